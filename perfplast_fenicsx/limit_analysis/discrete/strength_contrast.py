"""Give advice on bodies that are far stronger, or weaker, or held against their loads."""

from mpi4py import MPI
from petsc4py import PETSc

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


def held_bodies(problem: Problem) -> tuple[str, ...]:
    """Return advice for bodies that cannot deform, if supports hold them against their loads.

    Such a body carries any load, for example a stiff wall whose toe shares nodes with held ground.
    Collective.
    """
    V, comm = problem.V, problem.comm
    gdim, owned = problem.bodies.gdim, V.dofmap.index_map.size_local
    live = problem.loads.live.array_r.reshape(owned, gdim)
    stiff = sorted(problem.tagged_mesh.volumes.keys() - _radii(problem, least=0.0).keys())
    told = []
    for name in stiff:
        inside = problem.create_vector()
        with inside.localForm() as local:
            local.set(0.0)
            nodes = np.unique(V.dofmap.list[problem.tagged_mesh.cells(name)])
            local.array.reshape(-1, gdim)[nodes] = 1.0
        inside.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        mine = inside.array_r.reshape(owned, gdim)[:, 0] > 0
        inside.destroy()
        sums = np.stack([live[mine].sum(axis=0), np.abs(live[mine]).sum(axis=0)])
        force, size = comm.allreduce(sums)
        held = comm.allreduce(problem.fixed[:owned][mine].sum(axis=0)) > 0
        rounding = 1e-9
        against = held & (np.abs(force) > rounding * size.sum())
        axes = [axis for axis, is_so in zip("xyz", against, strict=False) if is_so]
        if axes:
            told.append(
                f"supports hold nodes of '{name}', which does not yield, along {', '.join(axes)}"
                " against its loads; separate it from what they hold by a contact, or end the"
                " supports before its nodes"
            )
    return tuple(told)


def _radii(problem: Problem, least: float = np.finfo(float).tiny) -> dict[str, float]:
    """Return the least yield radius of each body that can yield. Collective.

    Cohesionless sand has a radius of 0, because its strength depends on the pressure.

    Args:
        problem: The bodies.
        least: Smallest radius of a body that counts.
    """
    found, (of_cells, *_) = {}, body_cones(problem).at_cells()
    profile = profiles_of_cells(problem, "below")
    if profile is not None:
        of_cells = of_cells * profile.min(axis=1)
    for name in sorted(problem.tagged_mesh.volumes):
        cells = problem.tagged_mesh.cells(name)
        mine = float(of_cells[cells[cells < len(of_cells)]].min(initial=np.inf))
        radius = problem.comm.allreduce(mine, MPI.MIN)
        if np.isfinite(radius) and radius >= least:
            found[name] = radius
    return found


def _told(ratios: dict[str, float]) -> str:
    """Return a list of bodies in words, with their strength ratios."""
    return ", ".join(f"'{name}', {ratio:.0e} times" for name, ratio in ratios.items())


def _them(ratios: dict[str, float]) -> str:
    """Return "it" for one body, "them" for several."""
    return "it" if len(ratios) == 1 else "them"
