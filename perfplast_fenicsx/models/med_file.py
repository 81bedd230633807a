"""Read a ``.med`` file from Salome or Code_Aster as a mesh with groups.

The format is HDF5 (MED 2.3 to 4, https://docs.salome-platform.org). ``ENS_MAA`` contains the nodes
and elements of a mesh, each with the number of its family. ``FAS`` contains the families, each with
the names of its groups.
"""

from pathlib import Path
from typing import Any

import numpy as np

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.models.element_types import (
    HEXAHEDRON,
    LINE,
    PYRAMID,
    QUADRILATERAL,
    TETRAHEDRON,
    TRIANGLE,
    WEDGE,
    Block,
    ElementType,
)
from perfplast_fenicsx.models.foreign_model import ForeignModel
from perfplast_fenicsx.models.grouped_model import GroupedMesh, model_of
from perfplast_fenicsx.proof.stored_file import check_regular, stored_file

TYPES = {
    **{"TE4": ElementType(TETRAHEDRON, 4), "T10": ElementType(TETRAHEDRON, 10)},
    **{"HE8": ElementType(HEXAHEDRON, 8), "H20": ElementType(HEXAHEDRON, 20)},
    **{"H27": ElementType(HEXAHEDRON, 27), "PE6": ElementType(WEDGE, 6)},
    **{"P15": ElementType(WEDGE, 15), "P18": ElementType(WEDGE, 18)},
    **{"PY5": ElementType(PYRAMID, 5), "P13": ElementType(PYRAMID, 13)},
    **{"TR3": ElementType(TRIANGLE, 3), "TR6": ElementType(TRIANGLE, 6)},
    **{"TR7": ElementType(TRIANGLE, 7), "QU4": ElementType(QUADRILATERAL, 4)},
    **{"QU8": ElementType(QUADRILATERAL, 8), "QU9": ElementType(QUADRILATERAL, 9)},
    **{"SE2": ElementType(LINE, 2), "SE3": ElementType(LINE, 3), "SE4": ElementType(LINE, 4)},
}
"""Element types by MED's names; the nodes have the order of Abaqus."""


SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""First bytes of an HDF5 file."""


def read_med(path: Path) -> ForeignModel:
    """Return the model in a ``.med`` file.

    Raises:
        InputError: If the file cannot be read, is damaged, or has no solids.
    """
    try:
        check_regular(path)
        with path.open("rb") as opened:
            if opened.read(len(SIGNATURE)) != SIGNATURE:
                raise InputError(
                    f"'{path}' is not an HDF5 file, so it is not a MED file; export the mesh again."
                )
        with stored_file(path) as file:
            return model_of(_mesh(file))
    except InputError as error:
        raise error if str(path) in str(error) else InputError(f"'{path}': {error}") from error
    except OSError as error:
        reason = error.strerror or "it is cut off or damaged"
        raise InputError(f"'{path}' cannot be read: {reason}; export the mesh again.") from error
    except (KeyError, ValueError, TypeError, RuntimeError, AttributeError, MemoryError) as error:
        raise InputError(
            f"'{path}' is not a MED file of a supported version ({_line(error)}); export the mesh "
            "again."
        ) from error


def _line(error: Exception) -> str:
    return " ".join(str(error).strip("'\"").split())[:200]


def _mesh(file: Any) -> GroupedMesh:
    meshes = sorted(file["ENS_MAA"]) if "ENS_MAA" in file else []
    if not meshes:
        raise InputError(
            "the file contains no mesh; export the mesh, not only the study or results."
        )
    name, remarks = meshes[0], []
    if len(meshes) > 1:
        remarks.append(f"of the meshes {', '.join(map(repr, meshes))} only the first one is read")
    mesh = file["ENS_MAA"][name]
    if "NOE" not in mesh:  # since MED 3, a mesh contains time steps, which contain the nodes
        steps = sorted(step for step in mesh if "NOE" in mesh[step])
        if not steps:
            raise InputError(f"the mesh '{name}' has no nodes; export it again.")
        mesh = mesh[steps[0]]
    places = np.asarray(mesh["NOE"]["COO"][()], dtype=np.float64)
    space = int(file["ENS_MAA"][name].attrs.get("ESP", file["ENS_MAA"][name].attrs["DIM"]))
    count = int(mesh["NOE"]["COO"].attrs.get("NBR", len(places) // max(space, 1)))
    if space not in (2, 3) or count * space != len(places) or not np.isfinite(places).all():
        raise InputError(
            f"the nodes of the mesh '{name}' do not have {space} finite coordinates each; export "
            "the mesh again."
        )
    points = np.zeros((count, 3))
    points[:, :space] = places.reshape(space, count).T
    found = GroupedMesh(points, [], remarks=remarks)
    of_elements: Longs = (
        _elements(mesh["MAI"], found) if "MAI" in mesh else np.zeros(0, dtype=np.int64)
    )
    every = file["FAS"][name] if "FAS" in file else file["ENS_MAA"][name].get("FAS", {})
    _group(every.get("ELEME", every), of_elements, found.groups)
    if "FAM" in mesh["NOE"]:
        own = np.asarray(mesh["NOE"]["FAM"][()], dtype=np.int64)
        _group(every.get("NOEUD", every), own, found.node_groups)
    return found


def _elements(kinds: Any, found: GroupedMesh) -> Longs:
    """Add the elements to ``found``, and return the family of each element."""
    families: list[Longs] = [np.zeros(0, dtype=np.int64)]
    point = "PO1"  # point elements, which a model does not need
    for name in sorted(kinds):
        kind = TYPES.get(name)
        flat = np.asarray(kinds[name]["NOD"][()], dtype=np.int64)
        if kind is None:
            if name != point:
                number = int(kinds[name]["NOD"].attrs.get("NBR", 1))
                found.left_out[name] = number
            continue
        nodes = flat.reshape(kind.nodes, -1).T - 1
        if nodes.size and not 0 <= nodes.min() <= nodes.max() < len(found.points):
            raise InputError(
                f"elements of type {name} refer to nodes that do not exist; export the mesh again."
            )
        own: Longs = np.zeros(len(nodes), dtype=np.int64)
        if "FAM" in kinds[name]:
            own = np.asarray(kinds[name]["FAM"][()], dtype=np.int64)
        if len(own) != len(nodes):
            raise InputError(
                f"there are {len(nodes)} elements of type {name}, but {len(own)} family numbers "
                "for them; export the mesh again."
            )
        found.blocks.append(Block(kind, found.count, nodes))
        families.append(own)
    return np.concatenate(families)


def _group(families: Any, own: Longs, groups: dict[str, Longs]) -> None:
    """Add the members of each family to the groups that the family names."""
    for family in families.values():
        if "GRO" not in family or "NUM" not in family.attrs:
            continue
        members = np.flatnonzero(own == int(family.attrs["NUM"]))
        for name in family["GRO"]["NOM"][()].astype(np.int8):
            text = name.tobytes().split(b"\0")[0].decode("utf-8", "replace").strip()
            if len(members) and text:
                groups[text] = np.union1d(groups.get(text, members), members)
