"""Store the loads of one kind, as in the file.

Loads are a force per volume of each cell, tractions on facets, and pore pressures in cells.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

NAMES = ("body_force", "traction", "pore_pressure", "rigid_force", "rigid_moment")
"""Names of the arrays that describe loads of one kind."""

KINDS = ("", "constant_", "any_")
"""Prefixes of the arrays by kind: sought loads (their factor is bounded), constant loads, and free
loads (of any factor). A file without the arrays of a kind has no such loads."""

EVERY = tuple(f"{kind}{name}" for kind in KINDS for name in NAMES)
"""Names of all arrays of loads."""


def with_all(arrays: Mapping[str, npt.NDArray]) -> dict[str, npt.NDArray]:
    """Return the arrays, with zeros for loads that the file does not contain."""
    axes, cells, facets = (np.shape(arrays.get(of, ())) for of in ("vertices", "cells", "facets"))
    d = axes[1:]
    rigid = (*np.shape(arrays.get("rigid", ())), *d)
    shapes = {
        "body_force": (*cells[:1], *d),
        "traction": (*facets, *d),
        "pore_pressure": cells,
        "rigid_force": rigid,
        "rigid_moment": (*rigid[:-1], *(2 * each - 3 for each in d)),
    }
    none = {
        f"{kind}{name}": np.zeros(shape)
        for kind in KINDS
        for name, shape in shapes.items()
        if f"{kind}{name}" not in arrays
    }
    return {**arrays, **none}


ALIKE = 2.0**-48
"""Largest difference between equal numbers of both halves, relative to their size: 32 times the
largest rounding error of one operation, for values between the vertices of another mesh."""


@dataclass(frozen=True)
class Loads:
    """The loads of one kind.

    Attributes:
        body_force: Force per volume, shape (num_cells, d).
        traction: Force per area at the vertices of facets, linear on each facet, shape (num_facets,
            d, d).
        pore_pressure: Pore pressure u at the vertices of cells, linear in each cell, shape
            (num_cells, d + 1). The cones bound effective stresses σ′; the stress in equilibrium is
            σ′ − uI.
        rigid_force: Force on each rigid surface, shape (num_rigid, d).
        rigid_moment: Moment on each rigid surface about the origin, shape (num_rigid, 1 or 3).
    """

    body_force: Floats
    traction: Floats
    pore_pressure: Floats
    rigid_force: Floats
    rigid_moment: Floats

    def __bool__(self) -> bool:
        return any(getattr(self, name).any() for name in NAMES)

    def __add__(self, other: "Loads") -> "Loads":
        return Loads(*(getattr(self, name) + getattr(other, name) for name in NAMES))

    def __rmul__(self, factor: float) -> "Loads":
        return Loads(*(factor * getattr(self, name) for name in NAMES))

    def total(self, stress: Floats) -> Floats:
        """Return total stresses, from effective stresses at the cells' vertices."""
        return stress - self.pore_pressure[..., None, None] * np.eye(stress.shape[-1])

    def same(self, other: "Loads") -> bool:
        """Return whether other loads are exactly equal to these loads."""
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in NAMES)

    def pore_work(self, volumes: Floats, growth: Floats) -> float:
        """Return ∫u div v, without integration error.

        Args:
            volumes: Volumes of the cells.
            growth: div v at the cells' vertices, linear in each cell, shape (num_cells, d + 1).
        """
        n = growth.shape[1]
        sums = self.pore_pressure.sum(axis=1) * growth.sum(axis=1)
        sums += np.einsum("cv,cv->c", self.pore_pressure, growth)
        return float(volumes @ sums) / (n * (n + 1))

    def sizes(self, volumes: Floats, areas: Floats) -> tuple[Floats, Floats]:
        """Return magnitudes of the forces in cells, including pore pressures, and on facets."""
        d = self.body_force.shape[1]
        pores = volumes ** ((d - 1) / d) * np.abs(self.pore_pressure).mean(axis=1)
        in_cells = volumes * np.linalg.norm(self.body_force, axis=1) + pores
        return in_cells, areas * np.linalg.norm(self.traction, axis=2).mean(axis=1)

    def stress(self, places: Floats) -> float:
        """Return the sum of the largest traction, pore pressure and column pressure of the loads.

        Args:
            places: Coordinates of the cells' vertices, shape (num_cells, d + 1, d).
        """
        largest = np.linalg.norm(self.traction, axis=2).max(initial=0)
        largest += np.abs(self.pore_pressure).max(initial=0)
        heavy = self.body_force.any(axis=1)
        if heavy.any():
            there = places[heavy].reshape(-1, places.shape[2])
            extent = np.linalg.norm(np.ptp(there, axis=0))
            largest += np.linalg.norm(self.body_force, axis=1).max() * extent
        return float(largest)
