"""Test bounds on adapted meshes: exact limit loads, fans, contact, and refusals."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

import basix.ufl
import numpy as np
import pytest
import ufl
from dolfinx.mesh import create_mesh, locate_entities_boundary, meshtags

from meshes.strip_footing import write_strip_footing
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    Adaptation,
    Contact,
    InputError,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    VonMises,
    adaptive_bounds,
    machine_memory,
    read_gmsh,
)
from perfplast_fenicsx.limit_analysis import (
    AdaptiveBounds,
    BodyBounds,
    Round,
    limit_bounds,
    strict_lower_bound,
)
from perfplast_fenicsx.limit_analysis.body import adaptive_meshes
from perfplast_fenicsx.limit_analysis.body.finer_meshes import finer_mesh, refined
from perfplast_fenicsx.limit_analysis.statements.load_factor import Bound, DesignFactor, Scope
from tests.limit_analysis.test_interior_point import COMM, RIGID, SOIL, K, footing, made
from tests.models import two_blocks_problem

PRANDTL = 2 + math.pi
CONTACT = Contact("upper_bottom", "lower_top")


def count(tagged_mesh: TaggedMesh) -> int:
    """Return the number of cells on all ranks."""
    topology = tagged_mesh.mesh.topology
    number: int = topology.index_map(topology.dim).size_global
    return number


@pytest.mark.long(but=["0.95-True-False", "1.05-False-True"])
@pytest.mark.parametrize(
    ("share", "carried", "refused"),
    [(0.95, True, False), (1.05, False, True), (0.999, False, False)],
)
def test_until_decided(share: float, carried: bool, refused: bool, shared_tmp_path: Path) -> None:
    """A decision needs fewer cells than a narrow bracket; near the limit it remains open."""
    design = share * PRANDTL * K
    mesh = made(shared_tmp_path, write_strip_footing, size=1.0, grading=1.0)
    supports = [Support("x0", "x"), Support("side", "x"), Support("bottom")]
    load = [Pressure("footing", 1.0)]
    problem = Problem(mesh, {"ground": SOIL}, supports, load, degree=2)
    adaptation = Adaptation(until="decided", cells=300)
    found = adaptive_bounds(problem, adaptation, rtol=1e-3, design=design)
    assert found.lower.strict
    assert found.upper.strict
    told = DesignFactor.of(design, found.lower.value, found.upper.value, None)
    assert (told.carried, told.refused) == (carried, refused)
    assert (found.reason == "it is proven whether the bodies carry the design load") == told.decided
    assert not decided(found.rounds[:-1], design), "it went on though it was decided"


def decided(rounds: Sequence[Round], design: float) -> bool:
    """Return whether one of the meshes decides the design load."""
    lows = [round_.lower for round_ in rounds if round_.lower is not None]
    highs = [round_.upper for round_ in rounds if round_.upper is not None]
    return max(lows, default=0.0) >= design or min(highs, default=math.inf) < design


def test_a_value_beside_a_proven_bound_ends_nothing() -> None:
    """The value may lie on the wrong side of the bound, so the difference has no meaning."""
    until = Adaptation(until=0.1)
    lower, upper = Bound(4.33777, "lower", Scope.BODY), Bound(4.34, "upper", Scope.BODY)
    value = replace(upper, of=Scope.MESH, why_not=("curved cells",))
    assert until.ends(lower, upper, None)
    assert until.ends(lower, value, None) is None
    ended = until.ends(replace(lower, of=Scope.MESH), value, None)
    assert ended is not None
    assert "which are not bounds of the body" in ended


def test_nothing_to_decide_on(shared_tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'^until = "decided" needs a design load'):
        adaptive_bounds(footing(shared_tmp_path), Adaptation(until="decided"))


@pytest.mark.long(but=["True"])
@pytest.mark.parametrize("punch", [False, True])
def test_footing(punch: bool, shared_tmp_path: Path) -> None:
    told: list[Round] = []
    problem = footing(shared_tmp_path, punch)
    found = adaptive_bounds(problem, Adaptation(until=0.05, cells=1200), monitor=told.append)
    assert found.lower.strict
    assert found.upper.strict
    assert found.lower.value is not None
    assert found.upper.value is not None
    assert found.lower.value < PRANDTL * K < found.upper.value
    assert found.upper.value / found.lower.value <= 1.05
    assert found.rounds == told
    assert [round_.number for round_ in told] == list(range(1, len(told) + 1))
    assert told[0].cells == count(problem.tagged_mesh)
    assert told[-1].cells == count(found.problem.tagged_mesh) < 1200
    gaps = [round_.gap for round_ in told]
    assert None not in gaps
    assert gaps == sorted(gaps, reverse=True)  # the best bounds on all meshes
    assert found.body.lower is found.lower
    assert found.body.problem is found.best.problem
    assert found.problem.num_pairs == 0 or punch


@pytest.mark.long
def test_a_round_that_worsens_bounds_does_not_count(
    shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The round changes neither the bounds nor the data that accompany them."""
    meshes: list[BodyBounds] = []

    def worse_and_worse(problem: Problem, *args: Any) -> BodyBounds:
        found = limit_bounds(problem, *args)
        if len(meshes) >= 2:
            assert found.upper.value is not None
            low, high = (replace(it, value=0.0) for it in (found.lower, found.upper))
            found = replace(found, lower=low, upper=replace(high, value=2 * found.upper.value))
        meshes.append(found)
        return found

    monkeypatch.setattr(adaptive_meshes, "limit_bounds", worse_and_worse)
    found = adaptive_bounds(footing(shared_tmp_path), Adaptation(until=0.01, cells=1000))
    assert len(meshes) > 2
    assert found.last is meshes[-1]
    assert found.best is meshes[1]
    assert found.body.mechanism is meshes[1].mechanism
    assert found.body.mesh is meshes[1].mesh
    assert found.body.stress is meshes[1].stress
    assert found.rounds[-1].gap == pytest.approx(found.rounds[1].gap)


@pytest.mark.mpi3
@pytest.mark.skipif(COMM.size == 1, reason="compares numbers of ranks")
def test_every_number_of_ranks_finds_the_same(shared_tmp_path: Path) -> None:
    """Each rank alone and all ranks together find the same meshes and bounds, with contact."""
    file = shared_tmp_path / "ground.msh"
    if COMM.rank == 0:
        write_strip_footing(file, punch=True, width=3.0, depth=2.0, grading=1.0, size=1.0)
    COMM.barrier()

    def rounds(comm: MPI.Intracomm) -> list[Round]:
        problem = Problem(
            read_gmsh(comm, file),
            {"ground": SOIL, "punch": RIGID},
            [Support("x0", "x"), Support("side"), Support("bottom")],
            [Pressure("top", 1.0)],
            [Contact("ground_footing", "punch_footing")],
            degree=2,
        )
        return adaptive_bounds(problem, Adaptation(until=0.02, cells=200)).rounds

    alone, together = rounds(MPI.COMM_SELF), rounds(COMM)
    assert len(together) > 2
    assert [one.cells for one in alone] == [one.cells for one in together]
    for kind in ("lower", "upper"):
        values = [[getattr(one, kind) for one in found] for found in (alone, together)]
        np.testing.assert_allclose(*values, rtol=1e-8)


def lattice(n: int) -> TaggedMesh:
    """Write equilateral triangles that fill a parallelogram (0, 6) wide and 3 rows of sides high.

    Each point of the straight top has three angles of triangles. Sides are 1/n long; the curves are
    the ``left`` and ``right`` half of the top, and ``rest``.
    """
    here = COMM.rank == 0
    i, j = np.meshgrid(np.arange(6 * n + 1), np.arange(3 * n + 1))
    x = np.stack([i + j / 2, -j * math.sqrt(3) / 2], axis=-1).reshape(-1, 2) / n
    number = np.arange(len(x)).reshape(i.shape)
    a, b, c, d = (
        number[rows, columns].ravel()
        for rows in (slice(None, -1), slice(1, None))
        for columns in (slice(None, -1), slice(1, None))
    )
    cells = np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)])
    element = ufl.Mesh(basix.ufl.element("Lagrange", "triangle", 1, shape=(2,)))
    mesh = create_mesh(COMM, cells if here else cells[:0], x=x if here else x[:0], e=element)
    mesh.topology.create_connectivity(1, 2)
    every = locate_entities_boundary(mesh, 1, lambda x: x[0] > -1)
    left = locate_entities_boundary(mesh, 1, lambda x: (x[1] > -1e-9) & (x[0] < 3 + 1e-9))
    right = locate_entities_boundary(mesh, 1, lambda x: (x[1] > -1e-9) & (x[0] > 3 - 1e-9))
    tags = np.full(len(every), 3, dtype=np.int32)
    tags[np.isin(every, left)], tags[np.isin(every, right)] = 1, 2
    owned = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
    return TaggedMesh(
        mesh,
        meshtags(mesh, 2, owned, np.ones(len(owned), dtype=np.int32)),
        meshtags(mesh, 1, every, tags),
        {"ground": 1},
        {"left": 1, "right": 2, "rest": 3},
    )


def test_few_directions_at_the_end_of_a_load_limit_the_bound() -> None:
    """Three cells of 60° carry 2√3 k on any mesh elsewhere; fans remove this limit."""
    problem = Problem(
        lattice(1),
        {"ground": SOIL},
        [Support("rest")],
        [Pressure("left", 1.0)],
        degree=2,
    )
    few = 2 * math.sqrt(3) * K
    for n in (1, 3):
        bound = strict_lower_bound(problem.on(lattice(n))).bound
        assert bound.value is not None
        assert bound.value < few * (1 + 1e-9)
    assert bound.value == pytest.approx(few, rel=1e-3)
    fanned = problem
    for _ in range(2):
        nowhere = np.zeros(len(fanned.tagged_mesh.cell_tags.indices), dtype=np.bool_)
        fanned = fanned.on(refined(fanned, nowhere))
    better = strict_lower_bound(fanned).bound
    assert better.value is not None
    assert better.value > 1.1 * few


def adapted_blocks(comm: MPI.Intracomm, cells: int) -> AdaptiveBounds:
    """Return two blocks in contact, with quadratic elements."""
    linear = two_blocks_problem(1, comm=comm)
    problem = Problem.from_given(
        linear.tagged_mesh, replace(linear.given, degree=2, contacts=[CONTACT])
    )
    return adaptive_bounds(problem, Adaptation(until=0.1, cells=cells), rtol=1e-3)


def test_contact_in_space() -> None:
    """Each mesh has cells of both bodies, and surfaces match. The next problem needs this."""
    cells = 160
    found = adapted_blocks(COMM, cells)
    assert len(found.rounds) > 1
    assert found.lower.strict
    assert found.upper.strict
    assert found.rounds[-1].gap is not None
    assert found.rounds[0].gap is not None
    assert found.rounds[-1].gap < found.rounds[0].gap
    assert count(found.problem.tagged_mesh) <= cells
    assert f"more than {cells} cells" in found.reason
    if COMM.size > 1:
        alone = adapted_blocks(MPI.COMM_SELF, cells)
        assert [round_.cells for round_ in alone.rounds] == [
            round_.cells for round_ in found.rounds
        ]
        for one, other in zip(alone.rounds, found.rounds, strict=True):
            assert one.lower == pytest.approx(other.lower, rel=1e-8)
            assert one.upper == pytest.approx(other.upper, rel=1e-8)


@pytest.mark.long
def test_steps_to_the_next_mesh_in_space() -> None:
    """The step doubles the cells for wide brackets, and is smaller for narrow brackets."""
    linear = two_blocks_problem(2, comm=COMM)
    problem = Problem.from_given(
        linear.tagged_mesh, replace(linear.given, degree=2, contacts=[CONTACT])
    )
    found, now = limit_bounds(problem, rtol=2e-2), count(problem.tagged_mesh)
    for gap, least, most in ((0.8, 1.7, 2.3), (0.11, 1.3, 1.75)):
        finer = finer_mesh(problem, found, gap, Adaptation(until=0.1))
        assert isinstance(finer, TaggedMesh)
        assert least * now <= count(finer) <= most * now
    fitting = Adaptation(until=0.1, cells=round(1.5 * now))
    finer = finer_mesh(problem, found, 0.8, fitting)
    assert isinstance(finer, TaggedMesh)
    assert 1.4 * now <= count(finer) <= 1.5 * now


def test_a_mesh_that_does_not_fit_into_memory_is_the_last(
    shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fill(_: Round) -> None:
        monkeypatch.setattr(machine_memory, "physical_memory", lambda: 2**10)

    problem = footing(shared_tmp_path)
    found = adaptive_bounds(problem, Adaptation(until=0.01), rtol=1e-2, monitor=fill)
    assert "unknowns needs at least" in found.reason
    assert len(found.rounds) == 1
    assert found.problem is problem
    assert found.lower.strict
    assert found.upper.strict


def test_a_first_mesh_that_is_finer_than_asked_is_the_only_one(shared_tmp_path: Path) -> None:
    found = adaptive_bounds(footing(shared_tmp_path), Adaptation(until=1e-3, cells=9), rtol=1e-2)
    assert len(found.rounds) == 1
    assert found.reason.startswith("a finer mesh would have more than 9 cells; give more cells")
    assert found.upper.strict


def test_what_cannot_be_adapted(shared_tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^until = 1 is not between 0 and 1; try 0.01"):
        Adaptation(until=1)
    mesh = made(shared_tmp_path, write_thick_tube, size=0.2, order=2)
    tube = Problem(
        mesh,
        dict.fromkeys(mesh.volumes, VonMises(young=70e3, poisson=0.3, yield_stress=250.0)),
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("inner", 1.0)],
        degree=2,
    )
    with pytest.raises(InputError, match=r"^cells are curved"):
        adaptive_bounds(tube)
