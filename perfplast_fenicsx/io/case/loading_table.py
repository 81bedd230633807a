"""Read the loading: ``[loading]``, or ``[[stage]]`` with bodies that remember plastic flow."""

from collections.abc import Mapping

from perfplast_fenicsx.controls.control import Control
from perfplast_fenicsx.controls.controls import CONTROLS
from perfplast_fenicsx.controls.stage_control import StageControl
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.schema import choose, convert
from perfplast_fenicsx.io.case.tables import Document
from perfplast_fenicsx.materials.law import carries_any_load
from perfplast_fenicsx.materials.laws import Material
from perfplast_fenicsx.materials.plastic_flow import with_memory
from perfplast_fenicsx.problem.declared.stage import Stage


def read_loading(top: Document, name: str) -> Control:
    """Return the control of the loading.

    Raises:
        InputError: If there is not exactly one of both tables, or if its keys are wrong.
    """
    if top.stage and top.loading is not None:
        raise InputError(
            f"{name}: there are both [loading] and [[stage]], which define two loadings; "
            "remove one of them."
        )
    if top.stage:
        places = [f"{name}, [[stage]] number {i}" for i in range(1, len(top.stage) + 1)]
        tables = zip(top.stage, places, strict=True)
        return StageControl([convert(table, Stage, place) for table, place in tables])
    if top.loading is None:
        raise InputError(
            f"{name}: 'loading' is missing; give a table, headed [loading], or [[stage]] tables."
        )
    place = f"{name}, [loading]"
    _, schema, rest = choose(top.loading, "control", CONTROLS, place, default="load")
    loading: Control = convert(rest, schema, place)
    return loading


def remembering(materials: Mapping[str, Material], loading: Control) -> dict[str, Material]:
    """Return the materials for a loading: with stages they remember plastic flow.

    Raises:
        InputError: If a limit load is sought for hardening bodies, which have none, or if there are
            stages for a body that cannot remember.
    """
    hard = sorted(name for name, a in materials.items() if carries_any_load(a))
    if hard and loading.limit_tolerance is not None:
        raise InputError(
            f"the material of '{hard[0]}' hardens, so that bodies carry any load and there "
            "is no limit load; give values or stages, or law = 'von-mises'."
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
