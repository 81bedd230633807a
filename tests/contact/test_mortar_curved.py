"""Mortar contact where the exact solution is known, and where nodes match."""

import math
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest

from meshes.thick_tube import OUTER, write_thick_tube
from perfplast_fenicsx import (
    Contact,
    Newton,
    OutputFields,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    VonMises,
    limit_load,
)
from tests.checks import assert_solved
from tests.models import Read, touching_blocks, wedge_problem

SEAM = 1.15
APART: dict[str, Any] = {"interface": SEAM, "size": 0.1, "order": 2, "finer": 1.5}
TUBE = VonMises(young=70e3, poisson=0.3, yield_stress=250.0)


def tubes(assembly: TaggedMesh, gap: Any = None, hosts: Any = None) -> Problem:
    """One tube in the other under pressure."""
    return Problem(
        assembly,
        dict.fromkeys(assembly.volumes, TUBE),
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("inner", 1.0)],
        [Contact("inner_tube_seam", "outer_tube_seam", gap, hosts=hosts)],
        degree=2,
    )


@pytest.mark.parametrize("hosts", ["primary", "secondary"])
def test_burst_pressure_of_tube_in_tube(read: Read, hosts: Any) -> None:
    """2k ln(b/a) for tubes whose nodes do not match; R. Hill 1950, chapter V."""
    problem = tubes(read(write_thick_tube, **APART), hosts=hosts)
    assert not problem.has_gaps  # the arcs are taken for what they are
    found = limit_load(problem)
    exact = 2 / math.sqrt(3) * TUBE.yield_stress * math.log(OUTER)
    assert found.estimate == pytest.approx(exact, rel=1e-4)


def test_linear_facets_of_touching_arcs_have_no_gap(read: Read) -> None:
    assert not tubes(read(write_thick_tube, **APART | {"order": 1})).has_gaps


def test_gap_is_a_formula_on_the_primary_surface(read: Read) -> None:
    assembly = read(write_thick_tube, **APART)
    gap = "1e-3*(x**2 + y**2)"
    for hosts in ("primary", "secondary"):
        given = tubes(assembly, gap, hosts).constraints.gap
        assert given == pytest.approx(1e-3 * SEAM**2, rel=1e-6)


@pytest.mark.parametrize("hosts", ["primary", "secondary"])
def test_press_fit_of_tubes(read: Read, hosts: Any, comm: MPI.Intracomm) -> None:
    """Tubes that are made too large by δ, in plane strain; S. Timoshenko, J. N. Goodier 1970, § 28.

    p = Eδ (c² − a²)(b² − c²) / (2(1 − ν²) c³ (b² − a²)) for the radii a, c, b and one material.
    """
    a, c, b, overlap = 1.0, 1.5, 2.5, 1.5e-3
    steel = VonMises(young=2e5, poisson=0.3, yield_stress=1e3)
    shape = {"outer": b, "interface": c, "size": 0.2, "order": 2, "finer": 1.5}
    problem = Problem(
        read(write_thick_tube, **shape),
        {"inner_tube": steel, "outer_tube": steel},
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("inner", 1.0)],
        [
            Contact(
                "inner_tube_seam", "outer_tube_seam", gap=-overlap, interference=True, hosts=hosts
            )
        ],
        degree=2,
    )
    level = Newton(problem).solve(0.0)
    assert_solved(level)
    assert abs(level.report.duality_gap) < 1e-11
    assert level.report.active_contacts == problem.num_pairs
    exact = 2e5 * overlap * (c**2 - a**2) * (b**2 - c**2)
    exact /= 2 * (1 - 0.3**2) * c**3 * (b**2 - a**2)
    fields = OutputFields(problem)
    shown = comm.allreduce(fields.update(level)["contact_pressure"].x.array.max(initial=0), MPI.MAX)
    assert shown == pytest.approx(exact, rel=1e-2)
    mean = np.linalg.norm(fields.resultants[0]) / (math.sqrt(2) * c)
    assert mean == pytest.approx(exact, rel=2e-3)


@pytest.mark.mpi3
def test_matching_nodes_give_the_same_rows(comm: MPI.Intracomm) -> None:
    """To rounding, and the same levels, where linear elements match."""
    levels = []
    rows = []
    for formulation in ("nodes", "mortar"):
        problem = touching_blocks(
            contacts=[Contact("lower_top", "upper_bottom", formulation=formulation)]  # type: ignore[arg-type]
        )
        levels.append(Newton(problem).solve(100.0))
        assert_solved(levels[-1])
        rows.append(problem.constraints)
    u = rows[0].B.createVecRight()
    u.setRandom(PETSc.Random().create(comm))
    jumps = [sorted(comm.allreduce(part.jumps(u).tolist())) for part in rows]
    assert jumps[0] == pytest.approx(jumps[1], abs=1e-14)
    assert levels[0].report.alpha == pytest.approx(levels[1].report.alpha, rel=1e-12)
    u.destroy()


def test_matching_inclined_blocks_in_plastic_flow(wedge: TaggedMesh) -> None:
    alphas = [
        Newton(
            wedge_problem(
                wedge,
                contacts=[Contact("lower_seam", "upper_seam", formulation=kind)],  # type: ignore[arg-type]
            )
        )
        .solve(200.0)
        .report.alpha
        for kind in ("nodes", "mortar")
    ]
    assert alphas[0] == pytest.approx(alphas[1], rel=1e-12)
