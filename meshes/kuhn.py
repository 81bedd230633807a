"""Divide boxes into graded layers of cubes with six tetrahedra each around one diagonal (Kuhn).

Each layer along each axis has its own direction of the diagonals. Cells of neighbouring cubes
always fit: the diagonal of a face depends only on the layers along the two axes in its plane, which
both cubes have in common. If the layers along x and y are equal, facets lie in the plane x = y.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from meshes.tetrahedra import Booleans
from perfplast_fenicsx.arrays import Floats, Longs


@dataclass(frozen=True)
class Layers:
    """Layers along an axis.

    Attributes:
        places: Coordinates of the layers' ends in ascending order, shape (n + 1,).
        back: Flags of layers whose diagonals start at the upper end, shape (n,).
    """

    places: Floats
    back: Booleans


def layers(places: Sequence[float] | Floats, signs: str = "+") -> Layers:
    """Return layers along an axis, with a sign for the diagonals of each layer, or one for all."""
    signs = signs * (len(places) - 1) if len(signs) == 1 else signs
    return Layers(np.array(places, dtype=np.float64), np.array([sign == "-" for sign in signs]))


@dataclass(frozen=True)
class Kuhn:
    """A body of cubes.

    Attributes:
        layers: Layers along each axis.
        keep: Function that returns which tetrahedra belong to the body, from their middles of shape
            (n, 3); by default all.
    """

    layers: tuple[Layers, Layers, Layers]
    keep: Callable[[Floats], Booleans] | None = None

    def cells(self) -> tuple[Floats, Longs]:
        """Return points (p, 3), and the point indices of right-handed tetrahedra (q, 4)."""
        counts = [len(along.back) for along in self.layers]
        cubes = np.array(list(product(*map(range, counts))))
        back = np.column_stack(
            [along.back[i] for along, i in zip(self.layers, cubes.T, strict=True)]
        )
        tetrahedra = []
        for order in permutations(range(3)):
            corners = np.vstack([np.zeros(3), np.cumsum(np.eye(3)[list(order)], axis=0)])
            steps = np.where(back[:, None, :], 1 - corners, corners).astype(np.int64)
            at = cubes[:, None, :] + steps
            odd = bool(np.linalg.det(corners[1:] - corners[:-1]) < 0)
            turned = (back.sum(axis=1) % 2 == 1) != odd
            at = np.where(turned[:, None, None], at[:, [1, 0, 2, 3]], at)
            tetrahedra.append(at)
        shape = [count + 1 for count in counts]
        steps = np.moveaxis(np.concatenate(tetrahedra), -1, 0)
        cells = np.asarray(np.ravel_multi_index(tuple(steps), shape), dtype=np.int64)
        every = np.meshgrid(*(along.places for along in self.layers), indexing="ij")
        x = np.stack(every, axis=-1).reshape(-1, 3)
        if self.keep is not None:
            cells = cells[self.keep(x[cells].mean(axis=1))]
        used, numbers = np.unique(cells, return_inverse=True)
        return x[used], numbers.reshape(cells.shape)
