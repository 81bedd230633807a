"""Keep the codes of errors and warnings, and make the page of codes from the source.

``python3 docs/refusals.py --write`` gives a code to each new place. All other places keep their
codes, even if their words, function or module have changed. Sphinx puts the table into ``codes.md``
in place of :data:`MARK`.
"""

import ast
import csv
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from docs.marks import replace_mark  # noqa: E402

PACKAGE = ROOT / "perfplast_fenicsx"
TABLE = PACKAGE / "codes.csv"
MARK = "<!-- the codes, from the program -->"

REFUSAL, WARNING, RETIRED = "refusal", "warning", "retired"

FIELDS = ("code", "kind", "module", "function", "text")

Site = tuple[str, str, str, str]
"""Kind, module, function and text of a place that raises an InputError or logs a warning."""


@dataclass(frozen=True, order=True)
class Row:
    """A row of the table.

    Attributes:
        code: The code.
        kind: "refusal", "warning", or "retired" for a code that no place has any longer.
        module: Module without the package.
        function: Function in the module.
        text: The message, with {} for values.
    """

    code: str
    kind: str
    module: str
    function: str
    text: str

    @property
    def site(self) -> Site:
        """Return the module, function and text of the row as a place."""
        return self.kind, self.module, self.function, self.text


def sites(package: Path = PACKAGE) -> list[Site]:
    """Return all places that raise an InputError or log a warning, in the order of their files."""
    found: dict[Site, None] = {}
    trees = {path: ast.parse(path.read_text("utf-8")) for path in sorted(package.rglob("*.py"))}
    errors = {"InputError"} | {
        node.name
        for tree in trees.values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef) and "InputError" in map(ast.unparse, node.bases)
    }
    for path, tree in trees.items():
        module = ".".join(path.relative_to(package).with_suffix("").parts)
        for function, within, call in _calls(tree):
            name = ast.unparse(call.func)
            kind = WARNING if name == "log.warning" else REFUSAL
            number = 1 if name == "raise_together" else 0
            if name not in {*errors, "raise_together", "log.warning"} or len(call.args) <= number:
                continue
            if (module, function) in {("errors", "raise_together"), ("errors", "on_all_ranks")}:
                continue  # these functions raise errors that other places create
            for text in _texts(call.args[number], within):
                found[(kind, module, function, text)] = None
    return list(found)


def _calls(tree: ast.AST) -> Iterator[tuple[str, ast.AST, ast.Call]]:
    """Yield each call outside of handlers of InputError, with the name and node of its function."""

    def walk(node: ast.AST, function: str, within: ast.AST) -> Iterator[Any]:
        if isinstance(node, ast.FunctionDef):
            function, within = node.name, node
        caught = isinstance(node, ast.ExceptHandler) and node.type is not None
        if caught and ast.unparse(node.type) == "InputError":  # type: ignore[attr-defined]
            return  # an error raised here keeps the code of the caught error
        if isinstance(node, ast.Call):
            yield function, within, node
        for child in ast.iter_child_nodes(node):
            yield from walk(child, function, within)

    return walk(tree, "<module>", tree)


def _texts(value: ast.expr, within: ast.AST) -> list[str]:
    """Return the messages that an expression can produce, with {} for values."""
    if isinstance(value, ast.IfExp):
        return [*_texts(value.body, within), *_texts(value.orelse, within)]
    if isinstance(value, ast.Name):
        given = [
            text
            for node in ast.walk(within)
            if isinstance(node, ast.Assign)
            and any(ast.unparse(target) == value.id for target in node.targets)
            and not isinstance(node.value, ast.Name)
            for text in _texts(node.value, within)
        ]
        return [text for text in given if text] or [""]
    if isinstance(value, ast.Constant):
        return [re.sub(r"%[-.\d]*[a-z]", "{}", value.value)] if isinstance(value.value, str) else []
    if isinstance(value, ast.JoinedStr):
        parts = [part.value if isinstance(part, ast.Constant) else "{}" for part in value.values]
        return ["".join(map(str, parts))]
    return [""]


def stored() -> list[Row]:
    """Return the stored rows of ``codes.csv``."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        return [Row(**row) for row in csv.DictReader(file)]


def updated(rows: list[Row], found: list[Site]) -> list[Row]:
    """Return the rows for the present places; a known place keeps its code.

    Args:
        rows: The stored rows.
        found: The present places in the source.
    """
    free = {row.site: row for row in rows if row.kind != RETIRED}
    kept = {site: free.pop(site) for site in found if site in free}
    for same_function, least in ((True, 0.4), (False, 0.8)):
        pairs = sorted(
            (
                (_likeness(site[3], row.text), site, row)
                for site in found
                if site not in kept
                for row in free.values()
                if not same_function or site[:3] == row.site[:3]
            ),
            reverse=True,
        )
        for likeness, site, row in pairs:
            if likeness >= least and site not in kept and row.site in free:
                kept[site] = Row(row.code, *site)
                del free[row.site]
    numbers: dict[str, int] = {}
    for row in rows:
        topic, _, number = row.code.rpartition("-")
        numbers[topic] = max(numbers.get(topic, 0), int(number))
    for site in found:
        if site not in kept:
            topic = site[1].rpartition(".")[2].strip("_").replace("_", "-")
            numbers[topic] = numbers.get(topic, 0) + 1
            kept[site] = Row(f"{topic}-{numbers[topic]}", *site)
    gone = [replace(row, kind=RETIRED) for row in rows if row.kind == RETIRED]
    gone += [replace(row, kind=RETIRED, module="", function="") for row in free.values()]
    return sorted([*kept.values(), *gone], key=_order)


def _likeness(one: str, other: str) -> float:
    """Return how similar two texts are, from 0 to 1."""
    if one == other:
        return 1.0
    matcher = SequenceMatcher(None, one, other, autojunk=False)
    return matcher.ratio() if matcher.quick_ratio() >= 0.4 else 0.0


def _order(row: Row) -> tuple[str, int]:
    topic, _, number = row.code.rpartition("-")
    return topic, int(number)


def reference() -> str:
    """Return the tables of all codes as MyST, one table for each topic."""
    topics: dict[str, list[Row]] = {}
    for row in updated(stored(), sites()):
        topics.setdefault(row.code.rpartition("-")[0], []).append(row)
    text = ""
    for topic, rows in topics.items():
        text += f"\n## {topic}\n\n| code | kind | message |\n|---|---|---|\n"
        for row in rows:
            words = re.sub(r"([|<>*_\[\]$`\\])", r"\\\1", row.text).replace("{}", "…")
            text += f"| `{row.code}` | {row.kind} | {words or 'a message from elsewhere'} |\n"
    return text


def write() -> None:
    """Write the CSV table for the present places."""
    rows = updated(stored() if TABLE.exists() else [], sites())
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(FIELDS)
        table.writerows((row.code, *row.site) for row in rows)


def setup(app: Any) -> dict[str, bool]:
    """Insert the table where a page has :data:`MARK`; Sphinx calls this function."""
    return replace_mark(app, MARK, reference)


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit("python3 docs/refusals.py --write")
    write()
