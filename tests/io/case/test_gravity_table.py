"""Test the weight of bodies by their densities, and tractions by their total force."""

from collections.abc import Mapping
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import BodyForce, InputError, Problem, Support, Traction
from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.io.case.gravity_table import GravityTable
from perfplast_fenicsx.io.case.load_table import load_in_words
from perfplast_fenicsx.mesh.sample_meshes import two_blocks
from perfplast_fenicsx.problem.judged.resultants import load_resultants
from perfplast_fenicsx.units import Units
from tests.models import STEEL

COMM = MPI.COMM_WORLD

CASE = """
title = "weights"
[mesh]
builder = "two_blocks"
n = 2
[material.lower]
law = "von-mises"
young = 2e5
poisson = 0.3
yield_stress = 200.0
[material.upper]
law = "elastic"
young = 2e5
poisson = 0.3
[[support]]
on = "left"
[[load]]
on = "top"
traction = [3.0, 0.0, -12.0]
total = true
[gravity]
acceleration = [0.0, 0.0, -10.0]
density = { lower = 2.0, upper = 0.5 }
[[contact]]
primary = "upper_bottom"
secondary = "lower_top"
[loading]
values = [0.0, 1.0]
"""


def test_weight_and_whole_force(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    path = shared_tmp_path / "case.toml"
    if comm.rank == 0:
        path.write_text(CASE)
    comm.barrier()
    case = read_case(path, comm)
    push, *weights = load_resultants(case.problem(comm))
    assert push.force == pytest.approx([3.0, 0.0, -12.0], rel=1e-12)
    found = {weight.on: weight.force[2] for weight in weights}
    assert found == pytest.approx({"lower": -60.0, "upper": -15.0}, rel=1e-12)
    assert all(weight.constant and weight.name == "gravity" for weight in weights)
    words = load_in_words(case.loads[0], Units(system="mm-N-MPa"))
    assert words == "evenly spread force (3, 0, -12) N on 'top'"


@pytest.mark.parametrize("n", [1, 2])
def test_a_whole_force_is_kept_on_any_mesh(n: int) -> None:
    materials = dict.fromkeys(("lower", "upper"), STEEL)
    loads = [Traction("top", (0.0, 0.0, -7.0), total=True)]
    problem = Problem(two_blocks(COMM, n), materials, [Support("left")], loads)
    (load,) = load_resultants(problem)
    assert load.force == pytest.approx([0.0, 0.0, -7.0], rel=1e-12)
    (given,) = problem.given.loads
    area = {1: 1.0, 2: 1.5}[n]  # facets represent the area of which they are a part
    assert np.asarray(given.value, dtype=float)[2] == pytest.approx(-7.0 / area, rel=1e-12)
    assert problem.on(problem.tagged_mesh).given.loads == problem.given.loads


def test_a_formula_has_no_whole_force() -> None:
    materials = dict.fromkeys(("lower", "upper"), STEEL)
    loads = [Traction("top", (0.0, 0.0, "-x"), total=True)]
    with pytest.raises(InputError, match="formula, but total = true"):
        Problem(two_blocks(COMM, 1), materials, [Support("left")], loads)


@pytest.mark.serial
def test_densities() -> None:
    weight = GravityTable([0.0, -10.0], {"a": 3.0}, constant=False)
    assert weight.loads(["a", "b"]) == [BodyForce("a", (0.0, -30.0), name="gravity")]


@pytest.mark.serial
@pytest.mark.parametrize(
    ("acceleration", "density", "part"),
    [
        ([0.0, -10.0], {}, "density is empty"),
        ([0.0, -10.0], {"bas": 1.0}, "did you mean 'base'"),
        ([0.0, -10.0], {"base": -1.0}, "density of 'base' is -1; give a positive"),
        ([0.0, np.inf], {"base": 1.0}, "is not finite"),
    ],
)
def test_weights_that_cannot_be(
    acceleration: list[float], density: Mapping[str, float], part: str
) -> None:
    with pytest.raises(InputError, match=part):
        GravityTable(acceleration, dict(density)).loads(["base", "lid"])
