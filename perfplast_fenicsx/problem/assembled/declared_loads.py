"""Assemble the declared loads into the vectors L₀ and L₁."""

from collections.abc import Sequence

from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import fem

from perfplast_fenicsx.compat import create_vector
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.assembled.integrals import assemble_force
from perfplast_fenicsx.problem.assembled.load_case import LoadCase
from perfplast_fenicsx.problem.assembled.rigid_rows import find_leaders
from perfplast_fenicsx.problem.assembled.work_form import work_form
from perfplast_fenicsx.problem.declared.loads import Force, Load, SpreadLoad
from perfplast_fenicsx.problem.declared.rigid_surface import RigidSurface, fitting


def declared_loads(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    loads: Sequence[Load],
    bcs: list[fem.DirichletBC],
    rigid: Sequence[RigidSurface],
    driven: bool,
    strained: bool,
) -> LoadCase:
    """Return the assembled loads of a problem. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        loads: The declared loads.
        bcs: Supports.
        rigid: Rigid surfaces, on which forces may act.
        driven: Whether ζ moves supports, obstacles or overlaps. If so, the list of loads may be
            empty.
        strained: Whether initial strains, overlaps or constant displacements load the bodies. If
            so, the list of loads may be empty.

    Raises:
        InputError: If a load does not fit the mesh, or if ζ multiplies no load.
    """
    growing = [load for load in loads if not load.constant]
    constant = [load for load in loads if load.constant]
    if not (driven or strained or loads):
        raise InputError("no load is given, so nothing can be increased; give at least one load.")
    free = [surface.on for surface in rigid if surface.free]
    straight = {surface.on: surface for surface in rigid if surface.held}
    for load in loads:
        if isinstance(load, Force) and load.on not in free:
            raise InputError(
                f"the force on '{load.on}' acts on a rigid surface whose motion is given; leave out"
                " the motion or the force."
            )
        if not isinstance(load, Force) or load.on not in straight:
            continue
        surface = straight[load.on]
        if np.any(load.moment):
            raise InputError(
                f"the force on '{load.on}' has a moment, but that surface is partly held "
                "and cannot rotate; remove the moment or held."
            )
        value = fitting(f"value of the force on '{load.on}'", load.value, V.mesh.geometry.dim)
        if not np.delete(value, surface.axes(V.mesh.geometry.dim)).any():
            raise InputError(
                f"the force on '{load.on}' acts only along {surface.held}, where that surface is"
                " held; give it a component along which the surface is free, or leave it out."
            )
    dead, live = (work_vector(V, tagged_mesh, part) for part in (constant, growing))
    case = LoadCase.of(dead, live, bcs)
    still = bool(loads) and not case.grows()
    if not driven and still and (growing or not case.has_dead()):
        raise InputError(
            "the loads do no work on any admissible displacement, so nothing can be increased;"
            " give a load that is not zero on a surface that is free to move."
        )
    return case


def work_vector(V: fem.FunctionSpace, tagged_mesh: TaggedMesh, loads: Sequence[Load]) -> PETSc.Vec:
    """Return the work L(v) of some loads as a vector, with entries at supported unknowns too.

    Collective.
    """
    spread = [load for load in loads if isinstance(load, SpreadLoad)]
    work = create_vector(V)
    if spread:
        form = fem.form(work_form(tagged_mesh, spread, ufl.TestFunction(V)))
        assemble_force(work, form, [])
    for load in loads:
        if isinstance(load, Force):
            _add(V, tagged_mesh, load, work)
    return work


def _add(V: fem.FunctionSpace, tagged_mesh: TaggedMesh, load: Force, work: PETSc.Vec) -> None:
    """Add the force on a rigid surface as forces on its leading nodes. Collective."""
    gdim, (first, last) = V.mesh.geometry.dim, V.dofmap.index_map.local_range
    what = f"of the force on '{load.on}'"
    value, point = fitting(f"value {what}", load.value, gdim), load.point
    moment = fitting(f"moment {what}", load.moment, 2 * gdim - 3)
    leaders = find_leaders(V, tagged_mesh, load.on)
    forces = leaders.forces(value, moment, fitting(f"point {what}", point, gdim))
    forces = forces / tagged_mesh.kinematics.carried(leaders.x)[:, None]
    at_nodes = work.array.reshape(-1, gdim)
    mine = (leaders.number >= first) & (leaders.number < last)
    at_nodes[leaders.number[mine] - first] += forces[mine]
