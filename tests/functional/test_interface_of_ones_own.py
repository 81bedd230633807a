"""Test an interface from outside the package, as one class and one entry, in whole runs."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

from mpi4py import MPI

import h5py
import numpy as np
import pytest

from perfplast_fenicsx import Contact, InputError, Support, VonMises
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.contact.declared.contact import INTERFACES
from perfplast_fenicsx.io.case.scene import read_scene
from perfplast_fenicsx.proof import check
from tests.models import case_text, write_case

STEEL = VonMises(2e5, 0.3, 100.0)
LOADS = '[[load]]\non = "top"\npressure = 20.0\nconstant = true\n'
LOADS += '[[load]]\non = "upper"\nbody_force = [1.0, 0.0, 0.0]\n'
SEAM = '[[contact]]\nprimary = "lower_top"\nsecondary = "upper_bottom"\ninterface = "riveted"\n'


@dataclass(frozen=True)
class Riveted(Contact):
    """Surfaces that rivets connect in tangential directions; the rivets are perfectly plastic.

    Args:
        primary: Physical name of the first surface.
        secondary: Physical name of the second surface.
        rivets: Number of rivets per area (1/length²).
        shear: Shear strength of a rivet (force).
    """

    rivets: float = 0.0
    shear: float = 0.0

    def __post_init__(self) -> None:
        if not (self.rivets > 0 and self.shear > 0):
            raise InputError("a riveted seam has rivets and a shear force above 0; give both.")
        object.__setattr__(self, "tresca", self.rivets * self.shear)
        super().__post_init__()


@pytest.fixture(autouse=True)
def known() -> Iterator[None]:
    """Return the one entry of this interface."""
    with mock.patch.dict(INTERFACES, {"riveted": Riveted}):
        yield


def ran(
    comm: MPI.Intracomm, folder: Path, loading: str, seam: str = "", status: int = SOLVED
) -> dict[str, Any]:
    """Run a block that is pushed along another block, and return the summary. Collective."""
    text = case_text(
        {"builder": "stacked_blocks", "n": 1},
        {"lower": STEEL, "upper": STEEL},
        [Support("y0", "y"), Support("bottom")],
        more=f"{SEAM}{seam or 'rivets = 4.0' + chr(10) + 'shear = 0.5'}\n"
        f"[element]\ndegree = 2\n[output]\npictures = false\n[loading]\n{loading}\n",
    )
    head, load, rest = text.partition("[[load]]")
    tail = rest[rest.index("\n[") :] if load else ""
    case = write_case(comm, folder / "case.toml", head + LOADS + tail)
    assert main(["run", str(case), "-o", str(folder / "r"), "--report"]) == status
    read = comm.rank == 0 and status == SOLVED
    found: dict[str, Any] = comm.bcast(
        json.loads((folder / "r" / "summary.json").read_text()) if read else {}
    )
    return found


def test_levels(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    last = ran(comm, shared_tmp_path, "values = [1.0, 1.9]")["steps"][-1]
    forces = last["reactions"]
    assert forces["loads"] == pytest.approx([1.9, 0.0, -20.0], abs=1e-9)
    seam = next(force for name, force in forces.items() if name.startswith("contact"))
    assert np.abs(seam)[[0, 2]] == pytest.approx([1.9, 20.0], abs=1e-6)
    outer = [forces["loads"], forces["support bottom"], forces["support y0"]]
    assert np.sum(outer, axis=0) == pytest.approx(0.0, abs=1e-6)
    assert last["balance"] < 1e-9
    scene = shared_tmp_path / "r" / "scene.json"
    if comm.rank == 0:
        read = read_scene(json.loads(scene.read_text()), str(scene)).scene
        assert read.contacts[0] == Riveted("lower_top", "upper_bottom", rivets=4.0, shear=0.5)


def test_limit_load(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    limit = ran(comm, shared_tmp_path, 'control = "work"\nuntil = "limit"')["limit"]
    assert limit["estimate"] == pytest.approx(2.0, rel=1e-3)


def test_strict_bounds(comm: MPI.Intracomm, shared_tmp_path: Path) -> None:
    """In equilibrium, the rivets alone carry the horizontal load."""
    limit = ran(comm, shared_tmp_path, 'control = "bounds"')["limit"]
    assert limit["lower"] == pytest.approx(2.0, rel=1e-3)
    assert limit["upper"] == pytest.approx(2.0, rel=1e-3)
    checked = check(shared_tmp_path / "r" / "bounds.h5")
    assert set(checked) == {"lower", "upper"}
    assert not any(half.faults for half in checked.values())
    with h5py.File(shared_tmp_path / "r" / "bounds.h5") as file:
        strengths = [np.max(values[()]) for values in adhesions(file)]
    assert max(strengths) == pytest.approx(2.0, rel=1e-12)


def adhesions(file: h5py.File) -> list[h5py.Dataset]:
    """Return the adhesions of contacts in both halves of a proof file."""
    found: list[h5py.Dataset] = []

    def visit(name: str, item: object) -> None:
        if name.endswith("contact_adhesion"):
            found.append(item)

    file.visititems(visit)
    return found


@pytest.mark.parametrize(
    ("seam", "part"),
    {
        "rivets = 4.0": "a riveted seam has rivets and a shear force above 0",
        "bolts = 4.0": "there is no key 'bolts' here",
    }.items(),
)
def test_what_is_wrong_with_it(
    seam: str,
    part: str,
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    ran(comm, shared_tmp_path, "values = [1.0]", seam, BAD_INPUT)
    assert part in comm.bcast(capsys.readouterr().err)
