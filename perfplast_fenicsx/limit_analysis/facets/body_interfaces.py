"""Collect the interfaces of the bodies of a bound, with each other and with half spaces.

The strength of an interface (:mod:`contact_strength`) defines the tractions that it bears, for any
kind of interface. This module defines the facets of an interface, and the unknowns of its jumps.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Ints, Longs, PairFlags
from perfplast_fenicsx.contact.declared.obstacles import Obstacle, Plane
from perfplast_fenicsx.limit_analysis.facets.contact_strength import ContactStrength, strength_of
from perfplast_fenicsx.limit_analysis.facets.facet_axes import turned_axes
from perfplast_fenicsx.limit_analysis.facets.facet_geometry import FacetGeometry
from perfplast_fenicsx.limit_analysis.facets.facet_pairs import FacetRows, facet_type, pair_facets
from perfplast_fenicsx.problem.problem import Problem

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Interface:
    """A pair of bodies, or a body and an obstacle, that cannot penetrate each other.

    Attributes:
        surfaces: Names of the surfaces, that of the primary body first; one for an obstacle.
        strength: Tractions that the interface bears.
        obstacle: The obstacle; None between bodies.
        into: Unit normal into the obstacle if it is a half space, shape (d,); otherwise None.
        dilation: Coefficient μ if bodies separate as they slip, otherwise 0.
    """

    surfaces: tuple[str, ...]
    strength: ContactStrength
    obstacle: Obstacle | None = None
    into: Floats | None = None
    dilation: float = 0.0


@dataclass(eq=False)
class InterfaceFacets:
    """Interfaces on the local facets, ghosts included.

    Attributes:
        axes: Directions of a facet's components, shape (num_facets, d, d). On surfaces in contact
            and on roller supports the first one is along the normal.
        held: Flags of the components that supports hold, shape (num_facets, d).
        hosts: Owned facets whose first component is a jump.
        twins: Unknowns that the jumps are relative to, −1 for none, shape (num_facets, d, d): for
            the components at each vertex, only for the first component without friction.
        in_contact: Owned facets of surfaces in contact.
        adhesion: Shear stress that slip has to overcome on a host facet, shape (num_facets,).
        friction: Coefficient μ on host facets that separate as they slip, shape (num_facets,); 0 on
            others. In the plane their two components are the jumps a and b of
            :mod:`associated_slip`.
        rubbing: Owned facets of both sides with shear tractions by such a resistance.
        oblique: Whether supports hold any surface obliquely to its normal, on this rank.
        matched: Whether all surfaces match facet by facet.
        both_held: Whether supports hold surfaces with friction, on both sides or along their
            normal.
    """

    axes: Floats
    held: Flags
    hosts: Longs
    twins: Longs
    in_contact: Longs
    adhesion: Floats
    friction: Floats
    rubbing: Longs
    oblique: bool = False
    matched: bool = True
    both_held: bool = False

    @classmethod
    def none(cls, held: Flags, guided: Floats) -> "InterfaceFacets":
        """Return the data of facets without any interface.

        Args:
            held: Components that supports hold, shape (num_facets, d).
            guided: Further directions that are held, 0 for none, shape (num_facets, d).
        """
        count, d = held.shape
        axes, held = np.tile(np.eye(d), (count, 1, 1)), held.copy()
        along = np.where(held, 0.0, guided)
        sizes = np.linalg.norm(along, axis=1, keepdims=True)
        # directions that roller supports add to the others, except for rounding
        on = np.flatnonzero(sizes > 1e-9)
        axes[on], held[on] = turned_axes(along[on] / sizes[on], held[on], np.zeros_like(held[on]))
        held[on, 0] = True
        twins = np.full((count, d, d), -1)
        no = np.zeros(0, dtype=np.int64)
        return cls(axes, held, no, twins, no, np.zeros(count), np.zeros(count), no)

    def add(self, problem: Problem, facets: FacetGeometry, interface: Interface) -> None:
        """Add an interface. Collective."""
        if interface.obstacle is None:
            self._add_bodies(problem, facets, interface)
        else:
            self._add_obstacle(problem, facets, interface, interface.obstacle)

    def _add_bodies(self, problem: Problem, facets: FacetGeometry, interface: Interface) -> None:
        rows = []
        for surface in interface.surfaces:
            on = facets.of(problem, surface)
            self.in_contact = np.append(self.in_contact, on)
            free = self._free(on, facets.normals(on))
            rows.append(_rows(problem, facets, on, self.held[on], free))
        one, other = rows
        pairs = pair_facets(problem.comm, one, other, problem.tagged_mesh.axisymmetric)
        if pairs is None:
            self.matched = False
            return
        self.hosts = np.append(self.hosts, pairs.host)
        self.twins[pairs.host, :, 0] = pairs.guest
        if self._rub(pairs.host, interface, pairs.turned):
            d = self.held.shape[1]
            self.twins[pairs.host] = pairs.guest[:, :, None] + np.arange(d)
            self.both_held |= pairs.both_held or bool((pairs.guest < 0).any())
        self._turn(pairs.host, facets.normals(pairs.host), pairs.aligned)
        self._turn(pairs.turned, -facets.normals(pairs.turned), pairs.turned_aligned)
        self._dilate(pairs.host, interface.dilation, pairs.turned)

    def _add_obstacle(
        self, problem: Problem, facets: FacetGeometry, interface: Interface, obstacle: Obstacle
    ) -> None:
        on = facets.of(problem, interface.surfaces[0])
        self.in_contact = np.append(self.in_contact, on)
        _, into = obstacle.towards(facets.corners(on).mean(axis=1))
        free = self._free(on, into)
        pressed = on[free].astype(np.int64)
        self.hosts = np.append(self.hosts, pressed)
        self._turn(pressed, into[free], self.held[pressed])
        self._rub(pressed, interface)
        self._dilate(pressed, interface.dilation)

    def _free(self, on: Ints, normal: Floats) -> Flags:
        """Return flags of the facets that supports leave free along a normal."""
        along = 1e-10  # component of a unit normal that is rounding
        part = np.linalg.norm(np.where(self.held[on], 0.0, normal), axis=1)
        free: Flags = part > along
        self.oblique |= bool((free & (part < 1 - along)).any())
        return free

    def _turn(self, on: Longs, normal: Floats, aligned: PairFlags) -> None:
        self.axes[on], self.held[on] = turned_axes(normal, self.held[on], aligned)

    def _rub(self, host: Longs, interface: Interface, *others: Longs) -> bool:
        """Give facets adhesion or friction, and return whether they have any."""
        adhesion = interface.strength.adhesion
        rubs = adhesion > 0 or interface.dilation > 0
        if rubs:
            self.adhesion[host] = adhesion
            self.rubbing = np.concatenate([self.rubbing, host, *others])
        return rubs

    def _dilate(self, host: Longs, friction: float, *others: Longs) -> None:
        """Let facets separate as they slip; in the plane w = a(n/2 + t/2μ) + b(n/2 − t/2μ)."""
        if friction > 0:
            self.friction[host] = friction
            for on in (host, *others):
                self.both_held |= bool(self.held[on].any())
                if self.held.shape[1] == 2:
                    normal, along = self.axes[on, 0] / 2, self.axes[on, 1] / (2 * friction)
                    self.axes[on] = np.stack([normal + along, normal - along], axis=1)


def by_friction_alone(problem: Problem) -> bool:
    """Return whether surfaces have friction that is not associated, and no adhesion."""
    found = [it for it in interfaces_of(problem) if it.dilation == 0]
    return any(it.strength.loose for it in found)


def interfaces_of(problem: Problem) -> tuple[Interface, ...]:
    """Return the interfaces that a problem declares."""
    given, origin = problem.given, np.zeros((1, problem.bodies.gdim))
    found = [Interface((it.primary, it.secondary), strength_of(it)) for it in given.contacts]
    for it in given.obstacles:
        into = it.towards(origin)[1][0] if isinstance(it, Plane) else None
        found.append(Interface((it.on,), strength_of(it), it, into))
    return tuple(
        replace(it, dilation=it.strength.friction if it.strength.associated else 0.0)
        for it in found
    )


def _rows(problem: Problem, facets: FacetGeometry, on: Ints, held: Flags, free: Flags) -> FacetRows:
    """Return facets as rows that are exchanged for matching."""
    rows = np.zeros(len(on), dtype=facet_type(facets.tdim))
    rows["corners"] = facets.corners(on)
    rows["x"][:, : facets.tdim] = rows["corners"].mean(axis=1)
    rows["normal"] = facets.normals(on)
    rows["rank"], rows["facet"] = problem.comm.rank, on
    rows["number"] = facets.index_map.local_to_global(on)
    rows["held"], rows["free"] = held, free
    return rows
