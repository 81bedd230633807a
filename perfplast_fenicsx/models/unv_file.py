"""Read a ``.unv`` file (I-DEAS universal file from Salome, NX, Femap) as a mesh with groups.

Lines with -1 enclose each dataset. Datasets 2411 and 781 contain nodes, 2412 contains elements, and
2467 and similar numbers contain groups (SDRC's universal file format). A mesh needs no other
datasets.
"""

import re
from pathlib import Path

import numpy as np

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.models.element_types import (
    HEXAHEDRON,
    LINE,
    QUADRILATERAL,
    TETRAHEDRON,
    TRIANGLE,
    WEDGE,
    Block,
    ElementType,
)
from perfplast_fenicsx.models.foreign_model import ForeignModel
from perfplast_fenicsx.models.grouped_model import GroupedMesh, model_of
from perfplast_fenicsx.models.number_text import (
    NOBODY,
    NumberIndex,
    real_numbers,
    text_of,
    whole_numbers,
)

NODES, ELEMENTS = ("2411", "781"), ("2412",)
GROUPS = ("2429", "2430", "2432", "2435", "2452", "2467", "2477")
"""Numbers of the datasets that are read."""


AROUND_3, AROUND_4 = [0, 2, 4, 1, 3, 5], [0, 2, 4, 6, 1, 3, 5, 7]
"""Places of the corners, then of the midside nodes, in quadratic elements of the file, which list
them alternately.
"""

FACES = {
    1: (ElementType(TRIANGLE, 3), [0, 1, 2]),
    2: (ElementType(TRIANGLE, 6), AROUND_3),
    4: (ElementType(QUADRILATERAL, 4), [0, 1, 2, 3]),
    5: (ElementType(QUADRILATERAL, 8), AROUND_4),
}
KINDS: dict[int, tuple[ElementType, list[int]]] = {
    **{of + one: kind for of in (40, 50, 60, 70, 80, 90) for one, kind in FACES.items()},
    111: (ElementType(TETRAHEDRON, 4), [0, 1, 2, 3]),
    112: (ElementType(WEDGE, 6), [0, 1, 2, 3, 4, 5]),
    113: (ElementType(WEDGE, 15), [0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8]),
    115: (ElementType(HEXAHEDRON, 8), [0, 1, 2, 3, 4, 5, 6, 7]),
    116: (
        ElementType(HEXAHEDRON, 20),
        [0, 2, 4, 6, 12, 14, 16, 18, 1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11],
    ),
    118: (ElementType(TETRAHEDRON, 10), [0, 2, 4, 9, 1, 3, 5, 6, 7, 8]),
    11: (ElementType(LINE, 2), [0, 1]),
    21: (ElementType(LINE, 2), [0, 1]),
    22: (ElementType(LINE, 3), [0, 2, 1]),
    24: (ElementType(LINE, 3), [0, 2, 1]),
}
"""Element types by descriptor, with the order of nodes: plane, thin, solid and line elements."""


def read_unv(path: Path) -> ForeignModel:
    """Return the model in a ``.unv`` file.

    Raises:
        InputError: If the file cannot be read, is damaged, or has no solids.
    """
    text = text_of(path)
    try:
        return model_of(_mesh(text))
    except InputError as error:
        raise InputError(f"'{path}': {error}") from error


def _mesh(text: str) -> GroupedMesh:
    datasets = _datasets(text)
    nodes = [lines for number, lines in datasets if number in NODES]
    if not nodes:
        raise InputError(
            "the file contains no nodes (dataset 2411 or 781), so it is not a mesh in the UNV "
            "format, or its version is too old; export the mesh again."
        )
    heads = np.concatenate([whole_numbers(lines[::2], "nodes") for lines in nodes])
    places = np.concatenate([real_numbers(lines[1::2], "nodes") for lines in nodes])
    if len(heads) % 4 or len(places) % 3 or len(heads) // 4 != len(places) // 3:
        raise InputError(
            "some nodes do not have 3 coordinates, so the file is cut off or "
            "damaged; export the mesh again."
        )
    points = NumberIndex(heads[::4], 0, "node")
    found = GroupedMesh(places.reshape(-1, 3), [])
    ids = [NOBODY]
    for number, lines in datasets:
        if number in ELEMENTS:
            ids += _elements(whole_numbers(lines, "elements"), points, found)
    of_elements = NumberIndex(np.concatenate(ids), 0, "element")
    for number, lines in datasets:
        if number in GROUPS:
            _groups(lines, points, of_elements, found)
    return found


def _datasets(text: str) -> list[tuple[str, list[str]]]:
    """Return the number and the lines of each dataset."""
    found = []
    for body in re.split(r"(?m)^ *-1 *\r?$", text)[1::2]:
        lines = body.strip("\r\n").splitlines()
        if lines:
            found.append((lines[0].strip(), lines[1:]))
    return found


def _elements(numbers: Longs, points: NumberIndex, found: GroupedMesh) -> list[Longs]:
    """Add a block for each run of elements of one kind to ``found``; return all their numbers."""
    ids, at = [], 0
    # count of numbers before the nodes of an element; the last such number is the number of nodes
    before_nodes = 6
    # line elements that have additional numbers, and the count of these numbers
    beams, of_beams = (11, 21, 22, 23, 24), 3
    while at + before_nodes <= len(numbers):
        kind, nodes = int(numbers[at + 1]), int(numbers[at + before_nodes - 1])
        first = before_nodes + (of_beams if kind in beams else 0)
        length = first + nodes
        table = numbers[at : at + (len(numbers) - at) // max(length, 1) * length]
        table = table.reshape(-1, max(length, 1))
        if nodes < 1 or not len(table):
            raise InputError("the elements are cut off or damaged; export the mesh again.")
        other = (table[:, 1] != kind) | (table[:, before_nodes - 1] != nodes)
        table = table[: int(np.argmax(other)) if other.any() else len(table)]
        at += table.size
        known = KINDS.get(kind)
        if known is None or known[0].nodes != nodes:
            name = f"{kind} with {nodes} nodes"
            found.left_out[name] = found.left_out.get(name, 0) + len(table)
            continue
        found.blocks.append(Block(known[0], found.count, points.of(table[:, first:])[:, known[1]]))
        ids.append(table[:, 0])
    if at < len(numbers):
        raise InputError("the last element is cut off; export the mesh again.")
    return ids


def _groups(
    lines: list[str], points: NumberIndex, elements: NumberIndex, found: GroupedMesh
) -> None:
    """Add the groups of a dataset to ``found``."""
    at = 0
    # codes of nodes and elements in groups, and the count of numbers in a line
    node, element, in_a_line = 7, 8, 8
    while at + 1 < len(lines):
        if not lines[at].strip():  # blank lines follow groups without members
            at += 1
            continue
        head, name = whole_numbers([lines[at]], "groups"), lines[at + 1].strip()
        count = int(head[-1]) if len(head) else -1
        if count < 0:
            raise InputError(f"the group '{name[:40]}' is damaged; export the mesh again.")
        what = f"members of '{name[:40]}'"
        first = whole_numbers(lines[at + 2 : at + 3], what) if count else NOBODY
        # Each member has its kind, its number and two zeros, and a line has two members. Older
        # datasets have no zeros.
        fields = 4 if len(first) > 2 and first[2] == 0 else 2
        tall = -(-count * fields // in_a_line)
        rows = whole_numbers(lines[at + 2 : at + 2 + tall], what)
        if len(rows) != fields * count:
            raise InputError(
                f"the group '{name[:40]}' is cut off or damaged; export the mesh again."
            )
        members = rows.reshape(count, -1) if count else np.zeros((0, 2), dtype=np.int64)
        for kind, index, groups in (
            (element, elements, found.groups),
            (node, points, found.node_groups),
        ):
            own = index.of(members[members[:, 0] == kind, 1], missing_is_fine=True)
            if len(own):
                groups[name] = np.union1d(groups.get(name, own), own)
        at += 2 + tall
