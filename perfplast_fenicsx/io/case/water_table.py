"""Read ``[water]``: pore pressure, pressure of open water on the ground, and saturated weight."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError, nearest, place_of
from perfplast_fenicsx.formulas import LONGEST, WordedFormula
from perfplast_fenicsx.geometry.drawn_ground import DrawnGround, points_of
from perfplast_fenicsx.io.case.gravity_table import GravityTable
from perfplast_fenicsx.io.case.schema import at, convert
from perfplast_fenicsx.io.case.tables import Document
from perfplast_fenicsx.problem.declared.loads import ForceBelow, Load, PorePressure, Pressure
from perfplast_fenicsx.units import Units

NAME = "water"
"""Name of all loads from water, for messages and stages."""

NEWTONS = 9810.0
"""Unit weight of water (N/m³)."""


MOST_WATER = 3.0
"""Largest plausible ratio of the density of saturated ground to the density of the same ground
above the water table. Above this ratio, the two numbers have different units, such as a weight and
a mass."""


@dataclass(frozen=True)
class WaterTable:
    """Water in the pores of ground and above the ground.

    Below the water table the pore pressure is the unit weight of water times the vertical depth;
    above the table the pressure is zero. Where the table is above the surface of drawn ground, the
    water presses on the surface. The mesh of drawn ground has edges along the table and below the
    corners of the table, so the pressure is linear in each cell. Both bounds are also strict on
    other meshes.

    Args:
        table: Points [x, y] of the water table from left to right, across the whole ground
            (length).
        unit_weight: Unit weight of water (force per volume); by default 9.81 kN/m³ in the system of
            [units].
        piezometric: Piezometric lines by names of bodies. They replace the water table for the pore
            pressure in these bodies. Their water does not press on the surface.
        ru: Pore pressure divided by the total weight of the ground above, from 0 to 1, by names of
            bodies of drawn ground.
        dry: Names of bodies without pore pressure.
        saturated: Densities below the water table, by names of bodies; the densities in [gravity]
            apply above the table.
        on: Surface on which water above the ground presses; the default for drawn ground is
            "surface". The key is required for other ground; give "" if no water is above the
            ground.
    """

    table: list[list[float]] = field(default_factory=list)
    unit_weight: float | None = None
    piezometric: dict[str, list[list[float]]] = field(default_factory=dict)
    ru: dict[str, float] = field(default_factory=dict)
    dry: list[str] = field(default_factory=list)
    saturated: dict[str, float] = field(default_factory=dict)
    on: str | None = None


@dataclass(frozen=True, eq=False)
class Water:
    """The loads from water, and the lines that mesh edges should follow.

    Attributes:
        loads: The loads, pore pressures first in the order of the bodies.
        kinks: Polylines where the gradient of a pore pressure jumps, each of shape (n, 2).
        table: Points of the water table for pictures, shape (n, 2); no points if there is no water
            table.
    """

    loads: list[Load] = field(default_factory=list)
    kinks: list[Floats] = field(default_factory=list)
    table: Floats = field(default_factory=lambda: np.zeros((0, 2)))


def read_water(
    top: Document,
    ground: DrawnGround | None,
    bodies: Iterable[str],
    units: Units,
    name: str,
) -> Water:
    """Return the water that a case defines; without ``[water]`` there are no loads.

    Args:
        top: The top level of the case file.
        ground: The ground that the case draws; None if it draws no ground.
        bodies: Names of all bodies.
        units: Units of the numbers.
        name: Name of the case file.

    Raises:
        InputError: As for :func:`water_of`, and if there is also ``[seepage]``.
    """
    if top.water is None:
        return Water()
    place = f"{name}, [water]"
    if top.seepage is not None:
        raise InputError(
            f"{place}: the case also has [seepage], which computes the pore pressures; remove one "
            "of the two tables."
        )
    table = convert(top.water, WaterTable, place)
    gravity = None
    if top.gravity is not None:
        gravity = convert(top.gravity, GravityTable, f"{name}, [gravity]")
    with at(place):
        return water_of(table, ground, gravity, list(bodies), units)


def water_in_cracks(
    ground: DrawnGround | None, given: float | None, units: Units, gravity: GravityTable | None
) -> tuple[list[Load], tuple[str, ...]]:
    """Return the loads from water in cracks, and the names of the sides of all cracks.

    Args:
        ground: The ground that the case draws; None if it draws no ground.
        given: The unit weight of water in the case; None if it is not given.
        units: Units of the numbers.
        gravity: The table ``[gravity]``; None if the case has no such table.

    Raises:
        InputError: If the unit weight is unknown, if a line with water is not a crack, or if a
            crack has no point at its water level.
    """
    for line in () if ground is None else ground.lines:
        heights = [point[1] for point in line.points]
        if line.water is not None and not line.crack:
            raise InputError(
                f"the line '{line.name}' has the key water, but is not a crack; give crack = true, "
                "or remove water."
            )
        if line.water is not None and line.water < max(heights) and line.water not in heights:
            raise InputError(
                f"the water in the crack '{line.name}' reaches y = {line.water:g}, where the crack "
                "has no point; add a point at this height to the line, so that the mesh has a "
                "vertex at the water level."
            )
    cracks = [] if ground is None else ground.cracks()
    loads = list[Load]()
    for line, sides in cracks:
        if line.water is not None:
            weight = unit_weight_of_water(given, units, gravity)
            value = f"{_number(weight)}*maximum({_number(line.water)} - y, 0)"
            words = f"{weight:g} times the depth of water in the crack"
            pressure = WordedFormula(value, words)
            loads += [Pressure(side, pressure, NAME, constant=True) for side in sides]
    return loads, tuple(side for _, sides in cracks for side in sides)


def water_of(
    table: WaterTable,
    ground: DrawnGround | None,
    gravity: GravityTable | None,
    bodies: Sequence[str],
    units: Units,
) -> Water:
    """Return the loads of water.

    Args:
        table: The table ``[water]``.
        ground: The ground that the case draws; None if it draws no ground.
        gravity: The table ``[gravity]``; None if the case has no such table.
        bodies: Names of the bodies.
        units: Units of the numbers.

    Raises:
        InputError: If a line does not cross the ground from left to right, if a body is unknown or
            has two pore pressures, or if a number is not plausible.
    """
    given = _Given(table, ground, gravity, bodies, units)
    given.check_names()
    weight = given.weight_of_water() if len(given.table) or table.piezometric else 0.0
    lines = {body: given.line(body) for body in bodies}
    loads = list[Load]()
    for body, line in lines.items():
        if line is not None and given.reaches(body, line):
            loads.append(PorePressure(body, given.pressure(weight, body), NAME))
    above = given.weight_above() if table.ru else []
    loads += [given.share_of_weight(body, share, above) for body, share in table.ru.items()]
    loads += given.on_surface(weight)
    loads += given.extra_weight()
    used = {id(line): line for line in lines.values() if line is not None}
    kinks = [part for line in used.values() for part in given.kinks(line)]
    kinks += [part for line, _ in above for part in given.kinks(line, ends=True)]
    return Water(loads, kinks, given.table)


class _Given:
    """The table ``[water]`` of a case, with the ground and the units of the case."""

    def __init__(
        self,
        table: WaterTable,
        ground: DrawnGround | None,
        gravity: GravityTable | None,
        bodies: Sequence[str],
        units: Units,
    ) -> None:
        self.said, self.gravity, self.bodies, self.units = table, gravity, bodies, units
        self.shapes = {} if ground is None else dict(ground.shapes)
        self.table: Floats = np.zeros((0, 2))
        if table.table:
            self.table = self._line(table.table, "table")
        divided = [self.table] if len(self.table) else []
        self.outline = None if ground is None else ground.with_kinks(divided).outline()
        self.others = {
            body: self._line(points, f"piezometric line of '{body}'")
            for body, points in table.piezometric.items()
        }

    def check_names(self) -> None:
        """Raise an error for no water, unknown bodies, or keys that contradict each other."""
        said = self.said
        if not (len(self.table) or said.piezometric or said.ru):
            raise InputError("no water is defined; give table = [[x, y], ...], piezometric or ru.")
        kinds = {"piezometric": [*said.piezometric], "ru": [*said.ru], "dry": said.dry}
        for kind, names in {**kinds, "saturated": [*said.saturated]}.items():
            for name in names:
                if name not in self.bodies:
                    raise InputError(
                        f"{kind} has an entry for '{name}', which is not a body; "
                        f"{nearest(name, self.bodies)}"
                    )
        for body in self.bodies:
            own = [kind for kind, names in kinds.items() if body in names]
            if len(own) > 1:
                raise InputError(
                    f"'{body}' is in {' and in '.join(own)}, which contradict each other; name the "
                    "body in only one of these keys."
                )
        if said.saturated and not len(self.table):
            raise InputError(
                "saturated applies to ground below a water table, but there is no water table; "
                "give table."
            )

    def weight_of_water(self) -> float:
        """Return the unit weight of water."""
        return unit_weight_of_water(self.said.unit_weight, self.units, self.gravity)

    def line(self, body: str) -> Floats | None:
        """Return the line that determines the pore pressure in a body; None if no line does."""
        if body in self.others:
            return self.others[body]
        if body in self.said.dry or body in self.said.ru or not len(self.table):
            return None
        return self.table

    def reaches(self, body: str, line: Floats) -> bool:
        """Return whether a part of a body is below a line; true for bodies that are not drawn."""
        return body not in self.shapes or _deepest(self.shapes[body], line, True)[0] > 0

    def pressure(self, weight: float, body: str = "") -> WordedFormula:
        """Return the pressure of water as a formula, below a body's line or below the table."""
        line = self.others.get(body, self.table)
        unit = self.units.table()["force_density"]
        what = "its piezometric line" if body in self.others else "the water table"
        words = f"{weight:g} {unit}".rstrip() + f" times the depth below {what}"
        return WordedFormula(f"{_number(weight)}*maximum({level(line)} - y, 0)", words)

    def on_surface(self, weight: float) -> list[Load]:
        """Return the pressure of open water on the surface of the ground, as a list of loads."""
        if not len(self.table):
            return []
        if self.outline is not None and not self.said.on:
            if self.outline.unnamed:
                raise InputError(
                    f"{self.outline.unnamed}; draw a [[line]] along the surface under water, and "
                    "give on = the name of this line."
                )
            plan = self.outline.plan
            edges = plan.points[plan.edges[self.outline.sides["surface"]]]
            if max(_deepest(ends, self.table, False)[0] for ends in edges) <= 0:
                return []
        elif self.said.on is None:
            raise InputError(
                "'on' is missing, and the case does not draw the ground; give on = the name of the "
                'surface under water, or on = "" if there is no water above the ground.'
            )
        elif not self.said.on:
            return []
        return [Pressure(self.said.on or "surface", self.pressure(weight), NAME, constant=True)]

    def extra_weight(self) -> list[Load]:
        """Return the additional weight of saturated ground below the water table, as loads."""
        found = list[Load]()
        for body, density in self.said.saturated.items():
            if self.gravity is None or body not in self.gravity.density:
                raise InputError(
                    f"saturated has an entry for '{body}', which has no density in [gravity]; give "
                    "the density of this body above the water table in [gravity]."
                )
            bulk = self.gravity.density[body]
            more = density - bulk
            if more < 0:
                raise InputError(
                    f"saturated gives {density:g} for '{body}', less than its density {bulk:g} in "
                    "[gravity]; swap the two numbers."
                )
            if density > MOST_WATER * bulk:
                raise InputError(
                    f"saturated gives {density:g} for '{body}', {density / bulk:.3g} times its "
                    f"density {bulk:g} in [gravity]; give both in the same unit, because "
                    "'acceleration' multiplies both."
                )
            if more > 0 and self.reaches(body, self.table):
                force = tuple(more * g for g in self.gravity.acceleration)
                depth = WordedFormula(
                    f"{level(self.table)} - y", "the ground is below the water table"
                )
                told = (NAME, self.gravity.constant, depth)
                found.append(ForceBelow(body, force, *told))
        return found

    def weight_above(self) -> list[tuple[Floats, float]]:
        """Return lines, each with the difference between the unit weights below and above it.

        The weight above a point is a sum over all lines: this difference times the height of the
        line above the point.
        """
        if self.outline is None or self.gravity is None:
            raise InputError(
                "ru needs the weight and the surface of the ground; draw the ground by [[region]] "
                "and give [gravity], or give the pore pressure as a [[load]]."
            )
        down = -self.gravity.acceleration[1]
        if not down > 0:
            raise InputError(
                "ru needs weight along -y, but the acceleration in [gravity] is "
                f"{self.gravity.acceleration}; correct it."
            )
        outline, density = self.outline, dict(self.gravity.density)
        plan, unit = outline.plan, np.zeros(len(outline.face_body) + 1)
        for number, (face, body) in enumerate(zip(plan.faces, outline.face_body, strict=True)):
            name = outline.names[body] if body >= 0 else ""
            wet = len(self.table) and np.interp(face.point[0], *self.table.T) > face.point[1]
            weights = self.said.saturated if wet and name in self.said.saturated else density
            unit[number] = down * weights.get(name, 0.0)
        ends = plan.points[plan.edges]
        backwards = ends[:, 0, 0] > ends[:, 1, 0]
        above, below = unit[plan.sides].T
        more = np.where(backwards, above - below, below - above)
        ends[backwards] = ends[backwards, ::-1]
        upright = ends[:, 0, 0] == ends[:, 1, 0]
        first, last = ends[..., 0].min(), ends[..., 0].max()
        steps = upright & (more != 0) & (ends[:, 0, 0] > first) & (ends[:, 0, 0] < last)
        if steps.any():
            raise InputError(
                "ru: the weight of the ground above jumps at the vertical side near "
                f"{place_of(ends[np.argmax(steps)].mean(axis=0))}; make this side inclined."
            )
        return _joined(ends[~upright & (more != 0)], more[~upright & (more != 0)])

    def share_of_weight(
        self, body: str, share: float, above: Sequence[tuple[Floats, float]]
    ) -> PorePressure:
        """Return the pore pressure in a body as a share of the weight of the ground above."""
        if not 0 <= share <= 1:
            raise InputError(
                f"ru = {share:g} for '{body}' is not between 0 and 1; give a number in this range."
            )
        x = np.concatenate([line[:, 0] for line, _ in above])
        terms = []
        for line, more in above:
            term = f"{_number(share * more)}*maximum({level(line)} - y, 0)"
            start, end = line[0, 0], line[-1, 0]
            if start > x.min() or end < x.max():
                until = f"x < {_number(end)}" if end < x.max() else f"x <= {_number(end)}"
                term = f"where((x >= {_number(start)}) & ({until}), {term}, 0)"
            terms.append(term)
        text = " + ".join(terms)
        if len(text) > LONGEST:
            raise InputError(
                f"ru of '{body}': the ground above this body has too many corners; remove some of "
                "them."
            )
        words = f"{share:g} times the weight of the ground above"
        return PorePressure(body, WordedFormula(text, words), NAME)

    def kinks(self, line: Floats, ends: bool = False) -> list[Floats]:
        """Return a line with vertical lines below its corners, and below its ends if ``ends``."""
        if self.outline is None:
            return []
        lowest = min(float(corners[:, 1].min()) for corners in self.shapes.values())
        slopes = np.diff(line[:, 1]) / np.diff(line[:, 0])
        bent = line[1:-1][slopes[1:] != slopes[:-1]]
        bent = np.concatenate([bent, line[[0, -1]]]) if ends else bent
        down = [np.array([[x, y], [x, lowest]]) for x, y in bent if y > lowest]
        return [line, *down]

    def _line(self, given: Sequence[Sequence[float]], what: str) -> Floats:
        """Return the points of a polyline, after checking that it crosses the whole ground."""
        line = points_of(given, what)
        back = np.flatnonzero(np.diff(line[:, 0]) <= 0)
        if back.size:
            raise InputError(
                f"{what} does not go from left to right between {place_of(line[back[0]])} and "
                f"{place_of(line[back[0] + 1])}; give its points from left to right."
            )
        if not self.shapes:
            return line
        x, y = np.concatenate(list(self.shapes.values())).T
        little = 1e-9 * float(np.ptp(x))
        if line[0, 0] > x.min() + little or line[-1, 0] < x.max() - little:
            raise InputError(
                f"{what} extends from x = {line[0, 0]:.6g} to {line[-1, 0]:.6g}, but the ground "
                f"from {x.min():.6g} to {x.max():.6g}; extend the line across the whole ground."
            )
        if not any(_deepest(corners, line, True)[0] > 0 for corners in self.shapes.values()):
            lowest = int(np.argmin(y))
            raise InputError(
                f"{what} lies entirely below the ground, whose lowest point is "
                f"{place_of((x[lowest], y[lowest]))}; correct the line."
            )
        return line


def unit_weight_of_water(given: float | None, units: Units, gravity: GravityTable | None) -> float:
    """Return the unit weight of water (force per volume).

    Args:
        given: The value that the case gives, if any.
        units: Units of the numbers.
        gravity: The table ``[gravity]``; None if the case has no such table.

    Raises:
        InputError: If the value is missing and [units] does not define it, or if it is not
            plausible for water.
    """
    system = units.known
    usual = None if system is None else NEWTONS * system.metres / system.pascals
    if given is None:
        if usual is None:
            raise InputError(
                "unit_weight is missing; give the unit weight of water, or a system under [units],"
                ' such as system = "m-kN-kPa" (9.81 kN/m^3).'
            )
        return usual
    if not (given > 0 and math.isfinite(given)):
        raise InputError(
            f"unit_weight = {given:g} is not a valid unit weight of water; give a positive number."
        )
    least, most = 0.9, 1.4  # relative to fresh water; the upper limit is that of mud
    if usual is not None and not least <= given / usual <= most:
        unit = units.table()["force_density"]
        raise InputError(
            f"unit_weight = {given:g} {unit} is {given / usual:.3g} times the usual value for "
            f"water, {usual:.4g} {unit}; correct it, or correct [units]."
        )
    if usual is None and gravity is not None:
        ground = max(gravity.density.values()) * math.hypot(*gravity.acceleration)
        # plausible unit weights of ground and buildings, relative to water
        lightest, heaviest = 0.3, 20.0
        if not lightest <= ground / given <= heaviest:
            raise InputError(
                f"unit_weight = {given:g}, but the heaviest body weighs {ground:.4g} per "
                f"unit of volume, {ground / given:.3g} times as much; give both in the "
                "same units."
            )
    return given


def level(points: Floats) -> str:
    """Return the formula for the height y of a polyline as a function of x.

    Args:
        points: Points from left to right, shape (n, 2).
    """
    (x, y), slopes = points.T, np.diff(points[:, 1]) / np.diff(points[:, 0])
    text = _number(y[0])
    bends = np.diff(slopes, prepend=0.0)
    for number, (start, bend) in enumerate(zip(x[:-1], bends, strict=True)):
        if bend:
            along = f"x - {_number(start)}"
            text += f" + {_number(bend)}*" + (f"maximum({along}, 0)" if number else f"({along})")
    return text


def _joined(ends: Floats, values: Floats) -> list[tuple[Floats, float]]:
    """Return polylines, each with a value, from adjoining edges with equal values.

    Args:
        ends: Ends of the edges, from left to right, shape (n, 2, 2).
        values: Values of the edges, shape (n,).
    """
    found: list[tuple[list[Floats], float]] = []
    for k in np.lexsort((ends[:, 0, 1], ends[:, 0, 0])):
        alike = (line for line, value in found if abs(value - values[k]) <= 1e-12 * abs(value))
        before = next((line for line in alike if (line[-1] == ends[k, 0]).all()), None)
        if before is None:
            found.append(([ends[k, 0], ends[k, 1]], float(values[k])))
        else:
            before.append(ends[k, 1])
    return [(np.array(line), value) for line, value in found]


def _deepest(corners: Floats, line: Floats, closed: bool) -> tuple[float, Floats]:
    """Return the largest depth of a polygon or polyline below a line, and the place.

    Args:
        corners: Corners of the polygon or polyline, shape (n, 2).
        line: Points of the line from left to right, shape (m, 2).
        closed: Whether an edge joins the last corner to the first one.
    """
    ends = np.roll(corners, -1, axis=0)
    start, end = (corners, ends) if closed else (corners[:-1], corners[1:])
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = (line[:, 0] - start[:, :1]) / (end - start)[:, :1]
    on = (shares > 0) & (shares < 1)
    between = start[:, None] + np.where(on, shares, 0.0)[..., None] * (end - start)[:, None]
    places = np.concatenate([start, end, between[on]])
    depth = np.interp(places[:, 0], *line.T) - places[:, 1]
    depth[np.abs(depth) < 1e-9 * np.abs(places).max()] = 0.0
    deepest = int(np.argmax(depth))
    return float(depth[deepest]), places[deepest]


def _number(value: float) -> str:
    return f"({float(value)!r})" if value < 0 else repr(float(value))
