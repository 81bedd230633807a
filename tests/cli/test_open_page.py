"""Test that ``perfplast setup DIR`` opens the page if there is a screen, or prints its address."""

from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli import mesh_command
from perfplast_fenicsx.cli.parser import BAD_INPUT, SOLVED


@pytest.mark.mpi2
@pytest.mark.parametrize("screen", [True, False])
def test_the_page(
    comm: MPI.Intracomm,
    shared_tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    screen: bool,
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(mesh_command.sys, "platform", "linux")
    monkeypatch.setattr(mesh_command.webbrowser, "open", lambda url: not opened.append(url))
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", ":0" if screen else "")
    if comm.rank == 0:
        (shared_tmp_path / "setup.html").write_text("<!DOCTYPE html>", encoding="utf-8")
    comm.Barrier()
    assert main(["setup", str(shared_tmp_path)]) == SOLVED
    address = (shared_tmp_path / "setup.html").as_uri()
    assert opened == ([address] if screen and comm.rank == 0 else [])
    assert (address in capsys.readouterr().out) == (comm.rank == 0)


def test_a_folder_without_a_page(
    comm: MPI.Intracomm, shared_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["setup", str(shared_tmp_path)]) == BAD_INPUT
    if comm.rank == 0:
        told = capsys.readouterr().err
        assert f"'{shared_tmp_path}' contains no setup.html" in told
        assert f"perfplast mesh DRAWING -o {shared_tmp_path}" in told
