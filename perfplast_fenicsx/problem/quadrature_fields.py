"""Strain and stress of a displacement, kept by DOLFINx Expressions, and integrals of them.

All forms and Expressions are compiled once for a problem. Nothing here loops over cells.
"""

from mpi4py import MPI
from petsc4py import PETSc

import ufl
from dolfinx import default_scalar_type, fem

from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.materials.mandel import strain
from perfplast_fenicsx.problem.integrals import Integral, assemble_force
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.spaces import by_cell
from perfplast_fenicsx.profiling import phase


class QuadratureFields:
    """Strain and stress at u.

    Attributes:
        problem: Whose they are.
        u: Displacement.
        e: ε(u), Mandel vectors at the quadrature points, as all strains and stresses.
        stress: Σ(e).
        force: Of :meth:`assemble_force`.
        potential: Ψ(ε(u)).
        stress_norm2: ‖σ‖² in the energy norm, ∫ σ:C⁻¹σ.
        u_norm2: ‖u‖² in the energy norm, ∫ ε(u):Cε(u).
    """

    def __init__(self, problem: Problem) -> None:
        """Create fields that are zero, and compile what evaluates them. Collective."""
        self.problem, law, comm, dx = problem, problem.moduli, problem.comm, problem.dx
        mesh, V, S, Q = problem.tagged_mesh.mesh, problem.V, problem.S, problem.Q
        self.u = fem.Function(V, name="displacement")
        self.e, self.stress = fem.Function(S), fem.Function(S)
        e, s = self.e, self.stress
        points = interpolation_points(S.element)
        self._update = [
            (e, fem.Expression(strain(self.u), points)),
            (s, fem.Expression(law.stress(e), points)),
        ]
        self.potential = Integral(comm, law.potential(e) * dx)
        self.stress_norm2 = Integral(comm, ufl.dot(law.compliance(s), s) * dx)
        self.u_norm2 = Integral(comm, ufl.dot(law.hooke(e), e) * dx)
        self._plastic_volume = Integral(comm, law.plastic(e) * dx)
        self._volume = Integral(comm, fem.Constant(mesh, default_scalar_type(1)) * dx)()
        overstress = fem.Expression(law.overstress(e), interpolation_points(Q.element))
        self._overstress = (fem.Function(Q), overstress)
        self._force_form = fem.form(problem.internal_form(s))
        self._owned_cells = mesh.topology.index_map(mesh.topology.dim).size_local
        self.force: PETSc.Vec = problem.create_vector()

    @phase("return map")
    def update(self) -> None:
        """Bring strain and stress to u. Its ghosts must be up to date."""
        for function, expression in self._update:
            function.interpolate(expression, self.problem.cells)

    def largest_overstress(self) -> float:
        """Largest 2μ‖dev e‖/γ of all points; above 1 something is plastic. Collective."""
        function, expression = self._overstress
        function.interpolate(expression, self.problem.cells)
        return self.problem.comm.allreduce(float(function.x.array.max(initial=0)), MPI.MAX)

    def plastic_cells(self) -> int:
        """Number of cells with a plastic point. Collective."""
        function, expression = self._overstress
        function.interpolate(expression, self.problem.cells)
        plastic = (by_cell(function)[: self._owned_cells] > 1).any(axis=1)
        return self.problem.comm.allreduce(int(plastic.sum()))

    def plastic_fraction(self) -> float:
        """Share of the volume that is plastic. Collective."""
        return self._plastic_volume() / self._volume

    @phase("assembly")
    def assemble_force(self) -> PETSc.Vec:
        """⟨Σ(e), ε(v)⟩ as a vector, zero at supports. Collective."""
        assemble_force(self.force, self._force_form, self.problem.bcs)
        return self.force
