"""Test shakedown loads against closed forms, a second method, and a history of cycles."""

import math
import re
from pathlib import Path
from typing import Any, ClassVar

from mpi4py import MPI

import numpy as np
import pytest

from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    Contact,
    DruckerPrager,
    Elastic,
    InputError,
    LoadDomain,
    MohrCoulomb,
    Pressure,
    Problem,
    Support,
    Tie,
    Traction,
    Tresca,
    VonMises,
    read_gmsh,
    shakedown_load,
    stacked_blocks,
)
from perfplast_fenicsx.limit_analysis import shakedown_diagram
from perfplast_fenicsx.limit_analysis.shakedown.shakedown_load import Failure
from perfplast_fenicsx.materials import Material
from perfplast_fenicsx.materials.von_mises import VonMisesLaw
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem import Temperature

STEEL = VonMises(young=2e5, poisson=0.3, yield_stress=math.sqrt(3))
"""k = 1."""

NU = 0.3


def tube(comm: MPI.Intracomm, folder: Path, outer: float, size: float, order: int) -> TaggedMesh:
    """Return a quarter of a tube."""
    path = folder / "tube.msh"
    if comm.rank == 0:
        write_thick_tube(path, outer=outer, size=size, order=order)
    comm.barrier()
    return read_gmsh(comm, path)


def first_yield(ratio: float) -> float:
    """Return the pressure over k at which a tube in plane strain yields at its bore, by Lamé."""
    share = 1 / (ratio**2 - 1)
    stress = np.array([-1.0, share * (1 + ratio**2), 0.0])
    stress[2] = NU * stress.sum()
    return math.sqrt(2) / float(np.linalg.norm(stress - stress.mean()))


@pytest.mark.long(but=["1.5-1", "2.0-2", "3.0-2"])
@pytest.mark.mpi2("1.5-1")
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("ratio", [1.5, 2.0, 3.0])
def test_a_thick_tube(ratio: float, order: int, comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    """The loads are min(2 p_el, p_lim) = 0.81093, 1.38629 and 1.77719 k."""
    mesh = tube(comm, shared_tmp_path, ratio, 0.1, order)
    held = [Support("x0", "x"), Support("y0", "y")]
    loads = [Pressure("inner", 1.0, name="p")]
    problem = Problem(mesh, {"tube": STEEL}, held, loads, degree=2)
    found = shakedown_load(problem, LoadDomain.of_ranges({"p": (0.0, 1.0)}))
    twice, limit = 2 * first_yield(ratio), 2 * math.log(ratio)
    assert found.converged
    assert found.load is not None
    assert found.upper is not None
    assert found.linear == (order == 1)
    assert found.failure == (Failure.ALTERNATING if twice < limit else Failure.COLLAPSE)
    if order == 1 or twice > limit:  # in curved cells the stress at the bore is not known
        assert found.load == pytest.approx(min(twice, limit), rel=5e-3)
    assert found.upper == pytest.approx(found.load, rel=2e-4)
    assert found.over <= 1 + 1e-6
    assert found.unbalanced <= 1e-9
    assert found.steps <= 15


def block(comm: MPI.Intracomm, law: object, loads: list[object], ties: bool = True) -> Problem:
    """Return two glued blocks that are free to widen."""
    return Problem(
        stacked_blocks(comm, 1),
        {"lower": law, "upper": law},  # type: ignore[dict-item]
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        loads,  # type: ignore[arg-type]
        degree=2,
        contacts=[Tie("lower_top", "upper_bottom")] if ties else [],
    )


@pytest.mark.mpi2
def test_a_bar_pulled_and_pushed(comm: MPI.Intracomm) -> None:
    """A uniform stress has no residual stress. The limit loads apply, with dead loads."""
    Y = math.sqrt(3)
    pull = Traction("top", (0.0, 0.0, 1.0), name="pull")
    held = Traction("top", (0.0, 0.0, 0.25 * Y), constant=True, name="held")
    both = shakedown_load(block(comm, STEEL, [pull, held]), LoadDomain.of_ranges({"pull": (-1, 1)}))
    assert both.load == pytest.approx(0.75 * Y, rel=2e-4)
    assert both.first_yield is None  # with constant loads
    alone = shakedown_load(block(comm, STEEL, [pull]), LoadDomain.of_ranges({"pull": (-0.5, 1)}))
    assert alone.load == pytest.approx(Y, rel=2e-4)
    assert alone.first_yield == pytest.approx(Y, rel=1e-8)


@pytest.mark.long
def test_frictional_ground(comm: MPI.Intracomm) -> None:
    """Two corners of uniaxial stress limit the load, each at its yield stress."""
    law = DruckerPrager(2e5, 0.3, cohesion=1.0, friction_angle=20.0, match="compression")
    pull = Traction("top", (0.0, 0.0, 1.0), name="pull")
    eta = 6 * math.sin(math.radians(20.0)) / (math.sqrt(3) * (3 - math.sin(math.radians(20.0))))
    cohesion = (
        6 * math.cos(math.radians(20.0)) / (math.sqrt(3) * (3 - math.sin(math.radians(20.0))))
    )
    limits = [cohesion / (1 / math.sqrt(3) + sign * eta / 3) for sign in (1.0, -1.0)]
    for low, high in ((0.0, 1.0), (-1.0, 0.5)):
        found = shakedown_load(
            block(comm, law, [pull]), LoadDomain.of_ranges({"pull": (low, high)})
        )
        ends = [limit / part for limit, part in zip(limits, (high, -low), strict=True) if part > 0]
        assert found.load == pytest.approx(min(ends), rel=2e-4)


def test_corners_and_heat(comm: MPI.Intracomm) -> None:
    """A bar held at both ends is heated repeatedly: EαΔT ≤ 2Y minus a constant tension."""
    steel = VonMises(2e5, 0.3, 100.0, expansion=1e-5)
    mesh = stacked_blocks(comm, 1)
    problem = Problem(
        mesh,
        {"lower": steel, "upper": steel},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z"), Support("top", "z")],
        degree=2,
        contacts=[Tie("lower_top", "upper_bottom")],
        initial=[Temperature("lower", 1.0, name="heat"), Temperature("upper", 1.0, name="heat")],
    )
    found = shakedown_load(problem, LoadDomain.of_ranges({"heat": (0.0, 1.0)}))
    assert found.load == pytest.approx(2 * 100.0 / (2e5 * 1e-5), rel=2e-4)
    assert found.failure == Failure.ALTERNATING
    assert found.accumulated < 0.01
    mean = LoadDomain.of_corners([{"heat": 1.0}, {"heat": -2.0}])
    wider = shakedown_load(problem, mean)
    assert wider.load == pytest.approx(2 * 100.0 / (3 * 2e5 * 1e-5), rel=2e-4)


@pytest.mark.mpi2("20.0")
@pytest.mark.parametrize("angle", [0.0, 20.0])
def test_heat_in_ground(angle: float, comm: MPI.Intracomm) -> None:
    """The same bar of Tresca or Mohr–Coulomb ground: EαΔT is the sum of both strengths."""
    c, phi = 10.0, math.radians(angle)
    law: Material = Tresca(2e5, 0.3, c, expansion=1e-5)
    if angle:
        law = MohrCoulomb(2e5, 0.3, c, angle, expansion=1e-5)
    strength = 2 * c * math.cos(phi)
    pulled, pushed = (strength / (1 + sign * math.sin(phi)) for sign in (1, -1))
    problem = Problem(
        stacked_blocks(comm, 1),
        {"lower": law, "upper": law},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z"), Support("top", "z")],
        degree=2,
        contacts=[Tie("lower_top", "upper_bottom")],
        initial=[Temperature("lower", 1.0, name="heat"), Temperature("upper", 1.0, name="heat")],
    )
    found = shakedown_load(problem, LoadDomain.of_ranges({"heat": (0.0, 1.0)}))
    assert found.load == pytest.approx((pulled + pushed) / (2e5 * 1e-5), rel=2e-4)
    assert found.upper == pytest.approx(found.load, rel=2e-4)
    assert found.first_yield == pytest.approx(pushed / (2e5 * 1e-5), rel=1e-6)
    assert found.over <= 1 + 1e-6
    # ground dilates at either corner, and expands sideways
    assert found.failure == (Failure.BOTH if angle else Failure.ALTERNATING)


@pytest.mark.long
def test_a_diagram(comm: MPI.Intracomm) -> None:
    """Two independent tractions on one face together carry Y."""
    one = Traction("top", (0.0, 0.0, 1.0), name="one")
    other = Traction("top", (0.0, 0.0, 10.0), name="other")
    problem = block(comm, STEEL, [one, other])
    rows = shakedown_diagram(problem, LoadDomain.of_ranges({"one": (0, 1), "other": (0, 1)}), 5)
    assert [row.angle for row in rows] == pytest.approx([0, 22.5, 45, 67.5, 90])
    for row in rows:
        assert row.first is not None
        assert row.second is not None
        assert row.first + 10 * row.second == pytest.approx(math.sqrt(3), rel=2e-4)


class NoCone:
    """A yield set without a known cone."""

    def cones(self, size: int) -> None:
        """Return none."""


class UnknownLaw(VonMisesLaw):
    """A law whose set has no cone."""

    @property
    def yields(self) -> Any:
        """Return the set."""
        return NoCone()


class Unknown(VonMises):
    """A material of this law."""

    law: ClassVar = UnknownLaw


PULL = Traction("top", (0.0, 0.0, 1.0), name="pull")
STAYS = Traction("top", (0.0, 0.0, 1.0), name="stays", constant=True)


@pytest.mark.parametrize(
    ("loads", "ranges", "part"),
    [
        ([PULL], {}, "ranges is empty"),
        ([PULL], {"pull": [1.0, 1.0]}, r"\[1, 1\] is not a valid range for 'pull'"),
        ([PULL], {"pull": [1.0]}, r"\[1\] is not a valid range for 'pull'"),
        ([PULL], {"pul": [0.0, 1.0]}, "'pul' varies, but no load"),
        (
            [PULL, STAYS],
            {"stays": [0, 1], "pull": [0, 1]},
            "'stays' varies, but this load is constant",
        ),
        ([PULL, Pressure("top", 2.0)], {"pull": [0.0, 1.0]}, "the load 'top' has no range"),
        ([PULL], {str(i): [0.0, 1.0] for i in range(7)}, "there are 7 ranges"),
    ],
)
def test_refused(
    loads: list[object], ranges: dict[str, list[float]], part: str, comm: MPI.Intracomm
) -> None:
    problem = block(comm, STEEL, loads)
    with pytest.raises(InputError, match=part):
        shakedown_load(problem, LoadDomain.of_ranges(ranges))


def test_more_is_refused(comm: MPI.Intracomm) -> None:
    for corners in ([], [{"pull": 1.0}], [{"pull": 1.0}, {"pull": 1.0}]):
        with pytest.raises(InputError, match="two different corners"):
            LoadDomain.of_corners(corners)
    ranges = LoadDomain.of_ranges({"pull": (0.0, 1.0)})
    with pytest.raises(InputError, match=r"a single cone of stresses.*'lower' \(Unknown\)"):
        shakedown_load(block(comm, Unknown(2e5, 0.3, 1.0), [PULL]), ranges)
    with pytest.raises(InputError, match="cohesion = 0 in volume 'lower'"):
        shakedown_load(block(comm, MohrCoulomb(2e5, 0.3, 0.0, 20.0), [PULL]), ranges)
    with pytest.raises(InputError, match="stress in a body that can yield"):
        shakedown_load(block(comm, Elastic(2e5, 0.3), [PULL]), ranges)
    touching = Problem(
        stacked_blocks(comm, 1),
        {"lower": STEEL, "upper": STEEL},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [PULL],
        [Contact("lower_top", "upper_bottom")],
        degree=2,
    )
    with pytest.raises(InputError, match="contacts that stay closed"):
        shakedown_load(touching, ranges)


def test_dead_loads_that_are_too_much(comm: MPI.Intracomm) -> None:
    heavy = Traction("top", (0.0, 0.0, 2.0), name="heavy", constant=True)
    found = shakedown_load(
        block(comm, STEEL, [PULL, heavy]), LoadDomain.of_ranges({"pull": (0.0, 1.0)})
    )
    assert not found.converged
    told = re.fullmatch(
        r"No shakedown load was found: on this mesh, the bodies carry about (0\.\d+) times the "
        r"constant loads\.",
        found.in_words(),
    )
    assert told is not None
    assert float(told[1]) == pytest.approx(math.sqrt(3) / 2, rel=3e-4)
