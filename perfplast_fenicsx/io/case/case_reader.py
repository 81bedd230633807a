"""Read case files."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args, get_type_hints

from mpi4py import MPI

from perfplast_fenicsx.contact.declared.contact import Tie
from perfplast_fenicsx.contact.declared.obstacles import OBSTACLES, Obstacle
from perfplast_fenicsx.controls.control import Given, Moved
from perfplast_fenicsx.errors import on_rank0
from perfplast_fenicsx.geometry.drawn_ground import DrawnGround
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.io.case.combinations import (
    designed_for,
    read_combinations,
    reduced,
)
from perfplast_fenicsx.io.case.gravity_table import GravityTable, earthquake_loads
from perfplast_fenicsx.io.case.load_table import read_load
from perfplast_fenicsx.io.case.loading_table import (
    read_conic,
    read_loading,
    read_method,
    remembering,
)
from perfplast_fenicsx.io.case.mesh_table import read_adaptation, read_ground, read_mesh
from perfplast_fenicsx.io.case.schema import Table, at, choose, convert, parse, read_text, shown
from perfplast_fenicsx.io.case.seepage_table import drawdowns, read_seepage, water_loads
from perfplast_fenicsx.io.case.support_tables import (
    RigidSurfaceTable,
    SupportTable,
    read_contact,
)
from perfplast_fenicsx.io.case.tables import (
    Document,
    ElementOptions,
    ModelOptions,
    OutputOptions,
    ReportHead,
)
from perfplast_fenicsx.io.case.units_table import read_units
from perfplast_fenicsx.io.case.water_table import Water, read_water, water_in_cracks
from perfplast_fenicsx.limit_analysis.conic.conic_solver import USUAL
from perfplast_fenicsx.limit_analysis.discrete.strength_reduction import check_all_divided
from perfplast_fenicsx.materials.elastic import check_deforms
from perfplast_fenicsx.materials.laws import MATERIALS, Material
from perfplast_fenicsx.materials.nonassociated_flow import check_flows
from perfplast_fenicsx.problem.declared.initial import Bolt, Initial, InitialStress, Temperature
from perfplast_fenicsx.problem.declared.loads import BodyForce, ForceBelow, Load
from perfplast_fenicsx.problem.declared.stage import check_stages
from perfplast_fenicsx.problem.declared.supports import RigidSurface, Support
from perfplast_fenicsx.seepage.declared import Seepage
from perfplast_fenicsx.spatial_fields import SpatialField, spatial_field
from perfplast_fenicsx.units import Units


def read_case(path: str | Path, comm: MPI.Intracomm = MPI.COMM_WORLD, trust: bool = False) -> Case:
    """Return a case; rank 0 reads the file, and every rank checks its content. Collective.

    Args:
        path: The TOML file.
        comm: The ranks that need the case.
        trust: Whether gmsh may run a script that makes the mesh.

    Raises:
        InputError: If the file cannot be read or is not TOML, if a key is unknown or missing, or if
            a value has a wrong type or is outside its range.
    """
    path = Path(path)
    text: str = comm.bcast(on_rank0(comm, lambda: read_text(path)))
    case = replace(case_of(path, text, parse(text, path.name)), trust=trust)
    for combination in case.combinations:
        case.combined(combination)
    return case


def case_of(path: Path, text: str, table: Table) -> Case:
    """Return the case that the table of a file defines. Not collective.

    Args:
        path: The file.
        text: The text of the file.
        table: The parsed content of the file. A sweep changes values only in this table, not in
            ``text``.

    Raises:
        InputError: As for :func:`read_case`.
    """
    name = path.name
    top = convert(table, Document, name)
    materials = _materials(top, path)
    units = read_units(top.units, materials, name)
    materials, weaker = reduced(materials, top.design, f"{name}, [design]")
    acting = _acting(top, path, materials, units)
    loads, weight = acting.loads, acting.weight
    obstacles = _obstacles(top, name)
    loading = read_loading(top, name)
    place, weights = f"{name}, [earthquake]", acting.weights
    loads += earthquake_loads(top.earthquake, weight, weights, loads, loading, place)
    combinations = read_combinations(_numbered(top.combination, f"{name}, [[combination]]"))
    if combinations:
        loading = designed_for(loading, f"{name}, [[combination]]")
    place = f"{name}, {'[[stage]]' if top.stage else '[loading]'}"
    coulomb = any(surface.get("coulomb") for surface in (*top.contact, *top.obstacle))
    conic, table_of_path = read_conic(top.solve, loading, f"{name}, [solve]")
    method, options = read_method(table_of_path, loading, f"{name}, [solve]", coulomb)
    initial = _initial(top, name)
    moved = loading.moved(loads, initial)
    held, rigid = _held(top, name, moved)
    contacts = _numbered(top.contact, f"{name}, [[contact]]")
    touching = [read_contact(contact, moved, where) for where, contact in contacts]
    strained = bool(initial) or any(a.interference and a.constant for a in touching)
    with at(name):
        materials = remembering(materials, loading)
        if stages := loading.in_turn():
            check_stages(stages, loads, initial, [*held, *rigid, *obstacles, *touching])
    with at(place):
        if not loading.of_body:
            check_flows(materials)
            check_deforms(materials)
        if not loading.divides:
            check_all_divided(materials, touching, obstacles)
        given = Given(loads, [*held, *rigid], obstacles, touching, strained, initial, materials)
        loading.check(given)
    mesh = read_mesh(top.mesh, top.geometry, name, acting.ground)
    other_solver = "" if conic == USUAL else f"conic programs are solved by {conic}"
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
        seepage=acting.seepage,
        contacts=touching,
        obstacles=obstacles,
        ties=[convert(tie, Tie, place) for place, tie in _numbered(top.tie, f"{name}, [[tie]]")],
        model=convert(top.model, ModelOptions, f"{name}, [model]"),
        rigid=rigid,
        element=convert({**loading.element, **top.element}, ElementOptions, f"{name}, [element]"),
        method=method,
        options=options,
        conic=conic,
        loading=loading,
        output=convert(top.output, OutputOptions, f"{name}, [output]"),
        report=convert(top.report, ReportHead, f"{name}, [report]"),
        units=units,
        initial=initial,
        combinations=combinations,
        remarks=tuple(filter(None, (weaker, other_solver, *drawdowns(acting.seepage, units)))),
        water=acting.water,
        cracks=acting.cracks,
    )


def _materials(top: Document, path: Path) -> dict[str, Material]:
    """Return the material of each volume."""
    materials: dict[str, Material] = {}
    for body, properties in top.material.items():
        place = f"{path.name}, [material.{body}]"
        _, law, rest = choose(properties, "law", MATERIALS, place)
        materials[body] = convert(with_fields(rest, law, path.parent, place), law, place)
    return materials


@dataclass(frozen=True)
class _Acting:
    """The loads on the bodies without an earthquake, and their sources.

    Attributes:
        loads: All loads, also from weight, water and seepage.
        weight: The weight; None without gravity.
        weights: The loads that an earthquake multiplies: weight, and water below a level.
        ground: The ground, with kinks where the water has them; None without ground.
        water: The water levels.
        cracks: The water in cracks.
        seepage: The seepage; None without seepage.
    """

    loads: list[Load]
    weight: GravityTable | None
    weights: list[BodyForce]
    ground: DrawnGround | None
    water: Water
    cracks: tuple[str, ...]
    seepage: Seepage | None


def _acting(top: Document, path: Path, materials: Mapping[str, Material], units: Units) -> _Acting:
    """Return the loads of a case, with the weight and the water that cause them."""
    name = path.name
    loads: list[Load] = []
    for place, load in _numbered(top.load, f"{name}, [[load]]"):
        loads.append(read_load(load, place))
    weight, weights = None, list[BodyForce]()
    if top.gravity is not None:
        place = f"{name}, [gravity]"
        weight = convert(top.gravity, GravityTable, place)
        with at(place):
            weights = weight.loads(materials)
    loads += weights
    ground = read_ground(top, path)
    water = read_water(top, ground, materials, units, name)
    given = (top.water or top.seepage or {}).get("unit_weight")
    in_cracks, cracks = water_in_cracks(ground, given, units, weight)
    loads += [*water.loads, *in_cracks]
    seepage = None
    if top.seepage is not None:
        place = f"{name}, [seepage]"
        seepage = read_seepage(top.seepage, units, weight, place)
        with at(place):
            loads += water_loads(seepage, materials, weight)
    weights += [load for load in water.loads if isinstance(load, ForceBelow)]
    if ground is not None:
        ground = ground.with_kinks(water.kinks)
    return _Acting(loads, weight, weights, ground, water, cracks, seepage)


def _obstacles(top: Document, name: str) -> list[Obstacle]:
    """Return the obstacles of a case."""
    obstacles: list[Obstacle] = []
    for place, obstacle in _numbered(top.obstacle, f"{name}, [[obstacle]]"):
        _, shape, rest = choose(obstacle, "shape", OBSTACLES, place)
        obstacles.append(convert(rest, shape, place))
    return obstacles


def _initial(top: Document, name: str) -> list[Initial]:
    """Return temperatures, initial stresses and bolts."""
    kinds: dict[str, tuple[list[Table], type[Initial]]] = {
        "temperature": (top.temperature, Temperature),
        "initial_stress": (top.initial_stress, InitialStress),
        "bolt": (top.bolt, Bolt),
    }
    initial: list[Initial] = []
    for kind, (tables, schema_of) in kinds.items():
        for where, entry in _numbered(tables, f"{name}, [[{kind}]]"):
            initial.append(convert(entry, schema_of, where))
    return initial


def _held(top: Document, name: str, moved: Moved) -> tuple[list[Support], list[RigidSurface]]:
    """Return supports and rigid surfaces.

    Args:
        top: The document.
        name: Name of the file in messages.
        moved: Function that returns whether the loading moves an object, from its names.
    """
    held, rigid = [], []
    for where, support in _numbered(top.support, f"{name}, [[support]]"):
        base = convert(support, SupportTable, where)
        with at(where):
            held.append(base.support(moved(base.name, base.on)))
    for where, surface in _numbered(top.rigid_surface, f"{name}, [[rigid_surface]]"):
        plate = convert(surface, RigidSurfaceTable, where)
        with at(where):
            rigid.append(plate.surface(moved(plate.name, plate.on)))
    return held, rigid


def with_fields(table: Table, law: type[Any], folder: Path, place: str) -> Table:
    """Return a material's table, with a field object in place of each description of a field.

    Args:
        table: The parsed TOML table, without the key ``law``.
        law: The dataclass of the material.
        folder: Folder of the case file.
        place: Place of the table, for messages.

    Raises:
        InputError: If a description is not a valid field.
    """
    hints, found = get_type_hints(law), dict(table)
    for key, value in table.items():
        varies = SpatialField in get_args(hints.get(key))
        if varies and isinstance(value, str | list | dict):
            with at(f"{place}: {key} = {shown(value)}"):
                found[key] = spatial_field(value, folder)
    return found


def _numbered(tables: list[Table], place: str) -> list[tuple[str, Table]]:
    """Return the tables of an array with places; the place of a single table has no number."""
    if len(tables) == 1:
        return [(place, tables[0])]
    return [(f"{place} number {i}", table) for i, table in enumerate(tables, start=1)]
