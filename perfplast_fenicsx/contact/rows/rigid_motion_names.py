"""Describe rigid motions in words: rotation or translation, with the axis."""

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.mesh.connected_bodies import Bodies


def motion_name(bodies: Bodies, v: Floats, middle: Floats | None = None) -> str:
    """Return a rigid motion of a body in words.

    Args:
        bodies: Bodies with their rigid motions.
        v: Coefficients of the motion, shape (num_modes,).
        middle: Position of the body, shape (gdim,): a motion that hardly rotates there is a
            translation. None accepts only exact translations.
    """
    gdim = bodies.gdim
    if bodies.num_modes == 1:
        return bodies.kinematics.motions[0]
    spin = v[gdim:]
    if middle is None:
        along = v[:gdim]
        # Share of rotation in a rigid motion that makes it a rotation, if the body's position is
        # unknown.
        least_spin = 1e-6
        turns = np.linalg.norm(spin) > least_spin * np.linalg.norm(v)
    else:
        along = bodies.rigid_modes(np.pad(middle, (0, 3 - gdim))[None])[0] @ v
        turns = np.linalg.norm(along) <= np.linalg.norm(spin)
    if not turns:
        return f"translation {_direction(along, 'in')}"
    return f"rotation {_direction(spin, 'about')}" if gdim == 3 else "rotation"


def _direction(d: Floats, axis: str) -> str:
    """Return a unit vector in words, first large component positive; an axis by its letter."""
    d = d / np.linalg.norm(d)
    d *= np.sign(d[np.argmax(np.abs(d))])
    rounded = np.round(d, 2) + 0.0
    if np.count_nonzero(rounded) == 1:
        return f"{axis} {'xyz'[int(np.argmax(rounded))]}"
    oblique = "along" if axis == "in" else axis
    return f"{oblique} (" + ", ".join(f"{a:.2f}" for a in rounded) + ")"
