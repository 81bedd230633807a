"""Test both bounds in parallel, each on one of two ranks, against bounds on both ranks together."""

import signal
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx import (
    InputError,
    Pressure,
    Problem,
    ResultFolder,
    Traction,
    limit_bounds,
    stacked_blocks,
)
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.recorder import Recorder
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis.body import halves
from perfplast_fenicsx.limit_analysis.body.halves import halves_at_once
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep, StopSearch
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.proof import check
from perfplast_fenicsx.solvers.linear.factorisation import TooLarge
from tests.limit_analysis.test_dead_loads import K, footing
from tests.limit_analysis.test_nonassociated_ground import column, ground
from tests.limit_analysis.test_rings import disc
from tests.limit_analysis.test_rubbing_bounds import between_platens, pushed
from tests.limit_analysis.test_stopped_search import CASE as BLOCKS
from tests.models import touching_blocks, write_case

COMM = MPI.COMM_WORLD
RTOL = 1e-6

pytestmark = [  # all tests run on two ranks, and on no other number
    pytest.mark.mpi2,
    pytest.mark.skipif(COMM.size != 2, reason="two ranks share the bounds"),
]

CASES: dict[str, Callable[[], Problem]] = {
    "blocks": lambda: touching_blocks(degree=2),
    "platens": lambda: between_platens(4, tresca=0.3 * K),
    "slope": lambda: pushed(2, 0.2, gdim=3, coulomb=0.2, associated=True),
    "disc": lambda: disc(3, tresca=0.3),
    "pair": lambda: column(ground("radenkovic"), Pressure("top", 1.0)),
    "weight": lambda: footing((0.0, -1.0), (0.5 * K, 0.0)),
    "falls": lambda: footing((0.0, -1.0), (2 * K, 0.0)),
    "stands": lambda: touching_blocks(loads=[Pressure("top", 50.0, constant=True)], degree=2),
}


def numbers(told: list[InteriorStep]) -> list[int]:
    """Return the numbers of the steps that a rank received."""
    return [step.number for step in told]


def seek_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Allow parallel bounds on small meshes."""
    module = import_module(limit_bounds.__module__)  # the module and its function have one name
    monkeypatch.setattr(module, "pays", lambda *_: True)


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compute both bounds in parallel on any mesh."""
    seek_at_once(monkeypatch)


@pytest.mark.long(but=["stands", "weight", "disc"])
@pytest.mark.parametrize("case", CASES)
def test_they_are_those_of_both_ranks(
    case: str, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The checker proves the bounds in the file."""
    problem = CASES[case]()
    together = limit_bounds(problem, RTOL)
    seek_at_once(monkeypatch)
    told = list[InteriorStep]()
    bounds = limit_bounds(problem, RTOL, told.append)
    assert bounds.question is together.question
    assert (bounds.question is Question.STANDS) == (case in ("falls", "stands"))
    for one, other in ((bounds.lower, together.lower), (bounds.upper, together.upper)):
        assert one.strict
        # The upper bound for "weight" scattered by 4e-6 between numbers of ranks and libraries,
        # with rtol = 1e-6 and 1e-8.
        scatter = 1e-5 if case == "weight" and one is bounds.upper else 2 * RTOL
        assert one.value == pytest.approx(other.value, rel=scatter)
    assert len(told) >= bounds.steps
    assert COMM.allgather(numbers(told))[0] == numbers(told)
    folder = ResultFolder(COMM, shared_tmp_path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    if COMM.rank == 0:
        proven = check(folder.file("bounds.h5"))
        for half, bound in (("lower", bounds.lower), ("upper", bounds.upper)):
            assert not proven[half].faults
            assert proven[half].proven == pytest.approx(bound.value, rel=1e-9)
    COMM.barrier()


@pytest.mark.usefixtures("at_once")
def test_fields_are_handed_back() -> None:
    """The work of the mechanism is its bound, and the shares sum to the gap."""
    problem = touching_blocks(loads=[Traction("top", (0.3, 0.0, -1.0))], degree=2)
    found = halves_at_once(problem, problem, RTOL, None)
    assert found is not None
    assert found.limit.upper is not None
    limit, flow = found.limit, found.flow.problem
    assert flow.loads.live.dot(limit.mechanism.x.petsc_vec) == pytest.approx(1.0, rel=1e-12)
    bounds = limit_bounds(problem, RTOL)
    lower, upper = bounds.lower.value, bounds.upper.value
    assert lower is not None
    assert upper is not None
    assert bounds.shares is not None
    assert COMM.allreduce(bounds.shares.sum()) == pytest.approx(upper - lower, abs=1e-8 * upper)
    assert bounds.static is not None
    dissipation = COMM.allreduce(bounds.static.dissipation.sum())
    assert dissipation == pytest.approx(lower, rel=10 * RTOL)


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("half", ["form_that_fits", "interior_point"])
def test_a_half_that_does_not_fit(half: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both ranks then compute one bound after the other."""

    def refuse(*_: object) -> None:
        raise TooLarge("a half does not fit")

    monkeypatch.setattr(halves, half, refuse)
    problem = touching_blocks(degree=2)
    assert halves_at_once(problem, problem, RTOL, None) is None
    assert limit_bounds(problem, 1e-4).strict


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("half", ["form_that_fits", "interior_point"])
def test_what_one_rank_refuses(half: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both ranks refuse in the same words."""

    def refuse(*_: object) -> None:
        raise InputError(f"refused by rank {COMM.rank}")

    monkeypatch.setattr(halves, half, refuse)
    rank = ["interior_point", "form_that_fits"].index(half)
    with pytest.raises(InputError, match=f"refused by rank {rank}"):
        limit_bounds(touching_blocks(degree=2))


class Enough(StopSearch):
    """The monitor stops the search."""


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("share", [0.5, 1.0])
def test_a_search_that_is_stopped(share: float) -> None:
    """Both halves end, and both ranks have the known bounds on the limit load."""
    problem, every, told = touching_blocks(degree=2), list[InteriorStep](), list[InteriorStep]()
    limit_bounds(problem, 1e-6, every.append)

    def stop(step: InteriorStep) -> None:
        told.append(step)
        if len(told) == round(share * len(every)):
            raise Enough

    with pytest.raises(Enough) as caught:
        limit_bounds(problem, 1e-6, stop)
    found = caught.value.found
    assert isinstance(found, LimitLoad)
    assert found.mechanism.function_space.mesh.comm.size == COMM.size
    assert COMM.allgather(found.lower)[0] == pytest.approx(found.lower, rel=1e-14)
    assert COMM.allgather(numbers(told))[0] == numbers(told) == numbers(every)[: len(told)]


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("rank", [0, 1])
def test_a_signal_that_reaches_one_rank(
    rank: int, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both ranks end after this step, in order."""
    text = BLOCKS.replace('control = "work"', 'control = "bounds"')
    case = write_case(COMM, shared_tmp_path / "case.toml", text.replace('until = "limit"\n', ""))
    results, plain = shared_tmp_path / "results", Recorder.interior

    def interior(self: Recorder, step: InteriorStep) -> None:
        if step.number == 5 and rank == COMM.rank:
            signal.raise_signal(signal.SIGTERM)
        plain(self, step)

    monkeypatch.setattr(Recorder, "interior", interior)
    assert main(["run", str(case), "-o", str(results)]) == 128 + signal.SIGTERM
    COMM.barrier()
    log = (results / "run.log").read_text(encoding="utf-8")
    assert "start again with: perfplast run" in log
    assert "step 4: " in log
    assert "step 6: " not in log
    COMM.barrier()


def test_few_cells_are_not_worth_a_copy(monkeypatch: pytest.MonkeyPatch) -> None:
    """No copies are made for linear elements either, or if memory is short."""
    few, more = (touching_blocks(stacked_blocks(COMM, n), degree=2) for n in (2, 3))
    assert not halves.pays(few, few)
    assert halves.pays(more, more)
    linear = touching_blocks(stacked_blocks(COMM, 3))
    assert not halves.pays(linear, linear)
    monkeypatch.setattr(halves, "spare_memory", lambda _: 1.0)
    assert not halves.pays(more, more)
