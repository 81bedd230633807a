"""Wrap every page in one HTML file that makes no network requests."""

import json
from collections.abc import Sequence
from html import escape
from importlib import resources
from string import Template
from typing import Any

SCRIPTS = "; script-src 'unsafe-inline'"
"""Additional permissions of a page with scripts."""

WORKERS = f"{SCRIPTS}; worker-src blob:"
"""Additional permissions of a page whose scripts start workers."""


def asset(name: str) -> str:
    """Return the contents of a file that pages include."""
    return resources.files(__package__).joinpath("assets", name).read_text(encoding="utf-8")


def framed(body: str, title: str, styles: Sequence[str], allowed: str = "") -> str:
    """Return the HTML of a page.

    Args:
        body: The element <body>.
        title: Title of the page, as plain text.
        styles: Names of the page's style sheets.
        allowed: Permissions in addition to text, styles and embedded pictures: :data:`SCRIPTS`,
            :data:`WORKERS`, or an empty string.
    """
    return Template(asset("frame.html")).substitute(
        body=body.rstrip("\n"),
        title=escape(title),
        style="".join(asset(name) for name in styles),
        allowed=allowed,
    )


def data_of(name: str, data: Any) -> str:
    """Return an element that contains data for scripts.

    Args:
        name: Identifier of the element.
        data: Any data that JSON can represent.
    """
    text = json.dumps(data, allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{text}</script>'


def scripts_of(data: Any, names: Sequence[str]) -> str:
    """Return the elements with the scripts of a page and their data.

    Args:
        data: Data for the scripts.
        names: Names of the script files without ".js", in the order in which the browser reads
            them.
    """
    source = "\n".join(asset(f"{name}.js") for name in names)
    return (
        f'{data_of("data", data)}\n<script>\n"use strict";\n(() => {{\n{source}\n}})();\n</script>'
    )
