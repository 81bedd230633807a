"""Record the solution of a load level, in the same way for every algorithm."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import PairFlags
from perfplast_fenicsx.problem.judged.certificate import certify
from perfplast_fenicsx.problem.judged.report import Iteration, LevelReport
from perfplast_fenicsx.problem.judged.state import Level
from perfplast_fenicsx.solvers.contact_solver import ContactSolver, counts
from perfplast_fenicsx.solvers.iterate import Iterate
from perfplast_fenicsx.solvers.linear.linear_solver import LinearSolver
from perfplast_fenicsx.solvers.newton_options import Monitor
from perfplast_fenicsx.solvers.verdicts import CREDIBLE, SLIDES, not_credible, slides_on


@dataclass(frozen=True)
class Step:
    """The result of one step in an algorithm.

    Attributes:
        zeta: Load factor after the step.
        increment: Value of the stopping criterion.
        active: Closed pairs hosted by this rank, shape (num_pairs,).
        active_set_iterations: Number of linear solves in the contact quadratic program.
        beta: Step length.
        rho: Regularisation of the tangent.
        finished: Whether the stopping criterion is satisfied by a full step with a settled active
            set.
        extra: Additional values for :attr:`report.Iteration.extra`.
    """

    zeta: float
    increment: float
    active: PairFlags
    active_set_iterations: int
    finished: bool
    beta: float = 1.0
    rho: float = 0.0
    extra: Mapping[str, float] = field(default_factory=dict)


class Progress:
    """Collect the iterations of a level, and assess the final state.

    Attributes:
        history: The iterations so far.
    """

    def __init__(
        self,
        iterate: Iterate,
        linear: LinearSolver,
        program: ContactSolver,
        monitor: Monitor | None,
        tolerance: float,
    ) -> None:
        """Start the clock, and store the initial counts of the solvers and the step tolerance."""
        self._slides = max(SLIDES, 10 * tolerance)
        self.history: list[Iteration] = []
        self._iterate, self._linear, self._monitor = iterate, linear, monitor
        self._began = time.perf_counter()
        self._program, self._before = program, counts(linear, program)
        self._krylov = linear.iterations

    def add(self, step: Step) -> None:
        """Record the current iterate after a step, and call the monitor. Collective."""
        iterate, linear = self._iterate, self._linear
        record = Iteration(
            number=len(self.history) + 1,
            zeta=step.zeta,
            alpha=iterate.work(),
            energy=iterate.energy(step.zeta),
            increment=step.increment,
            beta=step.beta,
            rho=step.rho,
            plastic_fraction=iterate.fields.plastic_fraction(),
            active_contacts=iterate.problem.comm.allreduce(int(step.active.sum())),
            active_set_iterations=step.active_set_iterations,
            linear_iterations=linear.iterations - self._krylov,
            seconds=time.perf_counter() - self._began,
            extra=step.extra,
        )
        self._krylov = linear.iterations
        self.history.append(record)
        if self._monitor is not None:
            self._monitor(record)

    def level(
        self,
        zeta: float,
        active: PairFlags,
        converged: bool,
        reason: str,
        refuted: bool = False,
    ) -> Level:
        """Return the level with a report on the iterate. Collective.

        Args:
            zeta: Load factor.
            active: Closed pairs hosted by this rank.
            converged: Whether the steps converged.
            reason: Reason for the end of the steps.
            refuted: Whether the reason is a verdict that no solution exists.
        """
        iterate, history = self._iterate, self.history
        problem, fields, comm = iterate.problem, iterate.fields, iterate.problem.comm
        problem.free.centre(fields.u)
        certificate = certify(problem, fields, zeta)
        if converged and not abs(certificate.duality_gap) <= CREDIBLE:
            converged, reason = False, not_credible(certificate.duality_gap)
        unbalanced = certificate.friction.unbalanced
        off = max(unbalanced, abs(certificate.duality_gap))
        if converged and problem.friction.count and not off <= self._slides:
            converged, reason = False, slides_on(unbalanced, certificate.duality_gap)
            refuted = True
        nodal = fields.u.x.array.reshape(-1, problem.V.dofmap.index_map_bs)
        largest = float(np.linalg.norm(nodal, axis=1).max(initial=0))
        counted = counts(self._linear, self._program)
        state = iterate.state(zeta, active)
        report = LevelReport(
            zeta=zeta,
            alpha=state.alpha,
            converged=converged,
            reason=reason,
            newton_iterations=len(history),
            active_set_iterations=sum(record.active_set_iterations for record in history),
            damping_min=min((record.beta for record in history), default=1.0),
            plastic_fraction=fields.plastic_fraction(),
            plastic_cells=fields.plastic_cells(),
            active_contacts=comm.allreduce(int(active.sum())),
            contact_pairs=problem.num_pairs,
            max_penetration=certificate.max_penetration,
            smallest_contact_force=certificate.smallest_contact_force,
            complementarity=certificate.complementarity,
            equilibrium=certificate.equilibrium,
            duality_gap=certificate.duality_gap,
            max_displacement=comm.allreduce(largest, MPI.MAX),
            seconds=time.perf_counter() - self._began,
            reactions=certificate.resultants.forces,
            balance=certificate.resultants.balance,
            slipping=certificate.friction.slipping,
            friction_dissipation=certificate.friction.energy,
            friction_excess=certificate.friction.excess,
            driving_force=certificate.resultants.driving,
            driving_forces=certificate.resultants.driving_by_name,
            bolts=fields.bolt_forces(),
            **{name: count - self._before[name] for name, count in counted.items()},
        )
        stress = fem.Function(problem.S, name="stress")
        stress.x.array[:] = fields.stress.x.array
        return Level(state, stress, certificate.forces, report, history, refuted)
