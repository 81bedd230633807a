"""Put the same problem on a mesh with elements of half the size."""

import numpy as np

from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.mesh.refinement import check_refinable, refine
from perfplast_fenicsx.problem.problem import Problem


def halved(problem: Problem) -> Problem:
    """Return the problem on a mesh all of whose edges are cut in half. Collective.

    Coinciding vertices of bodies in contact coincide afterwards, and the bodies do not change:
    polygons that approximate circles remain polygons.

    Raises:
        InputError: If cells are curved.
    """
    tagged_mesh = problem.tagged_mesh
    check_refinable(tagged_mesh)
    topology = tagged_mesh.mesh.topology
    every = np.ones(topology.index_map(topology.dim).size_local, dtype=np.bool_)
    opposite = opposite_vertices(tagged_mesh, problem.given.contacts)
    return problem.on(refine(tagged_mesh, every, opposite).tagged_mesh)
