"""Report a level and its iterations in numbers and words, without fields.

Code that reads results needs only this module, so that it imports neither DOLFINx nor MPI.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any


@dataclass(frozen=True)
class Iteration:
    """One Newton step, or one iteration of ALG2.

    Attributes:
        number: Number of the iteration, from 1.
        zeta: Load parameter.
        alpha: L₁(u) after the step.
        energy: J_ζ(u) after the step.
        increment: Value of the chosen stopping criterion.
        beta: Step length.
        rho: Regularisation ρ of the tangent.
        plastic_fraction: Share of the volume that is plastic after the step.
        active_contacts: Number of closed pairs.
        active_set_iterations: Linear solves of the contact quadratic program.
        linear_iterations: Number of Krylov iterations.
        seconds: Wall time since the level began.
        extra: Further values of an algorithm, by name. ALG2 stores the relative "primal" and "dual"
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
    """The report of a load level; one step in ``summary.json``.

    Attributes:
        zeta: Load parameter ζ.
        alpha: Work of the live loads α = L₁(u).
        converged: Whether the level was solved.
        reason: Why the iteration ended.
        newton_iterations: Number of Newton steps.
        active_set_iterations: Linear solves of the contact quadratic programs.
        linear_iterations: Number of Krylov iterations.
        linear_solves: Number of linear systems solved.
        setups: Number of factorisations or multigrid set-ups.
        damping_min: Smallest step length β.
        plastic_fraction: Share of the volume that is plastic.
        plastic_cells: Number of cells with at least one plastic quadrature point.
        active_contacts: Number of pairs with a contact force.
        contact_pairs: Number of all pairs.
        max_penetration: Largest (u_a − u_b)·n − g, at least 0 (length).
        smallest_contact_force: Smallest contact force of all pairs (force); a negative value means
            adhesion. The value is 0 without pairs.
        complementarity: Σ force × remaining gap, relative to |Ψ| + ½‖σ‖², as the duality gap.
        equilibrium: Norm of the unbalanced forces without contact forces, relative to the largest
            of these norms: the loads; the contact forces; all nodal forces if supports move; and
            the forces that stress exerts on nodes from all sides, if bodies have initial strain or
            remember plastic flow.
        duality_gap: J_ζ(u) + S(σ) + Σ force × gap − ⟨reactions, u_D⟩, relative to
            |Ψ(ε(u))| + ½‖σ‖².
        max_displacement: Largest nodal displacement (length).
        seconds: Wall time of the level.
        reactions: Forces on the bodies (:class:`resultants.Resultants`), one number for each
            direction.
        balance: Their sum or the sum of their moments, relative to all nodal forces.
        slipping: Places with friction that slip; in stages, since the previous level.
        friction_dissipation: Energy that this slip has dissipated, Σ c × slip.
        rounds: Iterations of the fixed point of Coulomb's friction; 1 without it.
        friction_excess: Largest friction force beyond the limit c, relative to the largest c, at
            least 0.
        driving_force: Where ζ moves supports and obstacles, their work on the bodies per unit of ζ:
            the force along each motion, times the motion for ζ = 1.
        stage: Stage of a loading history; empty without stages, and at rest before them. ζ is then
            the time, which grows by 1 in each stage.
        factors: Factors of loads, temperatures and motions, by their names in stages.
        works: Work of each load with the factor 1 on u (energy).
        driving_forces: Work of each motion on the bodies per unit of its factor.
        bolts: Force in the shank of each bolt (force), tension positive.
        contact_programs: Number of contact quadratic programs solved; 0 without contact.
        snes_vi_programs: Number of those that PETSc's SNES-VI solved by itself. It is 0 with Total
            FETI. It excludes programs whose active sets cycled, so that the condensed program chose
            the set.
        snes_vi_iterations: Iterations of SNES-VI, one active set for each.
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

    def row(self) -> dict[str, Any]:
        """Return the numbers by name; a table is divided, as in ``factor_push`` of ``factors``."""
        row: dict[str, Any] = {}
        for one in fields(self):
            value = getattr(self, one.name)
            if isinstance(value, Mapping):
                row |= {f"{one.name.removesuffix('s')}_{name}": a for name, a in value.items()}
            else:
                row[one.name] = value
        return row

    def summary(self) -> str:
        """Return a one-line summary of the level."""
        if not self.converged:
            return f"zeta={self.zeta:.6g}, no solution: {self.reason}"
        return (
            f"zeta={self.zeta:.6g}, alpha={self.alpha:.6g}, {self.newton_iterations} steps,"
            f" {self.plastic_fraction:.1%} plastic, {self.active_contacts}/{self.contact_pairs}"
            f" contacts, duality_gap={self.duality_gap:.1e}"
        )
