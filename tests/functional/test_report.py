"""Test ``perfplast report`` and ``run --report``: the page in a browser, and refusals."""

import base64
import json
import re
import shutil
import zlib
from collections.abc import Callable
from contextlib import redirect_stdout
from html import escape
from io import StringIO
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from matplotlib.image import imsave

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, FAULT, SOLVED
from perfplast_fenicsx.report.frame import asset
from tests.functional.browser_page import Page, alone
from tests.functional.test_command_line import CASE, one_line, write


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the results of a run with its report."""
    comm = MPI.COMM_WORLD
    place = comm.bcast(tmp_path_factory.mktemp("run"))
    text = CASE.replace("[50.0, 80.0]", "[50.0, 80.0, 95.0]")
    text += '[report]\nproject = "Punches"\nnumber = "17 <b>"\nrevision = "B"\nchecked = "A & B"\n'
    case, folder = write(comm, place, text), place / "results"
    with redirect_stdout(StringIO()) as out:
        assert main(["run", str(case), "-o", str(folder), "--report"]) == SOLVED
    if comm.rank == 0:
        assert out.getvalue().endswith(f"Report: {folder / 'report.html'}\n")
    return folder


@pytest.mark.mpi2
def test_the_run_writes_it(
    results: Path, comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]
) -> None:
    again = results / "new" / "page.html"
    assert main(["report", str(results), "-o", str(again)]) == SOLVED
    assert capsys.readouterr().out == ("" if comm.rank else f"{again}\n")
    page = again.read_text(encoding="utf-8")
    assert page == (results / "report.html").read_text(encoding="utf-8")
    assert "on this mesh the bodies carry the loads up to ζ&nbsp;=&nbsp;95" in page
    assert "yield stress 100 MPa" in page
    summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
    given = {"project": "Punches", "number": "17 <b>", "revision": "B", "checked": "A & B"}
    assert summary["report"] == given
    head = page[page.index("<header>") : page.index("</header>")]
    for told in ("Punches", "17 &lt;b&gt;", "B", summary["surroundings"]["began"]):
        assert f"<dd>{told}</dd>" in head
    signed = head[head.index('id="signatures"') :]
    assert re.findall(r'row">(\w+)</th><td>(.*?)</td><td></td><td></td>', signed) == [
        ("Prepared", ""),
        ("Checked", "A &amp; B"),
        ("Approved", ""),
    ]
    contents = page[page.index('<nav class="contents"') : page.index("</nav>")]
    links = re.findall(r'href="#(\w+)"', contents)
    assert links[0] == "bodies"
    assert links[-1] == "again"
    assert links == re.findall(r'<section id="(\w+)" aria-labelledby', page)
    assumed = page[page.index('<section id="assumptions"') : page.index('<section id="again"')]
    assert "<li>Surfaces in contact can push and separate, but not pull.</li>" in assumed
    assert "<li>Results hold for the mesh, not for the bodies.</li>" in assumed
    assert re.search(r"<li>Taken as perfectly plastic .*associated flow: .*punch", assumed)
    assert summary["given"]["materials"]["punch"]["kind"] == "von-mises"
    assert escape(summary["case"]["text"]) in page


def change(folder: Path, **values: Any) -> None:
    """Change values in ``summary.json``."""
    path = folder / "summary.json"
    path.write_text(json.dumps(json.loads(path.read_text(encoding="utf-8")) | values))


@pytest.mark.parametrize(
    ("spoil", "more", "part"),
    [
        (shutil.rmtree, [], "does not exist"),
        (lambda path: (path / "scene.json").unlink(), [], "contains no scene.json"),
        (lambda path: (path / "summary.json").write_text("{"), [], "cannot be read"),
        (
            lambda path: (path / "summary.json").write_text("{}"),
            [],
            "cannot be read (Object missing",
        ),
        (lambda path: change(path, mesh={}), [], "summary.json' cannot be read (Object missing"),
        (lambda path: change(path, limit={"lower": 1.0}), [], "cannot be read (Object missing"),
        (lambda path: change(path, case={"file": "a"}), [], "no file, or text,"),
        (lambda path: change(path, report={"number": 17}), [], "cannot be read (Expected"),
        (lambda path: change(path, surroundings={"versions": 1}), [], "cannot be read (Expected"),
        (
            lambda path: change(path, given={"initial": [{"kind": "temperature", "on": "a"}]}),
            [],
            "it has no change on a)",
        ),
        (
            lambda path: change(path, given={"materials": {"a": {"kind": "Flow"}}}),
            [],
            "kind of a material",
        ),
        (lambda path: (path / "fields/level_0002.vtkhdf").write_text("a"), [], "cannot be read"),
        (lambda path: (path / "model.json").touch(), [], "contains model.json, so its results"),
        (lambda path: None, ["-o", "/dev/null/a.html"], "cannot be written"),
        (lambda path: None, ["-o", "/"], "which is a folder; give the name"),
    ],
)
def test_what_cannot_be_reported(
    spoil: Callable[[Path], object],
    more: list[str],
    part: str,
    results: Path,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    shared_tmp_path: Path,
) -> None:
    folder = shared_tmp_path / "spoilt"
    if comm.rank == 0:
        spoil(shutil.copytree(results, folder))
    comm.barrier()
    assert main(["report", str(folder), *more]) == BAD_INPUT
    assert part in one_line(comm, capsys)


def test_a_fault_of_the_program_is_told_as_one(
    results: Path,
    comm: MPI.Intracomm,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if comm.size > 1:
        pytest.skip("a fault of the program ends all ranks")

    def faulty(_: object) -> None:
        raise KeyError("cells")

    monkeypatch.setattr("perfplast_fenicsx.report.page.verdict_on", faulty)
    assert main(["report", str(results), "-o", str(results / "other.html")]) == FAULT
    assert "KeyError: 'cells'" in capsys.readouterr().err
    assert not (results / "other.html").exists()


@alone
def test_in_a_browser(results: Path, browser: Any) -> None:
    """The page sends no requests, shows the bodies, and supports mouse, keys and narrow windows."""
    from selenium.webdriver import ActionChains, Keys

    page = Page(browser, results / "report.html")
    first = page.pixels()
    assert 0.1 < (first.min(axis=2) < 250).mean() < 0.9
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 20
    assert "step 3 of 3" in page.part("level-told").text

    page.keys("level", Keys.ARROW_LEFT)
    page.wait("document.getElementById('level-told').textContent.startsWith('step 2')")
    second = page.changed(first)
    page.choose("field", "")
    plain = page.changed(second)
    page.choose("scale", "0")
    page.wait("document.getElementById('scale-told').textContent === 'not deformed'")
    page.keys("canvas", Keys.ARROW_RIGHT)
    turned = page.changed(plain)
    page.keys("canvas", "0")
    page.choose("cut-axis", "0")
    page.changed(turned)
    page.choose("cut-axis", "")

    told = "document.getElementById('told').textContent"
    ActionChains(browser).move_to_element(page.part("canvas")).click().perform()
    page.wait(f"['base', 'punch'].includes({told})")
    before = page.pixels()
    page.part("hide").click()
    hidden = page.changed(before)
    page.part("all").click()
    page.changed(hidden)
    page.choose("field", "stress")
    page.part("reset").click()
    shown = page.changed(page.pixels() * 0)
    ActionChains(browser).move_to_element(page.part("canvas")).click().perform()
    page.wait(f"/^(base|punch): von Mises stress [0-9.]+ MPa$/.test({told})")
    named = np.abs(page.pixels() - shown).max(axis=2)
    assert 0 < (named > 20).mean() < 0.2  # only edges, without colours of the legend

    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True},
    )
    page.wait("innerWidth === 390")
    assert page("document.documentElement.scrollWidth") <= 390
    page.wait("document.getElementById('canvas').width === 2 * canvas.clientWidth")
    height = "document.querySelector('.curve.narrow text').getBoundingClientRect().height"
    assert page(height) > 11
    place = "document.querySelector('{}').getBoundingClientRect().toJSON()"
    label, stage = (page(place.format(what)) for what in ("#largest text", ".stage"))
    assert stage["left"] < label["left"] < label["right"] < stage["right"]
    assert page("[...document.querySelectorAll('pre')].every((a) => a.scrollWidth <= 390)")
    narrow = page.pixels()
    assert 0.05 < (narrow.min(axis=2) < 250).mean() < 0.95

    assert [line["message"] for line in browser.get_log("browser")] == []
    messages = [json.loads(line["message"])["message"] for line in browser.get_log("performance")]
    sent = [a for a in messages if a["method"] == "Network.requestWillBeSent"]
    asked = {message["params"]["request"]["url"].split(":")[0] for message in sent}
    assert asked <= {"file", "data"}
    assert sum(a["params"]["request"]["url"].startswith("file:") for a in sent) == 1


@alone
def test_a_browser_without_webgl_shows_a_sentence_and_the_still_picture(
    results: Path, tmp_path: Path, browser: Any
) -> None:
    """In place of an empty figure; with WebGL neither is visible."""
    folder, pixels = tmp_path / "drawn", np.zeros((4, 4, 3))
    shutil.copytree(results, folder)
    for name in ("fields", "mechanism"):
        imsave(folder / f"{name}.png", pixels[: 3 if name == "mechanism" else 4])
    assert main(["report", str(folder)]) == SOLVED
    page = Page(browser, folder / "report.html")
    visible = "document.getElementById('{}').checkVisibility()"
    page.wait(f"!{visible.format('still')}")
    assert page(visible.format("view"))
    source = "HTMLCanvasElement.prototype.getContext = () => null;"
    found = browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": source})
    browser.refresh()
    page.wait(visible.format("still"))
    page.wait("document.getElementById('still-words').textContent.includes('no WebGL 2')")
    assert not page(visible.format("view"))
    assert page("[...document.querySelectorAll('#still img')].map((a) => a.naturalHeight)") == [3]
    browser.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", found)
    told = (folder / "report.html").read_text(encoding="utf-8")
    assert "<noscript><style>#view { display: none; }</style></noscript>" in told


LIGHT_ARROWS = """(() => {
    const canvas = document.getElementById("canvas");
    const { width, height } = canvas;
    const pen = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d");
    pen.drawImage(canvas, 0, 0);
    const { data } = pen.getImageData(0, 0, width, height);
    let count = 0;
    for (let at = 0; at < data.length; at += 4) {
        count += [255, 160, 160].every((wanted, k) => Math.abs(data[at + k] - wanted) < 15);
    }
    return count;
})()"""
"""Script that returns the number of pixels with the light red of loads on dark paper."""

CONTRASTS_IN_THE_DARK = """
const light = (colour) => colour.map((a) => a / 255)
    .map((a) => (a <= 0.04045 ? a / 12.92 : ((a + 0.055) / 1.055) ** 2.4))
    .reduce((sum, a, k) => sum + a * [0.2126, 0.7152, 0.0722][k], 0);
const contrast = (colour) => (light(colour) + 0.05) / (light(DARK) + 0.05);
const { marks } = JSON.parse(document.getElementById("data").textContent);
const lines = [...marks.map(({ colour }) => colour), ...Object.values(MARK_COLOURS)];
return [
    BODIES.map((colour) => contrast(colour.map((a) => DIM_ON_DARK * a))),
    lines.map((colour) => contrast(onDark(colour).map((a) => 255 * a))),
];
"""
"""Script that returns the contrasts of bodies in the least light, and of marks, to dark paper."""


def corners_of_pictures(pdf: bytes) -> list[bytes]:
    """Return the colour in the first corner of each picture that Chromium prints."""
    found = []
    for head in re.finditer(rb"<<[^>]*/Subtype\s*/Image[^>]*>>\s*stream\r?\n", pdf):
        if b"/DeviceGray" not in head[0]:  # a mask
            length = re.search(rb"/Length (\d+)", head[0])
            assert length is not None
            found.append(zlib.decompress(pdf[head.end() :][: int(length[1])])[:3])
    return found


@alone
def test_in_the_dark_and_on_paper(results: Path, browser: Any) -> None:
    """Page and view follow the colour scheme, still pictures stay light, and paper is white."""
    page = Page(browser, results / "report.html")
    paper = "getComputedStyle(document.body).backgroundColor"
    assert page(paper) == "rgb(255, 255, 255)"

    page.choose("field", "")
    assert page(LIGHT_ARROWS) == 0

    def emulate(media: str, scheme: str) -> None:
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        told = {"media": media, "features": features}
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", told)

    emulate("screen", "dark")
    page.wait(f"{paper} === 'rgb(22, 25, 29)'")
    assert page("getComputedStyle(document.querySelector('.curve')).backgroundColor") == (
        "rgb(255, 255, 255)"
    )
    assert page.pixels()[0, 0].tolist() == [22, 25, 29]
    assert page(LIGHT_ARROWS) > 20
    emulate("", "dark")
    printed = browser.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})["data"]
    corners = corners_of_pictures(base64.b64decode(printed))
    assert len(corners) >= 5  # the large picture and four sides
    assert corners == [b"\xff\xff\xff"] * len(corners)
    page.wait("!matchMedia('print').matches")
    assert page.pixels()[0, 0].tolist() == [22, 25, 29]
    scripts = asset("colours.js") + asset("case_marks.js")
    bodies, lines = browser.execute_script(scripts + CONTRASTS_IN_THE_DARK)
    assert min(bodies) >= 3
    assert min(lines) >= 4.5
    emulate("print", "dark")
    page.wait(f"{paper} === 'rgb(255, 255, 255)'")
    assert page.pixels()[0, 0].tolist() == [255, 255, 255]
    legend = "getComputedStyle(document.getElementById('legend-bar')).printColorAdjust"
    assert page(legend) == "exact"
    button = "Object.assign(document.createElement('button'), { id: 'prove' })"
    page(f"document.getElementById('prove') ?? document.body.append({button})")
    for hidden in ("told", "prove"):  # pages with a proof have the button
        assert page(f"getComputedStyle(document.getElementById('{hidden}')).display") == "none"
    kept = "getComputedStyle(document.querySelector('{}')).breakInside"
    told = [page(kept.format(part)) for part in ("#again", "#verdict", "tr", "dl > div")]
    assert told == ["auto", "avoid", "avoid", "avoid"]
    case = "document.querySelector('#again details').open"
    assert not page(case)
    page("window.dispatchEvent(new Event('beforeprint'))")
    assert page(case)
    page("window.dispatchEvent(new Event('afterprint'))")
    assert not page(case)


NOTHING_AT_THE_EDGE = """(image) => {
    const {naturalWidth: width, naturalHeight: height} = image;
    const pen = Object.assign(document.createElement("canvas"), {width, height}).getContext("2d");
    pen.drawImage(image, 0, 0);
    const [right, bottom] = [width - 1, height - 1];
    return [[0, 0, width, 1], [0, bottom, width, 1], [0, 0, 1, height], [right, 0, 1, height]]
        .every((strip) => pen.getImageData(...strip).data.every((value) => value > 250));
}"""
"""Whether the edges of a picture are white, so that neither bodies nor arrows are cropped."""


@alone
def test_every_control_is_reached_by_keys(results: Path, browser: Any) -> None:
    """Keys reach the controls in the order of the page, and a frame marks the focused control."""
    from selenium.webdriver import ActionChains, Keys

    page = Page(browser, results / "report.html")
    wanted = page(
        "[...document.querySelectorAll('a, canvas, button, input, select, summary, .scroll')]"
        ".filter((part) => !part.disabled && part.checkVisibility()).length"
    )
    passed = []
    for _ in range(wanted):
        ActionChains(browser).send_keys(Keys.TAB).perform()
        passed.append(page("[...document.querySelectorAll('*')].indexOf(document.activeElement)"))
        assert page("getComputedStyle(document.activeElement).outlineWidth") == "3px"
    assert passed == sorted(set(passed))
    assert page("document.activeElement.tagName") == "SUMMARY"


@alone
def test_a_mechanism_has_the_colours_of_its_flow(tmp_path: Path, browser: Any) -> None:
    """The colours do not show stresses that are arbitrary where nothing flows; the page says so."""
    limit = 'control = "work"\nuntil = "limit"'
    text = CASE.replace("values = [50.0, 80.0]", limit)
    case, folder = write(MPI.COMM_WORLD, tmp_path, text), tmp_path / "results"
    assert main(["run", str(case), "-o", str(folder), "--report", "--quiet"]) == SOLVED
    page = Page(browser, folder / "report.html")
    assert page("document.getElementById('field').value") == "dissipation"
    assert "Where there is no plastic flow" in page("document.getElementById('bodies').textContent")
    before = page.pixels()
    page.choose("field", "stress")
    page.changed(before)


@pytest.mark.long
@alone
def test_the_bodies_from_four_sides(results: Path, browser: Any) -> None:
    """The four pictures differ, follow the settings, and turn the large picture."""
    page = Page(browser, results / "report.html")
    images = "[...document.querySelectorAll('#sides img')]"
    sources = f"{images}.map((image) => image.src)"
    page.wait(f"{images}.every((image) => image.naturalWidth === 560)")
    first = page(sources)
    assert len(set(first)) == len(first) == 4
    assert page(f"{images}.every({NOTHING_AT_THE_EDGE})")
    before = page.pixels()
    page.choose("field", "")
    plain = page.changed(before)
    page.wait(f"{sources}[0] !== '{first[0]}'")
    assert not set(first) & set(page(sources))
    browser.find_elements("css selector", "#sides button")[3].click()
    above = page.changed(plain)
    page.part("reset").click()
    page.changed(above)
    assert (page.pixels() == plain).all()


def test_date_and_command(results: Path, comm: MPI.Intracomm) -> None:
    page = (results / "report.html").read_text(encoding="utf-8")
    case = results.parent / "case.toml"
    launch = f"mpirun -n {comm.size} " if comm.size > 1 else ""
    assert f"{launch}perfplast run {case} -o {results} --report" in page
    began = json.loads((results / "summary.json").read_text(encoding="utf-8"))["surroundings"]
    assert f"<dd>{began['began']}</dd>" in page
