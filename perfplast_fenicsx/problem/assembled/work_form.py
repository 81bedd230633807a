"""Build L(v), the work of loads, as a form."""

from collections.abc import Sequence

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem

from perfplast_fenicsx.arrays import Ints
from perfplast_fenicsx.errors import InputError, on_all_ranks, raise_together
from perfplast_fenicsx.formulas import evaluate
from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.assembled.linear_tractions import linear_pores
from perfplast_fenicsx.problem.declared.loads import (
    EnclosedPores,
    FieldPores,
    ForceBelow,
    Formula,
    SpreadLoad,
    kind_of,
)


def work_form(tagged_mesh: TaggedMesh, loads: Sequence[SpreadLoad], v: ufl.Argument) -> ufl.Form:
    """Return the linear form L(v) of at least one load, without forces on rigid surfaces.

    Collective.

    Raises:
        InputError: For an unknown name, a value that is not finite, or an invalid formula.
    """
    mesh = tagged_mesh.mesh
    kinematics = tagged_mesh.kinematics
    ds, dx = (
        kinematics.measure(ufl.Measure(kind, domain=mesh, subdomain_data=tags))
        for kind, tags in (("ds", tagged_mesh.facet_tags), ("dx", tagged_mesh.cell_tags))
    )
    terms = []
    for load in loads:
        value = _value(tagged_mesh, load)
        tag = (tagged_mesh.volumes if load.in_volume else tagged_mesh.surfaces)[load.on]
        terms.append(load.work(value, v, tagged_mesh) * (dx if load.in_volume else ds)(tag))
    return sum(terms[1:], start=terms[0])


def _value(tagged_mesh: TaggedMesh, load: SpreadLoad) -> Expr:
    """Return the value of a load in UFL, a scalar or a vector with an entry for each direction."""
    mesh = tagged_mesh.mesh
    in_volume, scalar = load.in_volume, load.scalar
    entities = tagged_mesh.cells(load.on) if in_volume else tagged_mesh.facets(load.on)
    values: list[Formula] = [load.value] if scalar else list(load.value)  # type: ignore[list-item, arg-type]
    expected = 1 if scalar else mesh.geometry.dim
    numbers = [value for value in values if not isinstance(value, str)]
    if len(values) != expected or not np.isfinite(np.asarray(numbers, dtype=float)).all():
        raise InputError(
            f"the {_kind(load)} on '{load.on}' is {load.value}, but it needs {expected} "
            f"finite number{'s' if expected > 1 else ''}; correct its value."
        )
    if isinstance(load, ForceBelow):
        return ufl.as_vector(values) * _below(tagged_mesh, load)
    if len(numbers) == len(values):
        constant = fem.Constant(mesh, np.asarray(values, dtype=default_scalar_type))
        return constant[0] if scalar else constant
    tdim = mesh.topology.dim
    found = [_field(tagged_mesh, load, value, tdim - (not in_volume), entities) for value in values]
    return found[0] if scalar else ufl.as_vector(found)


def _below(tagged_mesh: TaggedMesh, load: ForceBelow) -> fem.Function:
    """Return the function that is 1 in the cells below the line of a load and 0 elsewhere.

    Collective.

    Raises:
        InputError: If the line divides a cell.
    """
    field = fem.Function(fem.functionspace(tagged_mesh.mesh, ("Discontinuous Lagrange", 0)))
    vertices, points = corners(tagged_mesh.mesh)
    cells = tagged_mesh.cells(load.on)
    owned = cells[cells < len(vertices)]

    def below() -> Ints:
        return owned[load.cells_below(points[vertices[owned]])]

    dofs = field.function_space.dofmap.list[on_all_ranks(tagged_mesh.mesh.comm, below)]
    field.x.array[dofs] = 1.0
    field.x.scatter_forward()
    return field


def _field(
    tagged_mesh: TaggedMesh, load: SpreadLoad, value: Formula, dim: int, entities: Ints
) -> fem.Function | fem.Constant:
    """Return a number, or a formula at nodes of quadratic cells; 0 outside the load."""
    mesh = tagged_mesh.mesh
    if not isinstance(value, str):
        return fem.Constant(mesh, default_scalar_type(value))
    if isinstance(load, EnclosedPores | FieldPores):
        linear = fem.Function(fem.functionspace(mesh, ("Discontinuous Lagrange", 1)))
        vertices, points = corners(mesh)
        owned = entities[entities < len(vertices)]
        values, _ = on_all_ranks(mesh.comm, lambda: linear_pores(load, points[vertices[owned]]))
        linear.x.array[linear.function_space.dofmap.list[owned]] = values
        linear.x.scatter_forward()
        return linear
    W = fem.functionspace(mesh, ("Lagrange", 2))
    field, message = fem.Function(W), None
    if dim == mesh.topology.dim:
        nodes = np.unique(W.dofmap.list[entities])
    else:
        nodes = fem.locate_dofs_topological(W, dim, entities)
    try:
        x = W.tabulate_dof_coordinates()[nodes]
        field.x.array[nodes] = evaluate(value, x, f"the {_kind(load)} on '{load.on}'")
    except InputError as error:
        message = str(error)
    raise_together(mesh.comm, message)
    return field


def _kind(load: SpreadLoad) -> str:
    """Return the name of a load for messages."""
    kind = kind_of(load).replace("_", " ")
    return f"{kind} '{load.name}'" if load.name else kind
