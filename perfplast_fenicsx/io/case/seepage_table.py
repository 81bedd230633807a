"""Read ``[seepage]``: water that flows through the ground, and the loads from this water."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.io.case.gravity_table import GravityTable
from perfplast_fenicsx.io.case.schema import Table, at, convert
from perfplast_fenicsx.io.case.water_table import unit_weight_of_water
from perfplast_fenicsx.problem.declared.loads import FieldPores, Load, Pressure
from perfplast_fenicsx.seepage.declared import Head, Seepage
from perfplast_fenicsx.seepage.flow import SteadyFlow
from perfplast_fenicsx.units import Units


def read_seepage(table: Table, units: Units, gravity: GravityTable | None, place: str) -> Seepage:
    """Return the seepage that a table defines.

    Args:
        table: ``[seepage]``.
        units: Units of the numbers.
        gravity: The table ``[gravity]``; None if the case has no such table.
        place: Place in the input, for messages.

    Raises:
        InputError: If a key or value is not valid.
    """
    each = table.get("head", [])
    if not isinstance(each, list) or not all(isinstance(one, dict) for one in each):
        raise InputError(
            f"{place}: head = {each!r} is not valid; give one [[seepage.head]] table "
            "for each water level."
        )
    of_head = f"{place.removesuffix('[seepage]')}[[seepage.head]] number"
    for number, one in enumerate(each, start=1):
        convert(one, Head, f"{of_head} {number}")
    said = convert(table, Seepage, place)
    with at(place):
        return replace(said, unit_weight=unit_weight_of_water(said.unit_weight, units, gravity))


def water_loads(seepage: Seepage, bodies: Iterable[str], weight: GravityTable | None) -> list[Load]:
    """Return the loads from seepage: pore pressures, and pressures on submerged surfaces.

    Args:
        seepage: The declared seepage.
        bodies: Names of all bodies.
        weight: The table ``[gravity]``; its acceleration must point opposite to ``up``.

    Raises:
        InputError: If a conductivity names an unknown body, or if the acceleration of gravity is
            not opposite to ``up``.
    """
    if weight is not None:
        down = [0.0] * len(weight.acceleration)
        if seepage.axis < len(down):
            down[seepage.axis] = -max(map(abs, weight.acceleration))
        if list(weight.acceleration) != down:
            raise InputError(
                f"up = '{seepage.up}' is not opposite to gravity, whose acceleration is "
                f"{weight.acceleration}; give the coordinate that points upwards, or correct "
                "[gravity]."
            )
    known, found = list(bodies), list[Load]()
    for body in seepage.conductivity:
        if body not in known:
            raise InputError(
                f"conductivity has an entry for '{body}', which is not a body; "
                f"{nearest(body, known)}"
            )
        found.append(FieldPores(body, "steady seepage", name=f"pore water in {body}"))
    for head in seepage.head:
        if head.presses:
            value = f"{seepage.unit_weight!r}*maximum({head.outside!r} - {seepage.up}, 0)"
            found.append(Pressure(head.on, value, name=f"water on {head.on}", constant=True))
    return found


def drawdowns(seepage: Seepage | None, units: Units) -> list[str]:
    """Return a remark on each water level that has fallen (rapid drawdown)."""
    length = f" {unit}" if (unit := units.table()["length"]) else ""
    return [
        f"the water outside '{head.on}' has fallen from {head.level:g}{length} to "
        f"{head.drawdown:g}{length}, but no water has drained from the ground since then"
        for head in (() if seepage is None else seepage.head)
        if head.drawdown is not None
    ]


def with_flow(loads: Sequence[Load], flow: SteadyFlow) -> list[Load]:
    """Return the loads, in which pore pressures from seepage have their computed fields.

    Args:
        loads: The loads of a case.
        flow: The computed seepage on a mesh of the same bodies.
    """
    return [
        replace(load, field=flow.pressure_in(load.on)) if isinstance(load, FieldPores) else load
        for load in loads
    ]
