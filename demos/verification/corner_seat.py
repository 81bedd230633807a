# %% [markdown]
# # A block in an L-shaped seat
#
# A unit block lies in a corner, on one face of the seat and against another face. The pressure p on
# its top and q on its side push it towards both faces. Nothing else holds the block. Contact is
# without friction, so each face of the seat must carry exactly the load that acts normal to it, for
# any mesh and any pressure distribution. Nodes in the corner belong to both faces and have two
# normals.
#
# The seat is elastic, or consists of two rigid planes. In the rigid seat the stress of the block is
# uniform, σ_x = −q, σ_y = −p, and the work of the loads is known. In plane strain it is
#
#     α = (1 + ν)/E [(1 − ν)(p² + q²) − 2ν pq],
#
# and in 3D, where the block is free to expand along z, it is α = (p² + q² − 2ν pq)/E.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/corner_seat.py

# %%
import time
from collections.abc import Sequence

from mpi4py import MPI

import numpy as np
from dolfinx import fem, la

from demos.verification.study import Row, mesh, run
from meshes.corner_seat import write_corner_seat
from perfplast_fenicsx import (
    Contact,
    Level,
    Newton,
    Plane,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    VonMises,
)
from perfplast_fenicsx.io import OutputFields, ResultFolder, ResultWriter, Scene
from perfplast_fenicsx.pictures import draw
from perfplast_fenicsx.problem import Prescribed

TITLE = "Block in a corner"
STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
P, Q = 200.0, 120.0
LOADS = [Pressure("top", P), Pressure("right", Q)]
CONTACTS = [Contact("block_corner", "seat_corner")]
ALLOWED = 1e-9


# %% [markdown]
# ## The two seats
#
# If rigid planes hold the block, the seat in the mesh is clamped and has no function. The obstacle
# for each plane is declared on the whole surface with both faces, so nodes on one face are
# candidates for contact with the other plane, at a distance.


# %%
def in_elastic_seat(tagged_mesh: TaggedMesh, degree: int) -> Problem:
    """Return the block in the elastic seat. Collective."""
    supports = [Support("seat_bottom", "y"), Support("seat_left", "x"), *along_z(tagged_mesh)]
    materials = {"block": STEEL, "seat": STEEL}
    return Problem(tagged_mesh, materials, supports, LOADS, CONTACTS, degree=degree)


def in_rigid_seat(tagged_mesh: TaggedMesh, degree: int) -> Problem:
    """Return the block between two rigid planes. Collective."""
    zero = [0.0] * (tagged_mesh.mesh.geometry.dim - 2)
    planes = [
        Plane("block_corner", point=(0.0, 0.0, *zero), normal=(1.0, 0.0, *zero)),
        Plane("block_corner", point=(0.0, 0.0, *zero), normal=(0.0, 1.0, *zero)),
    ]
    supports = [Support("seat_bottom"), Support("seat_left"), *along_z(tagged_mesh)]
    materials = {"block": STEEL, "seat": STEEL}
    return Problem(tagged_mesh, materials, supports, LOADS, obstacles=planes, degree=degree)


def along_z(tagged_mesh: TaggedMesh) -> list[Support]:
    """Return the supports of both bodies along z."""
    return [Support("z0", "z")] if tagged_mesh.mesh.geometry.dim == 3 else []


def exact_work(dim: int) -> float:
    """Return α of the block between rigid planes."""
    E, nu = STEEL.young, STEEL.poisson
    if dim == 3:
        return (P**2 + Q**2 - 2 * nu * P * Q) / E
    return (1 + nu) / E * ((1 - nu) * (P**2 + Q**2) - 2 * nu * P * Q)


# %% [markdown]
# ## What is checked
#
# The demo checks the forces of the faces on the block, the reactions of the seat's supports, and
# the equilibrium of all forces. `OutputFields.resultants` returns the contact forces times the
# normals, summed over each contact. The faces are parallel to the axes, so the components of these
# sums are the forces of the faces.


# %%
def reaction(problem: Problem, level: Level, surface: str, axis: int) -> float:
    """Return the force of the supports on a surface along an axis. Collective."""
    V = problem.V
    force = fem.assemble_vector(fem.form(problem.internal_form(level.stress)))
    force.scatter_reverse(la.InsertMode.add)
    facets = problem.tagged_mesh.facets(surface)
    nodes = fem.locate_dofs_topological(V, problem.tagged_mesh.mesh.topology.dim - 1, facets)
    nodes = nodes[nodes < V.dofmap.index_map.size_local]
    values = force.array.reshape(-1, V.dofmap.index_map_bs)[nodes, axis]
    return float(problem.comm.allreduce(values.sum()))


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return forces, reactions and work for both seats, in 2D and in 3D. Collective."""
    rows = []
    for dim, size in ((2, 0.2 if coarse else 0.05), (3, 0.4 if coarse else 0.25)):
        tagged_mesh = mesh(folder, write_corner_seat, dim=dim, size=size)
        for rigid in (False, True):
            for degree in (1, 2):
                problem = (in_rigid_seat if rigid else in_elastic_seat)(tagged_mesh, degree)
                began = time.perf_counter()
                level = Newton(problem).solve(1.0)
                seconds = time.perf_counter() - began
                report = level.report
                recovery = OutputFields(problem)
                recovery.update(level)
                side, below = recovery.resultants.sum(axis=0)[:2]
                numbers = [("force from below", below, P), ("force from the side", side, Q)]
                if rigid:
                    ((_, y, *_), (x, *_)) = recovery.resultants
                    across = float(np.hypot(x, y)) / P
                    numbers += [
                        ("force across", across, 0.0),
                        ("work α", report.alpha, exact_work(dim)),
                    ]
                else:
                    numbers += [
                        ("reaction below", reaction(problem, level, "seat_bottom", 1), P),
                        ("reaction at the side", reaction(problem, level, "seat_left", 0), Q),
                    ]
                numbers.append(("unbalanced forces", report.equilibrium, 0.0))
                rows += [
                    Row(
                        case=f"{'rigid' if rigid else 'elastic'} seat, {dim}D",
                        quantity=quantity,
                        element=f"P{degree}",
                        size=size,
                        dofs=problem.num_dofs,
                        computed=float(computed),
                        exact=exact,
                        allowed=ALLOWED,
                        solves=report.linear_solves,
                        seconds=seconds,
                    )
                    for quantity, computed, exact in numbers
                ]
                if not rigid and dim == degree == 2:
                    scene = Scene(TITLE, LOADS, CONTACTS)
                    writer = ResultWriter(
                        folder, problem, scene, "newton", prescribed=Prescribed.LOAD_FACTOR
                    )
                    writer.write(level)
                    draw(folder)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
