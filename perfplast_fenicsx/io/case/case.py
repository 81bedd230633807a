"""Case files: what is solved and how, as TOML.

A case file holds the tables ``[mesh]`` or ``[geometry]``, ``[material.NAME]``, ``[[support]]``,
``[[load]]``, ``[gravity]``, ``[[contact]]``, ``[[obstacle]]``, ``[[tie]]``, ``[[rigid_surface]]``,
``[[temperature]]``, ``[[initial_stress]]``, ``[model]``, ``[element]``, ``[solve]``, ``[loading]``
or ``[[stage]]``, ``[output]`` and ``[units]``; see
``demos/two_blocks.toml``. What may stand in a table is the dataclass it becomes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import OBSTACLES, Obstacle
from perfplast_fenicsx.contact.declared.tie import Tie
from perfplast_fenicsx.controls.control import Control
from perfplast_fenicsx.controls.given import Given
from perfplast_fenicsx.errors import InputError, on_rank0
from perfplast_fenicsx.io.case.geometry_table import GeometryFile
from perfplast_fenicsx.io.case.gravity_table import GravityTable
from perfplast_fenicsx.io.case.load_table import read_load
from perfplast_fenicsx.io.case.loading_table import read_loading, remembering
from perfplast_fenicsx.io.case.mesh_table import load_mesh, read_adaptation, read_mesh
from perfplast_fenicsx.io.case.method_table import read_method
from perfplast_fenicsx.io.case.scene import Scene
from perfplast_fenicsx.io.case.schema import Table, at, choose, convert
from perfplast_fenicsx.io.case.support_tables import (
    RigidSurfaceTable,
    SupportTable,
    read_contact,
)
from perfplast_fenicsx.io.case.tables import (
    Document,
    ElementOptions,
    MeshBuilder,
    MeshFile,
    ModelOptions,
    OutputOptions,
)
from perfplast_fenicsx.io.case.toml_reader import parse, read_text
from perfplast_fenicsx.io.case.units_table import read_units
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.discrete.limit_methods import LimitMethod, method_for
from perfplast_fenicsx.materials.laws import MATERIALS, Material
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.declared.initial import Initial, InitialStress, Temperature
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.declared.rigid_surface import RigidSurface
from perfplast_fenicsx.problem.declared.stage import Stage, check_stages
from perfplast_fenicsx.problem.declared.supports import Support
from perfplast_fenicsx.problem.history.loading_history import LoadingHistory
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.methods import METHODS
from perfplast_fenicsx.units import Units


@dataclass(frozen=True)
class Case:
    """A case file, read and checked as far as it can be without its mesh.

    ``text`` is what it says, ``table`` the same as TOML; with ``trust`` scripts may be run.
    """

    path: Path
    text: str = field(repr=False)
    table: Table = field(repr=False)
    title: str
    mesh: MeshFile | MeshBuilder | GeometryFile
    adapt: Adaptation | None
    materials: dict[str, Material]
    supports: list[Support]
    loads: list[Load]
    contacts: list[Contact]
    obstacles: list[Obstacle]
    ties: list[Tie]
    model: ModelOptions
    rigid: list[RigidSurface]
    element: ElementOptions
    method: str
    options: Any
    loading: Control
    output: OutputOptions
    units: Units
    initial: list[Initial]
    trust: bool = False

    @property
    def scene(self) -> Scene:
        """What pictures need to know."""
        return Scene(
            self.title,
            self.loads,
            self.contacts,
            self.obstacles,
            self.units,
            axisymmetric=self.model.kind == "axisymmetric",
            driven=self.loading.drives,
        )

    @property
    def stages(self) -> Sequence[Stage]:
        """Of a loading history; none where there is a [loading]."""
        return self.loading.in_turn()

    def __repr__(self) -> str:
        values = self.loading.values
        ends = "the limit load" if self.loading.prescribes is Prescribed.WORK else "a given motion"
        levels = f"until {ends}" if values is None else f"{len(values)} levels"
        levels = f"{len(self.stages)} stages" if self.stages else levels
        bodies = ", ".join(self.materials)
        return (
            f"Case({str(self.path)!r}: {self.title}; {bodies}; P{self.element.degree};"
            f" {self.method}, {levels})"
        )

    def tagged_mesh(self, comm: MPI.Intracomm) -> TaggedMesh:
        """Build or read the mesh. Collective.

        Raises:
            InputError: If there is no such builder or file, its arguments or content are wrong, or
                it cannot be adapted where that is wanted.
        """
        made = isinstance(self.mesh, GeometryFile)
        with at(f"{self.path.name}, [{'geometry' if made else 'mesh'}]"):
            mesh = load_mesh(comm, self.mesh, self.path, self.contacts, self.trust)
            if self.adapt is not None:
                with at("adapt"):
                    self.adapt.check(mesh)
        with at(f"{self.path.name}, [model]"):
            return self.model.of(mesh)

    def problem(self, comm: MPI.Intracomm) -> Problem:
        """Build the mesh and declare the problem on it. Collective.

        Raises:
            InputError: If the names, materials, supports, loads and contacts do not fit the mesh.
        """
        tagged_mesh = self.tagged_mesh(comm)
        with at(self.path.name):
            return Problem(
                tagged_mesh,
                self.materials,
                self.supports,
                self.loads,
                self.contacts,
                self.obstacles,
                self.element.degree,
                self.initial,
                self.ties,
                self.rigid,
            )

    def history(self, problem: Problem) -> LoadingHistory | None:
        """What leads a problem through the stages; None where there is a [loading]. Collective.

        Raises:
            InputError: If the stages do not fit the problem.
        """
        if not self.stages:
            return None
        with at(self.path.name):
            return LoadingHistory(problem, self.stages)

    def solver(self, problem: Problem) -> Any:
        """The algorithm of ``[solve]`` for a problem. Collective."""
        return METHODS[self.method].solver(problem, self.options)

    def limit_method(self, problem: Problem) -> LimitMethod | None:
        """How the limit load of a problem is found; None where levels are given."""
        if self.loading.limit_tolerance is None:
            return None
        if self.loading.limit_method is not None:
            return LimitMethod(self.loading.limit_method)
        by_path = self.table.get("solve") or problem.friction.follows_pressure
        return LimitMethod.PATH if by_path else method_for(problem)

    def method_on(self, problem: Problem) -> str:
        """The name of what solves a problem: an algorithm, or the interior point method."""
        direct = self.limit_method(problem) is LimitMethod.INTERIOR_POINT
        return str(LimitMethod.INTERIOR_POINT) if direct else self.method


def read_case(path: str | Path, comm: MPI.Intracomm = MPI.COMM_WORLD, trust: bool = False) -> Case:
    """Read a case file on rank 0 and check it on every rank alike. Collective.

    Args:
        path: The TOML file.
        comm: The ranks that need the case.
        trust: Let gmsh run the script that the mesh is made of, if it is one.

    Raises:
        InputError: A file that cannot be read or is not TOML, unknown or missing keys, or values of
            a wrong type or outside their range.
    """
    path = Path(path)
    text: str = comm.bcast(on_rank0(comm, lambda: read_text(path)))
    return replace(_case(path, text), trust=trust)


def _case(path: Path, text: str) -> Case:
    name = path.name
    table = parse(text, name)
    top = convert(table, Document, name)
    materials: dict[str, Material] = {}
    for body, properties in top.material.items():
        place = f"{name}, [material.{body}]"
        _, law, rest = choose(properties, "law", MATERIALS, place)
        materials[body] = convert(rest, law, place)
    units = read_units(top.units, materials, name)
    loads: list[Load] = []
    for place, load in _numbered(top.load, f"{name}, [[load]]"):
        loads.append(read_load(load, place))
    if top.gravity is not None:
        place = f"{name}, [gravity]"
        weight = convert(top.gravity, GravityTable, place)
        with at(place):
            loads += weight.loads(materials)
    supports = _numbered(top.support, f"{name}, [[support]]")
    contacts = _numbered(top.contact, f"{name}, [[contact]]")
    obstacles: list[Obstacle] = []
    for place, obstacle in _numbered(top.obstacle, f"{name}, [[obstacle]]"):
        _, shape, rest = choose(obstacle, "shape", OBSTACLES, place)
        obstacles.append(convert(rest, shape, place))
    loading = read_loading(top, name)
    place = f"{name}, {'[[stage]]' if top.stage else '[loading]'}"
    coulomb = any(surface.get("coulomb") for surface in (*top.contact, *top.obstacle))
    method, options = read_method(top.solve, loading, f"{name}, [solve]", coulomb)
    kinds: dict[str, tuple[list[Table], type[Initial]]] = {
        "temperature": (top.temperature, Temperature),
        "initial_stress": (top.initial_stress, InitialStress),
    }
    initial: list[Initial] = []
    for kind, (tables, schema_of) in kinds.items():
        for where, entry in _numbered(tables, f"{name}, [[{kind}]]"):
            initial.append(convert(entry, schema_of, where))
    moved = loading.moved(loads, initial)
    held, rigid = [], []
    for where, support in supports:
        base = convert(support, SupportTable, where)
        with at(where):
            held.append(base.support(moved(base.name, base.on)))
    for where, surface in _numbered(top.rigid_surface, f"{name}, [[rigid_surface]]"):
        plate = convert(surface, RigidSurfaceTable, where)
        with at(where):
            rigid.append(plate.surface(moved(plate.name, plate.on)))
    touching = [read_contact(contact, moved, where) for where, contact in contacts]
    strained = bool(initial) or any(a.interference and a.constant for a in touching)
    with at(name):
        materials = remembering(materials, loading)
        if stages := loading.in_turn():
            check_stages(stages, loads, initial, [*held, *rigid, *obstacles, *touching])
    with at(place):
        loading.check(Given(loads, [*held, *rigid], obstacles, touching, strained))
    mesh = read_mesh(top.mesh, top.geometry, name)
    model = convert(top.model, ModelOptions, f"{name}, [model]")
    if model.kind == "axisymmetric" and loading.of_body:
        raise InputError(
            f"{name}, [model]: control = 'bounds' or 'strength' is for plane strain and space; give"
            " control = 'work' and until = 'limit' for the limit load of the mesh."
        )
    return Case(
        path=path,
        text=text,
        table=table,
        title=top.title or path.stem,
        mesh=mesh,
        adapt=read_adaptation(mesh.adapt, loading, f"{name}, [mesh], adapt"),
        materials=materials,
        supports=held,
        loads=loads,
        contacts=touching,
        obstacles=obstacles,
        ties=[convert(tie, Tie, place) for place, tie in _numbered(top.tie, f"{name}, [[tie]]")],
        model=model,
        rigid=rigid,
        element=convert({**loading.element, **top.element}, ElementOptions, f"{name}, [element]"),
        method=method,
        options=options,
        loading=loading,
        output=convert(top.output, OutputOptions, f"{name}, [output]"),
        units=units,
        initial=initial,
    )


def _numbered(tables: list[Table], place: str) -> list[tuple[str, Table]]:
    """Tables of an array with their places; the number is left out where there is one."""
    if len(tables) == 1:
        return [(place, tables[0])]
    return [(f"{place} number {i}", table) for i, table in enumerate(tables, start=1)]
