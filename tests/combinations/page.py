"""Write the page of the documentation that shows which statements and questions combine.

./fenicsx python3 -m tests.combinations.page          # write the page again, in about two minutes
"""

import re
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.combinations.answers import Answer, answer
from tests.combinations.questions import QUESTIONS
from tests.combinations.refusals import remark
from tests.combinations.statements import STATEMENTS

PAGE = Path(__file__).resolve().parents[2] / "docs" / "what_goes_with_what.md"

HEAD = """# What goes with what

Each row is a variant of a case in which two blocks are pressed together, and each column is an
analysis. "yes" means that the program gives a result. If only one bound is strict, the cell names
this bound. A number means that the program refuses the case, or proves no bound; the message is
below the table. Unless stated otherwise, cases are small, in plane strain, with quadratic elements.
For shakedown, the blocks are tied and all loads vary. `tests/combinations` runs the cases and
writes this page.

"""

ROW = re.compile(r"^\| (?P<words>[^|]+?) \|(?P<cells>.*)\|$", re.M)


def cell(given: Answer, notes: dict[str, int]) -> str:
    """Return the cell of the table for an answer, and add its message to the notes."""
    if given.words == "yes":
        return "yes"
    kind, _, sentence = given.words.partition(": ")
    number = notes.setdefault(_general(sentence), len(notes) + 1)
    if kind.startswith("the "):
        return f"{kind.split()[1]} [{number}]"
    return f"[{number}]"


def _general(sentence: str) -> str:
    """Return a message without the place in the case file."""
    return re.sub(r"^(case\.toml|stacked_blocks)(, \[+[a-z_]+\]+)?: ", "", sentence)


def table(answers: Mapping[tuple[str, str], Answer]) -> str:
    """Return the page with all answers, by statement and question."""
    notes: dict[str, int] = {}
    lines = [" | ".join(["|", *QUESTIONS]) + " |", "|---" * (1 + len(QUESTIONS)) + "|"]
    for statement in STATEMENTS:
        cells = [cell(answers[statement.words, question], notes) for question in QUESTIONS]
        lines.append(" | ".join([f"| {statement.words}", *cells]) + " |")
    lines += ["", "| | message | reason |", "|---|---|---|"]
    lines += [f"| {number} | {words} | {remark(words)} |" for words, number in notes.items()]
    return HEAD + "\n".join(lines) + "\n"


def shown() -> dict[tuple[str, str], str]:
    """Return the cells of the page, by statement and question."""
    text = PAGE.read_text(encoding="utf-8")
    rows = {row["words"]: row["cells"] for row in ROW.finditer(text)}
    return {
        (statement.words, question): shown_there.strip()
        for statement in STATEMENTS
        for question, shown_there in zip(QUESTIONS, rows[statement.words].split("|"), strict=True)
    }


def main() -> None:
    """Run all cases and write the page. On one process."""
    answers = {}
    with TemporaryDirectory() as folder:
        for statement in STATEMENTS:
            for question in QUESTIONS:
                answers[statement.words, question] = answer(statement, question, Path(folder))
            print(statement.words, flush=True)
    PAGE.write_text(table(answers), encoding="utf-8")


if __name__ == "__main__":
    main()
