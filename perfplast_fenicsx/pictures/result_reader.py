"""Read the results of a run from its files, for pictures. Single-process: it reads whole fields.

The run may still be in progress. A run replaces files as a whole and never reopens them, so reading
does not disturb the run. The module does not use HDF5's file locks, which some file systems lack.
"""

import csv
import dataclasses
import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.scene import NamedScene, Scene, read_scene
from perfplast_fenicsx.io.case.schema import convert
from perfplast_fenicsx.io.results.result_files import (
    BEGUN,
    BESIDE,
    BODY,
    CELL_DATA,
    CONNECTIVITY,
    EARLIER,
    FIELD_DATA,
    FLOW,
    INTERRUPTED,
    MECHANISM,
    MESH,
    NAMED,
    OFFSETS,
    POINT_DATA,
    POINTS,
    SERIES,
    SURFACE_TAGS,
    SURFACES,
)
from perfplast_fenicsx.io.results.summary import Summary
from perfplast_fenicsx.pictures.boundary_surface import Skin, Surface, make_skin
from perfplast_fenicsx.problem.judged.report import LevelReport
from perfplast_fenicsx.proof.stored_file import check_regular, stored_file

FAR = 30.0
"""Ratio of the last to the first α above which the axis of α is logarithmic."""


@dataclass(frozen=True)
class StoredLimit:
    """A limit load of a result folder (:class:`limit_load.LimitLoad`).

    Attributes:
        lower: Static side of the mesh's limit load; not a bound for the body; −∞ if it is not
            known.
        estimate: Estimate of the mesh's limit load.
        upper: Kinematic side of the mesh's limit load; not a bound for the body.
        body: Table ``body`` in ``summary.json``; empty if it is missing.
        theorem: Whether limit theorems hold. If not, a path loses equilibrium between both sides.
        standing: Sentence on whether the constant loads alone are carried, if this was requested.
        strength: Factor of safety, if requested (:meth:`safety_factor.FactorOfSafety.table`).
        envelope: Carried combinations of loads, if requested.
        shakedown: Shakedown load, if requested (:class:`shakedown_load.ShakedownLoad`).
    """

    lower: float
    estimate: float | None
    upper: float | None
    body: Mapping[str, Any]
    theorem: bool = True
    standing: str = ""
    strength: Mapping[str, Any] | None = None
    envelope: Mapping[str, Any] | None = None
    shakedown: Mapping[str, Any] | None = None


def stored_limit(table: Mapping[str, Any]) -> StoredLimit:
    """Return the limit load from the table ``limit`` of ``summary.json``.

    Raises:
        KeyError: If a key is missing.
        TypeError: If a value has the wrong type.
        ValueError: If a text is not a number.
    """
    return StoredLimit(
        lower=float(table["lower"]) if table["lower"] is not None else -math.inf,
        estimate=table["estimate"],
        upper=table["upper"],
        body=table.get("body") or {},
        theorem=table.get("theorem", True),
        standing=table.get("standing") or "",
        strength=table.get("strength"),
        envelope=table.get("envelope"),
        shakedown=table.get("shakedown"),
    )


T = TypeVar("T")

DISPLACEMENT, PRESSURE = f"{POINT_DATA}/displacement", f"{POINT_DATA}/contact_pressure"
SLIP, FRICTION = f"{POINT_DATA}/slip", f"{POINT_DATA}/friction_stress"
YIELD_RATIO, LEVEL = f"{CELL_DATA}/yield_ratio", f"{FIELD_DATA}/level"
ACCUMULATED = f"{CELL_DATA}/accumulated_plastic_strain"
VELOCITY, DISSIPATION = f"{POINT_DATA}/mechanism", f"{CELL_DATA}/dissipation"


@dataclass(frozen=True)
class StoredLevel:
    """A level whose fields are stored.

    Attributes:
        number: Number of the level, from 1.
        report: Row of ``path.csv``.
        file: File with the fields, in the result folder.
    """

    number: int
    report: LevelReport
    file: str


@dataclass(frozen=True)
class StoredFlow:
    """The flow of water through the ground.

    Attributes:
        points: Coordinates, shape (num_points, d).
        cells: Indices of each cell's points, shape (num_cells, d + 1).
        pressure: Pore pressure at the points (stress).
        head: Total head at the points (length).
        saturation: Saturation at the points; 1 below the free surface, 0 above it.
        axis: Index of the coordinate that points upwards.
    """

    points: npt.NDArray[np.float64]
    cells: npt.NDArray[np.int64]
    pressure: npt.NDArray[np.float64]
    head: npt.NDArray[np.float64]
    saturation: npt.NDArray[np.float64]
    axis: int

    @property
    def height(self) -> npt.NDArray[np.float64]:
        """Return the height of the points (length)."""
        return self.points[:, self.axis]


class ResultReader:
    """Reads a result folder. Later changes of data that were already read have no effect."""

    def __init__(self, path: str | Path) -> None:
        """Check that the folder has results.

        Raises:
            InputError: If it has no results.
        """
        self.path = Path(path)
        if not self.path.is_dir():
            what = "is not a folder" if self.path.exists() else "does not exist"
            raise InputError(
                f"the result folder '{path}' {what}; give the folder that perfplast run wrote."
            )
        for name in EARLIER:
            if (self.path / name).exists():
                raise InputError(
                    f"the folder '{path}' contains {name}, so its results come from an earlier "
                    "version, which this version cannot read; run the case again."
                )
        for name in ("summary.json", "path.csv", "scene.json"):
            if not (self.path / name).is_file():
                raise InputError(
                    f"the folder '{path}' contains no {name}, so it has no results from this "
                    "version; give the folder that perfplast run wrote, or run the case again."
                )

    def __repr__(self) -> str:
        return f"ResultReader({str(self.path)!r}: {self.scene.title}; {len(self.reports)} levels)"

    @cached_property
    def named(self) -> NamedScene:
        """Return the content of ``scene.json``."""
        return read_scene(self._json("scene.json"), str(self.path / "scene.json"))

    @cached_property
    def summary(self) -> Summary:
        """Return the content of ``summary.json``."""
        return convert(self._json("summary.json"), Summary, str(self.path / "summary.json"))

    @cached_property
    def interrupted(self) -> str:
        """Return the signal that ended the run, such as SIGTERM; empty if no signal ended it."""
        log = self.path / "run.log"
        text = log.read_text(encoding="utf-8", errors="replace") if log.is_file() else ""
        last = text[text.rfind(f" {BEGUN} ") :]
        signal = re.search(rf"WARNING {INTERRUPTED} (\w+)", last)
        return signal[1] if signal else ""

    @property
    def scene(self) -> Scene:
        """Return the scene of the run: names, loads, contacts and units."""
        return self.named.scene

    @cached_property
    def limit(self) -> StoredLimit | None:
        """Return the limit load; None if it has not been found."""
        found = self.summary.limit
        if not found:
            return None

        return self.read("summary.json", lambda _: stored_limit(found))

    @cached_property
    def reports(self) -> list[LevelReport]:
        """Return the reports of all levels so far, without reactions, which no picture shows."""

        def rows(path: Path) -> list[LevelReport]:
            with path.open(encoding="utf-8", newline="") as file:
                table = csv.DictReader(file)
                if {"mesh", "factor", "angle"} & set(
                    table.fieldnames or ()
                ):  # a table without levels
                    return []
                return [_report(row) for row in table]

        return self.read("path.csv", rows)

    @cached_property
    def levels(self) -> list[StoredLevel]:
        """Return the levels whose fields are stored; empty if no fields were written."""
        if not (self.path / SERIES).exists():
            return []

        def files(path: Path) -> list[str]:
            return [entry["name"] for entry in json.loads(path.read_text("utf-8"))["files"]]

        names = self.read(SERIES, files)
        numbers = [int(self._arrays(name, LEVEL)[0][0]) for name in names]
        return [  # the fields of a level are written before its row in path.csv
            StoredLevel(number, self.reports[number - 1], name)
            for number, name in zip(numbers, names, strict=True)
            if number <= len(self.reports)
        ]

    @cached_property
    def gdim(self) -> int:
        """Return the dimension of the mesh."""
        return 2 if self.skin.surface.plane else 3

    def surface(self, level: StoredLevel) -> Surface:
        """Return the skin with the fields of a level."""
        skin = self.skin
        u, pressure, ratio = self._arrays(level.file, DISPLACEMENT, PRESSURE, YIELD_RATIO)
        at_cells = {"yield_ratio": ratio[skin.cells]}
        if bool(level.report.factors) and self.read(level.file, _remembers):
            (flow,) = self._arrays(level.file, ACCUMULATED)
            at_cells["accumulated_plastic_strain"] = flow[skin.cells]
        at_points = {"displacement": u, "contact_pressure": pressure}
        if any(one.rubs for one in (*self.scene.contacts, *self.scene.obstacles)):
            slip, stress = self._arrays(level.file, SLIP, FRICTION)
            at_points |= {"slip": slip, "friction_stress": stress}
        on_skin = {name: values[skin.nodes] for name, values in at_points.items()}
        return dataclasses.replace(skin.surface, at_points=on_skin, at_cells=at_cells)

    def mechanism(self, surface: Surface | None) -> tuple[Surface, float] | None:
        """Return the skin with the collapse mechanism and its largest dissipation, or None.

        Args:
            surface: Skin at the last level, whose stress and contact pressure are shown with the
                mechanism; None if the mechanism was found without a level and has its own stress.

        Returns:
            The skin with the velocity as ``displacement`` and, unless bodies are rigid blocks, the
            ``dissipation``; and the largest dissipation of all cells. None if there is no
            mechanism.
        """
        if self.limit is None or not (self.path / MECHANISM).exists():
            return None
        skin = self.skin
        yields = self.read(MECHANISM, lambda path: _has(path, DISSIPATION))
        if surface is None:
            (pressure,) = self._arrays(MECHANISM, PRESSURE)
            at_cells = {}
            if yields:
                (ratio,) = self._arrays(MECHANISM, YIELD_RATIO)
                at_cells = {"yield_ratio": ratio[skin.cells]}
            at_points = {"contact_pressure": pressure[skin.nodes]}
            surface = dataclasses.replace(skin.surface, at_points=at_points, at_cells=at_cells)
        (velocity,) = self._arrays(MECHANISM, VELOCITY)
        at_cells, largest = surface.at_cells, 0.0
        if yields:
            (work,) = self._arrays(MECHANISM, DISSIPATION)
            at_cells, largest = at_cells | {"dissipation": work[skin.cells]}, work.max(initial=0.0)
        at_points = surface.at_points | {"displacement": velocity[skin.nodes]}
        found = dataclasses.replace(surface, at_points=at_points, at_cells=at_cells)
        return found, float(largest)

    @cached_property
    def skin(self) -> Skin:
        """Return the skin without fields."""
        names = (POINTS, CONNECTIVITY, OFFSETS, BODY, SURFACES, SURFACE_TAGS)
        points, corners, offsets, body, facets, tags = self._arrays(MESH, *names)
        cells = corners.reshape(len(offsets) - 1, -1)  # all cells have equally many nodes
        return make_skin(points, cells, body, facets, tags, self.named)

    @cached_property
    def flow(self) -> StoredFlow | None:
        """Return the flow of water; None if no water flows."""
        if self.summary.seepage is None:
            return None
        names = [f"{POINT_DATA}/{name}" for name in ("pressure", "head", "saturation")]
        points, corners, offsets, upwards, pressure, head, saturation = self._arrays(
            FLOW, POINTS, CONNECTIVITY, OFFSETS, f"{FIELD_DATA}/upwards", *names
        )
        cells = corners.reshape(len(offsets) - 1, -1)
        axis = "xyz".index(upwards[0].decode())
        points = points[:, : cells.shape[1] - 1]
        return StoredFlow(points, cells, pressure, head, saturation, axis)

    def _arrays(self, name: str, *places: str) -> list[npt.NDArray[Any]]:
        """Return arrays of a VTKHDF file, by their paths in the file."""

        def read(path: Path) -> list[npt.NDArray[Any]]:
            with stored_file(path, BESIDE) as file:
                return [np.asarray(file[place]) for place in places]

        return self.read(name, read)

    def _json(self, name: str) -> dict[str, Any]:
        def load(path: Path) -> dict[str, Any]:
            if not isinstance(table := json.loads(path.read_text(encoding="utf-8")), dict):
                raise ValueError("it is not a JSON object")
            return table

        return self.read(name, load)

    def read(self, name: str, read: Callable[[Path], T]) -> T:
        """Return the content of a file in the folder.

        Raises:
            InputError: If the file cannot be read, or is not in the folder.
        """
        path = self.path / str(name)
        try:
            if not path.resolve().is_relative_to(self.path.resolve()):
                raise OSError("it lies outside the result folder")
            check_regular(path)
            return read(path)
        except InputError:
            raise
        except (OSError, KeyError, TypeError, ValueError, RuntimeError) as error:
            reason = str(error).strip("'\"").split("\n")[0]
            raise InputError(f"'{path}' cannot be read ({reason}); run the case again.") from error


def _remembers(path: Path) -> bool:
    """Return whether a result file contains a history of plastic flow."""
    return _has(path, ACCUMULATED)


def _has(path: Path, place: str) -> bool:
    """Return whether a file contains an array."""
    with stored_file(path, BESIDE) as file:
        return place in file


def _report(row: dict[str, Any]) -> LevelReport:
    """Return the report in a row of path.csv; columns from later versions may be missing."""
    values: dict[str, Any] = {}
    for key in NAMED:
        begin = f"{key}_"
        named = {name.removeprefix(begin): row[name] for name in row if name.startswith(begin)}
        values[f"{key}s"] = {name: float(text) for name, text in named.items()}
    for field in dataclasses.fields(LevelReport):
        if field.name == "reactions" or field.name in values:
            continue
        if field.name not in row and field.default is not dataclasses.MISSING:
            continue
        text = row[field.name]
        values[field.name] = text == "True" if field.type is bool else field.type(text)  # type: ignore[operator]
    return LevelReport(**values)
