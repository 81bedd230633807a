"""Handle facets that are held along one direction, in addition to held components.

Planes of symmetry are an example. Along the direction, the velocity has no component, and the
traction may have any component, as for held components. Therefore this traction component does no
work. The direction is the normal of a flat surface.
"""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.load_kinds import ALIKE, Floats

Flags = npt.NDArray[np.bool_]


def with_guided(arrays: Mapping[str, npt.NDArray]) -> dict[str, npt.NDArray]:
    """Return the arrays, with zero directions if the file has none."""
    if "guided" in arrays or "facets" not in arrays:
        return dict(arrays)
    return {**arrays, "guided": np.zeros(np.shape(arrays["facets"]))}


def left_free(vectors: Floats, held: Flags, guided: Floats) -> Floats:
    """Return the components of vectors at facets along free directions.

    Args:
        vectors: Vectors, shape (num_facets, n, d).
        held: Held components, shape (num_facets, d).
        guided: Unit vectors of additional held directions, 0 without such a direction, of the same
            shape.
    """
    free = vectors * ~held[:, None]
    along = np.where(held, 0.0, guided)
    squares = np.einsum("fi,fi->f", along, along)
    squares[squares == 0] = 1.0
    parts = np.einsum("fni,fi->fn", free, along) / squares[:, None]
    free -= parts[..., None] * along[:, None]
    rounding = 1e-12
    free[np.abs(free) <= rounding * np.abs(vectors).max(axis=2, keepdims=True)] = 0.0
    return free


def differ(one: Floats, other: Floats, held: Flags, far: Floats) -> Flags:
    """Return flags of directions that differ, except by rounding or by their sign, shape (n,).

    The function compares unit vectors along the parts of directions that are not held.

    Args:
        one: Directions, shape (n, d).
        other: Other directions, of the same shape.
        held: Held components, of the same shape.
        far: Largest coordinates of the facets over their extents, shape (n,); the rounding of
            coordinates changes the normals of facets.
    """
    one, other = (np.where(held, 0.0, of) for of in (one, other))
    sizes = [np.linalg.norm(of, axis=1, keepdims=True) for of in (one, other)]
    one, other = (
        of / np.where(size > 0, size, 1.0) for of, size in zip((one, other), sizes, strict=True)
    )
    apart = [np.abs(one + sign * other).max(axis=1, initial=0) for sign in (-1, 1)]
    return np.asarray(np.minimum(*apart) > ALIKE * (1 + far))
