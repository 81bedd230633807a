"""Declare the options of ALG1, ALG3 and ALG4, and derive the parameters of each step from them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from perfplast_fenicsx.errors import InputError, check_choice, check_end
from perfplast_fenicsx.problem.judged.report import Iteration

Monitor = Callable[[Iteration], None]
"""Function that is called on every rank after each iteration."""


CONTACT_SOLVERS = ("snes-vi", "tfeti")
"""Solvers of the contact quadratic program in a step."""


@dataclass(frozen=True)
class Subdivision:
    """Number of subdomains of Total FETI.

    Args:
        asked: Number of subdomains on all ranks that the user gives; None for an automatic number.
    """

    asked: int | None

    def wanted(self, num_dofs: int, gdim: int) -> int:
        """Return the number of subdomains for a problem."""
        # Default number of displacement unknowns in a subdomain, by dimension.
        unknowns_each = {2: 4000, 3: 6000}
        return self.asked or max(1, num_dofs // unknowns_each[gdim])


@dataclass(frozen=True)
class NewtonOptions:
    """Options of the Newton methods.

    Args:
        regularisation: ρ in [0, 1], or "adaptive". An adaptive ρ decreases in each step.
        damping: Whether to use an exact line search on the energy; otherwise β = 1.
        stopping: The relative criterion of the paper that ends the iteration (Remark 1):
            "displacement" is ‖δu‖ / (‖u + δu‖ + ‖u‖), "stress" is ‖δσ‖_E / (‖σ + δσ‖_E + ‖σ‖_E),
            and "energy" is |δJ| / (|J + δJ| + |J|).
        tolerance: Tolerance of this criterion, between 0 and 1. A damped step does not end the
            iteration.
        active_set: "exact" solves each contact quadratic program completely; "once" updates the
            active set once per Newton step. "adaptive" also updates it once, but up to four times
            after a damped step (with friction until it converges), and until it converges after the
            tenth step.
        max_iterations: Largest number of Newton steps in a level, at least 1.
        contact_solver: "snes-vi" finds the closed pairs by PETSc's SNES-VI, with one linear system
            for each active set. "tfeti" divides the bodies into subdomains and solves for the
            forces between them (Total FETI); contact then only bounds some of these forces, and
            each step solves the contact program completely.
        subdomains: Number of subdomains on all ranks for "tfeti"; each rank makes at least one
            subdomain of each of its bodies. By default subdomains have a size that factorises
            quickly.

    Raises:
        InputError: If a value is out of its range.
    """

    regularisation: float | Literal["adaptive"] = "adaptive"
    damping: bool = True
    stopping: Literal["displacement", "stress", "energy"] = "displacement"
    tolerance: float = 1e-8
    active_set: Literal["adaptive", "exact", "once"] = "adaptive"
    max_iterations: int = 60
    contact_solver: Literal["snes-vi", "tfeti"] = "snes-vi"
    subdomains: int | None = None

    def __post_init__(self) -> None:
        rho = self.regularisation
        if rho != "adaptive" and not (isinstance(rho, int | float) and 0 <= rho <= 1):
            raise InputError(
                f"regularisation = {rho!r} is neither a number in [0, 1] nor "
                '"adaptive"; give for example 1e-3.'
            )
        check_choice("stopping", self.stopping, ("displacement", "stress", "energy"))
        check_choice("active_set", self.active_set, ("adaptive", "exact", "once"))
        check_end(self.tolerance, self.max_iterations)
        check_choice("contact_solver", self.contact_solver, CONTACT_SOLVERS)
        if self.subdomains is None:
            return
        if self.contact_solver != "tfeti":
            raise InputError(
                f"subdomains = {self.subdomains} needs contact_solver = 'tfeti'; remove "
                "subdomains, or give contact_solver = 'tfeti'."
            )
        if self.subdomains < 1:
            raise InputError(
                f"subdomains = {self.subdomains} is less than 1; give 1 or more, or remove it."
            )

    @property
    def subdivision(self) -> Subdivision | None:
        """Return the subdivision of Total FETI; None for SNES-VI."""
        return Subdivision(self.subdomains) if self.contact_solver == "tfeti" else None


def regularisation(
    options: NewtonOptions, history: Sequence[Iteration], lifted: bool = False
) -> float:
    """Return ρ of the next step: fixed, or a tenth of the last ρ.

    An adaptive ρ starts at its largest value and decreases to 1e-8, so convergence near the
    solution is almost quadratic. Values above 1e-3 only slow down convergence near collapse.

    Args:
        options: Options of the Newton method.
        history: The steps so far.
        lifted: Whether the start did not satisfy supports, interferences or initial strains. Cells
            near them are then strained excessively, so the first step is elastic.
    """
    if options.regularisation != "adaptive":
        return float(options.regularisation)
    largest_rho, smallest_rho = 1e-3, 1e-8  # range of the adaptive regularisation
    if not history:
        return 1.0 if lifted else largest_rho
    last = history[-1]
    return max(min(last.rho, largest_rho) / 10, smallest_rho)


def most_sets(options: NewtonOptions, history: Sequence[Iteration]) -> int | None:
    """Return how many times the next step may update its active set; None for no limit.

    Each update solves one linear system, and near the solution one update per step is sufficient.
    After a damped step, few updates are allowed: its quadratic model was inaccurate, and the last
    few of thousands of pairs can change in the next step. After many steps the active sets may
    cycle, so there is no limit.
    """
    if options.active_set != "adaptive":
        return None if options.active_set == "exact" else 1
    # Number of steps in a level after which the adaptive strategy solves contact programs
    # completely.
    patience = 10
    if len(history) >= patience:
        return None
    few_sets = 4  # largest number of active sets in the step after a damped step
    return few_sets if any(record.beta < 1 for record in history[-1:]) else 1


def forcing(history: Sequence[Iteration], tolerance: float) -> float:
    """Return the relative tolerance for the linear solves of the next step.

    The tolerance is loose far from the solution.

    Near the solution it follows the last increment, so that convergence stays quadratic. The error
    of a solve is its tolerance times the increment, and need not be below a hundredth of the
    required accuracy. The function assumes that increments continue to decrease as in the last
    step.
    """
    before, last = ([1.0, 1.0] + [record.increment for record in history])[-2:]
    expected = last * min(1.0, last / before) if before > 0 else last
    enough = 1e-2 * tolerance / max(expected, tolerance)
    return min(1e-3, max(1e-2 * last, enough, 1e-11))
