"""Compute the certificate, which measures the accuracy of a state.

The certificate contains the duality gap, the penetration, the smallest contact force, the
complementarity and the unbalanced forces. At a solution inf J_ζ = −S(σ) − Σ force × gap. The
duality gap is J_ζ + S(σ) + Σ force × gap, relative to |Ψ| + ½‖σ‖² (:func:`certify` adds the terms
of friction and prescribed motion). The certificate is valid for any field, computed by any
algorithm.
"""

import math
from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.rows.friction import norms
from perfplast_fenicsx.problem.assembled.spaces import assemble_force
from perfplast_fenicsx.problem.fields.quadrature_fields import RIGID, QuadratureFields
from perfplast_fenicsx.problem.judged.resultants import Resultants, resultants
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import TINY

LEAST_PUSH = 1e-6
"""Smallest contact or friction force that serves as a reference, as a fraction of the forces that
stress exerts on nodes. It prevents rounding errors from serving as references."""


@dataclass(frozen=True)
class Rubbed:
    """Forces, slip and dissipation of friction in a state.

    Attributes:
        forces: Friction forces μ at the points hosted by this rank, shape (num_places, gdim − 1).
        jumps: Slip at these points (length), same shape.
        energy: Σ c‖slip‖, the dissipation by friction.
        excess: Largest ‖μ‖ − c, relative to the largest c; 0 if no force exceeds c.
        unbalanced: The same excess, relative to the largest of the contact forces, the friction
            forces, and ``LEAST_PUSH`` times the forces that stress exerts on nodes.
        slipping: Number of points that slip.
    """

    forces: Floats
    jumps: Floats
    energy: float
    excess: float
    unbalanced: float
    slipping: int


@dataclass(frozen=True)
class Certificate:
    """Residuals of the optimality conditions of (P)_ζ at a state.

    :class:`report.LevelReport` documents the numbers.

    ``forces`` are the contact forces of the pairs hosted by this rank, shape (num_pairs,), positive
    in compression.
    """

    forces: Floats
    max_penetration: float
    smallest_contact_force: float
    complementarity: float
    equilibrium: float
    duality_gap: float
    friction: Rubbed
    resultants: Resultants


def certify(problem: Problem, fields: QuadratureFields, zeta: float) -> Certificate:
    """Return the certificate of the state in ``fields``. Collective.

    The dual functional is S(σ) + ⟨σ, e₀⟩ + Σ force × gap + Σ μ·s₀ − ⟨reactions, u_D⟩, with the
    friction forces μ and the origins of slip s₀. At the solution it equals −inf J_ζ, so the sum of
    J_ζ and the dual functional is the duality gap. This sum vanishes only at the solution, and is
    relative to |Ψ| + ½‖σ‖² plus the dissipation by friction. The gaps of contact already contain
    the motion u_D.
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
    energy = fields.potential() - problem.loads.work(fields.u.x.petsc_vec, zeta)
    rubbed = _rubbed(problem, y, r, forces, LEAST_PUSH * float(internal.norm()))
    energy += rubbed.energy
    moved = _moved(problem, internal)
    resisted += comm.allreduce(float(np.sum(rubbed.forces * problem.friction.origin)))
    dual = fields.conjugate() + fields.initial_work() + resisted - moved.work
    least = RIGID**2 * fields.jagged_norm2()
    size = fields.size()
    scale = max(size + rubbed.energy, least, TINY)
    free = r.copy()
    free.array[basis.index] = 0
    free.array[basis.sliding] = 0
    least_force = RIGID * fields.gross_force() if size <= least else fields.inner_force()
    pushing = math.sqrt(comm.allreduce(float(forces @ forces)))
    norm = max(problem.loads.norm(zeta), moved.norm, pushing, least_force, TINY)
    certificate = Certificate(
        forces,
        max_penetration=comm.allreduce(max(0.0, float((-room).max(initial=0))), MPI.MAX),
        smallest_contact_force=_smallest(comm, forces),
        complementarity=slack / scale,
        equilibrium=free.norm(PETSc.NormType.NORM_2) / norm,
        duality_gap=(energy + dual) / scale,
        friction=rubbed,
        resultants=resultants(problem, internal, forces, rubbed.forces, zeta, least_force),
    )
    for vector in (residual, r, y, free):
        vector.destroy()
    return certificate


def contact_forces(
    problem: Problem, stress: fem.Function, zeta: float, times: float = 1.0
) -> Floats:
    """Return the contact forces that balance a stress and the loads, as in a certificate.

    Collective.

    Args:
        problem: The bodies.
        stress: Mandel vectors at the points.
        zeta: Load factor ζ of the live loads.
        times: Factor of the constant loads.

    Returns:
        Forces of the pairs hosted by this rank, shape (num_pairs,).
    """
    r = _left(problem, stress, zeta, times)
    forces = -r.array_r[problem.basis.index]
    r.destroy()
    return forces


def friction_forces(problem: Problem, stress: fem.Function, zeta: float) -> Floats:
    """Return the friction forces that balance a stress and the loads, shape (num_places, gdim − 1).

    Collective.
    """
    r = _left(problem, stress, zeta)
    forces = -problem.friction.jumps(r)
    r.destroy()
    return forces


def forces_between(problem: Problem, internal: PETSc.Vec, zeta: float) -> tuple[Floats, Floats]:
    """Return the contact and friction forces that balance nodal forces and the loads. Collective.

    Args:
        problem: The bodies.
        internal: ⟨σ, ε(·)⟩ in nodal unknowns.
        zeta: Load factor ζ of the live loads.

    Returns:
        Forces as in :func:`contact_forces` and :func:`friction_forces`.
    """
    residual = internal.copy()
    fem_petsc.set_bc(residual, problem.bcs)
    r = _in_jumps(problem, residual, zeta)
    pushed, rubbed = -r.array_r[problem.basis.index], -problem.friction.jumps(r)
    r.destroy()
    return pushed, rubbed


def _left(problem: Problem, stress: fem.Function, zeta: float, times: float = 1.0) -> PETSc.Vec:
    """Return the forces that contact must balance, in the jump basis. Collective."""
    residual = problem.create_vector()
    assemble_force(residual, fem.form(problem.internal_form(stress)), problem.bcs)
    return _in_jumps(problem, residual, zeta, times)


def _in_jumps(problem: Problem, residual: PETSc.Vec, zeta: float, times: float = 1.0) -> PETSc.Vec:
    """Return nodal forces minus the loads, in the jump basis, and destroy ``residual``.

    Collective.

    Args:
        problem: The bodies.
        residual: Nodal forces, zero at supports.
        zeta: Load factor ζ of the live loads.
        times: Factor of the constant loads.
    """
    r = problem.create_vector()
    problem.loads.subtract_from(residual, zeta, times)
    problem.basis.T.multTranspose(residual, r)
    residual.destroy()
    return r


def _rubbed(problem: Problem, y: PETSc.Vec, r: PETSc.Vec, pushes: Floats, least: float) -> Rubbed:
    """Return slip and dissipation at y, and the friction forces from the gradient r. Collective.

    Args:
        problem: Problem with the friction.
        y: Displacement in the jump basis.
        r: Gradient in the jump basis.
        pushes: Contact forces, shape (num_pairs,).
        least: Smallest force that serves as a reference.
    """
    friction, comm = problem.friction, problem.comm
    jumps, forces = friction.slip(y), -friction.jumps(r)
    if not friction.count:
        return Rubbed(forces, jumps, 0.0, 0.0, 0.0, 0)
    sizes = norms(jumps)
    rounding = 1e-13  # slip below this fraction of the largest displacement counts as zero
    slips = sizes > rounding * y.norm(PETSc.NormType.NORM_INFINITY)
    energy = comm.allreduce(friction.energy(np.where(slips[:, None], jumps, 0.0)))
    excess = float((norms(forces) - friction.bound).max(initial=0))
    finite = friction.bound[np.isfinite(friction.bound)]
    largest = max(norms(forces).max(initial=0), np.abs(pushes).max(initial=0), least)
    most = np.array([excess, finite.max(initial=0), largest])
    comm.Allreduce(MPI.IN_PLACE, most, MPI.MAX)
    relative, of_all = (float(most[0] / size) if size > 0 else 0.0 for size in most[1:])
    return Rubbed(forces, jumps, energy, relative, of_all, comm.allreduce(int(slips.sum())))


@dataclass(frozen=True)
class _Moved:
    """Effect of moving supports: the work of reactions on u_D, and the norm of all nodal forces."""

    work: float
    norm: float


def _moved(problem: Problem, internal: PETSc.Vec) -> _Moved:
    """Return the work ⟨σ, ε(ũ_D)⟩, and the norm of the nodal forces. Collective.

    ũ_D is u_D at supports and zero at all other unknowns, so loads do no work on it.
    """
    if not (problem.motion.moves_supports or problem.motion.driven):
        return _Moved(0.0, 0.0)
    u = problem.prescribed.ravel()[: internal.getLocalSize()]
    return _Moved(problem.comm.allreduce(float(internal.array_r @ u)), float(internal.norm()))


def _smallest(comm: MPI.Intracomm, forces: Floats) -> float:
    """Return the smallest force on all ranks, 0 if there are no forces. Collective."""
    smallest = comm.allreduce(float(forces.min(initial=np.inf)), MPI.MIN)
    return smallest if np.isfinite(smallest) else 0.0
