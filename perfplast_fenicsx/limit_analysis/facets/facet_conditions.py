"""What supports, loads and contact say of the tractions on each facet."""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from dolfinx import la

from perfplast_fenicsx.arrays import Floats, Ints, Longs, PairFlags
from perfplast_fenicsx.compat import geometry_dofmap
from perfplast_fenicsx.contact.declared.obstacles import Plane
from perfplast_fenicsx.limit_analysis.facets.contact_strength import strength_of
from perfplast_fenicsx.limit_analysis.facets.entering import CURVED
from perfplast_fenicsx.limit_analysis.facets.facet_axes import turned_axes
from perfplast_fenicsx.limit_analysis.facets.facet_geometry import FacetGeometry
from perfplast_fenicsx.limit_analysis.facets.facet_loads import FacetLoads, loads_of
from perfplast_fenicsx.limit_analysis.facets.facet_pairs import FacetRows, facet_type, pair_facets
from perfplast_fenicsx.limit_analysis.facets.facet_velocities import FacetNumbers, facet_numbers
from perfplast_fenicsx.limit_analysis.facets.rigid_facets import RigidFacets, rigid_facets
from perfplast_fenicsx.problem.declared.loads import is_bounded, is_known
from perfplast_fenicsx.problem.problem import Problem

UNMATCHED = "surfaces in contact do not match facet by facet"

OBLIQUE = "a support holds a surface in contact obliquely to its normal"

VARYING = "a load is a force per volume that is a formula"

UNKNOWN = "a load is of a kind that strict bounds do not know"

TWICE = "a surface is in contact with more than one other"

RIGID = "a surface is rigid and in contact, and of the tractions there only sums are known"

TIED = "surfaces are glued together in the mean alone"

HELD = "supports hold surfaces that rub, of both sides or along their normal"


@dataclass(frozen=True, eq=False)
class FacetConditions:
    """Conditions of the local facets, ghosts too, and those of this rank's cells.

    Attributes:
        numbers: Of the facets.
        vertices: Of the owned cells, in the order of their geometry, shape (num_cells, d + 1, d).
        axes: Directions of a facet's components, the first one along the normal on surfaces in
            contact, shape (num_facets, d, d).
        held: Components that supports hold, shape (num_facets, d).
        live: Loads that ζ multiplies, at ζ = 1.
        dead: Those that it does not.
        hosts: Owned facets whose first component is a jump.
        twins: Unknowns that the jumps are relative to, −1 for none, shape (num_facets, d, d); of
            the components at each vertex, of the first one alone where nothing rubs.
        in_contact: Owned facets of surfaces in contact.
        adhesion: Shear stress that slip has to overcome on a host facet, shape (num_facets,).
        rigid: Facets of surfaces that move as rigid ones.
        rubbing: Owned facets whose shear tractions are those of such a resistance, both sides.
        why_not: Why what is found does not hold for the body.
        prevents: Why nothing can be found.
    """

    numbers: FacetNumbers
    vertices: Floats
    axes: Floats
    held: npt.NDArray[np.bool_]
    live: FacetLoads
    dead: FacetLoads
    hosts: Longs
    twins: Longs
    in_contact: Longs
    adhesion: Floats
    rigid: RigidFacets
    rubbing: Longs
    why_not: tuple[str, ...]
    prevents: str | None


_known: WeakKeyDictionary[Problem, FacetConditions] = WeakKeyDictionary()


def facet_conditions(problem: Problem) -> FacetConditions:
    """What they say of a problem, read once for as long as it lives. Collective.

    Its mesh, its declaration and its contact, all of which they follow from, never change.
    """
    if problem not in _known:
        _known[problem] = _read(problem)
    return _known[problem]


def _read(problem: Problem) -> FacetConditions:
    mesh, given = problem.tagged_mesh.mesh, problem.given
    tdim = mesh.topology.dim
    numbers = facet_numbers(mesh)
    nodes = geometry_dofmap(mesh)[: len(numbers.facets), : tdim + 1]
    vertices: Floats = np.asarray(mesh.geometry.x[nodes][:, :, :tdim], dtype=np.float64)
    facets = FacetGeometry(problem, numbers, vertices)
    held, rigid = _held(problem, facets), rigid_facets(problem, facets)
    known = [load for load in given.loads if is_bounded(load)]
    live, dead = (
        loads_of(problem, facets, rigid, [load for load in known if load.constant is constant])
        for constant in (False, True)
    )
    bent = live[1] or dead[1]
    unknown = not all(is_known(load) for load in given.loads)
    varies = not unknown and len(known) < len(given.loads)

    axes = np.tile(np.eye(tdim), (facets.num, 1, 1))
    twins = np.full((facets.num, tdim, tdim), -1)
    adhesion = np.zeros(facets.num)
    why_not: list[str] = []
    hosts: list[Longs] = [np.zeros(0, dtype=np.int64)]
    touching: list[Ints] = [np.zeros(0, dtype=np.int32)]
    rubbing: list[Longs] = [np.zeros(0, dtype=np.int64)]
    oblique, matched, both_held = False, True, False

    along = 1e-10  # part of a unit normal that is rounding

    def is_free(on: Ints, normal: Floats) -> npt.NDArray[np.bool_]:
        nonlocal oblique
        part = np.linalg.norm(np.where(held[on], 0.0, normal), axis=1)
        free: npt.NDArray[np.bool_] = part > along
        oblique |= bool((free & (part < 1 - along)).any())
        return free

    def turn(on: Ints | Longs, normal: Floats, aligned: PairFlags | None = None) -> None:
        axes[on], held[on] = turned_axes(normal, held[on], held[on] if aligned is None else aligned)

    for contact in given.contacts:
        rows = []
        for surface in (contact.primary, contact.secondary):
            on = facets.of(problem, surface)
            touching.append(on)
            rows.append(_rows(problem, facets, on, held[on], is_free(on, facets.normals(on))))
        one, other = rows
        pairs = pair_facets(problem.comm, one, other, problem.tagged_mesh.axisymmetric)
        if pairs is None:
            matched = False
            continue
        hosts.append(pairs.host)
        twins[pairs.host, :, 0] = pairs.guest
        resists = strength_of(contact).adhesion
        if resists > 0:
            adhesion[pairs.host] = resists
            rubbing += [pairs.host, pairs.turned]
            twins[pairs.host] = pairs.guest[:, :, None] + np.arange(tdim)
            both_held |= pairs.both_held or bool((pairs.guest < 0).any())
        turn(pairs.host, facets.normals(pairs.host), pairs.aligned)
        turn(pairs.turned, -facets.normals(pairs.turned), pairs.turned_aligned)
    for obstacle in given.obstacles:
        on = facets.of(problem, obstacle.on)
        touching.append(on)
        _, into = obstacle.towards(facets.corners(on).mean(axis=1))
        free = is_free(on, into)
        hosts.append(on[free].astype(np.int64))
        turn(on[free], into[free])
        resists = strength_of(obstacle).adhesion
        if resists > 0:
            adhesion[on[free]] = resists
            rubbing.append(on[free].astype(np.int64))
        if not isinstance(obstacle, Plane):
            why_not.append(CURVED)
    every = np.concatenate(touching)
    faults = {
        RIGID: bool((rigid.surface[every] >= 0).any()),
        TIED: len(given.ties) > 0,
        VARYING: varies,
        UNKNOWN: unknown,
        str(bent): bent is not None,
        UNMATCHED: not matched,
        OBLIQUE: oblique,
        HELD: both_held,
        TWICE: len(np.unique(every)) < len(every),
    }
    found = [words for words, is_so in faults.items() if problem.comm.allreduce(is_so)]
    return FacetConditions(
        numbers=numbers,
        vertices=vertices,
        axes=axes,
        held=held,
        live=live[0],
        dead=dead[0],
        hosts=np.concatenate(hosts),
        twins=twins,
        in_contact=every.astype(np.int64),
        adhesion=adhesion,
        rigid=rigid,
        rubbing=np.concatenate(rubbing),
        why_not=tuple(dict.fromkeys(why_not)),
        prevents=found[0] if found else None,
    )


def _held(problem: Problem, facets: FacetGeometry) -> npt.NDArray[np.bool_]:
    """Cartesian components that supports hold, the same on all ranks. Collective."""
    tdim = facets.tdim
    flags = la.vector(facets.index_map, tdim)
    array = flags.array.reshape(-1, tdim)
    for support in problem.given.holding:
        on = problem.tagged_mesh.facets(support.on)
        for axis in support.axes(tdim):
            array[on, axis] = 1.0
    flags.scatter_reverse(la.InsertMode.add)
    flags.scatter_forward()
    held: npt.NDArray[np.bool_] = flags.array.reshape(-1, tdim) > 0
    return held


def _rows(
    problem: Problem,
    facets: FacetGeometry,
    on: Ints,
    held: npt.NDArray[np.bool_],
    free: npt.NDArray[np.bool_],
) -> FacetRows:
    """Facets that travel to be matched."""
    rows = np.zeros(len(on), dtype=facet_type(facets.tdim))
    rows["corners"] = facets.corners(on)
    rows["x"][:, : facets.tdim] = rows["corners"].mean(axis=1)
    rows["normal"] = facets.normals(on)
    rows["rank"], rows["facet"] = problem.comm.rank, on
    rows["number"] = facets.index_map.local_to_global(on)
    rows["held"], rows["free"] = held, free
    return rows
