"""Test proofs of bodies whose surfaces are held along one direction, and forgeries."""

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import Pressure, Problem, Support, VonMises
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.proof.body import Body
from tests.proof.forging import (
    Arrays,
    Forgery,
    Halves,
    alone,
    both,
    drop,
    high,
    low,
    make,
    said_of_forged,
    times,
    written,
)
from tests.symmetric_bodies import cube, square_tube

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="the checker is serial")

TURNED = 0.3


@pytest.fixture(scope="module", params=[2, 3])
def honest(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return the halves of a proof of an eighth of a tube, or half an octant of a cube."""
    tube = request.param == 2
    mesh = (square_tube if tube else cube)(MPI.COMM_SELF, 2 if tube else 1, False, TURNED)
    supports = [Support("diagonal", "normal"), Support("y0", "normal")]
    problem = Problem(
        mesh,
        {"body": VonMises(young=1e3, poisson=0.3, yield_stress=1.0)},
        [*supports, *([] if tube else [Support("bottom", "z"), Support("top", "xy")])],
        [Pressure("inner" if tube else "top", 1.0)],
        degree=2,
    )
    return written(tmp_path_factory.mktemp("honest"), limit_bounds(problem))


def guided_nodes(them: Arrays) -> np.ndarray:
    """Return the nodes on guides; vertices have the first numbers of their cells' nodes."""
    on = np.unique(them["facets"][them["guided"].any(axis=1)])
    d = them["vertices"].shape[1]
    return np.unique(them["nodes"][:, : d + 1][np.isin(them["cells"], on)])


def pass_through(share: float) -> Forgery:
    """Move nodes of guides along the normal of the diagonal."""

    def forge(them: Arrays) -> None:
        v = them["velocity"]
        direction = them["guided"][np.flatnonzero(them["guided"].any(axis=1))[0]]
        v[guided_nodes(them)] += share * np.abs(v).max() * direction

    return alone("upper", forge)


def shear_there(share: float) -> Forgery:
    """Add a uniform shear, with loads that balance it on all facets except guides."""

    def forge(them: Arrays) -> None:
        body = Body.of(them)
        shear = np.zeros((body.dim, body.dim))
        shear[0, 1] = shear[1, 0] = share * np.abs(them["stress"]).max()
        pulls = body.normals @ shear
        pulls[np.flatnonzero(them["guided"].any(axis=1))] = 0.0
        them["stress"] = them["stress"] + shear
        them["constant_traction"] = np.tile(pulls[:, None], (1, body.dim, 1))

    return alone("lower", forge)


def test_what_passes_a_guide_is_refused(honest: Halves, tmp_path: Path) -> None:
    """The checker corrects a velocity through the guide, which increases the bound."""
    for share in (1e-2, 1e-6):
        assert "only" in said_of_forged(honest, pass_through(share), tmp_path)


def test_a_shear_traction_on_a_guide_is_refused(honest: Halves, tmp_path: Path) -> None:
    for share in (1e-2, 1e-4):
        assert "outer tractions" in said_of_forged(honest, shear_there(share), tmp_path)


FORGERIES: dict[str, tuple[Forgery, str]] = {
    "no guide for the stress": (low(drop("guided")), "different supports"),
    "none for the velocity": (high(drop("guided")), "different supports"),
    "no guides at all": (both(drop("guided")), "outer tractions"),
    "directions that are longer": (both(times("guided", 1.1)), "not a unit vector"),
    "no number": (both(times("guided", np.nan)), "not finite"),
    "one direction for every facet": (
        both(make("guided", lambda g: np.tile(g[g.any(axis=1)][0], (len(g), 1)))),
        "only supports are loaded|outer tractions|entering",
    ),
    "flags": (both(make("guided", lambda g: g[:, 0])), "shape of guided"),
    "along the surface": (
        both(
            make("guided", lambda g: np.roll(g, 1, axis=1) * np.sign(np.arange(g.shape[1]) - 0.5))
        ),
        "outer tractions|entering",
    ),
}


@pytest.mark.parametrize("name", FORGERIES)
def test_forged_directions_are_refused(name: str, honest: Halves, tmp_path: Path) -> None:
    forge, words = FORGERIES[name]
    said = said_of_forged(honest, forge, tmp_path)
    assert any(word in said for word in words.split("|")), said
