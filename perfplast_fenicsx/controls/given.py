"""Store loads and motions of a case, and the checks that most controls share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.declared.initial import Initial
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.stage import Mover, follows
from perfplast_fenicsx.problem.declared.supports import RigidSurface, Support


@dataclass(frozen=True)
class Given:
    """Loads and motions of a case.

    Attributes:
        loads: The loads.
        supports: Supports that hold or move the bodies.
        obstacles: Rigid obstacles.
        contacts: Contacts, some of which may have a growing overlap.
        strained: Whether bodies have initial strain or overlap.
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
        """Return all objects that may move."""
        return (*self.supports, *self.obstacles, *self.contacts)

    @property
    def moving(self) -> bool:
        """Return whether some motion follows the loading."""
        return any(follows(mover) for mover in self.movers)

    @property
    def settled(self) -> bool:
        """Return whether a support has a prescribed motion."""
        return any(support.moves for support in self.supports)

    @property
    def stays(self) -> bool:
        """Return whether the bodies are loaded before the loading begins."""
        return self.strained or self.settled or any(load.constant for load in self.loads)

    def require_load(self, enough: bool = False) -> None:
        """Refuse bodies without loads.

        Args:
            enough: Whether something other than a load is enough for the control.

        Raises:
            InputError: If there is no load.
        """
        if not self.loads and not enough:
            raise InputError(
                "no load is given; add a [[load]] table. Without a load, control = 'load' "
                "needs an interference, a temperature, an initial stress or a constant "
                "displacement; control = 'displacement' or stages need motions that grow."
            )

    def refuse_moves(self) -> None:
        """Refuse obstacles that move.

        Raises:
            InputError: Naming the first moving obstacle.
        """
        for obstacle in self.obstacles:
            if any(obstacle.move):
                raise InputError(
                    f"the obstacle at '{obstacle.on}' has a move, which follows the load "
                    "factor only under control = 'displacement' or in stages; choose one "
                    "of them, or remove move."
                )
