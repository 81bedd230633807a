"""Test constant displacements, overlaps, temperatures and stresses: limit loads do not change."""

from typing import Any

import pytest

from perfplast_fenicsx import (
    Contact,
    InitialStress,
    InputError,
    Pressure,
    Problem,
    Support,
    Temperature,
    Traction,
    VonMises,
)
from perfplast_fenicsx.limit_analysis.body.limit_bounds import limit_bounds
from perfplast_fenicsx.limit_analysis.limit_search import limit_load
from perfplast_fenicsx.limit_analysis.statements.limit_checks import ignored
from perfplast_fenicsx.materials import Flow
from perfplast_fenicsx.materials.hardening import Hardening
from tests.models import touching_blocks

STEEL = VonMises(2e5, 0.3, 300.0, expansion=1.2e-5)
LOADS = [Pressure("top", 1.0), Traction("top", (0.0, 0.3, 0.0))]
PLACES = [Support("x0", "x"), Support("y0", "y")]

STAYS: dict[str, dict[str, Any]] = {
    "a settlement": {"supports": [*PLACES, Support("bottom", "z", value=-1e-3)]},
    "a press fit": {
        "contacts": [Contact("lower_top", "upper_bottom", gap=-1e-3, interference=True)]
    },
    "a gap": {"contacts": [Contact("lower_top", "upper_bottom", gap=1e-3)]},
    "a temperature": {"initial": [Temperature("upper", "40*y")]},
    "an initial stress": {"initial": [InitialStress("lower", (90.0, 0, "-50*x", 0, 0, 9.0))]},
    "bodies that remember": {"materials": {"lower": Flow(STEEL), "upper": Flow(STEEL)}},
}


def blocks(**changes: Any) -> Problem:
    given: dict[str, Any] = {
        "materials": {"lower": STEEL, "upper": STEEL},
        "supports": [*PLACES, Support("bottom", "z")],
        "loads": LOADS,
        "degree": 2,
    }
    return touching_blocks(**(given | changes))


@pytest.mark.mpi2("a settlement")
@pytest.mark.parametrize("what", STAYS)
def test_limit_load_and_bounds_are_those_without(what: str) -> None:
    plain, problem = blocks(), blocks(**STAYS[what])
    told = what not in ("a gap", "bodies that remember")
    assert bool(ignored(problem)) == told
    assert not ignored(plain)
    expected, found = limit_load(plain, 1e-4), limit_load(problem, 1e-4)
    assert found.method == "interior-point"
    assert found.lower == pytest.approx(expected.lower, rel=1e-6)
    assert found.upper == pytest.approx(expected.upper, rel=1e-6)


@pytest.mark.long(but=["a press fit"])
@pytest.mark.parametrize("what", ["a settlement", "a press fit", "a temperature"])
def test_strict_bounds_are_those_without(what: str) -> None:
    expected, found = limit_bounds(blocks(), 1e-3), limit_bounds(blocks(**STAYS[what]), 1e-3)
    for one, other in ((expected.lower, found.lower), (expected.upper, found.upper)):
        assert one.value is not None
        assert other.value == pytest.approx(one.value, rel=1e-6)
        assert other.of == one.of


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        (
            {"supports": [*PLACES, Support("bottom", "z", value=1e-3, constant=False)]},
            "the load factor moves supports",
        ),
        (
            {"loads": [], "supports": [*PLACES, Support("bottom", "z", value=1e-3)]},
            "no load",
        ),
        ({"materials": {"lower": Flow(Hardening(2e5, 0.3, 300.0, 1e3)), "upper": STEEL}}, "harden"),
    ],
    ids=["driven", "no load", "hardening"],
)
def test_what_is_refused(changes: dict[str, Any], part: str) -> None:
    with pytest.raises(InputError, match=part):
        limit_load(blocks(**changes), 1e-3, method="interior-point")
