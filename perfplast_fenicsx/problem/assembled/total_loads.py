"""Convert tractions that are given as the whole force on a surface to forces per area."""

from collections.abc import Sequence
from dataclasses import replace

import ufl
from dolfinx import default_scalar_type, fem

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.declared.loads import Load, Traction


def per_area(tagged_mesh: TaggedMesh, loads: Sequence[Load]) -> list[Load]:
    """Return the loads, with each total force divided by the area of its surface in the mesh.

    Collective.

    So the total force is exact, though the facets have a little less area than a round surface.

    Raises:
        InputError: If a total force is a formula, or if its surface is unknown.
    """
    found = list[Load]()
    for load in loads:
        if isinstance(load, Traction) and load.total:
            if any(isinstance(number, str) for number in load.value):
                raise InputError(
                    f"the traction on '{load.on}' is a formula, but total = true needs "
                    "numbers; remove one of them."
                )
            area = area_of(tagged_mesh, load.on)
            density = [float(number) / area for number in load.value]
            load = replace(load, value=tuple(density), total=False)
        found.append(load)
    return found


def area_of(tagged_mesh: TaggedMesh, surface: str) -> float:
    """Return the area of a surface: in the plane its length, in axisymmetry of a full turn.

    Collective.

    Raises:
        InputError: If the surface does not exist.
    """
    mesh = tagged_mesh.mesh
    tagged_mesh.facets(surface)  # raises the error for an unknown surface
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=tagged_mesh.facet_tags)
    one = fem.Constant(mesh, default_scalar_type(1.0))
    form = one * tagged_mesh.kinematics.measure(ds)(tagged_mesh.surfaces[surface])
    whole = mesh.comm.allreduce(fem.assemble_scalar(fem.form(form)))
    return float(whole * tagged_mesh.kinematics.thickness)
