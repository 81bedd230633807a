"""Determine the kind of a face from its curvatures, for spline faces."""

import gmsh
import numpy as np

from perfplast_fenicsx.geometry.joints import box


def kind_of(dim: int, tag: int) -> str:
    """Return gmsh's kind of a face or curve; "Plane", "Cylinder" or "Sphere" for splines."""
    kind = str(gmsh.model.getType(dim, tag))
    # Gmsh's kinds, in lower case, that may be planes, cylinders or spheres.
    untold = ("bspline surface", "bezier surface", "surface of revolution", "unknown")
    if dim != 2 or kind.lower() not in untold:
        return kind
    low, high = map(np.asarray, gmsh.model.getParametrizationBounds(2, tag))
    # Shares of each parameter at which curvatures are evaluated, as ends may be poles.
    samples = (0.2, 0.4, 0.6, 0.8)
    shares = np.stack(np.meshgrid(samples, samples), axis=-1).reshape(-1, 2)
    large, small, _, _ = gmsh.model.getPrincipalCurvatures(
        tag, (low + shares * (high - low)).ravel()
    )
    around = box(2, [tag])
    size = float(np.linalg.norm(around[1] - around[0]))
    both = np.sort(np.abs(np.column_stack([large, small])), axis=1) * size
    if not np.isfinite(both).all():
        return kind
    # Curvature that counts as zero, relative to the size of the face, and tolerance of equal ones.
    straight, same = 1e-5, 1e-4
    if both.max() < straight:
        return "Plane"
    alike = np.ptp(both, axis=0) < same * both.max()
    if not alike[1]:
        return kind
    if both[:, 0].max() < straight:
        return "Cylinder"
    if alike[0] and np.abs(both[:, 1] - both[:, 0]).max() < same * both.max():
        return "Sphere"
    return kind
