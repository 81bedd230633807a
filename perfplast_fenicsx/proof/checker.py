"""Prove the bounds of a file independently: ``python3 -m perfplast_fenicsx.proof DIR/bounds.h5``.

The file has a group ``lower`` with a stress, a group ``upper`` with a velocity, or both. Such a
group is called a half. It contains all data of its proof, including the bodies with their loads
(:class:`body.Body`). The checker runs on one process.

The checker detects overlapping cells by a region just inside each outer facet. Inner facets have
their cells on opposite sides, so the number of cells around a point changes only across an outer
facet. Therefore, if cells overlap, the region just inside some outer facet shares a volume with a
cell other than the facet's own cell.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.blocks import Factors, JointForces, carried_by
from perfplast_fenicsx.proof.body import Body, Floats
from perfplast_fenicsx.proof.box_pairs import box_pairs
from perfplast_fenicsx.proof.halves import differences, pair_of_drucker, pair_of_radenkovic
from perfplast_fenicsx.proof.lower import measure_stress, overstress
from perfplast_fenicsx.proof.plain_arrays import (
    ProofError,
    bound_of,
    checked,
    digest_of,
    number_of,
    stored_arrays,
)
from perfplast_fenicsx.proof.reduction import division_of, reduction_of, reduction_words
from perfplast_fenicsx.proof.rigid import check_loaded
from perfplast_fenicsx.proof.shared_cells import boxes_of, have_common_volume
from perfplast_fenicsx.proof.stored_file import stored_file
from perfplast_fenicsx.proof.taken_as_written import taken_as_written
from perfplast_fenicsx.proof.upper import check_nodes, measure_velocity
from perfplast_fenicsx.proof.verdict import ROUNDED, Checked, faults_of, rounding_of


def overlapping(body: Body) -> int:
    """Return the number of outer facets with another cell just inside; at least one of several."""
    slices, cells = _slices(body), body.vertices[body.cells]
    own = body.outer // (body.dim + 1)
    found = np.zeros(len(slices), dtype=bool)
    for a, b in box_pairs(boxes_of(slices), boxes_of(cells)):
        others = (own[a] != b) & ~found[a]
        a, b = a[others], b[others]
        found[a[have_common_volume(slices[a], cells[b])]] = True
        if found.any():  # one such facet is enough to refuse the bodies
            break
    return int(found.sum())


def _slices(body: Body) -> Floats:
    """Return flat simplices just inside outer facets, each within the facet's cell."""
    # Depth and thickness of a simplex, relative to the height of its cell. Because of rounding,
    # bodies that touch each other may overlap by less than this depth.
    depth = 1e-3
    cells = body.outer // (body.dim + 1)
    opposite = body.vertices[body.cells[cells, body.outer % (body.dim + 1)]][:, None]
    facets = (1 - depth) * body.vertices[body.facets] + depth * opposite
    middle = facets.mean(axis=1, keepdims=True)
    return np.concatenate([facets, (1 - depth) * middle + depth * opposite], axis=1)


Told = TypeVar("Told")

DRUCKER = (
    "Drucker's pair: with less friction from below, and with associated friction from "
    "above; the limit load with Coulomb's friction lies between, whatever the direction "
    "of slip."
)
"""The note on two halves with different friction."""

TOO_LARGE = "it is too large for this machine"
"""Reason for not checking a proof."""


@dataclass(frozen=True)
class _Half:
    """A half after its check.

    Attributes:
        checked: Its verdict.
        body: The bodies.
        overlaps: Number of outer facets that have another cell just inside them.
        power: Size of the works for an upper bound (:attr:`upper.Flow.power`); ∞ for a lower bound.
    """

    checked: Checked
    body: Body
    overlaps: int
    power: float = np.inf


@dataclass(frozen=True)
class Pair:
    """The verdict on the two files of a factor of safety.

    Attributes:
        carried: The factor at which the bodies provably carry the loads.
        not_carried: The factor at which the bodies provably do not carry the loads.
        faults: Reasons why the two factors are not proven for the same bodies.
    """

    carried: float
    not_carried: float
    faults: tuple[str, ...]

    def __str__(self) -> str:
        if self.faults:
            return f"factor of safety: not proven for the same bodies: {'; '.join(self.faults)}"
        between = f"{self.carried:.9g} to {self.not_carried:.9g} is proven"
        return f"factor of safety: {between}; both files describe the same bodies"


def check(path: str | Path) -> dict[str, Checked]:
    """Check the bounds of a file.

    Args:
        path: The file.

    Returns:
        The verdicts, by "lower" and "upper".

    Raises:
        ProofError: If the file cannot be read, or is not a proof.
    """
    return _of_file(path, check_halves)


def numbers_digest(path: str | Path) -> str:
    """Return the SHA-256 of the numbers in a file (:func:`plain_arrays.digest_of`).

    Raises:
        ProofError: If the file cannot be read, or is not a proof.
    """
    return _of_file(path, digest_of)


def _of_file(path: str | Path, of: Callable[[dict[str, dict[str, npt.NDArray]]], Told]) -> Told:
    """Return the result of ``of`` for the arrays and numbers of each half of a file.

    Raises:
        ProofError: If the file cannot be read, is not a proof, or is too large.
    """
    try:
        with stored_file(path) as file:
            halves = {kind: stored_arrays(file, kind) for kind in JUDGES if kind in file}
        return of(halves)
    except MemoryError as fault:
        raise ProofError(f"'{path}' is not a proof of bounds: {TOO_LARGE}.") from fault
    except (OSError, KeyError, AttributeError, TypeError, ValueError, RuntimeError) as fault:
        raise ProofError(f"'{path}' is not a proof of bounds: {fault}") from fault


def check_halves(halves: Mapping[str, Mapping[str, npt.NDArray]]) -> dict[str, Checked]:
    """Check the bounds in arrays, which are named as in a file.

    Args:
        halves: Arrays and numbers by name, of "lower", "upper" or both.

    Returns:
        The verdicts, by "lower" and "upper".

    Raises:
        ProofError: If the arrays do not fit together.
    """
    if not halves:
        raise ProofError("there is neither a lower nor an upper bound.")
    try:
        with np.errstate(all="ignore"):
            return _check_halves(halves)
    except MemoryError as fault:
        raise ProofError(f"{TOO_LARGE}.") from fault
    except (KeyError, AttributeError, TypeError, ValueError, RuntimeError) as fault:
        raise ProofError(str(fault)) from fault


def _check_halves(halves: Mapping[str, Mapping[str, npt.NDArray]]) -> dict[str, Checked]:
    """Return the verdicts on bounds in arrays; unsuitable arrays raise errors of any type."""
    judged: dict[str, _Half] = {}
    before: _Half | None = None
    for kind, judge in JUDGES.items():
        if kind in halves:
            before = judged[kind] = judge(halves[kind], before)
    found = {kind: half.checked for kind, half in judged.items()}
    if len(judged) < 2:
        return found
    faults, words = _together(judged["lower"], judged["upper"])
    found["lower"] = replace(found["lower"], words=(*found["lower"].words, words))
    return {kind: _with(half, faults) for kind, half in found.items()} if faults else found


def check_pair(
    below: str | Path, above: str | Path, found: Sequence[Mapping[str, Checked]] | None = None
) -> Pair:
    """Check the two files of a factor of safety, and check that both describe the same bodies.

    The strengths in each file are divided by the factor in this file. The undivided strengths in
    both files must be equal.

    Args:
        below: The file with the stress.
        above: The file with the velocity.
        found: Results of :func:`check` for both files; None to check the files now.

    Returns:
        The verdict on both files together.

    Raises:
        ProofError: If a file cannot be read, is not a proof, has another half, or has no factor.
    """
    halves = []
    verdicts = (check(below), check(above)) if found is None else found
    for path, kind, of in zip((below, above), ("lower", "upper"), verdicts, strict=True):
        if set(of) != {kind}:
            raise ProofError(
                f"'{path}' does not contain only the {kind} half of a factor of safety."
            )
        with stored_file(path) as file, np.errstate(all="ignore"):
            arrays = stored_arrays(file, kind)
            body = Body.of(arrays)
            reduced = reduction_of(body, arrays)
            if reduced is None:
                raise ProofError(f"'{path}' has no strength_factor.")
            halves.append((of[kind], body, division_of(body, *reduced)))
    (lower, less, divided), (upper, more, divided_more) = halves
    carried, not_carried = divided.factor, divided_more.factor
    faults = [fault for half in (lower, upper) for fault in half.faults]
    if not faults and not (lower.proven or 0.0) >= 1.0:
        faults.append("the stress does not carry the loads with the factor 1")
    if not faults and not (np.inf if upper.proven is None else upper.proven) <= 1.0:
        faults.append("the loads with the factor 1 do not drive the mechanism")
    if less.constant or more.constant:
        faults.append("there are constant loads, which the factor 1 does not multiply")
    with np.errstate(all="ignore"):
        faults += differences(less, more, (divided, divided_more))
    if not faults and not carried <= not_carried:
        faults.append("the factor of the lower file is above the factor of the upper file")
    return Pair(carried, not_carried, tuple(faults))


def factor_of(path: str | Path, kind: str) -> float:
    """Return the factor by which the strengths of a half are divided.

    Args:
        path: A file of a factor of safety.
        kind: "lower" or "upper".

    Raises:
        ProofError: If the file cannot be read, or has no such half or factor.
    """
    try:
        with stored_file(path) as file:
            return number_of("strength_factor", file[kind].attrs["strength_factor"])
    except (OSError, KeyError, AttributeError, TypeError, ValueError, RuntimeError) as fault:
        raise ProofError(f"'{path}' has no strength_factor for its {kind} half.") from fault


def check_lower(arrays: Mapping[str, npt.NDArray]) -> Checked:
    """Check a stress: ``stress`` (num_cells, d + 1, d, d), ``bound``, and the bodies.

    The stress balances the loads at ``factor``, or at ``bound`` if ``factor`` is missing. For
    bodies of revolution ``stress`` contains the coefficients of rσ (:mod:`rings`), shape
    (num_cells, 6, 2, 2). If no cell can yield, ``joint_force`` (num_facets, d, d) replaces
    ``stress``; adhesive joints also have ``joint_traction`` of the same shape. The second set of
    forces is ``inner_force``, ``inner_traction``, ``inner_factor`` and ``inner_any_factor``
    (:mod:`blocks`).

    Returns:
        The verdict on the stress or on the forces.

    Raises:
        ProofError: If the arrays do not fit together.
    """
    with np.errstate(all="ignore"):
        return _lower(arrays, None).checked


def check_upper(arrays: Mapping[str, npt.NDArray]) -> Checked:
    """Check a velocity: ``velocity`` (num_nodes, d), ``nodes`` of cells, ``bound``, and the bodies.

    Returns:
        The verdict on the velocity.

    Raises:
        ProofError: If the arrays do not fit together.
    """
    with np.errstate(all="ignore"):
        return _upper(arrays, None).checked


def _lower(arrays: Mapping[str, npt.NDArray], before: _Half | None) -> _Half:
    body, overlaps = _body(arrays, before)
    claimed = bound_of(arrays["bound"], bool(body.constant))
    factor = bound_of(arrays.get("factor", claimed), bool(body.constant))
    other = number_of("any_factor", arrays.get("any_factor", 0.0))
    factors = (factor, 1.0, other)
    judge = _of_stress if body.plastic.any() else _of_blocks
    found = judge(body, arrays, factors)
    proven, reasons = found.factor, [*_reasons(overlaps, None), *found.reasons]
    if reasons:
        proven = None
    if proven is None or not proven >= claimed - ROUNDED * abs(claimed):
        only = [] if proven is None else [f"only {proven:.9g} is proven"]
        faults = tuple(dict.fromkeys([*reasons, *only, *found.rows]))
    else:
        faults = ()
    sums = (
        f"Unbalanced forces are {found.forces:.2g} in all, compared with {found.loads:.6g} "
        "of the loads."
    )
    if proven is not None:
        sums += f" These forces and rounding reduce the bound by {max(factor - proven, 0.0):.2g}."
    words = (taken_as_written(body), *reduction_words(body, arrays), sums)
    shown = None if faults else proven
    over = found.over if body.constant else 1.0
    checked_half = Checked("lower", claimed, shown, found.measured, faults, words, proven, over)
    return _Half(checked_half, body, overlaps)


@dataclass(frozen=True)
class _Found:
    """The load factor that a stress or forces on joints prove.

    Attributes:
        factor: The load factor; None if it is not proven.
        reasons: Reasons why the factor is not proven.
        rows: Violated conditions, in words.
        measured: The residual of each condition.
        forces: Sum of the magnitudes of unbalanced forces.
        loads: The sum of the loads' magnitudes.
        over: The factor by which stresses may exceed the strength.
    """

    factor: float | None
    reasons: tuple[str, ...]
    rows: tuple[str, ...]
    measured: Mapping[str, float]
    forces: float
    loads: float
    over: float = 1.0


def _of_stress(body: Body, arrays: Mapping[str, npt.NDArray], factors: Factors) -> _Found:
    """Return the load factor that a stress proves, for loads at given factors."""
    stress, d = checked(arrays, ("stress",))["stress"], body.dim
    if stress.shape != (len(body.cells), 6 if body.is_revolved else d + 1, d, d):
        raise ProofError("the stress does not fit the cells.")
    every = (body.sought, body.constant, body.others)
    left = measure_stress(body, stress, [by * of for by, of in zip(factors, every, strict=True)])
    reasons, rows = [] if left.reason is None else [left.reason], faults_of(left.measured)
    found = overstress(body, stress, list(zip(factors, every, strict=True)))
    reasons += found.words()
    reasons += [] if found.reason is None else [found.reason]
    exact = left.measured["asymmetry"] == 0 and left.measured.get("axis", 0.0) == 0
    if body.constant and not found.factor <= 1:  # such a stress cannot be scaled
        reasons.append(f"stresses are {found.factor:.17g} times as large as they may be")
    factor = None if reasons or not exact else _divided(factors[0], found.factor)
    told = left.measured, left.forces, left.loads, found.factor
    return _Found(factor, tuple(reasons), tuple(rows), *told)


def _of_blocks(body: Body, arrays: Mapping[str, npt.NDArray], factors: Factors) -> _Found:
    """Return the load factor that forces on joints of rigid blocks prove, for given factors."""
    best = _joint_forces(body, arrays, "joint", factors)
    inner = None
    if "inner_force" in arrays:
        if "inner_factor" not in arrays:
            raise ProofError("inner_factor is missing.")
        factor = number_of("inner_factor", arrays["inner_factor"])
        other = number_of("inner_any_factor", arrays.get("inner_any_factor", 0.0))
        inner = _joint_forces(body, arrays, "inner", (factor, 1.0, other))
    every = (body.sought, body.constant, body.others)
    found = carried_by(body, best, inner, every)
    reasons = () if found.reason is None else (found.reason,)
    return _Found(found.factor, reasons, (), {}, found.left, found.loads)


def _joint_forces(
    body: Body, arrays: Mapping[str, npt.NDArray], prefix: str, factors: Factors
) -> JointForces:
    """Return the arrays of joint forces with a prefix, for loads at given factors."""
    none = np.zeros((len(body.facets), body.dim, body.dim))
    names = (f"{prefix}_force", f"{prefix}_traction")
    forces, tractions = checked({names[1]: none, **arrays}, names).values()
    if forces.shape != none.shape or tractions.shape != none.shape:
        raise ProofError("forces on joints do not fit the facets.")
    return JointForces(forces, tractions, factors)


def _divided(claimed: float, over: float) -> float:
    """Return the lower bound from a claim whose stress exceeds its limit by a factor ``over``."""
    return claimed if over <= 1 else float(np.nextafter(claimed / over, -np.inf))


def _upper(arrays: Mapping[str, npt.NDArray], before: _Half | None) -> _Half:
    given = checked(arrays, ("velocity", "nodes"))
    velocity, nodes = given["velocity"], given["nodes"]
    body, overlaps = _body(arrays, before)
    claimed = bound_of(arrays["bound"], bool(body.constant))
    if velocity.ndim != 2 or velocity.shape[1] != body.dim or not np.isfinite(velocity).all():
        raise ProofError("the velocity does not fit these bodies.")
    check_nodes(body, nodes, len(velocity))
    flow = measure_velocity(body, velocity[nodes])
    faults = (*_reasons(overlaps, None), *flow.reasons, *faults_of(flow.measured))
    reached = None if faults else flow.bound
    if reached is not None and not reached <= claimed + rounding_of(reached, flow.power):
        faults = (*faults, f"only {reached:.9g} is proven")
    same = before is not None and body is before.body
    words = ["For the same bodies." if same else taken_as_written(body)]
    words += reduction_words(body, arrays)
    if reached is not None:
        words.append(f"Residuals and rounding increase the bound by {flow.cost:.2g}.")
        if body.others and flow.others > 0:
            words.append(_up_to(reached, flow.work / flow.others))
    shown = None if faults else reached
    found = Checked("upper", claimed, shown, flow.measured, faults, tuple(words), reached)
    return _Half(found, body, overlaps, power=flow.power)


def _up_to(proven: float, factor: float) -> str:
    """Return a sentence on the range of the free loads' factors for which a bound holds.

    Args:
        proven: The bound without the free loads.
        factor: Factor at which the largest possible work of the free loads equals the work of the
            sought loads.
    """
    if proven < 1:
        most = (1 - proven) * factor
        return (
            "At factor 1 the loads are not carried with any factor of the free loads up to "
            f"{most:.2g}."
        )
    most = 1e-3 * proven * factor
    return f"Free loads with any factor up to {most:.2g} reduce this bound by a thousandth at most."


def _together(lower: _Half, upper: _Half) -> tuple[list[str], str]:
    """Return the faults of both halves in one file, and a sentence on the bounds' distance.

    The function compares the proven bounds, not the claimed ones.
    """
    same = upper.body is lower.body
    faults = [] if same else differences(lower.body, upper.body)
    low, high = lower.checked.proven, upper.checked.proven
    if low is None or high is None:
        return faults, "The distance of the bounds is unknown: one of them is not proven."
    if not low <= high + rounding_of(high, upper.power):
        faults.append(f"the lower bound {low:.9g} is above the upper one {high:.9g}")
    words = f"Bounds are {high - low:.3g} apart."
    if not faults and pair_of_drucker(lower.body, upper.body):
        words = f"{words} {DRUCKER}"
    if not faults and not same and pair_of_radenkovic(lower.body, upper.body):
        words = (
            f"{words} The cones of the lower half open less than those of the upper one at the "
            "same place: by the dilatancy angle and by the friction angle (Radenkovic's pair), "
            "or by the least and by the largest friction angle in a cell. Ground with both "
            "angles, or with angles between them, collapses between the bounds."
        )
    return faults, words


def _with(half: Checked, faults: list[str]) -> Checked:
    """Return a verdict with additional faults, and therefore without a proven bound."""
    return replace(half, proven=None, faults=(*half.faults, *faults))


def _body(arrays: Mapping[str, npt.NDArray], before: _Half | None) -> tuple[Body, int]:
    """Return the bodies of a half, and the number of outer facets with another cell just inside.

    If the half that was checked before has equal bodies, the function returns the bodies and the
    number of that half.
    """
    body = Body.of(arrays, None if before is None else before.body)
    if before is not None and body is before.body:
        return body, before.overlaps
    check_loaded(body)
    return body, overlapping(body)


def _reasons(overlaps: int, reason: str | None) -> list[str]:
    """Return the reasons why a half cannot be proven."""
    words = f"cells overlap ({overlaps} points of cells are also in others)"
    return [words] * (overlaps > 0) + ([] if reason is None else [reason])


JUDGES: Mapping[str, Callable[[Mapping[str, npt.NDArray], _Half | None], _Half]] = {
    "lower": _lower,
    "upper": _upper,
}
"""Function that checks each half, given the half that was checked before it."""
