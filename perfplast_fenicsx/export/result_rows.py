"""Make tables of a run: levels, forces and moments, the limit load and its bounds.

Rows are dicts; all rows of a table have the same keys.
"""

from collections.abc import Iterator, Sequence

from perfplast_fenicsx.io.results.summary import Summary, limit_rows
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.tables import Row


def level_rows(reader: ResultReader) -> list[Row]:
    """Return a row for each level.

    Args:
        reader: The results.

    Returns:
        Rows with the ``level`` (from 1) and the fields of :class:`~report.LevelReport`, except the
        reactions, which :func:`resultant_rows` returns. With stages, each name in a stage has a
        column such as ``factor_push``.

    Raises:
        InputError: If a file cannot be read.
    """
    return [{"level": number, **report.row()} for number, report in enumerate(reader.reports, 1)]


def bound_rows(reader: ResultReader) -> list[Row]:
    """Return a row for each mesh on which a limit load or bounds were computed.

    Args:
        reader: The results.

    Returns:
        The rows of :func:`~summary.limit_rows`.

    Raises:
        InputError: If a file cannot be read.
    """
    summary = reader.summary
    if not summary.limit:
        return []
    return reader.read("summary.json", lambda _: limit_rows(summary))


def resultant_rows(reader: ResultReader) -> list[Row]:
    """Return a row for each stored force or moment on the bodies.

    Args:
        reader: The results.

    Returns:
        The rows. The columns are the following.

        - ``state``: "level"; "given" at ζ = 1; "lower" or "upper" for a bound of the bodies;
          "limit" for the limit load of the mesh;
        - ``level``: number of the level, otherwise empty;
        - ``zeta``: load factor, empty for a constant load;
        - ``quantity``: "force", or "moment" about the origin;
        - ``name``: for example "support bottom";
        - one column for each axis, empty if a moment has no such component;
        - ``unit``: empty if the unit is unknown.

    Raises:
        InputError: If a file cannot be read.
    """
    summary = reader.summary
    return reader.read("summary.json", lambda _: list(_resultants(summary)))


def _resultants(summary: Summary) -> Iterator[Row]:
    axes = summary.model["axes"]
    about = "xyz" if len(axes) == 3 else "z"
    columns = [*axes, *(axis for axis in about if axis not in axes)]

    def row(
        state: str, zeta: float | None, name: str, parts: Sequence[float], level: int | None = None
    ) -> Row:
        return told("force", axes, state, zeta, name, parts, level)

    def turn(state: str, zeta: float | None, name: str, parts: Sequence[float]) -> Row:
        return told("moment", about, state, zeta, name, parts, None)

    def told(
        quantity: str,
        along: str,
        state: str,
        zeta: float | None,
        name: str,
        parts: Sequence[float],
        level: int | None,
    ) -> Row:
        known = dict(zip(along, parts, strict=False))
        return {
            "state": state,
            "level": level,
            "zeta": zeta,
            "quantity": quantity,
            "name": name,
            **{axis: known.get(axis) for axis in columns},
            "unit": summary.units.get(quantity, ""),
        }

    for number, step in enumerate(summary.steps, start=1):
        for name, parts in step["reactions"].items():
            yield row("level", step["zeta"], name, parts, number)
    limit = summary.limit or {}
    body = limit.get("body") or {}
    factors = {"given": 1.0, "lower": body.get("lower"), "upper": body.get("upper")}
    for load in summary.loads:
        named = load["name"] not in ("", load["on"])
        name = f"load {load['name']} on {load['on']}" if named else f"load {load['on']}"
        for state, zeta in factors.items():
            if zeta is None or (load["constant"] and state != "given"):
                continue
            told_at = None if load["constant"] else zeta
            yield row(state, told_at, name, [zeta * part for part in load["force"]])
            if any(load["moment"]):
                yield turn(state, told_at, name, [zeta * part for part in load["moment"]])
    if found := limit.get("forces"):
        state = "lower" if found.get("strict") else "limit"
        for name, parts in found["reactions"].items():
            yield row(state, found["zeta"], name, parts)
        for name, parts in found["moments"].items():
            yield turn(state, found["zeta"], name, parts)
