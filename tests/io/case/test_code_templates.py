"""Test templates of design codes: refused until all is filled in, and read afterwards."""

import re
import tomllib
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx import InputError, Support, VonMises
from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED
from perfplast_fenicsx.io.case.case_reader import case_of
from perfplast_fenicsx.io.case.code_templates import OPEN, TEMPLATES
from tests.models import case_text

OPEN_ONES = {"en-13445-3-gpd", "asme-viii-2-limit-load", "en-1993-1-14"}
GROUND = {"en-1997-1-da1", "en-1997-1-da2", "en-1997-1-da3"}
NAMES = OPEN_ONES | GROUND


def case(name: str, filled: float | None) -> tuple[Path, str]:
    """Return a case of two blocks with a template, and with loads named as in the template."""
    text = TEMPLATES[name]
    if filled is not None:
        text = re.sub(f'"{OPEN}[^"]*"', str(filled), text)
    factors = [one["factors"] for one in tomllib.loads(text)["combination"]]
    steel = {"lower": VonMises(2e5, 0.3, 300.0), "upper": VonMises(2e5, 0.3, 300.0)}
    blocks = {"builder": "stacked_blocks", "n": 1}
    head = case_text(blocks, steel, [Support("bottom")]).partition("[[load]]")[0]
    loads = "".join(
        f'[[load]]\nname = "{load}"\non = "top"\npressure = 1.0\n'
        for load in sorted({load for one in factors for load in one})
    )
    return Path("case.toml"), f'{head}{loads}{text}[loading]\ncontrol = "bounds"\n'


def read(name: str, filled: float | None) -> list[str]:
    """Return the remarks on the case."""
    path, text = case(name, filled)
    return list(case_of(path, text, tomllib.loads(text)).remarks)


def test_names() -> None:
    assert set(TEMPLATES) == NAMES


@pytest.mark.parametrize("name", sorted(OPEN_ONES))
def test_what_is_open_is_refused(name: str) -> None:
    """The refusal names the missing number, and its place in the code."""
    with pytest.raises(InputError, match=r"(EN|ASME).*give a"):
        read(name, None)


@pytest.mark.parametrize("name", sorted(NAMES))
def test_filled_in_it_is_read(name: str) -> None:
    """The results also name the code."""
    (remark,) = read(name, 1.25)
    assert tomllib.loads(TEMPLATES[name])["design"]["code"] in remark
    assert remark.endswith("the program does not check the factors")


@pytest.mark.parametrize("name", sorted(NAMES))
def test_numbers_have_sources(name: str) -> None:
    """All numbers are quoted in the comments, and only EN 1990 gives numbers."""
    numbers = re.findall(r"^(?!#).*= *(\d[\d.]*)", TEMPLATES[name], re.M)
    numbers += re.findall(
        r"(?<=[a-z] = )\d[\d.]*", "".join(re.findall("(?m)^fact.*", TEMPLATES[name]))
    )
    assert bool(numbers) == (name in {"en-1993-1-14", *GROUND})
    told = [line for line in TEMPLATES[name].splitlines() if line.startswith("#")]
    assert all(re.search(rf"\b{number}\b", "\n".join(told)) for number in numbers)


def test_shown(comm: MPI.Intracomm, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["template"]) == SOLVED
    listed = comm.bcast(capsys.readouterr().out)
    assert all(name in listed for name in NAMES)
    assert main(["template", "en-1993-1-14"]) == SOLVED
    assert "Table A1.2(B)" in comm.bcast(capsys.readouterr().out)
    assert main(["template", "en-1993-1-15"]) == BAD_INPUT
    assert "en-1993-1-14" in comm.bcast(capsys.readouterr().err)
