"""Describe a case before it is solved: its loads, supports, contacts and faces, with sizes."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import geometry_dofmap
from perfplast_fenicsx.geometry.first_case import are_bolt_and_nut
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.io.case.load_table import load_in_words
from perfplast_fenicsx.limit_analysis.discrete.strength_reduction import (
    divided_strengths,
    kept_strengths,
)
from perfplast_fenicsx.materials.elastic import ElasticLaw, all_elastic
from perfplast_fenicsx.problem.declared.loads import Load, kind_of
from perfplast_fenicsx.problem.declared.supports import RigidSurface, Support
from perfplast_fenicsx.problem.judged.left_motions import (
    HeldAgainst,
    held_against,
    left_motions,
)
from perfplast_fenicsx.problem.judged.resultants import LoadResultant, sized_resultants
from perfplast_fenicsx.problem.judged.sides import Cover, Sides, find_sides
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import ROUNDING
from perfplast_fenicsx.seepage.flow import flow_of

MOST = 6
"""Largest number of sides or names in a list; for the rest only the number is printed."""

ALIKE = 3
"""Number of supports that hold the same components from which they share one line."""

DRAWN = 1e-9
"""Relative difference up to which the areas of a surface in mesh and drawing count as equal."""


@dataclass
class Marked:
    """A surface that the picture of a case marks.

    Attributes:
        roles: Its roles in the case: "load", "support", "contact", "tie", "obstacle", "rigid".
        words: Texts for the legend; they do not mention the covered part of a side.
        part: The part of a side that the surface covers, in words; "" if it covers whole sides.
        force: Resultants of the loads on the surface (force), each of shape (gdim,).
    """

    roles: list[str] = field(default_factory=list)
    words: list[str] = field(default_factory=list)
    part: str = ""
    force: list[Floats] = field(default_factory=list)


@dataclass(frozen=True)
class Understood:
    """A description of a case, as the program has read it.

    Attributes:
        lines: Lines of text for a terminal.
        sides: The sides of the bodies.
        marked: The surfaces that the case names, in the order of the case.
    """

    lines: list[str]
    sides: Sides
    marked: dict[str, Marked]


def understood(case: Case, problem: Problem) -> Understood | None:
    """Return the description of a case on rank 0, and None on other ranks. Collective."""
    resultants = sized_resultants(problem)
    single, together = left_motions(problem)
    volumes = _volumes(problem)
    elastic = [name for name, one in case.materials.items() if issubclass(one.law, ElasticLaw)]
    gaps, against = _gaps(problem), held_against(problem, elastic)
    sides = find_sides(problem)
    if sides is None:
        return None
    told = _Told(case, problem, sides)
    told.loads(resultants, volumes)
    told.water()
    told.supports(single, together)
    told.interfaces(gaps, against)
    told.strengths()
    told.rest(volumes)
    return Understood(told.lines, sides, told.marked)


class _Told:
    """Describes a case in lines of text, and stores the surfaces that the case names."""

    def __init__(self, case: Case, problem: Problem, sides: Sides) -> None:
        self.case, self.problem, self.sides = case, problem, sides
        self.whole = problem.kinematics.whole
        self.units = case.units.table(self.whole)
        self._flat = problem.bodies.gdim == 2 and not problem.tagged_mesh.axisymmetric
        self.lines: list[str] = []
        self.marked: dict[str, Marked] = {}
        self.glued: list[str] = []

    def loads(
        self, resultants: Sequence[tuple[LoadResultant, float]], volumes: dict[str, float]
    ) -> None:
        """Add the lines on each load: surface, size and resultant."""
        if not self.case.loads:
            self.lines.append("Loads: none")
            return
        own = self.case.stages or not self.case.loading.together
        self.lines.append(f"Loads at {'a factor of 1' if own else 'zeta = 1'}:")
        both = zip(self.case.loads, resultants, strict=True)
        for number, (load, (found, total)) in enumerate(both):
            words = load_in_words(load, self.case.units, self.whole)
            solid = "volume" if self.whole else "area"
            size = f"{solid} {_number(volumes[load.on])}" if load.in_volume else self._area(load.on)
            told = f"{found.name}: {words}; {size}; {self._resultant(load, found, total)}"
            if load.constant:
                told += "; at any load factor"
            if load.in_volume:
                self.lines.append(f"  {told}")
                continue
            self._told(told, [load.on], "load", words)
            self.marked[load.on].force.append(np.array(found.force))
            if shared := self._shared(load, self.case.loads[:number]):
                self.lines.append(f"    acts together with {shared}")
            if held := self._held_on(load.on, np.abs(found.force) > ROUNDING * total):
                self.lines.append(
                    f"    a support holds {held} of this surface, so these "
                    "components of the load do no work"
                )

    def water(self) -> None:
        """Add lines on the inflow and outflow of water and on the largest pore pressure."""
        flow = flow_of(self.problem.given.loads)
        if flow is None:
            return
        unit = self.units["stress"]
        most = f"{_number(flow.pressures.max())}{f' {unit}' if unit else ''}"
        self.lines.append(
            f"Water: largest pore pressure {most}; {flow.iterations} iterations of SNES-VI"
        )
        if flow.uncertainty is not None:
            apart = f"{_number(flow.uncertainty)}{f' {unit}' if unit else ''}"
            self.lines.append(f"  with edges half as long, pressures differ by at most {apart}")
        for name, discharge in flow.discharges.items():
            way = "enters" if discharge > 0 else "leaves"
            volume = f"{_number(abs(discharge))} {self.units['volume']}".rstrip()
            told = f"{volume} {way} per unit of time"
            if not discharge:
                told = "no water passes"
            self.lines.append(f"  {name}: {told}")

    def supports(self, single: Sequence[list[str]], together: list[str]) -> None:
        """Add lines on supports and rigid surfaces: places, components, remaining rigid motions."""
        holding = self.problem.given.holding
        self.lines.append("Supports:" if holding else "Supports: none")
        what = [self._held_by(support) for support in holding]
        motions = ["; ".join(left) if left else "no rigid motion" for left in single]
        alike: dict[tuple[str, str], list[int]] = {}
        for number, support in enumerate(holding):
            if isinstance(support, Support) and not support.moves and not support.name:
                alike.setdefault((what[number], motions[number]), []).append(number)
        groups = {one: same for same in alike.values() if len(same) >= ALIKE for one in same}
        for number, support in enumerate(holding):
            same = groups.get(number, [])
            if number in same[:1]:
                self._alike([holding[one].on for one in same], what[number], motions[number])
            if same:
                continue
            verb = f"{'moves' if support.moves else 'holds'} {what[number]}"
            name = support.name or support.on
            words = verb + (f" of '{support.on}'" if name != support.on else "")
            line = f"{name}: {words}; {self._area(support.on)}; leaves {motions[number]}"
            role = "rigid" if isinstance(support, RigidSurface) else "support"
            self._told(line, [support.on], role, verb)
        for surface in self.case.rigid:
            if surface.free and not surface.held:
                told = f"{surface.name or surface.on}: '{surface.on}' moves as one rigid surface"
                self._told(f"{told}; {self._area(surface.on)}", [surface.on], "rigid", "rigid")
        if together and (len(holding), self.problem.bodies.count) != (1, 1):
            self.lines.append(f"  all supports together leave {'; '.join(together)}")
        if together and self.case.contacts:
            pairs = [(contact.primary, contact.secondary) for contact in self.case.contacts]
            bolts = "; perfplast mesh --bolted does so for bolts and nuts"
            self.lines.append(
                "    contact stops motions in one direction only: unless loads press the surfaces "
                "together, glue a joint ([[tie]] instead of [[contact]]), or add a support"
                + (bolts if any(are_bolt_and_nut(*pair) for pair in pairs) else "")
            )

    def interfaces(
        self, gaps: dict[str, tuple[int, float, float]], against: Sequence[HeldAgainst]
    ) -> None:
        """Add lines on contacts, obstacles and ties: areas, gaps of pairs of nodes, friction."""
        contacts, ties = self.case.contacts, self.problem.given.ties
        if contacts or self.case.obstacles:
            self.lines.append("Contacts:")
        for contact in contacts:
            both = (contact.primary, contact.secondary)
            found = gaps.get(contact.label)
            sizes = self._sizes(both)
            rubs = _friction(contact.tresca, contact.coulomb)
            self.lines.append(f"  '{both[0]}' and '{both[1]}': {sizes}; {self._gap(found)}; {rubs}")
            self._mark(both, "contact", f"contact of '{both[0]}' and '{both[1]}'")
            for one in against:
                if (one.surface, one.other) in (both, both[::-1]):
                    self.lines.append(f"    {_held(one)}")
        for obstacle in self.case.obstacles:
            found = gaps.get(f"obstacle {obstacle.name or obstacle.on}")
            rubs = _friction(obstacle.tresca, obstacle.coulomb)
            shape = type(obstacle).__name__.lower()
            self.lines.append(
                f"  '{obstacle.on}' and a rigid {shape}: {self._area(obstacle.on)};"
                f" {self._gap(found)}; {rubs}"
            )
            self._mark([obstacle.on], "obstacle", f"rigid {shape}")
        if ties:
            self.lines.append("Ties:")
        for tie in ties:
            both = (tie.primary, tie.secondary)
            sizes = self._sizes(both)
            told = "" if tie in self.case.ties else "; the drawing has one face for both"
            self.lines.append(f"  '{both[0]}' and '{both[1]}': {sizes}{told}")
            if told:
                self.glued += both
            else:
                self._mark(both, "tie", f"tie of '{both[0]}' and '{both[1]}'")

    def strengths(self) -> None:
        """Add a line if no body can yield, and lines on the strengths that F divides or keeps."""
        case = self.case
        rubbing = [*case.contacts, *case.obstacles]
        if case.loading.of_body and all_elastic(case.materials.values()):
            self.lines.append(
                "No body can yield: only contacts and obstacles can limit the load, and if they do "
                "not, the run ends without a limit load (exit status 3)."
            )
        if not case.loading.divides:
            return
        weaker = divided_strengths(case.materials, rubbing)
        self.lines.append(f"F divides: {_few(weaker)}")
        if kept := kept_strengths(case.materials, rubbing):
            self.lines.append(f"F does not divide (reduced = false): {_few(kept)}")

    def rest(self, volumes: dict[str, float]) -> None:
        """Add lines on surfaces that the case does not name, and on bodies without a load."""
        areas, of_tags = self.sides.area_of_tags(), self.sides.names_of_tags()
        used = self.problem.tagged_mesh.tags_of([*self.marked, *self.glued])
        free: dict[str, float] = {}
        for tag, name in self.sides.names_of_all(of_tags.keys() - set(used)).items():
            free[name] = free.get(name, 0.0) + areas.get(tag, 0.0)
        parts = [f"'{name}' ({_number(area)})" for name, area in sorted(free.items()) if area]
        unnamed = sum(area for tag, area in areas.items() if tag not in of_tags)
        if unnamed > ROUNDING * sum(areas.values()):
            parts.append(f"{_number(unnamed)} without a name")
        what = "length" if self._flat else "area"
        self.lines.append(f"Not named by the case ({what}): {_few(parts) or 'nothing'}")
        loaded = {load.on for load in self.case.loads if load.in_volume}
        named = self.problem.free.names
        touched = self._bodies_of({load.on for load in self.case.loads if not load.in_volume})
        for number, name in enumerate(named):
            if any(f"'{volume}'" in name for volume in loaded):
                touched.add(number)
        resting = [name for number, name in enumerate(named) if number not in touched]
        if resting and self.case.loads:
            self.lines.append(f"No load acts on {_few(resting)}")

    def _bodies_of(self, names: Iterable[str]) -> set[int]:
        found: set[int] = set()
        for name in names:
            found |= {int(body) for body in np.unique(self.sides.facets.body[self.sides.on(name)])}
        return found

    def _held_by(self, support: Support | RigidSurface) -> str:
        """Return the components that a support holds or moves, in words."""
        if isinstance(support, Support) and support.guides:
            out = f", by {support.value} out of the body" if support.moves else ""
            return f"the normal component{out}"
        axes = self.problem.kinematics.axes
        return ", ".join(axes[number] for number in support.axes(self.problem.bodies.gdim))

    def _alike(self, names: Sequence[str], what: str, motions: str) -> None:
        """Add lines on supports that hold the same components and leave the same motions."""
        line = f"{len(names)} supports: each holds {what}; total {self._area(*names)}"
        self._told(f"{line}; each leaves {motions}", names, "support", f"holds {what}")
        stem = _stem(names)
        by_size: dict[str, list[str]] = {}
        for name in names:
            by_size.setdefault(self._area(name), []).append(name.removeprefix(stem))
        where = f"{stem}... " if stem else ""
        self.lines += [f"    {size}: {where}{', '.join(own)}" for size, own in by_size.items()]

    def _told(self, line: str, names: Sequence[str], role: str, words: str) -> None:
        """Add a line on surfaces, with the sides that the surfaces cover together."""
        parts, all_of = self._covered(*names)
        if all_of:
            of = [f"{side} of {_few(sorted(bodies))}" for side, bodies in sorted(all_of.items())]
            line += f"; all of {_few(of)}"
        if not all_of and not parts:
            line += "; inside a body, not on an outer face"
        self.lines.append(f"  {line}")
        self.lines += [f"    only a part: {part}" for part in parts[:MOST]]
        if len(parts) > MOST:
            self.lines.append(f"    and parts of {len(parts) - MOST} more sides")
        self._mark(names, role, words)
        for name in names:
            if own := self._covered(name)[0]:
                self.marked[name].part = own[0] + (" ..." if len(own) > 1 else "")

    def _covered(self, *names: str) -> tuple[list[str], dict[str, set[str]]]:
        """Return sides that surfaces cover partly, in words, and bodies of sides covered whole."""
        parts, all_of = [], dict[str, set[str]]()
        for cover in self.sides.covers(*names):
            body = self.problem.free.names[cover.side.body]
            if cover.whole:
                all_of.setdefault(cover.side.words, set()).add(body)
            else:
                parts.append(_part(cover, f"{cover.side.words} of {body}"))
        return parts, all_of

    def _mark(self, names: Iterable[str], role: str, words: str) -> None:
        for name in names:
            mark = self.marked.setdefault(name, Marked())
            mark.roles.append(role)
            mark.words.append(words)

    def _shared(self, load: Load, others: Sequence[Load]) -> str:
        """Return the loads of the same kind that share faces with a load, in words."""
        own, found = set(self.problem.tagged_mesh.tags_of([load.on])), []
        for other in others:
            alike = kind_of(other) == kind_of(load) and other.constant == load.constant
            if other.in_volume or not alike:
                continue
            common = own & {*self.problem.tagged_mesh.tags_of([other.on])}
            area = self.sides.facets.area[np.isin(self.sides.facets.tag, sorted(common))].sum()
            if common:
                words = load_in_words(other, self.case.units, self.whole)
                what = "length" if self._flat else "area"
                found.append(f"{words}, on a common {what} of {_number(float(area))}")
        return "; ".join(found)

    def _held_on(self, name: str, pushed: npt.NDArray[np.bool_]) -> str:
        """Return the axes along which a load pushes a surface and a support holds it, in words."""
        gdim, axes = self.problem.bodies.gdim, self.problem.kinematics.axes
        held = {
            number
            for support in self.problem.given.holding
            if support.on == name
            for number in support.axes(gdim)
            if pushed[number]
        }
        return ", ".join(axes[number] for number in sorted(held))

    def _area(self, *names: str) -> str:
        unit = self.units["length"]
        unit = f" {unit}{'' if self._flat else '^2'}" if unit else ""
        return f"{'length' if self._flat else 'area'} {self._size(*names, unit=unit)}"

    def _sizes(self, names: Sequence[str]) -> str:
        """Return the areas, or in the plane the lengths, of surfaces in words."""
        sizes = " and ".join(self._size(name) for name in names)
        return f"{'lengths' if self._flat else 'areas'} {sizes}"

    def _size(self, *names: str, unit: str = "") -> str:
        """Return the total area of surfaces in words, and in the drawing if the two differ."""
        area, known = self.sides.area(*names), self.problem.tagged_mesh.drawn
        apart = abs(sum(map(self.sides.area, names)) - area) <= DRAWN * area
        drawn = sum(known[one] for one in names) if apart and known.keys() >= {*names} else 0.0
        told = f"{_number(area)}{unit}"
        if drawn and abs(area / drawn - 1) > DRAWN:
            told += f" ({_number(drawn)} in the drawing, {100 * (area / drawn - 1):+.2g} %)"
        return told

    def _gap(self, found: tuple[int, float, float] | None) -> str:
        if found is None or not found[0]:
            return "no pairs of nodes"
        count, low, high = found
        small = ROUNDING * self.problem.bodies.size
        low, high = (0.0 if abs(gap) <= small else gap for gap in (low, high))
        if low == high == 0:
            where = "touching"
        elif high - low <= small:
            where = f"gap {_number(low)}" if low > 0 else f"overlap {_number(-low)}"
        else:
            where = f"gap from {_number(low)} to {_number(high)}"
        return f"{count} pairs of nodes, {where}"

    def _resultant(self, load: Load, found: LoadResultant, total: float) -> str:
        """Return a load's force in words, with its moment about the surface's centroid.

        Args:
            load: The load.
            found: The resultant of the load.
            total: Sum of the magnitudes of the load's nodal forces. Components that are rounding
                errors relative to this sum are shown as 0.
        """
        force, unit = np.array(found.force), self.units["force"]
        size = self.problem.bodies.size
        told = f"force {_vector(force, total)}{f' {unit}' if unit else ''}"
        if load.in_volume or not found.moment:
            return told
        own = self.sides.on(load.on)
        area = self.sides.facets.area[own]
        if not area.sum() > 0:
            return told
        middle = area @ self.sides.facets.x[own].mean(axis=1) / area.sum()
        moment = np.array(found.moment) - np.atleast_1d(_cross(middle, force))
        small = 1e-6  # moments below this fraction of their largest possible value are not printed
        if np.abs(moment).max() > small * total * size:
            shown = moment * self.case.units.moment_scale(self.whole)
            unit = self.units["moment"]
            words = _vector(shown, total * size)
            told += f", moment about its centroid {words}{f' {unit}' if unit else ''}"
        return told


def _part(cover: Cover, where: str) -> str:
    """Return the part of a side that a surface covers, and the names on the rest, in words."""
    side = cover.side
    share = cover.area / side.area
    rest = [
        f"{repr(name) if name else 'without a name'} ({_number(area)})"
        for name, area in sorted(cover.rest.items())
    ]
    pieces = f", {cover.pieces} of its {side.pieces} faces" if side.pieces > 1 else ""
    return (
        f"{100 * share:.3g} % of {where}{pieces} ({_number(cover.area)} of {_number(side.area)});"
        f" the rest is {_few(rest)}"
    )


def _stem(names: Sequence[str]) -> str:
    """Return the words, up to an underscore, with which all names begin; "" if there are none."""
    first, last = min(names), max(names)
    alike = next((k for k in range(len(first)) if first[k : k + 1] != last[k : k + 1]), len(first))
    stem = first[: first.rfind("_", 0, alike) + 1]
    return "" if stem in names else stem


def _few(words: Sequence[str]) -> str:
    """Return a list as text; after the first entries only the number of the others is given."""
    shown = words if len(words) <= MOST + 1 else [*words[:MOST], f"{len(words) - MOST} more"]
    return ", ".join(shown)


def _held(one: HeldAgainst) -> str:
    """Return a remark on a support that holds nodes in contact along the normal, with a remedy."""
    return (
        f"{_few(one.by)} holds {one.held} of the {one.nodes} nodes of '{one.surface}' along the "
        f"normal, but does not hold '{one.other}': an elastic or rigid body cannot be pushed into "
        "these nodes; end the support before the contact, or hold other components"
    )


def _friction(tresca: float | None, coulomb: float | None) -> str:
    told = [f"adhesion {_number(tresca)}"] if tresca else []
    told += [f"friction {_number(coulomb)}"] if coulomb else []
    return " and ".join(told) or "no friction"


def _cross(arm: Floats, force: Floats) -> Floats:
    if len(arm) == 2:
        return np.array([arm[0] * force[1] - arm[1] * force[0]])
    return np.asarray(np.cross(arm, force), dtype=np.float64)


def _number(value: float) -> str:
    return f"{value:.5g}"


def _vector(values: Floats, most: float) -> str:
    """Return components in brackets, with rounding errors (relative to ``most``) as 0."""
    shown = np.where(np.abs(values) <= ROUNDING * most, 0.0, values)
    return f"({', '.join(_number(float(one)) for one in shown)})"


def _volumes(problem: Problem) -> dict[str, float]:
    """Return the volume (in the plane the area) of each named body. Collective."""
    tagged_mesh = problem.tagged_mesh
    mesh, tags, dim = tagged_mesh.mesh, tagged_mesh.cell_tags, tagged_mesh.mesh.topology.dim
    owned = tags.indices < mesh.topology.index_map(dim).size_local
    x = mesh.geometry.x[geometry_dofmap(mesh)[tags.indices[owned], : dim + 1], :dim]
    size = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / (2 if dim == 2 else 6)
    size = size * problem.kinematics.around(x.mean(axis=1))
    sums = [size[tags.values[owned] == tag].sum() for tag in tagged_mesh.volumes.values()]
    total = problem.comm.allreduce(np.array(sums, dtype=np.float64))
    return dict(zip(tagged_mesh.volumes, total.tolist(), strict=True))


def _gaps(problem: Problem) -> dict[str, tuple[int, float, float]]:
    """Return the number of pairs and the range of gaps of each contact and obstacle. Collective."""
    rows, found = problem.constraints, {}
    for number, source in enumerate(rows.sources):
        gap = rows.gap[rows.surface == number]
        count = problem.comm.allreduce(len(gap))
        low = problem.comm.allreduce(float(gap.min(initial=np.inf)), MPI.MIN)
        high = problem.comm.allreduce(float(gap.max(initial=-np.inf)), MPI.MAX)
        found[source.name] = (count, low, high)
    return found
