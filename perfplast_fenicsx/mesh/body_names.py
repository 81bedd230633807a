"""Name bodies by their volume, with their position if a volume has several bodies."""

from collections import Counter

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.mesh.connected_bodies import Bodies
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import bounding_box
from perfplast_fenicsx.rounding import ROUNDING


def body_names(V: fem.FunctionSpace, tagged_mesh: TaggedMesh, bodies: Bodies) -> list[str]:
    """Return a name for each body, the same on every rank. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        bodies: The bodies of the mesh.

    Returns:
        Such as "'pin'"; "'bolts' about (0.5, 2.5)" with its middle, if several bodies share a name;
        all names if volumes with several names form one body.
    """
    topology, tags = tagged_mesh.mesh.topology, tagged_mesh.cell_tags
    owned = tags.indices < topology.index_map(topology.dim).size_local
    body = bodies.of_node[V.dofmap.list[tags.indices[owned], 0]]
    own = np.unique(np.stack([body, tags.values[owned]], axis=1), axis=0)
    found = np.unique(np.concatenate(V.mesh.comm.allgather(own)), axis=0)
    named = {tag: name for name, tag in tagged_mesh.volumes.items()}
    called = [
        " and ".join(sorted(f"'{named[tag]}'" for tag in found[found[:, 0] == number, 1]))
        for number in range(bodies.count)
    ]
    several = Counter(called)
    x = V.tabulate_dof_coordinates()[:, : bodies.gdim]
    for number, name in enumerate(called):
        if several[name] > 1:
            low, high = bounding_box(V.mesh.comm, x[bodies.of_node == number])
            middle = (low + high) / 2
            middle[np.abs(middle) < ROUNDING * np.linalg.norm(high - low)] = 0.0
            place = ", ".join(f"{a:.4g}" for a in middle)
            called[number] = f"{name} about ({place})"
    return called
