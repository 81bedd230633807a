"""Compare the bounds that a result folder claims with the bounds that its proof files prove."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.result_files import DIRECTIONS, FALLS, LEAST, PROOF, STANDS
from perfplast_fenicsx.limit_analysis.body.proven_polytopes import rays_at
from perfplast_fenicsx.proof.checker import check, check_pair, factor_of
from perfplast_fenicsx.proof.plain_arrays import ProofError
from perfplast_fenicsx.proof.verdict import Checked

Proofs = dict[str, dict[str, Checked]]
"""The results of the checker by name of the proof file and by kind, "lower" or "upper"."""

SAME = 1e-9
"""Relative difference up to which bounds count as equal."""


def direction_file(angles: tuple[float, ...]) -> str:
    """Return the name of the proof file for a direction of an envelope (angles in degrees)."""
    return "_".join([DIRECTIONS, *(f"{angle:06.2f}" for angle in angles)]) + ".h5"


def proofs_in(folder: Path) -> Proofs:
    """Return the results that the checker finds in the proof files of a folder.

    Raises:
        InputError: If a file cannot be read.
    """
    names = [name for name in (PROOF, LEAST, STANDS, FALLS) if (folder / name).exists()]
    names += [path.name for path in sorted(folder.glob(f"{DIRECTIONS}_*.h5"))]
    return {name: proven_by(folder / name) for name in names}


def proven_by(path: Path) -> dict[str, Checked]:
    """Return the checker's result for each half of a proof file, by "lower" and "upper".

    Raises:
        InputError: If the file cannot be read.
    """
    if path.is_symlink():
        raise InputError(
            f"'{path}' is a symbolic link, which may lead to another folder; remove it and run the"
            " case again."
        )
    try:
        return check(path)
    except ProofError as error:
        raise InputError(f"{error} Run the case again.") from error


def check_claims(limit: dict[str, Any], proofs: Proofs) -> None:
    """Check that proof files prove the bounds that ``summary.json`` claims as strict.

    If the proof of a bound for the body is missing, the function removes the bound from the table
    and adds the reason.

    Args:
        limit: The table ``limit`` of ``summary.json``.
        proofs: The results of the checker for the files.

    Raises:
        InputError: If a file proves a different bound, or if the proof of an envelope or of a
            factor of safety is missing.
    """
    body = limit.get("body") or {}
    for name, kind, claimed in list(_claims(limit)):
        halves = proofs.get(name, {})
        if name == PROOF and kind not in halves:
            _take_out(body, kind)
            why = f"summary.json claims {claimed:.9g}, but {name} has no proof of it"
            body["why_not"] = [*body.get("why_not", []), f"{kind} bound: {why}"]
            continue
        check_claim("summary.json", name, kind, claimed, halves)


def _take_out(body: dict[str, Any], kind: str) -> None:
    """Remove a bound from the table of the body."""
    if body.get("standing"):
        low, high = body["standing"]
        body["standing"] = [None, high] if kind == "lower" else [low, None]
    else:
        body[kind] = None


def check_factor(folder: Path, limit: Mapping[str, Any], proofs: Proofs) -> None:
    """Check that the two proof files of a factor of safety prove it for the same bodies.

    For ground with ψ < φ the bodies are not compared, because the equivalent associated ground
    depends on the factor.

    Args:
        folder: The result folder.
        limit: The table ``limit`` of ``summary.json``.
        proofs: The results of the checker for the files.

    Raises:
        InputError: If the files do not prove the factor, or if the bodies in both files differ.
    """
    strength = limit.get("strength") or {}
    both = {"lower": folder / STANDS, "upper": folder / FALLS}
    known = {kind: path for kind, path in both.items() if strength.get(kind) is not None}
    try:
        factors = {kind: factor_of(path, kind) for kind, path in known.items()}
        faults: tuple[str, ...] = ()
        if len(known) == len(both) and not strength.get("estimate"):
            found = [proofs[path.name] for path in both.values()]
            faults = check_pair(both["lower"], both["upper"], found).faults
    except ProofError as error:
        raise InputError(f"{error} Run the case again.") from error
    for kind, factor in factors.items():
        if not abs(factor - strength[kind]) <= SAME * abs(factor):
            raise InputError(
                f"summary.json says that F = {strength[kind]:.9g} is proven, but"
                f" {known[kind].name} has F = {factor:.9g}; run the case again."
            )
    if faults:
        raise InputError(
            f"{STANDS} and {FALLS} do not prove a factor of safety for the same bodies "
            f"({'; '.join(faults)}); run the case again."
        )


def check_claim(
    source: str, name: str, kind: str, claimed: float, halves: Mapping[str, Checked]
) -> None:
    """Check that a proof file proves a bound.

    Args:
        source: Name of the file that claims the bound.
        name: Name of the proof file.
        kind: "lower" or "upper".
        claimed: The bound.
        halves: The results of the checker for both halves of the file.

    Raises:
        InputError: If the file does not prove the bound.
    """
    said = f"{source} says that the {kind} bound {claimed:.9g} is proven, but {name}"
    again = "run the case again"
    half = halves.get(kind)
    if half is None:
        raise InputError(f"{said} contains no proof of this bound; {again}.")
    if half.proven is None:
        raise InputError(f"{said} does not prove this bound ({'; '.join(half.faults)}); {again}.")
    excess = claimed - half.claimed if kind == "lower" else half.claimed - claimed
    if not excess <= SAME * abs(half.claimed):
        raise InputError(f"{said} proves only {half.proven:.9g}; {again}.")


def _claims(limit: Mapping[str, Any]) -> Iterator[tuple[str, str, float]]:
    """Yield the proof file, the kind and the value of each claimed bound.

    For a factor of safety, the claimed value is 1. With strengths divided by the lower factor, the
    bodies carry the loads; with strengths divided by the upper factor, they do not.
    """
    body, strength = limit.get("body") or {}, limit.get("strength") or {}
    if strength:
        for kind, name in (("lower", STANDS), ("upper", FALLS)):
            if strength.get(kind) is not None:
                yield name, kind, 1.0
        return
    bounds = body.get("standing") or [body.get("lower"), body.get("upper")]
    for kind, value in zip(("lower", "upper"), bounds, strict=True):
        if value is not None:
            yield PROOF, kind, float(value)
    least = body.get("least") or {}  # these are bounds for the reversed loads
    for kind, key in (("lower", "carried"), ("upper", "none_below")):
        if least.get(key) is not None:
            yield LEAST, kind, -float(least[key])
    if envelope := limit.get("envelope"):
        yield from _in_directions(envelope)


def _in_directions(envelope: Mapping[str, Any]) -> Iterator[tuple[str, str, float]]:
    """Yield the claims of an envelope, whose points are each λ times the ray of a direction.

    Half-spaces are not included, because a proof file contains the loads of only one direction.
    """
    directions = [tuple(map(float, angles)) for angles in envelope["directions"]]
    rays = rays_at(np.array(directions))
    parallel = 1e-9  # relative deviation above which a point does not lie on a ray
    for point in np.array(envelope["carried"], dtype=np.float64):
        if point.any():
            along = rays @ point
            best = int(np.argmax(np.abs(along)))
            if not abs(along[best]) >= (1 - parallel) * np.linalg.norm(point):
                raise InputError(
                    "summary.json has an envelope point that does not lie in any of the "
                    "directions; run the case again."
                )
            yield direction_file(directions[best]), "lower", float(along[best])
