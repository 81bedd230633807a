"""Test strict bounds for bodies of revolution around exact limit loads, on any number of ranks."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from meshes.ring import write_ring
from meshes.strip_footing import write_strip_footing
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    BodyForce,
    Contact,
    DruckerPrager,
    Elastic,
    InputError,
    Plane,
    PorePressure,
    Pressure,
    Problem,
    Support,
    Tie,
    Traction,
    VonMises,
)
from perfplast_fenicsx.arrays import matrices
from perfplast_fenicsx.compat import geometry_dofmap
from perfplast_fenicsx.io import OutputFields
from perfplast_fenicsx.limit_analysis import BodyBounds, limit_bounds
from perfplast_fenicsx.limit_analysis.discrete.point_strains import nodes_of_cells
from perfplast_fenicsx.limit_analysis.facets.ring_flux import by_flux, nodal_velocity
from perfplast_fenicsx.limit_analysis.statements.limit_checks import idle_pores
from perfplast_fenicsx.materials.coulomb_ground import MohrCoulomb, Tresca
from perfplast_fenicsx.mesh.ring_polynomials import (
    EDGES,
    coefficients_of_radius,
    of_parts,
    polynomials,
    ring_rates,
    weights_of_rates,
)
from perfplast_fenicsx.mesh.straight_geometry import corners, gradients
from tests.contact.blocks_apart import blocks_apart
from tests.limit_analysis.test_static_bound import rectangle
from tests.models import Read

STEEL = VonMises(young=1e3, poisson=0.3, yield_stress=math.sqrt(3.0))
"""Steel with the shear strength k = 1."""


ANGLE = 20.0
"""Friction angle (degrees) of ground with cohesion 1."""

SOIL = MohrCoulomb(young=1e3, poisson=0.3, cohesion=1.0, friction_angle=ANGLE)

ROUND_CONE = DruckerPrager(
    young=1e3, poisson=0.3, cohesion=1.0, friction_angle=ANGLE, match="compression"
)

PASSIVE = math.tan(math.radians(45 + ANGLE / 2)) ** 2
"""Ratio of lateral to axial pressure at which ground without cohesion yields."""


def disc(n: int, law: object = STEEL, around: float = 0.0, **friction: float) -> Problem:
    """Return a disc of radius 1 and height 1/2 on a plane, under pressure from above.

    Args:
        n: Cells of the height.
        law: Law of the disc.
        around: Constant pressure on its side.
        friction: Friction of the plane.
    """
    mesh = rectangle(
        (2 * n, n),
        (1.0, 0.5),
        {"disc": lambda x: x[1] < 2},
        {
            "bottom": lambda x: x[1] < 1e-9,
            "top": lambda x: x[1] > 0.5 - 1e-9,
            "side": lambda x: x[0] > 1 - 1e-9,
        },
        shake=0.1,
    )
    loads = [Traction("top", [0.0, -1.0])]
    loads += [Pressure("side", around, constant=True)] if around else []  # type: ignore[list-item]
    return Problem(
        mesh.turned(),
        {"disc": law},  # type: ignore[dict-item]
        [],
        loads,
        [],
        [Plane("bottom", [0.0, 0.0], [0.0, 1.0], name="floor", **friction)],  # type: ignore[arg-type]
        degree=2,
    )


def tube(read: Read, law: object = STEEL) -> Problem:
    """Return a tube between planes, under internal pressure."""
    mesh = read(write_ring, inner=1.0, outer=2.0, height=0.4, size=0.2).turned()
    held = [Support("bottom", "y"), Support("top", "y")]
    laws = {"ring": law}
    return Problem(mesh, laws, held, [Pressure("inner", 1.0)], degree=2)  # type: ignore[arg-type]


def tubes(read: Read, outward: float = 0.0) -> Problem:
    """Return the same for two tubes, one in the other, with nonmatching nodes."""
    mesh = read(write_ring, outer=2.0, height=0.3, interface=1.5, size=0.2).turned()
    cells = mesh.cells("outer_ring")
    nodes = np.unique(geometry_dofmap(mesh.mesh)[cells])
    mesh.mesh.geometry.x[nodes, 0] += outward
    held = [Support("bottom", "y"), Support("top", "y")]
    laws = dict.fromkeys(mesh.volumes, STEEL)
    return Problem(mesh, laws, held, [Pressure("inner", 1.0)], [SEAM], degree=2)


SEAM = Contact("inner_ring_seam", "outer_ring_seam")


def column(dead: float = 0.0, law: object = STEEL) -> Problem:
    """Return a column of radius 1 that stands on its end, under its weight."""
    mesh = rectangle(
        (3, 6),
        (1.0, 2.0),
        {"column": lambda x: x[1] < 3},
        {
            "bottom": lambda x: x[1] < 1e-9,
            "side": lambda x: x[0] > 1 - 1e-9,
        },
    ).turned()
    loads = [BodyForce("column", [0.0, -1.0])]
    loads += [Pressure("side", dead, constant=True)] if dead else []  # type: ignore[list-item]
    held = [Plane("bottom", [0.0, 0.0], [0.0, 1.0])]
    return Problem(mesh, {"column": law}, [], loads, [], held, degree=2)  # type: ignore[dict-item]


def check(bounds: BodyBounds, exact: float, width: float) -> None:
    assert bounds.strict, bounds.why_not
    lower, upper = bounds.lower.value, bounds.upper.value
    assert lower is not None
    assert upper is not None
    assert lower <= exact * (1 + 1e-9)
    assert exact <= upper * (1 + 1e-9)
    assert upper - lower <= width * exact
    assert bounds.shares is not None
    gap = bounds.problem.comm.allreduce(float(bounds.shares.sum()))
    assert gap == pytest.approx(upper - lower, abs=2e-3 * exact)


def test_pressure_of_shells_that_touch_on_the_axis(read: Read) -> None:
    """One shell exerts the force 2σ_y ln(b/c) π c² on the other shell along the axis."""
    seam, shape = 1.4, {"outer": 2.0, "size": 0.2}
    mesh = read(write_thick_tube, interface=seam, **shape).turned()
    problem = Problem(
        mesh,
        dict.fromkeys(mesh.volumes, STEEL),
        [Support("y0", "y")],
        [Pressure("inner", 1.0)],
        [Contact("inner_tube_seam", "outer_tube_seam")],
        degree=2,
    )
    found = limit_bounds(problem).mesh
    assert found.stress is not None
    assert found.contact_forces is not None
    fields = OutputFields(problem)
    fields.of_stress(found.stress, found.contact_forces)
    pressure = 2 * STEEL.yield_stress * math.log(2.0 / seam)
    assert -fields.resultants[0][1] == pytest.approx(pressure * math.pi * seam**2, rel=5e-3)


@pytest.mark.long(but=["disc", "tube", "tubes meshed apart", "Tresca", "weight"])
@pytest.mark.parametrize(
    ("problem", "exact", "width"),
    [
        (lambda _: disc(2), math.sqrt(3.0), 2e-3),
        (tube, 2 * math.log(2.0), 3e-4),
        (tubes, 2 * math.log(2.0), 2e-2),
        (lambda _: disc(2, Tresca(young=1e3, poisson=0.3, cohesion=1.0)), 2.0, 2e-3),
        # σ_z = −λ(2 − z), and nothing else acts at the foot, which yields at σ_z = −2λ = −k√3
        (lambda _: column(), math.sqrt(3.0) / 2, 0.25),
        (lambda _: column(law=SOIL), math.sqrt(PASSIVE), 0.25),
    ],
    ids=["disc", "tube", "tubes meshed apart", "Tresca", "weight", "weight of ground"],
)
def test_exact_limit_loads_lie_between(
    read: Read, problem: Callable[[Read], Problem], exact: float, width: float
) -> None:
    found = limit_bounds(problem(read))
    if width > 0.1:  # no exact value; the upper bound exceeds that of a uniform stress
        assert found.strict
        assert found.lower.value is not None
        assert found.upper.value is not None
        assert exact * (1 - 1e-3) < found.upper.value
        assert found.lower.value < found.upper.value < found.lower.value * (1 + width)
        return
    check(found, exact, width)


@pytest.mark.long(but=["column", "constant pressure around", "Drucker\\u2013Prager"])
@pytest.mark.mpi3("column")
@pytest.mark.parametrize(
    ("problem", "exact", "width"),
    [
        (lambda _: disc(2, SOIL), 2 * math.sqrt(PASSIVE), 2e-3),
        (lambda _: disc(2, SOIL, around=0.5), 2 * math.sqrt(PASSIVE) + PASSIVE / 2, 2e-3),
        (lambda _: disc(2, ROUND_CONE), 2 * math.sqrt(PASSIVE), 2e-3),
        # (H + p)/H = (b/a)^(1 − 1/N) with H = c cot φ and N = PASSIVE
        (
            lambda read: tube(read, SOIL),
            (2 ** (1 - 1 / PASSIVE) - 1) / math.tan(math.radians(ANGLE)),
            4e-3,
        ),
    ],
    ids=["column", "constant pressure around", "Drucker–Prager", "tube"],
)
def test_exact_limit_loads_of_ground_that_dilates(
    read: Read, problem: Callable[[Read], Problem], exact: float, width: float
) -> None:
    check(limit_bounds(problem(read)), exact, width)


@pytest.mark.long
def test_a_smooth_circular_footing_beside_a_surcharge(read: Read) -> None:
    """A shift of stresses by c cot φ replaces c. So both bounds satisfy N_q = 1 + N_c tan φ."""
    mesh = read(write_strip_footing, size=0.5, punch=True, width=3.0, depth=3.0).turned()

    def found(surcharge: float) -> BodyBounds:
        loads = [Pressure("top", 1.0)]
        loads += [Pressure("free", surcharge, constant=True)] if surcharge else []
        return limit_bounds(
            Problem(
                mesh,
                {"ground": SOIL, "punch": Elastic(1e7, 0.3)},
                [Support("side", "x"), Support("bottom")],
                loads,
                [Contact("ground_footing", "punch_footing")],
                degree=2,
            ),
            1e-5,
        )

    alone, beside, q = found(0.0), found(0.7), 0.7
    exact = 20.077
    assert alone.strict
    assert beside.strict
    assert alone.lower.value is not None
    assert alone.upper.value is not None
    assert alone.lower.value < exact < alone.upper.value < 1.25 * alone.lower.value
    gain = math.tan(math.radians(ANGLE))
    for one, other in ((alone.lower, beside.lower), (alone.upper, beside.upper)):
        assert one.value is not None
        assert other.value == pytest.approx(q + (1 + q * gain) * one.value, rel=1e-3)


def test_ground_dilates_by_enough_between_the_coefficients() -> None:
    """This holds at random points in cells; the dissipation there sums at most to the bound."""
    found = limit_bounds(disc(2, SOIL))
    vertices, points = corners(found.problem.tagged_mesh.mesh)
    x = points[vertices]
    nodes, _ = nodes_of_cells(found.flow.problem, len(x))
    v = found.flow.velocity.x.array.reshape(-1, 2)[nodes]
    sine, steepness = math.sin(math.radians(ANGLE)), 1 / math.tan(math.radians(ANGLE))
    at = np.random.default_rng(2).dirichlet(np.ones(3), 400)
    radii = x[..., 0] @ at.T
    rates = np.einsum("pi,cim->cpm", polynomials(at), ring_rates(x, v)) / radii[..., None] ** 2
    values = np.linalg.eigvalsh(matrices(rates.reshape(-1, 4))).reshape(*rates.shape[:2], 3)
    growth, sizes = values.sum(axis=2), np.abs(values).sum(axis=2)
    assert (growth >= (sine - 1e-9) * sizes).all()
    _, areas = gradients(x)
    power = 2 * math.pi * float(areas @ (radii * steepness * growth).mean(axis=1))
    power = found.problem.comm.allreduce(power)
    assert found.upper.value is not None
    assert power <= found.upper.value * 1.01  # 400 points
    assert power == pytest.approx(found.upper.value, rel=2e-2)


@pytest.mark.long
def test_a_sphere_by_polygons(read: Read) -> None:
    """The bounds hold for the polygonal body, whose corners lie on both spheres."""
    mesh = read(write_thick_tube, outer=2.0, size=0.15).turned()
    loads = [Pressure("inner", 1.0)]
    found = limit_bounds(Problem(mesh, {"tube": STEEL}, [Support("y0", "y")], loads, degree=2))
    exact = 2 * math.sqrt(3.0) * math.log(2.0)
    assert found.strict
    assert found.upper.value == pytest.approx(exact, rel=2e-3)
    assert found.lower.value == pytest.approx(exact, rel=1e-2)


@pytest.mark.long
def test_constant_pressure_beside_a_growing_one() -> None:
    alone, beside = limit_bounds(column()), limit_bounds(column(0.5))
    assert beside.strict
    assert alone.upper.value is not None
    assert beside.lower.value is not None
    assert beside.upper.value is not None
    # pressure on all faces except the top makes the column weaker, never stronger
    assert beside.lower.value < beside.upper.value < alone.upper.value + 0.5


@pytest.mark.long
def test_friction_bears_more_the_more_there_is() -> None:
    found = [limit_bounds(disc(2, tresca=c)) if c else limit_bounds(disc(2)) for c in (0.0, 0.5)]
    assert all(it.strict for it in found)
    known = [it.upper.value for it in found[:1]] + [it.lower.value for it in found[1:]]
    assert known[0] is not None
    assert known[1] is not None
    assert known[0] < known[1]


def test_the_velocity_is_that_of_the_flux(read: Read) -> None:
    problem = tube(read)
    found = limit_bounds(problem)
    u, x = found.mechanism.x.array.reshape(-1, 2), problem.V.tabulate_dof_coordinates()
    middle = problem.V.dofmap.index_map.size_local
    speeds = (u[:middle, 0] * x[:middle, 0]).round(9)
    parts = problem.comm.allgather(speeds)
    every = np.concatenate(parts)
    assert np.ptp(every) < 0.05 * np.abs(every).max()  # u_r = c/r with one c everywhere
    work = float(problem.loads.live.dot(found.mechanism.x.petsc_vec))
    assert work == pytest.approx(1.0, rel=1e-9)


def test_motions_along_the_axis_strain_nothing() -> None:
    problem = disc(1)
    flux = by_flux(problem)
    v = fem.Function(flux.V)
    v.x.array.reshape(-1, 2)[:, 1] = flux.V.tabulate_dof_coordinates()[:, 0]
    form = fem.form(
        sum(e**2 for e in flux.kinematics.strain(v)) * flux.dx  # type: ignore[operator]
    )
    assert problem.comm.allreduce(fem.assemble_scalar(form)) < 1e-25
    u = nodal_velocity(problem, v)
    assert np.abs(u.x.array.reshape(-1, 2) - [0.0, 1.0]).max() < 1e-12


@pytest.mark.long(but=["2-3-False", "3-3-True"])
@pytest.mark.mpi2("2-3-False")
@pytest.mark.parametrize("tied", [False, True])
@pytest.mark.parametrize(("lower", "upper"), [(2, 3), (3, 3)])
def test_blocks_that_meet_on_the_axis(lower: int, upper: int, tied: bool) -> None:
    """Column of two blocks with an irregular mesh: at the axis, only symmetry gives their shear."""
    mesh = blocks_apart(MPI.COMM_WORLD, [lower] * 2, [upper] * 2).turned()
    pair = ("lower_top", "upper_bottom")
    problem = Problem(
        mesh,
        dict.fromkeys(mesh.volumes, STEEL),
        [Support("bottom", "y")],
        [Pressure("top", 1.0)],
        [Tie(*pair) if tied else Contact(*pair)],
        degree=2,
    )
    check(limit_bounds(problem), math.sqrt(3.0), 4e-3)


def wet(problem: Problem) -> Problem:
    """Return a disc with pore pressures."""
    pores = [PorePressure("disc", "0.3 + x*y"), PorePressure("disc", 0.2, constant=False)]
    loads = [*problem.given.loads, *pores]
    return Problem.from_given(problem.tagged_mesh, replace(problem.given, loads=loads))


def test_pores_do_no_work() -> None:
    problem = disc(2)
    pores = wet(problem)
    bounds, plain = limit_bounds(pores), limit_bounds(problem)
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(plain.lower.value, rel=1e-9)
    assert bounds.upper.value == pytest.approx(plain.upper.value, rel=1e-9)
    assert idle_pores(pores) == [
        "pore pressures do no work if bodies preserve their volume, and are ignored"
    ]
    assert not idle_pores(problem)


@pytest.mark.parametrize(
    ("problem", "words"),
    [
        (lambda read: tubes(read, 0.02), ["radial gap", "without this gap"]),
        (lambda _: wet(disc(1, SOIL)), ["pore pressure", "dilates", "control = 'work'"]),
    ],
)
def test_what_is_refused(
    read: Read, problem: Callable[[Read], Problem], words: Sequence[str]
) -> None:
    with pytest.raises(InputError) as refused:
        limit_bounds(problem(read))
    assert all(word in str(refused.value) for word in words)


@pytest.mark.serial
@pytest.mark.parametrize("radii", [(0.3, 0.5, 1.1), (0.0, 0.5, 1.1), (0.0, 0.0, 1.1)])
def test_integrals_over_the_radius_are_from_above(radii: tuple[float, float, float]) -> None:
    for turn in range(3):
        r = np.roll(radii, turn)
        # points of a fine triangle, away from its edges
        n = 400
        i, j = np.triu_indices(n)
        s, t = (i + 1 / 3) / n, (n - 1 - j + 1 / 3) / n
        inside = s + t < 1
        places = np.column_stack([s, t, 1 - s - t])[inside]
        a, b = np.array(EDGES).T
        polynomials = np.hstack([places**2, 2 * places[:, a] * places[:, b]])
        exact = (polynomials / (places @ r)[:, None]).mean(axis=0)
        found = weights_of_rates(r[None], np.ones(1))[0]
        kept = coefficients_of_radius(np.column_stack([r, np.zeros(3)])[None])[0] > 0
        if (r == 0).sum() == 2:  # r times a linear function
            c = int(np.argmax(r))
            assert found[c] == pytest.approx(1 / (3 * r[c]))
            continue
        assert (found[kept] >= exact[kept] * (1 - 0.02)).all()
        assert (found[kept] <= exact[kept] * 1.5).all()


@pytest.mark.serial
def test_parts_have_the_same_polynomials() -> None:
    random = np.random.default_rng(1)
    whole, corners = random.random((1, 6, 2)), random.dirichlet(np.ones(3), 3)[None]
    part = of_parts(whole, corners)
    at = random.dirichlet(np.ones(3), 5)
    a, b = np.array(EDGES).T

    def value(of: np.ndarray, places: np.ndarray) -> np.ndarray:
        return np.hstack([places**2, 2 * places[:, a] * places[:, b]]) @ of[0]

    assert np.allclose(value(part, at), value(whole, at @ corners[0]))
