"""Test imports between sub-packages: :data:`BELOW` lists the allowed ones."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

pytestmark = pytest.mark.serial

ROOT = Path(__file__).parents[1]
PACKAGE = "perfplast_fenicsx"

BELOW: dict[str, set[str]] = {
    "mesh": set(),
    "materials": set(),
    "contact.declared": set(),
    "contact.rows": {"contact.declared", "mesh"},
    "contact.surfaces": {"contact.declared", "mesh"},
    "contact.mortar": {"contact.declared", "contact.rows", "contact.surfaces", "mesh"},
    "contact.formulations": {
        *("contact.declared", "contact.mortar", "contact.rows", "contact.surfaces", "mesh")
    },
    "contact": set(),
    "problem.declared": {"contact", "materials", "mesh"},
    "problem.assembled": {"contact", "materials", "mesh", "problem.declared"},
    "problem": {"contact", "materials", "mesh", "problem.assembled", "problem.declared"},
    "problem.fields": {"contact", "materials", "problem", "problem.assembled"},
    "problem.history": {"problem", "problem.assembled", "problem.declared"},
    "problem.judged": {
        *("contact", "problem", "problem.assembled", "problem.declared", "problem.fields")
    },
    "solvers.linear": {"problem"},
    "solvers.active_set": {"contact", "problem", "solvers.linear"},
    "solvers.tfeti": {"contact", "problem", "solvers.linear", "solvers.active_set"},
    "solvers": {
        *("contact", "materials", "problem"),
        *("solvers.linear", "solvers.active_set", "solvers.tfeti"),
    },
    "limit_analysis.statements": {"materials", "problem"},
    "limit_analysis.conic": {"limit_analysis.statements", "solvers.linear"},
    "limit_analysis.discrete": {
        *("contact", "materials", "mesh", "problem", "solvers.linear"),
        *("limit_analysis.conic", "limit_analysis.statements"),
    },
    "limit_analysis.path": {"contact", "materials", "problem", "solvers"},
    "limit_analysis.facets": {"contact", "materials", "mesh", "problem"},
    "limit_analysis.stress": {
        *("mesh", "problem", "solvers.linear", "limit_analysis.conic", "limit_analysis.discrete"),
        *("limit_analysis.facets", "limit_analysis.statements"),
    },
    "limit_analysis.velocity": {
        *("mesh", "problem", "limit_analysis.conic", "limit_analysis.discrete"),
        *("limit_analysis.facets", "limit_analysis.statements"),
    },
    "limit_analysis.blocks": {
        *("contact", "mesh", "problem", "limit_analysis.discrete", "limit_analysis.facets"),
        "limit_analysis.statements",
    },
    "limit_analysis.shakedown": {
        *("materials", "mesh", "problem", "solvers.linear", "limit_analysis.conic"),
        *("limit_analysis.discrete", "limit_analysis.facets", "limit_analysis.statements"),
    },
    "limit_analysis.body": {
        *("contact", "materials", "mesh", "problem", "solvers.linear"),
        *("limit_analysis.blocks", "limit_analysis.conic", "limit_analysis.discrete"),
        *("limit_analysis.facets", "limit_analysis.statements", "limit_analysis.stress"),
        *("limit_analysis.velocity", "proof"),
    },
    "limit_analysis": {
        *("problem", "solvers", "limit_analysis.discrete", "limit_analysis.path"),
        "limit_analysis.statements",
    },
    "seepage": {"mesh", "solvers.linear"},
    "controls": {"contact", "limit_analysis", "problem", "solvers"},
    "io.case": {
        *("controls", "geometry", "mesh", "materials", "contact", "problem", "solvers"),
        *("limit_analysis", "seepage"),
    },
    "proof": set(),
    "io.results": {
        *("contact", "mesh", "materials", "problem", "limit_analysis", "solvers", "io.case"),
        *("proof", "seepage"),
    },
    "pictures": {"contact", "problem", "proof", "io.case", "io.results"},
    "report": {"pictures", "problem", "proof", "solvers", "io.case", "io.results"},
    "export": {"pictures", "proof", "report", "io.results"},
    "geometry": {"mesh", "materials"},
    "models": {"geometry", "materials", "proof"},
    "cli": {
        *("controls", "geometry", "models", "pictures", "report", "io.case", "io.results"),
        *("export", "limit_analysis", "solvers", "problem", "materials", "seepage"),
    },
}
"""For each room (sub-package), the rooms from which it may import, besides itself and the ground.
The ground consists of the modules in the package itself, which import from no room. A module
elsewhere that may import from a room may also import from its sub-folders."""

GROUND = ""


@cache
def tree(path: Path) -> ast.Module:
    """Return the syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


def imports(path: Path) -> Iterator[tuple[str, ...]]:
    """Yield what a file imports from the package, as parts of dotted names after its own."""
    for node in ast.walk(tree(path)):
        names = []
        if isinstance(node, ast.ImportFrom) and node.level == 0:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            first, *rest = name.split(".")
            if first == PACKAGE:
                yield tuple(rest)


def room(parts: tuple[str, ...]) -> str:
    """Return the room in which a dotted name lies."""
    return next((name for name in (".".join(parts[:2]), parts[0]) if name in BELOW), GROUND)


def modules() -> list[tuple[str, Path]]:
    """Return all modules with their rooms, except the module of the command."""
    found = []
    for path in sorted((ROOT / PACKAGE).rglob("*.py")):
        parts = path.relative_to(ROOT / PACKAGE).with_suffix("").parts
        if parts != ("__main__",):
            found.append((room(parts), path))
    return found


def below(home: str) -> set[str]:
    """Return all rooms from which a room may import."""
    found = set(BELOW.get(home, set()))
    for name in BELOW.get(home, set()):
        if name.split(".")[0] != home.split(".")[0]:
            found |= {inner for inner in BELOW if inner.startswith(f"{name}.")}
    return found


def test_arrows_between_rooms_run_one_way() -> None:
    wrong = [
        f"{path.relative_to(ROOT)} ({home or 'ground'}) imports {'.'.join(parts)}"
        for home, path in modules()
        for parts in imports(path)
        if room(parts) not in {GROUND, home} | below(home)
    ]
    assert not wrong, "\n".join(wrong)


def test_no_circle_of_rooms() -> None:
    left = set(BELOW)
    while left:
        free = [name for name in left if not below(name) & left]
        assert free, f"a circle among {', '.join(left)}"
        left -= set(free)


@cache
def depth(home: str) -> int:
    """Return the number of rooms in the longest chain of imports from a room downwards."""
    return 1 + max((depth(name) for name in below(home)), default=0)


def test_chains_of_rooms_have_at_most_22_rooms() -> None:
    deepest = max(BELOW, key=depth)
    assert depth(deepest) <= 22, f"{deepest} is {depth(deepest)} deep"


def test_every_folder_is_a_room() -> None:
    folders = {path.parent.relative_to(ROOT / PACKAGE).parts for _, path in modules()}
    assert {".".join(parts) for parts in folders if parts} == set(BELOW) | {"io"}


@pytest.mark.parametrize("path", sorted((ROOT / "demos").rglob("*.py")), ids=lambda p: p.stem)
def test_demos_import_no_deeper_than_rooms(path: Path) -> None:
    rooms = {name.split(".")[0] for name in BELOW}
    named = filter(None, imports(path))
    deeper = [".".join(parts) for parts in named if len(parts) > 1 + (parts[0] in rooms)]
    assert not deeper


def test_modules_have_at_most_600_lines() -> None:
    """A module contains one topic; 600 lines are the most that a reader can follow."""
    long = {
        str(path.relative_to(ROOT)): lines
        for _, path in modules()
        if (lines := len(path.read_text(encoding="utf-8").splitlines())) > 600
    }
    assert not long


KERNEL_SOURCES = {"body_stiffness.py:source", "condensed_stiffness.py:source"}
"""Functions that return the source of C kernels."""


def functions() -> Iterator[tuple[str, ast.FunctionDef]]:
    """Return all functions and methods of the package, each with its file and name."""
    for _, path in modules():
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.FunctionDef):
                yield f"{path.relative_to(ROOT / PACKAGE)}:{node.name}", node


def test_functions_have_at_most_8_parameters() -> None:
    many = set()
    for name, node in functions():
        arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        if len([one for one in arguments if one.arg not in {"self", "cls"}]) > 8:
            many.add(name)
    assert not many


def test_functions_have_at_most_80_lines() -> None:
    long = {
        name
        for name, node in functions()
        if (node.end_lineno or 0) - node.lineno >= 80 and name.split("/")[-1] not in KERNEL_SOURCES
    }
    assert not long


def test_no_public_name_is_that_of_a_module() -> None:
    """The first import of the module would replace the name."""
    for names in (ROOT / PACKAGE).rglob("__init__.pyi"):
        modules = {path.stem for path in names.parent.iterdir()}
        public = {
            alias.asname
            for node in ast.walk(tree(names))
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }
        assert not public & modules


def test_public_names_exist() -> None:
    """Each name of a stub is defined or imported in the module that the stub names."""
    missing = []
    for stub in sorted((ROOT / PACKAGE).rglob("__init__.pyi")):
        for node in tree(stub).body:
            if not isinstance(node, ast.ImportFrom):
                continue
            path = stub.parent.joinpath(*(node.module or "").split("."))
            files = [path.with_suffix(".py"), path / "__init__.py"]
            texts = [file.read_text(encoding="utf-8") for file in files if file.exists()]
            defined = {
                name
                for text in texts
                for part in ast.walk(ast.parse(text))
                for name in _names_of(part)
            }
            missing += [
                f"{stub}: {one.name}"
                for one in node.names
                if one.name not in defined and "lazy_loader" not in "".join(texts)
            ]
    assert not missing


def _names_of(node: ast.AST) -> list[str]:
    """Return the names that a statement defines."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    if isinstance(node, ast.ImportFrom | ast.Import):
        return [alias.asname or alias.name for alias in node.names]
    targets = node.targets if isinstance(node, ast.Assign) else []
    targets = [node.target] if isinstance(node, ast.AnnAssign) else targets
    return [target.id for target in targets if isinstance(target, ast.Name)]


def importers() -> dict[str, set[str]]:
    """Return for each module of the package the files of the package that import from it."""
    found: dict[str, set[str]] = {
        ".".join(path.relative_to(ROOT / PACKAGE).with_suffix("").parts): set()
        for _, path in modules()
    }
    for _, path in modules():
        here = ".".join(path.relative_to(ROOT / PACKAGE).with_suffix("").parts)
        for parts in imports(path):
            for name in (".".join(parts), ".".join(parts[:-1])):
                if name in found:
                    found[name].add(here)
    return found


def test_no_thin_module_serves_one_neighbour() -> None:
    """A module below 60 lines whose only importer is in its folder belongs in the importer."""
    thin = set()
    for name, users in importers().items():
        folder, _, stem = name.rpartition(".")
        lines = (ROOT / PACKAGE / f"{name.replace('.', '/')}.py").read_text(encoding="utf-8")
        alone = len(users) == 1 and next(iter(users)).rpartition(".")[0] == folder
        if alone and stem != "__init__" and len(lines.splitlines()) < 60:
            thin.add(name)
    assert thin == THIN_MODULES


THIN_MODULES = {"controls.load_control"}
"""Modules of a kind for which each member has a separate file."""


def test_a_bound_needs_at_most_50_modules_of_limit_analysis() -> None:
    known = importers()
    found, new = set(), {"limit_analysis.body.limit_bounds"}
    while new:
        found |= new
        new = {name for name, users in known.items() if users & found} - found
        new = {name for name in new if name.startswith("limit_analysis.")}
    assert len(found) <= 50
