"""Write files for other programs from a result folder. Runs in a single process."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from xml.sax.saxutils import quoteattr

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.export.result_rows import Row, bound_rows, level_rows, resultant_rows
from perfplast_fenicsx.export.vtu_writer import vtu_of
from perfplast_fenicsx.io.results.result_files import (
    EXPORTED,
    MECHANISM,
    MECHANISM_POINTS,
    POINT_SERIES,
    SERIES,
)
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.tables import csv_table

TABLES: dict[str, Callable[[ResultReader], list[Row]]] = {
    "levels.csv": level_rows,
    "resultants.csv": resultant_rows,
    "bounds.csv": bound_rows,
}
"""Function that returns the rows of each table, by the name of the file."""


def export(
    folder: str | Path,
    output: str | Path | None = None,
    *,
    vtu: bool = True,
    csv: bool = True,
    say: Callable[[str], None] = lambda line: None,
) -> list[Path]:
    """Write the results of a finished or active run for other programs. Not collective.

    Args:
        folder: The result folder.
        output: The folder for the files; by default ``export`` in the result folder.
        vtu: Whether to write ``.vtu`` files of each level, the quadrature points and the mechanism,
            if they are stored, and ``fields.pvd`` with a list of the levels.
        csv: Whether to write the tables of :data:`TABLES` that have rows.
        say: Function that is called with the path of each file.

    Returns:
        The paths of the files.

    Raises:
        InputError: If there are no results of the requested kinds, if they cannot be read, or if
            the files cannot be written.
    """
    reader = ResultReader(folder)
    target = Path(output) if output else reader.path / EXPORTED
    written: list[Path] = []

    def write(name: str, content: bytes) -> None:
        path = target / name
        try:
            target.mkdir(parents=True, exist_ok=True)
            replace(path, content)
        except OSError as error:
            reason = error.strerror or str(error)
            raise InputError(
                f"'{path}' cannot be written ({reason}); give another folder with -o."
            ) from error
        written.append(path)
        say(str(path))

    if vtu:
        for series, listed in ((SERIES, "fields.pvd"), (POINT_SERIES, "points.pvd")):
            _write_series(reader, series, listed, write)
        for name in (MECHANISM, MECHANISM_POINTS):
            if (reader.path / name).is_file():
                write(Path(name).with_suffix(".vtu").name, reader.read(name, vtu_of))
    if csv:
        for name, rows_of in TABLES.items():
            if rows := rows_of(reader):
                write(name, csv_table(rows))
    if not written:
        raise InputError(
            f"the folder '{folder}' contains nothing to export yet: no fields, no levels, no limit "
            "load; give the folder of a run with results."
        )
    return written


def _write_series(
    reader: ResultReader, series: str, listed: str, write: Callable[[str, bytes], None]
) -> None:
    """Write all files of a series, and the ``.pvd`` list of them for ParaView."""
    if not (reader.path / series).is_file():
        return
    entries = reader.read(series, lambda path: json.loads(path.read_text("utf-8"))["files"])
    lines = []
    for entry in entries:
        name = Path(entry["name"]).with_suffix(".vtu").name
        write(name, reader.read(entry["name"], vtu_of))
        lines.append(f'<DataSet timestep="{entry["time"]!r}" file={quoteattr(name)}/>\n')
    if lines:
        write(listed, _pvd(lines))


def _pvd(lines: Iterable[str]) -> bytes:
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
    return f"{head}{''.join(lines)}</Collection>\n</VTKFile>\n".encode()
