"""Write and check proof files such as ``bounds.h5``, and the file ``directions.json``.

The groups ``lower`` and ``upper`` of a proof file contain the arrays from :mod:`proof_arrays`.
:mod:`proof.checker` checks them without other code of the program.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import h5py
import numpy as np

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.io.results.claims import check_claim, direction_file, proven_by
from perfplast_fenicsx.io.results.result_files import KNOWN
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.io.results.vtkhdf import write_arrays
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import AdaptiveBounds
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.interaction import Proven
from perfplast_fenicsx.limit_analysis.body.proof_arrays import (
    LowerProof,
    VelocityProof,
    half_arrays,
    proofs,
    proven_part,
)
from perfplast_fenicsx.limit_analysis.body.proven_polytopes import rays_at
from perfplast_fenicsx.proof.checker import check
from perfplast_fenicsx.proof.verdict import Checked


def write_proof(
    folder: ResultFolder, path: Path, lower: LowerProof | None, upper: VelocityProof | None
) -> None:
    """Write the proofs of a lower and an upper bound to a file. Collective.

    Args:
        folder: Result folder, which provides the ranks and the message for system errors.
        path: The file; its folder exists.
        lower: Proof of the lower bound, or None.
        upper: Proof of the upper bound, or None. Its mesh of the bodies may be different.

    Raises:
        InputError: If cells or obstacles are curved, if the file format does not support a kind of
            load, or if the file cannot be written.
    """
    blocks, numbers = half_arrays(lower, upper)

    def describe(file: h5py.File) -> None:
        for kind, each in numbers.items():
            file.create_group(kind).attrs.update(each)

    every = {f"{kind}/{name}": of for kind, half in blocks.items() for name, of in half.items()}
    write_arrays(folder, path, every, describe=describe)


def save_proof(bounds: BodyBounds | AdaptiveBounds, path: str | Path) -> dict[str, Checked]:
    """Write the proof of bounds to a file, and return the results of the checker. Collective.

    Args:
        bounds: Bounds from :func:`~.limit_bounds` or :func:`~.adaptive_bounds`.
        path: The file, such as ``bounds.h5``; it is replaced.

    Returns:
        The checker's results by "lower" and "upper", the same on every rank. Bounds that are not
        strict or that the checker refuses are missing.

    Raises:
        InputError: On every rank, if the bounds have no proof, or if the file cannot be written.
    """
    both = (bounds.low, bounds.high) if isinstance(bounds, AdaptiveBounds) else (bounds, bounds)
    target, comm = Path(path), both[0].problem.comm
    folder = ResultFolder(comm, target.parent, force=True)
    folder.on_root(lambda: target.parent.mkdir(parents=True, exist_ok=True))
    low, high = judge(folder, folder.file(target.name), *both)
    if not (low.lower.strict or high.upper.strict):
        why = "; ".join((*low.lower.why_not, *high.upper.why_not))
        raise InputError(f"these bounds have no proof ({why}); compute strict bounds.")
    found: dict[str, Checked] = comm.bcast(check(target) if comm.rank == 0 else {})
    return found


def judge(
    folder: ResultFolder,
    path: Path,
    low: BodyBounds,
    high: BodyBounds,
    divisor: float | None = None,
) -> tuple[BodyBounds, BodyBounds]:
    """Write the proof of two bounds; return them, and replace those that the checker refuses.

    Collective.

    Args:
        folder: The result folder.
        path: The file. It contains only proven bounds, and does not exist if nothing is proven.
        low: Bounds of which the function uses the lower one.
        high: Bounds of which the function uses the upper one.
        divisor: Factor F that divides the strengths of the bodies; None if there is no such factor.

    Returns:
        ``low`` and ``high``, in which bounds that the checker refuses are only estimates of the
        mesh. If the checker proves a weaker bound, this bound replaces the given one.

    Raises:
        InputError: As for :func:`write_proof`.
    """

    def ask(lower: LowerProof | None, upper: VelocityProof | None) -> dict[str, Checked]:
        write_proof(folder, path, lower, upper)
        return check(path) if folder.comm.rank == 0 else {}

    low, high = proven_part(low, high, ask, divisor)
    if proofs(low, high) == (None, None):
        folder.on_root(lambda: path.unlink(missing_ok=True))
    return low, high


def write_proven(folder: ResultFolder, proven: Proven) -> None:
    """Add the proven bounds of a direction to ``directions.json``. Collective.

    Raises:
        InputError: On every rank, if the file cannot be written, or if the existing file cannot be
            read.
    """
    others = [one for one in read_proven(folder) if not one.is_at(proven.angles)]
    text = json.dumps([asdict(one) for one in [*others, proven]], indent=1)
    folder.on_root(lambda: replace(folder.file(KNOWN), text.encode()))


def read_proven(folder: ResultFolder, again: bool = False) -> list[Proven]:
    """Return the proven directions of an earlier run; [] if the file is missing. Collective.

    Args:
        folder: The result folder.
        again: Whether to check the proof file of each direction again.

    Raises:
        InputError: On every rank, if the file cannot be read, or if a proof is missing or not
            valid.
    """
    found, path = list[Proven](), folder.file(KNOWN)
    error = None
    if folder.comm.rank == 0 and path.exists():
        try:
            found = [_proven(row) for row in json.loads(path.read_text(encoding="utf-8"))]
            if again:
                _check(folder, found)
        except InputError as fault:
            error = str(fault)
        except (OSError, ValueError, KeyError, TypeError) as fault:
            error = (
                f"{path} cannot be read ({fault}); start again with -o DIR --force instead of"
                " --restart."
            )
    raise_together(folder.comm, error)
    return list(folder.comm.bcast(found))


def _check(folder: ResultFolder, found: Sequence[Proven]) -> None:
    """Check that the proof file of each direction proves its bounds. Not collective.

    Raises:
        InputError: If a file does not prove its bounds.
    """
    for one in found:
        name, ray = direction_file(one.angles), rays_at(np.array([one.angles]))[0]
        path = folder.file(name)
        halves = proven_by(path) if path.exists() else {}
        if one.carried is not None:
            along = float(ray @ one.carried)
            off = float(np.linalg.norm(one.carried - along * ray))
            if off > 1e-9 * abs(along):
                degrees = ", ".join(f"{angle:g}°" for angle in one.angles)
                raise InputError(
                    f"{KNOWN} contains a point that does not lie in the direction {degrees}; start "
                    "again with -o DIR --force."
                )
            check_claim(KNOWN, name, "lower", along, halves)
        if one.side is not None:
            check_claim(KNOWN, name, "upper", one.side[-1] / float(ray @ one.side[:-1]), halves)


def _proven(row: dict[str, list[float] | None]) -> Proven:
    angles, carried, side = (row[key] for key in ("angles", "carried", "side"))
    return Proven(
        tuple(map(float, angles or ())),
        None if carried is None else tuple(map(float, carried)),
        None if side is None else tuple(map(float, side)),
    )
