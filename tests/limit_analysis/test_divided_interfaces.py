"""Test bounds for separately meshed plane bodies: cells are divided until facets match."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    Adaptation,
    Contact,
    InputError,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    Tie,
    Traction,
    VonMises,
    adaptive_bounds,
    limit_bounds,
    read_gmsh,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis.body.bound_problems import with_divided_interfaces
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.mesh.divided_surfaces import surface_ends
from perfplast_fenicsx.proof import check
from tests.contact.blocks_apart import blocks_apart

COMM = MPI.COMM_WORLD
STEEL = VonMises(2e5, 0.3, 200.0)
PAIR = ("lower_top", "upper_bottom")
MEETING: dict[str, type[Contact | Tie]] = {"ties": Tie, "contacts": Contact}
EXACT = 2 / 3**0.5 * STEEL.yield_stress
"""Limit load of a block in plane strain with free sides."""


def blocks(lower: int, upper: int, kind: str, loads: Any = None, **shape: Any) -> Problem:
    mesh = blocks_apart(COMM, [lower] * 2, [upper] * 2, **shape)
    supports = [Support("bottom", "y"), Support("x0", "x"), Support("upper_x0", "x")]
    loads = loads or [Pressure("top", 1.0)]
    met = [MEETING[kind](*PAIR)]
    materials = {"lower": STEEL, "upper": STEEL}
    return Problem(mesh, materials, supports, loads, met, degree=2)


@pytest.mark.mpi2("2-3-ties")
@pytest.mark.parametrize("kind", MEETING)
@pytest.mark.parametrize(("lower", "upper"), [(2, 3), (3, 5), (7, 3)])
def test_blocks_that_are_meshed_apart(
    shared_tmp_path: Path, lower: int, upper: int, kind: str
) -> None:
    bounds = limit_bounds(blocks(lower, upper, kind), 1e-4)
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(EXACT, rel=2e-4)
    assert bounds.lower.value <= EXACT <= bounds.upper.value * (1 + 1e-9)
    assert bounds.upper.value == pytest.approx(EXACT, rel=1e-5)
    there = ResultFolder(COMM, shared_tmp_path)
    write_proof(there, there.file("bounds.h5"), *proofs(bounds, bounds))
    for of in check(there.file("bounds.h5")).values():
        assert not of.faults


@pytest.mark.serial
@pytest.mark.parametrize("seed", range(3))
def test_both_sides_have_one_set_of_numbers(seed: int) -> None:
    """Vertices of separately meshed surfaces at first differ by rounding, 3.4e-12."""
    problem = blocks(2 + seed, 3 + seed, "contacts")
    x = problem.tagged_mesh.mesh.geometry.x
    seam = np.abs(x[:, 1] - 1.0) < 1e-9
    shifts = np.random.default_rng(seed).uniform(-1, 1, (x.shape[0], 2))
    x[seam, :2] += 3.4e-12 * shifts[seam]
    there = with_divided_interfaces(problem).tagged_mesh
    sides = [np.unique(surface_ends(there, name).reshape(-1, 2), axis=0) for name in PAIR]
    assert len(sides[0]) == len(sides[1]) > 4
    assert np.array_equal(*sides)  # equal numbers on both sides


def test_mortar_contact_that_was_asked_for_is_at_each_point_in_bounds() -> None:
    found = blocks(2, 3, "contacts")
    given = replace(found.given, contacts=[Contact(*PAIR, formulation="mortar")])
    bounds = limit_bounds(Problem.from_given(found.tagged_mesh, given), 1e-4)
    assert bounds.strict
    assert bounds.upper.value == pytest.approx(EXACT, rel=1e-5)


@pytest.mark.long
def test_as_the_body_whose_nodes_match() -> None:
    """A block is pushed and pressed on an inclined seam: both brackets contain the same number."""
    loads = [Pressure("top", 1.0), Traction("top", (0.4, 0.0))]
    apart, matching = (
        adaptive_bounds(
            blocks(3, upper, "ties", loads, slope=0.3, moved_by=0.0), Adaptation(0.05, 300)
        )
        for upper in (5, 3)
    )
    for it in (apart, matching):
        assert it.lower.strict
        assert it.upper.strict
    lows, highs = (
        [it.lower.value for it in (apart, matching)],
        [it.upper.value for it in (apart, matching)],
    )
    assert max(lows) <= min(highs)
    assert highs[0] - lows[0] <= 1.5 * (highs[1] - lows[1]) + 0.02 * highs[1]


def test_cells_are_divided_at_the_nodes_of_the_other_side_alone() -> None:
    problem = blocks(2, 3, "contacts")
    finer = with_divided_interfaces(problem)
    cells = [it.tagged_mesh.mesh.topology.index_map(2).size_global for it in (problem, finer)]
    assert cells[1] == cells[0] + 1 + 2  # one node from one side, two from the other
    assert with_divided_interfaces(finer) is finer
    for name in problem.tagged_mesh.surfaces:
        counts = [
            COMM.allreduce(int((it.tagged_mesh.facets(name) < _owned(it)).sum()))
            for it in (problem, finer)
        ]
        assert counts[1] == (4 if name in PAIR else counts[0])
    for name, more in (("lower", 2), ("upper", 1)):
        counts = [COMM.allreduce(len(it.tagged_mesh.cells(name))) for it in (problem, finer)]
        assert counts[1] == counts[0] + more


def test_surfaces_that_do_not_lie_on_each_other_are_left() -> None:
    problem = blocks(2, 3, "contacts", height=1.01)
    assert with_divided_interfaces(problem) is problem


def tubes(
    folder: Path, finer: float | None, kind: str = "contacts", radius: float = 1.4
) -> Problem:
    """Return a tube in a tube; their circles are replaced by different chords."""
    path = folder / f"{finer}.msh"
    if COMM.rank == 0:
        write_thick_tube(path, outer=2.0, interface=radius, size=0.3, finer=finer)
    COMM.barrier()
    mesh = read_gmsh(COMM, path)
    met = [MEETING[kind]("inner_tube_seam", "outer_tube_seam")]
    supports = [Support("x0", "x"), Support("y0", "y")]
    return Problem(
        mesh,
        dict.fromkeys(mesh.volumes, STEEL),
        supports,
        [Pressure("inner", 1.0)],
        met,
        degree=2,
    )


@pytest.mark.parametrize("kind", MEETING)
def test_polygons_of_one_circle_are_taken_as_one(shared_tmp_path: Path, kind: str) -> None:
    problem = tubes(shared_tmp_path, 1.5, kind)
    finer = with_divided_interfaces(problem)
    (told,) = finer.tagged_mesh.taken
    assert "projected model: 'inner_tube_seam' and 'outer_tube_seam'" in told
    assert with_divided_interfaces(finer) is finer
    for name in ("inner_tube_seam", "outer_tube_seam"):
        ends = surface_ends(finer.tagged_mesh, name).reshape(-1, 2)
        assert np.hypot(*ends.T) == pytest.approx(1.4, rel=1e-9)
    apart, matching = limit_bounds(problem), limit_bounds(tubes(shared_tmp_path, None, kind))
    assert apart.strict
    assert matching.strict
    assert apart.taken == (told,)
    assert "projected model" in apart.in_words()
    assert not matching.taken
    assert apart.lower.value <= matching.upper.value
    assert matching.lower.value <= apart.upper.value
    there = ResultFolder(COMM, shared_tmp_path)
    write_proof(there, there.file("bounds.h5"), *proofs(apart, apart))
    for of in check(there.file("bounds.h5")).values():
        assert not of.faults


def test_a_cell_that_is_thinner_than_the_curve_is_refused(shared_tmp_path: Path) -> None:
    with pytest.raises(InputError, match="too thin for the curvature"):
        with_divided_interfaces(tubes(shared_tmp_path, 0.4, radius=1.96))


def _owned(problem: Problem) -> int:
    owned: int = problem.tagged_mesh.mesh.topology.index_map(1).size_local
    return owned
