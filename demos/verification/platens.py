# %% [markdown]
# # A block between platens, in plane strain
#
# A block is compressed along y and free to expand along x. Between smooth platens the stress in the
# block is uniform. The block collapses at the pressure 2k, k = σ_y/√3, for any width and height.
# Any mesh represents uniform stress and strain exactly, so the only error is the tolerance of the
# limit search.
#
# Here the lower platen is a rigid plane, an obstacle on which the block stands. Nothing else
# supports the block along y. In the first case, a uniform pressure on the block replaces the upper
# platen. In the second case, the upper platen is an elastic body that is ten times as stiff as the
# block, and the pressure acts on the platen. So in the second case only two contacts support the
# block.
#
# Rough platens hold the faces of the block. The limit pressure then depends on the ratio of width
# to height; for a ratio of 2 it is 2.4277 k. The rough platen is a body that is a thousand times as
# stiff as the block and glued to it; the mesh is a quarter of both. A slip line runs from the
# middle of the block to its corner, where elements are ten times smaller. Linear triangles lock
# completely in this case: the loading curve has no plateau, so the demo omits linear triangles.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/platens.py

# %%
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mpi4py import MPI

from demos.verification.slip import draw_slip, subfolder
from demos.verification.study import Row, collapse, mesh, run
from meshes.contact_patch import write_contact_patch
from meshes.platens import write_platens
from perfplast_fenicsx import Contact, Elastic, Plane, Pressure, Problem, Support, VonMises
from perfplast_fenicsx.contact import Obstacle
from perfplast_fenicsx.io import ResultFolder, Scene
from perfplast_fenicsx.materials import Material
from perfplast_fenicsx.pictures import draw

TITLE = "Block between platens, plane strain"
BLOCK = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
K = BLOCK.yield_stress / math.sqrt(3)
LOADS = [Pressure("top", 1.0)]


def elastic(stiffness: float) -> Elastic:
    """Return a material ``stiffness`` times as stiff as the block."""
    return Elastic(stiffness * BLOCK.young, BLOCK.poisson)


# %% [markdown]
# ## The three problems


# %%
@dataclass(frozen=True)
class Case:
    """One of the three problems, without its mesh.

    Attributes:
        name: Name in the table.
        write: Function that writes the mesh.
        arguments: Arguments of ``write``.
        materials: Materials of the volumes.
        exact: Limit load.
        supports, contacts, obstacles: Supports, contacts and obstacles of the problem.
    """

    name: str
    write: Callable[..., None]
    arguments: dict[str, object]
    materials: dict[str, Material]
    exact: float
    supports: Sequence[Support] = (Support("x0", "x"),)
    contacts: Sequence[Contact] = ()
    obstacles: Sequence[Obstacle] = ()

    def problem(self, folder: ResultFolder, size: float, degree: int) -> Problem:
        """Return the problem on a mesh. Collective."""
        tagged_mesh = mesh(folder, self.write, size=size, **self.arguments)
        held = (self.supports, LOADS, self.contacts, self.obstacles)
        return Problem(tagged_mesh, self.materials, *held, degree=degree)


ON_PLANE = Case(
    name="smooth, on a plane",
    write=write_platens,
    arguments={},
    materials={"block": BLOCK},
    exact=2 * K,
    obstacles=[Plane("y0", point=(0.0, 0.0), normal=(0.0, 1.0))],
)
BETWEEN = Case(
    name="smooth, plane and body",
    write=write_contact_patch,
    arguments={"dim": 2},
    materials={"lower": BLOCK, "upper": elastic(10.0)},
    exact=2 * K,
    contacts=[Contact("lower_seam", "upper_seam")],
    obstacles=[Plane("bottom", point=(0.0, 0.0), normal=(0.0, 1.0))],
)
ROUGH = Case(
    name="rough, width/height 2",
    write=write_platens,
    arguments={"platen": True},
    materials={"block": BLOCK, "platen": elastic(1000.0)},
    exact=2.4277 * K,
    supports=[Support("x0", "x"), Support("y0", "y")],
)


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return limit loads between smooth and rough platens. Collective."""
    fine = (0.1, 0.05) if coarse else (0.1, 0.05, 0.025)
    rows = []
    for case, sizes, degree, allowed in (
        (ON_PLANE, (0.2, 0.1), 1, 1e-3),
        (ON_PLANE, (0.2, 0.1), 2, 1e-3),
        (BETWEEN, (0.2, 0.1), 1, 1e-3),
        (BETWEEN, (0.2, 0.1), 2, 1e-3),
        (ROUGH, fine, 2, 0.02),
    ):
        for size in sizes:
            problem = case.problem(folder, size, degree)
            found = collapse(problem)
            rows.append(found.row(case.name, size, case.exact, allowed))
        if case is ROUGH or (case is BETWEEN and degree == 2 and not coarse):
            pictures = subfolder(folder, "rough" if case is ROUGH else "smooth")
            title = f"Platens: {case.name}"
            found.write(pictures, Scene(title, LOADS, case.contacts, case.obstacles))
            draw(pictures)
            if case is ROUGH:
                draw_slip(pictures, title)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
