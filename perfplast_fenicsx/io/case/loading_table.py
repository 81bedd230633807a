"""Read the loading (``[loading]`` or ``[[stage]]``) and the algorithm (``[solve]``)."""

from collections.abc import Mapping
from typing import Any

from perfplast_fenicsx.controls.control import Control
from perfplast_fenicsx.controls.controls import CONTROLS
from perfplast_fenicsx.controls.stage_control import StageControl
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.schema import Table, choose, convert
from perfplast_fenicsx.io.case.tables import Document
from perfplast_fenicsx.limit_analysis.conic.conic_solver import SOLVERS, USUAL
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitMethod
from perfplast_fenicsx.limit_analysis.limit_search import limit_options
from perfplast_fenicsx.materials.law import carries_any_load
from perfplast_fenicsx.materials.laws import Material
from perfplast_fenicsx.materials.plastic_flow import with_memory
from perfplast_fenicsx.problem.declared.stage import Stage
from perfplast_fenicsx.solvers.methods import METHODS


def read_loading(top: Document, name: str) -> Control:
    """Return the control of the loading, from ``[loading]`` or from ``[[stage]]``.

    Raises:
        InputError: If the case has both tables or neither, or if a key or value is not valid.
    """
    if top.stage and top.loading is not None:
        raise InputError(
            f"{name}: the case has both [loading] and [[stage]], but each defines the loading; "
            "remove one of them."
        )
    if top.stage:
        places = [f"{name}, [[stage]] number {i}" for i in range(1, len(top.stage) + 1)]
        tables = zip(top.stage, places, strict=True)
        return StageControl([convert(table, Stage, place) for table, place in tables])
    if top.loading is None:
        raise InputError(
            f"{name}: 'loading' is missing; give a table headed [loading], or [[stage]] tables."
        )
    place = f"{name}, [loading]"
    _, schema, rest = choose(top.loading, "control", CONTROLS, place, default="load")
    loading: Control = convert(rest, schema, place)
    return loading


def remembering(materials: Mapping[str, Material], loading: Control) -> dict[str, Material]:
    """Return the materials for a loading; with stages they store plastic strains.

    Raises:
        InputError: If a limit load is sought although a body hardens, or if a law has no plastic
            history for stages.
    """
    hard = sorted(name for name, a in materials.items() if carries_any_load(a))
    if hard and loading.limit_tolerance is not None:
        raise InputError(
            f"the material of '{hard[0]}' hardens, so there is no limit load; give values or "
            "stages, or law = 'von-mises'."
        )
    if not loading.in_turn():
        return dict(materials)
    found: dict[str, Material] = {}
    for name in sorted(materials):
        remembers = with_memory(materials[name])
        if remembers is not None:
            found[name] = remembers
            continue
        raise InputError(
            f"the material of '{name}' has no plastic history, which stages need; give"
            " values of the load factor, or law = 'von-mises'."
        )
    return found


def read_conic(table: Table, loading: Control, place: str) -> tuple[str, Table]:
    """Return the name of the solver of conic programs, and the table without the key ``conic``.

    Args:
        table: The table.
        loading: The control of the loading.
        place: Place in the input, for messages.

    Raises:
        InputError: If the solver is unknown, or if the loading needs no conic program.
    """
    if "conic" not in table:
        return USUAL, table
    conic, _, rest = choose(table, "conic", SOLVERS, place)
    if loading.limit_tolerance is None:
        raise InputError(
            f"{place}: conic = '{conic}' applies only to limit loads and bounds, which this "
            "loading does not compute; remove conic, or give control = 'bounds'."
        )
    if rest or loading.limit_method == LimitMethod.PATH:
        raise InputError(
            f"{place}: conic = '{conic}' applies to the interior point method, but the case "
            "selects a loading path; remove conic, or remove limit_method = 'path' and all other "
            "keys of this table."
        )
    return conic, rest


def read_method(
    table: Table, loading: Control, place: str, coulomb: bool = False
) -> tuple[str, Any]:
    """Return the method and its options; the default is ALG1 for loads and ALG3 for works.

    Args:
        table: The table.
        loading: The control of the loading.
        place: Place in the input, for messages.
        coulomb: Whether the case has Coulomb's friction.

    Raises:
        InputError: If the method does not fit the loading, or if an option is not valid.
    """
    if table and loading.limit_method == LimitMethod.INTERIOR_POINT:
        raise InputError(
            f"{place}: the interior point method solves no load levels; remove this table, or "
            "follow a path with control = 'work', until = 'limit' and limit_method = 'path'."
        )
    wanted = loading.prescribes
    fitting = [name for name, entry in METHODS.items() if entry.solver.prescribes is wanted]
    method, algorithm, rest = choose(table, "method", METHODS, place, default=fitting[0])
    if method not in fitting and loading.in_turn():
        raise InputError(
            f"{place}: method = '{method}' prescribes the work, but stages prescribe load factors; "
            f"use method = {' or '.join(map(repr, fitting))}."
        )
    if method not in fitting:
        control = {schema.prescribes: name for name, schema in reversed(CONTROLS.items())}
        other = control[algorithm.solver.prescribes]
        chosen = next(name for name, schema in CONTROLS.items() if isinstance(loading, schema))
        raise InputError(
            f"{place}: method = '{method}' works with control = '{other}', but [loading] has "
            f"control = '{chosen}'; use method = {' or '.join(map(repr, fitting))}, or control = "
            f"'{other}'."
        )
    if loading.limit_tolerance is not None:
        rest = limit_options(loading.limit_tolerance, coulomb) | rest
    return method, convert(rest, algorithm.options, place)
