"""No random edit of an honest file makes a bound that is false.

An edit of a stress, a velocity or a claim leaves the bodies as they are, and so does an edit of the
bodies of one half that the checker takes as the same. Then no lower bound may be above the honest
upper one, and no upper bound below the honest lower one. Edits of the bodies of both halves have
other limits: there the two bounds must not cross.

``PERFPLAST_FUZZ=10`` tries 2 000 on all kinds of files.
"""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from perfplast_fenicsx import limit_bounds
from perfplast_fenicsx.proof import ProofError, check
from tests.limit_analysis.test_dead_loads import K, footing
from tests.limit_analysis.test_rigid_blocks import pushed
from tests.limit_analysis.test_rigid_rings import pressed_disc
from tests.proof.forging import Arrays, Halves, blocks, copied, write, written
from tests.proof.test_rubbing import stacked

pytestmark = pytest.mark.serial

EFFORT = float(os.environ.get("PERFPLAST_FUZZ", "0.15"))
SHORT = EFFORT < 1

KINDS: dict[str, Callable[[Path], Halves]] = {
    "blocks": lambda path: blocks(path, 2),
    "adhesion": lambda path: written(path, limit_bounds(stacked(2, tresca=10.0), 1e-3)),
    "constant loads": lambda path: written(path, limit_bounds(footing((0.0, -1.0), (0.5 * K, 0)))),
    "blocks in space": lambda path: blocks(path, 3),
    "friction": lambda path: written(path, limit_bounds(stacked(2, coulomb=0.2), 1e-3)),
    "rings with a plate": lambda path: written(path, limit_bounds(pressed_disc(2))),
    "rigid blocks": lambda path: written(path, limit_bounds(pushed(0.2, 2.0, 1.0, 0.1))),
}
OF_PROOFS = {
    "lower": ("stress", "joint_force", "inner_force", "inner_factor", "bound", "factor"),
    "upper": ("velocity", "bound"),
}
OF_BODIES = (
    *("vertices", "cells", "cone", "cone_bound", "cone_matrix", "body_force", "traction", "held"),
    *("surface", "facets", "contacts", "contact_adhesion", "contact_friction", "obstacle_normals"),
    *("constant_traction", "obstacle_adhesion"),
)
EDITS = int(200 * EFFORT)


def scaled(values: npt.NDArray, random: np.random.Generator) -> npt.NDArray:
    """Return all values times a factor near 1 or far from it."""
    size = 10.0 ** random.uniform(-12, 1)
    return values * (1 + size * random.choice([-1.0, 1.0]))


def noisy(values: npt.NDArray, random: np.random.Generator) -> npt.NDArray:
    """Return values with noise on some rows; the noise of stresses is symmetric."""
    size = 10.0 ** random.uniform(-15, 1) * np.abs(values).max(initial=1e-3)
    noise = size * random.normal(size=values.shape)
    if values.ndim >= 2 and values.shape[-1] == values.shape[-2]:
        noise = noise + np.swapaxes(noise, -1, -2)
    rows = random.random(len(values)) < random.choice([0.02, 0.3, 1.0])
    rows[random.integers(len(values))] = True
    return values + noise * rows.reshape(-1, *[1] * (values.ndim - 1))


def shuffled(values: npt.NDArray, random: np.random.Generator) -> npt.NDArray:
    """Two rows change places."""
    order = np.arange(len(values))
    pair = random.integers(len(values), size=2)
    order[pair] = order[pair[::-1]]
    return values[order]


def cleared(values: npt.NDArray, random: np.random.Generator) -> npt.NDArray:
    """A row of zeros."""
    found = values.copy()
    found[random.integers(len(values))] = 0
    return found


def flipped(values: npt.NDArray, random: np.random.Generator) -> npt.NDArray:
    """Another whole number, or flag, in one place."""
    found = values.copy()
    most = 1 if values.dtype == np.uint8 else max(int(values.max()), 1)
    found.flat[random.integers(found.size)] = random.integers(most + 1)
    return found


def edit(them: Arrays, name: str, random: np.random.Generator) -> None:
    """Change one array in place of itself."""
    values = np.asarray(them[name])
    if values.ndim == 0:
        them[name] = np.asarray(scaled(values, random))
        return
    if not values.size:
        return
    if values.dtype.kind == "f":
        change = random.choice(np.array([scaled, noisy, shuffled, cleared], dtype=object))
    else:
        change = random.choice(np.array([shuffled, flipped], dtype=object))
    them[name] = change(values, random)


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, Halves, float, float]]:
    """Honest files of several kinds, with their bounds."""
    found = []
    for name, make in list(KINDS.items())[: 2 if SHORT else None]:
        folder = tmp_path_factory.mktemp("honest")
        halves = make(folder)
        proven = check(folder / "bounds.h5")
        low, high = proven["lower"].proven, proven["upper"].proven
        assert low is not None
        assert high is not None
        found.append((name, halves, low, high))
    return found


def test_no_edit_proves_what_is_false(
    honest: list[tuple[str, Halves, float, float]], tmp_path: Path
) -> None:
    random = np.random.default_rng(20261128)
    passed = refused = 0
    for number in range(EDITS):
        name, halves, low, high = honest[number % len(honest)]
        halves = copied(halves)
        where = random.choice(["proof", "proof", "one half", "both halves"])
        kind = str(random.choice(["lower", "upper"]))
        them = halves[kind]
        if where == "proof":
            them.setdefault("factor", them["bound"])
            arrays = [array for array in OF_PROOFS[kind] if array in them]
            for array in random.choice(arrays, size=random.integers(1, 3)):
                edit(them, str(array), random)
            if random.random() < 0.3:
                del them["factor"]
        else:
            names = [array for array in OF_BODIES if array in them and them[array].size]
            array = str(random.choice(names))
            edit(them, array, random)
            if where == "both halves":
                for other in halves.values():
                    if array in other and other[array].shape == them[array].shape:
                        other[array] = them[array]
        try:
            found = check(write(tmp_path / "edited.h5", halves))
        except ProofError:
            refused += 1
            continue
        words = (number, name, where, kind, [str(half) for half in found.values()])
        lower, upper = found["lower"].proven, found["upper"].proven
        passed += lower is not None and upper is not None
        refused += lower is None or upper is None
        rounding = 1e-9 * max(abs(low), abs(high))
        if where == "both halves":
            assert lower is None or upper is None or lower <= upper + rounding, words
            continue
        assert lower is None or lower <= high + rounding, words
        assert upper is None or upper >= low - rounding, words
    print("EDITS", EDITS, "passed", passed, "refused", refused)
    assert passed > EDITS // 50  # some edits are harmless
    assert refused > EDITS // 4
