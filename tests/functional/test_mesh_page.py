"""The page of ``perfplast mesh``: the bodies in a browser, where a click tells a face's name."""

import math
import re
from pathlib import Path
from typing import Any

import gmsh
import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import SOLVED
from perfplast_fenicsx.mesh import gmsh_session
from tests.functional.browser_page import Page, alone

pytestmark = alone


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two blocks side by side along x; the second one has a pad of a quarter on its back."""
    folder = tmp_path_factory.mktemp("page")
    drawing = folder / "two <b>.brep"
    with gmsh_session():
        occ = gmsh.model.occ
        for x in (0, 1):
            occ.addBox(x, 0, 0, 1, 1, 1)
        pad = occ.addRectangle(1, 0, 0, 0.5, 0.5)
        occ.rotate([(2, pad)], 1, 0, 0, 1, 0, 0, math.pi / 2)
        occ.translate([(2, pad)], 0.25, 1, 0.25)
        occ.fragment([(3, 2)], [(2, pad)])
        occ.synchronize()
        gmsh.write(str(drawing))
    arguments = ["mesh", str(drawing), "-o", str(folder / "case"), "--size", "0.5"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("perfplast_fenicsx.cli.mesh_command.draw_parts", lambda *of: None)
        assert main(arguments) == SOLVED
    return folder / "case" / "bodies.html"


def test_all_faces_are_on_the_page(made: Path) -> None:
    text = made.read_text(encoding="utf-8")
    ends = [f"part_{body}_{end}" for body in (1, 2) for end in ("y_low", "z_low", "z_high")]
    for name in [*ends, "part_1_y_high"]:
        assert f'<th scope="row"><button type="button">{name}</button></th>' in text
    assert "two &lt;b&gt;" in text
    assert "<b>.brep" not in text


def test_areas_and_shares_of_names_are_on_the_page(made: Path) -> None:
    text = made.read_text(encoding="utf-8")
    faces, sets = text.split("<h2>Names of several faces</h2>")
    sets, touching = sets.split("<h2>Faces that touch</h2>")
    (pad,) = [row for row in faces.split("<tr ") if "<td>0.25</td><td>0.25</td>" in row]
    assert "<td>part_2_y_high (the whole side), 25 % of it</td>" in pad
    assert re.search(r"<td>part_2_y_high</td><td>2: \d+-\d+</td><td>1</td><td>1</td>", sets)
    assert "<td>1</td><td>flat</td><td>contact</td>" in touching
    assert "<td>part_1</td>" in faces.split("<h2>Bodies</h2>")[1]


def test_a_click_tells_the_name_of_a_face(made: Path, browser: Any) -> None:
    from selenium.webdriver import ActionChains, Keys

    page = Page(browser, made)
    before = page.pixels()
    told = "document.getElementById('told').textContent"
    canvas = page.part("canvas")
    for down, up in ((0, "z_high"), (1, "y_low")):  # seen from x, -y and z
        shift = -60 if down == 0 else 60
        ActionChains(browser).move_to_element_with_offset(canvas, 0, shift).click().perform()
        page.wait(f"/^part_[12]_{up}: flat, area 1, centre /.test({told})")
    lit = page.changed(before)
    assert len(lit)
    browser.execute_script("document.querySelector('[data-face=\"1\"]').click()")
    assert page(told).startswith("part_1_")
    name = browser.find_element("css selector", '[data-face="2"] button')
    name.send_keys(Keys.ENTER)
    page.wait(f"{told}.startsWith('{name.text}: ')")
    assert [line["message"] for line in browser.get_log("browser")] == []
