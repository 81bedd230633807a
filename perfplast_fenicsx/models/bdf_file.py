"""Read a Nastran bulk data file (``.bdf``, ``.nas``, ``.fem``) as a mesh with groups.

The fields of a card have 8 or 16 characters, or are separated by commas (MSC Nastran's quick
reference guide). Properties become bodies, and supports become groups of nodes.
"""

import re
from collections import Counter
from pathlib import Path

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.models.element_types import (
    HEXAHEDRON,
    PYRAMID,
    QUADRILATERAL,
    TETRAHEDRON,
    TRIANGLE,
    WEDGE,
    Block,
    Shape,
)
from perfplast_fenicsx.models.element_types import ElementType as Type
from perfplast_fenicsx.models.foreign_model import ForeignMaterial, ForeignModel
from perfplast_fenicsx.models.grouped_model import GroupedMesh, model_of
from perfplast_fenicsx.models.number_text import NumberIndex, text_of

ELEMENTS: dict[str, tuple[Shape, int]] = {
    "CTETRA": (TETRAHEDRON, 10),
    "CPYRAM": (PYRAMID, 13),
    "CPENTA": (WEDGE, 15),
    "CHEXA": (HEXAHEDRON, 20),
    "CTRIA3": (TRIANGLE, 3),
    "CTRIA6": (TRIANGLE, 6),
    "CQUAD4": (QUADRILATERAL, 4),
    "CQUAD8": (QUADRILATERAL, 8),
}
"""Shape of the elements of each card, and number of nodes of a quadratic element."""

TAKEN = {*ELEMENTS, "GRID", "PSOLID", "PSHELL", "MAT1", "SPC", "SPC1"}

NAMES = re.compile(
    r"^\$(?:HMNAME +(?:PROP|COMP) +(\d+) *\"([^\"]+)\"|ANSA_NAME\w*;(\d+);P\w+;([^;]+);"
    r"| *Femap Property (\d+) : (.+))",
    re.MULTILINE | re.IGNORECASE,
)
"""Pattern of the comments in which HyperMesh, ANSA and Femap write names of properties."""


EXPONENT = re.compile(r"(?<=[\d.])([+-]\d)")
"""Pattern of an exponent without a letter before it, as in 2.1+5."""

Cards = dict[str, list[list[str]]]


def read_bdf(path: Path) -> ForeignModel:
    """Return the model in a Nastran bulk data file.

    Raises:
        InputError: If the file cannot be read, is damaged, or has no solid elements.
    """
    text = text_of(path)
    try:
        return model_of(_mesh(text))
    except InputError as error:
        raise InputError(f"'{path}': {error}") from error


def _mesh(text: str) -> GroupedMesh:
    cards = _cards(text)
    if "GRID" not in cards:
        raise InputError(
            "there are no nodes (GRID), so this is not a Nastran bulk data file; give another file."
        )
    ids = _whole(cards["GRID"], 1, 2)[:, 0]
    systems = {row[2] for row in cards["GRID"] if len(row) > 2} - {"", "0"}
    if systems:
        raise InputError(
            f"nodes are given in the coordinate system {sorted(systems)[0]}; export the mesh in "
            "the basic coordinate system."
        )
    index = NumberIndex(ids, 0, "node")
    found = GroupedMesh(_real(cards["GRID"], 3, 6), [])
    names = {
        one or two or three: (a or b or c).strip()
        for one, a, two, b, three, c in NAMES.findall(text)
    }
    for card, (shape, most) in ELEMENTS.items():
        _elements(cards.get(card, []), shape, most, index, names, found)
    _materials(cards, names, found)
    for card in ("SPC", "SPC1"):
        _supports(card, cards.get(card, []), index, found)
    unknown = Counter({card: len(rows) for card, rows in cards.items() if card not in TAKEN})
    # cards that do not affect a limit load
    silent = {"BEGIN", "BEGIN BULK", "ENDDATA", "PARAM", "CORD2R", "SPCADD", "EIGRL"}
    for card, number in unknown.items():
        if card not in silent:
            found.remarks.append(f"{card} ({number} cards) has no counterpart and is ignored")
    return found


def _cards(text: str) -> Cards:
    """Return the fields of all cards by name of the card; field 0 is the name."""
    begin = re.search(r"(?im)^\s*BEGIN\b.*$", text)
    lines = text[begin.end() if begin else 0 :].splitlines()
    cards: Cards = {}
    row: list[str] | None = None
    # characters in a small or large field, and in all fields of a line
    small, large, last = 8, 16, 72
    for line in lines:
        body = line.split("$", 1)[0].rstrip().expandtabs(small)
        if not body:
            continue
        if "," in body:
            first, *fields = (cell.strip() for cell in body.split(","))
            fields = fields[:8]
        else:
            first, rest = body[:small].strip(), body[small:last]
            width = large if "*" in first else small
            fields = [rest[at : at + width].strip() for at in range(0, len(rest), width)]
            fields += [""] * ((last - small) // width - len(fields))
        name = first.rstrip("*_").upper()  # meshio writes CTETRA_
        if name == "ENDDATA":
            break
        if first[:1] in ("", "+", "*"):
            if row is None:
                raise InputError(
                    f"the line '{line[:30]}' is a continuation line without a line before it, so "
                    "the file is damaged; export it again."
                )
            row += fields
        else:
            row = [name, *fields]
            cards.setdefault(name, []).append(row)
    return cards


def _elements(
    rows: list[list[str]],
    shape: Shape,
    most: int,
    index: NumberIndex,
    names: dict[str, str],
    found: GroupedMesh,
) -> None:
    """Add a block of a card's elements with all midside nodes, and a block of the others."""
    quadratic = [len(row) > most + 2 and all(row[3 : most + 3]) for row in rows]
    for whole in (True, False):
        mine = [row for row, full in zip(rows, quadratic, strict=True) if full == whole]
        if not mine:
            continue
        count = most if whole else shape.corners
        table = _whole(mine, 2, count + 3)
        nodes = index.of(table[:, 1:])
        # Nastran lists the midside nodes of the vertical edges before the ones of the top face
        if count in (15, 20):
            base, edges = shape.corners, shape.corners // 2
            tops = [*range(base + 2 * edges, base + 3 * edges)]
            nodes = nodes[:, [*range(base + edges), *tops, *range(base + edges, base + 2 * edges)]]
        first = found.count
        found.blocks.append(Block(Type(shape, count), first, nodes))
        for number in np.unique(table[:, 0]):
            name = names.get(str(number), f"pid_{number}")
            members = first + np.flatnonzero(table[:, 0] == number)
            found.groups[name] = np.union1d(found.groups.get(name, members), members)


def _materials(cards: Cards, names: dict[str, str], found: GroupedMesh) -> None:
    """Add the MAT1 materials to which properties refer, by names of bodies."""
    known = {}
    for row in cards.get("MAT1", []):
        young, shear, poisson, density, expansion = _real([row], 2, 7)[0]
        if shear and not poisson and young:
            poisson = young / (2 * shear) - 1
        known[row[1]] = ForeignMaterial(
            young or None, poisson, density=density or None, expansion=expansion
        )
    for row in cards.get("PSOLID", []):
        name = names.get(row[1], f"pid_{row[1]}")
        if row[2] in known:
            found.materials[name] = known[row[2]]


def _supports(card: str, rows: list[list[str]], index: NumberIndex, found: GroupedMesh) -> None:
    """Add held nodes as groups; the user declares the supports in the case."""
    for row in rows:
        cells = [cell for cell in row[2:] if cell]
        if card == "SPC":
            some = [(cells[at + 1], [cells[at]]) for at in range(0, len(cells) - 1, 3)]
        elif len(cells) == 4 and cells[2].upper() == "THRU":
            numbers = range(int(cells[1]), int(cells[3]) + 1) if _are_whole(cells[1::2]) else []
            some = [(cells[0], [str(number) for number in numbers])]
        else:
            some = [(cells[0], cells[1:])] if cells else []
        for components, nodes in some:
            if not _are_whole(nodes) or not components.isdigit():
                raise InputError(
                    f"{card} has '{' '.join(cells)[:40]}' where numbers are expected, so the file "
                    "is damaged; export it again."
                )
            name = f"held_{components}_of_set_{row[1]}"
            own = index.of(np.array(nodes, dtype=np.int64), missing_is_fine=True)
            found.node_groups[name] = np.union1d(found.node_groups.get(name, own), own)


def _are_whole(cells: list[str]) -> bool:
    return all(cell.isdigit() for cell in cells)


def _whole(rows: list[list[str]], first: int, last: int) -> Longs:
    """Return fields as integers, with 0 for empty fields, shape (rows, last - first)."""
    try:
        table = [[int(cell or 0) for cell in row[first:last]] for row in rows]
        return np.array(table, dtype=np.int64).reshape(len(rows), last - first)
    except ValueError as error:
        raise InputError(
            f"{rows[0][0]} has fields that are not integers ({error}), so the file is damaged; "
            "export it again."
        ) from error


def _real(rows: list[list[str]], first: int, last: int) -> Floats:
    """Return fields as numbers, with 0 for empty fields, shape (rows, last - first)."""
    try:
        table = [[_number(cell) for cell in (row + [""] * last)[first:last]] for row in rows]
    except ValueError as error:
        raise InputError(
            f"{rows[0][0]} has fields that are not numbers ({error}), so the file is damaged; "
            "export it again."
        ) from error
    found = np.array(table)
    if not np.isfinite(found).all():
        raise InputError(
            f"{rows[0][0]} has numbers that are not finite, so the file is damaged; "
            "export it again."
        )
    return found


def _number(cell: str) -> float:
    try:
        return float(cell or 0)
    except ValueError:
        return float(EXPONENT.sub(r"e\1", cell.upper().replace("D", "E")))
