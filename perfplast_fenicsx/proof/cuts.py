"""Outer facets that lie on each other, and neither share a cell's side nor are in contact."""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats


def cuts_of(body: Body) -> Floats:
    """Return the middle of each pair of such facets with the same vertices, shape (num_pairs, d).

    Nothing keeps the bodies from parting or entering each other there. A stress that they bear so
    is one of bodies without that cut as well; a velocity is not.
    """
    d = body.dim
    touch = [*body.contacts.ravel(), *body.obstacles]
    free = np.flatnonzero(~np.isin(body.surface, touch))
    places = body.vertices[body.facets[free]]
    # Distance of places that are the same, relative to the size of the bodies.
    same = 1e-9 * max(float(np.ptp(body.vertices, axis=0).max(initial=0.0)), np.finfo(float).tiny)
    keys = np.rint(places / same)
    for axis in reversed(range(d)):
        order = np.argsort(keys[..., axis], axis=1, kind="stable")
        keys = np.take_along_axis(keys, order[..., None], axis=1)
    rows = keys.reshape(len(keys), d * d)
    _, first, counts = np.unique(rows, axis=0, return_index=True, return_counts=True)
    return np.asarray(places[first[counts > 1]].mean(axis=1))
