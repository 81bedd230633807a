"""Choose the next mesh of bounds: where it is finer, and how many cells it has."""

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.directions_of_change import directions_of_change
from perfplast_fenicsx.limit_analysis.body.edge_metric import edge_metric
from perfplast_fenicsx.limit_analysis.body.marking import largest_shares, to_refine
from perfplast_fenicsx.limit_analysis.body.singular_edges import singular_edges
from perfplast_fenicsx.limit_analysis.body.singular_points import singular_points
from perfplast_fenicsx.limit_analysis.body.wide_corners import wide_corners
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import Verdict
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import varying_of
from perfplast_fenicsx.limit_analysis.facets.enclosed_pores import on_kinks
from perfplast_fenicsx.mesh.crossing_edges import bend_crossings
from perfplast_fenicsx.mesh.refinement import fan, fan_around, refine, spread
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import fetch_rows
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.spatial_fields import PointValues


def finer_mesh(
    problem: Problem,
    found: BodyBounds,
    gap: float | None,
    adaptation: Adaptation,
    much: bool = False,
) -> TaggedMesh | str:
    """Return the next mesh, or why there is no next mesh. Collective.

    If it would have too many cells, the function marks as many as fit. A mesh with hardly more
    cells than this one would cost as much and improve little. In the plane, a twelfth more cells at
    the right places can still close a fifth of the gap. In space each mesh costs more than all
    previous ones. The function therefore marks more cells if the next step would be small.

    Args:
        problem: The bodies and their loads, on this mesh.
        found: Bounds on it.
        gap: Relative gap of the best bounds so far; None if one of them is missing.
        adaptation: The adaptation, with its limits.
        much: Whether a plane mesh should have about twice as many cells as the previous one.
    """
    # Dörfler's fraction by dimension: the marked cells carry this share of the gap, and of the
    # dissipation. It is smaller in space, where the closure of the refinement divides many more
    # cells.
    part, worth_while = {2: (0.4, 1.05), 3: (0.2, 1.2)}[problem.bodies.gdim]
    if much and problem.bodies.gdim == 2:
        part, worth_while = 0.8, 1.5
    cells, now = adaptation.cells, number_of_cells(problem.tagged_mesh)
    too_many = f"a finer mesh would have more than {cells} cells"
    if now >= cells:
        return too_many
    if found.static is not None and found.static.verdict is Verdict.NO_RESISTANCE:
        part = 1.0  # without a result there are no indicators: cells are too large everywhere
    marked = to_refine(problem, found, part)
    if not problem.comm.allreduce(int(marked.sum())):
        return "no result indicates where to refine"
    usual = refined(problem, marked, found, cells)
    least, most = 0.0, float(cells)
    if problem.bodies.gdim == 3 and part < 1.0:
        least, most = _wanted(now, gap, adaptation)
    finer, few = usual, worth_while * now
    largest = 0.9  # largest marked part; beyond it cells contribute almost nothing to the gap
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
    """Return the least and largest number of cells of the next mesh in space.

    The number should suffice by the observed convergence, but is at most twice the present one:
    indicators on a coarse mesh are not those on a much finer one.

    Args:
        now: Number of cells of this mesh.
        gap: Gap of the best bounds so far.
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
        found: Bounds on the mesh. In the plane, cells become long where mechanism or stress changes
            in one direction (:mod:`edge_metric`). In space, edges along which velocity and stress
            change are cut (:mod:`directions_of_change`). Cells at singular edges with the largest
            loss of the lower bound become fans instead of being refined, since more directions
            reduce this loss.
        cells: Largest number of cells of the mesh. In the plane, fans of long cells are created at
            once if they take less than a fourth of it, and otherwise gradually with each mesh.
    """
    given, tagged_mesh = problem.given, problem.tagged_mesh
    in_space = problem.bodies.gdim == 3
    changes = directions_of_change(found) if in_space and found is not None else None
    if in_space and found is not None and found.static is not None:
        dissipation = found.static.dissipation
        tagged_mesh, marked, changes = _with_fans(problem, marked, dissipation, changes)
    at_once, metric, gap = False, None, None
    if not in_space:
        if found is not None:
            metric, gap = edge_metric(found), found.lower.apart(found.upper)
        long = _with_long_fans(problem, marked, metric, gap)
        at_once = number_of_cells(long[0]) <= cells / 4 + number_of_cells(tagged_mesh)
        tagged_mesh, marked, metric = long if at_once else (tagged_mesh, marked, metric)
    pairs = opposite_vertices(tagged_mesh, given.contacts)
    finer = refine(tagged_mesh, marked, pairs, metric, changes).tagged_mesh
    if in_space:
        return finer
    valence = 24  # final number of cells at points where the stress depends on the direction
    points = singular_points(finer, given, valence, ends=not at_once)
    if problem.comm.allreduce(len(points)):
        finer = fan(finer, points, opposite_vertices(finer, given.contacts)).tagged_mesh
    fields = varying_of(problem)
    # A field of a file has kinks everywhere. Vertices on them move, because linear bounds of the
    # field then lose less than with lines that cross.
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
    metric: Floats | None,
    gap: float | None,
) -> tuple[TaggedMesh, npt.NDArray[np.bool_], Floats | None]:
    """Return a plane mesh with fans of its long cells, with marks and metric. Collective.

    Cells that become parts of fans lose their mark: further refinement would shorten them.
    """
    given, tagged_mesh = problem.given, problem.tagged_mesh
    most = 8  # number of times that angles are halved
    for _ in range(most):
        wide, there = wide_corners(tagged_mesh, given, gap)
        if not problem.comm.allreduce(int(wide.sum())):
            break
        pairs = opposite_vertices(tagged_mesh, given.contacts)
        finer = spread(tagged_mesh, wide, there, pairs)
        marked = fetch_rows(problem.comm, marked & ~wide.any(axis=1), finer.parents)
        if metric is not None:
            metric = fetch_rows(problem.comm, metric, finer.parents)
        tagged_mesh = finer.tagged_mesh
    return tagged_mesh, marked, metric


def _with_fans(
    problem: Problem,
    marked: npt.NDArray[np.bool_],
    dissipation: Floats,
    changes: Floats | None,
) -> tuple[TaggedMesh, npt.NDArray[np.bool_], Floats | None]:
    """Return a mesh in space with fans at the marked cells that need them. Collective.

    Returns:
        The mesh, the remaining marks of its owned cells, and their directions of change.
    """
    comm, given, tagged_mesh = problem.comm, problem.given, problem.tagged_mesh
    most = 0.5  # share of the multipliers' dissipation, which is often in few cells,
    nearly = 0.5  # share of it that must be at such edges; otherwise cell size matters as well
    valence = 12  # cells around edges; each costs as many cells as the edge has
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
