"""Mesh half of the section of a bolt in a ring, with one stiff head on both, about x = 0.

Volumes are ``bolt``, (0, SHANK)×(0, LENGTH), and ``head``, (0, OUTER)×(LENGTH, LENGTH + HEAD),
which share a curve, and ``ring``, (INNER, OUTER)×(0, LENGTH). Curves are ``bolt_bottom`` and
``ring_bottom`` (y = 0), ``ring_top`` and the coinciding curve ``seat`` under the head, and ``top``.
"""

from pathlib import Path

from meshes.command_line import mesh_parser, write_from
from meshes.naming import name
from meshes.sizes import generate
from perfplast_fenicsx.mesh import gmsh_session

SHANK, INNER, OUTER = 10.0, 11.0, 20.0
"""Radius of the bolt, and radii of the ring (mm)."""

LENGTH, HEAD = 60.0, 20.0
"""Length of the bolt and the ring, and height of the head (mm)."""


def write_bolted_ring(path: str | Path, size: float = 3.0) -> None:
    """Mesh the three bodies and write a .msh file. Not collective.

    Args:
        path: The file to write.
        size: Edge length.
    """
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ

        def loop(corners: list[int], lines: dict[tuple[int, int], int]) -> int:
            around = zip(corners, [*corners[1:], corners[0]], strict=True)
            edges = []
            for a, b in around:
                known = lines.get((b, a))
                lines[a, b] = known if known is not None else occ.addLine(a, b)
                edges.append(lines[a, b] if known is None else -known)
            return int(occ.addPlaneSurface([occ.addCurveLoop(edges)]))

        def points(*places: tuple[float, float]) -> list[int]:
            return [occ.addPoint(*place, 0.0) for place in places]

        lines: dict[tuple[int, int], int] = {}
        low, high = LENGTH, LENGTH + HEAD
        bolt = points((0.0, 0.0), (SHANK, 0.0), (SHANK, low), (0.0, low))
        head = [bolt[3], bolt[2], *points((INNER, low), (OUTER, low), (OUTER, high), (0.0, high))]
        ring = points((INNER, 0.0), (OUTER, 0.0), (OUTER, low), (INNER, low))
        faces = {"bolt": [loop(bolt, lines)], "head": [loop(head, lines)]}
        faces["ring"] = [loop(ring, lines)]
        occ.synchronize()
        name(2, faces)
        curves = {
            "bolt_bottom": (bolt[0], bolt[1]),
            "ring_bottom": (ring[0], ring[1]),
            "ring_top": (ring[2], ring[3]),
            "seat": (head[2], head[3]),
            "top": (head[4], head[5]),
        }
        name(1, {curve: [lines[ends]] for curve, ends in curves.items()})
        generate(2, lambda x, y, z: size, 1)
        gmsh.write(str(path))


def main() -> None:
    """Write the mesh that the command line describes."""
    write_from(mesh_parser(write_bolted_ring, "Mesh a bolt in a ring."), write_bolted_ring)


if __name__ == "__main__":
    main()
