"""Test that claims without support in the file are refused, even if the difference is hidden."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from perfplast_fenicsx import limit_bounds
from perfplast_fenicsx.proof import check
from tests.limit_analysis.test_dead_loads import K, footing
from tests.proof.forging import (
    Arrays,
    Halves,
    alone,
    blocks,
    both,
    in_turn,
    said_of_forged,
    times,
    write,
    written,
)
from tests.proof.test_forgeries import free_cell

pytestmark = pytest.mark.serial

Change = Callable[[Arrays], object]


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return two stacked blocks."""
    return blocks(tmp_path_factory.mktemp("pressed"), 2)


@pytest.fixture(scope="module")
def fallen(tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return a strip that constant loads shear off under any pressure."""
    bounds = limit_bounds(footing((0.0, -1.0), (2 * K, 0.0)))
    return written(tmp_path_factory.mktemp("fallen"), bounds)


def nearly_all_stays(them: Arrays) -> None:
    """All loads are constant at the upper bound, except for a billionth."""
    share = (1 - 1e-9) * float(them["bound"])
    for name in ("traction", "body_force"):
        them[f"constant_{name}"] = share * them[name]
    them["bound"] = 1e-9 * them["bound"]


@pytest.mark.parametrize("claim", [1.0, 0.9, 0.0, -0.9])
def test_a_claim_beside_loads_at_their_limit(pressed: Halves, tmp_path: Path, claim: float) -> None:
    """The bound is 1e-9 of the dissipation, and is still proven to 0.1 %."""
    honest = float(pressed["upper"]["bound"])
    forge = in_turn(nearly_all_stays, times("bound", claim))
    said = said_of_forged(pressed, alone("upper", forge), tmp_path)
    if claim == 1.0:
        assert not said
        proven = check(tmp_path / "forged.h5")["upper"].proven
        assert proven == pytest.approx(1e-9 * honest, rel=2e-3)
    else:
        assert "only" in said
        number = float(said.split("only ")[1].split()[0])
        assert number == pytest.approx(1e-9 * honest, rel=2e-3)


def idle_and_quick(them: Arrays) -> None:
    """A remote cell without loads of any factor moves a million times as fast."""
    free_cell(1.0)(them)
    cell, facets = len(them["cells"]) - 1, len(them["facets"]) - len(them["any_traction"])
    assert facets > 0
    fastest = np.abs(them["velocity"]).max()
    them["velocity"][them["nodes"][cell]] = [1e6 * fastest, 0.0]
    for name, rows in (("traction", facets), ("body_force", 1), ("pore_pressure", 1)):
        for kind in ("constant_", "any_"):
            if f"{kind}{name}" in them:
                before = them[f"{kind}{name}"]
                none = np.zeros((rows, *before.shape[1:]))
                them[f"{kind}{name}"] = np.concatenate([before, none])
    if "pore_pressure" in them:
        before = them["pore_pressure"]
        them["pore_pressure"] = np.concatenate([before, np.zeros((1, *before.shape[1:]))])


def some_work(them: Arrays) -> None:
    """Loads of any factor are a ten thousandth of the others, and do work."""
    them["any_traction"] = them["any_traction"] + 1e-4 * them["traction"]


@pytest.mark.parametrize("forge", [some_work, in_turn(some_work, idle_and_quick)])
def test_work_of_loads_of_any_factor(fallen: Halves, tmp_path: Path, forge: Change) -> None:
    """For any speed of the others, these loads do work in their place."""
    said = said_of_forged(fallen, alone("upper", forge), tmp_path)
    assert "work of others" in said


def test_a_quick_idle_cell_alone_is_harmless(fallen: Halves, tmp_path: Path) -> None:
    assert not said_of_forged(fallen, alone("upper", idle_and_quick), tmp_path)


def test_the_largest_factor_of_others_is_told(fallen: Halves, tmp_path: Path) -> None:
    words = check(write(tmp_path / "told.h5", fallen))["upper"].words
    assert any("with any factor of the free loads up to" in word for word in words)


def on_supports_alone(them: Arrays) -> None:
    """All loads act on supported nodes."""
    push = np.zeros_like(them["traction"])
    push[them["held"].all(axis=1)] = 1.0
    assert push.any()
    them.update(traction=push, body_force=np.zeros_like(them["body_force"]))
    them["bound"] = np.asarray(1e9)
    if "stress" in them:
        them["stress"] = np.zeros_like(them["stress"])


def test_nothing_that_matters_is_loaded(tmp_path: Path) -> None:
    """The body carries such loads with every factor, so a bound has no meaning."""
    honest = written(tmp_path, limit_bounds(footing((0.0, -1.0), (0.0, 0.0))))
    for forge in (both(on_supports_alone), alone("lower", on_supports_alone)):
        assert "only supports are loaded" in said_of_forged(honest, forge, tmp_path)
