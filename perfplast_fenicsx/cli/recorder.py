"""What is written and shown of a run, level by level; where a run that was ended goes on."""

import time

from perfplast_fenicsx._version import __version__
from perfplast_fenicsx.cli.run_log import RunLog
from perfplast_fenicsx.cli.signals import Interrupts
from perfplast_fenicsx.cli.terminal import Terminal
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.io.results.checkpoints import Checkpoints, Saved
from perfplast_fenicsx.io.results.field_series import FieldSeries
from perfplast_fenicsx.io.results.output_fields import OutputFields
from perfplast_fenicsx.io.results.result_folder import ResultFolder, Results
from perfplast_fenicsx.limit_analysis.limit_search import Search
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.state import Iteration, Level


class Recorder:
    """Keeps the results of a run up to date, and is where an interrupt ends it.

    Attributes:
        results: Summary and path.
        recovery: Makes the fields that are written.
        fields: Writes them; None where no fields are wanted.
        saved: What the run has gone on from; nothing where it began anew.
        last: The last level that is solved; None before the first.
    """

    def __init__(
        self,
        case: Case,
        problem: Problem,
        folder: ResultFolder,
        checkpoints: Checkpoints,
        saved: Saved,
        terminal: Terminal,
        journal: RunLog,
        interrupts: Interrupts,
        began: float,
    ) -> None:
        """Write and show what there is before the first level. Collective.

        Args:
            case: What is solved.
            problem: The same as a discrete problem.
            folder: Where the results go.
            checkpoints: Those of the folder.
            saved: What to go on from.
            terminal: What is shown.
            journal: What is logged.
            interrupts: Signals.
            began: When the run began, by ``time.perf_counter``.
        """
        self._checkpoints, self._terminal, self._journal = checkpoints, terminal, journal
        self._interrupts = interrupts
        self._began = began - saved.timings.get("total", 0.0)
        self.saved, self.last, self._before = saved, saved.level, saved.before
        self.results = Results(
            *(folder, problem, case.title, __version__, case.method, saved.reports),
            prescribed=case.loading.prescribes,
        )
        timings = self.results.summary.timings
        timings |= saved.timings
        timings["setup"] = timings.get("setup", 0.0) + time.perf_counter() - began
        terminal.header(case.title, case.method, problem)
        for report in saved.reports:
            terminal.level(report)
        self._announce()
        self.recovery = OutputFields(problem)
        self.fields: FieldSeries | None = None
        if case.output.fields:
            kept = self.recovery.update(self.last) if self.last else None
            times = [self._prescribed.of(report) for report in saved.reports]
            self._fields = FieldsFile(folder, problem.tagged_mesh, fields=kept, times=times)
        interrupts.check()
        self._solving = time.perf_counter()

    def iteration(self, record: Iteration) -> None:
        """Show and log an iteration; a monitor of the algorithms. Collective.

        Raises:
            Interrupted: On every rank, if a signal has come.
        """
        self._terminal.iteration(record)
        self._journal.iteration(record)
        self._interrupts.check()

    def level(self, level: Level, search: Search | None = None) -> None:
        """Write a level, and a checkpoint if it is solved. Collective.

        Args:
            level: The level.
            search: What is known of the limit load, where one is looked for.

        Raises:
            InputError: On every rank, if the system refuses.
            Interrupted: On every rank, if a signal has come.
        """
        results, report = self.results, level.report
        timings = results.summary.timings
        timings["solve"] = timings.get("solve", 0.0) + time.perf_counter() - self._solving
        timings["total"] = self.elapsed()
        self._terminal.level(report)
        self._journal.level(report)
        with results.timed("output"):
            if report.converged and self.fields is not None:
                self.fields.write(self.recovery.update(level), report)
            results.add(report)
            if report.converged:
                self._before = self.last.state if self.last and search else None
                self.last = level
                now = Saved(results.reports, level, self._before, search, timings)
                self._checkpoints.write(now)
        self._solving = time.perf_counter()
        self._announce()
        self._interrupts.check()

    def elapsed(self) -> float:
        """Wall time of the run, with what it has gone on from (s)."""
        return time.perf_counter() - self._began

    def _announce(self) -> None:
        self._terminal.status(f"level {len(self.results.reports) + 1}")
