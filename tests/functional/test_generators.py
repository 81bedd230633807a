"""Test the mesh generators in meshes/: names, sizes, matching surfaces, curves."""

import runpy
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import asin, cos, pi, sin, sqrt, tan
from pathlib import Path

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import pytest
from dolfinx.mesh import entities_to_geometry

from meshes.ball_in_socket import write_ball_in_socket
from meshes.beam_on_prop import write_beam_on_prop
from meshes.contact_patch import write_contact_patch
from meshes.corner_seat import LEG, write_corner_seat
from meshes.cracked_strip import write_cracked_strip
from meshes.fanned_footing import write_fanned_footing
from meshes.footing import write_footing
from meshes.hertz_line import ARC, write_hertz_line
from meshes.hertz_sphere import CAP, write_hertz_sphere
from meshes.hollow_shaft import write_hollow_shaft
from meshes.loaded_beam import write_loaded_beam
from meshes.plate_with_hole import write_plate_with_hole
from meshes.platens import PLATEN, write_platens
from meshes.retaining_wall import write_retaining_wall
from meshes.ring import write_ring
from meshes.rough_cube import HALF, write_rough_cube
from meshes.rough_cube import PLATEN as LAYER
from meshes.round_hole import write_round_hole
from meshes.sectors import (
    write_blocks_half,
    write_bracket_half,
    write_cantilever_quarter,
    write_cube_sector,
    write_patch_edge_sector,
    write_patch_sector,
    write_plate_sector,
    write_prop_half,
    write_punch_sector,
)
from meshes.shaft import write_shaft
from meshes.sphere_sector import write_sphere_sector
from meshes.square_bar import write_square_bar
from meshes.square_footing import DEPTH as BELOW
from meshes.square_footing import WIDTH as BROAD
from meshes.square_footing import write_square_footing
from meshes.square_punch import DEPTH as DEEP
from meshes.square_punch import PUNCH, write_square_punch
from meshes.square_punch import WIDTH as GROUND
from meshes.strip_footing import DEPTH, WIDTH, write_strip_footing
from meshes.thick_sphere import write_thick_sphere
from meshes.thick_tube import write_thick_tube
from meshes.tube_polygon import write_tube_polygon
from perfplast_fenicsx.compat import geometry_dofmap
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh, read_gmsh
from tests.mesh.test_meshes import area_vector, check_interface, in_order, surface_nodes, volume

pytestmark = pytest.mark.serial


@dataclass
class Case:
    """A generator with the required properties of its mesh.

    Attributes:
        write: The generator.
        arguments: Its arguments.
        volumes: Volume by name, of the true bodies.
        areas: Area vector ∫ n ds by name.
        pairs: Matching surfaces.
        rel: Relative error that the geometry may have.
        gdim: Dimension of the mesh.
    """

    write: Callable[..., None]
    arguments: dict[str, object]
    volumes: dict[str, float]
    areas: dict[str, tuple[float, ...]]
    pairs: list[tuple[str, str]] = field(default_factory=list)
    rel: float = 1e-12
    gdim: int = 2

    def __str__(self) -> str:
        options = [f"{key}={value}" for key, value in self.arguments.items() if key != "size"]
        return "-".join([self.write.__name__.removeprefix("write_"), *options])

    def read(self, comm: MPI.Intracomm, folder: Path, **changes: object) -> TaggedMesh:
        """Write the mesh on rank 0, and read it on all ranks."""
        path = folder / "mesh.msh"
        if comm.rank == 0:
            self.write(path, **self.arguments | changes)
        comm.barrier()
        return read_gmsh(comm, path, self.gdim)


def meshed_apart(case: Case) -> Case:
    """Return the same bodies, meshed separately, so their nodes do not match."""
    return replace(case, arguments=case.arguments | {"finer": 1.5}, pairs=[])


quarter = pi / 4
arc_height = 1 - sqrt(1 - ARC**2)
cap_side = (asin(CAP) - CAP * sqrt(1 - CAP**2)) / 2  # the cap, projected along x or y
TUBES = Case(
    write_thick_tube,
    {"outer": 2.0, "interface": 1.5, "size": 0.2, "order": 2},
    {"inner_tube": quarter * (1.5**2 - 1), "outer_tube": quarter * (4 - 1.5**2)},
    {
        "inner": (-1, -1),
        "outer": (2, 2),
        "x0": (-1, 0),
        "y0": (0, -1),
        "inner_tube_seam": (1.5, 1.5),
        "outer_tube_seam": (-1.5, -1.5),
    },
    [("inner_tube_seam", "outer_tube_seam")],
    rel=1e-4,
)
PUNCH_ON_GROUND = Case(
    write_strip_footing,
    {"punch": True, "size": 0.5, "order": 2},
    {"ground": WIDTH * DEPTH, "punch": 1},
    {
        "x0": (-DEPTH - 1, 0),
        "bottom": (0, -WIDTH),
        "side": (DEPTH, 0),
        "free": (0, WIDTH - 1),
        "top": (0, 1),
        "ground_footing": (0, 1),
        "punch_footing": (0, -1),
    },
    [("ground_footing", "punch_footing")],
)
HALF_CYLINDERS = Case(
    write_hertz_line,
    {"contact_size": 0.05, "bodies": 2, "order": 2},
    {"lower": quarter, "upper": quarter},
    {
        "x0": (-2, 0),
        "top": (0, 1),
        "bottom": (0, -1),
        "upper_arc": (arc_height, -ARC),
        "upper_free": (1 - arc_height, ARC - 1),
        "lower_arc": (arc_height, ARC),
        "lower_free": (1 - arc_height, 1 - ARC),
    },
    rel=1e-5,
)
CASES = [
    Case(
        write_thick_tube,
        {"size": 0.1},
        {"tube": quarter * (1.3**2 - 1)},
        {"inner": (-1, -1), "outer": (1.3, 1.3), "x0": (-0.3, 0), "y0": (0, -0.3)},
        rel=4e-3,
    ),
    TUBES,
    meshed_apart(TUBES),
    Case(
        write_thick_sphere,
        {"size": 0.4},
        {"shell": pi / 6 * 7},
        {
            "inner": (-quarter,) * 3,
            "outer": (4 * quarter,) * 3,
            "x0": (-3 * quarter, 0, 0),
            "y0": (0, -3 * quarter, 0),
            "z0": (0, 0, -3 * quarter),
        },
        rel=5e-2,
        gdim=3,
    ),
    Case(
        write_thick_sphere,
        {"interface": 1.5, "size": 0.4, "order": 2},
        {"inner_shell": pi / 6 * (1.5**3 - 1), "outer_shell": pi / 6 * (8 - 1.5**3)},
        {
            "inner": (-quarter,) * 3,
            "outer": (4 * quarter,) * 3,
            "x0": (-3 * quarter, 0, 0),
            "y0": (0, -3 * quarter, 0),
            "z0": (0, 0, -3 * quarter),
            "inner_shell_seam": (1.5**2 * quarter,) * 3,
            "outer_shell_seam": (-(1.5**2) * quarter,) * 3,
        },
        [("inner_shell_seam", "outer_shell_seam")],
        rel=2e-3,
        gdim=3,
    ),
    Case(
        write_rough_cube,
        {"size": 0.25},
        {"cube": HALF**3, "platen": HALF**2 * LAYER},
        {
            "x0": (HALF * (HALF + LAYER), 0, 0),
            "y0": (0, HALF * (HALF + LAYER), 0),
            "z0": (0, 0, -(HALF**2)),
            "top": (0, 0, HALF**2),
        },
        gdim=3,
    ),
    Case(
        write_rough_cube,
        {"size": 0.25, "platen": False},
        {"cube": HALF**3},
        {
            "x0": (HALF**2, 0, 0),
            "y0": (0, HALF**2, 0),
            "z0": (0, 0, -(HALF**2)),
            "top": (0, 0, HALF**2),
        },
        gdim=3,
    ),
    Case(
        write_rough_cube,
        {"size": 0.25, "half": True},
        {"cube": HALF**3 / 2, "platen": HALF**2 * LAYER / 2},
        {
            "x0": (HALF * (HALF + LAYER), 0, 0),
            "diagonal": (-HALF * (HALF + LAYER), HALF * (HALF + LAYER), 0),
            "z0": (0, 0, -(HALF**2) / 2),
            "top": (0, 0, HALF**2 / 2),
        },
        gdim=3,
    ),
    Case(
        write_square_footing,
        {"cells": 3, "eighth": True},
        {"ground": BROAD**2 * BELOW / 2},
        {
            "diagonal": (-BROAD * BELOW, BROAD * BELOW, 0),
            "y0": (0, -BROAD * BELOW, 0),
            "bottom": (0, 0, -(BROAD**2) / 2),
            "sides": (BROAD * BELOW, 0, 0),
            "footing": (0, 0, 0.5),
        },
        gdim=3,
    ),
    Case(
        write_square_footing,
        {"cells": 3, "layers": 2},
        {"ground": BROAD**2 * BELOW},
        {
            "x0": (-BROAD * BELOW, 0, 0),
            "y0": (0, -BROAD * BELOW, 0),
            "bottom": (0, 0, -(BROAD**2)),
            "sides": (BROAD * BELOW, BROAD * BELOW, 0),
            "footing": (0, 0, 1),
        },
        gdim=3,
    ),
    Case(
        write_square_punch,
        {"size": 1.0},
        {"ground": GROUND**2 * DEEP, "punch": PUNCH},
        {
            "x0": (-GROUND * DEEP - PUNCH, 0, 0),
            "y0": (0, -GROUND * DEEP - PUNCH, 0),
            "bottom": (0, 0, -(GROUND**2)),
            "sides": (GROUND * DEEP, GROUND * DEEP, 0),
            "top": (0, 0, 1),
            "ground_seam": (0, 0, 1),
            "punch_seam": (0, 0, -1),
        },
        [("ground_seam", "punch_seam")],
        gdim=3,
    ),
    Case(
        write_square_punch,
        {"size": 1.0, "eighth": True},
        {"ground": GROUND**2 * DEEP / 2, "punch": PUNCH / 2},
        {
            "diagonal": (-GROUND * DEEP - PUNCH, GROUND * DEEP + PUNCH, 0),
            "y0": (0, -GROUND * DEEP - PUNCH, 0),
            "bottom": (0, 0, -(GROUND**2) / 2),
            "sides": (GROUND * DEEP, 0, 0),
            "top": (0, 0, 0.5),
            "ground_seam": (0, 0, 0.5),
            "punch_seam": (0, 0, -0.5),
        },
        [("ground_seam", "punch_seam")],
        gdim=3,
    ),
    Case(
        write_cantilever_quarter,
        {},
        {"beam": 1.25},
        {"wall": (-0.25, 0, 0), "end": (0.25, 0, 0), "y0": (0, -2.5, 0), "z0": (0, 0, -2.5)},
        gdim=3,
    ),
    Case(
        write_plate_sector,
        {},
        {"plate": 6.25},
        {
            "y0": (0, -2.5, 0),
            "oblique": (-2.5, 2.5, 0),
            "edge": (2.5, 0, 0),
            "top": (0, 0, 12.5),
            "z0": (0, 0, -12.5),
        },
        gdim=3,
    ),
    Case(
        write_cube_sector,
        {},
        {"cube": 0.0625},
        {
            "oblique": (-0.25, 0.25, 0),
            "x0": (0.25, 0, 0),
            "top": (0, 0, 0.125),
            "z0": (0, 0, -0.125),
        },
        gdim=3,
    ),
    Case(
        write_patch_sector,
        {},
        {"ground": 9.0},
        {"oblique": (-6, 6, 0), "held": (6, 0, -4.5), "y0": (0, -6, 0), "top": (0, 0, 0.5)},
        gdim=3,
    ),
    Case(
        write_patch_edge_sector,
        {},
        {"ground": 9.0},
        {"oblique": (-6, 6, 0), "held": (6, 0, -4.5), "y0": (0, -6, 0), "top": (0, 0, 0.5)},
        gdim=3,
    ),
    Case(
        write_bracket_half,
        {},
        {"bracket": 7.0},
        {"foot": (0, 0, -1), "end": (1, 0, 0), "y0": (0, -7, 0)},
        gdim=3,
    ),
    Case(
        write_blocks_half,
        {},
        {"lower": 1.5, "upper": 1.5},
        {
            "left": (-1, 0, 0),
            "y0": (0, -6, 0),
            "top": (0, 0, 0.75),
            "upper_bottom": (0, 0, -1.5),
            "lower_top": (0, 0, 1.5),
        },
        [("upper_bottom", "lower_top")],
        gdim=3,
    ),
    Case(
        write_prop_half,
        {},
        {"beam": 5e5, "block": 2.5e5},
        {
            "beam_x_low": (-1250, 0, 0),
            "beam_z_high": (0, 0, 10000),
            "block_z_low": (0, 0, -2500),
            "y0": (0, -30000, 0),
            "beam_joint": (0, 0, -2500),
            "block_joint": (0, 0, 2500),
        },
        [("beam_joint", "block_joint")],
        gdim=3,
    ),
    Case(
        write_punch_sector,
        {},
        {"ground": 9.0, "punch": 0.25},
        {
            "oblique": (-6.5, 6.5, 0),
            "y0": (0, -6.5, 0),
            "held": (6, 0, -4.5),
            "top": (0, 0, 0.5),
            "ground_seam": (0, 0, 0.5),
            "punch_seam": (0, 0, -0.5),
        },
        [("ground_seam", "punch_seam")],
        gdim=3,
    ),
    Case(
        write_sphere_sector,
        {"size": 0.1},
        {"shell": 7 * pi / 90},
        {
            "x0": (-0.83035, 0, 0),
            "y0": (0, -0.54729, 0),
            "oblique": (0.79166, 0.48927, -0.30239),
            "inner": (-0.01290, -0.01934, -0.10080),
            "outer": (0.05159, 0.07736, 0.40319),
        },
        rel=0.01,
        gdim=3,
    ),
    Case(
        write_ring,
        {"inner": 0.0, "interface": 1.5, "size": 0.3},
        {"inner_ring": 0.75, "outer_ring": 0.25},
        {
            "inner": (-0.5, 0),
            "outer": (0.5, 0),
            "bottom": (0, -2),
            "top": (0, 2),
            "inner_ring_seam": (0.5, 0),
            "outer_ring_seam": (-0.5, 0),
        },
        [("inner_ring_seam", "outer_ring_seam")],
    ),
    Case(
        write_footing,
        {"size": 1.0},
        {"ground": 48},
        {"bottom": (0, -12), "sides": (0, 0), "footing": (0, 2), "free": (0, 10)},
    ),
    Case(
        write_fanned_footing,
        {"cells": 6},
        {"ground": 48},
        {"bottom": (0, -12), "sides": (0, 0), "footing": (0, 2), "free": (0, 10)},
    ),
    Case(
        write_retaining_wall,
        {"size": 0.5, "width": 3.0},
        {"ground": 6, "wall": 0.5},
        {
            "bottom": (0, -3),
            "side": (2, 0),
            "top": (0, 3),
            "below": (-1, 0),
            "back": (-1, 0),
            "crest": (0, 0.5),
            "base": (0, -0.5),
            "ground_face": (-1, 0),
            "wall_face": (1, 0),
        },
        [("ground_face", "wall_face")],
    ),
    Case(
        write_round_hole,
        {"size": 0.4, "order": 2},
        {"plate": 25 - pi / 4},
        {"x0": (-4, 0), "y0": (0, -4), "side": (5, 0), "top": (0, 5), "hole": (-1, -1)},
        rel=1e-4,
    ),
    Case(
        write_loaded_beam,
        {"size": 0.5},
        {"beam": 24},
        {"left": (-1, 0), "right": (1, 0), **{f"at{i}": (0, 0.5) for i in range(3)}},
    ),
    Case(
        write_hollow_shaft,
        {"size": 1.0},
        {"shaft": 16 * tan(pi / 8) * 0.05},
        {
            **{
                f"{end}{i}": (0, 0, sign * 2 * tan(pi / 8) * 0.05)
                for end, sign in (("bottom", -1), ("top", 1))
                for i in range(8)
            },
            "bottom0": (0, 0, 0.05 * (0.05 - 2 * tan(pi / 8))),
            "held": (0, 0, -(0.05**2)),
        },
        gdim=3,
    ),
    Case(
        write_shaft,
        {"hub": 2.0, "size": 0.3, "order": 2},
        {"shaft": pi / 4, "hub": 3 * pi / 4},
        {
            "outer": (2, 2),
            "x0": (-2, 0),
            "y0": (0, -2),
            "shaft_seam": (1, 1),
            "hub_seam": (-1, -1),
        },
        [("shaft_seam", "hub_seam")],
        rel=2e-3,
    ),
    Case(
        write_shaft,
        {"hub": 2.0, "length": 0.5, "size": 0.5, "order": 2},
        {"shaft": pi / 8, "hub": 3 * pi / 8},
        {
            "outer": (1, 1, 0),
            "x0": (-1, 0, 0),
            "y0": (0, -1, 0),
            "z0": (0, 0, -pi),
            "z1": (0, 0, pi),
            "shaft_seam": (0.5, 0.5, 0),
            "hub_seam": (-0.5, -0.5, 0),
        },
        [("shaft_seam", "hub_seam")],
        rel=3e-3,
        gdim=3,
    ),
    Case(
        write_ball_in_socket,
        {"size": 0.5, "order": 2},
        {"ball": pi / 6, "socket": 7 * pi / 6},
        {
            "outer": (pi, pi, pi),
            "x0": (-pi, 0, 0),
            "y0": (0, -pi, 0),
            "z0": (0, 0, -pi),
            "ball_seam": (pi / 4, pi / 4, pi / 4),
            "socket_seam": (-pi / 4, -pi / 4, -pi / 4),
        },
        [("ball_seam", "socket_seam")],
        rel=3e-3,
        gdim=3,
    ),
    Case(
        write_shaft,
        {"length": 0.5, "size": 0.5, "order": 2},
        {"shaft": pi / 8},
        {
            "outer": (0.5, 0.5, 0),
            "x0": (-0.5, 0, 0),
            "y0": (0, -0.5, 0),
            "z0": (0, 0, -pi / 4),
            "z1": (0, 0, pi / 4),
        },
        rel=2e-3,
        gdim=3,
    ),
    Case(
        write_square_bar,
        {"length": 0.5, "size": 0.25},
        {"bar": 0.125},
        {"x0": (-0.25, 0, 0), "y0": (0, -0.25, 0), "z0": (0, 0, -0.25), "z1": (0, 0, 0.25)},
        gdim=3,
    ),
    Case(
        write_strip_footing,
        {"size": 0.5},
        {"ground": WIDTH * DEPTH},
        {
            "x0": (-DEPTH, 0),
            "bottom": (0, -WIDTH),
            "side": (DEPTH, 0),
            "footing": (0, 1),
            "free": (0, WIDTH - 1),
        },
    ),
    PUNCH_ON_GROUND,
    meshed_apart(PUNCH_ON_GROUND),
    Case(
        write_contact_patch,
        {"dim": 2, "size": 0.4, "order": 2},
        {"lower": 1, "upper": 1},
        {
            "x0": (-2, 0),
            "bottom": (0, -1),
            "top": (0, 1),
            "lower_seam": (0, 1),
            "upper_seam": (0, -1),
        },
        [("lower_seam", "upper_seam")],
    ),
    Case(
        write_contact_patch,
        {"dim": 3, "size": 0.5},
        {"lower": 1, "upper": 1},
        {
            "x0": (-2, 0, 0),
            "y0": (0, -2, 0),
            "bottom": (0, 0, -1),
            "top": (0, 0, 1),
            "lower_seam": (0, 0, 1),
            "upper_seam": (0, 0, -1),
        },
        [("lower_seam", "upper_seam")],
        gdim=3,
    ),
    Case(
        write_corner_seat,
        {"dim": 2, "size": 0.4},
        {"block": 1, "seat": LEG * (2 + LEG)},
        {
            "top": (0, 1),
            "right": (1, 0),
            "seat_bottom": (0, -1 - LEG),
            "seat_left": (-1 - LEG, 0),
            "block_corner": (-1, -1),
            "seat_corner": (1, 1),
        },
        [("block_corner", "seat_corner")],
    ),
    Case(
        write_corner_seat,
        {"dim": 3, "size": 0.5, "order": 2},
        {"block": 1, "seat": LEG * (2 + LEG)},
        {
            "top": (0, 1, 0),
            "right": (1, 0, 0),
            "seat_bottom": (0, -1 - LEG, 0),
            "seat_left": (-1 - LEG, 0, 0),
            "z0": (0, 0, -((1 + LEG) ** 2)),
            "z1": (0, 0, (1 + LEG) ** 2),
            "block_corner": (-1, -1, 0),
            "seat_corner": (1, 1, 0),
        },
        [("block_corner", "seat_corner")],
        gdim=3,
    ),
    Case(
        write_platens,
        {"size": 0.2, "order": 2},
        {"block": 0.5},
        {"x0": (-0.5, 0), "y0": (0, -1), "side": (0.5, 0), "top": (0, 1)},
    ),
    Case(
        write_platens,
        {"platen": True, "size": 0.2},
        {"block": 0.5, "platen": PLATEN},
        {"x0": (-0.5 - PLATEN, 0), "y0": (0, -1), "side": (0.5, 0), "top": (0, 1)},
    ),
    Case(
        write_cracked_strip,
        {"width": 3.0, "length": 4.0, "tip": 1.0, "size": 0.4, "order": 2},
        {"strip": 12},
        {"inner": (0, -1), "outer": (0, -2), "x0": (-4, 0), "side": (4, 0), "top": (0, 3)},
    ),
    Case(
        write_beam_on_prop,
        {"size": 30.0},
        {"beam": 20000, "block": 10000},
        {
            "wall": (-50, 0),
            "floor": (0, -100),
            "top": (0, 400),
            "beam_seam": (0, -100),
            "block_seam": (0, 100),
        },
        pairs=[("beam_seam", "block_seam")],
    ),
    Case(
        write_tube_polygon,
        {"lesser": True, "size": quarter * 2 / 3},
        {"tube": 3 * sin(pi / 6) / 2 * (4 - 1 / cos(pi / 12) ** 2)},
        {
            "inner": (-1 / cos(pi / 12), -1 / cos(pi / 12)),
            "outer": (2, 2),
            "x0": (1 / cos(pi / 12) - 2, 0),
            "y0": (0, 1 / cos(pi / 12) - 2),
        },
    ),
    Case(
        write_plate_with_hole,
        {"size": 1.0, "order": 2},
        {"plate": 18.75},
        {"x0": (-2.5, 0), "y0": (0, -2.5), "side": (5, 0), "top": (0, 5), "hole": (-2.5, -2.5)},
    ),
    Case(
        write_hertz_line,
        {"contact_size": 0.05},
        {"upper": quarter},
        {
            "x0": (-1, 0),
            "top": (0, 1),
            "upper_arc": (arc_height, -ARC),
            "upper_free": (1 - arc_height, ARC - 1),
        },
        rel=5e-3,
    ),
    HALF_CYLINDERS,
    meshed_apart(HALF_CYLINDERS),
    Case(
        write_hertz_sphere,
        {"contact_size": 0.1},
        {"upper": pi / 6},
        {
            "x0": (-quarter, 0, 0),
            "y0": (0, -quarter, 0),
            "top": (0, 0, quarter),
            "upper_cap": (cap_side, cap_side, -quarter * CAP**2),
            "upper_free": (quarter - cap_side, quarter - cap_side, quarter * (CAP**2 - 1)),
        },
        rel=3e-2,
        gdim=3,
    ),
    Case(
        write_hertz_sphere,
        {"contact_size": 0.1, "bodies": 2, "order": 2},
        {"lower": pi / 6, "upper": pi / 6},
        {
            "x0": (-2 * quarter, 0, 0),
            "y0": (0, -2 * quarter, 0),
            "top": (0, 0, quarter),
            "bottom": (0, 0, -quarter),
            "upper_cap": (cap_side, cap_side, -quarter * CAP**2),
            "upper_free": (quarter - cap_side, quarter - cap_side, quarter * (CAP**2 - 1)),
            "lower_cap": (cap_side, cap_side, quarter * CAP**2),
            "lower_free": (quarter - cap_side, quarter - cap_side, quarter * (1 - CAP**2)),
        },
        rel=5e-4,
        gdim=3,
    ),
]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_volumes_and_surfaces(comm: MPI.Intracomm, shared_tmp_path: Path, case: Case) -> None:
    tagged_mesh = case.read(comm, shared_tmp_path)
    assert tagged_mesh.volumes.keys() == case.volumes.keys()
    assert tagged_mesh.surfaces.keys() == case.areas.keys()
    for name, value in case.volumes.items():
        assert volume(tagged_mesh, name) == pytest.approx(value, rel=case.rel)
    for name, vector in case.areas.items():
        error = case.rel * np.linalg.norm(vector)
        np.testing.assert_allclose(area_vector(tagged_mesh, name), vector, rtol=0, atol=error)
    for one, other in case.pairs:
        check_interface(tagged_mesh, one, other)
    nodes = {(2, 1): 3, (2, 2): 6, (3, 1): 4, (3, 2): 10}[case.gdim, case.arguments.get("order", 1)]
    assert geometry_dofmap(tagged_mesh.mesh).shape[1] == nodes


def points(tagged_mesh: TaggedMesh, name: str) -> npt.NDArray[np.float64]:
    """Return the nodes of a surface, in order, shape (num_nodes, 3)."""
    return in_order(surface_nodes(tagged_mesh, name).values())


@pytest.mark.parametrize(
    ("write", "gdim", "radius"), [(write_thick_tube, 2, 1.15), (write_thick_sphere, 3, 1.5)]
)
def test_curved_facets(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    write: Callable[..., None],
    gdim: int,
    radius: float,
) -> None:
    case = Case(write, {"interface": radius, "size": 0.4}, {}, {}, gdim=gdim)
    exact = np.pi * (radius**gdim - 1) / {2: 4, 3: 6}[gdim]
    errors = []
    for order in (1, 2):
        tagged_mesh = case.read(comm, shared_tmp_path, order=order)
        for side in [name for name in tagged_mesh.surfaces if name.endswith("_seam")]:
            distances = np.linalg.norm(points(tagged_mesh, side), axis=1)
            np.testing.assert_allclose(distances, radius, rtol=1e-12)
        errors.append(abs(volume(tagged_mesh, min(tagged_mesh.volumes)) - exact))
    assert errors[1] < errors[0] / 50


@pytest.mark.parametrize(("surface", "radius"), [("inner", 1.0), ("outer", 2.0)])
def test_circumscribed_facets(
    comm: MPI.Intracomm, shared_tmp_path: Path, surface: str, radius: float
) -> None:
    """The facets touch the sphere, with vertices outside; the other facets have vertices on it."""
    case = Case(write_thick_sphere, {"size": 0.4, "circumscribed": surface}, {}, {}, gdim=3)
    tagged_mesh = case.read(comm, shared_tmp_path)
    for name, size in (("inner", 1.0), ("outer", 2.0)):
        distances = np.linalg.norm(points(tagged_mesh, name), axis=1)
        if name == surface:
            assert distances.min() > size
        np.testing.assert_allclose(distances, distances[0], rtol=1e-12)
    facets = tagged_mesh.facets(surface)
    mesh = tagged_mesh.mesh
    corners = mesh.geometry.x[entities_to_geometry(mesh, 2, facets)]
    a, b, c = corners.swapaxes(0, 1)
    normals = np.cross(b - a, c - a)
    from_centre = np.abs(np.einsum("fi,fi->f", normals, a)) / np.linalg.norm(normals, axis=1)
    least = comm.allreduce(float(from_centre.min(initial=np.inf)), MPI.MIN)
    assert least == pytest.approx(radius, rel=1e-12)


@pytest.mark.parametrize(
    ("write", "gdim", "contact"), [(write_hertz_line, 2, "arc"), (write_hertz_sphere, 3, "cap")]
)
def test_mirror_image(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    write: Callable[..., None],
    gdim: int,
    contact: str,
) -> None:
    case = Case(write, {"contact_size": 0.1, "bodies": 2, "order": 2}, {}, {}, gdim=gdim)
    tagged_mesh = case.read(comm, shared_tmp_path)
    axis = gdim - 1
    up = np.eye(3)[axis]
    for surface in (contact, "free"):
        upper, lower = (points(tagged_mesh, f"{body}_{surface}") for body in ("upper", "lower"))
        lower[:, axis] = 0.0 - lower[:, axis]
        np.testing.assert_allclose(upper, in_order(map(tuple, lower)), atol=1e-14)
        np.testing.assert_allclose(np.linalg.norm(upper - up, axis=1), 1, rtol=1e-12)
    upper, lower = (surface_nodes(tagged_mesh, f"{body}_{contact}") for body in ("upper", "lower"))
    assert upper.keys().isdisjoint(lower)
    for nodes in (upper, lower):
        assert np.linalg.norm(list(nodes.values()), axis=1).min() < 1e-14
    touching = points(tagged_mesh, f"upper_{contact}")
    assert np.linalg.norm(touching - touching * up, axis=1).max() == pytest.approx(ARC)
    assert ARC == CAP


def test_platen_is_glued(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    case = Case(write_platens, {"platen": True, "size": 0.2}, {}, {})
    tagged_mesh = case.read(comm, shared_tmp_path)
    mesh = tagged_mesh.mesh
    nodes = geometry_dofmap(mesh)
    used = [
        set(mesh.geometry.input_global_indices[nodes[tagged_mesh.cells(name)]].ravel())
        for name in ("block", "platen")
    ]
    block, platen = (set().union(*comm.allgather(part)) for part in used)
    assert len(block & platen) > 5


def edge_lengths(tagged_mesh: TaggedMesh, point: tuple[float, ...]) -> tuple[float, float]:
    """Return the longest edge of the largest cell at a place, and in the whole mesh."""
    mesh = tagged_mesh.mesh
    cells = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local, dtype=np.int32)
    sizes = mesh.h(mesh.topology.dim, cells)
    vertices = mesh.geometry.x[geometry_dofmap(mesh)[cells, : mesh.topology.dim + 1]]
    there = np.linalg.norm(vertices - (*point, 0, 0)[:3], axis=2).min(axis=1) < 1e-9
    local = (sizes[there].max(initial=0), sizes.max(initial=0))
    return tuple(mesh.comm.allreduce(value, MPI.MAX) for value in local)


@pytest.mark.parametrize(
    ("case", "point", "near"),
    [
        (Case(write_strip_footing, {"size": 0.5, "punch": True}, {}, {}), (1, 0), 0.05),
        (Case(write_platens, {"size": 0.2, "platen": True}, {}, {}), (1, 0.5), 0.02),
        (Case(write_cracked_strip, {"size": 0.2}, {}, {}), (0.5, 0), 0.0125),
        (Case(write_plate_with_hole, {"size": 1.0}, {}, {}), (2.5, 2.5), 0.1),
        (Case(write_hertz_line, {"contact_size": 0.02}, {}, {}), (0, 0), 0.02),
        (Case(write_hertz_sphere, {"contact_size": 0.03}, {}, {}, gdim=3), (0, 0, 0), 0.03),
    ],
    ids=str,
)
def test_finer_where_it_matters(
    comm: MPI.Intracomm, shared_tmp_path: Path, case: Case, point: tuple[float, ...], near: float
) -> None:
    finest, largest = edge_lengths(case.read(comm, shared_tmp_path), point)
    assert near / 2 < finest < 2 * near
    assert largest > 6 * near


def test_folded_elements_are_refused(tmp_path: Path) -> None:
    write_thick_sphere(tmp_path / "mesh.msh", interface=1.3, size=0.4, order=2)  # repairs some
    with pytest.raises(InputError, match="fold over; give a smaller size"):
        write_thick_sphere(tmp_path / "mesh.msh", interface=1.3, size=0.8, order=2)


def test_command_line(
    comm: MPI.Intracomm, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = shared_tmp_path / "script.msh"
    if comm.rank == 0:
        options = ["-o", str(path), "--size", "1", "--order", "2", "--punch"]
        monkeypatch.setattr("sys.argv", ["strip_footing.py", *options])
        script = Path(__file__).parents[2] / "meshes" / "strip_footing.py"
        runpy.run_path(str(script), run_name="__main__")
    comm.barrier()
    tagged_mesh = read_gmsh(comm, path, gdim=2)
    assert tagged_mesh.volumes.keys() == {"ground", "punch"}
    assert geometry_dofmap(tagged_mesh.mesh).shape[1] == 6
