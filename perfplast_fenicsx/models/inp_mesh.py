"""Read the nodes, elements, sets and instances of an ``.inp`` file into one assembly."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.models.element_types import LINE, Block, ElementType, element_type
from perfplast_fenicsx.models.inp_keywords import Keyword
from perfplast_fenicsx.models.number_text import (
    NOBODY,
    NumberIndex,
    Sets,
    add_to,
    first_has,
    members_of,
    names_of,
    table_of,
)

MESH_KEYWORDS = ("NODE", "ELEMENT", "NSET", "ELSET")
"""Keywords that define nodes, elements and sets."""


SCOPES = ("PART", "END PART", "ASSEMBLY", "END ASSEMBLY", "INSTANCE", "END INSTANCE")
"""Keywords that define the part or instance to which the following keywords belong."""


@dataclass
class Part:
    """Nodes and elements with a common numbering, of a part or of a file without parts.

    Attributes:
        nodes: Numbers, shape (n,), and coordinates, shape (n, 3), of the nodes in each ``*NODE``
            block.
        elements: Type of the elements in each ``*ELEMENT`` block, their numbers, and the numbers of
            their nodes.
        sets: Numbers of the members of each set, by kind ("NSET", "ELSET") and name.
    """

    nodes: list[tuple[Longs, Floats]] = field(default_factory=list)
    elements: list[tuple[ElementType, Longs, Longs]] = field(default_factory=list)
    sets: Sets = field(default_factory=dict)


@dataclass
class Assembly:
    """All instances of parts together.

    Attributes:
        points: Coordinates of the points, shape (n, 3).
        blocks: Blocks of elements.
        count: Total number of elements.
        sets: Indices of the members of each set, by kind and name. Names are in upper case; a set
            of a part also has the name ``INSTANCE.SET``.
        left_out: Number of elements of unsupported types, by type.
        numbers: Indices by number, for each instance and kind of set.
        instances: Names and parts of the instances; ("", "") for a file without instances.
    """

    points: Floats
    blocks: list[Block]
    count: int
    sets: Sets
    left_out: dict[str, int]
    numbers: dict[str, dict[str, NumberIndex]]
    instances: list[tuple[str, str]]

    def members(self, kind: str, name: str) -> Longs | None:
        """Return the members of a set, or the single node or element with a number.

        None if the set, node or element does not exist.
        """
        plain = name.upper().strip("\"'")
        instance, _, number = plain.rpartition(".")
        if number.isdigit() and instance in self.numbers:
            found = self.numbers[instance][kind].of(np.array([int(number)]), missing_is_fine=True)
            return found if len(found) else None
        return self.sets.get((kind, plain))


class MeshReader:
    """Reads the keywords of a file in order, then makes the assembly."""

    def __init__(self) -> None:
        self._parts: dict[str, Part] = {"": Part()}
        self._now, self._inside = "", ""
        self._instances: list[tuple[str, str, list[list[str]]]] = []
        self._left_out: dict[str, int] = {}
        self._later: list[tuple[Keyword, str]] = []

    def take(self, keyword: Keyword) -> None:
        """Read a keyword of :data:`MESH_KEYWORDS` or :data:`SCOPES`.

        Raises:
            InputError: If the data of the keyword are not valid.
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
                members = members_of(keyword, name, part.sets)
                add_to(part.sets, (name, keyword.option(name)), members)
            else:
                self._later.append((keyword, instance))

    def assembly(self) -> Assembly:
        """Return the assembly of all parts that were read.

        Raises:
            InputError: If an element refers to a node, or an instance to a part, that does not
                exist.
        """
        instances = self._instances or [("", "", [])]
        points: list[Floats] = []
        blocks: list[Block] = []
        sets: Sets = {}
        numbers: dict[str, dict[str, NumberIndex]] = {}
        count = offset = 0
        for name, of, moves in instances:
            if of not in self._parts:
                raise InputError(
                    f"the instance '{name}' refers to part '{of}', which the file does not define; "
                    "export the model with all parts."
                )
            part, first = self._parts[of], count
            ids = np.concatenate([NOBODY, *(one for one, _ in part.nodes)])
            places = np.concatenate([np.zeros((0, 3)), *(xyz for _, xyz in part.nodes)])
            nodes = NumberIndex(ids, offset, f"node of '{name}'" if name else "node of the model")
            points.append(_moved(places, moves, name))
            offset += len(places)
            of_elements = [NOBODY]
            for kind, own, connectivity in part.elements:
                blocks.append(Block(kind, count, nodes.of(connectivity)))
                of_elements.append(own)
                count += len(own)
            elements = NumberIndex(np.concatenate(of_elements), first, "element")
            numbers[name] = {"NSET": nodes, "ELSET": elements}
            for (kind_of, own_name), members in part.sets.items():
                found = numbers[name][kind_of].of(members, missing_is_fine=True)
                for called in {own_name, f"{name}.{own_name}" if name else own_name}:
                    add_to(sets, (kind_of, called), found)
        for keyword, instance in self._later:
            _add_later(keyword, instance, numbers, sets)
        return Assembly(
            points=np.concatenate([np.zeros((0, 3)), *points]),
            blocks=blocks,
            count=count,
            sets=sets,
            left_out=self._left_out,
            numbers=numbers,
            instances=[(name, of) for name, of, _ in instances],
        )

    def _nodes(self, keyword: Keyword) -> None:
        table = table_of(keyword)
        most_columns = 7  # columns of `*NODE`: number, coordinates, and direction of a normal
        if not 3 <= table.shape[1] <= most_columns:
            raise InputError(
                f"line {keyword.number}: *NODE needs a number and 2 or 3 coordinates for each "
                "node, so the file is damaged; export it again."
            )
        places = np.zeros((len(table), 3))
        places[:, : min(3, table.shape[1] - 1)] = table[:, 1:4]
        if not np.isfinite(places).all():
            raise InputError(
                f"line {keyword.number}: *NODE has coordinates that are not finite numbers, so the "
                "file is damaged; export it again."
            )
        ids = table[:, 0].astype(np.int64)
        part = self._parts[self._now]
        part.nodes.append((ids, places))
        if keyword.option("NSET"):
            add_to(part.sets, ("NSET", keyword.option("NSET")), ids)

    def _elements(self, keyword: Keyword) -> None:
        name = keyword.option("TYPE")
        kind = element_type(name)
        if kind is None:
            self._left_out[name] = self._left_out.get(name, 0) + len(keyword.lines)
            return
        cells = ",".join(keyword.lines).replace(",,", ",").strip(", ").split(",")
        width = 1 + kind.nodes
        # element type for which CalculiX accepts extra nodes for incompatible modes, and their
        # number
        with_inner_nodes, inner = "C3D8I", 3
        if name == with_inner_nodes and first_has(keyword, 1 + kind.nodes + inner):
            width += inner
        try:
            table = np.array(cells, dtype=np.int64)
        except ValueError as error:
            raise InputError(
                f"line {keyword.number}: *ELEMENT has an entry that is not an integer ({error}), "
                "so the file is damaged; export it again."
            ) from error
        if len(table) % width and kind.shape is LINE:
            # beams may have an extra node for their direction; this function omits all beams
            self._left_out[name] = self._left_out.get(name, 0) + len(keyword.lines)
            return
        if len(table) % width:
            raise InputError(
                f"line {keyword.number}: each element of type {name} needs {width} numbers, but "
                f"{len(table)} numbers are given in total, so the file is cut off or damaged; "
                "export the mesh again."
            )
        table = table.reshape(-1, width)
        part = self._parts[self._now]
        part.elements.append((kind, table[:, 0], table[:, 1 : 1 + kind.nodes]))
        if keyword.option("ELSET"):
            add_to(part.sets, ("ELSET", keyword.option("ELSET")), table[:, 0])


def _add_later(
    keyword: Keyword, instance: str, numbers: dict[str, dict[str, NumberIndex]], sets: Sets
) -> None:
    """Add a set of the assembly, from numbers or sets of an instance, or from named sets."""
    kind = keyword.name
    before = f"{instance}." if instance else ""
    named = [sets[key] for n in names_of(keyword) if (key := (kind, before + n.upper())) in sets]
    found = np.concatenate([NOBODY, *named])
    if instance in numbers:
        own = members_of(keyword, kind, {})
        found = np.concatenate([found, numbers[instance][kind].of(own, missing_is_fine=True)])
    add_to(sets, (kind, keyword.option(kind)), found)


def _moved(points: Floats, moves: Sequence[Iterable[str]], name: str) -> Floats:
    """Return the points of a part after the translation and rotation (degrees) of an instance."""
    try:
        rows = [list(map(float, row)) for row in moves if row]
    except ValueError as error:
        raise InputError(
            f"the instance '{name}' has a translation or rotation that is not a number, so the "
            "file is damaged; export it again."
        ) from error
    if rows:
        points = points + np.array((rows[0] + [0.0] * 3)[:3])
    if len(rows) > 1:
        if len(rows[1]) != 7:
            raise InputError(
                f"the instance '{name}' needs 7 numbers for its rotation, so the file is damaged; "
                "export it again."
            )
        start, end, angle = np.array(rows[1][:3]), np.array(rows[1][3:6]), math.radians(rows[1][6])
        axis = end - start
        length = float(np.linalg.norm(axis))
        if not length > 0:
            raise InputError(
                f"the instance '{name}' rotates about an axis of zero length, so the file is "
                "damaged; export it again."
            )
        k, r = axis / length, points - start
        along = (r @ k)[:, None] * k
        points = start + along + math.cos(angle) * (r - along) + math.sin(angle) * np.cross(k, r)
    return points
