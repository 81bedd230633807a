"""The stiffness as a matrix in blocks, with room for what contact adds in its basis."""

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx.common import IndexMap
from scipy import sparse

from perfplast_fenicsx.problem.problem import Problem


def create_stiffness(problem: Problem) -> PETSc.Mat:
    """A matrix of zeros in blocks that has room for K and for A = TᵀKT. Collective."""
    V, T = problem.V, problem.basis.T
    topology = V.mesh.topology
    index_map, bs = V.dofmap.index_map, V.dofmap.index_map_bs
    known = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    numbers = index_map.local_to_global(known)
    cells = numbers[V.dofmap.list[: topology.index_map(topology.dim).size_local]]
    pointer = np.arange(len(cells) + 1) * cells.shape[1]
    C = _nodal(cells.ravel(), pointer, index_map, T.comm)
    K_nodes = C.transposeMatMult(C)
    pointer, columns, _ = T.getValuesCSR()
    T_nodes = _nodal(columns // bs, pointer[::bs], index_map, T.comm)
    both = K_nodes.PtAP(T_nodes)
    both.axpy(1.0, K_nodes)
    pointer, columns, _ = both.getValuesCSR()
    for matrix in (C, K_nodes, T_nodes, both):
        matrix.destroy()

    K = PETSc.Mat().create(T.comm)
    K.setSizes(T.getSizes())
    K.setType("baij")
    K.setBlockSize(bs)
    K.setPreallocationCSR((pointer, columns))
    K.setLGMap(PETSc.LGMap().create(numbers.astype(PETSc.IntType), bsize=bs, comm=T.comm))
    return K


def _nodal(
    columns: npt.NDArray, pointer: npt.NDArray, index_map: IndexMap, comm: PETSc.Comm
) -> PETSc.Mat:
    """A matrix of ones, with a column a node. Collective."""
    nodes = (index_map.size_local, index_map.size_global)
    shape = (len(pointer) - 1, nodes[1])
    ones = sparse.csr_matrix((np.ones(len(columns)), columns, pointer), shape=shape)
    ones.sum_duplicates()
    csr = (ones.indptr.astype(PETSc.IntType), ones.indices.astype(PETSc.IntType), ones.data)
    return PETSc.Mat().createAIJ(((shape[0], None), nodes), csr=csr, comm=comm)
