"""Test ``[units]`` of a case file, and the meaning of the numbers in a case."""

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.io.case.gravity_table import GravityTable
from perfplast_fenicsx.io.case.load_table import load_in_words, meaning
from perfplast_fenicsx.io.case.units_table import odd_magnitudes
from perfplast_fenicsx.materials.coulomb_ground import MohrCoulomb
from perfplast_fenicsx.materials.elastic import Elastic
from perfplast_fenicsx.materials.von_mises import VonMises
from perfplast_fenicsx.problem.declared.loads import Force, PorePressure, Pressure
from perfplast_fenicsx.problem.declared.supports import Support
from perfplast_fenicsx.units import Name, Units
from tests.models import case_text, write_case

pytestmark = pytest.mark.serial

LOADING = "[loading]\nvalues = [100.0]\n"
WEIGHT = '[[load]]\non = "lower"\nbody_force = [0, 0, "-x"]\nconstant = true\n'


def text(units: str, more: str = "") -> str:
    """Return the case of two blocks with the numbers of s235 in MPa."""
    bodies = {"lower": VonMises(210000.0, 0.3, 235.0), "upper": Elastic(210000.0, 0.3)}
    mesh = {"builder": "stacked_blocks", "n": 1}
    return case_text(mesh, bodies, [Support("bottom")], more=f"{LOADING}[units]\n{units}\n{more}")


def test_meaning(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    path = write_case(comm, shared_tmp_path / "case.toml", text('system = "mm-N-MPa"', WEIGHT))
    case = read_case(path)
    assert case.units == Units(system="mm-N-MPa")
    assert meaning(case) == [
        "zeta = 1 is pressure 1 MPa on 'top'.",
        "Constant loads: body force (0, 0, '-x') N/mm^3 on 'lower'.",
        "Units: lengths in mm, forces in N, stresses in MPa, works in N mm, moments of results"
        " in N m.",
    ]


def test_meaning_in_inches(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    """Steel A36 in AISC 360 has 29 000 ksi and 36 ksi."""
    given = text('system = "in-kip-ksi"', WEIGHT)
    given = given.replace("210000.0", "29000.0").replace("235.0", "36.0")
    case = read_case(write_case(comm, shared_tmp_path / "case.toml", given))
    assert meaning(case) == [
        "zeta = 1 is pressure 1 ksi on 'top'.",
        "Constant loads: body force (0, 0, '-x') kip/in^3 on 'lower'.",
        "Units: lengths in in, forces in kip, stresses in ksi, works in kip in, moments of results"
        " in kip ft.",
    ]


def test_loads_in_words() -> None:
    mm = Units(system="mm-N-MPa")
    force = Force("lid", [0.0, -2.5], moment=3.0)
    assert load_in_words(force, mm, whole=False) == (
        "force (0, -2.5) N/mm and moment 3 N mm/mm on 'lid'"
    )
    force = Force("lid", [0.0, -2.5], point=[1.0, 0.5])
    assert load_in_words(force, mm) == "force (0, -2.5) N on 'lid' at the point (1, 0.5) mm"
    assert load_in_words(Force("lid", [], moment=[0.0, 0.0, 1.0]), Units()) == (
        "moment (0, 0, 1) on 'lid'"
    )
    assert load_in_words(PorePressure("clay", "10*y"), mm) == "pore pressure '10*y' MPa on 'clay'"
    assert load_in_words(Pressure("lid", 1e-3), Units()) == "pressure 0.001 on 'lid'"


@pytest.mark.parametrize(
    ("units", "says"),
    [
        ('system = "mm-kg-s"', "give 'mm-N-MPa', "),
        ('system = "SI"\nlength = "mm"', "length = 'mm' contradicts system = 'SI'"),
        ('system = "SI"', r"\[material.lower\]: young = 210000 .*; write young = 2.1e\+11"),
        (
            'system = "in-kip-ksi"',
            "gives stresses in ksi; write .* 34.0839",
        ),
        ('length = "m"\nstress = "kPa"', r"values for 's235' in MPa, .* in kPa"),
        ("mass = 1", "no key 'mass'"),
    ],
)
def test_refused(comm: MPI.Intracomm, shared_tmp_path: Path, units: str, says: str) -> None:
    path = write_case(comm, shared_tmp_path / "case.toml", text(units))
    with pytest.raises(InputError, match=says):
        read_case(path)


def test_ground_in_other_units(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    ground = {"lower": MohrCoulomb(4.0, 0.3, 0.013, 17.5), "upper": Elastic(210000.0, 0.3)}
    mesh = {"builder": "stacked_blocks", "n": 1}
    more = f'{LOADING}[units]\nsystem = "m-kN-kPa"\n'
    case = case_text(mesh, ground, [Support("bottom")], more=more)
    path = write_case(comm, shared_tmp_path / "case.toml", case)
    with pytest.raises(InputError, match=r"lower\]: .* write young = 4000 and cohesion = 13\."):
        read_case(path)


def test_commands(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_case(comm, shared_tmp_path / "case.toml", text('system = "SI"'))
    assert main(["check", str(path)]) == BAD_INPUT
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1 if comm.rank == 0 else 0)
    write_case(comm, path, text('system = "mm-N-MPa"'))
    assert main(["info", str(path)]) == 0
    assert main(["materials", "--units", "m-kN-kPa"]) == 0
    out, _ = capsys.readouterr()
    if comm.rank == 0:
        assert "zeta = 1 is pressure 1 MPa on 'top'." in out
        assert "Stresses in kPa." in out
        assert [line.split()[1:4] for line in out.splitlines() if "s355" in line] == [
            ["2.1e+08", "0.3", "355000"]
        ]
        assert "unit weights in kN/m^3" in out
        clay = [line.split()[1:6] for line in out.splitlines() if "  clay-stiff-drained" in line]
        assert clay == [["4000", "0.3", "13", "17.5", "19"]]


@pytest.mark.parametrize(
    ("system", "density", "acceleration", "weighs"),
    [
        ("mm-N-MPa", 7.85e-9, 9810.0, None),
        ("mm-N-MPa", 7850.0, 9.81, "7.7e+10 kN/m³"),
        ("mm-N-MPa", 7.85e-9, 9.81, "0.077 kN/m³"),
        ("SI", 7850.0, 9.81, None),
        ("in-lbf-psi", 0.284, 1.0, None),  # a unit weight as the density
    ],
)
def test_weights_in_other_units_are_suspicious(
    comm: MPI.Intracomm, system: Name, density: float, acceleration: float, weighs: str | None
) -> None:
    loads = GravityTable([0.0, 0.0, -acceleration], {"lower": density}).loads(["lower"])
    points = np.array([[0.0, 0.0, 0.0], [10.0, 10.0, 10.0]])
    told = odd_magnitudes(Units(system=system), {}, loads, comm, points)
    assert [line.split(", and steel")[0] for line in told] == (
        [f"'lower' weighs {weighs}"] if weighs else []
    )
