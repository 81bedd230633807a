"""Measure deal.II's step-42 on one uniform mesh, by its own clocks.

The script benchmarks/peers/setup compiles it with perfect plasticity. Do not start it under mpirun.

python3 -m benchmarks.peers.step42 --ranks 2 -o record.json
"""

import argparse
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

PARAMETERS = """
set polynomial degree             = 1
set number of initial refinements = {refinements}
set number of cycles              = 1
set refinement strategy           = global
set obstacle                      = sphere
set output directory              = output
"""

MOST_STEPS = 100
"""Number of steps at which step-42 stops without a message."""

NOT_A_STEP = ("Setup", "Graphical output")
"""Sections that are not part of the Newton iteration."""


def program() -> Path:
    """Return the path of the compiled program."""
    return Path(os.environ.get("PERFPLAST_PEERS", "/nowhere")) / "step-42" / "step-42"


def read(output: str) -> dict[str, object]:
    """Return numbers of iterations and times (s) from the output of step-42.

    Raises:
        ValueError: If a number is missing in the output.
    """
    dofs = re.search(r"Number of degrees of freedom: *(\d+)", output)
    total = re.search(r"Total wallclock time elapsed since start *\| *([\d.e+-]+)s", output)
    steps = re.findall(r"Newton iteration (\d+)", output)
    if not (dofs and total and steps):
        raise ValueError(f"step-42 did not run to its end: ...{output[-500:]}")
    sections = {
        name.strip(): float(spent)
        for name, spent in re.findall(r"^\| ([A-Za-z][^|]*)\| *\d+ \| *([\d.e+-]+)s", output, re.M)
    }
    outside = sum(sections.get(name, 0.0) for name in NOT_A_STEP)
    return {
        "dofs": int(dofs[1]),
        "newton_iterations": int(steps[-1]),
        "linear_iterations": sum(map(int, re.findall(r"in (\d+) \w+ iterations", output))),
        "converged": int(steps[-1]) < MOST_STEPS,
        "seconds": {"path": float(total[1]) - outside, "run": float(total[1]), **sections},
    }


def main() -> None:
    """Run step-42, and write the record."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--ranks", type=int, required=True)
    parser.add_argument("--refinements", type=int, default=5, help="8^k hexahedra")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "case.prm"
        file.write_text(PARAMETERS.format(refinements=arguments.refinements), encoding="utf-8")
        done = subprocess.run(
            ["mpirun", "-n", str(arguments.ranks), str(program()), file.name],
            cwd=folder,
            env=os.environ | {"DEAL_II_NUM_THREADS": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
    if done.returncode:
        sys.exit(f"step-42 ended with status {done.returncode}: ...{done.stdout[-500:]}")
    largest = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    record = {"ranks": arguments.ranks, **read(done.stdout)}
    record["peak_memory_mb"] = {"total": None, "largest": largest}
    arguments.output.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
