"""Solve the punch by GetFEM: one step of Prandtl-Reuss plasticity from zero, which is Hencky's law.

Mesh, law, supports, pressure and nodal contact are those of ``punch`` in benchmarks/problems.py.
The script uses GetFEM's bricks, its Newton method with the simplest line search, and sequential
MUMPS.

python3 benchmarks/peers/getfem_punch.py --n 8 -o record.json      (needs Debian's python3-getfem)
"""

import argparse
import json
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import getfem as gf
import numpy as np
import numpy.typing as npt

YOUNG, POISSON, YIELD = 200000.0, 0.3, 400 * np.sqrt(1.5)
RESIDUAL = 1e-9
MOST_STEPS = 80

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

TETRAHEDRA = ((1, 2, 4, 6), (1, 4, 5, 6), (4, 5, 6, 8), (2, 3, 4, 6), (3, 6, 7, 4), (4, 6, 7, 8))
CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))


def box(cubes: int, origin: tuple[float, float, float], h: float) -> tuple[Array, npt.NDArray]:
    """Return points and tetrahedra of a cube with ``cubes`` small cubes along each edge.

    Args:
        cubes: Number of small cubes along each edge.
        origin: Corner with the smallest coordinates.
        h: Edge length of a small cube.
    """
    k, j, i = np.meshgrid(*[np.arange(cubes)] * 3, indexing="ij")
    edge = cubes + 1
    corner = [((k + c) * edge + j + b) * edge + i + a for a, b, c in CORNERS]
    cells = np.stack([corner[v - 1].ravel() for four in TETRAHEDRA for v in four], 1)
    z, y, x = np.meshgrid(*[np.arange(edge)] * 3, indexing="ij")
    points = np.array(origin) + h * np.stack([x.ravel(), y.ravel(), z.ravel()], 1)
    return points, cells.reshape(-1, 4)


@dataclass(frozen=True)
class Body:
    """GetFEM's mesh, elements and integration of one body, without the supported unknowns.

    Attributes:
        position: Position of each unknown, shape (3, num_unknowns).
        axis: Displacement component of each unknown.
    """

    mesh: gf.Mesh
    full: gf.MeshFem
    free: gf.MeshFem
    integration: gf.MeshIm
    position: Array
    axis: npt.NDArray[np.int64]


def make_body(
    points: Array, cells: npt.NDArray, held: Callable[[Array, npt.NDArray[np.int64]], Flags]
) -> Body:
    """Return a body of linear tetrahedra; ``held`` marks the supported unknowns."""
    mesh = gf.Mesh("empty", 3)
    mesh.add_convex(gf.GeoTrans("GT_PK(3,1)"), np.transpose(points[cells], (2, 1, 0)))
    full = gf.MeshFem(mesh, 3)
    full.set_fem(gf.Fem("FEM_PK(3,1)"))
    position, axis = full.basic_dof_nodes(), np.arange(full.nbdof()) % 3
    kept = np.flatnonzero(~held(position, axis))
    free = gf.MeshFem("partial", full, kept)
    integration = gf.MeshIm(mesh, gf.Integ("IM_TETRAHEDRON(1)"))
    return Body(mesh, full, free, integration, position[:, kept], axis[kept])


def make_bodies(n: int) -> tuple[Body, Body]:
    """Return a quarter of the base and a quarter of the punch."""

    def symmetry(x: Array, axis: npt.NDArray[np.int64]) -> Flags:
        return ((axis == 0) & (abs(x[0]) < 1e-9)) | ((axis == 1) & (abs(x[1]) < 1e-9))

    def fixed(x: Array, axis: npt.NDArray[np.int64]) -> Flags:
        return symmetry(x, axis) | (abs(x[2]) < 1e-9)

    base = make_body(*box(n, (0, 0, 0), 1 / n), fixed)
    return base, make_body(*box(n // 2, (0, 0, 1), 1 / n), symmetry)


def make_model(base: Body, punch: Body, pressure: float, n: int) -> gf.Model:
    """Return the problem as a model of GetFEM's bricks."""
    model = gf.Model("real")
    model.add_initialized_data("lambda", [YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))])
    model.add_initialized_data("mu", [YOUNG / (2 * (1 + POISSON))])
    model.add_initialized_data("sigma_y", [YIELD])
    model.set_time_step(1.0)
    for name, body in (("1", base), ("2", punch)):
        model.add_fem_variable(f"u{name}", body.free)
        model.add_fem_data(f"Previous_u{name}", body.free)
        scalar = gf.MeshImData(body.integration, -1, [1])
        tensor = gf.MeshImData(body.integration, -1, [3, 3])
        model.add_im_data(f"xi{name}", scalar)
        model.add_im_data(f"Previous_xi{name}", scalar)
        model.add_im_data(f"Previous_Ep{name}", tensor)
        model.add_small_strain_elastoplasticity_brick(
            *(body.integration, "Prandtl Reuss", "displacement only"),
            *(f"u{name}", f"xi{name}", f"Previous_Ep{name}"),
            *("lambda", "mu", "sigma_y", "1", "timestep"),
        )
    faces = punch.mesh.outer_faces()
    heights = np.array(
        [
            punch.mesh.pts()[2, punch.mesh.pid_in_faces(faces[:, [i]])].mean()
            for i in range(faces.shape[1])
        ]
    )
    punch.mesh.set_region(1, faces[:, heights > 1.5 - 1e-6])
    model.add_initialized_data("t", [0, 0, -pressure])
    model.add_source_term_brick(punch.integration, "u2", "t", 1)

    first, second = (_contact_nodes(body, n) for body in (base, punch))
    nodes = sorted(second)
    jump = [gf.Spmat("empty", len(nodes), body.free.nbdof()) for body in (base, punch)]
    for row, node in enumerate(nodes):
        jump[0].add([row], [first[node]], np.array([[1.0]]))
        jump[1].add([row], [second[node]], np.array([[-1.0]]))
    model.add_variable("lam_n", len(nodes))
    model.add_initialized_data("r", [YOUNG / n])
    model.add_initialized_data("gap", np.zeros(len(nodes)))
    model.add_basic_contact_brick_two_deformable_bodies("u1", "u2", "lam_n", "r", *jump, "gap")
    return model


def _contact_nodes(body: Body, n: int) -> dict[tuple[int, ...], int]:
    """Return the unknown of the normal displacement at each node of the contact plane z = 1."""
    chosen = np.flatnonzero((body.axis == 2) & (abs(body.position[2] - 1) < 1e-9))
    return {tuple(np.round(body.position[:, j] * n).astype(int)): int(j) for j in chosen}


def main() -> None:
    """Solve the load level, and write the record."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--n", type=int, required=True)
    parser.add_argument("--pressure", type=float, default=450.0)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    gf.util_trace_level(0)
    began = time.perf_counter()
    base, punch = make_bodies(arguments.n)
    model = make_model(base, punch, arguments.pressure, arguments.n)
    model.assembly("build_all")
    ready = time.perf_counter()
    steps, converged = model.solve(
        *("max_res", RESIDUAL, "max_iter", MOST_STEPS),
        *("lsolver", "mumps", "lsearch", "simplest"),
    )
    end = time.perf_counter()
    scalar = gf.MeshFem(punch.mesh, 1)
    scalar.set_fem(gf.Fem("FEM_PK(3,1)"))
    downwards = np.tile([[0], [0], [-1.0]], (1, scalar.nbdof()))
    load = gf.asm_boundary_source(1, punch.integration, punch.free, scalar, downwards)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    record = {
        "ranks": 1,
        "dofs": base.full.nbdof() + punch.full.nbdof(),
        "newton_iterations": int(steps),
        "converged": bool(converged),
        "alpha": float(load @ model.variable("u2")),
        "active_contacts": int((model.variable("lam_n") < -1e-9).sum()),
        "seconds": {"path": end - ready, "run": end - began},
        "peak_memory_mb": {"total": memory, "largest": memory},
    }
    arguments.output.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
