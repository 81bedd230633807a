"""Frame all pages: one HTML file that requests nothing from a network."""

import json
from collections.abc import Sequence
from html import escape
from importlib import resources
from string import Template
from typing import Any

SCRIPTS = "; script-src 'unsafe-inline'"
"""Additional permissions of a page with scripts."""

WORKERS = f"{SCRIPTS}; worker-src blob:"
"""Permissions of a page whose scripts start workers."""


def asset(name: str) -> str:
    """Return the contents of a file that pages include."""
    return resources.files(__package__).joinpath("assets", name).read_text(encoding="utf-8")


def framed(body: str, title: str, styles: Sequence[str], allowed: str = "") -> str:
    """Return the HTML of a page.

    Args:
        body: The element <body>.
        title: Its title, as text.
        styles: Names of its style sheets.
        allowed: Its permissions in addition to text, styles and its own pictures: :data:`SCRIPTS`,
            :data:`WORKERS`, or none.
    """
    return Template(asset("frame.html")).substitute(
        body=body.rstrip("\n"),
        title=escape(title),
        style="".join(asset(name) for name in styles),
        allowed=allowed,
    )


def data_of(name: str, data: Any) -> str:
    """Return an element that holds data for scripts.

    Args:
        name: Its id.
        data: Anything that JSON can hold.
    """
    text = json.dumps(data, allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{text}</script>'


def scripts_of(data: Any, names: Sequence[str]) -> str:
    """Return the elements of a page's scripts and of their data.

    Args:
        data: Data for the scripts.
        names: Names of the files without .js, in reading order.
    """
    source = "\n".join(asset(f"{name}.js") for name in names)
    return (
        f'{data_of("data", data)}\n<script>\n"use strict";\n(() => {{\n{source}\n}})();\n</script>'
    )
