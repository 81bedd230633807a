"""Bounds of the stress of each material, ‖Mσ‖ ≤ c − q·σ, and the dissipation of its flow.

Or (1 + s)σ₁ − (1 − s)σ₃ ≤ c of principal stresses (:mod:`principal`). Rates are admissible then
where tr ε ≥ s Σ|ε_i| and dissipate (c/2s) tr ε; of s = 0 where tr ε = 0, and then (c/2) Σ|ε_i|.
With σ₁ ≤ f as well it is tr ε ≥ s Σ|ε_i| of any s ≥ 0, and (f − h) tr ε + h Σ|ε_i| with
h = (c/2 − sf)/(1 − s).

Stresses are vectors (σ_xx, σ_yy, √2σ_xy) in the plane, of what is in it, around an axis (σ_rr,
σ_zz, σ_θθ, √2σ_rz), and in space (σ_xx, σ_yy, σ_zz, √2σ_yz, √2σ_xz, √2σ_xy); strain rates alike, so
that σ:ε is their product. By duality the sup of σ:ε is the least cz with ε = Mᵀy + qz, ‖y‖ ≤ z.
With y = η − rz for η = M⁺ᵀε and r = M⁺ᵀq it is

- if M has a null vector ν with q·ν > 0: z = ε·ν/(q·ν), which has to be at least ‖η − rz‖;
- else, where ‖r‖ < 1, z = (√((η·r)² + (1 − ‖r‖²)‖η‖²) − η·r)/(1 − ‖r‖²); and ε·ν has to be zero
  if there is a null vector.

The first is linear in ε, the second convex.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.balls import U
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
"""Least ratio of the singular values of a matrix that are no zeros to the largest."""

ROUNDED = 1e-13
"""Ratio below which a singular value, or q·ν to ‖q‖, is the rounding of zero."""

STEEPEST = 1 - 1e-9
"""Largest ‖r‖ of a set that no null vector's slope closes."""


def vectors(tensors: Floats) -> Floats:
    """Return vectors of symmetric matrices, shape (..., m) of (..., d, d)."""
    d = tensors.shape[-1]
    pairs = [(0, 1)] if d == 2 else [(1, 2), (0, 2), (0, 1)]
    columns = [tensors[..., i, i] for i in range(d)]
    root = np.sqrt(0.5)
    columns += [root * (tensors[..., i, j] + tensors[..., j, i]) for i, j in pairs]
    return np.stack(columns, axis=-1)


@dataclass(frozen=True)
class Cones:
    """Those of all materials, by number.

    Attributes:
        bound: c ≥ 0 (stress), 0 where the set is a cone from zero; shape (num_cones,).
        slope: q, shape (num_cones, m).
        matrix: M, of rank m or m − 1, rows of zeros allowed; shape (num_cones, m, m).
        sine: s of bounds of principal stresses, of which M and q are zero; NaN for others; shape
            (num_cones,).
        tension: f of these, NaN without one and for others.
    """

    bound: Floats
    slope: Floats
    matrix: Floats
    sine: Floats
    tension: Floats

    @property
    def is_cut(self) -> Flags:
        """Whether there is a tensile strength."""
        return ~np.isnan(self.tension)

    @property
    def is_principal(self) -> Flags:
        """Whether principal stresses are bounded."""
        return ~np.isnan(self.sine)

    def check(self, m: int) -> None:
        """Make sure that these are cones with zero inside whose admissible rates are known.

        Args:
            m: Components of a stress.

        Raises:
            ProofError: If they are not.
        """
        n = len(self.bound) if self.bound.ndim == 1 else -1
        if n < 0 or self.slope.shape != (n, m) or self.matrix.shape != (n, m, m):
            raise ProofError("the shape of cone_bound, cone_slope or cone_matrix fits nothing.")
        if not (np.isfinite(self.bound) & (self.bound >= 0)).all():
            raise ProofError("a cone's bound is not positive and finite, nor zero.")
        if not (np.isfinite(self.slope).all() and np.isfinite(self.matrix).all()):
            raise ProofError("a cone's slope or matrix is not finite.")
        if self.sine.shape != (n,) or self.tension.shape != (n,):
            raise ProofError("the shape of cone_sine or cone_tension fits nothing.")
        principal = self.is_principal
        if self.is_cut[~principal].any():
            raise ProofError("cone_tension is of a cone that bounds no principal stresses.")
        bound, sine, tension = self.bound[principal], self.sine[principal], self.tension[principal]
        check_principal(bound, sine, tension, (RANK, STEEPEST))
        if self.slope[principal].any() or self.matrix[principal].any():
            raise ProofError("a cone of principal stresses has a slope or a matrix.")
        sizes = [
            np.abs(part).max(axis=tuple(range(1, part.ndim)), initial=0.0)
            for part in (self.slope, self.matrix)
        ]
        check_sizes("a cone", np.max([self.bound, *sizes], axis=0))
        Cones(*(part[~principal] for part in vars(self).values()))._check_quadratic()

    def _check_quadratic(self) -> None:
        """The same of second-order cones alone, whose numbers are finite."""
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
            raise ProofError("a cone's slope along what its matrix leaves free is nearly zero.")
        if not (np.linalg.norm(self._tilt, axis=1)[~self.grows] < STEEPEST).all():
            raise ProofError("a cone is steeper than those whose rates are known.")

    @cached_property
    def has_null(self) -> Flags:
        """Whether a stress is left free by the matrix."""
        values = np.linalg.svd(self.matrix, compute_uv=False)
        return np.asarray(values[:, -1] <= ROUNDED * values[:, 0])

    @cached_property
    def _null(self) -> Floats:
        """Unit vectors ν; zero where there is none."""
        found = np.linalg.svd(self.matrix)[2][:, -1]
        return np.asarray(np.where(self.has_null[:, None], found, 0.0))

    @cached_property
    def _pull(self) -> Floats:
        """q·ν."""
        return np.einsum("ni,ni->n", self.slope, self._null)

    @cached_property
    def grows(self) -> Flags:
        """Whether the bound falls along what the matrix leaves free: such bodies dilate."""
        falls = np.abs(self._pull) > RANK * np.linalg.norm(self.slope, axis=1)
        return falls | (self.sine > 0) | self.is_cut

    @property
    def is_linear(self) -> Flags:
        """Whether what such bodies dissipate is linear in the rates."""
        return self.grows & ~self.is_cut

    @cached_property
    def _back(self) -> Floats:
        """M⁺ᵀ."""
        inverse = np.linalg.pinv(self.matrix, rcond=RANK / 2)
        return np.asarray(inverse.transpose(0, 2, 1), dtype=np.float64)

    @cached_property
    def _tilt(self) -> Floats:
        """M⁺ᵀq."""
        return np.einsum("nij,nj->ni", self._back, self.slope)

    @cached_property
    def radius(self) -> Floats:
        """A stress that the material bears: c over the largest singular value.

        Of principal stresses all of size c/√(2(1 + s²)) are borne, if none exceeds f.
        """
        values = np.linalg.svd(self.matrix, compute_uv=False)[:, 0]
        sines = np.where(self.is_principal, self.sine, 0.0)
        steepest = np.where(self.is_principal, np.sqrt(2 * (1 + sines**2)), values)
        found = self.bound / steepest
        return np.where(self.is_cut, np.minimum(found, self.tension), found)

    @property
    def weakness(self) -> Floats:
        """The most that a stress of size 1 adds to :meth:`ratios`, where c > 0."""
        found = 1 / self.radius + np.linalg.norm(self.slope, axis=1) / self.bound
        rounding = 1e-12  # of singular values
        return np.asarray(found * (1 + rounding))

    def own_radius(self, at: Longs, stress: Floats) -> Floats:
        """The same of each cell; where c = 0 what the stress has itself, −q·σ in the place of c.

        That is the least of the cell's places at which there is any stress, ∞ where it has none.

        Args:
            at: Cone of each cell, shape (num_cells,).
            stress: Vectors at some places of each, shape (num_cells, places, m).
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
        """(‖Mσ‖ + q·σ)/c, the like of principal stresses: the stress over it keeps to the cone.

        Where c = 0 it is ‖Mσ‖/(−q·σ), 0 of no stress: at most 1 where the stress keeps to the cone.

        Args:
            at: Cone of each cell, shape (num_cells,).
            stress: Vectors at some places of each, shape (num_cells, places, m).
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
        loose = self.bound[at] == 0
        found: Floats = (sizes + along) / np.where(loose, 1.0, self.bound[at])[:, None]
        if loose.any():
            pressed = along[loose] < 0
            own = np.where(pressed, sizes[loose] / np.where(pressed, -along[loose], 1.0), np.inf)
            found[loose] = np.where(stress[loose].any(axis=2), own, 0.0)
        return found

    def _at_apex(self, at: Longs, rates: Floats) -> tuple[Floats, Floats]:
        """Z and ‖y‖ of cells that grow; numbers of no meaning in others."""
        free = np.einsum("ci,cvi->cv", self._null[at], rates)
        pull = np.where(self.grows, self._pull, 1.0)[at, None]
        heads: Floats = free / pull
        rest = rates - heads[..., None] * self.slope[at][:, None]
        sizes = np.linalg.norm(np.einsum("cij,cvj->cvi", self._back[at], rest), axis=2)
        return heads, sizes

    def linear_power(self, at: Longs, rates: Floats) -> Floats:
        """Return the dissipation per volume, linear in rates, as if none lacked growth."""
        heads, sizes = self._at_apex(at, rates)
        found: Floats = self.bound[at, None] * np.maximum(heads, sizes)
        here = self.is_principal[at]
        if here.any():
            s, (traces, sizes) = self.sine[at[here], None], rate_sizes(rates[here])
            found[here] = self.bound[at[here], None] / (2 * s) * np.maximum(traces, s * sizes)
        return found

    def principal_power(self, at: Longs, rates: Floats) -> Floats:
        """Return the same of other cells of principal stresses, convex in the rates."""
        factors = power_factors(self.bound[at], self.sine[at], self.tension[at])
        of_trace, of_sizes = (factor[:, None] for factor in factors)
        (traces, sizes), s = rate_sizes(rates), self.sine[at, None]
        short = np.where(self.is_cut[at, None], np.maximum(s * sizes - traces, 0.0), 0.0)
        found: Floats = of_trace * traces + np.abs(of_trace) * short + of_sizes * sizes
        return found

    @cached_property
    def digits(self) -> Floats:
        """Rounding of numbers that are computed from a cone and a rate, relative."""
        values = np.linalg.svd(self.matrix, compute_uv=False)
        last = np.where(self.has_null, values[:, -2], values[:, -1])
        last = np.where(self.is_principal, 1.0, last)
        worst = np.where(self.is_principal, 1.0, values[:, 0]) / last
        return np.asarray(256 * U * worst)

    @cached_property
    def steepness(self) -> Floats:
        """The most that what a rate of size 1 dissipates per volume, or may be less by.

        The dissipation here is of any rate, admissible or not, and convex and of first degree.
        """
        back = np.linalg.norm(self._back, ord=2, axis=(1, 2))
        square = 1 - np.einsum("ni,ni->n", self._tilt, self._tilt)
        found = self.bound * back * (1 + np.sqrt(np.maximum(1 - square, 0.0))) / np.abs(square)
        found = np.where(self.is_linear, self.bound * self.alertness, found)
        of_trace, of_sizes = power_factors(self.bound, self.sine, self.tension)
        some = np.sqrt(3.0) * (np.abs(of_trace) * (2 + self.sine) + of_sizes)
        apex = np.sqrt(3.0) * self.bound / (2 * np.where(self.sine > 0, self.sine, 1.0))
        some = np.where(self.is_linear, apex, some)
        return np.asarray(np.where(self.is_principal, some, found) * (1 + self.digits))

    @cached_property
    def alertness(self) -> Floats:
        """The most that a rate of size 1 adds to what growth lacks (:meth:`short`)."""
        pull = np.where(np.abs(self._pull) > 0, np.abs(self._pull), 1.0)
        back = np.linalg.norm(self._back, ord=2, axis=(1, 2))
        found = 1 / pull + back * (1 + np.linalg.norm(self.slope, axis=1) / pull)
        principal = np.sqrt(3.0) * (1 + np.where(self.is_principal, self.sine, 0.0))
        return np.asarray(np.where(self.is_principal, principal, found) * (1 + self.digits))

    def short(self, at: Longs, rates: Floats) -> Floats:
        """Return ‖y‖ − z of cells that grow, at most zero where a rate is admissible.

        Of principal stresses it is s Σ|ε_i| − tr ε.

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
        return np.asarray(found)

    def keeps_volume(self, normals: int) -> Flags:
        """Return whether a rate is admissible if, and only if, it has no trace.

        Args:
            normals: How many components, the first, are normal ones.
        """
        unit = np.zeros(self.slope.shape[1])
        unit[:normals] = 1 / np.sqrt(normals)
        off = np.linalg.norm(self._null - (self._null @ unit)[:, None] * unit, axis=1)
        quadratic = self.has_null & ~self.grows & (off <= ROUNDED)
        return np.asarray(np.where(self.is_principal, ~self.grows, quadratic))

    @property
    def takes_any(self) -> Flags:
        """Whether every rate is admissible."""
        return ~self.has_null & ~self.grows & ~self.is_principal

    def convex_power(self, at: Longs, rates: Floats) -> tuple[Floats, Floats]:
        """The same of others with second-order cones, ‖a‖ + b with a and b linear in the rates.

        Returns:
            a, shape (num_cells, places, m), and b, shape (num_cells, places).
        """
        tilt = self._tilt
        square = 1 - np.einsum("ni,ni->n", tilt, tilt)
        share = np.where(square < 1, (1 - np.sqrt(square)) / np.maximum(1 - square, ROUNDED), 0.0)
        # (η·r)² + (1 − ‖r‖²)‖η‖² is ‖√(1 − ‖r‖²) η + (1 − √(1 − ‖r‖²)) r (r·η)/‖r‖²‖²
        root = np.sqrt(square)[:, None, None] * np.eye(tilt.shape[1])
        root = root + share[:, None, None] * tilt[:, :, None] * tilt[:, None]
        scale = (self.bound / square)[:, None, None]
        both = scale * (root @ self._back)
        along = -(scale[:, 0] * np.einsum("ni,nij->nj", tilt, self._back))
        return (
            np.einsum("cij,cvj->cvi", both[at], rates),
            np.einsum("ci,cvi->cv", along[at], rates),
        )
