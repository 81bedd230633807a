"""Run all verification cases and print one table: ``make verify``, on any number of ranks.

Each case is a module in this folder with a function ``study``. The pictures of a case are in a
folder with the name of the module. The exit status is 1 if a number is wrong, after all cases have
been solved.
"""

import argparse
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from mpi4py import MPI

from demos.verification.study import HEADING, Row, costs, rates, solve
from perfplast_fenicsx.cli import Terminal

CASES = (
    "contact_patch",
    "corner_seat",
    "thick_sphere",
    "thick_tube",
    "axisymmetry",
    "ground",
    "autofrettage",
    "tension_and_shear",
    "strip_footing",
    "rigid_footing",
    "torsion",
    "press_fit",
    "bolted_ring",
    "platens",
    "friction",
    "cracked_strips",
    "plate_with_hole",
    "hertz_line",
    "hertz_sphere",
    "meshed_apart",
    "curved_seams",
    "towers",
    "assemblies",
    "body_bounds",
    "bounds_in_space",
    "space_costs",
    "ring_bounds",
    "ground_bounds",
    "safety_factors",
    "yield_laws",
    "wall_bounds",
    "ground_in_space",
    "bounds_apart",
    "statements",
    "bound_costs",
    "dead_loads",
    "shakedown",
    "hollow_shaft",
    "joints",
    "published",
    "published_blocks",
    "published_contact",
    "published_plates",
)


def main(argv: Sequence[str] | None = None) -> None:
    """Solve the cases and print the table. Collective.

    Raises:
        SystemExit: If a number is wrong; raised on every rank.
    """
    parser = argparse.ArgumentParser(description="All verification cases in one table.")
    parser.add_argument("-o", "--output", default="results/verification", help="for pictures")
    parser.add_argument("--coarse", action="store_true", help="coarse meshes, for a quick look")
    parser.add_argument("--only", nargs="+", choices=CASES, default=CASES, metavar="CASE")
    arguments = parser.parse_args(argv)
    comm = MPI.COMM_WORLD
    terminal = Terminal(comm)
    terminal.say(HEADING)
    rows: list[Row] = []
    for name in arguments.only:
        study = import_module(f"demos.verification.{name}").study
        rows += solve(comm, study, Path(arguments.output) / name, arguments.coarse, terminal)
    terminal.say("\n" + "\n".join([*rates(rows), *costs(rows)]))
    wrong = sum(not row.right for row in rows)
    checked = sum(row.allowed is not None for row in rows)
    terminal.say(f"\n{checked} numbers checked, {wrong} wrong; pictures in {arguments.output}.")
    if wrong:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
