"""The discrete form of a limit load problem: strain rates at points, and a stiffness of moduli."""

from dataclasses import dataclass, replace
from typing import Protocol

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.limit_analysis.conic.principal_cones import PrincipalCones
from perfplast_fenicsx.rounding import TINY

NONE = np.zeros(0, dtype=np.int32)


class SingularStiffness(RuntimeError):
    """A factorisation that has failed, on every rank alike."""


@dataclass(frozen=True)
class Moduli:
    """κ, a, N and b of ⟨κ (tr ε − b:ε)² + a‖dev ε‖² − (N:ε)²⟩ at points, or whole moduli.

    Attributes:
        bulk: κ, shape (count,).
        a: Shape (count,).
        normal: N, a deviator, shape (count, m).
        along: b, a deviator, shape (count, m); None for zero.
        whole: Numbers of the points, shape (num,), whose modulus is RRᵀ of (tr ε, dev ε) instead,
            and R, shape (num, 1 + m, 1 + m); None without such points.
    """

    bulk: Floats
    a: Floats
    normal: Floats
    along: Floats | None = None
    whole: tuple[Longs, Floats] | None = None

    def with_whole(self, at: Longs, roots: Floats) -> "Moduli":
        """Return the same but for the whole ones of some points."""
        return replace(self, whole=(at, roots))

    def first(self, count: int) -> "Moduli":
        """Return those of the first points, among which those with whole moduli are."""
        along = None if self.along is None else self.along[:count]
        return Moduli(self.bulk[:count], self.a[:count], self.normal[:count], along, self.whole)

    def beyond(self, count: int) -> "Moduli":
        """Those of the points after the first ones, where whole moduli are among these."""
        along = None if self.along is None else self.along[count:]
        return Moduli(self.bulk[count:], self.a[count:], self.normal[count:], along)

    def matrices(self) -> Floats:
        """Return the same as forms of (tr ε, dev ε), shape (count, 1 + m, 1 + m)."""
        count, m = self.normal.shape
        found = np.zeros((count, 1 + m, 1 + m))
        found[:, 1:, 1:] = self.a[:, None, None] * np.eye(m)
        found[:, 1:, 1:] -= self.normal[:, :, None] * self.normal[:, None]
        first = np.zeros((count, 1 + m))
        first[:, 0] = 1.0
        if self.along is not None:
            first[:, 1:] = -self.along
        found += self.bulk[:, None, None] * first[:, :, None] * first[:, None]
        if self.whole is not None:
            at, roots = self.whole
            found[at] = roots @ np.swapaxes(roots, 1, 2)
        return found

    def roots(self) -> Floats:
        """R with R Rᵀ = κ(1, −b)(1, −b)ᵀ, and a I − N Nᵀ on the deviator, or the whole modulus.

        Returns:
            Shape (count, 1 + m, 1 + m).
        """
        length2 = np.einsum("ni,ni->n", self.normal, self.normal)
        left = np.sqrt(np.maximum(1 - length2 / self.a, 0.0))
        share = (1 - left) / np.maximum(length2, TINY)
        count, m = self.normal.shape
        roots = np.zeros((count, 1 + m, 1 + m))
        roots[:, 0, 0] = np.sqrt(self.bulk)
        if self.along is not None:
            roots[:, 1:, 0] = -roots[:, :1, 0] * self.along
        along = np.einsum("n,ni,nj->nij", share, self.normal, self.normal)
        roots[:, 1:, 1:] = np.sqrt(self.a)[:, None, None] * (np.eye(m) - along)
        if self.whole is not None:
            at, whole = self.whole
            roots[at] = whole
        return roots


class Strains(Protocol):
    """ε(v) at the points of this rank, and its transpose.

    Stresses are (p, s) in the coordinates of each point's cone, ‖s + γt‖ ≤ γ − αp, and strain rates
    are those that do their work (:mod:`standard_cones`). About the hydrostatic axis p is the mean
    stress and s the deviator, so that rates are trace and deviator, and go by these names.

    Attributes:
        count: Points of this rank.
        size: Components m of a deviator; its norm is that of the tensor.
        gdim: Dimension in which the trace is taken, and pressure acts.
        weights: Volume that a point stands for, shape (count,).
        radii: Yield radius γ (stress) without mean stress, ∞ in elastic bodies, shape (count,).
        slopes: α, by which it falls with the mean stress, shape (count,).
        tilts: t, shape (count, m); None where all are zero.
        principal: The points whose principal stresses are bounded instead; γ and α are there those
            of the narrowest cone of the same apex around that set.
    """

    count: int
    size: int
    gdim: int
    weights: Floats
    radii: Floats
    slopes: Floats
    tilts: Floats | None
    principal: PrincipalCones

    def of(self, y: PETSc.Vec) -> tuple[Floats, Floats]:
        """Trace and deviator of ε(v), shapes (count,) and (count, m). Collective."""
        ...

    def forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to ∫ (p δ + s):ε(v) for all v. Collective."""
        ...

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        ...


class Stiffness(Protocol):
    """K with :class:`Moduli` at the points and c s² for the jump s of each contact pair."""

    @property
    def factorisations(self) -> int:
        """So far."""
        ...

    @property
    def solves(self) -> int:
        """Systems solved so far."""
        ...

    def assemble(self, moduli: Moduli, held: Ints = NONE) -> None:
        """Bring K to moduli at the points, with unknowns that stay zero. Collective."""
        ...

    def jump_diagonal(self) -> Floats:
        """Diagonal entries of the jumps of this rank's pairs. Collective."""
        ...

    def add_at_jumps(self, springs: Floats) -> None:
        """Add c to the diagonal, shape (num_pairs,) on each rank. Collective."""
        ...

    def factorise(self) -> None:
        """Factorise. Collective.

        Raises:
            SingularStiffness: If that fails.
        """
        ...

    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve K x = b with the last factors. Collective."""
        ...

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        ...


@dataclass(frozen=True, eq=False)
class Discretisation:
    """The discrete form of a limit load problem.

    Attributes:
        comm: The ranks.
        strains: Strains of velocities.
        stiffness: Assembled for the same velocities.
        load: L, the loads whose factor λ is sought, as a vector, in the user's units.
        dead: L₀, loads that stay as they are, in the same.
        free: Loads of any factor.
        jumps: Local (owned) entries of velocities that are jumps [v] of contact pairs.
        proves_stress: Whether it is the stress that is to be proven: without cohesion some of the
            slope α is then kept for what rounding leaves, too.
    """

    comm: MPI.Intracomm
    strains: Strains
    stiffness: Stiffness
    load: PETSc.Vec
    dead: PETSc.Vec
    free: PETSc.Vec
    jumps: Ints
    proves_stress: bool = False
