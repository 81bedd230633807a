"""E, the unit of cost: one solution of linear elasticity on the same mesh by the same multigrid.

This module uses none of the program's solvers, so that E does not change when they improve.
"""

import gc
import time
from collections.abc import Sequence
from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx import Problem, Support, VonMises

RTOL = 1e-8

GAMG = {
    "ksp_type": "cg",
    "ksp_norm_type": "unpreconditioned",
    "ksp_max_it": 1000,
    "pc_type": "gamg",
    "pc_gamg_threshold": 0.01,
    "pc_gamg_aggressive_coarsening": 1,
    "pc_gamg_coarse_eq_limit": 1000,
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 3,
    "mg_levels_pc_type": "jacobi",
    "mg_levels_esteig_ksp_type": "cg",
    "mg_levels_ksp_chebyshev_esteig": "0,0.1,0,1.05",
    "mg_coarse_pc_type": "redundant",
    "mg_coarse_redundant_pc_type": "cholesky",
}


@dataclass(frozen=True)
class Unit:
    """The cost of one solution of linear elasticity.

    Attributes:
        allocation: Time (s) for the sparsity pattern and the memory of the matrix; not part of E.
        assembly: Time (s) to assemble the matrix.
        setup: Time (s) to set up the multigrid.
        solve: Time (s) of the conjugate gradient iterations.
        iterations: Number of conjugate gradient iterations.
        compliance: L(u), which shows that the right problem was solved.
    """

    allocation: float
    assembly: float
    setup: float
    solve: float
    iterations: int
    compliance: float

    @property
    def seconds(self) -> float:
        """Return E (s)."""
        return self.assembly + self.setup + self.solve


class Elasticity:
    """Linear elasticity without contact, on the mesh and with the supports of a problem."""

    def __init__(
        self, problem: Problem, material: VonMises, extra_supports: Sequence[Support] = ()
    ) -> None:
        """Compile the forms of stiffness and load. Collective.

        Args:
            problem: The problem with the mesh, elements, supports and loads to use.
            material: Material of all bodies; its yield stress is not used.
            extra_supports: Supports that are added to those of the problem.
        """
        V = problem.V
        gdim = V.mesh.geometry.dim
        u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
        e = ufl.sym(ufl.grad(u))
        lame, shear = material.bulk - 2 * material.shear / 3, material.shear
        stress = lame * ufl.tr(e) * ufl.Identity(gdim) + 2 * shear * e
        self._a = fem.form(ufl.inner(stress, ufl.sym(ufl.grad(v))) * problem.dx)
        self._bcs = list(problem.bcs)
        zero = default_scalar_type(0)
        for support in extra_supports:
            facets = problem.tagged_mesh.facets(support.on)
            for axis in support.axes(gdim):
                dofs = fem.locate_dofs_topological(V.sub(axis), gdim - 1, facets)
                self._bcs.append(fem.dirichletbc(zero, dofs, V.sub(axis)))
        self._load = problem.loads.live
        self._V = V

    def measure(self) -> Unit:
        """Assemble, set up and solve once, starting from zero. Collective.

        Raises:
            RuntimeError: If CG does not converge.
        """
        comm = self._V.mesh.comm
        times = []

        def clock() -> None:
            comm.Barrier()
            times.append(time.perf_counter())

        clock()
        A = fem_petsc.create_matrix(self._a)
        clock()
        fem_petsc.assemble_matrix(A, self._a, self._bcs)  # type: ignore[arg-type]
        A.assemble()
        b = self._load.copy()
        fem_petsc.set_bc(b, self._bcs)
        clock()
        A.setOption(PETSc.Mat.Option.SPD, True)
        modes = self._rigid_motions()
        A.setNearNullSpace(modes)
        ksp = self._solver()
        ksp.setOperators(A)
        ksp.setUp()
        clock()
        x = b.duplicate()
        ksp.solve(b, x)
        clock()
        reason, iterations = ksp.getConvergedReason(), ksp.getIterationNumber()
        compliance = b.dot(x)
        for thing in (ksp, modes, A, b, x):
            thing.destroy()
        gc.collect()
        PETSc.garbage_cleanup(comm)
        if reason <= 0:
            raise RuntimeError(f"linear elasticity was not solved (PETSc's reason {reason})")
        allocation, assembly, setup, solve = (float(spent) for spent in np.diff(times))
        return Unit(allocation, assembly, setup, solve, iterations, compliance)

    def _rigid_motions(self) -> PETSc.NullSpace:
        """Return the 6 (3 in 2D) rigid motions of the whole mesh as a null space."""
        gdim, owned = self._V.mesh.geometry.dim, self._V.dofmap.index_map.size_local
        x = self._load.duplicate()
        x.array[:] = self._V.tabulate_dof_coordinates()[:owned, :gdim].ravel()
        modes = PETSc.NullSpace().createRigidBody(x)
        x.destroy()
        return modes

    def _solver(self) -> PETSc.KSP:
        options = PETSc.Options()
        for key, value in GAMG.items():
            options[f"elasticity_{key}"] = value
        ksp = PETSc.KSP().create(self._V.mesh.comm)
        ksp.setOptionsPrefix("elasticity_")
        ksp.setTolerances(rtol=RTOL)
        ksp.setFromOptions()
        return ksp
