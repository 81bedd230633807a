"""Handle strengths that a factor of safety divides, and strengths that remain undivided.

In a half with the number ``strength_factor``, strengths (cohesions, slopes of friction and yield
stresses) are divided by this number, except strengths with the flags ``cell_kept``,
``contact_kept`` and ``obstacle_kept``. All other modules use the divided strengths, which the file
contains. This module computes the undivided strengths, which a reader can compare with the data of
the bodies.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.plain_arrays import ProofError, checked, number_of
from perfplast_fenicsx.proof.rings import around, normals_of

KEPT = ("cell_kept", "contact_kept", "obstacle_kept")
"""Names of the flags of cells, contacts and obstacles whose strength is not divided."""

MOST = 6
"""Largest number of strengths that are named individually."""


def reduction_of(
    body: Body, arrays: Mapping[str, npt.NDArray]
) -> tuple[float, dict[str, npt.NDArray]] | None:
    """Return the factor that divides strengths, and the flags of undivided strengths.

    Args:
        body: The bodies with divided strengths.
        arrays: Arrays of the half.

    Returns:
        The factor and the flags, or None for a half without a factor.

    Raises:
        ProofError: If there are flags without a factor, if the factor is not positive, if the flags
            do not fit the bodies, if the strength of a parabola is divided, or if a strength is
            divided in only some of its cells.
    """
    if "strength_factor" not in arrays:
        if any(name in arrays for name in KEPT):
            raise ProofError(f"{KEPT} are flags for strength_factor, which is missing.")
        return None
    factor = number_of("strength_factor", arrays["strength_factor"])
    if not factor > 0:
        raise ProofError("strength_factor is not positive.")
    counts = (len(body.cells), len(body.contacts), len(body.obstacles))
    none = {name: np.zeros(n, dtype=bool) for name, n in zip(KEPT, counts, strict=True)}
    kept = checked({**none, **arrays}, KEPT)
    for name, flags in none.items():
        if kept[name].shape != flags.shape:
            raise ProofError(f"the shape of {name} does not fit the bodies.")
    cells = kept["cell_kept"]
    if body.cones.is_curved[body.cone[~cells & body.plastic]].any():
        raise ProofError(
            "strength_factor divides a parabolic strength, and the quotient is not a parabola."
        )
    both = np.intersect1d(body.cone[cells & body.plastic], body.cone[~cells & body.plastic])
    if len(both):
        raise ProofError("cell_kept divides a strength in some cells but not in others.")
    return factor, kept


MATCHES = ("plane-strain", "compression", "extension")
"""States of stress in which a Drucker–Prager cone has the strength of Mohr and Coulomb."""


class Division(NamedTuple):
    """How the factor of a half divides its strengths.

    Attributes:
        times: F for divided cones, 1 for others, shape (num_cones,).
        kind: 0 for undivided cones; 1 for cones whose c and q F divides, and for bounds of
            principal stresses, where F divides cohesion and tan φ; 2 for Drucker–Prager cones of
            in-plane stresses; 3 for Drucker–Prager cones of all stresses. Shape (num_cones,).
        tangents: tan φ of the cones of kind 2 or 3 for each match, which the file does not contain;
            NaN for a match with which the cone is too steep. Shape (number of matches, num_cones);
            (1, num_cones) if there is no such cone.
        kept: Flags of the contacts and of the obstacles whose friction F does not divide.
        factor: F.
    """

    times: Floats
    kind: Longs
    tangents: Floats
    kept: tuple[Flags, Flags]
    factor: float


def division_of(body: Body, factor: float, kept: Mapping[str, npt.NDArray]) -> Division:
    """Return how a factor divides the strengths of bodies (:func:`reduction_of`)."""
    divided = np.zeros(len(body.cone_bound), dtype=bool)
    divided[body.cone[body.plastic & ~kept["cell_kept"]]] = True
    sines, eta = (_axial_slopes(body, directions) / np.sqrt(2) for directions in (2, 3))
    in_plane = divided & ~body.cones.is_principal & (sines > 0)
    in_plane &= body.dim == 2 and not body.is_revolved
    in_space = divided & ~body.cones.is_principal & ~in_plane & (eta > 0)
    eta = np.where(in_plane, sines / np.sqrt(1 + sines**2 / 3), eta)  # of equal in-plane strength
    tangents: Floats = np.full((1, len(eta)), np.nan)
    if (in_plane | in_space).any():
        tangents = np.array([_tangents_of(match, eta) for match in MATCHES])
    return Division(
        np.where(divided, factor, 1.0),
        np.where(in_plane, 2, np.where(in_space, 3, divided.astype(np.int64))),
        tangents,
        (np.asarray(kept["contact_kept"]), np.asarray(kept["obstacle_kept"])),
        factor,
    )


@np.errstate(invalid="ignore", divide="ignore")
def _tangents_of(match: str, eta: Floats) -> Floats:
    """Return tan φ of cones ‖dev σ‖/√2 + ηp ≤ k (D. C. Drucker, W. Prager); NaN if too steep."""
    steepest = 1e3  # beyond, rounding of η changes tan φ
    found = 3 * eta / np.sqrt(9 - 12 * eta**2)
    if match != "plane-strain":
        sign = -1 if match == "compression" else 1
        sine = 3 * np.sqrt(3) * eta / (6 - sign * np.sqrt(3) * eta)
        found = np.where(sine > 0, sine / np.sqrt(1 - sine**2), np.nan)
    return np.asarray(np.where(found <= steepest, found, np.nan))


def _sines_of(body: Body) -> Floats:
    """Return the sine of each cone's friction angle; NaN if the angle is not known.

    The angle is known for cones of principal stresses, and for plane cones whose axis is the mean
    stress: ‖dev σ‖ ≤ √2 (c cos φ − σ_m sin φ).
    """
    along = _axial_slopes(body, 2)
    usual = (along > 0) & (along**2 < 2) & (body.dim == 2) & (not body.is_revolved)
    found = np.where(usual, along / np.sqrt(2), np.nan)
    return np.asarray(np.where(body.cones.is_principal, body.cone_sine, found))


def _axial_slopes(body: Body, directions: int) -> Floats:
    """Return α of cones ‖dev σ‖ ≤ γ − α tr σ/n after scaling M; NaN for cones of other shapes.

    Args:
        body: The bodies.
        directions: n, the normal stresses that the deviator and the mean stress contain: 3, or 2
            for the in-plane stresses alone.
    """
    slope, matrix = body.cone_slope, body.cone_matrix
    m, n = slope.shape[1], normals_of(body)
    unit = np.append(np.ones(n), np.zeros(m - n))
    radius = np.sqrt((matrix**2).sum(axis=(1, 2)) / (m - n / directions))
    radius = np.where(radius > 0, radius, 1.0)
    along = slope @ unit / radius * (directions / n)
    plain = matrix.transpose(0, 2, 1) @ matrix / radius[:, None, None] ** 2
    shape = np.eye(m) - np.outer(unit, unit) / directions
    plain = np.abs(plain - shape).max(axis=(1, 2), initial=0.0)
    off = slope / radius[:, None] - along[:, None] * unit / directions
    off = np.abs(off).max(axis=1, initial=0.0)
    small = 1e-9
    return np.asarray(np.where(np.maximum(plain, off) <= small, along, np.nan))


def reduction_words(body: Body, arrays: Mapping[str, npt.NDArray]) -> list[str]:
    """Return sentences on the factor, and on strengths before or without division by it.

    Args:
        body: The bodies with divided strengths.
        arrays: Arrays of the half.

    Raises:
        ProofError: As for :func:`reduction_of`.
    """
    found = reduction_of(body, arrays)
    if found is None:
        return []
    factor, kept = found
    cells = kept["cell_kept"]
    divided = np.unique(body.cone[body.plastic & ~cells])
    words = [
        f"{_whole(body, number, factor)}{body.varies_by(number)}" for number in divided[: MOST + 1]
    ]
    words += _rubbing(body, kept, factor)
    more = len(words) + len(divided[MOST + 1 :]) - MOST
    less = f" and {more} more" if more > 0 else ""
    told = f"F = {factor:.9g} divides no strength."
    if words:
        told = f"Strengths are divided by F = {factor:.9g}; before the division they are"
        told = f"{told} {', '.join(words[:MOST])}{less}."
    left = []
    if (cells & body.plastic).any():
        volume = (body.volumes * around(body))[cells & body.plastic].sum()
        left.append(f"strengths in a volume of {volume:.6g}")
    for name, of in (("contact_kept", body.contacts), ("obstacle_kept", body.obstacles)):
        tags = [" and ".join(map(str, np.ravel(it))) for it in of[kept[name]]]
        left += [f"friction on surface {it}" for it in tags]
    return [f"{told} Not divided: {', '.join(left)}." if left else told]


def _whole(body: Body, number: np.int64, factor: float) -> str:
    """Return the undivided strength of a cone, in words.

    ``factor`` multiplies the bound, or cohesion and tan φ if the cone has a slope.
    """
    bound, slope = body.cone_bound[number], body.cone_slope[number]
    principal = bool(body.cones.is_principal[number])
    radius = np.sqrt((body.cone_matrix[number] ** 2).sum() / (len(slope) - 1))
    if not principal and not slope.any():
        return f"a yield radius of {factor * bound / radius:.6g}"
    sine = float(_sines_of(body)[number])
    if np.isnan(sine):
        return _with_slope(body, number, factor)
    size = 2.0 if principal else np.sqrt(2) * radius
    tension = factor * body.cone_tension[number]
    cut = f" and a tensile strength of {tension:.6g}" if body.cones.is_cut[number] else ""
    cosine = np.sqrt(1 - sine**2)
    told = f"a cohesion of {factor * bound / (size * cosine):.6g}"
    return told + (f" with tan φ = {factor * sine / cosine:.6g}" if sine else "") + cut


def _with_slope(body: Body, number: np.int64, factor: float) -> str:
    """Return the undivided strength of a cone with a slope and an unknown friction angle."""
    eta = _axial_slopes(body, 3)[number] / np.sqrt(2)
    if not eta > 0:
        return "that of a cone whose c and q are F times as large"
    m, n = body.cone_slope.shape[1], normals_of(body)
    radius = np.sqrt((body.cone_matrix[number] ** 2).sum() / (m - n / 3))
    apex = body.cone_bound[number] / (np.sqrt(2) * radius * eta)
    tangents = {match: factor * float(_tangents_of(match, eta)) for match in MATCHES}
    told = [
        f"{apex * tangent:.6g} with tan φ = {tangent:.6g} ({match})"
        for match, tangent in tangents.items()
        if not np.isnan(tangent)
    ]
    return f"a cohesion of {' or '.join(told)}"


def _rubbing(body: Body, kept: Mapping[str, npt.NDArray], factor: float) -> list[str]:
    """Return the undivided friction of contacts and obstacles, in words."""
    told = []
    for of in ("contact", "obstacle"):
        adhesion, friction = (getattr(body, f"{of}_{kind}") for kind in ("adhesion", "friction"))
        divided = ~kept[f"{of}_kept"] & ((adhesion > 0) | (friction > 0))
        for c, mu in np.unique(np.column_stack([adhesion, friction])[divided], axis=0):
            told.append(f"an adhesion of {factor * c:.6g} and a friction of {factor * mu:.6g}")
    return told
