"""Load laws, loads, controls and other parts that installed packages add to the program.

A package names a module as an entry point of the group ``GROUP``. The program imports this module
before a command reads its case. The module adds its classes to the tables from which case files
choose, such as :data:`~perfplast_fenicsx.materials.laws.MATERIALS`.
"""

from collections.abc import Iterator
from functools import cache
from importlib import metadata
from typing import Any

from perfplast_fenicsx.errors import InputError

GROUP = "perfplast_fenicsx.extensions"


def loaded(group: str, refusal: str) -> Iterator[tuple[metadata.EntryPoint, Any]]:
    """Yield the entry points of a group, sorted by name, with the loaded objects. Not collective.

    Args:
        group: Name of the group.
        refusal: Beginning of the error message, such as "the extension '{name}' cannot be
            imported".

    Raises:
        InputError: If an entry point cannot be loaded.
    """
    for entry in sorted(metadata.entry_points(group=group), key=lambda entry: entry.name):
        try:
            found = entry.load()
        except Exception as error:
            reason = f"{type(error).__name__}: {error}".rstrip(". ")
            raise InputError(
                f"{refusal.format(name=entry.name)} from {entry.value} ({reason}); repair or"
                f" uninstall {entry.dist.name if entry.dist else 'the package'}."
            ) from error
        yield entry, found


@cache
def load_extensions() -> None:
    """Import the modules of ``GROUP`` once. Not collective.

    Raises:
        InputError: If a module cannot be imported.
    """
    list(loaded(GROUP, "the extension '{name}' cannot be imported"))


def extensions() -> str:
    """Return the distributions that add modules, with versions; "none" if there are none."""
    added = {entry.dist for entry in metadata.entry_points(group=GROUP) if entry.dist}
    return ", ".join(sorted(f"{one.name} {one.version}" for one in added)) or "none"
