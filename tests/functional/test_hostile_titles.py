"""Test that titles from unknown sources are text: pages show them, terminals do not obey them."""

import json
from html.parser import HTMLParser
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.report.report_file import write_report
from tests.functional.test_hostile_files import CASE, MESH

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture
def case(shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write a case with its mesh into the working directory."""
    path = shared_tmp_path / "case.toml"
    if MPI.COMM_WORLD.rank == 0:
        (shared_tmp_path / "a.msh").write_text(MESH, encoding="utf-8")
        path.write_text(CASE.format(source="[mesh]\nfile = 'a.msh'"), encoding="utf-8")
    MPI.COMM_WORLD.barrier()
    monkeypatch.chdir(shared_tmp_path)
    return path


TITLES = (
    "</title><script>alert(1)</script>",
    "<!--<script>alert(1)",
    "]]><svg onload=alert(1)>",
    '" onmouseover=alert(1) x="',
    "' autofocus onfocus=alert(1) '",
    "</style><img src=x onerror=alert(1)>",
    "</textarea><iframe src='javascript:alert(1)'>",
    "<a href='javascript:alert(1)'>",
    "${alert(1)}`<b onclick=alert(1)>`",
    "\u2028</SCRIPT\t><ScRiPt>alert(1)",
)
"""Titles that a page would execute if they were not escaped."""


@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="one process reads, whatever the ranks")
def test_titles_are_text_in_pages(case: Path) -> None:
    """With each title, the page of one run has as many tags and handlers as with a plain title."""
    case.write_text(case.read_text().replace("from the mail", "TITLE"))
    assert main(["run", str(case), "-o", "out", "--quiet"]) == 0
    files = {name: Path("out", name).read_text("utf-8") for name in ("summary.json", "scene.json")}
    assert any("TITLE" in text for text in files.values())
    plain = Tags.of(write_report("out").read_text("utf-8"))
    for title in TITLES:
        for name, text in files.items():
            Path("out", name).write_text(text.replace("TITLE", json.dumps(title)[1:-1]), "utf-8")
        page = write_report("out").read_text("utf-8")
        assert "alert(1)" in page
        assert Tags.of(page) == plain, title


class Tags(HTMLParser):
    """The tags of a page as a browser parses them, with the names of their attributes."""

    @classmethod
    def of(cls, page: str) -> list[tuple[str, ...]]:
        """Return the tags of a page, with their attributes."""
        parser = cls()
        parser.found: list[tuple[str, ...]] = []
        parser.feed(page)
        return parser.found

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Store the tag with its attributes."""
        self.found.append((tag, *(name for name, _ in attrs)))


ESCAPES = ("\x1b]0;mine\x07", "\x1b[2J\x1b[H", "\rcase.toml can be run.", "\x9b31m", "\u202egood")


@pytest.mark.parametrize("title", ESCAPES)
def test_titles_are_text_on_terminals(
    title: str, case: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A title neither clears the screen, nor names the window, nor hides words."""
    if MPI.COMM_WORLD.rank == 0:
        written = "".join(f"\\u{ord(c):04x}" for c in title)
        case.write_text(case.read_text().replace("from the mail", written))
    MPI.COMM_WORLD.barrier()
    assert main(["check", str(case)]) == 0
    out = MPI.COMM_WORLD.bcast(capsys.readouterr().out)
    assert ascii(title)[1:-1] in out
    assert title not in out
