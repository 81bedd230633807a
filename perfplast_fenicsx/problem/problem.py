"""Define the discrete problem: spaces, supports, loads, contact and forms, and its variants.

This module declares the problem; it does not solve it.

(P)_ζ   minimise J_ζ(v) = Ψ(ε(v)) − L₀(v) − ζL₁(v) over K_h: v = u_D at supports,
        (v_a − v_b)·n ≤ g at contact nodes
"""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints, PairFlags
from perfplast_fenicsx.contact.declared.contact import Contact, Tie
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.contact.formulations.formulation import find_constraints
from perfplast_fenicsx.contact.formulations.tangential_rows import tangential_rows
from perfplast_fenicsx.contact.rows.constraints import Constraints, named, stacked
from perfplast_fenicsx.contact.rows.friction import Friction
from perfplast_fenicsx.contact.rows.jump_basis import JumpBasis, make_basis
from perfplast_fenicsx.contact.rows.loose_bodies import warn_of_loose_motions
from perfplast_fenicsx.contact.rows.rigid_motions import FreeMotions, RigidMotions, held_motions
from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import Rigid, with_stand_ins
from perfplast_fenicsx.materials.law import Material
from perfplast_fenicsx.mesh.connected_bodies import Bodies, body_names, find_bodies
from perfplast_fenicsx.mesh.kinematics import Kinematics
from perfplast_fenicsx.mesh.refinement import check_refinable, refine
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import drop_garbage, lasting
from perfplast_fenicsx.problem.assembled.declared_loads import LoadCase, declared_loads
from perfplast_fenicsx.problem.assembled.glued_rows import glued_rows
from perfplast_fenicsx.problem.assembled.initial_strain import Shanks, initial_strain
from perfplast_fenicsx.problem.assembled.law_on_cells import lay_out
from perfplast_fenicsx.problem.assembled.prescribed_displacement import (
    GivenMotion,
    check_moved_surfaces,
    conditions_at_rest,
    given_motion,
    known_displacements,
)
from perfplast_fenicsx.problem.assembled.rigid_bodies import (
    RigidBodies,
    Supported,
    rigid_bodies,
)
from perfplast_fenicsx.problem.assembled.spaces import Spaces, make_spaces, space_at_points
from perfplast_fenicsx.problem.assembled.spread_forces import on_this_mesh
from perfplast_fenicsx.problem.declared.given import Given, by_kind
from perfplast_fenicsx.problem.declared.initial import Initial
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.supports import RigidSurface, Support, name_of
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.tables import notebook_table


class Problem:
    """Elastic–perfectly plastic bodies with supports, loads, contact and friction.

    Attributes:
        tagged_mesh: The mesh with named bodies and surfaces.
        given: The declared data, with total forces as tractions on this mesh.
        stated_loads: The loads as declared, for results.
        degree: Degree of the displacements, 1 or 2.
        V: Continuous displacements, one vector per node.
        S: Mandel vectors at the quadrature points (:class:`spaces.Spaces`); ``Q`` has scalars at
            these points.
        dx: Measure with this quadrature rule; in axisymmetry it includes the full turn.
        cells: All local cells including ghosts, for `interpolate`, which would otherwise create
            this array at each call.
        bodies: Connected components and their rigid motions.
        laws: The material laws, each on the cells of its bodies.
        initial_strain: e₀, which is subtracted from ε(u) before the laws apply; None without
            initial strain.
        shanks: Shanks of bolts, which strain the bodies when they are tightened.
        bcs: Homogeneous conditions of supports, for increments.
        fixed: Supported components of each local node including ghosts, shape (num_nodes, gdim).
        support_names: Names in results of supports and moved rigid surfaces, without repetition.
        rigid_bodies: Bodies of rigid material that move in levels (:meth:`with_rigid_motions`);
            otherwise None.
        held_by: Index in ``support_names`` of the support or surface that holds each component, −1
            if the component is free; same shape as ``fixed``.
        motion: Prescribed motion of supports and obstacles at any ζ; stages replace it.
        prescribed: u_D (length) at held components, 0 elsewhere, at the ζ of :meth:`move_to`;
            initially 0.
        moved_to: ζ of the last :meth:`move_to`; if ``in_stages`` is True, levels are steps of a
            history.
        contact_tags: Tags of the surfaces of contacts and obstacles.
        num_pairs: Number of contact pairs on all ranks; ``num_tied`` is the number of rows in
            ``ties``.
        ties: The equations B u = 0 of ties, rigid surfaces and, last, guides, in the form of
            contact rows.
        guides: Supports along the normals of their surfaces.
        has_gaps: Whether any pair is initially open; ``interferes`` is True if any gap is negative
            at ζ = 0.
        constraints: The contact inequalities B u ≤ g, a row for each contact pair.
        sliding: The rows of tangential jumps on surfaces with friction.
        friction: Friction in the rows ``sliding``.
        free: Rigid motions that nothing resists, and the nodes at which springs fix them.
        first_active: Initial active set of pairs, with which no body can move freely.
        basis: Basis in which contact is a bound constraint. Its gaps are reduced by the closing
            that u_D and moving obstacles cause at ``moved_to``.
        loads: L₀ and L₁.
        declared: The declared loads.
    """

    def __init__(
        self,
        tagged_mesh: TaggedMesh,
        materials: Mapping[str, Material],
        supports: Sequence[Support | RigidSurface] = (),
        loads: Sequence[Load] = (),
        contacts: Sequence[Contact | Tie] = (),
        obstacles: Sequence[Obstacle] = (),
        degree: int = 1,
        initial: Sequence[Initial] = (),
    ) -> None:
        """Create the problem. Collective.

        Args:
            tagged_mesh: Mesh with named volumes and surfaces.
            materials: Material of each volume; any objects with the protocol :class:`Material`.
            supports: Supports with prescribed displacements, and surfaces that move as rigid
                bodies.
            loads: Loads; constant loads contribute to L₀(v), the others to L₁(v).
            contacts: Pairs of surfaces that cannot penetrate each other or that are tied together.
            obstacles: Rigid bodies that surfaces cannot penetrate.
            degree: 1 for linear displacements as in the paper, or 2 for quadratic displacements,
                which do not lock in plastic flow.
            initial: Changes of temperature, stresses in undeformed bodies, and bolts.

        Raises:
            InputError: If names, materials, loads, contact surfaces or supports do not fit the mesh
                or each other.
        """
        self.tagged_mesh = tagged_mesh
        drop_garbage(self.comm)
        tagged_mesh.check_tagged()
        held, rigid = by_kind("supports", supports, Support, RigidSurface)
        touching, ties = by_kind("contacts", contacts, Contact, Tie)
        given = Given(materials, held, loads, touching, obstacles, degree, initial, ties, rigid)
        given.check(tagged_mesh)
        self.stated_loads = tuple(loads)
        self.given = replace(given, loads=on_this_mesh(tagged_mesh, loads, rigid))
        spaces = make_spaces(tagged_mesh.mesh, degree, self.kinematics)
        self.degree, self.dx = degree, spaces.dx
        self.V, self.S, self.Q = spaces.V, spaces.S, spaces.Q
        topology = tagged_mesh.mesh.topology
        index_map = topology.index_map(topology.dim)
        self.cells = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
        self.bodies: Bodies = find_bodies(self.V, self.kinematics)
        self._lay_out(spaces, materials)
        self._hold(None)

    @classmethod
    def from_given(cls, tagged_mesh: TaggedMesh, given: Given) -> "Problem":
        """Return the problem of declared data, for example of another problem. Collective.

        ``Problem.from_given(problem.tagged_mesh, dataclasses.replace(problem.given, loads=loads))``
        is the problem with other loads. Results then state total forces of the given problem as
        tractions (``stated_loads``).

        Args:
            tagged_mesh: Mesh with named volumes and surfaces.
            given: The declared data.

        Raises:
            InputError: As for a new problem.
        """
        return cls(
            tagged_mesh,
            given.materials,
            [*given.supports, *given.rigid],
            given.loads,
            [*given.contacts, *given.ties],
            given.obstacles,
            given.degree,
            given.initial,
        )

    def _lay_out(self, spaces: Spaces, materials: Mapping[str, Material]) -> None:
        """Create laws, initial strain and shanks at the points of the spaces. Collective."""
        tagged_mesh, given = self.tagged_mesh, self.given
        self.laws = lay_out(tagged_mesh, spaces, materials)
        told = (tagged_mesh, spaces, given.materials, self.laws, given.initial)
        self.initial_strain = initial_strain(*told)
        self.shanks = Shanks(tagged_mesh, spaces, self.laws, given.initial)

    def _hold(self, rigid: Mapping[str, Material] | None) -> None:
        """Create supports, rows, the prescribed motion and loads. Collective.

        Args:
            rigid: Material of each volume, so that bodies whose material is a :class:`Rigid` follow
                rigid motions; None if no body follows rigid motions.
        """
        self.bcs, displacement = self._supports(self.given.holding, rigid)
        given, tagged_mesh = self.given, self.tagged_mesh
        on_mesh = (self.V, tagged_mesh, given, self.fixed)
        told = (displacement, self.rigid_bodies)
        self.ties, self.guides, taken = glued_rows(*on_mesh, *told)
        self.num_tied: int = self.comm.allreduce(len(self.ties.host))
        self.basis: JumpBasis = self._contact(given.contacts, given.obstacles, taken)
        self.motion, self.in_stages = self._motion(displacement), False
        self.prescribed = self.motion.displacement_at(0.0)
        self.move_to(0.0)
        stays = self.initial_strain is not None or self.interferes or self.motion.moves_supports
        acting = (given.loads, self.bcs, given.rigid, self.motion.driven, stays)
        self.loads: LoadCase = declared_loads(self.V, tagged_mesh, *acting)
        self.declared = self.loads
        self.free.check([self.loads.dead, self.loads.live])

    @property
    def has_rigid(self) -> bool:
        """Return whether a body has law = 'rigid'."""
        return any(isinstance(of, Rigid) for of in self.given.materials.values())

    def with_rigid_motions(self) -> "Problem":
        """Return a copy of the problem whose rigid bodies can move in levels. Collective.

        The returned problem is for algorithms that solve levels. Bounds use the rigid bodies of
        the original problem. Without rigid bodies, the method returns the problem itself.

        Raises:
            InputError: If rigid bodies touch each other or obstacles, or if supports do not fit
                rigid motions.
        """
        if not self.has_rigid or self.rigid_bodies is not None:
            return self
        other = copy.copy(self)
        other.__dict__.pop("glued_basis", None)
        points = Spaces(self.degree, self.V, self.S, self.Q, self.dx)
        other._lay_out(points, with_stand_ins(self.given.materials))
        other._hold(self.given.materials)
        return other

    def __repr__(self) -> str:
        topology = self.tagged_mesh.mesh.topology
        return (
            f"Problem({', '.join(sorted(self.tagged_mesh.volumes))};"
            f" {topology.index_map(topology.dim).size_global} cells, P{self.degree},"
            f" {self.num_dofs} dofs, {self.num_pairs} contact pairs)"
        )

    def _repr_html_(self) -> str:
        """Return the declared data as an HTML table."""
        given = self.given
        declared = {
            "support": given.supports,
            "load": self.stated_loads,
            "contact": given.contacts,
            "obstacle": given.obstacles,
            "tie": given.ties,
            "rigid surface": given.rigid,
            "initial": given.initial,
        }
        rows: list[tuple[str, object]] = [("mesh", repr(self))]
        rows += [(f"material of {name}", of) for name, of in given.materials.items()]
        rows += [(kind, one) for kind, every in declared.items() for one in every]
        return notebook_table("Problem", rows)

    def on(self, tagged_mesh: TaggedMesh) -> "Problem":
        """Return the same problem on another mesh with the same names of bodies and surfaces.

        Collective.

        Raises:
            InputError: As for a new problem, or if ``loads`` are not the declared loads.
        """
        if not self.as_declared:
            raise InputError(
                "the loads of the problem were replaced after its declaration, so the problem "
                "cannot be transferred to another mesh; give loads as Pressure, Traction, "
                "BodyForce or PorePressure."
            )
        found = Problem.from_given(tagged_mesh, self.given)
        found.stated_loads = self.stated_loads
        return found if self.rigid_bodies is None else found.with_rigid_motions()

    @property
    def comm(self) -> MPI.Intracomm:
        """Return a communicator of the mesh's ranks, which remains valid without the mesh."""
        return lasting(self.tagged_mesh.mesh.comm)

    @property
    def kinematics(self) -> Kinematics:
        """Return the kinematics, which interprets the coordinates of the mesh."""
        return self.tagged_mesh.kinematics

    @property
    def as_declared(self) -> bool:
        """Return whether ``loads`` are the declared loads and have not been replaced."""
        return self.loads is self.declared

    @property
    def num_dofs(self) -> int:
        """Return the number of displacement unknowns on all ranks, including supported unknowns."""
        return self.V.dofmap.index_map.size_global * self.V.dofmap.index_map_bs

    def space_at_points(self, shape: tuple[int, ...]) -> fem.FunctionSpace:
        """Return the space of values of ``shape`` at the quadrature points; Q or S if they fit.

        Collective.
        """
        for space in (self.Q, self.S):
            if space.value_shape == shape:
                return space
        return space_at_points(self.tagged_mesh.mesh, self.degree, shape)

    @property
    def history(self) -> dict[str, fem.Function]:
        """Return the internal variables of all laws by name, at the points; {} for Hencky's laws.

        The laws use these values from the end of the previous level (:meth:`remember`).
        """
        return {name: function for on in self.laws for name, function in on.old.items()}

    def remember(self, history: Mapping[str, fem.Function]) -> None:
        """Set the history of the laws to ``history``, or to zero if ``history`` is empty."""
        for name, function in self.history.items():
            function.x.array[:] = history[name].x.array if history else 0.0

    def move_to(self, zeta: float) -> None:
        """Move supports and obstacles to their positions at ζ; update gaps and origins of slip."""
        self.moved_to = zeta
        if self.motion.moves_supports or self.motion.driven:
            self.prescribed = self.motion.displacement_at(zeta)
            self.basis = replace(self.basis, gap=self.motion.gap_at(zeta))
        self.friction.origin[:] = self.motion.slide_at(zeta)

    def loaded_at_zero(self) -> bool:
        """Return whether the bodies are loaded or moved at ζ = 0. Collective."""
        moves = self.motion.moves_supports or self.motion.driven or self.interferes
        return moves or self.initial_strain is not None or self.loads.has_dead()

    def is_elastic_at_first(self) -> bool:
        """Return whether states at small ζ are multiples of one elastic state, apart from gaps.

        Collective.
        """
        return not self.loaded_at_zero() and not self.friction.count

    def create_vector(self) -> PETSc.Vec:
        """Return a zero vector with an entry for each displacement unknown. Collective."""
        vector = self.loads.live.duplicate()
        vector.set(0)
        return vector

    def internal_form(self, stress: fem.Function) -> ufl.Form:
        """Return the form ⟨σ, ε(v)⟩."""
        return ufl.dot(stress, self.kinematics.strain(ufl.TestFunction(self.V))) * self.dx

    def _supports(
        self,
        supports: Sequence[Support | RigidSurface],
        materials: Mapping[str, Material] | None,
    ) -> tuple[list[fem.DirichletBC], Floats]:
        """Return the conditions for increments, and u_D: the constant part and the part times ζ."""
        self.fixed, displacement, holder = known_displacements(self.V, self.tagged_mesh, supports)
        self.support_names = tuple(dict.fromkeys(name_of(support) for support in supports))
        self.rigid_bodies: RigidBodies | None = None
        if materials is not None:
            held = Supported(self.fixed, displacement, holder)
            self.rigid_bodies = rigid_bodies(self.V, self.tagged_mesh, materials, held)
        numbers = [self.support_names.index(name_of(support)) for support in supports]
        self.held_by: Ints = np.array([*numbers, -1], dtype=np.int32)[holder]
        return conditions_at_rest(self.V, self.fixed), displacement

    @cached_property
    def glued_basis(self) -> JumpBasis:
        """Return a basis whose last unknowns on each rank are the jumps of ties.

        The first call is collective.
        """
        rows = stacked(self.V, [self.constraints, self.sliding, self.ties])
        return make_basis(self.V, rows, self.fixed)

    @phase("contact set-up")
    def _contact(
        self,
        contacts: Sequence[Contact],
        obstacles: Sequence[Obstacle],
        taken: npt.NDArray[np.bool_],
    ) -> JumpBasis:
        """Create contact rows, friction and free motions, and return the jump basis. Collective."""
        V, tagged_mesh, fixed = self.V, self.tagged_mesh, self.fixed
        solid = () if self.rigid_bodies is None else (self.rigid_bodies.moving,)
        rows = find_constraints(V, tagged_mesh, contacts, obstacles, taken, *solid)
        self.constraints: Constraints = named(self.comm, rows)
        touching = [name for a in contacts for name in (a.primary, a.secondary)]
        touching += [source.on for source in self.constraints.sources if source.on]
        self.contact_tags = tagged_mesh.tags_of(touching)
        self.num_pairs: int = self.comm.allreduce(len(self.constraints.host))
        self.has_gaps: bool = self.comm.allreduce(bool((self.constraints.gap > 0).any()), MPI.LOR)
        told = (contacts, obstacles, self.given.ties, taken, self.guides.held)
        sliding, friction = tangential_rows(V, self.constraints, *told)
        self.sliding: Constraints = sliding
        held = stacked(V, [self.sliding, self.ties])
        motions = RigidMotions(V, self.bodies, fixed, self.constraints, held)
        names = body_names(V, tagged_mesh, self.bodies)
        self.free: FreeMotions = held_motions(V, self.bodies, names, motions)
        rows, flat = stacked(V, [self.constraints, held]), len(self.guides.host)
        warn_of_loose_motions(V, self.bodies, names, fixed, rows, self.free.basis, flat)
        self.first_active: PairFlags = motions.first_active()
        basis = make_basis(V, rows, fixed, len(self.ties.host), len(self.sliding.host))
        self.friction: Friction = friction.at(basis.sliding)
        return basis

    def _motion(self, displacement: Floats) -> GivenMotion:
        """Return the prescribed motion of supports, obstacles and overlaps. Collective."""
        V, (contacts, obstacles) = self.V, (self.given.contacts, self.given.obstacles)
        motion = given_motion(V, displacement, self.constraints, self.sliding, self.friction)
        self.interferes: bool = self.comm.allreduce(bool((motion.gap[0] < 0).any()), MPI.LOR)
        if motion.moves_supports or motion.driven:
            known = (self.constraints, self.fixed, displacement)
            check_moved_surfaces(V, self.tagged_mesh, motion.moves(contacts, obstacles), *known)
        return motion


def variant(
    problem: Problem,
    *,
    materials: Mapping[str, Material] | None = None,
    points: Spaces | None = None,
    rows: tuple[Constraints, Constraints] | None = None,
    basis: JumpBasis | None = None,
    friction: Friction | None = None,
    loads: Sequence[Load] | None = None,
    rubbing: tuple[Sequence[Contact], Sequence[Obstacle]] | None = None,
) -> Problem:
    """Return a problem on the same bodies with other data. Collective.

    The variant keeps the data of the given problem for which no argument is given.

    The variant shares mesh, displacements, supports and contact search with the given problem, but
    no data that levels change. Each variant has its own positions of supports and obstacles, and
    its own slip. The history of its laws starts from zero.

    Args:
        problem: The original problem.
        materials: Material of each volume, as for a new problem.
        points: Spaces with other quadrature points and the same displacements.
        rows: The contact inequalities, and the rows of tangential jumps on surfaces with friction.
        basis: The basis in which the inequalities are bounds; its rows that are not pairs are tied.
        friction: Friction data for the rows of the problem.
        loads: Loads, as for a new problem.
        rubbing: Contacts and obstacles that differ from the problem only in the friction of
            surfaces that already have friction.

    Raises:
        InputError: If materials or loads do not fit the mesh.
    """
    other = copy.copy(problem)
    spaces = points or Spaces(problem.degree, problem.V, problem.S, problem.Q, problem.dx)
    other.S, other.Q, other.dx = spaces.S, spaces.Q, spaces.dx
    if materials is not None:
        other.given = replace(problem.given, materials=materials)
    if materials is not None or points is not None or problem.history:
        other._lay_out(spaces, other.given.materials)
    other.constraints, other.sliding = rows or (problem.constraints, problem.sliding)
    if basis is not None:
        other.basis = basis
        counts = problem.comm.allreduce(np.array([len(basis.index), len(basis.tied)]))
        other.num_pairs, other.num_tied = map(int, counts)
    resisting = friction or problem.friction
    bound, origin = resisting.bound.copy(), resisting.origin.copy()
    other.friction = replace(resisting, bound=bound, origin=origin)
    other.prescribed = problem.prescribed.copy()
    if loads is not None:
        _load(other, loads)
    if rubbing is not None:
        _rub(other, *rubbing)
    return other


def _load(problem: Problem, loads: Sequence[Load]) -> None:
    """Replace the loads of a problem. Collective."""
    tagged_mesh, rigid = problem.tagged_mesh, problem.given.rigid
    found = on_this_mesh(tagged_mesh, loads, rigid)
    problem.stated_loads = tuple(loads)
    problem.given = replace(problem.given, loads=found)
    moved = problem.interferes or problem.motion.moves_supports
    stays = problem.initial_strain is not None or moved
    told = (problem.bcs, rigid, problem.motion.driven, stays)
    problem.loads = problem.declared = declared_loads(problem.V, tagged_mesh, found, *told)
    problem.free.check([problem.loads.dead, problem.loads.live])


def _rub(problem: Problem, contacts: Sequence[Contact], obstacles: Sequence[Obstacle]) -> None:
    """Replace the friction of a problem. Not collective."""
    problem.given = replace(problem.given, contacts=contacts, obstacles=obstacles)
    sources = tuple(
        replace(source, tresca=it.tresca, coulomb=it.coulomb)
        for source, it in zip(problem.constraints.sources, [*contacts, *obstacles], strict=True)
    )
    problem.constraints = replace(problem.constraints, sources=sources)
    friction = problem.friction
    tresca, coulomb = problem.constraints.friction_of(friction.pair)
    adhesion = tresca * friction.area
    bound = adhesion.copy()
    problem.friction = replace(friction, coulomb=coulomb, adhesion=adhesion, bound=bound)


def halved(problem: Problem) -> Problem:
    """Return the problem on a mesh in which all edges are halved. Collective.

    Coincident vertices of bodies in contact remain coincident. The bodies do not change: polygons
    that approximate circles remain polygons.

    Raises:
        InputError: If cells are curved.
    """
    tagged_mesh = problem.tagged_mesh
    check_refinable(tagged_mesh)
    topology = tagged_mesh.mesh.topology
    every = np.ones(topology.index_map(topology.dim).size_local, dtype=np.bool_)
    opposite = opposite_vertices(tagged_mesh, problem.given.contacts)
    return problem.on(refine(tagged_mesh, every, opposite).tagged_mesh)
