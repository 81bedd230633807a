"""Manage PETSc options: presets, and the user's options, which are tested before a run.

The module tests the user's PETSc options on tiny solvers, to report unknown options before a run.
PETSc itself reports unused options only at the end of a run, and unknown types only when it creates
a solver, late in a run.
"""

import ctypes
import difflib
import itertools
import re
import weakref
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.errors import InputError

LINEAR = "perfplast_"
"""Prefix of the user's options for every linear solver."""

COARSE = "perfplast_coarse_"
"""Prefix of the user's options for the aggregation that creates multigrid's coarse spaces."""

SPECTRUM = "perfplast_spectrum_"
"""Prefix of the user's options for the iteration that estimates the spectral radius. The smoothing
of multigrid's interpolations needs this radius."""

ACTIVE_SET = "perfplast_vi_"
"""Prefix of the user's options for SNES-VI, which finds the active contact set."""

BOUND = "perfplast_bound_"
"""Prefix of the user's options for the projection in an upper bound on a limit load."""

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
    """Set the options of a solver, and return their unique prefix.

    The preset is deleted with its owner, because PETSc takes more time with more options, and a run
    may create thousands of solvers.

    Args:
        owner: Owner of the options, which exist as long as the owner does.
        prefix: One of :data:`KINDS`: the prefix of the user's options for all solvers of this kind.
        preset: Default options without prefix.
        heed: Whether the user's options apply.

    Returns:
        The unique prefix, under which the preset and the user's options are set.
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
        # Options of the preset's preconditioner do not apply to another preconditioner.
        preset = {k: v for k, v in preset.items() if not k.startswith(("pc_", "mg_", "mat_"))}
    for key, value in {**preset, **given}.items():
        options[own + key] = value
        if key not in given:  # the option counts as used, even if its solver never runs
            options.hasName(own + key)
    presets = [own + key for key in preset if key not in given]
    weakref.finalize(owner, _delete, own, presets, not given).atexit = False
    return own


def _delete(own: str, presets: Iterable[str], all_: bool) -> None:
    """Delete the preset of a solver, but keep the user's options, so PETSc reports unused ones."""
    options = PETSc.Options()
    for key in presets:
        options.delValue(key)
    if all_:
        _made.discard(own)


def solver_name(ksp: str, pc: str) -> str:
    """Return the name of a linear solver for messages, from the types of PETSc's KSP and PC."""
    # Names of linear solvers by the types of PETSc's KSP and PC.
    names = {("preonly", "cholesky"): "MUMPS Cholesky", ("cg", "mg"): "CG + smoothed aggregation"}
    return names.get((ksp, pc), f"{ksp} + {pc}")


@contextmanager
def default(name: str, value: str) -> Iterator[None]:
    """Set an option that PETSc reads without a prefix, unless the user has set it."""
    options = PETSc.Options()
    given = options.hasName(name)
    if not given:
        options[name] = value
    try:
        yield
    finally:
        if not given:
            options.delValue(name)


Options = Mapping[str, str]

FACTOR = {"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"}

BASES: tuple[Options, ...] = (
    *({}, FACTOR, {"ksp_type": "cg", "pc_type": "mg"}, {"ksp_type": "cg", "pc_type": "gamg"}),
    {"ksp_type": "cg", "pc_type": "jacobi"},
)
"""Initial options of the test solvers; an option is known if any of these solvers reads it."""

INNER = re.compile(
    r"^(mg_(levels|coarse|fine)(_\d+)?|sub|redundant|telescope|esteig|ksp_chebyshev_esteig)_"
)
"""Prefixes of solvers inside preconditioners; such solvers accept the options of any solver."""

VIEWERS = re.compile(r"^(ksp|pc|snes|mat)_.*(view|monitor|converged_reason|converged_rate)")
"""Options that print something; a test would print it too."""


SNES_VI = {ACTIVE_SET: "contact programs", SEEPAGE: "flows of water"}
"""Kinds of problems that SNES-VI solves, by the prefix of the user's options for SNES-VI."""


def check_options(given: Mapping[str, str | None]) -> None:
    """Refuse unknown options of perfplast's solvers, and options with invalid values.

    Not collective: each rank tests the options by itself.

    Args:
        given: Values by names without the leading dash; names without perfplast's prefix belong to
            PETSc.

    Raises:
        InputError: If there is such an option; the message names it.
    """
    by_kind: dict[str, dict[str, str]] = {}
    for name, value in given.items():
        if not name.startswith(LINEAR):
            first = name.partition("_")[0]
            if difflib.SequenceMatcher(None, first, LINEAR[:-1]).ratio() > 0.8:
                raise InputError(
                    f"the PETSc option '-{name}' does not have perfplast's prefix; did you mean"
                    f" '-{LINEAR}{name.partition('_')[2]}'?"
                )
            continue
        kind = max((one for one in KINDS if name.startswith(one)), key=len)
        by_kind.setdefault(kind, {})[name.removeprefix(kind)] = value or ""
    for kind, options in by_kind.items():
        _check(kind, options)


def _check(kind: str, options: Options) -> None:
    groups: dict[str, dict[str, str]] = {}
    for name, value in options.items():
        inner = name
        while match := INNER.match(inner):
            inner = inner[match.end() :]
        if not VIEWERS.match(inner):
            groups.setdefault(name.removesuffix(inner), {})[inner] = value
    # PETSc's error codes for values: not supported, wrong, out of range, not a number, or of
    # unknown type; and for a missing factorisation.
    petsc_errors = (56, 62, 63, 86, 92)
    for within, tried in groups.items():
        known: set[str] = set()
        for base in BASES:
            try:
                known |= _read(kind, {**base, **tried})
            except PETSc.Error as error:
                if error.ierr in petsc_errors:
                    name = _culprit(kind, tried)
                    raise InputError(
                        f"the PETSc option '-{kind}{within}{name} {tried[name]}' cannot be used:"
                        f" {_reason(error)}; correct its value."
                    ) from error
                raise
        for name in tried:
            if name not in known:
                raise InputError(
                    f"the PETSc option '-{kind}{within}{name}' is unknown to the solvers "
                    "with this prefix; check its name, or remove it."
                )
    if kind in SNES_VI:
        check_snes_vi(options, kind)


def check_snes_vi(options: Options, kind: str = ACTIVE_SET) -> None:
    """Refuse options that would replace SNES-VI by another solver, or prevent its steps.

    Args:
        options: Values by names without any prefix.
        kind: One of :data:`SNES_VI`.

    Raises:
        InputError: If there is such an option; the message names it.
    """
    for name, value in options.items():
        told = f"the PETSc option '-{kind}{name} {value}' cannot be used:"
        if name == "snes_type" and value != "vinewtonrsls":
            raise InputError(f"{told} {SNES_VI[kind]} need vinewtonrsls; remove the option.")
        if name == "snes_max_it" and int(value) < 1:
            raise InputError(f"{told} at least one iteration is needed; give 1 or more.")
        if kind == ACTIVE_SET and not name.startswith("snes_"):
            raise InputError(
                f"{told} SNES-VI uses the same linear solver as all other steps; give "
                f"'-{LINEAR}{name} {value}' for this solver."
            )


def _culprit(kind: str, tried: Options) -> str:
    """Return the first option that fails alone, or the last option if none does."""
    for name, value in tried.items():
        try:
            _read(kind, {name: value})
        except PETSc.Error:
            return name
    return name


def _reason(error: PETSc.Error) -> str:
    last = str(error).splitlines()[-1].partition("] ")[2].strip()
    return last[:1].lower() + last[1:]


def _read(kind: str, options: Options) -> set[str]:
    """Create a solver with the given options, and return the names of the options that it reads.

    Raises:
        PETSc.Error: If the solver cannot be created.
    """
    database, prefix = PETSc.Options(), f"{kind}trial_"
    for name, value in options.items():
        database[prefix + name] = value or None
    rows = np.arange(5, dtype=PETSc.IntType)
    identity = (rows, rows[:-1], np.ones(4))
    matrix = PETSc.Mat().createAIJ((4, 4), csr=identity, comm=PETSc.COMM_SELF)
    ksp, snes = PETSc.KSP().create(PETSc.COMM_SELF), PETSc.SNES().create(PETSc.COMM_SELF)
    try:
        if kind in SNES_VI:
            snes.setOptionsPrefix(prefix)
            snes.setType("vinewtonrsls")
            snes.setFromOptions()
        ksp.setOptionsPrefix(prefix)
        ksp.setOperators(matrix)
        ksp.setFromOptions()
        if ksp.pc.getType() in ("cholesky", "lu"):  # these read more options during set-up
            ksp.setUp()
        return {name for name in options if _was_read(prefix + name)}
    finally:
        for name in options:
            database.delValue(prefix + name)
        for made in (ksp, snes, matrix):
            made.destroy()


def _was_read(name: str) -> bool:
    """Return whether an option was read; petsc4py has no function for this."""
    read = ctypes.c_int(0)
    ctypes.CDLL(PETSc.__file__).PetscOptionsUsed(None, name.encode(), ctypes.byref(read))
    return bool(read.value)
