"""A mesh whose elements and nodes are in groups with names: what Salome, Nastran and VTK give."""

from dataclasses import dataclass, field

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.models.element_blocks import Block
from perfplast_fenicsx.models.foreign_model import ForeignMaterial


@dataclass
class GroupedMesh:
    """The content of a file with groups; :func:`grouped_model.model_of` makes a model of it.

    Attributes:
        points: Shape (n, 3).
        blocks: Elements; those of block k follow those of block k - 1.
        groups: Numbers of elements by the name of their group.
        node_groups: Numbers of points by the name of their group.
        materials: Materials by the name of the group of elements that has it.
        left_out: How many elements of types that the program does not know, by type.
        turned: Whether a plane mesh is half a section about an axis; None where nothing says that.
        remarks: Remarks on what has no counterpart, a sentence each.
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
        """Elements in all."""
        return sum(len(block.nodes) for block in self.blocks)

    def dimensions(self) -> Longs:
        """Return the dimension of each element, shape (count,)."""
        dims = [np.full(len(block.nodes), block.kind.shape.dim) for block in self.blocks]
        return np.concatenate([np.zeros(0, dtype=np.int64), *dims])
