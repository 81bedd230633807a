"""Build a problem step by step, with the names of the mesh as attributes that an editor completes.

:class:`ProblemBuilder` checks each step when it is made, and lists what the problem lacks::

    build = ProblemBuilder(read_gmsh(MPI.COMM_WORLD, "prop.msh"))
    build.material(steel, *build.bodies)
    build.add(Support(build.surfaces.block_z_low), Pressure(build.surfaces.beam_z_high, 1.0))
    problem = build.problem(degree=2)
"""

from collections.abc import Iterator, Mapping

from perfplast_fenicsx.contact.declared.contact import Contact, Tie
from perfplast_fenicsx.contact.declared.obstacles import Cylinder, Obstacle, Plane, Sphere
from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.materials.law import Material
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.declared.initial import (
    Bolt,
    Initial,
    InitialStress,
    Temperature,
)
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.supports import RigidSurface, Support
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.tables import notebook_table

Declared = Support | Load | Contact | Obstacle | Tie | RigidSurface | Initial
"""Everything that a problem may contain besides its mesh and its materials."""

ARGUMENTS: tuple[tuple[str, tuple[type, ...]], ...] = (
    ("supports", (Support, RigidSurface)),
    ("contacts", (Contact, Tie)),
    ("obstacles", (Plane, Sphere, Cylinder)),
    ("initial", (Temperature, InitialStress, Bolt)),
    ("loads", (Load,)),
)
"""Arguments of :class:`Problem`, each with the classes of its entries."""


class Names:
    """Names of the mesh as attributes and keys, for completion in editors and notebooks.

    Each attribute is the name itself: ``names.top == "top"``. A name that is not an identifier of
    Python is a key: ``names["left side"]``. Iteration yields all names.
    """

    def __init__(self, kind: str, names: Mapping[str, object]) -> None:
        """Store the names.

        Args:
            kind: "body" or "surface", for messages.
            names: The names, as keys.
        """
        self._kind, self._names = kind, tuple(sorted(names))

    def __getattr__(self, name: str) -> str:
        if not name.startswith("_") and name in self._names:
            return name
        raise AttributeError(self._unknown(name))

    def __getitem__(self, name: str) -> str:
        if name in self._names:
            return name
        raise InputError(self._unknown(name))

    def __dir__(self) -> list[str]:
        return [name for name in self._names if name.isidentifier()]

    def _ipython_key_completions_(self) -> list[str]:
        """Return the keys, which IPython completes."""
        return list(self._names)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return f"Names({', '.join(self._names) or 'none'})"

    def _unknown(self, name: str) -> str:
        return f"the mesh has no {self._kind} '{name}'; {nearest(name, self._names)}"


class ProblemBuilder:
    """A problem that is built step by step.

    Attributes:
        tagged_mesh: The mesh with named bodies and surfaces.
        bodies: Names of the bodies.
        surfaces: Names of the surfaces.
        materials: The material of each body so far.
        declared: All other declarations so far, in their order.
    """

    def __init__(self, tagged_mesh: TaggedMesh) -> None:
        """Start without materials, supports and loads."""
        self.tagged_mesh = tagged_mesh
        self.bodies = Names("body", tagged_mesh.volumes)
        self.surfaces = Names("surface", tagged_mesh.surfaces)
        self.materials: dict[str, Material] = {}
        self.declared: list[Declared] = []

    def material(self, material: Material, *bodies: str) -> "ProblemBuilder":
        """Assign a material to bodies; it replaces an earlier material.

        Args:
            material: The material.
            bodies: Names of at least one body; ``*build.bodies`` names all bodies.

        Returns:
            This builder.

        Raises:
            InputError: If no body is named, or if the mesh has no such body.
        """
        if not bodies:
            raise InputError(
                "a material needs the names of its bodies; give these names, or *build.bodies for "
                "all bodies."
            )
        for name in bodies:
            self.tagged_mesh.cells(name)
        self.materials |= dict.fromkeys(bodies, material)
        return self

    def add(self, *declared: Declared) -> "ProblemBuilder":
        """Add supports, loads, contacts, obstacles, ties, rigid surfaces or initial strains.

        Args:
            declared: The declarations.

        Returns:
            This builder.

        Raises:
            InputError: If an object is of another kind, or names an unknown body or surface. The
                builder then adds none of the objects.
        """
        for one in declared:
            self._check_names(one, _argument_of(one))
        self.declared += declared
        return self

    def _check_names(self, one: Declared, argument: str) -> None:
        """Refuse names that the mesh does not have."""
        if isinstance(one, Contact | Tie):
            used = [one.primary, one.secondary]
        else:
            used = [one.on]
        in_volume = argument == "initial" or (isinstance(one, Load) and one.in_volume)
        for name in used:
            (self.tagged_mesh.cells if in_volume else self.tagged_mesh.facets)(name)

    def missing(self) -> list[str]:
        """Return a clause for each part that the problem lacks; an empty list if it lacks none.

        Supports may be missing on purpose, for example if contact holds all bodies, so they are not
        listed.
        """
        without = [name for name in self.bodies if name not in self.materials]
        found = [f"a material of {', '.join(without)}"] if without else []
        if not any(isinstance(one, Load) for one in self.declared):
            found.append("a load")
        return found

    def problem(self, degree: int) -> Problem:
        """Return the problem. Collective.

        Args:
            degree: Degree of the displacements, 1 or 2; bounds need 2.

        Raises:
            InputError: If a body has no material, or if the declarations do not fit the mesh or
                each other.
        """
        arguments: dict[str, list[Declared]] = {name: [] for name, _ in ARGUMENTS}
        for one in self.declared:
            arguments[_argument_of(one)].append(one)
        materials = dict(self.materials)  # later steps do not change the problem
        return Problem(self.tagged_mesh, materials, degree=degree, **arguments)  # type: ignore[arg-type]

    def __repr__(self) -> str:
        counts = f"{len(self.materials)} materials, {len(self.declared)} declarations"
        return f"ProblemBuilder({counts}; missing: {'; '.join(self.missing()) or 'nothing'})"

    def _repr_html_(self) -> str:
        """Return the declarations so far, and the missing parts, as an HTML table."""
        rows: list[tuple[str, object]] = [("mesh", self.tagged_mesh)]
        rows += [(f"material of {name}", of) for name, of in self.materials.items()]
        rows += [(type(one).__name__, one) for one in self.declared]
        rows += [("missing", clause) for clause in self.missing()]
        return notebook_table("Problem so far", rows)


def _argument_of(one: Declared) -> str:
    """Return the argument of :class:`Problem` to which a declaration belongs.

    Raises:
        InputError: If the object is not a declaration.
    """
    for name, kinds in ARGUMENTS:
        if isinstance(one, kinds):
            return name
    raise InputError(
        f"an object of type {type(one).__name__} cannot be part of a problem; add supports, loads, "
        "contacts, obstacles, ties, rigid surfaces, bolts, temperatures or initial stresses."
    )
