"""Define the protocols through which the interior point iteration uses all kinds of cones.

A program has blocks: points with one kind of cone, or contact pairs. Each point or pair of a block
has two cone members. The static member is linear in the stress or force, and in unknowns of the
block. The kinematic member lies in the dual cone. If the velocity is feasible, the kinematic member
is linear in the rates. The iteration drives the Jordan product of both members towards a multiple
of the unit element. A :class:`Block` supplies the centre of its cones, the members of a stress,
step lengths, and corrections of products. At an iterate, a :class:`ScaledBlock` supplies moduli,
products, and the change of the members with the velocity.

A :class:`PointSets` contains the yield sets of a law at its points, and creates a block from these
sets.

:mod:`second_order_cones`, :mod:`semidefinite_cones`, :mod:`parabolas` and :mod:`half_spaces`
implement blocks. This module uses only NumPy.
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
"""Proximal parameter δ for stresses that no cone bounds: in a step, these stresses change by 1/δ
times a strain. With a larger δ, the iteration converges slowly for linear elements that nearly lock
(three times as many steps with 1e-4). With a smaller δ, K is ill-conditioned."""

MOST_VISCOUS = 1e4
"""Largest initial viscosity of strong bodies, relative to the viscosity of the bodies that limit
the loads. The limit keeps the first K well conditioned."""

NEAR = 0.1
"""Fraction q of the target μ: products between qμ and μ/q are not corrected."""

Places: TypeAlias = Longs | slice
"""Indices of points; a slice that selects all points avoids a copy."""

NO_OWN: Floats = np.zeros(0)
"""Empty array, for a block without own unknowns."""


@dataclass(frozen=True, eq=False)
class Rates:
    """Strain rates and contact jumps of a velocity at all points and pairs of a rank.

    Attributes:
        trace: Trace of the strain rate, in the coordinates of the cones, shape (count,).
        deviator: Deviator of the strain rate, in the coordinates of the cones, shape (count, m).
        jumps: Jumps [v] of contact pairs, shape (num_pairs,).
    """

    trace: Floats
    deviator: Floats
    jumps: Floats


@dataclass(frozen=True, eq=False)
class Borne:
    """Stress and forces at all points and pairs of a rank; each block writes its own part.

    Attributes:
        pressure: Mean stress p, in the coordinates of the cones, shape (count,).
        deviator: Deviator s, in the coordinates of the cones, shape (count, m).
        forces: Forces r of contact pairs, shape (num_pairs,).
    """

    pressure: Floats
    deviator: Floats
    forces: Floats

    def plus(self, t: float, change: "Borne") -> "Borne":
        """Return the stress and forces plus t times a change."""
        both = zip(vars(self).values(), vars(change).values(), strict=True)
        return Borne(*(one + t * by for one, by in both))


@dataclass(frozen=True, eq=False)
class Members:
    """Members of the cones of a block, or their changes.

    Attributes:
        static: Static members, functions of stress and forces, shape (num, ...).
        kinematic: Kinematic members, functions of the rates, of the same shape.
        own: Static unknowns that only this block has, shape (num,), or :data:`NO_OWN`.
    """

    static: Floats
    kinematic: Floats
    own: Floats = field(default_factory=lambda: NO_OWN)

    def inner(self) -> float:
        """Return the sum of the inner products of static and kinematic members."""
        axes = "nkab"[: self.static.ndim]
        return float(np.einsum(f"{axes},{axes}->", self.static, self.kinematic))

    def plus(self, t: float, change: "Members") -> "Members":
        """Return the members plus t times a change."""
        both = zip(vars(self).values(), vars(change).values(), strict=True)
        return Members(*(one + t * by for one, by in both))


@dataclass(frozen=True)
class Moduli:
    """Moduli κ, a, N and b of ⟨κ (tr ε − b:ε)² + a‖dev ε‖² − (N:ε)²⟩ at points, or full moduli.

    Attributes:
        bulk: Coefficient κ, shape (count,).
        a: Coefficient a, shape (count,).
        normal: Deviator N, shape (count, m).
        along: Deviator b, shape (count, m); None if b = 0.
        whole: Indices of points that have a full modulus RRᵀ for (tr ε, dev ε) instead, shape
            (num,), and R, shape (num, 1 + m, 1 + m); None without such points.
        springs: Coefficient c of ⟨c [v]²⟩ at contact pairs, shape (num_pairs,); None if the caller
            adds the springs separately.
    """

    bulk: Floats
    a: Floats
    normal: Floats
    along: Floats | None = None
    whole: tuple[Longs, Floats] | None = None
    springs: Floats | None = None

    def with_whole(self, at: Longs, roots: Floats) -> "Moduli":
        """Return these moduli with full moduli RRᵀ at further points.

        Args:
            at: Indices of the points, shape (num,).
            roots: Matrices R, shape (num, j, k), j and k ≤ 1 + m; missing entries are zero.
        """
        size = 1 + self.normal.shape[1]
        roots = np.pad(roots, ((0, 0), *((0, size - length) for length in roots.shape[1:])))
        if self.whole is not None:
            at, roots = np.concatenate([self.whole[0], at]), np.concatenate([self.whole[1], roots])
        return replace(self, whole=(at, roots))

    def first(self, count: int) -> "Moduli":
        """Return the moduli of the first ``count`` points, which include all full moduli."""
        along = None if self.along is None else self.along[:count]
        return Moduli(self.bulk[:count], self.a[:count], self.normal[:count], along, self.whole)

    def beyond(self, count: int) -> "Moduli":
        """Return the moduli of the points from ``count`` on; these points have no full moduli."""
        along = None if self.along is None else self.along[count:]
        return Moduli(self.bulk[count:], self.a[count:], self.normal[count:], along)

    def matrices(self) -> Floats:
        """Return the moduli as quadratic forms of (tr ε, dev ε), shape (count, 1 + m, 1 + m)."""
        roots = self.roots()
        return roots @ np.swapaxes(roots, 1, 2)

    def roots(self) -> Floats:
        """Return factors R of the moduli RRᵀ, shape (count, 1 + m, 1 + m).

        RRᵀ is κ(1, −b)(1, −b)ᵀ plus a I − N Nᵀ on the deviator, or the full modulus of the point.
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
    """The columns of a conic program for the unknowns of a block.

    Attributes:
        pressure: Columns of p at all points, shape (count,).
        deviator: Columns of s at all points, shape (count, m).
        forces: Columns of r, shape (num_pairs,).
        own: Columns of the block's own unknowns, shape (num,), possibly empty.
    """

    pressure: Longs
    deviator: Longs
    forces: Longs
    own: Longs


@dataclass(frozen=True, eq=False)
class ConeRows:
    """Cones of one kind and size, with the members right + factors · x[columns].

    Attributes:
        kind: Kind of the cones.
        right: Constant parts, shape (num, size).
        columns: Indices of the unknowns in each member, shape (num, k).
        factors: Coefficients of these unknowns, shape (num, size, k).
    """

    kind: "ConeKind"
    right: Floats
    columns: Longs
    factors: Floats


class ConeKind(StrEnum):
    """Self-dual cones that conic solvers support."""

    NONNEGATIVE = "nonnegative"
    """Non-negative numbers."""
    SECOND_ORDER = "second-order"
    """Second-order cone a₀ ≥ ‖a'‖."""
    SEMIDEFINITE = "semidefinite"
    """Positive semidefinite 3 × 3 matrices as Mandel vectors."""


@runtime_checkable
class MatrixBlock(Protocol):
    """A block that can write its members as rows of a matrix, for external solvers."""

    def rows(self, at: Columns) -> ConeRows:
        """Return the static members as linear functions of the unknowns."""
        ...

    def from_rows(self, static: Floats, kinematic: Floats, own: Floats) -> Members:
        """Return the members, given as static and dual vectors in the order of :meth:`rows`."""
        ...


class ScaledBlock(Protocol):
    """A block at an iterate, with the scaling of its cones."""

    def stiffen(self, moduli: Moduli) -> Moduli:
        """Write this block's moduli into those of all points and pairs, and return the result."""
        ...

    def products(self, change: Members | None = None) -> Floats:
        """Return the products of the scaled members, or of a change of the members."""
        ...

    def aim(self, products: Floats) -> Any:
        """Return the data that :meth:`bear` and :meth:`follow` need to change the products."""
        ...

    def bear(self, aim: Any, change: Borne) -> None:
        """Write the change of stress and forces that reaches the aim at a constant velocity."""
        ...

    def follow(self, aim: Any, rates: Rates, change: Borne) -> Members:
        """Write the change of stress and forces that reaches the aim with these additional rates.

        Returns:
            The change of the members.
        """
        ...

    def resist(self, rates: Rates, change: Borne) -> Floats:
        """Write the stress and forces that follow from the rates by the moduli alone.

        Returns:
            The change of the block's own unknowns.
        """
        ...


class Block(Protocol):
    """The points of a rank with one kind of cone, or the contact pairs of a rank.

    Attributes:
        degree: Sum of the ranks of the cones; the gap divided by this sum is the mean product.
    """

    @property
    def degree(self) -> int:
        """Return the sum of the ranks of the cones."""
        ...

    def start(self, borne: Borne) -> Members:
        """Write the stress at the centre of the cones, and return the members at this stress."""
        ...

    def flow(self, moduli: Moduli) -> None:
        """Write the moduli at the initial stress, for the flow that determines the units."""
        ...

    def static(self, borne: Borne, own: Floats) -> Floats:
        """Return the static members of stress and forces."""
        ...

    def longest(self, a: Floats, da: Floats) -> float:
        """Return the largest t with a + t da in the cones, if a is inside; ∞ without a limit."""
        ...

    def raised(self, products: Floats, by: float) -> Floats:
        """Return the products plus ``by`` times the unit element."""
        ...

    def missing(self, products: Floats, mu: float) -> Floats:
        """Return the change that brings outlying products closer to μ; decreases are limited."""
        ...

    def scaled(self, now: Members, rates: Rates) -> ScaledBlock:
        """Return the block at an iterate, from the rates of the iterate's velocity."""
        ...


class PointSets(Protocol):
    """Yield sets of one kind at points of a rank, in the coordinates (p, s) and the user's units.

    Points that belong to no :class:`PointSets` have second-order cones (:mod:`second_order_cones`).
    A second-order cone, with γ and α of the point, also encloses each set of a :class:`PointSets`.
    If a set bounds the mean stress, α > 0 and the body dilates.

    Attributes:
        at: Indices of the points, shape (num,).
    """

    @property
    def at(self) -> Longs:
        """Return the indices of the points, shape (num,)."""
        ...

    @property
    def caps(self) -> Floats:
        """Return the tensile strength (stress) of each set, ∞ if it has none, shape (num,)."""
        ...

    def those(self, chosen: npt.NDArray[np.bool_] | Longs) -> Self:
        """Return the sets at the points that ``chosen`` selects by flags or indices."""
        ...

    def ratios(self, pressure: Floats, deviator: Floats) -> Floats:
        """Return the gauge (1 on a set's surface) from stresses at all points, shape (num,)."""
        ...

    def powers(self, trace: Floats, deviator: Floats) -> Floats:
        """Return the support function from admissible rates at all points, shape (num,)."""
        ...

    def lacking(self, trace: Floats, deviator: Floats) -> Floats:
        """Return the amount by which tr ε is too small for admissible rates, shape (num,)."""
        ...

    def block(self, unit: float, weights: Floats) -> Block:
        """Return the points as a block of a program.

        Args:
            unit: Unit of stress.
            weights: Weights w, shape (num,).
        """
        ...


class LawSet(Protocol):
    """A yield set other than a second-order cone, which a law returns as its only cone.

    The coordinates are the mean stress and the deviator; in plane strain, the mean and the deviator
    of the in-plane stress.
    """

    def around(self, flat: bool) -> tuple[float, float]:
        """Return γ (stress) and α of a cone ‖s‖ ≤ γ − αp that encloses the set.

        Args:
            flat: Whether the set contains only in-plane stresses, as in plane strain.
        """
        ...

    def at_points(self, at: Longs, tensors: Floats, flat: bool) -> PointSets:
        """Return the set at points.

        Args:
            at: Indices of the points.
            tensors: Tensors whose coefficients in a stress are p and the components of s, shape
                (1 + m, 3, 3).
            flat: As for :meth:`around`; the out-of-plane stress is then p.
        """
        ...


@runtime_checkable
class Provable(Protocol):
    """A :class:`LawSet` that proof files can describe; strict bounds support such sets."""

    def on_file(self) -> dict[str, float]:
        """Return the numbers that describe the set, by the names of arrays in the proof file.

        If a name is missing, ``cone_slope`` and ``cone_matrix`` count as zero, others as NaN.
        """
        ...


@dataclass(frozen=True, eq=False)
class Products:
    """Products of static and kinematic members, for each block.

    Corrections keep the products close to each other, because an interior point method takes long
    steps if all products decrease together. J. Gondzio, Multiple centrality corrections in a
    primal-dual method for linear programming, Comput. Optim. Appl. 6 (1996), 137,
    doi:10.1007/BF00249643; for cones, the corrections apply to the eigenvalues of the products.

    Attributes:
        blocks: Blocks of the program.
        parts: Products of each block.
    """

    blocks: Sequence[Block]
    parts: Sequence[Floats]

    def __add__(self, other: "Products") -> "Products":
        parts = [one + more for one, more in zip(self.parts, other.parts, strict=True)]
        return Products(self.blocks, parts)

    def __neg__(self) -> "Products":
        return Products(self.blocks, [-part for part in self.parts])

    def raised(self, by: float) -> "Products":
        """Return the products with ``by`` added to their eigenvalues."""
        both = zip(self.blocks, self.parts, strict=True)
        return Products(self.blocks, [block.raised(part, by) for block, part in both])

    def missing(self, mu: float) -> "Products":
        """Return the change that brings outlying products closer to μ; decreases are limited."""
        both = zip(self.blocks, self.parts, strict=True)
        return Products(self.blocks, [block.missing(part, mu) for block, part in both])


class SystemPoints(Protocol):
    """The common part of blocks with an unknown t at each point, which no other equation contains.

    Static members are linear in y = (t, p, s), X = h + Gy. Multipliers satisfy −Gᵀz = w(0, tr ε,
    dev ε).

    Attributes:
        at: Indices of the points, shape (num,).
        weights: Weights w, shape (num,).
        size: Number m of the components of s that belong to the sets. Further components belong to
            sets of other kinds.
        constants: Members h at y = 0.
    """

    at: Longs
    weights: Floats
    size: int
    constants: Floats

    def changes(self, y: Floats) -> Floats:
        """Return Gy, with the shape of the members, from y of shape (num, 2 + m)."""

    def works(self, kinematic: Floats) -> Floats:
        """Return Gᵀz, shape (num, 2 + m)."""

    def least(self, works: Floats) -> Floats:
        """Return a small z with given :meth:`works`."""

    def chosen(self, own: Any, pressure: Any, deviator: Any) -> Any:
        """Return y, shape (num, 2 + m), from t at these points, and p and s at all points."""
        return np.column_stack([own, pressure[self.at], deviator[self.at, : self.size]])

    def static(self, borne: Borne, own: Floats) -> Floats:
        """See :meth:`Block.static`."""
        return self.constants + self.changes(self.chosen(own, borne.pressure, borne.deviator))


class ScaledSystems:
    """The common part of :class:`SystemPoints` at an iterate; see :class:`ScaledBlock`.

    With the scaling of Nesterov and Todd, products change by Λ∘r̃ if dx̃ + dz̃ = r̃. It follows that

        H dy = G̃ᵀ r̃ + Gᵀz + w(ε + dε),    H = G̃ᵀG̃.

    The modulus of a point is H⁻¹ without the row and column of t. The data of an aim are r̃, and r̃
    as vectors in the order of the rows of G̃, shape (num, k).
    """

    def __init__(
        self, block: SystemPoints, scaling: Any, columns: Floats, now: Members, rates: Rates
    ) -> None:
        """Factorise H, from G̃, shape (num, k, 2 + m); further rows only add products to H."""
        self._block, self.scaling, self._columns = block, scaling, columns
        triangles = np.linalg.qr(columns, mode="r")
        self._roots: Floats = np.asarray(np.linalg.inv(triangles), dtype=np.float64)
        self._off = block.works(now.kinematic) + self._rates(rates)

    def _rates(self, rates: Rates) -> Floats:
        """Return w(0, tr ε, dev ε), shape (num, 2 + m)."""
        block, zeros = self._block, np.zeros(len(self._block.at))
        found: Floats = block.weights[:, None] * block.chosen(zeros, rates.trace, rates.deviator)
        return found

    def stiffen(self, moduli: Moduli) -> Moduli:
        """See :meth:`ScaledBlock.stiffen`."""
        roots = self._roots[:, 1:, 1:]  # this block of the inverse is also triangular
        return moduli.with_whole(self._block.at, roots)

    def bear(self, aim: tuple[Floats, Floats], change: Borne) -> None:
        """See :meth:`ScaledBlock.bear`."""
        self._respond(aim[1], self._off, change)

    def follow(self, aim: tuple[Floats, Floats], rates: Rates, change: Borne) -> Members:
        """See :meth:`ScaledBlock.follow`."""
        block, off = self._block, self._off + self._rates(rates)
        dy = self._respond(aim[1], off, change)
        static = block.changes(dy)
        kinematic: Floats = self.scaling.undone(aim[0] - self.scaling.primal(static))
        left = block.works(kinematic) + off  # more than rounding if not admissible
        return Members(static, kinematic - block.least(left), dy[:, 0])

    def resist(self, rates: Rates, change: Borne) -> Floats:
        """See :meth:`ScaledBlock.resist`."""
        return self._respond(np.zeros((len(self._off), 0)), self._rates(rates), change)[:, 0]

    def _respond(self, numbers: Floats, works: Floats, change: Borne) -> Floats:
        """Write the stress of dy = H⁻¹(G̃ᵀ ``numbers`` + ``works``), and return dy."""
        right = works + np.einsum("nij,ni->nj", self._columns[:, : numbers.shape[1]], numbers)
        half = np.einsum("nji,nj->ni", self._roots, right)
        dy: Floats = np.einsum("nij,nj->ni", self._roots, half)
        at = self._block.at
        change.pressure[at], change.deviator[at, : self._block.size] = dy[:, 1], dy[:, 2:]
        return dy


def missing_of(values: Floats, mu: float) -> Floats:
    """Return the change of outlying eigenvalues towards μ, with decreases of at most μ/NEAR."""
    most = mu / NEAR
    missing: Floats = np.maximum(np.clip(values, NEAR * mu, most) - values, -most)
    return missing
