"""Test ``perfplast claim`` and the tool server: only numbers that a file proves are bounds."""

import asyncio
import hashlib
import json
import shutil
import sys
import time
from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest

from meshes.strip_footing import write_strip_footing
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli import tool_server
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.cli.tool_server import NAMES, Tools, answering
from perfplast_fenicsx.environment import environment_with_package
from perfplast_fenicsx.errors import UNLISTED
from perfplast_fenicsx.proof import check
from tests.functional.test_adapted_run import CASE

pytestmark = pytest.mark.serial

COMM = MPI.COMM_WORLD


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a case, and its results in ``results``."""
    folder = tmp_path_factory.mktemp("tools")
    write_strip_footing(folder / "ground.msh", size=0.4)
    text = CASE.replace("adapt = { until = 0.2, cells = 800 }\n", "")
    (folder / "case.toml").write_text(f'{text}[units]\nsystem = "mm-N-MPa"\n', encoding="utf-8")
    assert main(["run", str(folder / "case.toml"), "-o", str(folder / "results")]) == SOLVED
    return folder


@pytest.fixture
def copied(place: Path, tmp_path: Path) -> Path:
    """Return a copy of the results, which a test may damage."""
    return Path(shutil.copytree(place / "results", tmp_path / "results"))


def refusal(folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    capsys.readouterr()
    assert main(["claim", str(folder)]) == BAD_INPUT
    return capsys.readouterr().err


def test_a_claim(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["claim", str(place / "results"), "--json"]) == SOLVED
    found = json.loads(capsys.readouterr().out)
    proven = check(place / "results" / "bounds.h5")
    assert found["quantity"] == "load factor"
    for kind in ("lower", "upper"):
        assert found[kind] == pytest.approx(proven[kind].proven, rel=1e-12)
    assert [one["half"] for one in found["proofs"]] == ["lower", "upper"]
    data = (place / "results" / "bounds.h5").read_bytes()
    assert {one["sha256"] for one in found["proofs"]} == {hashlib.sha256(data).hexdigest()}
    assert found["meaning"] == "ζ is the load factor: ζ = 1 is pressure 1 MPa on footing."
    assert found["units"]["stress"] == "MPa"
    assert found["not_proven"] == []
    assert any("Plane strain" in text for text in found["assumptions"])
    assert all(text.startswith("Taken as written: ") for text in found["taken_as_written"])
    assert main(["claim", str(place / "results")]) == SOLVED
    words = capsys.readouterr().out
    assert words.startswith(found["sentence"])
    assert found["proofs"][0]["sha256"] in words


def test_assumptions_of_bounds_on_one_mesh(place: Path, tmp_path: Path) -> None:
    """Report and claim list the same assumptions."""
    page = tmp_path / "report.html"
    assert main(["report", str(place / "results"), "-o", str(page)]) == SOLVED
    text = page.read_text(encoding="utf-8")
    assert "The bodies are the regions that the straight-sided elements of the mesh fill." in text
    assert "Results hold for the mesh" not in text


@pytest.mark.parametrize("name", ["bounds.h5", "summary.json"])
def test_files_that_somebody_edited(
    copied: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    if name == "bounds.h5":
        (copied / name).unlink()
    else:
        summary = json.loads((copied / name).read_text(encoding="utf-8"))
        summary["limit"]["body"]["lower"] *= 1.5
        (copied / name).write_text(json.dumps(summary), encoding="utf-8")
    told = refusal(copied, capsys)
    assert ("nothing is proven" if name == "bounds.h5" else "says that the lower bound") in told


def test_one_half(copied: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A bound without proof is null, with the reason."""
    path = copied / "summary.json"
    summary = json.loads(path.read_text(encoding="utf-8"))
    summary["limit"]["body"] |= {"lower": None, "why_not": ["lower bound: of no use"]}
    path.write_text(json.dumps(summary), encoding="utf-8")
    import h5py

    with h5py.File(copied / "bounds.h5", "a") as file:
        del file["lower"]
    capsys.readouterr()
    assert main(["claim", str(copied), "--json"]) == SOLVED
    found = json.loads(capsys.readouterr().out)
    assert found["lower"] is None
    assert found["upper"] > 0
    assert "carry" not in found["sentence"]
    assert found["not_proven"] == ["lower bound: of no use"]


def test_reasons_of_a_half_that_is_proven(copied: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The bounds on a factor of safety come from two runs, each of which computed one bound."""
    path = copied / "summary.json"
    summary = json.loads(path.read_text(encoding="utf-8"))
    summary["limit"]["body"]["why_not"] = ["lower bound: it was not requested"]
    path.write_text(json.dumps(summary), encoding="utf-8")
    capsys.readouterr()
    assert main(["claim", str(copied), "--json"]) == SOLVED
    found = json.loads(capsys.readouterr().out)
    assert found["lower"] > 0
    assert found["not_proven"] == []


def test_levels_prove_nothing(
    place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (place / "case.toml").read_text(encoding="utf-8")
    text = text.replace('control = "bounds"', "values = [100.0]").replace(
        '"ground.msh"', json.dumps(str(place / "ground.msh"))
    )
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    assert main(["run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "out")]) == SOLVED
    told = refusal(tmp_path / "out", capsys)
    assert "nothing is proven" in told
    assert 'control = "bounds"' in told


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("check", {"case": "../case.toml"}, "outside the folders"),
        ("claim", {"folder": "/etc"}, "outside the folders"),
        ("claim", {"folder": "nowhere"}, "does not exist"),
        ("prove", {"file": "case.toml"}, "case.toml"),
        ("status", {"folder": "never"}, "no run was started"),
        ("run", {"case": "bad.toml", "folder": "new"}, "yield_strength"),
        ("run", {"case": "case.toml", "folder": "results"}, "already has results"),
    ],
)
def test_what_the_tools_refuse(
    place: Path, name: str, arguments: dict[str, Any], words: str
) -> None:
    text = (place / "case.toml").read_text(encoding="utf-8")
    bad = text.replace("yield_stress", "yield_strength")
    (place / "bad.toml").write_text(bad, encoding="utf-8")
    found = answering(getattr(Tools((place.resolve(),)), name))(**arguments)
    assert not found["ok"]
    told = found.get("error") or {"message": "\n".join(found["text"]), "code": "checker"}
    assert words in told["message"]
    assert told["code"] not in {"", UNLISTED}
    assert not (place / "new").exists()


def test_a_link_out_of_the_folder(place: Path, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(place)
    found = answering(Tools((tmp_path.resolve(),)).check)("link/case.toml")
    assert "outside the folders" in found["error"]["message"]


def test_a_run_by_tools(place: Path) -> None:
    """The tools lead from a case to a claim whose proof the checker confirms."""
    tools = Tools((place.resolve(),))
    assert tools.run("case.toml", "by_tools")["ok"]
    until = time.monotonic() + 600
    while tools.status("by_tools")["state"] == "going on":
        assert time.monotonic() < until
        time.sleep(0.1)
    ended = tools.status("by_tools")
    assert (ended["state"], ended["exit_status"]) == ("ended", SOLVED)
    claim = tools.claim("by_tools")
    assert claim["lower"] < claim["upper"]
    assert tools.prove("by_tools/bounds.h5")["ok"]
    sha = {one["sha256"] for one in claim["proofs"]}
    assert sha == {hashlib.sha256((place / "by_tools" / "bounds.h5").read_bytes()).hexdigest()}


def test_without_the_package(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mcp.server", None)
    for folder, words in ((str(place), "perfplast_fenicsx[mcp]"), ("nowhere", "is not a folder")):
        with pytest.raises(tool_server.InputError, match=words.replace("[", r"\[")):
            tool_server.serve([folder])


def test_the_server(place: Path) -> None:
    """A client of the protocol lists the tools, and reads a claim."""
    mcp: Any = pytest.importorskip("mcp")
    stdio = pytest.importorskip("mcp.client.stdio")

    async def asked() -> tuple[list[str], dict[str, Any]]:
        arguments = ["-m", "perfplast_fenicsx", "mcp", str(place)]
        environment = environment_with_package()
        server = mcp.StdioServerParameters(command=sys.executable, args=arguments, env=environment)
        async with stdio.stdio_client(server) as streams, mcp.ClientSession(*streams) as session:
            await session.initialize()
            listed = await session.list_tools()
            found = await session.call_tool("claim", {"folder": "results"})
            return [tool.name for tool in listed.tools], json.loads(found.content[0].text)

    names, found = asyncio.run(asked())
    assert names == list(NAMES)
    assert found["ok"]
    assert found["lower"] > 0
