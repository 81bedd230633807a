"""Loads of one kind, as they are on file: a force per volume of each cell, tractions of facets."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

SOUGHT = ("body_force", "traction")
"""Loads whose factor is bounded, by the names of their arrays."""

CONSTANT = ("constant_body_force", "constant_traction")
"""Those that stay as they are; a file without them has none."""

ANY = ("any_body_force", "any_traction")
"""Those that may have any factor."""


def with_all(arrays: Mapping[str, npt.NDArray]) -> dict[str, npt.NDArray]:
    """Arrays with zeros for the loads of which a file has none."""
    none = {
        name: np.zeros_like(arrays[like])
        for names in (CONSTANT, ANY)
        for name, like in zip(names, SOUGHT, strict=True)
        if name not in arrays and like in arrays
    }
    return {**arrays, **none}


@dataclass(frozen=True)
class Loads:
    """Loads.

    Attributes:
        body_force: Force per volume, shape (num_cells, d).
        traction: Force per area at the vertices of facets, linear between, (num_facets, d, d).
    """

    body_force: Floats
    traction: Floats

    def __bool__(self) -> bool:
        return bool(self.body_force.any() or self.traction.any())

    def __add__(self, other: "Loads") -> "Loads":
        return Loads(self.body_force + other.body_force, self.traction + other.traction)

    def __rmul__(self, factor: float) -> "Loads":
        return Loads(factor * self.body_force, factor * self.traction)

    def size(self, volumes: Floats, areas: Floats) -> float:
        """The sum of the magnitudes of all forces."""
        on_facets = np.linalg.norm(self.traction, axis=2).mean(axis=1)
        return float(areas @ on_facets + volumes @ np.linalg.norm(self.body_force, axis=1))

    def stress(self, places: Floats) -> float:
        """A stress that they cause: the largest traction, and that of a column.

        Args:
            places: Of the cells' vertices, shape (num_cells, d + 1, d).
        """
        largest = np.linalg.norm(self.traction, axis=2).max(initial=0)
        heavy = self.body_force.any(axis=1)
        if heavy.any():
            there = places[heavy].reshape(-1, places.shape[2])
            extent = np.linalg.norm(np.ptp(there, axis=0))
            largest += np.linalg.norm(self.body_force, axis=1).max() * extent
        return float(largest)
