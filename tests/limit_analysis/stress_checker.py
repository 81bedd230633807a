"""Check whether a piecewise linear stress is admissible, from its values and the mesh only."""

import math
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx import Problem
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import geometry_dofmap


@dataclass(frozen=True)
class Checked:
    """Errors of a stress in its admissibility conditions.

    Attributes:
        divergence: Largest |div σ + f|, times the size of the cell.
        jump: Largest jump of tractions between parts of a body.
        deviators: ‖dev σ‖ at each vertex of each part of each owned cell, shape (num_cells, n); in
            plane strain with the mean stress out of the plane.
        x: Vertices of the boundary's facets, of all ranks, shape (num_facets, d, d).
        normals: Outward unit normals, shape (num_facets, d).
        tractions: Tractions at these vertices, shape (num_facets, d, d).
        forces: Sum of all forces that are unbalanced in cells and between cells.
    """

    divergence: float
    jump: float
    deviators: Floats
    x: Floats
    normals: Floats
    tractions: Floats
    forces: float

    def pressures(self, chosen: npt.NDArray[np.bool_]) -> Floats:
        """Return the pressure at the vertices of given boundary facets."""
        found: Floats = -np.einsum("fvi,fi->fv", self.tractions[chosen], self.normals[chosen])
        return found


def check_stress(
    problem: Problem, stress: Floats, force: tuple[float, ...] | None = None
) -> Checked:
    """Check a stress in the form of ``StaticBound``, with f per volume. Collective."""
    mesh = problem.tagged_mesh.mesh
    topology, tdim = mesh.topology, mesh.topology.dim
    owned = topology.index_map(tdim).size_local
    x = mesh.geometry.x[geometry_dofmap(mesh)[:owned, : tdim + 1], :tdim]
    vertices = topology.connectivity(tdim, 0).array.reshape(-1, tdim + 1)[:owned]
    names = topology.index_map(0).local_to_global(vertices.ravel()).reshape(vertices.shape)
    if tdim == 3:
        centres = -1 - (topology.index_map(3).local_range[0] + np.arange(owned))
        middles = x.mean(axis=1)
        x, names = (np.repeat(a[:, None], 4, axis=1) for a in (x, names))
        for a in range(4):
            x[:, a, a], names[:, a, a] = middles, centres
        x, names = x.reshape(-1, 4, 3), names.reshape(-1, 4)
    mandel = stress.reshape(len(x), tdim + 1, -1)
    mean = mandel[..., :3].mean(axis=2, keepdims=True)
    deviator = mandel - np.concatenate([np.repeat(mean, 3, axis=2), 0 * mandel[..., 3:]], axis=2)
    sigma = np.zeros((len(x), tdim + 1, tdim, tdim))
    for i in range(tdim):
        sigma[..., i, i] = mandel[..., i]
    pairs = [(0, 1)] if tdim == 2 else [(1, 2), (0, 2), (0, 1)]
    for k, (i, j) in enumerate(pairs, start=3):
        sigma[..., i, j] = sigma[..., j, i] = mandel[..., k] / np.sqrt(2)

    corners = np.concatenate([np.ones((len(x), tdim + 1, 1)), x], axis=2)
    slopes = np.swapaxes(np.linalg.inv(corners)[:, 1:], 1, 2)
    divergence = np.einsum("cvij,cvj->ci", sigma, slopes) + np.asarray(force or (0.0,) * tdim)
    size = np.ptp(x, axis=1).max(axis=1, initial=0)
    largest = float((np.abs(divergence).max(axis=1, initial=0) * size).max(initial=0))
    volumes = np.abs(np.linalg.det(corners)) / math.factorial(tdim)
    inside = problem.comm.allreduce(float(np.linalg.norm(divergence, axis=1) @ volumes))

    found = []
    for a in range(tdim + 1):
        others = [b for b in range(tdim + 1) if b != a]
        normal = -slopes[:, a] / np.linalg.norm(slopes[:, a], axis=1, keepdims=True)
        order = np.argsort(names[:, others], axis=1)
        order = np.array(others)[order] if len(names) else np.zeros((0, tdim), dtype=int)
        here = np.arange(len(x))[:, None]
        push = np.einsum("cvij,cj->cvi", sigma[here, order], normal)
        area = np.linalg.norm(slopes[:, a], axis=1) * volumes * tdim
        found.append((names[here, order], x[here, order], normal, push, area))
    gathered = problem.comm.allgather([np.concatenate(parts) for parts in zip(*found, strict=True)])
    names, x, normals, pushes, areas = (np.concatenate(a) for a in zip(*gathered, strict=True))
    _, first, inverse, count = np.unique(
        names, axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    sums = np.zeros((len(first), tdim, tdim))
    np.add.at(sums, inverse.ravel(), pushes)
    inner = first[count == 2]
    between = np.linalg.norm(sums[count == 2], axis=2).mean(axis=1) @ areas[inner]
    jump = float(np.abs(sums[count == 2]).max(initial=0))
    outer = first[count == 1]
    norms = np.linalg.norm(deviator, axis=2).reshape(owned, -1)
    largest = problem.comm.allreduce(largest, MPI.MAX)
    return Checked(
        largest, jump, norms, x[outer], normals[outer], pushes[outer], inside + float(between)
    )


def opposite(checked: Checked, chosen: np.ndarray) -> Floats:
    """Return the tractions on facets that coincide with given facets, vertex by vertex."""
    others = {}
    for x, push in zip(checked.x[~chosen], checked.tractions[~chosen], strict=True):
        others[_name(x)] = x, push
    found = []
    for facet in checked.x[chosen]:
        x, push = others[_name(facet)]
        found.append(push[[int(np.argmin(np.linalg.norm(x - v, axis=1))) for v in facet]])
    return np.array(found)


def _name(facet: Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(sorted(tuple(float(c) + 0.0 for c in np.round(v, 9)) for v in facet))
