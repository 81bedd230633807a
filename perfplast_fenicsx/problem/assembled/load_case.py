"""Store the loads as vectors: L₀, which acts at any ζ, and L₁, which ζ multiplies.

The energy of (P)_ζ is J_ζ(v) = Ψ(ε(v)) − L₀(v) − ζL₁(v). Only this module evaluates its last two
terms.
"""

from dataclasses import dataclass

from petsc4py import PETSc

from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc


@dataclass(frozen=True)
class LoadCase:
    """Permanent (dead) and live loads; all methods are collective.

    Attributes:
        dead: L₀ as a vector in V's dual, zero at supported unknowns (ghosts summed).
        live: L₁, the loads of ζ = 1, in the same form.
        held: The parts of both that act on supported unknowns, which do no work on displacements
            and which supports carry directly; None if there are no such parts.
    """

    dead: PETSc.Vec
    live: PETSc.Vec
    held: "LoadCase | None" = None

    @staticmethod
    def of(dead: PETSc.Vec, live: PETSc.Vec, bcs: list[fem.DirichletBC]) -> "LoadCase":
        """Return loads from vectors that also have entries at supported unknowns.

        These become zero.
        """
        held = LoadCase(dead.copy(), live.copy())
        for all_of_it, rest in ((dead, held.dead), (live, held.live)):
            fem_petsc.set_bc(all_of_it, bcs)
            rest.axpy(-1.0, all_of_it)
        return LoadCase(dead, live, held)

    def total(self, zeta: float, out: PETSc.Vec) -> PETSc.Vec:
        """Set ``out`` to L₀ + ζL₁ and return it."""
        self.dead.copy(out)
        out.axpy(zeta, self.live)
        return out

    def subtract_from(self, force: PETSc.Vec, zeta: float, times: float = 1.0) -> None:
        """Subtract L₀ + ζL₁ from the internal forces, which gives the gradient of J_ζ.

        Args:
            force: The internal forces.
            zeta: ζ.
            times: Factor of L₀.
        """
        force.axpy(-zeta, self.live)
        force.axpy(-times, self.dead)

    def norm(self, zeta: float) -> float:
        """Return the Euclidean norm of L₀ + ζL₁ (force)."""
        total = self.total(zeta, self.live.duplicate())
        norm = float(total.norm())
        total.destroy()
        return norm

    def alpha(self, u: PETSc.Vec) -> float:
        """Return the work of the live loads α = L₁(u), which work control prescribes."""
        return float(self.live.dot(u))

    def dead_work(self, u: PETSc.Vec) -> float:
        """Return the work of the permanent loads L₀(u)."""
        return float(self.dead.dot(u))

    def work(self, u: PETSc.Vec, zeta: float) -> float:
        """Return the work of all loads L₀(u) + ζL₁(u)."""
        return self.dead_work(u) + zeta * self.alpha(u)

    def add_all_to(self, force: PETSc.Vec, zeta: float) -> None:
        """Add L₀ + ζL₁ with its parts on supported unknowns."""
        for loads in (self, self.held):
            if loads is not None:
                force.axpy(zeta, loads.live)
                force.axpy(1.0, loads.dead)

    def has_dead(self) -> bool:
        """Return whether any load acts at ζ = 0. Collective."""
        return float(self.dead.norm()) > 0

    def grows(self) -> bool:
        """Return whether ζ multiplies any load."""
        return float(self.live.norm()) > 0
