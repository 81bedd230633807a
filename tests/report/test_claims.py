"""Test that a page calls only those numbers proven that files beside it prove."""

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from mpi4py import MPI

import h5py
import numpy as np
import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.claims import check_claims, direction_file
from perfplast_fenicsx.io.results.proof_file import read_proven, write_proven
from perfplast_fenicsx.io.results.result_files import PROOF
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis.body.interaction import Proven
from perfplast_fenicsx.proof.verdict import Checked
from perfplast_fenicsx.report.proof_section import fingerprint, proof_section, proofs_of
from tests.proof.forging import Halves, blocks, copied, write

pytestmark = pytest.mark.serial


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return the halves of a proof of two stacked blocks."""
    return blocks(tmp_path_factory.mktemp("honest"), 2)


def reader_of(folder: Path, lower: float | None, upper: float | None) -> Any:
    """Return a reader of a folder whose summary claims these bounds."""
    limit = {"body": {"lower": lower, "upper": upper}}
    return SimpleNamespace(path=folder, summary=SimpleNamespace(limit=limit))


def test_what_the_file_proves_is_on_the_page(honest: Halves, tmp_path: Path) -> None:
    path = write(tmp_path / "bounds.h5", honest)
    low, high = (float(honest[kind]["bound"]) for kind in ("lower", "upper"))
    page = proof_section(tmp_path, proofs_of(reader_of(tmp_path, low, high)))
    assert "lower bound" in page and "upper bound" in page and page.count("proven,") == 1
    assert fingerprint([path]) in page
    assert proof_section(tmp_path, {}) == ""
    # The verdict rounds the claims 2 and 1.5 outwards; the rounding of the checker must not appear.
    both = {"lower": (1.5, 1.5 * (1 - 1e-15)), "upper": (2.0, 2.0 * (1 + 1e-15))}
    halves = {k: Checked(k, claimed, proven, {}, ()) for k, (claimed, proven) in both.items()}
    page = proof_section(tmp_path, {PROOF: halves})
    assert "lower bound 1.5 proven, upper bound 2 proven" in page
    less = Checked("lower", 1.5, 1.25, {}, ("only 1.25 is proven",))
    assert "lower bound 1.25 proven" in proof_section(tmp_path, {PROOF: {"lower": less}})


FALSE: dict[str, tuple[Callable[[float, float], tuple[float, float]], str]] = {
    "both a hundredfold": (lambda a, b: (100 * a, 100 * b), "lower bound"),
    "a little more": (lambda a, b: (a * (1 + 1e-8), b), "lower bound"),
    "a little less": (lambda a, b: (a, b * (1 - 1e-8)), "upper bound"),
    "turned round": (lambda a, b: (b, a), "lower bound|upper bound"),
    "not a number": (lambda a, b: (math.nan, b), "lower bound"),
    "infinite": (lambda a, b: (math.inf, b), "lower bound"),
    "nothing is carried": (lambda a, b: (a, 0.0), "upper bound"),
}


@pytest.mark.parametrize("name", FALSE)
def test_a_summary_that_contradicts_its_file(honest: Halves, tmp_path: Path, name: str) -> None:
    change, words = FALSE[name]
    write(tmp_path / "bounds.h5", honest)
    low, high = (float(honest[kind]["bound"]) for kind in ("lower", "upper"))
    with pytest.raises(InputError, match=words):
        proofs_of(reader_of(tmp_path, *change(low, high)))


def test_modest_claims_are_fine(honest: Halves, tmp_path: Path) -> None:
    """A summary may claim less than the file proves."""
    write(tmp_path / "bounds.h5", honest)
    low, high = (float(honest[kind]["bound"]) for kind in ("lower", "upper"))
    proofs_of(reader_of(tmp_path, 0.9 * low, 1.1 * high))
    proofs_of(reader_of(tmp_path, None, high))


@pytest.mark.parametrize("which", ["no file", "half"])
def test_a_claim_whose_proof_is_missing(honest: Halves, tmp_path: Path, which: str) -> None:
    """The page does not accept the claim, and gives the reason."""
    if which == "half":
        write(tmp_path / "bounds.h5", {"upper": copied(honest)["upper"]})
    reader = reader_of(tmp_path, 1e9, None)
    proofs_of(reader)
    body = reader.summary.limit["body"]
    assert body["lower"] is None
    assert "claims 1e+09" in body["why_not"][0]


@pytest.mark.parametrize("which", ["stress", "text", "link"])
def test_a_claim_without_its_proof(honest: Halves, tmp_path: Path, which: str) -> None:
    low = float(honest["lower"]["bound"])
    path, halves = tmp_path / "bounds.h5", copied(honest)
    if which == "stress":
        halves["lower"]["stress"] = 2 * halves["lower"]["stress"]
        write(path, halves)
    elif which == "text":
        path.write_text("proven")
    elif which == "link":
        path.symlink_to(write(tmp_path / "other.h5", halves))
    with pytest.raises(InputError, match=r"does not prove|not a proof|is a symbolic link"):
        proofs_of(reader_of(tmp_path, low, None))


def test_a_larger_claim_in_the_file_itself(honest: Halves, tmp_path: Path) -> None:
    """File and summary agree, but the stress proves less."""
    path, low = write(tmp_path / "bounds.h5", honest), float(honest["lower"]["bound"])
    with h5py.File(path, "a") as file:
        file["lower"].attrs["bound"] = 2 * low
    with pytest.raises(InputError, match="does not prove this bound"):
        proofs_of(reader_of(tmp_path, 2 * low, None))


@pytest.mark.parametrize(("carried", "side"), [(10.0, 1.0), (1.0, 0.1), (1.0 + 1e-7, 1.0)])
def test_directions_that_an_edited_file_claims(
    honest: Halves, tmp_path: Path, carried: float, side: float
) -> None:
    """A restart proves each direction again."""
    low, high = (float(honest[kind]["bound"]) for kind in ("lower", "upper"))
    folder = ResultFolder(MPI.COMM_SELF, tmp_path)
    angles, ray = (60.0,), np.array([0.5, math.sqrt(0.75)])
    write(tmp_path / direction_file(angles), honest)
    normal = np.array([0.8, 0.6])
    plane = (*map(float, normal), float(high * normal @ ray))
    write_proven(folder, Proven(angles, tuple(map(float, low * ray)), plane))
    assert len(read_proven(folder, again=True)) == 1
    more = (*plane[:2], side * plane[2])
    write_proven(folder, Proven(angles, tuple(map(float, carried * low * ray)), more))
    with pytest.raises(InputError, match=r"direction_060\.00\.h5 proves"):
        read_proven(folder, again=True)
    (tmp_path / direction_file(angles)).unlink()
    with pytest.raises(InputError, match="contains no proof of this bound"):
        read_proven(folder, again=True)


def proof(kind: str, bound: float) -> Checked:
    """Return a proven half."""
    return Checked(kind, bound, bound, {}, ())


def claims_of_envelope(carried: np.ndarray, angles: list[float]) -> dict[str, Any]:
    """Return a table of points."""
    directions = [[angle] for angle in angles]
    return {"envelope": {"directions": directions, "carried": carried.tolist()}}


@pytest.mark.parametrize(("factor", "fine"), [(1.0, True), (0.9, True), (10.0, False)])
def test_points_of_an_envelope(factor: float, fine: bool) -> None:
    angles = [0.0, 30.0, 90.0, 210.0]
    proofs = {
        direction_file((angle,)): {"lower": proof("lower", 1.0 + number)}
        for number, angle in enumerate(angles)
    }
    turn = np.radians(angles)
    rays = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = np.concatenate([[[0.0, 0.0]], (1.0 + np.arange(4))[:, None] * rays])
    points[2] *= factor
    limit = claims_of_envelope(points, angles)
    if fine:
        check_claims(limit, proofs)
        return
    with pytest.raises(InputError, match=r"direction_030\.00\.h5 proves only 2"):
        check_claims(limit, proofs)


def test_a_point_of_no_direction() -> None:
    limit = claims_of_envelope(np.array([[1.0, 1.0]]), [0.0, 90.0])
    with pytest.raises(InputError, match="not lie in any"):
        check_claims(limit, {})


@pytest.mark.parametrize(("stands", "falls", "fine"), [(1.0, 1.0, True), (0.9, 1.0, False)])
def test_a_factor_of_safety(stands: float, falls: float, fine: bool) -> None:
    """Smaller strengths carry the loads once; strengths for the larger factor do not."""
    proofs = {
        "stands.h5": {"lower": proof("lower", stands)},
        "falls.h5": {"upper": proof("upper", falls)},
    }
    limit = {"strength": {"lower": 1.5, "upper": 1.6}, "body": {"lower": 9.0, "upper": 9.0}}
    if fine:
        check_claims(limit, proofs)
        return
    with pytest.raises(InputError, match=r"stands\.h5 proves only 0\.9"):
        check_claims(limit, proofs)


def test_the_smallest_load_factor() -> None:
    """The factor is minus the bound for reversed loads."""
    least = {"carried": -2.0, "none_below": -2.5}
    limit = {"body": {"lower": None, "upper": None, "least": least}}
    halves = {"lower": proof("lower", 2.0), "upper": proof("upper", 2.5)}
    check_claims(limit, {"least.h5": halves})
    with pytest.raises(InputError, match=r"least\.h5 proves only 1\.9"):
        check_claims(limit, {"least.h5": halves | {"lower": proof("lower", 1.9)}})
