"""Compute resultants of each load: its force and moment at ζ = 1, including supported nodes."""

from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.problem.assembled.declared_loads import work_vector
from perfplast_fenicsx.problem.declared.loads import kind_of
from perfplast_fenicsx.problem.judged.moments import moment
from perfplast_fenicsx.problem.once import once_a_problem
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class LoadResultant:
    """A load as a force and a moment.

    Attributes:
        name: Its name in messages, or the surface or volume where it acts.
        on: Its surface or volume.
        kind: Its kind in case files.
        constant: Whether it acts in full at any load factor.
        force: One number for each direction (force; in the plane per unit of depth, in axisymmetry
            of the full turn).
        moment: Moment about the origin (force × length): three numbers in space, one in the plane,
            an empty array for bodies of revolution.
    """

    name: str
    on: str
    kind: str
    constant: bool
    force: list[float]
    moment: list[float]


def load_resultants(problem: Problem) -> list[LoadResultant]:
    """Return the resultant of each declared load at ζ = 1, in the order of the loads.

    Collective.
    """
    return [found for found, _ in sized_resultants(problem)]


@once_a_problem
def sized_resultants(problem: Problem) -> list[tuple[LoadResultant, float]]:
    """Return each resultant with the sum of the magnitudes of its nodal forces. Collective."""
    found = []
    for load in problem.given.loads:
        work = work_vector(problem.V, problem.tagged_mesh, [load])
        forces = work.array_r.reshape(-1, problem.bodies.gdim).copy()
        work.destroy()
        sums = [problem.comm.allreduce(a) for a in (forces.sum(axis=0), moment(problem, forces))]
        force, turning = ([float(number) for number in one] for one in sums)
        size = problem.comm.allreduce(float(np.linalg.norm(forces, axis=1).sum()))
        name = load.name or load.on
        told = LoadResultant(name, load.on, kind_of(load), load.constant, force, turning)
        found.append((told, size))
    return found
