"""How good is a state? Duality gap, equilibrium, penetration, contact forces, complementarity."""

import math
from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.problem.energy_norms import RIGID
from perfplast_fenicsx.problem.integrals import assemble_force
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.quadrature_fields import QuadratureFields
from perfplast_fenicsx.problem.resultants import Resultants, resultants

SMALLEST = 1e-300
"""What nothing is divided by less of."""


@dataclass(frozen=True)
class Certificate:
    """The optimality conditions of (P)_ζ at a state; see :class:`report.LevelReport` for meanings.

    ``forces`` are the contact forces of the pairs hosted by this rank, shape (num_pairs,), positive
    where the bodies push each other.
    """

    forces: Floats
    max_penetration: float
    smallest_contact_force: float
    complementarity: float
    equilibrium: float
    duality_gap: float
    resultants: Resultants


def certify(problem: Problem, fields: QuadratureFields, zeta: float) -> Certificate:
    """Judge the state that ``fields`` is at. Collective.

    The dual functional is S(σ) + ⟨σ, e₀⟩ + Σ force × gap − ⟨reactions, u_D⟩, and inf J_ζ is minus
    that at the solution, so the sum of both is the duality gap. It vanishes for the solution alone,
    and is told relative to Ψ + S, the sum of what is never negative in both. Gaps are those of the
    basis, which what u_D closes is taken from.
    """
    comm, basis = problem.comm, problem.basis
    internal = fields.assemble_all_forces()
    residual = internal.copy()
    fem_petsc.set_bc(residual, problem.bcs)
    problem.loads.subtract_from(residual, zeta)
    r = residual.duplicate()
    basis.T.multTranspose(residual, r)
    y = r.duplicate()
    basis.M.mult(fields.u.x.petsc_vec, y)

    forces = -r.array_r[basis.index]
    room = basis.gap - y.array_r[basis.index]
    slack = comm.allreduce(float(np.dot(forces, room)))
    resisted = comm.allreduce(float(np.dot(forces, basis.gap)))
    potential, conjugate = fields.potential(), fields.conjugate()
    energy = potential - problem.loads.work(fields.u.x.petsc_vec, zeta)
    moved = _moved(problem, internal)
    dual = conjugate + fields.initial_work() + resisted - moved.work
    least = RIGID**2 * fields.jagged_norm2()
    rigid = potential + conjugate <= least
    scale = max(potential + conjugate, least, SMALLEST)
    free = r.copy()
    free.array[basis.index] = 0
    least_force = RIGID * fields.gross_force() if rigid else 0.0
    pushing = math.sqrt(comm.allreduce(float(forces @ forces)))
    norm = max(problem.loads.norm(zeta), moved.norm, pushing, least_force, SMALLEST)
    certificate = Certificate(
        forces,
        max_penetration=comm.allreduce(max(0.0, float((-room).max(initial=0))), MPI.MAX),
        smallest_contact_force=_smallest(comm, forces),
        complementarity=slack / scale,
        equilibrium=free.norm(PETSc.NormType.NORM_2) / norm,
        duality_gap=(energy + dual) / scale,
        resultants=resultants(problem, internal, forces, zeta, least_force),
    )
    for vector in (residual, r, y, free):
        vector.destroy()
    return certificate


def contact_forces(problem: Problem, stress: fem.Function, zeta: float) -> Floats:
    """Contact forces that balance a stress and the loads, as a certificate has them. Collective.

    Returns:
        Shape (num_pairs,), those of the pairs hosted by this rank.
    """
    residual, r = problem.create_vector(), problem.create_vector()
    assemble_force(residual, fem.form(problem.internal_form(stress)), problem.bcs)
    problem.loads.subtract_from(residual, zeta)
    problem.basis.T.multTranspose(residual, r)
    forces = -r.array_r[problem.basis.index]
    for vector in (residual, r):
        vector.destroy()
    return forces


@dataclass(frozen=True)
class _Moved:
    """What is moved does: work of supports on u_D, and the norm of all nodal forces."""

    work: float
    norm: float


def _moved(problem: Problem, internal: PETSc.Vec) -> _Moved:
    """⟨σ, ε(ũ_D)⟩ with ũ_D zero at all other unknowns, and so no work of loads. Collective."""
    if not (problem.motion.moves_supports or problem.motion.driven):
        return _Moved(0.0, 0.0)
    u = problem.prescribed.ravel()[: internal.getLocalSize()]
    return _Moved(problem.comm.allreduce(float(internal.array_r @ u)), float(internal.norm()))


def _smallest(comm: MPI.Intracomm, forces: Floats) -> float:
    """Of all ranks, 0 where there is none. Collective."""
    smallest = comm.allreduce(float(forces.min(initial=np.inf)), MPI.MIN)
    return smallest if np.isfinite(smallest) else 0.0
