# %% [markdown]
# # Bounds for tubes and shells whose parts are meshed separately
#
# The bodies are a tube in a tube (plane strain), and half of the section of a shell in a shell
# (axisymmetric). Both parts obey von Mises' law with the shear yield stress k = 1. They are tied,
# or in contact without friction, and an inner pressure acts. The outer body has 1.5 times as many
# edges at the seam as the inner body.
#
# The inner and outer surfaces are polygons with 16 sides in a quarter circle.
#
# - If the seam is also such a polygon, both bodies end at this polygon, and the program divides
#   cells until the facets match. The bodies are then the same as with matching nodes.
# - If the seam is a circle, the edges of each body are chords of this circle. The chords of the two
#   bodies differ, so the bodies overlap in some places and are apart in others. The bounds then
#   hold for a projected model: both bodies end at the polygon through the nodes of both.
#
# The brackets must overlap the brackets for matching nodes and an equal number of cells, and must
# be at most 1.5 times as wide. Tied bodies form one piece for any polygon at the seam.
#
#     ./fenicsx python3 demos/verification/bounds_apart.py

# %%
import time
from collections.abc import Sequence
from itertools import product

from mpi4py import MPI

from demos.verification.bounded_bodies import of_shear
from demos.verification.published import at_most, ends, show_bounds
from demos.verification.slip import subfolder
from demos.verification.study import Row, mesh, run
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    Adaptation,
    Contact,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    Tie,
    adaptive_bounds,
)
from perfplast_fenicsx.io import ResultFolder
from perfplast_fenicsx.limit_analysis import AdaptiveBounds

TITLE = "Bounds of bodies meshed apart"
SEAM, OUTER, SIZE, FINER, SIDES = 1.4, 2.0, 0.1, 1.5, 16
"""Radii of seam and outer surface over the inner radius, edge length at the seam, ratio of the
numbers of edges, and sides in a quarter circle."""
WIDER, QUICK = 1.5, 4.0
"""Largest ratio of the widths of brackets without and with matching nodes, normally and in a quick
run."""
CELLS, FEW = 4000, 400
PAIR = ("inner_tube_seam", "outer_tube_seam")


def bounds(section: TaggedMesh, tied: bool, cells: int) -> AdaptiveBounds:
    """Return strict bounds on an adapted mesh. Collective."""
    supports = [Support("y0", "y")]
    if not section.axisymmetric:
        supports.append(Support("x0", "x"))
    problem = Problem(
        section,
        dict.fromkeys(section.volumes, of_shear(1.0)),
        supports,
        [Pressure("inner", 1.0)],
        [Tie(*PAIR) if tied else Contact(*PAIR)],
        degree=2,
    )
    return adaptive_bounds(problem, Adaptation(1e-5, cells))


def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return brackets for matching nodes and for separately meshed bodies. Collective."""
    rows: list[Row] = []
    cells, size, wider = (FEW, 2 * SIZE, QUICK) if coarse else (CELLS, SIZE, WIDER)
    shape = {"interface": SEAM, "outer": OUTER, "size": size, "sides": SIDES}
    for body, tied, projected in product(("tubes", "shells"), (False, True), (False, True)):
        if coarse and (tied or not projected):
            continue
        found = []
        for finer in (None, FINER):
            seam = {"finer": finer, "round_seam": projected}
            section = mesh(folder, write_thick_tube, **shape, **seam)
            section = section if body == "tubes" else section.turned()
            began = time.perf_counter()
            found.append(bounds(section, tied, cells))
        matching, apart = found
        (below, above), (low, high) = map(ends, found)
        told = [
            ("below, matching above", low, above),
            ("matching below, above", below, high),
            ("width, that of matching", high - low, wider * (above - below)),
        ]
        name = f"{body} {'tied' if tied else 'in contact'}"
        name += ", projected" if projected else ", one polygon"
        rows += at_most(f"{name}, matching", matching, 0.0, [("below, above", below, above)])
        rows += at_most(f"{name}, apart", apart, time.perf_counter() - began, told)
    show_bounds(subfolder(folder, "shells"), "Shells meshed apart", apart)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
