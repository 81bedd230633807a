"""Describe axisymmetric velocities u by v = ru, a quadratic function in each cell.

The flow u preserves volume if the divergence of v in the section is zero; three points of a cell
are sufficient to enforce this condition. With a polynomial w and u_r = rw, a flow between fixed
planes would need r²w independent of r, and no polynomial except zero satisfies this condition. With
v, such a flow only needs v_r independent of r. On the axis, v is zero. With zero divergence, u_r is
also zero on the axis, and strain rates are finite except at vertices on the axis.
"""

from dataclasses import replace

from mpi4py import MPI

import numpy as np
from dolfinx import fem, la

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.kinematics import ON_AXIS, RingFlux
from perfplast_fenicsx.parallel import bounding_box
from perfplast_fenicsx.problem.problem import Problem


def by_flux(problem: Problem) -> Problem:
    """Return the problem with v as the unknown, and with supports that do not move. Collective.

    The bodies and the loads do not change. In contacts, the gap of the mesh replaces a declared
    gap.

    Args:
        problem: Axisymmetric problem with quadratic elements on straight cells.

    Raises:
        InputError: If surfaces in contact have a radial gap.
    """
    given = problem.given
    still = [replace(one, value=0.0) for one in given.supports]
    contacts = [
        one if one.gap is None else replace(one, gap=None, interference=False, constant=True)
        for one in given.contacts
    ]
    given = replace(given, supports=still, contacts=contacts, initial=())
    low, high = bounding_box(problem.comm, problem.tagged_mesh.mesh.geometry.x.astype(float))
    shift = float((low + high)[0] / 2 / np.linalg.norm(high - low))
    section = RingFlux(shift)
    found = Problem.from_given(replace(problem.tagged_mesh, section=section), given)
    _check_rings_meet(found)
    return found


def _check_rings_meet(problem: Problem) -> None:
    """Refuse rings in contact whose radii differ. Collective."""
    rows = problem.constraints
    inner = np.array([source.inner for source in rows.sources], dtype=bool)[rows.surface]
    across = np.abs(rows.gap * rows.normal[:, 0])[inner]
    largest = problem.comm.allreduce(float(across.max(initial=0.0)), MPI.MAX)
    rounding = 1e-9  # relative to the size of the bodies
    if largest > rounding * problem.bodies.size:
        raise InputError(
            f"surfaces in contact have a radial gap of {largest:.3g}, but strict bounds need "
            "contact surfaces of equal radius; mesh the bodies without this gap (limit loads do "
            "not change), or give control = 'work' and until = 'limit'."
        )


def nodal_velocity(problem: Problem, flux: fem.Function) -> fem.Function:
    """Return u = v/r at the nodes, with linear extrapolation along edges to the axis. Collective.

    Args:
        problem: Problem with displacements u on the same mesh.
        flux: Velocity v whose ghosts are up to date.
    """
    V = problem.V
    found = fem.Function(V, name=flux.name)
    r, v = V.tabulate_dof_coordinates()[:, :1], flux.x.array.reshape(-1, 2)
    off = r[:, 0] > ON_AXIS * problem.bodies.size
    u = np.divide(v, r, out=np.zeros_like(v), where=off[:, None])
    layout, cells = V.dofmap.dof_layout, V.dofmap.list
    sums = la.vector(V.dofmap.index_map, 2)
    at = sums.array.reshape(-1, 2)
    for edge in range(3):
        (middle,) = layout.entity_dofs(1, edge)
        ends = [i for i in layout.entity_closure_dofs(1, edge) if i != middle]
        for end, other in (ends, ends[::-1]):
            here = ~off[cells[:, end]] & off[cells[:, middle]]
            told = 2 * u[cells[here, middle], 1] - u[cells[here, other], 1]
            np.add.at(at, cells[here, end], np.column_stack([told, np.ones_like(told)]))
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    total, count = sums.array.reshape(-1, 2).T
    values: Floats = np.where(count > 0, total / np.maximum(count, 1), u[:, 1])
    for edge in range(3):
        (middle,) = layout.entity_dofs(1, edge)
        ends = [i for i in layout.entity_closure_dofs(1, edge) if i != middle]
        here = ~off[cells[:, middle]]
        values[cells[here, middle]] = values[cells[here][:, ends]].mean(axis=1)
    found.x.array[:] = np.column_stack([u[:, 0], values]).ravel()
    found.x.scatter_forward()
    return found
