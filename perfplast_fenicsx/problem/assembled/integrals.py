"""Compile forms once and assemble them repeatedly."""

from mpi4py import MPI
from petsc4py import PETSc

import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc


class Integral:
    """A scalar form, compiled once, summed over the ranks at each call."""

    def __init__(self, comm: MPI.Intracomm, form: ufl.Form) -> None:
        self._comm = comm
        self._form = fem.form(form)

    def __call__(self) -> float:
        """Return the integral of the current values. Collective."""
        return float(self._comm.allreduce(fem.assemble_scalar(self._form)))


def assemble_force(vector: PETSc.Vec, form: fem.Form, bcs: list[fem.DirichletBC]) -> None:
    """Assemble a linear form into a vector, with ghosts summed and zero at supports. Collective."""
    with vector.localForm() as local:
        local.set(0)
    fem_petsc.assemble_vector(vector, form)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    fem_petsc.set_bc(vector, bcs)
