# %% [markdown]
# # Press fits in plane strain
#
# The radius of a shaft or tube is larger by δ than the hole of the surrounding hub. The bodies
# press on each other without friction and remain elastic. By Lamé's solution the pressure is
#
#     p = δ / (c (f + g)),   f = ((c² + a²)/(c² − a²) − ν/(1 − ν)) / E',
#                            g = ((b² + c²)/(b² − c²) + ν/(1 − ν)) / E',   E' = E/(1 − ν²)
#
# where the inner body occupies a ≤ r ≤ c (a = 0 for a shaft) and the outer body c ≤ r ≤ b (S. P.
# Timoshenko, J. N. Goodier, Theory of Elasticity, 3rd ed., 1970, section 28). The pressure equals
# the contact force along an axis on a quarter of the seam, divided by c. Displacements are
# quadratic on second-order geometry; the gap is −ζδ.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/press_fit.py

# %%
import time
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.slip import subfolder
from demos.verification.study import Row, mesh, run, show
from meshes.shaft import write_shaft
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import Contact, Elastic, Newton, Problem, Support, TaggedMesh
from perfplast_fenicsx.io import ResultFolder, Scene

TITLE = "Press fits, plane strain"
ALLOWED = 2e-3


# %%
def lame(steel: Elastic, a: float, c: float, b: float, delta: float) -> float:
    """Return the pressure by the formula above."""
    nu = steel.poisson / (1 - steel.poisson)
    inside = (c**2 + a**2) / (c**2 - a**2) - nu
    outside = (b**2 + c**2) / (b**2 - c**2) + nu
    return delta * steel.young / (1 - steel.poisson**2) / (c * (inside + outside))


def row_of(
    folder: ResultFolder | None,
    case: str,
    tagged_mesh: TaggedMesh,
    steel: Elastic,
    size: float,
    radii: Sequence[float],
    share: float = 1.0,
) -> Row:
    """Return a row for the pressure, measured by the contact force. Collective.

    Args:
        folder: Folder for pictures; None to draw no pictures.
        case: Name of the case.
        tagged_mesh: Mesh with the seams of two bodies.
        steel: Material of both bodies.
        size: Edge length.
        radii: a, c, b and the interference δ.
        share: Load factor ζ, the fraction of δ that is applied.
    """
    began = time.perf_counter()
    inner, outer = sorted(
        (name for name in tagged_mesh.surfaces if name.endswith("_seam")),
        key=lambda name: name.startswith(("hub", "outer")),
    )
    contacts = [Contact(outer, inner, gap=-radii[3], interference=True, constant=False)]
    problem = Problem(
        tagged_mesh,
        dict.fromkeys(tagged_mesh.volumes, steel),
        [Support("x0", "x"), Support("y0", "y")],
        contacts=contacts,
        degree=2,
    )
    level = Newton(problem).solve(share)
    report, seconds = level.report, time.perf_counter() - began
    if folder is not None:
        show(folder, problem, Scene(TITLE, contacts=contacts), [level])
    force = abs(report.reactions[f"contact {outer} {inner}"][0])
    return Row(
        case=case,
        quantity="pressure",
        element="P2, curved",
        size=size,
        dofs=problem.num_dofs,
        computed=force / radii[1],
        exact=share * lame(steel, *radii),
        allowed=ALLOWED,
        solves=report.linear_solves,
        seconds=seconds,
    )


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for two fits with the pressures 84.7118 and 46.514332 by the formula.

    Collective.
    """
    sizes = (0.4, 0.2) if coarse else (0.4, 0.2, 0.1)
    rows, steel = [], Elastic(young=206900.0, poisson=0.29)
    for size in sizes:
        shaft = mesh(folder, write_shaft, hub=2.0, size=size)
        pictures = subfolder(folder, "shaft") if size == sizes[-1] else None
        radii = (0.0, 1.0, 2.0, 1e-3)
        rows.append(row_of(pictures, "shaft in a hub", shaft, steel, size, radii))
    steel = Elastic(young=2e5, poisson=0.3)
    for size in sizes:
        tubes = mesh(folder, write_thick_tube, outer=2.5, interface=1.5, size=size / 2, order=2)
        pictures = subfolder(folder, "tubes") if size == sizes[-1] and not coarse else None
        radii = (1.0, 1.5, 2.5, 1.5e-3)
        if size == sizes[0]:
            rows.append(row_of(None, "tube on a tube, half of δ", tubes, steel, size, radii, 0.5))
        rows.append(row_of(pictures, "tube on a tube", tubes, steel, size, radii))
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
