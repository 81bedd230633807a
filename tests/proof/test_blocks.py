"""Test that proofs of rigid blocks have no faults, and that forged proofs are refused."""

from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import Contact, Problem, Rigid, Support, limit_bounds
from perfplast_fenicsx.proof import check
from tests.limit_analysis.test_rigid_blocks import pushed
from tests.proof.forging import Halves, in_turn, said_of, said_of_forged, write, written
from tests.stones import box, stones, weight_and

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="the checker is serial")


def in_space() -> Problem:
    """Return a stone on a held stone, pushed along the joint, with friction and adhesion."""
    mesh = stones(
        MPI.COMM_WORLD, [box([0, 0, -1], [1, 1, 0]), box([0, 0, 0], [1, 1, 1])], (1, 1, 1)
    )
    return Problem(
        mesh,
        {"0": Rigid(), "1": Rigid()},
        [Support("0_z0")],
        weight_and(mesh, [1.0, 0.0, 0.0], ["0"]),
        [Contact("0_z1", "1_z0", coulomb=0.1, tresca=0.2, associated=True)],
        degree=2,
    )


@pytest.fixture(scope="module", params=[2, 3])
def honest(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return the halves of a proof for blocks with friction and adhesion."""
    problem = pushed(0.2, 2.0, 1.0, 0.1) if request.param == 2 else in_space()
    return written(tmp_path_factory.mktemp("blocks"), limit_bounds(problem))


def lower(change: Callable[[dict], object]) -> Callable[[Halves], None]:
    """Return a function that changes the lower half, and omits the upper half."""

    def forge(halves: Halves) -> None:
        del halves["upper"]
        change(halves["lower"])

    return forge


def upper(change: Callable[[dict], object]) -> Callable[[Halves], None]:
    """Return a function that changes the upper half, and omits the lower half."""

    def forge(halves: Halves) -> None:
        del halves["lower"]
        change(halves["upper"])

    return forge


def times(name: str, factor: float) -> Callable[[dict], None]:
    """Return a function that multiplies an array."""

    def change(half: dict) -> None:
        with np.errstate(invalid="ignore"):  # 0 times a nan
            half[name] = half[name] * factor

    return change


def elsewhere(half: dict) -> None:
    """Add two opposite forces on a facet without contact, which balance each other."""
    free = np.setdiff1d(np.arange(len(half["facets"])), np.flatnonzero(touched(half)))
    free = free[~half["held"][free].any(axis=1)]
    half["joint_force"][free[0], 0, 0] += 1.0
    half["joint_force"][free[0], 1, 0] -= 1.0


def touched(half: dict) -> np.ndarray:
    """Return the facets in contact."""
    return np.isin(half["surface"], half["contacts"])


def pulled(half: dict) -> None:
    """Add a pull at one vertex of the contact and a push at another, equal on both sides."""
    force, at = half["joint_force"], np.flatnonzero(touched(half))
    up = np.zeros(force.shape[2])
    up[-1] = 100.0
    for sign, below in ((1.0, True), (-1.0, False)):
        mine = at[(force[at, :, -1].sum(axis=1) < 0) == below]
        places = half["vertices"][half["facets"][mine]]
        x = places[..., 0]
        force[mine] += sign * up * np.where(np.isclose(x, x.min()), 1.0, 0.0)[..., None]


def unequal(half: dict) -> None:
    """Remove the forces on one side of the contact; supports balance the other side."""
    half["joint_force"][np.isin(half["surface"], half["contacts"][0, :1])] *= 0.5


def rubs_more(half: dict) -> None:
    """Rotate contact forces towards the joint plane."""
    half["joint_force"][touched(half)] = np.roll(half["joint_force"][touched(half)], 1, axis=2)


def bent(half: dict) -> None:
    """Strain a block."""
    half["velocity"][::2] *= 1.001


def turned(half: dict) -> None:
    """Reverse the motion, so blocks penetrate or loads do no work."""
    half["velocity"] *= -1


def without_inner(half: dict) -> None:
    """Remove the forces inside the limits."""
    for name in [name for name in half if name.startswith("inner")]:
        del half[name]


FORGERIES = {
    "more load": (lower(times("bound", 1.001)), "only"),
    "more weight": (
        lower(times("constant_body_force", 1.01)),
        "only|balance the residual forces on a body",
    ),
    "no adhesion": (
        lower(times("contact_adhesion", 0.0)),
        "only|balance the residual forces on a body",
    ),
    "less adhesion": (
        lower(times("contact_adhesion", 0.9)),
        "only|balance the residual forces on a body",
    ),
    "less friction": (
        lower(times("contact_friction", 0.9)),
        "only|balance the residual forces on a body",
    ),
    "rubs more": (lower(rubs_more), "only|balance the residual forces on a body"),
    "no number": (lower(times("joint_force", np.nan)), "not finite"),
    "endless": (lower(times("joint_force", np.inf)), "not finite"),
    "not held": (lower(times("held", 0)), "only|balance the residual forces on a body"),
    "nothing inside": (lower(without_inner), "only|balance the residual forces on a body"),
    "inner ones of more load": (
        lower(in_turn(times("inner_factor", 1e6), times("bound", 1.001))),
        "only|balance the residual forces on a body",
    ),
    "inner ones without a factor": (lower(lambda half: half.pop("inner_factor")), "inner_factor"),
    "inner ones that pull": (
        lower(in_turn(times("inner_force", -1.0), times("bound", 1.001))),
        "only|balance the residual forces on a body",
    ),
    "all held": (
        lower(lambda half: half.update(held=np.ones_like(half["held"]))),
        "only supports are loaded|supports hold facets in contact",
    ),
    "no forces": (lower(lambda half: half.pop("joint_force")), "joint_force is missing"),
    "a stress in their place": (
        lower(
            lambda half: (
                half.update(
                    stress=np.zeros((*half["cells"].shape, *half["vertices"].shape[1:] * 2))
                )
                or half.pop("joint_force")
            )
        ),
        "joint_force is missing",
    ),
    "too few": (
        lower(lambda half: half.update(joint_force=half["joint_force"][:-1])),
        "fit the facets",
    ),
    "no contact": (
        lower(
            lambda half: half.update(
                contacts=half["contacts"][:0],
                contact_adhesion=np.zeros(0),
                contact_friction=np.zeros(0),
            )
        ),
        "no cell can yield",
    ),
    "less above": (upper(times("bound", 0.999)), "only"),
    "bent": (upper(bent), "only"),
    "turned": (upper(turned), "do no work"),
    "more friction": (upper(times("contact_friction", 1.1)), "only"),
    "more adhesion": (upper(times("contact_adhesion", 1.1)), "only"),
    "weaker above": (
        lambda halves: halves["upper"].update(
            contact_adhesion=halves["upper"]["contact_adhesion"] * 0.5
        ),
        "has less friction",
    ),
}


@pytest.mark.parametrize("name", FORGERIES)
def test_forgeries_are_refused(honest: Halves, name: str, tmp_path: Path) -> None:
    forge, why = FORGERIES[name]
    said = said_of_forged(honest, forge, tmp_path)
    assert any(words in said for words in why.split("|")), said


def test_forces_that_are_a_share_of_others_hide_nothing(honest: Halves, tmp_path: Path) -> None:
    """Large balanced forces do not permit unbalanced loads."""
    halves = {"lower": {name: np.copy(values) for name, values in honest["lower"].items()}}
    half = halves["lower"]
    held = np.flatnonzero(half["held"].any(axis=1))
    half["joint_force"][held[0], 0, 0] += 1e12
    half["joint_force"][held[0], 1, 0] -= 1e12
    half["bound"] = half["bound"] * 1.01
    assert "only" in said_of(write(tmp_path / "forged.h5", halves))


@pytest.mark.parametrize("change", [elsewhere, pulled, unequal])
def test_forces_that_count_for_nothing_prove_no_more(
    honest: Halves, change: Callable[[dict], object], tmp_path: Path
) -> None:
    """Forces count on the first side of a joint, and where supports hold."""
    halves = {"lower": {name: np.copy(values) for name, values in honest["lower"].items()}}
    change(halves["lower"])
    proven = check(write(tmp_path / "changed.h5", halves))["lower"].reached or 0.0
    assert proven <= float(honest["upper"]["bound"]) * (1 + 1e-9)


def test_what_forces_leave_lowers_the_bound(honest: Halves, tmp_path: Path) -> None:
    """The load is larger by a fraction, and the inner forces compensate this."""
    claimed = float(honest["lower"]["bound"])
    for share in (1e-9, 1e-6, 1e-3):
        half = {name: np.copy(values) for name, values in honest["lower"].items()}
        half["bound"] = half["factor"] = np.asarray(claimed * (1 + share))
        proven = check(write(tmp_path / "changed.h5", {"lower": half}))["lower"].reached
        assert proven is not None
        assert proven <= float(honest["upper"]["bound"])
        assert proven >= claimed * (1 - 100 * share)
