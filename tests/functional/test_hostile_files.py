"""Test that a case from an unknown source is data: nothing runs, nothing is written elsewhere."""

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.geometry import MeshingOptions
from perfplast_fenicsx.geometry.kept_mesh import END, MARK, _fingerprint

TOUCH = 'SystemCall "touch PWNED";\n'
"""Text with which a gmsh script runs a command."""

SOLID = """SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 1, 1};
"""

CASE = """
title = "from the mail"
{source}

[material.block]
law = "elastic"
young = 200e3
poisson = 0.3

[[support]]
on = "low"
components = "xyz"

[[load]]
on = "high"
traction = [0.0, 0.0, 1.0]

[element]
degree = 1

[loading]
control = "load"
values = [1.0]

[output]
pictures = false
"""


def mesh_file(body: str = "block", surface: str = "low") -> str:
    """Return a cube of six tetrahedra in gmsh's format 2.2."""
    corners = [(i & 1, i >> 1 & 1, i >> 2) for i in range(8)]
    paths = [(1, 3), (1, 5), (2, 3), (2, 6), (4, 5), (4, 6)]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "3"]
    lines += [f'3 1 "{body}"', f'2 2 "{surface}"', '2 3 "high"', "$EndPhysicalNames"]
    lines += ["$Nodes", "8", *(f"{n} {x} {y} {z}" for n, (x, y, z) in enumerate(corners, 1))]
    lines += ["$EndNodes", "$Elements", "10"]
    triangles = [(2, 0, 1, 3), (2, 0, 2, 3), (3, 4, 5, 7), (3, 4, 6, 7)]
    for number, (tag, *nodes) in enumerate(triangles, 1):
        lines.append(f"{number} 2 2 {tag} {tag} " + " ".join(str(n + 1) for n in nodes))
    for number, (one, two) in enumerate(paths, 5):
        lines.append(f"{number} 4 2 1 1 1 {one + 1} {two + 1} 8")
    return "\n".join([*lines, "$EndElements", ""])


MESH = mesh_file()

FORMULA = """
[[initial_stress]]
on = "block"
stress = ["{}", 0.0, 0.0, 0.0, 0.0, 0.0]
"""

FORMULAS = (
    "__import__('os').system('touch PWNED')",
    "().__class__.__base__.__subclasses__()",
    "open('PWNED', 'w')",
    "eval('1')",
    "exec('import os')",
    "x.__class__",
    "x.tofile('PWNED')",
    "globals()['x']",
    "[c for c in (1, 2)][0]",
    "(lambda: 1)()",
    "(x := 1)",
    "f'{x}'",
    "9**9**9**9**9",
    "np.save('PWNED', x)",
)

STAGE = """
[[stage]]
name = "=HYPERLINK(2)"
steps = 1
factors = {high = 1.0}
"""

STEP_LIKE = "// ISO-10303-21;\n"
IGES_LIKE = f"{'//':72}S      1\n"


@dataclass(frozen=True)
class Hostile:
    """A file from an unknown source.

    Attributes:
        name: Name of the mesh or geometry file.
        content: Its content.
        says: Words of the refusal; empty if the file is harmless.
        beside: Other files, by name.
        table: Table of the case that names the file.
        more: Further lines of the table.
    """

    name: str
    content: str
    says: str = ""
    beside: dict[str, str] = field(default_factory=dict)
    table: str = "geometry"
    more: str = ""


SCRIPT = "is a script, through which gmsh"
NOT_RUN = "is a program, which perfplast never runs"
NO_MESH = "is not a gmsh .msh file"

HOSTILE = {
    "SystemCall": Hostile("a.geo", TOUCH + SOLID, SCRIPT),
    "upper case": Hostile("a.GEO", TOUCH + SOLID, SCRIPT),
    "unrolled": Hostile("a.geo_unrolled", TOUCH + SOLID, SCRIPT),
    "NonBlocking": Hostile("a.geo", "NonBlocking" + TOUCH + SOLID, SCRIPT),
    "Include": Hostile("a.geo", 'Include "b.geo";\n' + SOLID, SCRIPT, {"b.geo": TOUCH}),
    "Merge": Hostile("a.geo", 'Merge "b.opt";\n' + SOLID, SCRIPT, {"b.opt": TOUCH}),
    "Save": Hostile("a.geo", SOLID + 'Save "PWNED.msh";\n', SCRIPT),
    "Print": Hostile("a.geo", SOLID + 'Mesh 2;\nPrint "PWNED.msh";\n', SCRIPT),
    "Printf": Hostile("a.geo", SOLID + 'Printf("x") > "PWNED";\n', SCRIPT),
    "OnelabRun": Hostile("a.geo", SOLID + 'OnelabRun("x", "touch PWNED");\n', SCRIPT),
    "Plugin": Hostile("a.geo", SOLID + "Plugin(NewView).Run;\nSave View[0] 'PWNED';\n", SCRIPT),
    "options": Hostile("a.geo", SOLID, SCRIPT, {"a.geo.opt": TOUCH}),
    "Python": Hostile("a.py", "open('PWNED', 'w')\n", NOT_RUN),
    "shell": Hostile("a.sh", "touch PWNED\n", NOT_RUN),
    "as STEP": Hostile("a.step", TOUCH + SOLID, "is not in STEP format"),
    "in STEP": Hostile("a.step", STEP_LIKE + TOUCH + SOLID, "cannot be read"),
    "STEP's options": Hostile(
        "a.stp", STEP_LIKE, "cannot be read", {"a.stp.opt": TOUCH, "a.opt": TOUCH}
    ),
    "as BREP": Hostile("a.brep", TOUCH + SOLID, "is not in BREP format"),
    "in BREP": Hostile("a.brep", "// CASCADE Topology\n" + TOUCH + SOLID, "a.brep'"),
    "as IGES": Hostile("a.iges", TOUCH + SOLID, "is not in IGES format"),
    "in IGES": Hostile("a.igs", IGES_LIKE + TOUCH + SOLID, "a.igs'"),
    "as STL": Hostile("a.stl", TOUCH + SOLID, "suffix of a geometry file"),
    "as options": Hostile("a.opt", TOUCH + SOLID, "suffix of a geometry file"),
    "its own trust": Hostile("a.geo", TOUCH + SOLID, "no key 'trust'", more="trust = true"),
    "as mesh": Hostile("a.msh", TOUCH + SOLID, NO_MESH, table="mesh"),
    "script for mesh": Hostile("a.geo", TOUCH + SOLID, NO_MESH, table="mesh"),
    "view for mesh": Hostile("a.pos", TOUCH + SOLID, NO_MESH, table="mesh"),
    "behind a head": Hostile("a.msh", "$MeshFormat\n" + TOUCH, "cannot read", table="mesh"),
    "behind comments": Hostile(
        "a.msh", "$Comments\n$EndComments\n" + TOUCH, "cannot read", table="mesh"
    ),
    "behind a mesh": Hostile("a.msh", MESH + TOUCH, table="mesh"),
    "mesh's options": Hostile(
        "a.msh", MESH, "", {"a.msh.opt": TOUCH, "a.opt": TOUCH}, table="mesh"
    ),
    "settings": Hostile(
        "a.msh", MESH, "", {name: TOUCH for name in (".gmshrc", ".gmsh-options")}, table="mesh"
    ),
    "mesh as program": Hostile("a.exe", "$MeshFormat; touch PWNED\n", "", table="mesh"),
    "mesh as Python": Hostile("a.py", MESH, table="mesh"),
    "name as command": Hostile("x;touch PWNED;.msh.gz", "\x1f\x8b", NO_MESH, table="mesh"),
    "names as commands": Hostile(
        "a.msh",
        mesh_file("$(touch PWNED)", "`touch PWNED`"),
        "volumes: $(touch PWNED)",
        table="mesh",
    ),
    "one more key": Hostile("a.msh", MESH, "no key 'run'", table="mesh", more="run = 'b.sh'"),
    "include": Hostile("a.msh", MESH, "no key 'include'", table="mesh", more="include = 'b.toml'"),
    "plugin": Hostile("a.msh", MESH, "no key 'plugin'", table="mesh", more="[plugin]\nx = 'b.py'"),
    "output elsewhere": Hostile(
        "a.msh", MESH, "no key 'folder'", table="mesh", more="[output]\nfolder = '../PWNED'"
    ),
    "law as program": Hostile(
        "a.msh",
        MESH,
        "'os.system' is unknown",
        table="mesh",
        more="[material.x]\nlaw = 'os.system'",
    ),
    "prototype": Hostile(
        "a.msh", MESH, "no key '__class__'", table="mesh", more="[__class__]\nx = 1"
    ),
    "nested": Hostile("a.msh", MESH, "nested too deeply", table="mesh", more="x = " + "[" * 9999),
    "long number": Hostile("a.msh", MESH, "case.toml", table="mesh", more=f"x = {'9' * 9999}"),
    "no text": Hostile("a.msh", MESH, "case.toml", table="mesh", more="x = '\x00\x1b[2J'"),
} | {
    f"formula {n}": Hostile("a.msh", MESH, "the formula", table="mesh", more=FORMULA.format(text))
    for n, text in enumerate(FORMULAS)
}


def files_below(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


@pytest.fixture
def mail(shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[Hostile], Path]:
    """Unpack a file into a folder, which is working directory and home; return the case."""

    def unpack(hostile: Hostile) -> Path:
        path = shared_tmp_path / "case.toml"
        if MPI.COMM_WORLD.rank == 0:
            for name, content in {hostile.name: hostile.content, **hostile.beside}.items():
                (shared_tmp_path / name).write_text(content, encoding="latin-1")
            source = f"[{hostile.table}]\nfile = '{hostile.name}'\n{hostile.more}"
            text = CASE.format(source=source)
            if "[output]" in hostile.more:  # a table may occur once
                text = text.split("\n[output]\npictures")[0]
            path.write_text(text, encoding="utf-8")
        MPI.COMM_WORLD.barrier()
        monkeypatch.chdir(shared_tmp_path)
        monkeypatch.setenv("HOME", str(shared_tmp_path))
        return path

    return unpack


@pytest.mark.long(
    but=[
        "SystemCall",
        "upper case",
        "unrolled",
        "NonBlocking",
        "Include",
        "Merge",
        "Save",
        "Print",
        "Printf",
        "OnelabRun",
        "Plugin",
        "options",
        "Python",
        "shell",
        "as STEP",
        "in STEP",
        "STEP's options",
        "as BREP",
        "in BREP",
        "as IGES",
        "in IGES",
        "as STL",
        "as options",
        "its own trust",
        "as mesh",
        "script for mesh",
        "view for mesh",
        "behind a head",
        "behind comments",
        "behind a mesh",
        "mesh's options",
        "settings",
        "mesh as program",
        "mesh as Python",
        "name as command",
        "names as commands",
        "one more key",
        "include",
        "plugin",
        "output elsewhere",
        "law as program",
        "prototype",
        "nested",
        "long number",
        "no text",
        "formula 0",
        "formula 1",
        "formula 2",
        "formula 13",
    ]
)
@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("hostile", HOSTILE.values(), ids=HOSTILE)
def test_nothing_is_run(
    hostile: Hostile, mail: Callable[[Hostile], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """``check``, ``info``, ``run`` and ``mesh`` run nothing: they print one sentence."""
    case = mail(hostile)
    before = files_below(case.parent)
    commands = [["check", str(case)]]
    if hostile.says:
        commands.append(["run", str(case), "-o", "out"])
    if hostile.table == "geometry":
        commands.append(["info", str(case)])
        if not hostile.more:
            commands.append(["mesh", hostile.name, "-o", "out"])
    for command in commands:
        status = main(command)
        told = MPI.COMM_WORLD.bcast(capsys.readouterr().err)
        assert files_below(case.parent) == before
        if hostile.says:
            assert status == 2
            assert hostile.says in told
            assert told.count("\n") == 1
        MPI.COMM_WORLD.barrier()


@pytest.mark.long
def test_names_are_text(
    mail: Callable[[Hostile], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """The page escapes names, and no cell of the table begins like a formula."""
    sheet, html = "=HYPERLINK(1)", "<img src=x onerror=alert(1)>"
    case = mail(Hostile("a.msh", mesh_file(html, sheet), table="mesh"))
    if MPI.COMM_WORLD.rank == 0:
        text = case.read_text().replace('on = "low"', f'on = "{sheet}"')
        text = text.replace("material.block", f'material."{html}"')
        text = text.partition("[loading]")[0] + STAGE
        case.write_text(text.replace("from the mail", "../../PWNED </script><script>alert(1)"))
    MPI.COMM_WORLD.barrier()
    before = files_below(case.parent)
    assert main(["run", str(case), "-o", "out", "--report", "--quiet"]) == 0
    MPI.COMM_WORLD.barrier()
    written = files_below(case.parent) - before
    written = {name for name in written if not name.startswith(("out", "."))}  # no cache files
    assert written == set()
    page = Path("out/report.html").read_text(encoding="utf-8")
    assert "alert(1)" in page
    assert html not in page
    assert "<script>alert(1)" not in page
    cells = Path("out/path.csv").read_text(encoding="utf-8").replace("\n", ",").split(",")
    assert f"support_{sheet}_x" in cells
    assert "'=HYPERLINK(2)" in cells
    assert not [cell for cell in cells if cell.startswith(("=", "+", "@"))]


@pytest.mark.usefixtures("undrawn")
@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="one process reads, whatever the ranks")
def test_a_script_is_run_where_it_is_trusted(
    mail: Callable[[Hostile], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """The mesh is then stored, and needs no trust as long as nothing changes."""
    case = mail(Hostile("a.geo", TOUCH + SOLID))
    text = case.read_text().replace('"low"', '"part_z_low"').replace('"high"', '"part_z_high"')
    case.write_text(text.replace("material.block", "material.part"))
    assert main(["check", str(case)]) == 2
    assert not Path("PWNED").exists()
    assert main(["check", str(case), "--trust"]) == 0
    assert Path("PWNED").exists()  # else the table above proves nothing
    Path("PWNED").unlink()
    assert main(["check", str(case)]) == 0
    assert not Path("PWNED").exists()
    Path("a.geo").write_text(TOUCH + SOLID + "//")
    assert main(["check", str(case)]) == 2
    assert main(["mesh", "a.geo", "-o", "made", "--trust"]) == 0
    assert Path("PWNED").exists()
    assert "give --trust" in capsys.readouterr().err


@pytest.mark.usefixtures("undrawn")
@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="one process reads, whatever the ranks")
def test_a_mesh_that_says_what_it_was_made_of(mail: Callable[[Hostile], Path]) -> None:
    """Anybody can write this text; the mesh remains data, and the script does not run."""
    case = mail(Hostile("a.geo", TOUCH + SOLID))
    mark = MARK + _fingerprint(Path("a.geo").read_bytes(), MeshingOptions()) + END
    case.with_suffix(".msh").write_bytes(MESH.encode() + mark)
    case.with_suffix(".msh.opt").write_text(TOUCH)
    assert main(["check", str(case)]) == 0
    assert not Path("PWNED").exists()


@pytest.mark.usefixtures("undrawn")
@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="one process writes, whatever the ranks")
def test_links_do_not_lead_out(
    tmp_path: Path, mail: Callable[[Hostile], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """If links replace output files, the files to which they lead remain unchanged."""
    victim = tmp_path.parent / f"{tmp_path.name}_victim"
    victim.write_text("mine")
    case = mail(Hostile("a.msh", MESH, table="mesh"))
    os.symlink(victim, "case.msh.part")
    text = case.read_text().replace('"low"', '"part_z_low"').replace('"high"', '"part_z_high"')
    text = text.replace("material.block", "material.part").replace("a.msh", "a.geo")
    Path("made.toml").write_text(text.replace("[mesh]", "[geometry]"))
    Path("a.geo").write_text(SOLID)
    os.symlink(victim, "made.msh.part")
    assert main(["check", "made.toml", "--trust"]) == 0
    for name in ("run.log", "summary.json", "checkpoint.h5", "fields"):
        folder = Path(f"out_{name}")
        folder.mkdir()
        os.symlink(victim, folder / name)
        assert main(["run", str(case), "-o", str(folder), "--force"]) == 2
        assert f"'{name}' in" in capsys.readouterr().err.replace(f"{folder}/", "")
    assert victim.read_text() == "mine"
