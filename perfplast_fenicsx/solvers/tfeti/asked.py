"""Store the contact QP of one step for Total FETI, with its accuracy."""

from dataclasses import dataclass

from petsc4py import PETSc

from perfplast_fenicsx.arrays import Floats


@dataclass(frozen=True)
class Asked:
    """A contact QP.

    Attributes:
        r: Gradient at δ = 0, in the jump basis.
        f: The forces −r on torn unknowns.
        room: Room of each pair, shape (num_pairs,).
        work: ℓᵀδ in units of the border; None if it is not prescribed.
        accuracy: Allowed norm of unbalanced nodal forces.
        noise: Contact forces up to this size do not affect the active set.
        rtol: Relative tolerance.
    """

    r: PETSc.Vec
    f: Floats
    room: Floats
    work: float | None
    accuracy: float
    noise: float
    rtol: float
