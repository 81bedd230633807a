"""Write the setup page of a case, where the user clicks faces and edits the case file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from perfplast_fenicsx._version import __version__
from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.report.frame import SCRIPTS, asset, framed, scripts_of
from perfplast_fenicsx.report.packing import pack_integers, pack_numbers
from perfplast_fenicsx.report.page import VIEW
from perfplast_fenicsx.report.tables import scrolled
from perfplast_fenicsx.report.view_data import view_mesh

SETUP = ("toml", "case_check", "case_marks", "face_families", "setup")
"""Script files of the forms, read in this order after the scripts of the view."""

BAND = 0.006
"""Half-width of the band along a face of a plane body, relative to the size of the bodies."""


@dataclass(frozen=True)
class FaceRow:
    """A free face in words.

    Attributes:
        number: Number of the face, from 1, as in the skin.
        name: Name of the face in the mesh.
        shape: Shape in words.
        area: Area as text; for a plane body the length.
        cad: Area in the CAD file; "-" if it is unknown.
        centre: Coordinates, as text.
        together: Sets that contain the face, and the face's share of the area of each set, as text.
    """

    number: int
    name: str
    shape: str
    area: str
    cad: str
    centre: str
    together: str = ""

    def in_words(self, size: str) -> str:
        """Return the text that appears after a click on the face.

        Args:
            size: Name of the quantity ``area``: "area", or "length" for a plane body.
        """
        words = f"{self.name}: {self.shape}, {size} {self.area}, centre ({self.centre})"
        return f"{words}; one of {self.together}" if self.together else words


def setup_page(
    title: str,
    skin: Path,
    faces: Sequence[FaceRow],
    setup: Mapping[str, Any],
    tables: Mapping[str, Sequence[Sequence[str]]] | None = None,
    size: str = "Area",
    warnings: Sequence[str] = (),
) -> str:
    """Return the HTML of the setup page.

    Args:
        title: Title of the page.
        skin: The .npz file of :func:`perfplast_fenicsx.geometry.mesher.skin_of`.
        faces: The free faces.
        setup: Data for ``setup.js``: dimension ``dim``; names of ``bodies``; the number of
            ``cells``, and the number up to which bounds are ``affordable``; ``faces``, ``sets``
            and ``joints`` with their names; the contacts that a run has ``refused``, or None; the
            text of the initial ``case``; the JSON ``schema`` of case files; ``systems`` of units,
            each with the ``newtons`` per m³ of its force per volume; plausible ``weights`` (N/m³);
            the ``library`` of materials for each system.
        tables: Additional tables by heading. Their rows have equal length; the first row has the
            column heads.
        size: Heading of the column with the sizes of faces.
        warnings: Warnings of the mesh, without full stops.
    """
    with np.load(skin) as file:
        arrays = {name: file[name] for name in file.files}
    used, corners = np.unique(arrays["triangles"], return_inverse=True)
    triangles = corners.reshape(arrays["triangles"].shape).astype(np.int64)
    points = np.asarray(arrays["points"][used], dtype=np.float64)
    plane = bool(np.ptp(points[:, 2]) == 0)
    body, face = arrays["body"].astype(np.int64), arrays["face"].astype(np.int64)
    segments = _segments(arrays, triangles, body, used)
    if plane:
        points, triangles = _with_bands(points, triangles, segments)
        body = np.append(body, np.repeat(segments.body, 2))
        face = np.append(face, np.repeat(segments.face, 2))
    order = np.lexsort((-face, body))  # so that bands hide the triangles of plane bodies
    surface = Surface(
        points=points,
        triangles=triangles,
        edges=np.zeros((int(plane), 2), dtype=np.int64),
        body=body,
        names=[str(name) for name in arrays["names"]],
        at_points={},
        at_cells={},
        marks={},
    )
    still = [pack_numbers(np.zeros(len(points))) for _ in range(3)]
    words = {face.number: face.in_words(size.lower()) for face in faces}
    data = view_mesh(surface, order) | {
        "axisymmetric": False,
        "marks": [],
        "faces": {"of": pack_integers(face[order]), "words": words},
        "lines_of_faces": {
            "face": pack_integers(segments.face),
            "ends": [pack_numbers(axis) for axis in segments.ends.reshape(-1, 3).T],
            "outwards": [pack_numbers(axis) for axis in segments.outwards.T],
        },
        "outlines": {
            "seam": pack_integers(arrays["seam"]),
            "ends": [pack_numbers(axis) for axis in arrays["points"][arrays["outlines"].ravel()].T],
        },
        "states": [{"title": "", "mechanism": False, "motion": still, "largest": 0, "fields": {}}],
        "fields": [],
        "setup": setup,
    }
    body = Template(asset("setup_page.html")).substitute(
        title=escape(title),
        view=asset("view.html"),
        warnings=_warnings(warnings),
        faces=_face_table(faces, size),
        tables="\n".join(_section(head, table) for head, table in (tables or {}).items()),
        version=escape(__version__),
        scripts=scripts_of(data, (*VIEW, *SETUP)),
    )
    return framed(body, title, ["page.css", "setup.css"], SCRIPTS)


@dataclass(frozen=True)
class _Segments:
    """Lines of the free faces of plane bodies.

    Attributes:
        face: Number of the line's face, shape (n,).
        body: Index of the line's body, shape (n,).
        ends: End points, shape (n, 2, 3).
        outwards: Unit normals that point out of the body, shape (n, 3).
    """

    face: Longs
    body: Longs
    ends: Floats
    outwards: Floats


def _segments(arrays: Mapping[str, Any], triangles: Longs, body: Longs, used: Longs) -> _Segments:
    """Return the lines of free faces; no lines for 3D bodies.

    Args:
        arrays: Arrays of the skin.
        triangles: Triangles of the bodies, as indices into ``used``.
        body: Index of each triangle's body.
        used: Indices of the used points in the skin.
    """
    ends = np.searchsorted(used, arrays["segments"]).astype(np.int64)
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    keys = edges[:, 0] * len(used) + edges[:, 1]
    wanted = np.sort(ends, axis=1) @ np.array([len(used), 1])
    order = np.argsort(keys, kind="stable")
    at = order[np.searchsorted(keys[order], wanted)]
    points = np.asarray(arrays["points"][used], dtype=np.float64)
    inside = points[triangles[at // 3]].mean(axis=1)
    both = points[ends]
    along = both[:, 1] - both[:, 0]
    outwards = np.stack([along[:, 1], -along[:, 0], np.zeros(len(along))], axis=1)
    outwards /= np.maximum(np.linalg.norm(outwards, axis=1, keepdims=True), 1e-300)
    turned = np.einsum("nk,nk->n", outwards, both.mean(axis=1) - inside) < 0
    outwards[turned] *= -1
    return _Segments(arrays["segment_face"].astype(np.int64), body[at // 3], both, outwards)


def _with_bands(points: Floats, triangles: Longs, segments: _Segments) -> tuple[Floats, Longs]:
    """Return points and triangles after adding a clickable band along each line of a face."""
    half = BAND * float(np.linalg.norm(np.ptp(points, axis=0))) * segments.outwards[:, None]
    corners = np.concatenate([segments.ends - half, segments.ends + half], axis=1)
    first = len(points) + 4 * np.arange(len(corners))[:, None, None]
    bands = (first + np.array([[0, 1, 3], [0, 3, 2]])).reshape(-1, 3)
    # Triangles of a plane body are visible from both sides, so their vertex order does not matter.
    return (
        np.concatenate([points, corners.reshape(-1, 3)]),
        np.concatenate([triangles, bands]).astype(np.int64),
    )


def _face_table(faces: Sequence[FaceRow], size: str) -> str:
    """Return the table of free faces; a click on a row selects its face."""
    titles = ["No.", "Name", "Shape", size, "Of CAD", "Centre"]
    together = any(face.together for face in faces)
    if together:
        titles.append("One of")
    rows = []
    for face in faces:
        texts = [face.shape, face.area, face.cad, face.centre]
        cells = "".join(
            f"<td>{escape(text)}</td>" for text in [*texts, *([face.together] * together)]
        )
        rows.append(
            f'<tr data-face="{face.number}"><td>{face.number}</td><th scope="row">'
            f'<button type="button" aria-pressed="false">{escape(face.name)}</button></th>'
            f"{cells}</tr>"
        )
    return scrolled([escape(title) for title in titles], "".join(rows), "Free faces")


def _warnings(warnings: Sequence[str]) -> str:
    """Return the list of the warnings of the mesh; an empty string if there are no warnings."""
    items = "".join(f"<li>{escape(one)}.</li>" for one in warnings)
    head = '<h3 id="warnings-h">Warnings of the mesh</h3>'
    return f'{head}\n<ul id="warnings" aria-labelledby="warnings-h">{items}</ul>' if items else ""


def _section(heading: str, table: Sequence[Sequence[str]]) -> str:
    """Return a section with a table; the first row contains the column heads."""
    rows = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in table[1:]
    )
    heads = [escape(head[:1].upper() + head[1:]) for head in table[0]]
    return f"<section><h2>{escape(heading)}</h2>\n{scrolled(heads, rows, heading)}</section>"
