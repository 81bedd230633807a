"""Define a mesh in all formats for several tests: two bodies of one hexahedron each.

One body lies on the other, and they share four nodes. Surfaces are foot, top and a side of both.
"""

from pathlib import Path
from typing import Any

import h5py
import numpy as np

POINTS = np.array([[x, y, z] for z in (0.0, 1.0, 2.5) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))])
SOLIDS = np.array([[0, 1, 2, 3, 4, 5, 6, 7], [4, 5, 6, 7, 8, 9, 10, 11]])
FACES = np.array([[0, 1, 2, 3], [8, 9, 10, 11], [0, 1, 5, 4], [4, 5, 9, 8], [4, 5, 6, 7]])
"""Foot, top, a side of each body, and the face between the bodies."""

GROUPS = {"lower": [0], "Upper": [1], "all": [0, 1]}
FACE_GROUPS = {"foot": [0], "Top": [1], "side": [2, 3], "between": [4]}
NODE_GROUPS = {"footNodes": [0, 1, 2, 3], "edge": [0, 4]}


def _families(parts: dict[str, list[int]], count: int, first: int) -> tuple[np.ndarray, dict]:
    """Return a family for each combination of groups with an element or node."""
    own = [tuple(name for name, members in parts.items() if k in members) for k in range(count)]
    kinds = {groups: first - k for k, groups in enumerate(dict.fromkeys(filter(None, own)))}
    return np.array([kinds.get(groups, 0) for groups in own]), {n: g for g, n in kinds.items()}


def write_med(path: Path, real: str = "<f8", whole: str = "<i4", old: bool = False) -> Path:
    """Write a MED file in the form of Salome.

    Args:
        path: The file.
        real: Kind of its coordinates, ">f8" as of another machine.
        whole: Kind of its whole numbers.
        old: Whether to write MED 2.3, without steps, and with families in the mesh.
    """
    with h5py.File(path, "w") as file:
        mesh: Any = file.create_group("ENS_MAA/Mesh_1")
        mesh.attrs.update({"DIM": 3, "ESP": 3})
        names = file.create_group("ENS_MAA/Mesh_1/FAS" if old else "FAS/Mesh_1")
        if not old:
            mesh = mesh.create_group("-0000000000000000001-0000000000000000001")
        mesh["NOE/COO"] = POINTS.T.ravel().astype(real)
        mesh["NOE/COO"].attrs["NBR"] = len(POINTS)
        first = -1
        for kind, table, groups in (("HE8", SOLIDS, GROUPS), ("QU4", FACES, FACE_GROUPS)):
            own, families = _families(groups, len(table), first)
            first -= len(families)
            mesh[f"MAI/{kind}/NOD"] = (table.T.ravel() + 1).astype(whole)
            mesh[f"MAI/{kind}/NOD"].attrs["NBR"] = len(table)
            mesh[f"MAI/{kind}/FAM"] = own.astype(whole)
            _write_families(names, "ELEME", families)
        own, families = _families(NODE_GROUPS, len(POINTS), 100)
        mesh["NOE/FAM"] = own.astype(whole)
        _write_families(names, "NOEUD", families)
    return path


def _write_families(names: Any, of: str, families: dict[int, tuple[str, ...]]) -> None:
    for number, groups in families.items():
        family = names.create_group(f"{of}/FAM_{number}")
        family.attrs["NUM"] = number
        text = np.zeros((len(groups), 80), dtype=np.int8)
        for row, group in zip(text, groups, strict=True):
            row[: len(group.encode())] = list(group.encode())
        kind = h5py.h5t.array_create(h5py.h5t.NATIVE_INT8, (80,))
        space = h5py.h5s.create_simple((len(groups),))
        data = h5py.h5d.create(family.create_group("GRO").id, b"NOM", kind, space)
        data.write(h5py.h5s.ALL, h5py.h5s.ALL, text, mtype=kind)
        family["GRO"].attrs["NBR"] = len(groups)


def unv_text(fields: int = 4) -> str:
    """Return a UNV file in Salome's form; with ``fields`` 2 groups are as in older datasets."""
    text = "    -1\n   164\n         1  SI\n    -1\n    -1\n  2411\n"
    for k, place in enumerate(POINTS, start=11):
        text += f"{k:10}{1:10}{1:10}{11:10}\n" + "".join(f"{x:25.16E}" for x in place) + "\n"
    text = text.replace("E+", "D+") + "    -1\n    -1\n  2412\n"
    text += f"{1:10}{21:10}{2:10}{1:10}{7:10}{2:10}\n{0:10}{1:10}{1:10}\n{11:10}{12:10}\n"
    for k, nodes in enumerate([*FACES, *SOLIDS], start=2):
        kind = 44 if len(nodes) == 4 else 115
        text += f"{k:10}{kind:10}{2:10}{1:10}{7:10}{len(nodes):10}\n"
        text += "".join(f"{node + 11:10}" for node in nodes) + "\n"
    text += f"    -1\n    -1\n  {2467 if fields == 4 else 2435}\n"
    groups = [(name, 8, [m + 2 for m in members]) for name, members in FACE_GROUPS.items()]
    groups += [(name, 8, [m + 7 for m in members]) for name, members in GROUPS.items()]
    groups += [(name, 7, [m + 11 for m in members]) for name, members in NODE_GROUPS.items()]
    text += f"{9:10}" + f"{0:10}" * 7 + "\nempty\n\n"
    for k, (name, kind, members) in enumerate(groups, start=1):
        text += f"{k:10}" + f"{0:10}" * 6 + f"{len(members):10}\n{name}\n"
        cells = [[kind, member, 0, 0][:fields] for member in members]
        lines = [cells[at : at + 8 // fields] for at in range(0, len(cells), 8 // fields)]
        text += "".join(
            "".join(f"{number:10}" for cell in line for number in cell) + "\n" for line in lines
        )
    return text + "    -1\n"


def bdf_text(comma: bool = False, long: bool = False) -> str:
    """Return a BDF file in HyperMesh's form: narrow or wide fields, or fields between commas."""

    def card(name: str, *cells: object) -> str:
        texts = ["" if cell is None else f"{cell}" for cell in cells]
        if comma:
            rows = [texts[at : at + 8] for at in range(0, len(texts), 8)]
            return (
                "\n".join(",".join(["" if k else name, *row]) for k, row in enumerate(rows)) + "\n"
            )
        wide, many = (16, 4) if long else (8, 8)
        rows = [texts[at : at + many] for at in range(0, len(texts), many)]
        star = "*" if long else ""
        return "".join(
            f"{(star or '+') if k else name + star:8}" + "".join(f"{c:{wide}}" for c in row) + "\n"
            for k, row in enumerate(rows)
        )

    text = 'SOL 101\nCEND\nBEGIN BULK\n$ a comment\n$HMNAME PROP        1"lower" 4\n'
    text += '$HMNAME COMP        2"Upper"\n'
    for k, (x, y, z) in enumerate(POINTS, start=11):
        text += card("GRID", k, None, x, y, "2.5+0" if z == 2.5 else z)
    for k, nodes in enumerate(SOLIDS, start=1):
        text += card("CHEXA", k, k, *(nodes + 11))
    for k, nodes in enumerate(FACES[:2], start=11):
        text += card("CQUAD4", k, k, *(nodes + 11))
    text += card("PSOLID", 1, 5) + card("PSOLID", 2, 5)
    text += card("MAT1", 5, "2.1+5", None, 0.3, "7.85-9")
    text += card("SPC1", 1, 123, 11, 12, 13, 14) + card("FORCE", 2, 23, 0, 1.0, 0.0, 0.0, 1.0)
    return text + "ENDDATA\n"
