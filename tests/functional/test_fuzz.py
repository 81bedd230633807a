"""Test broken input systematically: one sentence on every rank, or a valid result.

No input may cause a traceback, a hang, different outcomes on different ranks, or a level that
wrongly counts as converged. ``PERFPLAST_FUZZ=20`` tries twenty times as many inputs.
"""

import copy
import json
import math
import os
import random
import signal
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from meshes.wedge import write_wedge
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.errors import LONGEST_MESSAGE, InputError
from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.io.case.schema import LARGEST_FILE, parse
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.mesh.tagged_mesh import read_gmsh
from perfplast_fenicsx.solvers.load_stepping import load_path

EFFORT = float(os.environ.get("PERFPLAST_FUZZ", "1"))

HANGS = 300
"""Time (s) after which an attempt counts as a hang."""

pytestmark = [
    pytest.mark.filterwarnings("error::RuntimeWarning"),  # NumPy would print these warnings
    pytest.mark.timeout(600 * max(1, EFFORT)),
]

BASE: dict[str, Any] = {
    "title": "Two blocks",
    "mesh": {"builder": "stacked_blocks", "n": 1, "heights": [1.0, 1.0]},
    "material": {
        "upper": {"law": "von-mises", "young": 2e5, "poisson": 0.3, "yield_stress": 450.0},
        "lower": {"law": "elastic", "young": 2e5, "poisson": 0.3},
    },
    "support": [
        {"on": "bottom", "components": "xyz"},
        {"on": "x0", "components": "x"},
        {"on": "y0", "components": "y"},
    ],
    "load": [{"on": "top", "pressure": 1.0}, {"on": "upper", "body_force": [0.0, 0.0, -1.0]}],
    "contact": [{"primary": "upper_bottom", "secondary": "lower_top", "gap": "0*x"}],
    "obstacle": [
        {"on": "x0", "shape": "plane", "point": [-1.0, 0, 0], "normal": [1.0, 0, 0]},
        {"on": "y0", "shape": "sphere", "centre": [0.5, -9.0, 0.5], "radius": 1.0, "hollow": False},
    ],
    "element": {"degree": 1},
    "solve": {
        "method": "newton",
        "regularisation": 1e-3,
        "damping": True,
        "stopping": "displacement",
        "tolerance": 1e-8,
        "active_set": "adaptive",
        "max_iterations": 20,
    },
    "loading": {"control": "load", "values": [20.0, 40.0]},
    "output": {"fields": False, "pictures": False},
    "units": {"length": "mm", "stress": "MPa"},
}

HOSTILE: list[Any] = [
    *(0, -1, 1, 7, -0.0, 5e-324, 1e-300, 1e-31, 1e31, 1e308, -1e308, 10**9, 2**31, 2**63, 10**400),
    *(
        math.nan,
        math.inf,
        -math.inf,
        True,
        [],
        {},
        [[]],
        [math.nan],
        [1e308, 1, 1],
        [1, 2],
        "",
        " ",
    ),
    *("x", "top", "bottom", "upper", "newton", "a\nb", "a\0b", "\x1b[2J", "é" * 30, "x" * 5000),
    *("../../../../etc/passwd", "/dev/zero", "/dev/stdin", "$\\frac", "%s", "{}", "\u202e"),
    *("9**9**9**9", "(" * 400 + "x" + ")" * 400, "-" * 900 + "x", "where(x, 1, 2)", "sin()", "1/0"),
    *(
        "x.__class__",
        "__import__('os')",
        "lambda: x",
        "1e999",
        "x\0",
        "x" + "**x" * 300,
        "-1",
        "x&y",
    ),
]

FORMULAS = st.text(alphabet="xyz()+-*/%<>=&|.,19e _[]{}'\"\\\0\nsincoπ^~@:", max_size=40)


def toml(value: Any) -> str:
    """Return a value as TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {toml(value[key])}" for key in value) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, int) and abs(value) > 2**63:
        return hex(value)
    return repr(value)


def document(table: dict[str, Any]) -> str:
    return "".join(f"{json.dumps(key)} = {toml(table[key])}\n" for key in table)


def places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every container in a value, with each of its keys."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in list(items):
        yield value, key
        if isinstance(item, dict | list):
            yield from places(item)


@st.composite
def broken_cases(draw: st.DrawFn, most: int = 3) -> str:
    """Return a case with one or several faults."""
    table = copy.deepcopy(BASE)
    for _ in range(draw(st.integers(1, most))):
        container, key = draw(st.sampled_from(list(places(table))))
        kind = draw(st.sampled_from(["drop", "rename", "hostile", "hostile", "nest", "formula"]))
        if kind == "drop":
            del container[key]
        elif kind == "rename" and isinstance(container, dict):
            word = draw(st.one_of(st.just(f"{key}e"), st.just(str(key)[1:]), st.text(max_size=6)))
            container[word] = container.pop(key)
        elif kind == "nest":
            container[key] = [container[key]] if draw(st.booleans()) else {"x": container[key]}
        elif kind == "formula":
            container[key] = draw(FORMULAS)
        else:
            container[key] = copy.deepcopy(draw(st.sampled_from(HOSTILE)))  # the lists may change
        if not table:
            break
    return document(table)


def fuzz(number: int) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Use the same examples on every rank and in every run."""
    return settings(
        max_examples=max(1, int(number * EFFORT)),
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )


class Hang(BaseException):
    """An exception that the library must not catch."""


def outcome(comm: MPI.Intracomm, attempt: Callable[[], str]) -> str:
    """Return the outcome of an attempt, the same on every rank: "refused", or its result."""

    def late(*_: object) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(HANGS)
    try:
        result, text = attempt(), ""
    except InputError as error:
        result, text = "refused", str(error)
        assert text.isprintable()
        assert len(text) <= LONGEST_MESSAGE + 200
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    found = comm.allgather((result, text))
    assert len(set(found)) == 1, found
    return result


class Tally:
    """Count outcomes, and print the counts."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self.capsys, self.counts = capsys, Counter[str]()

    def show(self, what: str) -> None:
        with self.capsys.disabled():
            if MPI.COMM_WORLD.rank == 0:
                found = ", ".join(f"{count} {name}" for name, count in self.counts.most_common())
                print(f"\n{self.counts.total()} {what}: {found}", flush=True)


@pytest.fixture
def tally(capsys: pytest.CaptureFixture[str]) -> Tally:
    return Tally(capsys)


def put(comm: MPI.Intracomm, path: Path, content: bytes) -> Path:
    if comm.rank == 0:
        path.write_bytes(content)
    comm.barrier()
    return path


def test_the_base_is_fine(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    path = put(comm, shared_tmp_path / "case.toml", document(BASE).encode())
    assert solved(comm, path) == "solved"


@pytest.mark.mpi2
def test_case_files(comm: MPI.Intracomm, shared_tmp_path: Path, tally: Tally) -> None:
    """Wrong keys, types and values; the program refuses most of them without a mesh."""

    @fuzz(300 if comm.size == 1 else 75)
    @given(broken_cases())
    def attempt(text: str) -> None:
        path = put(comm, shared_tmp_path / "case.toml", text.encode())
        tally.counts[outcome(comm, lambda: repr(type(read_case(path, comm)).__name__))] += 1

    attempt()
    tally.show("broken case files read")
    assert tally.counts["refused"] > tally.counts.total() / 2


@pytest.mark.mpi2
def test_broken_text(comm: MPI.Intracomm, shared_tmp_path: Path, tally: Tally) -> None:
    """Return text in which bytes are changed, cut, repeated or inserted."""
    whole = document(BASE).encode()

    @fuzz(125 if comm.size == 1 else 40)
    @given(st.integers(0, len(whole)), st.integers(0, 60), st.binary(max_size=12))
    def attempt(start: int, length: int, instead: bytes) -> None:
        content = whole[:start] + instead + whole[start + length :]
        path = put(comm, shared_tmp_path / "case.toml", content)
        tally.counts[outcome(comm, lambda: repr(type(read_case(path, comm)).__name__))] += 1

    attempt()
    tally.show("case files with broken text read")
    assert tally.counts["refused"] > tally.counts.total() / 2


def solved(comm: MPI.Intracomm, path: Path) -> str:
    """Solve a case; a level that counts as converged must have a certificate."""
    case = read_case(path, comm)
    solver = case.solver(case.problem(comm))
    if case.loading.values is None:
        return "read"
    for level in load_path(solver, case.loading.values[:3]):
        report = level.report
        if not report.converged:
            return "no solution"
        assert math.isfinite(report.max_displacement)
        assert abs(report.duality_gap) < 1e-3, report
        assert report.equilibrium < 1e-3, report
        assert report.zeta == 0 or report.max_displacement > 0, report
    return "solved"


@st.composite
def broken_values(draw: st.DrawFn) -> str:
    """Return a case with one value that only a mesh or the solution can reject."""
    table = copy.deepcopy(BASE)
    numbers = [
        (container, key)
        for container, key in places(table)
        if isinstance(container[key], float | int | str) and key not in ("n", "title", "method")
    ]
    container, key = draw(st.sampled_from(numbers))
    extremes = st.sampled_from([1e-30, 1e-20, 1e-9, 1e9, 1e20, 1e30, -1e30, -1.0, 0.0, 0.4999999])
    if isinstance(container[key], str):
        container[key] = draw(st.sampled_from([text for text in HOSTILE if isinstance(text, str)]))
    else:
        container[key] = draw(extremes)
    return document(table)


def test_extreme_values_are_solved_or_refused(
    comm: MPI.Intracomm, shared_tmp_path: Path, tally: Tally
) -> None:
    @fuzz(20 if comm.size == 1 else 6)
    @given(broken_values())
    def attempt(text: str) -> None:
        path = put(comm, shared_tmp_path / "case.toml", text.encode())
        tally.counts[outcome(comm, lambda: solved(comm, path))] += 1

    attempt()
    tally.show("cases with extreme values set up and solved")
    assert tally.counts["refused"] > 0
    assert tally.counts["solved"] > 0


def broken_mesh(lines: list[str], lot: random.Random) -> bytes:
    """Return a .msh file with one or several faults."""
    lines = list(lines)
    words = [
        "nan",
        "inf",
        "1e308",
        "-1",
        "0",
        "3",
        "999999999",
        "4294967297",
        "x",
        "",
        '"',
        "1e-320",
    ]
    for _ in range(lot.choice([1, 1, 2, 5])):
        at, other = lot.randrange(len(lines)), lot.randrange(len(lines))
        kind = lot.randrange(8)
        if kind == 0:
            lines = lines[: max(1, at)]
        elif kind == 1:
            lines[at : at + 1] = []
        elif kind == 2:
            lines[at], lines[other] = lines[other], lines[at]
        elif kind == 3:
            lines.insert(at, lines[other])
        elif kind < 7:
            parts = lines[at].split(" ")
            parts[lot.randrange(len(parts))] = lot.choice(words)
            lines[at] = " ".join(parts)
        else:
            garbage = "".join(chr(lot.randrange(256)) for _ in range(4))
            lines[at] = lines[at][: lot.randrange(len(lines[at]) + 1)] + garbage
    return "\n".join(lines).encode("latin1")


def test_mesh_files(comm: MPI.Intracomm, shared_tmp_path: Path, tally: Tally) -> None:
    path = shared_tmp_path / "mesh.msh"
    if comm.rank == 0:
        write_wedge(path, size=2, order=1)
    comm.barrier()
    lines = path.read_text(encoding="utf-8").split("\n")
    comm.barrier()
    lot = random.Random(2)
    for _ in range(max(1, int((8 if comm.size == 1 else 3) * EFFORT))):
        put(comm, path, broken_mesh(lines, lot))
        tally.counts[outcome(comm, lambda: repr(type(read_gmsh(comm, path)).__name__))] += 1
    tally.show("broken mesh files read")
    assert tally.counts["refused"] > tally.counts.total() / 2


WEDGE = {"2 5 0 0": "2 5 0 3", "2 8 0 0": "2 8 0 2", '3 8 "upper"': '999999999 8 "upper"'}
"""Changes of a mesh file with which gmsh crashes or runs without end."""


@pytest.mark.mpi2("2 5 0 0-2 5 0 3-gmsh cannot read")
@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        *((old, new, "gmsh cannot read") for old, new in WEDGE.items()),
        ("1 0.5 0\n", "nan 0.5 0\n", "such as (nan, 0.5, 0)"),
        ("1 0.5 0\n", "1e300 0.5 0\n", "such as (1e+300, 0.5, 0)"),
        ("1.5 0.5 1.125\n", "1 0 1\n", "are degenerate"),
    ],
)
def test_mesh_faults(
    old: str, new: str, part: str, comm: MPI.Intracomm, shared_tmp_path: Path
) -> None:
    path = shared_tmp_path / "mesh.msh"
    if comm.rank == 0:
        write_wedge(path, size=2, order=1)
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new, 1), encoding="utf-8")
    comm.barrier()
    with pytest.raises(InputError) as caught:
        read_gmsh(comm, path)
    assert part in comm.bcast(str(caught.value))


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("a = " + "[" * 5000, "nested too deeply"),
        ("a = " + "9" * 5000, "not valid TOML: .*5000 digits"),
        ("a = 2026-02-30", "not valid TOML"),
        ("a = '", "not valid TOML"),
        ("a = 1" + "0" * 30, "a = .* has 100 bits"),
        ("a = [{b = 0x" + "f" * 50_000 + "}]", "b = .* has 200000 bits"),
    ],
    ids=range(6),
)
def test_hostile_toml(text: str, part: str) -> None:
    with pytest.raises(InputError, match=part):
        parse(text, "case.toml")


def test_large_files(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    path = put(comm, shared_tmp_path / "large.toml", b"#" * LARGEST_FILE + b"\n")
    with pytest.raises(InputError, match="has more than 1000000 bytes"):
        read_case(path, comm)


@pytest.mark.parametrize("name", ["two_blocks", "punch", "l_plate", "stacked_blocks"])
def test_meshes_too_large_for_memory(name: str, comm: MPI.Intracomm) -> None:
    for n in (10**4, 10**9, 2**62):
        with pytest.raises(InputError, match="tetrahedra need more than the"):
            build(comm, name, n=n)


NAMES = [
    "/dev/zero",
    "/dev/null",
    "",
    ".",
    "\0",
    "a\nb",
    "x" * 5000,
    "../" * 2000,
    "é\u202e",
    "\udc80",
]


def refuse(comm: MPI.Intracomm, arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Check that a command is invalid input, reported in one sentence by one rank."""

    def attempt() -> str:
        assert main(arguments) == BAD_INPUT, arguments
        return "refused"

    outcome(comm, attempt)
    error = capsys.readouterr().err
    if comm.rank == 0:
        assert error.startswith("perfplast: ")
        assert error.endswith("\n")
        assert error.count("\n") == 1
        assert error[:-1].isprintable()
    else:
        assert error == ""


@pytest.mark.parametrize("command", ["check", "run", "mesh"])
def test_path_names(
    command: str,
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Names of missing files, devices and FIFOs, as arguments and as mesh files."""
    monkeypatch.chdir(shared_tmp_path)
    if comm.rank == 0:
        os.mkfifo("fifo")
        Path("loop").symlink_to("loop")
    comm.barrier()
    for name in [*NAMES, "fifo", "loop"]:
        arguments = [command, name]
        if command == "mesh":
            if "\udc80" in name:
                continue
            table = BASE | {"mesh": {"file": name}}
            path = put(comm, shared_tmp_path / "case.toml", document(table).encode())
            arguments = ["check", str(path)]
        elif command == "run":
            arguments += ["-o", "results"]

        refuse(comm, arguments, capsys)
    assert not (shared_tmp_path / "results").exists()


def test_output_folders(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One rank refuses in one sentence a path that cannot be a folder."""
    monkeypatch.chdir(shared_tmp_path)
    case = put(comm, shared_tmp_path / "case.toml", document(BASE).encode())
    if comm.rank == 0:
        Path("file").touch()
        Path("loop").symlink_to("loop")
        Path("dangling").symlink_to("/nowhere/at/all")
        os.mkfifo("fifo")
    comm.barrier()
    names = ["file", "file/below", "loop", "dangling", "fifo", "/dev/null", "/proc/1/x", "x" * 300]
    for name in names:
        refuse(comm, ["run", str(case), "-o", name], capsys)


def test_result_folders(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    tally: Tally,
) -> None:
    """A restart from a damaged checkpoint uses the previous checkpoint, or is refused."""
    case = put(comm, shared_tmp_path / "case.toml", document(BASE).encode())
    results = shared_tmp_path / "results"
    assert main(["run", str(case), "-o", str(results)]) == SOLVED
    whole = {path: path.read_bytes() for path in sorted(results.glob("checkpoint*.h5"))}
    assert len(whole) == 2
    comm.barrier()
    lot = random.Random(3)
    for _ in range(max(1, int((8 if comm.size == 1 else 5) * EFFORT))):
        damaged = {path: content for path, content in whole.items() if lot.random() < 0.7}
        for path, content in whole.items():
            put(comm, path, damage(content, lot) if path in damaged else content)

        def attempt() -> str:
            status = main(["run", str(case), "--restart", str(results)])
            if status == BAD_INPUT:
                return "refused"
            assert status == SOLVED
            return "solved"

        tally.counts[outcome(comm, attempt)] += 1
        error = capsys.readouterr().err
        if comm.rank == 0:
            assert "Traceback" not in error
        summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
        assert all(abs(step["duality_gap"]) < 1e-3 for step in summary["steps"])
        comm.barrier()
    tally.show("damaged result folders gone on from")
    assert len(tally.counts) == 2


def damage(content: bytes, lot: random.Random) -> bytes:
    """Return a file that is cut, or in which some bytes are changed."""
    if lot.random() < 0.3:
        return content[: lot.randrange(len(content))]
    changed = bytearray(content)
    for _ in range(lot.choice([1, 3, 30])):
        changed[lot.randrange(len(changed))] = lot.randrange(256)
    return bytes(changed)
