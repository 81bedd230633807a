"""Read a ``.vtu`` or ``.vtk`` file as a mesh with groups.

These files have no names of bodies and surfaces, but arrays of integers at cells or points. Each
number in an array defines a group: the number 3 in the array "region" defines ``region_3``.
"""

import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.environment import environment_for_gmsh
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
from perfplast_fenicsx.proof.stored_file import check_regular

KINDS = {
    **{3: ElementType(LINE, 2), 21: ElementType(LINE, 3)},
    **{5: ElementType(TRIANGLE, 3), 22: ElementType(TRIANGLE, 6)},
    **{9: ElementType(QUADRILATERAL, 4), 23: ElementType(QUADRILATERAL, 8)},
    **{28: ElementType(QUADRILATERAL, 9), 10: ElementType(TETRAHEDRON, 4)},
    **{24: ElementType(TETRAHEDRON, 10), 12: ElementType(HEXAHEDRON, 8)},
    **{25: ElementType(HEXAHEDRON, 20), 29: ElementType(HEXAHEDRON, 27)},
    **{13: ElementType(WEDGE, 6), 26: ElementType(WEDGE, 15)},
    **{14: ElementType(PYRAMID, 5), 27: ElementType(PYRAMID, 13)},
}
"""Element types by VTK's numbers; the nodes have the order of Abaqus."""


USUAL = ("gmsh:physical", "CellEntityIds", "medit:ref", "region", "material", "part")
"""Arrays that define groups in files from gmsh, meshio and others. If a file has none of them,
another array is used."""


def read_vtu(path: Path) -> ForeignModel:
    """Return the model in a ``.vtu`` or ``.vtk`` file.

    Raises:
        InputError: If the file cannot be read, is damaged, or has no solids.
    """
    try:
        check_regular(path)
        with path.open("rb") as opened:
            opened.read(1)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror}; check the path.") from error
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "mesh.npz"
        program = Path(__file__).with_name("vtk_dump.py")
        command = [sys.executable, "-P", str(program), str(path.absolute()), str(target)]
        most_seconds = 600  # time limit of VTK
        try:
            done = subprocess.run(
                command,
                env=environment_for_gmsh(Path(folder)),
                stdin=subprocess.DEVNULL,
                capture_output=True,
                check=False,
                timeout=most_seconds,
            )
        except subprocess.TimeoutExpired as error:
            raise InputError(
                f"VTK did not read '{path}' within {most_seconds} s; export a smaller mesh."
            ) from error
        if done.returncode or not target.exists():
            how = f"exit status {done.returncode}"
            if done.returncode < 0:
                how = signal.strsignal(-done.returncode) or how
            raise InputError(
                f"VTK cannot read '{path}' ({how.lower()}), so the file may be damaged; export the "
                "mesh again."
            )
        with np.load(target) as arrays:
            try:
                return model_of(_mesh(arrays))
            except InputError as error:
                raise InputError(f"'{path}': {error}") from error


def _mesh(arrays: Any) -> GroupedMesh:
    kinds, offsets, nodes = arrays["kinds"], arrays["offsets"], arrays["nodes"]
    found = GroupedMesh(arrays["points"], [])
    if not np.isfinite(found.points).all():
        raise InputError("nodes have coordinates that are not finite; export the mesh again.")
    places = np.full(len(kinds), -1)
    points = (1, 2)  # point elements, which have no meaning here
    for number in np.unique(kinds):
        mine = np.flatnonzero(kinds == number)
        kind = KINDS.get(int(number))
        if kind is None:
            if number not in points:
                found.left_out[f"VTK {number}"] = len(mine)
            continue
        if not (np.diff(offsets)[mine] == kind.nodes).all():
            raise InputError(
                f"cells of VTK's type {number} do not have {kind.nodes} nodes each; export the "
                "mesh again."
            )
        table = nodes[offsets[mine][:, None] + np.arange(kind.nodes)]
        if table.size and not 0 <= table.min() <= table.max() < len(found.points):
            raise InputError("cells refer to points that do not exist; export the mesh again.")
        places[mine] = found.count + np.arange(len(mine))
        found.blocks.append(Block(kind, found.count, table))
    for where, groups in (("cell", found.groups), ("point", found.node_groups)):
        _group(arrays, where, places, groups, found.remarks)
    return found


def _group(
    arrays: Any, where: str, places: Longs, groups: dict[str, Longs], remarks: list[str]
) -> None:
    """Add groups of cells or points, which the numbers in one array define."""
    found = {
        str(arrays[f"{key}_name"]): arrays[key]
        for key in arrays.files
        if key.startswith(where) and key[-1].isdigit()
    }
    # an array with more different numbers does not define groups, but numbers cells
    most_groups = 200
    usable = {
        name: values for name, values in found.items() if 1 < len(np.unique(values)) <= most_groups
    }
    if not usable:
        return
    name = next((one for one in USUAL if one in usable), next(iter(usable)))
    if len(usable) > 1:
        others = ", ".join(repr(one) for one in usable if one != name)
        remarks.append(
            f"groups of {where}s come from the array '{name}'; other arrays ({others}) are ignored"
        )
    for number in np.unique(usable[name]):
        members = np.flatnonzero(usable[name] == number)
        members = places[members] if where == "cell" else members
        members = members[members >= 0]
        if len(members) and (where == "cell" or number):  # at points, 0 means no group
            groups[f"{name}_{number}"] = members
