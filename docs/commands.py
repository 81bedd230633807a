r"""Run the commands of a page in a fresh folder, and compare or refresh the outputs on the page.

    ./fenicsx python3 docs/commands.py docs/tutorial.md            # do the outputs agree?
    ./fenicsx python3 docs/commands.py docs/tutorial.md --write    # store the present outputs

A code block with a caption is a file. A block with the caption ``FILE, [TABLE]`` replaces this
table in the case file. In a block of the language ``console``, a line that begins with ``$`` is a
command, and the lines below the command are its output. A line ``...`` matches any number of lines.
All other blocks are ignored.
"""

import argparse
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType

ROOT = Path(__file__).resolve().parents[1]

BLOCK = re.compile(r"^(?P<fence>```+)(?P<info>[^\n`]*)\n(?P<text>.*?)^(?P=fence)$", re.M | re.S)
CAPTION = re.compile(r":caption: (.+)\n+")
NUMBER = re.compile(r"[-−+]?\d+(\.\d+)?([eE][-+−]?\d+)?")
ELLIPSIS = "..."

EXACT: Mapping[str, str] = MappingProxyType({})

NO_PICTURES = "\n[output]\npictures = false\n"


@dataclass(frozen=True)
class Command:
    """A command of a page.

    Attributes:
        line: The command line.
        shown: The output that the page shows.
        span: Start and end of the shown output in the page.
    """

    line: str
    shown: str
    span: tuple[int, int]


@dataclass(frozen=True)
class File:
    """A file of a page.

    Attributes:
        name: The name of the file, followed by ``, [TABLE]`` if the block has only this table.
        text: The content of the block.
    """

    name: str
    text: str


def parts(page: str) -> Iterator[Command | File]:
    """Yield the files and commands of a page, in order."""
    for block in BLOCK.finditer(page):
        caption = CAPTION.match(block["text"])
        if caption:
            yield File(caption[1], block["text"][caption.end() :])
        elif block["info"].strip() == "console":
            yield from _commands(block["text"], block.start("text"))


def _commands(text: str, offset: int) -> Iterator[Command]:
    starts = [match.start() for match in re.finditer(r"^\$ ", text, re.M)]
    for start, end in zip(starts, [*starts[1:], len(text)], strict=True):
        typed = re.match(r"\$ ((?:.*\\\n)*.*\n)", text[start:end])
        assert typed
        first = start + typed.end()
        yield Command(typed[1].strip(), text[first:end], (offset + first, offset + end))


def clone(folder: Path) -> Path:
    """Make a folder with links to the repository for commands that write files; return its path."""
    folder.mkdir()
    for entry in ROOT.iterdir():
        if not entry.name.startswith((".", "results", "build")):
            (folder / entry.name).symlink_to(entry)
    return folder


def write_file(folder: Path, file: File, pictures: bool = True) -> None:
    """Write a file of a page, or replace a table in it.

    Args:
        folder: The folder.
        file: The file.
        pictures: Whether a case file may draw pictures.
    """
    name, _, table = file.name.partition(", ")
    path, text = folder / name, file.text
    if table:
        old = path.read_text(encoding="utf-8")
        place = re.compile(rf"^{re.escape(table)} *(?:#[^\n]*)?\n.*?(?=^\[|\Z)", re.M | re.S)
        if not place.search(old):
            raise LookupError(f"{name} has no table {table}")
        text = place.sub(lambda _: text, old)
    # a file without a title contains only a part of a case
    whole = path.suffix == ".toml" and re.search(r"^title\b", text, re.M)
    if whole and not pictures and NO_PICTURES not in text:
        text += NO_PICTURES
    path.write_text(text, encoding="utf-8")


def execute(folder: Path, command: Command) -> str:
    """Run a command and return its standard output.

    Raises:
        RuntimeError: If the command fails.
    """
    done = subprocess.run(
        command.line,
        shell=True,
        executable="/bin/bash",
        cwd=folder,
        capture_output=True,
        stdin=subprocess.DEVNULL,
        text=True,
        encoding="utf-8",
    )
    if done.returncode:
        printed = done.stdout + done.stderr
        raise RuntimeError(f"$ {command.line}\nended with {done.returncode}:\n{printed}")
    return done.stdout


def same(shown: str, printed: str) -> bool:
    """Return whether the output on the page agrees with the output of the command.

    Differences in numbers, spaces, lists of files and the picture of ``check`` are ignored.
    """

    def plain(text: str) -> list[str]:
        text = re.sub(r"^(Results in \S+):.*", r"\1", text, flags=re.M)
        text = re.sub(r"^Picture of the case: .*\n", "", text, flags=re.M)
        lines = [" ".join(NUMBER.sub("0", line).split()) for line in text.strip().splitlines()]
        return [line.replace("less than 0", "0") for line in lines]

    pattern = "".join(
        r"(.*\n)*" if line == ELLIPSIS else re.escape(f"{line}\n") for line in plain(shown)
    )
    return bool(re.fullmatch(pattern, "".join(f"{line}\n" for line in plain(printed))))


def check(
    page: Path, folder: Path, pictures: bool = True, coarse: Mapping[str, str] = EXACT
) -> list[str]:
    """Run the commands of a page in a new folder, and compare their outputs with the page.

    Args:
        page: A page in Markdown.
        folder: The new folder; it must not exist.
        pictures: Whether the case files of the page may draw pictures.
        coarse: Replacements in the page, such as coarser meshes, which shorten a test.

    Returns:
        A message for each command with an output that differs from the page.

    Raises:
        RuntimeError: If a command fails.
    """
    clone(folder)
    faults = []
    text = page.read_text(encoding="utf-8")
    for fine, instead in coarse.items():
        text = text.replace(fine, instead)
    for part in parts(text):
        if isinstance(part, File):
            write_file(folder, part, pictures)
            continue
        printed = execute(folder, part)
        if not same(part.shown, printed):
            faults.append(f"$ {part.line}\nprints\n{printed}\nbut {page.name} shows\n{part.shown}")
    return faults


def refresh(page: Path, folder: Path) -> None:
    """Run a page, and write the outputs into it, except those with a line ``...``."""
    text = page.read_text(encoding="utf-8")
    clone(folder)
    printed: list[tuple[tuple[int, int], str]] = []
    for part in parts(text):
        if isinstance(part, File):
            write_file(folder, part)
            continue
        output = execute(folder, part)
        if ELLIPSIS not in part.shown.splitlines():
            printed.append((part.span, output))
    for (start, end), output in reversed(printed):
        text = text[:start] + output + text[end:]
    page.write_text(text, encoding="utf-8")


def main() -> int:
    """Check the pages that the command line names, or rewrite the outputs on these pages."""
    parser = argparse.ArgumentParser(description="Run the commands of pages.")
    parser.add_argument("pages", nargs="+", type=Path)
    parser.add_argument("--write", action="store_true", help="write what they print")
    arguments = parser.parse_args()
    status = 0
    for page in arguments.pages:
        with TemporaryDirectory() as temporary:
            folder = Path(temporary) / "clone"
            if arguments.write:
                refresh(page, folder)
            else:
                for fault in check(page, folder):
                    status = 1
                    print(fault)
    return status


if __name__ == "__main__":
    sys.exit(main())
