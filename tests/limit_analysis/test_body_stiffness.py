"""Test K from moduli at points against strain rates, moduli and forces of a velocity."""

from collections.abc import Callable

from mpi4py import MPI

import numpy as np
import pytest

from meshes.strip_footing import write_strip_footing
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import Pressure, Problem, Support, Tie, VonMises, stacked_blocks
from perfplast_fenicsx.limit_analysis.conic.cone import Moduli
from perfplast_fenicsx.limit_analysis.discrete.body_stiffness import BodyStiffness
from perfplast_fenicsx.limit_analysis.discrete.point_strains import PointCoordinates, PointStrains
from tests.materials.energy_cap import Foam
from tests.models import STEEL, Read, two_blocks_problem
from tests.solvers.linear.systems import corner_problem, quadratic_problem

COMM = MPI.COMM_WORLD


def footing(read: Read) -> Problem:
    mesh = read(write_strip_footing, size=1.0, order=2)
    laws = dict.fromkeys(mesh.volumes, STEEL)
    return Problem(mesh, laws, [Support("bottom")], [Pressure("footing", 1.0)], degree=2)


def tube(read: Read) -> Problem:
    mesh = read(write_thick_tube, outer=2.0, size=0.5).turned()
    laws = dict.fromkeys(mesh.volumes, STEEL)
    return Problem(mesh, laws, [Support("y0", "y")], [Pressure("inner", 1.0)])


def foam(read: Read) -> Problem:
    """Return a problem with a law whose cones have oblique axes."""
    return Problem(
        stacked_blocks(COMM, 1),
        {"lower": Foam(1e4, 0.3, 10.0, 3.0), "upper": VonMises(2e5, 0.3, 100.0)},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", 1.0)],
        contacts=[Tie("lower_top", "upper_bottom")],
        degree=2,
    )


def random_moduli(at: PointCoordinates, m: int) -> Moduli:
    """Return random moduli of all kinds at once."""
    rng = np.random.default_rng(COMM.rank)
    count = len(at.radii)
    bulk, a = rng.uniform(1, 3, count), rng.uniform(1, 2, count)
    normal, along = rng.normal(size=(2, count, m))
    normal /= 1.1 * np.linalg.norm(normal, axis=1)[:, None]
    whole = np.arange(0, count, 7)
    roots = rng.normal(size=(len(whole), 1 + m, 1 + m))
    if at.isotropic:
        stresses = slice(at.normal)
        for deviator in (normal, along, np.swapaxes(roots, 1, 2)[:, :, 1:]):
            deviator[..., stresses] -= deviator[..., stresses].mean(axis=-1, keepdims=True)
    return Moduli(bulk, a, normal, along).with_whole(whole, roots)


@pytest.mark.mpi3("quadratic")
@pytest.mark.parametrize(
    "make",
    [
        lambda read: quadratic_problem(),
        lambda read: two_blocks_problem(2),
        lambda read: corner_problem(),
        *(footing, tube, foam),
    ],
    ids=["quadratic", "linear", "two normals", "plane", "axisymmetric", "other cones"],
)
def test_it_is_the_forces_of_moduli_times_strain_rates(
    make: Callable[[Read], Problem], read: Read
) -> None:
    problem = make(read)
    strains = PointStrains(problem)
    bodies = BodyStiffness(problem, strains)
    T, y, u, image, found, expected = problem.basis.T, *(problem.create_vector() for _ in range(5))
    first = u.getOwnershipRange()[0]
    owned = len(u.array_r)
    free = ~problem.fixed.ravel()[:owned]
    u.array[:] = np.cos(first + np.arange(owned)) * free
    problem.basis.M.mult(u, y)
    T.mult(y, u)  # ties hold
    p, s = strains.of(y)
    for _ in range(2):  # the last result leaves no trace
        moduli = random_moduli(strains.coordinates, s.shape[1])
        stress = np.einsum("nij,nj->ni", moduli.matrices(), np.column_stack([p, s]))
        strains.forces(stress[:, 0].copy(), stress[:, 1:].copy(), expected)
        bodies.assemble(moduli)
        bodies.matrix.mult(u, image)
        T.multTranspose(image, found)
        found.axpy(-1.0, expected)
        assert found.norm() < 1e-12 * expected.norm()
    diagonal = bodies.matrix.getDiagonal()
    np.testing.assert_allclose(diagonal.array[~free], 1.0, rtol=1e-12)
