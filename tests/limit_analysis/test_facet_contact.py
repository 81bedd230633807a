"""Test upper bounds for contact on curved faces: mechanisms penetrate no facet."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem
from scipy.optimize import nnls

from meshes.pin_in_lug import write_pin_in_lug
from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Problem,
    Support,
    Traction,
    limit_bounds,
    read_gmsh,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis.body.proof_arrays import StressProof, VelocityProof
from perfplast_fenicsx.limit_analysis.facets.entering import (
    enclosing_cones,
    entering_between_nodes,
    without_entering,
)
from perfplast_fenicsx.mesh import gmsh_session, write_split
from perfplast_fenicsx.proof import check
from tests.models import STEEL

COMM = MPI.COMM_WORLD


@pytest.fixture
def mesh_of(shared_tmp_path: Path) -> Callable[[Callable[[Path], None]], Path]:
    """Return the mesh from a file that a function writes on one process."""

    def made(write: Callable[[Path], None]) -> Path:
        path = shared_tmp_path / "bodies.msh"
        if COMM.rank == 0:
            write(path)
        COMM.barrier()
        return path

    return made


def write_clamped_pin(path: Path) -> None:
    """Write a disk between the halves of a square plate, which touch each other beside the disk."""
    with gmsh_session() as gmsh:
        occ, model = gmsh.model.occ, gmsh.model
        halves = [(2, occ.addRectangle(-1, y, 0, 2, 1)) for y in (-1.0, 0.0)]
        occ.fragment(halves, [(2, occ.addDisk(0, 0, 0, 0.5, 0.5))])
        occ.synchronize()
        bodies: dict[str, list[int]] = {}
        for _, body in model.getEntities(2):
            name = ("lower", "upper")[occ.getCenterOfMass(2, body)[1] > 0]
            bodies.setdefault(name if occ.getMass(2, body) > 0.5 else "pin", []).append(body)
        sides: dict[str, list[int]] = {}
        for _, curve in model.getEntities(1):
            x, y, _ = occ.getCenterOfMass(1, curve)
            if len(model.getAdjacencies(1, curve)[0]) == 2:
                seam = "between" if abs(x) > 0.6 else ("low_seam", "high_seam")[y > 0]
                if abs(y) > 1e-9 or abs(x) > 0.6:
                    sides.setdefault(seam, []).append(curve)
            elif abs(y) > 0.9:
                sides[("bottom", "top")[y > 0]] = [curve]
        for name, tags in bodies.items():
            model.addPhysicalGroup(2, tags, name=name)
        for name, tags in sides.items():
            model.addPhysicalGroup(1, tags, name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.25)
        model.mesh.generate(2)
        write_split(path)


def clamped_pin(path: Path) -> Problem:
    return Problem(
        read_gmsh(COMM, path),
        dict.fromkeys(("lower", "upper", "pin"), STEEL),
        [Support("bottom")],
        [Traction("top", (-0.3, -1.0))],
        [
            Contact("pin_low_seam", "lower_low_seam"),
            Contact("pin_high_seam", "upper_high_seam"),
            Contact("lower_between", "upper_between"),
        ],
        degree=2,
    )


def pin_in_lug(path: Path) -> Problem:
    """Return half a lug, held at its end, and a pin that pulls away from it."""
    return Problem(
        read_gmsh(COMM, path),
        {"pin": STEEL, "lug": STEEL},
        [Support("x0", "x"), Support("z0", "z"), Support("end", "y")],
        [BodyForce("pin", (0.0, 1.0, 0.0))],
        [Contact("pin_bore", "lug_bore")],
        degree=2,
    )


@pytest.mark.serial
@pytest.mark.parametrize("d", [2, 3])
def test_directions_are_positive_sums_of_the_few(d: int) -> None:
    rng = np.random.default_rng(29)
    towards = rng.normal(size=(60, 1, d))
    towards /= np.linalg.norm(towards, axis=2, keepdims=True)
    given = towards + rng.uniform(-0.3, 0.3, size=(60, 7, d)) * rng.uniform(size=(60, 1, 1))
    known = rng.uniform(size=(60, 7)) > 0.5
    known[:, 0] = True
    given[:10] = given[:10, :1]  # a plane face
    vectors, count = enclosing_cones(given, known)
    assert (count[:10] == 1).all()
    assert (count <= d).all()
    assert count.max() == d
    for directions, there, few, many in zip(given, known, vectors, count, strict=True):
        assert np.linalg.cond(few[:many]) < 1000
        for direction in directions[there]:
            _, off = nnls(few[:many].T, direction)
            assert off < 1e-9


@pytest.mark.serial
def test_two_normals_of_an_edge_are_kept_and_opposite_ones_have_no_cone() -> None:
    edge = np.array([[[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [1.0, 0.0, 0.0]]])
    vectors, count = enclosing_cones(edge, np.ones((1, 3), dtype=bool))
    assert count.tolist() == [2]
    cosines = np.sort(vectors[0, :2] @ np.array([0.6, 0.8, 0.0]))
    assert np.allclose(cosines, [0.6, 1.0])
    apart = np.array([[[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]])
    assert enclosing_cones(apart, np.ones((1, 2), dtype=bool))[1].tolist() == [-1]
    assert enclosing_cones(0 * apart, np.ones((1, 2), dtype=bool))[1].tolist() == [0]


def test_a_pin_that_turns_enters_the_facets_of_its_hole(
    mesh_of: Callable[[Callable[[Path], None]], Path],
) -> None:
    problem = pin_in_lug(mesh_of(lambda path: write_pin_in_lug(path, 1.0)))
    x = problem.V.tabulate_dof_coordinates()
    inside = np.linalg.norm(x[:, :2], axis=1) < 1 + 1e-9
    v = fem.Function(problem.V)
    velocity = v.x.array.reshape(-1, 3)
    pin = np.zeros(len(x), dtype=bool)
    pin[problem.V.dofmap.list[problem.tagged_mesh.cells("pin")]] = True
    assert (inside | ~pin).all()
    velocity[pin] = np.column_stack([-x[pin, 1], x[pin, 0], 0 * x[pin, 0]])
    assert entering_between_nodes(problem, v) == ["the mechanism enters contact between nodes"]
    velocity[pin] = 0.0
    assert entering_between_nodes(problem, v) == []


@pytest.mark.long(but=["clamped_pin-write_clamped_pin"])
@pytest.mark.mpi2("clamped_pin-write_clamped_pin")
@pytest.mark.parametrize(
    ("make", "write"),
    [
        (pin_in_lug, lambda path: write_pin_in_lug(path, 1.0)),
        (clamped_pin, write_clamped_pin),
    ],
)
def test_bounds_are_proven(
    mesh_of: Callable[[Callable[[Path], None]], Path],
    make: Callable[[Path], Problem],
    write: Callable[[Path], None],
    shared_tmp_path: Path,
) -> None:
    """Where both halves meet the pin, three bodies meet, and their nodes move together."""
    problem = make(mesh_of(write))
    bounds = limit_bounds(problem)
    assert bounds.strict
    assert bounds.lower.value is not None
    assert bounds.upper.value is not None
    assert bounds.stress is not None
    assert 0 < bounds.lower.value < bounds.upper.value
    folder = ResultFolder(COMM, shared_tmp_path)
    path = folder.file("bounds.h5")
    write_proof(
        folder,
        path,
        StressProof(bounds.problem, bounds.lower.value, bounds.stress),
        VelocityProof(bounds.problem, bounds.upper.value, bounds.mechanism),
    )
    COMM.barrier()
    found = check(path)
    assert found["lower"].proven == pytest.approx(bounds.lower.value, rel=1e-9)
    assert found["upper"].proven == pytest.approx(bounds.upper.value, rel=1e-4)


def test_friction_on_curved_faces_has_no_strict_mechanism(
    mesh_of: Callable[[Callable[[Path], None]], Path],
) -> None:
    path = mesh_of(lambda path: write_pin_in_lug(path, 1.0))
    rough = [Contact("pin_bore", "lug_bore", tresca=10.0)]
    given = replace(pin_in_lug(path).given, contacts=rough)
    assert without_entering(Problem.from_given(read_gmsh(COMM, path), given)) is None
