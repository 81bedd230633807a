"""Test bounds for tractions that are linear on facets, such as a water pressure.

A block stands in water between smooth planes. The water pressure and the buoyancy of the block do
no work on flows that preserve volume. So the block collapses under a piston's pressure on top at
the same pressure as in air.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx.mesh import CellType, GhostMode, create_box, locate_entities_boundary, meshtags

from perfplast_fenicsx import (
    BodyForce,
    InputError,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    TaggedMesh,
    Traction,
    VonMises,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.proof import check
from tests.limit_analysis.test_static_bound import rectangle

COMM = MPI.COMM_WORLD
SOIL = VonMises(young=1e3, poisson=0.3, yield_stress=3**0.5)
"""k = 1."""
DEEP = 3.0
"""Height of the water above the bottom."""
WEIGHT = 0.7
"""Unit weight of the water."""
SQUARE = {
    "left": lambda x: x[0] < 1e-9,
    "bottom": lambda x: x[1] < 1e-9,
    "right": lambda x: x[0] > 1 - 1e-9,
    "top": lambda x: x[1] > 1 - 1e-9,
}


def cube(n: int) -> TaggedMesh:
    """Return the unit cube, with surfaces x0, y0, z0, x1, y1 and z1."""
    mesh = create_box(
        COMM, [(0, 0, 0), (1, 1, 1)], (n, n, n), CellType.tetrahedron, ghost_mode=GhostMode.none
    )
    names = [f"{axis}{side}" for side in (0, 1) for axis in "xyz"]
    found = [
        locate_entities_boundary(mesh, 2, lambda x, i=i, side=side: abs(x[i] - side) < 1e-9)
        for side in (0, 1)
        for i in range(3)
    ]
    facets = np.concatenate(found)
    tags = np.repeat(np.arange(6, dtype=np.int32), [len(some) for some in found])
    order = np.argsort(facets)
    cells = np.arange(mesh.topology.index_map(3).size_local, dtype=np.int32)
    return TaggedMesh(
        mesh,
        meshtags(mesh, 3, cells, np.zeros(len(cells), dtype=np.int32)),
        meshtags(mesh, 2, facets[order], tags[order]),
        {"block": 0},
        {name: number for number, name in enumerate(names)},
    )


def in_water(sides: Sequence[Load], n: int = 3, shake: float = 0.2) -> Problem:
    """Return a square block, with the pressure 1 and the water pressure on top."""
    mesh = rectangle((n, n), (1.0, 1.0), {"block": lambda x: x[0] < 2}, SQUARE, shake)
    loads = [
        Pressure("top", 1.0 + WEIGHT * (DEEP - 1.0)),
        BodyForce("block", (0.0, -WEIGHT)),
        *sides,
    ]
    return Problem(
        mesh, {"block": SOIL}, [Support("left", "x"), Support("bottom", "y")], loads, degree=2
    )


WATER = f"{WEIGHT}*({DEEP} - y)"


@pytest.mark.mpi2("pressure")
@pytest.mark.parametrize(
    "side",
    [Pressure("right", WATER), Traction("right", (f"-{WATER}", "0*x"))],
    ids=["pressure", "traction"],
)
def test_a_block_in_water(shared_tmp_path: Path, side: Load) -> None:
    bounds = limit_bounds(in_water([side]), 1e-6)
    proven(bounds, shared_tmp_path, 2.0)


def test_a_cube_in_water(shared_tmp_path: Path) -> None:
    water = WATER.replace("y", "z")
    loads = [
        Pressure("z1", 1.0 + WEIGHT * (DEEP - 1.0)),
        BodyForce("block", (0.0, 0.0, -WEIGHT)),
        Pressure("x1", water),
        Pressure("y1", water),
    ]
    held = [Support(f"{axis}0", axis) for axis in "xyz"]
    problem = Problem(cube(1), {"block": SOIL}, held, loads, degree=2)
    proven(limit_bounds(problem, 1e-6), shared_tmp_path, 3**0.5)


def proven(bounds: object, path: Path, exact: float) -> None:
    """Both bounds are strict and meet at one load, and an independent checker agrees."""
    assert bounds.strict, bounds.why_not
    assert bounds.lower.value <= exact * (1 + 1e-9)
    assert bounds.upper.value >= exact * (1 - 1e-9)
    assert bounds.upper.value - bounds.lower.value < 2e-5 * exact
    folder = ResultFolder(COMM, path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    for half in check(folder.file("bounds.h5")).values():
        assert not half.faults
        assert half.proven == pytest.approx(exact, rel=2e-5)


def test_bending_by_a_linear_traction() -> None:
    """The traction that bends a bar is linear over the end, whose edge carries at most 2k."""
    mesh = rectangle((6, 4), (2.0, 1.0), {"block": lambda x: x[0] < 3}, ENDS)
    loads = [Traction("right", ("2*y - 1", 0.0))]
    problem = Problem(mesh, {"block": SOIL}, [Support("left")], loads, degree=2)
    bounds = limit_bounds(problem)
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(2.0, rel=1e-4)
    assert 2.0 <= bounds.upper.value < 3.1  # the whole bar bends at 3


ENDS = {"left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > 2 - 1e-9}


def test_water_alone_limits_nothing() -> None:
    mesh = rectangle((2, 2), (1.0, 1.0), {"block": lambda x: x[0] < 2}, SQUARE)
    loads = [
        Pressure("top", WEIGHT * (DEEP - 1.0)),
        BodyForce("block", (0.0, -WEIGHT)),
        Pressure("right", WATER),
    ]
    held = [Support("left", "x"), Support("bottom", "y")]
    bounds = limit_bounds(Problem(mesh, {"block": SOIL}, held, loads, degree=2))
    assert bounds.in_words().startswith("Nothing limits the loads")


@pytest.mark.parametrize(
    ("value", "linear"),
    [
        ("1 + 0*x", True),
        ("maximum(0.5 - y, 0)", True),
        ("y**2", False),
        ("maximum(0.4 - y, 0)", False),
    ],
)
def test_what_is_linear_on_facets(value: str, linear: bool) -> None:
    """Vertices are at multiples of 1/2: a kink there causes no error."""
    problem = in_water([Pressure("right", value)], n=2, shake=0.0)
    if linear:
        assert limit_bounds(problem).strict
        return
    with pytest.raises(InputError, match="'right' is a formula"):
        limit_bounds(problem)


def test_a_force_per_volume_is_a_number() -> None:
    given = in_water([]).given
    loads = [*given.loads, BodyForce("block", ("x", 0.0))]
    problem = Problem.from_given(in_water([]).tagged_mesh, replace(given, loads=loads))
    with pytest.raises(InputError, match="'block' is a force per volume"):
        limit_bounds(problem)
