"""Write the fields of all levels: a VTKHDF file for each, and a list for ParaView's time series.

Each file is renamed when it is complete; then the list is replaced as a whole. So a crash does not
damage existing levels, and a restart continues them.

ParaView opens ``fields.vtkhdf.series``; PyVista shows a level by one line::

    pyvista.HDFReader("results/fields/level_0001.vtkhdf").read().plot(scalars="yield_ratio")
"""

import json
import logging
from collections.abc import Mapping, Sequence

from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.io.results.point_writer import PointWriter
from perfplast_fenicsx.io.results.result_files import (
    FIELDS,
    MECHANISM,
    MECHANISM_POINTS,
    MESH,
    POINT_SERIES,
    SERIES,
    level_file,
    point_file,
)
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.io.results.vtkhdf import FieldWriter
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.judged.report import LevelReport
from perfplast_fenicsx.problem.problem import Problem

log = logging.getLogger(__name__)


class FieldSeries:
    """Writes fields of load levels; the time is the prescribed quantity ζ or α."""

    def __init__(
        self,
        folder: ResultFolder,
        problem: Problem,
        prescribed: Prescribed,
        kept: Sequence[LevelReport] = (),
        points: bool = False,
    ) -> None:
        """Write the mesh, and keep the levels of an earlier run. Collective.

        Args:
            folder: Folder of the files.
            problem: Problem of the levels.
            prescribed: The prescribed quantity of a level.
            kept: The levels that an earlier run has written, from the first one on; files of later
                levels are removed.
            points: Whether to write fields at the quadrature points too.

        Raises:
            InputError: If the files cannot be written.
        """
        self._folder, self._prescribed = folder, prescribed
        there = folder.comm.bcast(
            [number for number in range(1, len(kept) + 1) if self._has(number)]
        )
        self._times = {number: prescribed.of(kept[number - 1]) for number in there}
        if len(there) < len(kept) and folder.comm.rank == 0:
            log.warning(
                "the fields of %d of the %d solved levels are missing in '%s': they are "
                "not listed, and have no pictures; to write them, run the case again with "
                "--force",
                *(len(kept) - len(there), len(kept), folder.file(FIELDS)),
            )
        folder.on_root(lambda: folder.file(FIELDS).mkdir(exist_ok=True))
        self._writer = FieldWriter(folder, problem, folder.file(MESH))
        self._points = PointWriter(folder, problem) if points else None
        self._list_levels()
        folder.on_root(self._remove_others)

    def __repr__(self) -> str:
        return f"FieldSeries({str(self._folder.file(SERIES))!r}: {len(self._times)} levels)"

    def write(
        self,
        number: int,
        fields: Mapping[str, fem.Function],
        report: LevelReport,
        at_points: Mapping[str, Floats] | None = None,
    ) -> None:
        """Append a solved level. Collective.

        Args:
            number: Number of the level, from 1; higher than the previous ones.
            fields: Nodal or piecewise constant functions by name (:meth:`FieldWriter.write`).
            report: The level.
            at_points: Fields at the quadrature points by name, if these are written.

        Raises:
            InputError: If the files cannot be written; existing files remain complete.
        """
        facts: dict[str, float | int | str] = {"level": number}
        facts["prescribed"] = self._prescribed.value
        facts |= {"zeta": report.zeta, "alpha": report.alpha}
        self._writer.write(self._folder.file(level_file(number)), fields, facts)
        if self._points is not None and at_points is not None:
            self._points.write(self._folder.file(point_file(number)), at_points, facts)
        self._times[number] = self._prescribed.of(report)
        self._list_levels()

    def write_mechanism(
        self,
        fields: Mapping[str, fem.Function],
        zeta: float,
        alpha: float,
        at_points: Mapping[str, Floats] | None = None,
    ) -> None:
        """Write ``mechanism.vtkhdf``. Collective.

        Args:
            fields: A velocity of unit work, its plastic work, and further fields by name.
            zeta: The load factor of the velocity.
            alpha: The reached work α.
            at_points: Fields at the quadrature points by name, if these are written.

        Raises:
            InputError: If the file cannot be written.
        """
        facts = {"zeta": zeta, "alpha": alpha}
        self._writer.write(self._folder.file(MECHANISM), fields, facts)
        if self._points is not None and at_points:
            self._points.write(self._folder.file(MECHANISM_POINTS), at_points, facts)

    def _has(self, number: int) -> bool:
        return self._folder.file(level_file(number)).is_file()

    def _list_levels(self) -> None:
        """Replace the list of the levels. Collective."""

        def write() -> None:
            self._list(SERIES, {level_file(number): time for number, time in self._times.items()})
            if self._points is not None:
                by_file = {point_file(number): time for number, time in self._times.items()}
                on_file = {n: t for n, t in by_file.items() if self._folder.file(n).is_file()}
                self._list(POINT_SERIES, on_file)

        self._folder.on_root(write)

    def _list(self, series: str, times: Mapping[str, float]) -> None:
        files = [{"name": name, "time": time} for name, time in times.items()]
        text = json.dumps({"file-series-version": "1.0", "files": files}, indent=1)
        replace(self._folder.file(series), f"{text}\n".encode())

    def _remove_others(self) -> None:
        """Remove the files of levels that are not listed."""
        ours = {self._folder.file(of(n)) for n in self._times for of in (level_file, point_file)}
        for kind in ("level", "points"):
            for path in self._folder.file(FIELDS).glob(f"{kind}_*.vtkhdf"):
                if path not in ours:
                    path.unlink()
