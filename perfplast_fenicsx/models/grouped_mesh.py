"""Represent a mesh whose elements and nodes are in named groups, as in Salome, Nastran and VTK."""

from dataclasses import dataclass, field

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.models.element_blocks import Block
from perfplast_fenicsx.models.foreign_model import ForeignMaterial


@dataclass
class GroupedMesh:
    """The content of a file with groups; :func:`grouped_model.model_of` turns it into a model.

    Attributes:
        points: Coordinates of the points, shape (n, 3).
        blocks: Blocks of elements; their numbers continue from block to block.
        groups: Numbers of elements by group name.
        node_groups: Numbers of points by group name.
        materials: Materials by the name of their group of elements.
        left_out: Number of elements of unsupported types, by type.
        turned: Whether a plane mesh is half a section about an axis; None if the file does not say
            so.
        remarks: Remarks on parts without a counterpart, a sentence each.
    """

    points: Floats
    blocks: list[Block]
    groups: dict[str, Longs] = field(default_factory=dict)
    node_groups: dict[str, Longs] = field(default_factory=dict)
    materials: dict[str, ForeignMaterial] = field(default_factory=dict)
    left_out: dict[str, int] = field(default_factory=dict)
    turned: bool | None = None
    remarks: list[str] = field(default_factory=list)

    @property
    def count(self) -> int:
        """Total number of elements."""
        return sum(len(block.nodes) for block in self.blocks)

    def dimensions(self) -> Longs:
        """Return the dimension of each element, shape (count,)."""
        dims = [np.full(len(block.nodes), block.kind.shape.dim) for block in self.blocks]
        return np.concatenate([np.zeros(0, dtype=np.int64), *dims])
