"""Turn the title of a case into a heading of pictures: shortened, with characters of the font."""

from matplotlib.font_manager import findfont, get_font

LONGEST = 90
"""Largest number of characters of a heading that fit on a picture."""

MISSING = "?"
"""Replacement of a character that the font lacks."""


def heading(title: str) -> str:
    """Return the heading of a picture.

    Args:
        title: Title of the case, any text.
    """
    return drawable(_short(title))


def drawable(words: str) -> str:
    """Return words of a case, such as names of bodies, in characters of the font.

    Args:
        words: Any text.
    """
    font = get_font(findfont("sans"))
    return "".join(one if font.get_char_index(ord(one)) else MISSING for one in words)


def in_legend(words: str) -> str:
    """Return words of a case for matplotlib, which reads text between dollars as a formula."""
    return drawable(words).replace("$", r"\$")


def remark_on(title: str) -> str | None:
    """Return a remark if the heading differs from the title; otherwise None."""
    if heading(title) == " ".join(title.split()):
        return None
    if heading(title) == _short(title):
        return f"The title is cut to {LONGEST} characters in pictures."
    return f"The font of pictures lacks characters of the title: {MISSING} replaces them."


def _short(title: str) -> str:
    words = " ".join(title.split())
    return words if len(words) <= LONGEST else f"{words[: LONGEST - 3].rstrip()}..."
