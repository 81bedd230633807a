"""Turn surfaces that may share facets into surfaces that share none."""

from collections.abc import Sequence

import numpy as np

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.geometry.part_names import unique_names


class NamedSurfaces:
    """Surfaces by name, which are divided where they overlap.

    A facet has one physical name in a mesh. Facets of several surfaces become surfaces of their
    own. A name then represents several of these.
    """

    def __init__(self) -> None:
        self._members: dict[str, Longs] = {}

    def add(self, name: str, facets: Longs) -> None:
        """Add a surface, or facets to one."""
        before = self._members.get(name, np.zeros(0, dtype=np.int64))
        self._members[name] = np.union1d(before, facets)

    def names(self) -> list[str]:
        """Return the names of the surfaces, in the order of their definition."""
        return list(self._members)

    def remove(self, name: str) -> None:
        """Forget a surface."""
        del self._members[name]

    def facets(self, name: str) -> Longs:
        """Return the facets of a surface."""
        return self._members[name]

    def divided(
        self, taken: Sequence[str] = ()
    ) -> tuple[list[str], Longs, Longs, dict[str, list[str]]]:
        """Return surfaces without common facets.

        Args:
            taken: Names of bodies.

        Returns:
            Names of the surfaces; the facets, shape (k,), and the surface of each, shape (k,); the
            new surfaces that each added name represents.
        """
        names = [name for name, facets in self._members.items() if len(facets)]
        members = [self._members[name] for name in names]
        every = np.unique(np.concatenate([np.zeros(0, np.int64), *members]))
        signs = np.zeros((len(every), (len(names) + 62) // 63), dtype=np.int64)
        for number, name in enumerate(names):
            at = np.searchsorted(every, self._members[name])
            signs[at, number // 63] |= np.int64(1) << np.int64(number % 63)
        kinds, surface = np.unique(signs, axis=0, return_inverse=True)
        stands: dict[str, list[str]] = {name: [] for name in names}
        having = [
            [n for k, n in enumerate(names) if kind[k // 63] >> np.int64(k % 63) & 1]
            for kind in kinds
        ]
        plain = unique_names("_and_".join(some) for some in having)
        plain = [f"{name}_surface" if name in taken else name for name in plain]
        for called, some in zip(plain, having, strict=True):
            for name in some:
                stands[name].append(called)
        return plain, every, surface.ravel(), stands
