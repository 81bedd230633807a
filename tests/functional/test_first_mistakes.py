"""Test first mistakes of users: the program accepts each, or gives one sentence with a remedy."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.formulas import SHOWN, check
from perfplast_fenicsx.io.case.schema import parse, read_text
from tests.mesh.damaged_meshes import blocks

pytestmark = pytest.mark.usefixtures("undrawn")

CASE = """
title = "a cube"

[mesh]
builder = "two_blocks"
n = 2

[material.lower]
law = "von-mises"
young = 206900.0
poisson = 0.29
yield_stress = 450.0

[material.upper]
law = "elastic"
young = 206900.0
poisson = 0.29

[[support]]
on = "left"
components = "xyz"

[[load]]
on = "top"
traction = [0.0, 0.0, -1.0]

[[contact]]
primary = "upper_bottom"
secondary = "lower_top"

[element]
degree = 1

[loading]
control = "load"
values = [10.0, 20.0]

[units]
system = "mm-N-MPa"
"""

Told = Callable[..., tuple[int, str]]


@pytest.fixture
def told(shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Told:
    """Write the case with changes, run a command, and return the status and the message."""

    def run(*changes: tuple[str, str], command: tuple[str, ...] = ("check",)) -> tuple[int, str]:
        path, text = shared_tmp_path / "case.toml", CASE
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        if MPI.COMM_WORLD.rank == 0:
            path.write_text(text, encoding="utf-8")
        MPI.COMM_WORLD.barrier()
        capsys.readouterr()
        status = main([command[0], str(path), *command[1:]])
        return status, str(MPI.COMM_WORLD.bcast(capsys.readouterr().err))

    return run


REFUSED = [
    (("0.29\nyield", "0,29\nyield"), "write a decimal point, 0.29 for 0,29"),
    (('builder = "two_blocks"\nn = 2', 'file = "C:\\models\\block.msh"'), "C:/models/block.msh"),
    (('builder = "two_blocks"\nn = 2', 'file = "C:\\temp\\new.msh"'), "\\ is an escape"),
    (('builder = "two_blocks"\nn = 2', "file = 'parts\\new.msh'"), "write / for \\"),
    (('"top"', '"upper"'), "but a surface is needed here; known surfaces: left"),
    (("material.upper", "material.top"), "'top' is a surface of this mesh"),
    (('components = "xyz"', 'components = "yz"'), "the body 'lower' (translation in x"),
]


@pytest.mark.parametrize(("change", "says"), REFUSED)
def test_refused_with_the_remedy(told: Told, change: tuple[str, str], says: str) -> None:
    status, complaint = told(change)
    assert status == 2
    assert says in complaint
    assert complaint.count("\n") == 1


SI = (('system = "mm-N-MPa"', 'system = "SI"'), ("206900.0", "900.0"), ("450.0", "1.0"))

ODD = [
    ((("young = 206900.0", "young = 206.9e9"),), "'lower': young = 2.069e+11 MPa is 2.07e+08 GPa"),
    ((("yield_stress = 450.0", "yield_stress = 450e6"),), "yield_stress / young = 2.17e+03"),
    (SI, "young = 900 Pa is 9e-07 GPa"),
    ((('builder = "two_blocks"\nn = 2', 'file = "large.msh"'),), "the mesh is 2e+20 mm large"),
    ((('builder = "two_blocks"\nn = 2', 'file = "tiny.msh"'),), "the mesh is 2e-12 mm large"),
]


@pytest.mark.parametrize(("changes", "says"), ODD)
def test_odd_numbers_are_told(
    told: Told, shared_tmp_path: Path, changes: tuple[tuple[str, str], ...], says: str
) -> None:
    if MPI.COMM_WORLD.rank == 0:
        mesh = blocks(3)
        for name, scale in (("large", 1e20), ("tiny", 1e-12)):
            scaled = replace(mesh, points=scale * mesh.points)
            scaled.write(shared_tmp_path / f"{name}.msh")
    if "file" in changes[0][1]:
        names = (("lower]", "a]"), ("upper]", "b]"), ('"left"', '"low"'), ('"top"', '"high"'))
        pairs = (('"upper_bottom"', '"seam_a"'), ('"lower_top"', '"seam_b"'))
        changes = (*changes, *names, *pairs, ("[[contact]]", "[[tie]]"))
    status, complaint = told(*changes)
    assert status == 0, complaint
    assert says in complaint


def test_nothing_is_said_of_usual_numbers(told: Told) -> None:
    assert told() == (0, "")


def test_a_mark_in_front(tmp_path: Path) -> None:
    """Windows' Notepad writes a byte order mark."""
    path = tmp_path / "case.toml"
    path.write_text(CASE, encoding="utf-8-sig")
    assert parse(read_text(path), "case.toml")["title"] == "a cube"


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("a.inp", "with perfplast mesh"),
        ("a.vtu", "with perfplast mesh"),
        ("a.exo", "shows under 'Other formats'"),
        ("a.step", "[geometry] instead of [mesh]"),
    ],
)
def test_other_formats(told: Told, shared_tmp_path: Path, name: str, says: str) -> None:
    if MPI.COMM_WORLD.rank == 0:
        (shared_tmp_path / name).write_text("*NODE\n1, 0, 0, 0\n")
    MPI.COMM_WORLD.barrier()
    status, complaint = told(('builder = "two_blocks"\nn = 2', f'file = "{name}"'))
    assert status == 2
    assert says in complaint


def test_long_formulas_are_cut() -> None:
    with pytest.raises(InputError) as refusal:
        check("+".join(["x"] * 400) + "+ q", "here")
    assert len(str(refusal.value)) < 500 + SHOWN
    assert "has the name 'q'" in str(refusal.value)


def test_restart_with_more_levels(told: Told, shared_tmp_path: Path) -> None:
    """The run continues; a message names a changed earlier level, and missing fields."""
    results = str(shared_tmp_path / "results")
    quiet = (("[element]", "[output]\npictures = false\n\n[element]"),)
    assert told(*quiet, command=("run", "-o", results, "--quiet")) == (0, "")
    again = ("run", "--restart", results, "--quiet")
    more = ("[10.0, 20.0]", "[10.0, 20.0, 30.0]")
    assert told(*quiet, more, command=again) == (0, "")
    rows = (shared_tmp_path / "results" / "path.csv").read_text().splitlines()
    assert [row.split(",")[1] for row in rows[1:]] == ["10.0", "20.0", "30.0"]
    status, complaint = told(*quiet, ("[10.0, 20.0]", "[10.0, 25.0, 30.0]"), command=again)
    assert status == 2
    assert "loading.values: entry 2 is 25.0, but was 20.0" in complaint
    status, complaint = told(*quiet, command=again)
    assert status == 2
    assert "loading.values has 2 entries, but had 3" in complaint
    if MPI.COMM_WORLD.rank == 0:
        (shared_tmp_path / "results" / "fields" / "level_0002.vtkhdf").unlink()
    status, complaint = told(*quiet, more, command=again)
    assert status == 0
    assert "fields of 1 of the 3 solved levels" in complaint
    status, complaint = told(*quiet, command=("run", "--restart", f"{results}_01"))
    assert status == 2
    assert "results_01' does not exist" in complaint
