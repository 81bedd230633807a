"""Turn supports, loads, contact and ties of an ``.inp`` file into ones on disjoint surfaces."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.models.element_facets import ElementFacets
from perfplast_fenicsx.models.foreign_model import Held, Joined, Pushed
from perfplast_fenicsx.models.inp_keywords import Keyword, number_of
from perfplast_fenicsx.models.inp_mesh import Assembly
from perfplast_fenicsx.models.inp_statements import LOADS
from perfplast_fenicsx.models.inp_used_surfaces import UsedSurfaces, missing

NAMED_SUPPORTS = {"ENCASTRE": "123", "PINNED": "123", "XSYMM": "1", "YSYMM": "2", "ZSYMM": "3"}
"""Components that named supports hold."""

AXES = "xyz"


@dataclass(frozen=True, eq=False)
class InpBody:
    """A body.

    Attributes:
        name: Name in the case.
        material: Name of the material, "" without one.
        elements: Numbers of its elements.
        density: Mass per volume; None if it is not known.
    """

    name: str
    material: str
    elements: Longs
    density: float | None


@dataclass
class Made:
    """Supports, loads and joints on surfaces that share no facets.

    Attributes:
        surfaces: See :meth:`NamedSurfaces.divided`.
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
    """Find the surfaces of statements, and divide those that overlap."""

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
            surfaces: Search of facets.
            bodies: Bodies with their elements and densities.
            dim: Dimension: 3, or 2 in the plane.
            thickness: Thickness of elements in the plane, over which forces at nodes are
                distributed.
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
            on: Keywords of supports, loads, contact and ties.
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
                    self._remarks.append(f"*BOUNDARY '{', '.join(row)}' is not understood")
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
        """Return forces at nodes: on sets that are surfaces, and together on all other nodes."""
        forces: dict[str, list[float]] = {}
        rest: dict[str, list[Longs]] = {}
        for row in keyword.rows():
            if len(row) < 3 or not row[1].isdigit() or not 1 <= int(row[1]) <= self._dim:
                self._remarks.append(
                    f"*CLOAD '{', '.join(row)}' is no force along an axis, and is left out"
                )
                continue
            nodes, axis = self._assembly.members("NSET", row[0]), int(row[1]) - 1
            if nodes is None:
                raise missing("*CLOAD", row[0])
            if not len(nodes):
                self._remarks.append(f"*CLOAD on '{row[0]}', which is empty, is left out")
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
                f"forces at the nodes of '{name}', {_vector(force)} in all, are taken as a uniform"
                " traction with this resultant"
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
                    f"*{keyword.name} '{', '.join(row)}' is not understood: left out"
                )
            if on is not None:
                load = Pushed(on, "pressure", number_of(row[2], keyword))
                pushed += [] if name.isdigit() and load in pushed else [load]
        return pushed

    def _pressed(self, elset: str, face: str, pressure: float) -> str | None:
        """Return the surface of a pressure; single elements with the same pressure share one."""
        members = self._assembly.members("ELSET", elset)
        if members is None:
            raise missing(f"*DLOAD {face}", elset)
        facets = self._find.of_faces(members, face)
        if not len(facets):
            self._remarks.append(f"*DLOAD {face} on '{elset}' presses no outer face: left out")
            return None
        name = f"PRESSED_BY_{pressure:g}" if elset.isdigit() else f"{elset}_{face}"
        return self._use.use(name, facets)

    def _weight(self, elset: str, given: list[float]) -> list[Pushed]:
        """Return the gravity loads of a set, for the bodies that it contains completely."""
        size, direction = given[0], given[1 : 1 + self._dim]
        members = self._assembly.members("ELSET", elset)
        found = []
        for body in self._bodies:
            if members is None or not np.isin(body.elements, members).all():
                continue
            if body.density is None:
                self._remarks.append(
                    f"gravity on '{body.name}' needs a *DENSITY of its material, and is left out"
                )
                continue
            force = tuple(size * body.density * x for x in direction)
            found.append(Pushed(body.name, "body_force", force, "gravity times density"))
        if not found:
            self._remarks.append(f"gravity on '{elset}', which has no whole body, is left out")
        return found

    def _pairs(self, keyword: Keyword, frictions: dict[str, float]) -> list[Joined]:
        tied = keyword.name == "TIE"
        joined = []
        for row in keyword.rows():
            if len(row) < 2:
                self._remarks.append(
                    f"*{keyword.name} '{', '.join(row)}' needs two surfaces: left out"
                )
                continue
            one, other = (self._use.named(name, f"*{keyword.name}") for name in row[:2])
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
