"""Define bodies whose strengths differ by up to 1e15, or of which a load moves only a small part.

Limit loads are known. A stack of blocks on rollers, pressed from above, carries σ_y of the weakest
block in 3D and 2σ_y/√3 = 2k in plane strain: the uniform stress is admissible, and the weakest
block flows uniformly and slides on the others. In a layer that is glued to its neighbours and at
least twice as high as wide, a wedge of 90° moves out between two slip lines. A square under the
pressure p from above and (1 − e) p from the side has the shear stress e p/2, and carries p = 2k/e.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import sqrt
from pathlib import Path
from random import Random

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx import (
    Contact,
    Plane,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    VonMises,
    read_gmsh,
)
from perfplast_fenicsx.arrays import Floats
from tests.limit_analysis.stress_checker import Checked
from tests.limit_analysis.test_static_bound import rectangle
from tests.random_bodies import Stack, write_stack

DECADES = 15.0
SMALL = 1e-9


@dataclass(frozen=True)
class Pressed:
    """A problem on rollers at x = 0 (and at y = 0 in 3D) and below.

    Attributes:
        problem: The whole problem.
        exact: Its limit load.
        side: Pressure on the side opposite x = 0, for pressure 1 on the top.
        contrast: Ratio of the strengths.
    """

    problem: Problem
    exact: float
    side: float = 0.0
    contrast: float = 1.0


def strengths(random: Random, count: int) -> list[float]:
    """Return yield stresses between 1 and 1e15."""
    return [10 ** random.uniform(0, DECADES) for _ in range(count)]


def material(yield_stress: float) -> VonMises:
    """Return a material for tests in which only the yield stress matters."""
    return VonMises(young=1e3, poisson=0.3, yield_stress=yield_stress)


def sliding(seed: int, dim: int, path: Path) -> Pressed:
    """Return a stack of blocks in contact."""
    random, comm = Random(1000 + seed), MPI.COMM_WORLD
    count = random.randint(2, 3 if dim == 2 else 2)
    heights = [random.uniform(0.4, 1.2) for _ in range(count)]
    size = random.uniform(0.3, 0.5) if dim == 2 else 0.7
    it = Stack(seed, dim, heights, [(1.0, 1.0)] * count, size, True)
    file = path / "stack.msh"
    if comm.rank == 0:
        write_stack(file, it)
    comm.barrier()
    names = [f"block{i}" for i in range(count)]
    yields = strengths(random, count)
    contacts = []
    for i, (below, above) in enumerate(pairwise(names)):
        pair = [f"{below}_seam{i}", f"{above}_seam{i}"]
        random.shuffle(pair)
        contacts.append(Contact(*pair))
    problem = Problem(
        read_gmsh(comm, file),
        dict(zip(names, map(material, yields), strict=True)),
        [Support("x0", "x"), Support("bottom", "xyz"[dim - 1])]
        + ([Support("y0", "y")] if dim == 3 else []),
        [Pressure("top", 1.0)],
        contacts,
        degree=2,
    )
    factor = 2 / sqrt(3) if dim == 2 else 1.0
    return Pressed(problem, factor * min(yields), contrast=max(yields) / min(yields))


SURFACES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "x0": lambda x: x[0] < SMALL,
    "y0": lambda x: x[1] < SMALL,
}


def glued(seed: int) -> Pressed:
    """Return two or three layers in one mesh, each twice as high as wide."""
    random = Random(2000 + seed)
    count, n = random.randint(2, 3), random.choice([2, 3])
    return layers(strengths(random, count), n)


def layers(yields: list[float], n: int) -> Pressed:
    """Return layers of width 1/2 and height 1, from the bottom up, with n cells along the width."""
    count = len(yields)
    volumes = {
        f"layer{i}": lambda x, i=i: (x[1] > i) & (x[1] < i + 1)  # type: ignore[misc]
        for i in range(count)
    }
    surfaces = SURFACES | {"top": lambda x: x[1] > count - SMALL}
    mesh = rectangle((n, 2 * n * count), (0.5, float(count)), volumes, surfaces)
    problem = Problem(
        mesh,
        dict(zip(volumes, map(material, yields), strict=True)),
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("top", 1.0)],
        degree=2,
    )
    return Pressed(problem, 2 / sqrt(3) * min(yields), contrast=max(yields) / min(yields))


def square(n: int, shake: float) -> TaggedMesh:
    """Return a unit square with n cells along a side, and the names of the sides."""
    surfaces = SURFACES | {"top": lambda x: x[1] > 1 - SMALL, "right": lambda x: x[0] > 1 - SMALL}
    return rectangle((n, n), (1.0, 1.0), {"block": lambda x: x[0] > -1}, surfaces, shake)


def squeezed(e: float, planes: bool, n: int = 4, shake: float = 0.1) -> Pressed:
    """Return a square under almost equal pressures, on rollers or rigid planes."""
    obstacles, supports = [], [Support("x0", "x"), Support("y0", "y")]
    if planes:
        supports = []
        obstacles = [Plane("x0", [0.0, 0.0], [1.0, 0.0]), Plane("y0", [0.0, 0.0], [0.0, 1.0])]
    loads = [Pressure("top", 1.0), Pressure("right", 1.0 - e)]
    block = {"block": material(sqrt(3))}
    problem = Problem(square(n, shake), block, supports, loads, obstacles=obstacles, degree=2)
    return Pressed(problem, 2 / e if e else np.inf, 1.0 - e)


def forces_left(it: Pressed, checked: Checked, load: float) -> float:
    """Return the resultant of all forces that a stress leaves unbalanced.

    Args:
        it: The problem.
        checked: The stress, from :func:`tests.limit_analysis.stress_checker.check_stress`.
        load: Load factor λ.
    """
    x, normals, push = checked.x, checked.normals, checked.tractions.copy()
    dim = x.shape[2]
    lowest, highest = x.min(axis=(0, 1)), x.max(axis=(0, 1))
    place = x.mean(axis=1)
    top = place[:, -1] > highest[-1] - SMALL
    push[top] += load * normals[top, None]
    right = place[:, 0] > highest[0] - SMALL
    push[right] += load * it.side * normals[right, None]
    for axis in {0, dim - 1} | ({1} if dim == 3 else set()):
        push[place[:, axis] < lowest[axis] + SMALL, :, axis] = 0.0  # forces of rollers or planes
    seam = (np.abs(normals[:, -1]) > 0.5) & (place[:, -1] > lowest[-1] + SMALL) & ~top
    sizes = np.linalg.norm(push, axis=2)
    sizes[seam] = np.linalg.norm(push[seam, :, :-1], axis=2)  # contact has no friction
    sizes[seam] += np.abs(_unequal(x[seam], push[seam, :, -1], normals[seam, -1])) / 2
    total: float = float((sizes.mean(axis=1) * _areas(x)).sum()) + checked.forces
    return total


def _unequal(x: Floats, push: Floats, normal: Floats) -> Floats:
    """Return the imbalance of tractions on both sides of a seam, at the vertices of its facets."""
    if not len(x):
        return push
    names = np.round(x, 6).reshape(-1, x.shape[2])
    facet = np.round(np.repeat(x.mean(axis=1), x.shape[1], axis=0), 6)
    _, at = np.unique(np.hstack([names, facet]), axis=0, return_inverse=True)
    sums = np.bincount(at.ravel(), weights=push.ravel())
    found: Floats = sums[at.ravel()].reshape(push.shape)
    assert (np.bincount(at.ravel()) == 2).all()
    return found


def _areas(x: Floats) -> Floats:
    """Return the areas of facets from their vertices, shape (num_facets, d, d)."""
    edges = x[:, 1:] - x[:, :1]
    if x.shape[2] == 2:
        return np.linalg.norm(edges[:, 0], axis=1)
    return np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2
