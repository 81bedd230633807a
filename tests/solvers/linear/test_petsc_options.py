"""Test options: user options replace presets, and solvers do not share options."""

import gc

from petsc4py import PETSc

import pytest

from perfplast_fenicsx import Newton, limit_bounds
from perfplast_fenicsx.solvers.linear.petsc_options import (
    COARSE,
    LINEAR,
    SPECTRUM,
    default,
    own_prefix,
    solver_name,
)
from tests.models import punch_problem

pytestmark = pytest.mark.serial


class Owner:
    """An owner of options."""


def test_a_default_option_gives_way_to_the_users_and_is_gone_afterwards() -> None:
    options = PETSc.Options()
    with default("matptap_via", "allatonce"):
        assert options.getString("matptap_via") == "allatonce"
    assert not options.hasName("matptap_via")
    options["matptap_via"] = "scalable"
    with default("matptap_via", "allatonce"):
        assert options.getString("matptap_via") == "scalable"
    assert options.getString("matptap_via") == "scalable"
    options.delValue("matptap_via")


def test_a_solver_gets_its_preset_and_the_users_options_of_its_kind_only() -> None:
    preset = {"ksp_type": "cg", "ksp_max_it": 7, "pc_type": "jacobi"}
    options = PETSc.Options()
    me = Owner()
    with default(SPECTRUM + "ksp_max_it", "5"), default(LINEAR + "ksp_max_it", "9"):
        mine, other = own_prefix(me, SPECTRUM, preset), own_prefix(me, COARSE, preset)
        ours, heedless = own_prefix(me, LINEAR, preset), own_prefix(me, LINEAR, preset, heed=False)
    assert len({mine, other, ours, heedless}) == 4
    found = [options.getInt(prefix + "ksp_max_it") for prefix in (mine, other, ours, heedless)]
    assert found == [5, 7, 9, 7]
    assert not options.hasName(ours + "spectrum_ksp_max_it")


def test_what_tunes_the_presets_preconditioner_is_not_for_another() -> None:
    preset = {"ksp_type": "cg", "pc_type": "mg", "pc_mg_cycle_type": "w"}
    options = PETSc.Options()
    me = Owner()
    with default(LINEAR + "pc_type", "jacobi"):
        prefix = own_prefix(me, LINEAR, preset)
    assert options.getString(prefix + "pc_type") == "jacobi"
    assert not options.hasName(prefix + "pc_mg_cycle_type")


def test_a_preset_is_deleted_with_its_owner() -> None:
    """User options remain, so PETSc can warn about unused options."""
    options, me = PETSc.Options(), Owner()
    gc.collect()
    before = options.getAll()
    with default(LINEAR + "ksp_max_it", "9"):
        prefix = own_prefix(me, LINEAR, {"ksp_type": "cg", "ksp_max_it": 7})
        own_prefix(me, COARSE, {"ksp_type": "cg"})
    assert len(options.getAll()) == len(before) + 3
    del me
    assert options.getAll() == before | {prefix + "ksp_max_it": "9"}
    options.delValue(prefix + "ksp_max_it")


def test_solvers_leave_no_options() -> None:
    """Neither a level nor bounds leave options."""
    gc.collect()
    before = PETSc.Options().getAll()
    problem = punch_problem(2)
    Newton(problem).solve(1.0)
    limit_bounds(problem, 1e-2)
    del problem
    gc.collect()
    assert PETSc.Options().getAll() == before


@pytest.mark.parametrize(
    ("types", "name"),
    [
        (("preonly", "cholesky"), "MUMPS Cholesky"),
        (("cg", "mg"), "CG + smoothed aggregation"),
        (("gmres", "ilu"), "gmres + ilu"),
    ],
)
def test_names_for_people(types: tuple[str, str], name: str) -> None:
    assert solver_name(*types) == name
