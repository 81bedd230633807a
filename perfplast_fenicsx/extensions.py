"""Laws, loads, controls and other parts that installed packages add to the command line.

A package names a module under the entry points of the group ``GROUP``. The module is imported
before a command reads its case, and puts its classes into the tables that case files choose from,
such as :data:`~perfplast_fenicsx.materials.laws.MATERIALS`.
"""

from functools import cache
from importlib import metadata

GROUP = "perfplast_fenicsx.extensions"


@cache
def load_extensions() -> str | None:
    """Import the modules of ``GROUP``, once; return why one cannot be, or None."""
    for entry in sorted(metadata.entry_points(group=GROUP), key=lambda entry: entry.name):
        try:
            entry.load()
        except Exception as error:
            reason = f"{type(error).__name__}: {error}".rstrip(". ")
            return (
                f"the extension '{entry.name}' cannot be imported from {entry.value} ({reason});"
                f" mend or uninstall {entry.dist.name if entry.dist else 'the package'}."
            )
    return None


def extensions() -> str:
    """Return the distributions that add modules, with their versions; "none" without any."""
    added = {entry.dist for entry in metadata.entry_points(group=GROUP) if entry.dist}
    return ", ".join(sorted(f"{one.name} {one.version}" for one in added)) or "none"
