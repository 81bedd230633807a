"""Write and read ``scene.json``: names, loads, contacts and units, for pictures.

A run writes this file with its results, so that pictures can be drawn without the case file.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.contact.declared.contact import INTERFACES, Contact
from perfplast_fenicsx.contact.declared.obstacles import OBSTACLES, Obstacle
from perfplast_fenicsx.io.case.schema import Table, at, choose, convert
from perfplast_fenicsx.problem.declared.loads import Load, kind_of, load_kinds
from perfplast_fenicsx.units import Units

if TYPE_CHECKING:  # code that reads results for pictures does not start MPI
    from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


@dataclass(frozen=True)
class Scene:
    """The data that pictures need besides the fields.

    Attributes:
        title: Title of pictures.
        loads: The loads; ζ multiplies all of them except constant ones.
        contacts: Pairs of surfaces.
        obstacles: Rigid obstacles.
        units: Units of the numbers.
        axisymmetric: Whether the mesh is the half section of bodies of revolution.
        driven: Whether ζ moves supports and obstacles, and no load grows with ζ.
    """

    title: str
    loads: Sequence[Load] = ()
    contacts: Sequence[Contact] = ()
    obstacles: Sequence[Obstacle] = ()
    units: Units = field(default_factory=Units)
    axisymmetric: bool = False
    driven: bool = False

    def unit_of_work(self, gdim: int) -> str:
        """Return the unit of work for a mesh of dimension ``gdim``; empty if it is unknown."""
        return self.units.of_work(whole=self.axisymmetric or gdim == 3)

    @property
    def view(self) -> str:
        """Return the note for captions of half sections; empty for other pictures."""
        return ",   axisymmetric about z" if self.axisymmetric else ""

    @property
    def on_surfaces(self) -> list[Load]:
        """Return the loads that act on surfaces, which pictures show as arrows."""
        return [load for load in self.loads if not load.in_volume]

    @property
    def marks(self) -> dict[str, list[str]]:
        """Return the names of the surfaces that have each mark in a picture.

        The marks are ``load i`` for each load on surfaces, ``contact`` for surfaces with a
        displayed pressure, and ``opposite`` for the other surface of each pair.
        """
        marks = {f"load {i}": [load.on] for i, load in enumerate(self.on_surfaces)}
        contact = [contact.secondary for contact in self.contacts]
        marks["contact"] = contact + [obstacle.on for obstacle in self.obstacles]
        return marks | {"opposite": [contact.primary for contact in self.contacts]}


def write_scene(scene: Scene, tagged_mesh: "TaggedMesh", path: Path) -> None:
    """Write ``scene.json``. Not collective."""
    shapes = {shape: name for name, shape in OBSTACLES.items()}
    interfaces = {interface: name for name, interface in INTERFACES.items()}
    table = asdict(scene)
    for entry, load in zip(table["loads"], scene.loads, strict=True):
        entry["kind"] = kind_of(load)
        entry.pop("field", None)
    for entry, obstacle in zip(table["obstacles"], scene.obstacles, strict=True):
        entry["shape"] = shapes[type(obstacle)]
    for entry, contact in zip(table["contacts"], scene.contacts, strict=True):
        entry["interface"] = interfaces[type(contact)]
    names = {"volumes": tagged_mesh.volumes, "surfaces": dict(tagged_mesh.surfaces)}
    text = json.dumps(names | table, indent=2, ensure_ascii=False, default=list)
    replace(path, f"{text}\n".encode())


@dataclass(frozen=True)
class NamedScene:
    """Content of ``scene.json``: a scene, and the tags in ``fields/mesh.vtkhdf`` by name."""

    scene: Scene
    volumes: dict[str, int]
    surfaces: dict[str, list[int]]


@dataclass(frozen=True)
class _Document:
    """The top level of ``scene.json``."""

    title: str
    volumes: dict[str, int]
    surfaces: dict[str, int | list[int]]
    loads: list[Table]
    contacts: list[Table]
    obstacles: list[Table]
    units: Table
    axisymmetric: bool = False
    driven: bool = False


def read_scene(table: Mapping[str, Any], place: str) -> NamedScene:
    """Return the content of ``scene.json``.

    Args:
        table: Table from JSON.
        place: Place of the file, for messages.

    Raises:
        InputError: If :func:`write_scene` did not write the table.
    """
    top = convert(dict(table), _Document, place)

    def chosen(
        tables: list[Table], key: str, kinds: Mapping[str, type[Any]], default: str | None = None
    ) -> list[Any]:
        found = []
        for entry in tables:
            _, kind, rest = choose(entry, key, kinds, place, default=default)
            found.append(convert(rest, kind, place))
        return found

    with at(place):
        scene = Scene(
            top.title,
            chosen(top.loads, "kind", load_kinds()),
            chosen(top.contacts, "interface", INTERFACES, "friction"),
            chosen(top.obstacles, "shape", OBSTACLES),
            convert(top.units, Units, place),
            top.axisymmetric,
            top.driven,
        )
    surfaces = {name: np.ravel(tags).tolist() for name, tags in top.surfaces.items()}
    return NamedScene(scene, top.volumes, surfaces)
