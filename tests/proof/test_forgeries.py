"""Test that forged proofs are refused, each for the right reason.

A forgery changes arrays of honest files, one in 2D and one in 3D, in the lower half, the upper half
or both. Forgeries that do not depend on the dimension are tried in both.
"""

import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from mpi4py import MPI

import h5py
import numpy as np
import pytest

from perfplast_fenicsx.proof import ProofError, check
from tests.proof.forging import (
    Arrays,
    Forgery,
    Halves,
    alone,
    blocks,
    both,
    drop,
    high,
    in_turn,
    low,
    make,
    put,
    said_of_forged,
    times,
    write,
)

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="the checker is serial")


@pytest.fixture(scope="module", params=[2, 3])
def honest(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return the halves of a proof of two blocks on a plane, of different strength, with weight."""
    return blocks(tmp_path_factory.mktemp("honest"), request.param)


def free_cell(
    radius: float, speed: float = 0.0, size: float = 1.0, pressed: float = 0.0
) -> Callable[[Arrays], None]:
    """Add a free remote cell, which may be sheared, or pressed from all sides."""

    def forge(them: Arrays) -> None:
        d, n = them["vertices"].shape[1], len(them["vertices"])
        x = 50.0 + size * np.concatenate([np.zeros((1, d)), np.eye(d)])
        cell = np.arange(n, n + d + 1)
        inward = np.concatenate([-np.ones((1, d)), np.eye(d)])
        outward = -inward / np.linalg.norm(inward, axis=1, keepdims=True)
        more: Arrays = {
            "vertices": x,
            "cells": cell[None],
            "cone": np.array([len(them["cone_bound"])]),
            "cone_bound": np.array([radius]),
            "cone_slope": np.zeros((1, d * (d + 1) // 2)),
            "cone_matrix": them["cone_matrix"][:1],
            "cone_sine": them["cone_sine"][:1],
            "cone_tension": them["cone_tension"][:1],
            "body_force": np.zeros((1, d)),
            "facets": np.array([[v for v in cell if v != out] for out in cell]),
            "surface": np.zeros(d + 1, dtype=int),
            "held": np.zeros((d + 1, d), dtype=np.uint8),
            "traction": np.repeat(-pressed * outward[:, None], d, axis=1),
        }
        if "stress" in them:
            inside = -pressed * float(them["bound"]) * np.eye(d)
            more["stress"] = np.tile(inside, (1, d + 1, 1, 1))
        else:
            pairs = [(a, b) for a in range(d + 1) for b in range(a + 1, d + 1)]
            nodes = np.concatenate([x, np.array([(x[a] + x[b]) / 2 for a, b in pairs])])
            v = np.zeros_like(nodes)
            v[:, 0] = speed * (nodes[:, 1] - 50.0)
            more["nodes"] = len(them["velocity"]) + np.arange(len(nodes))[None]
            more["velocity"] = v
        for name, rows in more.items():
            them[name] = np.concatenate([them[name], rows])

    return forge


ELASTIC = partial(np.full_like, fill_value=-1)
"""No cones for all cells."""


def elastic_where_weakest(them: Arrays) -> None:
    """Make the weakest cells elastic."""
    them["cone"][them["cone"] == np.argmin(them["cone_bound"])] = -1


def nothing(them: Arrays) -> None:
    """No rows at all."""
    for name in them:
        if name != "bound":
            them[name] = them[name][:0]


def floating(cone: str) -> Callable[[Arrays], None]:
    """Pull a free cell by a small force, beside bodies that carry any load."""

    def forge(them: Arrays) -> None:
        them["cone_bound"] = 1e15 * them["cone_bound"]
        free_cell(1e15)(them)
        them["body_force"][-1] = 1e-11
        if cone == "elastic":
            them["cone"][-1] = -1
        else:
            d = them["vertices"].shape[1]
            them["cone_bound"][-1] = 0.0
            them["cone_slope"][-1, :d] = 0.2

    return forge


def twice_in_one_place(them: Arrays) -> None:
    """Add a copy of all bodies in the same place."""
    second_copy(them, 0.0)


def second_copy(them: Arrays, shift: float) -> None:
    """Add a copy of all bodies, moved along x."""
    vertices, nodes = len(them["vertices"]), len(them.get("velocity", ()))
    for name in them:
        if name == "bound" or name.startswith(("contact", "obstacle")) or "cone_" in name:
            continue
        more = them[name].copy()
        if name in ("cells", "facets"):
            more += vertices
        if name == "nodes":
            more += nodes
        if name == "vertices":
            more[:, 0] += shift
        if name == "surface":
            more[:] = 0  # without contact
        them[name] = np.concatenate([them[name], more])


def a_cell_within(them: Arrays) -> None:
    """Add a small free cell inside another cell."""
    centre = them["vertices"][them["cells"][0]].mean(axis=0)
    free_cell(1.0, size=1e-3)(them)
    them["vertices"][-centre.size - 1 :] += centre - 50.0


def crossing(them: Arrays) -> None:
    """Add two needles that cross between the ends and middles of their sides."""
    free_cell(1.0)(them)
    free_cell(1.0)(them)
    d = them["vertices"].shape[1]
    one = np.concatenate([np.zeros((1, d)), np.eye(d)])
    one[1, 0] = 8.0
    other = 0.1 * np.concatenate([np.zeros((1, d)), np.eye(d)]) + 0.05
    other[:, 0] += 2.0
    other[:, 1] -= 4.0
    other[2, 1] = 12.0
    them["vertices"][-2 * d - 2 :] = 50.0 + np.concatenate([one, other])


def folded(them: Arrays) -> None:
    """Move the vertex of an outer facet's cell through the next cell."""
    d, cells = them["vertices"].shape[1], them["cells"]
    inner = np.setdiff1d(cells.ravel(), them["facets"].ravel())
    v = inner[0] if len(inner) else cells[0, 0]
    x = them["vertices"]
    around = cells[(cells == v).any(axis=1)]
    far = x[np.unique(around)]
    x[v] = far.max(axis=0) + np.ptp(far, axis=0) * np.arange(1, d + 1)


def weakest_cell(them: Arrays, speed: float) -> None:
    """Move everything down, beside a fast cell without dissipation."""
    them["velocity"][:, -1] -= 1.0
    free_cell(1e-29, speed)(them)


def moved(axis: int, by: float) -> Callable[[Arrays], None]:
    """Change all velocities."""

    def forge(them: Arrays) -> None:
        them["velocity"][:, axis] += by

    return forge


def raised(them: Arrays, by: float) -> None:
    """Add a uniform stress that only its bounds can detect."""
    d = them["vertices"].shape[1]
    them["stress"] += by * np.eye(d)


def swollen(them: Arrays, by: float) -> None:
    """Change the velocity in proportion to the distance from the corner, so the volume changes."""
    cells, nodes = them["cells"], them["nodes"]
    d = them["vertices"].shape[1]
    x = np.zeros_like(them["velocity"])
    x[nodes[:, : d + 1]] = them["vertices"][cells]
    pairs = [(a, b) for a in range(d + 1) for b in range(a + 1, d + 1)]
    x[nodes[:, d + 1 :]] = them["vertices"][cells[:, pairs]].mean(axis=2)
    them["velocity"] += by * x


def without(tag_of: str) -> Callable[[Arrays], None]:
    """Remove the contact or the obstacle."""

    def forge(them: Arrays) -> None:
        for name in them:
            if name.startswith(tag_of[:-1]):
                them[name] = them[name][:0]

    return forge


LARGE = 1e300

FORGERIES: dict[str, tuple[Forgery, str]] = {
    # forgeries that once passed
    "a strong free cell hides a load": (
        both(in_turn(free_cell(1e12), times("bound", 100))),
        "outer tractions",
    ),
    "a strong free cell hides that there is no stress": (
        alone("lower", in_turn(times("stress", 0), times("bound", 1000), free_cell(1e14))),
        "outer tractions",
    ),
    "a quick weak cell hides rigid motion": (
        alone("upper", lambda them: weakest_cell(them, 1e20)),
        "no work",
    ),
    "a quick weak cell hides moved supports": (
        alone("upper", in_turn(moved(0, 1.0), free_cell(1e-29, 1e20))),
        "exceed the work",
    ),
    "a quick weak cell hides volume": (
        alone("upper", in_turn(lambda them: swollen(them, -1.0), free_cell(1e-29, 1e20))),
        "exceed the work",
    ),
    "all elastic, hardly loaded": (
        alone("lower", in_turn(make("cone", ELASTIC), times("traction", 1e-12))),
        "joint_force is missing",
    ),
    "no rows": (both(nothing), "no cell"),
    "no rows, lower": (alone("lower", in_turn(nothing, put("bound", (), 1e9))), "no cell"),
    "upper half weaker": (
        high(in_turn(times("cone_bound", 0.5), times("bound", 0.6))),
        "weaker bodies",
    ),
    "stress complex": (low(make("stress", lambda a: a + 1j)), "consist of numbers"),
    "stress as text": (low(make("stress", lambda a: a.astype("S"))), "consist of numbers"),
    "held as text": (both(make("held", lambda a: a.astype("S"))), "consist of numbers"),
    "held nan": (both(make("held", lambda a: np.where(a, a, np.nan))), "flags"),
    "held as floats": (both(make("held", lambda a: a.astype(float))), "flags"),
    "cells 0.4 too large": (both(make("cells", lambda a: a + 0.4)), "whole numbers"),
    "an obstacle turned round": (high(times("obstacle_normals", -1.0)), "different contacts"),
    "bodies in one place": (both(twice_in_one_place), "overlap"),
    # empty or harmless loads
    "only supports are loaded": (
        both(in_turn(times("traction", 0), times("body_force", 0))),
        "loaded",
    ),
    "elastic alone": (alone("upper", make("cone", ELASTIC)), "no work"),
    # kinds of numbers
    "velocity complex": (high(make("velocity", lambda a: a + 1j)), "consist of numbers"),
    "vertices complex": (both(make("vertices", lambda a: a + 0j)), "consist of numbers"),
    "vertices as text": (both(make("vertices", lambda a: a.astype("S"))), "consist of numbers"),
    "long floats": (low(make("stress", lambda a: a.astype(np.longdouble))), "8 bytes"),
    "nodes as floats": (high(make("nodes", lambda a: a.astype(float))), "whole numbers"),
    "facets as floats": (both(make("facets", lambda a: a.astype(float))), "whole numbers"),
    "surface as floats": (both(make("surface", lambda a: a.astype(float))), "whole numbers"),
    "contacts as floats": (both(make("contacts", lambda a: a.astype(float))), "whole numbers"),
    "cells as flags": (both(make("cells", lambda a: a.astype(bool))), "whole numbers"),
    "huge vertex numbers": (
        both(make("cells", lambda a: a.astype(np.uint64) + np.uint64(2**63))),
        "too large",
    ),
    "held 2": (both(put("held", (0, 0), 2)), "flags"),
    "held -1": (both(make("held", lambda a: -a.astype(np.int8))), "flags"),
    # the bound
    "bound text": (low(make("bound", lambda a: np.bytes_(b"1.0"))), "single real"),
    "bound complex": (low(make("bound", lambda a: a + 1j)), "single real"),
    "bound nan": (low(put("bound", (), np.nan)), "not finite"),
    "bound infinite": (low(put("bound", (), np.inf)), "not finite"),
    "upper bound infinite": (high(put("bound", (), np.inf)), "not finite"),
    "bound huge": (low(put("bound", (), 1e61)), "1e-60 to 1e60"),
    "upper bound tiny": (high(put("bound", (), 1e-61)), "1e-60 to 1e60"),
    "bound negative": (high(times("bound", -1.0)), "negative"),
    "two bounds": (low(make("bound", lambda a: np.array([a, a]))), "single real"),
    "no bound": (low(drop("bound")), "bound is missing"),
    "lower 1e-6 too large": (low(times("bound", 1 + 1e-6)), "outer tractions"),
    "upper 1e-6 too small": (high(times("bound", 1 - 1e-6)), "only"),
    # invalid or absurd numbers
    "vertices nan": (both(times("vertices", np.nan)), "not finite"),
    "vertices huge": (both(times("vertices", LARGE)), "1e-30 to 1e30"),
    "vertices tiny": (both(times("vertices", 1e-300)), "1e-30 to 1e30"),
    "far from the origin": (both(make("vertices", lambda a: a + 1e14)), "volume|rounding"),
    "radii nan": (both(put("cone_bound", 0, np.nan)), "not positive|is negative"),
    "radii zero": (both(put("cone_bound", 0, 0.0)), "not positive|is negative"),
    "radii minus infinite": (both(put("cone_bound", 0, -np.inf)), "not positive|is negative"),
    "traction infinite": (both(put("traction", 0, np.inf)), "not finite"),
    "body force nan": (both(put("body_force", 0, np.nan)), "not finite"),
    "normals nan": (both(times("obstacle_normals", np.nan)), "not finite"),
    "normals twice as long": (both(times("obstacle_normals", 2.0)), "unit vector"),
    "stress nan": (low(put("stress", 0, np.nan)), "equilibrium"),
    "stress infinite": (low(put("stress", 0, np.inf)), "equilibrium"),
    "stress huge": (low(put("stress", 0, LARGE)), "1e-60 to 1e60"),
    "velocity infinite": (high(put("velocity", 0, np.inf)), "does not fit these"),
    "velocity huge": (high(times("velocity", LARGE)), "1e-30 to 1e30"),
    "elastic bodies that flow, and nothing else": (
        alone(
            "upper",
            in_turn(
                make("cone", lambda a: np.full_like(a, -1)), free_cell(1.0), times("bound", 0.0)
            ),
        ),
        "no work",
    ),
    "velocity whose squares are lost": (
        high(in_turn(times("velocity", 1e-170), times("bound", 0.0))),
        "1e-30 to 1e30",
    ),
    "stresses whose squares are lost": (
        low(in_turn(*(times(n, 1e-170) for n in ("stress", "traction", "cone_bound")))),
        "outside the range",
    ),
    "cones whose squares are lost": (
        both(in_turn(times("cone_bound", 1e-170), times("cone_matrix", 1e-170))),
        "outside the range",
    ),
    "one cone whose squares are lost": (
        both(in_turn(put("cone_bound", 0, 1e-170), put("cone_matrix", 0, 1e-170))),
        "1e-30 to 1e30",
    ),
    # shapes
    "no axis": (both(make("vertices", np.ravel)), "the shape of"),
    "four coordinates": (both(make("vertices", lambda a: np.hstack([a, a]))), "the shape of"),
    "cells with one vertex less": (both(make("cells", lambda a: a[:, 1:])), "the shape of"),
    "a radius too few": (both(make("cone", lambda a: a[1:])), "the shape of"),
    "a stress too few": (low(make("stress", lambda a: a[1:])), "does not fit"),
    "a stress for each cell": (low(make("stress", lambda a: a[:, 0])), "does not fit"),
    "a scalar": (both(make("cells", lambda a: a[0, 0])), "the shape of"),
    "too many axes": (low(make("stress", lambda a: a[None])), "the shape of"),
    "nodes of vertices alone": (high(make("nodes", lambda a: a[:, :3])), "do not fit"),
    "node that there is not": (high(put("nodes", (0, 0), 10**9)), "have no velocity"),
    "node before the first": (high(put("nodes", (0, 0), -1)), "have no velocity"),
    "vertex before the first": (both(put("cells", (0, 0), -1)), "do not exist"),
    "no velocity": (high(drop("velocity")), "missing"),
    "no stress": (low(drop("stress")), "missing"),
    "no contacts array": (both(drop("contacts")), "shape of contact_adhesion"),
    # geometry
    "a cell twice": (
        alone(
            "lower",
            lambda them: [
                them.update({name: np.concatenate([them[name], them[name][:1]])})
                for name in ("cells", "cone", "body_force", "stress")
            ],
        ),
        "facets|two cells",
    ),
    "a cell within another": (both(a_cell_within), "overlap"),
    "bodies half in each other": (both(lambda them: second_copy(them, 0.3)), "overlap"),
    "bodies by a hundredth in each other": (both(lambda them: second_copy(them, 0.99)), "overlap"),
    "bodies across each other": (both(crossing), "overlap"),
    "folded": (both(folded), "folded|overlap|no volume"),
    "flat": (both(make("vertices", lambda a: a * ([1] * (a.shape[1] - 1) + [0]))), "no volume"),
    "two vertices of a cell are one": (
        both(lambda them: put("cells", (0, 0), them["cells"][0, 1])(them)),
        "no volume",
    ),
    "a facet is forgotten": (
        both(
            lambda them: [
                them.update({name: them[name][1:]})
                for name in ("facets", "surface", "held", "traction")
            ]
        ),
        "not the outer facets",
    ),
    "a facet twice": (both(put("facets", 0, -1)), "do not exist"),
    # both halves are of different bodies
    "larger in the upper half": (high(times("vertices", 1.01)), "volume or position"),
    "elsewhere in the upper half": (
        high(make("vertices", lambda a: a + 1.0)),
        "volume or position",
    ),
    "strengths changed over": (
        high(make("cone", lambda a: a.max() + a.min() - a)),
        "weaker bodies",
    ),
    "stronger in the lower half": (low(times("cone_bound", 1.5)), "weaker bodies"),
    "loads twice as large above": (high(times("traction", 2.0)), "different loads"),
    "heavier above": (high(times("body_force", 3.0)), "different loads"),
    "weight turned above": (
        high(make("body_force", lambda a: a[:, ::-1])),
        "different loads",
    ),
    "loads half as large below": (
        low(in_turn(*(times(name, 0.5) for name in ("traction", "body_force", "stress")))),
        "different loads",
    ),
    "held below alone": (low(make("held", np.ones_like)), "different supports"),
    "free above": (high(make("held", np.zeros_like)), "different supports"),
    "other names of surfaces": (high(make("surface", lambda a: a + 1)), "different surfaces"),
    "no contact above": (high(without("contacts")), "different contacts"),
    "no contact below": (low(without("contacts")), "different contacts"),
    "no obstacle above": (high(without("obstacles")), "different contacts"),
    "upper claimed below lower": (
        lambda halves: halves["upper"]["bound"].__setitem__((), 0.5 * halves["lower"]["bound"]),
        "only",
    ),
    # invalid tags
    "a contact of no surface": (both(put("contacts", (0, 0), 0)), "not positive"),
    "an obstacle of no surface": (both(put("obstacles", 0, 0)), "not positive"),
    "a contact of a surface that there is not": (
        both(put("contacts", (0, 0), 4711)),
        "does not exist",
    ),
    "a surface below zero": (both(put("surface", 0, -1)), "negative tags"),
    "a contact twice": (
        both(
            lambda them: [
                them.update({name: np.concatenate([them[name], them[name][:, ::-1]])})
                if name == "contacts"
                else them.update({name: np.concatenate([them[name]] * 2)})
                for name in them
                if name.startswith("contact")
            ]
        ),
        "twice",
    ),
    # the stress
    "asymmetric by the last bit": (
        low(lambda them: put("stress", (0, 0, 0, 1), them["stress"][0, 0, 0, 1] + 1e-14)(them)),
        "asymmetry",
    ),
    "everywhere a little pull": (low(lambda them: raised(them, 1e-6)), "tractions|tension"),
    "stress larger by 1e-7": (low(times("stress", 1 + 1e-7)), "tractions"),
    "one component": (low(lambda them: put("stress", (0, 0, 0, 0), 7.0)(them)), "equilibrium"),
    "cells changed over": (
        low(lambda them: put("stress", slice(0, 2), them["stress"][1::-1])(them)),
        "tractions|equilibrium",
    ),
    "weaker by 1e-8": (both(times("cone_bound", 1 - 1e-4)), "times as large"),
    "pull": (low(times("stress", -1.0)), "tension|tractions"),
    "hidden forces, each small": (
        low(make("body_force", lambda a: a + 1e-6 / len(a))),
        "left of load|equilibrium",
    ),
    "hidden forces in a strong body under its own load": (
        alone(
            "lower",
            in_turn(
                free_cell(1e15, pressed=1e9),
                put("body_force", (0, 0), 1e-6),
            ),
        ),
        "left of strength|equilibrium",
    ),
    "a force on an elastic body that nothing holds": (
        alone("lower", floating("elastic")),
        "left of piece",
    ),
    "a force on sand without stress": (alone("lower", floating("sand")), "equilibrium"),
    # the velocity
    "supports move": (
        high(lambda them: put("velocity", (slice(None), 0), them["velocity"][:, 0] + 1e-3)(them)),
        "only",
    ),
    "into the plane": (high(moved(-1, -1e-3)), "only"),
    "at rest": (high(times("velocity", 0.0)), "no work"),
    "backwards": (high(times("velocity", -1.0)), "no work|all the work"),
    "swelling": (high(lambda them: swollen(them, 1e-6)), "only"),
    "one node": (high(lambda them: put("velocity", 0, them["velocity"][0] + 1e-3)(them)), "only"),
    "elastic where it flows": (
        both(elastic_where_weakest),
        "no work",
    ),
    "nodes changed over": (
        high(lambda them: put("nodes", (0, slice(0, 2)), them["nodes"][0, 1::-1])(them)),
        "not continuous",
    ),
}


@pytest.mark.parametrize("name", FORGERIES)
def test_a_forgery_is_refused(honest: Halves, name: str, tmp_path: Path) -> None:
    forge, words = FORGERIES[name]
    said = said_of_forged(honest, forge, tmp_path)
    assert any(word in said for word in words.split("|")), said


def test_arrays_that_are_not_in_the_file(honest: Halves, tmp_path: Path) -> None:
    less = {kind: dict(half) for kind, half in honest.items()}
    del less["upper"]["velocity"], less["lower"]["stress"]
    path = write(tmp_path / "forged.h5", less)
    with h5py.File(path, "a") as file:
        file["lower"].create_dataset("stress", (10**6, 10**6), "f8", chunks=(1024, 1024))
    refused(path, "declares 1e+12 numbers")
    with h5py.File(path, "a") as file:
        del file["lower"]
        file["upper"]["velocity"] = h5py.ExternalLink("/dev/zero", "velocity")
    refused(path, "velocity is a link")
    with h5py.File(path, "a") as file:
        del file["upper/velocity"]
        place = [("/dev/zero", 0, h5py.h5f.UNLIMITED)]
        file["upper"].create_dataset("velocity", (10**4, 2), "f8", external=place)
    refused(path, "not in the file itself")
    with h5py.File(path, "a") as file:
        del file["upper/velocity"]
        file.create_group("upper/velocity")
    refused(path, "velocity is not an array")
    with h5py.File(path, "w") as file:
        file["lower"] = 1.0
    refused(path, "not a group")
    write(path, {"upper": honest["upper"]})
    with h5py.File(path, "a") as file:
        file["lower"] = h5py.ExternalLink("other.h5", "lower")
    refused(path, "lower is a link")
    path.write_text("lower")
    refused(path, "not a proof of bounds")


def refused(path: Path, words: str) -> None:
    """Check that a file is refused as a proof file."""
    with pytest.raises(ProofError, match=words.replace("+", r"\+")):
        check(path)


def test_the_status_is_that_of_the_documentation(honest: Halves, tmp_path: Path) -> None:
    good, bad, none = (tmp_path / name for name in ("good.h5", "bad.h5", "none.h5"))
    write(good, honest)
    low = {k: v.copy() for k, v in honest["lower"].items()}
    write(bad, {"lower": low | {"stress": 2 * low["stress"]}})
    write(none, {"lower": low | {"stress": low["stress"].astype("S")}})
    for path, status in ((good, 0), (bad, 1), (none, 2)):
        command = [sys.executable, "-m", "perfplast_fenicsx.proof", str(path)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == status, done.stderr
        assert "Traceback" not in done.stderr
        if status < 2:
            for words in ("Taken as written", "yield radii", "supports hold", "contact", "loads"):
                assert words in done.stdout
            assert "Unbalanced forces are" in done.stdout


def test_facets_of_a_surface_that_are_held_otherwise_are_listed_apart(
    honest: Halves, tmp_path: Path
) -> None:
    lower = {name: values.copy() for name, values in honest["lower"].items()}
    held, surface = lower["held"], lower["surface"]
    one = np.flatnonzero(held.any(axis=1))[0]
    before = [axis for axis, alike in zip("xyz", held[one], strict=False) if alike]
    rest = np.count_nonzero((surface == surface[one]) & (held == held[one]).all(axis=1)) - 1
    held[one] = True
    words = " ".join(check(write(tmp_path / "rollers.h5", {"lower": lower}))["lower"].words)
    axes = "xyz"[: held.shape[1]]
    assert len(before) < len(axes)
    assert f"{', '.join(axes)} of surface {surface[one]} (1 facets)" in words
    assert f"{', '.join(before)} of surface {surface[one]} ({rest} facets)" in words


def test_an_upper_half_of_stronger_bodies_is_one(honest: Halves, tmp_path: Path) -> None:
    """An upper bound of stronger bodies also holds for the bodies."""
    upper = honest["upper"]
    stronger = upper | {"cone_bound": 2 * upper["cone_bound"], "bound": 2 * upper["bound"]}
    path = write(tmp_path / "stronger.h5", {"lower": honest["lower"], "upper": stronger})
    assert not any(of.faults for of in check(path).values())
