"""L(v), the work of the loads of ζ = 1."""

from collections.abc import Sequence

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.loads import BodyForce, Load, Pressure


def work_form(tagged_mesh: TaggedMesh, loads: Sequence[Load], v: ufl.Argument) -> ufl.Form:
    """The linear form L(v) of all loads.

    Raises:
        InputError: No load at all, an unknown name, or a value that is not finite.
    """
    if not loads:
        raise InputError("no load is given, so nothing can be increased; give at least one load.")
    mesh = tagged_mesh.mesh
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=tagged_mesh.facet_tags)
    dx = ufl.Measure("dx", domain=mesh, subdomain_data=tagged_mesh.cell_tags)
    terms = []
    for load in loads:
        kind = type(load).__name__.lower()
        value = np.atleast_1d(np.asarray(load.value, dtype=default_scalar_type))
        expected = 1 if isinstance(load, Pressure) else mesh.geometry.dim
        if value.shape != (expected,) or not np.isfinite(value).all():
            raise InputError(
                f"the {kind} on '{load.on}' is {load.value}, where {expected} finite"
                f" number{'s are' if expected > 1 else ' is'} needed; correct its value."
            )
        if isinstance(load, BodyForce):
            tagged_mesh.cells(load.on)
            tag = tagged_mesh.volumes[load.on]
            terms.append(ufl.inner(fem.Constant(mesh, value), v) * dx(tag))
        else:
            tagged_mesh.facets(load.on)
            tag = tagged_mesh.surfaces[load.on]
            density = (
                -fem.Constant(mesh, value[0]) * ufl.FacetNormal(mesh)
                if isinstance(load, Pressure)
                else fem.Constant(mesh, value)
            )
            terms.append(ufl.inner(density, v) * ds(tag))
    return sum(terms[1:], start=terms[0])
