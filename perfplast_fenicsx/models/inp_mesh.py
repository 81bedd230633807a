"""Nodes, elements, sets and instances of an ``.inp`` file, as arrays over the whole assembly."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.models.element_types import ElementType, element_type
from perfplast_fenicsx.models.inp_keywords import Keyword

NOBODY: Longs = np.zeros(0, dtype=np.int64)

MESH_KEYWORDS = ("NODE", "ELEMENT", "NSET", "ELSET")
"""Keywords that make nodes, elements and sets."""

SCOPES = ("PART", "END PART", "ASSEMBLY", "END ASSEMBLY", "INSTANCE", "END INSTANCE")
"""Keywords that say which part or instance others belong to."""


@dataclass
class Part:
    """What is numbered together: a part, or a whole file without parts.

    Attributes:
        nodes: Numbers, shape (n,), and places, shape (n, 3), of each *NODE block.
        elements: Type, numbers and nodes' numbers of each *ELEMENT block.
        sets: By kind ("NSET", "ELSET") and name: numbers.
    """

    nodes: list[tuple[Longs, Floats]] = field(default_factory=list)
    elements: list[tuple[ElementType, Longs, Longs]] = field(default_factory=list)
    sets: dict[tuple[str, str], Longs] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Block:
    """Elements of one type.

    Attributes:
        kind: Their type.
        first: Number of the first one in the assembly; the others follow.
        nodes: Shape (n, kind.nodes), indices of points.
    """

    kind: ElementType
    first: int
    nodes: Longs


@dataclass
class Assembly:
    """All instances together.

    Attributes:
        points: Shape (n, 3).
        blocks: Of elements.
        count: Elements in all.
        sets: By kind and name (in capitals, ``INSTANCE.SET`` of a part's): indices.
        left_out: Elements of types that the program does not know, by type.
        numbers: By instance and kind: indices by number.
    """

    points: Floats
    blocks: list[Block]
    count: int
    sets: dict[tuple[str, str], Longs]
    left_out: dict[str, int]
    numbers: dict[str, dict[str, "NumberIndex"]]

    def members(self, kind: str, name: str) -> Longs | None:
        """A set by its name, or the one node or element of a number; None where there is none."""
        plain = name.upper().strip("\"'")
        instance, _, number = plain.rpartition(".")
        if number.isdigit() and instance in self.numbers:
            found = self.numbers[instance][kind].of(np.array([int(number)]), missing_is_fine=True)
            return found if len(found) else None
        return self.sets.get((kind, plain))


class MeshReader:
    """Takes keywords in their order, and puts the assembly together in the end."""

    def __init__(self) -> None:
        self._parts: dict[str, Part] = {"": Part()}
        self._now, self._inside = "", ""
        self._instances: list[tuple[str, str, list[list[str]]]] = []
        self._left_out: dict[str, int] = {}
        self._later: list[tuple[Keyword, str]] = []

    def take(self, keyword: Keyword) -> None:
        """Take a keyword of :data:`MESH_KEYWORDS` or :data:`SCOPES`.

        Raises:
            InputError: If its data cannot be understood.
        """
        name = keyword.name
        if name == "PART":
            self._now = keyword.option("NAME")
            self._parts[self._now] = Part()
        elif name in ("END PART", "END INSTANCE"):
            self._now = self._inside = ""
        elif name == "INSTANCE":
            self._inside = keyword.option("NAME")
            self._instances.append((self._inside, keyword.option("PART"), keyword.rows()))
        elif name == "NODE":
            self._nodes(keyword)
        elif name == "ELEMENT":
            self._elements(keyword)
        elif name in ("NSET", "ELSET"):
            instance = keyword.option("INSTANCE")
            if self._now or not (instance or self._instances):
                part = self._parts[self._now]
                members = _members(keyword, name, part.sets)
                _add(part.sets, (name, keyword.option(name)), members)
            else:
                self._later.append((keyword, instance))

    def assembly(self) -> Assembly:
        """All that was read.

        Raises:
            InputError: If an element or set names what there is not.
        """
        instances = self._instances or [("", "", [])]
        points: list[Floats] = []
        blocks: list[Block] = []
        sets: dict[tuple[str, str], Longs] = {}
        count = 0
        numbers: dict[str, dict[str, NumberIndex]] = {}
        for name, of, moves in instances:
            if of not in self._parts:
                raise InputError(f"the instance '{name}' is of a part '{of}' that there is not.")
            part = self._parts[of]
            offset = sum(map(len, points))
            ids = np.concatenate([NOBODY, *(one for one, _ in part.nodes)])
            places = np.concatenate([np.zeros((0, 3)), *(xyz for _, xyz in part.nodes)])
            nodes = NumberIndex(ids, offset, f"node of '{name or 'the model'}'")
            points.append(_moved(places, moves, name))
            of_elements = []
            first = count
            for kind, own, connectivity in part.elements:
                blocks.append(Block(kind, count, nodes.of(connectivity)))
                of_elements.append(own)
                count += len(own)
            elements = NumberIndex(np.concatenate([NOBODY, *of_elements]), first, "element")
            numbers[name] = {"NSET": nodes, "ELSET": elements}
            for (kind_of, own_name), members in part.sets.items():
                found = numbers[name][kind_of].of(members, missing_is_fine=True)
                for called in {own_name, f"{name}.{own_name}" if name else own_name}:
                    _add(sets, (kind_of, called), found)
        for keyword, instance in self._later:
            kind_of = keyword.name
            if instance in numbers:
                own = {
                    key[1].removeprefix(f"{instance}."): value
                    for key, value in sets.items()
                    if key[0] == kind_of and key[1].startswith(f"{instance}.")
                }
                raw = _members(keyword, kind_of, {})
                found = numbers[instance][kind_of].of(raw, missing_is_fine=True)
                named = [own[n.upper()] for n in _names(keyword) if n.upper() in own]
                found = np.concatenate([found, *named])
            else:
                named = [sets[kind_of, n.upper()] for n in _names(keyword) if (kind_of, n.upper()) in sets]
                found = np.concatenate([NOBODY, *named])
            _add(sets, (kind_of, keyword.option(kind_of)), found)
        return Assembly(
            np.concatenate([np.zeros((0, 3)), *points]),
            blocks,
            count,
            sets,
            self._left_out,
            numbers,
        )

    def _nodes(self, keyword: Keyword) -> None:
        values = _numbers(keyword)
        width = 1 + values.shape[1] if values.ndim == 2 else 4
        table = values
        if table.size and not 3 <= width - 1 <= 7:
            raise InputError(f"line {keyword.number}: *NODE wants a number and coordinates.")
        places = np.zeros((len(table), 3))
        places[:, : min(3, table.shape[1] - 1)] = table[:, 1:4]
        if not np.isfinite(places).all():
            raise InputError(f"line {keyword.number}: *NODE has coordinates that are no numbers.")
        ids = table[:, 0].astype(np.int64)
        part = self._parts[self._now]
        part.nodes.append((ids, places))
        if keyword.option("NSET"):
            _add(part.sets, ("NSET", keyword.option("NSET")), ids)

    def _elements(self, keyword: Keyword) -> None:
        name = keyword.option("TYPE")
        kind = element_type(name)
        if kind is None:
            self._left_out[name] = self._left_out.get(name, 0) + len(keyword.lines)
            return
        cells = ",".join(keyword.lines).replace(",,", ",").strip(", ").split(",")
        width = 1 + kind.nodes
        try:
            table = np.array(cells, dtype=np.int64)
        except ValueError as error:
            raise InputError(
                f"line {keyword.number}: *ELEMENT has a number that is none ({error})."
            ) from error
        if len(table) % width:
            raise InputError(
                f"line {keyword.number}: elements of type {name} have {kind.nodes} nodes each, and"
                f" {len(table)} numbers stand there; the file is cut off or damaged."
            )
        table = table.reshape(-1, width)
        part = self._parts[self._now]
        part.elements.append((kind, table[:, 0], table[:, 1:]))
        if keyword.option("ELSET"):
            _add(part.sets, ("ELSET", keyword.option("ELSET")), table[:, 0])


class NumberIndex:
    """Finds the index in the assembly of what has a number in its part."""

    def __init__(self, ids: Longs, first: int, what: str) -> None:
        self._order = np.argsort(ids, kind="stable")
        self._sorted, self._first, self._what = ids[self._order], first, what

    def of(self, numbers: Longs, missing_is_fine: bool = False) -> Longs:
        """Indices, the last one's where a number is given twice."""
        if not len(self._sorted):
            if numbers.size and not missing_is_fine:
                raise InputError(f"there is no {self._what} {numbers.ravel()[0]}.")
            return NOBODY
        at = np.searchsorted(self._sorted, numbers, side="right") - 1
        there = self._sorted[np.maximum(at, 0)] == numbers
        if missing_is_fine:
            return self._first + self._order[at[there]]
        if not there.all():
            raise InputError(
                f"there is no {self._what} {numbers[~there].ravel()[0]}, which an element has; the"
                " file is cut off or damaged."
            )
        return self._first + self._order[at]


def _numbers(keyword: Keyword) -> Floats:
    """Data lines of equal length as a table."""
    if not keyword.lines:
        return np.zeros((0, 4))
    lines = [line.rstrip(", ") for line in keyword.lines]
    width = lines[0].count(",") + 1
    try:
        values = np.array(",".join(lines).split(","), dtype=np.float64)
        return values.reshape(-1, width)
    except ValueError as error:
        raise InputError(
            f"line {keyword.number}: *{keyword.name} has lines that differ, or what is no number"
            f" ({error})."
        ) from error


def _names(keyword: Keyword) -> list[str]:
    """What of the data is a name."""
    return [cell for row in keyword.rows() for cell in row if cell and not _is_whole(cell)]


def _is_whole(cell: str) -> bool:
    return cell.lstrip("+-").isdigit()


def _members(
    keyword: Keyword, kind: str, known: dict[tuple[str, str], Longs]
) -> Longs:
    """The numbers of a set."""
    rows = keyword.rows()
    if "GENERATE" in keyword.options:
        found = []
        for row in rows:
            try:
                first, last, step = (*map(int, row), 1)[:3]
            except ValueError as error:
                raise InputError(
                    f"line {keyword.number}: *{kind}, GENERATE wants first, last and step."
                ) from error
            if step < 1 or (last - first) // step > 100_000_000:
                raise InputError(f"line {keyword.number}: *{kind} has the step {step}.")
            found.append(np.arange(first, last + 1, step, dtype=np.int64))
        return np.concatenate([NOBODY, *found])
    plain = np.array([int(c) for row in rows for c in row if _is_whole(c)], dtype=np.int64)
    others = [known[kind, n.upper()] for n in _names(keyword) if (kind, n.upper()) in known]
    return np.concatenate([plain, *others])


def _add(
    sets: dict[tuple[str, str], Longs], key: tuple[str, str], members: Longs
) -> None:
    """Sets that are given again grow."""
    before = sets.get(key)
    sets[key] = members if before is None else np.union1d(before, members)


def _moved(points: Floats, moves: Sequence[Iterable[str]], name: str) -> Floats:
    """Where an instance puts a part: a translation, then a turn about an axis (degrees)."""
    rows = [list(map(float, row)) for row in moves if row]
    if rows:
        points = points + np.array((rows[0] + [0.0] * 3)[:3])
    if len(rows) > 1:
        if len(rows[1]) != 7:
            raise InputError(f"the instance '{name}' turns by no 7 numbers.")
        start, end, angle = np.array(rows[1][:3]), np.array(rows[1][3:6]), math.radians(rows[1][6])
        axis = end - start
        length = float(np.linalg.norm(axis))
        if not length > 0:
            raise InputError(f"the instance '{name}' turns about an axis without length.")
        k, r = axis / length, points - start
        along = (r @ k)[:, None] * k
        points = start + along + math.cos(angle) * (r - along) + math.sin(angle) * np.cross(k, r)
    return points
