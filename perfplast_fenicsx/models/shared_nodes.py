"""Report bodies of a model that share nodes, and thus form one piece."""

import numpy as np

from perfplast_fenicsx.models.foreign_model import ForeignModel


def told_of_shared_nodes(model: ForeignModel) -> list[str]:
    """Return a remark on the bodies that share nodes, which a picture of the mesh does not show."""
    bodies = np.repeat(model.body, model.cells.shape[1])
    first = np.full(len(model.points), len(model.bodies))
    last = np.full(len(model.points), -1)
    np.minimum.at(first, model.cells.ravel(), bodies)
    np.maximum.at(last, model.cells.ravel(), bodies)
    shared = last > first
    if not shared.any():
        return []
    pairs = np.unique(np.column_stack([first[shared], last[shared]]), axis=0)
    names = sorted({model.bodies[number] for number in pairs.ravel()})
    return [
        f"{' and '.join(map(repr, names))} share nodes, and are one piece there; export them as"
        " separate meshes where there is to be contact"
    ]
