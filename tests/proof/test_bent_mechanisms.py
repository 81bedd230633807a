"""Test that errors of a velocity increase an upper bound by as much as they cost.

The bodies are single cells with known limits, or blocks with a known lower bound.
"""

from collections.abc import Callable
from functools import partial
from itertools import combinations, product

import numpy as np
import numpy.typing as npt
import pytest

from perfplast_fenicsx.proof.body import Body
from perfplast_fenicsx.proof.checker import check, check_upper
from perfplast_fenicsx.proof.places import places_of
from perfplast_fenicsx.proof.volume_change import SIZE
from tests.proof.forging import Arrays, Halves, blocks, copied
from tests.proof.test_balance import cantilever, limit, pressed, strip

pytestmark = pytest.mark.serial

Velocity = Callable[[npt.NDArray], npt.NDArray]


def moving(them: Arrays, velocity: Velocity) -> Arrays:
    """Return the upper half with a velocity of vertices, shape (n, d)."""
    them = {name: values for name, values in them.items() if name != "stress"}
    places = places_of(Body.of(them))
    x = them["vertices"]
    x = np.concatenate([x, x[places.ends].mean(axis=1)])
    return {**them, "nodes": places.of_cells, "velocity": velocity(x)}


def pulled(length: float = 4.0, cells: int = 4) -> Arrays:
    """Return a strip between rollers under the tension 1 at its end: it yields at 2."""
    them = strip(length, cells)
    them["held"][:] = 0
    them["held"][-2, 0] = 1  # the left end along x, and the lower side along y
    them["held"][:cells, 1] = 1
    them["traction"][-1, :, 0] = 1.0
    return them


def stretched(x: npt.NDArray) -> npt.NDArray:
    """Return its mechanism."""
    return x * [1.0, -1.0]


def scaled(x: npt.NDArray, factors: tuple[float, float]) -> npt.NDArray:
    """Return a uniform expansion along both axes."""
    return x * np.array(factors)


@pytest.mark.parametrize("size", [0.0, *(10.0**-k for k in range(1, 16))])
def test_noise_costs_something(size: float) -> None:
    """No bound is below the limit, and little noise costs little."""
    random = np.random.default_rng(7)
    noise = size * random.normal(size=(100, 2))
    them = moving(pulled(), lambda x: stretched(x) + noise[: len(x)])
    reached = check_upper(them).reached
    assert reached is None or reached >= 2.0
    if size <= 1e-3:
        assert reached is not None
        assert reached <= 2.0 + 1e-12 + 2e3 * size


@pytest.mark.parametrize("slenderness", [10.0, 1e3, 1e5, 1e6])
@pytest.mark.parametrize("pressure", [0.0, 1.5, 1e3])
def test_a_hinge_that_changes_its_volume(slenderness: float, pressure: float) -> None:
    """Fibres that lengthen without a contraction dissipate half of the correct work (B4)."""
    them = cantilever(slenderness, 8)
    x = them["vertices"]
    x[np.isclose(x[:, 0], slenderness / 8), 0] = 1.0  # length and height of the hinge are equal
    if pressure:
        pressed(them, pressure)

    def hinge(x: npt.NDArray) -> npt.NDArray:
        near, up = np.minimum(x[:, 0], 1.0), x[:, 1] - 0.5
        return np.column_stack([near * up, -np.where(x[:, 0] < 1, near**2 / 2, x[:, 0] - 0.5)])

    reached = check_upper(moving(them, hinge)).reached
    assert reached is None or reached >= limit(slenderness) * (1 - 1.0 / slenderness)


def test_what_grows_has_to_grow_by_more_than_rounding() -> None:
    """On the edge of the cone a rate may lie outside; slightly beyond it is certainly inside."""
    slope = 0.5
    for share, fine in ((1 - 1e-9, False), (1.0, False), (1 + 1e-9, True)):
        them = pulled()
        them["cone_slope"] = np.array([[slope / 2, slope / 2, 0.0]])
        # ε = diag(1, −b) with tr ε = share · slope/√2 · ‖dev ε‖ · √2
        b = (1 - share * slope / np.sqrt(2)) / (1 + share * slope / np.sqrt(2))
        found = check_upper(moving(them, partial(scaled, factors=(1.0, -b))))
        assert (found.reached is not None) == fine, found.faults
        if not fine:
            assert any("dilate too little" in fault for fault in found.faults)


def test_volume_without_a_way_out() -> None:
    """A body held on all sides, except at an elastic body that is pulled away, cannot follow."""
    them = pulled()
    beside = (them["vertices"][them["facets"]][..., 0] >= 3.0).all(axis=1)
    them["held"] = np.where(beside[:, None], 0, np.ones_like(them["held"]))
    ends = them["vertices"][them["facets"]][..., 0]
    them["held"][ends.max(axis=1) == 3.0, 0] = 0  # where the elastic body begins
    them["cone"][-2:] = -1
    faults = check_upper(moving(them, lambda x: np.outer(x[:, 0] >= 3.0, [1.0, 0.0]))).faults
    assert any("no outlet" in fault for fault in faults), faults
    them["held"][0] = 0  # one facet is free
    faults = check_upper(moving(them, lambda x: np.outer(x[:, 0] >= 3.0, [1.0, 0.0]))).faults
    assert not any("no outlet" in fault for fault in faults), faults


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> tuple[Halves, float]:
    """Return two plane blocks on a plane, and their lower bound."""
    folder = tmp_path_factory.mktemp("honest")
    halves = blocks(folder, 2)
    low = check(folder / "bounds.h5")["lower"].proven
    assert low is not None
    return halves, low


def nodes_on(them: Arrays, flags: npt.NDArray) -> npt.NDArray:
    """Return the velocity nodes on given outer facets."""
    body = Body.of(them)
    places = places_of(body)
    nodes = np.zeros(places.count, dtype=np.int64)
    nodes[places.of_cells] = them["nodes"]
    return np.unique(nodes[places.of_facets[flags]])


def supports_move(them: Arrays, size: float) -> None:
    """Move the supported nodes."""
    at = nodes_on(them, np.asarray(them["held"].any(axis=1)))
    them["velocity"][at] += size


def bodies_enter(them: Arrays, size: float) -> None:
    """Move all contact nodes down by different distances."""
    at = nodes_on(them, np.isin(them["surface"], them["contacts"]))
    them["velocity"][at, 1] -= size * np.linspace(0, 1, len(at))


def planes_are_entered(them: Arrays, size: float) -> None:
    """Move all nodes on obstacles down."""
    them["velocity"][nodes_on(them, np.isin(them["surface"], them["obstacles"])), 1] -= size


def volumes_change(them: Arrays, size: float) -> None:
    """Contract everything towards a corner, on which the loads do work."""
    body = Body.of(them)
    x = np.zeros_like(them["velocity"])
    places = places_of(body)
    every = np.concatenate([body.vertices, body.vertices[places.ends].mean(axis=1)])
    x[them["nodes"]] = every[places.of_cells]
    them["velocity"] -= size * x


def elastic(them: Arrays, size: float) -> None:
    """Make the stronger block elastic; it strains."""
    them["cone"] = np.where(them["cone"] == np.argmax(them["cone_bound"]), -1, them["cone"])
    volumes_change(them, size)


def swept(them: Arrays, size: float) -> None:
    """Require slip to open the joint, which it does not do."""
    them["contact_friction"] = np.full(len(them["contacts"]), size)


EDITS = (supports_move, bodies_enter, planes_are_entered, volumes_change, elastic, swept)


@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_proves_no_less_than_is_carried(
    honest: tuple[Halves, float], edit: Callable[[Arrays, float], None]
) -> None:
    """Each edit has ten sizes."""
    halves, low = honest
    fine = 0
    for power in range(10):
        them = copied(halves)["upper"]
        edit(them, 10.0 ** (-14 + 1.5 * power))
        reached = check_upper(them).reached
        assert reached is None or reached >= low
        fine += reached is not None
    assert fine >= 5


class _Divided:
    """Velocities of one degree on a regular simplex that is divided at its centre.

    Attributes:
        rows: The coefficients of the divergence, of each of all coefficients.
        inside: Numbers of coefficients that are zero on no facet alone.
    """

    def __init__(self, dim: int, degree: int) -> None:
        x = np.zeros((dim + 1, dim))
        for i in range(1, dim + 1):
            x[i] = x[:i].mean(axis=0)
            x[i, i - 1] = np.sqrt(1 - ((x[0] - x[i]) ** 2).sum())
        self.x, self.dim, self.degree = x, dim, degree
        self.volume = abs(np.linalg.det(x[1:] - x[0])) / (2 if dim == 2 else 6)
        self.numbers: dict[tuple, int] = {}
        self.parts, centre = [], -1
        for out in range(dim + 1):
            names = [*(v for v in range(dim + 1) if v != out), centre]
            ends = np.array([x.mean(axis=0) if v == centre else x[v] for v in names])
            g = np.linalg.inv(ends[1:] - ends[:1]).T
            g = np.concatenate([-g.sum(axis=0, keepdims=True), g])
            number = {}
            for powers in self._powers(degree):
                key = tuple((v, n) for v, n in sorted(zip(names, powers, strict=True)) if n)
                number[powers] = self.numbers.setdefault(key, len(self.numbers))
            self.parts.append((names, g, number))
        self.lower = self._powers(degree - 1)
        self.inside = np.array([n for key, n in self.numbers.items() if key[0][0] == centre])
        self.rows = np.stack([self.gradients(it) for it in self._units()])
        self.rows = np.einsum("njii->jn", self.rows.reshape(len(self.rows), -1, dim, dim))

    def _powers(self, degree: int) -> list[tuple[int, ...]]:
        every = product(range(degree + 1), repeat=self.dim + 1)
        return [powers for powers in every if sum(powers) == degree]

    def _units(self) -> npt.NDArray:
        count = len(self.numbers) * self.dim
        return np.eye(count).reshape(count, -1, self.dim)

    def gradients(self, u: npt.NDArray) -> npt.NDArray:
        """Return the coefficients of the gradient on all parts."""
        found = []
        for _, g, number in self.parts:
            for powers in self.lower:
                more = [
                    tuple(n + (i == j) for j, n in enumerate(powers)) for i in range(self.dim + 1)
                ]
                outer = [np.outer(u[number[m]], g[i]) for i, m in enumerate(more)]
                found.append(self.degree * sum(outer))
        return np.array(found)

    def solved(self, u: npt.NDArray, divergence: npt.NDArray) -> npt.NDArray:
        """Return gradients of the smallest velocity with a divergence and given facet values."""
        free = (self.inside[:, None] * self.dim + np.arange(self.dim)).ravel()
        rest = divergence - self.rows @ u.ravel()
        more = np.linalg.lstsq(self.rows[:, free], rest, rcond=None)[0]
        assert np.abs(self.rows[:, free] @ more - rest).max() < 1e-10
        u = u.ravel().copy()
        u[free] += more
        return self.gradients(u.reshape(-1, self.dim))

    def of_linear(self, q: npt.NDArray) -> npt.NDArray:
        """Return the coefficients of a linear function from its values at the vertices."""
        found = []
        for names, _, _ in self.parts:
            ends = np.array([q.mean() if v < 0 else q[v] for v in names])
            found += [np.dot(powers, ends) / (self.degree - 1) for powers in self.lower]
        return np.array(found)


@pytest.mark.parametrize("dim", [2, 3])
def test_constants(dim: int) -> None:
    """The sizes of velocities on the regular simplex do not exceed the constants in use."""
    it = _Divided(dim, dim)
    zero = np.zeros((len(it.numbers), dim))
    sizes = 0.0
    for vertex in range(dim + 1):
        q = np.where(np.arange(dim + 1) == vertex, 1.0, 0.0) - 1 / (dim + 1)
        sizes = sizes + np.linalg.norm(it.solved(zero, it.of_linear(q)), axis=(1, 2))
    assert np.max(sizes) <= SIZE[dim][0] <= 1.01 * np.max(sizes)
    edge = tuple((v, 1) for v in range(1, dim + 1))
    area = 1.0 if dim == 2 else np.sqrt(3) / 4
    outward = it.x[1:].mean(axis=0) - it.x[0]
    outward /= np.linalg.norm(outward)
    found = []
    for axis in np.eye(dim):
        bump = zero.copy()
        bump[it.numbers[edge]] = {2: 3.0, 3: 10.0}[dim] * axis  # its mean is 1
        flux = area * (axis @ outward) / it.volume
        found.append(it.solved(bump, np.full(len(it.rows), flux)))
    each = np.stack(found, axis=-1).reshape(len(found[0]), dim * dim, dim)
    largest = np.linalg.norm(each, ord=2, axis=(1, 2)).max()
    assert largest <= SIZE[dim][1] <= 1.01 * largest


def test_pairs_of_vertices_are_those_of_nodes() -> None:
    """Edges have the same numbers as in files."""
    body = Body.of(strip(2.0, 2))
    places = places_of(body)
    ends = body.cells[:, list(combinations(range(3), 2))]
    assert (np.sort(ends, axis=2) == places.ends[places.of_cells[:, 3:] - len(body.vertices)]).all()
