"""What bodies are called: by the name of their volume, and by where they are if it has several."""

from collections import Counter

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.mesh.connected_bodies import Bodies
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import bounding_box


def body_names(V: fem.FunctionSpace, tagged_mesh: TaggedMesh, bodies: Bodies) -> list[str]:
    """Words for each body, alike on every rank. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        bodies: Its bodies.

    Returns:
        "'pin'"; "'bolts' in the box [0 to 1, 2 to 3]" where several bodies have that name; all
        names where bodies of several names are one.
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
            box = ", ".join(f"{a:.4g} to {b:.4g}" for a, b in zip(low, high, strict=True))
            called[number] = f"{name} in the box [{box}]"
    return called
