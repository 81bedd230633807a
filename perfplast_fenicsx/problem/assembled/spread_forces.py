"""Convert forces, moments and bearing forces on surfaces to tractions with the same resultants."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.assembled.rigid_rows import moments_of
from perfplast_fenicsx.problem.declared.loads import Bearing, CosinePressure, Force, Load, Traction
from perfplast_fenicsx.problem.declared.supports import AXES, RigidSurface


def cosine_pressure(tagged_mesh: TaggedMesh, load: Bearing) -> CosinePressure:
    """Return the pressure p = max(0, −a·n) whose resultant on the mesh is the force. Collective.

    The vector a minimises the convex function Φ(a) − F·a, where Φ(a) = ½∫max(0, −a·n)². The
    gradient of Φ is the resultant.

    Raises:
        InputError: If the mesh is of a body of revolution, if the force is zero, or if no such
            pressure has this resultant: a pin can neither pull nor press along its axis.
    """
    mesh = tagged_mesh.mesh
    gdim = mesh.geometry.dim
    if tagged_mesh.kinematics.whole and gdim == 2:
        raise InputError(
            f"the bearing force on '{load.on}' acts on a body of revolution, where a pin would "
            "press all around the axis; give a pressure."
        )
    force = load.vector(gdim)
    force = np.asarray(force / tagged_mesh.kinematics.thickness, dtype=np.float64)
    if not force.any():
        raise InputError(f"the bearing force on '{load.on}' is zero; give a force.")
    resultant = _Resultant(tagged_mesh, load.on)
    size, area = float(np.linalg.norm(force)), resultant.area()
    a: Floats = np.asarray(force / area, dtype=np.float64)
    found, slope = resultant.of(a)
    # Limit of Newton iterations. As soon as the set of loaded facets is constant, one iteration
    # solves the equations.
    most_steps = 50
    left_over = 1e-11  # allowed residual force, relative to the force
    # Directions with a relative stiffness below this value cannot take pressure.
    unsupported = 1e-9
    # Largest |a| relative to force / area; a whole bore has 4. Oblique facets of a coarse mesh take
    # a force along the axis only with larger values, as pressures from all sides.
    steepest = 20.0
    for _ in range(most_steps):
        left = force - found
        if np.linalg.norm(left) <= left_over * size:
            if np.linalg.norm(a) * area > steepest * size:
                break
            return CosinePressure(load.on, tuple(map(float, a)), load.name, load.constant)
        step = np.linalg.lstsq(slope, left, rcond=unsupported)[0]
        share, before = 1.0, float(np.linalg.norm(left))
        while share > 1e-3:
            trial, steep = resultant.of(a + share * step)
            if np.linalg.norm(force - trial) < before:
                break
            share /= 2
        else:
            break
        a, found, slope = a + share * step, trial, steep
    raise InputError(
        f"no pressure on '{load.on}' has the resultant {force.tolist()}: a pin presses only normal "
        "to its axis, on facets that face the force; correct the force, or give it as force = "
        "[...], which may also pull."
    )


class _Resultant:
    """The resultant of the pressure and its derivative with respect to a."""

    def __init__(self, tagged_mesh: TaggedMesh, surface: str) -> None:
        mesh = tagged_mesh.mesh
        tagged_mesh.facets(surface)  # raises the error for an unknown surface
        self.comm, self.gdim = mesh.comm, mesh.geometry.dim
        ds = ufl.Measure("ds", domain=mesh, subdomain_data=tagged_mesh.facet_tags)
        ds = ds(tagged_mesh.surfaces[surface])
        zeros = np.zeros(self.gdim, default_scalar_type)
        self.a, self.one, self.other = (fem.Constant(mesh, zeros) for _ in range(3))
        normal = ufl.FacetNormal(mesh)
        inwards, one, other = (-ufl.inner(c, normal) for c in (self.a, self.one, self.other))
        pressed = ufl.conditional(ufl.gt(inwards, 0.0), 1.0, 0.0)
        self._area = fem.form(fem.Constant(mesh, default_scalar_type(1.0)) * ds)
        self._force = fem.form(ufl.max_value(inwards, 0.0) * one * ds)
        self._slope = fem.form(pressed * one * other * ds)

    def area(self) -> float:
        """Return the area of the surface. Collective."""
        return self._total(self._area)

    def of(self, a: Floats) -> tuple[Floats, Floats]:
        """Return the force and its derivative with respect to a. Collective."""
        self.a.value[:] = a
        force, slope = np.zeros(self.gdim), np.zeros((self.gdim, self.gdim))
        for i, axis in enumerate(np.eye(self.gdim)):
            self.one.value[:] = axis
            force[i] = self._total(self._force)
            for j in range(i + 1):
                self.other.value[:] = np.eye(self.gdim)[j]
                slope[i, j] = slope[j, i] = self._total(self._slope)
        return force, slope

    def _total(self, form: fem.Form) -> float:
        return float(self.comm.allreduce(fem.assemble_scalar(form)))


def per_area(tagged_mesh: TaggedMesh, loads: Sequence[Load]) -> list[Load]:
    """Return the loads, with each total force divided by the area of its surface in the mesh.

    Collective.

    The total force is therefore exact, although plane facets have a slightly smaller area than a
    round surface.

    Raises:
        InputError: If a total force is a formula, or if its surface is unknown.
    """
    found = list[Load]()
    for load in loads:
        if isinstance(load, Traction) and load.total:
            if any(isinstance(number, str) for number in load.value):
                raise InputError(
                    f"the traction on '{load.on}' is a formula, but total = true needs "
                    "numbers; give numbers, or remove total."
                )
            area = area_of(tagged_mesh, load.on)
            density = [float(number) / area for number in load.value]
            load = replace(load, value=tuple(density), total=False)
        found.append(load)
    return found


def area_of(tagged_mesh: TaggedMesh, surface: str) -> float:
    """Return the area of a surface. Collective.

    In plane meshes it is the length times the thickness, in axisymmetry the area of the full turn.

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


def on_this_mesh(
    tagged_mesh: TaggedMesh, loads: Sequence[Load], rigid: Sequence[RigidSurface]
) -> list[Load]:
    """Return the loads, with total forces replaced by tractions on the mesh. Collective.

    Forces on rigid surfaces do not change.

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
    """Return the traction t = F/A + ω × (x − c) that has the given force and moment. Collective.

    The point c is the centroid of the surface, and ω = J⁻¹M, where M is the moment about c and J =
    ∫|r|² − r rᵀ. The traction is linear on each straight facet, so a stress that is linear in the
    cells can balance it.
    """
    if tagged_mesh.kinematics.whole and tagged_mesh.mesh.geometry.dim == 2:
        raise InputError(
            f"the force on '{load.on}' acts on a body of revolution, which is not supported; give "
            "a traction along the axis with total = true, or a pressure."
        )
    gdim = tagged_mesh.mesh.geometry.dim
    force, moment, point = load.vectors(gdim)
    area, centroid, second = _integrals(tagged_mesh, load.on)
    thickness = tagged_mesh.kinematics.thickness
    force, moment = (np.asarray(it / thickness, dtype=np.float64) for it in (force, moment))
    if np.size(load.point):
        moment = moment + moments_of((point - centroid)[None], force[None])[0]
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


def _formula(constant: float, slopes: Floats, centroid: Floats) -> str:
    """Return one component of the traction as a formula that is linear in the coordinates."""
    terms = [
        f" + {float(slope)!r}*({axis} - {float(c)!r})"
        for slope, axis, c in zip(slopes, AXES, centroid, strict=False)
        if slope
    ]
    return f"{float(constant)!r}{''.join(terms)}"


def _integrals(tagged_mesh: TaggedMesh, surface: str) -> tuple[float, Floats, Floats]:
    """Return the area, the centroid, and the second moments about the centroid, shape (d, d).

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
