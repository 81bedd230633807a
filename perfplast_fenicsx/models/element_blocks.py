"""Elements of one type, as an array."""

from dataclasses import dataclass

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.models.element_types import ElementType


@dataclass(frozen=True, eq=False)
class Block:
    """Elements of one type.

    Attributes:
        kind: Their type.
        first: Number of the first one in the model; the others follow.
        nodes: Shape (n, kind.nodes), indices of points.
    """

    kind: ElementType
    first: int
    nodes: Longs
