"""Test the search for roots of μ over F, on known curves."""

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest

from perfplast_fenicsx.limit_analysis.body import safety_factor
from perfplast_fenicsx.limit_analysis.body.factor_roots import FactorRoots
from perfplast_fenicsx.limit_analysis.statements.load_factor import Bound, Scope

ROOT = 1.56
STEEP = 100.0


def bounds(factor: float, kind: str, strict: bool = True) -> Any:
    """Return bounds of one kind on μ = (1.56/F)^100, as for a slope with almost no cohesion."""
    none, scope = Bound(None, kind, Scope.MESH), Scope.BODY if strict else Scope.MESH
    found = Bound((ROOT / factor) ** STEEP if strict else None, kind, scope)
    lower, upper = (found, none) if kind == "lower" else (none, found)
    return SimpleNamespace(lower=lower, upper=upper, static=None)


@dataclass
class Known(FactorRoots):
    """A known curve, on a mesh with or without strict bounds."""

    strict: bool = True

    def _bound(self, kind: str, factor: float) -> None:
        self.searches += 1
        self.keep(factor, bounds(factor, kind, self.strict), kind)


def curve(factor: float, kind: str, steepness: float, strict: bool = True) -> Known:
    """Return the known data on a mesh after one bound at some F."""
    nothing: Any = None
    found = Known(nothing, 1e-3, None, None, steepness, strict=strict)
    found.keep(factor, bounds(factor, kind, strict), kind)
    return found


@pytest.mark.serial
@pytest.mark.parametrize(
    ("kind", "factor", "other"), [("upper", 1.69, 1.45), ("lower", 1.45, 1.69)]
)
def test_no_root_is_sought_beyond_a_bound_of_the_other_kind(
    kind: str, factor: float, other: float
) -> None:
    """A steepness that is much too small would lead beyond this bound."""
    known = curve(factor, kind, steepness=7.0)
    found = known.root(kind, None, other)
    assert found == pytest.approx(ROOT, rel=1.1e-3)
    low, high = sorted((factor, other))
    assert all(low <= tried <= high for tried in known.found[kind])
    assert known.searches <= 6


@pytest.mark.serial
def test_the_root_of_a_coarser_mesh_where_the_last_one_has_no_strict_bound() -> None:
    coarse, fine = (curve(1.5, "lower", STEEP, strict) for strict in (True, False))
    safety_factor._root_of_finest([coarse, fine], "lower", "upper")
    assert max(coarse.shown("lower")) == pytest.approx(ROOT, rel=1.1e-3)
    assert max(coarse.shown("lower")) <= ROOT
    assert not fine.shown("lower")
    hopeless = [curve(1.5, "lower", STEEP, False) for _ in range(3)]
    safety_factor._root_of_finest(hopeless, "lower", "upper")
    assert [it.searches > 0 for it in hopeless] == [False, False, True]
    again = curve(1.5, "lower", STEEP)
    safety_factor._root_of_finest([curve(1.5, "lower", STEEP), again], "lower", "upper")
    assert math.isclose(max(again.shown("lower")), max(coarse.shown("lower")))
