"""Problems that are built step by step, and fields that are DOLFINx functions."""

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Elastic,
    InputError,
    MohrCoulomb,
    Newton,
    PorePressure,
    Pressure,
    Problem,
    ProblemBuilder,
    Support,
    TaggedMesh,
    Temperature,
    Traction,
    VonMises,
    field_of,
    l_plate,
    limit_bounds,
    two_blocks,
)
from perfplast_fenicsx.io.case.load_table import load_in_words
from perfplast_fenicsx.materials.law import Material
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.solvers.load_stepping import load_path
from perfplast_fenicsx.spatial_fields import Formula
from perfplast_fenicsx.units import Units
from tests.limit_analysis.test_static_bound import rectangle

STEEL = VonMises(2e5, 0.3, yield_stress=450.0)


@pytest.fixture
def build(comm: MPI.Intracomm) -> ProblemBuilder:
    return ProblemBuilder(two_blocks(comm, n=1))


def function(mesh: TaggedMesh, formula: str) -> fem.Function:
    """A function of degree 1 that equals a formula at the vertices."""
    V = fem.functionspace(mesh.mesh, ("Lagrange", 1))
    found = fem.Function(V, name="given")
    found.interpolate(lambda x: Formula(formula).at(x.T, "the test"))
    return found


def test_steps_make_the_problem_of_a_script(build: ProblemBuilder) -> None:
    on = build.surfaces
    contact, support = Contact(on.upper_bottom, on.lower_top), Support(on.left)
    load = Traction(on["top"], (0.0, 0.0, -1.0))
    assert build.missing() == ["a material of lower, upper", "a load"]
    build.material(STEEL, *build.bodies).add(support, contact).add(load)
    assert build.missing() == []
    bodies = dict.fromkeys(("lower", "upper"), STEEL)
    written = Problem(build.tagged_mesh, bodies, [support], [load], [contact], degree=1)
    given = build.problem(degree=1).given
    build.material(Elastic(2e5, 0.3), "lower").add(load)  # later steps belong to other problems
    for name, value in vars(given).items():
        expected = getattr(written.given, name)
        assert value == (list(expected) if isinstance(expected, tuple) else expected)


def test_an_editor_completes_the_names(build: ProblemBuilder) -> None:
    assert {"top", "left", "lower_top", "upper_bottom"} <= {*dir(build.surfaces)}
    assert dir(build.bodies) == ["lower", "upper"] == build.bodies._ipython_key_completions_()
    assert len(build.bodies) == 2


def test_what_is_missing_is_in_the_table(build: ProblemBuilder) -> None:
    build.material(STEEL, "upper")
    assert "missing: a material of lower; a load" in repr(build)
    assert "a material of lower" in build._repr_html_()


def test_wrong_steps_are_refused_at_once(build: ProblemBuilder) -> None:
    with pytest.raises(AttributeError, match="no surface 'tap'; did you mean 'top'"):
        _ = build.surfaces.tap
    with pytest.raises(InputError, match="no body 'wheel'; known: lower, upper"):
        _ = build.bodies["wheel"]
    with pytest.raises(InputError, match="'uper' is not a volume"):
        build.material(STEEL, "lower", "uper")
    with pytest.raises(InputError, match=r"or \*build.bodies for all"):
        build.material(STEEL)
    with pytest.raises(InputError, match="'tap' is not a surface"):
        build.add(Support("left"), Pressure("tap", 1.0))
    with pytest.raises(InputError, match="'top' is a surface"):
        build.add(BodyForce("top", (0.0, 0.0, -1.0)))
    with pytest.raises(InputError, match="'tap' is not a surface"):
        build.add(Contact("top", "tap"))
    with pytest.raises(InputError, match="an object of type VonMises cannot"):
        build.add(STEEL)  # type: ignore[arg-type]
    assert build.materials == {}
    assert build.declared == []


def square(comm: MPI.Intracomm) -> TaggedMesh:
    """A unit square, 36 triangles."""
    sides = {"left": lambda x: x[0] < 1e-9, "bottom": lambda x: x[1] < 1e-9}
    sides |= {"top": lambda x: x[1] > 1 - 1e-9}
    return rectangle((3, 3), (1.0, 1.0), {"body": lambda x: x[0] < 2}, sides, comm=comm)


def bounds_of(mesh: TaggedMesh, material: Material, *loads: Load) -> tuple[float, float]:
    supports = [Support("left", "x"), Support("bottom", "y")]
    found = limit_bounds(Problem(mesh, {"body": material}, supports, loads, degree=2))
    assert found.lower.strict
    assert found.upper.strict
    assert found.lower.value is not None
    assert found.upper.value is not None
    return found.lower.value, found.upper.value


@pytest.mark.mpi2
def test_the_strength_of_a_function_is_that_of_its_formula(comm: MPI.Intracomm) -> None:
    mesh, formula = square(comm), "450 - 200*x - 100*y"
    load = Pressure("top", 100.0)
    steel = VonMises(2e5, 0.3, field_of(function(mesh, formula)))
    expected = bounds_of(mesh, VonMises(2e5, 0.3, Formula(formula)), load)
    assert bounds_of(mesh, steel, load) == pytest.approx(expected, rel=1e-6)


def test_the_temperature_of_a_function_is_that_of_its_formula(comm: MPI.Intracomm) -> None:
    mesh, warm = l_plate(comm, n=1), Elastic(2e5, 0.3, expansion=1.2e-5)
    supports = [Support("x0", "x"), Support("y0", "y"), Support("z0", "z")]
    found = []
    for change in ("20 + 30*x*x", field_of(function(mesh, "20 + 5*x - y")), "20 + 5*x - y"):
        initial = [Temperature("plate", change)]
        given = ({"plate": warm}, supports, [Pressure("top", 1.0)])
        problem = Problem(mesh, *given, initial=initial)
        (level,) = load_path(Newton(problem), [1.0])
        found.append(level.report.max_displacement)
    assert found[1] == pytest.approx(found[2], rel=1e-10)
    assert found[0] != pytest.approx(found[2], rel=1e-3)


@pytest.mark.mpi2
def test_the_pore_pressure_of_a_function_is_that_of_its_formula(comm: MPI.Intracomm) -> None:
    mesh, formula = square(comm), "10 - 8*y"
    ground = MohrCoulomb(2e5, 0.3, cohesion=50.0, friction_angle=20.0)
    water = PorePressure.from_function("body", function(mesh, formula))
    assert "the function 'given'" in load_in_words(water, Units())
    load = Pressure("top", 1.0)
    expected = bounds_of(mesh, ground, load, PorePressure("body", formula))
    assert bounds_of(mesh, ground, load, water) == pytest.approx(expected, rel=1e-6)


def test_functions_that_are_no_fields_are_refused(comm: MPI.Intracomm) -> None:
    mesh = l_plate(comm, n=1)
    for element in (("Lagrange", 2), ("DG", 1), ("Lagrange", 1, (3,))):
        with pytest.raises(InputError, match="continuous scalar function of degree 1"):
            field_of(fem.Function(fem.functionspace(mesh.mesh, element)))
    wrong = function(mesh, "x")
    wrong.x.array[:] = np.nan
    with pytest.raises(InputError, match="'given' has a value that is not finite"):
        field_of(wrong)


def test_a_pressure_that_bends_in_a_cell_is_refused(comm: MPI.Intracomm) -> None:
    """The function has its own, finer mesh."""
    fine = function(l_plate(comm, n=2), "x*x*100")
    coarse = l_plate(comm, n=1)
    loads = [Pressure("top", 1.0), PorePressure.from_function("plate", fine)]
    with pytest.raises(InputError, match="is not linear in the cell"):
        Problem(coarse, {"plate": MohrCoulomb(2e5, 0.3, 50.0, 20.0)}, (), loads)
