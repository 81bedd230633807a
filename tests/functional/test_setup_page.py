"""The page that ``perfplast mesh`` writes: faces are chosen by clicks, and the case file grows."""

import json
import math
import re
import tomllib
from pathlib import Path
from typing import Any

import gmsh
import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import SOLVED
from perfplast_fenicsx.mesh import gmsh_session
from perfplast_fenicsx.report.frame import asset
from tests.functional.browser_page import Page, alone

pytestmark = alone

ROOT = Path(__file__).parents[2]

LEFT = "[...document.querySelectorAll('#left li')].map((a) => a.textContent)"
"""What the page lists as missing or wrong."""

COMPLETE = f"{LEFT}.join() === 'Nothing. perfplast check makes all other tests.'"


class SetupPage(Page):
    """The page as a hand uses it."""

    def press(self, *names: str) -> None:
        """Click the buttons with these words or names of faces, one after the other."""
        for name in names:
            self.wait("document.getElementById('cards').ariaBusy === 'false'")
            self._browser.find_element("xpath", f"//button[normalize-space()='{name}']").click()

    def add(self, kind: str, **fields: str) -> None:
        """Fill in the form for an entry and send it."""
        self.choose("kind", kind)
        for name, text in fields.items():
            field = self.part(f"add-{name}")
            if field.tag_name == "select":
                self.choose(f"add-{name}", text)
            else:
                field.clear()
                field.send_keys(text)
        self.press("Add")

    def type(self, name: str, text: str) -> None:
        """Replace the text of a field, and go on to the next one."""
        from selenium.webdriver import Keys

        self.wait("document.getElementById('cards').ariaBusy === 'false'")
        self.part(name).send_keys(Keys.CONTROL, "a", Keys.NULL, Keys.DELETE, text, Keys.TAB)

    def drop(self, text: str) -> None:
        """Drop a case file on the page."""
        self._browser.execute_script(
            """const moved = new DataTransfer();
            moved.items.add(new File([arguments[0]], "case.toml"));
            document.dispatchEvent(new DragEvent("drop", { dataTransfer: moved }));""",
            text,
        )

    @property
    def case(self) -> str:
        """The text of the case file."""
        return str(self("document.getElementById('text').value"))


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
    return folder / "case" / "setup.html"


def test_all_faces_are_on_the_page(made: Path) -> None:
    text = made.read_text(encoding="utf-8")
    ends = [f"part_{body}_{end}" for body in (1, 2) for end in ("y_low", "z_low", "z_high")]
    for name in [*ends, "part_1_y_high"]:
        assert (
            f'<th scope="row"><button type="button" aria-pressed="false">{name}</button></th>'
            in text
        )
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


def test_a_click_chooses_a_face(made: Path, browser: Any) -> None:
    from selenium.webdriver import ActionChains, Keys

    page = SetupPage(browser, made)
    before = page.pixels()
    told = "document.getElementById('told').textContent"
    canvas = page.part("canvas")
    for down, up in ((0, "z_high"), (1, "y_low")):  # seen from x, -y and z
        shift = -60 if down == 0 else 60
        ActionChains(browser).move_to_element_with_offset(canvas, 0, shift).click().perform()
        page.wait(f"/^part_[12]_{up}: flat, area 1, centre .*; chosen$/.test({told})")
    page.changed(before)
    assert len(page("document.querySelectorAll('[aria-pressed=true]')")) == 2
    page.press("Choose nothing")
    name = browser.find_element("css selector", '[data-face="2"] button')
    name.send_keys(Keys.ENTER)
    page.wait(f"{told}.startsWith('{name.text}: ')")
    assert page.part("chosen").text == f"Chosen: {name.text}"
    assert [line["message"] for line in browser.get_log("browser")] == []


@pytest.fixture(scope="module")
def prop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the tutorial, on a coarse mesh and without a material."""
    folder = tmp_path_factory.mktemp("prop") / "prop"
    drawing = ROOT / "docs" / "prop.step"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("perfplast_fenicsx.cli.mesh_command.draw_parts", lambda *of: None)
        assert main(["mesh", str(drawing), "-o", str(folder), "--size", "100"]) == SOLVED
    return folder


def by_hand(prop: Path) -> str:
    """Return the case of the tutorial: its first case with the tables that the tutorial writes."""
    tutorial = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    blocks = re.findall(
        r"```\{code-block\} toml\n:caption: prop/case.toml.*?\n\n(.*?)```", tutorial, re.S
    )
    assert len(blocks) == 2
    text = (prop / "case.toml").read_text(encoding="utf-8")
    for kind, block in zip(("support", "load"), blocks, strict=True):
        (placeholder,) = re.findall(rf"\[\[{kind}\]\].*?\n\n", text, re.S)
        text = text.replace(placeholder, block)
    for key, number in (("young", "210000.0"), ("poisson", "0.3"), ("yield_stress", "235.0")):
        text = re.sub(rf"{key} = 0\.0 .*", f"{key} = {number}", text)
    return text


@pytest.mark.usefixtures("undrawn")
def test_clicks_make_the_case_of_the_tutorial(
    prop: Path, browser: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Clicks make the same tables as a hand; the page asks for nothing; check takes the file."""
    page = SetupPage(browser, prop / "setup.html")
    left = page(LEFT)
    assert "[support]: nothing holds the bodies; choose a face and add a support" in left
    assert "[load]: no load grows with the load factor; add a load" in left
    assert "Material of beam, young: 0 is not positive" in left
    for body in ("beam", "block"):
        page.choose(f"e-material-{body}--library", "s235")
    page.press("beam_x_low", "block_z_low")
    page.add("support")
    page.press("beam_z_high")
    page.add("pressure", pressure="1.0")
    page.wait(COMPLETE)
    assert tomllib.loads(page.case) == tomllib.loads(by_hand(prop))
    assert "# finer ones until bounds are 10 % apart" in page.case
    assert "<-" not in page.case.split("title")[1]

    folder = {"behavior": "allow", "downloadPath": str(tmp_path)}
    browser.execute_cdp_cmd("Browser.setDownloadBehavior", folder)
    page.press("Save case.toml")
    saved = tmp_path / "case.toml"
    for _ in range(600):
        if saved.exists():
            break
        page.pixels()  # two frames
    assert saved.read_text(encoding="utf-8") == page.case
    case = prop / "clicked.toml"
    case.write_bytes(saved.read_bytes())
    assert main(["check", str(case)]) == SOLVED
    assert "beam_z_high: pressure 1 MPa" in capsys.readouterr().out

    assert [line["message"] for line in browser.get_log("browser")] == []
    messages = [json.loads(line["message"])["message"] for line in browser.get_log("performance")]
    sent = [
        message["params"]["request"]["url"]
        for message in messages
        if message["method"] == "Network.requestWillBeSent"
    ]
    assert {url.split(":")[0] for url in sent} <= {"file", "data", "blob"}
    assert sum(url.startswith("file:") for url in sent) == 1


WRONG_FIELDS = (
    ("load-0-pressure", "1,5", "'1,5' has a comma; write 1.5"),
    ("load-0-pressure", "10 kPa", "'10 kPa' has a unit; give the number alone, in MPa"),
    ("load-0-pressure", "much", "'much' is not known in a formula"),
    ("load-0-pressure", "x^2", "write ** for powers"),
    ("load-0-pressure", "", "is missing; give a number or a formula"),
    ("load-0-on", "beam_z_hihg", "the nearest is 'beam_z_high'"),
    ("support-0-on", "wall", "'wall' is not a name of the drawing"),
    ("material-beam--young", "-210000", "-210000 is not positive"),
    ("material-beam--poisson", "0.5", "0.5 is not between −1 and 0.5"),
    ("material-beam--young", "steel", "'steel' is not a number"),
    ("contact-0-secondary", "beam_joint_1", "is the primary surface as well"),
    ("loading--limit_tolerance", "2", "2 is not between 0 and 1"),
    ("mesh--adapt", "{ until = 0.1, cell = 9 }", "the nearest key is 'cells'"),
    ("element--degree", "3", None),
)
"""Field of a card, what is typed, and the words beside it; None where it is not offered."""


def test_wrong_entries_are_named_at_their_field(prop: Path, browser: Any) -> None:
    """Each has its words beside the field and in the list, and right entries have none."""
    page = SetupPage(browser, prop / "setup.html")
    page.drop(by_hand(prop))
    page.wait(COMPLETE)
    for field, text, words in WRONG_FIELDS:
        name = f"e-{field}"
        right = page(f"document.getElementById('{name}').value")
        if words is None:
            options = f"[...document.getElementById('{name}').options]"
            assert text not in page(f"{options}.map((a) => a.value)")
            continue
        page.type(name, text)
        page.wait(f"document.getElementById('{name}').getAttribute('aria-invalid') === 'true'")
        assert words in page.part(f"{name}-fault").text, (field, text)
        assert any(words in line for line in page(LEFT)), (field, text)
        page.type(name, right)
        page.wait(COMPLETE)
    assert tomllib.loads(page.case) == tomllib.loads(by_hand(prop))


def test_forms_add_what_they_say(prop: Path, browser: Any) -> None:
    """Words beside the field refuse what is wrong; the rest is in the file, and undo removes it."""
    page = SetupPage(browser, prop / "setup.html")
    before = page.case
    page.add("support")
    assert page.part("add-fault").text == "Choose a face first."
    page.press("beam_z_high")
    page.add("traction", **{"traction-x": "0", "traction-y": "0", "traction-z": "-1 MPa"})
    assert "has a unit" in page.part("add-traction-z-fault").text
    page.add("tie")
    assert page.part("add-fault").text == "Choose 2 surfaces first; 1 are chosen."
    page.press("beam_x_high")
    push = {"force-x": "0", "force-y": "0", "force-z": "-2e3", "constant": "true"}
    page.add("force", **push)
    assert page.part("add-fault").text.startswith("2 faces are chosen, and this acts on one.")
    page.choose("question", "load")
    page.part("ask-values").send_keys("1,5")
    page.press("Ask this")
    assert "may be one number or several" in page.part("ask-values-fault").text
    assert page.case == before

    page.add("face", name="pushed")
    page.add("force", **push)
    down = {"acceleration-x": "0", "acceleration-y": "0", "acceleration-z": "-9810"}
    page.add("gravity", **down, **{"density-beam": "7.85e-9"})
    page.part("ask-values").clear()
    page.part("ask-values").send_keys("1, 1.5")
    page.press("Ask this")
    page.press("Glue instead")
    page.wait("document.getElementById('e-tie-0') !== null")
    case = tomllib.loads(page.case)
    assert case["geometry"]["face"] == [{"name": "pushed", "faces": ["beam_z_high", "beam_x_high"]}]
    assert case["load"] == [{"on": "pushed", "force": [0, 0, -2000.0], "constant": True}]
    assert case["gravity"] == {"acceleration": [0, 0, -9810], "density": {"beam": 7.85e-9}}
    assert case["loading"] == {"control": "load", "values": [1, 1.5]}
    assert "mesh" not in case
    assert case["tie"] == [{"primary": "beam_joint_1", "secondary": "block_joint_1"}]
    for _ in range(5):
        page.press("Undo")
    assert page.case == before


def test_a_file_that_is_dropped_keeps_its_comments(prop: Path, browser: Any) -> None:
    """The page reads TOML as tomllib does, and a change of a field changes its value alone."""
    files = [*ROOT.glob("demos/*.toml"), *ROOT.glob("docs/gallery/*.toml")]
    assert len(files) > 10
    script = (
        asset("toml.js") + "return JSON.stringify(arguments[0].map((a) => parseToml(a).value));"
    )
    texts = [file.read_text(encoding="utf-8") for file in files]
    for text, read in zip(texts, json.loads(browser.execute_script(script, texts)), strict=True):
        assert read == tomllib.loads(text)

    page = SetupPage(browser, prop / "setup.html")
    text = by_hand(prop).replace("pressure = 1.0", "pressure = 1.5  ")
    page.drop(text)
    page.wait("document.getElementById('e-load-0-pressure')?.value === '1.5'")
    assert page.case == text
    page.type("e-load-0-pressure", "2.5")
    changed = json.dumps(text.replace("1.5 ", "2.5 "))
    page.wait(f"document.getElementById('text').value === {changed}")
    assert "# MPa, times the load factor zeta" in page.case
    page.drop("[loading\ncontrol = 1")
    page.wait(f"{LEFT}[0].startsWith('The text cannot be read, line 1: ')")
