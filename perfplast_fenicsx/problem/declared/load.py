"""Define the interface of all loads."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:  # code that reads results for pictures and reports does not import DOLFINx
    from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh

Formula = float | str
"""A number, or a formula in x, y, z."""

Quantities = Mapping[str, str]


class Load:
    """The interface of a load.

    Attributes:
        words: Name in reports.
        quantities: Units of its fields, by the keys of :meth:`units.Units.table`: of ``value``,
            which case files name after the load's kind, and of other fields that are loads on their
            own.
        in_volume: Whether ``on`` is a volume rather than a surface.
        on: Physical surface or volume.
        value: A number or formula, or one for each direction.
        name: Name in messages and stages.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
    """

    words: ClassVar[str]
    quantities: ClassVar[Quantities]
    in_volume: ClassVar[bool] = False

    on: str
    value: Formula | Sequence[Formula]
    name: str
    constant: bool


class SpreadLoad(Load):
    """A load with a density in its volume or on its surface.

    Attributes:
        scalar: Whether ``value`` is one number or formula instead of one for each direction.
    """

    scalar: ClassVar[bool] = False

    def work(self, value: Any, v: Any, tagged_mesh: "TaggedMesh") -> Any:
        """Return the work per volume or area, the integrand of L(v).

        Args:
            value: Value of the load in UFL, a scalar or a vector.
            v: Displacement, a vector in UFL.
            tagged_mesh: The mesh.
        """
        raise NotImplementedError
