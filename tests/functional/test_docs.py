"""Test the documentation: complete reference, site, and pages whose commands run."""

import dataclasses
import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from docs import api_pages, case_reference, command_reference, commands
from docs.repository import LINK
from perfplast_fenicsx.__main__ import main as command_line
from perfplast_fenicsx.cli.parser import BAD_INPUT, FAULT, NO_SOLUTION, SOLVED, make_parser
from perfplast_fenicsx.contact.declared.contact import Contact, Tie
from perfplast_fenicsx.contact.declared.obstacles import OBSTACLES
from perfplast_fenicsx.controls.controls import CONTROLS
from perfplast_fenicsx.geometry.drawn_ground import DrawnLine, Region, Stratum
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions, NamedFace
from perfplast_fenicsx.io.case import support_tables
from perfplast_fenicsx.io.case import tables as schemas
from perfplast_fenicsx.io.case.combinations import Combination, DesignTable
from perfplast_fenicsx.io.case.gravity_table import EarthquakeTable, GravityTable
from perfplast_fenicsx.io.case.load_table import load_table
from perfplast_fenicsx.io.case.water_table import WaterTable
from perfplast_fenicsx.io.results import field_series
from perfplast_fenicsx.materials.laws import MATERIALS
from perfplast_fenicsx.mesh.sample_meshes import BUILDERS
from perfplast_fenicsx.problem.declared.initial import Bolt, InitialStress, Temperature
from perfplast_fenicsx.problem.declared.stage import Stage
from perfplast_fenicsx.report.claim import Claim
from perfplast_fenicsx.seepage import Head, Seepage
from perfplast_fenicsx.solvers.methods import METHODS
from perfplast_fenicsx.units import Units
from tests.test_walls import BELOW

pytestmark = pytest.mark.serial

COARSE = {
    "prop --size 30": "prop --size 60",
    "until = 0.02, cells = 4000": "until = 0.2, cells = 1500",
}
"""Coarser meshes for the tutorials."""

DOCS = Path(__file__).resolve().parents[2] / "docs"

TABLES = {
    "[mesh]": [schemas.MeshFile],
    "[geometry]": [MeshingOptions, NamedFace],
    "[[region]]": [Region],
    "[[stratum]]": [Stratum],
    "[[line]]": [DrawnLine],
    "[water]": [WaterTable],
    "[material.NAME]": [*MATERIALS.values()],
    "[[support]]": [support_tables.SupportTable],
    "[[load]]": [load_table()],
    "[gravity]": [GravityTable],
    "[earthquake]": [EarthquakeTable],
    "[seepage]": [Seepage, Head],
    "[[temperature]]": [Temperature],
    "[[initial_stress]]": [InitialStress],
    "[[bolt]]": [Bolt],
    "[[contact]]": [Contact],
    "[[obstacle]]": [*OBSTACLES.values()],
    "[[rigid_surface]]": [support_tables.RigidSurfaceTable],
    "[[tie]]": [Tie],
    "[[combination]]": [Combination],
    "[design]": [DesignTable],
    "[model]": [schemas.ModelOptions],
    "[element]": [schemas.ElementOptions],
    "[solve]": [entry.options for entry in METHODS.values()],
    "[loading]": [*CONTROLS.values()],
    "[[stage]]": [Stage],
    "[output]": [schemas.OutputOptions],
    "[report]": [schemas.ReportHead],
    "[units]": [Units],
}


def tables(text: str) -> dict[str, str]:
    """Return the tables of the reference by their headings."""
    _, *parts = re.split(r"^## `?([^`\n]+)`?\n", text, flags=re.MULTILINE)
    return dict(zip(parts[::2], parts[1::2], strict=True))


def test_every_table_has_a_section() -> None:
    keys = {field.name for field in dataclasses.fields(schemas.Document)}
    assert set(case_reference.SECTIONS) == keys - {"title"}
    assert set(tables(case_reference.reference())) == {"Top level", *TABLES}


@pytest.mark.parametrize("heading", TABLES)
def test_every_field_is_documented(heading: str) -> None:
    text = tables(case_reference.reference())[heading]
    for schema in TABLES[heading]:
        rows = case_reference.rows(schema)
        assert rows in text
        for field in dataclasses.fields(schema):
            ((default, meaning),) = re.findall(
                rf"^\| `{field.name}` \| [^|]+ \| ([^|]+) \| (.+) \|$", rows, re.MULTILINE
            )
            assert len(meaning) > 10
            required = field.default is field.default_factory is dataclasses.MISSING
            assert (default == "required") == required, field


def test_choices_are_documented() -> None:
    text = case_reference.reference()
    choices: list[Any] = [MATERIALS, METHODS, OBSTACLES, CONTROLS, BUILDERS]
    for name in [name for mapping in choices for name in mapping]:
        assert f'`"{name}"`' in text


def test_every_command_is_documented() -> None:
    text = command_reference.reference()
    for command in ("run", "check"):
        assert f"\n## `perfplast {command}`\n" in text
    assert "--force" in text


def test_every_room_has_a_page() -> None:
    pages = (page.read_text(encoding="utf-8") for page in (DOCS / "api").glob("*.md"))
    named = [name for page in pages for name in api_pages.ROOM.findall(page)]
    assert sorted(named) == sorted({*BELOW, "ground"})


def test_the_line_for_pyvista_is_shown() -> None:
    """The page shows the line that a test of :mod:`field_series` runs."""
    (line,) = re.findall(r"^    (pyvista\..+)$", field_series.__doc__ or "", re.MULTILINE)
    assert f"\n{line}\n" in (DOCS / "howto" / "fields.md").read_text(encoding="utf-8")


def test_the_readme_does_what_it_shows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The script prints the output shown below it, and the case runs."""
    text = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 100
    (script,) = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    exec(compile(script, "README.md", "exec"), {})
    out, _ = capsys.readouterr()
    *_, shown = script.splitlines()
    assert commands.same(shown.removeprefix("# ") + "\n", out)
    (case,) = re.findall(r"^```toml\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    path = tmp_path / "case.toml"
    path.write_text(case, encoding="utf-8")
    monkeypatch.setattr("perfplast_fenicsx.cli.commands.draw_case", lambda *of: False)
    assert command_line(["check", str(path)]) == SOLVED
    assert "can be run" in capsys.readouterr().out


def scripts(page: str) -> list[str]:
    """Return the scripts of a page."""
    text = (DOCS / page).read_text(encoding="utf-8")
    return re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


SCRIPTS = [
    *scripts("howto/python.md"),
    scripts("api/index.md")[0].replace("size=40.0", "size=60.0"),  # a coarser mesh suffices here
]


@pytest.mark.parametrize("number", range(len(SCRIPTS)))
def test_a_script_of_few_lines(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    number: int,
) -> None:
    """Each script is complete, has few lines, and ends with a bracket or a picture."""
    script = SCRIPTS[number]
    assert len([line for line in script.splitlines() if line]) <= 15
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    shutil.copy(DOCS / "prop.step", tmp_path)
    exec(compile(script, f"script {number}", "exec"), {"__name__": f"script_{number}"})
    out, _ = capsys.readouterr()
    drawn = [path.stat().st_size for path in tmp_path.glob("*.png")]
    assert re.search(r"between [\d.]+ and [\d.]+|stands with F", out) or min(drawn) > 1000


def test_links_lead_to_files() -> None:
    """This test checks all pages in the repository; Sphinx checks the links of the site."""
    pages = [*DOCS.parent.glob("*.md"), *DOCS.rglob("*.md"), *DOCS.parent.glob("benchmarks/*.md")]
    links = [(page, match[2]) for page in pages for match in LINK.finditer(page.read_text("utf-8"))]
    files = [(page, link) for page, link in links if ":" not in link]
    assert len(files) > 50
    assert [(page, link) for page, link in files if not (page.parent / link).exists()] == []


def test_programs_find_what_they_are_told() -> None:
    """``AGENTS.md`` and ``llms.txt``: one page each, with commands and options that exist."""
    parser = make_parser()
    root = DOCS.parent
    for name in ("AGENTS.md", "llms.txt"):
        text = (root / name).read_text(encoding="utf-8")
        assert len(text.splitlines()) <= 60
        links = [match[2] for match in LINK.finditer(text)]
        assert links
        assert [link for link in links if not (root / link).exists()] == []
    text = (root / "AGENTS.md").read_text(encoding="utf-8")
    shown = [line.split() for line in re.findall(r"`perfplast ([^`]+)`", text)]
    assert {words[0] for words in shown} >= {"mesh", "check", "run", "claim", "mcp", "schema"}
    for words in shown:
        parser.parse_args(words)
    status = {int(number) for number in re.findall(r"\b(\d+)(?:, 143)?: ", text)}
    assert status == {SOLVED, FAULT, BAD_INPUT, NO_SOLUTION, 130}
    keys = set(re.findall(r"`([a-z_]+)`", text[text.index("## A claim") :]))
    assert keys <= {field.name for field in dataclasses.fields(Claim)}


def test_the_design_names_what_there_is() -> None:
    named = re.findall(r"`([\w/]+\.py)`: `(\w+)`", (DOCS / "design.md").read_text())
    assert len(named) >= 10
    for path, name in named:
        text = (DOCS.parent / "perfplast_fenicsx" / path).read_text()
        assert re.search(rf"^(def|class) {name}\b", text, re.MULTILINE), (path, name)


def test_pictures_are_small() -> None:
    pictures = [*DOCS.glob("pictures/*")]
    assert pictures
    assert [picture for picture in pictures if picture.stat().st_size > 150_000] == []


@pytest.mark.parametrize(
    ("shown", "printed", "equal"),
    [
        ("a 1.5\nb\n", "a  2e-3\nb\n", True),
        ("a\n...\nc\n", "a\nb\nb\nc\n", True),
        ("a\nc\n", "a\nb\nc\n", False),
        ("Results in r: x.csv, x.png\n", "Results in r: x.csv\n", True),
        ("2 ranks\n", "1 rank\n", False),
    ],
)
def test_outputs_are_compared(shown: str, printed: str, equal: bool) -> None:
    assert commands.same(shown, printed) == equal


@pytest.mark.long(but=["howto/python.md-2"])
@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("tutorial.md", 6),
        ("tutorial_slope.md", 9),
        ("extending.md", 7),
        ("howto/python.md", 2),
    ],
)
def test_pages_do_what_they_show(tmp_path: Path, name: str, count: int) -> None:
    page = DOCS / name
    parts = list(commands.parts(page.read_text(encoding="utf-8")))
    assert sum(isinstance(part, commands.Command) for part in parts) == count
    # without pictures, which take most of the time and have separate tests
    faults = commands.check(page, tmp_path / "clone", pictures=False, coarse=COARSE)
    assert not faults, "\n".join([*faults, f"docs/commands.py docs/{name} --write refreshes it"])


@pytest.mark.long
def test_site(tmp_path: Path) -> None:
    for module in ("sphinx", "myst_parser", "furo"):
        if not importlib.util.find_spec(module):
            pytest.skip(f"{module} is not installed")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-n", "-q", "-b", "html"]
    done = subprocess.run(
        [*command, "-d", str(tmp_path / "trees"), str(DOCS), str(tmp_path / "site")],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    site = tmp_path / "site"
    assert "<math" in (site / "theory.html").read_text(encoding="utf-8")
    assert "limit_tolerance" in (site / "case_file.html").read_text(encoding="utf-8")
    # a page loads nothing from other hosts
    for page in site.rglob("*.html"):
        fetched = re.findall(
            r'<(?:script|link|img)[^>]+(?:src|href)="(https?://[^"]+)"', page.read_text()
        )
        assert fetched == [], page
