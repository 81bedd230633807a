"""PETSc options: a preset, overridden by the user's, under a prefix of the solver's own."""

import itertools
from collections.abc import Mapping

from petsc4py import PETSc

_instances = itertools.count()


def own_prefix(prefix: str, preset: Mapping[str, object]) -> str:
    """Make an options prefix for one solver.

    Args:
        prefix: Where users put options for every solver of the kind, such as ``perfplast_``.
        preset: Options that hold where the user says nothing, without prefix.

    Returns:
        A prefix nobody else uses, under which preset and user's options stand.
    """
    options = PETSc.Options()
    own = f"{prefix}{next(_instances)}_"
    given = {
        key.removeprefix(prefix): value
        for key, value in options.getAll().items()
        if key.startswith(prefix) and not key.removeprefix(prefix)[:1].isdigit()
    }
    for key, value in {**preset, **given}.items():
        options[own + key] = value
    return own
