"""Test the summary of a case before the solution: parts of sides, names, motions."""

import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mpi4py import MPI

import basix.ufl
import numpy as np
import numpy.typing as npt
import pytest
import ufl
from dolfinx.mesh import create_mesh, locate_entities, meshtags

from perfplast_fenicsx import TaggedMesh
from perfplast_fenicsx.cli.case_picture import PICTURE, Section, arrays_of, draw_case
from perfplast_fenicsx.cli.understood import Understood, understood
from perfplast_fenicsx.compat import geometry_dofmap
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.io.case.case_reader import case_of
from perfplast_fenicsx.io.case.schema import parse
from perfplast_fenicsx.problem.judged.sides import Sides, find_sides
from perfplast_fenicsx.problem.problem import Problem
from tests.models import punch_problem

Points = npt.NDArray[np.float64]
Where = Callable[[Points], npt.NDArray[np.bool_]]
Map = Callable[[Points], Points]

HEAD = """
[mesh]
file = "none.msh"
[element]
degree = 1
[loading]
values = [1.0]
[output]
pictures = false
"""

ELASTIC = '[material.{}]\nlaw = "elastic"\nyoung = 1000.0\npoisson = 0.3\n'
BODY = '[material.{}]\nlaw = "von-mises"\nyoung = 1000.0\npoisson = 0.3\nyield_stress = 10.0\n'


def side(
    axis: int, at: float, low: float = -9.0, high: float = 9.0, along: int | None = None
) -> Where:
    """Return the facets at one coordinate, between two values of another coordinate."""
    other = (1 - axis if axis < 2 else 0) if along is None else along

    def on(x: Points) -> npt.NDArray[np.bool_]:
        eps = 1e-9
        inside = (x[other] > low - eps) & (x[other] < high + eps)
        return np.isclose(x[axis], at) & inside

    return on


LEFT, RIGHT, BOTTOM, TOP = side(0, 0.0), side(0, 4.0), side(1, 0.0), side(1, 2.0)
FEET = {"foot_1": side(1, 0.0, 0.0, 1.0), "foot_2": side(1, 0.0, 1.0, 2.0)}
HOLD = '[[support]]\non = "left"\n'
PULL = '[[load]]\non = "right"\ntraction = [1.0, 0.0]\n'


def support(on: str, more: str = "") -> str:
    return f'[[support]]\non = "{on}"\n{more}\n'


def load(on: str, kind: str = "pressure = 1.0") -> str:
    return f'[[load]]\non = "{on}"\n{kind}\n'


@dataclass(frozen=True)
class Body:
    """Return a grid of squares or cubes, divided into simplices, after a selection and a map."""

    name: str = "plate"
    low: tuple[float, ...] = (0.0, 0.0)
    high: tuple[float, ...] = (4.0, 2.0)
    counts: tuple[int, ...] = (8, 4)
    keep: Where | None = None
    upper: str = ""


@dataclass(frozen=True)
class Told:
    """A case, with the words that its summary must contain.

    The summary contains ``words`` and no word of ``never``. The picture marks the surfaces in
    ``parts`` as covering only a part of a side. The tag of a facet is the first name that contains
    the facet, counted from 1. ``within`` has the tags of names that lie in another name.
    ``elastic`` are bodies that do not yield.
    """

    text: str
    words: tuple[str, ...]
    names: Mapping[str, Where] = field(default_factory=lambda: {"left": LEFT, "right": RIGHT})
    parts: tuple[str, ...] = ()
    never: tuple[str, ...] = ()
    elastic: tuple[str, ...] = ()
    within: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    bodies: tuple[Body, ...] = (Body(),)
    mapped: Map | None = None


def simplices(body: Body) -> tuple[Points, npt.NDArray[np.int64]]:
    """Return the points and cells of a body."""
    axes = [
        np.linspace(a, b, n + 1) for a, b, n in zip(body.low, body.high, body.counts, strict=True)
    ]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    number = np.arange(x[..., 0].size).reshape(x.shape[:-1])
    if len(body.low) == 2:
        a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
        cells = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=-2)
    else:
        corner = [
            number[
                i : number.shape[0] - 1 + i,
                j : number.shape[1] - 1 + j,
                k : number.shape[2] - 1 + k,
            ]
            for i, j, k in np.ndindex(2, 2, 2)
        ]
        paths = [(0, 4, 6, 7), (0, 4, 5, 7), (0, 2, 6, 7), (0, 2, 3, 7), (0, 1, 5, 7), (0, 1, 3, 7)]
        cells = np.stack([np.stack([corner[i] for i in path], -1) for path in paths], axis=-2)
    points, cells = x.reshape(-1, len(body.low)), cells.reshape(-1, len(body.low) + 1)
    if body.keep is not None:
        middle = points[cells].mean(axis=1)
        cells = cells[body.keep(middle.T)]
    return points, cells


def made(told: Told) -> TaggedMesh:
    """Return the mesh of a case, from rank 0."""
    comm, gdim = MPI.COMM_WORLD, len(told.bodies[0].low)
    points, cells, volume = np.zeros((0, gdim)), np.zeros((0, gdim + 1), np.int64), {}
    if comm.rank == 0:
        for body in told.bodies:
            x, own = simplices(body)
            cells = np.concatenate([cells, own + len(points)])
            points = np.concatenate([points, x])
    used, cells = np.unique(cells, return_inverse=True) if len(cells) else (np.zeros(0, int), cells)
    points, cells = points[used], cells.reshape(-1, gdim + 1)
    kind = "triangle" if gdim == 2 else "tetrahedron"
    element = basix.ufl.element("Lagrange", kind, 1, shape=(gdim,))
    mesh = create_mesh(comm, cells, x=points, e=ufl.Mesh(element))
    topology = mesh.topology
    for one, other in ((gdim - 1, gdim), (gdim, gdim - 1), (gdim - 1, 0), (gdim, 0)):
        topology.create_connectivity(one, other)
    names, at, tags = [], [], []
    for number, name in enumerate(told.names):
        from_facets = locate_entities(mesh, gdim - 1, told.names[name])
        at.append(from_facets)
        tags.append(np.full(len(from_facets), number + 1, dtype=np.int32))
    facets, first = np.unique(np.concatenate(at), return_index=True)
    values = np.concatenate(tags)[first]
    index_map = topology.index_map(gdim)
    local = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    middle = mesh.geometry.x[geometry_dofmap(mesh)].mean(axis=1)
    volume = np.zeros(len(local), dtype=np.int32)
    for body in told.bodies:
        inside = ((middle[:, :gdim] > body.low) & (middle[:, :gdim] < body.high)).all(axis=1)
        names += [body.name] if body.name not in names else []
        volume[inside] = names.index(body.name) + 1
        if body.upper:
            names += [body.upper]
            half = (body.low[1] + body.high[1]) / 2
            volume[inside & (middle[:, 1] > half)] = len(names)
    if told.mapped is not None:
        mesh.geometry.x[:] = told.mapped(mesh.geometry.x)
    return TaggedMesh(
        mesh,
        meshtags(mesh, gdim, local, volume),
        meshtags(mesh, gdim - 1, facets.astype(np.int32), values),
        {name: number + 1 for number, name in enumerate(names)},
        {name: (*told.within.get(name, ()), number + 1) for number, name in enumerate(told.names)},
    )


def ring(x: Points) -> Points:
    """Return a quarter of a ring with radii 1 and 3, from a rectangle 4 × 2."""
    angle, radius = x[:, 0] / 4 * math.pi / 2, 1 + x[:, 1]
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), x[:, 2]])


def leant(x: Points) -> Points:
    """Incline the right side to the left by 3 in 4; its normal becomes (0.8, 0.6)."""
    return np.column_stack([x[:, 0] - x[:, 0] / 4 * 0.75 * x[:, 1], x[:, 1:]])


def closed(x: Points) -> Points:
    """Lower the upper body, so that both bodies touch."""
    return np.column_stack([x[:, 0], x[:, 1] - 0.5 * (x[:, 1] > 2.25), x[:, 2]])


def arch(x: Points) -> npt.NDArray[np.bool_]:
    return np.asarray((x[1] > 1) | (x[0] < 1) | (x[0] > 3))


def cube(**more: Any) -> tuple[Body, ...]:
    return (Body("cube", (0.0,) * 3, (4.0,) * 3, (4, 4, 4), **more),)


def pad(x: Points) -> npt.NDArray[np.bool_]:
    inside = (x[0] > 1 - 1e-9) & (x[0] < 3 + 1e-9) & (x[1] > 1 - 1e-9) & (x[1] < 3 + 1e-9)
    return np.asarray(np.isclose(x[2], 4.0) & inside)


HIGHER = (Body(), Body("upper", (0.0, 2.5), (4.0, 3.5), (8, 2)))
FLOOR = {"bottom": BOTTOM}


def driven_wall(elastic: tuple[str, ...], words: tuple[str, ...], never: tuple[str, ...]) -> Told:
    """Return a wall that is pushed into ground; the base is also held below the wall."""
    return Told(
        support("bed")
        + support("under_wall", 'components = "y"')
        + load("back", "traction = [1.0, 0.0]")
        + '[[contact]]\nprimary = "face"\nsecondary = "front"\n',
        words,
        {
            "bed": lambda x: np.isclose(x[1], 0) & (x[0] > 0.99),
            "under_wall": lambda x: np.isclose(x[1], 0) & (x[0] < 0.51),
            "face": lambda x: np.isclose(x[0], 1),
            "front": lambda x: np.isclose(x[0], 0.5),
            "back": LEFT,
        },
        never=never,
        elastic=elastic,
        bodies=(
            Body("wall", high=(0.5, 2.0), counts=(1, 4)),
            Body("soil", low=(1.0, 0.0), high=(4.0, 2.0), counts=(6, 4)),
        ),
        mapped=lambda x: np.column_stack([x[:, 0] + 0.5 * (x[:, 0] < 0.75), x[:, 1:]]),
    )


AT_TOE = "support bed holds 1 of the 5 nodes of 'face' along the normal, but does not hold 'front'"


CASES = {
    "support on half of the base": Told(
        support("floor") + load("top"),
        ("50 % of side y = 0 of 'plate' (2 of 4)", "the rest is without a name (2)"),
        {"floor": side(1, 0.0, 0.0, 2.0), "top": TOP},
        ("floor",),
    ),
    "support on the first of three lines": Told(
        support("a") + load("top"),
        ("only a part: 25 % of side y = 0", "the rest is 'b' (2), 'c' (1)"),
        {
            "a": side(1, 0.0, 0.0, 1.0),
            "b": side(1, 0.0, 1.0, 3.0),
            "c": side(1, 0.0, 3.0, 4.0),
            "top": TOP,
        },
        ("a",),
    ),
    "support between two points": Told(
        support("middle") + load("top"),
        ("12.5 % of side y = 0",),
        {"middle": side(1, 0.0, 1.5, 2.0), "top": TOP},
        ("middle",),
    ),
    "one load on a quarter of the top": Told(
        HOLD + load("strip"),
        ("strip: pressure 1 on 'strip'; length 1; force (0, -1)", "25 % of side y = 2"),
        {"left": LEFT, "strip": side(1, 2.0, 1.0, 2.0)},
        ("strip",),
    ),
    "a load of the whole top": Told(
        HOLD + load("top"),
        ("length 4; force (0, -4); all of side y = 2 of 'plate'",),
        {"left": LEFT, "top": TOP},
        never=("only a part",),
    ),
    "two pressures on one pad": Told(
        HOLD + load("pad") + load("top") + load("top", "traction = [1.0, 0.0]"),
        (
            "top: pressure 1 on 'top'; length 4; force (0, -4)",
            "acts together with pressure 1 on 'pad', on a common length of 1",
        ),
        {"pad": side(1, 2.0, 1.0, 2.0), "top": TOP, "left": LEFT},
        ("pad",),
        within={"top": (1,)},
    ),
    "a dead pressure and one that grows": Told(
        HOLD + load("top") + load("top", "pressure = 1.0\nconstant = true"),
        ("at any load factor",),
        {"top": TOP, "left": LEFT},
        never=("acts together",),
    ),
    "an elastic wall pushed at a held toe": driven_wall(("wall",), (AT_TOE,), ()),
    "a wall that yields at a held toe": driven_wall((), ("5 pairs",), ("along the normal",)),
    "support in full": Told(
        HOLD + PULL,
        ("left: holds x, y; length 2; leaves no rigid motion; all of side x = 0 of 'plate'",),
        never=("only a part", "all supports together"),
    ),
    "supports that hold the same components": Told(
        "".join(support(f"foot_{number}") for number in (1, 2, 3)) + load("top"),
        (
            "3 supports: each holds x, y; total length 4; each leaves no rigid motion;"
            " all of side y = 0 of 'plate'",
            "length 1: foot_... 1, 2",
            "length 2: foot_... 3",
        ),
        FEET | {"foot_3": side(1, 0.0, 2.0, 4.0), "top": TOP},
        ("foot_1", "foot_2", "foot_3"),
        never=("foot_1", "only a part", "all supports together"),
    ),
    "four such supports, and others": Told(
        "".join(support(name) for name in ("left", *FEET, "foot_3"))
        + support("right", 'components = "y"\nvalue = 0.1\nname = "settled"')
        + load("top"),
        (
            "4 supports: each holds x, y; total length 5; each leaves no rigid motion;"
            " all of side x = 0 of 'plate'",
            "only a part: 75 % of side y = 0 of 'plate' (3 of 4); the rest is without a name (1)",
            "length 2: left",
            "length 1: foot_1, foot_2, foot_3",
            "settled: moves y of 'right'; length 1; leaves",
        ),
        FEET
        | {
            "foot_3": side(1, 0.0, 3.0, 4.0),
            "left": LEFT,
            "right": side(0, 4.0, 1.0, 2.0),
            "top": TOP,
        },
        ("foot_1", "foot_2", "foot_3", "right"),
    ),
    "two supports that hold the same components": Told(
        "".join(map(support, FEET)) + load("top"),
        (
            "foot_1: holds x, y; length 1; leaves no rigid motion",
            "foot_2: holds x, y; length 1; leaves no rigid motion",
        ),
        FEET | {"top": TOP},
        ("foot_1", "foot_2"),
    ),
    "roller in x": Told(
        support("left", 'components = "x"') + PULL,
        ("left: holds x; length 2; leaves translation in y",),
    ),
    "roller in y below": Told(
        support("bottom", 'components = "y"') + load("top"),
        ("bottom: holds y; length 4; leaves translation in x",),
        {"bottom": BOTTOM, "top": TOP},
    ),
    "two rollers": Told(
        support("left", 'components = "x"') + support("bottom", 'components = "y"') + load("top"),
        ("leaves translation in y", "leaves translation in x"),
        {"left": LEFT, "bottom": BOTTOM, "top": TOP},
        never=("all supports together",),
    ),
    "two rollers in one direction": Told(
        support("left", 'components = "x"') + support("right", 'components = "x"') + load("far"),
        ("all supports together leave translation in y of 'plate'",),
        {"left": LEFT, "right": side(0, 4.0, 0.0, 1.0), "far": side(0, 4.0, 1.0, 2.0)},
        ("right", "far"),
    ),
    "a load on what is held": Told(
        HOLD + load("left", "traction = [0.0, 1.0]") + PULL,
        ("a support holds y of this surface",),
    ),
    "a load on what a roller holds": Told(
        support("left") + support("right", 'components = "x"') + load("right", "traction = [1, 1]"),
        ("a support holds x of this surface",),
    ),
    "no name at all for the rest": Told(
        HOLD + PULL, ("Not named by the case (length): 8 without a name",)
    ),
    "a named surface that nothing uses": Told(
        HOLD + PULL,
        ("Not named by the case (length): 'top' (4), 4 without a name",),
        {"left": LEFT, "right": RIGHT, "top": TOP},
    ),
    "a surface around a corner": Told(
        HOLD + load("corner"),
        ("all of side x = 4 of 'plate', side y = 2 of 'plate'", "force (-2, -4)"),
        {"left": LEFT, "corner": lambda x: np.isclose(x[0], 4) | np.isclose(x[1], 2)},
        never=("only a part",),
    ),
    "parts of two sides": Told(
        HOLD + load("corner"),
        ("only a part: 50 % of side x = 4", "only a part: 25 % of side y = 2"),
        {
            "left": LEFT,
            "corner": lambda x: side(0, 4.0, 1.0, 2.0)(x) | side(1, 2.0, 3.0, 4.0)(x),
        },
        ("corner",),
    ),
    "one of two feet": Told(
        support("foot") + load("top"),
        ("50 % of side y = 0 of 'plate', 1 of its 2 faces (1 of 2)", "the rest is 'other' (1)"),
        {"foot": side(1, 0.0, 0.0, 1.0), "other": side(1, 0.0, 3.0, 4.0), "top": TOP},
        ("foot",),
        bodies=(Body(keep=arch),),
    ),
    "half of a foot": Told(
        support("foot") + load("top"),
        ("25 % of side y = 0 of 'plate', 0 of its 2 faces",),
        {"foot": side(1, 0.0, 0.0, 0.5), "top": TOP},
        ("foot",),
        bodies=(Body(keep=arch),),
    ),
    "both feet": Told(
        support("feet") + load("top"),
        ("all of side y = 0 of 'plate'",),
        {"feet": BOTTOM, "top": TOP},
        bodies=(Body(keep=arch),),
        never=("only a part",),
    ),
    "part of a bore": Told(
        support("bore") + load("outer"),
        ("50 % of curved side of 'plate'",),
        {"bore": side(1, 0.0, 0.0, 2.0), "outer": TOP},
        ("bore",),
        mapped=ring,
    ),
    "all of a bore": Told(
        support("bore") + load("outer"),
        ("all of curved side of 'plate'",),
        {"bore": BOTTOM, "outer": TOP},
        mapped=ring,
        never=("only a part",),
    ),
    "all of two curved sides of one body": Told(
        support("rounds") + load("right"),
        ("all of curved side of 'plate'",),
        {"rounds": lambda x: BOTTOM(x) | TOP(x), "right": RIGHT},
        mapped=ring,
        never=("'plate', 'plate'",),
    ),
    "symmetry of a ring, one plane half": Told(
        support("left", 'components = "y"') + support("right", 'components = "x"') + load("outer"),
        ("left: holds y; length 1; leaves translation in x", "50 % of side y = 0"),
        {"left": side(0, 0.0, 0.0, 1.0), "right": RIGHT, "outer": TOP},
        ("left",),
        mapped=ring,
    ),
    "an oblique side": Told(
        support("right", 'components = "normal"') + support("bottom") + load("top"),
        ("right: holds the normal component", "all of side with normal (0.8, 0.6) of 'plate'"),
        {"right": RIGHT, "bottom": BOTTOM, "top": TOP},
        mapped=leant,
    ),
    "a thin plate with large faces": Told(
        support("left") + load("top"),
        ("all of side x = 0 of 'cube'", "all of side z = 50 of 'cube'"),
        {"left": LEFT, "top": side(2, 4.0)},
        bodies=cube(),
        mapped=lambda x: np.column_stack([x[:, 0], 1e5 * x[:, 1], 1e5 * (x[:, 2] - 4) + 50]),
    ),
    "a part of an oblique side": Told(
        support("bottom") + load("upper_half"),
        ("50 % of side with normal (0.8, 0.6)", "force (-1, -0.75)"),
        {"upper_half": side(0, 4.0, 1.0, 2.0), "bottom": BOTTOM},
        ("upper_half",),
        mapped=leant,
    ),
    "one stratum of two": Told(
        support("bottom") + support("right", 'components = "x"') + load("top"),
        ("50 % of side x = 4 of 'plate' and 'sand'", "the rest is 'right_2' (1)"),
        {
            "bottom": BOTTOM,
            "right": side(0, 4.0, 0.0, 1.0),
            "right_2": side(0, 4.0, 1.0, 2.0),
            "top": TOP,
        },
        ("right",),
        bodies=(Body(upper="sand"),),
    ),
    "round bodies have the area of the turn": Told(
        support("bottom", 'components = "y"') + load("right") + '[model]\nkind = "axisymmetric"\n',
        (f"area {2 * math.pi * 4 * 2:.5g}", "bottom: holds z", "leaves no rigid motion"),
        {"bottom": BOTTOM, "right": RIGHT},
    ),
    "a part of a side of a round body": Told(
        support("bottom", 'components = "y"') + load("top") + '[model]\nkind = "axisymmetric"\n',
        ("25 % of side z = 2",),
        {"bottom": BOTTOM, "top": side(1, 2.0, 0.0, 2.0)},
        ("top",),
    ),
    "contact that touches": Told(
        support("bottom")
        + load("top")
        + support("x0", 'components = "x"')
        + '[[contact]]\nprimary = "lower"\nsecondary = "under"\n',
        ("'lower' and 'under': lengths 4 and 4; 9 pairs of nodes, touching; no friction",),
        {
            **FLOOR,
            "top": side(1, 3.5),
            "x0": side(0, 0.0, 2.5, 3.5),
            "lower": TOP,
            "under": side(1, 2.5),
        },
        bodies=HIGHER,
        mapped=closed,
    ),
    "a body that is glued to a held one": Told(
        support("bottom") + load("top") + '[[tie]]\nprimary = "lower"\nsecondary = "under"\n',
        ("bottom: holds x, y; length 4; leaves no rigid motion", "No load acts on 'plate'"),
        {**FLOOR, "top": side(1, 3.5), "lower": TOP, "under": side(1, 2.5)},
        bodies=HIGHER,
        mapped=closed,
        never=("all supports together",),
    ),
    "bodies that are glued and may slide": Told(
        support("bottom", 'components = "y"')
        + load("top")
        + '[[tie]]\nprimary = "lower"\nsecondary = "under"\n',
        ("all supports together leave translation in x of 'plate', 'upper'",),
        {**FLOOR, "top": side(1, 3.5), "lower": TOP, "under": side(1, 2.5)},
        bodies=HIGHER,
        mapped=closed,
    ),
    "a body in contact that no support holds": Told(
        support("bottom") + load("top") + '[[contact]]\nprimary = "lower"\nsecondary = "under"\n',
        ("all supports together leave all rigid motions of 'upper'", "No load acts on 'plate'"),
        {**FLOOR, "top": side(1, 3.5), "lower": TOP, "under": side(1, 2.5)},
        bodies=HIGHER,
        mapped=closed,
    ),
    "a gap": Told(
        support("bottom")
        + support("x0", 'components = "x"')
        + load("top")
        + '[[contact]]\nprimary = "lower"\nsecondary = "under"\ncoulomb = 0.3\n',
        ("9 pairs of nodes, gap 0.5; friction 0.3",),
        {
            **FLOOR,
            "top": side(1, 3.5),
            "x0": side(0, 0.0, 2.5, 3.5),
            "lower": TOP,
            "under": side(1, 2.5),
        },
        bodies=HIGHER,
    ),
    "an obstacle": Told(
        support("left", 'components = "x"')
        + load("top")
        + '[[obstacle]]\nshape = "plane"\non = "bottom"\npoint = [0, -0.1]\nnormal = [0, 1]\n',
        ("'bottom' and a rigid plane: length 4; 9 pairs of nodes, gap 0.1; no friction",),
        {"left": LEFT, **FLOOR, "top": TOP},
    ),
    "pressure all around": Told(
        HOLD + load("rest"),
        ("force (-2, 0)", "all of side x = 4"),
        {"left": LEFT, "rest": lambda x: RIGHT(x) | TOP(x) | BOTTOM(x)},
    ),
    "a load that turns": Told(
        HOLD + load("top", 'pressure = "x"'),
        ("force (0, -8), moment about its centroid (-5.3333)",),
        {"left": LEFT, "top": TOP},
    ),
    "a whole force": Told(
        HOLD + load("top", "traction = [0.0, -3.0]\ntotal = true"),
        ("evenly spread force (0, -3) on 'top'; length 4; force (0, -3)",),
        {"left": LEFT, "top": TOP},
    ),
    "a weight": Told(
        HOLD + load("plate", "body_force = [0.0, -2.0]\nconstant = true") + PULL,
        ("area 8; force (0, -16); at any load factor",),
    ),
    "a moved support": Told(
        HOLD + support("right", 'components = "x"\nvalue = 0.1\nname = "pull"') + load("top"),
        ("pull: moves x of 'right'",),
        {"left": LEFT, "right": RIGHT, "top": TOP},
    ),
    "a name inside of a body": Told(
        HOLD + PULL + load("cut", "traction = [0.0, 1.0]"),
        ("inside a body, not on an outer face",),
        {"left": LEFT, "right": RIGHT, "cut": side(0, 2.0)},
    ),
    "a pad on the top of a cube": Told(
        support("bottom") + load("pad"),
        ("area 4; force (0, 0, -4)", "25 % of side z = 4 of 'cube' (4 of 16)"),
        {"bottom": side(2, 0.0), "pad": pad},
        ("pad",),
        bodies=cube(),
    ),
    "the top without its pad": Told(
        support("bottom") + load("top"),
        ("area 12; force (0, 0, -12)", "75 % of side z = 4", "the rest is 'pad' (4)"),
        {"bottom": side(2, 0.0), "pad": pad, "top": side(2, 4.0)},
        ("top",),
        bodies=cube(),
    ),
    "rollers in space": Told(
        support("x0", 'components = "x"') + support("bottom", 'components = "z"') + load("top"),
        (
            "leaves translation in y, z and rotation about x",
            "all supports together leave translation in y of 'cube'",
        ),
        {"x0": side(0, 0.0), "bottom": side(2, 0.0), "top": side(2, 4.0)},
        bodies=cube(),
    ),
    "one foot of four in space": Told(
        support("foot") + load("top"),
        ("25 % of side z = 0 of 'cube', 1 of its 4 faces (1 of 4)",),
        {
            "foot": lambda x: side(2, 0.0, 0.0, 1.0)(x) & (x[1] < 1 + 1e-9),
            "top": side(2, 4.0),
        },
        ("foot",),
        bodies=cube(
            keep=lambda x: (x[2] > 1) | ((abs(x[0] - 2) > 1) & (abs(x[1] - 2) > 1)),
        ),
    ),
}


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> Callable[[Told], tuple[Case, Problem]]:
    """Return the case and the problem of an entry of the table."""

    def read(told: Told) -> tuple[Case, Problem]:
        names = dict.fromkeys(n for body in told.bodies for n in (body.name, body.upper) if n)
        text = HEAD + "".join(BODY.format(name) for name in names) + told.text
        for name in told.elastic:
            yields, elastic = BODY.format(name), ELASTIC.format(name)
            text = text.replace(yields, elastic)
        mesh = made(told)
        case = case_of(Path("case.toml"), text, parse(text, "case.toml"))
        with monkeypatch.context() as patched:
            patched.setattr(Case, "tagged_mesh", lambda self, comm: self.model.of(mesh))
            return case, case.problem(MPI.COMM_WORLD)

    return read


@pytest.mark.parametrize("name", CASES)
def test_case_is_told(name: str, read: Callable[[Told], tuple[Case, Problem]]) -> None:
    told = CASES[name]
    case, problem = read(told)
    meant = understood(case, problem)
    assert (meant is None) == (problem.comm.rank != 0)
    if meant is None:
        return
    text = "\n".join(meant.lines)
    for words in told.words:
        assert words in text
    for words in told.never:
        assert words not in text
    assert {name for name, mark in meant.marked.items() if mark.part} == set(told.parts)
    _check_marks(meant, told)


def _check_marks(meant: Understood, told: Told) -> None:
    """The picture marks each named surface, and the rest of a side with a partial name."""
    arrays = arrays_of("a case", meant, Section(), False)
    shown = arrays["mark"]
    facets = meant.sides.facets
    outside = [name for name in meant.marked if meant.sides.area(name) > 0]
    numbers = [list(meant.marked).index(name) for name in outside]
    assert set(shown[shown >= 0].tolist()) == set(numbers)
    for name, number in zip(outside, numbers, strict=True):
        inner = [list(told.names)[tag - 1] for tag in told.within.get(name, ())]
        seen = meant.sides.area(name) - sum(map(meant.sides.area, inner))
        assert facets.area[shown == number].sum() == pytest.approx(seen)
    assert bool(arrays["rest"].any() or _named(meant, told)) == bool(told.parts)
    for name in told.parts:
        label = str(arrays["labels"][list(meant.marked).index(name)])
        assert "only a part" in label


def _named(meant: Understood, told: Told) -> bool:
    """Return whether the case names and marks everything next to parts of sides."""
    return any(
        meant.sides.facets.tag[meant.sides.rest(name)].min(initial=0) >= 0 for name in told.parts
    )


@pytest.mark.serial
def test_only_edges_of_bodies_are_sharp() -> None:
    """Facets whose order of vertices is random looked folded at the edges of cells."""
    problem = punch_problem(2)
    sides = find_sides(problem)
    assert sides is not None
    x = arrays_of("a case", Understood([], sides, {}), Section(), False)["x"]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    assert normal == pytest.approx(sides.facets.normal, abs=1e-12)


@pytest.mark.serial
@pytest.mark.long(but=["one of two feet"])
@pytest.mark.parametrize("name", ["one of two feet", "one foot of four in space"])
def test_picture_is_drawn(
    name: str,
    read: Callable[[Told], tuple[Case, Problem]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    case, problem = read(CASES[name])
    if problem.bodies.gdim == 2:  # such a picture needs neither VTK nor an X server
        monkeypatch.setitem(sys.modules, "pyvista", None)
        monkeypatch.setenv("PATH", str(tmp_path))
    picture = tmp_path / PICTURE
    assert draw_case(case, problem, understood(case, problem), picture)
    assert picture.stat().st_size > 10_000


def test_forty_cases() -> None:
    assert len(CASES) >= 40
    assert sum(bool(told.parts) for told in CASES.values()) >= 15


@pytest.mark.serial
def test_the_widest_name_of_what_is_left() -> None:
    """The program listed the parts of the ground surface instead of its name."""
    surfaces: dict[str, int | tuple[int, ...]] = {"soil_face_1": 1, "soil_y_high": 2}
    surfaces |= {"surface": (1, 2), "soil_x_low": 3, "left": 3}
    nothing: Any = None
    sides = Sides(nothing, (), nothing, nothing, surfaces)
    assert sides.names_of_all([1, 2, 3]) == {1: "surface", 2: "surface", 3: "left"}
    assert sides.names_of_all([1, 3]) == {1: "soil_face_1", 3: "left"}
