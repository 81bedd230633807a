"""Find the pressure of a pin in its bore whose resultant on the mesh is a given force."""

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.declared.loads import Bearing, CosinePressure
from perfplast_fenicsx.problem.declared.rigid_surface import fitting


def cosine_pressure(tagged_mesh: TaggedMesh, load: Bearing) -> CosinePressure:
    """Return the pressure p = max(0, −a·n) whose resultant on the mesh is the force. Collective.

    The vector a minimises the convex function Φ(a) − F·a with Φ(a) = ½∫max(0, −a·n)². The gradient
    of Φ is the resultant.

    Raises:
        InputError: If no such pressure has this force: a pin can neither pull nor push along its
            axis.
    """
    mesh = tagged_mesh.mesh
    gdim = mesh.geometry.dim
    if tagged_mesh.kinematics.whole and gdim == 2:
        raise InputError(
            f"the bearing force on '{load.on}' is on a body of revolution, where a pin would press"
            " all around; give a pressure."
        )
    force = fitting(f"value of the bearing force on '{load.on}'", load.value, gdim)
    force = np.asarray(force / tagged_mesh.kinematics.thickness, dtype=np.float64)
    if not force.any():
        raise InputError(f"the bearing force on '{load.on}' is zero; give a force.")
    resultant = _Resultant(tagged_mesh, load.on)
    size = float(np.linalg.norm(force))
    a: Floats = np.asarray(force / resultant.area(), dtype=np.float64)
    found, slope = resultant.of(a)
    # Limit of Newton iterations. Each at least halves the error until the set of loaded facets is
    # constant.
    most_steps = 50
    left_over = 1e-11  # allowed residual force, relative to the force
    # The pressure cannot act along directions with less than this share of the largest stiffness.
    unsupported = 1e-9
    for _ in range(most_steps):
        left = force - found
        if np.linalg.norm(left) <= left_over * size:
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
        f"no pressure on '{load.on}' has the force {force.tolist()}: a pin presses across "
        "its axis, on facets that face the force; correct the force, or give it as force "
        "= [...], which may also pull."
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
