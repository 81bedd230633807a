"""Test 3D, plane strain and axisymmetry: strains and measures by hand, motions without strain."""

import math
from dataclasses import replace

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.mesh import CellType, Mesh, create_box, create_rectangle

from perfplast_fenicsx import InputError, TaggedMesh, stacked_blocks
from perfplast_fenicsx.mesh.kinematics import KINDS, Kinematics, divergence

INNER, OUTER, HEIGHT = 0.5, 2.0, 1.5
VOLUME = math.pi * (OUTER**2 - INNER**2) * HEIGHT


def section(inner: float = INNER) -> Mesh:
    return create_rectangle(MPI.COMM_WORLD, [(inner, 0.0), (OUTER, HEIGHT)], (4, 3))


def integral(mesh: Mesh, kinematics: Kinematics, density: ufl.core.expr.Expr) -> float:
    form = density * kinematics.measure(ufl.Measure("dx", domain=mesh))
    return float(mesh.comm.allreduce(fem.assemble_scalar(fem.form(form))))


@pytest.mark.parametrize("kind", ["plane-strain", "axisymmetric", "space"])
def test_rigid_motions_strain_nothing(kind: str) -> None:
    box = [(INNER, 0.0, 0.0), (OUTER, HEIGHT, 1.0)]
    of_cubes = (2, 2, 2), CellType.tetrahedron
    mesh = create_box(MPI.COMM_WORLD, box, *of_cubes) if kind == "space" else section()
    kinematics, V = KINDS[kind], fem.functionspace(mesh, ("P", 1, (mesh.geometry.dim,)))
    u, x = fem.Function(V), np.asarray(V.tabulate_dof_coordinates(), dtype=np.float64)
    modes = kinematics.rigid_modes(x)
    assert modes.shape == (len(x), mesh.geometry.dim, len(kinematics.motions))
    for motion in range(len(kinematics.motions)):
        u.x.array[:] = modes[:, :, motion].ravel()
        e = kinematics.strain(u)
        assert integral(mesh, kinematics, ufl.dot(u, u)) > 0.1
        assert integral(mesh, kinematics, ufl.dot(e, e)) < 1e-25


def test_strain_of_a_body_of_revolution_by_hand() -> None:
    mesh, kinematics = section(), KINDS["axisymmetric"]
    r, z = ufl.SpatialCoordinate(mesh)
    V = fem.functionspace(mesh, ("P", 3, (2,)))
    u = fem.Function(V)
    u.interpolate(lambda x: np.array([x[0] ** 2 * x[1], x[0] * x[1]]))
    by_hand = ufl.as_vector([2 * r * z, r, r * z, (r**2 + z) / math.sqrt(2)])
    wrong = kinematics.strain(u) - by_hand
    assert integral(mesh, kinematics, ufl.dot(wrong, wrong)) < 1e-24
    wrong = divergence(kinematics, u) - (3 * r * z + r)
    assert integral(mesh, kinematics, wrong**2) < 1e-24


@pytest.mark.mpi2
def test_integrals_go_around_the_axis() -> None:
    mesh, kinematics = section(), KINDS["axisymmetric"]
    one = fem.Constant(mesh, 1.0)
    assert integral(mesh, kinematics, one) == pytest.approx(VOLUME, rel=1e-13)
    assert integral(mesh, KINDS["plane-strain"], one) == pytest.approx((OUTER - INNER) * HEIGHT)
    skin = fem.form(one * kinematics.measure(ufl.Measure("ds", domain=mesh)))
    ends, sides = 2 * VOLUME / HEIGHT, 2 * math.pi * (INNER + OUTER) * HEIGHT
    found = mesh.comm.allreduce(fem.assemble_scalar(skin))
    assert found == pytest.approx(ends + sides, rel=1e-13)
    x = np.array([[[0.0, 1.0], [3.0, -1.0]]])
    assert kinematics.around(x) == pytest.approx(np.array([[0.0, 6 * math.pi]]))


def test_only_the_axis_holds_and_only_outwards() -> None:
    x = np.array([[0.0, 0.3, 0.0], [1e-14, 0.0, 0.0], [1e-3, 0.0, 0.0]])
    held = KINDS["axisymmetric"].held(x, 1.0)
    assert held.tolist() == [[True, False], [True, False], [False, False]]
    assert not KINDS["plane-strain"].held(x, 1.0).any()
    assert not KINDS["space"].held(x, 1.0).any()


def test_what_cannot_turn_is_refused_in_a_sentence() -> None:
    blocks = stacked_blocks(MPI.COMM_WORLD, 1)
    with pytest.raises(InputError, match=r"mesh of triangles, .*; give the half section"):
        blocks.turned()
    flat = replace(blocks, mesh=section(-0.1))
    with pytest.raises(InputError, match=r"extends to x = -0\.1, but x is the radius"):
        flat.turned()
    for inner in (0.0, -1e-14, INNER):
        turned: TaggedMesh = replace(blocks, mesh=section(inner)).turned()
        assert turned.kinematics.name == "axisymmetric"
