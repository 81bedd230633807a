"""Write and show the results of a run level by level, and continue an interrupted run."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from perfplast_fenicsx.cli.run_log import RunLog, petsc_options, versions
from perfplast_fenicsx.cli.signals import Interrupts
from perfplast_fenicsx.cli.terminal import Terminal
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.io.results.checkpoints import Checkpoints, Saved
from perfplast_fenicsx.io.results.proof_file import write_proven
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.io.results.result_writer import ResultWriter
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import AdaptiveBounds, Round
from perfplast_fenicsx.limit_analysis.body.body_bounds import (
    NOT_SOUGHT,
    BodyBounds,
    Effort,
    designed,
    next_steps,
    sentence,
)
from perfplast_fenicsx.limit_analysis.body.interaction import Angles, Envelope, Proven, Proving
from perfplast_fenicsx.limit_analysis.body.safety_factor import (
    INTERRUPTED,
    FactorOfSafety,
    estimate_in_words,
    times_in_words,
)
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad, LimitMethod
from perfplast_fenicsx.limit_analysis.path.limit_judge import Search
from perfplast_fenicsx.limit_analysis.shakedown.shakedown_load import Direction, ShakedownLoad
from perfplast_fenicsx.limit_analysis.statements.load_factor import Bound
from perfplast_fenicsx.materials.nonassociated_flow import by_davis
from perfplast_fenicsx.outcome_words import Row, factor_so_far, force_rows
from perfplast_fenicsx.problem.judged.report import Iteration, LevelReport
from perfplast_fenicsx.problem.judged.state import Level
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.report.report_file import LiveReport


def force_lines(
    loads: Sequence[Mapping[str, Any]],
    lower: float | None,
    upper: float | None,
    at_limit: Mapping[str, Any] | None,
    axes: str,
    units: Mapping[str, str],
) -> list[str]:
    """Return the lines of the table of forces at the bounds; [] if there are no loads.

    Args:
        loads: See :func:`outcome_words.force_rows`.
        lower: Proven lower bound on the load factor; None if none is proven.
        upper: Proven upper bound on the load factor; None if none is proven.
        at_limit: The forces that are in balance with the stress of the lower bound or of the mesh.
        axes: Letters of the force components, such as "xyz".
        units: Units by quantity, from :meth:`units.Units.table`.
    """
    forces = force_rows(loads, lower, upper, at_limit)
    moments = force_rows(loads, lower, upper, at_limit, moments=True)
    if not forces:
        return []
    lines = _table(f"Forces{_bracket(units.get('force', ''))}", axes, forces)
    if any(row for _, row in moments):
        head = f"Moments about the origin{_bracket(units.get('moment', ''))}"
        lines += _table(head, "xyz" if len(axes) == 3 else "z", moments)
    return lines


def bolt_lines(reports: Sequence[LevelReport], unit: str) -> list[str]:
    """Return lines with the bolt forces at each solved level; [] if there are no bolts.

    Args:
        reports: Reports of all levels.
        unit: Unit of force; empty if it is unknown.
    """
    solved = [(n, report) for n, report in enumerate(reports, 1) if report.converged]
    if not solved or not solved[0][1].bolts:
        return []
    names = list(solved[0][1].bolts)
    widths = [max(12, len(name)) for name in names]
    lines = [f"Forces of bolts, tension positive{_bracket(unit)}:"]
    heads = "".join(f"  {name:>{width}}" for name, width in zip(names, widths, strict=True))
    lines.append(f"{'step':>6}  {'zeta':>12}{heads}")
    for number, report in solved:
        forces = zip((report.bolts[name] for name in names), widths, strict=True)
        cells = "".join(f"  {force:>{width}.6g}" for force, width in forces)
        lines.append(f"{number:>6}  {report.zeta:>12.6g}{cells}")
    return lines


def _table(head: str, axes: str, rows: Sequence[Row]) -> list[str]:
    width = max(len(head), *(len(name) + 2 for name, _ in rows))
    lines = [f"{head:{width}}" + "".join(f"  {axis:>12}" for axis in axes)]
    for name, row in rows:
        cells = "".join(f"  {number:>12.6g}" for number in row)
        lines.append(f"  {name:{width - 2}}{cells}")
    return lines


def _bracket(unit: str) -> str:
    return f" ({unit})" if unit else ""


@dataclass(frozen=True)
class RunContext:
    """The objects that belong to one run.

    Attributes:
        case: The case that is solved.
        problem: The discrete problem of the case.
        method: Name of the method in the results.
        folder: Result folder.
        checkpoints: Checkpoints of the folder.
        saved: State from which the run continues; empty for a new run.
        terminal: The terminal that shows the run.
        journal: The log of the run.
        interrupts: Handler of signals.
        began: Start of the run, by ``time.perf_counter``.
        date: Date, time and time zone of the start.
        command: Shell command that repeats the run, without PETSc options.
        remarks: Remarks on the problem.
        warnings: Warnings so far; the list grows during the run.
        live: The report that is updated during the run; None if there is no such report.
    """

    case: Case
    problem: Problem
    method: str
    folder: ResultFolder
    checkpoints: Checkpoints
    saved: Saved
    terminal: Terminal
    journal: RunLog
    interrupts: Interrupts
    began: float
    date: str
    command: str
    remarks: list[str]
    warnings: list[str]
    live: LiveReport | None = None


class Recorder:
    """Writes and shows the results of a run as they arise, and ends the run after a signal.

    Attributes:
        results: The data of ``summary.json`` and ``path.csv``.
        last: The last solved level; None before the first.
    """

    def __init__(self, run: RunContext) -> None:
        """Write and show the data that are known before the first level. Collective."""
        self._run, case, saved = run, run.case, run.saved
        self._began = run.began - saved.timings.get("total", 0.0)
        self.last, self._before = saved.level, saved.before
        setup = saved.timings.get("setup", 0.0) + time.perf_counter() - run.began
        run.terminal.header(case.title, run.method, run.problem, case.options, case.conic)
        for report in saved.reports:
            run.terminal.level(report)
        self._writer = ResultWriter(
            run.folder,
            run.problem,
            case.scene,
            run.method,
            prescribed=case.loading.prescribes,
            fields=case.output.fields,
            points=case.output.points,
            saved=saved,
        )
        self.results = self._writer.results
        summary = self.results.summary
        summary.timings |= saved.timings | {"setup": setup}
        summary.case = {"file": str(case.path), "text": case.text}
        summary.report = case.report.given
        summary.surroundings = {
            "versions": versions(),
            "petsc_options": petsc_options(),
            "command": run.command,
            "began": run.date,
        }
        summary.remarks, summary.warnings = run.remarks, run.warnings
        if run.live is not None:
            run.terminal.heard = run.live.say
            self.results.write()
            run.live.refresh()
        self._announce()
        run.interrupts.check()
        self._solving = time.perf_counter()
        self._factors: tuple[float | None, float | None] = (None, None)
        self._safety_is_known = False

    def plan(self, levels: int) -> None:
        """Store and show the number of levels in the whole run. Collective.

        Raises:
            InputError: On every rank, if the files cannot be written.
        """
        self._run.terminal.plan(levels)
        self.results.summary.planned = levels
        self.results.write()

    def iteration(self, record: Iteration) -> None:
        """Show and log an iteration; called by the algorithms. Collective.

        Raises:
            Interrupted: On every rank, after a signal.
        """
        self._run.terminal.iteration(record)
        self._run.journal.iteration(record)
        self._run.interrupts.check()

    def interior(self, step: InteriorStep) -> None:
        """Show and log a step of the interior point method; called after each step. Collective.

        Raises:
            Interrupted: On every rank, after a signal.
        """
        self._run.terminal.interior(step)
        self._run.journal.interior(step)
        self._run.interrupts.check()

    def mesh(self, round_: Round) -> None:
        """Show and log the bounds from one of several meshes; called after each mesh. Collective.

        Raises:
            Interrupted: On every rank, after a signal.
        """
        self._run.terminal.mesh(round_)
        self._run.journal.mesh(round_)
        self._run.interrupts.check()

    def level(self, level: Level, search: Search | None = None) -> None:
        """Show, log and write a level, with a checkpoint if the level is solved. Collective.

        Args:
            level: The level.
            search: State of the search for a limit load; None if there is no search.

        Raises:
            InputError: On every rank, if the files cannot be written.
            Interrupted: On every rank, after a signal.
        """
        timings = self.results.summary.timings
        timings["solve"] = timings.get("solve", 0.0) + time.perf_counter() - self._solving
        timings["total"] = self.elapsed()
        self._run.terminal.level(level.report)
        self._run.journal.level(level.report)
        self._writer.write(level)
        if level.report.converged:
            self._before = self.last.state if self.last else None
            self.last = level
            with self.results.timed("output"):
                now = Saved(self.results.reports, level, self._before, search, timings)
                self._run.checkpoints.write(now)
        if self._run.live is not None:
            self._run.live.refresh()
        self._solving = time.perf_counter()
        self._announce()
        self._run.interrupts.check()

    def so_far(self, adaptive: AdaptiveBounds) -> None:
        """Write the bounds from the meshes so far, if a live report is requested. Collective.

        Args:
            adaptive: The bounds.

        Raises:
            InputError: On every rank, if the files cannot be written.
            Interrupted: On every rank, after a signal.
        """
        if self._run.live is not None:
            body, adaptive_ = self._writer.judged(adaptive.body, adaptive)
            self._writer.write_limit(adaptive.best.mesh, body, adaptive_)
            self._run.live.refresh()
            self._run.interrupts.check()

    def limit(
        self,
        limit: LimitLoad,
        body: BodyBounds | None = None,
        adaptive: AdaptiveBounds | None = None,
    ) -> None:
        """Write and show the limit load of the mesh and the proven bounds for the body. Collective.

        Args:
            limit: Limit load of the mesh; with several meshes, of the mesh with the best bounds.
            body: Proven bounds of the body.
            adaptive: The bounds from a sequence of meshes; None for one mesh.

        Raises:
            InputError: On every rank, if the files cannot be written.
        """
        solve = time.perf_counter() - self._solving
        if body is not None:
            body, adaptive = self._writer.judged(body, adaptive)
        known = body.limits if body else (NOT_SOUGHT, NOT_SOUGHT)
        lower, upper = (bound.strict_value for bound in known)
        case = self._run.case
        design = designed(case.loading.design, case.combination, limit, body)
        if design is not None:
            self._run.terminal.say(design.in_words())
        answer = "" if body is None else case.loading.answer(lower, upper)
        if answer:
            self._run.terminal.say(answer)
        steps = []
        if body is not None:
            mesh, ended = self.results.summary.mesh, adaptive.reason if adaptive else ""
            effort = Effort(self._run.problem.bodies.gdim, mesh["cells"], solve, ended)
            steps = next_steps(body, effort)
            self._run.terminal.body(body, steps)
            if adaptive is not None and not any(adaptive.reason in step for step in steps):
                ended = f"Refinement ended: {adaptive.reason}."
                self._run.terminal.say(ended)
                self._run.journal.say(ended)
        follows = body is not None and body.friction is not None
        self._run.terminal.limit(limit, last=adaptive is not None, associated=follows)
        self._run.journal.limit(limit, body)
        if not self.results.reports:  # without levels, no other function stores these times
            self.results.summary.timings |= {"solve": solve, "total": self.elapsed()}
        self._writer.write_limit(limit, body, adaptive, steps, design, answer)
        summary = self.results.summary
        forces = (summary.limit or {}).get("forces")
        axes, units = summary.model["axes"], summary.units
        for line in force_lines(summary.loads, lower, upper, forces, axes, units):
            self._run.terminal.say(line)

    def factor(self, factor: float, lower: Bound, upper: Bound, cells: int) -> None:
        """Show and log bounds on the load multiple for strengths divided by F. Collective.

        Raises:
            Interrupted: On every rank, after a signal.
        """
        davis = by_davis(self._run.case.materials)
        stands, falls = self._factors
        if lower.strict_value is not None and lower.strict_value >= 1:
            stands = max(stands or factor, factor)
        if upper.strict_value is not None and upper.strict_value <= 1:
            falls = min(falls or factor, factor)
        self._factors = (stands, falls)
        known = factor_so_far(stands, falls, davis)
        words = f"{times_in_words(factor, lower, upper, cells, davis)} {sentence(known)}."
        self._run.terminal.known = known
        self._run.terminal.say(words)
        self._run.journal.say(words)
        self._run.interrupts.check()

    def estimate(self, factor: float, times: float | None, cells: int) -> None:
        """Show and log an estimate of the load multiple for strengths divided by F. Collective.

        Raises:
            Interrupted: On every rank, after a signal.
        """
        known = factor_so_far(*self._factors, by_davis(self._run.case.materials))
        words = f"{estimate_in_words(factor, times, cells)} {sentence(known)}."
        self._run.terminal.known = known
        self._run.terminal.say(words)
        self._run.journal.say(words)
        self._run.interrupts.check()

    def interrupted_safety(self, found: FactorOfSafety | None) -> None:
        """Write and show the factors that an interrupted search for F has proven. Collective.

        Args:
            found: The proven factors; None if the search was interrupted before its first bound.

        Raises:
            InputError: On every rank, if the files cannot be written.
        """
        if found is not None:
            self.safety(found)
        elif not self._safety_is_known:
            known = factor_so_far(*self._factors, by_davis(self._run.case.materials))
            words = f"{sentence(known)}. {INTERRUPTED}"
            self._run.terminal.say(words)
            self._run.journal.say(words)

    def safety(self, found: FactorOfSafety) -> None:
        """Write and show a factor of safety with its proof. Collective.

        Raises:
            InputError: On every rank, if the files cannot be written.
        """
        self._run.terminal.known, self._safety_is_known = "", True
        solve = time.perf_counter() - self._solving
        found = self._writer.judged_safety(found)
        self._run.terminal.say(found.news())
        self._run.journal.say(found.news())
        self.results.summary.timings |= {"solve": solve, "total": self.elapsed()}
        self._writer.write_safety(found)

    def direction(
        self, angles: Angles, low: BodyBounds, high: BodyBounds, prove: Proving
    ) -> Proven:
        """Prove, show and log the bounds in one direction of an envelope. Collective.

        Args:
            angles: The angles of the direction (degrees).
            low: Bounds whose lower bound is used.
            high: Bounds whose upper bound is used.
            prove: Function that returns the proven bounds from ``low`` and ``high``.

        Raises:
            InputError: On every rank, if the files cannot be written.
            Interrupted: On every rank, after a signal.
        """
        low, high = self._writer.judged_direction(angles, low, high)
        proven = prove(low, high)
        lower, upper = low.limits[0], high.limits[1]
        at = ", ".join(f"{angle:.4g}" for angle in angles)
        words = (
            f"At {at} degrees: lower bound {lower.shown if lower.strict else 'not proven'}, "
            f"upper bound {upper.shown if upper.strict else 'not proven'}."
        )
        self._run.terminal.say(words)
        self._run.journal.say(words)
        write_proven(self._run.folder, proven)
        self._run.interrupts.check()
        return proven

    def envelope(self, found: Envelope, names: Sequence[str]) -> None:
        """Write and show the envelope of the load multiples that the bodies carry. Collective.

        Raises:
            InputError: On every rank, if the files cannot be written.
        """
        solve = time.perf_counter() - self._solving
        self._run.terminal.say(found.in_words())
        self._run.journal.say(found.in_words())
        self.results.summary.timings |= {"solve": solve, "total": self.elapsed()}
        self._writer.write_envelope(found, names)

    def shakedown(self, found: ShakedownLoad, diagram: Sequence[Direction]) -> None:
        """Write and show a shakedown load, and the diagram for two varying loads. Collective.

        Raises:
            InputError: On every rank, if the files cannot be written.
        """
        solve = time.perf_counter() - self._solving
        for one in diagram:
            ends = "none found" if one.first is None else f"{one.first:.5g}, {one.second:.5g}"
            self._run.terminal.say(f"At {one.angle:.4g} degrees: {ends}; {one.failure}.")
        for tell in (self._run.terminal.say, self._run.journal.say):
            tell(found.in_words())
        self.results.summary.timings |= {"solve": solve, "total": self.elapsed()}
        self._writer.write_shakedown(found, diagram)

    def elapsed(self) -> float:
        """Return the wall time of the run, including the earlier runs that it continues (s)."""
        return time.perf_counter() - self._began

    def _announce(self) -> None:
        direct = self._run.method == LimitMethod.INTERIOR_POINT
        self._run.terminal.status("first step" if direct else self._run.terminal.next_level)
