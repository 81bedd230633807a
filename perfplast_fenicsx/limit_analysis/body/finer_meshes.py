"""Choose the next mesh for bounds: where it is finer, and how many cells it has.

For 3D meshes, the module computes the directions in which velocity and stress change in each cell.
A mesh should be fine across slip bands, which the velocity shows, and across the thickness of
bending parts, which the stress shows. Along the bands and parts, the mesh may be coarse.

For plane meshes, the module defines the length of edges by the change of the solution along them.
At slip lines, the velocity changes only across the lines. If principal stresses rotate about a
point, they change only with the angle around the point. Cells may be long in the direction in which
the solution does not change. Of two edges of equal length, the edge with the larger change is
longer in this metric.
"""

from collections.abc import Callable, Sequence
from functools import partial

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.errors import on_all_ranks
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.bound_problems import (
    cells_with_corners,
    enclosed_pores,
    of_parents,
)
from perfplast_fenicsx.limit_analysis.body.singular_points import (
    singular_edges,
    singular_points,
    wide_corners,
)
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import Verdict
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import varying_of
from perfplast_fenicsx.mesh.alfeld_split import AlfeldSplit
from perfplast_fenicsx.mesh.crossing_edges import bend_crossings
from perfplast_fenicsx.mesh.refinement import fan, fan_around, refine, spread
from perfplast_fenicsx.mesh.straight_geometry import corners, gradients
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import fetch_rows, sums_at
from perfplast_fenicsx.problem.declared.loads import FieldPores, Load, PorePressure
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.spatial_fields import PointValues, SpatialField


def largest_shares(comm: MPI.Intracomm, shares: Floats, part: float) -> npt.NDArray[np.bool_]:
    """Return flags of the cells whose large contributions make up a given part of the sum.

    Collective.

    This is the marking of W. Dörfler, doi:10.1137/0733054.

    Args:
        comm: The ranks.
        shares: Contributions of the owned cells; negative contributions count as zero.
        part: Part of the sum over all cells, between 0 and 1.
    """
    shares = np.maximum(shares, 0.0)
    wanted = part * comm.allreduce(float(shares.sum()))
    low, high = 0.0, comm.allreduce(float(shares.max(initial=0.0)), MPI.MAX)
    halvings = 60  # bisections of the interval that contains the smallest contribution to mark
    for _ in range(halvings):
        middle = (low + high) / 2
        enough = comm.allreduce(float(shares[shares >= middle].sum())) >= wanted
        low, high = (middle, high) if enough else (low, middle)
    marked: npt.NDArray[np.bool_] = (shares >= low) & (shares > 0)
    return marked


def to_refine(problem: Problem, found: BodyBounds, part: float) -> npt.NDArray[np.bool_]:
    """Return flags of owned cells that cause a given part of the gap or the dissipation.

    Collective.

    The dissipation is the dissipation of the lower bound's multipliers. In 2D the marked cells have
    the given part of the sum of gap and dissipation. In this sum, each of the two is divided by its
    total, and the dissipation has half weight.

    Args:
        problem: The bodies with their loads.
        found: Bounds on the mesh of the problem.
        part: Part of the sums, between 0 and 1; 1 marks all cells.
    """
    dissipation = None if found.static is None else found.static.dissipation
    topology = problem.tagged_mesh.mesh.topology
    cells = topology.index_map(topology.dim)
    marked = np.full(cells.size_local, part >= 1.0)
    if dissipation is not None and part < 1.0:
        # If very few cells limit the stress, they cause the whole gap, and the indicators elsewhere
        # belong to a stress that is too small. In this case the function marks only these cells. If
        # the bounds are already close, a larger stress helps little; other cells are marked, too.
        most, few, near = 0.9, 0.005, 0.1
        here = largest_shares(problem.comm, dissipation, most)
        if problem.comm.allreduce(int(here.sum())) < few * cells.size_global:
            marked |= here
            gap = found.lower.apart(found.upper)
            if gap is None or gap > near:
                return marked
            dissipation = np.where(here, 0.0, dissipation)
    every = [it for it in (found.shares, dissipation) if it is not None]
    if topology.dim == 2 and len(every) == 2:
        # A mechanism dissipates most next to singular points, which soon contribute little to the
        # gap.
        every = [_in_all(problem.comm, every[0]) + _in_all(problem.comm, every[1]) / 2]
    for shares in every:
        marked |= largest_shares(problem.comm, shares, part)
    return marked


def _in_all(comm: MPI.Intracomm, shares: Floats) -> Floats:
    """Return contributions divided by their sum; negative contributions count as 0. Collective."""
    shares = np.maximum(shares, 0.0)
    whole = comm.allreduce(float(shares.sum()))
    return shares / whole if whole > 0 else shares


def directions_of_change(found: BodyBounds) -> Floats:
    """Return the gradients of velocity and stress deviator in cells, scaled to norms of 1 and 1/2.

    Collective.

    The function takes gradients of fields that are linear in each cell. The values of the fields at
    the corners are the velocity, and the deviator averaged over the surrounding cells. Without a
    stress, the function returns only the gradient of the velocity.

    Args:
        found: Bounds with a mechanism; its velocity is zero if no mechanism was found.

    Returns:
        ∂f_j/∂x_i in row i, for the owned cells before the split, shape (num_cells, 3, 3 or 9); zero
        where nothing changes.
    """
    tagged_mesh, space = found.problem.tagged_mesh, found.mechanism.function_space
    cells, points = corners(tagged_mesh.mesh)
    places = points[cells]
    at_vertices = space.dofmap.list[: len(cells), : cells.shape[1]]  # independent of the degree
    velocity = found.mechanism.x.array.reshape(-1, space.dofmap.index_map_bs)[at_vertices]
    changes = [_gradients(tagged_mesh, places, velocity)]
    if found.stress is not None:
        deviator = found.stress.copy()
        deviator[..., :3] -= deviator[..., :3].mean(axis=2, keepdims=True)
        around = _around_vertices(tagged_mesh, cells, places, deviator)
        changes.append(_gradients(tagged_mesh, places, around))
    weights = 1.0, 0.5  # more weight of the stress worsens punches more than it improves plates
    sized = [_in_their_size(found.problem.comm, it) for it in changes]
    return np.concatenate([w * it for w, it in zip(weights, sized, strict=False)], axis=2)


def _gradients(tagged_mesh: TaggedMesh, places: Floats, values: Floats) -> Floats:
    """Return gradients in cells before the split, from values at the corners of their parts."""
    matrices, changes = places[:, 1:] - places[:, :1], values[:, 1:] - values[:, :1]
    gradients = np.asarray(np.linalg.solve(matrices, changes), dtype=np.float64)
    if not isinstance(tagged_mesh, AlfeldSplit):
        return gradients
    # The parts of a cell have equal volumes. The mean of their gradients is therefore the gradient
    # from the cell's own corners.
    flat = gradients.reshape(len(gradients), -1) / places.shape[1]
    sums = np.stack([of_parents(column, tagged_mesh) for column in flat.T], axis=1)
    return sums.reshape(-1, *gradients.shape[1:])


def _around_vertices(
    tagged_mesh: TaggedMesh, cells: Ints, places: Floats, values: Floats
) -> Floats:
    """Return volume-weighted means of values over the cells around each corner. Collective.

    Args:
        tagged_mesh: The mesh.
        cells: Vertices of the owned cells, shape (num_cells, 4).
        places: Coordinates of these vertices, shape (num_cells, 4, 3).
        values: Values at corners of cells, shape (num_cells, 4, m). The result has the same shape.
    """
    vertices = tagged_mesh.mesh.topology.index_map(0)
    volumes = np.abs(np.linalg.det(places[:, 1:] - places[:, :1]))
    weighted = np.concatenate([values, np.ones_like(values[..., :1])], axis=2)
    weighted *= volumes[:, None, None]
    width = weighted.shape[2]
    table = sums_at(vertices, width, (cells.ravel(), weighted.reshape(-1, width)))
    means: Floats = (table[:, :-1] / table[:, -1:])[cells]
    return means


def _in_their_size(comm: MPI.Intracomm, gradients: Floats) -> Floats:
    """Return each gradient divided by its norm. Collective.

    A gradient that consists only of rounding errors stays small.
    """
    sizes = np.linalg.norm(gradients, axis=(1, 2), keepdims=True)
    least = 1e-4 * comm.allreduce(float(sizes.max(initial=0.0)), MPI.MAX)
    return np.divide(
        gradients, sizes + least, out=np.zeros_like(gradients), where=sizes + least > 0
    )


def edge_metric(found: BodyBounds) -> Floats | None:
    """Return a matrix M for each owned cell; the length of an edge e is then √(e·M e). Collective.

    M = GᵀG + 3 SᵀS. G is the gradient of the mechanism in the middle of the cell, and S is the
    gradient of the in-plane stress deviator. Both gradients are scaled to a largest squared
    singular value of 1. In this metric, an edge along which neither field changes is short.

    Args:
        found: Bounds on the mesh, with quadratic velocities on triangles.

    Returns:
        Matrices, shape (num_cells, 2, 2); None without both bounds, and in axisymmetry.
    """
    tagged_mesh = found.problem.tagged_mesh
    plane = tagged_mesh.mesh.topology.dim == 2 and not tagged_mesh.axisymmetric
    if not plane or found.stress is None or found.shares is None or found.problem.degree != 2:
        return None
    vertices, points = corners(tagged_mesh.mesh)
    x = points[vertices]
    inverse = np.linalg.inv(x[:, 1:] - x[:, :1])  # maps x − x₀ to coordinates of the cell
    slopes = np.concatenate([-inverse.sum(axis=2)[:, None], inverse.transpose(0, 2, 1)], axis=1)

    space = found.mechanism.function_space
    u = found.mechanism.x.array.reshape(-1, 2)[space.dofmap.list[: len(x)]]
    a, b = np.array([(1, 2), (0, 2), (0, 1)]).T  # ends of the edges in the order of their nodes
    in_middle = np.concatenate([slopes / 3, (slopes[:, a] + slopes[:, b]) * 4 / 3], axis=1)
    of_velocity = np.einsum("cni,cnj->cij", u, in_middle)

    deviator = np.stack(
        [(found.stress[..., 0] - found.stress[..., 1]) / np.sqrt(2), found.stress[..., 3]], axis=2
    )
    of_stress = np.einsum("cni,cnj->cij", deviator, slopes)
    more = 3.0  # weight of the stress, so that it also counts in fans with slip lines
    comm, apart = tagged_mesh.mesh.comm, np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2)
    sizes = apart.max(axis=1)
    of_mechanism = _stretches(comm, of_velocity * sizes[:, None, None], u)
    return of_mechanism + more * _stretches(comm, of_stress * sizes[:, None, None], deviator)


def _stretches(comm: MPI.Intracomm, changes: Floats, values: Floats) -> Floats:
    """Return GᵀG of gradients G, scaled to a largest eigenvalue of 1, the smallest at least 1/64.

    Collective.

    Args:
        comm: The ranks.
        changes: G times the size of the cell, shape (n, 2, 2).
        values: Values whose change is measured, shape (n, k, 2). If they change in a cell only by
            rounding errors, both eigenvalues are 1.
    """
    longest = 8.0  # largest ratio of length to width of cells
    nothing = 1e-4  # relative to the largest value
    largest = comm.allreduce(float(np.abs(values).max(initial=0.0)), MPI.MAX)
    squares, axes = np.linalg.eigh(np.einsum("cki,ckj->cij", changes, changes))
    small, large = np.sqrt(np.maximum(squares, 0.0)).T
    ratio = np.divide(small, large, out=np.ones_like(small), where=large > nothing * largest)
    stretched = np.column_stack([np.maximum(ratio, 1 / longest), np.ones_like(ratio)])
    stretches: Floats = np.einsum("cik,ck,cjk->cij", axes, stretched**2, axes)
    return stretches


def finer_mesh(
    problem: Problem,
    found: BodyBounds,
    gap: float | None,
    adaptation: Adaptation,
    much: bool = False,
) -> TaggedMesh | str:
    """Return the next mesh, or the reason why there is no next mesh. Collective.

    If the next mesh would have too many cells, the function marks as many cells as fit. A mesh with
    hardly more cells than the last one would cost as much and improve little. In 2D, a twelfth more
    cells at the right places can still close a fifth of the gap. In 3D each mesh costs more than
    all previous meshes together. The function therefore marks more cells if the next 3D mesh would
    have few additional cells.

    Args:
        problem: The bodies and their loads, on this mesh.
        found: Bounds on this mesh.
        gap: Relative gap of the best bounds so far; None if one of them is missing.
        adaptation: The adaptation, with its limits.
        much: Whether a plane mesh should have about twice as many cells as the previous one.
    """
    # Dörfler's fraction by dimension: the marked cells cause this share of the gap and of the
    # dissipation. It is smaller in 3D, because the closure of the refinement divides many more
    # cells there.
    part, worth_while = {2: (0.4, 1.05), 3: (0.2, 1.2)}[problem.bodies.gdim]
    if much and problem.bodies.gdim == 2:
        part, worth_while = 0.8, 1.5
    cells, now = adaptation.cells, number_of_cells(problem.tagged_mesh)
    too_many = f"a finer mesh would have more than {cells} cells; give more cells under adapt"
    if now >= cells:
        return too_many
    if found.static is not None and found.static.verdict is Verdict.NO_RESISTANCE:
        part = 1.0  # without a result there are no indicators; cells are too large everywhere
    marked = to_refine(problem, found, part)
    if not problem.comm.allreduce(int(marked.sum())):
        return "no result indicates where to refine; give smaller elements in the first mesh"
    usual = refined(problem, marked, found, cells)
    least, most = 0.0, float(cells)
    if problem.bodies.gdim == 3 and part < 1.0:
        least, most = _wanted(now, gap, adaptation)
    finer, few = usual, worth_while * now
    largest = 0.9  # largest part to mark; the remaining cells cause almost none of the gap
    low, high = part, largest
    if number_of_cells(usual) > most:
        least, low, high = max(least, 0.95 * most), 0.0, part
    halvings = 5
    for _ in range(halvings):
        if least <= number_of_cells(finer) <= most:
            break
        part = (low + high) / 2
        other = refined(problem, to_refine(problem, found, part), found, cells)
        if number_of_cells(other) > most:
            high = part
        else:
            low, finer = part, other
    if number_of_cells(usual) > cells and not few <= number_of_cells(finer) <= cells:
        return too_many
    return usual if number_of_cells(finer) < few else finer


def _wanted(now: int, gap: float | None, adaptation: Adaptation) -> tuple[float, float]:
    """Return the least and the largest number of cells of the next 3D mesh.

    By the observed convergence, the number should be enough to reach ``until``. It is at most about
    twice the present number, because indicators on a coarse mesh differ from those on a much finer
    mesh.

    Args:
        now: Number of cells of this mesh.
        gap: Relative gap of the best bounds so far; None if one of them is missing.
        adaptation: The adaptation, with its limits.
    """
    growth, steady = 2.0, 1.5
    if gap is not None and not isinstance(adaptation.until, str):
        order = 0.9  # the gap falls with this negative power of the number of cells
        growth = float(np.clip((gap / adaptation.until) ** (1 / order), steady, growth))
    roughly = 1.05  # tolerance in both directions
    most = min(growth * roughly * now, adaptation.cells)
    return min(growth / roughly * now, 0.95 * adaptation.cells), most


def refined(
    problem: Problem,
    marked: npt.NDArray[np.bool_],
    found: BodyBounds | None = None,
    cells: float = np.inf,
) -> TaggedMesh:
    """Return the mesh of a problem, refined at marked cells, with fans where they are needed.

    Collective.

    Args:
        problem: The bodies with their loads.
        marked: Marks of the owned cells.
        found: Bounds on the mesh, if known. In 2D, cells become long where mechanism or stress
            changes in one direction only. In 3D, bisection cuts the edges along which velocity and
            stress change. Cells at singular edges with the largest loss of the lower bound become
            fans instead of being refined, because faces in more directions reduce this loss.
        cells: Largest number of cells of the mesh. In 2D, fans of long cells are created at once if
            they add at most a fourth of this number, and otherwise gradually with each mesh.
    """
    given, tagged_mesh = problem.given, problem.tagged_mesh
    in_space = problem.bodies.gdim == 3
    changes = directions_of_change(found) if in_space and found is not None else None
    if in_space and found is not None and found.static is not None:
        dissipation = found.static.dissipation
        tagged_mesh, marked, changes = _with_fans(problem, marked, dissipation, changes)
    at_once, metric, gap, rigid = False, None, None, None
    if not in_space:
        if found is not None:
            metric, gap = edge_metric(found), found.lower.apart(found.upper)
        cones = body_cones(problem)
        rigid = ~np.array([cone.yields for cone in cones.cones])[cones.of_cells]
        long = _with_long_fans(problem, marked, rigid, metric, gap)
        at_once = number_of_cells(long[0]) <= cells / 4 + number_of_cells(tagged_mesh)
        tagged_mesh, marked, rigid, metric = (
            long if at_once else (tagged_mesh, marked, rigid, metric)
        )
    pairs = opposite_vertices(tagged_mesh, given.contacts)
    finer = refine(tagged_mesh, marked, pairs, metric, changes, rigid).tagged_mesh
    if in_space:
        return finer
    valence = 24  # final number of cells at points where the stress depends on the direction
    points = singular_points(finer, given, valence, ends=not at_once)
    if problem.comm.allreduce(len(points)):
        finer = fan(finer, points, opposite_vertices(finer, given.contacts)).tagged_mesh
    fields = varying_of(problem)
    # A field from a file has kinks everywhere and is left out. Vertices move onto the kinks of
    # other fields, because linear bounds of a field lose more in cells that a kink crosses.
    strengths = [
        (name, field)
        for name, each in fields.items()
        for field in each.values()
        if not isinstance(field, PointValues)
    ]
    bend_crossings(finer, on_kinks(finer, given.loads, strengths))
    return finer


def _with_long_fans(
    problem: Problem,
    marked: npt.NDArray[np.bool_],
    rigid: npt.NDArray[np.bool_],
    metric: Floats | None,
    gap: float | None,
) -> tuple[TaggedMesh, npt.NDArray[np.bool_], npt.NDArray[np.bool_], Floats | None]:
    """Return a plane mesh with fans of long cells, its marks, its rigid cells and its metric.

    Collective.

    Cells that become parts of fans lose their mark, because refinement would shorten them.
    """
    given, tagged_mesh = problem.given, problem.tagged_mesh
    most = 8  # number of times that angles are halved
    for _ in range(most):
        wide, there = wide_corners(tagged_mesh, given, gap)
        if not problem.comm.allreduce(int(wide.sum())):
            break
        pairs = opposite_vertices(tagged_mesh, given.contacts)
        finer = spread(tagged_mesh, wide, there, pairs, rigid)
        rigid = fetch_rows(problem.comm, rigid, finer.parents)
        marked = fetch_rows(problem.comm, marked & ~wide.any(axis=1), finer.parents)
        if metric is not None:
            metric = fetch_rows(problem.comm, metric, finer.parents)
        tagged_mesh = finer.tagged_mesh
    return tagged_mesh, marked, rigid, metric


def _with_fans(
    problem: Problem,
    marked: npt.NDArray[np.bool_],
    dissipation: Floats,
    changes: Floats | None,
) -> tuple[TaggedMesh, npt.NDArray[np.bool_], Floats | None]:
    """Return a 3D mesh with fans around singular edges that cause most of the dissipation.

    Collective. Without such edges, the function returns the given mesh.

    Returns:
        The mesh, the remaining marks of its owned cells, and their directions of change.
    """
    comm, given, tagged_mesh = problem.comm, problem.given, problem.tagged_mesh
    most = 0.5  # share of the multipliers' dissipation; the cells with this share are often few
    nearly = 0.5  # part of this share that must lie at singular edges to make fans worthwhile
    valence = 12  # wanted number of cells around each edge
    few = largest_shares(comm, dissipation, most)
    edges = singular_edges(tagged_mesh, given, valence) & few[:, None]
    cut = edges.any(axis=1)
    at_edges, of_few = comm.allreduce(np.array([dissipation[cut].sum(), dissipation[few].sum()]))
    if not at_edges > nearly * of_few:
        return tagged_mesh, marked, changes
    fans = fan_around(tagged_mesh, edges, opposite_vertices(tagged_mesh, given.contacts))
    if changes is not None:
        changes = fetch_rows(comm, changes, fans.parents)
    return fans.tagged_mesh, fetch_rows(comm, marked & ~cut, fans.parents), changes


def number_of_cells(tagged_mesh: TaggedMesh) -> int:
    """Return the number of cells on all ranks."""
    topology = tagged_mesh.mesh.topology
    count: int = topology.index_map(topology.dim).size_global
    return count


def on_kinks(
    tagged_mesh: TaggedMesh,
    loads: Sequence[Load],
    strengths: Sequence[tuple[str, SpatialField]] = (),
) -> npt.NDArray[np.bool_]:
    """Return a flag for each local vertex: whether a pressure's or strength's gradient jumps.

    Collective.

    Args:
        tagged_mesh: Mesh of straight cells.
        loads: Loads of any kind; the function uses only the pore pressures among them.
        strengths: Names of volumes, each with a strength field.
    """
    mesh = tagged_mesh.mesh
    index_map = mesh.topology.index_map(0)
    count = index_map.size_local + index_map.num_ghosts
    found = np.zeros(count, dtype=bool)
    known: list[tuple[str, Callable[[Floats], Floats | None]]] = []
    for load in loads:
        if isinstance(load, PorePressure) and isinstance(load.value, str):
            linear = load if isinstance(load, FieldPores) else enclosed_pores(load, "below")
            known.append((load.on, linear.at_corners))
    for name, field in strengths:
        known.append((name, partial(_low, field)))
    for name, at_corners in known:
        cells, vertices, places = cells_with_corners(tagged_mesh, name)
        values = on_all_ranks(mesh.comm, partial(at_corners, places))
        if values is None:
            continue
        d = places.shape[2]
        slopes = np.einsum("cv,cvi->ci", values, gradients(places)[0])
        rows = np.hstack([np.ones((len(cells), 1)), slopes, slopes**2])
        rows = np.repeat(rows, d + 1, axis=0)
        table = sums_at(index_map, 1 + 2 * d, (vertices.ravel(), rows))
        spread = table[:, :1] * table[:, 1 + d :] - table[:, 1 : 1 + d] ** 2
        largest = tagged_mesh.mesh.comm.allreduce(np.abs(slopes).max(initial=0.0), MPI.MAX)
        noticed = 1e-6  # share of the largest gradient, far above rounding in small cells
        found |= (spread > (noticed * largest) ** 2 * table[:, :1] ** 2).any(axis=1)
    return found


def _low(field: SpatialField, corners: Floats) -> Floats:
    """Return the vertex values of linear functions that are below a strength in each cell."""
    return field.between(corners, "a strength")[0]
