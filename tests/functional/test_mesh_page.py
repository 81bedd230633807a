"""The page of ``perfplast mesh``: the bodies in a browser, where a click tells a face's name."""

from pathlib import Path
from typing import Any

import gmsh
import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import SOLVED
from perfplast_fenicsx.mesh import gmsh_session
from tests.functional.browser_page import Page, alone

pytestmark = alone


@pytest.fixture
def made(tmp_path: Path, undrawn: None) -> Path:
    """Two blocks side by side along x."""
    drawing = tmp_path / "two <b>.brep"
    with gmsh_session():
        for x in (0, 1):
            gmsh.model.occ.addBox(x, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.write(str(drawing))
    folder = tmp_path / "case"
    assert main(["mesh", str(drawing), "-o", str(folder), "--size", "0.5"]) == SOLVED
    return folder / "bodies.html"


def test_all_faces_are_on_the_page(made: Path) -> None:
    text = made.read_text(encoding="utf-8")
    for end in ("y_low", "y_high", "z_low", "z_high"):
        for body in ("part_1", "part_2"):
            assert f'<th scope="row"><button type="button">{body}_{end}</button></th>' in text
    assert "two &lt;b&gt;" in text
    assert "<b>.brep" not in text


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
