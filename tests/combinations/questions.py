"""Define the questions that a case can contain."""

from collections.abc import Mapping
from typing import Any

from tests.combinations.statements import Statement

Tables = Mapping[str, Any]


def _levels(method: str, **options: object) -> Tables:
    return {"loading": {"values": [1.0]}, "solve": {"method": method, **options}}


def _works(method: str) -> Tables:
    return {"loading": {"control": "work", "values": [1.0]}, "solve": {"method": method}}


def _limit(method: str) -> Tables:
    return {"loading": {"control": "work", "until": "limit", "limit_method": method}}


QUESTIONS: Mapping[str, Tables] = {
    "ALG1": _levels("newton"),
    "ALG2": _levels("augmented-lagrangian"),
    "ALG3": _works("work-newton"),
    "ALG4": _works("bordered-newton"),
    "T-FETI": _levels("newton", contact_solver="tfeti"),
    "stages": {"stage": [{"factors": {}, "steps": 2}]},
    "limit load along a path": _limit("path"),
    "limit load by the interior point method": _limit("interior-point"),
    "bounds of the body": {"loading": {"control": "bounds"}},
    "bounds on adapted meshes": {
        "loading": {"control": "bounds"},
        "mesh": {"adapt": {"cells": 300}},
    },
    "shakedown, tied": {"loading": {"control": "shakedown"}},
}
"""Tables of each question; levels and factors come from the statement."""


def asked(question: str, statement: Statement, given: Tables) -> Tables:
    """Return the tables of a question, with the levels that it prescribes.

    Args:
        question: One of :data:`QUESTIONS`.
        statement: The statement about the case.
        given: The tables of the case without the question.
    """
    tables = dict(QUESTIONS[question])
    loading = tables.get("loading", {})
    if "values" in loading:
        value = statement.work if "control" in loading else statement.level
        tables["loading"] = loading | {"values": [value]}
    if loading.get("control") == "shakedown":
        varied = [load["on"] for load in given["load"] if not load.get("constant")]
        tables["loading"] = loading | {"ranges": {name: [0.0, 1.0] for name in varied}}
        plain = [one for one in given["contact"] if not set(one) - {"primary", "secondary"}]
        tables["contact"] = [one for one in given["contact"] if one not in plain]
        tables["tie"] = [*given.get("tie", []), *plain]
    if "stage" in tables:
        loads = [load["on"] for load in given["load"] if not load.get("constant")]
        factors = dict.fromkeys(loads, statement.level)
        tables["stage"] = [{"factors": factors, "steps": 2}]
    return tables
