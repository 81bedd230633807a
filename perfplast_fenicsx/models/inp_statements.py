"""Read the materials, supports, loads and contacts of an ``.inp`` file."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.models.foreign_model import ForeignMaterial, Held, Joined, Pushed
from perfplast_fenicsx.models.inp_keywords import Keyword, number_of
from perfplast_fenicsx.models.inp_mesh import SCOPES, Assembly
from perfplast_fenicsx.models.outer_facets import ElementFacets, NamedSurfaces

SILENT = {
    *("HEADING", "PREPRINT", "RESTART", "STEP", "END STEP", "STATIC", "OUTPUT", "NODE OUTPUT"),
    *("ELEMENT OUTPUT", "CONTACT OUTPUT", "NODE FILE", "EL FILE", "NODE PRINT", "EL PRINT"),
    *("CONTACT FILE", "CONTACT PRINT", "SECTION PRINT", "FILE OUTPUT", "PHYSICAL CONSTANTS"),
    *("SURFACE BEHAVIOR", "SYSTEM", "MONITOR", "CONTROLS", "PRINT", "DATA CHECK", "INCLUDE"),
    *("ELEMENT PRINT", "ENERGY OUTPUT", "ENERGY FILE", "ENERGY PRINT", "SOLID SECTION", *SCOPES),
}
"""Keywords that do not affect a limit load, or that other modules read."""

LOADS = ("CLOAD", "DLOAD", "DSLOAD")


class Statements:
    """Stores keywords that do not belong to the mesh, until the mesh is known.

    Attributes:
        sections: Part, element set and material of each section.
        materials: Materials by name in upper case.
        surfaces: ``*SURFACE`` keywords.
        frictions: Coefficients by interaction.
        thicknesses: Thicknesses of plane elements from sections.
    """

    def __init__(self) -> None:
        self.sections: list[tuple[str, str, str]] = []
        self._part = ""
        self.materials: dict[str, ForeignMaterial] = {}
        self._material = ""
        self.frictions: dict[str, float] = {}
        self._interaction = ""
        self.thicknesses: set[float] = set()
        self.surfaces: list[Keyword] = []
        self._on_surfaces: list[tuple[int, Keyword]] = []
        self._steps = 0
        self._unknown: Counter[str] = Counter()
        self._noted: list[str] = []

    @property
    def remarks(self) -> list[str]:
        """Return remarks on keywords and data that the program ignores."""
        told = [
            f"*{name} ({number} times) has no counterpart and is ignored"
            if number > 1
            else f"*{name} has no counterpart and is ignored"
            for name, number in self._unknown.items()
        ]
        loaded = {step for step, keyword in self._on_surfaces if keyword.name in LOADS}
        if len(loaded) > 1:
            told.append(
                f"of {self._steps} steps, only loads and supports up to step {min(loaded)} are "
                "used, the first step with loads"
            )
        return self._noted + told

    def chosen(self) -> list[Keyword]:
        """Return keywords of supports, loads and joints up to the end of the first loaded step."""
        loaded = [step for step, keyword in self._on_surfaces if keyword.name in LOADS]
        last = min(loaded, default=self._steps)
        return [keyword for step, keyword in self._on_surfaces if step <= last]

    def take(self, keyword: Keyword) -> None:
        """Read a keyword that does not belong to the mesh."""
        name = keyword.name
        if name == "SOLID SECTION":
            elset, material = keyword.option("ELSET"), keyword.option("MATERIAL")
            self.sections.append((self._part, elset, material))
            cells = [row[0] for row in keyword.rows() if row and row[0]]
            self.thicknesses |= {number_of(cell, keyword) for cell in cells[:1]}
        elif name in ("PART", "END PART"):
            self._part = keyword.option("NAME")
        elif name == "MATERIAL":
            self._material = keyword.option("NAME")
            self.materials[self._material] = ForeignMaterial()
        elif name in ("ELASTIC", "PLASTIC", "DENSITY", "EXPANSION"):
            self._property(keyword)
        elif name == "SURFACE INTERACTION":
            self._interaction = keyword.option("NAME")
        elif name == "FRICTION":
            rows = keyword.rows()
            given = number_of(rows[0][0], keyword) if rows and rows[0] else 0.0
            self.frictions[self._interaction] = given
        elif name == "SURFACE":
            self.surfaces.append(keyword)
        elif name in ("BOUNDARY", "CLOAD", "DLOAD", "DSLOAD", "TIE", "CONTACT PAIR"):
            self._on_surfaces.append((self._steps, keyword))
        elif name not in SILENT:
            self._unknown[name] += 1
        if name == "STEP":
            self._steps += 1

    def _property(self, keyword: Keyword) -> None:
        """Read a property of the current material."""
        now, rows = self.materials.get(self._material), [row for row in keyword.rows() if row]
        if now is None or not rows:
            raise InputError(
                f"line {keyword.number}: *{keyword.name} belongs to no *MATERIAL, or contains no "
                "numbers, so the file is damaged; export it again."
            )
        values = [[number_of(cell, keyword) for cell in row] for row in rows]
        if keyword.name == "ELASTIC":
            kind = keyword.option("TYPE", "ISOTROPIC")
            if kind not in ("ISO", "ISOTROPIC") or len(values[0]) < 2:
                self._noted.append(
                    f"*ELASTIC of '{self._material}' is {kind.lower()}, which the program does not "
                    "support: fill in the material of the body"
                )
                return
            now = replace(now, young=values[0][0], poisson=values[0][1])
        elif keyword.name == "PLASTIC":
            stresses = [row[0] for row in values]
            now = replace(now, yield_stress=stresses[0])
            if len(values) > 1 and any(stress != stresses[0] for stress in stresses):
                self._noted.append(
                    f"*PLASTIC of '{self._material}' has {len(values)} points: only the first "
                    f"yield stress {stresses[0]:g} is used, because limit loads need perfect "
                    "plasticity"
                )
        elif keyword.name == "DENSITY":
            now = replace(now, density=values[0][0])
        else:
            now = replace(now, expansion=values[0][0])
        self.materials[self._material] = now


def missing(what: str, name: str) -> InputError:
    """Return the error for a keyword that refers to a missing set or surface."""
    return InputError(
        f"{what} refers to '{name}', which the file does not contain; export the model with all "
        "sets and surfaces, or correct the name."
    )


class UsedSurfaces:
    """Finds the surfaces to which keywords refer: by name, by sets of nodes, and by faces.

    Attributes:
        remarks: Remarks on sets that do not form surfaces.
    """

    def __init__(self, assembly: Assembly, find: ElementFacets, dim: int) -> None:
        """Store the mesh.

        Args:
            assembly: The mesh.
            find: Search for facets by nodes or elements.
            dim: 3, or 2 for plane models.
        """
        self._assembly, self._find, self._dim = assembly, find, dim
        self._named = NamedSurfaces()
        self._facets: dict[str, Longs] = {}
        self._no_surface: dict[str, list[str]] = {}
        self.remarks: list[str] = []

    def declare(self, keyword: Keyword) -> None:
        """Read a ``*SURFACE`` keyword."""
        name = keyword.option("NAME")
        every: list[Longs] = [np.zeros(0, dtype=np.int64)]
        for row in keyword.rows():
            kind = "NSET" if keyword.option("TYPE") == "NODE" else "ELSET"
            members = self._assembly.members(kind, row[0]) if row else None
            if members is None:
                raise missing(f"*SURFACE '{name}'", ", ".join(row[:1]))
            if kind == "NSET":
                every.append(self._find.of_nodes(members))
            elif self._is_flat(members):
                every.append(self._find.of_flat_elements(members))
            else:
                face = row[1].upper() if len(row) > 1 else ""
                every.append(self._find.of_faces(members, face))
        self._facets[name] = np.unique(np.concatenate(every))

    def use(self, name: str, facets: Longs) -> str:
        """Add facets to the surface ``name``, and return the name."""
        self._named.add(name, facets)
        return name

    def of_nodes(self, name: str, what: str) -> str | None:
        """Return the name of the surface of a set of nodes, or add a remark and return None."""
        nodes = self._assembly.members("NSET", name)
        if nodes is None:
            raise missing(what, name)
        facets = self._find.of_nodes(nodes)
        if not self._find.covered(nodes, facets):
            self._no_surface.setdefault(what, []).append(name)
            return None
        return self.use(name, facets)

    def named(self, name: str, what: str) -> str | None:
        """Return a ``*SURFACE``'s name, or add a remark and return None if it has no outer face."""
        facets = self._facets.get(name.upper())
        if facets is None:
            raise missing(what, name)
        if not len(facets):
            self.remarks.append(
                f"{what} on the surface '{name}', which has no outer face, is ignored"
            )
            return None
        return self.use(name.upper(), facets)

    def area(self, name: str) -> float:
        """Return the area of a surface to which keywords refer."""
        return float(self._find.areas(self._named.facets(name)).sum())

    def divided(self, taken: Sequence[str]) -> tuple[list[str], Longs, Longs, dict[str, list[str]]]:
        """Return the result of :meth:`NamedSurfaces.divided`, and complete ``remarks``."""
        most_shown = 5  # largest number of names in a remark
        for what, names in self._no_surface.items():
            shown = ", ".join(repr(name) for name in names[:most_shown])
            more = f" and {len(names) - most_shown} more" if len(names) > most_shown else ""
            self.remarks.append(
                f"{what} on {shown}{more}, whose nodes do not form a surface, is ignored; use a "
                "set that contains all nodes of outer faces"
            )
        self._no_surface.clear()
        return self._named.divided(taken)

    def _is_flat(self, elements: Longs) -> bool:
        """Return whether a set contains no solid elements, only surface elements."""
        blocks = [b for b in self._assembly.blocks if b.kind.shape.dim == self._dim]
        solid = [np.arange(b.first, b.first + len(b.nodes)) for b in blocks]
        return not np.isin(elements, np.concatenate(solid)).any()


NAMED_SUPPORTS = {"ENCASTRE": "123", "PINNED": "123", "XSYMM": "1", "YSYMM": "2", "ZSYMM": "3"}
"""Numbers of the components that named supports hold."""

AXES = "xyz"


@dataclass(frozen=True, eq=False)
class InpBody:
    """A body that a section of the file defines.

    Attributes:
        name: Name in the case.
        material: Name of the material; "" if the body has no material.
        elements: Numbers of the elements.
        density: Mass per volume; None if it is unknown.
    """

    name: str
    material: str
    elements: Longs
    density: float | None


@dataclass
class Made:
    """Supports, loads and joints, on surfaces that share no facets.

    Attributes:
        surfaces: Result of :meth:`NamedSurfaces.divided`.
        held: Supports.
        pushed: Loads.
        joined: Contacts and ties.
        remarks: Remarks on parts that could not be converted.
    """

    surfaces: tuple[list[str], Longs, Longs, dict[str, list[str]]]
    held: list[Held] = field(default_factory=list)
    pushed: list[Pushed] = field(default_factory=list)
    joined: list[Joined] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


class OnSurfaces:
    """Converts keywords into supports, loads and joints on surfaces without common facets."""

    def __init__(
        self,
        assembly: Assembly,
        surfaces: ElementFacets,
        bodies: Sequence[InpBody],
        dim: int,
        thickness: float = 1.0,
    ) -> None:
        """Store the mesh.

        Args:
            assembly: The mesh.
            surfaces: Search for facets.
            bodies: The bodies with their elements and densities.
            dim: 3, or 2 for plane models.
            thickness: Thickness of plane elements, over which forces at nodes are distributed.
        """
        self._thickness = thickness
        self._assembly, self._find = assembly, surfaces
        self._bodies, self._dim = bodies, dim
        self._use = UsedSurfaces(assembly, surfaces, dim)
        self._remarks: list[str] = []

    def made(self, surfaces: list[Keyword], on: list[Keyword], frictions: dict[str, float]) -> Made:
        """Return the supports, loads and joints on surfaces.

        Args:
            surfaces: ``*SURFACE`` keywords.
            on: Keywords of supports, loads, contacts and ties.
            frictions: Coefficients by interaction.
        """
        for keyword in surfaces:
            self._use.declare(keyword)
        pushed: list[Pushed] = []
        joined: list[Joined] = []
        held = self._boundary([one for one in on if one.name == "BOUNDARY"])
        for keyword in on:
            if keyword.name in ("TIE", "CONTACT PAIR"):
                joined += self._pairs(keyword, frictions)
            elif keyword.name == "CLOAD":
                pushed += self._nodal(keyword)
            elif keyword.name in LOADS:
                pushed += self._distributed(keyword)
        divided = self._use.divided([body.name for body in self._bodies])
        stands = divided[3]
        found = Made(divided, remarks=self._use.remarks + self._remarks)
        for one in held:
            found.held += [replace(one, on=name) for name in stands[one.on]]
        for load in pushed:
            on_bodies = load.kind == "body_force"
            names = [load.on] if on_bodies else stands[load.on]
            found.pushed += [replace(load, on=name) for name in names]
        for pair in joined:
            for a in stands[pair.primary]:
                for b in stands[pair.secondary]:
                    found.joined.append(replace(pair, primary=a, secondary=b))
        found.held = list(dict.fromkeys(found.held))
        return found

    def _boundary(self, keywords: list[Keyword]) -> list[Held]:
        found: dict[tuple[str, float], set[str]] = {}
        single: dict[tuple[str, float], list[Longs]] = {}
        for keyword, row in ((one, row) for one in keywords for row in one.rows()):
            if len(row) < 2:
                continue
            first = row[1].upper()
            axes = NAMED_SUPPORTS.get(first)
            if axes is None:
                last = row[2] if len(row) > 2 and row[2] else row[1]
                if not (row[1].isdigit() and last.isdigit()):
                    self._remarks.append(
                        f"*BOUNDARY '{', '.join(row)}' is not understood and is ignored"
                    )
                    continue
                axes = "".join(str(k) for k in range(int(row[1]), int(last) + 1))
            here = {AXES[int(k) - 1] for k in axes if k in "123"[: self._dim]}
            value = number_of(row[3], keyword) if len(row) > 3 and row[3] else 0.0
            if here and row[0].rpartition(".")[2].isdigit():
                node = self._assembly.members("NSET", row[0])
                if node is None:
                    raise missing("*BOUNDARY", row[0])
                for axis in here:
                    single.setdefault((axis, value), []).append(node)
            elif here:
                found.setdefault((row[0].upper(), value), set()).update(here)
        for (axis, value), nodes in single.items():
            name = f"HELD_{axis}{'' if value == 0 else f'_{value:g}'}".upper()
            self._assembly.sets["NSET", name] = np.unique(np.concatenate(nodes))
            found[name, value] = {axis}
        held = []
        for (name, value), some in found.items():
            on = self._use.of_nodes(name, "*BOUNDARY")
            if on is not None:
                held.append(Held(on, "".join(sorted(some)), value))
        return held

    def _nodal(self, keyword: Keyword) -> list[Pushed]:
        """Return tractions that replace nodal forces; sets that form no surface are merged."""
        forces: dict[str, list[float]] = {}
        rest: dict[str, list[Longs]] = {}
        for row in keyword.rows():
            if len(row) < 3 or not row[1].isdigit() or not 1 <= int(row[1]) <= self._dim:
                self._remarks.append(
                    f"*CLOAD '{', '.join(row)}' is not a force along an axis and is ignored"
                )
                continue
            nodes, axis = self._assembly.members("NSET", row[0]), int(row[1]) - 1
            if nodes is None:
                raise missing("*CLOAD", row[0])
            if not len(nodes):
                self._remarks.append(f"*CLOAD on '{row[0]}', which is an empty set, is ignored")
                continue
            resultant, name = len(nodes) * number_of(row[2], keyword), row[0].upper()
            whole = len(nodes) > 1 and self._find.covered(nodes, self._find.of_nodes(nodes))
            if not whole:
                name = f"PUSHED_{AXES[axis].upper()}"
                rest.setdefault(name, []).append(nodes)
            forces.setdefault(name, [0.0] * self._dim)[axis] += resultant
        for name, some in rest.items():
            self._assembly.sets["NSET", name] = np.unique(np.concatenate(some))
        pushed = []
        for name, force in forces.items():
            on = self._use.of_nodes(name, "*CLOAD")
            if on is None:
                continue
            area = self._use.area(on) * self._thickness
            self._remarks.append(
                f"forces at the nodes of '{name}', in total {_vector(force)}, are replaced by a "
                "uniform traction with this resultant"
            )
            traction = tuple(component / area for component in force)
            pushed.append(Pushed(on, "traction", traction, f"{_vector(force)} in all"))
        return pushed

    def _distributed(self, keyword: Keyword) -> list[Pushed]:
        pushed = []
        uniaxial, gravity = "P", "GRAV"
        for row in keyword.rows():
            if len(row) < 3:
                continue
            name, kind = row[0].upper(), row[1].upper()
            if kind == gravity and len(row) >= 6:
                pushed += self._weight(name, [number_of(cell, keyword) for cell in row[2:6]])
                continue
            if keyword.name == "DSLOAD" and kind == uniaxial:
                on = self._use.named(name, "*DSLOAD")
            elif keyword.name == "DLOAD" and kind[:1] == uniaxial and kind[1:].isdigit():
                on = self._pressed(name, kind, number_of(row[2], keyword))
            else:
                on = None
                self._remarks.append(
                    f"*{keyword.name} '{', '.join(row)}' is not understood and is ignored"
                )
            if on is not None:
                load = Pushed(on, "pressure", number_of(row[2], keyword))
                pushed += [] if name.isdigit() and load in pushed else [load]
        return pushed

    def _pressed(self, elset: str, face: str, pressure: float) -> str | None:
        """Return the name of a pressure's surface; single elements of equal pressure share one."""
        members = self._assembly.members("ELSET", elset)
        if members is None:
            raise missing(f"*DLOAD {face}", elset)
        facets = self._find.of_faces(members, face)
        if not len(facets):
            self._remarks.append(f"*DLOAD {face} on '{elset}' acts on no outer face and is ignored")
            return None
        name = f"PRESSED_BY_{pressure:g}" if elset.isdigit() else f"{elset}_{face}"
        return self._use.use(name, facets)

    def _weight(self, elset: str, given: list[float]) -> list[Pushed]:
        """Return the gravity loads of a set, for the bodies that the set contains completely."""
        size, direction = given[0], given[1 : 1 + self._dim]
        members = self._assembly.members("ELSET", elset)
        found = []
        for body in self._bodies:
            if members is None or not np.isin(body.elements, members).all():
                continue
            if body.density is None:
                self._remarks.append(
                    f"gravity on '{body.name}' is ignored, because its material has no *DENSITY"
                )
                continue
            force = tuple(size * body.density * x for x in direction)
            found.append(Pushed(body.name, "body_force", force, "gravity times density"))
        if not found:
            self._remarks.append(
                f"gravity on '{elset}' is ignored, because this set contains no whole body"
            )
        return found

    def _pairs(self, keyword: Keyword, frictions: dict[str, float]) -> list[Joined]:
        tied = keyword.name == "TIE"
        joined = []
        for row in keyword.rows():
            if len(row) < 2:
                self._remarks.append(
                    f"*{keyword.name} '{', '.join(row)}' does not have two surfaces and is ignored"
                )
                continue
            one, other = (self._use.named(name, f"*{keyword.name}") for name in row[:2])
            if one is None or other is None:
                continue
            mu = 0.0 if tied else frictions.get(keyword.option("INTERACTION"), 0.0)
            if mu:
                self._remarks.append(
                    f"friction {mu:g} of '{one}' and '{other}' is only a comment in the case, "
                    "because no limit theorem holds with Coulomb's friction"
                )
            joined.append(Joined(one, other, tied, mu))
        return joined


def _vector(values: list[float]) -> str:
    return f"({', '.join(f'{value:.6g}' for value in values)})"
