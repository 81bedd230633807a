"""Test contradictory loadings: one sentence each, and status 2.

tests/functional/test_axisymmetric_case.py tests the refusal of r < 0.
"""

from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Support, VonMises
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT
from tests.models import case_text, write_case

STEEL = VonMises(2e5, 0.3, 300.0)
ROLLERS = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")]
BLOCKS = case_text({"builder": "stacked_blocks", "n": 1}, {"lower": STEEL, "upper": STEEL}, ROLLERS)
CONTACT = '\n[[contact]]\nprimary = "lower_top"\nsecondary = "upper_bottom"\n'
LOADING = "[loading]\nvalues = [1.0]\n"
LIMIT = '[loading]\ncontrol = "work"\nuntil = "limit"\n'
BOUNDS = '[loading]\ncontrol = "bounds"\n'
BENDING_WEIGHT = '[[load]]\non = "upper"\nbody_force = ["0.0", "0.0", "-x"]\n'
PLANE = (
    '[[obstacle]]\nshape = "plane"\non = "top"\npoint = [0.0, 0.0, 2.0]\n'
    "normal = [0.0, 0.0, -1.0]\nmove = [0.0, 0.0, -1.0]\n"
)


def moved(on: str, value: str) -> str:
    return f'[[support]]\non = "{on}"\ncomponents = "z"\nvalue = {value}\n'


def stage(factors: str) -> str:
    return f"[[stage]]\nfactors = {{ {factors} }}\n"


REFUSED = {
    "all loads constant": (
        BLOCKS.replace("pressure = 1.0", "pressure = 1.0\nconstant = true") + CONTACT + LIMIT,
        "but all loads are constant",
    ),
    "a move without control": (
        BLOCKS + CONTACT + PLANE + LOADING,
        "the obstacle at 'top' has a move",
    ),
    "a displacement against a contact": (
        BLOCKS + CONTACT + moved("lower_top", "0.1") + moved("upper_bottom", "0.0") + LOADING,
        "cannot prevent an overlap there",
    ),
    "a negative gap": (BLOCKS + CONTACT + "gap = -1e-3\n" + LOADING, "interference = true"),
    "an overlap that nothing makes grow": (
        BLOCKS + CONTACT + "gap = -1e-3\ninterference = true\nconstant = false\n" + LOADING,
        "'upper_bottom' has constant = false",
    ),
    "no overlap that could grow": (
        BLOCKS + CONTACT + "constant = false\n" + LOADING,
        "constant = false, but no overlap",
    ),
    "an overlap of nothing that is to grow": (
        BLOCKS
        + CONTACT
        + 'gap = 1e-3\ninterference = true\nconstant = false\nname = "fit"\n'
        + stage("top = 1.0, fit = 1.0"),
        "constant = false, but it has no overlap",
    ),
    "a stage of an overlap that is constant": (
        BLOCKS + CONTACT + 'interference = true\nname = "fit"\n' + stage("top = 1.0, fit = 1.0"),
        "a factor for 'fit', which is constant",
    ),
    "a stage of no load": (
        BLOCKS + CONTACT + stage("top = 1.0, tpo = 2.0"),
        "a factor for 'tpo', but",
    ),
    "a stage of what does not move": (
        BLOCKS + CONTACT + stage("top = 1.0, bottom = 2.0"),
        "a factor for 'bottom', but",
    ),
    "a stage of a load and a motion": (
        BLOCKS + CONTACT + PLANE + stage("top = 1.0"),
        "or temperature and of a motion",
    ),
    "a move in no stage": (
        BLOCKS + CONTACT + PLANE + 'name = "punch"\n' + stage("top = 1.0"),
        "motion of 'punch' is in no stage",
    ),
    "two stages of one place": (
        BLOCKS
        + moved("lower_top", "0.1")
        + 'name = "a"\n'
        + moved("lower_top", "0.1")
        + 'name = "b"\n'
        + CONTACT
        + stage("top = 1.0, a = 1.0, b = 2.0"),
        "'a' and 'b' hold the same nodes",
    ),
    "more levels than can be": (
        BLOCKS + CONTACT + stage("top = 1.0") + "steps = 1000000000000\n",
        "steps = 1000000000000 is not a valid number of levels",
    ),
    "a value that is no number": (
        BLOCKS + CONTACT + moved("top", '"far"') + LOADING,
        "'far' has the name 'far'",
    ),
    "a limit of bodies that harden": (
        BLOCKS.replace('law = "von-mises"', 'law = "von-mises-hardening"\nisotropic = 1.0')
        + CONTACT
        + LIMIT,
        "so there is no limit load",
    ),
    "bounds with a body force by formula": (
        BLOCKS + BENDING_WEIGHT + CONTACT + BOUNDS,
        "is a force per volume that is a formula",
    ),
    "bounds with a pressure bent on facets": (
        BLOCKS.replace("pressure = 1.0", 'pressure = "1 + x*x"') + CONTACT + BOUNDS,
        "strict bounds accept tractions",
    ),
    "a factor of safety with such a pressure": (
        BLOCKS.replace("pressure = 1.0", 'pressure = "1 + x*x"\nconstant = true')
        + CONTACT
        + BOUNDS.replace("bounds", "strength"),
        "strict bounds accept tractions",
    ),
    "a method that knows no hardening": (
        BLOCKS.replace('law = "von-mises"', 'law = "von-mises-hardening"\nisotropic = 1.0')
        + CONTACT
        + LOADING
        + '[solve]\nmethod = "augmented-lagrangian"\n',
        "is not a projection onto a yield set",
    ),
    "subdomains and friction": (
        BLOCKS + CONTACT + "tresca = 1.0\n" + LOADING + '[solve]\ncontact_solver = "tfeti"\n',
        '"tfeti" does not support friction',
    ),
    "a tolerance finer than slip": (
        BLOCKS + CONTACT + "coulomb = 0.3\n" + LIMIT + "limit_tolerance = 1e-12\n",
        "cannot distinguish sliding bodies",
    ),
}
"""Files that ``check`` and ``run`` both refuse, without a solution."""


@pytest.mark.parametrize("fault", REFUSED)
def test_one_sentence(
    fault: str, comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, part = REFUSED[fault]
    case = write_case(comm, shared_tmp_path / "case.toml", text)
    assert main(["check", str(case)]) == BAD_INPUT
    out, err = capsys.readouterr()
    assert out == ""
    assert comm.rank == 0 or err == ""
    err = comm.bcast(err)
    assert part in err
    assert err.startswith("perfplast: ")
    assert err.count("\n") == 1
    assert err.count("case.toml") == 1
