"""What a proof is about, in words: what the checker cannot know, and the reader can."""

import numpy as np

from perfplast_fenicsx.proof.body import Body
from perfplast_fenicsx.proof.load_kinds import Loads

MOST = 6
"""Materials, surfaces and so on that are named one by one."""


def taken_as_written(body: Body) -> str:
    """The bodies, strengths, supports, contact and loads of a half, in one sentence."""
    d = body.dim
    parts = [
        f"{len(body.cells)} {'triangles' if d == 2 else 'tetrahedra'} of volume"
        f" {body.volumes.sum():.6g}, glued where they share vertices",
        _strengths(body),
        _supports(body),
        _contacts(body),
        f"loads whose resultants at λ = 1 are {_loads(body, body.sought)}",
    ]
    if body.constant:
        parts.append(f"loads that stay, whose resultants are {_loads(body, body.constant)}")
    if body.others:
        words = _loads(body, body.others)
        parts.append(f"loads of any factor, whose resultants at factor 1 are {words}")
    return f"Taken as written: {'; '.join(parts)}."


def _listed(words: list[str]) -> str:
    """Words, and how many more there are."""
    more = len(words) - MOST
    return ", ".join(words[:MOST]) + (f" and {more} more" if more > 0 else "")


def _strengths(body: Body) -> str:
    cones = np.column_stack([body.yield_radius, body.yield_slope])
    kinds, at = np.unique(cones, axis=0, return_inverse=True)
    volumes = np.bincount(at.ravel(), weights=body.volumes)
    words = []
    for radius, slope, volume in zip(*kinds.T, volumes, strict=True):
        falls = f" less {slope:.6g} times the mean stress" if slope else ""
        here = f"{radius:.6g}{falls} in a volume of {volume:.6g}"
        words.append(here if np.isfinite(radius) else "elastic cells")
    return f"yield radii (the largest ‖dev σ‖) {_listed(words)}"


def _supports(body: Body) -> str:
    words = []
    for tag in np.unique(body.surface[body.held.any(axis=1)]):
        here = body.on(tag)
        axes = [
            axis
            for axis, held in zip("xyz", np.atleast_1d(body.held[here].any(axis=0)), strict=False)
            if held
        ]
        count = int(body.held[here].any(axis=1).sum())
        words.append(f"{', '.join(axes)} of surface {tag} ({count} facets)")
    return f"supports hold {_listed(words)}" if words else "no supports"


def _contacts(body: Body) -> str:
    words: dict[str, list[str]] = {}
    rubs = zip(body.contact_adhesion, body.contact_friction, strict=True)
    for (one, other), terms in zip(body.contact_pairs, rubs, strict=True):
        words.setdefault(_friction(*terms), []).append(f"surfaces {one} and {other}")
    rubs = zip(body.obstacle_adhesion, body.obstacle_friction, strict=True)
    obstacles = zip(body.obstacles, body.obstacle_normals, rubs, strict=True)
    for tag, normal, terms in obstacles:
        along = ", ".join(f"{part:.4g}" for part in np.atleast_1d(normal))
        here = f"surface {tag} and a plane towards ({along})"
        words.setdefault(_friction(*terms), []).append(here)
    kinds = [f"contact {friction} of {_listed(some)}" for friction, some in words.items()]
    return "; ".join(kinds) if kinds else "no contact"


def _friction(adhesion: float, friction: float) -> str:
    parts = [f"{adhesion:.6g}"] * bool(adhesion > 0)
    parts += [f"{friction:.6g} times the pressure"] * bool(friction > 0)
    return f"with a shear stress of up to {' and '.join(parts)}" if parts else "without friction"


def _loads(body: Body, loads: Loads) -> str:
    words = []
    force = body.areas[:, None] * loads.traction.mean(axis=1)
    for tag in np.unique(body.surface[loads.traction.any(axis=(1, 2))]):
        total = force[body.on(tag)].sum(axis=0)
        words.append(f"{_vector(total)} on surface {tag}")
    if loads.body_force.any():
        words.append(f"{_vector(body.volumes @ loads.body_force)} in the volume")
    return _listed(words)


def _vector(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"
