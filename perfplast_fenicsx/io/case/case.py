"""Define the content of a case file (TOML): the problem, the loading, and the solver.

A case file defines the bodies by ``[mesh]``, by ``[geometry]``, or by ``[[region]]``,
``[[stratum]]`` and ``[[line]]`` for drawn ground. Other tables are ``[material.NAME]``,
``[[support]]``, ``[[load]]``, ``[gravity]``, ``[earthquake]``, ``[water]``, ``[[combination]]``,
``[design]``, ``[[contact]]``, ``[[obstacle]]``, ``[[tie]]``, ``[[rigid_surface]]``,
``[[temperature]]``, ``[[initial_stress]]``, ``[[bolt]]``, ``[model]``, ``[element]``, ``[solve]``,
``[loading]`` or ``[[stage]]``, ``[output]``, ``[report]`` and ``[units]``; see
``demos/two_blocks.toml``. The dataclass of a table defines its keys.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

from perfplast_fenicsx.contact.declared.contact import Contact, Tie
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.controls.control import Control, Given
from perfplast_fenicsx.io.case.combinations import Combination, weakened
from perfplast_fenicsx.io.case.mesh_table import CaseMesh, GeometryFile, GroundInCase, load_mesh
from perfplast_fenicsx.io.case.scene import Scene
from perfplast_fenicsx.io.case.schema import Table, at
from perfplast_fenicsx.io.case.seepage_table import with_flow
from perfplast_fenicsx.io.case.tables import (
    ElementOptions,
    ModelOptions,
    OutputOptions,
    ReportHead,
)
from perfplast_fenicsx.io.case.water_table import Water
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitMethod, method_for
from perfplast_fenicsx.materials.laws import Material
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.declared.initial import Initial
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.declared.stage import Stage, called
from perfplast_fenicsx.problem.declared.supports import RigidSurface, Support
from perfplast_fenicsx.problem.history.loading_history import LoadingHistory
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.seepage.declared import Seepage
from perfplast_fenicsx.seepage.flow import flow_of, steady_flow
from perfplast_fenicsx.solvers.methods import METHODS
from perfplast_fenicsx.units import Units


@dataclass(frozen=True)
class Case:
    """The content of a case file, after all checks that need no mesh.

    ``text`` is the text of the file, and ``table`` the parsed TOML. If ``trust`` is true, gmsh may
    run scripts. ``loads`` includes the loads of ``water``. ``cracks`` contains the names of all
    sides of cracks.
    """

    path: Path
    text: str = field(repr=False)
    table: Table = field(repr=False)
    title: str
    mesh: CaseMesh
    adapt: Adaptation | None
    materials: dict[str, Material]
    supports: list[Support]
    loads: list[Load]
    seepage: Seepage | None
    contacts: list[Contact]
    obstacles: list[Obstacle]
    ties: list[Tie]
    model: ModelOptions
    rigid: list[RigidSurface]
    element: ElementOptions
    method: str
    options: Any
    conic: str
    loading: Control
    output: OutputOptions
    report: ReportHead
    units: Units
    initial: list[Initial]
    combinations: list[Combination]
    remarks: tuple[str, ...] = ()
    combination: str = ""
    trust: bool = False
    water: Water = field(default_factory=Water)
    cracks: tuple[str, ...] = ()

    @property
    def scene(self) -> Scene:
        """Return the names, loads, contacts and units that pictures show."""
        return Scene(
            self.title,
            self.loads,
            self.contacts,
            self.obstacles,
            self.units,
            axisymmetric=self.model.kind == "axisymmetric",
            driven=self.loading.drives,
        )

    @property
    def stages(self) -> Sequence[Stage]:
        """Return the stages of the loading history; empty if the case has a [loading] table."""
        return self.loading.in_turn()

    def combined(self, combination: Combination) -> "Case":
        """Return the case with the loads and strengths of one combination.

        Raises:
            InputError: If a load is unknown, or if the loads of the combination do not fit the
                control.
        """
        strained = bool(self.initial) or any(a.interference and a.constant for a in self.contacts)
        with at(f"{self.path.name}, [[combination]] '{combination.name}'"):
            movers = (self.obstacles, self.contacts)
            held: list[Support | RigidSurface] = [*self.supports, *self.rigid]
            moving = [called(one) for one in (*held, *self.obstacles) if _moves(one)]
            strains = [getattr(one, "name", "") or one.on for one in self.initial]
            loads = combination.of(self.loads, [*moving, *strains])
            materials, _ = weakened(self.materials, combination.strength)
            given = Given(loads, held, *movers, strained, self.initial, materials)
            self.loading.check(given)
            return replace(
                self,
                title=f"{self.title}: {combination.name}",
                loads=loads,
                materials=materials,
                combinations=[],
                combination=combination.name,
                remarks=(*self.remarks, combination.in_words()),
            )

    def __repr__(self) -> str:
        values = self.loading.values
        ends = "the limit load" if self.loading.prescribes is Prescribed.WORK else "a given motion"
        levels = f"until {ends}" if values is None else f"{len(values)} levels"
        levels = f"{len(self.stages)} stages" if self.stages else levels
        bodies = ", ".join(self.materials)
        return (
            f"Case({str(self.path)!r}: {self.title}; {bodies}; P{self.element.degree};"
            f" {self.method}, {levels})"
        )

    def tagged_mesh(self, comm: MPI.Intracomm) -> TaggedMesh:
        """Return the mesh, which is built or read from a file. Collective.

        Raises:
            InputError: If the builder or file does not exist, if the arguments or the file are not
                valid, or if the mesh cannot be adapted as requested.
        """
        made = isinstance(self.mesh, GeometryFile | GroundInCase)
        with at(f"{self.path.name}, [{'geometry' if made else 'mesh'}]"):
            mesh = load_mesh(comm, self.mesh, self.path, self.contacts, self.trust)
            if self.adapt is not None:
                with at("adapt"):
                    self.adapt.check(mesh)
        with at(f"{self.path.name}, [model]"):
            return self.model.of(mesh)

    def problem(self, comm: MPI.Intracomm) -> Problem:
        """Return the problem of the case, on a mesh that is built or read. Collective.

        Raises:
            InputError: If names, materials, supports, loads or contacts do not fit the mesh.
        """
        tagged_mesh = self.tagged_mesh(comm)
        pairs: list[Contact | Tie] = [*self.contacts, *self.ties]
        named = [name for pair in pairs for name in (pair.primary, pair.secondary)]
        tagged_mesh, left = tagged_mesh.left_glued(named, self.cracks)
        glued = [Tie(*pair) for pair in left]
        with at(self.path.name):
            problem = Problem(
                tagged_mesh,
                self.materials,
                [*self.supports, *self.rigid],
                self.loads_on(tagged_mesh),
                [*pairs, *glued],
                self.obstacles,
                self.element.degree,
                self.initial,
            )
            return problem if self.loading.of_body else problem.with_rigid_motions()

    def loads_on(self, bodies: TaggedMesh | Problem) -> list[Load]:
        """Return the loads, including pore pressures from seepage. Collective.

        Args:
            bodies: The mesh, or a problem of this case, whose known seepage is used again.

        Raises:
            InputError: If the seepage cannot be computed.
        """
        if self.seepage is None:
            return self.loads
        flow = flow_of(bodies.given.loads) if isinstance(bodies, Problem) else None
        if flow is None:
            mesh = bodies.tagged_mesh if isinstance(bodies, Problem) else bodies
            with at("[seepage]"):
                flow = steady_flow(mesh, self.seepage)
        return with_flow(self.loads, flow)

    def history(self, problem: Problem) -> LoadingHistory | None:
        """Return the loading history of the stages; None if the case has no stages. Collective.

        Raises:
            InputError: If the stages do not fit the problem.
        """
        if not self.stages:
            return None
        with at(self.path.name):
            return LoadingHistory(problem, self.stages)

    def solver(self, problem: Problem) -> Any:
        """Return the algorithm that ``[solve]`` selects, for a problem. Collective."""
        return METHODS[self.method].solver(problem, self.options)

    def limit_method(self, problem: Problem) -> LimitMethod | None:
        """Return the method for the limit load of a problem; None if the case gives load levels."""
        if self.loading.limit_tolerance is None:
            return None
        if self.loading.limit_method is not None:
            return LimitMethod(self.loading.limit_method)
        about_a_path = set(self.table.get("solve", {})) - {"conic"}
        by_path = about_a_path or problem.friction.follows_pressure
        return LimitMethod.PATH if by_path else method_for(problem)

    def method_on(self, problem: Problem) -> str:
        """Return the name of the method in results: an algorithm, or the interior point method."""
        direct = self.limit_method(problem) is LimitMethod.INTERIOR_POINT
        return str(LimitMethod.INTERIOR_POINT) if direct else self.method


def _moves(one: Support | RigidSurface | Obstacle) -> bool:
    """Return whether an object has a prescribed motion."""
    return one.moves if isinstance(one, Support | RigidSurface) else any(one.move)
