"""Test that unknown or wrong PETSc options are reported before a run, and valid ones are not."""

import gc
from collections.abc import Iterator
from typing import Any

from petsc4py import PETSc

import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.solvers.linear.petsc_options import check_options

GOOD: list[Any] = [
    {"perfplast_ksp_rtol": "1e-10"},
    {"perfplast_pc_type": "mg", "perfplast_mg_levels_ksp_max_it": "2"},
    {"perfplast_mg_levels_3_pc_type": "sor", "perfplast_mg_coarse_ksp_type": "preonly"},
    {"perfplast_ksp_type": "gmres", "perfplast_ksp_gmres_restart": "50"},
    {"perfplast_mat_mumps_icntl_14": "40", "perfplast_limit_mat_mumps_icntl_22": "1"},
    {"perfplast_pc_type": "lu", "perfplast_pc_factor_mat_solver_type": "superlu_dist"},
    {"perfplast_coarse_pc_gamg_coarse_eq_limit": "50"},
    {"perfplast_vi_snes_max_it": "20", "perfplast_vi_snes_monitor": None},
    {"perfplast_ksp_monitor": None, "perfplast_ksp_converged_reason": None},
    pytest.param(
        {"perfplast_pc_type": "hypre", "perfplast_pc_hypre_boomeramg_max_iter": "2"},
        marks=pytest.mark.skipif(
            not PETSc.Sys.hasExternalPackage("hypre"), reason="a PETSc without hypre, as PyPI's"
        ),
    ),
    {"log_view": None, "options_left": "0"},
]

BAD: list[tuple[dict[str, str | None], str]] = [
    ({"perfplast_pc_type": "banana"}, "'-perfplast_pc_type banana' cannot be used: unable to find"),
    ({"perfplast_ksp_type": "apple", "perfplast_ksp_rtol": "1e-8"}, "'-perfplast_ksp_type apple'"),
    ({"perfplast_ksp_typo": "5"}, "'-perfplast_ksp_typo' is unknown"),
    ({"perfplast_ksp_rtol": "small"}, "'-perfplast_ksp_rtol small' cannot be used"),
    ({"perfplast_ksp_max_it": "1.5"}, "no integer value"),
    ({"perfplast_mg_levels_ksp_typo": "5"}, "'-perfplast_mg_levels_ksp_typo' is unknown"),
    ({"perfplast_vi_snes_typo": "5"}, "'-perfplast_vi_snes_typo' is unknown"),
    ({"perfplast_vi_snes_type": "vinewtonssls"}, "contact programs need vinewtonrsls"),
    ({"perfplast_vi_snes_max_it": "0"}, "at least one iteration"),
    ({"perfplast_vi_ksp_rtol": "1e-9"}, "give '-perfplast_ksp_rtol 1e-9'"),
    ({"perfplast_24_ksp_rtol": "1e-8"}, "'-perfplast_24_ksp_rtol' is unknown"),
    ({"perfplst_ksp_rtol": "1e-8"}, "did you mean '-perfplast_ksp_rtol'"),
    ({"perfplast_pc_factor_mat_solver_type": "mumsp"}, "mumsp"),
]


@pytest.fixture(autouse=True, scope="module")
def nothing_is_collected() -> Iterator[None]:
    """Prevent the deletion of solvers of other tests, and of their options, during comparisons."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.mark.parametrize("given", GOOD)
def test_options_that_are_right(given: dict[str, str | None]) -> None:
    before = PETSc.Options().getAll()
    check_options(given)
    assert PETSc.Options().getAll() == before


@pytest.mark.parametrize(("given", "says"), BAD)
def test_options_that_are_not(given: dict[str, str | None], says: str) -> None:
    before = PETSc.Options().getAll()
    with pytest.raises(InputError) as refusal:
        check_options(given)
    assert says in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert PETSc.Options().getAll() == before
