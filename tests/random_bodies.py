"""Make random stacks of blocks in contact, in 2D or 3D, with random materials and loads."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from pathlib import Path
from random import Random
from typing import Any

import gmsh

from meshes.naming import interface, name, name_planes
from meshes.shapes import add_box, add_outline, add_polygon
from meshes.sizes import generate
from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Elastic,
    Plane,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    Traction,
    VonMises,
)
from perfplast_fenicsx.mesh import gmsh_session, on_plane, write_split


@dataclass(frozen=True)
class Stack:
    """Stacked blocks, each with a side in the plane x = 0 (and y = 0).

    Attributes:
        seed: Seed of all random numbers.
        dim: 2 or 3.
        heights: Heights of the blocks.
        widths: Lower and upper width of each block; equal in space.
        size: Edge length of the cells in the middle.
        plain: Whether the stack is pressed between smooth planes, so that the limit load is known.
    """

    seed: int
    dim: int
    heights: Sequence[float]
    widths: Sequence[tuple[float, float]]
    size: float
    plain: bool


def stack(seed: int, dim: int) -> Stack:
    """Return a random stack; every third stack is two-dimensional."""
    random = Random(seed)
    count, plain = random.randint(1, 3 if dim == 2 else 2), seed % 3 == 0
    heights = [random.uniform(0.4, 1.2) for _ in range(count)]
    widths = [(random.uniform(0.5, 1.5), random.uniform(0.5, 1.5)) for _ in range(count)]
    if dim == 3:
        widths = [(below, below) for below, _ in widths]
    if plain:
        widths = [(1.0, 1.0)] * count
    size = random.uniform(0.2, 0.4) if dim == 2 else random.uniform(0.5, 0.7)
    return Stack(seed, dim, heights, widths, size, plain)


def write_stack(path: Path, it: Stack) -> None:
    """Mesh the stack without structure and write a .msh file. On one process."""
    random, dim = Random(it.seed), it.dim
    place = [random.uniform(0, 1) for _ in range(3)]
    growth = random.uniform(0, 1)

    def law(*x: float) -> float:
        return it.size * (1 + growth * math.dist(x, place))

    with gmsh_session():
        level, blocks = 0.0, []
        for height, (below, above) in zip(it.heights, it.widths, strict=True):
            if dim == 3:
                blocks.append(add_box([0.0, 0.0, level], [below, below, height]))
            else:
                outline = [(0.0, level), (below, level), (above, level + height)]
                blocks.append((2, add_polygon(add_outline([*outline, (0.0, level + height)]))))
            level += height
        parts = [[block] for block in blocks]
        if len(blocks) > 1:
            parts = gmsh.model.occ.fragment(blocks[:1], blocks[1:])[1]
        gmsh.model.occ.synchronize()
        name(dim, {f"block{i}": [part[0][1]] for i, part in enumerate(parts)})
        sides = {"x0": (0, 0.0), "y0": (1, 0.0)} if dim == 3 else {"x0": (0, 0.0)}
        name_planes(dim - 1, sides | {"bottom": (dim - 1, 0.0), "top": (dim - 1, level)})
        name(dim - 1, {f"seam{i}": seam for i, seam in enumerate(_seams(dim - 1, it.heights))})
        generate(dim, law, 1)
        write_split(path)


def _seams(dim: int, heights: Sequence[float]) -> list[list[int]]:
    """Return the tags of the entities between blocks, from the bottom up."""
    level = accumulate(heights[:-1])
    return [[tag for tag in on_plane(dim, dim, z) if tag in interface(dim)] for z in level]


def problem_of(
    it: Stack, mesh: TaggedMesh, contrast: float = 1, dead: float = 0
) -> tuple[Problem, float | None]:
    """Return a quadratic problem of a stack with random materials, supports and loads.

    Args:
        it: The stack.
        mesh: Mesh of the stack.
        contrast: Factor that multiplies the strength of a random block.
        dead: Share of the loads that is constant, by which the limit load decreases.

    Returns:
        The problem, and its limit load if it is known.
    """
    random, dim = Random(it.seed), it.dim
    names = [f"block{i}" for i in range(len(it.heights))]
    strengths = {name: random.choice([1.0, random.uniform(0.5, 2.0)]) for name in names}
    strengths[Random(it.seed).choice(names)] *= contrast
    materials: dict = {
        name: VonMises(young=1e3, poisson=0.3, yield_stress=strength)
        for name, strength in strengths.items()
    }
    if len(names) > 1 and random.random() < 0.3:
        stiff = random.choice(names)
        materials[stiff] = Elastic(young=1e3, poisson=0.3)
        del strengths[stiff]
    down = "xyz"[dim - 1]
    supports = [Support("x0", "x"), *([Support("y0", "y")] if dim == 3 else [])]
    planes = []
    if random.random() < 0.4:
        planes = [Plane("bottom", [0.0] * dim, [0.0] * (dim - 1) + [1.0])]
    else:
        rough = not it.plain and random.random() < 0.5
        supports.append(Support("bottom") if rough else Support("bottom", down))
    loads: list = [Pressure("top", 1.0)]
    if not it.plain:
        side = [random.uniform(-0.3, 0.3) for _ in range(dim)]
        if random.random() < 0.5:
            loads.append(Traction("top", side))
        if random.random() < 0.5:
            loads.append(BodyForce(random.choice(names), side))
    if dead:
        loads += [replace(load, value=_times(dead, load.value), constant=True) for load in loads]
    contacts = []
    for i, (below, above) in enumerate(pairwise(names)):
        pair = [f"{below}_seam{i}", f"{above}_seam{i}"]
        random.shuffle(pair)
        contacts.append(Contact(*pair))
    problem = Problem(mesh, materials, supports, loads, contacts, planes, degree=2)
    factor = 2 / 3**0.5 if dim == 2 else 1.0
    return problem, factor * min(strengths.values()) if it.plain else None


def _times(factor: float, value: Any) -> Any:
    return factor * value if isinstance(value, float) else tuple(factor * x for x in value)
