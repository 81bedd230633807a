"""Loads and motions of a case, and the refusals that most controls share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.declared.initial import Initial
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.rigid_surface import RigidSurface
from perfplast_fenicsx.problem.declared.stage import Mover, follows
from perfplast_fenicsx.problem.declared.supports import Support


@dataclass(frozen=True)
class Given:
    """Loads and motions of a case.

    Attributes:
        loads: The loads.
        supports: Supports that hold or move the bodies.
        obstacles: Rigid obstacles.
        contacts: Some of which may overlap more and more.
        strained: Whether bodies are strained at first, or overlap so.
        initial: Initial strains and stresses.
        materials: Materials of the bodies by name.
    """

    loads: Sequence[Load]
    supports: Sequence[Support | RigidSurface]
    obstacles: Sequence[Obstacle]
    contacts: Sequence[Contact]
    strained: bool
    initial: Sequence[Initial] = ()
    materials: Mapping[str, object] = field(default_factory=dict)

    @property
    def movers(self) -> tuple[Mover, ...]:
        """All that may move."""
        return (*self.supports, *self.obstacles, *self.contacts)

    @property
    def moving(self) -> bool:
        """Whether something follows the loading."""
        return any(follows(mover) for mover in self.movers)

    @property
    def settled(self) -> bool:
        """Whether a support is moved."""
        return any(support.moves for support in self.supports)

    @property
    def stays(self) -> bool:
        """Whether something loads the bodies before the loading does."""
        return self.strained or self.settled or any(load.constant for load in self.loads)

    def require_load(self, enough: bool = False) -> None:
        """Refuse bodies that nothing loads.

        Args:
            enough: Whether something else does that goes with the control.

        Raises:
            InputError: If there is none.
        """
        if not self.loads and not enough:
            raise InputError(
                "no load is given; add a [[load]] table. Without one control = 'load' goes with an"
                " interference, a temperature, an initial stress or a displacement that stays, and"
                " control = 'displacement' or stages with motions that grow."
            )

    def refuse_moves(self) -> None:
        """Refuse obstacles that move.

        Raises:
            InputError: Naming the first one.
        """
        for obstacle in self.obstacles:
            if any(obstacle.move):
                raise InputError(
                    f"the obstacle at '{obstacle.on}' has a move, which follows the load factor"
                    " under control = 'displacement', or stages; choose one of them, or leave move"
                    " out."
                )
