"""Define the arguments of ``perfplast mesh``."""

import argparse
from typing import Any


def add_mesh(commands: Any, scripts: argparse.ArgumentParser) -> None:
    """Add the command ``mesh``.

    Args:
        commands: The sub-parsers.
        scripts: Parser with the arguments of all commands that may run a script.
    """
    mesh = commands.add_parser(
        "mesh",
        parents=[scripts],
        help="turn a geometry, or a model of another program, into a mesh and a first case file",
        description="Read the bodies of a geometry file, find where they touch, and write "
        "DIR/case.msh and DIR/case.toml, in which you fill in materials, supports and "
        "loads. Lengths are in mm for STEP files. A model of another program (Abaqus, "
        "CalculiX: .inp; Salome: .med; I-DEAS: .unv; Nastran: .bdf; VTK: .vtu) already "
        "has a mesh: the command takes the mesh with its groups, and from an .inp file "
        "also materials, supports, loads, contacts and ties.",
    )
    mesh.add_argument(
        "geometry",
        metavar="DRAWING",
        help=".step, .stp, .brep, .iges, .igs, .geo; .inp, .med, .unv, .bdf, .nas, .fem, .vtu or"
        " .vtk",
    )
    mesh.add_argument("-o", "--output", metavar="DIR", required=True, help="output folder")
    mesh.add_argument("--force", action="store_true", help="replace mesh and case file in DIR")
    _add_sizes(mesh)
    _add_bodies(mesh)


def _add_sizes(mesh: argparse.ArgumentParser) -> None:
    """Add the options of the cells."""
    mesh.add_argument("--size", metavar="H", type=float, help="largest edge length")
    mesh.add_argument(
        "--size-of",
        metavar="BODY=H",
        action="append",
        default=[],
        help="largest edge length in one body (may be repeated)",
    )
    mesh.add_argument(
        "--curvature",
        metavar="N",
        type=float,
        help="number of elements around a circle (default: 10, or as many as make areas "
        "accurate to 1 %%)",
    )
    mesh.add_argument(
        "--order", type=int, choices=(1, 2), default=1, help="2 for curved elements (default: 1)"
    )
    mesh.add_argument(
        "--patience",
        metavar="S",
        type=float,
        default=600.0,
        help="largest time for meshing, in seconds (default: 600)",
    )


def _add_bodies(mesh: argparse.ArgumentParser) -> None:
    """Add the options of the bodies, and of what is between them."""
    mesh.add_argument(
        "--without",
        metavar="BODY",
        action="append",
        default=[],
        help="body to leave out, by its name (may be repeated)",
    )
    mesh.add_argument(
        "--symmetry",
        metavar="AXIS=X",
        action="append",
        default=[],
        help="plane of symmetry, such as x=0; the half with positive coordinates is kept (may "
        "be repeated)",
    )
    mesh.add_argument(
        "--apart",
        action="store_true",
        help="mesh each body separately; contact is then mortar, even where bodies share a "
        "face in the drawing",
    )
    mesh.add_argument(
        "--overlap",
        metavar="SHARE",
        type=float,
        default=1e-3,
        help="largest share of a body's volume that another body may overlap (default: 0.001)",
    )
    mesh.add_argument(
        "--close-gaps",
        metavar="GAP",
        type=float,
        default=0.0,
        help="largest distance at which faces of bodies still touch (default: 0)",
    )
    mesh.add_argument(
        "--material",
        metavar="NAME",
        help="material of all bodies (perfplast materials lists the names)",
    )
    glued = mesh.add_mutually_exclusive_group()
    glued.add_argument(
        "--glued", "--tied", dest="tied", action="store_true", help="glue bodies that touch"
    )
    glued.add_argument("--bolted", action="store_true", help="glue only bolts to their nuts")
