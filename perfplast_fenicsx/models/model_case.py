"""Write a first case file for another program's model, and survey the model."""

import json
from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.geometry.survey import Body, Face, Joint, Survey
from perfplast_fenicsx.models.foreign_model import ForeignMaterial, ForeignModel, Joined

HEAD = """\
# Made from {source}.{fill}

title = {title}

[mesh]
file = {mesh}
"""

END = """
[element]
degree = 2

[loading]
control = "work"
until = "limit"                 # the load at which the bodies collapse
"""

DRIVEN = """
[element]
degree = 2

[loading]
control = "displacement"        # supports move, and there are no loads
until = 1.0                     # factor on the displacements of supports
"""


FURTHER: dict[str, Any] = {"subsequent_indent": "#   ", "break_long_words": False}
"""Format of a comment's continuation lines."""


def case_of(model: ForeignModel, title: str, source: str, mesh: str, stress: str = "") -> str:
    """Return the text of a case file with all known data.

    Args:
        model: The model.
        title: Title of the case.
        source: Name of the model's file.
        mesh: Name of the mesh file in the folder of the case.
        stress: Unit of stress; "" if it is unknown.
    """
    text = ""
    if model.turned:
        text += '\n[model]\nkind = "axisymmetric"\n'
    if model.thickness is not None:
        text += f'\n[model]\nkind = "plane-stress"\nthickness = {model.thickness!r}\n'
    driven = any(support.value for support in model.held) and not model.pushed
    yields = any(given.yield_stress is not None for given in model.materials.values())
    for body in model.bodies:
        text += _material(body, model.materials.get(body), yields)
    for support in model.held:
        text += f"\n[[support]]\non = {_quoted(support.on)}\n"
        text += f"components = {_quoted(support.components)}\n"
        if support.value:
            text += f"value = {support.value!r}\n" + "constant = false\n" * driven
    if not model.held:
        text += '\n[[support]]\non = "NAME"                     # <- a surface that is held\n'
    for pair in model.joined:
        text += _pair(pair)
    for load in model.pushed:
        value = load.value if isinstance(load.value, float) else list(load.value)
        note = f"  # {load.note}" if load.note else ""
        text += f"\n[[load]]\non = {_quoted(load.on)}\n{load.kind} = {value!r}{note}\n"
    if not (model.pushed or driven):
        text += '\n[[load]]\non = "NAME"                     # <- a surface that is loaded\n'
        text += "pressure = 1.0                  # <-\n"
    text += DRIVEN if driven else END
    text += f"\n[units]\nstress = {_quoted(stress)}\n" if stress else ""
    if not (model.held and (model.pushed or driven)):
        listed = ", ".join(model.surfaces) or "none"
        text += "\n" + fill(f"Surfaces: {listed}", 100, initial_indent="# ", **FURTHER) + "\n"
    text += "".join(f"\n# Differs from {source}: {remark}." for remark in model.remarks)
    text += "\n" if model.remarks else ""
    told = " Fill in the entries marked with <-." if "<-" in text else ""
    names = {"title": _quoted(title), "mesh": _quoted(mesh)}
    return HEAD.format(source=source, fill=told, **names) + text


def survey_of(model: ForeignModel) -> Survey:
    """Return the survey of a model, in the form of the survey of a geometry."""
    dim, points = model.dim, model.points
    volumes = _volumes(points, model.cells, dim)
    bodies = []
    for number, name in enumerate(model.bodies):
        mine = model.cells[model.body == number]
        places = points[mine.ravel()][:, :dim]
        size = float(volumes[model.body == number].sum())
        low, high = places.min(axis=0), places.max(axis=0)
        worst = float(_qualities(points, mine, dim).min())
        bodies.append(Body(name, name, size, _place(low), _place(high), len(mine), worst))
    faces = []
    turned = 1e-6  # a surface is flat if its normals differ by less than this
    for number, name in enumerate(model.surfaces):
        mine = model.facets[model.surface == number]
        normals = _normals(points, mine, dim)
        areas = np.linalg.norm(normals, axis=1)
        flat = abs(normals.sum(axis=0)) @ abs(normals.sum(axis=0)) >= areas.sum() ** 2 * (
            1 - turned
        )
        centre = np.average(points[mine].mean(axis=1), axis=0, weights=areas)[:dim]
        owner = next((b.name for b in bodies), "")
        shape = ("flat" if flat else "curved") if dim == 3 else ("straight" if flat else "curved")
        faces.append(Face(number + 1, name, owner, shape, float(areas.sum()), _place(centre)))
    by_name = {face.name: face for face in faces}
    joints = [
        Joint(
            ("", ""),
            (pair.primary, pair.secondary),
            by_name[pair.primary].area,
            ("tied" if pair.tied else "contact",),
        )
        for pair in model.joined
    ]
    nodes = len(np.unique(model.cells))
    return Survey(dim, 1, nodes, bodies, joints, [], faces, list(model.remarks))


def skin_of_model(
    model: ForeignModel, survey: Survey, outer: Longs, body: Longs, face: Longs
) -> dict:
    """Return the data for a picture: outer triangles, and places on named surfaces.

    Args:
        model: The model.
        survey: Survey of the model.
        outer: Corners of the visible triangles, shape (n, 3).
        body: Body of each triangle.
        face: Number of the named surface of each triangle, from 1; 0 if the triangle is on no named
            surface.
    """
    places = []
    for number, one in enumerate(survey.faces):
        middles = model.points[model.facets[model.surface == number]].mean(axis=1)
        centre = np.zeros(3)
        centre[: model.dim] = one.centre
        places.append(middles[np.argmin(np.linalg.norm(middles - centre, axis=1))])
    return {
        "points": model.points,
        "triangles": outer,
        "body": body,
        "face": face,
        "names": np.array(model.bodies),
        "places": np.array(places).reshape(-1, 3),
        "numbers": np.array([one.number for one in survey.faces], dtype=np.int64),
    }


def _material(body: str, given: ForeignMaterial | None, yields: bool) -> str:
    text = f"\n[material.{body}]\n"
    if given is None or given.young is None:
        return text + (
            'law = "von-mises"\nyoung = 0.0                     # <-\n'
            "poisson = nan                   # <-\nyield_stress = 0.0              # <-\n"
        )
    law = "elastic" if given.yield_stress is None else "von-mises"
    either = (
        ""
        if yields
        else '               # <- or "von-mises" with a yield_stress: at least one body must yield'
    )
    text += f"law = {_quoted(law)}{either}\nyoung = {given.young!r}\npoisson = {given.poisson!r}\n"
    if given.yield_stress is not None:
        text += f"yield_stress = {given.yield_stress!r}\n"
    return text + (f"expansion = {given.expansion!r}\n" if given.expansion else "")


def _pair(pair: Joined) -> str:
    kind = "tie" if pair.tied else "contact"
    text = (
        f"\n[[{kind}]]\nprimary = {_quoted(pair.primary)}\nsecondary = {_quoted(pair.secondary)}\n"
    )
    return text + (f"# coulomb = {pair.coulomb!r}\n" if pair.coulomb else "")


def _volumes(points: Floats, cells: Longs, dim: int) -> Floats:
    edges = points[cells[:, 1:], :dim] - points[cells[:, :1], :dim]
    return np.asarray(np.abs(np.linalg.det(edges)) / (6 if dim == 3 else 2))


def _qualities(points: Floats, cells: Longs, dim: int) -> Floats:
    """Return volumes relative to equilateral cells with the same mean square of edge lengths."""
    ends = [(i, j) for i in range(dim + 1) for j in range(i)]
    squares = sum(
        ((points[cells[:, i], :dim] - points[cells[:, j], :dim]) ** 2).sum(axis=1) for i, j in ends
    ) / len(ends)
    equilateral = squares ** (dim / 2) * (2**0.5 / 12 if dim == 3 else 3**0.5 / 4)
    return np.asarray(_volumes(points, cells, dim) / np.maximum(equilateral, 1e-300))


def _normals(points: Floats, facets: Longs, dim: int) -> Floats:
    """Return normals of facets, whose lengths are areas, all on the side of the first normal."""
    p = points[facets]
    if dim == 2:
        along = p[:, 1] - p[:, 0]
        normals = np.column_stack([along[:, 1], -along[:, 0], 0 * along[:, 0]])
    else:
        normals = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) / 2
    return np.asarray(normals * np.where(normals @ normals[0] < 0, -1.0, 1.0)[:, None])


def _place(point: Floats) -> tuple[float, ...]:
    return tuple(float(x) for x in point)


def _quoted(text: Sequence[str] | str) -> str:
    return json.dumps(text, ensure_ascii=False)
