"""Build structured assemblies by name: ``two_blocks``, ``punch``, ``l_plate``, ``stacked_blocks``.

:mod:`perfplast_fenicsx.mesh.box_mesh` describes their division into tetrahedra, and which
coordinates are exact.
"""

import inspect
from collections.abc import Callable, Sequence
from numbers import Integral, Real

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.mesh.box_mesh import Box, Surface, structured_mesh
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


def two_blocks(comm: MPI.Intracomm, n: int) -> TaggedMesh:
    """Return blocks (0,3)×(0,1)×(0,1) and the same on top, with ``n`` cubes per unit length.

    Collective.

    Volumes ``lower`` and ``upper``; surfaces ``left`` (x = 0, both), ``top`` (z = 2 and x ≥ 1.5;
    for odd n only its whole cubes), ``upper_bottom`` and ``lower_top`` (z = 1).

    Args:
        comm: Communicator of the mesh.
        n: Cubes per unit length, at least 1.

    Raises:
        InputError: If ``n`` is not a positive integer.
    """
    _check_n("two_blocks", n)
    counts = (3 * n, n, n)
    return structured_mesh(
        comm,
        [
            Box("lower", (0.0, 0.0, 0.0), (3.0, 1.0, 1.0), counts),
            Box("upper", (0.0, 0.0, 1.0), (3.0, 1.0, 2.0), counts),
        ],
        [
            Surface("left", ("lower", "upper"), lambda x: x[0] == 0),
            Surface("top", ("upper",), lambda x: (x[2] == 2) & (x[0] >= 1.5)),
            Surface("upper_bottom", ("upper",), lambda x: x[2] == 1),
            Surface("lower_top", ("lower",), lambda x: x[2] == 1),
        ],
    )


def punch(comm: MPI.Intracomm, n: int) -> TaggedMesh:
    """Return a quarter of a square punch (0,½)²×(1,1½) on a base (0,1)³. Collective.

    Volumes ``base`` and ``punch``; surfaces ``x0``, ``y0`` (both bodies), ``bottom`` (z = 0),
    ``top`` (z = 1½), ``punch_bottom`` and ``base_top``, which is only the part under the punch
    (z = 1, x ≤ ½, y ≤ ½).

    Args:
        comm: Communicator of the mesh.
        n: Cubes per unit length, an even number.

    Raises:
        InputError: If ``n`` is not a positive even number.
    """
    _check_n("punch", n)
    if n % 2:
        raise InputError(f"builder 'punch' has n = {n}; n must be even, as the punch is ½ wide")
    half = n // 2
    return structured_mesh(
        comm,
        [
            Box("base", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (n, n, n)),
            Box("punch", (0.0, 0.0, 1.0), (0.5, 0.5, 1.5), (half, half, half)),
        ],
        [
            Surface("x0", ("base", "punch"), lambda x: x[0] == 0),
            Surface("y0", ("base", "punch"), lambda x: x[1] == 0),
            Surface("bottom", ("base",), lambda x: x[2] == 0),
            Surface("top", ("punch",), lambda x: x[2] == 1.5),
            Surface("punch_bottom", ("punch",), lambda x: x[2] == 1),
            Surface("base_top", ("base",), lambda x: (x[2] == 1) & (x[0] <= 0.5) & (x[1] <= 0.5)),
        ],
    )


def l_plate(comm: MPI.Intracomm, n: int) -> TaggedMesh:
    """Return an L-shaped plate in plane strain: (0,10)²×(0,1) without (0,5)²×(0,1). Collective.

    Volume ``plate``; surfaces ``x0``, ``y0``, ``z0``, ``z1`` and ``top`` (y = 10).

    Args:
        comm: Communicator of the mesh.
        n: Cubes per unit length: 2^level for the level of the published meshes.

    Raises:
        InputError: If ``n`` is not a positive integer.
    """
    _check_n("l_plate", n)

    def in_plate(cube: Longs) -> npt.NDArray[np.bool_]:
        return (cube[0] >= 5 * n) | (cube[1] >= 5 * n)

    return structured_mesh(
        comm,
        [Box("plate", (0.0, 0.0, 0.0), (10.0, 10.0, 1.0), (10 * n, 10 * n, n), in_plate)],
        [
            Surface("x0", ("plate",), lambda x: x[0] == 0),
            Surface("y0", ("plate",), lambda x: x[1] == 0),
            Surface("z0", ("plate",), lambda x: x[2] == 0),
            Surface("z1", ("plate",), lambda x: x[2] == 1),
            Surface("top", ("plate",), lambda x: x[1] == 10),
        ],
    )


def stacked_blocks(
    comm: MPI.Intracomm, n: int, heights: Sequence[float] = (1.0, 1.0)
) -> TaggedMesh:
    """Return two blocks of section 1×1 on top of each other. Collective.

    Volumes ``lower`` and ``upper``; surfaces ``x0``, ``y0`` (both), ``bottom``, ``top``,
    ``upper_bottom`` and ``lower_top``.

    Args:
        comm: Communicator of the mesh.
        n: Cubes along each edge of each block, at least 1, stretched to its height.
        heights: Heights of the lower and the upper block, from 1e-6 to 1e6.

    Raises:
        InputError: If ``n`` is not a positive integer, or if a height is out of its range.
    """
    _check_n("stacked_blocks", n)
    if not (
        isinstance(heights, Sequence)
        and len(heights) == 2
        and all(isinstance(h, Real) and 1e-6 <= h <= 1e6 for h in heights)
    ):
        raise InputError(
            f"builder 'stacked_blocks' has heights = {heights!r}; give two positive numbers between"
            " 1e-6 and 1e6, as the blocks are 1 wide"
        )
    middle, top = float(heights[0]), float(heights[0]) + float(heights[1])
    return structured_mesh(
        comm,
        [
            Box("lower", (0.0, 0.0, 0.0), (1.0, 1.0, middle), (n, n, n)),
            Box("upper", (0.0, 0.0, middle), (1.0, 1.0, top), (n, n, n)),
        ],
        [
            Surface("x0", ("lower", "upper"), lambda x: x[0] == 0),
            Surface("y0", ("lower", "upper"), lambda x: x[1] == 0),
            Surface("bottom", ("lower",), lambda x: x[2] == 0),
            Surface("top", ("upper",), lambda x: x[2] == top),
            Surface("upper_bottom", ("upper",), lambda x: x[2] == middle),
            Surface("lower_top", ("lower",), lambda x: x[2] == middle),
        ],
    )


BUILDERS: dict[str, Callable[..., TaggedMesh]] = {
    builder.__name__: builder for builder in (two_blocks, punch, l_plate, stacked_blocks)
}
"""The builders by their names in case files."""


def build(comm: MPI.Intracomm, name: str, **arguments: object) -> TaggedMesh:
    """Build a mesh by the name and arguments of a case file. Collective.

    Args:
        comm: Communicator of the mesh.
        name: One of :data:`BUILDERS`.
        arguments: Arguments of the builder besides ``comm``.

    Raises:
        InputError: For an unknown builder, an unknown or missing argument, or an error of the
            builder itself.
    """
    if name not in BUILDERS:
        raise InputError(f"there is no builder '{name}'; {nearest(name, BUILDERS)}")
    parameters = dict(inspect.signature(BUILDERS[name]).parameters)
    del parameters["comm"]
    for argument in arguments:
        if argument not in parameters:
            raise InputError(
                f"builder '{name}' takes no '{argument}'; {nearest(argument, parameters)}"
            )
    for key, parameter in parameters.items():
        if parameter.default is inspect.Parameter.empty and key not in arguments:
            raise InputError(f"builder '{name}' needs '{key}'; give it, e.g. {key} = 4")
    return BUILDERS[name](comm, **arguments)


def _check_n(builder: str, n: object) -> None:
    if isinstance(n, bool) or not isinstance(n, Integral) or n < 1:
        raise InputError(f"builder '{builder}' has n = {n!r}; n must be a positive whole number")
