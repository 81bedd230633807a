"""Test case files: the resulting cases, and one sentence on every rank for each fault."""

from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Plane
from perfplast_fenicsx.controls.load_control import LoadControl
from perfplast_fenicsx.controls.work_control import WorkControl
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.io.case.tables import MeshBuilder, MeshFile, OutputOptions, ReportHead
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.materials.elastic import Elastic
from perfplast_fenicsx.materials.von_mises import VonMises
from perfplast_fenicsx.problem.declared.loads import (
    BodyForce,
    Force,
    PorePressure,
    Pressure,
    Traction,
)
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.declared.supports import RigidSurface, Support
from perfplast_fenicsx.solvers.augmented_lagrangian import AugmentedLagrangian
from perfplast_fenicsx.solvers.newton import BorderedNewton, Newton, WorkNewton
from perfplast_fenicsx.solvers.newton_options import NewtonOptions

pytestmark = pytest.mark.serial

Read = Callable[[str], Case]

BASE = """
title = "Two blocks"
[mesh]
builder = "two_blocks"
n = 2
[material.upper]
law = "von-mises"
young = 206900.0
poisson = 0.29
yield_stress = 450.0
[material.lower]
law = "elastic"
young = 206900
poisson = 0.3
[[support]]
on = "left"
components = "xyz"
[[load]]
on = "top"
traction = [0.0, 0, -1.0]
[[contact]]
primary = "upper_bottom"
secondary = "lower_top"
gap = 0.0
[solve]
method = "newton"
stopping = "displacement"
tolerance = 1e-8
damping = true
regularisation = 1e-3
[loading]
control = "load"
values = [20.0, 40.0]
[output]
pictures = false
"""

SOLVE = BASE[BASE.index("[solve]") : BASE.index("[loading]")]
UZAWA = '[solve]\nmethod = "augmented-lagrangian"\n'
WORK = (BASE[BASE.index("[solve]") : BASE.index("[output]")], '[loading]\ncontrol = "work"\n')

OBSTACLE = """[[obstacle]]
on = "lower_top"
shape = "plane"
point = [0, 0, 3]
normal = [0, 0, -1.0]
[solve]
"""

LOWER = """[material.lower]
law = "elastic"
young = 206900
poisson = 0.3
"""


@pytest.fixture
def read(shared_tmp_path: Path, comm: MPI.Intracomm) -> Read:
    """Read a text as the case file ``bad.toml``."""

    def read_text(text: str) -> Case:
        path = shared_tmp_path / "bad.toml"
        if comm.rank == 0:
            path.write_text(text, encoding="utf-8")
        comm.barrier()
        return read_case(path, comm)

    return read_text


def assert_one_sentence(comm: MPI.Intracomm, error: BaseException, *parts: str) -> None:
    """Check that the message has these parts, is one line, and is equal on every rank."""
    message = str(error)
    assert "\n" not in message
    assert len(set(comm.allgather(message))) == 1
    for part in parts:
        assert part in message


def replaced(old: str, new: str) -> str:
    assert old in BASE
    return BASE.replace(old, new, 1)


def with_bounds(mesh: str) -> str:
    """Return the case with bounds for the body, and other arguments of the builder."""
    return replaced(BASE[BASE.index("[solve]") :], '[loading]\ncontrol = "bounds"\n').replace(
        "n = 2", mesh
    )


def test_everything_arrives(read: Read, shared_tmp_path: Path) -> None:
    case = read(BASE)
    assert case.title == "Two blocks"
    assert case.mesh == MeshBuilder("two_blocks", {"n": 2})
    assert case.materials == {
        "upper": VonMises(206900.0, 0.29, 450.0),
        "lower": Elastic(206900.0, 0.3),
    }
    assert case.supports == [Support("left", "xyz")]
    assert case.loads == [Traction("top", [0.0, 0.0, -1.0])]
    assert case.contacts == [Contact("upper_bottom", "lower_top", 0.0)]
    assert case.method == "newton"
    assert case.options.regularisation == 1e-3
    assert case.loading == LoadControl([20.0, 40.0])
    assert case.output == OutputOptions(fields=True, pictures=False)
    assert case.path == shared_tmp_path / "bad.toml"


def test_defaults(read: Read) -> None:
    short = BASE[: BASE.index("[solve]")].replace('title = "Two blocks"', "")
    case = read(short.replace('components = "xyz"', "") + "[loading]\nvalues = [1]")
    assert case.title == "bad"
    assert case.supports == [Support("left")]
    assert case.options == type(case.options)()
    assert case.output == OutputOptions()
    assert case.report == ReportHead()
    assert case.report.given == {}


def test_whose_computation_it_is(read: Read, comm: MPI.Intracomm) -> None:
    head = '[report]\nproject = "Crane, Halle 3"\nauthor = "A. Ünal"\n'
    case = read(BASE + head)
    assert case.report == ReportHead(project="Crane, Halle 3", author="A. Ünal")
    assert case.report.given == {"project": "Crane, Halle 3", "author": "A. Ünal"}
    for line, parts in {
        "number = 17": ("number = 17", "give a string"),
        'numer = "17"': ("numer", "number"),
    }.items():
        with pytest.raises(InputError) as refusal:
            read(BASE + head + line)
        assert_one_sentence(comm, refusal.value, "bad.toml, [report]", *parts)


@pytest.mark.parametrize(
    ("line", "load"),
    [
        ("pressure = 2", Pressure("top", 2.0)),
        ("body_force = [1, 2, 3]", BodyForce("top", [1, 2, 3])),
    ],
)
def test_kinds_of_load(read: Read, line: str, load: object) -> None:
    assert read(replaced("traction = [0.0, 0, -1.0]", line)).loads == [load]


def test_other_choices(read: Read) -> None:
    case = read(replaced("regularisation = 1e-3", 'regularisation = "adaptive"'))
    assert case.options.regularisation == "adaptive"
    case = read(replaced("gap = 0.0", 'gap = "0.1*x"'))
    assert case.contacts[0].gap == "0.1*x"
    case = read(replaced('builder = "two_blocks"\nn = 2', 'file = "a.msh"'))
    assert case.mesh == MeshFile("a.msh")
    assert case.adapt is None
    case = read(with_bounds("n = 2\nadapt = { cells = 4000 }"))
    assert case.adapt == Adaptation(until=0.01, cells=4000)
    assert case.mesh == MeshBuilder("two_blocks", {"n": 2}, {"cells": 4000})


@pytest.mark.parametrize(
    ("solve", "solver"),
    [
        ('method = "newton"', Newton),
        ('method = "augmented-lagrangian"\npenalty = "adaptive"', AugmentedLagrangian),
        ('method = "work-newton"', WorkNewton),
        ('method = "bordered-newton"', BorderedNewton),
    ],
)
def test_each_method_has_its_solver(
    read: Read, comm: MPI.Intracomm, solve: str, solver: type
) -> None:
    text = replaced(SOLVE, f"[solve]\n{solve}\n")
    if solver.prescribes is Prescribed.WORK:  # type: ignore[attr-defined]
        text = text.replace('control = "load"', 'control = "work"')
    case = read(text)
    assert type(case.solver(case.problem(comm))) is solver


def test_a_support_that_moves(read: Read, comm: MPI.Intracomm) -> None:
    along = '[[support]]\non = "left"\ncomponents = "x"\nvalue = -1e-3\n'
    moved = ('components = "xyz"\n', 'components = "yz"\n' + along)
    case = read(replaced(*moved))
    assert case.supports == [Support("left", "yz"), Support("left", "x", -1e-3)]
    assert case.problem(comm).motion.moves_supports
    loading = WORK[1] + 'until = "limit"\nlimit_tolerance = 1e-5\n'
    assert read(replaced(WORK[0], loading).replace(*moved)).loading.values is None


WEIGHT = """[[load]]
name = "weight"
on = "upper"
body_force = [0.0, 0.0, "-1 - z"]
constant = true
[[load]]
on = "lower"
pore_pressure = "10*maximum(1 - z, 0)"
[solve]
"""


def test_loads_that_are_constant(read: Read, comm: MPI.Intracomm) -> None:
    case = read(replaced("[solve]\n", WEIGHT))
    assert case.loads == [
        Traction("top", [0.0, 0.0, -1.0]),
        BodyForce("upper", [0.0, 0.0, "-1 - z"], "weight", constant=True),
        PorePressure("lower", "10*maximum(1 - z, 0)"),
    ]
    assert [load.constant for load in case.loads] == [False, True, True]
    assert case.problem(comm).loaded_at_zero()
    falling = replaced("[solve]\n", WEIGHT).replace("[20.0, 40.0]", "[-20.0, -40.0]")
    assert read(falling).loading.values == [-20.0, -40.0]


@pytest.mark.parametrize(
    "loading", ['until = "limit"\nlimit_tolerance = 1e-5\n', "values = [1.0]\n"]
)
def test_constant_loads_alone_have_no_limit(read: Read, comm: MPI.Intracomm, loading: str) -> None:
    text = replaced(WORK[0], WORK[1] + loading)
    with pytest.raises(InputError) as refusal:
        read(text.replace("traction = ", "constant = true\ntraction = "))
    assert_one_sentence(comm, refusal.value, "[loading]", "all loads are constant")


def test_limit_runs_have_options_that_suit_them(read: Read) -> None:
    loading = WORK[1] + 'until = "limit"\nlimit_tolerance = 1e-5\n'
    case = read(replaced(WORK[0], loading))
    assert case.method == "work-newton"
    assert case.options == NewtonOptions(stopping="stress", tolerance=1e-5)
    assert case.loading == WorkControl(until="limit", limit_tolerance=1e-5)
    own = read(replaced(WORK[0], '[solve]\nstopping = "energy"\n' + loading))
    assert own.options == NewtonOptions(stopping="energy", tolerance=1e-5)


@pytest.mark.parametrize(
    ("loading", "method", "degree", "tolerance"),
    [
        ('control = "work"\nuntil = "limit"', "interior-point", 1, 1e-3),
        ('control = "work"\nuntil = "limit"\nlimit_method = "path"', "work-newton", 1, 1e-3),
        ('control = "bounds"', "interior-point", 2, 1e-4),
        ('control = "bounds"\nlimit_tolerance = 0.01', "interior-point", 2, 0.01),
        ('control = "work"\nvalues = [1.0]', "work-newton", 1, None),
    ],
)
def test_how_a_limit_load_is_found(
    loading: str, method: str, degree: int, tolerance: float | None, read: Read, comm: MPI.Intracomm
) -> None:
    case = read(replaced(WORK[0], f"[loading]\n{loading}\n"))
    problem = case.problem(comm)
    assert case.method_on(problem) == method
    assert problem.degree == degree
    assert case.loading.limit_tolerance == tolerance


def test_an_algorithm_means_a_path(read: Read, comm: MPI.Intracomm) -> None:
    loading = '[solve]\nmethod = "bordered-newton"\n' + WORK[1] + 'until = "limit"\n'
    case = read(replaced(WORK[0], loading))
    assert case.method_on(case.problem(comm)) == "bordered-newton"


def test_the_problem_is_built(read: Read, comm: MPI.Intracomm) -> None:
    problem = read(BASE).problem(comm)
    assert problem.num_dofs == 2 * 7 * 3 * 3 * 3


WORK_NEWTON = '[solve]\nmethod = "work-newton"\n'
DRIVEN = (
    BASE[BASE.index("[[support]]") :],
    """[[support]]
on = "left"
[[support]]
on = "top"
components = "z"
value = -1e-3
[[contact]]
primary = "upper_bottom"
secondary = "lower_top"
[loading]
control = "displacement"
until = 1.0
""",
)
"""Everything after the materials, and the same with a support that follows ζ."""


def test_motions_that_follow_the_load_factor(read: Read, comm: MPI.Intracomm) -> None:
    case = read(replaced(*DRIVEN))
    assert case.supports == [
        Support("left", constant=False),
        Support("top", "z", -1e-3, constant=False),
    ]
    assert case.scene.driven
    assert "until a given motion" in repr(case)
    problem = case.problem(comm)
    assert problem.motion.driven
    assert not problem.loads.grows()
    still = replaced(*DRIVEN).replace('on = "left"', 'on = "left"\nvalue = 0.1\nconstant = true')
    assert read(still).supports[0] == Support("left", value=0.1)


RIGID = '[[rigid_surface]]\non = "top"\n'


def test_a_rigid_surface(read: Read, comm: MPI.Intracomm) -> None:
    force = "force = [0, 0, -1]\nmoment = [0.1, 0, 0]\npoint = [2, 0.5, 2]"
    case = read(replaced("[solve]", f"{RIGID}[solve]").replace("traction = [0.0, 0, -1.0]", force))
    assert case.rigid == [RigidSurface("top", [])]
    held = replaced("[solve]", f"{RIGID}held = 'xy'\n[solve]")
    assert read(held).rigid == [RigidSurface("top", [], held="xy")]
    assert case.loads == [Force("top", [0, 0, -1], [0.1, 0, 0], [2, 0.5, 2])]
    assert case.problem(comm).loads.grows()
    turned = f"{RIGID}rotation = [0, 0, 1]\ncomponents = 'xy'\n[[contact]]"
    text = replaced(*DRIVEN).replace("[[contact]]", turned, 1)
    (surface,) = read(text).rigid
    assert surface == RigidSurface("top", [], (), [0, 0, 1], "xy", constant=False)


FORMAT_FAULTS = [
    # the file
    ("[solve]", "[solve", ["bad.toml is not valid TOML", "line"]),
    ("n = 2", "n = 2\nn = 3", ["bad.toml is not valid TOML", "line 6"]),
    # keys
    ("[solve]", "[slove]", ["'slove'", "did you mean 'solve'?"]),
    ("young =", "yuong =", ["[material.upper]", "'yuong'", "did you mean 'young'?"]),
    ("pictures", "colours", ["[output]", "'colours'", "known: fields, pictures"]),
    ("poisson = 0.29", "", ["[material.upper]", "'poisson' is missing", "a number"]),
    ("yield_stress = 450.0", "", ["[material.upper]", "'yield_stress' is missing"]),
    ('law = "elastic"', "", ["[material.lower]", "'law' is missing", "'von-mises', 'von"]),
    ('on = "left"', "", ["[[support]]", "'on' is missing"]),
    ('secondary = "lower_top"', "", ["[[contact]]", "'secondary' is missing"]),
    ("values = [20.0, 40.0]", "", ["[loading]", "'values' is missing"]),
    (
        'law = "elastic"',
        'law = "elastic"\nyield_stress = 1',
        ["[material.lower]", "'yield_stress'"],
    ),
    # types
    ('title = "Two blocks"', "title = 3", ["title = 3", "a string"]),
    ("poisson = 0.29", 'poisson = "0.29"', ["[material.upper]", "poisson = '0.29'", "a number"]),
    ("[[load]]", "[load]", ["load = {", "[[load]]"]),
    ("[[support]]", "[support]", ["support = {", "[[support]]"]),
    ("[solve]", "[[solve]]", ["solve = [", "[solve]"]),
    ("[material.upper]", "[material]", ["material = {", "[material.NAME]"]),
    ("traction = [0.0, 0, -1.0]", "traction = 1", ["[[load]]", "traction = 1", "a list"]),
    ("traction = [0.0, 0, -1.0]", 'traction = ["a"]', ["[[load]]", "traction", "the name 'a'"]),
    ("gap = 0.0", "gap = [0.0]", ["[[contact]]", "gap = [0.0]", "a number or a string"]),
    ("damping = true", "damping = 1", ["[solve]", "damping = 1", "true or false"]),
    ("regularisation = 1e-3", "regularisation = true", ["[solve]", "regularisation = true"]),
    ('builder = "two_blocks"', "builder = 3", ["[mesh]", "builder = 3", "a string"]),
    # choices
    ('law = "von-mises"', 'law = "vonmises"', ["[material.upper]", "did you mean 'von-mises'?"]),
    ('"newton"', '"secant"', ["[solve]", "method = 'secant'", "newton"]),
    ('"load"', '"strain"', ["[loading]", "control = 'strain'", "load"]),
    ('"displacement"', '"strain"', ["[solve]", "'strain'", "'stress'", "'energy'"]),
    # ranges
    ("young = 206900.0", "young = 0.0", ["[material.upper]", "young = 0.0"]),
    ("young = 206900.0", "young = nan", ["[material.upper]", "young = nan"]),
    ("poisson = 0.29", "poisson = 0.5", ["[material.upper]", "poisson = 0.5", "1/2"]),
    ("poisson = 0.3", "poisson = -1", ["[material.lower]", "poisson = -1"]),
    ("yield_stress = 450.0", "yield_stress = -1", ["[material.upper]", "yield_stress = -1"]),
    ("tolerance = 1e-8", "tolerance = 0", ["[solve]", "tolerance = 0"]),
    ("tolerance = 1e-8", "tolerance = nan", ["[solve]", "tolerance = nan"]),
    ("regularisation = 1e-3", "regularisation = 1.5", ["[solve]", "regularisation = 1.5"]),
    # loads
    ("traction = [0.0, 0, -1.0]", "", ["[[load]]", "'top' has no load", "exactly one"]),
    ("traction = [", "pressure = 1\ntraction = [", ["[[load]]", "traction and pressure"]),
    ("traction = [0.0, 0", "traction = [nan, 0", ["[[load]]", "[nan, 0", "finite"]),
    ("traction = [0.0, 0, -1.0]", "pressure = inf", ["[[load]]", "pressure = inf", "finite"]),
    # loading
    ("[20.0, 40.0]", "[]", ["[loading]", "empty"]),
    ("[20.0, 40.0]", "[40.0, 40]", ["[loading]", "40.0 after 40.0"]),
    ("[20.0, 40.0]", "[40.0, 20]", ["[loading]", "20.0 after 40.0"]),
    ("[20.0, 40.0]", "[-1, 20]", ["[loading]", "-1.0"]),
    ("[20.0, 40.0]", "[nan]", ["[loading]", "nan"]),
    ("[20.0, 40.0]", "[1, inf]", ["[loading]", "inf"]),
    # controls and their methods
    ('control = "load"', 'control = "work"', ["method = 'newton'", "'work-newton'"]),
    ('"newton"', '"bordered-newton"', ["'bordered-newton'", "control = 'load'", "'newton'"]),
    (WORK[0], WORK[1] + "values = []", ["[loading]", "values is empty"]),
    (WORK[0], WORK[1] + "values = [-1.0]", ["[loading]", "-1.0", "works"]),
    (WORK[0], WORK[1] + 'until = "limit"\nlimit_method = "guess"', ["limit_method", "'path'"]),
    (WORK[0], WORK[1] + 'values = [1.0]\nlimit_method = "path"', ["limit_method", "until"]),
    ('control = "load"\nvalues = [20.0, 40.0]', 'control = "bounds"', ["[solve]", "remove"]),
    (WORK[0], '[loading]\ncontrol = "bounds"\nlimit_tolerance = 0', ["limit_tolerance = 0.0"]),
    (WORK[0], '[loading]\ncontrol = "bounds"\nvalues = [1.0]', ["[loading]", "'values'"]),
    (WORK[0], WORK[1] + 'until = "collapse"\nlimit_tolerance = 1e-4', ["until", "limit"]),
    (WORK[0], WORK[1] + 'until = "limit"\nlimit_tolerance = 2.0', ["limit_tolerance = 2.0"]),
    (WORK[0], WORK[1] + "values = [1.0]\nlimit_tolerance = 1e-4", ["limit_tolerance", "until"]),
    (WORK[0], WORK[1] + 'until = "limit"\nvalues = [1.0]', ["both values and until"]),
    (WORK[0], WORK[1], ["neither values nor until"]),
    (SOLVE, UZAWA + "penalty = 0.0", ["[solve]", "penalty = 0.0", "adaptive"]),
    (SOLVE, UZAWA + "relaxation = 2.5", ["[solve]", "relaxation = 2.5"]),
    (SOLVE, UZAWA + 'acceleration = "fast"', ["[solve]", "acceleration", "anderson"]),
    (SOLVE, UZAWA + "max_iterations = 0", ["[solve]", "max_iterations = 0"]),
    (SOLVE, UZAWA + "damping = true", ["[solve]", "'damping'"]),
    # motions
    ('"load"', '"displacement"', ["[loading]", "the load on 'top' would grow", "constant = true"]),
    (DRIVEN[0], DRIVEN[1].replace("value = -1e-3", ""), ["[loading]", "no motion"]),
    (DRIVEN[0], DRIVEN[1].replace("until = 1.0", ""), ["neither values nor until"]),
    (DRIVEN[0], DRIVEN[1].replace("until = 1.0", "until = 0.0"), ["until = 0.0"]),
    (DRIVEN[0], DRIVEN[1].replace("until = 1.0", "values = [1, 1]"), ["(or all decrease)"]),
    (DRIVEN[0], DRIVEN[1] + WORK_NEWTON, ["'work-newton'", "control = 'displacement'"]),
    ('components = "xyz"', "constant = false", ["[[support]]", "constant = false", "'left'"]),
    ("[solve]", OBSTACLE.replace("point", "move = [0, 0, 1.0]\npoint"), ["'lower_top'", "move"]),
    ("[solve]", f"{RIGID}constant = false\n[solve]", ["[[rigid_surface]]", "constant = false"]),
    ("[solve]", f'{RIGID}rotation = "a"\n[solve]', ["[[rigid_surface]]", "rotation = 'a'"]),
    ("traction =", "point = [0, 0, 0]\ntraction =", ["the traction on 'top'", "force"]),
    ("traction =", "moment = 1\ntraction =", ["traction and moment", "exactly one"]),
    # elements and obstacles
    ("[solve]", "[element]\ndegree = 3\n[solve]", ["[element]", "degree = 3", "1 or 2"]),
    ("[solve]", '[element]\ndegree = "2"\n[solve]', ["[element]", "degree = '2'"]),
    ("[solve]", '[element]\nkind = "P2"\n[solve]', ["[element]", "'kind'", "degree"]),
    ("[solve]", OBSTACLE.replace("plane", "cube"), ["[[obstacle]]", "shape = 'cube'", "sphere"]),
    ("[solve]", OBSTACLE.replace("normal", "nrmal"), ["[[obstacle]]", "'nrmal'", "normal"]),
    ("[solve]", OBSTACLE.replace("point", "#"), ["[[obstacle]]", "'point' is missing"]),
    ("[solve]", OBSTACLE.replace('shape = "plane"', ""), ["[[obstacle]]", "'shape' is missing"]),
    # mesh
    ('builder = "two_blocks"', "", ["[mesh]", "neither a builder nor a file"]),
    ('builder = "two_blocks"', 'builder = "a"\nfile = "b"', ["[mesh]", "both"]),
    ('builder = "two_blocks"', 'file = "a.msh"', ["[mesh]", "'n'"]),
]


@pytest.mark.parametrize(("old", "new", "parts"), FORMAT_FAULTS)
def test_format_fault(
    read: Read, comm: MPI.Intracomm, old: str, new: str, parts: list[str]
) -> None:
    with pytest.raises(InputError) as caught:
        read(replaced(old, new + "\n" * old.endswith("\n")))
    assert_one_sentence(comm, caught.value, "bad.toml", *parts)


MESH_FAULTS = [
    ("[solve]", f"{RIGID}[solve]".replace("top", "left"), ["'left'", "shares nodes", "support"]),
    ("[solve]", f"{RIGID}[solve]".replace("top", "tp"), ["'tp'", "top"]),
    ('"two_blocks"', '"two_bloks"', ["[mesh]", "two_bloks", "two_blocks"]),
    ("n = 2", "n = 0", ["[mesh]", "n = 0"]),
    ("n = 2", "m = 2", ["[mesh]", "'m'"]),
    ("n = 2", "", ["[mesh]", "'n'"]),
    ('builder = "two_blocks"\nn = 2', 'file = "no.msh"', ["[mesh]", "no.msh"]),
    ('builder = "two_blocks"\nn = 2', 'file = "bad.toml"', ["[mesh]", "bad.toml"]),
    ("[material.upper]", "[material.uper]", ["'uper'", "upper"]),
    (
        '[material.lower]\nlaw = "elastic"\nyoung = 206900\npoisson = 0.3',
        "",
        ["'lower'", "material"],
    ),
    ('on = "left"', 'on = "lft"', ["'lft'", "left", "lower_top"]),
    ('on = "top"', 'on = "bottom"', ["'bottom'", "top"]),
    ("traction =", "body_force =", ["'top'", "upper"]),
    ('secondary = "lower_top"', 'secondary = "lower"', ["'lower'", "lower_top"]),
    ('components = "xyz"', 'components = "xw"', ["'xw'", "'xyz'"]),
    ('components = "xyz"', 'components = ""', ["components = ''", "'xyz'"]),
    ("traction = [0.0, 0, -1.0]", "traction = [0.0, -1.0]", ["'top'", "[0.0, -1.0]", "3"]),
    ("traction = [0.0, 0, -1.0]", "pressure = 0", ["load"]),
    ("gap = 0.0", "gap = -0.5", ["contact 1", "-0.5", "negative"]),
    ("gap = 0.0", "gap = nan", ["contact 1", "nan"]),
    ("gap = 0.0", 'gap = "x - 1"', ["contact 1", "x - 1", "negative"]),
    ("gap = 0.0", 'gap = "log(x - 5)"', ["contact 1", "log(x - 5)", "nan"]),
    ("gap = 0.0", "gap = \"__import__('os')\"", ["contact 1", "__import__", "allowed"]),
    ('secondary = "lower_top"', 'secondary = "left"', ["contact 1", "opposite"]),
    ('secondary = "lower_top"', 'secondary = "upper_bottom"', ["contact 1", "itself"]),
    ('on = "left"\ncomponents = "xyz"', 'on = "left"\ncomponents = "x"', ["y"]),
    ("[solve]\n", OBSTACLE.replace("lower_top", "lwr"), ["'lwr'", "lower_top"]),
    ("[solve]\n", OBSTACLE.replace("3]", "0.5]"), ["obstacle 1", "overlap", "0.5"]),
    ("[solve]\n", OBSTACLE.replace("[0, 0, 3]", "[0, 3]"), ["obstacle 1", "point", "3D"]),
    ("[solve]\n", OBSTACLE.replace("-1.0", "0"), ["obstacle 1", "normal", "zero"]),
    ('[[support]]\non = "left"\ncomponents = "xyz"', "", []),
]


@pytest.mark.parametrize(("old", "new", "parts"), MESH_FAULTS)
def test_fault_seen_with_the_mesh(
    read: Read, comm: MPI.Intracomm, old: str, new: str, parts: list[str]
) -> None:
    case = read(replaced(old, new))
    with pytest.raises(InputError) as caught:
        case.problem(comm)
    assert_one_sentence(comm, caught.value, "bad.toml", *parts)


@pytest.mark.parametrize(
    ("mesh", "parts"),
    [
        ("adapt = { until = 2.0 }", ["[mesh], adapt", "until = 2.0", "try 0.01"]),
        ("adapt = { cels = 5 }", ["[mesh], adapt", "'cels'", "'cells'"]),
        ("adapt = true", ["[mesh]", "adapt = true", "a table"]),
    ],
)
def test_adaptation_that_cannot_be(
    read: Read, comm: MPI.Intracomm, mesh: str, parts: list[str]
) -> None:
    with pytest.raises(InputError) as caught:
        read(with_bounds(f"n = 2\n{mesh}")).problem(comm)
    assert_one_sentence(comm, caught.value, "bad.toml", *parts)


def test_adaptation_goes_with_bounds(read: Read, comm: MPI.Intracomm) -> None:
    with pytest.raises(InputError) as caught:
        read(replaced("n = 2", "n = 2\nadapt = {}"))
    assert_one_sentence(comm, caught.value, "bad.toml, [mesh], adapt", "control = 'bounds'")


def test_a_body_held_by_nothing(read: Read, comm: MPI.Intracomm) -> None:
    case = read(BASE[: BASE.index("[[contact]]")] + BASE[BASE.index("[solve]") :])
    assert case.problem(comm).num_pairs == 0  # both blocks are clamped, so they need no contact
    stacked = replaced('"two_blocks"', '"stacked_blocks"').replace('"left"', '"bottom"')
    case = read(stacked[: stacked.index("[[contact]]")] + stacked[stacked.index("[solve]") :])
    with pytest.raises(InputError) as caught:
        case.problem(comm)
    assert_one_sentence(comm, caught.value, "bad.toml")


def test_files_that_cannot_be_read(shared_tmp_path: Path, comm: MPI.Intracomm) -> None:
    binary = shared_tmp_path / "binary.toml"
    if comm.rank == 0:
        binary.write_bytes(b"\x80\xff\x00")
    comm.barrier()
    for path, part in (
        (shared_tmp_path / "no.toml", "no such file"),
        (shared_tmp_path, "is a directory"),
        (binary, "UTF-8"),
    ):
        with pytest.raises(InputError) as caught:
            read_case(path, comm)
        assert_one_sentence(comm, caught.value, str(path), part)


def test_elements_and_obstacles(read: Read, comm: MPI.Intracomm) -> None:
    case = read(replaced("[solve]\n", "[element]\ndegree = 2\n" + OBSTACLE))
    assert case.obstacles == [Plane("lower_top", [0.0, 0.0, 3.0], [0.0, 0.0, -1.0])]
    problem = case.problem(comm)
    assert problem.degree == 2
    assert problem.num_dofs == 2 * 3 * (13 * 5 * 5)
    obstacle = problem.constraints.surface == 1
    assert comm.allreduce(int(obstacle.sum())) == 12 * 5  # the nodes of the clamped end are held
    np.testing.assert_allclose(problem.constraints.gap[obstacle], 2.0, rtol=1e-14)
    assert read(BASE).problem(comm).degree == 1


@pytest.mark.parametrize("name", ["two_blocks", "punch"])
def test_the_examples_are_valid(name: str, comm: MPI.Intracomm) -> None:
    case = read_case(Path(__file__).parents[3] / "demos" / f"{name}.toml", comm)
    assert isinstance(case.mesh, MeshBuilder)
    assert case.mesh.builder == name
