"""Test that the second checker, in JavaScript, agrees with the first one in a browser."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from meshes.sectors import write_punch_sector
from perfplast_fenicsx import (
    Contact,
    Elastic,
    MohrCoulomb,
    Pressure,
    Problem,
    Support,
    VonMises,
    limit_bounds,
    read_gmsh,
)
from perfplast_fenicsx.materials.drucker_prager import Match
from perfplast_fenicsx.proof import ProofError, check
from perfplast_fenicsx.proof.__main__ import main
from perfplast_fenicsx.proof.checker import check_pair, numbers_digest
from perfplast_fenicsx.report import proof_again
from perfplast_fenicsx.report.frame import asset
from perfplast_fenicsx.report.proof_again import checker_source, packed_proof, prove_again
from tests.functional.browser_page import Page, alone
from tests.functional.test_random_statements import HINGED
from tests.limit_analysis.test_rigid_blocks import pushed
from tests.limit_analysis.test_static_bound import rectangle
from tests.proof.forging import Arrays, Halves, blocks, copied, halves_of, write, written
from tests.proof.small_bodies import (
    ROUNDED,
    UNDONE,
    UNLIKE,
    adhering_square,
    beside_a_fast_body,
    beside_a_large_stress,
    columns_under_a_plate,
    cut_square,
    guided_plate,
    hanging_square,
    obstacle_without_normal,
    plate_with_free_load,
    pushed_square,
    stacked_walls,
    thin_triangles,
    unlike_halves,
)
from tests.proof.test_balance import strip
from tests.proof.test_blocks import in_space
from tests.proof.test_cone_shapes import LARGE
from tests.proof.test_forged_halves import finer
from tests.proof.test_random_edits import KINDS, OF_BODIES, OF_PROOFS, edit
from tests.proof.test_reduction import MATCHES, flatter, written_cubes
from tests.random_statements import random_case

pytestmark = [pytest.mark.serial, alone]

AGREE = 1e-8
"""Largest relative difference of bounds, by which a claim may exceed a proof. The checkers round to
the safe side in different ways."""

CONES = {"cone": np.zeros(2, dtype=int)}
"""Two cells that can yield."""

RUBBING = 1e-7
"""The same for upper bounds with friction, where each checker modifies a velocity differently."""


class Checker:
    """The checker on a page without other content."""

    def __init__(self, browser: Any, folder: Path) -> None:
        self._browser = browser
        page = folder / "checker.html"
        page.write_text(f"<script>{checker_source()}\nwindow.verdictOn = verdictOn;</script>")
        browser.get(page.as_uri())

    def __call__(self, path: Path) -> dict[str, Any]:
        """Return the findings of the checker on a file."""
        found: dict[str, Any] = self._browser.execute_async_script(
            """const done = arguments[1];
            verdictOn(arguments[0]).then(done, (error) => done({ error: String(error) }));""",
            packed_proof(path),
        )
        assert "error" not in found, found
        return found


@pytest.fixture
def checker(browser: Any, tmp_path: Path) -> Checker:
    """Return the checker in a browser."""
    return Checker(browser, tmp_path)


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return two stacked blocks on a plane, with weight."""
    return blocks(tmp_path_factory.mktemp("honest"), 2)


def bounds_of(found: dict[str, Any]) -> list[float]:
    """Return the bounds that the checker proves."""
    return [found[kind]["proven"] for kind in ("lower", "upper")]


def first_bounds(path: Path) -> list[float | None]:
    """Return the bounds that the first checker proves."""
    return [half.proven for half in check(path).values()]


def first_refuses(path: Path, kind: str) -> bool:
    """Return whether the first checker proves nothing in a half, or cannot read the proof."""
    try:
        return bool(check(path)[kind].faults)
    except ProofError:
        return True


def proven_on(path: Path, browser: Any) -> str:
    """Click the button of a page, and return its answer."""
    browser.get(path.as_uri())
    browser.find_element("id", "prove").click()
    page = Page.__new__(Page)
    page._browser = browser
    page.wait("document.getElementById('proven').dataset.ready === 'true'")
    return str(browser.find_element("id", "proven").text)


def half_the_strength(half: Arrays) -> None:
    half["cone_bound"] = np.asarray(half["cone_bound"]) / 2


def more_of_stress(half: Arrays) -> None:
    half["stress"] = np.asarray(half["stress"]) * 1.001


def less_of_one_load(half: Arrays) -> None:
    half["traction"] = np.asarray(half["traction"]) * 0.99


def skew(half: Arrays) -> None:
    half["stress"] = np.asarray(half["stress"]).copy()
    half["stress"][0, 0, 0, 1] += 1e-12


def claim(half: Arrays) -> None:
    half["bound"] = np.asarray(half["bound"] * (1.0001 if "stress" in half else 0.9999))


def into_the_other(half: Arrays) -> None:
    """Reverse the velocity at half of the places."""
    half["velocity"] = np.asarray(half["velocity"]).copy()
    half["velocity"][::2] *= -1


def growth(half: Arrays) -> None:
    half["velocity"] = np.asarray(half["velocity"]) * 1.0
    half["velocity"][0] += 0.01


def folded(half: Arrays) -> None:
    half["vertices"] = np.asarray(half["vertices"]) * 1.0
    half["vertices"][0] += 10.0


def more_bent(half: Arrays) -> None:
    half["cone_curvature"] = np.asarray(half["cone_curvature"]) * 0.99


def straight(half: Arrays) -> None:
    half["cone_curvature"] = np.asarray(half["cone_curvature"]) * 0


def divided(half: Arrays) -> None:
    half["strength_factor"] = np.asarray(2.0)


LOWER = (half_the_strength, more_of_stress, less_of_one_load, skew, claim, folded)
UPPER = (into_the_other, growth, claim, folded)
BENT = (more_bent, straight, divided)


def test_the_page_proves_the_bounds_again(honest: Halves, tmp_path: Path, browser: Any) -> None:
    """The button runs it in another thread, with the security policy of the report."""
    path = write(tmp_path / "bounds.h5", honest)
    head = asset("page.html").split("<title>")[0]
    again = prove_again([path], 10**6)
    (tmp_path / "page.html").write_text(f"{head}</head><body>{again}</body></html>")
    words = proven_on(tmp_path / "page.html", browser)
    low, high = first_bounds(path)
    assert low is not None and high is not None
    assert "bounds.h5: Proven again in this browser: between " in words
    shown = words.split("between ")[1].split(". ")[0].split(" (")[0].rstrip(".").split(" and ")
    assert 0 <= low - float(shown[0]) <= 1e-5 * low
    assert 0 <= float(shown[1]) - high <= 1e-5 * high
    assert f"SHA-256 of the numbers: {numbers_digest(path)}." in words
    large = prove_again([path], 100)
    assert "bounds.h5 is too large for this page" in large and "<script" not in large


def test_both_files_of_a_factor_of_safety(honest: Halves, tmp_path: Path, browser: Any) -> None:
    """The page compares the files. The bounds divide the strengths, so the loads are limits."""
    paths = []
    for name, kind, less in (("stands", "lower", 1 - 1e-6), ("falls", "upper", 1 + 1e-6)):
        half = copied(honest)[kind]
        factor = float(half["bound"]) * less
        half |= {"cone_bound": half["cone_bound"] / factor, "bound": np.asarray(1.0)}
        half["strength_factor"] = np.asarray(factor)
        if "stress" in half:
            half["stress"] = half["stress"] / factor * less
        paths.append(write(tmp_path / f"{name}.h5", {kind: half}))
    assert not check_pair(paths[0], paths[1]).faults
    half["vertices"] = half["vertices"] * 1.001
    for above in (paths[1], write(tmp_path / "larger.h5", {"upper": half})):
        pair = check_pair(paths[0], above)
        page = tmp_path / "page.html"
        page.write_text(f"<body>{prove_again([paths[0], above], 10**6)}</body>")
        words = proven_on(page, browser)
        if pair.faults:
            assert "The factor of safety is not proven: the halves have bodies of" in words
        else:
            assert "stands.h5: The lower bound 1 is proven again" in words
            low, high = words.split("Factor of safety: between ")[1].split(";")[0].split(" and ")
            assert 0 <= pair.carried - float(low) <= 1e-5 * pair.carried
            assert 0 <= float(high) - pair.not_carried <= 1e-5 * pair.not_carried


@pytest.mark.parametrize("match", MATCHES)
def test_both_files_of_ground_in_space(match: Match, tmp_path: Path, browser: Any) -> None:
    """The page compares friction angles, with the match that makes them equal."""
    for change in (lambda half: None, flatter):
        paths = written_cubes(tmp_path, match, change)
        (tmp_path / "page.html").write_text(f"<body>{prove_again(paths, 10**6)}</body>")
        words = proven_on(tmp_path / "page.html", browser)
        assert ("has weaker bodies" in words) == bool(check_pair(*paths).faults), words
        assert ("Factor of safety: between 1 and 10;" in words) == (change is not flatter), words


@pytest.mark.parametrize("which", range(len(LARGE)))
def test_both_checkers_compare_large_strengths(
    which: int, tmp_path: Path, checker: Checker
) -> None:
    lower, upper = LARGE[which]
    nodes = np.array([[0, 1, 3, 4, 5, 6], [0, 3, 2, 5, 7, 8]])  # vertices, and edges 01, 02, 12
    for above in (lower, upper):
        halves = {"lower": {**lower}, "upper": {**above}}
        del halves["upper"]["stress"]
        halves["upper"] |= {"nodes": nodes, "velocity": np.zeros((9, 2))}
        for half in halves.values():
            half["body_force"] = np.ones((2, 2))
        path = write(tmp_path / "bounds.h5", halves)
        for found in (checker(path), check(path)):
            words = str(found)
            assert ("weaker" in words) == (above is upper), words


def test_both_checkers_let_elastic_cells_contain_each_cone(
    tmp_path: Path, checker: Checker
) -> None:
    lower = LARGE[-1][0] | {"body_force": np.ones((2, 2))}
    upper = lower | {"cone": np.array([0, -1]), "velocity": np.zeros((9, 2))}
    del upper["stress"]
    upper["nodes"] = np.array([[0, 1, 3, 4, 5, 6], [0, 3, 2, 5, 7, 8]])
    for halves in ((lower, upper), (lower | {"cone": np.array([0, -1])}, {**upper, **CONES})):
        path = write(tmp_path / "bounds.h5", dict(zip(("lower", "upper"), halves, strict=True)))
        for found in (checker(path), check(path)):
            assert ("weaker" in str(found)) == (halves[1] is not upper), found


@pytest.mark.parametrize(
    "of", [adhering_square, cut_square, guided_plate, obstacle_without_normal, *ROUNDED]
)
def test_the_second_checker_refuses(
    of: Callable[[], Arrays], tmp_path: Path, checker: Checker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An attack proved false bounds for these squares, or bounds that the first checker refuses."""
    monkeypatch.setattr(proof_again, "plain", lambda _, values: values)  # another writer's page
    path = write(tmp_path / "lower.h5", {"lower": of()})
    assert first_refuses(path, "lower")
    assert "fault" in checker(path)["lower"]


@pytest.mark.parametrize("last", ["nothing", "obstacle", "square"])
def test_the_second_checker_passes_volume_only_to_one_neighbour(
    last: str, tmp_path: Path, checker: Checker
) -> None:
    found = checker(write(tmp_path / "upper.h5", {"upper": pushed_square(last)}))
    assert ("fault" in found["upper"]) == (last != "nothing")


def test_the_second_checker_finds_thin_walls_in_contact(tmp_path: Path, checker: Checker) -> None:
    found = checker(write(tmp_path / "upper.h5", {"upper": stacked_walls(5e-7)}))
    assert "do not match the opposite facets" in found["upper"]["fault"]


@pytest.mark.parametrize(
    "halves",
    [hanging_square(5e-7), hanging_square(2e-11), thin_triangles(0.4375, 0.75, 6e10)],
    ids=["strip", "narrow strip", "heights"],
)
def test_the_second_checker_sees_small_differences_of_bodies(
    halves: Halves, tmp_path: Path, checker: Checker
) -> None:
    path = write(tmp_path / "bounds.h5", halves)
    assert first_bounds(path) == [None, None]
    found = checker(path)
    for kind in ("lower", "upper"):
        fault = found[kind]["fault"]
        assert "bodies of different volume" in fault or "one half is connected" in fault


def test_the_second_checker_holds_columns_by_a_plate(tmp_path: Path, checker: Checker) -> None:
    path = write(tmp_path / "lower.h5", {"lower": columns_under_a_plate((1, 0))})
    assert checker(path)["lower"]["proven"] == pytest.approx(first_bounds(path)[0], rel=AGREE)


@pytest.mark.parametrize(("x", "force"), [(0.0, (0.0, 1.0)), (4e6, (0.0, 1.0)), (0.0, (1e7, 1.0))])
def test_the_second_checker_counts_work_that_plates_can_do(
    x: float, force: tuple[float, float], tmp_path: Path, checker: Checker
) -> None:
    path = write(tmp_path / "upper.h5", {"upper": plate_with_free_load(x, force)})
    assert "any factor" in checker(path)["upper"]["fault"]


@pytest.mark.parametrize("kind", UNLIKE)
def test_the_second_checker_compares_up_to_rounding(
    kind: str, tmp_path: Path, checker: Checker
) -> None:
    for by, unlike in ((9e-10, True), (0.0, False)):
        words = str(checker(write(tmp_path / "bounds.h5", unlike_halves(kind, by))))
        assert ("the halves have different" in words) == unlike


@pytest.mark.parametrize("name", UNDONE)
def test_the_second_checker_counts_the_flow_that_undoes_volume_changes(
    name: str, tmp_path: Path, checker: Checker
) -> None:
    make, (_, words) = UNDONE[name]
    path = write(tmp_path / "upper.h5", {"upper": make()})
    assert words in checker(path)["upper"]["fault"]


@pytest.mark.parametrize("speed", [0.0, 1e7])
def test_the_second_checker_counts_work_beside_fast_bodies(
    speed: float, tmp_path: Path, checker: Checker
) -> None:
    path = write(tmp_path / "upper.h5", {"upper": beside_a_fast_body(speed)})
    assert "any factor" in checker(path)["upper"]["fault"]


def test_the_second_checker_counts_the_rounding_of_stresses(
    tmp_path: Path, checker: Checker
) -> None:
    """A large stress leaves few digits for the stress of other bodies."""
    for size in (0.0, 1e46):
        path = write(tmp_path / "lower.h5", {"lower": beside_a_large_stress(size)})
        found = checker(path)["lower"]
        assert not found.get("proven", 0.0) > 0.51, found


def test_both_checkers_agree(honest: Halves, tmp_path: Path, checker: Checker) -> None:
    """The test uses an honest file, and edited files."""
    path = write(tmp_path / "bounds.h5", honest)
    found = checker(path)
    assert bounds_of(found) == pytest.approx(first_bounds(path), rel=AGREE)
    edits: list[tuple[str, Callable[[Arrays], None]]] = []
    edits += [("lower", edit) for edit in LOWER] + [("upper", edit) for edit in UPPER]
    for kind, change in edits:
        them = copied(honest)
        change(them[kind])
        path = write(tmp_path / f"{kind}_{change.__name__}.h5", them)
        found = checker(path)
        assert first_refuses(path, kind), (kind, change)
        assert "fault" in found[kind], (kind, change, found)


def test_cells_of_very_unlike_sizes(tmp_path: Path, checker: Checker) -> None:
    """The largest cell is 1e9 times as long as the smallest one."""
    them = strip(1.0, 30)
    x = 2.0 ** -np.arange(31.0)
    them["vertices"] = np.concatenate([np.column_stack([x, 0 * x]), np.column_stack([x, x])])
    them["traction"][-1, :, 0] = 1.0
    them["bound"] = np.array(0.0)
    path = write(tmp_path / "wedge.h5", {"lower": them})
    assert first_bounds(path) == [0.0]
    assert checker(path)["lower"] == {"claimed": 0, "proven": 0}


def test_the_numbers_that_are_checked_are_hashed(
    honest: Halves, tmp_path: Path, checker: Checker, capsys: pytest.CaptureFixture[str]
) -> None:
    """A change in the last bit changes the SHA-256; types and order in the file do not."""
    path = write(tmp_path / "bounds.h5", honest)
    assert checker(path)["digest"] == numbers_digest(path)
    other = copied(honest)
    other["upper"]["cells"] = other["upper"]["cells"].astype(np.int32)
    assert numbers_digest(write(tmp_path / "types.h5", other)) == numbers_digest(path)
    other["upper"]["velocity"].flat[0] = np.nextafter(other["upper"]["velocity"].flat[0], 1.0)
    edited = write(tmp_path / "edited.h5", other)
    assert checker(edited)["digest"] == numbers_digest(edited) != numbers_digest(path)
    assert main(["--sha256", str(path)]) == 0
    assert capsys.readouterr().out == f"{numbers_digest(path)}  {path}\n"
    assert main(["--sha256", str(tmp_path)]) == 2


def test_halves_on_two_meshes(honest: Halves, tmp_path: Path, checker: Checker) -> None:
    """The bodies in both halves agree, except for loads or strengths in the upper half."""
    halves = copied(honest)
    finer(halves["lower"])
    path = write(tmp_path / "finer.h5", halves)
    assert bounds_of(checker(path)) == pytest.approx(first_bounds(path), rel=AGREE)
    for name in ("cone_bound", "traction", "vertices"):
        them = copied(halves)
        them["upper"][name] = np.asarray(them["upper"][name]) * 0.999
        path = write(tmp_path / f"{name}.h5", them)
        assert first_bounds(path) == [None, None]
        for half in ("lower", "upper"):
            assert "halves have" in checker(path)[half]["fault"] or name == "cone_bound"
            assert "fault" in checker(path)[half]


def sand() -> Problem:
    """Return a block without cohesion, with pressure from above and less from the side."""
    sides = {"left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > 1 - 1e-9}
    ends = {"bottom": lambda x: x[1] < 1e-9, "top": lambda x: x[1] > 1 - 1e-9}
    mesh = rectangle((2, 2), (1.0, 1.0), {"sand": lambda x: x[0] > -1}, sides | ends)
    return Problem(
        mesh,
        {"sand": MohrCoulomb(1e4, 0.3, 0.0, 30.0)},
        [Support("left", "x"), Support("bottom", "y")],
        [Pressure("top", 1.0), Pressure("right", 1.0, constant=True)],
        degree=2,
    )


def punch(path: Path) -> Halves:
    """Return halves for an elastic punch on ground, with an oblique plane of symmetry.

    The checkers lift the punch and points of the ground along the plane.
    """
    write_punch_sector(path / "punch.msh")
    problem = Problem(
        read_gmsh(MPI.COMM_SELF, path / "punch.msh"),
        {"ground": VonMises(1e3, 0.3, math.sqrt(3)), "punch": Elastic(1e6, 0.3)},
        [Support("y0", "y"), Support("oblique", "normal"), Support("held")],
        [Pressure("top", 1.0)],
        [Contact("punch_seam", "ground_seam")],
        degree=2,
    )
    return written(path, limit_bounds(problem, 1e-3))


OTHERS: dict[str, tuple[Callable[[Path], Halves], tuple[Callable[[Arrays], None], ...]]] = {
    "rings with a plate": (KINDS["rings with a plate"], (half_the_strength, skew, claim)),
    "a stone that rubs and adheres": (
        lambda path: written(path, limit_bounds(pushed(0.2, 2.0, 1.0, 0.1))),
        (claim,),
    ),
    "sand": (lambda path: written(path, limit_bounds(sand())), (more_of_stress, claim)),
    "rock": (
        KINDS["rock"],
        (half_the_strength, more_of_stress, claim, *BENT),
    ),
    "a punch beside an oblique plane": (punch, (claim,)),
    "stones in space": (lambda path: written(path, limit_bounds(in_space())), (claim,)),
    "an elastic body on a hinge": (
        lambda path: written(path, limit_bounds(random_case(HINGED).problem, 1e-3)),
        (claim,),
    ),
}


USUAL = ["rings with a plate", "a stone that rubs and adheres", "sand", "rock"]


@pytest.mark.long(but=[*USUAL, "a punch beside an oblique plane"])
@pytest.mark.parametrize("name", OTHERS)
def test_both_checkers_agree_on_other_bodies(name: str, tmp_path: Path, checker: Checker) -> None:
    """The test uses honest files, and edited files."""
    make, edits = OTHERS[name]
    honest = make(tmp_path)
    path = tmp_path / "bounds.h5"
    assert bounds_of(checker(path)) == pytest.approx(first_bounds(path), rel=AGREE)
    for change in edits:
        for kind in ("lower", "upper") if change in (*UPPER, *BENT) else ("lower",):
            them = copied(honest)
            change(them[kind])
            path = write(tmp_path / f"{kind}_{change.__name__}.h5", them)
            assert first_refuses(path, kind)
            assert "fault" in checker(path)[kind]


@pytest.mark.long
@pytest.mark.parametrize("name", KINDS)
def test_both_checkers_agree_on_each_kind(name: str, tmp_path: Path, checker: Checker) -> None:
    """For 30 edits of each honest file, it proves nothing that the first checker refuses.

    It may refuse more: if an edit leaves large residuals, its estimate of their cost is larger.
    """
    KINDS[name](tmp_path)
    path = tmp_path / "bounds.h5"
    honest, random = halves_of(path), np.random.default_rng(51)
    agreed = 0
    for number in range(31):
        them = copied(honest)
        if number:
            kind = str(random.choice(["lower", "upper"]))
            names = [array for array in (*OF_PROOFS[kind], *OF_BODIES) if array in them[kind]]
            edit(them[kind], str(random.choice(names)), random)
        path = write(tmp_path / "edited.h5", them)
        try:
            first = {half.kind: half.proven for half in check(path).values()}
        except ProofError:
            first = {"lower": None, "upper": None}
        for kind, found in checker(path).items():
            if kind not in first or "does not" in found.get("fault", ""):
                continue
            proven = first[kind]
            assert proven is not None or "fault" in found, (number, kind, found)
            if not number and proven is not None:
                rubs = kind == "upper" and name in {"adhesion", "friction"}
                assert found["proven"] == pytest.approx(proven, rel=RUBBING if rubs else AGREE)
            agreed += ("fault" in found) == (proven is None)
    assert agreed > 30
