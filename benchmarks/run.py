"""Run each benchmark job in its own processes, and print tables; do not use mpirun.

make bench                                all groups (hours)
make bench CASES="two_blocks_16 start"    some groups; CASES=list shows them all
make bench ROUNDS=1                       each job once
make bench CASES=show                     print the tables of stored records
"""

import argparse
import json
import os
import platform
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.catalogue import GROUPS, Group, Job
from benchmarks.goals import Record
from benchmarks.peers import ccx_program
from benchmarks.peers.step42 import program
from benchmarks.table import is_wrong, report

LIMIT = 3 * 3600
"""Longest time (s) of one run."""

CHANGES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "PETSC_OPTIONS")
"""Environment variables that change the measured times."""


def missing(job: Job) -> bool:
    """Return whether the job needs a peer that is not installed."""
    if job.peer == "step-42":
        return not program().exists()
    if job.peer == "calculix":
        return ccx_program.program() is None
    return bool(job.peer) and find_spec(job.peer) is None


def run(job: Job, limit: float = LIMIT) -> Record | None:
    """Run a job and return its record; if it fails, print its last output and return None."""
    with TemporaryDirectory() as folder:
        output = Path(folder) / "record.json"
        command = [sys.executable, *job.command, "-o", str(output)]
        if job.command[:2] == ("-m", "benchmarks.case"):
            command += ["--began", repr(time.time())]
        if job.ranks > 1:
            command = ["mpirun", "-n", str(job.ranks), *command]
        load, began = os.getloadavg()[0], time.perf_counter()
        process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,
        )
        try:
            words, _ = process.communicate(timeout=limit)
        except BaseException as stop:
            os.killpg(process.pid, signal.SIGTERM)  # mpirun then ends its ranks
            process.communicate()
            if not isinstance(stop, subprocess.TimeoutExpired):
                raise
            words = f"stopped after {limit:g} s"
        if process.returncode or not output.exists():
            print(f"{job.name} failed:\n{words[-2000:]}", file=sys.stderr)
            return None
        record: Record = json.loads(output.read_text(encoding="utf-8"))
        record["job"] = job.name
        if job.reference:
            record["reference_error"] = record["alpha"] / job.reference - 1
        record["wall_seconds"] = time.perf_counter() - began
        record["load_average_before"] = load
        return record


def run_group(group: Group, rounds: int, limit: float) -> dict[str, list[Record | None]]:
    """Run all jobs of a group in each round, and return the records of each job."""
    absent = [job.name for job in group.jobs if missing(job)]
    if absent:
        print(f"  omitted, because benchmarks/peers/setup did not install it: {', '.join(absent)}")
    jobs = [job for job in group.jobs if job.name not in absent]
    records: dict[str, list[Record | None]] = {job.name: [] for job in jobs}
    for number in range(rounds):
        for job in jobs:
            record = run(job, limit)
            records[job.name].append(record)
            wall = f"{record['wall_seconds']:.1f} s" if record else "FAILED"
            print(f"  round {number + 1} of {rounds}, {job.name}: {wall}", flush=True)
    return records


def machine() -> dict[str, Any]:
    """Return date, processor, cores, memory and settings, on which times depend."""
    cpu = [
        line.split(":", 1)[1].strip()
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        if line.startswith("model name")
    ]
    return {
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
        "cpu": cpu[0] if cpu else platform.processor(),
        "cores": os.cpu_count(),
        "memory_gb": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9,
        "settings": {name: os.environ.get(name) for name in CHANGES},
    }


def load(folder: Path) -> dict[str, dict[str, list[Record | None]]]:
    """Return the stored records of earlier runs by group and job."""
    files = {name: folder / f"{name}.json" for name in GROUPS}
    return {
        name: json.loads(file.read_text(encoding="utf-8"))["records"]
        for name, file in files.items()
        if file.exists()
    }


def about(results: dict[str, dict[str, list[Record | None]]]) -> str:
    """Return a line about the machine, and a line for each set of libraries in the records."""
    facts = machine()
    libraries = sorted(
        {
            ", ".join(f"{name} {value}" for name, value in record["libraries"].items())
            for jobs in results.values()
            for runs in jobs.values()
            for record in runs
            if record and "libraries" in record
        }
    )
    settings = ", ".join(f"{k}={v}" for k, v in facts["settings"].items() if v is not None)
    hardware = f"{facts['cpu']}, {facts['cores']} cores, {facts['memory_gb']:.0f} GB; {settings}"
    return "\n".join([hardware, *libraries])


def main(argv: Sequence[str] | None = None) -> int:
    """Run the groups that the command line names, and print the tables.

    Returns:
        Exit status: 1 if a job of this program failed, or did not solve its problem.
    """
    parser = argparse.ArgumentParser(description="Benchmarks; see benchmarks/README.md.")
    parser.add_argument("cases", nargs="*", metavar="CASE", help="groups, or list, or show")
    parser.add_argument("--rounds", type=int, help="how often each job is run")
    parser.add_argument("--limit", type=float, default=LIMIT, help="seconds for one run")
    parser.add_argument("-o", "--output", type=Path, default=Path("results/benchmarks"))
    arguments = parser.parse_args(argv)
    cases = arguments.cases or list(GROUPS)
    if cases == ["list"]:
        for name, group in GROUPS.items():
            print(f"{name:<15} {group.about}")
            print(*(f"{'':<15}   {job.name}" for job in group.jobs), sep="\n")
        return 0
    if cases == ["show"]:
        results = load(arguments.output)
        print(about(results), report(results), sep="\n\n")
        return 0
    unknown = [name for name in cases if name not in GROUPS]
    if unknown:
        parser.error(f"there is no case {', '.join(unknown)}; there are {', '.join(GROUPS)}")
    if shutil.which("mpirun") is None:
        parser.error("mpirun is missing; run this by make bench")
    arguments.output.mkdir(parents=True, exist_ok=True)
    results = {}
    for name in cases:
        group = GROUPS[name]
        print(f"{name}: {group.about}", flush=True)
        facts = machine()
        results[name] = run_group(group, arguments.rounds or group.rounds, arguments.limit)
        text = json.dumps({"machine": facts, "records": results[name]}, indent=1)
        (arguments.output / f"{name}.json").write_text(text + "\n", encoding="utf-8")
    print("", about(results), report(results), f"records: {arguments.output}", sep="\n\n")
    ours = [
        record
        for jobs in results.values()
        for runs in jobs.values()
        for record in runs
        if not record or "levels" in record
    ]
    return int(any(not record or is_wrong(record) for record in ours))


if __name__ == "__main__":
    sys.exit(main())
