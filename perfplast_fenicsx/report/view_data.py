"""Pack the data of the page's view of the bodies: mesh, levels and mechanism.

A page must be small enough to send by e-mail, so the page of a large run omits some levels.

The module reads fields of a result file as numbers on the skin of the bodies. It reads a field in
slabs of rows and keeps only the values on the skin. Single-process.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.io.results.result_files import BESIDE, BODY, CELL_DATA, MECHANISM, POINT_DATA
from perfplast_fenicsx.pictures.annotations import load_arrows, spread
from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.pictures.result_reader import ResultReader, StoredLevel
from perfplast_fenicsx.problem.declared.supports import AXES
from perfplast_fenicsx.proof.stored_file import stored_file
from perfplast_fenicsx.report.packing import pack_integers, pack_numbers, size_of
from perfplast_fenicsx.rounding import ROUNDING

WORDS: dict[str, tuple[str, Literal["stress", "length", ""]]] = {
    "stress": ("von Mises stress", "stress"),
    "yield_ratio": ("utilisation (1: yields)", ""),
    "plastic": ("plastic fraction of each cell", ""),
    "displacement": ("displacement", "length"),
    "contact_pressure": ("contact pressure", "stress"),
    "accumulated_plastic_strain": ("accumulated plastic strain", ""),
    "plastic_strain": ("plastic strain", ""),
    "back_stress": ("back stress (von Mises)", "stress"),
    "slip": ("slip", "length"),
    "friction_stress": ("friction", "stress"),
    "mechanism": ("velocity at collapse", ""),
    "dissipation": ("plastic dissipation at collapse", ""),
    "lower_bound_stress": ("von Mises stress of the lower bound", "stress"),
    "gap_share": ("contribution to the gap between the bounds", ""),
}
"""Title of each field and kind of its numbers, in the order of the menu."""


@dataclass(frozen=True)
class FieldWords:
    """The displayed name of a field, and the unit of its numbers."""

    label: str
    unit: str


def words_of(name: str, units: Mapping[str, str]) -> FieldWords:
    """Return the displayed name and unit of a field; an unknown field keeps its own name.

    Args:
        name: Name of the field in the result files.
        units: Units by quantity (:meth:`units.Units.table`).
    """
    label, kind = WORDS.get(name, (name.replace("_", " "), ""))
    return FieldWords(label, units.get(kind, ""))


def rank_of(name: str) -> int:
    """Return the position of a field in the menu; unknown fields come last."""
    order = list(WORDS)
    return order.index(name) if name in order else len(order)


def skin_lines(surface: Surface) -> tuple[Longs, Longs]:
    """Return the edges of triangles that are drawn as lines.

    Returns:
        Indices of points, shape (num_lines, 2), and the body of each line, in ascending order.
    """
    corners = np.concatenate([surface.triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    edges = np.sort(corners, axis=1)
    triangle = np.tile(np.arange(len(surface.triangles)), 3)
    key = edges[:, 0] * len(surface.points) + edges[:, 1]
    order = np.argsort(key, kind="stable")
    _, first, count = np.unique(key[order], return_index=True, return_counts=True)
    a, b = order[first], order[first + (count > 1)]
    normals = _unit_normals(surface)
    # Cosine of the angle between two triangles above which their common edge is drawn.
    least_cosine = np.cos(np.radians(30.0))
    smooth = np.einsum("ni,ni->n", normals[triangle[a]], normals[triangle[b]]) > least_cosine
    same = surface.body[triangle[a]] == surface.body[triangle[b]]
    shown = a[(count != 2) | ~smooth | ~same]
    body = surface.body[triangle[shown]]
    by_body = np.argsort(body, kind="stable")
    return edges[shown[by_body]], body[by_body]


def _unit_normals(surface: Surface) -> np.ndarray:
    p, q, r = (surface.points[corner] for corner in surface.triangles.T)
    normals = np.cross(q - p, r - p)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.where(lengths > 0, lengths, 1.0))


SLAB = 1 << 17
"""Number of rows that are read together."""


@dataclass(frozen=True)
class SkinField:
    """A number at each point or triangle of the skin.

    Attributes:
        name: Name of the field in the file.
        at: Whether the values are at points or triangles.
        values: Shape (num_points,) or (num_triangles,).
    """

    name: str
    at: Literal["points", "cells"]
    values: Floats


@dataclass(frozen=True)
class SkinState:
    """The skin at a level, or with the mechanism.

    Attributes:
        motion: Displacement or velocity of the skin's points, shape (num_points, 3).
        fields: All fields as numbers, including the size of the motion.
    """

    motion: Floats
    fields: list[SkinField]


def read_state(reader: ResultReader, name: str) -> SkinState:
    """Return all fields of a file on the skin.

    Args:
        reader: The results.
        name: Name of a field file in the folder.

    Raises:
        InputError: If the file cannot be read, or has neither a displacement nor a velocity.
    """
    skin = reader.skin

    # Fields that give the motion of points; the second one is a velocity.
    motions = ("displacement", "mechanism")

    def read(path: Path) -> SkinState:
        fields, motion = [], None
        with stored_file(path, BESIDE) as file:
            places = [f"{POINT_DATA}/{a}" for a in file.get(POINT_DATA, ())]
            places += [f"{CELL_DATA}/{a}" for a in file.get(CELL_DATA, ())]
            for place in places:
                if place == BODY:
                    continue
                nodal = place.startswith(POINT_DATA)
                values = rows_of(file[place], skin.nodes if nodal else skin.cells)
                label = place.rsplit("/", 1)[1]
                if label in motions:
                    motion = values
                number = as_number(label, values)
                fields.append(SkinField(label, "points" if nodal else "cells", number))
        if motion is None:
            raise KeyError(f"neither {' nor '.join(motions)} is in it")
        return SkinState(motion, fields)

    return reader.read(name, read)


def rows_of(data: Any, rows: Longs) -> npt.NDArray[Any]:
    """Return rows of a data set in single precision.

    Args:
        data: The data set.
        rows: Row indices, in ascending order.
    """
    found = np.empty((len(rows), *data.shape[1:]), dtype=np.float32)
    for first in range(0, len(data), SLAB):
        low, high = np.searchsorted(rows, [first, first + SLAB])
        if high > low:
            found[low:high] = data[first : first + SLAB][rows[low:high] - first]
    return found


def as_number(name: str, values: Floats) -> Floats:
    """Return the numbers that the view displays for a field.

    Args:
        name: Name of the field.
        values: Numbers, vectors (n, 3), or tensors (n, 9) or (n, 3, 3).

    Returns:
        Numbers are unchanged. Vectors become their norm, stresses von Mises' stress √(3/2) ‖dev σ‖,
        and other tensors, which are strains, √(2/3) ‖ε‖.
    """
    if values.ndim == 1:
        return values
    flat = values.reshape(len(values), -1)
    if flat.shape[1] != 9:
        return np.asarray(np.linalg.norm(flat, axis=1))
    if "stress" not in name:
        return np.asarray(np.sqrt(2 / 3) * np.linalg.norm(flat, axis=1))
    deviator = flat.copy()
    deviator[:, ::4] -= flat[:, ::4].mean(axis=1, keepdims=True)
    return np.asarray(np.sqrt(3 / 2) * np.linalg.norm(deviator, axis=1))


HEAD, TICK = 0.25, 0.015
"""Length of an arrow's head relative to its shaft, and half the length of a tick relative to the
size of the bodies."""


def view_marks(reader: ResultReader) -> list[dict[str, Any]]:
    """Return the lines that show loads and supports; they move with points of the skin.

    Returns:
        Each kind has a ``colour``, ``anchors`` (a point of the skin for each end of a line), and
        ``offsets`` from the anchors, one axis after the other.
    """
    surface = reader.skin.surface
    found = []
    # Colours of lines: red, green and blue.
    colours = {"loads": (0.72, 0.05, 0.05), "supports": (0.05, 0.3, 0.75)}
    for kind, (ends, held) in {"loads": _arrows(reader), "supports": _ticks(reader)}.items():
        if len(ends):
            anchors = cKDTree(surface.points).query(held)[1]
            offsets = ends - surface.points[anchors]
            found.append(
                {
                    "kind": kind,
                    "colour": colours[kind],
                    "anchors": pack_integers(anchors),
                    "offsets": [pack_numbers(axis) for axis in offsets.T],
                }
            )
    return found


def _arrows(reader: ResultReader) -> tuple[Floats, Floats]:
    """Return the ends of arrow lines, shape (2 n, 3), and their anchor points on the skin."""
    surface = reader.skin.surface
    arrows = load_arrows(surface, surface.points, reader.scene.on_surfaces)
    tails, tips = arrows.starts, arrows.starts + arrows.vectors
    across = np.cross(arrows.vectors, [0.0, 0.0, 1.0])
    steep = np.linalg.norm(across, axis=1) < 1e-6 * np.linalg.norm(arrows.vectors, axis=1)
    across[steep] = np.cross(arrows.vectors[steep], [0.0, 1.0, 0.0])
    backs = [tips - HEAD * arrows.vectors + side * HEAD / 2 * across for side in (-1, 1)]
    ends = np.stack([tails, tips, backs[0], tips, backs[1], tips], axis=1)
    tree = cKDTree(surface.points)
    nearer = tree.query(tips)[0] <= tree.query(tails)[0]
    touched = np.where(nearer[:, None], tips, tails)
    return ends.reshape(-1, 3), np.repeat(touched, 6, axis=0)


def _ticks(reader: ResultReader) -> tuple[Floats, Floats]:
    """Return the ends and anchors of support ticks: a line along each held axis."""
    surface, tags = reader.skin.surface, reader.skin.tags
    ends, held = [np.zeros((0, 3))], [np.zeros((0, 3))]
    half = TICK * surface.size
    most_marks = 20  # approximate number of points that show a support
    for support in reader.summary.given.get("supports", []):
        chosen = np.flatnonzero(np.isin(tags, reader.named.surfaces.get(support["on"], [])))
        if not len(chosen):
            continue
        facets = surface.facets[chosen]
        total = np.linalg.norm(surface.normals[chosen], axis=1).sum()
        weights, facet = spread(
            surface.points[facets], (total / most_marks) ** (1 / (facets.shape[1] - 1))
        )
        places = np.einsum("nc,nci->ni", weights, surface.points[facets[facet]])
        letters = set(support.get("components", AXES)) & set(AXES)
        axes = [np.eye(3)[AXES.index(one)] for one in letters if not surface.plane or one != "z"]
        if support.get("components") == "normal":
            normal = surface.normals[chosen].sum(axis=0)
            axes = [normal / np.linalg.norm(normal)]
        for along in half * np.array(axes):
            ends.append(np.stack([places - along, places + along], axis=1).reshape(-1, 3))
            held.append(np.repeat(places, 2, axis=0))
    return np.concatenate(ends), np.concatenate(held)


ROOM = 18_000_000
"""Largest number of characters of packed arrays, which keeps the whole page below 20 MB."""


ARBITRARY = (
    "Stress and contact pressure belong to one state of equilibrium at the limit load. "
    "Where there is no plastic flow, as in unloaded bolts, other stresses are possible."
)
"""The sentence on fields at the limit load, which belong to no level."""


@dataclass(frozen=True)
class View:
    """The data of the view, and remarks on them.

    Attributes:
        data: Data for ``decode.js``; None if there is nothing to show.
        remarks: Sentences on omitted data, with the reasons.
    """

    data: dict[str, Any] | None
    remarks: list[str] = field(default_factory=list)


def view_data(reader: ResultReader, room: int = ROOM) -> View:
    """Return the packed skin, as many levels as fit, and the mechanism.

    Args:
        reader: The results.
        room: Largest number of characters of the packed arrays.

    Raises:
        InputError: If a field file cannot be read.
    """
    collapses = reader.limit is not None and (reader.path / MECHANISM).exists()
    if not reader.levels and not collapses:
        return View(None, ["The run stored no fields, so the page does not show the bodies."])
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
        # These fields are kept even if not a single level with all fields fits.
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
                f"Some numbers of '{one['label']}' are not finite; they are"
                " shown as the smallest finite number."
            )
    return View(data, remarks)


def chosen_levels(count: int, most: int) -> list[int]:
    """Return evenly spaced indices of the displayed levels, always with the last one."""
    if not count:
        return []
    return sorted({int(a) for a in np.linspace(count - 1, 0, min(count, max(most, 1))).round()})


def view_mesh(surface: Surface, order: Longs) -> dict[str, Any]:
    """Return points, triangles and lines of the skin, grouped by body."""
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
    """Reads the fields of levels on the skin of the bodies, and packs them."""

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
            seen = values[np.isfinite(values)]  # JSON cannot represent infinity and NaN
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
    """Return the fields in the order of the menu, with their ranges over all levels."""
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
