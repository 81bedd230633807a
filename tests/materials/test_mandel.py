"""Test that products of Mandel vectors equal products of tensors."""

from mpi4py import MPI

import pytest
import ufl
from dolfinx import fem
from dolfinx.mesh import create_unit_cube, create_unit_square

from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.materials.mandel import deviator, tensor
from perfplast_fenicsx.mesh.kinematics import KINDS

pytestmark = pytest.mark.serial


def test_mandel_products_are_tensor_products() -> None:
    for mesh in (create_unit_square(MPI.COMM_SELF, 1, 1), create_unit_cube(MPI.COMM_SELF, 1, 1, 1)):
        gdim = mesh.geometry.dim
        x = ufl.SpatialCoordinate(mesh)
        u = ufl.as_vector([x[0] ** 2 + (i + 2) * x[0] * x[1] for i in range(gdim)])
        kind = "space" if gdim == 3 else "plane-strain"
        e, full = KINDS[kind].strain(u), ufl.sym(ufl.grad(u))
        for difference in (
            ufl.dot(e, e) - ufl.inner(full, full),
            ufl.inner(tensor(e), tensor(e)) - ufl.inner(full, full),
            ufl.tr(tensor(deviator(e))),
        ):
            size = fem.assemble_scalar(fem.form(difference**2 * ufl.dx))
            assert abs(size) < 1e-20
    assert interpolation_points(fem.functionspace(mesh, ("DG", 0)).element).shape == (1, 3)
