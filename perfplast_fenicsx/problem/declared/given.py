"""What a problem declares, whatever its mesh."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.contact.declared.tie import Tie
from perfplast_fenicsx.materials.law import Material
from perfplast_fenicsx.problem.declared.initial import Initial
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.rigid_surface import RigidSurface
from perfplast_fenicsx.problem.declared.supports import Support


@dataclass(frozen=True)
class Given:
    """The arguments of :class:`problem.Problem`, but for the mesh; it says what they mean."""

    materials: Mapping[str, Material]
    supports: Sequence[Support]
    loads: Sequence[Load]
    contacts: Sequence[Contact]
    obstacles: Sequence[Obstacle]
    degree: int
    initial: Sequence[Initial]
    ties: Sequence[Tie]
    rigid: Sequence[RigidSurface]

    @property
    def holding(self) -> list[Support | RigidSurface]:
        """Supports, and rigid surfaces whose motion is known, be it in part."""
        known = (surface for surface in self.rigid if surface.held or not surface.free)
        return [*self.supports, *known]
