"""Handle surfaces glued to a rigid plate: resultants of their tractions, and their motions.

Only the resultant force and moment of a plate's tractions are known: they equal the force and
moment of the plate's loads. A surface that is held along some axes does not rotate, and only the
force along the other axes matters. The velocity of the plate is a + ω × (x − c) with the centre c
of the surface. The plate of a body of revolution moves along the axis. For such bodies, stresses
are S = rσ, velocities are v = ru, and resultants are divided by 2π.
"""

from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.guided import left_free
from perfplast_fenicsx.proof.load_kinds import Loads
from perfplast_fenicsx.proof.plain_arrays import ProofError
from perfplast_fenicsx.proof.rings import applied


@dataclass(frozen=True)
class Rigid:
    """A rigid surface.

    Attributes:
        number: Index of the surface in the file.
        facets: Indices of its facets.
        free: Flags of the checked components of the resultant force and moment, shape (3 or 6,).
        middle: Centre c.
        extent: Largest distance of the surface's vertices from the centre.
        area: Area of the surface; for a body of revolution divided by 2π.
        turn: Divisor of the forces in the file: 2π for bodies of revolution, otherwise 1.
    """

    number: int
    facets: Longs
    free: Flags
    middle: Floats
    extent: float
    area: float
    turn: float

    def wanted(self, loads: Loads) -> Floats:
        """Return the loads' force and moment (about c, over the extent); zero where not free."""
        force, moment = loads.rigid_force[self.number], loads.rigid_moment[self.number]
        about = moment - moments(self.middle[None], force[None])[0]
        found: Floats = np.append(force, about / self.extent) * self.free / self.turn
        return found

    def resultant(self, body: Body, tractions: Floats) -> Floats:
        """Return the tractions' force and moment (about c, over the extent); zero where not free.

        For tractions that are linear between the facets' vertices, the integrals are exact.

        Args:
            body: The bodies.
            tractions: Tractions of all facets, shape (num_facets, d, d); for bodies of revolution
                coefficients of r times tractions, shape (num_facets, 3, 2).
        """
        d, here = body.dim, tractions[self.facets]
        areas = body.areas[self.facets]
        if body.is_revolved:
            return np.append(areas @ here.mean(axis=1), 0.0) * self.free
        places = body.vertices[body.facets[self.facets]]
        arms = np.reshape((places - self.middle) / self.extent, (-1, d))
        means = (np.eye(d) + 1) / (d * (d + 1))  # mean products of barycentric coordinates
        weighted = np.einsum("f,ab,fbi->fai", areas, means, here)
        about = moments(np.asarray(arms, dtype=np.float64), weighted.reshape(-1, d)).sum(axis=0)
        found: Floats = np.append(areas @ here.mean(axis=1), about) * self.free
        return found

    def motion(self, x: Floats, v: Floats) -> tuple[Floats, float]:
        """Return the rigid motion that fits given velocities best, and the largest deviation.

        Args:
            x: Points, shape (n, d).
            v: Velocities at the points.

        Returns:
            The motion (a and ω times the extent, zero for held components), and the largest
            difference.
        """
        d = x.shape[1]
        arms = np.asarray((x - self.middle) / self.extent, dtype=np.float64)
        turns = [turned(axis, arms) for axis in np.eye(2 * d - 3)]
        shifts = [np.broadcast_to(axis, x.shape) for axis in np.eye(d)]
        every = np.stack([*shifts, *turns], axis=2) * self.free
        if self.turn != 1:
            every = every * x[:, :1, None]  # for v = ru
        found = np.linalg.lstsq(every.reshape(-1, every.shape[2]), v.ravel(), rcond=None)[0]
        motion: Floats = found * self.free
        return motion, float(np.abs(v - every @ motion).max(initial=0))


def rigid_of(body: Body) -> list[Rigid]:
    """Return the rigid surfaces of the bodies."""
    found = []
    for number, tag in enumerate(body.rigid):
        facets, held = body.on(tag), body.rigid_held[number]
        x = body.vertices[body.facets[facets]]
        areas = body.areas[facets]
        middle = areas @ x.mean(axis=1) / areas.sum()
        free = np.append(~held, np.full(2 * body.dim - 3, not held.any()))
        extent = float(np.linalg.norm(x - middle, axis=2).max())
        turn = 2 * np.pi if body.is_revolved else 1.0
        area = float(areas @ x[..., 0].mean(axis=1) if body.is_revolved else areas.sum())
        found.append(Rigid(number, facets, free, middle, extent, area, turn))
    return found


def check_loaded(body: Body) -> None:
    """Refuse sought loads (whose factor is bounded) that act only on supports.

    On a rigid surface, only the free components of the tractions' resultant act.

    Args:
        body: The bodies.

    Raises:
        ProofError: If these loads act only on supports.
    """
    loads, glued = body.sought, np.isin(body.surface, body.rigid)
    free = left_free(loads.traction, body.held, body.guided)[~body.on_axis & ~glued]
    if free.any() or loads.body_force.any() or loads.pore_pressure.any():
        return
    rounding = 1e-12  # resultant over the sum of magnitudes
    for surface in rigid_of(body):
        pushes = surface.resultant(body, applied(body, loads))
        here = applied(body, loads)[surface.facets]
        size = float(body.areas[surface.facets] @ np.linalg.norm(here, axis=2).mean(axis=1))
        if surface.wanted(loads).any() or np.abs(pushes).max() > rounding * size:
            return
    raise ProofError("only supports are loaded: every load factor would be a bound.")


def sums_of(rigid: list[Rigid], loads: Loads) -> tuple[float, float]:
    """Return the sum of the sizes of loads on rigid surfaces, and the largest load per area."""
    sizes = [float(np.abs(surface.wanted(loads)).sum()) for surface in rigid]
    stresses = [size / surface.area for size, surface in zip(sizes, rigid, strict=True)]
    return sum(sizes), max(stresses, default=0.0)


def moments(arms: Floats, forces: Floats) -> Floats:
    """Return arms × forces for arrays (n, d), of shape (n, 1) in 2D and (n, 3) in 3D."""
    if arms.shape[1] == 2:
        return (arms[:, :1] * forces[:, 1:] - arms[:, 1:] * forces[:, :1])[:, :1]
    return np.asarray(np.cross(arms, forces), dtype=np.float64)


def turned(turn: Floats, arms: Floats) -> Floats:
    """Return rotation × arms for one rotation, shape (n, d)."""
    if arms.shape[1] == 2:
        return turn[0] * np.column_stack([-arms[:, 1], arms[:, 0]])
    return np.asarray(np.cross(turn, arms), dtype=np.float64)
