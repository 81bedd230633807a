"""Choose element sizes: an automatic size with few elements, finer ones where areas need them."""

import math
from collections.abc import Sequence
from dataclasses import replace

import gmsh

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.cad_measures import mesh_measure, missed_areas
from perfplast_fenicsx.geometry.generated_mesh import FLAT, generate
from perfplast_fenicsx.geometry.measured import elements, qualities
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.geometry.parts import Part
from perfplast_fenicsx.geometry.sizes import Sizes, most_elements

EXACT = 0.01
"""Relative error of areas that is accepted without a remark."""


def mesh_with_areas(dim: int, parts: Sequence[Part], options: MeshingOptions) -> float:
    """Mesh arcs finely enough for accurate areas, and return the largest edge length.

    Without a given size, an automatic size with few elements is used. If a mesh with finer arcs has
    flat elements, too many elements or none, the previous mesh is restored.
    """
    most, sizes = most_elements(dim, len(parts)), Sizes.of(dim, parts)
    if options.size is None:
        longest = _usual_size(sizes, options, most)
        options = replace(options, size=longest)
    else:
        longest = generate(sizes, options)
    if options.curvature is not None or sizes.scripted:
        return longest
    before: dict[tuple[int, int], float] = {}
    times = 4  # largest number of refinements of arcs
    for _ in range(times):
        finer = before | finer_arcs(dim, parts)
        if finer == before:
            break
        try:
            generate(sizes, options, finer)
            fine = _count(dim, parts) <= most
            fine = fine and min(qualities(dim, part).min() for part in parts) >= FLAT
        except InputError:
            fine = False
        if not fine:
            generate(sizes, options, before)
            break
        before = finer
    return longest


def finer_arcs(dim: int, parts: Sequence[Part]) -> dict[tuple[int, int], float]:
    """Return edge lengths of inaccurate arcs and curved faces for accurate areas."""
    enough = 0.95  # target share of the allowed error, which is of second order in edge lengths
    found: dict[tuple[int, int], float] = {}
    for face, missed in missed_areas(dim, parts).items():
        if missed <= EXACT:
            continue
        around = gmsh.model.getAdjacencies(dim - 1, face)[1] if dim == 3 else ()
        for entity in [(dim - 1, face), *((1, int(curve)) for curve in around)]:
            if gmsh.model.getType(*entity) in ("Plane", "Line"):
                continue
            finer = math.sqrt(enough * EXACT / missed) * _edge_length(*entity)
            found[entity] = min(finer, found.get(entity, finer))
    return found


def _edge_length(dim: int, tag: int) -> float:
    """Return the mean edge length of the elements of a curve or face."""
    count = sum(len(tags) for tags in gmsh.model.mesh.getElements(dim, tag)[1])
    measure = mesh_measure(dim, tag) / max(count, 1)
    of_triangle = 4 / math.sqrt(3)  # squared edge of an equilateral triangle, over its area
    return measure if dim == 1 else math.sqrt(of_triangle * measure)


def _usual_size(sizes: Sizes, options: MeshingOptions, most: int) -> float:
    """Mesh with an automatic size with few elements, and return the size.

    Raises:
        InputError: If no automatic size can be meshed.
    """
    first = sizes.usual
    # Shares of the usual size that are tried if faces overlap on a coarse mesh.
    finer_sizes = (1.0, 0.7, 0.5)
    for share in finer_sizes:
        size = share * first
        try:
            generate(sizes, replace(options, size=size))
        except InputError:
            if share == finer_sizes[-1]:
                raise
            continue
        break
    # Factors and number of larger sizes that are tried if small fillets and holes cause too many
    # elements.
    coarser, times = 1.3, 5
    for _ in range(times if share == 1 else 0):
        if _count(sizes.dim, sizes.parts) <= most:
            break
        try:
            generate(sizes, replace(options, size=coarser * size))
        except InputError:
            generate(sizes, replace(options, size=size))
            break
        size *= coarser
    return size


def _count(dim: int, parts: Sequence[Part]) -> int:
    """Return the number of elements of the mesh."""
    return sum(elements(dim, part).size for part in parts)
