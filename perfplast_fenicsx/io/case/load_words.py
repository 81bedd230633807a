"""Describe loads in words with units: those that ζ multiplies, and constant ones."""

from typing import TYPE_CHECKING, Any

from perfplast_fenicsx.formulas import WordedFormula
from perfplast_fenicsx.problem.declared.loads import FieldPores, ForceBelow, Load, Traction, kind_of
from perfplast_fenicsx.units import Units

if TYPE_CHECKING:  # code that reads results for reports does not start MPI
    from perfplast_fenicsx.io.case.case import Case


def load_in_words(load: Load, units: Units, whole: bool = True) -> str:
    """Return a load in words, such as ``pressure 1 MPa on 'top'``.

    Args:
        load: The load.
        units: Units of its numbers.
        whole: See :meth:`units.Units.table`.
    """
    table = units.table(whole)
    words = []
    for field, quantity in load.quantities.items():
        value = getattr(load, field)
        if not hasattr(value, "__len__") or len(value):
            what = kind_of(load) if field == "value" else field
            if isinstance(load, ForceBelow):
                what = "body force"
            if isinstance(load, Traction) and load.total:
                what, quantity = "force, spread evenly,", "force"
            if isinstance(load, FieldPores):
                words.append(f"pore pressure of {load.value}")
                continue
            unit = "" if isinstance(value, WordedFormula) else table[quantity]
            words.append(f"{what.replace('_', ' ')} {_value(value)} {unit}".rstrip())
    below = f" where {_value(load.depth)}" if isinstance(load, ForceBelow) else ""
    return f"{' and '.join(words)} on '{load.on}'{below}"


def meaning(case: "Case", whole: bool = True) -> list[str]:
    """Return sentences on the meaning of a case's numbers: the load factor and the units.

    Args:
        case: The case.
        whole: See :meth:`units.Units.table`.
    """
    units = case.units
    live = [load_in_words(load, units, whole) for load in case.loads if not load.constant]
    dead = [load_in_words(load, units, whole) for load in case.loads if load.constant]
    told = []
    own = case.stages or not case.loading.together
    factor = "A factor of 1" if own else "zeta = 1"
    if live:
        told.append(f"{factor} is {', '.join(live)}.")
    elif case.scene.driven:
        told.append(
            "zeta = 1 is the motion of supports, obstacles and overlaps as given in the case."
        )
    elsewhere = dict.fromkeys(name for stage in case.stages for name in stage.factors)
    others = [
        repr(name)
        for name in elsewhere
        if name not in {load.name or load.on for load in case.loads}
    ]
    if others:
        told.append(f"A factor of 1 of {', '.join(others)} is the value in the case.")
    if dead:
        told.append(f"At any load factor these act in full: {', '.join(dead)}.")
    if case.scene.axisymmetric:
        told.append(
            "Forces and works in results are those of the full turn; pressures, tractions "
            "and body forces are per area and volume."
        )
    if units.in_words():
        told.append(f"Units: {units.in_words(whole)}.")
    return told


def _value(value: Any) -> str:
    """Return a number or a formula as text, or one for each direction."""
    if isinstance(value, WordedFormula):
        return value.words
    if isinstance(value, str):
        return repr(value)
    if hasattr(value, "__len__"):
        return f"({', '.join(_value(one) for one in value)})"
    return f"{value:.6g}"
