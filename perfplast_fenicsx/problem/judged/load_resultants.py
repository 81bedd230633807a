"""Resultants of each load: its force and moment at ζ = 1, at supported nodes too."""

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
        name: As messages call it, or where it acts.
        on: Its surface or volume.
        kind: As case files call it.
        constant: Whether it acts in full at any load factor.
        force: One number a direction (force; in the plane for each unit of depth, in axisymmetry of
            the full turn).
        moment: About the origin (force × length): three numbers in space, one in the plane, none of
            bodies of revolution.
    """

    name: str
    on: str
    kind: str
    constant: bool
    force: list[float]
    moment: list[float]


def load_resultants(problem: Problem) -> list[LoadResultant]:
    """The resultant of each declared load, at ζ = 1, in the order of the loads. Collective."""
    return [found for found, _ in sized_resultants(problem)]


@once_a_problem
def sized_resultants(problem: Problem) -> list[tuple[LoadResultant, float]]:
    """Return each resultant with the sum of the sizes of its nodal forces. Collective."""
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
