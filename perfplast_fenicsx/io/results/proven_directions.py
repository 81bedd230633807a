"""``directions.json``: what the directions of an envelope have proven, for runs that go on."""

import json
from dataclasses import asdict

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.errors import raise_together
from perfplast_fenicsx.io.results.result_files import KNOWN
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis.body.interaction import Proven


def write_proven(folder: ResultFolder, proven: Proven) -> None:
    """Put what a direction proves on file, beside the others. Collective.

    Raises:
        InputError: On every rank, if the system refuses, or what is there cannot be read.
    """
    others = [one for one in read_proven(folder) if not one.is_at(proven.angles)]
    text = json.dumps([asdict(one) for one in [*others, proven]], indent=1)
    folder.on_root(lambda: replace(folder.file(KNOWN), text.encode()))


def read_proven(folder: ResultFolder) -> list[Proven]:
    """What an earlier run has put on file; nothing where there is no file. Collective.

    Raises:
        InputError: On every rank, if it cannot be read.
    """
    found, path = list[Proven](), folder.file(KNOWN)
    error = None
    if folder.comm.rank == 0 and path.exists():
        try:
            found = [_proven(row) for row in json.loads(path.read_text(encoding="utf-8"))]
        except (OSError, ValueError, KeyError, TypeError) as fault:
            error = (
                f"{path} cannot be read ({fault}); begin anew with --force instead of --restart."
            )
    raise_together(folder.comm, error)
    return list(folder.comm.bcast(found))


def _proven(row: dict[str, list[float] | None]) -> Proven:
    angles, carried, side = (row[key] for key in ("angles", "carried", "side"))
    return Proven(
        tuple(map(float, angles or ())),
        None if carried is None else tuple(map(float, carried)),
        None if side is None else tuple(map(float, side)),
    )
