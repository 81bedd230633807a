"""Print the progress of a run: a header, a line for each level, and a live line meanwhile.

Only rank 0 prints. The live line appears only if the output is a terminal.
"""

import os
import shutil
import sys
import time
from collections.abc import Callable, Sequence
from typing import TextIO

from mpi4py import MPI

from perfplast_fenicsx.errors import visible
from perfplast_fenicsx.io.results.result_files import BEFORE, NEWEST
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import Round
from perfplast_fenicsx.limit_analysis.body.body_bounds import (
    BodyBounds,
    sentence,
    standing_in_words,
)
from perfplast_fenicsx.limit_analysis.conic.conic_solver import USUAL
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad, LimitMethod
from perfplast_fenicsx.outcome_words import NO_PAIR, SAID, MeshEstimate, PathBracket
from perfplast_fenicsx.problem.judged.report import Iteration, LevelReport
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import rounded_down, rounded_up, without_rounding
from perfplast_fenicsx.solvers.linear.linear_solver import chosen_solver
from perfplast_fenicsx.solvers.newton_options import NewtonOptions
from perfplast_fenicsx.units import Units


def remaining(planned: int | None, seconds: Sequence[float]) -> str:
    """Return how many levels are left, and about how long they take, in words.

    Args:
        planned: Number of levels of the whole run; None if it chooses them itself.
        seconds: Time of each level so far (s).

    Returns:
        Text such as ``2 levels left, about 1:40``. Before the first level ends the time is missing.
        The text is empty if no level is left or if the number is unknown.
    """
    left = 0 if planned is None else planned - len(seconds)
    if left < 1:
        return ""
    time = _time_left(left, seconds)
    return f"{left} level{'s' if left > 1 else ''} left" + (f", about {time}" if time else "")


def next_level(planned: int | None, seconds: Sequence[float]) -> str:
    """Return the level in progress, such as ``level 3/5, 1:40 left``.

    Args:
        planned: Number of levels of the whole run; None if it chooses them itself.
        seconds: Time of each level so far (s).
    """
    number = len(seconds) + 1
    if planned is None or planned < number:
        return f"level {number}"
    time = _time_left(planned - len(seconds), seconds)
    return f"level {number}/{planned}" + (f", {time} left" if time else "")


def _time_left(levels: int, seconds: Sequence[float]) -> str:
    # The times of the next levels are estimated from this number of recent levels, because levels
    # near collapse take longer than the first ones.
    most_recent = 3
    recent = seconds[-most_recent:]
    return clock(levels * sum(recent) / len(recent)) if recent else ""


def clock(seconds: float) -> str:
    """Return a time as minutes and seconds, with hours if needed."""
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


COLUMNS = (
    *(("step", 4), ("zeta", 11), ("alpha", 12), ("Newton", 6), ("active set", 10)),
    *(("linear", 7), ("plastic", 8), ("contacts", 11), ("duality gap", 11), ("seconds", 8)),
)


LIVE_PERIOD = 0.2
"""Shortest time between two live lines (s)."""


class Terminal:
    """Writes to a stream on rank 0; other ranks write nothing.

    Attributes:
        heard: Function that is called on every rank with the current activity; None for no call.
        known: The results so far, which precede the current activity on the live line.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        stream: TextIO | None = None,
        live: bool | None = None,
        quiet: bool = False,
    ) -> None:
        """Choose the stream.

        Args:
            comm: The ranks of the run.
            stream: Stream to which the terminal writes; by default standard output.
            live: Whether to show a live line; by default it is shown if the stream is a terminal.
            quiet: Whether to write nothing at all.
        """
        self._comm = comm
        self._stream = stream or sys.stdout
        self._speaks = comm.rank == 0 and not quiet
        self._live = self._speaks and (shows(self._stream) if live is None else live)
        self._shown = 0
        self._last = 0.0
        self._began = time.monotonic()
        self._seconds: list[float] = []
        self._planned: int | None = None
        self._stage = ""
        self._driven = False
        self.heard: Callable[[str], None] | None = None
        self.known = ""

    def say(self, text: str = "") -> None:
        """Write one or several lines; control characters are written as escapes."""
        if self._speaks:
            self.clear()
            self._write(f"{visible(text, lines=True)}\n")

    def status(self, text: str) -> None:
        """Show the current activity on the live line, and call ``heard`` with it."""
        if self.heard is not None:
            self.heard(text)
        if self._live:
            text = f"{clock(time.monotonic() - self._began)}  {visible(text)}"
            text = text[: shutil.get_terminal_size().columns - 1]
            self.clear()
            self._shown = len(text)
            self._write(f"\r{text}")

    def clear(self) -> None:
        """Remove the live line so that another line can be written."""
        if self._shown:
            self._write("\r" + " " * self._shown + "\r")
            self._shown = 0

    def _write(self, text: str) -> None:
        """Write a text; after the stream is closed, write nothing (the results are stored)."""
        try:
            print(text, end="", file=self._stream, flush=True)
        except BrokenPipeError:
            self._speaks = self._live = False
            self._shown = 0
            # without this redirection, Python would flush the rest to the closed stream at its exit
            with open(os.devnull, "w") as nowhere:
                os.dup2(nowhere.fileno(), self._stream.fileno())

    def header(
        self,
        title: str,
        method: str,
        problem: Problem,
        options: object = None,
        conic: str = USUAL,
    ) -> None:
        """Print the problem, and the heading of the table if load levels follow. Collective."""
        self.say(describe(title, method, problem, options, conic))
        for remark in problem.constraints.remarks:
            self.say(remark)
        if method != LimitMethod.INTERIOR_POINT:
            self._driven = problem.motion.driven and not problem.loads.grows()
            # The column contains the driving force if ζ moves supports and obstacles and no load
            # grows with ζ.
            driven = "force"
            heads = (
                (driven if name == "alpha" and self._driven else name, w) for name, w in COLUMNS
            )
            self.say("  ".join(f"{name:>{width}}" for name, width in heads))

    def plan(self, levels: int) -> None:
        """Store the number of levels in the whole run."""
        self._planned = levels

    @property
    def next_level(self) -> str:
        """Return the level in progress, the number of levels and the remaining time, in words."""
        return next_level(self._planned, self._seconds)

    def iteration(self, record: Iteration) -> None:
        """Show a Newton step on the live line; called by the algorithms."""
        now = time.monotonic()
        if now - self._last >= LIVE_PERIOD:
            self._last = now
            self.status(
                f"{self.next_level}: zeta {record.zeta:.6g}, alpha {record.alpha:.4g},"
                f" Newton {record.number}, {record.plastic_fraction:.1%} plastic,"
                f" increment {record.increment:.1e}, CG {record.linear_iterations}"
            )

    def interior(self, step: InteriorStep) -> None:
        """Show a step of the interior point method on the live line; called after each step."""
        known = f"{self.known}; " if self.known else ""
        self.status(
            f"{known}step {step.number}: load {step.load:.6g}, gap {step.gap:.1e}, unbalanced "
            f"forces {step.unbalanced:.1e}, inadmissible flow {step.inadmissible:.1e}"
        )

    def mesh(self, round_: Round) -> None:
        """Write the bounds from one of several meshes; called as a monitor after each mesh."""
        lower, upper = (
            f"none ({value:.6g} is not proven)" if value is not None else "none"
            for value in round_.not_proven
        )
        lower = lower if round_.lower is None else rounded_down(round_.lower)
        upper = upper if round_.upper is None else rounded_up(round_.upper)
        apart = "" if round_.gap is None else f", best bounds {100 * round_.gap:.3g} % apart"
        self.say(
            f"Mesh {round_.number}: {round_.cells} cells, lower bound {lower}, upper"
            f" bound {upper}{apart}, {round_.seconds:.1f} s"
        )

    def level(self, report: LevelReport) -> None:
        """Write the line for a level, and at the beginning of a stage a line with its name."""
        self._seconds.append(report.seconds)
        if report.stage != self._stage:
            self._stage = report.stage
            self.say(f"Stage '{report.stage}':")
        found = report.driving_force if self._driven else report.alpha
        cells = (
            *(len(self._seconds), f"{report.zeta:.6g}", f"{found:.6g}"),
            *(report.newton_iterations, report.active_set_iterations, report.linear_iterations),
            *(f"{report.plastic_fraction:.1%}", f"{report.active_contacts}/{report.contact_pairs}"),
            *(f"{report.duality_gap:.1e}", f"{report.seconds:.2f}"),
        )
        pairs = zip(cells, COLUMNS, strict=True)
        self.say("  ".join(f"{cell:>{width}}" for cell, (_, width) in pairs))
        if not report.converged:
            self.say(f"No solution at zeta = {report.zeta:.6g}: {report.reason}.")

    def limit(self, limit: LimitLoad, last: bool = False, associated: bool = False) -> None:
        """Print the limit load of the mesh, or of the last mesh if there are several.

        Args:
            limit: The limit load.
            last: Whether the limit load belongs to the last of several meshes.
            associated: Whether this limit load assumes associated slip, which Coulomb's friction
                does not have.
        """
        if not limit.theorem:
            self._path_bracket(limit)
            return
        if words := standing_in_words(limit):
            self.say(f"{words[:-1]} ({effort(limit)}).")
            return
        estimate = MeshEstimate(limit.lower, limit.estimate, limit.upper)
        met = limit.levelled_off and limit.upper is not None
        self.say(
            f"Limit load of {'the last' if last else 'this'} mesh"
            f"{' with associated friction' if associated else ''}: {estimate.in_words()}"
            f" ({effort(limit)}{'' if met else f': {limit.reason}'})."
        )

    def _path_bracket(self, limit: LimitLoad) -> None:
        """Print the load at which a path loses equilibrium, and Drucker's bounds."""
        found = PathBracket(limit.lower, limit.upper).in_words()
        self.say(f"This path {found} ({effort(limit)}).")
        self.say(f"Reason for the end of the search: {limit.reason}.")
        self.say(SAID)
        pair = limit.drucker
        self.say(NO_PAIR if pair is None else f"For comparison: {pair.in_words()}.")

    def reactions(self, report: LevelReport, problem: Problem, units: Units) -> None:
        """Print the forces that loads, supports, obstacles and contacts exert on the bodies.

        Args:
            report: Report of the level.
            problem: The problem that was solved.
            units: Units of the numbers.
        """
        width = max(map(len, report.reactions), default=0)
        factors = "".join(f", {name} = {factor:.6g}" for name, factor in report.factors.items())
        unit = units.table(problem.kinematics.whole)["force"]
        forces = f"Forces {problem.kinematics.forces}".rstrip() + (f" ({unit})" if unit else "")
        at = f"zeta = {report.zeta:.6g}{factors}"
        self.say(f"{forces} at {at}, in balance to {report.balance:.1e}:")
        shown = without_rounding(list(report.reactions.values()))
        for name, force in zip(report.reactions, shown, strict=True):
            cells = "  ".join(f"{component:>12.6g}" for component in force)
            self.say(f"  {name:<{width}}  {cells}")

    def body(self, bounds: BodyBounds, steps: Sequence[str] = ()) -> None:
        """Print the bounds for the body, and the steps that reduce their gap."""
        self.say(bounds.in_words())
        for step in steps:
            self.say(f"{sentence(step)}.")

    def results(self, folder: ResultFolder, goes_on: bool = True) -> None:
        """Print the result folder and the files in it.

        Args:
            folder: Result folder.
            goes_on: Whether ``--restart`` can continue from the levels; if not, checkpoint files
                are not listed.
        """
        if self._comm.rank == 0:
            found = [name for name in folder.found() if goes_on or name not in (NEWEST, BEFORE)]
            self.say(f"Results in {folder.path}: {', '.join(found)}")


def describe(
    title: str, method: str, problem: Problem, options: object = None, conic: str = USUAL
) -> str:
    """Return a description of the problem in one line. Collective."""
    mesh, comm = problem.tagged_mesh.mesh, problem.comm
    bodies = ", ".join(sorted(problem.tagged_mesh.volumes))
    cells = mesh.topology.index_map(mesh.topology.dim).size_global
    pairs = problem.num_pairs
    ranks = f"{comm.size} rank{'s' if comm.size > 1 else ''}"
    direct = method == LimitMethod.INTERIOR_POINT
    plane = ", plane strain" if mesh.geometry.dim == 2 else ""
    plane = ", axisymmetric" if problem.tagged_mesh.axisymmetric else plane
    plane = ", plane stress" if problem.tagged_mesh.is_thin else plane
    linear = "MUMPS Cholesky" if direct else chosen_solver(problem)
    if direct and conic != USUAL:
        linear = conic
    if isinstance(options, NewtonOptions) and options.subdivision:
        linear = "Total FETI"
    return (
        f"{visible(title)}: {bodies}; {cells} cells, P{problem.degree}{plane},"
        f" {problem.num_dofs} dofs, {pairs} contact pairs;"
        f" method {method} on {ranks}, {linear}"
    )


def effort(limit: LimitLoad) -> str:
    """Return the number of linear solves or factorisations of a limit load, in words."""
    if limit.factorisations is None:
        return f"{limit.linear_solves} linear solves"
    return f"{limit.factorisations} factorisations"


def shows(stream: TextIO) -> bool:
    """Return whether a stream goes to a terminal.

    Open MPI's launcher gives each rank a terminal even if its own output is redirected. So on ranks
    of this launcher, the function tests the output of the launcher.
    """
    if not stream.isatty():
        return False
    if "OMPI_COMM_WORLD_RANK" not in os.environ:
        return True
    try:
        launcher = os.open(f"/proc/{os.getppid()}/fd/1", os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
    except OSError:
        return False
    try:
        return os.isatty(launcher)
    finally:
        os.close(launcher)
