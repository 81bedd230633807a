"""Write a loading bracket with two lugs as a STEP file: one part, four bolt holes, a bored clevis.

We designed it after the bracket of GE's challenge of 2013; it is smaller. It has a foot of
100×60×10 with bolt holes of radius 5, and two lugs with a bore of radius 8 (mm).
"""

import argparse
from pathlib import Path

from meshes.shapes import add_box
from perfplast_fenicsx.mesh import gmsh_session

LENGTH, WIDTH, FOOT = 100.0, 60.0, 10.0
"""Dimensions of the foot along x and y, and its thickness (mm)."""

LUG, GAP, TALL = 10.0, 20.0, 40.0
"""Thickness of a lug, distance between the lugs, and height of the bore's axis (mm)."""

BORE, EYE, BOLT = 8.0, 16.0, 5.0
"""Radii of the bore, of the round end of a lug, and of a bolt hole (mm)."""


def write_engine_bracket(path: str | Path) -> None:
    """Write the STEP file. Not collective.

    Args:
        path: The file to write.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        body = [add_box((-LENGTH / 2, -WIDTH / 2, 0.0), (LENGTH, WIDTH, FOOT))]
        for y in (-GAP / 2 - LUG, GAP / 2):
            shank = add_box((-EYE, y, FOOT), (2 * EYE, LUG, TALL - FOOT))
            eye = (3, occ.addCylinder(0.0, y, TALL, 0.0, LUG, 0.0, EYE))
            body = occ.fuse(body, [shank, eye])[0]
        holes = [(3, occ.addCylinder(0.0, -WIDTH, TALL, 0.0, 2 * WIDTH, 0.0, BORE))]
        for x in (-LENGTH / 2 + 14.0, LENGTH / 2 - 14.0):
            for y in (-WIDTH / 2 + 14.0, WIDTH / 2 - 14.0):
                holes.append((3, occ.addCylinder(x, y, -FOOT, 0.0, 0.0, 3 * FOOT, BOLT)))
        occ.cut(body, holes)
        occ.synchronize()
        gmsh.write(str(path))


def main() -> None:
    """Write the STEP file that the command line describes."""
    parser = argparse.ArgumentParser(description="Write a loading bracket with two lugs.")
    parser.add_argument("-o", "--output", dest="path", default="engine_bracket.step")
    write_engine_bracket(parser.parse_args().path)


if __name__ == "__main__":
    main()
