"""Compute resultants of the forces on the bodies: of loads, supports, obstacles and contact.

Internal forces do no work on rigid motions. The sum of all resultants therefore equals the sum of
the residual at free unknowns, so the resultants balance at a solution. The same holds for moments.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.problem.assembled.declared_loads import work_vector
from perfplast_fenicsx.problem.assembled.prescribed_displacement import GivenMotion
from perfplast_fenicsx.problem.declared.loads import kind_of
from perfplast_fenicsx.problem.once import once_a_problem
from perfplast_fenicsx.problem.problem import Problem


def moment(problem: Problem, forces: Floats) -> Floats:
    """Return the moment of the nodal forces on this rank about the origin. Not collective.

    Args:
        problem: Problem with the nodes.
        forces: Forces on the nodes that this rank owns, shape (num_nodes, gdim).

    Returns:
        Moment about x, y and z in 3D, shape (3,); about z per unit of depth in plane meshes, shape
        (1,); empty for bodies of revolution, shape (0,).
    """
    gdim = problem.bodies.gdim
    if problem.tagged_mesh.axisymmetric:
        return np.zeros(0)
    x = problem.V.tabulate_dof_coordinates()[: len(forces)]
    if gdim == 3:
        found: Floats = np.cross(x, forces).sum(axis=0)
        return found
    return np.atleast_1d((x[:, 0] * forces[:, 1] - x[:, 1] * forces[:, 0]).sum())


@dataclass(frozen=True)
class Resultants:
    """The resultants of the forces on the bodies by source, and the imbalance of their sum.

    Attributes:
        forces: Force of each source, one number for each direction. In plane strain it is per unit
            of depth. In axisymmetry it refers to the full turn; its radial number is the sum of
            outward forces around the axis, not a vector resultant. The sources are ``loads``,
            ``support NAME``, ``rigid surface NAME`` if its motion is prescribed, ``obstacle NAME``
            and ``contact PRIMARY SECONDARY``. The force of a contact acts on the body of the
            primary surface; its sum over both bodies is zero. If two supports hold the same
            component, the force belongs to the first one.
        moments: Moments of ``loads``, ``support NAME`` and ``rigid surface NAME`` about the origin
            (:func:`moment`).
        balance: The larger of two imbalances, relative to the sum of all nodal forces. The first is
            the sum of the forces on the bodies. The second is the sum of their moments about the
            middle of the bodies, divided by the size of the bodies. Axisymmetry uses only the axial
            forces.
        driving: Work of supports, obstacles and growing overlaps on the bodies per unit of ζ: the
            force along each motion, times the motion at ζ = 1.
        driving_by_name: Work of the motion of each name in stages, per unit of its factor.
    """

    forces: Mapping[str, list[float]]
    moments: Mapping[str, list[float]]
    balance: float
    driving: float
    driving_by_name: Mapping[str, float]


def resultants(
    problem: Problem,
    internal: PETSc.Vec,
    contact: Floats,
    friction: Floats,
    zeta: float,
    least: float = 0.0,
) -> Resultants:
    """Return the resultants at a state. Collective.

    Args:
        problem: The bodies, their loads and their supports.
        internal: ⟨σ, ε(·)⟩ in nodal unknowns, including supported ones.
        contact: Forces of the pairs hosted by this rank, shape (num_pairs,).
        friction: Friction forces, shape (num_places, gdim − 1).
        zeta: Load factor.
        least: A smaller sum of nodal forces (force) counts as a rounding error.
    """
    comm, gdim = problem.comm, problem.bodies.gdim
    loads, pushes = problem.create_vector(), problem.create_vector()
    problem.loads.add_all_to(loads, zeta)
    _add_contact(problem, contact, friction, pushes)
    guided: Floats = np.zeros((0, gdim))
    if problem.num_tied:
        guided = _add_ties(problem, internal, zeta, pushes)
    external, pushed, reaction = (
        vector.array_r.reshape(-1, gdim).copy() for vector in (loads, pushes, internal)
    )
    loads.destroy()
    pushes.destroy()
    reaction -= external + pushed
    held_by = problem.held_by[: len(reaction)]
    reaction[held_by < 0] = 0

    names = list(problem.support_names)
    names += [source.name for source in problem.constraints.sources]
    supports, sums = len(problem.support_names), np.zeros((len(names) + 1, gdim))
    for axis in range(gdim):
        held = held_by[:, axis] >= 0
        sums[:supports, axis] = np.bincount(
            held_by[held, axis], reaction[held, axis], minlength=supports
        )
    guides = problem.guides
    of_guides = np.array([names.index(name) for name in guides.names], dtype=np.int64)
    np.add.at(sums, of_guides[guides.number], guided)
    on_pairs = -contact[:, None] * problem.constraints.normal
    np.add.at(sums, supports + problem.constraints.surface, on_pairs)
    places = problem.constraints.surface[problem.friction.pair]
    rubbed = -np.einsum("ni,nij->nj", friction, problem.friction.direction)
    np.add.at(sums, supports + places, rubbed)
    sums[-1] = external.sum(axis=0)
    sums = comm.allreduce(sums)

    forces: dict[str, Floats] = {"loads": np.zeros(gdim)}
    for name, force in zip([*names, "loads"], sums, strict=True):
        forces[name] = forces.get(name, np.zeros(gdim)) + force
    inner = {source.name for source in problem.constraints.sources if source.inner}
    outer = [force for name, force in forces.items() if name not in inner]
    parts = (external, pushed, reaction)
    total = comm.allreduce(sum(float(np.linalg.norm(part, axis=1).sum()) for part in parts))
    total = max(total, least)
    missing = _missing(problem, np.sum(outer, axis=0), external + pushed + reaction)
    pushing = sums[supports:-1]

    def driven(motion: GivenMotion) -> float:
        own = float(np.sum(reaction * motion.displacement[1][: len(reaction)]))
        moved = comm.allreduce(own + float(np.sum(guided * motion.displacement[1][guides.host])))
        spread = comm.allreduce(float(contact @ motion.overlap))
        return moved + spread + float(np.sum(pushing * motion.sources))

    on_guides = guides.host, guided, of_guides[guides.number]
    moments = _moments(problem, external, reaction, on_guides)
    told = {name: [*map(float, force)] for name, force in forces.items()}
    by_name = {name: driven(part) for name, part in problem.motion.parts.items()}
    balance = missing / total if total > 0 else 0.0
    return Resultants(told, moments, balance, driven(problem.motion), by_name)


def _moments(
    problem: Problem, external: Floats, reaction: Floats, on_guides: tuple[Ints, Floats, Longs]
) -> dict[str, list[float]]:
    """Return the moments of the loads and of each support about the origin. Collective.

    Args:
        problem: The bodies.
        external: Nodal forces of the loads, shape (num_nodes, gdim).
        reaction: Nodal forces of the supports, same shape.
        on_guides: Node, force and number of the support for each guide row.
    """
    node, force, support = on_guides
    turning = {"loads": moment(problem, external)}
    for number, name in enumerate(problem.support_names):
        nodal = np.where(problem.held_by[: len(reaction)] == number, reaction, 0.0)
        mine = support == number
        np.add.at(nodal, node[mine], force[mine])
        turning[name] = moment(problem, nodal)
    return {name: problem.comm.allreduce(each).tolist() for name, each in turning.items()}


def _add_contact(problem: Problem, contact: Floats, friction: Floats, forces: PETSc.Vec) -> None:
    """Set ``forces`` to the contact and friction forces on nodes. Collective."""
    rows = problem.constraints.B.createVecLeft()
    rows.array[:] = -contact
    problem.constraints.B.multTranspose(rows, forces)
    rows.destroy()
    if problem.friction.count:
        there = problem.friction.index >= 0
        along = problem.sliding.B.createVecLeft()
        along.array[:] = -friction[there]
        problem.sliding.B.multTransposeAdd(along, forces, forces)
        along.destroy()


def _add_ties(problem: Problem, internal: PETSc.Vec, zeta: float, forces: PETSc.Vec) -> Floats:
    """Add the nodal forces of all rows B u = 0 to ``forces``, also at supports. Collective.

    Returns:
        The forces of guides, one for each guide row.
    """
    left, glued = internal.copy(), problem.ties.B.createVecLeft()
    fem_petsc.set_bc(left, problem.bcs)
    problem.loads.subtract_from(left, zeta)
    along = problem.create_vector()
    problem.glued_basis.T.multTranspose(left, along)
    before = len(problem.constraints.host) + len(problem.sliding.host)
    glued.array[:] = along.array_r[problem.glued_basis.index[before:]]
    problem.ties.B.multTransposeAdd(glued, forces, forces)
    first = len(problem.ties.host) - len(problem.guides.host)
    guided: Floats = (glued.array_r[:, None] * problem.ties.normal)[first:]
    for vector in (left, glued, along):
        vector.destroy()
    return guided


def _missing(problem: Problem, total: Floats, forces: Floats) -> float:
    """Return the larger of the unbalanced force and the unbalanced moment.

    The moment is about the middle of the nodes, divided by the distance of the farthest node from
    the middle. Collective.
    """
    comm, kinematics = problem.comm, problem.kinematics
    x = problem.V.tabulate_dof_coordinates()[: len(forces)]
    middle = comm.allreduce(x.sum(axis=0)) / problem.V.dofmap.index_map.size_global
    arms = x - middle
    farthest = comm.allreduce(float(np.linalg.norm(arms, axis=1).max(initial=0)), MPI.MAX)
    modes = kinematics.rigid_modes(np.asarray(arms / (farthest or 1.0), dtype=np.float64))
    work = comm.allreduce(np.einsum("ni,nim->m", forces, modes))
    at_middle = kinematics.rigid_modes(np.zeros((1, 3)))[0]
    rotations = ~at_middle.any(axis=0)
    felt = np.linalg.norm([total @ at_middle, work * rotations], axis=1)
    return float(felt.max())


@dataclass(frozen=True)
class LoadResultant:
    """The force and the moment of a load.

    Attributes:
        name: Name of the load; by default its surface or volume.
        on: Surface or volume of the load.
        kind: Kind of the load in case files.
        constant: Whether the load acts in full at any load factor.
        force: One number for each direction (force; per unit of depth in plane meshes, for the full
            turn in axisymmetry).
        moment: Moment about the origin (force × length): three numbers in 3D, one number in plane
            meshes, an empty list for bodies of revolution.
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
    """Return, for each load, its resultant and the sum of the magnitudes of its nodal forces.

    Collective.
    """
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
