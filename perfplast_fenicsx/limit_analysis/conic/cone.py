"""The protocol of a kind of cone, which is all that the interior point iteration knows of cones.

A program has blocks: points of one kind of cone, or contact pairs. Each point of a block has two
members of cones. The static one is linear in what the point bears, and in unknowns of its own. The
kinematic one, of the dual cone, is linear in its rates where the velocity is right. The iteration
brings the products of both to a multiple of the unit. For this it asks a :class:`Block` for the
middle of its cones, the members of a stress, longest steps, and what products lack. At an iterate
it asks a :class:`ScaledBlock` for moduli, products, and how members follow a velocity.

A law's set at its points, from which blocks are made, is a :class:`PointSets`.

Kinds: :mod:`second_order_cones`, :mod:`semidefinite_cones`, :mod:`half_spaces`. NumPy only.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, Protocol, Self, TypeAlias, runtime_checkable

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.rounding import TINY

PROXIMAL = 1e-5
"""Proximal parameter δ of stresses that nothing bounds: they change by 1/δ times a strain. Larger:
slow where linear elements nearly lock (three times the steps at 1e-4); smaller: K is
ill-conditioned."""

MOST_VISCOUS = 1e4
"""Cap on the initial viscosity of strong bodies, beside those that bear the loads, for the
conditioning of the first K."""

NEAR = 0.1
"""Products between this share of what they should be and its inverse are left as they are."""

Places: TypeAlias = Longs | slice
"""Numbers of points; a slice of all of them copies nothing."""

NO_OWN: Floats = np.zeros(0)
"""Own unknowns of a block that has none."""


@dataclass(frozen=True, eq=False)
class Rates:
    """The rates of a velocity at all points and pairs of a rank.

    Attributes:
        trace: Of the strain rate, in the coordinates of the cones, shape (count,).
        deviator: The same, shape (count, m).
        jumps: [v] of contact pairs, shape (num_pairs,).
    """

    trace: Floats
    deviator: Floats
    jumps: Floats


@dataclass(frozen=True, eq=False)
class Borne:
    """Stress and forces of all points and pairs of a rank; blocks write their parts into these.

    Attributes:
        pressure: p, in the coordinates of the cones, shape (count,).
        deviator: s, the same, shape (count, m).
        forces: r of contact pairs, shape (num_pairs,).
    """

    pressure: Floats
    deviator: Floats
    forces: Floats

    def plus(self, t: float, change: "Borne") -> "Borne":
        """Stress and forces after t times a change."""
        return Borne(
            self.pressure + t * change.pressure,
            self.deviator + t * change.deviator,
            self.forces + t * change.forces,
        )


@dataclass(frozen=True, eq=False)
class Members:
    """Members of the cones of a block, or changes of them.

    Attributes:
        static: Those of what is borne, shape (num, ...).
        kinematic: Those of the rates, the same shape.
        own: Static unknowns that only this block knows, shape (num,), or :data:`NO_OWN`.
    """

    static: Floats
    kinematic: Floats
    own: Floats = field(default_factory=lambda: NO_OWN)

    def plus(self, t: float, change: "Members") -> "Members":
        """The members after t times a change."""
        return Members(
            self.static + t * change.static,
            self.kinematic + t * change.kinematic,
            self.own + t * change.own,
        )


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
        springs: c of ⟨c [v]²⟩ at contact pairs, shape (num_pairs,); None where they are apart.
    """

    bulk: Floats
    a: Floats
    normal: Floats
    along: Floats | None = None
    whole: tuple[Longs, Floats] | None = None
    springs: Floats | None = None

    def with_whole(self, at: Longs, roots: Floats) -> "Moduli":
        """The same but for the whole ones of some more points."""
        if self.whole is not None:
            at, roots = np.concatenate([self.whole[0], at]), np.concatenate([self.whole[1], roots])
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


@dataclass(frozen=True, eq=False)
class Columns:
    """The columns of a conic program in which the unknowns of a block are.

    Attributes:
        pressure: Of p at all points, shape (count,).
        deviator: Of s at all points, shape (count, m).
        forces: Of r, shape (num_pairs,).
        own: Of the block's own unknowns, shape (num,), or no columns.
    """

    pressure: Longs
    deviator: Longs
    forces: Longs
    own: Longs


@dataclass(frozen=True, eq=False)
class ConeRows:
    """Cones of one kind and size, whose members are right + factors · x[columns].

    Attributes:
        kind: Kind of the cones.
        right: Constant parts, shape (num, size).
        columns: Numbers of the unknowns of each member, shape (num, k).
        factors: Shape (num, size, k).
    """

    kind: "ConeKind"
    right: Floats
    columns: Longs
    factors: Floats


class ConeKind(StrEnum):
    """Self-dual cones that conic solvers know."""

    NONNEGATIVE = "nonnegative"
    """Numbers."""
    SECOND_ORDER = "second-order"
    """a₀ ≥ ‖a'‖."""
    SEMIDEFINITE = "semidefinite"
    """Mandel vectors of matrices of 3 × 3."""


@runtime_checkable
class MatrixBlock(Protocol):
    """A block that can be written as rows of a matrix, for solvers of other programs."""

    def rows(self, at: Columns) -> ConeRows:
        """Return the static members as functions of the unknowns."""
        ...

    def from_rows(self, static: Floats, kinematic: Floats, own: Floats) -> Members:
        """Return members from static and dual ones in the rows of :meth:`rows`."""
        ...


class ScaledBlock(Protocol):
    """A block at an iterate, with the scaling of its cones."""

    def stiffen(self, moduli: Moduli) -> Moduli:
        """Return the moduli of all points and pairs, with those of this block."""
        ...

    def products(self, change: Members | None = None) -> Floats:
        """Return the products of the scaled members of the iterate, or of a change of it."""
        ...

    def aim(self, products: Floats) -> Any:
        """Return what :meth:`bear` and :meth:`follow` need for the products to change so."""
        ...

    def bear(self, aim: Any, change: Borne) -> None:
        """Write the change of what is borne that the aim calls for while the velocity stays."""
        ...

    def follow(self, aim: Any, rates: Rates, change: Borne) -> Members:
        """Write the change of what is borne as the velocity changes by these rates.

        Returns:
            The change of the members.
        """
        ...

    def resist(self, rates: Rates, change: Borne) -> Floats:
        """Write what resists these rates alone, by the moduli.

        Returns:
            The change of the block's own unknowns.
        """
        ...


class Block(Protocol):
    """The points of a rank with one kind of cone, or its contact pairs.

    Attributes:
        degree: Sum of the ranks of the cones, each of which counts as much in the gap.
    """

    @property
    def degree(self) -> int:
        """Sum of the ranks of the cones."""
        ...

    def start(self, borne: Borne) -> Members:
        """Write what is borne in the middle of the cones, and return the members there."""
        ...

    def flow(self, moduli: Moduli) -> None:
        """Write the moduli of the flow that units are chosen by, those of :meth:`start`."""
        ...

    def static(self, borne: Borne, own: Floats) -> Floats:
        """Return the static members of what is borne."""
        ...

    def inner(self, now: Members) -> float:
        """Return the sum of the inner products of the members."""
        ...

    def longest(self, now: Members, change: Members) -> float:
        """Return the longest step that keeps the members inside; ∞ if any does."""
        ...

    def raised(self, products: Floats, by: float) -> Floats:
        """Return products with a multiple of the unit added."""
        ...

    def missing(self, products: Floats, mu: float) -> Floats:
        """Return the change that brings outliers nearer to μ; large ones by a limited amount."""
        ...

    def scaled(self, now: Members, rates: Rates) -> ScaledBlock:
        """Return the block at an iterate, whose velocity has these rates."""
        ...

    def viscosities(self, now: Members, rates: Rates, stiffer: float, out: Floats) -> None:
        """Write stress over rate of the points, where rates below 1/``stiffer`` count as that."""
        ...


class PointSets(Protocol):
    """Yield sets of one kind at points of a rank, in the coordinates (p, s) and the user's units.

    Points that are in no such sets have second-order cones (:mod:`second_order_cones`). In the
    coordinates of these a set has a cone around it, whose numbers γ and α are those of its points:
    α > 0 where the set bounds the mean stress, so that bodies dilate.

    Attributes:
        at: Numbers of the points, shape (num,).
    """

    @property
    def at(self) -> Longs:
        """Numbers of the points, shape (num,)."""
        ...

    @property
    def caps(self) -> Floats:
        """Largest mean stress of the sets (stress), ∞ of what has none, shape (num,)."""
        ...

    def those(self, chosen: npt.NDArray[np.bool_] | Longs) -> Self:
        """Return the sets of some of the points, by flags or places among them."""
        ...

    def ratios(self, pressure: Floats, deviator: Floats) -> Floats:
        """Return the gauge of stresses at all points, shape (num,): 1 on the surface of a set."""
        ...

    def powers(self, trace: Floats, deviator: Floats) -> Floats:
        """Return the support function of admissible rates at all points, shape (num,)."""
        ...

    def lacking(self, trace: Floats, deviator: Floats) -> Floats:
        """Return what tr ε lacks for rates at all points to be admissible, shape (num,)."""
        ...

    def block(self, unit: float, strengths: Floats, weights: Floats) -> Block:
        """Return the points as a block of a program.

        Args:
            unit: Of stress.
            strengths: Sizes of the strengths in the program's unit, shape (num,).
            weights: w, shape (num,).
        """
        ...


class LawSet(Protocol):
    """A yield set of another kind, which a law returns as its only cone.

    Its coordinates are the mean stress and the deviator, in plane strain those in the plane.
    """

    def around(self, flat: bool) -> tuple[float, float]:
        """Return γ (stress) and α of a cone ‖s‖ ≤ γ − αp around the set.

        Args:
            flat: Whether it is of the stresses in the plane alone, as in plane strain.
        """
        ...

    def at_points(self, at: Longs, tensors: Floats, flat: bool) -> PointSets:
        """Return the set at points.

        Args:
            at: Numbers of the points.
            tensors: Tensors that p and the components of s are factors of, shape (1 + m, 3, 3).
            flat: As for :meth:`around`; the stress out of the plane is then p.
        """
        ...


@dataclass(frozen=True, eq=False)
class Products:
    """Products of static and kinematic members, block by block.

    They are brought near to one another: an interior point method goes far where all shrink
    together. J. Gondzio, Multiple centrality corrections in a primal-dual method for linear
    programming, Comput. Optim. Appl. 6 (1996), 137, doi:10.1007/BF00249643; for cones with the
    eigenvalues of the products.

    Attributes:
        blocks: Of the program.
        parts: One a block.
    """

    blocks: Sequence[Block]
    parts: Sequence[Floats]

    def __add__(self, other: "Products") -> "Products":
        parts = [one + more for one, more in zip(self.parts, other.parts, strict=True)]
        return Products(self.blocks, parts)

    def __neg__(self) -> "Products":
        return Products(self.blocks, [-part for part in self.parts])

    def raised(self, by: float) -> "Products":
        """Return the products with a number added to their eigenvalues."""
        both = zip(self.blocks, self.parts, strict=True)
        return Products(self.blocks, [block.raised(part, by) for block, part in both])

    def missing(self, mu: float) -> "Products":
        """Return the change that brings outliers nearer to μ; large ones by a limited amount."""
        both = zip(self.blocks, self.parts, strict=True)
        return Products(self.blocks, [block.missing(part, mu) for block, part in both])


def missing_of(values: Floats, mu: float) -> Floats:
    """Return what eigenvalues lack to be near μ, at most ``mu / NEAR`` of large ones."""
    most = mu / NEAR
    missing: Floats = np.maximum(np.clip(values, NEAR * mu, most) - values, -most)
    return missing
