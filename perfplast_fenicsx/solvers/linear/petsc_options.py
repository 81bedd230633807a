"""Manage PETSc options: a preset, overridden by the user's options, under a unique prefix."""

import itertools
import weakref
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager

from petsc4py import PETSc

LINEAR = "perfplast_"
"""Prefix of the user's options for every linear solver."""

COARSE = "perfplast_coarse_"
"""Prefix of the user's options for the aggregation that makes multigrid's coarse spaces."""

SPECTRUM = "perfplast_spectrum_"
"""Prefix of the user's options for the iteration that estimates the spectral radius by which
multigrid's interpolations are smoothed."""

ACTIVE_SET = "perfplast_vi_"
"""Prefix of the user's options for SNES-VI, which finds the active contact set."""

BOUND = "perfplast_bound_"
"""Prefix of the user's options for the projection for an upper bound of a limit load."""

LIMIT = "perfplast_limit_"
"""Prefix of the user's options for the factorisations of limit analysis."""

SUBDOMAINS = "perfplast_tfeti_"
"""Prefix of the user's options for the factorisations of subdomains in Total FETI."""

SEEPAGE = "perfplast_seepage_"
"""Prefix of the user's options for SNES-VI, which computes seepage."""

KINDS = {LINEAR, COARSE, SPECTRUM, ACTIVE_SET, BOUND, LIMIT, SUBDOMAINS, SEEPAGE}
"""Prefixes of all kinds of solvers."""


_instances = itertools.count()
_made: set[str] = set()


def own_prefix(owner: object, prefix: str, preset: Mapping[str, object], heed: bool = True) -> str:
    """Return a unique options prefix for a solver, after setting the options under it.

    The preset is deleted with its owner. PETSc's time grows with the number of options, and a run
    may create thousands of solvers.

    Args:
        owner: Owner of the options, which exist as long as it lives.
        prefix: One of :data:`KINDS`, the prefix of users' options for all solvers of a kind.
        preset: Default options without prefix.
        heed: Whether the user's options apply.

    Returns:
        A unique prefix, under which preset and user's options are set.
    """
    options = PETSc.Options()
    own = f"{prefix}{next(_instances)}_"
    longer = {other for other in KINDS | _made if len(other) > len(prefix)}
    given = {
        key.removeprefix(prefix): value
        for key, value in options.getAll().items()
        if heed and key.startswith(prefix) and not key.startswith(tuple(longer))
    }
    _made.add(own)
    if given.get("pc_type", preset.get("pc_type")) != preset.get("pc_type"):
        # options of the preset's preconditioner do not apply to another one
        preset = {k: v for k, v in preset.items() if not k.startswith(("pc_", "mg_", "mat_"))}
    for key, value in {**preset, **given}.items():
        options[own + key] = value
        if key not in given:  # the option counts as used, even if its solver never runs
            options.hasName(own + key)
    presets = [own + key for key in preset if key not in given]
    weakref.finalize(owner, _delete, own, presets, not given).atexit = False
    return own


def _delete(own: str, presets: Iterable[str], all_: bool) -> None:
    """Delete the preset of a solver. PETSc warns of the user's unused options."""
    options = PETSc.Options()
    for key in presets:
        options.delValue(key)
    if all_:
        _made.discard(own)


def solver_name(ksp: str, pc: str) -> str:
    """Return the name of a linear solver in messages, from the types of PETSc's KSP and PC."""
    # Names of linear solvers by the types of PETSc's KSP and PC.
    names = {("preonly", "cholesky"): "MUMPS Cholesky", ("cg", "mg"): "CG + smoothed aggregation"}
    return names.get((ksp, pc), f"{ksp} + {pc}")


@contextmanager
def default(name: str, value: str) -> Iterator[None]:
    """Set an option that PETSc reads without a prefix, unless the user set it."""
    options = PETSc.Options()
    given = options.hasName(name)
    if not given:
        options[name] = value
    try:
        yield
    finally:
        if not given:
            options.delValue(name)
