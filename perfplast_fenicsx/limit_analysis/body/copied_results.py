"""Transfer results from one rank's copy of a mesh to the mesh that all ranks share."""

from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.body.flow_problem import FlowProblem
from perfplast_fenicsx.limit_analysis.body.parts_of_cells import by_cells, of_parts
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.stress.static_stress import StaticBound
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.mesh.whole_mesh import WholeMesh, to_owners


@dataclass(frozen=True)
class Copied:
    """A mesh that ranks share, and this rank's copy of the mesh."""

    shared: TaggedMesh
    copy: WholeMesh

    def limit(
        self, root: int, flow: FlowProblem, own: FlowProblem | None, found: LimitLoad | None
    ) -> LimitLoad | None:
        """Return a limit load with its mechanism and its stress, but without forces of pairs.

        Collective.

        Args:
            root: The rank with the result.
            flow: The flow problem on the shared mesh.
            own: The flow problem on the copy; ``found`` exists only on the root.
            found: The result on the root; ignored on other ranks.

        Returns:
            The same result on every rank; None if nothing was found.
        """
        told, rows = None, dict[str, npt.NDArray]()
        if self._comm.rank == root and own is not None and found is not None:
            fields = {"mechanism": found.mechanism, "stress": found.stress}
            rows = {name: _rows(it, own) for name, it in fields.items() if it is not None}
            told = vars(found) | dict.fromkeys((*fields, "contact_forces"))
        told = self._comm.bcast(told, root)
        if told is None:
            return None
        rows = to_owners(self.shared, self.copy, root, rows)
        problem = flow.problem
        spaces = {"mechanism": problem.V, "stress": problem.S}
        fields = {name: _function(flow, spaces[name], name, it) for name, it in rows.items()}
        return LimitLoad(**(told | fields))

    def stress(self, root: int, found: StaticBound | None) -> StaticBound:
        """Return a lower bound with its stress. The rank with the result.

        Args:
            root: The rank that has found it.
            found: The result on the root; ignored on other ranks.
        """
        told, rows = dict[str, Any](), dict[str, npt.NDArray]()
        if self._comm.rank == root and found is not None:
            rows = {"stress": found.stress, "dissipation": found.dissipation}
            told = vars(found) | dict.fromkeys(rows)
        told = self._comm.bcast(told, root)
        return StaticBound(**(told | to_owners(self.shared, self.copy, root, rows)))

    @property
    def _comm(self) -> MPI.Intracomm:
        return self.shared.mesh.comm


def _rows(function: fem.Function, own: FlowProblem) -> Floats:
    """Return values at the nodes or points of each cell or part, shape (num_cells, ...)."""
    dofmap = function.function_space.dofmap
    values: Floats = function.x.array.reshape(-1, dofmap.index_map_bs)[dofmap.list]
    return values if own.split is None else by_cells(values, own.split)


def _function(
    flow: FlowProblem, space: fem.FunctionSpace, name: str, rows: npt.NDArray
) -> fem.Function:
    """Return a function with the given values. Collective."""
    function, dofmap = fem.Function(space, name=name), space.dofmap
    values = rows if flow.split is None else of_parts(rows, flow.split)
    function.x.array.reshape(-1, dofmap.index_map_bs)[dofmap.list[: len(values)]] = values
    function.x.scatter_forward()
    return function
