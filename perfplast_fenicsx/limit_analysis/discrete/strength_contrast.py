"""Give advice on bodies that are far stronger, or weaker, than those that bear the loads."""

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import profiles_of_cells
from perfplast_fenicsx.problem.problem import Problem

NOTICED = 1e-3
"""Share of an upper bound that may be rounding without advice."""

RESOLVED = 1e5
"""Ratio of strengths up to which weak bodies are balanced far below 1e-9 of their strength. The
rounding of the strong ones (1e-15) limits this balance.
"""


def strong_bodies(problem: Problem, share: float) -> tuple[str, ...]:
    """Return advice if rounding has a large share of an upper bound; otherwise nothing.

    Collective.
    """
    radii = _radii(problem)
    least, largest = min(radii.values(), default=np.inf), max(radii.values(), default=0.0)
    few = max(RESOLVED * least, NOTICED * largest)
    strong = {name: radius / least for name, radius in radii.items() if radius > few}
    if not strong:
        return ()
    return (
        f"{share:.1%} of the upper bound may come from rounding in the strain of"
        f' {_told(strong)} as strong as the weakest body; make {_them(strong)} law = "elastic"',
    )


def weak_bodies(problem: Problem) -> tuple[str, ...]:
    """Return advice if rounding prevents a lower bound with weak bodies. Collective.

    The result is empty without such bodies.
    """
    radii = _radii(problem)
    largest = max(radii.values(), default=0.0)
    weak = {name: radius / largest for name, radius in radii.items() if RESOLVED * radius < largest}
    if not weak:
        return ()
    return (
        f"{_told(weak)} as strong as the strongest body, which is less than rounding leaves of the"
        f" balance beside that; if {_them(weak)} bears nothing leave it out of the mesh, and if it"
        ' does make the strong ones law = "elastic"',
    )


def _radii(problem: Problem) -> dict[str, float]:
    """Return the least yield radius of each body that has a positive one. Collective.

    Cohesionless sand is not included, as its strength depends on the pressure.
    """
    found, (of_cells, *_) = {}, body_cones(problem).at_cells()
    profile = profiles_of_cells(problem, "below")
    if profile is not None:
        of_cells = of_cells * profile.min(axis=1)
    for name in sorted(problem.tagged_mesh.volumes):
        cells = problem.tagged_mesh.cells(name)
        mine = float(of_cells[cells[cells < len(of_cells)]].min(initial=np.inf))
        radius = problem.comm.allreduce(mine, MPI.MIN)
        if np.isfinite(radius) and radius > 0:
            found[name] = radius
    return found


def _told(ratios: dict[str, float]) -> str:
    """Return a list of bodies in words, with their strength ratios."""
    return ", ".join(f"'{name}', {ratio:.0e} times" for name, ratio in ratios.items())


def _them(ratios: dict[str, float]) -> str:
    """Return "it" for one body, "them" for several."""
    return "it" if len(ratios) == 1 else "them"
