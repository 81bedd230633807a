"""Read the bodies of a strict bound from a problem, once, as arrays of a rank.

Supports, loads and interfaces determine the conditions on cells and on the tractions of each facet.
Stress and velocity programs, error indicators, the division of corners and the proof file use them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import la

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import geometry_dofmap
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import (
    Interface,
    InterfaceFacets,
    interfaces_of,
)
from perfplast_fenicsx.limit_analysis.facets.entering import CURVED
from perfplast_fenicsx.limit_analysis.facets.facet_geometry import FacetGeometry
from perfplast_fenicsx.limit_analysis.facets.facet_loads import FacetLoads, loads_of
from perfplast_fenicsx.limit_analysis.facets.facet_velocities import FacetNumbers, facet_numbers
from perfplast_fenicsx.limit_analysis.facets.rigid_facets import RigidFacets, rigid_facets
from perfplast_fenicsx.problem.declared.loads import is_bounded, is_known
from perfplast_fenicsx.problem.once import once_a_problem
from perfplast_fenicsx.problem.problem import Problem

Flags = npt.NDArray[np.bool_]

UNMATCHED = "surfaces in contact do not match facet by facet"

OBLIQUE = "a support holds a surface in contact obliquely to its normal"

VARYING = "a load is a force per volume that is a formula"

UNKNOWN = "a load is of a kind that strict bounds do not know"

TWICE = "a surface is in contact with more than one other"

RIGID = "a surface is rigid and in contact, where only the resultant of the tractions is known"

TIED = "surfaces are glued together in the mean alone"

HELD = "supports hold surfaces that rub or touch, of both sides or along their normal"


@dataclass(frozen=True, eq=False)
class BoundBody:
    """The local facets, ghosts too, and this rank's cells.

    Attributes:
        numbers: Numbers of the facets.
        geometry: Geometry of the outer facets.
        vertices: Vertices of the owned cells, in the order of their geometry, shape (num_cells, d +
            1, d).
        supported: Cartesian components that supports hold, shape (num_facets, d); without free
            rigid surfaces.
        guided: Unit vectors along which roller supports hold facets, 0 for none, shape (num_facets,
            d).
        live: Loads that ζ multiplies, at ζ = 1.
        dead: Permanent loads.
        rigid: Facets of surfaces that move as rigid ones.
        interfaces: Contacts, followed by obstacles.
        facets: Supports and interfaces of the facets, also of rigid surfaces.
        why_not: Reasons why results do not hold for the body.
        prevents: Reason why there can be no result; None without one.
        turned: Whether the bodies are of revolution.
    """

    numbers: FacetNumbers
    geometry: FacetGeometry
    vertices: Floats
    supported: Flags
    guided: Floats
    live: FacetLoads
    dead: FacetLoads
    rigid: RigidFacets
    interfaces: Sequence[Interface]
    facets: InterfaceFacets
    why_not: tuple[str, ...]
    prevents: str | None
    turned: bool


@once_a_problem
def bound_body(problem: Problem) -> BoundBody:
    """Return the bodies of a problem, which are read once and kept with it. Collective."""
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
    guided = _guided(problem, facets)
    interfaces, at = interfaces_of(problem), InterfaceFacets.none(held, guided)
    for interface in interfaces:
        at.add(problem, facets, interface)
    curved = any(it.obstacle is not None and it.into is None for it in interfaces)
    faults = {
        RIGID: bool((rigid.surface[at.in_contact] >= 0).any()),
        TIED: len(given.ties) > 0,
        VARYING: varies,
        UNKNOWN: unknown,
        str(bent): bent is not None,
        UNMATCHED: not at.matched,
        OBLIQUE: at.oblique,
        HELD: at.both_held or bool(guided[at.in_contact].any()),
        TWICE: len(np.unique(at.in_contact)) < len(at.in_contact),
    }
    found = [words for words, is_so in faults.items() if problem.comm.allreduce(is_so)]
    return BoundBody(
        numbers=numbers,
        geometry=facets,
        vertices=vertices,
        supported=held & (rigid.surface < 0)[:, None],
        guided=guided,
        live=live[0],
        dead=dead[0],
        rigid=rigid,
        interfaces=interfaces,
        facets=at,
        why_not=(CURVED,) if curved else (),
        prevents=found[0] if found else None,
        turned=problem.tagged_mesh.axisymmetric,
    )


def _guided(problem: Problem, facets: FacetGeometry) -> Floats:
    """Return directions along which roller supports hold facets, the same on all ranks.

    Collective.
    """
    guides = problem.guides
    found = np.zeros((facets.num, facets.tdim))
    for surface, normal in zip(guides.surfaces, guides.normals, strict=True):
        flags = la.vector(facets.index_map, 1)
        flags.array[problem.tagged_mesh.facets(surface)] = 1.0
        flags.scatter_reverse(la.InsertMode.add)
        flags.scatter_forward()
        found[flags.array > 0] = normal
    return found


def _held(problem: Problem, facets: FacetGeometry) -> Flags:
    """Return the Cartesian components that supports hold, the same on all ranks. Collective."""
    tdim = facets.tdim
    flags = la.vector(facets.index_map, tdim)
    array = flags.array.reshape(-1, tdim)
    for support in problem.given.holding:
        on = problem.tagged_mesh.facets(support.on)
        for axis in support.axes(tdim):
            array[on, axis] = 1.0
    flags.scatter_reverse(la.InsertMode.add)
    flags.scatter_forward()
    held: Flags = flags.array.reshape(-1, tdim) > 0
    return held
