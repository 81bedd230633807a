"""Collect interfaces between bodies for strict bounds: facet pairs and admissible tractions.

The strength of an interface defines its admissible tractions. The module also defines the facets of
an interface and the unknowns of its jumps.

For strict bounds, a contact is a layer of zero thickness with a yield set for its tractions. A
surface can transmit the tractions r = (r_n, r_t) with

    r_n ≤ 0,   ‖r_t‖ ≤ c − μ r_n,

with the adhesion c (a constant shear strength) and the coefficient of friction μ. Let w
= v_b − v_a be the jump, with w_n along the outward normal of body a. If slip is normal to the set,
w_n ≥ μ‖w_t‖, and the jump dissipates c‖w_t‖. The reason is that the set is the sum of the cone
‖r_t‖ ≤ −μ r_n and the disc ‖r_t‖ ≤ c. The support function of the cone is 0 for jumps with w_n ≥
μ‖w_t‖ and ∞ for all other jumps.

With μ = 0, slip is normal to the set, and both limit theorems hold. With Coulomb's friction, μ > 0,
slip is not normal to the set, but Drucker's two theorems hold (J. Appl. Mech. 21 (1954), 71). True
tractions are in the set, so the upper bound of this set also holds for real slip. Real slip
dissipates (c + μp)‖w_t‖, which is at least the dissipation with μ = 0. Therefore a lower bound with
the adhesion c alone also holds. If a contact declares associated slip, for example a joint that
dilates, both limit theorems hold for the whole set.
"""

from dataclasses import dataclass
from itertools import permutations

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Ints, Longs, PairFlags
from perfplast_fenicsx.contact.declared.contact import FrictionTerms
from perfplast_fenicsx.contact.declared.obstacles import Obstacle, Plane
from perfplast_fenicsx.contact.surfaces.node_matching import match_nodes
from perfplast_fenicsx.limit_analysis.facets.facet_geometry import FacetGeometry, turned_axes
from perfplast_fenicsx.parallel import bounding_box, send_rows
from perfplast_fenicsx.problem.problem import Problem

REACH = 1e-6
"""Largest distance between the midpoints of touching facets, relative to the size of their
surfaces."""


def facing_vertices(
    one: Floats, other: Floats, normals: Floats, turned: bool = False
) -> tuple[Longs, Floats]:
    """Return matching vertices of opposite facets, and the largest distance of a match per facet.

    Distances are measured along the facet, without the distance along its normal.

    Args:
        one: Vertices of facets, shape (n, d, d).
        other: Vertices of the opposite facets, shape (n, d, d).
        normals: Outward unit normals of the facets ``one``, shape (n, d).
        turned: Whether the facets are sections of rings, which face each other only at equal radii.

    Returns:
        Indices of vertices, shape (n, d), and distances (length), shape (n,).
    """
    best = np.full(len(one), np.inf)
    order = np.zeros(one.shape[:2], dtype=np.int64)
    for permutation in permutations(range(one.shape[1])):
        between = other[:, permutation] - one
        along = np.einsum("fvi,fi->fv", between, normals).mean(axis=1)
        between = between - along[:, None, None] * normals[:, None]
        if turned:
            between[..., 0] += (along * normals[:, 0])[:, None]
        off = np.linalg.norm(between, axis=2).max(axis=1, initial=0.0)
        order[off < best] = permutation
        best = np.minimum(off, best)
    return order, best


Flags = npt.NDArray[np.bool_]

FacetRows = npt.NDArray[np.void]
"""Array of a surface's facets, with rows of the type :func:`facet_type`."""


def facet_type(gdim: int) -> np.dtype:
    """Return the data type of a row that describes a facet.

    The fields are:

    - ``x``: the midpoint (3 numbers),
    - ``normal``: the outward unit normal,
    - ``corners``: the vertices in the order of their global numbers,
    - ``rank``: the rank that owns the facet,
    - ``facet`` and ``number``: the local and the global number of the facet,
    - ``held``: flags of the components that supports prescribe,
    - ``free``: whether supports leave the facet free along its normal.
    """
    return np.dtype(
        [
            ("x", np.float64, 3),
            ("normal", np.float64, gdim),
            ("corners", np.float64, (gdim, gdim)),
            ("rank", np.int32),
            ("facet", np.int32),
            ("number", np.int64),
            ("held", np.bool_, gdim),
            ("free", np.bool_),
        ]
    )


@dataclass(frozen=True)
class FacetPairs:
    """Pairs of opposite facets on this rank: hosts, whose jumps are relative to guests.

    Attributes:
        host: Owned facets whose normal velocity unknown becomes a jump, shape (num_pairs,).
        guest: Normal velocity unknown of the opposite facet, to which the jump is relative, at each
            vertex of the host, shape (num_pairs, d); −1 where supports hold the guest along its
            normal.
        aligned: Flags of components that supports hold on either side of a host, shape (num_pairs,
            d).
        turned: Owned guest facets, which use the normal of their host.
        turned_aligned: The same flags as ``aligned``, for each guest.
        both_held: Whether supports hold components on both sides of any pair of this rank.
    """

    host: Longs
    guest: Longs
    aligned: Flags
    turned: Longs
    turned_aligned: Flags
    both_held: bool


def match_facets(
    comm: MPI.Intracomm, primary: FacetRows, secondary: FacetRows, turned: bool = False
) -> tuple[FacetRows, FacetRows, Longs] | None:
    """Match the facets of two surfaces, which coincide up to rounding. Collective.

    Args:
        comm: The ranks.
        primary: Facets of one surface that this rank owns, with the fields ``x``, ``normal`` and
            ``corners`` of :func:`facet_type`.
        secondary: Facets of the other surface that this rank owns.
        turned: Whether the facets are sections of rings, which match only at equal radii.

    Returns:
        The facets of both surfaces, pair by pair, and the vertices of the second facets that face
        the vertices of the first, shape (num_pairs, d); None if the surfaces do not match facet by
        facet.
    """
    gdim = primary["normal"].shape[1]
    corners = np.concatenate([primary["corners"], secondary["corners"]]).reshape(-1, gdim)
    low, high = bounding_box(comm, np.pad(corners, ((0, 0), (0, 3 - gdim))))
    found = match_nodes(comm, primary, secondary, REACH * float(np.linalg.norm(high - low)))
    a, b = found.primary, found.secondary
    order, off = facing_vertices(a["corners"], b["corners"], a["normal"], turned)
    # Limit for the distance between vertices, relative to the size of the facet, and for the sum
    # of both unit normals, which are opposite.
    rounding = 1e-8
    size = np.ptp(a["corners"], axis=1).max(axis=1)
    askew = np.linalg.norm(a["normal"] + b["normal"], axis=1)
    same = bool(((off <= rounding * size) & (askew <= rounding)).all())
    if found.alone or not comm.allreduce(same, MPI.LAND):
        return None
    return a, b, order


def pair_facets(
    comm: MPI.Intracomm, primary: FacetRows, secondary: FacetRows, turned: bool = False
) -> FacetPairs | None:
    """Match the facets of two surfaces on the ranks that own the facets. Collective.

    The host is the facet of the first surface, unless supports hold this facet along its normal, or
    hold more components of this facet than of the opposite facet.

    Returns:
        The pairs; None if :func:`match_facets`, which has the same arguments, finds none.
    """
    matched = match_facets(comm, primary, secondary, turned)
    if matched is None:
        return None
    a, b, order = matched
    gdim = order.shape[1]
    flags = ("aligned", np.bool_, gdim)
    host_type = [("facet", np.int64), ("guest", np.int64, gdim), flags, ("rank", np.int64)]
    both = a["free"] & b["free"]
    swapped = np.where(both, b["held"].sum(axis=1) < a["held"].sum(axis=1), ~a["free"])
    back = np.argsort(order, axis=1)
    host, guest = (np.where(swapped, *pair) for pair in ((b, a), (a, b)))
    aligned = np.where(both[:, None], a["held"] | b["held"], host["held"])
    order = np.where(swapped[:, None], back, order)
    hosts = np.empty(len(a), dtype=np.dtype(host_type))
    hosts["facet"], hosts["rank"], hosts["aligned"] = host["facet"], host["rank"], aligned
    numbers = (guest["number"][:, None] * gdim + order) * gdim
    hosts["guest"] = np.where(both[:, None], numbers, -1)
    hosts = hosts[a["free"] | b["free"]]
    guests = np.empty(len(a), dtype=np.dtype([("facet", np.int64), flags]))
    guests["facet"], guests["aligned"] = guest["facet"], aligned
    mine = send_rows(comm, hosts, hosts["rank"])
    others = send_rows(comm, guests[both], guest["rank"][both])
    both_held = bool((a["held"].any(axis=1) & b["held"].any(axis=1)).any())
    return FacetPairs(
        host=mine["facet"],
        guest=mine["guest"],
        aligned=mine["aligned"],
        turned=others["facet"],
        turned_aligned=others["aligned"],
        both_held=both_held,
    )


@dataclass(frozen=True)
class ContactStrength:
    """The set of tractions that a contact or an obstacle can transmit.

    Attributes:
        adhesion: Adhesion c ≥ 0 (stress).
        friction: Coefficient of friction μ ≥ 0.
        associated: Whether slip is normal to the set of tractions.
        reduced: Whether a factor of safety divides the adhesion and the friction coefficient.
    """

    adhesion: float
    friction: float
    associated: bool = False
    reduced: bool = True

    @property
    def loose(self) -> bool:
        """Return whether there is friction but no adhesion to dissipate work in associated slip."""
        return self.friction > 0 and self.adhesion == 0


def strength_of(terms: FrictionTerms) -> ContactStrength:
    """Return the strength of a contact or an obstacle."""
    numbers = (terms.tresca or 0.0, terms.coulomb or 0.0)
    return ContactStrength(*numbers, terms.associated, terms.reduced)


def any_loose(problem: Problem) -> bool:
    """Return whether any contact or obstacle has friction but no adhesion."""
    return any(it.loose for it in strengths_of(problem))


def strengths_of(problem: Problem) -> list[ContactStrength]:
    """Return the strengths of all contacts and obstacles."""
    return [strength_of(it) for it in (*problem.given.contacts, *problem.given.obstacles)]


@dataclass(frozen=True, eq=False)
class Interface:
    """A pair of bodies, or a body and an obstacle, that cannot penetrate each other.

    Attributes:
        surfaces: Names of the surfaces, the primary surface first; a single name for an obstacle.
        strength: Tractions that the interface can transmit.
        obstacle: The obstacle; None for an interface between bodies.
        into: Unit normal into the obstacle if the obstacle is a half-space, shape (d,); otherwise
            None.
    """

    surfaces: tuple[str, ...]
    strength: ContactStrength
    obstacle: Obstacle | None = None
    into: Floats | None = None

    @property
    def dilation(self) -> float:
        """Return the coefficient of friction μ if bodies separate as they slip, otherwise 0."""
        return self.strength.friction if self.strength.associated else 0.0


@dataclass(eq=False)
class InterfaceFacets:
    """Interface data of the local facets, including ghosts.

    Attributes:
        axes: Directions of the components on each facet, shape (num_facets, d, d). On contact
            surfaces and roller supports, the first direction is the normal.
        held: Flags of the components that supports hold, shape (num_facets, d).
        hosts: Owned facets whose first component is a jump.
        twins: Unknowns to which the jumps are relative, for each component at each vertex, shape
            (num_facets, d, d); −1 for components that are not jumps. Without adhesion and dilation,
            only the first component is a jump.
        in_contact: Owned facets of surfaces in contact.
        adhesion: Shear strength that resists slip on a host facet (stress), shape (num_facets,).
        friction: Coefficient of friction μ on host facets that separate as they slip, shape
            (num_facets,); 0 on other facets. In 2D, the components on these facets are the jumps a
            and b of :mod:`entering`.
        rubbing: Owned facets, on both sides of interfaces, with shear tractions from adhesion or
            friction.
        oblique: Whether supports hold any contact surface of this rank in a direction oblique to
            its normal.
        matched: Whether all surfaces match facet by facet.
        both_held: Whether supports hold both sides of a surface with adhesion or dilation, or hold
            one side along its normal.
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
            held: Flags of components that supports hold, shape (num_facets, d).
            guided: Further directions along which supports hold facets, shape (num_facets, d); 0
                without such a direction.
        """
        count, d = held.shape
        axes, held = np.tile(np.eye(d), (count, 1, 1)), held.copy()
        along = np.where(held, 0.0, guided)
        sizes = np.linalg.norm(along, axis=1, keepdims=True)
        # directions from roller supports whose size exceeds rounding
        on = np.flatnonzero(sizes > 1e-9)
        axes[on], held[on] = turned_axes(along[on] / sizes[on], held[on], np.zeros_like(held[on]))
        held[on, 0] = True
        twins = np.full((count, d, d), -1)
        no = np.zeros(0, dtype=np.int64)
        return cls(axes, held, no, twins, no, np.zeros(count), np.zeros(count), no)

    def add(self, problem: Problem, facets: FacetGeometry, interface: Interface) -> None:
        """Add the facets of an interface. Collective."""
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
        """Return flags of the facets that supports leave free along a normal; set ``oblique``."""
        along = 1e-10  # largest component of a unit normal that counts as zero
        part = np.linalg.norm(np.where(self.held[on], 0.0, normal), axis=1)
        free: Flags = part > along
        self.oblique |= bool((free & (part < 1 - along)).any())
        return free

    def _turn(self, on: Longs, normal: Floats, aligned: PairFlags) -> None:
        self.axes[on], self.held[on] = turned_axes(normal, self.held[on], aligned)

    def _rub(self, host: Longs, interface: Interface, *others: Longs) -> bool:
        """Set the adhesion of facets; return whether they have adhesion or associated friction."""
        adhesion = interface.strength.adhesion
        rubs = adhesion > 0 or interface.dilation > 0
        if rubs:
            self.adhesion[host] = adhesion
            self.rubbing = np.concatenate([self.rubbing, host, *others])
        return rubs

    def _dilate(self, host: Longs, friction: float, *others: Longs) -> None:
        """Let facets separate as they slip; in 2D, w = a(n/2 + t/2μ) + b(n/2 − t/2μ)."""
        if friction > 0:
            self.friction[host] = friction
            for on in (host, *others):
                self.both_held |= bool(self.held[on].any())
                if self.held.shape[1] == 2:
                    normal, along = self.axes[on, 0] / 2, self.axes[on, 1] / (2 * friction)
                    self.axes[on] = np.stack([normal + along, normal - along], axis=1)


def by_friction_alone(problem: Problem) -> bool:
    """Return whether any surface has nonassociated friction and no adhesion."""
    return any(it.dilation == 0 and it.strength.loose for it in interfaces_of(problem))


def interfaces_of(problem: Problem) -> tuple[Interface, ...]:
    """Return the interfaces that a problem declares."""
    given, origin = problem.given, np.zeros((1, problem.bodies.gdim))
    found = [Interface((it.primary, it.secondary), strength_of(it)) for it in given.contacts]
    for it in given.obstacles:
        into = it.towards(origin)[1][0] if isinstance(it, Plane) else None
        found.append(Interface((it.on,), strength_of(it), it, into))
    return tuple(found)


def _rows(problem: Problem, facets: FacetGeometry, on: Ints, held: Flags, free: Flags) -> FacetRows:
    """Return facets as rows that the ranks exchange for matching."""
    rows = np.zeros(len(on), dtype=facet_type(facets.tdim))
    rows["corners"] = facets.corners(on)
    rows["x"][:, : facets.tdim] = rows["corners"].mean(axis=1)
    rows["normal"] = facets.normals(on)
    rows["rank"], rows["facet"] = problem.comm.rank, on
    rows["number"] = facets.index_map.local_to_global(on)
    rows["held"], rows["free"] = held, free
    return rows
