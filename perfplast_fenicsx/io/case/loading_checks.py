"""What of a case goes with which control."""

from collections.abc import Sequence

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.loading_options import (
    Control,
    DisplacementControl,
    LoadControl,
    StageControl,
    StrengthControl,
    WorkControl,
)
from perfplast_fenicsx.limit_analysis.body.safety_factor import check_staying
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.rigid_surface import RigidSurface
from perfplast_fenicsx.problem.declared.stage import Mover, follows
from perfplast_fenicsx.problem.declared.supports import Support


def check_loading(
    loading: Control,
    loads: Sequence[Load],
    supports: Sequence[Support | RigidSurface],
    obstacles: Sequence[Obstacle],
    contacts: Sequence[Contact],
    strained: bool,
) -> None:
    """Refuse loads and motions that do not go with the control.

    Args:
        loading: The control.
        loads: What acts.
        supports: What holds or moves the bodies.
        obstacles: What surfaces cannot penetrate.
        contacts: Some of which may overlap more and more.
        strained: Whether bodies are strained at first, or overlap so.

    Raises:
        InputError: Naming what does not fit.
    """
    if isinstance(loading, DisplacementControl):
        _check_driven(loads, (*supports, *obstacles, *contacts))
        return
    staged = isinstance(loading, StageControl)
    moving = any(follows(mover) for mover in (*supports, *obstacles, *contacts))
    settled = any(support.moves for support in supports)
    alone = (strained or settled) and isinstance(loading, LoadControl)
    if not loads and not (alone or (staged and (strained or moving))):
        raise InputError(
            "no load is given; add a [[load]] table. Without one control = 'load' goes with an"
            " interference, a temperature, an initial stress or a displacement that stays, and"
            " control = 'displacement' or stages with motions that grow."
        )
    for obstacle in obstacles:
        if any(obstacle.move) and not staged:
            raise InputError(
                f"the obstacle at '{obstacle.on}' has a move, which follows the load factor under"
                " control = 'displacement', or stages; choose one of them, or leave move out."
            )
    if isinstance(loading, StrengthControl):
        check_staying(loads)
    constant = any(load.constant for load in loads)
    stays = constant or any(support.moves for support in supports) or strained
    if not stays and isinstance(loading, LoadControl | WorkControl):
        loading.check_proportional()
    if isinstance(loading, WorkControl) and all(load.constant for load in loads):
        raise InputError(
            "control = 'work' goes with a load that grows, but all loads are constant; take"
            " constant = true from one of them, or give control = 'load', or 'bounds', which tells"
            " how many times they are carried."
        )


def _check_driven(loads: Sequence[Load], movers: Sequence[Mover]) -> None:
    """Refuse loads that grow, and motions of which there are none."""
    for load in loads:
        if not load.constant:
            raise InputError(
                f"control = 'displacement' moves supports and obstacles, but the load on"
                f" '{load.on}' is to grow; give it constant = true, or control = 'load'."
            )
    if not any(follows(mover) for mover in movers):
        raise InputError(
            "control = 'displacement' moves nothing; give a [[support]] a value, an [[obstacle]]"
            " a move, a [[rigid_surface]] a displacement or rotation, or a [[contact]] with"
            " interference constant = false."
        )
