"""Compute the resultants of forces on rigid surfaces about the origin."""

from collections.abc import Sequence

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.problem.declared.loads import Force, Load
from perfplast_fenicsx.problem.declared.rigid_surface import RigidSurface, fitting, turned


def rigid_resultants(
    surfaces: Sequence[RigidSurface], loads: Sequence[Load], gdim: int
) -> tuple[Floats, Floats]:
    """Return the force and moment on each of some rigid surfaces for ζ = 1.

    Args:
        surfaces: Rigid surfaces.
        loads: Loads; only the forces on these surfaces count.
        gdim: 2 or 3.

    Returns:
        The forces, shape (num_surfaces, gdim), and the moments about the origin, shape
        (num_surfaces, 1 or 3).
    """
    numbers = {surface.on: number for number, surface in enumerate(surfaces)}
    forces = np.zeros((len(surfaces), gdim))
    moments = np.zeros((len(surfaces), 2 * gdim - 3))
    for load in loads:
        if isinstance(load, Force) and load.on in numbers:
            what = f"of the force on '{load.on}'"
            force = fitting(f"value {what}", load.value, gdim)
            point = fitting(f"point {what}", load.point, gdim)
            forces[numbers[load.on]] += force
            moments[numbers[load.on]] += fitting(f"moment {what}", load.moment, 2 * gdim - 3)
            moments[numbers[load.on]] += moments_of(point[None], force[None])[0]
    return forces, moments


def moments_of(arms: Floats, forces: Floats) -> Floats:
    """Return moments of forces, both of shape (n, gdim); the moments have shape (n, 1 or 3)."""
    axes = np.eye(2 * arms.shape[1] - 3)
    return np.stack([np.einsum("ni,ni->n", turned(e, arms), forces) for e in axes], axis=1)
