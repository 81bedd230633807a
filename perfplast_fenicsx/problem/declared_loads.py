"""From declared loads to the vectors L₀ and L₁."""

from collections.abc import Sequence

from petsc4py import PETSc

import ufl
from dolfinx import fem, la
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.load_case import LoadCase
from perfplast_fenicsx.problem.loads import Load
from perfplast_fenicsx.problem.work_form import work_form


def declared_loads(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    loads: Sequence[Load],
    bcs: list[fem.DirichletBC],
    driven: bool,
) -> LoadCase:
    """The loads of a problem. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        loads: What acts.
        bcs: Supports.
        driven: Whether ζ moves supports or obstacles: there may then be no load, and none grows.

    Raises:
        InputError: If a load does not fit the mesh, grows where it must not, or nothing grows.
    """
    growing = [load for load in loads if not load.constant]
    constant = [load for load in loads if load.constant]
    if driven and growing:
        raise InputError(
            f"the load on '{growing[0].on}' grows with ζ, but ζ moves supports or obstacles; make"
            " the load constant, or leave the motion out."
        )
    if not driven and not loads:
        raise InputError("no load is given, so nothing can be increased; give at least one load.")
    dead, live = (_work(V, tagged_mesh, part) for part in (constant, growing))
    case = LoadCase.of(dead, live, bcs)
    if not driven and not case.grows() and (growing or case.is_proportional()):
        raise InputError(
            "the loads do no work on any admissible displacement, so nothing can be increased;"
            " give a load that is not zero on a surface that is free to move."
        )
    return case


def _work(V: fem.FunctionSpace, tagged_mesh: TaggedMesh, loads: Sequence[Load]) -> PETSc.Vec:
    """L(v) of some loads as a vector, at supported unknowns too."""
    if not loads:
        return la.create_petsc_vector(V.dofmap.index_map, V.dofmap.index_map_bs)
    form = work_form(tagged_mesh, loads, ufl.TestFunction(V))
    work = fem_petsc.assemble_vector(fem.form(form))
    work.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return work
