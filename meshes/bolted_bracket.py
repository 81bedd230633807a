"""Write a bracket bolted to a wall as a STEP file: ten named parts that fit each other.

The parts are ``wall``, ``bracket``, ``bolt_1`` to ``bolt_4`` and ``nut_1`` to ``nut_4`` (mm). The
wall is a plate at x < 0; the bracket's arm extends to x = REACH at mid-height. Bolts fill their
holes.
"""

import argparse
import re
from collections.abc import Sequence
from pathlib import Path

from meshes.shapes import add_box
from perfplast_fenicsx.mesh import gmsh_session

WALL, FOOT, RIB = 15.0, 12.0, 14.0
"""Thickness of the wall, of the bracket's foot and of its arm (mm)."""

HALF, REACH = 60.0, 120.0
"""Half of the side of the foot, and length of the arm from the wall (mm)."""

SHANK, HEAD, HEAD_HEIGHT = 6.0, 10.0, 8.0
"""Radius of a bolt, and radius and height of its head and of its nut (mm)."""

PLACES = [(y, z) for y in (-40.0, 40.0) for z in (-40.0, 40.0)]
"""Coordinates (y, z) of the bolts (mm)."""

PRODUCT = re.compile(r"Open CASCADE STEP translator [\d.]+ \d+\.(\d+)")
"""Pattern of OpenCASCADE's names for the parts of a file, which it numbers in each process."""


def write_bolted_bracket(path: str | Path) -> None:
    """Write the STEP file. Not collective.

    Args:
        path: The file to write.
    """
    names = ["wall", "bracket"]
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ

        def rod(x: float, length: float, radius: float, place: tuple[float, float]) -> int:
            return int(occ.addCylinder(x, *place, length, 0, 0, radius))

        holes = [(3, rod(-2 * WALL, 4 * WALL, SHANK, place)) for place in PLACES]
        wall = add_box((-WALL, -1.5 * HALF, -1.5 * HALF), (WALL, 3 * HALF, 3 * HALF))
        foot = add_box((0.0, -HALF, -HALF), (FOOT, 2 * HALF, 2 * HALF))
        arm = add_box((FOOT, -HALF / 2, -RIB / 2), (REACH - FOOT, HALF, RIB))
        parts = [occ.cut([wall], holes, removeTool=False)[0]]
        parts.append(occ.cut(occ.fuse([foot], [arm])[0], holes)[0])
        for k, place in enumerate(PLACES, start=1):
            shank = (3, rod(-WALL - HEAD_HEIGHT, WALL + HEAD_HEIGHT + FOOT, SHANK, place))
            parts.append(occ.fuse([shank], [(3, rod(FOOT, HEAD_HEIGHT, HEAD, place))])[0])
            names.append(f"bolt_{k}")
        for k, place in enumerate(PLACES, start=1):
            nut = (3, rod(-WALL - HEAD_HEIGHT, HEAD_HEIGHT, HEAD, place))
            hole = (3, rod(-WALL - HEAD_HEIGHT, HEAD_HEIGHT, SHANK, place))
            parts.append(occ.cut([nut], [hole])[0])
            names.append(f"nut_{k}")
        occ.synchronize()
        order = [tag for part in parts for _, tag in part]
        gmsh.write(str(path))
        written = [tag for _, tag in gmsh.model.getEntities(3)]
    _name(Path(path), [names[order.index(tag)] for tag in written])


def _name(path: Path, names: Sequence[str]) -> None:
    """Give the parts of a STEP file their names, which gmsh does not write."""
    text = path.read_text(encoding="ascii")
    path.write_text(PRODUCT.sub(lambda k: names[int(k[1]) - 1], text), encoding="ascii")


def main() -> None:
    """Write the STEP file that the command line describes."""
    parser = argparse.ArgumentParser(description="Write a bolted bracket of ten parts.")
    parser.add_argument("-o", "--output", dest="path", default="bolted_bracket.step")
    write_bolted_bracket(parser.parse_args().path)


if __name__ == "__main__":
    main()
