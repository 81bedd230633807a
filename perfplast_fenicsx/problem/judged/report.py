"""Reports of a level and of its iterations: numbers and words, no fields.

Whoever reads results needs no more than this, so that nothing of DOLFINx or MPI is imported here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Iteration:
    """One Newton step, or one iteration of ALG2.

    Attributes:
        number: From 1.
        zeta: Load parameter.
        alpha: L₁(u) after the step.
        energy: J_ζ(u) after the step.
        increment: Value of the chosen stopping criterion.
        beta: Step length.
        rho: Regularisation ρ of the tangent.
        plastic_fraction: Share of the volume that is plastic after the step.
        active_contacts: Closed pairs.
        active_set_iterations: Linear solves of the contact quadratic program.
        linear_iterations: Krylov iterations.
        seconds: Wall time since the level began.
        extra: What an algorithm has besides, by name: ALG2 the relative "primal" and "dual"
            residual and the "penalty" r.
    """

    number: int
    zeta: float
    alpha: float
    energy: float
    increment: float
    beta: float
    rho: float
    plastic_fraction: float
    active_contacts: int
    active_set_iterations: int
    linear_iterations: int
    seconds: float
    extra: Mapping[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        return (
            f"Iteration({self.number}: zeta={self.zeta:.6g}, alpha={self.alpha:.6g},"
            f" increment={self.increment:.1e}, beta={self.beta:.2g})"
        )


@dataclass(frozen=True)
class LevelReport:
    """The report of a load level; a step of ``summary.json``.

    Attributes:
        zeta: Load parameter ζ.
        alpha: Work of the live loads α = L₁(u).
        converged: Whether the level was solved.
        reason: Why the iteration ended.
        newton_iterations: Newton steps.
        active_set_iterations: Linear solves of the contact quadratic programs.
        linear_iterations: Krylov iterations.
        linear_solves: Linear systems solved.
        setups: Factorisations or multigrid set-ups.
        damping_min: Smallest step length β.
        plastic_fraction: Share of the volume that is plastic.
        plastic_cells: Cells that are plastic, at one quadrature point at least.
        active_contacts: Pairs that push.
        contact_pairs: All pairs.
        max_penetration: Largest (u_a − u_b)·n − g, at least 0 (length).
        smallest_contact_force: Smallest contact force of all pairs (force); negative means an
            adhesive one. 0 without any.
        complementarity: Σ force × remaining gap, relative to |Ψ| + ½‖σ‖², as the duality gap.
        equilibrium: Norm of the forces that nothing balances (contact forces apart, which the three
            numbers above judge), relative to the largest of these: the loads, the contact forces,
            all nodal forces where supports move, and those that stress exerts on nodes from all
            sides where bodies are strained at first or remember plastic flow.
        duality_gap: J_ζ(u) + S(σ) + Σ force × gap − ⟨reactions, u_D⟩, relative to
            |Ψ(ε(u))| + ½‖σ‖².
        max_displacement: Largest nodal displacement (length).
        seconds: Wall time of the level.
        reactions: Forces on the bodies (:class:`resultants.Resultants`), one number a direction.
        balance: Their sum or moment, relative to all nodal forces.
        slipping: Places with friction that slip; in stages since the level before.
        friction_dissipation: What this slip has dissipated, Σ c × slip (energy).
        rounds: Rounds of the fixed point of Coulomb's friction; 1 without it.
        friction_excess: Largest force of friction beyond c, relative to the largest c, at least 0.
        driving_force: Where ζ moves supports and obstacles, the work that they do on the bodies for
            a growth of ζ by 1: the force along what moves, times how far it moves for ζ = 1.
        stage: The stage of a loading history; empty where there are none, and at rest before them.
            ζ is then the time, which grows by 1 in each stage.
        factors: What multiplies loads, temperatures and motions, by their names in stages.
        works: Work that each of these loads, with the factor 1, does on u (energy).
        driving_forces: Work that what each of these motions moves does on the bodies for a growth
            of its factor by 1.
        bolts: Force in the shank of each bolt (force), tension positive.
        contact_programs: Contact quadratic programs solved; 0 without contact.
        snes_vi_programs: Those that PETSc's SNES-VI solved by itself. It solved none with Total
            FETI, nor those in which active sets went in circles, so that the condensed program
            chose the set.
        snes_vi_iterations: Iterations of SNES-VI, an active set each.
    """

    zeta: float
    alpha: float
    converged: bool
    reason: str
    newton_iterations: int
    active_set_iterations: int
    linear_iterations: int
    linear_solves: int
    setups: int
    damping_min: float
    plastic_fraction: float
    plastic_cells: int
    active_contacts: int
    contact_pairs: int
    max_penetration: float
    smallest_contact_force: float
    complementarity: float
    equilibrium: float
    duality_gap: float
    max_displacement: float
    seconds: float
    reactions: Mapping[str, Sequence[float]] = field(default_factory=dict)
    balance: float = 0.0
    slipping: int = 0
    friction_dissipation: float = 0.0
    rounds: int = 1
    friction_excess: float = 0.0
    driving_force: float = 0.0
    stage: str = ""
    factors: Mapping[str, float] = field(default_factory=dict)
    works: Mapping[str, float] = field(default_factory=dict)
    driving_forces: Mapping[str, float] = field(default_factory=dict)
    bolts: Mapping[str, float] = field(default_factory=dict)
    contact_programs: int = 0
    snes_vi_programs: int = 0
    snes_vi_iterations: int = 0

    def __repr__(self) -> str:
        return f"LevelReport({self.summary()})"

    def summary(self) -> str:
        """Return the level in a few words."""
        if not self.converged:
            return f"zeta={self.zeta:.6g}, no solution: {self.reason}"
        return (
            f"zeta={self.zeta:.6g}, alpha={self.alpha:.6g}, {self.newton_iterations} steps,"
            f" {self.plastic_fraction:.1%} plastic, {self.active_contacts}/{self.contact_pairs}"
            f" contacts, duality_gap={self.duality_gap:.1e}"
        )
