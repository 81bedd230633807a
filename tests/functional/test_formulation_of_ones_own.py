"""Test contact rows of a formulation from outside the package, in whole runs."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import Support, VonMises
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.contact import Constraints, Source, make_constraints
from perfplast_fenicsx.contact.rows.constraints import stacked
from perfplast_fenicsx.contact.surfaces.surface_facets import can_host, surface_nodes
from perfplast_fenicsx.problem import problem as problem_module
from tests.models import case_text, write_case

STEEL = VonMises(206900.0, 0.29, 450.0)
ROLLERS = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")]
BLOCK = case_text(
    {"builder": "stacked_blocks", "n": 2},
    {"lower": STEEL, "upper": STEEL},
    [*ROLLERS, Support("upper_bottom", "z")],
    more="[loading]\nvalues = [50.0, 100.0]\n[output]\npictures = false\n",
).replace("pressure = 1.0", "traction = [0.2, 0.0, 1.0]")

Rows = Callable[..., Constraints]


def stop(on: str, d: Sequence[float], play: float, number: int, *sources: Source) -> Rows:
    """Return rows for u·d ≤ play at each node of a surface."""

    def constraints(V: Any, tagged_mesh: Any, fixed: Any) -> Constraints:
        nodes = surface_nodes(V, tagged_mesh, on, fixed)
        weight = np.bincount(np.unique(nodes["node"], return_inverse=True)[1], nodes["weight"])
        nodes = nodes[np.unique(nodes["node"], return_index=True)[1]]
        along = np.tile(np.asarray(d, dtype=float), (len(nodes), 1))
        able = can_host(nodes, along)
        nodes, along = nodes[able], along[able]
        return make_constraints(
            V,
            nodes["node"],
            np.full(len(nodes), play),
            along,
            np.full(len(nodes), number, dtype=np.int32),
            [(np.arange(len(nodes)), nodes["number"], along)],
            area=weight[able],
            sources=sources,
        )

    return constraints


@pytest.fixture
def run(
    monkeypatch: pytest.MonkeyPatch, comm: MPI.Intracomm, shared_tmp_path: Path
) -> Callable[..., dict[str, Any]]:
    """Run the block with these rows, and return the last level in ``summary.json``."""

    def run(*chosen: Rows, status: int = SOLVED) -> dict[str, Any]:
        def find(V: Any, mesh: Any, contacts: Any, obstacles: Any, fixed: Any) -> Constraints:
            parts = [rows(V, mesh, fixed) for rows in chosen]
            return parts[0] if len(parts) == 1 else stacked(V, parts)

        monkeypatch.setattr(problem_module, "find_constraints", find)
        case = write_case(comm, shared_tmp_path / "case.toml", BLOCK)
        folder = shared_tmp_path / "results"
        assert main(["run", str(case), "-o", str(folder)]) == status
        read = comm.rank == 0 and status == SOLVED
        text = (folder / "summary.json").read_text(encoding="utf-8") if read else "{}"
        found: dict[str, Any] = comm.bcast(json.loads(text)).get("steps", [{}])[-1]
        return found

    return run


def test_surfaces_are_numbered_freely(run: Callable[..., dict[str, Any]]) -> None:
    """Two stops have no sources. Earlier, their numbers counted as contacts and obstacles."""
    last = run(stop("top", (0, 0, 1), 1e-4, 7), stop("top", (1, 0, 0), 0.0, 0))
    forces = {name: np.array(force) for name, force in last["reactions"].items()}
    assert forces["loads"] == pytest.approx([20.0, 0.0, 100.0], rel=1e-9)
    assert forces["surface 7"][2] < -10.0
    assert forces["surface 0"][0] < -1.0
    assert forces["surface 7"][:2] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert sum(forces.values()) == pytest.approx(np.zeros(3), abs=1e-6)
    assert last["balance"] < 1e-9


@pytest.mark.parametrize("friction", [{}, {"tresca": 5.0}, {"coulomb": 0.1}], ids=str)
def test_a_source_of_ones_own(
    friction: dict[str, float], run: Callable[..., dict[str, Any]]
) -> None:
    """Results contain the name of the source, and its friction acts."""
    source = Source("end stop", "top", **friction)
    last = run(stop("top", (0, 0, 1), 1e-5, 0, source))
    forces = {name: np.array(force) for name, force in last["reactions"].items()}
    pressed, rubbed = -forces["end stop"][2], -forces["end stop"][0]
    assert pressed > 10.0
    assert (rubbed > 1e-3) == bool(friction)
    if "coulomb" in friction:
        assert rubbed <= 0.1 * pressed * (1 + 1e-6)
    assert sum(forces.values()) == pytest.approx(np.zeros(3), abs=1e-6)
    assert last["balance"] < 1e-9


def test_numbers_of_no_source(
    run: Callable[..., dict[str, Any]], comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]
) -> None:
    run(stop("top", (0, 0, 1), 1e-5, 2, Source("end stop", "top")), status=BAD_INPUT)
    assert "there are 1 sources; number surfaces" in comm.bcast(capsys.readouterr().err)
