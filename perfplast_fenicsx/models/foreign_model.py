"""Define a model from another program, as far as a case can represent it, with remarks."""

from dataclasses import dataclass, field, replace

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.common import TABLE, find
from perfplast_fenicsx.units import SYSTEMS


@dataclass(frozen=True)
class ForeignMaterial:
    """The parameters of a material.

    Attributes:
        young: Young's modulus; None if it is not given.
        poisson: Poisson's ratio.
        yield_stress: Initial yield stress; None for elastic bodies.
        hardening: Initial slope of the hardening curve; 0 for perfect plasticity.
        density: Mass per volume; None if it is not given.
        expansion: Coefficient of thermal expansion.
    """

    young: float | None = None
    poisson: float | None = None
    yield_stress: float | None = None
    hardening: float = 0.0
    density: float | None = None
    expansion: float = 0.0


@dataclass(frozen=True)
class Held:
    """A surface on which some displacement components are prescribed."""

    on: str
    components: str
    value: float = 0.0


@dataclass(frozen=True)
class Pushed:
    """A load on a surface or a body.

    Attributes:
        on: Name of the surface or body.
        kind: "pressure", "traction" or "body_force".
        value: A number or a vector.
        note: Comment for the case file.
    """

    on: str
    kind: str
    value: float | tuple[float, ...]
    note: str = ""


@dataclass(frozen=True)
class Joined:
    """Two surfaces that are in contact or glued.

    Attributes:
        primary: Name of one surface.
        secondary: Name of the other surface.
        tied: Whether the surfaces are glued.
        coulomb: Coefficient of friction; 0 if there is no friction.
    """

    primary: str
    secondary: str
    tied: bool = False
    coulomb: float = 0.0


@dataclass
class ForeignModel:
    """A model of simplices with named bodies and surfaces.

    Attributes:
        dim: 3, or 2 for a plane model.
        turned: Whether a plane model is the half section of bodies of revolution.
        thickness: Thickness of sheets in plane stress (length); None otherwise.
        points: Coordinates of the points, shape (n, 3).
        cells: Corners of the simplices, shape (m, dim + 1).
        body: Number of the body of each cell, shape (m,).
        bodies: Names of the bodies.
        facets: Corners of the named facets, shape (k, dim); no facet occurs twice.
        surface: Number of the surface of each named facet, shape (k,).
        surfaces: Names of the surfaces.
        materials: Materials by name of the body; bodies without a material are missing.
        held: Supports.
        pushed: Loads.
        joined: Contacts and ties.
        remarks: Remarks on parts that could not be read or were changed, each a sentence.
    """

    dim: int
    turned: bool
    points: Floats
    cells: Longs
    body: Longs
    bodies: list[str]
    facets: Longs
    surface: Longs
    surfaces: list[str]
    materials: dict[str, ForeignMaterial] = field(default_factory=dict)
    held: list[Held] = field(default_factory=list)
    pushed: list[Pushed] = field(default_factory=list)
    joined: list[Joined] = field(default_factory=list)
    thickness: float | None = None
    remarks: list[str] = field(default_factory=list)


def told_of_shared_nodes(model: ForeignModel) -> list[str]:
    """Return a list with one remark if bodies share nodes, and an empty list otherwise."""
    bodies = np.repeat(model.body, model.cells.shape[1])
    first = np.full(len(model.points), len(model.bodies))
    last = np.full(len(model.points), -1)
    np.minimum.at(first, model.cells.ravel(), bodies)
    np.maximum.at(last, model.cells.ravel(), bodies)
    shared = last > first
    if not shared.any():
        return []
    pairs = np.unique(np.column_stack([first[shared], last[shared]]), axis=0)
    names = sorted({model.bodies[number] for number in pairs.ravel()})
    return [
        f"{' and '.join(map(repr, names))} share nodes, so they are connected: to define contact "
        "between them, export them as separate meshes"
    ]


def with_material(model: ForeignModel, name: str) -> tuple[ForeignModel, str]:
    """Return the model with one material for all bodies, and the unit of stress.

    The unit follows from Young's moduli in the file. If the file has none, the numbers are in MPa.

    Raises:
        InputError: If the material does not exist, if a body already has a yield stress, or if
            Young's moduli do not fit the material in any unit.
    """
    common = find(name)
    yields = [body for body, given in model.materials.items() if given.yield_stress is not None]
    if yields:
        raise InputError(
            f"'{yields[0]}' already has a yield stress in the file; remove --material, and change "
            "the yield stress in the case."
        )
    known = [given.young for given in model.materials.values() if given.young is not None]
    # Young's moduli of one material in the same unit differ at most by this factor; the moduli of
    # steels differ by less, and units differ by more.
    alike = 2.0
    fitting = [
        system
        for system in (SYSTEMS if known else [TABLE])
        if all(1 / alike < young / common.in_system(system).young < alike for young in known)
    ]
    if not fitting:
        raise InputError(
            f"the Young's moduli in the file ({', '.join(f'{young:g}' for young in known)}) do not "
            f"fit {name} in any system of units; remove --material, and fill in the yield stress."
        )
    one = common.in_system(fitting[0])
    given = ForeignMaterial(one.young, one.poisson, one.yield_stress)
    materials = {}
    for body in model.bodies:
        before = model.materials.get(body, ForeignMaterial())
        materials[body] = replace(given, density=before.density, expansion=before.expansion)
    return replace(model, materials=materials), SYSTEMS[fitting[0]].stress
