"""Options: a preset gives way to the user, and solvers do not see each other's."""

from petsc4py import PETSc

import pytest

from perfplast_fenicsx.solvers.linear.petsc_options import (
    COARSE,
    LINEAR,
    SPECTRUM,
    default,
    own_prefix,
    solver_name,
)

pytestmark = pytest.mark.serial


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
    with default(SPECTRUM + "ksp_max_it", "5"), default(LINEAR + "ksp_max_it", "9"):
        mine, other = own_prefix(SPECTRUM, preset), own_prefix(COARSE, preset)
        ours, heedless = own_prefix(LINEAR, preset), own_prefix(LINEAR, preset, heed=False)
    assert len({mine, other, ours, heedless}) == 4
    found = [options.getInt(prefix + "ksp_max_it") for prefix in (mine, other, ours, heedless)]
    assert found == [5, 7, 9, 7]
    assert not options.hasName(ours + "spectrum_ksp_max_it")


def test_what_tunes_the_presets_preconditioner_is_not_for_another() -> None:
    preset = {"ksp_type": "cg", "pc_type": "mg", "pc_mg_cycle_type": "w"}
    options = PETSc.Options()
    with default(LINEAR + "pc_type", "jacobi"):
        prefix = own_prefix(LINEAR, preset)
    assert options.getString(prefix + "pc_type") == "jacobi"
    assert not options.hasName(prefix + "pc_mg_cycle_type")


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
