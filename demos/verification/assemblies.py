# %% [markdown]
# # Randomly generated assemblies
#
# One to three blocks stand in a row against a wall, and a lid lies on top. Most blocks contain a
# round pin. So there are two to six bodies of randomly chosen steels, which touch without friction.
# Pressures act on the last block and on the lid. Forces in either direction pull the pins, which
# then lift off from their bores on one side. The limit loads are not known. A loading path with
# prescribed work and the interior point method are independent: each brackets the limit load of the
# mesh, and the brackets must overlap.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/assemblies.py

# %%
import random
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.study import Row, mesh, run
from demos.verification.towers import TOLERANCE, both_ways, drawn_steels
from meshes.assembly import write_assembly
from meshes.joints import sides
from perfplast_fenicsx import BodyForce, Contact, Pressure, Problem, Support, TaggedMesh
from perfplast_fenicsx.io import ResultFolder, Scene
from perfplast_fenicsx.pictures import draw
from perfplast_fenicsx.problem import Load

TITLE = "Assemblies"
ASSEMBLIES, FEW = range(20), (5,)
SUPPORTS = [Support("x0", "x"), Support("y0", "y"), Support("z0", "z")]


def loads_of(tagged_mesh: TaggedMesh, number: int) -> list[Load]:
    """Return random loads on an assembly."""
    drawn = random.Random(number)
    loads: list[Load] = [Pressure("end", 1.0)]
    if "top" in tagged_mesh.surfaces:
        loads.append(Pressure("top", drawn.uniform(0.0, 1.0)))
    pins = [body for body in sorted(tagged_mesh.volumes) if body.startswith("pin")]
    return loads + [BodyForce(pin, (drawn.uniform(-5.0, 5.0), 0.0, 0.0)) for pin in pins]


def problem_of(tagged_mesh: TaggedMesh, number: int) -> Problem:
    """Return the problem of an assembly of random steels; ζ is the pressure on the last block."""
    materials = drawn_steels(sorted(tagged_mesh.volumes), number)
    loads = loads_of(tagged_mesh, number)
    contacts = [Contact(*pair) for pair in sides(tagged_mesh.surfaces)]
    return Problem(tagged_mesh, materials, SUPPORTS, loads, contacts, degree=2)


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return rows for the limit loads by both methods. Collective."""
    rows = []
    for number in FEW if coarse else ASSEMBLIES:
        problem = problem_of(mesh(folder, write_assembly, number=number), number)
        found, estimate = both_ways(problem)
        rows.append(found.row(f"assembly {number}", 0.45, estimate, TOLERANCE))
    found.write(folder, Scene(f"Assembly {number}", loads_of(problem.tagged_mesh, number), []))
    draw(folder)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
