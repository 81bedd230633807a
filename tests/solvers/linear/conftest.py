"""Define options for the tests in this folder."""

from collections.abc import Iterator

from petsc4py import PETSc

import pytest


@pytest.fixture
def multigrid() -> Iterator[None]:
    """Use multigrid for problems that the program would factorise."""
    options = PETSc.Options()
    given = {"perfplast_pc_type": "mg", "perfplast_coarse_pc_gamg_coarse_eq_limit": "60"}
    for key, value in given.items():
        options[key] = value
    yield
    for key in given:
        options.delValue(key)
