"""What an ``.inp`` file says beside its mesh: materials, sections, supports, loads, contact."""

from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.parts import unique_names
from perfplast_fenicsx.models.foreign_model import ForeignMaterial, Held, Joined, Pushed
from perfplast_fenicsx.models.inp_keywords import Keyword
from perfplast_fenicsx.models.inp_mesh import SCOPES, Assembly
from perfplast_fenicsx.models.inp_surfaces import InpSurfaces
from perfplast_fenicsx.models.named_surfaces import NamedSurfaces

SILENT = {
    *("HEADING", "PREPRINT", "RESTART", "STEP", "END STEP", "STATIC", "OUTPUT", "NODE OUTPUT"),
    *("ELEMENT OUTPUT", "CONTACT OUTPUT", "NODE FILE", "EL FILE", "NODE PRINT", "EL PRINT"),
    *("CONTACT FILE", "CONTACT PRINT", "SECTION PRINT", "FILE OUTPUT", "PHYSICAL CONSTANTS"),
    *("SURFACE BEHAVIOR", "SYSTEM", "MONITOR", "CONTROLS", "PRINT", "DATA CHECK", "INCLUDE"),
    *("ELEMENT PRINT", "ENERGY OUTPUT", "ENERGY FILE", "ENERGY PRINT", "SOLID SECTION", *SCOPES),
}
"""Keywords that say nothing of a limit load, or are taken elsewhere."""

NAMED_SUPPORTS = {"ENCASTRE": "123", "PINNED": "123", "XSYMM": "1", "YSYMM": "2", "ZSYMM": "3"}
"""Components that names of supports hold."""

AXES = "xyz"
UNIAXIAL, GRAVITY = "P", "GRAV"


@dataclass
class Made:
    """Statements on surfaces that share no facets.

    Attributes:
        surfaces: See :meth:`NamedSurfaces.divided`.
        held: Supports.
        pushed: Loads.
        joined: Contacts and ties.
        remarks: What could not be made of it.
    """

    surfaces: tuple[list[str], Longs, Longs, dict[str, list[str]]]
    held: list[Held] = field(default_factory=list)
    pushed: list[Pushed] = field(default_factory=list)
    joined: list[Joined] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


class Statements:
    """Takes keywords, and makes statements of them once the mesh is known.

    Attributes:
        sections: Element set and material of each section.
        materials: By name, in capitals.
        remarks: Keywords that have no counterpart.
    """

    def __init__(self) -> None:
        self.sections: list[tuple[str, str]] = []
        self.materials: dict[str, ForeignMaterial] = {}
        self._material = ""
        self._frictions: dict[str, float] = {}
        self._interaction = ""
        self._surfaces: list[Keyword] = []
        self._on_surfaces: list[Keyword] = []
        self._steps = 0
        self._unknown: Counter[str] = Counter()
        self._noted: list[str] = []

    @property
    def remarks(self) -> list[str]:
        """See the class."""
        told = [
            f"*{name} ({number} times) has no counterpart and is left out"
            if number > 1
            else f"*{name} has no counterpart and is left out"
            for name, number in self._unknown.items()
        ]
        if self._steps > 1:
            told.append(f"the loads of {self._steps} steps are taken together, and all grow with ζ")
        return self._noted + told

    def material_of(self, elset: str) -> str:
        """The material of a section."""
        return dict(self.sections).get(elset, "")

    def take(self, keyword: Keyword) -> None:
        """Take a keyword that is none of the mesh's."""
        name = keyword.name
        if name == "SOLID SECTION":
            self.sections.append((keyword.option("ELSET"), keyword.option("MATERIAL")))
        elif name == "MATERIAL":
            self._material = keyword.option("NAME")
            self.materials[self._material] = ForeignMaterial()
        elif name in ("ELASTIC", "PLASTIC", "DENSITY", "EXPANSION"):
            self._property(keyword)
        elif name == "SURFACE INTERACTION":
            self._interaction = keyword.option("NAME")
        elif name == "FRICTION":
            rows = keyword.rows()
            self._frictions[self._interaction] = float(rows[0][0]) if rows and rows[0] else 0.0
        elif name == "SURFACE":
            self._surfaces.append(keyword)
        elif name in ("BOUNDARY", "CLOAD", "DLOAD", "DSLOAD", "TIE", "CONTACT PAIR"):
            self._on_surfaces.append(keyword)
        elif name not in SILENT:
            self._unknown[name] += 1
        if name == "STEP":
            self._steps += 1

    def _property(self, keyword: Keyword) -> None:
        """A property of the last material."""
        now, rows = self.materials.get(self._material), [row for row in keyword.rows() if row]
        if now is None or not rows:
            raise InputError(f"line {keyword.number}: *{keyword.name} belongs to no *MATERIAL.")
        try:
            values = [[float(cell) for cell in row] for row in rows]
        except ValueError as error:
            raise InputError(
                f"line {keyword.number}: *{keyword.name} has what is no number ({error})."
            ) from error
        if keyword.name == "ELASTIC":
            kind = keyword.option("TYPE", "ISOTROPIC")
            if kind not in ("ISO", "ISOTROPIC") or len(values[0]) < 2:
                self._noted.append(
                    f"*ELASTIC of '{self._material}' is {kind.lower()}, which the program does not"
                    " know: its body has no material yet"
                )
                return
            now = replace(now, young=values[0][0], poisson=values[0][1])
        elif keyword.name == "PLASTIC":
            stresses = [row[0] for row in values]
            now = replace(now, yield_stress=stresses[0])
            if len(values) > 1 and any(stress != stresses[0] for stress in stresses):
                self._noted.append(
                    f"*PLASTIC of '{self._material}' has {len(values)} points: its first yield"
                    f" stress {stresses[0]:g} is taken without hardening, as limit loads want it"
                )
        elif keyword.name == "DENSITY":
            now = replace(now, density=values[0][0])
        else:
            now = replace(now, expansion=values[0][0])
        self.materials[self._material] = now

    def made(
        self, assembly: Assembly, surfaces: InpSurfaces, bodies: list[str], dim: int
    ) -> Made:
        """Statements on surfaces and bodies.

        Args:
            assembly: The mesh.
            surfaces: Finds facets.
            bodies: Element sets of the bodies.
            dim: 3, or 2 in the plane.
        """
        return _Maker(self, assembly, surfaces, bodies, dim).made(
            self._surfaces, self._on_surfaces, self._frictions
        )


class _Maker:
    def __init__(
        self,
        statements: Statements,
        assembly: Assembly,
        surfaces: InpSurfaces,
        bodies: list[str],
        dim: int,
    ) -> None:
        self._statements, self._assembly, self._find = statements, assembly, surfaces
        self._bodies, self._dim = bodies, dim
        self._named = NamedSurfaces()
        self._facets: dict[str, Longs] = {}
        self._remarks: list[str] = []
        self._used: set[str] = set()

    def made(
        self, surfaces: list[Keyword], on: list[Keyword], frictions: dict[str, float]
    ) -> Made:
        """Find the surfaces of all statements, then divide those that overlap."""
        for keyword in surfaces:
            self._surface(keyword)
        held: list[Held] = []
        pushed: list[Pushed] = []
        joined: list[Joined] = []
        for keyword in on:
            if keyword.name == "BOUNDARY":
                held += self._boundary(keyword)
            elif keyword.name in ("TIE", "CONTACT PAIR"):
                joined += self._pairs(keyword, frictions)
            elif keyword.name == "CLOAD":
                pushed += self._nodal(keyword)
            else:
                pushed += self._distributed(keyword)
        divided = self._named.divided(self._used)
        stands = divided[3]
        bodies = dict(zip(self._bodies, unique_names(self._bodies), strict=True))
        found = Made(divided, remarks=self._remarks)
        for one in held:
            found.held += [replace(one, on=name) for name in stands[one.on]]
        for load in pushed:
            if load.kind == "body_force":
                found.pushed.append(replace(load, on=bodies[load.on]))
            else:
                found.pushed += [replace(load, on=name) for name in stands[load.on]]
        for pair in joined:
            for a in stands[pair.primary]:
                for b in stands[pair.secondary]:
                    found.joined.append(replace(pair, primary=a, secondary=b))
        found.held = list(dict.fromkeys(found.held))
        return found

    def _surface(self, keyword: Keyword) -> None:
        """A surface by its name."""
        name, facets = keyword.option("NAME"), np.zeros(0, dtype=np.int64)
        for row in keyword.rows():
            kind = "NSET" if keyword.option("TYPE") == "NODE" else "ELSET"
            members = self._members(kind, row[0]) if row else None
            if members is None:
                self._remarks.append(f"*SURFACE '{name}' names the set '{row[:1]}', which is not there")
                continue
            if kind == "NSET":
                found = self._find.of_nodes(members)
            elif self._is_flat(members):
                found = self._find.of_flat_elements(members)
            else:
                found = self._find.of_faces(members, row[1].upper() if len(row) > 1 else "")
            facets = np.union1d(facets, found)
        self._facets[name] = facets

    def _members(self, kind: str, name: str) -> Longs | None:
        return self._assembly.members(kind, name)

    def _is_flat(self, elements: Longs) -> bool:
        """Whether the elements of a set are those of surfaces."""
        blocks = [b for b in self._assembly.blocks if b.kind.shape.dim == self._dim]
        solid = [np.arange(b.first, b.first + len(b.nodes)) for b in blocks]
        return not np.isin(elements, np.concatenate(solid)).any()

    def _use(self, name: str, facets: Longs) -> str:
        self._named.add(name, facets)
        self._used.add(name)
        return name

    def _of_nodes(self, name: str, what: str) -> str | None:
        """A set of nodes as a surface, if it is one."""
        nodes = self._members("NSET", name)
        if nodes is None:
            self._remarks.append(f"{what} on '{name}', which is no set of nodes, is left out")
            return None
        facets = self._find.of_nodes(nodes)
        if not self._find.covered(nodes, facets):
            self._remarks.append(
                f"{what} on the {len(nodes)} nodes of '{name}', which are no surface, is left out;"
                " give it to a set that has all nodes of some outer faces"
            )
            return None
        return self._use(name, facets)

    def _boundary(self, keyword: Keyword) -> list[Held]:
        found: dict[tuple[str, float], set[str]] = {}
        single: dict[tuple[str, float], list[Longs]] = {}
        for row in keyword.rows():
            if len(row) < 2:
                continue
            first = row[1].upper()
            axes = NAMED_SUPPORTS.get(first)
            if axes is None:
                last = row[2] if len(row) > 2 and row[2] else row[1]
                if not (row[1].isdigit() and last.isdigit()):
                    self._remarks.append(f"*BOUNDARY '{', '.join(row)}' is not understood")
                    continue
                axes = "".join(str(k) for k in range(int(row[1]), int(last) + 1))
            here = {AXES[int(k) - 1] for k in axes if k in "123"[: self._dim]}
            value = float(row[3]) if len(row) > 3 and row[3] else 0.0
            if here and row[0].rpartition(".")[2].isdigit():
                node = self._members("NSET", row[0])
                for axis in here if node is not None else ():
                    single.setdefault((axis, value), []).append(node)  # type: ignore[arg-type]
            elif here:
                found.setdefault((row[0].upper(), value), set()).update(here)
        for (axis, value), nodes in single.items():
            name = f"HELD_{axis.upper()}{'' if value == 0 else f'_{value:g}'}"
            self._assembly.sets["NSET", name] = np.unique(np.concatenate(nodes))
            found[name, value] = {axis}
        held = []
        for (name, value), some in found.items():
            on = self._of_nodes(name, "*BOUNDARY")
            if on is not None:
                held.append(Held(on, "".join(sorted(some)), value))
        return held

    def _nodal(self, keyword: Keyword) -> list[Pushed]:
        forces: dict[str, list[float]] = {}
        for row in keyword.rows():
            if len(row) < 3 or not row[1].isdigit() or not 1 <= int(row[1]) <= self._dim:
                self._remarks.append(f"*CLOAD '{', '.join(row)}' is no force along an axis: left out")
                continue
            nodes = self._members("NSET", row[0])
            count = 0 if nodes is None else len(nodes)
            forces.setdefault(row[0].upper(), [0.0] * self._dim)[int(row[1]) - 1] += count * float(row[2])
        pushed = []
        for name, force in forces.items():
            on = self._of_nodes(name, "*CLOAD")
            if on is None:
                continue
            area = float(self._find.areas(self._find.of_nodes(self._members("NSET", name))).sum())  # type: ignore[arg-type]
            self._remarks.append(
                f"forces at the nodes of '{name}', {_vector(force)} in all, are taken as a uniform"
                " traction with this resultant"
            )
            traction = tuple(component / area for component in force)
            pushed.append(Pushed(on, "traction", traction, f"{_vector(force)} in all"))
        return pushed

    def _distributed(self, keyword: Keyword) -> list[Pushed]:
        pushed = []
        for row in keyword.rows():
            if len(row) < 3:
                continue
            name, kind = row[0].upper(), row[1].upper()
            if kind == GRAVITY and len(row) >= 6:
                pushed += self._weight(name, [float(cell) for cell in row[2:6]])
                continue
            if keyword.name == "DSLOAD" and kind == UNIAXIAL:
                on = self._surface_named(name, "*DSLOAD")
            elif keyword.name == "DLOAD" and kind[:1] == UNIAXIAL and kind[1:].isdigit():
                on = self._pressed(name, kind)
            else:
                on = None
                self._remarks.append(f"*{keyword.name} '{', '.join(row)}' is not understood: left out")
            if on is not None:
                pushed.append(Pushed(on, "pressure", float(row[2])))
        return pushed

    def _pressed(self, elset: str, face: str) -> str | None:
        members = self._members("ELSET", elset)
        facets = None if members is None else self._find.of_faces(members, face)
        if facets is None or not len(facets):
            self._remarks.append(f"*DLOAD {face} on '{elset}' presses no outer face: left out")
            return None
        return self._use(f"{elset}_{face}", facets)

    def _weight(self, elset: str, given: list[float]) -> list[Pushed]:
        """Gravity of a set that is a body, or has whole bodies."""
        size, direction = given[0], np.array(given[1:4])
        members = self._members("ELSET", elset)
        found = []
        for body in self._bodies:
            own = self._members("ELSET", body)
            if members is None or own is None or not np.isin(own, members).all():
                continue
            density = self._statements.materials.get(self._statements.material_of(body))
            if density is None or density.density is None:
                self._remarks.append(f"gravity on '{body}' wants *DENSITY of its material: left out")
                continue
            force = tuple(float(x) for x in size * density.density * direction[: self._dim])
            found.append(Pushed(body, "body_force", force, "gravity times density"))
        if not found:
            self._remarks.append(f"gravity on '{elset}', which has no whole body, is left out")
        return found

    def _surface_named(self, name: str, what: str) -> str | None:
        facets = self._facets.get(name.upper())
        if facets is None or not len(facets):
            why = "which is not there" if facets is None else "which has no outer face"
            self._remarks.append(f"{what} on the surface '{name}', {why}, is left out")
            return None
        return self._use(name.upper(), facets)

    def _pairs(self, keyword: Keyword, frictions: dict[str, float]) -> list[Joined]:
        tied = keyword.name == "TIE"
        joined = []
        for row in keyword.rows():
            if len(row) < 2:
                self._remarks.append(f"*{keyword.name} '{', '.join(row)}' wants two surfaces: left out")
                continue
            one, other = (self._surface_named(name, f"*{keyword.name}") for name in row[:2])
            if one is None or other is None:
                continue
            mu = 0.0 if tied else frictions.get(keyword.option("INTERACTION"), 0.0)
            if mu:
                self._remarks.append(
                    f"friction {mu:g} of '{one}' and '{other}' is in the case as a comment: no"
                    " limit theorem holds with Coulomb's friction"
                )
            joined.append(Joined(one, other, tied, mu))
        return joined


def _vector(values: list[float]) -> str:
    return f"({', '.join(f'{value:.6g}' for value in values)})"
