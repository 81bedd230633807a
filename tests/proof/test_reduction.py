"""What the checker says of a factor that divides strengths."""

from collections.abc import Callable

import numpy as np
import pytest

from perfplast_fenicsx.proof.body import Body
from perfplast_fenicsx.proof.plain_arrays import ProofError
from perfplast_fenicsx.proof.reduction import reduction_words
from tests.proof.forging import Arrays, blocks


@pytest.fixture(scope="module")
def half(tmp_path_factory: pytest.TempPathFactory) -> Arrays:
    """A half of two blocks of yield stress 1 and 3, without a factor."""
    return blocks(tmp_path_factory.mktemp("reduction"), 2)["lower"]


def test_strengths_before_they_are_divided(half: Arrays) -> None:
    body = Body.of(half)
    assert reduction_words(body, half) == []
    (told,) = reduction_words(body, {**half, "strength_factor": np.array(2.0)})
    radii = np.sqrt(2 / 3) * np.array([1.0, 3.0])
    for radius in radii:
        assert f"a yield radius of {2 * radius:.6g}" in told
    assert "Not divided" not in told
    kept = body.cone == body.cone[0]
    (told,) = reduction_words(body, {**half, "strength_factor": np.array(2.0), "cell_kept": kept})
    mine = body.yield_radius[0]
    assert f"a yield radius of {2 * mine:.6g}" not in told
    assert f"Not divided: strengths in a volume of {body.volumes[kept].sum():.6g}." in told
    rubs = {**half, "contact_adhesion": np.array([0.5]), "contact_friction": np.array([0.2])}
    (told,) = reduction_words(Body.of(rubs), {**rubs, "strength_factor": np.array(1.5)})
    assert "an adhesion of 0.75 and a friction of 0.3" in told
    kept = np.array([True])
    (told,) = reduction_words(
        Body.of(rubs), {**rubs, "strength_factor": np.array(1.5), "contact_kept": kept}
    )
    assert "friction on surface" in told


def without_factor(them: Arrays) -> None:
    del them["strength_factor"]


def too_few(them: Arrays) -> None:
    them["cell_kept"] = them["cell_kept"][1:]


def in_some_cells(them: Arrays) -> None:
    them["cell_kept"][0] = 1


def negative(them: Arrays) -> None:
    them["strength_factor"] = np.array(-1.0)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (without_factor, "strength_factor, which is missing"),
        (too_few, "the shape of cell_kept"),
        (in_some_cells, "in some cells and not in others"),
        (negative, "strength_factor is not positive"),
    ],
)
def test_what_fits_no_bodies_is_refused(
    half: Arrays, change: Callable[[Arrays], None], named: str
) -> None:
    them = {**half, "strength_factor": np.array(2.0)}
    them["cell_kept"] = np.zeros(len(half["cells"]), dtype=np.uint8)
    change(them)
    with pytest.raises(ProofError, match=named):
        reduction_words(Body.of(half), them)
