"""The loads as vectors: L₀, which is there at any ζ, and L₁, which ζ multiplies.

The energy of (P)_ζ is J_ζ(v) = Ψ(ε(v)) − L₀(v) − ζL₁(v). What follows from its last two terms is
written here and nowhere else.
"""

from dataclasses import dataclass

from petsc4py import PETSc

from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc


@dataclass(frozen=True)
class LoadCase:
    """Dead and live loads; all methods are collective.

    Attributes:
        dead: L₀ as a vector in V's dual, zero at supported unknowns (ghosts summed).
        live: L₁, the same of the loads of ζ = 1.
        held: What of both acts on supported unknowns, which no displacement sees, and supports
            take up at once; None for nothing.
    """

    dead: PETSc.Vec
    live: PETSc.Vec
    held: "LoadCase | None" = None

    @staticmethod
    def of(dead: PETSc.Vec, live: PETSc.Vec, bcs: list[fem.DirichletBC]) -> "LoadCase":
        """Loads from vectors that have entries at supported unknowns too, which become zero."""
        held = LoadCase(dead.copy(), live.copy())
        for all_of_it, rest in ((dead, held.dead), (live, held.live)):
            fem_petsc.set_bc(all_of_it, bcs)
            rest.axpy(-1.0, all_of_it)
        return LoadCase(dead, live, held)

    def total(self, zeta: float, out: PETSc.Vec) -> PETSc.Vec:
        """Set ``out`` to L₀ + ζL₁, and return it."""
        self.dead.copy(out)
        out.axpy(zeta, self.live)
        return out

    def subtract_from(self, force: PETSc.Vec, zeta: float, times: float = 1.0) -> None:
        """Take L₀ + ζL₁ from the internal forces, which leaves the gradient of J_ζ.

        Args:
            force: The internal forces.
            zeta: ζ.
            times: So many times L₀.
        """
        force.axpy(-zeta, self.live)
        force.axpy(-times, self.dead)

    def norm(self, zeta: float) -> float:
        """Euclidean norm of L₀ + ζL₁ (force)."""
        total = self.total(zeta, self.live.duplicate())
        norm = float(total.norm())
        total.destroy()
        return norm

    def alpha(self, u: PETSc.Vec) -> float:
        """Work of the live loads α = L₁(u), which the work-controlled methods prescribe."""
        return float(self.live.dot(u))

    def dead_work(self, u: PETSc.Vec) -> float:
        """Return the work of the dead loads L₀(u)."""
        return float(self.dead.dot(u))

    def work(self, u: PETSc.Vec, zeta: float) -> float:
        """Return the work of all loads L₀(u) + ζL₁(u)."""
        return self.dead_work(u) + zeta * self.alpha(u)

    def add_all_to(self, force: PETSc.Vec, zeta: float) -> None:
        """Add L₀ + ζL₁ and what of them acts on supported unknowns."""
        for loads in (self, self.held):
            if loads is not None:
                force.axpy(zeta, loads.live)
                force.axpy(1.0, loads.dead)

    def has_dead(self) -> bool:
        """Return whether anything is loaded at ζ = 0. Collective."""
        return float(self.dead.norm()) > 0

    def grows(self) -> bool:
        """Return whether ζ multiplies anything."""
        return float(self.live.norm()) > 0
