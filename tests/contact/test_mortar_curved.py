"""Test mortar contact against exact solutions, and against matching nodes."""

import math
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest
from dolfinx import fem

from demos.verification.curved_seams import OVERLAP, shrink_fit_pressure
from demos.verification.curved_seams import SEAM as SEAM_OF_SHELLS
from meshes.thick_sphere import write_thick_sphere
from meshes.thick_tube import OUTER, write_thick_tube
from perfplast_fenicsx import (
    Contact,
    Elastic,
    Newton,
    OutputFields,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    VonMises,
    limit_load,
)
from perfplast_fenicsx.arrays import Floats
from tests.checks import assert_solved
from tests.models import Read, touching_blocks, wedge_problem

SEAM = 1.15
APART: dict[str, Any] = {"interface": SEAM, "size": 0.1, "order": 2, "finer": 1.5}
TUBE = VonMises(young=70e3, poisson=0.3, yield_stress=250.0)


def tubes(assembly: TaggedMesh, gap: Any = None, hosts: Any = None) -> Problem:
    """Return a tube in a tube, under pressure."""
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
    """The limit pressure is 2k ln(b/a) for nonmatching nodes too; R. Hill 1950, chapter V."""
    problem = tubes(read(write_thick_tube, **APART), hosts=hosts)
    assert not problem.has_gaps  # the mesh represents the arcs exactly enough
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


@pytest.mark.mpi2("primary")
@pytest.mark.parametrize("hosts", ["primary", "secondary"])
def test_press_fit_of_tubes(read: Read, hosts: Any, comm: MPI.Intracomm) -> None:
    """Tubes whose radii overlap by δ, in plane strain; S. Timoshenko, J. N. Goodier 1970, § 28.

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


def shells(assembly: TaggedMesh, **contact: Any) -> Problem:
    """Return a spherical shell that is larger by δ than the hole of the shell around it."""
    contact = {"gap": -OVERLAP, "interference": True} | contact
    return Problem(
        assembly,
        dict.fromkeys(assembly.volumes, Elastic(young=2e5, poisson=0.3)),
        [Support("x0", "x"), Support("y0", "y"), Support("z0", "z")],
        [Pressure("inner", 1.0)],
        [Contact("inner_shell_seam", "outer_shell_seam", **contact)],
        degree=2,
    )


@pytest.mark.long
def test_curved_facets_in_space_are_as_near_as_nodes(read: Read) -> None:
    """Lamé's pressure holds on matching and separate meshes.

    Bernstein coefficients of displacements along the normals of nodes lost 3.7 and 1.7 % of the
    pressure.
    """
    exact = shrink_fit_pressure() * math.pi / 4 * SEAM_OF_SHELLS**2
    errors = []
    for size in (0.5, 0.35):
        shape = {"interface": SEAM_OF_SHELLS, "size": size, "order": 2}
        for kind, finer in (("nodes", None), ("mortar", None), ("mortar", 1.5)):
            problem = shells(read(write_thick_sphere, finer=finer, **shape), formulation=kind)
            level = Newton(problem).solve(0.0)
            assert_solved(level)
            assert abs(level.report.duality_gap) < 1e-11
            assert level.report.balance < 1e-12
            force = level.report.reactions["contact inner_shell_seam outer_shell_seam"]
            errors.append(np.abs(np.abs(force) / exact - 1).max())
    nodes, mortar, apart = np.reshape(errors, (2, 3)).T
    assert (mortar <= 1.5 * nodes).all()
    assert (apart <= 1.5 * nodes).all()
    assert mortar[1] < mortar[0] * (0.35 / 0.5) ** 2


@pytest.mark.mpi3("primary")
@pytest.mark.parametrize("hosts", ["primary", "secondary"])
def test_rows_on_curved_facets(read: Read, hosts: Any, comm: MPI.Intracomm) -> None:
    """Areas are those of the curved surface.

    Translations are no jump, and a radial jump has its true length. To third order, common motions
    of both bodies are no jump.
    """
    shape = {"interface": SEAM_OF_SHELLS, "size": 0.35, "order": 2, "finer": 1.5}
    assembly = read(write_thick_sphere, **shape)
    problem = shells(assembly, hosts=hosts)
    constraints, V = problem.constraints, problem.V
    area = comm.allreduce(float(constraints.area.sum()))
    assert area == pytest.approx(math.pi / 2 * SEAM_OF_SHELLS**2, rel=3e-4)
    x = V.tabulate_dof_coordinates()
    inside = np.zeros(len(x), dtype=np.bool_)
    inside[V.dofmap.list[assembly.cells("inner_shell")].ravel()] = True
    u = fem.Function(V)

    def jumps(field: Floats) -> Floats:
        u.x.array[:] = field.ravel()
        return constraints.jumps(u.x.petsc_vec)

    def most(jump: Floats) -> float:
        return comm.allreduce(float(np.abs(jump).max(initial=0)), MPI.MAX)

    for axis in np.eye(3):
        assert most(jumps(np.tile(axis, (len(x), 1)))) < 1e-13
    assert most(jumps(np.cross([0.3, -0.7, 0.5], x))) < 5e-4
    radius = np.linalg.norm(x, axis=1, keepdims=True)
    assert most(jumps(x / radius * inside[:, None]) - 1) < 2e-3


def test_friction_on_curved_facets(read: Read, comm: MPI.Intracomm) -> None:
    """Common translations cause no slip, and friction forces are in equilibrium."""
    shape = {"interface": SEAM_OF_SHELLS, "size": 0.5, "order": 2, "finer": 1.5}
    problem = shells(read(write_thick_sphere, **shape), tresca=20.0)
    assert problem.friction.count
    u = fem.Function(problem.V)
    u.x.array[:] = np.tile([0.3, -0.7, 0.5], len(u.x.array) // 3)
    slip = problem.sliding.jumps(u.x.petsc_vec)
    assert comm.allreduce(float(np.abs(slip).max(initial=0)), MPI.MAX) < 1e-13
    level = Newton(problem).solve(0.0)
    assert_solved(level)
    assert level.report.balance < 1e-12


def test_straight_facets_of_curved_surfaces_are_told(read: Read) -> None:
    told = tubes(read(write_thick_tube, **APART | {"order": 1})).constraints.remarks
    assert "straight facets" in told[0]
    curved = tubes(read(write_thick_tube, **APART)).constraints.remarks
    assert "straight" not in curved[0]


def test_matching_nodes_give_the_same_rows(comm: MPI.Intracomm) -> None:
    """With matching linear elements, rows and levels agree apart from rounding."""
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
