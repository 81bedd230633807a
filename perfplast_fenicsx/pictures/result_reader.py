"""The results of a run as they are on file, for pictures. Single-process: it reads whole fields.

The run may still be going on: it replaces files as a whole, and opens none again, so that reading
does not disturb it. HDF5's locks are not used, since some file systems have none.
"""

import csv
import dataclasses
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar
from xml.etree import ElementTree

import h5py
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.scene import NamedScene, Scene, read_scene
from perfplast_fenicsx.io.results.array_names import (
    BODY,
    GEOMETRY,
    SURFACE_TAGS,
    SURFACES,
    TOPOLOGY,
)
from perfplast_fenicsx.pictures.boundary_surface import Skin, Surface, make_skin
from perfplast_fenicsx.problem.report import LevelReport

Floats = npt.NDArray[np.float64]
T = TypeVar("T")

SAME = 1e-9
"""Relative difference of the time of fields and what a level prescribes, which is rounding."""

NODAL, CELLWISE = ("displacement", "contact_pressure"), ("yield_ratio",)


@dataclass(frozen=True)
class Bounds:
    """What is known of the limit load (:class:`limit_search.LimitLoad`)."""

    lower: float
    estimate: float | None
    upper: float | None


@dataclass(frozen=True)
class StoredLevel:
    """A level whose fields are on file.

    Attributes:
        number: From 1.
        report: Its row of ``path.csv``.
        places: Of its fields, as ``FILE:/ARRAY``, by name.
    """

    number: int
    report: LevelReport
    places: dict[str, str]


class ResultReader:
    """A result folder, as it was when first looked at."""

    def __init__(self, path: str | Path) -> None:
        """Look whether there are results.

        Raises:
            InputError: If there are none.
        """
        self.path = Path(path)
        if not self.path.is_dir():
            what = "is not a folder" if self.path.exists() else "does not exist"
            raise InputError(f"the result folder '{path}' {what}; give the DIR of perfplast run.")
        for name in ("summary.json", "path.csv", "scene.json"):
            if not (self.path / name).is_file():
                raise InputError(
                    f"the folder '{path}' has no {name}, so it has no results of this version; give"
                    " the DIR of perfplast run, or run the case again."
                )

    def __repr__(self) -> str:
        return f"ResultReader({str(self.path)!r}: {self.model.title}; {len(self.reports)} levels)"

    @cached_property
    def named(self) -> NamedScene:
        """The content of ``scene.json``."""
        return read_scene(self._json("scene.json"), str(self.path / "scene.json"))

    @property
    def model(self) -> Scene:
        """What is drawn around the bodies."""
        return self.named.model

    @cached_property
    def limit(self) -> Bounds | None:
        """The limit load, where it has been found."""
        found = self._json("summary.json").get("limit")
        return found and Bounds(found["lower"], found["estimate"], found["upper"])

    @cached_property
    def reports(self) -> list[LevelReport]:
        """All levels so far."""

        def rows(path: Path) -> list[LevelReport]:
            with path.open(encoding="utf-8", newline="") as file:
                return [_report(row) for row in csv.DictReader(file)]

        return self._read("path.csv", rows)

    @cached_property
    def levels(self) -> list[StoredLevel]:
        """The levels whose fields are on file; none where no fields were written."""
        if not (self.path / "fields.xdmf").exists():
            return []
        wanted = {*NODAL, *CELLWISE}
        series = [(at, a) for at, a in self._series("fields.xdmf") if wanted <= set(a)]

        def matched(key: str) -> list[StoredLevel]:
            """The levels where ``key``, ζ or α, is the time of the fields."""
            return [
                StoredLevel(number, report, places)
                for number, report in enumerate(self.reports, start=1)
                for at, places in series
                if report.converged and abs(at - getattr(report, key)) <= SAME * abs(at)
            ]

        return max(map(matched, ("zeta", "alpha")), key=len)

    @cached_property
    def gdim(self) -> int:
        """Dimension of the mesh."""
        return 2 if self._skin.surface.plane else 3

    def surface(self, level: StoredLevel) -> Surface:
        """The skin with the fields of a level."""
        places = level.places
        at_points = {name: self._nodal(self._array(places[name])) for name in NODAL}
        at_cells = {name: self._cellwise(self._array(places[name])) for name in CELLWISE}
        return dataclasses.replace(self._skin.surface, at_points=at_points, at_cells=at_cells)

    def mechanism(self, surface: Surface) -> tuple[Surface, float] | None:
        """The collapse mechanism, where the limit load has been found.

        Args:
            surface: The last level, whose stress and contact pressure are shown with it.

        Returns:
            The skin with the velocity as ``displacement`` and the ``dissipation``, and the largest
            dissipation of all cells; None where there is no mechanism.
        """
        if self.limit is None or not (self.path / "mechanism.xdmf").exists():
            return None
        (_, places), *_ = self._series("mechanism.xdmf") or [(0.0, {})]
        work = self._array(places["dissipation"])
        at_cells = surface.at_cells | {"dissipation": self._cellwise(work)}
        at_points = surface.at_points | {
            "displacement": self._nodal(self._array(places["mechanism"]))
        }
        found = dataclasses.replace(surface, at_points=at_points, at_cells=at_cells)
        return found, float(work.max(initial=0.0))

    @cached_property
    def _skin(self) -> Skin:
        """The skin without fields."""

        def read(path: Path) -> Skin:
            with h5py.File(path, locking=False) as file:
                x, cells, body = file[GEOMETRY][:], file[TOPOLOGY][:], file[BODY][:].ravel()
                facets, tags = file[SURFACES][:], file[SURFACE_TAGS][:].ravel()
            return make_skin(x, cells, body, facets, tags, self.named)

        return self._read("fields.h5", read)

    def _array(self, place: str) -> Floats:
        """The array that an XDMF file names."""
        file_, _, name = place.partition(":")

        def read(path: Path) -> Floats:
            with h5py.File(path, locking=False) as file:
                return np.asarray(file[name], dtype=np.float64)

        return self._read(file_, read)

    def _nodal(self, values: Any) -> Floats:
        """Values at the skin's points, shape (num_points,) or (num_points, 3)."""
        array = np.asarray(values, dtype=np.float64)[self._skin.nodes]
        return array[:, 0] if array.shape[1] == 1 else array

    def _cellwise(self, values: Any) -> Floats:
        """Values of the cells below the skin's triangles."""
        return np.asarray(values, dtype=np.float64).ravel()[self._skin.cells]

    def _json(self, name: str) -> dict[str, Any]:
        def load(path: Path) -> dict[str, Any]:
            table = json.loads(path.read_text(encoding="utf-8"))
            if not isinstance(table, dict):
                raise ValueError("it is no JSON object")
            return table

        return self._read(name, load)

    def _series(self, name: str) -> list[tuple[float, dict[str, str]]]:
        """Times of an XDMF file, rising, each with the places of its fields."""

        def read(path: Path) -> list[tuple[float, dict[str, str]]]:
            found: dict[float, dict[str, str]] = {}
            for grid in ElementTree.parse(path).iter("Grid"):
                at = grid.find("Time")
                for attribute in grid.findall("Attribute") if at is not None else []:
                    item = attribute.find("DataItem")
                    assert at is not None
                    assert item is not None
                    fields = found.setdefault(float(at.attrib["Value"]), {})
                    fields[attribute.attrib["Name"]] = (item.text or "").strip()
            return sorted(found.items())

        return self._read(name, read)

    def _read(self, name: str, read: Callable[[Path], T]) -> T:
        """The content of a file.

        Raises:
            InputError: If it cannot be read.
        """
        try:
            return read(self.path / name)
        except InputError:
            raise
        except (OSError, KeyError, ValueError, RuntimeError, ElementTree.ParseError) as error:
            reason = str(error).strip("'\"").split("\n")[0]
            raise InputError(
                f"'{self.path / name}' cannot be read ({reason}); run the case again."
            ) from error


def _report(row: dict[str, Any]) -> LevelReport:
    values = {}
    for field in dataclasses.fields(LevelReport):
        text = row[field.name]
        values[field.name] = text == "True" if field.type is bool else field.type(text)  # type: ignore[operator]
    return LevelReport(**values)
