"""What may stand in the tables of a case file: one dataclass a table, or several to choose from.

Those of materials, supports, contacts, obstacles, loadings and algorithms are of the modules that
use them.
"""

import math
from dataclasses import dataclass, field
from typing import Any, Literal

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.formulas import check
from perfplast_fenicsx.io.case.schema import Table, shown
from perfplast_fenicsx.problem.loads import LOADS, Load


@dataclass(frozen=True)
class Document:
    """The top level of a case file.

    Args:
        mesh: The bodies.
        material: The law of each body; NAME is that of its physical volume.
        load: What pushes and pulls, at least once. The load factor ζ multiplies all loads but those
            that are constant.
        loading: How far the bodies are loaded, and by what it is controlled; it is missing where
            there are stages.
        stage: A history of loading, instead of [loading]: the bodies then remember plastic flow.
        title: For people; the name of the file where it is missing.
        support: What holds the bodies.
        temperature: Where the temperature changes.
        initial_stress: Where bodies have stress before they are deformed.
        contact: Which bodies touch, or may touch, each other.
        obstacle: Rigid obstacles that do not move.
        tie: Which bodies are glued together.
        element: The finite elements.
        solve: The algorithm and its options.
        output: What is written.
        units: What legends call the units.
    """

    mesh: Table
    material: dict[str, Table]
    load: list[Table]
    loading: Table | None = None
    stage: list[Table] = field(default_factory=list)
    title: str = ""
    support: list[Table] = field(default_factory=list)
    temperature: list[Table] = field(default_factory=list)
    initial_stress: list[Table] = field(default_factory=list)
    contact: list[Table] = field(default_factory=list)
    obstacle: list[Table] = field(default_factory=list)
    tie: list[Table] = field(default_factory=list)
    element: Table = field(default_factory=dict)
    solve: Table = field(default_factory=dict)
    output: Table = field(default_factory=dict)
    units: Table = field(default_factory=dict)


@dataclass(frozen=True)
class OutputOptions:
    """What is written beside ``summary.json`` and ``path.csv``.

    Args:
        fields: Write ``fields.vtkhdf.series`` and the folder ``fields``.
        pictures: Draw ``path.png``, and of the fields on file ``fields.png`` and
            ``mechanism.png``; without fields ``path.png`` alone.
    """

    fields: bool = True
    pictures: bool = True


@dataclass(frozen=True)
class ElementOptions:
    """The finite element.

    Args:
        degree: Of the displacements, 1 or 2; of mechanisms (control = "bounds") 2 by default.
    """

    degree: Literal[1, 2] = 1


@dataclass(frozen=True)
class MeshFile:
    """A gmsh file of tetrahedra, or of triangles in a plane z = const for plane strain.

    Args:
        file: Its path, relative to the folder of the case file. Bodies and surfaces have physical
            names.
        adapt: With ``control = "bounds"``: bound the limit load on finer and finer meshes.
    """

    file: str
    adapt: Table | None = None


@dataclass(frozen=True)
class MeshBuilder:
    """A structured builder of :mod:`perfplast_fenicsx.mesh.sample_meshes` and its arguments.

    Args:
        builder: Its name.
        arguments: What the builder takes, each a key of its own.
        adapt: As for files.
    """

    builder: str
    arguments: dict[str, Any]
    adapt: Table | None = None


@dataclass(frozen=True)
class LoadTable:
    """A load on a surface or in a volume: give exactly one of its four kinds.

    Numbers may be formulas in x, y, z, such as ``"10*maximum(8 - y, 0)"``, which are taken at the
    nodes of quadratic cells.

    Args:
        on: Physical surface, or volume for a ``body_force`` or ``pore_pressure``.
        traction: Force per area (stress), one number or formula a direction.
        pressure: Pressure (stress), a number or formula; a positive one pushes on the body.
        body_force: Force per volume, one number or formula a direction.
        pore_pressure: Pressure of water in the pores (stress), a number or formula; the stress of
            the material is then the effective one.
        constant: Whether the load acts in full at any load factor, as a weight does; without it
            true of a ``pore_pressure``, and false of others.
        name: What messages and stages call the load.
    """

    on: str
    traction: list[float | str] | None = None
    pressure: float | str | None = None
    body_force: list[float | str] | None = None
    pore_pressure: float | str | None = None
    constant: bool | None = None
    name: str = ""

    def load(self, place: str) -> Load:
        """The load that it describes.

        Raises:
            InputError: If it has none or several of the four kinds, or one that is not finite.
        """
        given = {kind: getattr(self, kind) for kind in LOADS}
        given = {kind: value for kind, value in given.items() if value is not None}
        if len(given) != 1:
            what = " and ".join(given) or "no load"
            raise InputError(
                f"{place}: '{self.on}' has {what}; give exactly one of traction, pressure,"
                " body_force and pore_pressure (several loads are several [[load]] tables)."
            )
        ((kind, value),) = given.items()
        numbers = value if isinstance(value, list) else [value]
        if not all(isinstance(one, str) or math.isfinite(one) for one in numbers):
            raise InputError(
                f"{place}: {kind} = {shown(value)} is not finite; give finite numbers."
            )
        for formula in numbers:
            if isinstance(formula, str):
                check(formula, f"{place}: {kind}")
        cls = LOADS[kind]
        constant = cls.constant if self.constant is None else self.constant
        load: Load = cls(self.on, value, self.name, constant)
        return load
