"""Strain and stress of a state, kept by DOLFINx Expressions, and the integrals of Newton's method.

All forms and Expressions are compiled once for a problem. Nothing here loops over cells.
"""

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.materials.mandel import strain
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.spaces import by_cell
from perfplast_fenicsx.problem.stiffness import create_stiffness
from perfplast_fenicsx.profiling import phase


class Integral:
    """A scalar form, compiled once, summed over the ranks at each call."""

    def __init__(self, comm: MPI.Intracomm, form: ufl.Form) -> None:
        self._comm = comm
        self._form = fem.form(form)

    def __call__(self) -> float:
        """The integral now. Collective."""
        return float(self._comm.allreduce(fem.assemble_scalar(self._form)))


def assemble_force(vector: PETSc.Vec, form: fem.Form, bcs: list[fem.DirichletBC]) -> None:
    """Assemble a linear form into a vector, ghosts summed, zero at supports. Collective."""
    with vector.localForm() as local:
        local.set(0)
    fem_petsc.assemble_vector(vector, form)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    fem_petsc.set_bc(vector, bcs)


class Fields:
    """Strain, stress and tangent data at u, and integrals along a direction.

    Attributes:
        u: Displacement.
        e: ε(u), Mandel vectors at the quadrature points, as all strains and stresses.
        stress: Σ(e).
        du: A direction δu.
        de: Its strain ε(δu).
        beta: Step length in the line-search integrals.
        rho: ρ of Σ^{o,ρ}.
        force: Of :meth:`assemble_force`.
        stiffness: Of :meth:`assemble_stiffness`; zero before.
    """

    def __init__(self, problem: Problem) -> None:
        """Create fields that are zero, and compile what evaluates them. Collective."""
        law, V, S, Q = problem.moduli, problem.V, problem.S, problem.Q
        mesh, comm, dx = problem.tagged_mesh.mesh, problem.comm, problem.dx
        self.u, self.du = fem.Function(V, name="displacement"), fem.Function(V)
        self.e, self.de, self.stress = fem.Function(S), fem.Function(S), fem.Function(S)
        self.beta = fem.Constant(mesh, default_scalar_type(1))
        self.rho = fem.Constant(mesh, default_scalar_type(1))
        self._a, self._normal = fem.Function(Q), fem.Function(S)

        def on(space: fem.FunctionSpace, expression: ufl.core.expr.Expr) -> fem.Expression:
            return fem.Expression(expression, interpolation_points(space.element))

        a, normal = law.tangent_data(self.e, self.rho)
        self._update = [
            (self.e, on(S, strain(self.u))),
            (self.stress, on(S, law.stress(self.e))),
        ]
        self._tangent = [(self._a, on(Q, a)), (self._normal, on(S, normal))]
        self._strain_of_direction = on(S, strain(self.du))

        e, de, s = self.e, self.de, self.stress
        moved = law.stress(e + self.beta * de)
        change = law.stress(e + de) - s

        def square(stress: ufl.core.expr.Expr) -> ufl.Form:
            return ufl.dot(law.compliance(stress), stress) * dx

        def energy(strain_: ufl.core.expr.Expr) -> ufl.Form:
            return ufl.dot(law.hooke(strain_), strain_) * dx

        self.slope = Integral(comm, ufl.dot(moved, de) * dx)
        self.potential = Integral(comm, law.potential(e) * dx)
        self.stress_power = Integral(comm, ufl.dot(s, e) * dx)
        self.stress_norm2 = Integral(comm, square(s))
        self.moved_stress_norm2 = Integral(comm, square(law.stress(e + de)))
        self.change_norm2 = Integral(comm, square(change))
        self.u_norm2 = Integral(comm, energy(e))
        self.du_norm2 = Integral(comm, energy(de))
        self.moved_norm2 = Integral(comm, energy(e + de))
        self._plastic_volume = Integral(comm, law.plastic(e) * dx)
        self._volume = Integral(comm, fem.Constant(mesh, default_scalar_type(1)) * dx)()

        self._overstress = (fem.Function(Q), on(Q, law.overstress(e)))
        self._force_form = fem.form(problem.internal_form(self.stress))
        self._tangent_form = fem.form(problem.tangent_form(self._a, self._normal))
        self._bcs, self._comm = problem.bcs, comm
        self._cells = problem.cells
        self._owned_cells = mesh.topology.index_map(mesh.topology.dim).size_local
        self._fixed = problem.fixed[: V.dofmap.index_map.size_local].ravel()
        self.force: PETSc.Vec = problem.load.duplicate()
        self.stiffness = create_stiffness(problem)

    @phase("return map")
    def update(self) -> None:
        """Bring strain and stress to u. Its ghosts must be up to date."""
        for function, expression in self._update:
            function.interpolate(expression, self._cells)

    @phase("return map")
    def update_direction(self) -> None:
        """Bring ε(δu) to δu. Its ghosts must be up to date."""
        self.de.interpolate(self._strain_of_direction, self._cells)

    def largest_overstress(self) -> float:
        """Largest 2μ‖dev e‖/γ of all points; above 1 something is plastic. Collective."""
        function, expression = self._overstress
        function.interpolate(expression, self._cells)
        return self._comm.allreduce(float(function.x.array.max(initial=0)), MPI.MAX)

    def plastic_cells(self) -> int:
        """Number of cells with a plastic point. Collective."""
        function, expression = self._overstress
        function.interpolate(expression, self._cells)
        plastic = (by_cell(function)[: self._owned_cells] > 1).any(axis=1)
        return self._comm.allreduce(int(plastic.sum()))

    def plastic_fraction(self) -> float:
        """Share of the volume that is plastic. Collective."""
        return self._plastic_volume() / self._volume

    @phase("assembly")
    def assemble_force(self) -> PETSc.Vec:
        """⟨Σ(e), ε(v)⟩ as a vector, zero at supports. Collective."""
        assemble_force(self.force, self._force_form, self._bcs)
        return self.force

    @phase("assembly")
    def assemble_stiffness(self, rho: float) -> PETSc.Mat:
        """Σ^{o,ρ}(e) as a matrix in blocks, which are assembled twice as fast as single entries.

        Supported unknowns keep a diagonal of its mean. Collective.
        """
        self.rho.value = rho
        for function, expression in self._tangent:
            function.interpolate(expression, self._cells)
        self.stiffness.zeroEntries()
        fem_petsc.assemble_matrix(self.stiffness, self._tangent_form, self._bcs)  # type: ignore[arg-type]
        self.stiffness.assemble()
        self._scale_supports()
        return self.stiffness

    def _scale_supports(self) -> None:
        """Give supported unknowns the weight of the others, lest Krylov solvers overlook them."""
        diagonal = self.stiffness.getDiagonal()
        values = diagonal.array
        total = self._comm.allreduce(np.array([values[~self._fixed].sum(), (~self._fixed).sum()]))
        values[self._fixed] = total[0] / max(total[1], 1)
        self.stiffness.setDiagonal(diagonal)
        diagonal.destroy()
