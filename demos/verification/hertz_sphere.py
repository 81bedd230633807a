# %% [markdown]
# # Hertz: a ball pressed on a plane, on another ball, and into a block
#
# Elastic bodies that touch at a point transfer the load P through a disc of radius a, in which the
# pressure distribution is half an ellipsoid (H. Hertz, 1881; K. L. Johnson, Contact Mechanics,
# Cambridge 1985, chapter 4):
#
#     a³ = 3PR/(4E*),   p(r) = p₀ √(1 − r²/a²),   p₀ = 3P/(2πa²),
#
# where 1/R is the sum of the curvatures, and 1/E* the sum of (1 − ν²)/E, of both bodies; a rigid
# body contributes zero. In one case the ball is a rigid obstacle, against which a flat block is
# pressed.
#
# The second moment of the pressure field gives the radius: ∫p r² / ∫p = 2a²/5. Quadratic elements
# smear the pressure field over about half an element, so this radius is too large, by 1 % with
# seven elements over a. With linear elements the pressures at single vertices scatter by ±5 %, and
# the largest pressure is 2 to 3 % too large on every mesh.
#
# The demo does not check the approach a²/R of distant points in Hertz's theory, because the choice
# of distant points in a ball is arbitrary.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/hertz_sphere.py

# %%
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

import ufl
from dolfinx import default_scalar_type, fem

from demos.verification.hertz_line import (
    ALLOWED,
    ALUMINIUM,
    FINER,
    STEEL,
    Pressures,
    contact_modulus,
    draw_pressures,
    measure,
)
from demos.verification.study import Row, mesh, run
from meshes.hertz_sphere import RADIUS, write_hertz_sphere
from meshes.naming import name, name_planes
from meshes.shapes import add_box
from meshes.sizes import finer_at, generate
from perfplast_fenicsx import (
    Contact,
    Elastic,
    Newton,
    Plane,
    Pressure,
    Problem,
    Sphere,
    Support,
    TaggedMesh,
)
from perfplast_fenicsx.io import OutputFields, ResultFolder
from perfplast_fenicsx.mesh import gmsh_session, write_split

TITLE = "Hertz point contact"
CONTACT_RADIUS = 0.12

# %% [markdown]
# ## The block
#
# The mesh is a quarter of a block of half-width R and height R, with small elements where the ball
# touches the block.


# %%
def write_block(path: str | Path, contact_size: float, order: int = 1) -> None:
    """Mesh a quarter of a block below z = 0 and write a .msh file. Not collective.

    Args:
        path: The file to write.
        contact_size: Edge length near the origin.
        order: Degree of the geometry, 1 or 2.
    """
    with gmsh_session() as gmsh:
        _, block = add_box((0.0, 0.0, -RADIUS), (RADIUS,) * 3)
        gmsh.model.occ.synchronize()
        name(3, {"block": [block]})
        name_planes(2, {"x0": (0, 0.0), "y0": (1, 0.0), "face": (2, 0.0), "bottom": (2, -RADIUS)})
        law = finer_at((0.0, 0.0, 0.0), contact_size, 0.3 * RADIUS, flat=1.2 * CONTACT_RADIUS)
        generate(3, law, order)
        write_split(path)


# %% [markdown]
# ## The cases
#
# The load is chosen to make Hertz's contact radius 0.12 R. The load is a pressure on the plane
# through the middle of the ball, or on the bottom of the block. The model is a quarter of the
# bodies.


# %%
def ball_on_plane(folder: ResultFolder, degree: int, size: float) -> Problem:
    """Return a ball on a rigid plane. Collective."""
    tagged_mesh = mesh(folder, write_hertz_sphere, contact_size=size, order=degree)
    return Problem(
        tagged_mesh,
        {"upper": STEEL},
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("top", hertz_load(STEEL) / 4 / area(tagged_mesh, "top"))],
        obstacles=[Plane("upper_cap", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))],
        degree=degree,
    )


def balls_apart(folder: ResultFolder, degree: int, size: float) -> Problem:
    """Return a ball of steel on a ball of aluminium with a finer mesh. Collective."""
    return ball_on_ball(folder, degree, size, FINER)


def ball_on_ball(
    folder: ResultFolder, degree: int, size: float, finer: float | None = None
) -> Problem:
    """Return a ball of steel on a ball of aluminium. Collective."""
    shape = {"contact_size": size, "order": degree, "bodies": 2, "finer": finer}
    tagged_mesh = mesh(folder, write_hertz_sphere, **shape)
    return Problem(
        tagged_mesh,
        {"upper": STEEL, "lower": ALUMINIUM},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", hertz_load(STEEL, ALUMINIUM) / 4 / area(tagged_mesh, "top"))],
        [Contact("upper_cap", "lower_cap")],
        degree=degree,
    )


def rigid_ball(folder: ResultFolder, degree: int, size: float) -> Problem:
    """Return a block that is pressed against a rigid ball. Collective."""
    tagged_mesh = mesh(folder, write_block, contact_size=size, order=degree)
    return Problem(
        tagged_mesh,
        {"block": STEEL},
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("bottom", hertz_load(STEEL) / 4 / area(tagged_mesh, "bottom"))],
        obstacles=[Sphere("face", centre=(0.0, 0.0, RADIUS), radius=RADIUS)],
        degree=degree,
    )


def hertz_load(*bodies: Elastic) -> float:
    """Return the force for the given contact radius; ``bodies`` are the elastic bodies."""
    return 4 / 3 * CONTACT_RADIUS**3 * contact_modulus(*bodies) * len(bodies) / RADIUS


def area(tagged_mesh: TaggedMesh, surface: str) -> float:
    """Return the area of a surface of the mesh; it is smaller than on the sphere. Collective."""
    ds = ufl.Measure("ds", domain=tagged_mesh.mesh, subdomain_data=tagged_mesh.facet_tags)
    one = fem.Constant(tagged_mesh.mesh, default_scalar_type(1)) * ds(tagged_mesh.surfaces[surface])
    return float(tagged_mesh.mesh.comm.allreduce(fem.assemble_scalar(fem.form(one))))


@dataclass(frozen=True)
class Case:
    """A case with its meshes.

    Attributes:
        name: Name in the table.
        make: Function of folder, degree and edge length that returns the problem.
        surface: Surface on which the pressure is measured.
        bodies: The elastic materials.
        parts: Numbers of elements over the contact radius, by degree.
        coarse: Numbers of elements over the contact radius in a quick run, by degree.
    """

    name: str
    make: Callable[[ResultFolder, int, float], Problem]
    surface: str
    bodies: tuple[Elastic, ...]
    parts: dict[int, tuple[int, ...]]
    coarse: dict[int, tuple[int, ...]]


CASES = (
    Case(
        "ball on a plane",
        ball_on_plane,
        "upper_cap",
        (STEEL,),
        {1: (8, 16), 2: (5, 7)},
        {2: (5,)},
    ),
    Case(
        "ball on a ball",
        ball_on_ball,
        "upper_cap",
        (STEEL, ALUMINIUM),
        {1: (12,), 2: (5,)},
        {1: (8,)},
    ),
    Case(
        "ball on a ball, apart",
        balls_apart,
        "upper_cap",
        (STEEL, ALUMINIUM),
        {1: (10,), 2: (5,)},
        {},
    ),
    Case("rigid ball on a block", rigid_ball, "face", (STEEL,), {1: (12,), 2: (5, 7)}, {1: (8,)}),
)


def press(
    case: Case, folder: ResultFolder, degree: int, parts: int
) -> tuple[list[Row], Pressures, float]:
    """Return rows for one mesh, its pressures, and Hertz's largest pressure. Collective."""
    load = hertz_load(*case.bodies)
    peak = 3 * load / (2 * math.pi * CONTACT_RADIUS**2)
    size = CONTACT_RADIUS / parts
    problem = case.make(folder, degree, size)
    began = time.perf_counter()
    level = Newton(problem).solve(1.0)
    seconds = time.perf_counter() - began
    recovery = OutputFields(problem)
    found = measure(problem, recovery.update(level)["contact_pressure"], case.surface)
    rows = [
        Row(
            case=case.name,
            quantity=quantity,
            element=f"P{degree}",
            size=size,
            dofs=problem.num_dofs,
            computed=computed,
            exact=exact,
            allowed=allowed,
            solves=level.report.linear_solves,
            seconds=seconds,
        )
        for quantity, computed, exact, allowed in (
            ("contact radius", math.sqrt(2.5 * found.spread), CONTACT_RADIUS, ALLOWED),
            ("peak pressure", found.peak, peak, ALLOWED),
            ("contact force", abs(float(recovery.resultants[0, 2])), load / 4, 1e-8),
        )
    ]
    return rows, found, peak


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for contact radius, peak pressure and force of all cases. Collective."""
    table: list[Row] = []
    finest = {}
    for case in CASES:
        for degree, parts in (case.coarse if coarse else case.parts).items():
            for number in parts:
                rows, found, peak = press(case, folder, degree, number)
                table += rows
            finest[f"{case.name}, P{degree}"] = found, peak
    draw_pressures(folder, finest, CONTACT_RADIUS, TITLE)
    return table


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
