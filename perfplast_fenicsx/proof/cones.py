"""Define bounds on stresses, ‖Mσ‖ ≤ c − q·σ, and the dissipation of each material.

A second form is (1 + s)σ₁ − (1 − s)σ₃ ≤ c for principal stresses (:mod:`principal`). In this form,
strain rates are admissible if tr ε ≥ s Σ|ε_i|, and their dissipation is (c/2s) tr ε. For s = 0,
admissible rates have tr ε = 0, and their dissipation is (c/2) Σ|ε_i|. With the additional condition
σ₁ ≤ f, rates are admissible if tr ε ≥ s Σ|ε_i| for any s ≥ 0, and their dissipation is (f − h) tr ε
+ h Σ|ε_i| with h = (c/2 − sf)/(1 − s). A third form is a parabola of in-plane principal stresses
(:mod:`parabola`), whose tensile strength is c.

Stresses are vectors of the components (σ_xx, σ_yy, √2σ_xy) in 2D, (σ_rr, σ_zz, σ_θθ, √2σ_rz) in
axisymmetry, and (σ_xx, σ_yy, σ_zz, √2σ_yz, √2σ_xz, √2σ_xy) in 3D. Strain rates have the same form,
so σ:ε is the scalar product of the two vectors. By duality the supremum of σ:ε is the least cz with
ε = Mᵀy + qz and ‖y‖ ≤ z. With y = η − rz for η = M⁺ᵀε and r = M⁺ᵀq, the least z is

- if M has a null vector ν with q·ν > 0: z = ε·ν/(q·ν), where ‖η − rz‖ ≤ z must hold;
- otherwise, for ‖r‖ < 1: z = (√((η·r)² + (1 − ‖r‖²)‖η‖²) − η·r)/(1 − ‖r‖²), where ε·ν must be zero
  if M has a null vector ν.

The first expression for z is linear in ε, and the second is convex in ε.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof import parabola
from perfplast_fenicsx.proof.balls import U, norms_of
from perfplast_fenicsx.proof.plain_arrays import ProofError, check_sizes
from perfplast_fenicsx.proof.principal import (
    check_principal,
    eigenvalues,
    power_factors,
    rate_sizes,
)

Floats = npt.NDArray[np.float64]
Longs = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


RANK = 1e-6
"""Least ratio of a matrix's nonzero singular values to its largest singular value."""

ROUNDED = 2e-15
"""Ratio of singular values, or of q·ν to ‖q‖, below which the smaller number counts as zero.

A large pressure multiplies what counts as zero. The lower half pays for a change of M and q by 128
roundings (:mod:`lower`), which include these numbers and the tolerance of :mod:`cone_shapes`.
"""

MOST_DIGITS = 1e-3
"""Largest relative rounding error of a dissipation that the checker supports."""

STEEPEST = 1 - 1e-9
"""Largest ‖r‖ of cones that have no null vector ν with q·ν > 0."""


def vectors(tensors: Floats) -> Floats:
    """Return the vectors of symmetric matrices, shape (..., m) from (..., d, d)."""
    d = tensors.shape[-1]
    pairs = [(0, 1)] if d == 2 else [(1, 2), (0, 2), (0, 1)]
    columns = [tensors[..., i, i] for i in range(d)]
    root = np.sqrt(0.5)
    columns += [root * (tensors[..., i, j] + tensors[..., j, i]) for i, j in pairs]
    return np.stack(columns, axis=-1)


@dataclass(frozen=True)
class Cones:
    """The cones of all materials, by their index.

    Attributes:
        bound: Bound c ≥ 0 (stress); 0 for a cone with its apex at zero stress; shape (num_cones,).
        slope: Slope q, shape (num_cones, m).
        matrix: Matrix M of rank m or m − 1, possibly with zero rows, shape (num_cones, m, m).
        sine: Sine s of cones that bound principal stresses, whose M and q are zero; NaN for other
            cones; shape (num_cones,).
        tension: Tensile strength f of cones that bound principal stresses; NaN without a tensile
            strength, and for other cones; shape (num_cones,).
        curvature: Factor k of parabolas, whose M and q are zero; NaN for other cones; shape
            (num_cones,).
    """

    bound: Floats
    slope: Floats
    matrix: Floats
    sine: Floats
    tension: Floats
    curvature: Floats

    @property
    def is_curved(self) -> Flags:
        """Return flags of cones that are parabolas."""
        return ~np.isnan(self.curvature)

    @property
    def is_pointwise(self) -> Flags:
        """Return flags of bounds of principal stresses, and of parabolas."""
        return self.is_principal | self.is_curved

    @property
    def is_cut(self) -> Flags:
        """Return flags of cones with a tensile strength."""
        return ~np.isnan(self.tension)

    @property
    def is_principal(self) -> Flags:
        """Return flags of cones that bound principal stresses."""
        return ~np.isnan(self.sine)

    def check(self, m: int) -> None:
        """Refuse cones that do not contain zero, or whose admissible rates are not supported.

        Args:
            m: Number of components of a stress.

        Raises:
            ProofError: If a cone is refused.
        """
        n = len(self.bound) if self.bound.ndim == 1 else -1
        if n < 0 or self.slope.shape != (n, m) or self.matrix.shape != (n, m, m):
            raise ProofError("the shape of cone_bound, cone_slope or cone_matrix is not valid.")
        if not (np.isfinite(self.bound) & (self.bound >= 0)).all():
            raise ProofError("a cone's bound is not finite, or is negative.")
        if not (np.isfinite(self.slope).all() and np.isfinite(self.matrix).all()):
            raise ProofError("a cone's slope or matrix is not finite.")
        if not self.sine.shape == self.tension.shape == self.curvature.shape == (n,):
            raise ProofError("the shape of cone_sine, _tension or _curvature is not valid.")
        principal, curved = self.is_principal, self.is_curved
        parabola.check_parabolas(self.curvature[curved], self.bound[curved], m)
        if (principal & curved).any():
            raise ProofError("cone_curvature is given for a cone with a sine.")
        if self.is_cut[~principal].any():
            raise ProofError(
                "cone_tension is given for a cone that does not bound principal stresses."
            )
        bound, sine, tension = self.bound[principal], self.sine[principal], self.tension[principal]
        check_principal(bound, sine, tension, (RANK, STEEPEST))
        if self.slope[self.is_pointwise].any() or self.matrix[self.is_pointwise].any():
            raise ProofError("a cone of principal stresses has a slope or a matrix.")
        sizes = [
            np.abs(part).max(axis=tuple(range(1, part.ndim)), initial=0.0)
            for part in (self.slope, self.matrix)
        ]
        for part in (self.bound, *sizes):
            check_sizes("a cone", part)
        Cones(*(part[~self.is_pointwise] for part in vars(self).values()))._check_quadratic()

    def _check_quadratic(self) -> None:
        """Check the second-order cones, whose entries are known to be finite."""
        values = np.linalg.svd(self.matrix, compute_uv=False)
        largest = values[:, :1]
        if not (values[:, -2:-1] > RANK * largest).all():
            raise ProofError("a cone's matrix leaves more than one stress free.")
        last = values[:, -1:]
        if not ((last <= ROUNDED * largest) | (last > RANK * largest)).all():
            raise ProofError("a cone's matrix is nearly singular.")
        if not (self.grows | (self.bound > 0)).all():
            raise ProofError("a cone's bound is not positive, and no slope closes it.")
        pull, size = np.abs(self._pull), np.linalg.norm(self.slope, axis=1)
        if not (~self.has_null | (pull <= ROUNDED * size) | (pull > RANK * size)).all():
            raise ProofError("a cone's slope along its matrix's null vector is nearly zero.")
        flat = np.linalg.norm(self._tilt, axis=1) < STEEPEST
        if not ((flat | self.grows).all() and (self.digits <= MOST_DIGITS).all()):
            raise ProofError("a cone is too steep for its rates to be supported.")

    @cached_property
    def has_null(self) -> Flags:
        """Return flags of cones with a null vector of M, along which M bounds no stress."""
        values = np.linalg.svd(self.matrix, compute_uv=False)
        return np.asarray(values[:, -1] <= ROUNDED * values[:, 0])

    @cached_property
    def _null(self) -> Floats:
        """Return the unit null vector ν of each M, or zero if M has no null vector."""
        found = np.linalg.svd(self.matrix)[2][:, -1]
        return np.asarray(np.where(self.has_null[:, None], found, 0.0))

    @cached_property
    def _pull(self) -> Floats:
        """Return q·ν of each cone."""
        return np.einsum("ni,ni->n", self.slope, self._null)

    @cached_property
    def grows(self) -> Flags:
        """Return flags of cones that narrow along ν or bound the mean stress: materials dilate."""
        falls = np.abs(self._pull) > RANK * np.linalg.norm(self.slope, axis=1)
        return falls | (self.sine > 0) | self.is_cut | self.is_curved

    @property
    def is_linear(self) -> Flags:
        """Return flags of cones whose dissipation is linear in admissible rates."""
        return self.grows & ~self.is_cut & ~self.is_curved

    @cached_property
    def _back(self) -> Floats:
        """Return M⁺ᵀ of each cone."""
        inverse = np.linalg.pinv(self.matrix, rcond=RANK / 2)
        return np.asarray(inverse.transpose(0, 2, 1), dtype=np.float64)

    @cached_property
    def _tilt(self) -> Floats:
        """Return M⁺ᵀq of each cone."""
        return np.einsum("nij,nj->ni", self._back, self.slope)

    @cached_property
    def radius(self) -> Floats:
        """Return a scale of each material's stresses: c over the largest singular value of M.

        For bounds of principal stresses, all stresses of size c/√(2(1 + s²)) are admissible unless
        a principal stress exceeds f.
        """
        values = np.linalg.svd(self.matrix, compute_uv=False)[:, 0]
        sines = np.where(self.is_principal, self.sine, 0.0)
        steepest = np.where(self.is_principal, np.sqrt(2 * (1 + sines**2)), values)
        steepest[self.is_curved] = 1.0
        found = self.bound / steepest
        here = self.is_curved
        found[here] = 1 / parabola.most_gauge(self.curvature[here], self.bound[here])
        return np.where(self.is_cut, np.minimum(found, self.tension), found)

    @property
    def weakness(self) -> Floats:
        """Return upper bounds on the increase of :meth:`ratios` by a stress of size 1 if c > 0."""
        found = 1 / self.radius + np.linalg.norm(self.slope, axis=1) / self.bound
        rounding = 1e-12  # relative error of singular values
        return np.asarray(found * (1 + rounding))

    @cached_property
    def growth(self) -> Floats:
        """Return upper bounds on the increase of :meth:`excess` by a stress of size 1."""
        values = np.linalg.svd(self.matrix, compute_uv=False)[:, 0]
        rounding = 1e-12  # relative error of singular values
        return np.asarray((values + np.linalg.norm(self.slope, axis=1)) * (1 + rounding))

    @cached_property
    def relief(self) -> Floats:
        """Return the least decrease of :meth:`excess` by a pressure of 1; 0 if it may increase."""
        normals = {3: 2, 4: 3, 6: 3}[self.slope.shape[1]]
        along = self.slope[:, :normals].sum(axis=1)
        across = np.linalg.norm(self.matrix[:, :, :normals].sum(axis=2), axis=1)
        return np.asarray(np.maximum(along - across, 0.0))

    def excess(self, at: Longs, stress: Floats) -> Floats:
        """Return ‖Mσ‖ + q·σ, at most c inside cones that do not bound principal stresses.

        Args:
            at: Cone of each cell, shape (num_cells,).
            stress: Vectors at some points of each cell, shape (num_cells, points, m).
        """
        sizes = np.linalg.norm(np.einsum("cij,cvj->cvi", self.matrix[at], stress), axis=2)
        return np.asarray(sizes + np.einsum("ci,cvi->cv", self.slope[at], stress))

    def own_radius(self, at: Longs, stress: Floats) -> Floats:
        """Return the radius of each cell's cone; for c = 0, with −q·σ instead of c.

        For c = 0, the radius is the least over the cell's points with a nonzero stress; ∞ if the
        stress is zero at all points.

        Args:
            at: Cone of each cell, shape (num_cells,).
            stress: Vectors at some points of each cell, shape (num_cells, points, m).
        """
        found = self.radius[at]
        loose = self.bound[at] == 0
        if loose.any():
            steepest = np.linalg.svd(self.matrix, compute_uv=False)[at[loose], 0]
            heads = -np.einsum("ci,cvi->cv", self.slope[at[loose]], stress[loose])
            borne = np.where(stress[loose].any(axis=2), np.maximum(heads, 0.0), np.inf)
            found[loose] = borne.min(axis=1) / steepest
        return found

    def ratios(self, at: Longs, stress: Floats) -> Floats:
        """Return (‖Mσ‖ + q·σ)/c, or the equivalent ratio for principal stresses.

        A stress divided by its ratio lies in the cone. For c = 0, the ratio is ‖Mσ‖/(−q·σ), or 0
        for zero stress; the ratio is at most 1 in the cone.

        Args:
            at: Cone of each cell, shape (num_cells,).
            stress: Vectors at some points of each cell, shape (num_cells, points, m).
        """
        sizes = np.linalg.norm(np.einsum("cij,cvj->cvi", self.matrix[at], stress), axis=2)
        along = np.einsum("ci,cvi->cv", self.slope[at], stress)
        here = self.is_principal[at]
        if here.any():
            s, values = self.sine[at[here], None], eigenvalues(stress[here])
            along[here] = (1 + s) * values[..., 2] - (1 - s) * values[..., 0]
            cut, pulled = self.is_cut[at[here]], self.bound[at[here]] / self.tension[at[here]]
            pulled = np.where(cut, pulled, 0.0)[:, None] * values[..., 2]
            along[here] = np.where(cut[:, None], np.maximum(along[here], pulled), along[here])
        curved = self.is_curved[at]
        if curved.any():  # here ``along`` is c times the gauge
            k, f = (of[at[curved], None] for of in (self.curvature, self.bound))
            along[curved] = f * parabola.gauges(k, f, stress[curved])
        loose = self.bound[at] == 0
        found: Floats = (sizes + along) / np.where(loose, 1.0, self.bound[at])[:, None]
        if loose.any():
            pressed = along[loose] < 0
            own = np.where(pressed, sizes[loose] / np.where(pressed, -along[loose], 1.0), np.inf)
            found[loose] = np.where(stress[loose].any(axis=2), own, 0.0)
        return found

    def _at_apex(self, at: Longs, rates: Floats) -> tuple[Floats, Floats]:
        """Return z and ‖y‖ of dilating cells; the values of other cells have no meaning."""
        free = np.einsum("ci,cvi->cv", self._null[at], rates)
        pull = np.where(self.grows & ~self.is_curved, self._pull, 1.0)[at, None]
        heads: Floats = free / pull
        rest = rates - heads[..., None] * self.slope[at][:, None]
        return heads, norms_of(np.einsum("cij,cvj->cvi", self._back[at], rest))

    def linear_power(self, at: Longs, rates: Floats) -> Floats:
        """Return the dissipation c max(z, ‖y‖) per volume, which is linear in admissible rates."""
        heads, sizes = self._at_apex(at, rates)
        found: Floats = self.bound[at, None] * np.maximum(heads, sizes)
        here = self.is_principal[at]
        if here.any():
            s, (traces, sizes) = self.sine[at[here], None], rate_sizes(rates[here])
            found[here] = self.bound[at[here], None] / (2 * s) * np.maximum(traces, s * sizes)
        return found

    def principal_power(self, at: Longs, rates: Floats) -> Floats:
        """Return the dissipation per volume of cones that are ``is_pointwise``.

        The dissipation is convex in admissible rates.
        """
        factors = power_factors(self.bound[at], self.sine[at], self.tension[at])
        of_trace, of_sizes = (factor[:, None] for factor in factors)
        (traces, sizes), s = rate_sizes(rates), self.sine[at, None]
        short = np.where(self.is_cut[at, None], np.maximum(s * sizes - traces, 0.0), 0.0)
        found: Floats = of_trace * traces + np.abs(of_trace) * short + of_sizes * sizes
        here = self.is_curved[at]
        if here.any():
            k, f = (of[at[here], None] for of in (self.curvature, self.bound))
            found[here] = parabola.powers(k, f, rates[here])
        return found

    @cached_property
    def digits(self) -> Floats:
        """Return the relative rounding error of numbers computed from a cone and a rate.

        The dissipation contains 1/(1 − ‖r‖²), or 1/(q·ν) with an error of ν.
        """
        values = np.linalg.svd(self.matrix, compute_uv=False)
        last = np.where(self.has_null, values[:, -2], values[:, -1])
        last = np.where(self.is_pointwise, 1.0, last)
        worst = np.where(self.is_pointwise, 1.0, values[:, 0]) / last
        square = 1 - np.einsum("ni,ni->n", self._tilt, self._tilt)
        flat = np.linalg.norm(self._tilt, axis=1) < STEEPEST
        worst = worst / np.where(flat & ~self.grows, square, 1.0)
        closes = self.grows & ~self.is_pointwise
        sizes = np.where(closes, np.linalg.norm(self.slope, axis=1), 1.0)
        return np.asarray(256 * U * worst * sizes / np.where(closes, np.abs(self._pull), 1.0))

    @cached_property
    def steepness(self) -> Floats:
        """Return an upper bound on the Lipschitz constant of each cone's dissipation per volume.

        For this constant, the dissipation is extended to all rates, admissible or not; the
        extension is convex and homogeneous of degree 1.
        """
        back = np.linalg.norm(self._back, ord=2, axis=(1, 2))
        square = 1 - np.einsum("ni,ni->n", self._tilt, self._tilt)
        found = self.bound * back * (1 + np.sqrt(np.maximum(1 - square, 0.0))) / np.abs(square)
        found = np.where(self.is_linear, self.bound * self.alertness, found)
        of_trace, of_sizes = power_factors(self.bound, self.sine, self.tension)
        some = np.sqrt(3.0) * (np.abs(of_trace) * (2 + self.sine) + of_sizes)
        apex = np.sqrt(3.0) * self.bound / (2 * np.where(self.sine > 0, self.sine, 1.0))
        some = np.where(self.is_linear, apex, some)
        found = np.where(self.is_principal, some, found)
        here = self.is_curved
        found[here] = parabola.steepest(self.curvature[here], self.bound[here])
        return np.asarray(found * (1 + self.digits))

    @cached_property
    def alertness(self) -> Floats:
        """Return upper bounds on the change of the lack of dilatancy (:meth:`short`) at rate 1."""
        pull = np.where(np.abs(self._pull) > 0, np.abs(self._pull), 1.0)
        back = np.linalg.norm(self._back, ord=2, axis=(1, 2))
        found = 1 / pull + back * (1 + np.linalg.norm(self.slope, axis=1) / pull)
        principal = np.sqrt(3.0) * (1 + np.where(self.is_principal, self.sine, 0.0))
        found = np.where(self.is_principal, principal, found)
        found = np.where(self.is_curved, np.sqrt(2.0) * (1 + parabola.GENTLEST), found)
        return np.asarray(found * (1 + self.digits))

    def short(self, at: Longs, rates: Floats) -> Floats:
        """Return ‖y‖ − z of dilating cells, which is at most zero for admissible rates.

        For bounds of principal stresses, the function returns s Σ|ε_i| − tr ε, and for parabolas
        δ(ε₁ − ε₃) − tr ε.

        Args:
            at: Cone of each cell, shape (num_cells,).
            rates: Vectors, shape (num_cells, places, m).
        """
        heads, sizes = self._at_apex(at, rates)
        found = sizes - heads
        here = self.is_principal[at]
        if here.any():
            traces, sizes = rate_sizes(rates[here])
            found[here] = self.sine[at[here], None] * sizes - traces
        here = self.is_curved[at]
        if here.any():
            growth, shear = parabola.sizes(rates[here])
            found[here] = parabola.GENTLEST * shear - growth
        return np.asarray(found)

    def keeps_volume(self, normals: int) -> Flags:
        """Return flags of cones that admit a rate if and only if its trace is zero.

        Args:
            normals: Number of normal components, which come first in a vector.
        """
        unit = np.zeros(self.slope.shape[1])
        unit[:normals] = 1 / np.sqrt(normals)
        bounded = np.linalg.norm(self.matrix @ unit, axis=1)
        along = np.abs(self.slope @ unit) <= ROUNDED * np.linalg.norm(self.slope, axis=1)
        along &= bounded <= ROUNDED * np.linalg.norm(self.matrix, ord=2, axis=(1, 2))
        quadratic = self.has_null & ~self.grows & along
        return np.asarray(np.where(self.is_principal, ~self.grows, quadratic))

    @property
    def takes_any(self) -> Flags:
        """Return flags of cones that admit every rate."""
        return ~self.has_null & ~self.grows & ~self.is_principal

    def convex_power(self, at: Longs, rates: Floats) -> tuple[Floats, Floats]:
        """Return a and b, linear in the rates, for the dissipation ‖a‖ + b of quadratic cones.

        Returns:
            a has the shape (num_cells, points, m), and b the shape (num_cells, points).
        """
        tilt = self._tilt
        square = 1 - np.einsum("ni,ni->n", tilt, tilt)
        share = 1 / (1 + np.sqrt(square))
        # (η·r)² + (1 − ‖r‖²)‖η‖² is ‖√(1 − ‖r‖²) η + r (r·η)/(1 + √(1 − ‖r‖²))‖²
        root = np.sqrt(square)[:, None, None] * np.eye(tilt.shape[1])
        root = root + share[:, None, None] * tilt[:, :, None] * tilt[:, None]
        scale = (self.bound / square)[:, None, None]
        both = scale * (root @ self._back)
        along = -(scale[:, 0] * np.einsum("ni,nij->nj", tilt, self._back))
        return (
            np.einsum("cij,cvj->cvi", both[at], rates),
            np.einsum("ci,cvi->cv", along[at], rates),
        )
