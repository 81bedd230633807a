"""The title of a case as a heading of pictures: cut short, and of characters that the font has."""

from matplotlib.font_manager import findfont, get_font

LONGEST = 90
"""Characters of a heading; more do not fit on a picture."""

MISSING = "?"
"""Stands for a character that the font has not."""


def heading(title: str) -> str:
    """Return the heading of a picture.

    Args:
        title: Title of the case, whatever it consists of.
    """
    return drawable(_short(title))


def drawable(words: str) -> str:
    """Return words of a case as pictures can show them, such as names of bodies.

    Args:
        words: Whatever they consist of.
    """
    font = get_font(findfont("sans"))
    return "".join(one if font.get_char_index(ord(one)) else MISSING for one in words)


def in_legend(words: str) -> str:
    """Words of a case for places where matplotlib takes what is between dollars for a formula."""
    return drawable(words).replace("$", r"\$")


def remark_on(title: str) -> str | None:
    """Return a remark if the heading differs from the title; else None."""
    if heading(title) == " ".join(title.split()):
        return None
    if heading(title) == _short(title):
        return f"The title is cut to {LONGEST} characters in pictures."
    return f"The font of pictures lacks characters of the title: {MISSING} stands for them."


def _short(title: str) -> str:
    words = " ".join(title.split())
    return words if len(words) <= LONGEST else f"{words[: LONGEST - 3].rstrip()}..."
