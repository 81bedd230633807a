"""Compute volumes, area vectors and maps of cells, with bounds on the rounding errors.

The shapes follow exactly from the stored coordinates.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.balls import (
    Balls,
    U,
    contracted,
    crossed,
    norms_of,
    stacked,
    upwards,
)
from perfplast_fenicsx.proof.load_kinds import Floats


@dataclass(frozen=True)
class Shapes:
    """Volumes and area vectors of the cells, with errors.

    Attributes:
        places: Coordinates of the cells' vertices, shape (num_cells, d + 1, d).
        areas: Outward area vectors of the facets opposite each vertex, shape (num_cells, d + 1, d).
        volumes: Volumes; for a cell whose shape is lost to rounding, the ball contains zero.
    """

    places: Floats
    areas: Balls
    volumes: Balls

    @cached_property
    def least_volumes(self) -> Floats:
        """Return the volumes, bounded from below."""
        return np.maximum(self.volumes.mid - 2 * self.volumes.rad, 0.0)

    @cached_property
    def to_regular(self) -> "ToRegular":
        """Return the maps from the cells to the regular simplex."""
        d = self.places.shape[2]
        # The rows of B⁻¹ are combinations of the gradients −a/(dV).
        maps = _regular(d).T @ (self.areas.mid[:, 1:] / d)
        off = np.linalg.norm(self.areas.rad, axis=(1, 2))
        rounded = 64 * U * np.linalg.norm(self.areas.mid, axis=(1, 2))
        norms = np.linalg.norm(maps, ord=2, axis=(1, 2)) + off
        rounding = 1e-12  # relative error of norms of small matrices
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            scale = 1 / self.least_volumes
            return ToRegular(
                maps * scale[:, None, None],
                upwards((off + rounded) * scale),
                norms * scale * (1 + rounding),
            )

    @cached_property
    def stretches(self) -> Floats:
        """Return upper bounds on ‖B‖ for the maps B from the regular simplex to the cells."""
        edges = (self.places[:, 1:] - self.places[:, :1]).transpose(0, 2, 1)
        maps = edges @ np.linalg.inv(_regular(self.places.shape[2]).T)
        # relative error of norms of small matrices
        return np.linalg.norm(maps, ord=2, axis=(1, 2)) * (1 + 1e-12)


def shapes_of(places: Floats, corners: npt.NDArray[np.int64]) -> Shapes:
    """Return the shapes of cells.

    Args:
        places: Coordinates of the cells' vertices, shape (num_cells, d + 1, d).
        corners: Vertex indices of the facet opposite each vertex, shape (d + 1, d).
    """
    d, x = places.shape[2], Balls.exact(places)
    areas, heights = [], []
    for i in range(d + 1):
        first, *others = corners[i]
        edges = [x[:, k] - x[:, first] for k in others]
        if d == 2:
            area = stacked([edges[0][:, 1], -edges[0][:, 0]], 1)
        else:
            area = crossed(*edges) * Balls.exact(0.5)
        heights.append(contracted(area, x[:, first] - x[:, i]))
        sign = np.where(heights[-1].mid < 0, -1.0, 1.0)
        areas.append(area * Balls.exact(sign)[:, None])
    height = heights[0] * Balls.exact(np.sign(heights[0].mid))
    turned = np.any([np.abs(of.mid) <= 2 * of.rad for of in heights], axis=0)
    height = Balls(height.mid, height.low, np.where(turned, np.inf, height.rad))
    return Shapes(places, stacked(areas, 1), height * Balls.part(d))


@dataclass(frozen=True)
class ToRegular:
    """The maps B⁻¹ from the cells to the regular simplex with edges of length 1.

    Attributes:
        maps: Approximations of B⁻¹, shape (num_cells, d, d).
        errors: Bounds on the errors of ``maps``, as spectral norms.
        norms: Upper bounds on ‖B⁻¹‖.
    """

    maps: Floats
    errors: Floats
    norms: Floats

    def sizes(self, cells: npt.NDArray[np.int64], forces: Floats, off: Floats) -> Floats:
        """Return upper bounds on |B⁻¹F| for forces F on cells, shape (n, ...).

        Args:
            cells: The cell of each force, shape (n,).
            forces: Forces, shape (n, ..., d).
            off: Bounds on the errors of the forces, shape (n, ...).
        """
        size = norms_of(forces)
        errors, norms = (
            of[cells].reshape(-1, *(1,) * (off.ndim - 1)) for of in (self.errors, self.norms)
        )
        with np.errstate(invalid="ignore", over="ignore"):
            mapped = np.einsum("nij,n...j->n...i", self.maps[cells], forces)
            found = norms_of(mapped) + errors * size + norms * off
        found = np.where((size == 0) & (off == 0), 0.0, found)
        return upwards(np.where(np.isnan(found), np.inf, found))


def _regular(d: int) -> Floats:
    """Return the vertices of the regular simplex, without the first vertex at the origin."""
    regular = np.zeros((d + 1, d))
    for i in range(1, d + 1):
        regular[i] = regular[:i].mean(axis=0)
        regular[i, i - 1] = np.sqrt(1 - ((regular[0] - regular[i]) ** 2).sum())
    return regular[1:]
