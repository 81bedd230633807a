"""ALG2: the augmented Lagrangian method of Uzawa type with Anderson acceleration.

The method is in Section 3.2 of Čermák, Haslinger, Sysala (COMPLAS XII, 2013). With a misprint in
(7) corrected, an iteration has three steps:

1.  r⟨Cε(u), ε(v−u)⟩ ≥ ζL(v−u) − ⟨σ^k, ε(v−u)⟩ + r⟨Ce^k, ε(v−u)⟩ for all v in K_h,
2.  ω = (C⁻¹σ^k + rê)/(1+r),  e = ((1+r)ω − C⁻¹Σ(ω))/r,
3.  σ^{k+1} = Σ(e) = Σ(ω),

with ê = ε(u), or ê = θε(u) + (1−θ)e^k with over-relaxation by θ. With plastic strain p, where Σ(e)
= P(C(e − p)), steps 2 and 3 use e − p. The operator of step 1 is the elastic stiffness for the
whole run, and r occurs only in the right-hand sides. The multigrid hierarchy or factorisation of
this operator is therefore reused until the active set changes. Since σ^k = Σ(e^k), an iteration
maps e^k to e^{k+1} and needs no other data.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.errors import InputError, check_choice, check_end
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.problem.assembled.law_on_cells import LawExpression, LawOnCells, OfLaw
from perfplast_fenicsx.problem.assembled.spaces import assemble_force
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.fields.quadrature_fields import strain_norm2, stress_norm2
from perfplast_fenicsx.problem.judged.report import Iteration
from perfplast_fenicsx.problem.judged.state import State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.friction_qp import FrictionSplitting
from perfplast_fenicsx.solvers.level_solver import LevelSolver
from perfplast_fenicsx.solvers.progress import Step
from perfplast_fenicsx.solvers.verdicts import BEYOND, above_limit

Strains = Floats


Weights = tuple[Floats, Floats]
"""Weights of the spherical and the deviatoric part of the strains, at each owned quadrature
point."""


def elastic_weights(problem: Problem) -> Weights:
    """Return √(3κ) and √(2μ) at each point, each times the square root of the point's volume.

    Collective.
    """
    Q = problem.Q
    owned = Q.dofmap.index_map.size_local
    volume = fem.assemble_vector(fem.form(ufl.TestFunction(Q) * problem.dx)).array[:owned]

    def root(modulus: OfLaw) -> Floats:
        at_points = fem.Function(Q)
        LawExpression(problem.laws, Q, modulus).interpolate(at_points)
        return np.sqrt(at_points.x.array[:owned] * volume)

    return root(lambda on: 3 * on.law.elastic.bulk), root(lambda on: 2 * on.law.elastic.shear)


class Anderson:
    """Extrapolate e ← g(e) from the last iterations, with residuals measured in ‖·‖_C.

    D. G. Anderson, J. ACM 12 (1965); type II, undamped.
    """

    def __init__(self, comm: MPI.Intracomm, weights: Weights) -> None:
        """Store the weights of the norm.

        Args:
            comm: Ranks that share the strains.
            weights: Weights of ‖·‖_C, see :func:`elastic_weights`.
        """
        self._comm = comm
        self._spherical, self._deviatoric = (values[:, None] for values in weights)
        self._images: list[Strains] = []
        self._residuals: list[Strains] = []

    def restart(self) -> None:
        """Clear the stored images and residuals of earlier iterations."""
        self._images.clear()
        self._residuals.clear()

    def extrapolate(self, current: fem.Function, image: fem.Function) -> None:
        """Replace the image g(e) of the current strain by an extrapolation. Collective."""
        before, after = self._values(current), self._values(image)
        residual = self._weigh(after - before)
        self._images.append(after.copy())
        self._residuals.append(residual)
        most_kept = 8  # number of stored iterations
        del self._images[:-most_kept], self._residuals[:-most_kept]
        if len(self._images) < 2:
            return
        gram = np.array([[np.vdot(a, b) for a in self._residuals] for b in self._residuals])
        gram = self._comm.allreduce(gram)
        regularisation = 1e-12  # added to the normal equations, relative to their trace
        gram += regularisation * np.trace(gram) * np.eye(len(gram))
        weights = np.linalg.solve(gram, np.ones(len(gram)))
        weights /= weights.sum()
        after[:] = sum(w * g for w, g in zip(weights, self._images, strict=True))
        image.x.scatter_forward()

    def _values(self, strain: fem.Function) -> Strains:
        width = strain.function_space.dofmap.index_map_bs
        return strain.x.array[: len(self._spherical) * width].reshape(-1, width)

    def _weigh(self, strains: Strains) -> Strains:
        """Return the strains in coordinates in which ‖·‖_C is the Euclidean norm."""
        mean = strains[:, :3].sum(axis=1, keepdims=True) / 3
        weighed = self._deviatoric * strains
        weighed[:, :3] += (self._spherical - self._deviatoric) * mean
        return weighed


CHECK_EVERY = 10
"""Number of iterations between checks for a collapse mechanism and for an unbalanced penalty."""


@dataclass(frozen=True)
class AugmentedLagrangianOptions:
    """Options of ALG2.

    Args:
        penalty: r > 0, relative to the elastic moduli, or "adaptive". An adaptive penalty is
            doubled or halved to keep the primal and the dual residual comparable.
        relaxation: Over-relaxation θ in (0, 2); θ = 1 gives the method of the paper.
        acceleration: "anderson" extrapolates e^k from the last iterations. "none" does not
            extrapolate; problems with friction always use "none".
        tolerance: Tolerance, between 0 and 1, of both relative residuals: ‖ε(u) − e‖_C/‖ε(u)‖_C
            (primal) and r‖e^{k+1} − e^k‖_C/‖σ‖_E (dual).
        max_iterations: Largest number of iterations in a level, at least 1.

    Raises:
        InputError: If a value is out of its range.
    """

    penalty: float | Literal["adaptive"] = "adaptive"
    relaxation: float = 1.0
    acceleration: Literal["none", "anderson"] = "anderson"
    tolerance: float = 1e-8
    max_iterations: int = 3000

    def __post_init__(self) -> None:
        r = self.penalty
        if r != "adaptive" and not (type(r) in (int, float) and 0 < r < np.inf):
            raise InputError(
                f'penalty = {r!r} is neither a positive number nor "adaptive"; 1 is a good value.'
            )
        if not 0 < self.relaxation < 2:
            raise InputError(
                f"relaxation = {self.relaxation} is not between 0 and 2; 1 means no relaxation."
            )
        check_choice("acceleration", self.acceleration, ("none", "anderson"))
        check_end(self.tolerance, self.max_iterations)


class AugmentedLagrangian(LevelSolver):
    """ALG2, which prescribes ζ. A level starts from a state with e = ε(u)."""

    method = "augmented-lagrangian"
    prescribes = Prescribed.LOAD_FACTOR
    steps_called = "iterations"

    def __init__(self, problem: Problem, options: AugmentedLagrangianOptions | None = None) -> None:
        """Compile the forms and create the solvers. Collective.

        Raises:
            InputError: If a law is not a projection onto a yield set.
        """
        for on in problem.laws:
            if not on.law.projects:
                raise InputError(
                    f"the law {type(on.law).__name__} is not a projection onto a yield set, which "
                    f'ALG2 (method = "{self.method}") requires; give method = "newton".'
                )
        self.options = options or AugmentedLagrangianOptions()
        criterion = "primal and dual residual met"
        end = (self.options.tolerance, self.options.max_iterations)
        super().__init__(problem, end, criterion)
        operator = self.iterate.operator(rho=1.0)
        self._splitting: FrictionSplitting | None = None
        if problem.friction.count:
            stiffness = problem.friction.gather(operator.diagonal()).max(axis=1)
            self._splitting = FrictionSplitting(problem, operator, stiffness)
        self.program.set_operator(operator)
        self._first_work = 0.0

        mesh, S = problem.tagged_mesh.mesh, problem.S
        self._q, self._next_q = fem.Function(S), fem.Function(S)
        self._sigma, self._trial = fem.Function(S), fem.Function(S)
        self._r = fem.Constant(mesh, default_scalar_type(1))
        self._theta = fem.Constant(mesh, default_scalar_type(self.options.relaxation))
        e, q, sigma, r = self.iterate.fields.e, self._q, self._sigma, self._r

        relaxed = self._theta * e + (1 - self._theta) * q

        def step_2(on: LawOnCells) -> Expr:
            compliance, p = on.law.elastic.compliance, on.law.unstressed(on.old)
            seen = relaxed if p is None else relaxed - p
            omega = (compliance(sigma) + r * seen) / (1 + r)
            stress = on.law.stress(omega if p is None else omega + p, on.old)
            found = ((1 + r) * omega - compliance(stress)) / r
            return found if p is None else found + p

        def at_points(value: OfLaw) -> LawExpression:
            return LawExpression(problem.laws, S, value)

        self._step_2 = at_points(step_2)
        self._step_3 = at_points(lambda on: on.law.stress(q, on.old))
        self._augmented = at_points(lambda on: sigma + r * on.law.elastic.hooke(e - q))
        self._force_form = fem.form(problem.internal_form(self._trial))
        self._force = problem.create_vector()
        self._gradient = problem.create_vector()

        self._primal2 = strain_norm2(problem, e - self._next_q)
        self._dual2 = strain_norm2(problem, self._next_q - q)
        self._stress2 = stress_norm2(problem, lambda on: sigma)
        self._anderson = Anderson(problem.comm, elastic_weights(problem))

    def begin(self, value: float, start: State | None) -> tuple[float, PairFlags]:
        """Start from ``start``, with u in K_h, e = ε(u), σ = Σ(e) and the first penalty.

        Collective.
        """
        options, active = self.options, self.iterate.begin(start)
        # Initial adaptive penalty. The tangent moduli, relative to the elastic ones, lie in [0,
        # 1]. The best r is about the square root of the product of their bounds, so it is below 1,
        # and smaller for more plastic flow.
        first_penalty = 0.3
        self._r.value = first_penalty if options.penalty == "adaptive" else options.penalty
        self._q.x.array[:] = self.iterate.fields.e.x.array
        self._step_3.interpolate(self._sigma)
        self._anderson.restart()
        if self._splitting is not None:
            self._splitting.begin(self.iterate.jumps())
        return value, active

    def step(
        self,
        value: float,
        zeta: float,
        active: PairFlags,
        history: Sequence[Iteration],
    ) -> Step:
        """Perform steps 1 to 3, with Anderson extrapolation of e if it is enabled. Collective."""
        options, iterate = self.options, self.iterate
        if history and len(history) % CHECK_EVERY == 0:
            self._balance(history[-1].extra["primal"], history[-1].extra["dual"])
        gradient = self._step_1_gradient(zeta)
        # Relative tolerance of each linear solve; its right-hand side is the remaining residual.
        linear_tolerance = 1e-3
        found = self.program.solve(gradient, iterate.room(), active, linear_tolerance)
        iterate.aim(found.delta)
        iterate.advance(1.0)
        self._step_2.interpolate(self._next_q)
        primal2, dual2 = self._primal2(), self._dual2()
        if self._splitting is not None:
            more = self._splitting.follow(iterate.jumps(), float(self._r.value))
            primal2, dual2 = primal2 + more[0], dual2 + more[1]
        elif options.acceleration == "anderson":
            self._anderson.extrapolate(self._q, self._next_q)
        self._q.x.array[:] = self._next_q.x.array
        self._step_3.interpolate(self._sigma)
        r = float(self._r.value)
        least = iterate.least_norm2()
        primal = _ratio(primal2, max(iterate.fields.u_norm2(), least))
        dual = r * _ratio(dual2, max(self._stress2(), least))
        if not history:
            self._first_work = iterate.first_work(zeta)
        return Step(
            zeta,
            increment=max(primal, dual),
            active=found.active,
            active_set_iterations=found.iterations,
            finished=max(primal, dual) < options.tolerance and found.settled,
            extra={"primal": primal, "dual": dual, "penalty": r},
        )

    def ended(self, zeta: float, history: Sequence[Iteration]) -> str | None:
        """Return a message if the last step shows that J_ζ is unbounded below, else None.

        The method looks at every tenth step only. Collective.
        """
        due = len(history) % CHECK_EVERY == 0
        if not due or not self.iterate.descends_until(BEYOND * self._first_work, zeta):
            return None
        return above_limit(zeta, history, self.problem.loads.grows())

    def _step_1_gradient(self, zeta: float) -> PETSc.Vec:
        """Return (⟨σ^k + rC(ε(u) − e^k), ε(·)⟩ − L₀ − ζL₁)/r in jump unknowns."""
        self._augmented.interpolate(self._trial)
        assemble_force(self._force, self._force_form, self.problem.bcs)
        self.problem.loads.subtract_from(self._force, zeta)
        self._force.scale(1 / float(self._r.value))
        self.problem.basis.T.multTranspose(self._force, self._gradient)
        if self._splitting is not None:
            r = float(self._r.value)
            self._splitting.add_gradient(self.iterate.jumps(), r, self._gradient)
        return self._gradient

    def _balance(self, primal: float, dual: float) -> None:
        if self.options.penalty != "adaptive":
            return
        # An adaptive penalty changes if one residual exceeds the other by this factor.
        unbalanced = 3.0
        if primal > unbalanced * dual:
            self._r.value = self._r.value * 2
        elif dual > unbalanced * primal:
            self._r.value = self._r.value / 2
        else:
            return
        self._anderson.restart()


def _ratio(change2: float, size2: float) -> float:
    """Return the quotient of two norms from their squares; 0 if the second norm is zero."""
    return float(np.sqrt(max(change2, 0) / size2)) if size2 > 0 else 0.0
