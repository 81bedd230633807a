"""Whether both halves of a proof are of the same bodies, however each is meshed."""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats, Longs
from perfplast_fenicsx.proof.load_kinds import Loads
from perfplast_fenicsx.proof.rings import normals_of

SAME = 1e-9
"""Volumes, areas, places and forces that differ by less, relative to the largest, are the same."""


def differences(lower: Body, upper: Body) -> list[str]:
    """What differs between the bodies of two halves, in words.

    Those of the upper half may be stronger, and rub more: what is a bound from above of the
    stronger bodies is one of the others.

    Args:
        lower: The bodies of the lower half.
        upper: Those of the upper one.
    """
    if lower.dim != upper.dim:
        return ["one half is plane, and the other in space"]
    if lower.is_revolved != upper.is_revolved:
        return ["one half is of bodies of revolution, and the other is not"]
    found = []
    if not _alike(_masses(lower), _masses(upper)):
        found.append("the halves have bodies of different volume or place")
    elif not _is_weaker(lower, upper):
        found.append(
            "the upper half has weaker bodies than the lower one, or of cones of other shapes"
        )
    tags = np.union1d(lower.surface, upper.surface)
    if not _alike(_areas(lower, tags), _areas(upper, tags)):
        found.append("the halves have different surfaces")
    if not _alike(*(_supports(body, tags) for body in (lower, upper))):
        found.append("the halves have different supports")
    kinds = zip(
        *((body.sought, body.constant, body.others) for body in (lower, upper)), strict=True
    )
    if not all(
        _alike(_resultants(lower, one, tags), _resultants(upper, other, tags))
        for one, other in kinds
    ):
        found.append("the halves have different loads")
    if not _alike(*(_rigid(body) for body in (lower, upper))):
        found.append("the halves have different rigid surfaces")
    if not _same_contacts(lower, upper):
        found.append("the halves have different contacts, or the upper one rubs less")
    return found


def _alike(one: Floats, other: Floats) -> bool:
    """Whether all columns are the same but for rounding."""
    size = np.maximum(np.abs(one), np.abs(other)).max(axis=0, initial=0)
    return bool((np.abs(one - other) <= SAME * size).all())


def _centres(body: Body) -> Floats:
    return np.asarray(body.vertices[body.cells].mean(axis=1))


def _masses(body: Body) -> Floats:
    """Volume, and its moments of first and second order as one column each, of all cells."""
    x = _centres(body)
    first = body.volumes @ x
    nodes = body.vertices[body.cells]
    second = (
        (nodes**2).sum(axis=1) + nodes.sum(axis=1) ** 2  # exact on simplices
    ) / ((body.dim + 1) * (body.dim + 2))
    extent = np.abs(nodes).max()
    parts = [body.volumes.sum(), *(first / extent), *(body.volumes @ second / extent**2)]
    return np.array(parts)[:, None]


def _is_weaker(lower: Body, upper: Body) -> bool:
    """Whether for any strength the upper half has no more volume that is weaker than that.

    Where both have the same volume of a strength, it must be in the same place. Bodies of each
    shape of cone are compared by themselves, and must be of the same volume and in the same place:
    of two shapes neither need be in the other.
    """
    kinds, numbers = np.unique(
        np.concatenate(_strengths(lower, upper)), axis=0, return_inverse=True
    )
    ends = np.append(np.diff(kinds[:, 0]) > 0, True)
    total = lower.volumes.sum()
    volumes, places = [], []
    extent = np.abs(lower.vertices[lower.cells]).max()
    for body, at in zip((lower, upper), np.split(numbers.ravel(), [len(lower.cells)]), strict=True):
        volumes.append(np.bincount(at, weights=body.volumes, minlength=len(kinds)))
        moments = body.volumes[:, None] * _centres(body) / extent
        places.append(
            np.stack([np.bincount(at, weights=m, minlength=len(kinds)) for m in moments.T], axis=1)
        )
    more = np.cumsum(volumes[1]) - np.cumsum(volumes[0])
    less = (more <= SAME * total) & (~ends | (np.abs(more) <= SAME * total))
    moved = np.cumsum(places[1] - places[0], axis=0)[ends]
    same = np.abs(volumes[1] - volumes[0]) <= SAME * total
    near = (np.abs(places[1] - places[0]) <= SAME * total).all(axis=1)
    return bool(less.all() and near[same].all() and (np.abs(moved) <= SAME * total).all())


def _strengths(*bodies: Body) -> list[Floats]:
    """Number of the shape of each cell's cone, and its strength; shape (num_cells, 2) each.

    A shape is MᵀM and q, for a matrix M of size 1, or s of principal stresses. Elastic cells are as
    bodies of infinite strength that keep their volume.
    """
    m, n = bodies[0].components, normals_of(bodies[0])
    plain = np.eye(m)
    plain[:n, :n] -= 1 / n
    no_sine = -1.0  # in the place of s where no principal stresses are bounded
    none: Floats = np.array([[*np.zeros(m), no_sine]])
    shapes, bounds = [np.append(_shape(plain[None]), none, axis=1)], []
    for body in bodies:
        principal = body.cones.is_principal
        sizes = np.where(principal, 1.0, np.linalg.norm(body.cone_matrix, axis=(1, 2)))
        slopes = body.cone_slope / sizes[:, None]
        sines = np.where(principal, body.cone_sine, no_sine)
        matrices = np.where(principal[:, None, None], np.eye(m), body.cone_matrix)
        shapes.append(np.column_stack([_shape(matrices), slopes, sines]))
        bounds.append(np.append(body.cone_bound / sizes, np.inf)[body.cone])
    numbers = _alike_rows(np.concatenate(shapes))
    ends = np.cumsum([1, *(len(body.cone_bound) for body in bodies)])
    found = []
    for body, bound, first in zip(bodies, bounds, ends, strict=False):
        mine = np.append(numbers[first : first + len(body.cone_bound)], numbers[0])
        found.append(np.column_stack([mine[body.cone], bound]).astype(np.float64))
    return found


def _shape(matrices: Floats) -> Floats:
    """MᵀM of matrices of size 1, in rows."""
    unit = matrices / np.linalg.norm(matrices, axis=(1, 2), keepdims=True)
    return np.asarray((unit.transpose(0, 2, 1) @ unit).reshape(len(unit), -1))


def _alike_rows(rows: Floats) -> Longs:
    """A number for each row, the same for those that are rounded to the same."""
    digits = 11  # behind the point, that entries of cones of size 1 are compared with
    _, numbers = np.unique(np.round(rows, digits), axis=0, return_inverse=True)
    return np.asarray(numbers.ravel(), dtype=np.int64)


def _areas(body: Body, tags: np.ndarray) -> Floats:
    """Area of each surface, and its first moments."""
    at = np.searchsorted(tags, body.surface)
    x = body.vertices[body.facets].mean(axis=1)
    columns = [body.areas, *(body.areas * along for along in x.T)]
    return np.stack([np.bincount(at, weights=c, minlength=len(tags)) for c in columns], axis=1)


def _supports(body: Body, tags: np.ndarray) -> Floats:
    """Area of each surface that is held in each way."""
    d = body.dim
    ways: Longs = body.held @ (1 << np.arange(d))
    at = np.searchsorted(tags, body.surface) * 2**d + ways
    areas = np.bincount(at, weights=body.areas, minlength=len(tags) * 2**d)
    return np.asarray(areas[:, None], dtype=np.float64)


def _resultants(body: Body, loads: Loads, tags: np.ndarray) -> Floats:
    """Force and moment about the origin of each surface's loads, and of body forces."""
    d = body.dim
    x = body.vertices[body.facets]
    at = np.searchsorted(tags, body.surface)
    exact = (np.eye(d) + 1) / (d * (d + 1))  # means of products of barycentric coordinates
    force = body.areas[:, None] * loads.traction.mean(axis=1)
    moment = np.einsum("f,fai,ab,fbj->fij", body.areas, x, exact, loads.traction)
    moment = (moment - moment.transpose(0, 2, 1)).reshape(len(x), -1)
    in_cells = body.volumes[:, None] * loads.body_force
    turning = np.einsum("ci,cj->cij", _centres(body), in_cells)
    turning = (turning - turning.transpose(0, 2, 1)).reshape(len(in_cells), -1)
    found = []
    for on_surfaces, inside in ((force, in_cells), (moment, turning)):
        rows = np.zeros((len(tags) + 1, on_surfaces.shape[1]))
        np.add.at(rows, at, on_surfaces)
        rows[-1] = inside.sum(axis=0)
        found.append(rows.reshape(-1, 1))
    # what cancels within a surface is rounding of its largest part
    sizes = body.areas @ np.linalg.norm(loads.traction, axis=2).mean(axis=1)
    whole = sizes + body.volumes @ np.linalg.norm(loads.body_force, axis=1)
    extent = np.abs(body.vertices[body.cells]).max()
    plates = np.zeros((len(tags), d + 2 * d - 3))
    at_plates = np.searchsorted(tags, body.rigid)
    plates[at_plates] = np.hstack([loads.rigid_force, loads.rigid_moment / extent])
    every = [found[0], found[1] / extent, plates.reshape(-1, 1), [[whole]], _pores(body, loads)]
    return np.concatenate(every)


def _pores(body: Body, loads: Loads) -> Floats:
    """Integrals of a pressure in pores, of its square, and its first moments."""
    u, x, n = loads.pore_pressure, body.vertices[body.cells], body.dim + 1
    means = (np.eye(n) + 1) / (n * (n + 1))  # of products of barycentric coordinates
    squares = np.einsum("c,ca,ab,cb->", body.volumes, u, means, u)
    moments = np.einsum("c,ca,ab,cbi->i", body.volumes, u, means, x) / np.abs(x).max()
    size = np.sqrt(squares * body.volumes.sum())
    return np.array([body.volumes @ u.mean(axis=1), *moments, size])[:, None]


def _rigid(body: Body) -> Floats:
    """Whether each surface is rigid, and what holds it, in the order of all tags."""
    tags = np.unique(body.surface)
    ways = np.zeros(len(tags))
    ways[np.searchsorted(tags, body.rigid)] = 1.0 + body.rigid_held @ (2 << np.arange(body.dim))
    return ways[:, None]


def _contacts(body: Body) -> Floats:
    """Rows of each contact: its tags in order, adhesion and friction."""
    rows = np.column_stack(
        [np.sort(body.contacts, axis=1), body.contact_adhesion, body.contact_friction]
    )
    return np.asarray(rows[np.lexsort(rows.T[::-1])], dtype=np.float64)


def _obstacles(body: Body) -> Floats:
    """Rows of each obstacle: its tag and normal, adhesion and friction."""
    rows = np.column_stack(
        [body.obstacles, body.obstacle_normals, body.obstacle_adhesion, body.obstacle_friction]
    )
    return np.asarray(rows[np.argsort(body.obstacles, kind="stable")], dtype=np.float64)


def _same_contacts(lower: Body, upper: Body) -> bool:
    """Whether contacts and obstacles are the same, and nowhere rub less in the upper half."""
    for rows in (_contacts, _obstacles):
        one, other = rows(lower), rows(upper)
        if len(one) != len(other) or not _alike(one[:, :-2], other[:, :-2]):
            return False
        if not (one[:, -2:] <= other[:, -2:]).all():
            return False
    return True


def pair_of_drucker(lower: Body, upper: Body) -> bool:
    """Whether anything has no friction beside adhesion in the lower half, and some in the upper."""
    sums = (body.contact_friction.sum() + body.obstacle_friction.sum() for body in (lower, upper))
    less, more = sums
    return bool(less < more)
