"""Apply the stages of a loading history to a problem: loads, motions and e₀ at a given time.

ζ is the time, which grows by 1 in each stage. In the stage that starts at ζ = k, each factor f_i
changes linearly from a_i to b_i. With the loads ℓ_i at factor 1 and the constant loads L_c,

    L₀ + ζL₁ = L_c + Σ (a_i + (ζ − k)(b_i − a_i)) ℓ_i,    L₁ = Σ (b_i − a_i) ℓ_i,

so a level solves (P)_ζ like any other level. The same holds for u_D and the gaps of moving objects.
α = L₁(u) is the work of the load changes in the stage.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.problem.assembled.declared_loads import LoadCase, work_vector
from perfplast_fenicsx.problem.assembled.initial_strain import initial_strain
from perfplast_fenicsx.problem.assembled.prescribed_displacement import (
    GivenMotion,
    given_motion,
    known_displacements,
)
from perfplast_fenicsx.problem.assembled.spaces import Spaces
from perfplast_fenicsx.problem.declared.initial import Bolt, Initial, Temperature
from perfplast_fenicsx.problem.declared.stage import Stage, called, check_stages, follows
from perfplast_fenicsx.problem.declared.supports import AXES, RigidSurface, Support
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import ROUNDING


def named_motions(problem: Problem) -> dict[str, GivenMotion]:
    """Return, for each name, the prescribed motion that its factor multiplies. Collective.

    Raises:
        InputError: If a support moves along its normal, or if one component of a node follows two
            names.
    """
    V, given = problem.V, problem.given
    supports = given.holding
    for support in supports:
        if isinstance(support, Support) and support.guides and follows(support):
            raise InputError(
                f"the support on '{support.on}' moves along its normal, which stages do not "
                "support; give control = 'displacement', constant = true, or letters as "
                "components."
            )
    _, values, holder = known_displacements(V, problem.tagged_mesh, supports)
    _check_parted(problem, supports, values[1] != 0, holder)
    followers = [called(one) if follows(one) else None for one in supports]
    others = (*given.obstacles, *given.contacts)
    names = [*followers, *(called(one) for one in others if follows(one))]
    rows = (problem.constraints, problem.sliding, problem.friction)
    parts = {}
    for name in dict.fromkeys(name for name in names if name is not None):
        mine = np.array([*(follower == name for follower in followers), False])  # -1: no holder
        moved = np.where(mine[holder], values[1], 0.0)
        sources = [
            one if one.called == name else replace(one, move=(), grows=False)
            for one in problem.constraints.sources
        ]
        both = np.stack([np.zeros_like(moved), moved])
        parts[name] = given_motion(V, both, *rows, sources)
    return parts


def in_stage(
    constant: GivenMotion,
    parts: Mapping[str, GivenMotion],
    first: Mapping[str, float],
    rate: Mapping[str, float],
) -> GivenMotion:
    """Return the motion in a stage, in which the factor of each name is first + ζ · rate.

    Args:
        constant: The motion of the problem; the function uses only its part without ζ.
        parts: See :func:`named_motions`.
        first: Factors by name, extrapolated to ζ = 0.
        rate: Growth of the factors with ζ, by name.
    """
    displacement = np.stack([constant.displacement[0], np.zeros_like(constant.displacement[0])])
    gap = np.stack([constant.gap[0], np.zeros_like(constant.gap[0])])
    slide = np.stack([constant.slide[0], np.zeros_like(constant.slide[0])])
    sources, overlap = np.zeros_like(constant.sources), np.zeros_like(constant.overlap)
    for name, part in parts.items():
        both = np.array([first[name], rate[name]])
        displacement += np.multiply.outer(both, part.displacement[1])
        gap += np.multiply.outer(both, part.gap[1])
        slide += np.multiply.outer(both, part.slide[1])
        sources += rate[name] * part.sources
        overlap += rate[name] * part.overlap
    return replace(
        constant,
        displacement=displacement,
        gap=gap,
        slide=slide,
        sources=sources,
        overlap=overlap,
        parts=parts,
    )


def _check_parted(
    problem: Problem,
    supports: Sequence[Support | RigidSurface],
    moved: npt.NDArray[np.bool_],
    holder: Ints,
) -> None:
    """Refuse moving supports with different names that hold the same component of a node.

    Collective.
    """
    mesh, message = problem.tagged_mesh, None
    fdim, gdim = mesh.mesh.topology.dim - 1, mesh.mesh.geometry.dim
    for support in supports:
        if not follows(support):
            continue
        nodes = fem.locate_dofs_topological(problem.V, fdim, mesh.facets(support.on))
        for axis in support.axes(gdim):
            theirs = holder[nodes, axis][moved[nodes, axis]]
            others = {called(supports[i]) for i in np.unique(theirs)}
            for other in sorted(others - {called(support)}):
                message = (
                    f"the supports '{other}' and '{called(support)}' hold the same nodes along "
                    f"{AXES[axis]}, but stages could move the supports differently; give both "
                    "supports the same name, or separate their surfaces."
                )
    raise_together(problem.comm, message)


class LoadingHistory:
    """Sets the loads, the motion and e₀ of a problem for any time in the stages.

    Attributes:
        problem: The problem that is loaded.
        stages: The stages in order.
    """

    def __init__(self, problem: Problem, stages: Sequence[Stage]) -> None:
        """Assemble the load vector and the initial strain for each name. Collective.

        Raises:
            InputError: If the stages do not fit the loads and motions.
        """
        given = problem.given
        movers = [*given.holding, *given.obstacles, *given.contacts]
        check_stages(stages, given.loads, given.initial, movers)
        self.problem, self.stages = problem, tuple(stages)
        problem.in_stages = True
        names = dict.fromkeys(name for stage in stages for name in stage.factors)
        self._vectors: dict[str, PETSc.Vec] = {}
        self._strains: dict[str, Floats] = {}
        self._cases: dict[int, LoadCase] = {}
        self._at_rest = problem.motion
        self._motions = named_motions(problem)
        for name in names:
            loads = [load for load in given.loads if called(load) == name]
            if loads:
                self._vectors[name] = work_vector(problem.V, problem.tagged_mesh, loads)
            warmed = [a for a in given.initial if isinstance(a, Temperature) and called(a) == name]
            if warmed:
                self._strains[name] = self._strain(warmed)
        bolts = [one for one in given.initial if isinstance(one, Bolt)]
        self._preloads = {bolt.called: bolt.preload for bolt in bolts if bolt.called in names}
        problem.shanks.anew = tuple(self._preloads)
        constant = [load for load in given.loads if load.constant]
        self._constant = work_vector(problem.V, problem.tagged_mesh, constant)
        rest = [a for a in given.initial if isinstance(a, Temperature) and called(a) in names]
        others = [one for one in given.initial if one not in rest]
        self._first_strain = self._strain(others) if others else None

    def times(self) -> Iterator[float]:
        """Yield the times of all levels, except the level at rest."""
        for k, stage in enumerate(self.stages):
            for step in range(1, stage.steps + 1):
                yield k + step / stage.steps

    def rests_first(self) -> bool:
        """Return whether a load, a motion or a strain acts before the first stage.

        Collective.
        """
        problem = self.problem
        strained = self._first_strain is not None
        settled = bool(self._at_rest.displacement[0].any())
        moved = problem.comm.allreduce(settled, MPI.LOR) or problem.interferes or strained
        return moved or float(self._constant.norm()) > 0

    def number(self, time: float) -> int:
        """Return the number of the stage at a time, from 0; a stage includes its end."""
        return min(max(math.ceil(time - ROUNDING) - 1, 0), len(self.stages) - 1)

    def label(self, time: float) -> str:
        """Return the name of the stage at a time for results; empty at rest."""
        k = self.number(time)
        return (self.stages[k].name or f"stage {k + 1}") if time > 0 else ""

    def factors(self, time: float) -> dict[str, float]:
        """Return the factors at a time, by name."""
        k = self.number(time)
        before, after = self._at_end(k - 1), self._at_end(k)
        share = time - k
        return {name: (1 - share) * before[name] + share * after[name] for name in after}

    def tightened(self, time: float) -> dict[str, float]:
        """Return the forces to which the stage at a time tightens bolts, by name."""
        factors, stage = self.factors(time), self.stages[self.number(time)]
        named = [name for name in self._preloads if name in stage.factors and time > 0]
        return {name: factors[name] * self._preloads[name] for name in named}

    def check_start(self, time: float) -> None:
        """Refuse to continue from a time at which bolts have been tightened again.

        Raises:
            InputError: If a stage up to this time has tightened a bolt: results do not store the
                shortening of the shanks.
        """
        begun = self.stages[: self.number(time) + 1] if time > 0 else ()
        for name in self._preloads:
            if any(name in stage.factors for stage in begun):
                raise InputError(
                    f"the bolt '{name}' is tightened again in this or an earlier stage, so a run"
                    " cannot continue from this level; run the case from its beginning, with"
                    " --force."
                )

    def works(self, u: PETSc.Vec) -> dict[str, float]:
        """Return the work ℓ_i(u) of the loads of each name. Collective."""
        return {name: float(vector.dot(u)) for name, vector in self._vectors.items()}

    def go_to(self, time: float) -> None:
        """Set the loads and motion of the problem for the stage at a time, and e₀ for the time.

        Collective.
        """
        problem, k = self.problem, self.number(time)
        if k not in self._cases:
            self._cases[k] = self._case(k)
        problem.loads = self._cases[k]
        if self._motions:
            problem.motion = in_stage(self._at_rest, self._motions, *self._lines(k))
        e0 = problem.initial_strain
        if e0 is not None:
            now = self.factors(time)
            e0.x.array[:] = problem.shanks.strain()
            e0.x.array[:] += 0.0 if self._first_strain is None else self._first_strain
            for name, strain in self._strains.items():
                e0.x.array[:] += now[name] * strain

    def _case(self, k: int) -> LoadCase:
        """Return the loads of stage ``k``. Collective."""
        first, rate = self._lines(k)
        dead, live = self._constant.copy(), self.problem.create_vector()
        for name, vector in self._vectors.items():
            dead.axpy(first[name], vector)
            live.axpy(rate[name], vector)
        return LoadCase.of(dead, live, self.problem.bcs)

    def _lines(self, k: int) -> tuple[dict[str, float], dict[str, float]]:
        """Return factors of stage ``k`` by name, extrapolated to ζ = 0, and their growth with ζ."""
        before, after = self._at_end(k - 1), self._at_end(k)
        rate = {name: after[name] - before[name] for name in after}
        return {name: before[name] - k * rate[name] for name in after}, rate

    def _at_end(self, k: int) -> Mapping[str, float]:
        """Return the factors at the end of stage ``k``; for k = −1 they are 0, for bolts 1."""
        factors = dict.fromkeys((name for a in self.stages for name in a.factors), 0.0)
        factors |= dict.fromkeys(self._preloads, 1.0)
        for stage in self.stages[: k + 1]:
            factors |= stage.factors
        return factors

    def _strain(self, given: Sequence[Initial]) -> Floats:
        """Return the initial strain of given declarations, as values at the quadrature points."""
        problem = self.problem
        spaces = Spaces(problem.degree, problem.V, problem.S, problem.Q, problem.dx)
        materials = problem.given.materials
        strain = initial_strain(problem.tagged_mesh, spaces, materials, problem.laws, given)
        assert strain is not None
        return np.array(strain.x.array)
