"""Store aggregates of nodes on each level of multigrid, and the motions of each.

The columns of a tentative interpolation Q are orthonormal motions of one aggregate each, zero
elsewhere. PETSc's GAMG creates the aggregates for the stiffness in nodal unknowns, where bodies are
not coupled, with the rigid motions. One more motion may be added to all of them.
"""

from dataclasses import dataclass
from typing import Self

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.solvers.linear.petsc_options import COARSE, own_prefix

AGGREGATION = {
    "ksp_type": "preonly",
    "pc_type": "gamg",
    "pc_gamg_agg_nsmooths": 0,
    "pc_gamg_threshold": 0.01,
    "pc_gamg_aggressive_coarsening": 10,
    "pc_gamg_coarse_eq_limit": 1000,
    # no system is solved with it, and bodies that only contact holds have a singular K
    "mg_levels_ksp_type": "richardson",
    "mg_levels_pc_type": "none",
    "mg_coarse_ksp_type": "preonly",
    "mg_coarse_pc_type": "none",
}


@dataclass(frozen=True)
class Aggregates:
    """Aggregates of the nodes of one level, which are the nodes of the next level.

    Attributes:
        members: Global number of the aggregate of each owned node, or -1.
        count: Number of owned aggregates.
        motions: Motions of a node's aggregate in its unknowns, shape (nodes, unknowns per node,
            motions per aggregate).
    """

    members: Longs
    count: int
    motions: Floats

    @classmethod
    def of(cls, tentative: PETSc.Mat) -> Self:
        """Read the aggregates from a tentative interpolation of GAMG. Collective."""
        rows, columns = tentative.getBlockSizes()
        pointer, column, value = tentative.getValuesCSR()
        begin = pointer[:-1:rows]
        belongs = pointer[1 : len(pointer) : rows] > begin
        members = np.full(len(begin), -1)
        members[belongs] = column[begin[belongs]] // columns
        motions = np.zeros((len(begin), rows, columns))
        motions[belongs] = value.reshape(-1, rows, columns)
        return cls(members, tentative.getLocalSize()[1] // columns, motions)

    def interpolation(self, comm: PETSc.Comm) -> PETSc.Mat:
        """Return Q as a matrix. Collective."""
        nodes, rows, columns = self.motions.shape
        belongs = self.members >= 0
        pointer = np.zeros(nodes * rows + 1, dtype=PETSc.IntType)
        np.cumsum(np.repeat(belongs * columns, rows), out=pointer[1:])
        column = self.members[belongs, None, None] * columns + np.arange(columns)
        column = np.broadcast_to(column, (belongs.sum(), rows, columns))
        return PETSc.Mat().createAIJ(
            ((nodes * rows, None), (self.count * columns, None)),
            bsize=(rows, columns),
            csr=(pointer, column.astype(PETSc.IntType).ravel(), self.motions[belongs].ravel()),
            comm=comm,
        )

    def with_motion(self, motion: Floats, comm: PETSc.Comm) -> tuple["Aggregates", Floats]:
        """Add a motion to each aggregate. Collective.

        Args:
            motion: Motion of the whole body, shape (nodes, unknowns per node). A node may have one
                unknown more than ``motions`` has: that of the motion added on the finer level.
            comm: The problem's communicator.

        Returns:
            Aggregates with one more motion each, and the motion in the unknowns of the next level,
            shape (aggregates, motions per aggregate).
        """
        more = motion.shape[1] - self.motions.shape[1]
        motions = np.pad(self.motions, ((0, 0), (0, more), (0, 0)))
        Q = Aggregates(self.members, self.count, motions).interpolation(comm)
        known = _restrict(Q, motion)
        left = motion - _prolong(Q, known).reshape(motion.shape)
        Q.destroy()
        ones = Aggregates(self.members, self.count, np.ones((len(motion), 1, 1)))
        sums = ones.interpolation(comm)
        whole, size = (np.sqrt(_restrict(sums, (m**2).sum(axis=1))) for m in (motion, left))
        # Least relative difference from rigid motions at which a motion is added to an aggregate.
        rigid = 1e-8
        size[size <= rigid * whole] = 0.0
        inverse = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
        added = left * _prolong(sums, inverse)[:, None]
        sums.destroy()
        richer = np.concatenate([motions, added[..., None]], axis=2)
        projected = np.column_stack([known.reshape(self.count, motions.shape[2]), size])
        return Aggregates(self.members, self.count, richer), projected


def _restrict(Q: PETSc.Mat, fine: Floats) -> Floats:
    """Return Qᵀ times the owned part of a vector. Collective."""
    coarse, image = Q.createVecs()
    image.array[:] = fine.ravel()
    Q.multTranspose(image, coarse)
    product: Floats = coarse.array.copy()
    for thing in (coarse, image):
        thing.destroy()
    return product


def _prolong(Q: PETSc.Mat, coarse: Floats) -> Floats:
    """Return Q times the owned part of a vector. Collective."""
    unknowns, image = Q.createVecs()
    unknowns.array[:] = coarse
    Q.mult(unknowns, image)
    product: Floats = image.array.copy()
    for thing in (unknowns, image):
        thing.destroy()
    return product


def aggregate(nodes: Floats, stiffness: PETSc.Mat) -> list[Aggregates]:
    """Return aggregates of nodes, with rigid motions. Collective.

    Args:
        nodes: Coordinates of the owned nodes, shape (num_nodes, gdim).
        stiffness: K in nodal unknowns, in blocks; only its pattern and the strength of its entries
            matter.

    Returns:
        The aggregates of each level, finest first; an empty list for a small problem.
    """
    modes = _rigid_motions(nodes, stiffness)
    stiffness.setNearNullSpace(modes)
    modes.destroy()
    ksp = PETSc.KSP().create(stiffness.comm)
    prefix = own_prefix(ksp, COARSE, AGGREGATION)
    PETSc.Options()[prefix + "pc_gamg_agg_nsmooths"] = (
        0  # Q itself, whatever options the user gives
    )
    ksp.setOptionsPrefix(prefix)
    pc = ksp.getPC()
    try:
        ksp.setFromOptions()
        ksp.setOperators(stiffness)
        ksp.setUp()
        return [
            Aggregates.of(pc.getMGInterpolation(level))
            for level in reversed(range(1, pc.getMGLevels()))
        ]
    finally:
        stiffness.setNearNullSpace(PETSc.NullSpace())
        for thing in (
            pc,
            ksp,
        ):  # immediately: Python's garbage collection would wait for a collective clean-up
            thing.destroy()


def _rigid_motions(nodes: Floats, stiffness: PETSc.Mat) -> PETSc.NullSpace:
    """Return rigid motions of all bodies together."""
    x = stiffness.createVecRight()
    x.array[:] = nodes.ravel()
    modes = PETSc.NullSpace().createRigidBody(x)
    x.destroy()
    return modes
