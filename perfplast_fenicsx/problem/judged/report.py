"""Report a level and its iterations in numbers and words, without fields.

Code that reads results needs only this module, and so imports neither DOLFINx nor MPI.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any


@dataclass(frozen=True)
class Iteration:
    """One Newton step, or one iteration of ALG2.

    Attributes:
        number: Number of the iteration, from 1.
        zeta: Load factor ζ.
        alpha: L₁(u) after the step.
        energy: J_ζ(u) after the step.
        increment: Value of the chosen stopping criterion.
        beta: Step length.
        rho: Regularisation ρ of the tangent.
        plastic_fraction: Plastic fraction of the volume after the step.
        active_contacts: Number of closed pairs.
        active_set_iterations: Number of linear solves in the contact quadratic program.
        linear_iterations: Number of Krylov iterations.
        seconds: Wall time since the start of the level.
        extra: Further values of an algorithm, by name. ALG2 stores the relative "primal" and "dual"
            residuals and the "penalty" r.
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
    """The report on a load level; an entry of the steps in ``summary.json``.

    Attributes:
        zeta: Load factor ζ.
        alpha: Work of the live loads α = L₁(u).
        converged: Whether the level was solved.
        reason: Reason for the end of the iteration.
        newton_iterations: Number of Newton steps.
        active_set_iterations: Number of linear solves in the contact quadratic programs.
        linear_iterations: Number of Krylov iterations.
        linear_solves: Number of linear systems solved.
        setups: Number of factorisations and multigrid set-ups.
        damping_min: Smallest step length β.
        plastic_fraction: Plastic fraction of the volume.
        plastic_cells: Number of cells with at least one plastic quadrature point.
        active_contacts: Number of pairs with a contact force.
        contact_pairs: Number of all pairs.
        max_penetration: Largest (u_a − u_b)·n − g, at least 0 (length).
        smallest_contact_force: Smallest contact force of all pairs (force), 0 without pairs; a
            negative value means tension.
        complementarity: Σ force × remaining gap, relative to |Ψ| + ½‖σ‖² like the duality gap.
        equilibrium: Norm of the unbalanced forces without contact forces, relative to the largest
            of several norms. The norms are those of the loads; of the contact forces; of all nodal
            forces if supports move; and, with initial strain or a plastic history, of the forces
            that stress exerts on nodes from all sides.
        duality_gap: J_ζ(u) + S(σ) + Σ force × gap − ⟨reactions, u_D⟩, relative to
            |Ψ(ε(u))| + ½‖σ‖².
        max_displacement: Largest nodal displacement (length).
        seconds: Wall time of the level.
        reactions: Forces on the bodies (:class:`resultants.Resultants`), by source, with one number
            for each direction.
        balance: Larger of the unbalanced force and moment (divided by the size of the bodies),
            relative to the sum of all nodal forces.
        slipping: Number of points with friction that slip; in stages, since the previous level.
        friction_dissipation: Energy that this slip has dissipated, Σ c × slip.
        rounds: Number of fixed-point iterations for Coulomb's friction; 1 without it.
        friction_excess: Largest excess of a friction force over its bound c, relative to the
            largest c, at least 0.
        driving_force: Work of moved supports, moved obstacles and growing overlaps on the bodies
            per unit of ζ: the force along each motion, times the motion at ζ = 1.
        stage: Name of the stage in a loading history; empty without stages, and for the level at
            rest before them. In stages, ζ is the time, which grows by 1 in each stage.
        factors: Factors of loads, temperatures and motions, by their names in stages.
        works: Work on u of each load at factor 1 (energy).
        driving_forces: Work of each motion on the bodies per unit of its factor.
        bolts: Force in the shank of each bolt (force), tension positive.
        contact_programs: Number of contact quadratic programs solved; 0 without contact.
        snes_vi_programs: Number of these programs that PETSc's SNES-VI solved by itself; 0 with
            Total FETI. Programs whose active sets cycled do not count, because the condensed
            program chose their sets.
        snes_vi_iterations: Number of iterations of SNES-VI, each with one active set.
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
        """Return the values by name; a mapping gives a value for each key, as ``factor_NAME``."""
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
