"""Hold elements of one type as an array."""

from dataclasses import dataclass

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.models.element_types import ElementType


@dataclass(frozen=True, eq=False)
class Block:
    """Elements of one type.

    Attributes:
        kind: Type of the elements.
        first: Number of the first element in the model; the others follow.
        nodes: Nodes of the elements, shape (n, kind.nodes), indices of points.
    """

    kind: ElementType
    first: int
    nodes: Longs
