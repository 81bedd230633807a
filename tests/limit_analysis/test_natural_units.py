"""Test strengths of very different size, and loads that nothing, or almost nothing, limits."""

from collections.abc import Sequence
from dataclasses import replace
from math import sqrt

from mpi4py import MPI

import numpy as np
import pytest

from meshes.thick_sphere import write_thick_sphere
from perfplast_fenicsx import Elastic, Plane, Pressure, Problem, Support, Traction, VonMises
from perfplast_fenicsx.limit_analysis import (
    BodyBounds,
    Verdict,
    interior_point,
    limit_bounds,
    strict_lower_bound,
)
from perfplast_fenicsx.limit_analysis.conic import interior_steps
from perfplast_fenicsx.limit_analysis.conic.conic_program import UNLIMITED, ConicProgram, Start
from perfplast_fenicsx.units import SYSTEMS, Name
from tests.contrast_bodies import SURFACES, forces_left, layers, material, square, squeezed
from tests.limit_analysis.stress_checker import check_stress
from tests.limit_analysis.test_static_bound import rectangle
from tests.models import Read

COMM = MPI.COMM_WORLD


def columns(yields: Sequence[float], n: int = 4) -> Problem:
    """Return columns of one mesh, 1 wide and 1 high, that an elastic platen compresses."""
    count = len(yields)
    volumes = {
        f"column{i}": lambda x, i=i: (x[0] > i) & (x[0] < i + 1) & (x[1] < 1)  # type: ignore[misc]
        for i in range(count)
    }
    mesh = rectangle(
        (n * count, n + n // 2),
        (float(count), 1.5),
        volumes | {"platen": lambda x: x[1] > 1},
        SURFACES | {"top": lambda x: x[1] > 1.5 - 1e-9},
        shake=0.1,
    )
    materials = dict(zip(volumes, map(material, yields), strict=True))
    return Problem(
        mesh,
        materials | {"platen": Elastic(young=1e3, poisson=0.3)},
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("top", 1.0)],
        degree=2,
    )


def both(bounds: BodyBounds) -> tuple[float, float]:
    """Return both bounds, which must exist and be strict up to rounding of the balance."""
    assert bounds.upper.strict
    assert bounds.lower.strict or "unbalanced forces by rounding" in bounds.why_not[0]
    assert bounds.lower.value is not None
    assert bounds.upper.value is not None
    return bounds.lower.value, bounds.upper.value


@pytest.mark.mpi2("100000.0")
@pytest.mark.parametrize("contrast", [1e5, 1e8])
def test_a_weak_layer_between_strong_ones(contrast: float) -> None:
    it = layers([contrast, 1.0, 10 * contrast], n=2)
    bounds = limit_bounds(it.problem)
    lower, upper = both(bounds)
    assert 0.999 * it.exact < lower <= it.exact <= upper < 1.1 * it.exact
    assert bounds.advice == ()


def test_strengths_beyond_what_rounding_resolves_are_said() -> None:
    it = layers([1e15, 1.0], n=2)
    bounds = limit_bounds(it.problem)
    lower, upper = both(bounds)
    assert 0.999 * it.exact < lower <= it.exact <= upper
    assert bounds.upper.of_rounding > 0.01
    assert bounds.mesh.estimate == pytest.approx(it.exact, rel=0.06)
    words = bounds.in_words()
    assert "'layer0', 1e+15 times as strong as the weakest body; give it law = \"elastic\"" in words


@pytest.mark.long
def test_a_weak_body_that_bears_nothing_spoils_no_bound() -> None:
    """Beside a column of strength 1, the other may have 1e-3 or less; both once counted as 1e-3."""
    found = [both(limit_bounds(columns([weak, 1.0]))) for weak in (1e-2, 1e-3, 1e-4)]
    for lower, upper in found[1:]:
        assert lower == pytest.approx(found[0][0], rel=0.02)
        assert upper == pytest.approx(found[0][1], rel=0.02)
        assert 1 / sqrt(3) < lower < upper < 1.2 * lower  # at least the single column, over 2


def test_a_much_weaker_body_spoils_no_upper_bound() -> None:
    """Rounding errors in the strong body may exceed the strength of the weak body."""
    few, many = (limit_bounds(columns([weak, 1.0])) for weak in (1e-3, 1e-12))
    assert both(few)[1] == pytest.approx(many.upper.value, rel=0.01)
    if many.lower.value is None:
        assert "out of the mesh" in many.in_words()


def test_bodies_that_were_too_strong_to_yield_do_in_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """If the search begins with an irrelevant strength, it continues with the next strength."""
    # with less, balance would depend on rounding: pressures at the ends are 1e5 times as large
    weak = 7.5e-5
    problem = columns([weak, 1.0])
    starts: list[Start] = []
    choose = interior_steps.choose_units

    def weakest_first(program: ConicProgram, start: Start) -> bool:
        if start.scale is None:
            start = replace(start, scale=weak)
        starts.append(start)
        return choose(program, start)

    right = interior_point(problem).estimate
    bound = strict_lower_bound(problem).bound.value
    for module in ("discrete.discrete_limit", "stress.static_bound"):
        path = f"perfplast_fenicsx.limit_analysis.{module}.choose_units"
        monkeypatch.setattr(path, weakest_first)
    found = interior_point(problem)
    assert found.verdict is Verdict.FOUND
    assert found.estimate == pytest.approx(right, rel=1e-3)
    assert [start.scale for start in starts] == [weak, pytest.approx(sqrt(2 / 3))]
    assert strict_lower_bound(problem).bound.value == pytest.approx(bound, rel=1e-3)


@pytest.mark.parametrize("planes", [False, True])
@pytest.mark.parametrize("e", [1e-2, 1e-4])
def test_loads_of_which_little_is_bounded(e: float, planes: bool) -> None:
    it = squeezed(e, planes)
    bounds = limit_bounds(it.problem)
    lower, upper = both(bounds)
    assert 0.999 * it.exact < lower <= it.exact <= upper < 1.001 * it.exact
    assert bounds.static is not None
    left = forces_left(it, check_stress(it.problem, bounds.static.stress), lower)
    assert left < 1e-6 * (upper - lower)


def shut(planes: bool) -> Problem:
    """Return a square under pressure that cannot move: between rollers, or three planes."""
    block, load = {"block": material(sqrt(3))}, [Pressure("top", 1.0)]
    if not planes:
        rollers = [Support("x0", "x"), Support("y0", "y"), Support("right", "x")]
        return Problem(square(4, 0.1), block, rollers, load, degree=2)
    places = {"x0": (0.0, 1.0, 0.0), "y0": (0.0, 0.0, 1.0), "right": (1.0, -1.0, 0.0)}
    walls = [Plane(on, [x, 0.0], [nx, ny]) for on, (x, nx, ny) in places.items()]
    return Problem(square(4, 0.1), block, [], load, obstacles=walls, degree=2)


@pytest.mark.parametrize("case", ["rollers", "planes", "all around"])
def test_loads_that_nothing_bounds(case: str) -> None:
    problem = squeezed(0.0, True).problem if case == "all around" else shut(case == "planes")
    bounds = limit_bounds(problem)
    assert bounds.lower.value is bounds.upper.value is None
    assert bounds.mesh.reason == UNLIMITED
    assert not bounds.mesh.levelled_off
    assert bounds.in_words() == f"N{UNLIMITED[1:]}."


def test_linear_elements_that_lock(read: Read) -> None:
    """A sphere that bursts with quadratic elements."""
    mesh = read(write_thick_sphere, size=0.4)
    held = [Support("x0", "x"), Support("y0", "y"), Support("z0", "z")]
    steel = dict.fromkeys(mesh.volumes, material(sqrt(3)))
    locked = interior_point(Problem(mesh, steel, held, [Pressure("inner", 1.0)], degree=1))
    assert locked.upper is locked.estimate is None
    # rounding decides how the search ends, 1e10 times above the limit load of the sphere
    beyond = locked.reason.startswith(UNLIMITED) or "carry the loads beyond" in locked.reason
    assert beyond or (locked.lower is not None and locked.lower > 1e9)
    assert "locking of linear elements" in locked.reason


def test_slender_bodies_carry_something() -> None:
    """Large motions once made residuals of K look like a corner without strength."""
    length = 40
    ends = {"left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > length - 1e-9}
    mesh = rectangle((2 * length, 2), (float(length), 1.0), {"beam": lambda x: x[0] > -1}, ends)
    beam, end = {"beam": material(sqrt(3))}, [Traction("right", (0.0, -1.0))]
    found = strict_lower_bound(Problem(mesh, beam, [Support("left")], end, degree=1))
    hinge = 2 * 0.5**2 / length  # 2k on either half of the height
    assert found.bound.value is not None
    assert 0.9 * hinge < found.bound.value < 1.05 * hinge
    assert np.isfinite(found.dissipation).all()


def footing(system: Name) -> Problem:
    """Return half a rough footing 0.5 m wide on a steel layer 0.5 m thick, in a system of units."""
    units = SYSTEMS[system]
    high = 0.5 / units.metres
    mesh = rectangle(
        (8, 4),
        (2 * high, high),
        {"soil": lambda x: x[0] > -1.0},
        {
            "base": lambda x: x[1] < 1e-9 * high,
            "axis": lambda x: x[0] < 1e-9 * high,
            "foot": lambda x: (x[1] > (1 - 1e-9) * high) & (x[0] < 0.501 * high),
        },
    )
    steel = VonMises(2.1e11 / units.pascals, 0.3, 2.48e8 / units.pascals)
    supports = [Support("base"), Support("axis", "x")]
    load = Pressure("foot", 2.48e6 / units.pascals)
    return Problem(mesh, {"soil": steel}, supports, [load], degree=2)


@pytest.mark.parametrize("system", ["mm-N-MPa", "in-kip-ksi", "ft-lbf-psf"])
def test_load_factors_do_not_depend_on_the_units(system: Name) -> None:
    """The bounds differ by rounding in the iteration, which is far smaller than the gap."""
    one, other = limit_bounds(footing("SI")), limit_bounds(footing(system))
    assert both(other) == pytest.approx(both(one), rel=1e-9)
