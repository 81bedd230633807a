"""Make the gallery from the numbered examples in ``demos``.

./fenicsx python3 docs/examples.py --write     # write docs/gallery.md from the docstrings
./fenicsx python3 docs/examples.py --draw      # run the examples, and store their pictures too
"""

import argparse
import ast
import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
GALLERY = ROOT / "docs" / "gallery.md"
EXAMPLES = sorted((ROOT / "demos").glob("ex[0-9][0-9]_*.py"))

HEAD = """# Gallery

This page shows eleven examples in Python. Each is one file with fewer than 100 lines and runs in
seconds, on one or several processes. It draws a picture, and ends with an error if a number is
wrong. See also the [notebook](../demos/limit_load.ipynb), case files of [real
structures](gallery/real_things.md), and [verification](verification.md).
"""


def picture(example: Path) -> str:
    """Return the path of the picture that an example draws, relative to its working folder."""
    return re.findall(r"results/ex\d\d/\w+\.png", example.read_text(encoding="utf-8"))[-1]


def stored(example: Path) -> Path:
    """Return the path of an example's picture in the documentation."""
    return ROOT / "docs" / "pictures" / f"{example.stem}.png"


def page() -> str:
    """Return the gallery, with title, first paragraph, command and picture of each example."""
    text = HEAD
    for number, example in enumerate(EXAMPLES, 1):
        docstring = ast.get_docstring(ast.parse(example.read_text(encoding="utf-8"))) or ""
        title, _, body = docstring.partition("\n\n")
        title, first = title.rstrip("."), body.split("\n\n")[0]
        text += f"\n## {number}. {title}\n\n{first}\n\n"
        text += f"    ./fenicsx python3 demos/{example.name}\n\n"
        text += f"![Result of example {number}](pictures/{stored(example).name})\n"
    return text


def draw(example: Path) -> None:
    """Run an example in a temporary folder, and store its picture, at most 900 pixels wide."""
    from PIL import Image

    with TemporaryDirectory() as folder:
        subprocess.run([sys.executable, example], cwd=folder, check=True)
        with Image.open(Path(folder) / picture(example)) as drawn:
            small = drawn.convert("RGB")
            small.thumbnail((900, 900))
            small.quantize(128).save(stored(example), optimize=True)


def main() -> None:
    """Write the gallery, and draw its pictures if the command line has ``--draw``."""
    parser = argparse.ArgumentParser(description="Make the gallery from the numbered examples.")
    parser.add_argument("--write", action="store_true", help="write docs/gallery.md")
    parser.add_argument("--draw", metavar="NAME", nargs="*", help="run examples, by default all")
    asked = parser.parse_args()
    for example in EXAMPLES:
        if asked.draw is not None and (not asked.draw or example.stem[:4] in asked.draw):
            draw(example)
    if asked.write or asked.draw is not None:
        GALLERY.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
