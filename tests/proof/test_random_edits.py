"""Test that no random edit of an honest file proves a false bound.

An edit of a stress, a velocity or a claim does not change the bodies. The same holds for an edit of
the bodies in one half that the checker accepts as the same bodies. Then no lower bound may be above
the honest upper bound, and no upper bound below the honest lower bound. Edits of the bodies in both
halves change the limits: there the two bounds must not cross.

With ``PERFPLAST_FUZZ=10`` the long test tries 2 040 edits of all kinds of files.
"""

import math
import os
from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import pytest

from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    BodyForce,
    HoekBrown,
    MohrCoulomb,
    PorePressure,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    Traction,
    VonMises,
    limit_bounds,
    read_gmsh,
)
from perfplast_fenicsx.proof import ProofError, check
from tests.functional.test_plane_stress import ring
from tests.functional.test_random_statements import HINGED
from tests.limit_analysis.test_associated_joints import cut_column
from tests.limit_analysis.test_dead_loads import K, footing
from tests.limit_analysis.test_no_cohesion import on_heavy_sand, under_surcharge
from tests.limit_analysis.test_nonassociated_ground import column, ground
from tests.limit_analysis.test_pore_bounds import U, square
from tests.limit_analysis.test_rigid_blocks import pushed
from tests.limit_analysis.test_rigid_rings import pressed_disc
from tests.limit_analysis.test_static_bound import rectangle
from tests.proof.forging import Arrays, Halves, blocks, copied, write, written
from tests.proof.test_blocks import in_space
from tests.proof.test_rubbing import stacked
from tests.random_statements import random_case

pytestmark = pytest.mark.serial

EFFORT = float(os.environ.get("PERFPLAST_FUZZ", "1"))


def reading(folder: Path) -> Callable[..., TaggedMesh]:
    """Return a function that writes a mesh and reads it."""

    def read(write_mesh: Callable[..., object], **options: object) -> TaggedMesh:
        write_mesh(folder / "mesh.msh", **options)
        return read_gmsh(MPI.COMM_SELF, folder / "mesh.msh")

    return read


def of(make: Callable[[Path], Problem], rtol: float = 1e-3) -> Callable[[Path], Halves]:
    """Return a function that writes the proof of a problem."""
    return lambda path: written(path, limit_bounds(make(path), rtol))


def sheet(path: Path) -> Problem:
    """Return a quarter of a ring in plane stress."""
    return ring(reading(path)(write_thick_tube, outer=2.0, size=0.4), Pressure("inner", 1.0))


def dilating_less(path: Path) -> Problem:
    """Return a column of ground with two angles."""
    return column(ground("radenkovic"), Pressure("top", 1.0))


def in_a_direction(path: Path) -> Problem:
    """Return a square sheet under two loads in one direction of an envelope; one is constant."""
    sides = {
        f"{axis}{end}": lambda x, i=i, end=end: np.abs(x[i] - end) < 1e-9
        for i, axis in enumerate("xy")
        for end in (0, 1)
    }
    mesh = rectangle((2, 2), (1.0, 1.0), {"sheet": lambda x: x[0] < 2}, sides)
    loads = [Traction("y1", (0.0, 0.8)), Pressure("x1", -0.6)]
    loads += [Traction("x1", (0.1, 0.0), constant=True)]
    held = [Support(f"{axis}0", axis) for axis in "xy"]
    return Problem(mesh.thin(), {"sheet": VonMises(2e5, 0.3, 1.0)}, held, loads, degree=2)


def combined(path: Path) -> Problem:
    """Return a block whose strength and loads have partial factors of a combination."""
    law = MohrCoulomb(1e4, 0.3, 10.0 / 1.25, math.degrees(math.atan(math.tan(0.5) / 1.25)))
    sides = {"left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > 1 - 1e-9}
    ends = {"bottom": lambda x: x[1] < 1e-9, "top": lambda x: x[1] > 1 - 1e-9}
    mesh = rectangle((2, 2), (1.0, 1.0), {"ground": lambda x: x[0] > -1}, sides | ends)
    loads = [Pressure("top", 1.5), BodyForce("ground", (0.0, -1.35), constant=True)]
    held = [Support("left", "x"), Support("bottom", "y")]
    return Problem(mesh, {"ground": law}, held, loads, degree=2)


def footing_on_rock(path: Path) -> Problem:
    """Return half of a strip footing on Hoek–Brown rock, between rollers and a pressure."""
    sides = {"left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > 2 - 1e-9}
    ends = {
        "bottom": lambda x: x[1] < 1e-9,
        "strip": lambda x: (x[1] > 1 - 1e-9) & (x[0] < 1 + 1e-9),
    }
    mesh = rectangle((4, 2), (2.0, 1.0), {"rock": lambda x: x[0] > -1}, sides | ends)
    law = HoekBrown(1e4, 0.25, compressive_strength=20.0, m_b=1.5, s=0.01)
    loads = [Pressure("strip", 1.0), Pressure("right", 0.5, constant=True)]
    held = [Support("left", "x"), Support("bottom")]
    return Problem(mesh, {"rock": law}, held, loads, degree=2)


WET = [PorePressure(name, U) for name in ("lower", "upper")]

KINDS: dict[str, Callable[[Path], Halves]] = {
    "blocks": lambda path: blocks(path, 2),
    "adhesion": of(lambda path: stacked(2, tresca=10.0)),
    "constant loads": of(lambda path: footing((0.0, -1.0), (0.5 * K, 0)), 1e-4),
    "blocks in space": lambda path: blocks(path, 3),
    "friction": of(lambda path: stacked(2, coulomb=0.2)),
    "rings with a plate": of(lambda path: pressed_disc(2), 1e-4),
    "rigid blocks": of(lambda path: pushed(0.2, 2.0, 1.0, 0.1), 1e-4),
    "a sheet": of(sheet),
    "two loads on a sheet": of(in_a_direction),
    "a combination": of(combined),
    "Radenkovic's pair": of(dilating_less),
    "sand under a surcharge": of(lambda path: under_surcharge(reading(path), 20.0)),
    "heavy sand": of(lambda path: on_heavy_sand(reading(path), "rough", 0.8)),
    "a cut with friction": of(lambda path: cut_column(0.3, 0.0, 2.0)),
    "rigid stones in space": of(lambda path: in_space()),
    "water in the pores": of(lambda path: square(Pressure("top", 1.0), *WET)),
    "rock": of(footing_on_rock),
    "an elastic body on a hinge": of(lambda path: random_case(HINGED).problem),
}
SHORT = ("blocks", "adhesion")
OF_PROOFS = {
    "lower": ("stress", "joint_force", "inner_force", "inner_factor", "bound", "factor"),
    "upper": ("velocity", "bound"),
}
OF_BODIES = (
    *("vertices", "cells", "cone", "cone_bound", "cone_matrix", "body_force", "traction", "held"),
    *("surface", "facets", "contacts", "contact_adhesion", "contact_friction", "obstacle_normals"),
    *("constant_traction", "obstacle_adhesion", "cone_curvature"),
)


def scaled(values: npt.NDArray, random: np.random.Generator) -> npt.NDArray:
    """Return all values times a factor near 1 or far from it."""
    size = 10.0 ** random.uniform(-12, 1)
    return values * (1 + size * random.choice([-1.0, 1.0]))


def noisy(values: npt.NDArray, random: np.random.Generator) -> npt.NDArray:
    """Return values with noise on some rows; the noise of stresses is symmetric."""
    size = 10.0 ** random.uniform(-15, 1) * np.abs(values).max(initial=1e-3)
    noise = size * random.normal(size=values.shape)
    if values.ndim >= 2 and values.shape[-1] == values.shape[-2]:
        noise = noise + np.swapaxes(noise, -1, -2)
    rows = random.random(len(values)) < random.choice([0.02, 0.3, 1.0])
    rows[random.integers(len(values))] = True
    return values + noise * rows.reshape(-1, *[1] * (values.ndim - 1))


def shuffled(values: npt.NDArray, random: np.random.Generator) -> npt.NDArray:
    """Exchange two rows."""
    order = np.arange(len(values))
    pair = random.integers(len(values), size=2)
    order[pair] = order[pair[::-1]]
    return values[order]


def cleared(values: npt.NDArray, random: np.random.Generator) -> npt.NDArray:
    """Set a row to zero."""
    found = values.copy()
    found[random.integers(len(values))] = 0
    return found


def flipped(values: npt.NDArray, random: np.random.Generator) -> npt.NDArray:
    """Change a whole number, or a flag, in one place."""
    found = values.copy()
    most = 1 if values.dtype == np.uint8 else max(int(values.max()), 1)
    found.flat[random.integers(found.size)] = random.integers(most + 1)
    return found


def edit(them: Arrays, name: str, random: np.random.Generator) -> None:
    """Replace one array by its edited copy."""
    values = np.asarray(them[name])
    if values.ndim == 0:
        them[name] = np.asarray(scaled(values, random))
        return
    if not values.size:
        return
    if values.dtype.kind == "f":
        change = random.choice(np.array([scaled, noisy, shuffled, cleared], dtype=object))
    else:
        change = random.choice(np.array([shuffled, flipped], dtype=object))
    them[name] = change(values, random)


def some_edits(
    name: str, number: int, folder: Path, random: np.random.Generator
) -> tuple[int, int]:
    """Check that edits of one kind prove nothing false; return how many prove a bound, and not."""
    honest = KINDS[name](folder)
    proven = check(folder / "bounds.h5")
    low, high = proven["lower"].proven, proven["upper"].proven
    assert low is not None
    assert high is not None
    passed = refused = 0
    rounding = 1e-9 * max(abs(low), abs(high))
    for each in range(number):
        halves = copied(honest)
        where = random.choice(["proof", "proof", "one half", "both halves"])
        kind = str(random.choice(["lower", "upper"]))
        them = halves[kind]
        if where == "proof":
            them.setdefault("factor", them["bound"])
            arrays = [array for array in OF_PROOFS[kind] if array in them]
            for array in random.choice(arrays, size=random.integers(1, 3)):
                edit(them, str(array), random)
            if random.random() < 0.3:
                del them["factor"]
        else:
            names = [array for array in OF_BODIES if array in them and them[array].size]
            array = str(random.choice(names))
            edit(them, array, random)
            if where == "both halves":
                for other in halves.values():
                    if array in other and other[array].shape == them[array].shape:
                        other[array] = them[array]
        try:
            found = check(write(folder / "edited.h5", halves))
        except ProofError:
            refused += 1
            continue
        words = (each, name, where, kind, [str(half) for half in found.values()])
        lower, upper = found["lower"].proven, found["upper"].proven
        passed += lower is not None and upper is not None
        refused += lower is None or upper is None
        if where == "both halves":
            assert lower is None or upper is None or lower <= upper + rounding, words
            continue
        assert lower is None or lower <= high + rounding, words
        assert upper is None or upper >= low - rounding, words
    return passed, refused


@pytest.mark.parametrize("name", SHORT)
def test_no_edit_proves_what_is_false(name: str, tmp_path: Path) -> None:
    passed, refused = some_edits(name, 15, tmp_path, np.random.default_rng(len(name)))
    assert passed and refused


@pytest.mark.long
@pytest.mark.parametrize("name", KINDS)
def test_no_edit_of_any_kind_proves_what_is_false(name: str, tmp_path: Path) -> None:
    """Some of the edits are harmless."""
    count = int(12 * EFFORT)
    random = np.random.default_rng([51, *name.encode()])
    passed, refused = some_edits(name, count, tmp_path, random)
    print("EDITS", name, count, "passed", passed, "refused", refused)
    assert passed >= count // 50
    assert refused > count // 4
