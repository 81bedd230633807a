"""Name the flat ends of bodies if a file has no names for them."""

from dataclasses import replace

import numpy as np

from perfplast_fenicsx.geometry.part_names import unique_names
from perfplast_fenicsx.models.foreign_model import ForeignModel
from perfplast_fenicsx.models.outer_facets import NOWHERE, OuterFacets


def with_flat_ends(model: ForeignModel) -> ForeignModel:
    """Return the model with names such as ``plate_z_low`` for flat outer facets without a name."""
    outer = OuterFacets(model.cells, len(model.points))
    free = np.ones(len(outer.corners), dtype=bool)
    named = outer.find(model.facets)
    free[named[named != NOWHERE]] = False
    wanted, found = [], []
    # largest distance of a flat end's nodes from its plane, relative to the body's size
    off_plane = 1e-6
    for number, body in enumerate(model.bodies):
        mine = free & (model.body[outer.cells] == number)
        places = model.points[np.unique(model.cells[model.body == number])][:, : model.dim]
        low, high = places.min(axis=0), places.max(axis=0)
        close = off_plane * float(np.linalg.norm(high - low))
        for axis, letter in enumerate("xyz"[: model.dim]):
            for side, end in (("low", low[axis]), ("high", high[axis])):
                off = np.abs(model.points[outer.corners, axis] - end).max(axis=1)
                at = np.flatnonzero(mine & (off <= close))
                if len(at):
                    wanted.append(f"{body}_{letter}_{side}")
                    found.append(at)
    if not found:
        return model
    names = unique_names([*model.surfaces, *wanted])
    first = len(model.surfaces)
    ends = [np.full(len(at), first + k) for k, at in enumerate(found)]
    return replace(
        model,
        facets=np.concatenate([model.facets, outer.corners[np.concatenate(found)]]),
        surface=np.concatenate([model.surface, *ends]),
        surfaces=names,
    )
