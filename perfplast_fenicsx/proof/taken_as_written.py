"""Describe the data of a proof that the checker cannot check, so that the reader can check them."""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats, Longs
from perfplast_fenicsx.proof.load_kinds import Loads
from perfplast_fenicsx.proof.rings import around, normals_of, times_radius


def cuts_of(body: Body) -> Floats:
    """Return the centroid of each pair of coinciding outer facets, shape (num_pairs, d).

    The function includes only pairs that are neither in contact nor on obstacles. At these pairs,
    nothing prevents the bodies from separating or penetrating each other. An admissible stress in
    the cut bodies is also admissible in the uncut bodies, but an admissible velocity may not be.
    """
    d = body.dim
    touch = [*body.contacts.ravel(), *body.obstacles]
    free = np.flatnonzero(~np.isin(body.surface, touch))
    places = body.vertices[body.facets[free]]
    # Distance below which points coincide: a small fraction of the size of the bodies.
    same = 1e-9 * max(float(np.ptp(body.vertices, axis=0).max(initial=0.0)), np.finfo(float).tiny)
    keys = np.rint(places / same)
    for axis in reversed(range(d)):
        order = np.argsort(keys[..., axis], axis=1, kind="stable")
        keys = np.take_along_axis(keys, order[..., None], axis=1)
    rows = keys.reshape(len(keys), d * d)
    _, first, counts = np.unique(rows, axis=0, return_index=True, return_counts=True)
    return np.asarray(places[first[counts > 1]].mean(axis=1))


MOST_WORDS = 6
"""Largest number of materials, surfaces and so on that are named individually."""

MANY = 24
"""Number of cones of one kind above which a common sentence describes these cones."""


def taken_as_written(body: Body) -> str:
    """Return a sentence on the bodies, strengths, supports, contacts and loads of a proof."""
    d = body.dim
    shape = "triangles" if d == 2 else "tetrahedra"
    shape += ", sections of rings around x = 0," if body.is_revolved else ""
    parts = [
        f"{len(body.cells)} {shape} of total volume {body.volumes @ around(body):.6g}, connected"
        " where they share vertices",
        *_cuts(body),
        _strengths(body),
        _supports(body),
        _contacts(body),
        *_rigid(body),
        f"loads whose resultants at λ = 1 are {_loads(body, body.sought)}",
    ]
    if body.constant:
        parts.append(f"permanent loads, whose resultants are {_loads(body, body.constant)}")
    if body.others:
        words = _loads(body, body.others)
        parts.append(f"loads with arbitrary factors, whose resultants at factor 1 are {words}")
    return f"Taken as written: {'; '.join(parts)}."


def _listed(words: list[str]) -> str:
    """Return the first entries, separated by commas, and the number of the other entries."""
    more = len(words) - MOST_WORDS
    return ", ".join(words[:MOST_WORDS]) + (f" and {more} more" if more > 0 else "")


def _cuts(body: Body) -> list[str]:
    """Return a clause on coinciding facets without contact; an empty list without such facets."""
    places = cuts_of(body)
    if not len(places):
        return []
    return [
        f"cuts between {len(places)} pairs of coinciding facets without contact, for example at "
        f"{_vector(places[0])}: the bound holds for bodies with these cuts"
    ]


def _strengths(body: Body) -> str:
    if not body.plastic.any():
        return "blocks of unlimited strength"
    weights = body.volumes * around(body)
    numbers = np.bincount(body.cone + 1, weights=weights, minlength=len(body.cone_bound) + 1)
    volumes = np.asarray(numbers, dtype=np.float64)
    words = ["elastic cells"] if volumes[0] else []
    used = np.flatnonzero(volumes[1:])
    alike = _of_one_axis(body, used) if len(used) > MANY else used[:0]
    words += _range_of(body, alike, volumes[1:])
    cones = {number: _cone(body, number) for number in np.setdiff1d(used, alike)}
    for number, cone in cones.items():
        where = f"in a volume of {volumes[number + 1]:.6g}"
        words.append(f"{cone}{body.varies_by(number)} {where}")
    what = "‖dev σ‖" + (", or ‖Mσ‖" if any("M" in cone for cone in cones.values()) else "")
    if (curved := body.cones.is_curved[used]).all():
        return f"strength: {_listed(words)}"
    what += ", or a limit of (σ₁ − σ₃)²" if curved.any() else ""
    return f"yield radii (the largest {what}): {_listed(words)}"


def _of_one_axis(body: Body, used: Longs) -> Longs:
    """Return those of the cones ``used`` that are circular around the in-plane mean stress."""
    M, q = body.cone_matrix[used], body.cone_slope[used]
    if q.shape[1] != 3:
        return used[:0]
    unit = np.array([1.0, 1.0, 0.0])
    sizes = np.sqrt((M**2).sum(axis=(1, 2)) / 2)
    sizes = np.where(sizes > 0, sizes, 1.0)
    plain = np.eye(3) - np.outer(unit, unit) / 2
    off = np.abs(M.transpose(0, 2, 1) @ M / sizes[:, None, None] ** 2 - plain).max(axis=(1, 2))
    along = q @ unit / sizes
    tilted = np.abs(q / sizes[:, None] - along[:, None] * unit / 2).max(axis=1)
    return np.asarray(used[(off < 1e-9) & (tilted < 1e-9) & (along > 0)])


def _range_of(body: Body, cones: Longs, volumes: Floats) -> list[str]:
    """Return a clause with the ranges of radius and slope of many cones, and their total volume.

    Many cones occur, for example, if each cell has its own cone. The list is empty without cones.

    Args:
        body: The bodies.
        cones: Numbers of cones of :func:`_of_one_axis`.
        volumes: Volume of the cells of each cone.
    """
    if not len(cones):
        return []
    sizes = np.sqrt((body.cone_matrix[cones] ** 2).sum(axis=(1, 2)) / 2)
    steep = body.cone_slope[cones][:, :2].sum(axis=1) / sizes
    at = np.full(len(body.cone_bound), np.nan)
    at[cones] = body.cone_bound[cones] / sizes
    here = np.isin(body.cone, cones)
    bounds = at[body.cone[here], None] * body.cell_strength[here]
    return [
        f"{len(cones)} cones: {bounds.min():.6g} to {bounds.max():.6g} minus {steep.min():.6g} to"
        f" {steep.max():.6g} times the mean stress in a volume of {volumes[cones].sum():.6g}"
    ]


def _cone(body: Body, number: np.int64) -> str:
    """Return the numbers of a yield set in words, such as the radius and the slope of a cone."""
    if body.cones.is_principal[number]:
        s = body.cone_sine[number]
        what = f"{1 + s:.6g} σ₁ − {1 - s:.6g} σ₃" if s else "σ₁ − σ₃"
        words = f"{body.cone_bound[number]:.6g} as the largest {what}"
        cut, tension = body.cones.is_cut[number], body.cone_tension[number]
        return words + (f" and {tension:.6g} as the largest σ₁" if cut else "")
    if body.cones.is_curved[number]:
        k, f = body.cone_curvature[number], body.cone_bound[number]
        return f"(σ₁ − σ₃)² at most {4 * k:.6g} times ({f:.6g} − σ₁)"
    d, M, q = normals_of(body), body.cone_matrix[number], body.cone_slope[number]
    unit = np.append(np.ones(d), np.zeros(len(q) - d))
    size = np.sqrt((M**2).sum() / (len(q) - 1))
    usual = np.abs(M.T @ M / size**2 - np.eye(len(q)) + np.outer(unit, unit) / d).max() < 1e-9
    along = float(q @ unit) / size
    bound = f"{body.cone_bound[number] / size:.6g}"
    if usual and np.abs(q / size - along * unit / d).max() < 1e-9:
        return bound + (f" minus {along:.6g} times the mean stress" if along else "")
    rows = ", ".join(_vector(row / size) for row in M)
    falls = f" minus {_vector(q / size)}·σ" if q.any() else ""
    return f"{bound}{falls} with M = ({rows})"


def _supports(body: Body) -> str:
    words = []
    for tag in np.unique(body.surface[body.held.any(axis=1)]):
        held = np.atleast_2d(body.held[body.on(tag)])
        patterns, counts = np.unique(held, axis=0, return_counts=True)
        for row, count in enumerate(counts):
            axes = [axis for axis, one in zip("xyz", patterns[row], strict=False) if one]
            if axes:
                words.append(f"{', '.join(axes)} of surface {tag} ({count} facets)")
    guided = np.flatnonzero(body.guided.any(axis=1))
    for tag in np.unique(body.surface[guided]):
        here = np.intersect1d(body.on(tag), guided)
        cosines = np.einsum("fi,fi->f", body.guided[here], body.normals[here])
        oblique = np.abs(cosines).min() < 1 - 1e-8  # angles of at least 1.4e-4
        what = "the oblique direction " if oblique else "its normal "
        along = f"{what}{_vector(body.guided[here[0]])}"
        words.append(f"surface {tag} along {along} ({len(here)} facets)")
    return f"supports hold {_listed(words)}" if words else "no supports"


def _contacts(body: Body) -> str:
    words: dict[str, list[str]] = {}
    rubs = zip(body.contact_adhesion, body.contact_friction, strict=True)
    firsts, seconds = body.contacts.T
    for one, other, terms in zip(firsts, seconds, rubs, strict=True):
        words.setdefault(_friction(*terms), []).append(f"surfaces {one} and {other}")
    rubs = zip(body.obstacle_adhesion, body.obstacle_friction, strict=True)
    obstacles = zip(body.obstacles, body.obstacle_normals, rubs, strict=True)
    for tag, normal, terms in obstacles:
        along = ", ".join(f"{part:.4g}" for part in np.atleast_1d(normal))
        here = f"surface {tag} and a plane with the normal ({along})"
        words.setdefault(_friction(*terms), []).append(here)
    kinds = [f"contact {friction} between {_listed(some)}" for friction, some in words.items()]
    return "; ".join(kinds) if kinds else "no contact"


def _rigid(body: Body) -> list[str]:
    words = []
    for tag, held in zip(body.rigid, body.rigid_held, strict=True):
        axes = ", ".join(
            axis for axis, is_so in zip("xyz", np.atleast_1d(held), strict=False) if is_so
        )
        words.append(f"surface {tag}" + (f" (held in {axes}, without rotation)" if axes else ""))
    return [f"rigid plates glued to {_listed(words)}"] if words else []


def _friction(adhesion: float, friction: float) -> str:
    parts = [f"{adhesion:.6g}"] * bool(adhesion > 0)
    parts += [f"{friction:.6g} times the pressure"] * bool(friction > 0)
    return f"with a shear stress of up to {' and '.join(parts)}" if parts else "without friction"


def _loads(body: Body, loads: Loads) -> str:
    words = []
    force = body.areas[:, None] * loads.traction.mean(axis=1)
    if body.is_revolved:
        radii = body.vertices[body.facets][..., 0]
        means = times_radius(radii, loads.traction).mean(axis=1)
        force = 2 * np.pi * body.areas[:, None] * means
    for tag in np.unique(body.surface[loads.traction.any(axis=(1, 2))]):
        total = force[body.on(tag)].sum(axis=0)
        words.append(f"{_vector(total)} on surface {tag}")
    if loads.body_force.any():
        words.append(f"{_vector((body.volumes * around(body)) @ loads.body_force)} in the volume")
    for number, tag in enumerate(body.rigid):
        force, moment = loads.rigid_force[number], loads.rigid_moment[number]
        if force.any() or moment.any():
            about = f" with the moment {_vector(moment)} about the origin"
            words.append(f"{_vector(force)}{about} on the rigid surface {tag}")
    if loads.pore_pressure.any():
        there = body.volumes[loads.pore_pressure.any(axis=1)].sum()
        least, most = loads.pore_pressure.min(), loads.pore_pressure.max()
        words.append(
            f"a pressure of {least:.6g} to {most:.6g} in the pores of a volume of "
            f"{there:.6g}, whose stresses are effective stresses"
        )
    return _listed(words)


def _vector(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"
