"""The limit load as that of linear stresses in equilibrium: a lower bound of the body's."""

from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.limit_analysis.conic.conic_program import ConicProgram, Stress
from perfplast_fenicsx.limit_analysis.conic.discretisation import Discretisation
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.discrete.friction_points import (
    FrictionStiffness,
    FrictionStrains,
    SlipPlaces,
)
from perfplast_fenicsx.limit_analysis.facets.bare_vertices import bare_vertices
from perfplast_fenicsx.limit_analysis.facets.facet_conditions import FacetConditions
from perfplast_fenicsx.limit_analysis.facets.facet_loads import FacetLoads
from perfplast_fenicsx.limit_analysis.facets.facet_velocities import FacetVelocities
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.limit_analysis.stress.condensed_stiffness import CondensedStiffness
from perfplast_fenicsx.limit_analysis.stress.multiplier_strains import MultiplierStrains
from perfplast_fenicsx.limit_analysis.stress.stress_form import StressForm
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class StaticProgram:
    """A conic program with what its unknowns mean.

    Attributes:
        program: Its velocities are the multipliers of the equilibrium of stresses.
        strains: Of the cells, whose points are the program's first ones; places of slip follow.
        stiffness: Of the cells; the program's has places of slip too.
        areas: Area that each node of an owned facet stands for, shape (num_facets, num_nodes).
        sections: An area of each cell that forces in it are measured by, V^((d − 1)/d).
        load: L before it was scaled, in the user's units.
        dead: L₀, the same.
        free: Loads of any factor, the same.
        jumps: Whether an owned facet unknown is a jump of contact, shape (num_unknowns,).
        pressed: Those of the vertices, on the axis too, where there is no pressure.
        slips: Whether it is a tangential one on a surface in contact that does not rub.
    """

    program: ConicProgram
    strains: MultiplierStrains
    stiffness: CondensedStiffness
    areas: Floats
    sections: Floats
    load: Floats
    dead: Floats
    free: Floats
    jumps: npt.NDArray[np.bool_]
    pressed: npt.NDArray[np.bool_]
    slips: npt.NDArray[np.bool_]

    def loads(self, load: float, aside: float) -> Floats:
        """All loads, in the user's units.

        Args:
            load: λ.
            aside: Factor of the loads of any factor.
        """
        return load * self.load + self.dead + aside * self.free

    def loaded(self, load: float, aside: float) -> float:
        """The sum of the magnitudes of all loads, each kind by itself, on this rank.

        Args:
            load: λ.
            aside: Factor of the loads of any factor.
        """
        kinds = (load * self.load, self.dead, aside * self.free)
        return float(sum(np.abs(kind).sum() for kind in kinds))

    def can_carry(self) -> bool:
        """Whether any stress is in equilibrium with the loads, pulling contact too. Collective.

        In the plane tractions on both sides of a corner may leave the one cell there no stress. In
        space the four parts of a cell carry all balanced linear tractions on its facets
        (:mod:`stress_cells`), so that nothing has to be asked. Where vertices are bare, rows depend
        on each other too much for an answer by refinement, and it is left to the iteration.

        Asked after :func:`natural_units.choose_units`, whose factors are used.
        """
        bare = bool(self.strains.idle.any())
        if self.strains.gdim == 3 or self.program.comm.allreduce(bare):
            return True
        program = self.program
        flow, left, more = (program.create_vector() for _ in range(3))
        program.load.copy(left)
        largest = PETSc.NormType.NORM_INFINITY
        whole, missing = program.load.norm(largest), np.inf
        # Share of the loads that, where it is left, no stress can carry; of a
        # shear beside a free side it is a half.
        least_missing = 1e-2
        # Of a flow: slender bodies move so far that some of their loads goes into the ridge of K.
        most_refinements = 10
        # Share of what was left before a refinement, above which it has not helped.
        refined = 0.9
        for _ in range(most_refinements):
            program.stiffness.solve(left, more)
            flow.axpy(1.0, more)
            pressure, deviator = program.viscous_stress(flow)
            program.internal_forces(pressure, deviator, left)
            left.array[program.jumps] += program.springs * flow.array_r[program.jumps]
            left.aypx(-1.0, program.load)
            before, missing = missing, left.norm(largest) / whole
            if missing <= least_missing or not missing < refined * before:
                break
        for vector in (flow, left, more):
            vector.destroy()
        return bool(missing <= least_missing)

    def unbalanced(self, stress: Stress, load: float, aside: float) -> float:
        """Largest force that nothing balances, relative to the strengths at its row. Collective.

        Contact that pushes is balanced, and contact that pulls is not.

        Args:
            stress: In the user's units.
            load: λ.
            aside: Factor of the loads of any factor.
        """
        left = self.strains.create_vector()
        self.program.strains.forces(*stress, left)
        forces = left.array_r - self.loads(load, aside)
        left.destroy()
        on_jumps = np.append(self.jumps, np.zeros(len(forces) - len(self.jumps), dtype=bool))
        forces = np.where(on_jumps, np.maximum(forces, 0.0), np.abs(forces))
        mine = float((forces / self.forces_of_strengths(stress[0])).max(initial=0.0))
        return float(self.program.comm.allreduce(mine, MPI.MAX))

    def forces_of_strengths(self, pressure: Floats) -> Floats:
        """Force in each row of equilibrium that is as large as the strength of what it is of.

        Yield radii of all cells at a facet count, the least one most, and none as more than the
        program's unit; that of bodies in contact too. Where all of these are elastic it is the
        least radius of all cells, as what judges the stress has it. Without cohesion the stress has
        its own strength there. Collective.

        Args:
            pressure: Of the stress, in the user's units.
        """
        strains, tdim = self.strains, self.strains.gdim
        inverse = strains.weaknesses(pressure)
        everywhere = self.program.comm.allreduce(float(inverse.max(initial=0.0)), MPI.MAX)
        least = 1 / self.program.stress_unit
        met = strains.facets.meet(np.repeat(inverse[:, None], strains.layout.outer, axis=1))
        around = strains.facets.gather(met).max(axis=1)
        weakness, inside = (
            np.where(sums > 0, np.maximum(sums, least), max(everywhere, least))
            for sums in (met, np.where(inverse > 0, inverse, around))
        )
        on_facets = np.repeat(self.areas.ravel(), tdim) / weakness
        in_cells = self.sections / inside
        return np.concatenate([on_facets, np.repeat(in_cells, strains.layout.inner)])


def static_program(
    problem: Problem, conditions: FacetConditions, question: Question, reserve: float
) -> StaticProgram:
    """Put the program together. Collective.

    Args:
        problem: The bodies and their loads.
        conditions: On facets.
        question: Of which loads the factor is sought.
        reserve: See :class:`ConicProgram`.

    Raises:
        InputError: If a body has a yield set that bounds do not know.
    """
    mesh, at = problem.tagged_mesh.mesh, conditions
    tdim, on = mesh.topology.dim, conditions.numbers.facets
    form = StressForm.of(problem, at)
    followers = at.rigid.followers(problem.comm, at.numbers, at.vertices, form.nodes)
    facets = FacetVelocities(mesh, at.numbers, form.twins.ravel(), form.nodes, followers)
    size = form.nodes * tdim
    axes = np.where(at.held[:, :, None], 0.0, at.axes)[on]
    turned, cones = problem.tagged_mesh.axisymmetric, body_cones(problem)
    bare = bare_vertices(problem, at, (cones.at_cells()[0] == 0) & (not turned))
    strains = MultiplierStrains(facets, at.vertices, axes, cones, bare, turned)

    num_owned = facets.count // (form.nodes * tdim)
    everywhere = np.zeros((num_owned, form.nodes, tdim), dtype=bool)
    jumps, slips, held = everywhere.copy(), everywhere.copy(), everywhere
    jumps[at.hosts, :, 0] = True
    slips[at.in_contact, :, 1:] = True
    slips[at.rubbing] = False
    on_axis = form.areas[:num_owned] == 0
    held[:] = at.held[:num_owned, None] | on_axis[..., None]
    held[at.rigid.surface[:num_owned] >= 0] = True
    lead = at.rigid.lead - mesh.topology.index_map(tdim - 1).local_range[0]
    mine = np.flatnonzero((lead >= 0) & (lead < num_owned))
    lead, unknowns = lead[mine], at.rigid.free.shape[1]
    held.reshape(num_owned, size)[lead, :unknowns] = at.rigid.free[mine] == 0
    pressed = jumps.copy()
    pressed[:, tdim:] = False
    jumps &= ~on_axis[..., None]
    moves, parts_freely = _idle(strains)
    pushes = jumps.ravel() & moves & ~parts_freely
    open_jumps = np.flatnonzero(pushes).astype(np.int32)
    still = np.flatnonzero(held.ravel() | ~moves | (jumps.ravel() & ~pushes)).astype(np.int32)
    stiffness = CondensedStiffness(strains, still, open_jumps)

    places = _slip_places(at, form.areas)
    both = FrictionStrains(strains, places)
    rubs = problem.comm.allreduce(len(places.area)) > 0

    def vector(loads: FacetLoads) -> PETSc.Vec:
        tractions = np.take_along_axis(loads.tractions[on], at.numbers.places[..., None], axis=2)
        pushes = np.einsum("cfik,cfjk->cfji", axes, form.pushes(tractions, loads))
        load = strains.create_vector()
        load.array[: facets.count] = facets.add_up(pushes.reshape(len(on), -1))
        at_leads = load.array[: facets.count].reshape(-1, size)
        at_leads[lead, :unknowns] += loads.resultants[mine]
        strains.inner(load.array)[:] = form.forces(loads)
        return load

    areas = form.measures[:num_owned].copy()
    areas[lead] = at.rigid.area[mine, None] / tdim
    load, dead, free = question.loads(vector(at.live), vector(at.dead))
    unscaled = [of.array_r.copy() for of in (load, dead, free)]
    return StaticProgram(
        program=ConicProgram(
            Discretisation(
                problem.comm,
                both if rubs else strains,
                FrictionStiffness(stiffness, both, strains.count) if rubs else stiffness,
                load,
                dead,
                free,
                open_jumps,
                proves_stress=True,
            ),
            reserve,
        ),
        strains=strains,
        stiffness=stiffness,
        areas=areas,
        sections=form.sections,
        load=unscaled[0],
        dead=unscaled[1],
        free=unscaled[2],
        jumps=jumps.ravel(),
        pressed=pressed.ravel(),
        slips=slips.ravel() & ~held.ravel(),
    )


def _idle(strains: MultiplierStrains) -> tuple[PairFlags, PairFlags]:
    """What bare vertices leave of the owned facets' unknowns. Collective.

    Returns:
        Whether any stress is in the row of each; whether one side of a jump has none, so that
        nothing presses there.
    """
    facets, busy = strains.facets, ~strains.idle[:, : strains.layout.outer]
    if not facets.vector.comm.tompi4py().allreduce(bool(strains.idle.any())):
        return np.ones(facets.count, dtype=bool), np.zeros(facets.count, dtype=bool)
    sizes = busy.astype(np.float64)
    alone = facets.meet(sizes, across=False) == 0
    either = facets.meet(facets.gather(alone.astype(np.float64)), across=False) > 0
    return facets.meet(sizes) > 0, either


def _slip_places(at: FacetConditions, areas: Floats) -> SlipPlaces:
    """Nodes of the host facets that adhere, whose shear tractions the adhesion bounds.

    Args:
        at: Conditions on facets.
        areas: What each node of each stands for; 0 on an axis, where there is no traction.
    """
    tdim, nodes = at.held.shape[1], areas.shape[1]
    facets = at.hosts[at.adhesion[at.hosts] > 0]
    which = np.flatnonzero(areas[facets] > 0)
    of, places = facets[which // nodes], which % nodes
    first = (of * nodes + places) * tdim
    shares = np.eye(tdim - 1) * ~at.held[of, None, 1:]
    area: Floats = areas[of, places]
    index = (first[:, None] + np.arange(1, tdim)).astype(np.int32)
    return SlipPlaces(index, shares, area, at.adhesion[of] * area)
