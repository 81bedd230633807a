"""Handle contacts and obstacles with adhesion c (a stress) and coefficient of friction μ.

Contact tractions with a pressure p ≥ 0 and a shear ‖τ‖ ≤ c + μp are admissible. They form a convex
set, the sum of a disc ‖τ‖ ≤ c and a cone ‖τ‖ ≤ μp. With associated slip w_t, the surfaces separate
by w_n ≥ μ‖w_t‖, and the dissipation is c‖w_t‖.
"""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

OF = {
    "contact_adhesion": "contacts",
    "contact_friction": "contacts",
    "obstacle_adhesion": "obstacles",
    "obstacle_friction": "obstacles",
}
"""Arrays with one number for each entry of another array; zeros if a file does not have them."""


def with_rubbing(arrays: Mapping[str, npt.NDArray]) -> dict[str, npt.NDArray]:
    """Return the arrays, without contacts if they are missing, and with zeros for missing terms."""
    axes = np.shape(arrays.get("vertices", ()))[1:]
    arrays = {
        "contacts": np.zeros((0, 2), dtype=np.int64),
        "obstacles": np.zeros(0, dtype=np.int64),
        "obstacle_normals": np.zeros((0, *axes)),
        **arrays,
    }
    none = {
        name: np.zeros(np.asarray(arrays[of]).shape[:1])
        for name, of in OF.items()
        if name not in arrays and of in arrays
    }
    return {**arrays, **none}


def fault_of(values: Floats) -> str | None:
    """Return the fault in values of adhesion or friction in words, or None."""
    fine = (values >= 0) & np.isfinite(values)
    return None if fine.all() else "is negative or not finite"


def loose(adhesion: Floats, friction: Floats) -> bool:
    """Return whether any contact with friction separates without dissipation."""
    return bool(((friction > 0) & (adhesion == 0)).any())


def excess(shear: Floats, pressure: Floats, adhesion: Floats, friction: Floats) -> Floats:
    """Return the parts of shear tractions beyond μp, relative to the adhesion.

    The returned values are at most 1 for admissible tractions. A stress divided by the largest
    value is admissible, because the admissible set contains 0. Without adhesion, the value is 0,
    and :func:`unheld` decides whether the traction is admissible.

    Args:
        shear: ‖τ‖ at the vertices of facets, shape (n, d).
        pressure: Pressure at the vertices of facets, shape (n, d).
        adhesion: Adhesion of each facet, shape (n,).
        friction: Friction of each facet, shape (n,).
    """
    beyond = shear - friction[:, None] * pressure
    adheres = adhesion > 0
    ratios: Floats = np.zeros_like(beyond)
    ratios[adheres] = np.maximum(beyond[adheres], 0.0) / adhesion[adheres, None]
    return ratios


def unheld(shear: Floats, pressure: Floats, adhesion: Floats, friction: Floats) -> Floats:
    """Return the parts of shear tractions beyond μp, 0 with adhesion; see :func:`excess`."""
    beyond = np.maximum(shear - friction[:, None] * pressure, 0.0)
    return np.where(adhesion[:, None] > 0, 0.0, beyond)
