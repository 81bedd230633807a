"""Spread forces and moments on surfaces as tractions that have these resultants on the mesh."""

from collections.abc import Sequence

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.assembled.bearing import cosine_pressure
from perfplast_fenicsx.problem.assembled.total_loads import per_area
from perfplast_fenicsx.problem.declared.loads import Bearing, Force, Load, Traction
from perfplast_fenicsx.problem.declared.rigid_surface import RigidSurface, fitting
from perfplast_fenicsx.problem.declared.supports import AXES


def on_this_mesh(
    tagged_mesh: TaggedMesh, loads: Sequence[Load], rigid: Sequence[RigidSurface]
) -> list[Load]:
    """Return the loads, with whole forces replaced by tractions. Collective.

    Forces on rigid surfaces are not changed.

    Raises:
        InputError: If a surface is unknown, or if the force cannot act on it.
    """
    solid = {surface.on for surface in rigid}
    found = list[Load]()
    for load in per_area(tagged_mesh, loads):
        if isinstance(load, Force) and load.on not in solid:
            load = _linear(tagged_mesh, load)
        elif isinstance(load, Bearing):
            load = cosine_pressure(tagged_mesh, load)
        found.append(load)
    return found


def _linear(tagged_mesh: TaggedMesh, load: Force) -> Load:
    """Return the traction t = F/A + ω × (x − c) with this force and moment. Collective.

    The point c is the centroid of the surface. The vector ω is J⁻¹M with the moment M about c and J
    = ∫|r|² − r rᵀ. So the traction is linear on each straight facet, and a stress that is linear in
    the cells can balance it.
    """
    if tagged_mesh.kinematics.whole and tagged_mesh.mesh.geometry.dim == 2:
        raise InputError(
            f"the force on '{load.on}' acts on a surface of a body of revolution; give a "
            "traction along the axis with total = true, or a pressure."
        )
    gdim = tagged_mesh.mesh.geometry.dim
    what = f"of the force on '{load.on}'"
    force = fitting(f"value {what}", load.value, gdim)
    moment = fitting(f"moment {what}", load.moment, 2 * gdim - 3)
    area, centroid, second = _integrals(tagged_mesh, load.on)
    thickness = tagged_mesh.kinematics.thickness
    force, moment = (np.asarray(it / thickness, dtype=np.float64) for it in (force, moment))
    if np.size(load.point):
        arm = fitting(f"point {what}", load.point, gdim) - centroid
        moment = moment + np.atleast_1d(_cross(arm, force))
    density = force / area
    if not moment.any():
        return Traction(load.on, tuple(map(float, density)), load.name, load.constant)
    if gdim == 2:
        spin = np.array([0.0, 0.0, moment[0] / np.trace(second)])
    else:
        spin = np.linalg.solve(np.trace(second) * np.eye(3) - second, moment)
    rows = np.array([[0, -spin[2], spin[1]], [spin[2], 0, -spin[0]], [-spin[1], spin[0], 0]])
    formulas = [_formula(density[i], rows[i, :gdim], centroid) for i in range(gdim)]
    return Traction(load.on, tuple(formulas), load.name, load.constant)


def _cross(arm: Floats, force: Floats) -> Floats:
    """Return the cross product of arm and force, one number in the plane."""
    if len(arm) == 2:
        return np.array([arm[0] * force[1] - arm[1] * force[0]])
    return np.asarray(np.cross(arm, force), dtype=np.float64)


def _formula(constant: float, slopes: Floats, centroid: Floats) -> str:
    """Return one component of the traction as a formula, linear in the coordinates."""
    terms = [
        f" + {float(slope)!r}*({axis} - {float(c)!r})"
        for slope, axis, c in zip(slopes, AXES, centroid, strict=False)
        if slope
    ]
    return f"{float(constant)!r}{''.join(terms)}"


def _integrals(tagged_mesh: TaggedMesh, surface: str) -> tuple[float, Floats, Floats]:
    """Return the area, the centroid, and the second moments of area about it, shape (d, d).

    Collective.

    Raises:
        InputError: If the surface does not exist.
    """
    mesh = tagged_mesh.mesh
    tagged_mesh.facets(surface)  # raises the error for an unknown surface
    gdim = mesh.geometry.dim
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=tagged_mesh.facet_tags)
    ds = ds(tagged_mesh.surfaces[surface])
    along, across = (fem.Constant(mesh, np.zeros(gdim, default_scalar_type)) for _ in range(2))
    centre = fem.Constant(mesh, np.zeros(gdim, default_scalar_type))
    arm = ufl.SpatialCoordinate(mesh) - centre
    one = fem.Constant(mesh, default_scalar_type(1.0))
    forms = [
        fem.form(integrand * ds)
        for integrand in (
            one,
            ufl.inner(arm, along),
            ufl.inner(arm, along) * ufl.inner(arm, across),
        )
    ]

    def total(form: fem.Form) -> float:
        return float(mesh.comm.allreduce(fem.assemble_scalar(form)))

    area, axes = total(forms[0]), np.eye(gdim)
    first, second = np.zeros(gdim), np.zeros((gdim, gdim))
    for i in range(gdim):
        along.value[:] = axes[i]
        first[i] = total(forms[1]) / area
    centre.value[:] = first
    for i in range(gdim):
        for j in range(i + 1):
            along.value[:], across.value[:] = axes[i], axes[j]
            second[i, j] = second[j, i] = total(forms[2])
    return area, first, second
