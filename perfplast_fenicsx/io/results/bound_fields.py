"""Fields of bounds of a body: the stress of the lower one, and where the gap between them is."""

import basix.ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.mandel_arrays import matrices
from perfplast_fenicsx.mesh.alfeld_split import AlfeldSplit
from perfplast_fenicsx.mesh.straight_geometry import corners


def bound_fields(body: BodyBounds) -> dict[str, fem.Function]:
    """Piecewise constant functions by name. Collective.

    Returns:
        ``lower_bound_stress``, the mean of each cell (3×3), where there is a lower bound, and
        ``gap_share``, what each cell that was given has of the gap, in its parts if it was split.
    """
    fields = {}
    tagged_mesh = body.problem.tagged_mesh
    if body.stress is not None:
        means = body.stress.mean(axis=1)
        if tagged_mesh.axisymmetric:  # of rσ
            vertices, points = corners(tagged_mesh.mesh)
            means /= points[vertices][..., 0].mean(axis=1)[:, None]
        fields["lower_bound_stress"] = _tensors(body, means)
    if body.shares is not None:
        scalars = fem.functionspace(tagged_mesh.mesh, ("DG", 0))
        shares = fem.Function(scalars, name="gap_share")
        total = body.problem.comm.allreduce(float(body.shares.sum()))
        of_cells = body.shares
        if isinstance(tagged_mesh, AlfeldSplit):
            of_cells = of_cells[tagged_mesh.parents]
        cells = scalars.dofmap.list[: len(of_cells), 0]
        shares.x.array[cells] = of_cells / (total if total > 0 else 1.0)
        shares.x.scatter_forward()
        fields["gap_share"] = shares
    return fields


def _tensors(body: BodyBounds, mandel: Floats) -> fem.Function:
    """Mandel vectors of the cells as 3×3 tensors."""
    mesh = body.problem.tagged_mesh.mesh
    space = fem.functionspace(mesh, basix.ufl.element("DG", mesh.basix_cell(), 0, shape=(3, 3)))
    function = fem.Function(space, name="lower_bound_stress")
    values = function.x.array.reshape(-1, 9)
    values[space.dofmap.list[: len(mandel), 0]] = matrices(mandel).reshape(-1, 9)
    function.x.scatter_forward()
    return function
