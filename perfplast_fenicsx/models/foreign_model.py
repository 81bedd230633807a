"""Represent a model of another program, as far as a case can express it, with remarks."""

from dataclasses import dataclass, field

from perfplast_fenicsx.arrays import Floats, Longs


@dataclass(frozen=True)
class ForeignMaterial:
    """Numbers of a material.

    Attributes:
        young: Young's modulus; None if it is not given.
        poisson: Poisson's ratio.
        yield_stress: Initial yield stress; None for elastic bodies.
        hardening: Initial slope of the hardening curve, 0 if it is flat.
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
    """A surface that is held, or moved, along some axes."""

    on: str
    components: str
    value: float = 0.0


@dataclass(frozen=True)
class Pushed:
    """A load on a surface or a body.

    Attributes:
        on: The surface or body.
        kind: "pressure", "traction" or "body_force".
        value: A number or a vector.
        note: A comment.
    """

    on: str
    kind: str
    value: float | tuple[float, ...]
    note: str = ""


@dataclass(frozen=True)
class Joined:
    """Two surfaces in contact, or glued.

    Attributes:
        primary: One surface.
        secondary: The other one.
        tied: Whether they are glued.
        coulomb: Coefficient of friction, 0 without.
    """

    primary: str
    secondary: str
    tied: bool = False
    coulomb: float = 0.0


@dataclass
class ForeignModel:
    """A model of simplices with names.

    Attributes:
        dim: Dimension: 3, or 2 for a plane model.
        turned: Whether a plane model is half a section of a body of revolution.
        thickness: Thickness of sheets in plane stress (length); None otherwise.
        points: Coordinates of the points, shape (n, 3).
        cells: Corners of the simplices, shape (m, dim + 1).
        body: Number of the body of each cell, shape (m,).
        bodies: Names of the bodies.
        facets: Corners of named facets, shape (k, dim); each facet once.
        surface: Number of the surface of each named facet, shape (k,).
        surfaces: Names of the surfaces.
        materials: Materials by body; bodies without one are missing.
        held: Supports.
        pushed: Loads.
        joined: Contacts and ties.
        remarks: Remarks on parts that were not understood or were changed, a sentence each.
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
