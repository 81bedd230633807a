"""Test searches that stop early or find rotating bodies: the program reports the known bounds."""

import json
import os
from pathlib import Path

from mpi4py import MPI

import gmsh
import numpy as np
import pytest

from meshes.joints import fragment, joints, sides
from meshes.naming import name
from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Elastic,
    Problem,
    Support,
    VonMises,
)
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.recorder import Recorder
from perfplast_fenicsx.cli.signals import Interrupted, Interrupts
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import Round
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep, StopSearch
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.mesh import gmsh_session, on_plane, write_split
from perfplast_fenicsx.proof import check
from tests.models import Read

pytestmark = pytest.mark.usefixtures("undrawn")

MANY = 10 * int(os.environ.get("PERFPLAST_FUZZ", "0"))
SEEDS = range(MANY or 4)
"""Seeds of random assemblies; every fourth assembly is in 3D."""


def write_pinned(path: Path, seed: int) -> None:
    """Write a lug or two plates on pins that can rotate freely. On one process.

    In 2D, round pins at random places connect bars; in 3D, plates are connected by a bolt with a
    head at either end.
    """
    random = np.random.default_rng(seed)
    with gmsh_session():
        occ = gmsh.model.occ
        if seed % 4 < 3:
            height, radius = 1.0 + random.random(), 0.25 + 0.15 * random.random()
            parts = {"base": [(2, occ.addRectangle(0, 0, 0, 3, 2 * height))]}
            for number in range(1, 2 + seed % 2):
                x, y = 0.8 + 1.2 * (number - 1) + 0.2 * random.random(), height
                parts[f"pin_{number}"] = [(2, occ.addDisk(x, y, 0, radius, radius))]
            dim = 2
        else:
            radius = 0.4 + 0.1 * random.random()
            parts = {
                "lower": [(3, occ.addBox(0, -1, 0, 3, 2, 1))],
                "upper": [(3, occ.addBox(0, -1, 1, 3, 2, 1))],
            }
            bolt = [(3, occ.addCylinder(1.5, 0, 0, 0, 0, 2, radius))]
            heads = [(3, occ.addCylinder(1.5, 0, z, 0, 0, 0.4, 0.8)) for z in (-0.4, 2.0)]
            parts["bolt"] = occ.fuse(bolt, heads)[0]
            dim = 3
        if dim == 2:
            _, images = occ.fragment(
                parts["base"], [p for k, p in parts.items() if k != "base" for p in p]
            )
            occ.synchronize()
            pins = [tag for some in images[1:] for _, tag in some]
            rest = [tag for _, tag in images[0] if tag not in pins]
            bodies = {"base": rest} | {f"pin_{k}": [tag] for k, tag in enumerate(pins, start=1)}
            name(2, bodies)
            found: dict[str, list[int]] = {"foot": on_plane(1, 1, 0.0)}
            for k, tag in enumerate(pins, start=1):
                found[f"joint_{k}"] = [int(a) for a in gmsh.model.getAdjacencies(2, tag)[1]]
            name(1, found)
        else:
            bodies = fragment(parts)
            name(3, bodies)
            foot = [tag for tag in on_plane(2, 0, 0.0)]
            name(2, {"foot": foot} | joints(bodies))
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5 if dim == 2 else 0.8)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 12)
        gmsh.model.mesh.generate(dim)
        write_split(path)


def pinned(read: Read, seed: int) -> Problem:
    """Return the assembly, pulled by a body force on bodies that rotate, or beside them."""
    tagged_mesh = read(write_pinned, seed=seed)
    steel = VonMises(2.1e5, 0.3, 235.0)
    materials = dict.fromkeys(tagged_mesh.volumes, steel)
    if seed % 3 == 0 and "pin_1" in materials:
        materials["pin_1"] = VonMises(2.1e5, 0.3, 900.0)
    dim = tagged_mesh.mesh.geometry.dim
    on = "upper" if dim == 3 else "pin_1"
    force = (0.3, 0.0, 1.0) if dim == 3 else (0.3, 1.0)
    contacts = [Contact(a, b) for a, b in sides(tagged_mesh.surfaces)]
    supports = [Support("foot")]
    return Problem(tagged_mesh, materials, supports, [BodyForce(on, force)], contacts, degree=2)


@pytest.mark.long(but=["0"])
@pytest.mark.parametrize("seed", SEEDS)
def test_assemblies_in_which_something_may_turn_have_a_bracket(read: Read, seed: int) -> None:
    problem = pinned(read, seed)
    found = interior_point(problem, 1e-3)
    assert found.upper is not None
    # the few quadratic 3D tetrahedra almost lock, and their mechanisms dissipate more
    apart = 1e-3 if problem.tagged_mesh.mesh.geometry.dim == 2 else 1e-2
    assert 0 < found.lower <= found.upper <= found.lower * (1 + apart), repr(found)
    assert len(found.steps) <= 25


class Enough(StopSearch):
    """The monitor stops the search."""


@pytest.mark.long(but=["8"])
@pytest.mark.mpi2("8")
@pytest.mark.parametrize("most", [8, 11])
def test_a_stopped_search_tells_its_bracket(read: Read, most: int) -> None:
    """At any stop, the bracket contains the bracket of the complete search."""
    problem = pinned(read, 1)
    whole = interior_point(problem, 1e-4)

    def stop(step: InteriorStep) -> None:
        if step.number == most:
            raise Enough

    with pytest.raises(Enough) as caught:
        interior_point(problem, 1e-8, stop)
    found = caught.value.found
    assert isinstance(found, LimitLoad)
    assert len(found.steps) == most
    assert whole.upper is not None
    assert found.lower <= whole.upper * (1 + 1e-9)
    assert f"stopped after {most} steps" in found.reason
    if found.upper is not None:
        assert found.upper >= whole.lower * (1 - 1e-9)
        assert found.estimate == pytest.approx((found.lower + found.upper) / 2)
        assert "apart" in found.reason
    else:
        assert most < 11


CASE = """
[mesh]
builder = "two_blocks"
n = 2
[material.lower]
law = "von-mises"
young = 206900.0
poisson = 0.29
yield_stress = 450.0
[material.upper]
law = "von-mises"
young = 206900.0
poisson = 0.29
yield_stress = 450.0
[[support]]
on = "left"
[[load]]
on = "top"
traction = [0.0, 0.0, -1.0]
[[contact]]
primary = "upper_bottom"
secondary = "lower_top"
[element]
degree = 2
[loading]
control = "work"
until = "limit"
limit_tolerance = 1e-6
"""


def test_an_interrupted_run_writes_what_it_knows(
    comm: MPI.Intracomm, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case, results = shared_tmp_path / "case.toml", shared_tmp_path / "results"
    if comm.rank == 0:
        case.write_text(CASE)
    comm.barrier()
    seen = []

    def check(self: Interrupts) -> None:
        seen.append(self)
        if len(seen) == 7:
            raise Interrupted(15)

    monkeypatch.setattr(Interrupts, "check", check)
    assert main(["run", str(case), "-o", str(results)]) == 128 + 15
    if comm.rank == 0:
        limit = json.loads((results / "summary.json").read_text())["limit"]
        assert 0 < limit["lower"] <= limit["estimate"] <= limit["upper"]
        assert not limit["levelled_off"]
        assert "the search was stopped after" in limit["reason"]


@pytest.mark.long
def test_a_run_that_is_interrupted_on_its_second_mesh(
    comm: MPI.Intracomm, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The results of the first mesh are stored, with its mechanism and the remaining work."""
    case, results = shared_tmp_path / "case.toml", shared_tmp_path / "results"
    until = 'until = "limit"\n'
    if comm.rank == 0:
        text = CASE.replace('control = "work"', 'control = "bounds"').replace(until, "")
        case.write_text(text.replace("[mesh]", "[mesh]\nadapt = { until = 1e-4, cells = 500 }"))
    comm.barrier()
    rounds = list[Round]()

    def interior(_: Recorder, step: InteriorStep) -> None:
        if rounds and step.number == 3:
            raise Interrupted(15)

    monkeypatch.setattr(Recorder, "interior", interior)
    monkeypatch.setattr(Recorder, "mesh", lambda _, round_: rounds.append(round_))
    assert main(["run", str(case), "-o", str(results)]) == 128 + 15
    assert len(rounds) == 1
    if comm.rank == 0:
        limit = json.loads((results / "summary.json").read_text())["limit"]
        body, (step,) = limit["body"], limit["next_steps"]
        assert (body["lower"], body["upper"]) == (rounds[0].lower, rounds[0].upper)
        assert body["strict"]
        assert [mesh["cells"] for mesh in body["meshes"]] == [rounds[0].cells]
        assert "the search on the next mesh was interrupted" in step
        assert {"bounds.h5", "mechanism.vtkhdf"} <= {path.name for path in results.iterdir()}
        assert not any(of.faults for of in check(results / "bounds.h5").values())


def test_what_is_found_of_other_loads_is_not_told(
    comm: MPI.Intracomm, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bounds with reduced strengths do not hold for the case."""
    case, results = shared_tmp_path / "case.toml", shared_tmp_path / "results"
    if comm.rank == 0:
        text = CASE.replace('control = "work"', 'control = "strength"')
        text = text.replace('until = "limit"\n', "").replace("-1.0]", "-1.0]\nconstant = true")
        case.write_text(text)
    comm.barrier()

    def interior(_: Recorder, step: InteriorStep) -> None:
        if step.number == 3:
            raise Interrupted(15)

    monkeypatch.setattr(Recorder, "interior", interior)
    assert main(["run", str(case), "-o", str(results)]) == 128 + 15
    if comm.rank == 0:
        assert json.loads((results / "summary.json").read_text())["limit"] is None


def test_elastic_bodies_that_may_turn(read: Read) -> None:
    """A pin that does not yield is in a base that yields."""
    tagged_mesh = read(write_pinned, seed=0)
    problem = Problem(
        tagged_mesh,
        {"base": VonMises(2.1e5, 0.3, 235.0), "pin_1": Elastic(2.1e5, 0.3)},
        [Support("foot")],
        [BodyForce("pin_1", (0.0, 1.0))],
        [Contact(a, b) for a, b in sides(tagged_mesh.surfaces)],
        degree=2,
    )
    found = interior_point(problem, 1e-3)
    assert found.upper is not None
    assert found.lower <= found.upper <= found.lower * (1 + 1e-3)
