"""Forge proofs: write, check and read honest files, change them, and write them again."""

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpi4py import MPI

import h5py
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Plane,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    VonMises,
    read_gmsh,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import BodyBounds, limit_bounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.proof import ProofError, check
from perfplast_fenicsx.proof.plain_arrays import NUMBERS
from tests.random_bodies import Stack, write_stack

Arrays = dict[str, npt.NDArray]
Halves = dict[str, Arrays]
Forgery = Callable[[Halves], object]


def written(folder: Path, low: BodyBounds, high: BodyBounds | None = None) -> Halves:
    """Return the halves of ``bounds.h5``, an honest proof of strict bounds.

    Args:
        folder: Folder of the file.
        low: Bounds on the mesh of the lower bound.
        high: Bounds on the mesh of the upper bound; by default the same.
    """
    high = low if high is None else high
    assert low.lower.strict, low.why_not
    assert high.upper.strict, high.why_not
    path = folder / "bounds.h5"
    write_proof(ResultFolder(MPI.COMM_SELF, folder), path, *proofs(low, high))
    assert not said_of(path)
    return halves_of(path)


def blocks(path: Path, dim: int) -> Halves:
    """Return the halves of a proof of two blocks on a plane, of different strength, with weight.

    Args:
        path: Folder of the file.
        dim: 2 or 3.
    """
    strengths = {"block0": 1.0, "block1": 3.0}
    it = Stack(1, dim, (0.7, 1.2), ((1.0, 1.0),) * 2, 0.4 if dim == 2 else 0.7, plain=True)
    write_stack(path / "stack.msh", it)
    problem = Problem(
        read_gmsh(MPI.COMM_SELF, path / "stack.msh"),
        {name: VonMises(young=1e3, poisson=0.3, yield_stress=s) for name, s in strengths.items()},
        [Support("x0", "x"), *([Support("y0", "y")] if dim == 3 else [])],
        [Pressure("top", 1.0), BodyForce("block1", [0.0] * (dim - 1) + [-0.1])],
        [Contact("block0_seam0", "block1_seam0")],
        [Plane("bottom", [0.0] * dim, [0.0] * (dim - 1) + [1.0])],
        degree=2,
    )
    return written(path, limit_bounds(problem))


def halves_of(path: Path) -> Halves:
    """Return the arrays and attributes of both halves of a file."""
    with h5py.File(path) as file:
        return {
            kind: {name: np.asarray(half[name]) for name in half}
            | {name: np.asarray(half.attrs[name]) for name in NUMBERS if name in half.attrs}
            for kind, half in file.items()
        }


def write(path: Path, halves: Halves) -> Path:
    """Write halves without changes."""
    with h5py.File(path, "w") as file:
        for kind, arrays in halves.items():
            group = file.create_group(kind)
            for name, values in arrays.items():
                if name in NUMBERS:
                    group.attrs[name] = values
                else:
                    group[name] = values
    return path


def said_of(path: Path) -> str:
    """Return all faults of a file, or why it is no proof; an empty text for an honest file."""
    try:
        return "; ".join(fault for half in check(path).values() for fault in half.faults)
    except ProofError as error:
        return str(error)


def copied(halves: Halves) -> Halves:
    """Return a copy of the halves that can be changed."""
    return copy.deepcopy(halves)


def said_of_forged(honest: Halves, forge: Forgery, folder: Path) -> str:
    """Return a copy of the halves after a change."""
    halves = copied(honest)
    forge(halves)
    return said_of(write(folder / "forged.h5", halves))


def both(change: Callable[[Arrays], object]) -> Forgery:
    """Return a function that changes both halves equally."""
    return lambda halves: [change(arrays) for arrays in halves.values()]


def low(change: Callable[[Arrays], object]) -> Forgery:
    """Return a function that changes the lower half."""
    return lambda halves: change(halves["lower"])


def high(change: Callable[[Arrays], object]) -> Forgery:
    """Return a function that changes the upper half."""
    return lambda halves: change(halves["upper"])


def alone(kind: str, change: Callable[[Arrays], object]) -> Forgery:
    """Return a function that keeps one changed half, which prevents a comparison."""

    def forge(halves: Halves) -> None:
        del halves["upper" if kind == "lower" else "lower"]
        change(halves[kind])

    return forge


def times(name: str, factor: npt.ArrayLike) -> Callable[[Arrays], None]:
    """Return a function that multiplies an array."""
    return lambda them: them.update({name: them[name] * np.asarray(factor)})


def put(name: str, where: Any, value: Any) -> Callable[[Arrays], None]:
    """Return a function that sets a part of an array."""
    return lambda them: them[name].__setitem__(where, value)


def make(name: str, change: Callable[[npt.NDArray], object]) -> Callable[[Arrays], None]:
    """Return a function that replaces an array by a function of it."""
    return lambda them: them.update({name: np.asarray(change(them[name]))})


def drop(name: str) -> Callable[[Arrays], object]:
    """Return a function that removes an array."""
    return lambda them: them.pop(name)


def in_turn(*changes: Callable[[Arrays], object]) -> Callable[[Arrays], object]:
    """Return a function that makes several changes in turn."""
    return lambda them: [change(them) for change in changes]
