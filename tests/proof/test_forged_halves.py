"""Test that halves of different bodies are refused, even if their sums agree."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import pytest

from perfplast_fenicsx import limit_bounds, read_gmsh
from perfplast_fenicsx.limit_analysis.body.finer_meshes import refined
from tests.limit_analysis.test_dead_loads import footing
from tests.proof.forging import (
    Arrays,
    Halves,
    blocks,
    both,
    copied,
    in_turn,
    put,
    said_of,
    write,
    written,
)
from tests.proof.test_forgeries import free_cell
from tests.proof.test_rings import discs
from tests.random_bodies import problem_of, stack, write_stack

pytestmark = pytest.mark.serial

Change = Callable[[Arrays], object]


@pytest.fixture(scope="module", params=[2, 3])
def stacked(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return two stacked blocks."""
    return blocks(tmp_path_factory.mktemp("stacked"), request.param)


@pytest.fixture(scope="module")
def ground(tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return a footing on a mesh of equal cells."""
    honest = limit_bounds(footing((0.0, -1.0), (0.0, 0.0)))
    return written(tmp_path_factory.mktemp("ground"), honest)


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return two axisymmetric discs."""
    return written(tmp_path_factory.mktemp("turned"), limit_bounds(discs(), 1e-3))


def refused(
    honest: Halves, common: Change, above: Change, below: Change, word: str, folder: Path
) -> None:
    """A change in both halves is harmless, but a change in one half is refused."""
    halves = copied(honest)
    both(common)(halves)
    assert not said_of(write(folder / "harmless.h5", halves))
    above(halves["upper"])
    below(halves["lower"])
    assert word in said_of(write(folder / "forged.h5", halves))


def as_it_is(them: Arrays) -> None:
    """Change nothing."""


def idle(count: int, size: float, away: float = 0.0) -> Change:
    """Add a row of free cells without strain."""

    def forge(them: Arrays) -> None:
        d = them["vertices"].shape[1]
        for number in range(count):
            free_cell(1.0, size=size)(them)
            them["vertices"][-d - 1 :, 0] += away + 2 * size * number

    return forge


def facets_of(them: Arrays, cell: int) -> npt.NDArray:
    """Return the numbers of all facets of a free cell, counted from the end."""
    wide = them["vertices"].shape[1] + 1
    return np.arange(wide) + len(them["facets"]) + wide * cell


def one_weaker_cell(them: Arrays) -> None:
    """Give one cell of the weaker block a tenth less strength."""
    for name in ("cone_bound", "cone_slope", "cone_matrix", "cone_sine", "cone_tension"):
        them[name] = np.concatenate([them[name], them[name][:1]])
    them["cone_bound"][-1] = 0.9 * them["cone_bound"].min()
    weak = np.flatnonzero(them["cone"] == np.argmin(them["cone_bound"][:-1]))
    them["cone"][weak[0]] = len(them["cone_bound"]) - 1


def less_load(them: Arrays) -> None:
    """Reduce the load on the blocks by a tenth, and load a remote block instead."""
    pushes = np.abs(them["traction"]).max(axis=(1, 2)) < 1e2
    them["traction"][pushes] *= 0.9
    them["bound"] = 2 * them["bound"]


def pressed_idle_cell(them: Arrays) -> None:
    """Add a large remote cell that supports hold, with pressure on the held facets."""
    idle(1, 1e6)(them)
    there = facets_of(them, -1)
    them["held"][there] = 1
    them["traction"][there] = 1e3


def moved_cell(them: Arrays) -> None:
    """Move the last free cell, except the large one, slightly further away."""
    d = them["vertices"].shape[1]
    them["vertices"][-d - 1 :, 1] += 1e-4
    if "velocity" in them:
        assert not them["velocity"][them["nodes"][-1]].any()


def far_names(them: Arrays) -> None:
    """Give all surfaces large numbers."""
    for name in ("surface", "contacts", "obstacles"):
        them[name] = them[name] + 10**12


def of_another_surface(them: Arrays) -> None:
    """Assign the contact to surfaces that do not face each other."""
    other = np.setdiff1d(them["surface"], [*them["contacts"].ravel(), *them["obstacles"]])
    them["contacts"][0, 1] = other[0]


HIDDEN: dict[str, tuple[Change, Change, str]] = {
    "a weaker cell beside a large idle body": (idle(1, 1e6), one_weaker_cell, "weaker bodies"),
    "less load beside a larger one": (pressed_idle_cell, less_load, "different loads"),
    "a body moved beside a large one": (
        in_turn(idle(1, 1e6), idle(1, 1.0, -1e3)),
        moved_cell,
        "volume or position",
    ),
    "supports moved to another facet": (
        in_turn(idle(1, 1.0), lambda it: put("held", facets_of(it, -1)[1], 1)(it)),
        lambda it: put("held", facets_of(it, -1)[1:3], it["held"][facets_of(it, -1)[2:0:-1]])(it),
        "different supports",
    ),
    "names exchanged about one middle": (
        in_turn(
            idle(4, 1.0),
            *(
                lambda it, cell=cell, tag=tag: put("surface", facets_of(it, cell)[:1], tag)(it)
                for cell, tag in ((-4, 101), (-3, 102), (-2, 102), (-1, 101))
            ),
        ),
        lambda it: it.update(
            surface=np.where(it["surface"] > 100, 203 - it["surface"], it["surface"])
        ),
        "different surfaces",
    ),
    "a contact of another surface of large number": (
        far_names,
        of_another_surface,
        "different contacts",
    ),
}


@pytest.mark.parametrize("name", HIDDEN)
def test_what_sums_do_not_tell(stacked: Halves, tmp_path: Path, name: str) -> None:
    common, above, word = HIDDEN[name]
    refused(stacked, common, above, as_it_is, word, tmp_path)


def in_row(them: Arrays, columns: tuple[int, int], changed: Change) -> None:
    """Change two cells of the lowest row of the ground, from those with equal places."""
    centres = them["vertices"][them["cells"]].mean(axis=1)
    row = np.flatnonzero(np.isclose(centres[:, 1], centres[:, 1].min()))
    row = row[np.argsort(centres[row, 0])]
    changed(them | {"these": row[list(columns)]})


def two_cones(them: Arrays) -> None:
    """Add a second cone, without cells, of twice the strength; claims are small."""
    for name in ("cone_bound", "cone_slope", "cone_matrix", "cone_sine", "cone_tension"):
        them[name] = np.concatenate([them[name], them[name][:1]])
    them["cone_bound"][1] *= 2
    if "velocity" in them:
        them["bound"] = 2 * them["bound"]


def strong(columns: tuple[int, int]) -> Change:
    """Assign the second cone to two cells of the lowest row."""
    return partial(in_row, columns=columns, changed=lambda it: put("cone", it["these"], 1)(it))


def test_strengths_exchanged_among_equal_cells(ground: Halves, tmp_path: Path) -> None:
    """The mean distance of cells 1 and 4 from the middle equals that of cells 2 and 3."""
    refused(ground, two_cones, strong((1, 2)), strong((0, 3)), "weaker bodies", tmp_path)


def heavy(columns: tuple[int, int]) -> Change:
    """Add forces on two cells, of which only the resultant is known."""
    push = [0.0, -1e-30]
    return partial(
        in_row, columns=columns, changed=lambda it: put("body_force", it["these"], push)(it)
    )


def test_forces_exchanged_among_equal_cells(ground: Halves, tmp_path: Path) -> None:
    refused(ground, two_cones, heavy((1, 2)), heavy((0, 3)), "different loads", tmp_path)


def sheared(them: Arrays) -> None:
    """Add tractions along a held facet with zero force and moment."""
    facet = np.flatnonzero(them["held"].all(axis=1))[0]
    x = them["vertices"][them["facets"][facet]]
    them["traction"][facet] += [x[1] - x[0], x[0] - x[1]]


def test_tractions_without_a_resultant(ground: Halves, tmp_path: Path) -> None:
    refused(ground, as_it_is, sheared, as_it_is, "different loads", tmp_path)


@pytest.mark.parametrize("radius", [1e-10, 1e-14])
def test_a_hole_along_the_axis(turned: Halves, tmp_path: Path, radius: float) -> None:
    def bored(them: Arrays) -> None:
        x = them["vertices"][:, 0]
        x[x == 0] = radius

    refused(turned, as_it_is, bored, as_it_is, "volume or position", tmp_path)


@pytest.mark.long(but=["1-2"])
@pytest.mark.parametrize(("seed", "dim"), [(1, 2), (14, 3)])
def test_halves_on_two_meshes(tmp_path: Path, seed: int, dim: int) -> None:
    """A third of the cells is divided for one half, with contact, weight and several strengths."""
    it = stack(seed, dim)
    write_stack(tmp_path / "stack.msh", it)
    coarse = problem_of(it, read_gmsh(MPI.COMM_WORLD, tmp_path / "stack.msh"))[0]
    some = np.arange(len(coarse.tagged_mesh.cell_tags.indices)) % 3 == 0
    fine = coarse.on(refined(coarse, some))
    one, other = (limit_bounds(problem, 1e-3) for problem in (coarse, fine))
    for name, (low, high) in {"finer above": (one, other), "finer below": (other, one)}.items():
        folder = tmp_path / name
        folder.mkdir()
        counts = [len(of["cells"]) for of in written(folder, low, high).values()]
        assert (counts[0] < counts[1]) == (name == "finer above")


def finer(them: Arrays) -> None:
    """Divide the first outer cell of the upper half into one cell per facet."""
    cell = int(np.flatnonzero(them["cone"] >= 0)[0])
    old, middle = them["cells"][cell].copy(), len(them["vertices"])
    centre = them["vertices"][old].mean(axis=0)
    them["vertices"] = np.vstack([them["vertices"], centre])
    parts = np.where(np.eye(len(old), dtype=bool), middle, old)
    for name in ("cone", "body_force", "stress"):
        if name in them:
            them[name] = np.concatenate([them[name], them[name][[cell] * (len(old) - 1)]])
    them["cells"] = np.concatenate([them["cells"], parts[1:]])
    them["cells"][cell] = parts[0]
    at = them["stress"][cell].copy()
    for number, part in zip((cell, *range(-len(old) + 1, 0)), range(len(old)), strict=True):
        them["stress"][number] = at
        them["stress"][number, part] = at.mean(axis=0)


def test_a_finer_half_is_of_the_same_bodies(stacked: Halves, tmp_path: Path) -> None:
    halves = copied(stacked)
    finer(halves["lower"])
    assert not said_of(write(tmp_path / "finer.h5", halves))
