# %% [markdown]
# # Curved seams in 3D: mortar contact compared with matching nodes
#
# On quadratic elements, a row of mortar contact is a Bernstein coefficient, not a value at a node.
# Curved surfaces therefore need care: when each row used only the normal at its node, the pressure
# was 1 % too small with five quadratic facets along a quarter of a circle. Three problems with
# closed forms show whether mortar contact is as accurate as contact of matching nodes on the same
# meshes. They also show the accuracy of mortar contact if the outer body has a separate mesh with
# 1.5 times as many edges:
#
# - A shrink fit: the radius of a sphere is larger by δ than the hole of the shell around the sphere
#   (Lamé's solution).
# - A ball in a socket, and a pin in a hole. Ball and pin fill their holes and slip without
#   friction. The pressure on the outer surface is p₀ + p₂ P₂(cos θ) for the ball, and p₀ + p₂ cos
#   2θ in plane strain for the pin.
#
# Displacements are sums of solutions U(r) P(θ), V(r) P'(θ) of Navier's equations, where U and V are
# powers of r (A. I. Lurie, Three-dimensional Problems of the Theory of Elasticity, 1964; J. H.
# Michell 1899). Their coefficients follow from zero shear on the seam and on the outer surface, the
# given pressure on the outer surface, and equal normal displacements and pressures on both sides of
# the seam.
#
# The error is the root mean square error of the pressure over the seam, divided by the root mean
# square of the pressure. The pressure field is linear between vertices. The table also contains the
# error of the force along z through an eighth of the seam, or along x through a quarter.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/curved_seams.py

# %%
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from demos.verification.study import Row, mesh, run
from meshes.ball_in_socket import OUTER, RADIUS, write_ball_in_socket
from meshes.shaft import write_shaft
from meshes.thick_sphere import write_thick_sphere
from perfplast_fenicsx import Contact, Elastic, Newton, Pressure, Problem, Support
from perfplast_fenicsx.io import OutputFields, ResultFolder, ResultWriter, Scene
from perfplast_fenicsx.pictures import draw
from perfplast_fenicsx.problem import Prescribed

Floats = npt.NDArray[np.float64]

TITLE = "Curved seams in 3D"
STEEL = Elastic(young=2e5, poisson=0.3)
EVEN, UNEVEN = 100.0, 40.0
"""p₀ and p₂; with these values the seam stays closed."""
OVERLAP, SEAM, HOLE, SHELL = 1e-3, 1.4, 1.0, 2.0
"""δ, and the radii of the shrink fit: seam, inner hole and outer surface."""
FINER = 1.5
"""Ratio of the numbers of edges of outer and inner body at the seam of separate meshes."""
LENGTH = 0.5
"""Length of the pin."""
WORSE = 1.5
"""Largest ratio of the errors with mortar contact and with matching nodes."""
SLOWER = 0.3
"""Largest loss of order with mortar contact compared with matching nodes, over all meshes of a
case."""

# %% [markdown]
# ## Closed forms


# %%
def second_mode(sphere: bool) -> float:
    """Return the pressure at the seam for p₂ = 1 on the outer surface.

    For the powers r^k, U = a r^k and V = b r^k, where a and b satisfy Navier's equations.
    """
    shear = STEEL.young / (2 * (1 + STEEL.poisson))
    lame = 2 * shear * STEEL.poisson / (1 - 2 * STEEL.poisson)
    whole = lame + 2 * shear
    rows = []
    for k in (3, 1, -2, -4) if sphere else (3, 1, -1, -3):
        if sphere:  # volume change E and rotation W: coefficients of a and b
            growth, turn = np.array([k + 2.0, -6.0]), np.array([-1.0, k + 1.0]) / 2
            radial = whole * (k - 1) * growth + 12 * shear * turn
            along = whole * growth + 2 * shear * k * turn
            shears = shear * np.array([1.0, k - 1.0])
        else:
            growth, turn = np.array([k + 1.0, 2.0]), np.array([2.0, k + 1.0]) / 2
            radial = whole * (k - 1) * growth - 4 * shear * turn
            along = -2 * whole * growth + 2 * shear * (k - 1) * turn
            shears = shear * np.array([-2.0, k - 1.0])
        mode = np.linalg.svd([radial, along])[2][-1]
        stress = lame * growth + 2 * shear * np.array([k, 0.0])
        rows.append((k, mode[0], stress @ mode, shears @ mode))
    k, U, stress, sheared = np.array(rows).T
    inside = k > 0  # powers that are finite at the centre

    def at(r: float, values: Floats, less: int, inner: float, outer: float) -> Floats:
        terms = values * r ** (k - less)
        return np.concatenate([inner * terms[inside], outer * terms])

    conditions = [
        at(RADIUS, sheared, 1, 1, 0),
        at(RADIUS, sheared, 1, 0, 1),
        at(RADIUS, U, 0, 1, -1),
        at(RADIUS, stress, 1, 1, -1),
        at(OUTER, sheared, 1, 0, 1),
        at(OUTER, stress, 1, 0, 1),
    ]
    factors = np.linalg.solve(conditions, [0.0, 0.0, 0.0, 0.0, 0.0, -1.0])
    return float(-at(RADIUS, stress, 1, 1, 0) @ factors)


def shrink_fit_pressure() -> float:
    """Return the pressure of the shrink fit: δ divided by the gap that unit pressure opens."""
    nu = STEEL.poisson

    def give(radius: float) -> float:
        moved = (1 - 2 * nu) * SEAM**3 + (1 + nu) * radius**3 / 2
        return SEAM / STEEL.young * moved / (SEAM**3 - radius**3)

    return OVERLAP / (give(HOLE) - give(SHELL))


# %% [markdown]
# ## Cases


# %%
@dataclass(frozen=True)
class Case:
    """A case with its closed form: the pressure at the seam is p₀ + p₂ · mode.

    Attributes:
        name: Name in the table.
        bodies: Inner and outer body; the surface of each body at the seam is ``BODY_seam``.
        write: Function that writes the mesh.
        shape: Arguments of ``write``, except the edge length and the ratio of edges.
        load: Load on the bodies.
        fit: Arguments of the contact between the bodies.
        planes: Planes of symmetry, or surfaces held along their normal.
        sizes: Edge lengths of the meshes.
        pressures: p₀ and p₂.
        mode: Formula in x, y, z.
        forces: Resultants of unit pressure, and of the mode as a pressure, on the seam.
        axis: Axis along which ``forces`` are given.
    """

    name: str
    bodies: tuple[str, str]
    write: Callable[..., None]
    shape: Mapping[str, object]
    load: Pressure
    fit: Mapping[str, Any]
    planes: Mapping[str, str]
    sizes: tuple[float, ...]
    pressures: tuple[float, float]
    mode: Callable[[Any], Any]
    forces: tuple[float, float]
    axis: int


def legendre(x: Any) -> Any:
    """Return P₂(cos θ), with the angle θ from the z axis."""
    return 1.5 * x[2] ** 2 / (x[0] ** 2 + x[1] ** 2 + x[2] ** 2) - 0.5


def twice(x: Any) -> Any:
    """Return cos 2θ, with the angle θ about the z axis."""
    return (x[0] ** 2 - x[1] ** 2) / (x[0] ** 2 + x[1] ** 2)


OCTANT = {"x0": "x", "y0": "y", "z0": "z"}
CASES = (
    Case(
        "shrink fit of shells",
        ("inner_shell", "outer_shell"),
        write_thick_sphere,
        {"interface": SEAM},
        Pressure("inner", 1.0),  # at ζ = 0
        {"gap": -OVERLAP, "interference": True},
        OCTANT,
        (0.5, 0.35, 0.25, 0.18),
        (shrink_fit_pressure(), 0.0),
        legendre,
        (math.pi / 4 * SEAM**2, 0.0),
        2,
    ),
    Case(
        "ball in a socket",
        ("ball", "socket"),
        write_ball_in_socket,
        {},
        Pressure("outer", f"{EVEN} + {UNEVEN}*(1.5*z**2/(x**2 + y**2 + z**2) - 0.5)"),
        {"gap": 0.0},
        OCTANT,
        (0.5, 0.35, 0.25, 0.18),
        (EVEN, UNEVEN * second_mode(sphere=True)),
        legendre,
        (math.pi / 4, math.pi / 16),
        2,
    ),
    Case(
        "pin in a hole",
        ("shaft", "hub"),
        write_shaft,
        {"hub": OUTER, "length": LENGTH},
        Pressure("outer", f"{EVEN} + {UNEVEN}*(x**2 - y**2)/(x**2 + y**2)"),
        {"gap": 0.0},
        OCTANT | {"z1": "z"},
        (0.5, 0.35, 0.25, 0.18),
        (EVEN, UNEVEN * second_mode(sphere=False)),
        twice,
        (LENGTH, LENGTH / 3),
        0,
    ),
)
"""All cases; seams have the radius 1, except those of the shells."""


# %%
def press(folder: ResultFolder, case: Case, size: float, kind: str) -> list[Row]:
    """Return the error of the pressure, and the force across the seam. Collective.

    Args:
        folder: Folder of the mesh.
        case: The case.
        size: Edge length.
        kind: "nodes", "mortar", or "apart" for mortar on separate meshes.
    """
    began = time.perf_counter()
    finer = FINER if kind == "apart" else None
    tagged_mesh = mesh(folder, case.write, size=size, order=2, finer=finer, **case.shape)
    inner, outer = (f"{body}_seam" for body in case.bodies)
    contact = Contact(
        inner, outer, formulation="nodes" if kind == "nodes" else "mortar", **case.fit
    )
    problem = Problem(
        tagged_mesh,
        dict.fromkeys(tagged_mesh.volumes, STEEL),
        [Support(plane, axis) for plane, axis in case.planes.items()],
        [case.load],
        [contact],
        degree=2,
    )
    level = Newton(problem).solve(0.0 if "interference" in case.fit else 1.0)
    if kind == "mortar":  # the last mesh is drawn
        scene = Scene(TITLE, [case.load], [contact])
        by = Prescribed.LOAD_FACTOR
        ResultWriter(folder, problem, scene, "newton", prescribed=by).write(level)
    fields = OutputFields(problem)
    pressure = fields.update(level)["contact_pressure"]
    x = ufl.SpatialCoordinate(tagged_mesh.mesh)
    exact = case.pressures[0] + case.pressures[1] * case.mode(x)
    ds = ufl.Measure("ds", domain=tagged_mesh.mesh, subdomain_data=tagged_mesh.facet_tags)
    on_seam = ds(tagged_mesh.surfaces[inner])

    def over_seam(integrand: Any) -> float:
        part = fem.assemble_scalar(fem.form(integrand * on_seam))
        return float(tagged_mesh.mesh.comm.allreduce(part))

    missed = math.sqrt(over_seam((pressure - exact) ** 2) / over_seam(exact**2))
    numbers = (
        ("error of the pressure", missed, 0.0),
        ("force across", abs(float(fields.resultants[0, case.axis])), force_of(case)),
    )
    return [
        Row(
            case=case.name,
            quantity=quantity,
            element=f"P2, {kind}",
            size=size,
            dofs=problem.num_dofs,
            computed=computed if level.report.converged else math.nan,
            exact=should,
            allowed=None,
            solves=level.report.linear_solves,
            seconds=time.perf_counter() - began,
        )
        for quantity, computed, should in numbers
    ]


def force_of(case: Case) -> float:
    """Return the resultant of the closed form."""
    return sum(p * force for p, force in zip(case.pressures, case.forces, strict=True))


# %% [markdown]
# ## Comparison
#
# On each mesh, the ratio of the errors must not exceed a limit. Over all meshes of a case, the
# order of convergence with mortar contact must not be much lower than the order with matching
# nodes.


# %%
def judged(nodes: Sequence[Row], mortar: Sequence[Row]) -> list[Row]:
    """Return ratios of errors of each quantity on each mesh, and differences between orders."""
    rows = [
        replace(
            row,
            quantity=f"{row.quantity}, / nodes",
            computed=abs(row.error / other.error),
            exact=WORSE,
            bound=True,
            allowed=0.0,
        )
        for other, row in zip(nodes, mortar, strict=True)
    ]
    orders = [order(nodes), order(mortar)]
    last = replace(
        rows[-1],
        quantity=f"{mortar[0].quantity}, order",
        computed=orders[0] - orders[1],
        exact=SLOWER,
    )
    return [*rows, last] if len(rows) > 2 else rows


def order(rows: Sequence[Row]) -> float:
    """Return the order of convergence in h, fitted to the errors on all meshes."""
    sizes, errors = np.log([(row.size, abs(row.error)) for row in rows]).T
    return float(np.polyfit(sizes, errors, 1)[0])


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return errors of all cases with matching nodes and with mortar contact. Collective."""
    table: list[Row] = []
    for case in CASES:
        sizes = case.sizes[:2] if coarse else case.sizes
        found = {
            kind: [press(folder, case, size, kind) for size in sizes]
            for kind in ("nodes", "mortar", "apart")
        }
        for rows in found.values():
            table += [row for column in zip(*rows, strict=True) for row in column]
        for kind in ("mortar", "apart"):
            columns = (zip(*found[one], strict=True) for one in ("nodes", kind))
            for nodes, mortar in zip(*columns, strict=True):
                table += judged(nodes, mortar)
    draw(folder)
    return table


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
