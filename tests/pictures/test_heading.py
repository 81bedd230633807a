"""Test titles that pictures cannot show literally."""

import pytest

from perfplast_fenicsx.pictures.picture_file import LONGEST, heading, remark_on


@pytest.mark.parametrize(
    ("title", "shown", "says"),
    [
        ("Two blocks, ζ = 1", "Two blocks, ζ = 1", None),
        ("$\\frac{a}", "$\\frac{a}", None),
        ("支架 bracket", "?? bracket", "that their font lacks"),
        ("a" * 30_000, "a" * (LONGEST - 3) + "...", f"only {LONGEST} characters"),
    ],
)
def test_headings(title: str, shown: str, says: str | None) -> None:
    assert heading(title) == shown
    remark = remark_on(title)
    assert (remark is None) == (says is None)
    if says is not None and remark is not None:
        assert says in remark
