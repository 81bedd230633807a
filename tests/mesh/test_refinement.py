"""Test finer meshes: bodies, names and matching surfaces do not change."""

from mpi4py import MPI

import dolfinx
import numpy as np
import numpy.typing as npt
import pytest
import ufl

from meshes.contact_patch import write_contact_patch
from meshes.strip_footing import write_strip_footing
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import Contact, InputError, TaggedMesh, stacked_blocks, two_blocks
from perfplast_fenicsx.compat import geometry_dofmap
from perfplast_fenicsx.contact.surfaces.node_matching import opposite_vertices
from perfplast_fenicsx.mesh import Refined, fan, refine
from perfplast_fenicsx.mesh.bisection import cut, edges_of_simplex
from perfplast_fenicsx.mesh.refinement import fan_around
from perfplast_fenicsx.parallel import fetch_rows
from tests.mesh.test_meshes import area_vector, check_interface, volume
from tests.models import Read

Floats = npt.NDArray[np.float64]


def corners(tagged_mesh: TaggedMesh) -> Floats:
    """Return the vertices of the owned cells, shape (num_cells, gdim + 1, gdim)."""
    mesh = tagged_mesh.mesh
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    x: Floats = mesh.geometry.x[
        geometry_dofmap(mesh)[:owned, : mesh.topology.dim + 1], : mesh.geometry.dim
    ]
    return x


def sizes(tagged_mesh: TaggedMesh) -> Floats:
    """Return the volumes of the owned cells."""
    x = corners(tagged_mesh)
    out: Floats = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / (2 if x.shape[2] == 2 else 6)
    return out


def quality(tagged_mesh: TaggedMesh) -> float:
    """Return the least volume of a cell over the cube (square) of its longest edge."""
    x = corners(tagged_mesh)
    longest = np.linalg.norm(x[:, :, None] - x[:, None], axis=-1).max(axis=(1, 2))
    least = (sizes(tagged_mesh) / longest ** x.shape[2]).min(initial=np.inf)
    return tagged_mesh.mesh.comm.allreduce(least, MPI.MIN)


def boundary(tagged_mesh: TaggedMesh) -> float:
    """Return the area of all facets with only one cell."""
    mesh = tagged_mesh.mesh
    one = dolfinx.fem.Constant(mesh, np.float64(1))
    return mesh.comm.allreduce(dolfinx.fem.assemble_scalar(dolfinx.fem.form(one * ufl.ds(mesh))))


def near(tagged_mesh: TaggedMesh, point: tuple[float, ...], body: str) -> npt.NDArray[np.bool_]:
    """Return the owned cells of a body with a vertex at the point."""
    x = corners(tagged_mesh)
    marks = np.zeros(len(x), dtype=np.bool_)
    marks[tagged_mesh.cells(body)] = True
    at: npt.NDArray[np.bool_] = (np.linalg.norm(x - np.array(point), axis=2) < 1e-9).any(axis=1)
    return marks & at


def check_finer(coarse: TaggedMesh, finer: Refined) -> None:
    """Check that bodies, surfaces and boundary keep their sizes, and cells fill their parents."""
    tagged_mesh = finer.tagged_mesh
    comm = tagged_mesh.mesh.comm
    assert len(finer.parents) == len(corners(tagged_mesh))
    assert boundary(tagged_mesh) == pytest.approx(boundary(coarse), rel=1e-12)
    for name in coarse.volumes:
        assert volume(tagged_mesh, name) == pytest.approx(volume(coarse, name), rel=1e-12)
    for name in coarse.surfaces:
        old, new = area_vector(coarse, name), area_vector(tagged_mesh, name)
        np.testing.assert_allclose(new, old, atol=1e-12)
    mine = np.column_stack([sizes(coarse), corners(coarse).mean(axis=1)])
    of_parent = fetch_rows(comm, mine, finer.parents)
    parts = np.concatenate(comm.allgather(finer.parents))
    whole = np.bincount(parts, weights=np.concatenate(comm.allgather(sizes(tagged_mesh))))
    np.testing.assert_allclose(whole, np.concatenate(comm.allgather(sizes(coarse))), rtol=1e-12)
    away = np.linalg.norm(corners(tagged_mesh).mean(axis=1) - of_parent[:, 1:], axis=1)
    assert (away ** (of_parent.shape[1] - 1) < 60 * of_parent[:, 0]).all()


@pytest.mark.mpi3
def test_marks_in_one_body_refine_the_other_at_their_contact(comm: MPI.Intracomm) -> None:
    contacts = [Contact("upper_bottom", "lower_top")]
    coarse = two_blocks(comm, 2)
    for _ in range(4):
        marked = near(coarse, (1.0, 0.5, 1.0), "upper")
        finer = refine(coarse, marked, opposite_vertices(coarse, contacts))
        check_finer(coarse, finer)
        check_interface(finer.tagged_mesh, "upper_bottom", "lower_top")
        coarse = finer.tagged_mesh
    assert quality(coarse) > quality(two_blocks(comm, 2)) / 20


@pytest.mark.mpi3
def test_cells_of_any_shape_are_cut_at_their_contact_alone(comm: MPI.Intracomm, read: Read) -> None:
    """The punch has one more cell for each edge of its contact; the ground is refined as before."""
    contacts = [Contact("ground_footing", "punch_footing")]
    made: dict[bool, TaggedMesh] = {}
    for any_shape in (False, True):
        mesh = read(write_strip_footing, punch=True, width=2.0, depth=1.0, size=0.4, grading=1.0)
        start = {name: cells_of(mesh, name) for name in mesh.volumes}
        edges = facets_of(mesh, "punch_footing")
        for _ in range(3):
            marked = near(mesh, (1.0, 0.0), "ground") | near(mesh, (0.0, 0.0), "ground")
            shapeless = np.zeros(len(marked), dtype=np.bool_)
            shapeless[owned(mesh, "punch")] = any_shape
            pairs = opposite_vertices(mesh, contacts)
            finer = refine(mesh, marked, pairs, shapeless=shapeless)
            check_finer(mesh, finer)
            check_interface(finer.tagged_mesh, "ground_footing", "punch_footing")
            mesh = finer.tagged_mesh
        made[any_shape] = mesh
        more = cells_of(mesh, "punch") - start["punch"]
        new = facets_of(mesh, "punch_footing") - edges
        assert new > 4 and (more == new) == any_shape
    assert cells_of(made[True], "ground") <= cells_of(made[False], "ground")


def owned(mesh: TaggedMesh, body: str) -> npt.NDArray[np.int32]:
    """Return the cells of a body that this rank owns."""
    cells = mesh.cells(body)
    return cells[cells < mesh.mesh.topology.index_map(2).size_local]


def cells_of(mesh: TaggedMesh, body: str) -> int:
    """Return the cells of a body on all ranks."""
    return mesh.mesh.comm.allreduce(len(owned(mesh, body)))


def facets_of(mesh: TaggedMesh, surface: str) -> int:
    """Return the facets of a surface on all ranks."""
    facets = mesh.facets(surface)
    return mesh.mesh.comm.allreduce(
        int((facets < mesh.mesh.topology.index_map(1).size_local).sum())
    )


def test_surfaces_apart_match_still(comm: MPI.Intracomm) -> None:
    """Across a gap much wider than the cells, each side keeps its position."""
    coarse = stacked_blocks(comm, 3)
    x = coarse.mesh.geometry.x
    x[np.unique(geometry_dofmap(coarse.mesh)[coarse.cells("upper")]), 2] += 2.0
    contacts = [Contact("lower_top", "upper_bottom")]
    for _ in range(3):
        pairs = opposite_vertices(coarse, contacts)
        finer = refine(coarse, near(coarse, (0.0, 0.0, 1.0), "lower"), pairs)
        check_finer(coarse, finer)
        coarse = finer.tagged_mesh
    pairs = opposite_vertices(coarse, contacts)
    count = comm.allreduce(len(pairs))
    assert count > 30
    assert len(np.unique(np.concatenate(comm.allgather(pairs)))) == 2 * count


@pytest.mark.mpi3
def test_refined_mesh_does_not_depend_on_ranks(comm: MPI.Intracomm, read: Read) -> None:
    def middles(ranks: MPI.Intracomm) -> Floats:
        tagged_mesh = read(write_contact_patch, comm=ranks, dim=2)
        (contact,) = [Contact("upper_seam", "lower_seam")]
        for _ in range(5):
            x = corners(tagged_mesh).mean(axis=1)
            marked = np.linalg.norm(x - (0.3, 0.4), axis=1) < 0.2
            pairs = opposite_vertices(tagged_mesh, [contact])
            tagged_mesh = refine(tagged_mesh, marked, pairs).tagged_mesh
        x = corners(tagged_mesh).mean(axis=1)
        place = tagged_mesh.mesh.topology.original_cell_index[: len(x)]
        out: Floats = np.concatenate(ranks.allgather(x))
        return out[np.argsort(np.concatenate(ranks.allgather(place)))]

    np.testing.assert_allclose(middles(comm), middles(MPI.COMM_SELF), atol=1e-12)


def test_angles_stay_bounded(comm: MPI.Intracomm, read: Read) -> None:
    tagged_mesh = read(write_strip_footing)
    least = quality(tagged_mesh)
    for _ in range(12):
        tagged_mesh = refine(tagged_mesh, near(tagged_mesh, (1.0, 0.0), "ground")).tagged_mesh
    assert quality(tagged_mesh) > least / 4
    assert sizes(tagged_mesh).min(initial=0.0) < 1e-7


@pytest.mark.mpi3
def test_cells_become_long_in_a_metric(read: Read) -> None:
    """Edges along y count a fourth: cells become this much longer, and surfaces still match."""
    contact = Contact("ground_footing", "punch_footing")
    arguments = {"punch": True, "width": 3.0, "depth": 2.0, "grading": 1.0, "size": 1.0}
    first = assembly = read(write_strip_footing, **arguments)
    comm, counts = first.mesh.comm, list[int]()
    for _ in range(4):
        count = len(corners(assembly))
        metric = np.broadcast_to(np.diag([1.0, 1 / 16]), (count, 2, 2))
        pairs = opposite_vertices(assembly, [contact])
        finer = refine(assembly, np.ones(count, dtype=np.bool_), pairs, metric)
        check_finer(assembly, finer)
        assembly = finer.tagged_mesh
        check_interface(assembly, "ground_footing", "punch_footing")
        counts.append(comm.allreduce(len(corners(assembly))))
    extents = np.concatenate(comm.allgather(np.ptp(corners(assembly), axis=1)))
    assert 2 < np.median(extents[:, 1] / extents[:, 0]) < 8
    isotropic = refine(first, np.ones(len(corners(first)), dtype=np.bool_)).tagged_mesh
    assert counts[0] < comm.allreduce(len(corners(isotropic)))


def test_fan_doubles_the_cells_at_a_point(comm: MPI.Intracomm, read: Read) -> None:
    coarse = read(write_strip_footing)
    at = (1.0, 0.0)
    for _ in range(3):
        vertices = coarse.mesh.topology.index_map(0)
        assert vertices.size_global > 0
        points = dolfinx.mesh.locate_entities(
            coarse.mesh, 0, lambda x: np.hypot(x[0] - at[0], x[1] - at[1]) < 1e-9
        )
        before = comm.allreduce(np.count_nonzero(near(coarse, at, "ground")))
        finer = fan(coarse, points)
        check_finer(coarse, finer)
        coarse = finer.tagged_mesh
        assert comm.allreduce(np.count_nonzero(near(coarse, at, "ground"))) == 2 * before


def test_fan_around_an_edge_in_space(comm: MPI.Intracomm) -> None:
    """Twice as many cells meet at an edge of a contact, on both sides."""
    coarse = two_blocks(comm, 1)
    ends = np.array([[1.0, 0.0, 1.0], [1.0, 1.0, 1.0]])

    def at_edge(tagged_mesh: TaggedMesh) -> npt.NDArray[np.bool_]:
        x = corners(tagged_mesh)
        on = [(np.linalg.norm(x - end, axis=2) < 1e-9).any(axis=1) for end in ends]
        return on[0] & on[1]

    x = corners(coarse)
    here = np.linalg.norm(x[:, :, None] - ends, axis=3).min(axis=2) < 1e-9
    edges = here[:, edges_of_simplex(3)].all(axis=2)
    before = comm.allreduce(np.count_nonzero(at_edge(coarse)))
    pairs = opposite_vertices(coarse, [Contact("upper_bottom", "lower_top")])
    finer = fan_around(coarse, edges, pairs)
    check_finer(coarse, finer)
    check_interface(finer.tagged_mesh, "upper_bottom", "lower_top")
    assert before > 0
    assert comm.allreduce(np.count_nonzero(at_edge(finer.tagged_mesh))) == 2 * before


@pytest.mark.mpi3
def test_edges_along_which_fields_change_are_cut(comm: MPI.Intracomm) -> None:
    """Cells become smaller along the gradient than across it; surfaces in contact still match."""

    def finer(coarse: TaggedMesh) -> Refined:
        every = np.ones(len(sizes(coarse)), dtype=np.bool_)
        upwards = np.zeros((len(every), 3, 2))
        upwards[:, 2, 1] = 7.0  # of any size
        pairs = opposite_vertices(coarse, [Contact("upper_bottom", "lower_top")])
        return refine(coarse, every, pairs, gradients=upwards)

    found = two_blocks(comm, 1)
    alone = two_blocks(MPI.COMM_SELF, 1)
    for _ in range(2):
        refined = finer(found)
        check_finer(found, refined)
        found, alone = refined.tagged_mesh, finer(alone).tagged_mesh
        check_interface(found, "upper_bottom", "lower_top")
        assert comm.allreduce(len(sizes(found))) == len(sizes(alone))
    extents = mean_extents(found)
    assert extents[2] < 0.8 * extents[:2].min()


def mean_extents(tagged_mesh: TaggedMesh) -> Floats:
    """Return the mean extents of cells along the axes, shape (gdim,)."""
    extents = np.ptp(corners(tagged_mesh), axis=1)
    comm = tagged_mesh.mesh.comm
    out: Floats = comm.allreduce(extents.sum(axis=0)) / comm.allreduce(len(extents))
    return out


def test_parts_fit_whatever_edges_are_cut() -> None:
    """Two tetrahedra share a face with all marks: both cut it in the same way."""
    cells = np.array([[0, 1, 2, 3], [2, 4, 1, 0]])
    names = np.array([[10, 11, 12, 13], [20, 21, 22, 23]], dtype=np.int32)
    edges = {(0, 1): 5, (0, 2): 6, (1, 2): 7, (0, 4): 8}
    local = [(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)]
    for order in np.random.default_rng(1).permuted(np.tile(np.arange(4), (8, 1)), axis=1):
        number = dict(zip(edges, order, strict=True))
        keys = [[tuple(sorted((cell[i], cell[j]))) for i, j in local] for cell in cells]
        middles = np.array([[edges.get(key, -1) for key in row] for row in keys])
        ranks = np.array([[number.get(key, -1) for key in row] for row in keys])
        parts = cut(cells, names, middles, ranks, inner=0)
        sides = [
            {tuple(sorted(np.delete(c, k))) for c, t in zip(parts.cells, parts.facets, strict=True)
             for k in range(4) if t[k] == tag}
            for tag in (13, 21)
        ]  # fmt: skip
        assert sides[0] == sides[1]
        assert len(sides[0]) == 4


def test_midsides_of_straight_cells_are_left_out(comm: MPI.Intracomm, read: Read) -> None:
    straight = read(write_strip_footing, order=2)
    finer = refine(straight, near(straight, (1.0, 0.0), "ground"))
    check_finer(straight, finer)
    assert geometry_dofmap(finer.tagged_mesh.mesh).shape[1] == 3


def test_what_cannot_be_refined_is_refused(comm: MPI.Intracomm, read: Read) -> None:
    curved = read(write_thick_tube, order=2)
    with pytest.raises(InputError, match=r"^cells are curved"):
        refine(curved, np.ones(len(corners(curved)), dtype=np.bool_))
    with pytest.raises(InputError, match=r"^fans of cells"):
        fan(stacked_blocks(comm, 1), np.array([0], dtype=np.int32))
