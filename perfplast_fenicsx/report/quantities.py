"""Define the numbers of a run that a page compares with the numbers of another run."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.rounding import rounded_down, rounded_up


@dataclass(frozen=True)
class Quantity:
    """A number of a run.

    Attributes:
        words: Name of the number, as HTML.
        of: Function that reads the number from a run's results, or returns None.
        shown: Function that formats it.
        unit: Kind of the number's unit; empty for pure numbers.
        is_load: Whether the number is a load factor, which cannot be compared between runs with
            different loads.
        at_end: Whether the number belongs to the last solved level, which may have another ζ in the
            other run.
    """

    words: str
    of: Callable[[ResultReader], float | None]
    shown: Callable[[float], str] = "{:.6g}".format
    unit: str = ""
    is_load: bool = False
    at_end: bool = False


def last_load(reader: ResultReader) -> float | None:
    """Return ζ of the last solved level; None if no level is solved."""
    found = _last("zeta")(reader)
    return None if found is None else float(found)


def _of_mesh(key: str) -> Callable[[ResultReader], float | None]:
    return lambda reader: reader.summary.mesh.get(key)


def _cells(reader: ResultReader) -> float | None:
    meshes = ((reader.summary.limit or {}).get("body") or {}).get("meshes") or [{}]
    return meshes[-1].get("cells") or reader.summary.mesh.get("cells")


def _of_limit(key: str) -> Callable[[ResultReader], float | None]:
    return lambda reader: (reader.summary.limit or {}).get(key)


def _of_body(key: str) -> Callable[[ResultReader], float | None]:
    return lambda reader: ((reader.summary.limit or {}).get("body") or {}).get(key)


def _last(key: str) -> Callable[[ResultReader], Any]:
    def found(reader: ResultReader) -> Any:
        solved = [step for step in reader.summary.steps if step["converged"]]
        return solved[-1].get(key) if solved else None

    return found


def _solved(reader: ResultReader) -> float | None:
    return float(sum(step["converged"] for step in reader.summary.steps)) or None


def _width(reader: ResultReader) -> float | None:
    lower, upper = _of_body("lower")(reader), _of_body("upper")(reader)
    return None if lower is None or upper is None or not lower else (upper - lower) / abs(lower)


def bolts(readers: Sequence[ResultReader]) -> list[Quantity]:
    """Return a quantity for each bolt of the runs: its force at the last solved level."""
    forces = [_last("bolts")(reader) or {} for reader in readers]
    names = dict.fromkeys(name for of_run in forces for name in of_run)

    def force(name: str) -> Callable[[ResultReader], float | None]:
        return lambda reader: (_last("bolts")(reader) or {}).get(name)

    return [
        Quantity(
            f"force of bolt {escape(name)} at this level", force(name), unit="force", at_end=True
        )
        for name in names
    ]


QUANTITIES = (
    Quantity("cells of the mesh (of the last one, if several)", _cells, "{:.0f}".format),
    Quantity("unknowns of the first mesh", _of_mesh("dofs"), "{:.0f}".format),
    Quantity("degree of the elements", lambda reader: reader.summary.given.get("degree")),
    Quantity("mean size of the cells", lambda a: a.summary.element_size or None, unit="length"),
    Quantity("ζ that the bodies carry, proven", _of_body("lower"), rounded_down, is_load=True),
    Quantity("ζ at which they collapse, proven", _of_body("upper"), rounded_up, is_load=True),
    Quantity("distance between these bounds", _width, "{:.2%}".format),
    Quantity("limit load of the mesh, estimate", _of_limit("estimate"), is_load=True),
    Quantity("solved levels", _solved),
    Quantity("ζ of the last solved level", last_load, is_load=True),
    Quantity(
        "largest displacement at this level", _last("max_displacement"), unit="length", at_end=True
    ),
    Quantity("work of the loads at this level, α", _last("alpha"), unit="work", at_end=True),
    Quantity(
        "plastic share at this level", _last("plastic_fraction"), "{:.1%}".format, at_end=True
    ),
    Quantity("processes", lambda reader: float(reader.summary.ranks), "{:.0f}".format),
    Quantity("wall time (s)", lambda a: a.summary.timings.get("total"), "{:.1f}".format),
    Quantity("memory of all processes (MiB)", lambda a: a.summary.peak_memory_mb, "{:.0f}".format),
)
"""The quantities that pages compare."""
