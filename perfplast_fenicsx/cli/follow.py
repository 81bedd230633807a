"""Implement ``perfplast plot --follow DIR``: print and draw the results of a run in progress.

One process reads the files. The run does not depend on this process, and may be on another machine.
"""

import json
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from perfplast_fenicsx.cli.terminal import Terminal, next_level, remaining
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.result_files import ENDED, INTERRUPTED, is_held
from perfplast_fenicsx.outcome_words import MeshEstimate, PathBracket

PERIOD = 0.5
"""Time between two reads of the files (s)."""

COLUMNS = (
    *(("step", 4), ("zeta", 11), ("alpha", 12), ("plastic", 8), ("contacts", 11)),
    *(("duality gap", 11), ("seconds", 8), ("left", 0)),
)

SHOWN = (
    *("zeta", "alpha", "plastic_fraction", "active_contacts", "contact_pairs", "duality_gap"),
    *("seconds", "converged"),
)
"""Keys of ``summary.json`` that are read for each level."""

log = logging.getLogger(__name__)


@dataclass
class Follower:
    """Follows a run by reading the files in its result folder, in one process.

    Attributes:
        folder: Result folder of the run, which need not exist yet.
        terminal: The terminal that shows the run.
        draw: Function that draws the results; it is called when new levels are stored.
        wait: Longest time to wait for the first results (s).
    """

    folder: Path
    terminal: Terminal
    draw: Callable[[], None]
    wait: float
    _shown: int = field(default=0, init=False)

    def follow(self) -> None:
        """Print each new level until the run ends, then print how it ended.

        Raises:
            InputError: If there are no results within ``wait``, or if they cannot be read.
        """
        self._await()
        self.terminal.say("  ".join(f"{name:>{width}}" for name, width in COLUMNS))
        while True:
            alive = is_held(
                self.folder / "run.log"
            )  # test before the levels are read, so that no level is missed
            summary = self._summary()
            self._show(summary)
            if not alive:
                break
            self.terminal.status(self._waiting(summary))
            time.sleep(PERIOD)
        self.terminal.say(self._end(summary))

    def _await(self) -> None:
        """Wait until the first results are stored."""
        until = time.monotonic() + self.wait
        while not all((self.folder / name).exists() for name in ("summary.json", "run.log")):
            if time.monotonic() > until:
                raise InputError(
                    f"there are no results in '{self.folder}' after {self.wait:g} s; give "
                    "the result folder of perfplast run, or a longer --wait."
                )
            self.terminal.status(f"waiting for results in {self.folder}")
            time.sleep(PERIOD)

    def _summary(self) -> dict[str, Any]:
        path = self.folder / "summary.json"
        try:
            summary = json.loads(path.read_text(encoding="utf-8"))
            keys = {"planned": summary["planned"], "limit": summary["limit"]}
            steps = [{key: step[key] for key in SHOWN} for step in summary["steps"]]
        except (KeyError, TypeError) as error:
            raise InputError(
                f"'{path}' does not have the form of this version of perfplast ({error}); run the "
                "case again."
            ) from error
        except (OSError, ValueError) as error:
            raise InputError(f"'{path}' cannot be read ({error}); run the case again.") from error
        return keys | {"steps": steps}

    def _show(self, summary: dict[str, Any]) -> None:
        """Print the new levels and draw the results."""
        steps = summary["steps"]
        for count, step in enumerate(steps[self._shown :], start=self._shown + 1):
            seconds = [one["seconds"] for one in steps[:count]]
            cells = (
                *(count, _told(step["zeta"], ".6g"), _told(step["alpha"], ".6g")),
                _told(step["plastic_fraction"], ".1%"),
                f"{step['active_contacts']}/{step['contact_pairs']}",
                *(_told(step["duality_gap"], ".1e"), _told(step["seconds"], ".2f")),
                remaining(summary["planned"], seconds),
            )
            pairs = zip(cells, COLUMNS, strict=True)
            self.terminal.say("  ".join(f"{cell:>{width}}" for cell, (_, width) in pairs).rstrip())
        if len(steps) > self._shown:
            self._shown = len(steps)
            self.terminal.status("drawing")
            try:
                self.draw()
            except InputError as error:
                log.warning("%s", error)

    def _waiting(self, summary: dict[str, Any]) -> str:
        """Return the current activity of the run, from its results and the last line of its log."""
        level = next_level(summary["planned"], [one["seconds"] for one in summary["steps"]])
        return f"{level}: {self._log()[-1].partition('INFO')[2].strip()}"

    def _log(self) -> list[str]:
        text = (self.folder / "run.log").read_text(encoding="utf-8", errors="replace")
        return text.splitlines() or [""]

    def _end(self, summary: dict[str, Any]) -> str:
        """Return a sentence on how the run ended."""
        *before, last = ["", *self._log()]
        count = len(summary["steps"])
        levels = f"{count} level{' is' if count == 1 else 's are'} stored"
        if ENDED not in last:
            return f"The run was killed; {levels}. Continue it with --restart {self.folder}."
        limit, failed = summary["limit"], [a for a in summary["steps"] if not a["converged"]]
        if limit is not None:
            sides = limit["lower"], limit["upper"]
            estimate = MeshEstimate(sides[0], limit["estimate"], sides[1])
            known = f"limit load of the mesh: {estimate.in_words()}"
            if not limit.get("theorem", True):
                known = f"the path {PathBracket(*sides).in_words()}"
            levels += f"; {known}"
        if failed:
            levels += f"; no solution at zeta = {failed[-1]['zeta']:.6g}"
        cause = next((a for a in (INTERRUPTED, "ended by", "ended: ") if a in before[-1]), "")
        how = f" ({before[-1][before[-1].index(cause) :]})" if cause else ""
        return f"The run ended{how}; {levels}."


def _told(value: float | None, digits: str) -> str:
    """Return a number as text; "none" for None, which the file has in place of infinity and NaN."""
    return "none" if value is None else f"{value:{digits}}"
