"""Pack data of the page's view of the bodies: mesh, levels, mechanism.

A page must be small enough for mail, so that a large run does not include every level.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.io.results.result_files import MECHANISM
from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.pictures.result_reader import ResultReader, StoredLevel
from perfplast_fenicsx.report.field_words import rank_of, words_of
from perfplast_fenicsx.report.packing import pack_integers, pack_numbers, size_of
from perfplast_fenicsx.report.skin_fields import SkinState, read_state
from perfplast_fenicsx.report.skin_lines import skin_lines
from perfplast_fenicsx.report.view_marks import view_marks
from perfplast_fenicsx.rounding import ROUNDING

ROOM = 18_000_000
"""Largest number of characters of packed arrays; the whole page then stays below 20 MB."""


ARBITRARY = (
    "Stress and contact pressure are those of one state of equilibrium at the limit load. "
    "Where nothing flows, as in bolts without load, other states are possible."
)
"""The sentence for fields at the limit load, which do not belong to a level."""


@dataclass(frozen=True)
class View:
    """Data and remarks of the view.

    Attributes:
        data: Data for ``decode.js``; None if there is nothing to show.
        remarks: Sentences on omitted data and the reasons.
    """

    data: dict[str, Any] | None
    remarks: list[str] = field(default_factory=list)


def view_data(reader: ResultReader, room: int = ROOM) -> View:
    """Return the packed skin, the levels that fit, and the mechanism.

    Args:
        reader: The results.
        room: Largest number of characters of arrays.

    Raises:
        InputError: If a field file cannot be read.
    """
    collapses = reader.limit is not None and (reader.path / MECHANISM).exists()
    if not reader.levels and not collapses:
        return View(None, ["The run stored no fields, so that the bodies are not shown."])
    units, remarks = reader.summary.units, []
    surface = reader.skin.surface
    order = np.argsort(surface.body, kind="stable")
    data = view_mesh(surface, order) | {
        "axisymmetric": reader.scene.axisymmetric,
        "marks": view_marks(reader),
        "states": [],
    }
    if collapses and not reader.levels:
        remarks.append(ARBITRARY)
    left = room - size_of(data)
    packer = _Packer(reader, order)
    newest = [packer.level(reader.levels[-1])] if reader.levels else []
    mechanism = [packer.mechanism()] if collapses else []
    if size_of(newest) + size_of(mechanism) > left:
        # Fields that are kept even if not one level with all fields fits.
        kept = ("stress", "displacement", "contact_pressure", "dissipation")
        packer = _Packer(reader, order, kept)
        newest = [packer.level(reader.levels[-1])] if reader.levels else []
        mechanism = [packer.mechanism()] if collapses else []
        remarks.append("The mesh is large: only the most important fields are on this page.")
        if size_of(newest) + size_of(mechanism) > left:
            return View(None, ["The mesh is too large for a page; open the fields with ParaView."])
    left -= size_of(mechanism)
    chosen = chosen_levels(len(reader.levels), left // max(size_of(newest), 1))
    if len(chosen) < len(reader.levels):
        remarks.append(
            f"The view has {len(chosen)} of {len(reader.levels)} levels, so that the page "
            "stays below 20 MB; the result folder has all of them."
        )
    states = [packer.level(reader.levels[number]) for number in chosen[:-1]] + newest
    data |= {"states": states + mechanism}
    data["fields"] = _offered(data["states"], units)
    for one in data["fields"]:
        if not one.pop("whole"):
            remarks.append(
                f"Some numbers of '{one['label']}' are not finite; the smallest of the others is"
                " shown there."
            )
    return View(data, remarks)


def chosen_levels(count: int, most: int) -> list[int]:
    """Return evenly spaced numbers of displayed levels from 0, always with the last one."""
    if not count:
        return []
    return sorted({int(a) for a in np.linspace(count - 1, 0, min(count, max(most, 1))).round()})


def view_mesh(surface: Surface, order: Longs) -> dict[str, Any]:
    """Return points, triangles and lines, grouped by body."""
    lines, line_body = skin_lines(surface)
    numbers = np.arange(len(surface.names) + 1)
    return {
        "plane": surface.plane,
        "size": surface.size,
        "names": surface.names,
        "points": [pack_numbers(axis) for axis in surface.points.T],
        "triangles": pack_integers(surface.triangles[order]),
        "triangleStarts": np.searchsorted(surface.body[order], numbers).tolist(),
        "lines": pack_integers(lines),
        "lineStarts": np.searchsorted(line_body, numbers).tolist(),
    }


@dataclass(frozen=True)
class _Packer:
    """Reads and packs states."""

    reader: ResultReader
    order: Longs
    kept: tuple[str, ...] = ()

    def level(self, level: StoredLevel) -> dict[str, Any]:
        report, count = level.report, len(self.reader.reports)
        what = f"step {level.number} of {count}"
        if report.stage:
            factors = ", ".join(f"{name} × {a:.4g}" for name, a in report.factors.items())
            what += f", {report.stage}: {factors or 'at rest'}"
        else:
            what += f": ζ = {report.zeta:.6g}"
        return {"title": what, "mechanism": False} | self._state(level.file)

    def mechanism(self) -> dict[str, Any]:
        title = "collapse mechanism (how the bodies move when they fail)"
        return {"title": title, "mechanism": True} | self._state(MECHANISM)

    def _state(self, name: str) -> dict[str, Any]:
        state: SkinState = read_state(self.reader, name)
        fields = {}
        for one in state.fields:
            if self.kept and one.name not in self.kept:
                continue
            values = one.values[self.order] if one.at == "cells" else one.values
            seen = values[np.isfinite(values)]  # JSON cannot represent the other values
            fields[one.name] = {
                "at": one.at,
                "low": float(seen.min()) if seen.size else 0.0,
                "high": float(seen.max()) if seen.size else 0.0,
                "whole": seen.size == values.size,
                "values": pack_numbers(values),
            }
        lengths = np.linalg.norm(state.motion.astype(np.float64), axis=1)
        return {
            "motion": [pack_numbers(axis) for axis in state.motion.T],
            "largest": float(lengths[np.isfinite(lengths)].max(initial=0.0)),
            "fields": fields,
        }


def _offered(states: list[dict[str, Any]], units: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return fields in the order of the menu, with their ranges over all levels."""
    names = sorted({name for state in states for name in state["fields"]}, key=rank_of)
    offered = []
    for name in names:
        of_levels = [a["fields"][name] for a in states if name in a["fields"]]
        words = words_of(name, units)
        low = min(a["low"] for a in of_levels)
        high = max(a["high"] for a in of_levels)
        offered.append(
            {
                "name": name,
                "label": words.label,
                "unit": words.unit,
                "low": low if low < -ROUNDING * abs(high) else 0.0,
                "high": high,
                "whole": all(a["whole"] for a in of_levels),
            }
        )
    return offered
