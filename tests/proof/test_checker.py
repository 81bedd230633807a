"""Test that the checker verifies a file of bounds alone, and finds violated conditions."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import h5py
import numpy as np
import numpy.typing as npt
import pytest

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Plane,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    VonMises,
    stacked_blocks,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import (
    interior_point,
    strict_upper_bound,
    without_entering,
)
from perfplast_fenicsx.limit_analysis.body.proof_arrays import StressProof, VelocityProof
from perfplast_fenicsx.mesh.alfeld_split import alfeld_split
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.proof import Checked, ProofError, check
from perfplast_fenicsx.proof.body import Body
from perfplast_fenicsx.proof.checker import check_lower, check_upper
from perfplast_fenicsx.proof.mechanism import mechanism_of
from perfplast_fenicsx.proof.parts import halved
from perfplast_fenicsx.proof.places import Places

COMM = MPI.COMM_WORLD
WEAK = VonMises(young=2e5, poisson=0.3, yield_stress=300.0)
STRONG = VonMises(young=2e5, poisson=0.3, yield_stress=450.0)
HEIGHTS = (0.7, 1.2)
WEIGHT = 0.5
LIMIT = WEAK.yield_stress / (1 + WEIGHT * HEIGHTS[1])
"""The lower block yields under the pressure on the upper block and its weight."""

Arrays = dict[str, npt.NDArray]


def stack() -> Problem:
    """Return two stacked blocks on a plane, split."""
    return Problem(
        alfeld_split(stacked_blocks(COMM, 2, heights=HEIGHTS)),
        {"lower": WEAK, "upper": STRONG},
        [Support("x0", "x"), Support("y0", "y")],
        [Pressure("top", 1.0), BodyForce("upper", (0.0, 0.0, -WEIGHT))],
        [Contact("lower_top", "upper_bottom")],
        [Plane("bottom", (0.0, 0.0, 0.0), (0.0, 0.0, 2.0))],
        degree=2,
    )


def stress(problem: Problem) -> npt.NDArray:
    """Return the uniaxial stress at the limit load, at the vertices of the cells."""
    cells, points = corners(problem.tagged_mesh.mesh)
    above = np.clip(sum(HEIGHTS) - points[cells][:, :, 2], 0, HEIGHTS[1])
    values = np.zeros((*cells.shape, 6))
    values[..., 2] = -LIMIT * (1 + WEIGHT * above)
    return values


@pytest.fixture(scope="module")
def proof(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a file with both bounds for the stack."""
    folder = ResultFolder(COMM, COMM.bcast(tmp_path_factory.mktemp("proof")))
    problem = stack()
    mended = without_entering(problem)
    assert mended is not None
    mechanism = interior_point(mended).mechanism
    upper = strict_upper_bound(problem, mechanism)
    assert upper.strict
    assert upper.value is not None
    path = folder.file("bounds.h5")
    write_proof(
        folder,
        path,
        StressProof(problem, LIMIT, stress(problem)),
        VelocityProof(problem, upper.value, mechanism),
    )
    COMM.barrier()
    return path


def arrays(path: Path, kind: str) -> Arrays:
    """Return the arrays of a half of the file."""
    with h5py.File(path) as file:
        found = {name: np.asarray(file[kind][name]) for name in file[kind]}
        return found | {"bound": np.asarray(file[kind].attrs["bound"])}


def radii(them: Arrays) -> npt.NDArray:
    """Return the yield radius of each cell."""
    found: npt.NDArray = them["cone_bound"][them["cone"]]
    return found


@pytest.mark.mpi3
def test_both_bounds_are_proven(proof: Path) -> None:
    found = check(proof)
    assert found["lower"].proven == pytest.approx(LIMIT, rel=1e-9)
    assert found["lower"].proven is not None
    assert found["lower"].proven < LIMIT  # minus the possible cost of rounding of the stress
    assert found["upper"].proven == pytest.approx(LIMIT, rel=1e-4)
    assert found["upper"].proven is not None
    assert found["upper"].proven == pytest.approx(found["upper"].claimed, rel=1e-9)
    assert found["upper"].proven >= LIMIT * (1 - 1e-9)
    for checked in found.values():
        assert not checked.faults
        assert "is proven" in str(checked)
        assert max(checked.measured.values(), default=0.0) <= 1 + 1e-12


def times(name: str, factor: float) -> Callable[[Arrays], None]:
    """Return a function that multiplies a whole array."""

    def change(them: Arrays) -> None:
        them[name] = them[name] * factor

    return change


def add(name: str, where: tuple, value: npt.ArrayLike) -> Callable[[Arrays], None]:
    """Return a function that adds to a part of an array."""

    def change(them: Arrays) -> None:
        them[name] = them[name].copy()
        them[name][where] += value

    return change


def shear_everywhere(them: Arrays) -> None:
    """Add a uniform stress that is in equilibrium, but not at the surfaces."""
    them["stress"] = them["stress"] / 2
    them["bound"] = them["bound"] / 2
    them["stress"][:, :, 0, 2] += 10.0
    them["stress"][:, :, 2, 0] += 10.0


def less_above(them: Arrays) -> None:
    """Reduce the pressure on the upper block below its contact pressure."""
    above = np.isclose(radii(them), STRONG.yield_radius)
    them["stress"][~above] *= 0.9


def linear_in_a_weak_cell(them: Arrays) -> None:
    """Change one corner of a cell that yields; strong cells carry such a change at no cost."""
    them["stress"][np.argmin(radii(them)), 0, 1, 1] += 1e-3


BROKEN_STRESSES: dict[str, tuple[Callable[[Arrays], None], str]] = {
    "too large": (times("cone_bound", 0.99), "times as large"),
    "another load": (times("bound", 1.01), "outer tractions"),
    "weightless": (times("body_force", 0.5), "equilibrium"),
    "a jump": (add("stress", (7, slice(None), 0, 0), 1.0), "tractions"),
    "a linear one": (linear_in_a_weak_cell, "equilibrium"),
    "no symmetry": (add("stress", (slice(None), slice(None), 0, 1), 1.0), "asymmetry"),
    "shear": (shear_everywhere, "outer tractions"),
    "pull": (times("stress", -1.0), "tension"),
    "unequal": (less_above, "unequal pressures"),
    "nan": (add("stress", (3, 0, 0, 0), np.nan), "equilibrium"),
}


@pytest.mark.parametrize("name", BROKEN_STRESSES)
def test_a_broken_stress_is_found(proof: Path, name: str) -> None:
    change, word = BROKEN_STRESSES[name]
    them = arrays(proof, "lower")
    change(them)
    refused(check_lower(them), word)


def into_the_plane(them: Arrays) -> None:
    """Move everything down."""
    them["velocity"] = them["velocity"] - [0, 0, 1]


BROKEN_VELOCITIES: dict[str, tuple[Callable[[Arrays], None], str]] = {
    "less than proven": (times("bound", 0.99), "only"),
    "stronger": (times("cone_bound", 1.01), "only"),
    "smaller loads": (times("traction", 0.5), "only"),
    "at rest": (lambda them: them.update(velocity=0 * them["velocity"]), "no work"),
    "volume": (add("velocity", (5, 0), 1e-3), "only"),
    "moved": (add("velocity", (slice(None), 0), 1e-3), "only"),
    "entering": (into_the_plane, "no work"),
    "elastic": (
        lambda them: them["cone"].__setitem__(np.isclose(radii(them), radii(them).min()), -1),
        "no work",
    ),
}


@pytest.mark.parametrize("name", BROKEN_VELOCITIES)
def test_a_broken_velocity_is_found(proof: Path, name: str) -> None:
    change, word = BROKEN_VELOCITIES[name]
    them = arrays(proof, "upper")
    change(them)
    refused(check_upper(them), word)


def refused(checked: Checked, word: str) -> None:
    """Check that nothing is proven, and that the reason contains a word."""
    assert word in "; ".join(checked.faults)
    assert "is not proven" in str(checked)


def test_entering_between_three_nodes_is_found(proof: Path) -> None:
    """Jumps 0, 0 at the ends and < 0 in the middle penetrate nowhere; 0 and 0 at one half do."""
    them = arrays(proof, "upper")
    cells, nodes = them["cells"], them["nodes"]
    x = np.zeros((len(them["velocity"]), 3))
    x[nodes[:, :4]] = them["vertices"][cells]
    pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    x[nodes[:, 4:]] = them["vertices"][cells[:, pairs]].mean(axis=2)
    at_seam = np.isclose(x[:, 2], HEIGHTS[0])
    upper = np.zeros(len(x), dtype=bool)
    upper[nodes[np.isclose(radii(them), STRONG.yield_radius)]] = True
    quarter = np.rint(4 * x[:, 0]).astype(int)  # nodes are a quarter apart
    body = Body.of(them)
    for apart, enters in ((quarter % 2 == 1, False), (quarter == 4, True)):
        v = np.zeros_like(x)
        v[:, 2] = np.where(upper & at_seam, apart, 0.0)
        found = mechanism_of(body, v[nodes])
        assert found.reason is None
        at = bernstein(found.places, v[nodes])
        assert (np.abs(found.at.mid - at).max() > 0.1) == enters  # bent until nothing penetrates


def bernstein(places: Places, v: npt.NDArray) -> npt.NDArray:
    """Return the coefficients of a straight velocity."""
    values = np.zeros((places.count, v.shape[2]))
    values[places.of_cells] = v
    n = places.count - len(places.ends)
    values[n:] = 2 * values[n:] - values[places.ends].mean(axis=1)
    return values


def swap_a_node(them: Arrays) -> None:
    """Give a cell a midside node that differs from its neighbour's."""
    them["nodes"][0, 5] = them["nodes"][0, 6]


def torn(them: Arrays) -> None:
    """Omit a facet."""
    for name in ("facets", "surface", "held", "traction"):
        them[name] = them[name][:-1]


def flat(them: Arrays) -> None:
    """Make a cell without volume."""
    them["vertices"][them["cells"][0, 0]] = them["vertices"][them["cells"][0, 1]]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (swap_a_node, "not continuous"),
        (torn, "not the outer facets"),
        (flat, "no volume"),
        (add("cells", (0, 0), 10**6), "do not exist"),
        (times("cone_bound", -1.0), "is negative"),
        (times("obstacle_normals", 2.0), "unit vector"),
        (times("vertices", np.nan), "not finite"),
        (lambda them: them.pop("held"), "held is missing"),
        (lambda them: them.update(traction=them["traction"][:, :2]), "traction"),
        (lambda them: them.update(nodes=them["nodes"][:, :4]), "do not fit"),
    ],
)
def test_what_is_no_proof_is_refused(
    proof: Path, change: Callable[[Arrays], None], word: str
) -> None:
    them = arrays(proof, "upper")
    change(them)
    with pytest.raises(ProofError, match=word):
        check_upper(them)


def test_files_that_are_none(shared_tmp_path: Path) -> None:
    with pytest.raises(ProofError, match="not a proof of bounds"):
        check(shared_tmp_path / "nothing.h5")


@pytest.mark.parametrize("dim", [2, 3])
def test_the_rule_is_exact_for_linear_functions_and_from_above(dim: int) -> None:
    points, shares = halved(dim, 3)
    assert np.isclose(shares.sum(), 1)
    # Products of two linear functions, too: ∫ λ_i λ_j = (1 + δ_ij)/((d + 1)(d + 2)).
    assert np.allclose(shares.T @ points, (np.eye(dim + 1) + 1) / ((dim + 1) * (dim + 2)))
    shares = shares.sum(axis=1)
    assert np.allclose(shares @ points, 1 / (dim + 1))
    exact = 2 / ((dim + 1) * (dim + 2))
    coarse = 1 / (dim + 1)
    found = shares @ points[:, 0] ** 2
    assert exact < found < exact + (coarse - exact) / 50


@pytest.mark.skipif(COMM.size > 1, reason="a process that uses MPI starts no other")
def test_the_command_uses_nothing_of_the_program(proof: Path) -> None:
    script = (
        "import runpy, sys; sys.argv[1:] = [sys.argv[1]]\n"
        "try: runpy.run_module('perfplast_fenicsx.proof', run_name='__main__')\n"
        "except SystemExit as end: status = end.code\n"
        "assert not {'dolfinx', 'mpi4py', 'petsc4py', 'ufl'} & set(sys.modules)\n"
        "sys.exit(status)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(proof)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("is proven") == 2
