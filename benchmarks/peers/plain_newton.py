"""Solve the plate by a plain DOLFINx Newton loop: UFL's own tangent, MUMPS in each step.

A user can write this loop in an hour. The law is one UFL expression, and ``ufl.derivative`` gives
its consistent tangent. The loop halves a step while the residual grows, and factorises in each
step.

python3 -m benchmarks.peers.plain_newton --n 4 -o record.json
"""

import argparse
import json
import math
import time
from pathlib import Path

from mpi4py import MPI
from petsc4py import PETSc

import ufl
from dolfinx import default_scalar_type, fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx import l_plate
from perfplast_fenicsx.io.results.result_folder import peak_memory

YOUNG, POISSON, YIELD = 206900.0, 0.29, 450.0
TRACTION = 200.0
TOLERANCE = 1e-8
MOST_STEPS, MOST_HALVINGS = 60, 8


def stress(e: ufl.core.expr.Expr) -> ufl.core.expr.Expr:
    """Return the stress at a strain ``e`` by Hencky's law with the von Mises condition."""
    bulk, shear = YOUNG / (3 * (1 - 2 * POISSON)), YOUNG / (2 * (1 + POISSON))
    deviator = ufl.dev(e)
    size = 2 * shear * ufl.sqrt(ufl.inner(deviator, deviator) + 1e-30)
    scale = ufl.conditional(ufl.gt(size, math.sqrt(2 / 3) * YIELD), 1, 0)
    shared = (1 - scale) + scale * math.sqrt(2 / 3) * YIELD / size
    return bulk * ufl.tr(e) * ufl.Identity(3) + 2 * shear * shared * deviator


def main() -> None:
    """Solve the level ζ = 1 from zero displacement, and write the record. Collective."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--n", type=int, required=True)
    parser.add_argument("--factor", choices=("lu", "cholesky"), default="lu")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    comm = MPI.COMM_WORLD
    began = time.perf_counter()
    plate = l_plate(comm, arguments.n)
    V = fem.functionspace(plate.mesh, ("P", 1, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    dx = ufl.dx(metadata={"quadrature_degree": 0})
    ds = ufl.Measure("ds", subdomain_data=plate.facet_tags)(plate.surfaces["top"])
    load = ufl.inner(fem.Constant(plate.mesh, (0.0, TRACTION, 0.0)), v) * ds
    F = ufl.inner(stress(ufl.sym(ufl.grad(u))), ufl.sym(ufl.grad(v))) * dx - load
    bcs = []
    for surface, axis in (("x0", 0), ("y0", 1), ("z0", 2), ("z1", 2)):
        dofs = fem.locate_dofs_topological(V.sub(axis), 2, plate.facets(surface))
        bcs.append(fem.dirichletbc(default_scalar_type(0), dofs, V.sub(axis)))
    residual, jacobian = fem.form(F), fem.form(ufl.derivative(F, u))
    A = fem_petsc.create_matrix(jacobian)
    b = fem_petsc.create_vector(residual)
    ksp = PETSc.KSP().create(comm)
    ksp.setType("preonly")
    ksp.getPC().setType(arguments.factor)
    ksp.getPC().setFactorSolverType("mumps")
    if arguments.factor == "cholesky":
        A.setOption(PETSc.Mat.Option.SPD, True)
    ksp.setOperators(A)
    step = b.duplicate()

    def assemble() -> float:
        with b.localForm() as local:
            local.set(0)
        fem_petsc.assemble_vector(b, residual)
        b.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        fem_petsc.set_bc(b, bcs)
        return float(b.norm())

    def move(share: float) -> None:
        u.x.petsc_vec.axpy(share, step)
        u.x.scatter_forward()

    comm.Barrier()
    ready = time.perf_counter()
    norm, steps, smallest = assemble(), 0, 1.0
    while steps < MOST_STEPS:
        steps += 1
        A.zeroEntries()
        fem_petsc.assemble_matrix(A, jacobian, bcs)  # type: ignore[arg-type]
        A.assemble()
        ksp.solve(b, step)
        step.scale(-1)
        before, size = u.x.petsc_vec.norm(), step.norm()
        move(1.0)
        beta, new = 1.0, assemble()
        while new > norm and beta > 2.0**-MOST_HALVINGS and size > TOLERANCE * before:
            beta /= 2
            move(-beta)
            new = assemble()
        norm, smallest = new, min(smallest, beta)
        if beta == 1 and size < TOLERANCE * (u.x.petsc_vec.norm() + before):
            break
    comm.Barrier()
    end = time.perf_counter()
    work = comm.allreduce(fem.assemble_scalar(fem.form(ufl.action(load, u))))
    memory = comm.allgather(peak_memory())
    record = {
        "ranks": comm.size,
        "dofs": V.dofmap.index_map.size_global * 3,
        "newton_iterations": steps,
        "damping_min": smallest,
        "alpha": work,
        "converged": steps < MOST_STEPS and math.isfinite(norm),
        "seconds": {"path": end - ready, "run": end - began},
        "peak_memory_mb": {"total": sum(memory), "largest": max(memory)},
    }
    if comm.rank == 0:
        arguments.output.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
