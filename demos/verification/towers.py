# %% [markdown]
# # Random towers of bodies
#
# Two to six blocks and quarters of cylinders of random steels stand on each other without friction,
# under a pressure on the highest body. The limit loads are not known. A loading path with
# prescribed work and the interior point method are independent: each brackets the limit load of the
# mesh, and the brackets must overlap.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/towers.py

# %%
import random
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.study import Collapse, Row, collapse, mesh, run
from meshes.tower import write_tower
from perfplast_fenicsx import Contact, Pressure, Problem, Support, TaggedMesh, VonMises, limit_load
from perfplast_fenicsx.io import ResultFolder, Scene
from perfplast_fenicsx.pictures import draw

TITLE = "Towers"
TOLERANCE = 1e-3
TOWERS, FEW = 20, 2
SUPPORTS = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")]
LOADS = [Pressure("top", 1.0)]


def drawn_steels(bodies: Sequence[str], number: int) -> dict[str, VonMises]:
    """Return a random steel for each body."""
    drawn = random.Random(number)
    ranges = ((70e3, 210e3), (0.2, 0.35), (200.0, 500.0))  # Young, Poisson, yield stress
    found = {}
    for body in bodies:
        young, poisson, strength = (drawn.uniform(*r) for r in ranges)
        found[body] = VonMises(young, poisson, strength)
    return found


def problem_of(tagged_mesh: TaggedMesh, number: int) -> Problem:
    """Return the problem of a tower of random steels; ζ is the pressure on top."""
    count = len(tagged_mesh.volumes)
    materials = drawn_steels([f"body_{i}" for i in range(count)], number)
    contacts = [Contact(f"body_{i}_seam_{i}", f"body_{i + 1}_seam_{i}") for i in range(count - 1)]
    return Problem(tagged_mesh, materials, SUPPORTS, LOADS, contacts, degree=2)


def both_ways(problem: Problem) -> tuple[Collapse, float]:
    """Return the limit load from a path, and the estimate by the interior point method. Collective.

    Raises:
        AssertionError: If a method gives no bracket, or the brackets do not overlap.
    """
    found = collapse(problem, TOLERANCE, "path")
    direct = limit_load(problem, TOLERANCE, method="interior-point")
    assert found.limit.levelled_off, found.limit.reason
    assert found.limit.upper is not None
    assert found.limit.lower <= found.limit.upper * (1 + TOLERANCE / 100)
    assert direct.levelled_off, direct.reason
    assert direct.upper is not None
    assert direct.estimate is not None
    assert found.limit.lower <= direct.upper * (1 + TOLERANCE / 10)
    assert direct.lower <= found.limit.upper * (1 + TOLERANCE / 10)
    return found, direct.estimate


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for the limit loads by both methods. Collective."""
    rows = []
    for number in range(FEW if coarse else TOWERS):
        problem = problem_of(mesh(folder, write_tower, number=number), number)
        found, estimate = both_ways(problem)
        rows.append(found.row(f"tower {number}", 0.4, estimate, TOLERANCE))
    found.write(folder, Scene(f"Tower {number}", LOADS, []))
    draw(folder)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
