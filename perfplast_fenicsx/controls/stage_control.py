"""Apply a loading by stages."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from perfplast_fenicsx.controls.control import Given, Moved, OfLevels, Run
from perfplast_fenicsx.problem.declared.initial import Bolt, Initial, Temperature
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.declared.stage import Stage, called
from perfplast_fenicsx.solvers.stage_stepping import stage_path


@dataclass(frozen=True)
class StageControl(OfLevels):
    """Loading by ``[[stage]]`` tables instead of ``[loading]``."""

    prescribes: ClassVar[Prescribed] = Prescribed.LOAD_FACTOR
    drives: ClassVar[bool] = False
    values: ClassVar[None] = None

    stages: list[Stage]

    def in_turn(self) -> Sequence[Stage]:
        """Return the stages."""
        return self.stages

    def moved(self, loads: Sequence[Load], initial: Sequence[Initial]) -> Moved:
        """Return a function that states whether a stage moves an object, from its name and surface.

        An object without a name has the name of its surface, unless a load, a temperature or a bolt
        has that name.
        """
        named = {name for stage in self.stages for name in stage.factors}
        taken = {called(load) for load in loads}
        taken |= {called(one) for one in initial if isinstance(one, Temperature)}
        taken |= {one.called for one in initial if isinstance(one, Bolt)}
        return lambda name, on: name in named or (not name and on in named - taken)

    def check(self, given: Given) -> None:
        """Refuse cases that have no loads, no motions and no initial strains."""
        given.require_load(given.strained or given.moving)

    def find(self, run: Run) -> None:
        """Solve the levels of all stages in order. Collective."""
        history = run.history
        if history is None:  # the history was made from the same stages
            raise RuntimeError("stages without a loading history")
        run.record.plan(sum(stage.steps for stage in history.stages) + history.rests_first())
        for level in stage_path(run.solver, history, run.record.iteration, run.start):
            run.record.level(level)
