"""Find outer facets that coincide without sharing a cell's side or being in contact."""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats


def cuts_of(body: Body) -> Floats:
    """Return the middle of each pair of such facets with the same vertices, shape (num_pairs, d).

    Nothing prevents the bodies from separating or penetrating each other there. A stress that such
    bodies bear is also one of the bodies without the cut; a velocity is not.
    """
    d = body.dim
    touch = [*body.contacts.ravel(), *body.obstacles]
    free = np.flatnonzero(~np.isin(body.surface, touch))
    places = body.vertices[body.facets[free]]
    # Distance of equal points, relative to the size of the bodies.
    same = 1e-9 * max(float(np.ptp(body.vertices, axis=0).max(initial=0.0)), np.finfo(float).tiny)
    keys = np.rint(places / same)
    for axis in reversed(range(d)):
        order = np.argsort(keys[..., axis], axis=1, kind="stable")
        keys = np.take_along_axis(keys, order[..., None], axis=1)
    rows = keys.reshape(len(keys), d * d)
    _, first, counts = np.unique(rows, axis=0, return_index=True, return_counts=True)
    return np.asarray(places[first[counts > 1]].mean(axis=1))
