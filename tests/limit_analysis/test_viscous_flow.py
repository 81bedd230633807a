"""Test the flow of viscous bodies after a failed factorisation."""

import pytest

from perfplast_fenicsx.limit_analysis.path.viscous_flow import NoFlow, ViscousFlow
from tests.models import stack_problem


def test_after_bodies_that_resist_nothing_the_next_ones_flow() -> None:
    """PETSc would otherwise continue with factors that MUMPS does not have."""
    problem = stack_problem(2)
    flow = ViscousFlow(problem)
    held = problem.basis.gap <= 0
    works = []
    for viscosity in (1.0, 0.0, 2.0):
        flow.viscosity.x.array[:] = viscosity
        if viscosity > 0:
            flow.solve(held)
            works.append(problem.loads.alpha(flow.velocity.x.petsc_vec))
        else:
            with pytest.raises(NoFlow, match="factorised"):
                flow.solve(held)
    flow.destroy()
    assert works == pytest.approx([1.0, 1.0])
