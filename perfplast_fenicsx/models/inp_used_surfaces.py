"""Collect the surfaces that statements of an ``.inp`` file refer to, and invalid ones."""

from collections.abc import Sequence

import numpy as np

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.models.element_facets import ElementFacets
from perfplast_fenicsx.models.inp_keywords import Keyword
from perfplast_fenicsx.models.inp_mesh import Assembly
from perfplast_fenicsx.models.named_surfaces import NamedSurfaces


def missing(what: str, name: str) -> InputError:
    """Return the error for a statement on a set or surface that the file does not have."""
    return InputError(
        f"{what} refers to '{name}', which the file does not have; export the model with all its"
        " sets and surfaces, or mend the name."
    )


class UsedSurfaces:
    """Surfaces by name, by sets of nodes and by faces, as statements refer to them.

    Attributes:
        remarks: Remarks on sets that are no surfaces.
    """

    def __init__(self, assembly: Assembly, find: ElementFacets, dim: int) -> None:
        """Store the mesh.

        Args:
            assembly: The mesh.
            find: Search of facets.
            dim: Dimension: 3, or 2 in the plane.
        """
        self._assembly, self._find, self._dim = assembly, find, dim
        self._named = NamedSurfaces()
        self._facets: dict[str, Longs] = {}
        self._no_surface: dict[str, list[str]] = {}
        self.remarks: list[str] = []

    def declare(self, keyword: Keyword) -> None:
        """Read a ``*SURFACE``."""
        name = keyword.option("NAME")
        every: list[Longs] = [np.zeros(0, dtype=np.int64)]
        for row in keyword.rows():
            kind = "NSET" if keyword.option("TYPE") == "NODE" else "ELSET"
            members = self._assembly.members(kind, row[0]) if row else None
            if members is None:
                raise missing(f"*SURFACE '{name}'", ", ".join(row[:1]))
            if kind == "NSET":
                every.append(self._find.of_nodes(members))
            elif self._is_flat(members):
                every.append(self._find.of_flat_elements(members))
            else:
                face = row[1].upper() if len(row) > 1 else ""
                every.append(self._find.of_faces(members, face))
        self._facets[name] = np.unique(np.concatenate(every))

    def use(self, name: str, facets: Longs) -> str:
        """Add facets under a name, and return the name."""
        self._named.add(name, facets)
        return name

    def of_nodes(self, name: str, what: str) -> str | None:
        """Return a set of nodes as a surface; None and a remark on ``what`` if it is no surface."""
        nodes = self._assembly.members("NSET", name)
        if nodes is None:
            raise missing(what, name)
        facets = self._find.of_nodes(nodes)
        if not self._find.covered(nodes, facets):
            self._no_surface.setdefault(what, []).append(name)
            return None
        return self.use(name, facets)

    def named(self, name: str, what: str) -> str | None:
        """Return a surface of a ``*SURFACE``; None and a remark on ``what`` without outer faces."""
        facets = self._facets.get(name.upper())
        if facets is None:
            raise missing(what, name)
        if not len(facets):
            self.remarks.append(
                f"{what} on the surface '{name}', which has no outer face, is left out"
            )
            return None
        return self.use(name.upper(), facets)

    def area(self, name: str) -> float:
        """Return the area of a surface that is used."""
        return float(self._find.areas(self._named.facets(name)).sum())

    def divided(self, taken: Sequence[str]) -> tuple[list[str], Longs, Longs, dict[str, list[str]]]:
        """Divide the surfaces as :meth:`NamedSurfaces.divided`, and complete ``remarks``."""
        most_shown = 5  # number of names that a remark shows
        for what, names in self._no_surface.items():
            shown = ", ".join(repr(name) for name in names[:most_shown])
            more = f" and {len(names) - most_shown} more" if len(names) > most_shown else ""
            self.remarks.append(
                f"{what} on {shown}{more}, whose nodes are no surface, is left out; give it to a"
                " set that has all nodes of some outer faces"
            )
        self._no_surface.clear()
        return self._named.divided(taken)

    def _is_flat(self, elements: Longs) -> bool:
        """Return whether the elements of a set are surface elements."""
        blocks = [b for b in self._assembly.blocks if b.kind.shape.dim == self._dim]
        solid = [np.arange(b.first, b.first + len(b.nodes)) for b in blocks]
        return not np.isin(elements, np.concatenate(solid)).any()
