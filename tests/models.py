"""Define the problems that several tests solve."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from mpi4py import MPI

from perfplast_fenicsx import (
    Contact,
    Elastic,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    Traction,
    VonMises,
    l_plate,
    punch,
    stacked_blocks,
    two_blocks,
)
from perfplast_fenicsx.materials.laws import MATERIALS

Read = Callable[..., TaggedMesh]
"""The fixture that writes a mesh and reads it."""

STEEL = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)
PUNCH_LIMIT = 400 * math.sqrt(1.5)
PUNCH_SUPPORTS = [Support("x0", "x"), Support("y0", "y"), Support("bottom")]

SLOPE_TABLES = """
units.system = "m-kN-kPa"
geometry.size = 14.0
output.pictures = false
gravity = { acceleration = [0.0, -1.0], density = { ground = 20.0 } }
support = [{ on = "base" }, { on = "left", components = "x" },
           { on = "right", components = "x" }]
stratum = [{ name = "ground", top = [[-50, 0], [0, 0], [75, 25], [150, 25]], bottom = -25 }]
[material.ground]
law = "mohr-coulomb"
young = 1e4
poisson = 0.3
cohesion = 25.0
friction_angle = 30.0
"""
"""A slope of 3:1 that is drawn in a case file; top-level keys may precede it."""


def l_plate_problem(n: int, comm: MPI.Intracomm = MPI.COMM_WORLD) -> Problem:
    """Return a quarter of a plate with a hole in plane strain, without contact."""
    supports = [Support("x0", "x"), Support("y0", "y"), Support("z0", "z"), Support("z1", "z")]
    loads = [Traction("top", (0.0, 200.0, 0.0))]
    return Problem(l_plate(comm, n), {"plate": STEEL}, supports, loads)


def punch_problem(
    n: int,
    gap: float | str = 0.0,
    swapped: bool = False,
    poisson: float = 0.3,
    comm: MPI.Intracomm = MPI.COMM_WORLD,
) -> Problem:
    """Return a quarter of a square punch on a block; ζ is the pressure on the punch."""
    material = VonMises(young=2e5, poisson=poisson, yield_stress=PUNCH_LIMIT)
    surfaces = ("punch_bottom", "base_top")
    return Problem(
        punch(comm, n),
        {"base": material, "punch": material},
        PUNCH_SUPPORTS,
        [Pressure("top", 1.0)],
        [Contact(*(reversed(surfaces) if swapped else surfaces), gap=gap)],
    )


def two_blocks_problem(
    n: int, gap: float | str = 0.0, comm: MPI.Intracomm = MPI.COMM_WORLD, **friction: float
) -> Problem:
    """Return two stacked cantilevers; ζ is the traction on the free half of the upper one."""
    return Problem(
        two_blocks(comm, n),
        {"lower": STEEL, "upper": STEEL},
        [Support("left")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("upper_bottom", "lower_top", gap, **friction)],
    )


STACK_HEIGHTS = (0.7, 1.2)
STACK_YOUNG = (2e5, 7e4)


def stack_problem(
    n: int, gap: float = 0.0, poisson: float = 0.3, comm: MPI.Intracomm = MPI.COMM_WORLD
) -> Problem:
    """Return two blocks on rollers; only contact supports the upper one, and ζ is its pressure."""
    return Problem(
        stacked_blocks(comm, n, heights=STACK_HEIGHTS),
        {
            "lower": VonMises(STACK_YOUNG[0], poisson, 300.0),
            "upper": VonMises(STACK_YOUNG[1], 0.2, 300.0),
        },
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom", gap)],
    )


WEDGE_STEEL = VonMises(2e5, 0.3, 400.0)


def wedge_problem(tagged_mesh: TaggedMesh, **changes: object) -> Problem:
    """Return two blocks that meet on an inclined plane; ζ is the pressure on top."""
    arguments: dict[str, object] = {
        "materials": {"lower": WEDGE_STEEL, "upper": WEDGE_STEEL},
        "supports": [Support("bottom"), Support("x0", "x"), Support("y0", "y")],
        "loads": [Pressure("top", 1.0)],
        "contacts": [Contact("lower_seam", "upper_seam")],
    }
    return Problem(tagged_mesh, **(arguments | changes))  # type: ignore[arg-type]


def touching_blocks(tagged_mesh: TaggedMesh | None = None, **changes: object) -> Problem:
    """Return two stacked cubes on rollers; ζ is the pressure on top."""
    arguments: dict[str, object] = {
        "materials": {"lower": STEEL, "upper": STEEL},
        "supports": [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        "loads": [Pressure("top", 1.0)],
        "contacts": [Contact("lower_top", "upper_bottom")],
    }
    mesh = tagged_mesh or stacked_blocks(MPI.COMM_WORLD, 2)
    return Problem(mesh, **(arguments | changes))  # type: ignore[arg-type]


def case_text(
    mesh: Mapping[str, object],
    materials: Mapping[str, Elastic | VonMises],
    supports: Sequence[Support],
    *,
    pushed: str = "top",
    contacts: Sequence[Contact] = (),
    more: str = "",
    title: str | None = None,
) -> str:
    """Return a case file with bodies under the pressure ζ.

    Args:
        mesh: Keys of [mesh].
        materials: Materials of the bodies by name.
        supports: Supports of the bodies.
        pushed: The surface under pressure.
        contacts: Contacts of the bodies.
        more: Text of other tables.
        title: Title of the case.
    """
    laws = {material: law for law, material in MATERIALS.items()}
    tables: list[tuple[str, Mapping[str, object]]] = [("[mesh]", mesh)]
    for body, material in materials.items():
        law = {"law": laws[type(material)]}
        tables.append((f"[material.{body}]", law | _given(material)))
    tables += [("[[support]]", _given(support)) for support in supports]
    tables.append(("[[load]]", {"on": pushed, "pressure": 1.0}))
    tables += [("[[contact]]", _given(contact)) for contact in contacts]
    lines = [] if title is None else [f"title = {json.dumps(title)}"]
    for heading, keys in tables:
        lines += [heading, *(f"{key} = {json.dumps(value)}" for key, value in keys.items())]
    return "\n".join([*lines, more])


def steel_blocks_case(more: str) -> str:
    """Return the case of two stacked steel blocks under the pressure ζ.

    Args:
        more: Text of other tables.
    """
    steel = VonMises(2e5, 0.3, 300.0)
    return case_text(
        {"builder": "stacked_blocks", "n": 1},
        {"lower": steel, "upper": steel},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        contacts=[Contact("lower_top", "upper_bottom")],
        more=more,
    )


def _given(table: Any) -> dict[str, object]:
    """Return the fields of a dataclass that differ from their defaults."""
    values = {field: getattr(table, field.name) for field in fields(table)}
    return {field.name: value for field, value in values.items() if value != field.default}


def punch_case(
    base: Elastic | VonMises,
    punch: Elastic | VonMises,
    gap: str | None = None,
    more: str = "",
    title: str | None = None,
) -> str:
    """Return a case file of a coarse punch on a block."""
    return case_text(
        {"builder": "punch", "n": 2},
        {"base": base, "punch": punch},
        PUNCH_SUPPORTS,
        contacts=[Contact("punch_bottom", "base_top", gap)],
        more=more,
        title=title,
    )


def write_case(comm: MPI.Intracomm, path: Path, text: str) -> Path:
    """Write a case file for all ranks. Collective."""
    if comm.rank == 0:
        path.write_text(text, encoding="utf-8")
    comm.barrier()
    return path
