"""Read a .msh file with gmsh and write its content to an .npz file, as a separate program.

A damaged file may make gmsh crash, run without end or allocate memory without limit. Only this
process ends then, not the ranks. The program imports nothing from this package, because such an
import would start MPI.

    python3 -P gmsh_dump.py FILE.msh TARGET.npz
"""

import json
import resource
import sys
from pathlib import Path
from typing import Any

import gmsh
import numpy as np


def limit(size: int) -> None:
    """Limit memory and processor time for a file of ``size`` bytes, and forbid core dumps."""
    # processor time for gmsh; undamaged files need less than a tenth of it
    least_seconds, seconds_per_mb = 30, 5
    seconds = least_seconds + seconds_per_mb * (size >> 20)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    least_memory, memory_per_byte = 8 << 30, 100  # address space for gmsh
    memory, most = least_memory + memory_per_byte * size, resource.getrlimit(resource.RLIMIT_AS)[1]
    if most == resource.RLIM_INFINITY or memory < most:
        resource.setrlimit(resource.RLIMIT_AS, (memory, most))


def dump(source: str, target: str) -> None:
    """Read a .msh file, and write its arrays, its groups and the first error to an .npz file."""
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.logger.start()
    fault = None
    try:
        gmsh.merge(source)
    except Exception as error:  # gmsh raises no more specific exception
        fault = str(error)
    faults = [line for line in gmsh.logger.get() if line.startswith("Error")]
    if faults and fault is None:
        fault = faults[0].partition(":")[2].strip()
    arrays: dict[str, Any] = {}
    blocks: list[tuple[int, int, list[int], int]] = []
    groups: list[tuple[int, int, str]] = []
    types: dict[int, tuple[str, int]] = {}
    if fault is None:
        for dim in range(4):
            for _, tag in gmsh.model.getPhysicalGroups(dim):
                groups.append((dim, int(tag), gmsh.model.getPhysicalName(dim, tag)))
            for _, entity in gmsh.model.getEntities(dim):
                named = [int(tag) for tag in gmsh.model.getPhysicalGroupsForEntity(dim, entity)]
                kinds, tags, nodes = gmsh.model.mesh.getElements(dim, entity)
                for kind, elements, connectivity in zip(kinds, tags, nodes, strict=True):
                    arrays[f"block_{len(blocks)}"] = connectivity.reshape(len(elements), -1)
                    blocks.append((dim, int(entity), named, int(kind)))
                    properties = gmsh.model.mesh.getElementProperties(kind)
                    types[int(kind)] = (properties[0], int(properties[3]))
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        arrays |= {"tags": tags, "coordinates": coordinates.reshape(-1, 3)}
    about = {"fault": fault, "blocks": blocks, "groups": groups, "types": types}
    # no gmsh.finalize() follows: after an error, gmsh may crash in it
    with open(target, "wb") as file:
        np.savez(file, about=json.dumps(about), **arrays)


if __name__ == "__main__":
    limit(Path(sys.argv[1]).stat().st_size)
    dump(*sys.argv[1:3])
