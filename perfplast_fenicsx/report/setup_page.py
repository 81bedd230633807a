"""Write the page that sets up a case: faces are chosen by clicks, and the case file is edited."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from perfplast_fenicsx._version import __version__
from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.report.frame import SCRIPTS, asset, framed, scripts_of
from perfplast_fenicsx.report.packing import pack_integers, pack_numbers
from perfplast_fenicsx.report.page import VIEW
from perfplast_fenicsx.report.tables import scrolled
from perfplast_fenicsx.report.view_data import view_mesh

SETUP = ("toml", "case_check", "setup")
"""Files of the forms, read in this order after those of the view."""


@dataclass(frozen=True)
class FaceRow:
    """A free face in words.

    Attributes:
        number: Number from 1, as in the skin.
        name: Name in the mesh.
        shape: Shape in words.
        area: Area as text; in the plane the length.
        cad: Area in the CAD file; "-" if it is unknown.
        centre: Coordinates, as text.
        together: Names that it shares with other faces, with its share, as text.
    """

    number: int
    name: str
    shape: str
    area: str
    cad: str
    centre: str
    together: str = ""

    @property
    def in_words(self) -> str:
        """Return the text that a click on the face shows."""
        words = f"{self.name}: {self.shape}, area {self.area}, centre ({self.centre})"
        return f"{words}; one of {self.together}" if self.together else words


def setup_page(
    title: str,
    skin: Path,
    faces: Sequence[FaceRow],
    setup: Mapping[str, Any],
    tables: Mapping[str, Sequence[Sequence[str]]] | None = None,
    size: str = "Area",
) -> str:
    """Return the HTML of the page that sets up a case.

    Args:
        title: Title of the page.
        skin: The .npz file of :func:`perfplast_fenicsx.geometry.skin.skin_of`.
        faces: The free faces.
        setup: Data for ``setup.js``: dimension ``dim``; names of ``bodies``; ``faces``, ``sets``
            and ``joints`` with their names; the text of the first ``case``; the JSON ``schema`` of
            cases; ``systems`` of units; the ``library`` of materials for each system.
        tables: Further tables by their headings: rows of equal length, the first one of heads.
        size: Heading of the sizes of faces.
    """
    with np.load(skin) as file:
        arrays = {name: file[name] for name in file.files}
    order = np.lexsort((arrays["face"], arrays["body"]))
    used, corners = np.unique(arrays["triangles"], return_inverse=True)
    triangles = corners.reshape(arrays["triangles"].shape).astype(np.int64)
    points = np.asarray(arrays["points"][used], dtype=np.float64)
    plane = bool(np.ptp(points[:, 2]) == 0)
    surface = Surface(
        points=points,
        triangles=triangles,
        edges=np.zeros((int(plane), 2), dtype=np.int64),
        body=arrays["body"].astype(np.int64),
        names=[str(name) for name in arrays["names"]],
        at_points={},
        at_cells={},
        marks={},
    )
    still = [pack_numbers(np.zeros(len(points))) for _ in range(3)]
    words = {face.number: face.in_words for face in faces}
    data = view_mesh(surface, order) | {
        "axisymmetric": False,
        "marks": [],
        "faces": {"of": pack_integers(arrays["face"][order].astype(np.int64)), "words": words},
        "states": [{"title": "", "mechanism": False, "motion": still, "largest": 0, "fields": {}}],
        "fields": [],
        "setup": setup,
    }
    body = Template(asset("setup_page.html")).substitute(
        title=escape(title),
        view=asset("view.html"),
        faces=_face_table(faces, size),
        tables="\n".join(_section(head, table) for head, table in (tables or {}).items()),
        version=escape(__version__),
        scripts=scripts_of(data, (*VIEW, *SETUP)),
    )
    return framed(body, title, ["page.css", "setup.css"], SCRIPTS)


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
    return scrolled([escape(title) for title in titles], "".join(rows))


def _section(heading: str, table: Sequence[Sequence[str]]) -> str:
    """Return a section with a table, whose first row contains the headings."""
    rows = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in table[1:]
    )
    heads = [escape(head[:1].upper() + head[1:]) for head in table[0]]
    return f"<section><h2>{escape(heading)}</h2>\n{scrolled(heads, rows)}</section>"
