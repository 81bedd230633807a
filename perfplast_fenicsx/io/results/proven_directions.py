"""Store ``directions.json``: proven bounds of an envelope's directions, for continued runs."""

import json
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.io.results.claims import check_claim, direction_file, proven_by
from perfplast_fenicsx.io.results.result_files import KNOWN
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis.body.interaction import Proven
from perfplast_fenicsx.limit_analysis.body.proven_polytopes import rays_at


def write_proven(folder: ResultFolder, proven: Proven) -> None:
    """Add the proven bounds of a direction to the file. Collective.

    Raises:
        InputError: On every rank, if the system refuses, or if the existing file cannot be read.
    """
    others = [one for one in read_proven(folder) if not one.is_at(proven.angles)]
    text = json.dumps([asdict(one) for one in [*others, proven]], indent=1)
    folder.on_root(lambda: replace(folder.file(KNOWN), text.encode()))


def read_proven(folder: ResultFolder, again: bool = False) -> list[Proven]:
    """Return the proven directions of an earlier run; an empty list without a file. Collective.

    Args:
        folder: The result folder.
        again: Whether the proof file of each direction must prove it again.

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
                f"{path} cannot be read ({fault}); start again with --force instead of --restart."
            )
    raise_together(folder.comm, error)
    return list(folder.comm.bcast(found))


def _check(folder: ResultFolder, found: Sequence[Proven]) -> None:
    """Check that the file of each direction proves its bounds. Only rank 0 calls this function.

    Raises:
        InputError: If a file does not.
    """
    for one in found:
        name, ray = direction_file(one.angles), rays_at(np.array([one.angles]))[0]
        path = folder.file(name)
        halves = proven_by(path) if path.exists() else {}
        if one.carried is not None:
            along = float(ray @ one.carried)
            off = float(np.linalg.norm(one.carried - along * ray))
            if off > 1e-9 * abs(along):
                raise InputError(f"{KNOWN} has a point that is not along {one.angles} degrees.")
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
