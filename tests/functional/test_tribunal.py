"""Test published factors of safety against proofs: verdicts, tables, cases, page."""

import csv
import math
import re
import shutil
import tomllib
from dataclasses import replace
from decimal import Decimal
from html import escape
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from demos.tribunal import tribunal
from demos.tribunal.log_spiral import Slope, least, ratio, slope_of, upper_bound
from demos.tribunal.picture import COLOURS, draw
from demos.tribunal.verdicts import (
    BELOW,
    IMPOSSIBLE,
    METHODS,
    POSSIBLE,
    UNDECIDED,
    WORDS,
    Published,
    Solved,
    ends,
    judge,
    judged,
    kind_of,
    read,
    write_verdicts,
)
from demos.tribunal.verdicts import (
    percent as percent_of,
)
from perfplast_fenicsx.__main__ import main as command_line
from perfplast_fenicsx.cli.parser import SOLVED
from tests.functional.browser_page import alone

pytestmark = [pytest.mark.serial, pytest.mark.usefixtures("undrawn")]

CASES = tribunal.all_cases()
PUBLISHED = read(Published, tribunal.HERE / tribunal.PUBLISHED)
STORED = {row.problem: row for row in read(Solved, tribunal.HERE / tribunal.BOUNDS)}
SHORT = ("pruska_01", "arai_tagyo_3")
"""Cases that ``make test`` checks; ``make verify`` checks all."""
MOST_LINES = 25


@pytest.mark.parametrize(
    ("value", "lower", "upper", "word", "percent"),
    [
        ("1.22", "1.2144", "1.2228", POSSIBLE, None),
        ("1.23", "1.2144", "1.225", POSSIBLE, None),
        ("1.23", "1.2144", "1.22499", IMPOSSIBLE, "0.00081"),
        ("1.31", "1.2144", "1.2228", IMPOSSIBLE, "6.72"),
        ("1.310", "1.2144", "1.2228", IMPOSSIBLE, "7.09"),
        ("1.21", "1.215", "1.2228", POSSIBLE, None),
        ("1.21", "1.21501", "1.2228", BELOW, "0.00082"),
        ("1.4", "1.3745", "1.3801", POSSIBLE, None),
        ("2", "1.5", "1.6", POSSIBLE, None),
        ("1.31", "", "1.2228", IMPOSSIBLE, "6.72"),
        ("1.22", "", "1.2228", UNDECIDED, None),
        ("1.00", "1.2144", "", BELOW, "17.24"),
        ("1.31", "1.2144", "", UNDECIDED, None),
        ("1.31", "", "", UNDECIDED, None),
        ("1/0.261", "3.775", "3.778", IMPOSSIBLE, "1.22"),
        ("1/0.265", "3.775", "3.778", POSSIBLE, None),
        ("1/0.266", "3.775", "3.778", BELOW, "0.22"),
    ],
)
def test_verdicts(value: str, lower: str, upper: str, word: str, percent: str | None) -> None:
    low, high = (Decimal(text) if text else None for text in (lower, upper))
    found = judge(value, low, high)
    assert (found.word, percent_of(found)) == (word, percent or "")
    assert judge(value, low, high, doubt="two unit weights").word == UNDECIDED


@pytest.mark.parametrize(
    ("value", "bound", "word"),
    [
        ("0.423", "lower", POSSIBLE),
        ("0.454", "upper", POSSIBLE),
        ("0.434", "lower", IMPOSSIBLE),
        ("0.427", "upper", BELOW),
    ],
)
def test_a_published_bound_is_wrong_on_the_wrong_side(value: str, bound: str, word: str) -> None:
    found = judge(value, Decimal("0.4286"), Decimal("0.4328"), bound=bound)
    assert found.word == word


@pytest.mark.parametrize("name", CASES)
def test_a_case_is_short(name: str) -> None:
    lines = CASES[name].read_text(encoding="utf-8").splitlines()
    assert len(lines) <= MOST_LINES
    assert lines[0].startswith("# ")


@pytest.mark.parametrize(
    "name", [pytest.param(it, marks=[] if it in SHORT else pytest.mark.long) for it in CASES]
)
def test_a_case_can_be_run(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = shutil.copy(CASES[name], tmp_path)
    assert command_line(["check", str(case)]) == SOLVED
    assert "can be run" in capsys.readouterr().out


def test_numbers_have_a_source_and_a_case() -> None:
    assert {number.problem for number in PUBLISHED} == CASES.keys()
    assert len({(it.problem, it.value, it.program, it.source) for it in PUBLISHED}) == len(
        PUBLISHED
    )
    for number in PUBLISHED:
        assert number.method in METHODS
        assert ends(number.value)[0] > 0
        control = tomllib.loads(CASES[number.problem].read_text("utf-8"))["loading"]["control"]
        assert number.quantity.startswith("factor of safety") == (control == "strength")
        assert (number.quantity == "k_c") == (control == "seismic")
        assert number.program and number.source
        assert number.year == "undated" or number.year[:4].isdigit()
        assert number.bound in ("", "lower", "upper")


def test_numbers_have_a_place_or_a_transcription() -> None:
    """A number that was read in its source has a page, a DOI or a commit."""
    place = re.compile(r"doi:10\.\d{4}|, \d+–\d+|\(\d{4}\) \d+|p\. \d+|commit [0-9a-f]{8}")
    for number in PUBLISHED:
        assert number.transcribed_by or place.search(number.source), number
    assert not place.search("RS2 Slope Stability Verification Manual, Part II, problem 56")
    assert place.search("Géotechnique 53 (2003), 463–479") and place.search("Proc. 2 (1949) 40")


def test_bounds_are_of_three_kinds() -> None:
    kinds = {it.problem: kind_of(it.quantity) for it in PUBLISHED}
    assert kinds["pruska_01"] == kinds["chart_60_20"] == kind_of("k_c") == "slopes"
    assert kinds["vertical_cut"] == kinds["footing_nc_0"] == "ground"
    assert kinds["notches_60"] == kinds["platens_2"] == "metal"


def test_stored_bounds_are_of_the_cases_and_in_order() -> None:
    assert STORED.keys() <= CASES.keys()
    for name, row in STORED.items():
        assert row.case == tribunal.checksum(CASES[name]), f"solve {name} again: make tribunal"
        low, high = row.sides
        assert low is None or high is None or low <= high
        assert low is None or not row.spiral or low <= Decimal(row.spiral)
        assert bool(low) == bool(row.stands) and bool(high) == bool(row.falls)


def test_each_slope_where_the_script_applies_has_a_log_spiral() -> None:
    applies = {
        name
        for name, case in CASES.items()
        if slope_of(tomllib.loads(case.read_text(encoding="utf-8"))) is not None
    }
    assert len(applies) > 50
    assert {name for name, row in STORED.items() if row.spiral} == applies


def test_the_page_and_the_verdicts_are_those_of_the_stored_bounds(tmp_path: Path) -> None:
    page = tribunal.page(CASES, PUBLISHED, STORED)
    assert page == tribunal.PAGE.read_text(encoding="utf-8"), "make tribunal writes it"
    write_verdicts(tmp_path / "new.csv", judged(PUBLISHED, STORED))
    stored = (tribunal.HERE / tribunal.VERDICTS).read_text(encoding="utf-8")
    assert (tmp_path / "new.csv").read_text(encoding="utf-8") == stored


def test_the_page_shows_each_problem_and_number(tmp_path: Path) -> None:
    row = Solved("pruska_01", "", "1.21440", "1.22280", "1.22490", "818", "21", "a", "b")
    page = tribunal.page(CASES, PUBLISHED, {"pruska_01": row})
    assert f"1 of {len(CASES)} problems have both bounds: 1 slopes, 0 other" in page
    (line,) = (line for line in page.splitlines() if "(../demos/tribunal/pruska_01.toml)" in line)
    assert " | slopes | 1.21440 | 1.22280 | 0.69 | 21 | 2/4/0/0 | 1.22490 |" in line
    assert line.startswith("| ![](pictures/tribunal/pruska_01.png) | ")
    assert page.count("\n| Pruška (2003): H = 7 m, γ = 24, c = 20, φ = 10° | ") == 7


def test_each_problem_has_a_small_picture() -> None:
    folder = tribunal.PAGE.parent / tribunal.PICTURES
    drawn = {path.stem: path.stat().st_size for path in folder.glob("*.png")}
    assert drawn.keys() == {name for name, row in STORED.items() if row.upper}
    assert max(drawn.values()) < 2000 and sum(drawn.values()) < 100_000


def drawn(
    folder: Path,
    vertices: npt.NDArray[np.float64],
    cells: npt.NDArray[np.int64],
    cones: list[int],
) -> npt.NDArray[np.int64]:
    """Draw four cells, of which the last two move, and return the pixels of the picture."""
    half = {
        "vertices": vertices,
        "cells": cells,
        "cone": np.array(cones),
        "velocity": np.repeat([[0.0, 0.0], [1.0, 0.0]], 6, axis=0),
        "nodes": np.repeat([0, 6], 2)[:, None] + np.arange(6),
    }
    with h5py.File(folder / "bounds.h5", "w") as file:
        for name, values in half.items():
            file[f"upper/{name}"] = values
    draw(folder / "bounds.h5", folder / "picture.png")
    with Image.open(folder / "picture.png") as image:
        return np.asarray(image.convert("RGB")).astype(int)


def test_a_picture_shows_what_moves(tmp_path: Path) -> None:
    """Two squares have different strengths, and the right square moves."""
    x, y = np.meshgrid([0.0, 1.0, 2.0], [0.0, 1.0])
    cells = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    pixels = drawn(tmp_path, np.column_stack([x.ravel(), y.ravel()]), cells, [0, 0, 1, 1])
    rows, columns, _ = pixels.shape
    middle, third = rows // 2, columns // 3
    assert tuple(pixels[middle, third]) == tuple(COLOURS[0])
    assert tuple(pixels[middle, 2 * third]) == tuple(COLOURS[-1])
    dark = np.flatnonzero(pixels[middle].sum(axis=1) < 100)
    assert any(abs(dark - columns / 2) < 2)  # the boundary between the strengths


def test_a_small_moving_part_is_enlarged(tmp_path: Path) -> None:
    """A square of a pixel's size, beside a large body at rest."""
    wide, side = 100.0, 0.4
    low = np.array([[0.0, 0.0], [wide, 0.0]])
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    squares = corners * [wide, 0.4 * wide] + low[0], corners * side + low[1]
    cells = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    pixels = drawn(tmp_path, np.concatenate(squares), cells, [0, 0, 0, 0])
    assert (pixels == COLOURS[-1]).all(axis=2).sum() > 100
    assert (pixels == COLOURS[0]).all(axis=2).sum() > 100


@alone
def test_the_page_filters_rows_by_verdict(tmp_path: Path, browser: Any) -> None:
    """The site turns tables into HTML and loads ``tribunal.js``, as here."""
    lines = tribunal.page(CASES, PUBLISHED, STORED).splitlines()
    boxes = [n for n, line in enumerate(lines) if line == '<div class="tribunal">']
    assert len(boxes) == 2
    html = []
    for start in boxes:
        rows = [it[2:-2].split(" | ") for it in lines[start + 2 : lines.index("</div>", start) - 1]]
        head = "".join(f"<th>{cell}</th>" for cell in rows[0])
        body = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows[2:])
        html += ['<div class="tribunal"><table><thead><tr>', head, "</tr></thead><tbody><tr>"]
        html += ["</tr><tr>".join(body), "</tr></tbody></table></div>"]
    script = (tribunal.PAGE.parent / "static" / "tribunal.js").as_uri()
    page = tmp_path / "page.html"
    page.write_text(f"{''.join(html)}<script src={script}></script>", encoding="utf-8")
    browser.get(page.as_uri())

    def shown(table: int, *words: str) -> str:
        """Press buttons above a table, and return the number of visible rows."""
        for word in words:
            browser.execute_script(
                """const box = document.querySelectorAll("div.tribunal")[arguments[0]];
                for (const button of box.querySelectorAll("button"))
                  if (button.textContent === arguments[1]) { button.click(); break; }""",
                table,
                word,
            )
        return str(
            browser.execute_script(
                """const box = document.querySelectorAll("div.tribunal")[arguments[0]];
                const left = [...box.querySelectorAll("tbody tr")].filter((row) => !row.hidden);
                const said = box.querySelector("[role=status]").textContent;
                return said.startsWith(`${left.length} of `) ? left.length : said""",
                table,
            )
        )

    found = judged(PUBLISHED, STORED)
    for word in WORDS:
        of_word = [number for number, verdict in found if verdict.word == word]
        button = "below" if word == BELOW else word
        assert shown(1, button) == str(len(of_word))
        assert shown(0, button) == str(len({number.problem for number in of_word}))
    slopes = {it.problem for it in PUBLISHED if kind_of(it.quantity) == "slopes"}
    assert shown(0, "all", "slopes") == str(len(slopes))


def test_what_was_solved_is_not_solved_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A failed case does not affect other cases; a changed case is solved again."""
    home = tmp_path / "tribunal"
    home.mkdir()
    for name in ("pruska_01", "pruska_02"):
        shutil.copy(CASES[name], home)
    rows = [
        line
        for line in (tribunal.HERE / "published.csv").read_text("utf-8").splitlines()
        if line.startswith(("problem,", "pruska_01,", "pruska_02,"))
    ]
    (home / "published.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    solved: list[str] = []

    def solve(case: Path, folder: Path) -> Solved:
        solved.append(case.stem)
        if case.stem == "pruska_02":
            raise tribunal.Failed("it has too few cells")
        sum_ = tribunal.checksum(case)
        return Solved(case.stem, sum_, "1.21440", "1.22280", "1.22490", "818", "21", "a", "b")

    monkeypatch.setattr(tribunal, "HERE", home)
    monkeypatch.setattr(tribunal, "solve", solve)
    arguments = ["-o", str(tmp_path / "out")]
    assert tribunal.main(arguments) == 1
    assert "pruska_02 no bounds: it has too few cells" in capsys.readouterr().out
    assert tribunal.main([*arguments, "--only", "pruska_01"]) == 0
    assert solved == ["pruska_01", "pruska_02"]
    with (home / "pruska_01.toml").open("a", encoding="utf-8") as case:
        case.write("# changed\n")
    assert tribunal.main([*arguments, "--only", "pruska_01"]) == 0
    assert solved == ["pruska_01", "pruska_02", "pruska_01"]
    with (tmp_path / "out" / "verdicts.csv").open(encoding="utf-8") as file:
        words = {
            row["program"]: row["verdict"]
            for row in csv.DictReader(file)
            if row["problem"] == "pruska_01"
        }
    assert words["GEO FEM"] == IMPOSSIBLE and words["RS2"] == POSSIBLE


def test_problems_that_are_not_selected_keep_their_stored_bounds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def solve(case: Path, folder: Path) -> Solved:
        return replace(STORED[case.stem], lower="1.21440")

    monkeypatch.setattr(tribunal, "solve", solve)
    assert tribunal.main(["-o", str(tmp_path), "--only", "pruska_01"]) == 0
    rows = {row.problem: row for row in read(Solved, tmp_path / tribunal.BOUNDS)}
    assert rows.keys() == STORED.keys()
    assert rows["pruska_01"].lower == "1.21440" and rows["cheng"] == STORED["cheng"]


@pytest.mark.long
def test_a_problem_is_solved_and_its_proofs_are_checked(tmp_path: Path) -> None:
    text = CASES["pruska_01"].read_text(encoding="utf-8")
    case = tmp_path / "pruska_01.toml"
    case.write_text(text.replace("until = 0.007", "until = 0.2, cells = 300"), encoding="utf-8")
    found = tribunal.with_spiral(tribunal.solve(case, tmp_path / "out"), case)
    low, high = found.sides
    assert low is not None and high is not None
    assert 1.0 < low < high < 1.5 and low < Decimal(found.spiral)
    proof = tmp_path / "out" / "results" / "stands.h5"
    assert tribunal.checksum(proof) == found.stands
    with pytest.raises(tribunal.Failed, match=r"is a proof of F = 1\."):
        tribunal.check_proof(proof, "lower", 1.5, divides=True)


def test_a_limit_load_is_solved_and_its_proof_is_checked(tmp_path: Path) -> None:
    """The constraint factor of Ewing and Hill lies between the bounds."""
    text = CASES["double_cracks_50"].read_text(encoding="utf-8")
    case = tmp_path / "double_cracks_50.toml"
    case.write_text(text.replace("until = 0.005, cells = 6000", "until = 0.1"), encoding="utf-8")
    found = tribunal.solve(case, tmp_path / "out")
    low, high = found.sides
    assert low is not None and high is not None
    assert float(low) < 1.0 + math.log(1.5) < float(high)
    assert found.spiral == ""
    proof = tmp_path / "out" / "results" / "bounds.h5"
    assert tribunal.checksum(proof) == found.stands == found.falls
    with pytest.raises(tribunal.Failed, match="proves 1"):
        tribunal.check_proof(proof, "lower", 1.5, divides=False)


@pytest.mark.long
@pytest.mark.parametrize("name", CASES)
def test_log_spirals_are_above_the_lower_bounds(name: str) -> None:
    slope = slope_of(tomllib.loads(CASES[name].read_text(encoding="utf-8")))
    spiral = None if slope is None else upper_bound(slope)
    if spiral is not None and name in STORED:
        low, _ = STORED[name].sides
        assert low is None or low <= spiral
        assert spiral == pytest.approx(float(STORED[name].spiral), rel=1e-3)


SLOPE = Slope(
    x=np.array([0.0, 4.0, 4.0 + 1 / math.sqrt(3), 9.0]),
    y=np.array([0.0, 0.0, 1.0, 1.0]),
    bottom=-3.0,
    cohesion=1 / 10.39,
    friction=math.tan(math.radians(20.0)),
    weight=(0.0, -1.0),
)
"""Slope of 60° with W. F. Chen's stability number γH/c for φ = 20° (1975, table 9.1)."""


def test_a_log_spiral_has_the_stability_number_of_chen() -> None:
    start = [(3.5, 2.2, 4.0)]
    assert least(SLOPE, 0.999, start)[0] > 1 > least(SLOPE, 1.001, start)[0]


@pytest.mark.long
def test_the_best_log_spiral_is_found() -> None:
    assert upper_bound(SLOPE) == pytest.approx(1.0, rel=1e-3)


def test_the_work_is_that_of_a_polygon() -> None:
    """The test replaces the arc by chords, and uses Green's formula."""
    mechanism, factor = (3.9, 2.2, 4.0), 1.1
    pole, t = np.array(mechanism[:2]), SLOPE.friction / factor
    start = np.array([4.0, 0.0]) - pole
    angle, radius = math.atan2(start[1], start[0]), math.hypot(*start)
    turned = np.linspace(0, 3, 400_001)
    r = radius * np.exp(-t * turned)
    arc = pole + np.column_stack([r * np.cos(angle + turned), r * np.sin(angle + turned)])
    last = np.flatnonzero(arc[100:, 1] > SLOPE.height(arc[100:, 0]))[0] + 100
    corner = [[SLOPE.x[2], 1.0]]
    x, y = (np.vstack([arc[:last], corner]) - pole).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    work = float(((x + np.roll(x, -1)) * cross).sum() / 6)
    spent = SLOPE.cohesion / factor * (radius**2 - r[last] ** 2) / (2 * t)
    assert ratio(mechanism, SLOPE, factor) == pytest.approx(spent / work, rel=1e-4)


def test_slopes_without_a_log_spiral() -> None:
    for name in ("arai_tagyo_2", "morgenstern_2", "fredlund_krahn_seam", "braced_cut", "acads_1c"):
        assert slope_of(tomllib.loads(CASES[name].read_text(encoding="utf-8"))) is None


def test_a_slope_and_its_mirror_image_are_one() -> None:
    case = tomllib.loads(CASES["acads_1a"].read_text(encoding="utf-8"))
    slope = slope_of(case)
    assert slope is not None
    top = case["stratum"][0]["top"]
    mirrored = slope_of(
        case | {"stratum": [{**case["stratum"][0], "top": [[-x, y] for x, y in top][::-1]}]}
    )
    assert mirrored is not None
    assert mirrored.x == pytest.approx(slope.x) and mirrored.y == pytest.approx(slope.y)
    assert replace(mirrored, x=slope.x, y=slope.y).weight == slope.weight
