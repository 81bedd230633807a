"""Write a result folder level by level, as a run does, and wait for the reader after each level.

    growing_folder.py FOLDER LEVELS END

The process continues when the reader has made the file FOLDER/seen.N. With END = "killed" the
process waits after its last level until a signal kills it.
"""

import json
import sys
import time
from pathlib import Path

from perfplast_fenicsx.io.results.result_files import ENDED, hold

PATIENCE = 600.0
"""Longest time to wait for the reader (s)."""

STEP = {
    **{"alpha": 0.5, "plastic_fraction": 0.25, "active_contacts": 3, "contact_pairs": 4},
    **{"duality_gap": 1e-15, "seconds": 2.0, "converged": True},
}


def grow(folder: Path, levels: int, end: str) -> None:
    """Write the levels, each after the reader has seen the previous level."""
    folder.mkdir()
    with (folder / "run.log").open("w", encoding="utf-8") as log:
        assert hold(log)
        for number in range(levels + 1):
            steps = [STEP | {"zeta": 10.0 * n} for n in range(1, number + 1)]
            part = folder / "summary.part"
            part.write_text(json.dumps({"steps": steps, "planned": levels, "limit": None}))
            part.rename(folder / "summary.json")
            until = time.monotonic() + PATIENCE
            while number and not (folder / f"seen.{number}").exists():
                assert time.monotonic() < until
                time.sleep(0.01)
        while end == "killed":
            time.sleep(1.0)
        print(f"2026-01-01 INFO    {ENDED} 1.0 s", file=log, flush=True)


if __name__ == "__main__":
    grow(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
