"""Test ten variants of each kind of forgery, in addition to other tests.

| attack | variants |
|---|---|
| facets behind others | ``test_shadowed_contact`` |
| numbers on a page, directions of an envelope | ``test_claims`` |
| links, pipes and shapes without storage | ``test_stored_file`` |
| stiff bodies that supports hold | ``test_held_bodies`` |
| claims, loads far below the strength, cells in one place, loads on what is held | here |
"""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from perfplast_fenicsx.proof import ProofError, check
from perfplast_fenicsx.proof.body import Body
from perfplast_fenicsx.proof.checker import check_lower, overlapping
from perfplast_fenicsx.proof.shared_cells import have_common_volume
from tests.proof.forging import Halves, blocks, copied, write
from tests.proof.test_shadowed_contact import Arrays, only_on_plate, plates

pytestmark = pytest.mark.serial

Floats = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return two stacked blocks."""
    return blocks(tmp_path_factory.mktemp("honest"), 2)


CLAIMS = [
    *((2.0, 3.0), (1.0, 0.5), (0.5, 2.0), (1e-3, 1.0), (1e9, 1e9), (0.0, 1e9)),
    *((1 + 1e-6, 1.0), (1.0, 1 - 1e-6), (3.0, 1 / 3), (1e9, 1e-9)),
]
"""Factors on both claims."""


@pytest.mark.parametrize("claims", CLAIMS)
def test_a_claim_changes_nothing_that_is_proven(
    honest: Halves, tmp_path: Path, claims: tuple[float, float]
) -> None:
    """A half that claims more than its numbers prove proves nothing."""
    halves, proven = copied(honest), check(write(tmp_path / "honest.h5", honest))
    halves["lower"]["factor"] = halves["lower"]["bound"]
    for half, by in zip(halves.values(), claims, strict=True):
        half["bound"] = by * half["bound"]
    found = check(write(tmp_path / "claims.h5", halves))
    for kind, too_much in (("lower", claims[0] > 1), ("upper", claims[1] < 1)):
        assert found[kind].reached == pytest.approx(proven[kind].reached, rel=1e-12)
        assert (found[kind].proven is None) == too_much


@pytest.mark.parametrize("slenderness", 10.0 ** np.linspace(0.5, 6, 10))
def test_a_slender_body_under_pressure(slenderness: float) -> None:
    """A constant hydrostatic pressure balances no force on the end, even a small one.

    The body is a cantilever of width 1. Its end fails in shear, or its foot in bending, at less
    than 1/slenderness of the shear strength.
    """
    body = slender(slenderness)
    for claim in (10.0, 1.0):
        half = body | {"bound": np.asarray(claim / slenderness)}
        found = check_lower(half)
        assert found.proven is None
        assert found.reached is None or found.reached <= 1 / slenderness


def slender(slenderness: float) -> Arrays:
    """Return a cantilever of two cells, with constant pressure 1.5 and a force across its end."""
    arrays = plates((0.0,), (), ()) | {"contacts": np.zeros((0, 2), dtype=int)}
    arrays["vertices"] = arrays["vertices"] * [1.0, slenderness]
    x = arrays["vertices"][arrays["facets"]]
    along = x[:, 1] - x[:, 0]
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    inward = np.einsum("fi,fi->f", normal, x.mean(axis=1) - [0.5, slenderness / 2]) < 0
    normal[inward] *= -1.0
    top = np.isclose(x[:, :, 1].min(axis=1), slenderness)
    arrays["traction"] = np.zeros((4, 2, 2))
    arrays["traction"][top, :, 0] = 1.0
    arrays["constant_traction"] = np.repeat(-1.5 * normal[:, None], 2, axis=1)
    arrays["stress"] = np.tile(-1.5 * np.eye(2), (2, 3, 1, 1))
    return arrays


COUNT = 300


def turned(angle: float) -> Floats:
    """Return a rotation matrix."""
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


LAYOUTS: dict[str, Callable[[int], Callable[[Floats], Floats]]] = {
    "in one place": lambda k: lambda x: x,
    "turned about one place": lambda k: lambda x: (x - 0.5) @ turned(0.01 * k),
    "each half as large": lambda k: lambda x: x * 2.0 ** -(k % 50),
    "each larger by a thousandth": lambda k: lambda x: x * 1.001**k,
    "along a line": lambda k: lambda x: np.add(x, [1e-3 * k, 0.0]),
    "along a diagonal": lambda k: lambda x: x + 1e-3 * k,
    "small ones in a large one": lambda k: lambda x: x if k == 0 else 1e-3 * x + 0.3 + 1e-6 * k,
    "needles across each other": lambda k: lambda x: x * ([1.0, 1e-3] if k % 2 else [1e-3, 1.0]),
    "needles along each other": lambda k: lambda x: x * [1.0, 1e-4] + [0.0, 1e-5 * k],
    "needles about a point": lambda k: lambda x: (x * [1.0, 1e-3]) @ turned(2e-3 * k),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_many_cells_in_one_place(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The checker refuses the cells, and examines only few of their 720 000 pairs."""
    looked_at = []

    def counted(ones: Floats, others: Floats) -> npt.NDArray[np.bool_]:
        looked_at.append(len(ones))
        return have_common_volume(ones, others)

    monkeypatch.setattr("perfplast_fenicsx.proof.checker.have_common_volume", counted)
    monkeypatch.setattr("perfplast_fenicsx.proof.box_pairs.AT_ONCE", 3000)
    arrays = plates((0.0,) * COUNT, (), ()) | {"contacts": np.zeros((0, 2), dtype=int)}
    squares = arrays["vertices"].reshape(COUNT, 4, 2)
    placed = [LAYOUTS[name](k)(square) for k, square in enumerate(squares)]
    arrays["vertices"] = np.concatenate(placed)
    assert overlapping(Body.of(arrays)) > 0
    assert sum(looked_at) <= 20_000


@pytest.mark.parametrize("axes", [(1, 1), (0, 1), (1, 0)])
@pytest.mark.parametrize("size", [1e-30, 1e-3, 1.0, 1e30])
def test_a_push_along_what_is_held(axes: tuple[int, int], size: float) -> None:
    """The body carries every factor of loads on held parts, so a bound has no meaning."""
    push = (size * axes[0], size * axes[1])
    arrays = plates((0.0, 1.0), (1,), (0,))
    only_on_plate(axes, push)(arrays)
    arrays["stress"] = np.zeros((len(arrays["cells"]), 3, 2, 2))
    arrays["bound"] = np.asarray(1e9)
    with pytest.raises(ProofError, match="only supports are loaded"):
        check_lower(arrays)
