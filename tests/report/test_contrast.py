"""Test colours of the page by the Web Content Accessibility Guidelines 2.2, 1.4.3 and 1.4.11."""

import re
from importlib import resources

import numpy as np
import pytest

from perfplast_fenicsx.report.curve import COLOURS, DASHES, MARKS

pytestmark = pytest.mark.serial

TEXT, MARK = 4.5, 3.0
"""Smallest contrasts of text and of drawn marks."""

CSS = resources.files("perfplast_fenicsx.report").joinpath("assets/page.css").read_text("utf-8")
LIGHT, DARK = (
    dict(re.findall(r"--(\w+): (#\w{6})", scheme)) for scheme in re.findall(r":root \{.*?\}", CSS)
)
SCHEMES = pytest.mark.parametrize("names", [LIGHT, DARK], ids=["light", "dark"])
WHITE = "#ffffff"
"""Background of curves in both schemes."""
HALOS = ("#largest circle on paper", "#largest text on paper")
"""Rules with strokes in the colour of the background, around marks on the bodies."""


def luminance(colour: str) -> float:
    """Return the luminance by the definition in the guidelines, for "#rrggbb" or "#rgb"."""
    digits = colour[1:] if len(colour) == 7 else "".join(2 * digit for digit in colour[1:])
    share = np.array(list(bytes.fromhex(digits))) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(a: str, b: str) -> float:
    low, high = sorted((luminance(a), luminance(b)))
    return (high + 0.05) / (low + 0.05)


def used(kind: str, names: dict[str, str]) -> list[tuple[str, str]]:
    """Return rules with the colours that they give to properties of a kind."""
    plain = re.sub(r"var\(--(\w+)\)", lambda found: names[found[1]], CSS)
    found = []
    for rule, body in re.findall(r"([^{}]+)\{([^{}]*)\}", plain):
        for colour in re.findall(rf"(?:^|[;\s])(?:{kind}):[^;]*?(#\w+)", body):
            found.append((f"{rule.strip()} on {ground(rule, body)}", colour))
    return found


def ground(rule: str, body: str) -> str:
    """Return the background of a rule, or of the page."""
    own = re.search(r"background: (#\w{6})", body)
    white = rule.strip().startswith(".curve")
    return own[1] if own else WHITE if white else "paper"


def test_both_schemes_have_the_same_colours() -> None:
    assert LIGHT.keys() == DARK.keys()
    assert luminance(LIGHT["paper"]) > 0.9
    assert luminance(DARK["paper"]) < 0.05


def test_the_measure() -> None:
    assert contrast("#000", "#ffffff") == pytest.approx(21)
    assert contrast("#767676", "#fff") == pytest.approx(4.54, abs=0.01)


@SCHEMES
def test_words_and_areas_of_the_curve(names: dict[str, str]) -> None:
    """Labels, also of the largest value, and the band between two bounds are filled."""
    found = dict(used("fill", names))
    label = "#largest text on paper"
    assert set(found) == {f".curve on {WHITE}", f".curve .band on {WHITE}", label}
    assert contrast(found.pop(label), names["paper"]) >= TEXT
    for colour in found.values():
        assert contrast(colour, WHITE) >= TEXT


@SCHEMES
@pytest.mark.parametrize(
    ("kind", "least"),
    [
        ("color", TEXT),
        ("border|border-left|border-bottom|border-left-color|outline|stroke|accent-color", MARK),
    ],
)
def test_colours_of_the_style_sheet(kind: str, least: float, names: dict[str, str]) -> None:
    found = used(kind, names)
    assert len(found) >= 8
    for rule, colour in found:
        if rule in HALOS and colour == names["paper"]:
            continue
        own = rule.rsplit(" on ", 1)[1]
        for paper in (names["paper"], names["wash"]) if own == "paper" else (own,):
            assert contrast(colour, paper) >= least, (rule, colour)


@SCHEMES
def test_colours_of_curves_and_axes(names: dict[str, str]) -> None:
    letters = [colour for rule, colour in used("color", names) if rule.startswith("#axes g")]
    assert len({*letters}) == 3
    for colour in letters:
        assert contrast(colour, names["paper"]) >= TEXT
    for colour in COLOURS:
        assert contrast(colour, WHITE) >= MARK


def test_curves_differ_by_more_than_their_colours() -> None:
    told = {(MARKS[k % len(MARKS)], DASHES[k // len(MARKS) % len(DASHES)]) for k in range(9)}
    assert len(told) == 9
