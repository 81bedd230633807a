"""Test codes, places and remedies of errors and warnings."""

import logging
from pathlib import Path

from mpi4py import MPI

import pytest

from docs import refusals
from docs.refusals import RETIRED, Row, updated
from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.errors import (
    UNLISTED,
    InputError,
    code_of,
    code_of_record,
    on_all_ranks,
    raise_together,
)
from perfplast_fenicsx.io.case.schema import at, convert
from perfplast_fenicsx.materials.von_mises import VonMises


@pytest.mark.serial
def test_each_place_has_a_code_of_its_own() -> None:
    """A new message needs a code; python3 docs/refusals.py --write adds one."""
    rows, found = refusals.stored(), refusals.sites()
    assert len({row.code for row in rows}) == len(rows)
    now = updated(rows, found)
    new = {row.code for row in now} - {row.code for row in rows}
    assert not new, "python3 docs/refusals.py --write"
    for row in now:
        if row.kind != RETIRED:
            assert code_of(row.module, row.function, row.text) == row.code


BEFORE = [
    Row("elastic-1", "refusal", "materials.elastic", "check", "young = {} is negative; give more."),
    Row("elastic-2", "refusal", "materials.elastic", "check", "poisson = {} is outside (-1, 1/2)."),
]


@pytest.mark.serial
@pytest.mark.parametrize(
    ("module", "function", "text"),
    [
        ("materials.elastic", "check", "young = {} is negative; give a positive one."),
        ("materials.stiff", "check_stiff", "young = {} is negative; give more."),
    ],
    ids=["words", "moved"],
)
def test_a_code_stays(module: str, function: str, text: str) -> None:
    found = [("refusal", module, function, text), BEFORE[1].site]
    assert [row.code for row in updated(BEFORE, found)] == ["elastic-1", "elastic-2"]
    assert updated(BEFORE, found)[0].text == text


@pytest.mark.serial
def test_a_code_is_not_given_again() -> None:
    later = updated(BEFORE, [BEFORE[0].site])
    assert [row.kind for row in later] == ["refusal", RETIRED]
    new = ("refusal", "materials.elastic", "check", "expansion = {} is not finite; remove it.")
    assert [row.code for row in updated(later, [BEFORE[0].site, new])][2] == "elastic-3"


def refused(action: object, *arguments: object, **named: object) -> InputError:
    with pytest.raises(InputError) as caught:
        action(*arguments, **named)  # type: ignore[operator]
    return caught.value


@pytest.mark.serial
def test_a_refusal_of_the_package() -> None:
    error = refused(VonMises, young=2e5, poisson=0.7, yield_stress=1.0)
    (row,) = [row for row in refusals.stored() if row.code == error.code]
    assert row.text.startswith("poisson = {}")
    assert error.where == "poisson"
    assert error.remedy.startswith("give Poisson's ratio")
    other = refused(VonMises, young=-1.0, poisson=0.3, yield_stress=1.0)
    assert other.code not in {error.code, UNLISTED}
    assert other.table() == {
        "message": str(other),
        "code": other.code,
        "where": "young",
        "remedy": "give a positive number in stress units",
    }


@pytest.mark.serial
def test_the_place_of_a_file_is_named() -> None:
    """The caller that names the file does not change the code."""
    alone = refused(Contact, "a", "b", coulomb=-0.1)
    table = {"primary": "a", "secondary": "b", "coulomb": -0.1}
    error = refused(convert, table, Contact, "case.toml, [[contact]] 1")
    assert error.code == alone.code
    assert error.where == "case.toml, [[contact]] 1, coulomb"

    def twice() -> None:
        with at("other.toml"), at("stage 2, [load]"):
            convert({"primary": "a"}, Contact, "[[contact]] 1")

    missing = refused(twice)
    assert missing.code == "schema-2"
    assert missing.where == "other.toml, stage 2, [load], [[contact]] 1, secondary"


@pytest.mark.mpi2
def test_ranks_agree(comm: MPI.Intracomm) -> None:
    """The code and the place come from the rank that found the fault."""

    def one_rank() -> None:
        if comm.rank == comm.size - 1:
            VonMises(young=2e5, poisson=0.7, yield_stress=1.0)

    error = refused(on_all_ranks, comm, one_rank)
    assert error.code == "elastic-2"
    text = "there is no load; give one." if comm.rank == comm.size - 1 else None
    error = refused(raise_together, comm, text)
    assert (error.code, error.remedy) == (UNLISTED, "give one")
    assert set(comm.allgather(error.code)) == {UNLISTED}


@pytest.mark.serial
def test_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    """A warning that repeats an error has the code of the error."""
    rows = [row for row in refusals.stored() if row.kind == "warning"]
    for row in rows:
        record = logging.makeLogRecord(
            {
                "name": f"perfplast_fenicsx.{row.module}",
                "funcName": row.function,
                "msg": row.text,
            }
        )
        assert code_of_record(record) == row.code
    error = refused(VonMises, young=2e5, poisson=0.7, yield_stress=1.0)
    with caplog.at_level(logging.WARNING):
        logging.getLogger(__name__).warning("%s", error)
    assert code_of_record(caplog.records[0]) == error.code


@pytest.mark.serial
def test_the_table_is_part_of_the_package() -> None:
    text = (Path(refusals.ROOT) / "pyproject.toml").read_text(encoding="utf-8")
    assert '"perfplast_fenicsx" = ["codes.csv"]' in text
