"""Compare CalculiX with the program on the same ``.inp``: plastic contact up to collapse.

CalculiX chooses its increments, and increases the load until it stops or the load is far above the
limit load. The program reads the same file by ``perfplast mesh``, solves the same load factors
below the limit load, and brackets the limit load. The script compares works, displacements and
contact forces at load factors below the limit load. It also compares processor times, and the last
converged increment with the bracket.

python3 -m benchmarks.peers.calculix punch -o record.json    (after benchmarks/peers/get_calculix)
"""

import argparse
import json
import re
import sys
import tempfile
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peers.ccx_program import calculix, program, timed
from benchmarks.peers.inp_deck import Array, Deck, Mesh, deck_text, read_mesh, work
from meshes.pin_in_lug import write_pin_in_lug
from meshes.propped_beam import write_propped_beam
from meshes.square_punch import write_square_punch
from meshes.wedge import write_wedge

CASES: dict[str, tuple[Callable[..., None], float, tuple[str, str], Deck]] = {
    "punch": (
        write_square_punch,
        0.5,
        ("punch_seam", "ground_seam"),
        Deck(
            yields={"ground": 240.0, "punch": None},
            held={"x0": "1", "y0": "2", "bottom": "123", "sides": "12"},
            most=1000.0,
            pressed="top",
        ),
    ),
    "lug": (
        write_pin_in_lug,
        0.4,
        ("pin_bore", "lug_bore"),
        Deck(
            yields={"lug": 240.0, "pin": None},
            held={"x0": "1", "z0": "3", "end": "123"},
            most=250.0,
            pulled="pin",
        ),
    ),
    "prop": (
        write_propped_beam,
        0.35,
        ("beam_seam", "block_seam"),
        Deck(
            yields={"beam": 240.0, "block": None},
            held={"held": "123", "y0": "2", "floor": "123"},
            most=45.0,
            pressed="top",
        ),
    ),
    "wedge": (
        write_wedge,
        0.4,
        ("upper_seam", "lower_seam"),
        Deck(
            yields={"lower": 240.0, "upper": 300.0},
            held={"bottom": "123", "x0": "1", "y0": "2"},
            most=320.0,
            pressed="top",
        ),
    ),
}
"""Mesh generator, edge length, surfaces in contact and model of each problem."""

SHARES = (0.25, 0.5, 0.75, 0.9)
"""Fractions of the limit load near which the script compares both programs."""

SAME = 0.01
"""Largest relative difference of works, displacements and contact forces below 0.8 of the limit."""


def perfplast(folder: Path, *arguments: str) -> float:
    """Run a command of the program in a folder, and return the processor time (s)."""
    command = [sys.executable, "-m", "perfplast_fenicsx", *arguments]
    seconds, status, output = timed(command, folder)
    if status:
        raise RuntimeError(f"{' '.join(arguments)}: status {status}\n{output[-2000:]}")
    return seconds


def with_loading(text: str, loading: str) -> str:
    """Return the text of a case with another [loading] table, or stages, without pictures."""
    kept = re.sub(r"^\[(loading|output)\]\n(?:(?!\[).*\n?)*", "", text, flags=re.M)
    return f"{kept}\n{loading}\n[output]\npictures = false\nfields = false\n"


def loaded(folder: Path, text: str, loading: str, into: str) -> tuple[float, dict[str, Any]]:
    """Run the case in ``folder/ours`` with another loading; return processor time (s), summary.

    Args:
        folder: The working folder.
        text: The case file.
        loading: The new [loading] table or stages.
        into: Name of the result folder.
    """
    case = folder / "ours/case.toml"
    case.write_text(with_loading(text, loading), encoding="utf-8")
    seconds = perfplast(folder, "run", "ours/case.toml", "-o", into)
    return seconds, json.loads((folder / into / "summary.json").read_text())


def history(text: str, factors: Sequence[float]) -> str:
    """Return a [[stage]] table for each load factor; bodies then keep their plastic strain."""
    (load,) = tomllib.loads(text)["load"]
    name = json.dumps(load.get("name") or load["on"])
    return "".join(f"[[stage]]\nfactors = {{ {name} = {factor!r} }}\n" for factor in factors)


def compare(name: str, size: float | None = None, stiffer: float = 1.0) -> dict[str, Any]:
    """Solve a problem by both programs, and return the results and their differences.

    In CalculiX, contact follows the displacements even without NLGEOM. A larger Young's modulus
    makes the displacements so small that this has no effect.

    Args:
        name: Name of the problem.
        size: Edge length of the mesh; None for the edge length of the problem.
        stiffer: Factor that multiplies Young's modulus, and so divides all displacements.
    """
    write, usual, contact, deck = CASES[name]
    deck = replace(deck, young=stiffer * deck.young)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write(folder / "model.msh", size=size or usual)
        mesh = read_mesh(folder / "model.msh")
        (folder / "model.inp").write_text(deck_text(mesh, deck, contact))
        theirs = calculix(folder, len(mesh.points))
        read = perfplast(folder, "mesh", "model.inp", "-o", "ours")
        text = (folder / "ours/case.toml").read_text(encoding="utf-8")
        bounded, found = loaded(folder, text, '[loading]\ncontrol = "bounds"\n', "bounds")
        limit = found["limit"]
        most = limit["estimate"]
        below = [k for k, time in enumerate(theirs["times"]) if time < max(SHARES) * most]
        stages = [theirs["times"][k] for k in below]
        solved, summary = loaded(folder, text, history(text, stages), "levels")
    steps = summary["steps"][-len(below) :]
    near = sorted({int(np.argmin(np.abs(np.array(stages) - s * most))) for s in SHARES})
    beside = [level(theirs, mesh, deck, below[k], stages[k], steps[k]) for k in near]
    before = [one for one in beside if one["load"] < 0.8 * most * deck.most]
    keys = ("alpha", "displacement", "contact")
    apart = max(one[f"{key}_apart"] for one in before for key in keys)
    ours = solved + bounded
    return {
        "case": name if stiffer == 1 else f"{name}, {stiffer:g} E",
        "dofs": summary["mesh"]["dofs"],
        "cells": summary["mesh"]["cells"],
        "converged": apart <= SAME,
        "apart": apart,
        "beside": beside,
        "curve": [
            [time * deck.most, deck.most * work(mesh, deck, u)]
            for time, u in zip(theirs["times"], theirs["fields"], strict=True)
        ],
        "last_converged": theirs["times"][-1] * deck.most if theirs["times"] else None,
        "reached": deck.most,
        "end": theirs["end"],
        "estimate": most * deck.most,
        "lower": times(limit["body"]["lower"], deck.most),
        "upper": times(limit["body"]["upper"], deck.most),
        "increments": len(theirs["times"]),
        "iterations": theirs["iterations"],
        "seconds": {
            "path": ours,
            "run": read + ours,
            "calculix": theirs["seconds"],
            "read": read,
            "levels": solved,
            "bounds": bounded,
        },
    }


def times(bound: float | None, most: float) -> float | None:
    """Return a bound on the load factor times the load ``most``; None if there is no bound."""
    return None if bound is None else bound * most


def level(
    theirs: dict[str, Any],
    mesh: Mesh,
    deck: Deck,
    k: int,
    factor: float,
    step: dict[str, Any],
) -> dict[str, float]:
    """Return work, largest displacement and contact force by both programs at one increment.

    Args:
        theirs: Results of CalculiX.
        mesh: The mesh.
        deck: Materials, supports and load.
        k: Index of the increment.
        factor: Load factor; the factor 1 is the load at time 1 of CalculiX.
        step: Level of the program at this load factor.
    """
    u: Array = theirs["fields"][k]
    forces = [force for name, force in step["reactions"].items() if name.startswith("contact")]
    ours = float(np.linalg.norm(forces[0]))
    found = {
        "load": factor * deck.most,
        "plastic_fraction": step["plastic_fraction"],
        "alpha": deck.most * work(mesh, deck, u),
        "our_alpha": next(iter(step["works"].values())),
        "displacement": float(np.linalg.norm(u, axis=1).max()),
        "our_displacement": step["max_displacement"],
        "contact": float(np.linalg.norm(theirs["forces"][k])),
        "our_contact": ours,
    }
    for key in ("alpha", "displacement", "contact"):
        found[f"{key}_apart"] = abs(found[f"our_{key}"] / found[key] - 1)
    return found


def main() -> None:
    """Compare both programs for the problem that the command line names; write the record."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("case", choices=CASES)
    parser.add_argument("--size", type=float)
    parser.add_argument("--stiffer", type=float, default=1.0, help="multiplies Young's modulus")
    parser.add_argument("-o", "--output", type=Path)
    arguments = parser.parse_args()
    if program() is None:
        sys.exit("CalculiX (ccx) is missing; run benchmarks/peers/get_calculix")
    text = json.dumps(compare(arguments.case, arguments.size, arguments.stiffer), indent=1)
    if arguments.output:
        arguments.output.write_text(f"{text}\n")
    else:
        print(text)


if __name__ == "__main__":
    main()
