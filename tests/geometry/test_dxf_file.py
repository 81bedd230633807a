"""Test ground from DXF files: regions and lines have the names of layers."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry import dxf_file
from perfplast_fenicsx.geometry.drawn_ground import DrawnGround
from perfplast_fenicsx.geometry.dxf_file import DxfDrawing, read_dxf
from perfplast_fenicsx.io.case.case_reader import read_case

pytestmark = pytest.mark.serial

SAND = [(30, 25), (70, 31), (70, 35), (50, 35)]
CLAY = [(20, 20), (70, 20), (70, 31), (30, 25), (20, 25)]

CASE = """
geometry = { file = "section.dxf", size = 4.0 }
loading.control = "strength"
gravity = { acceleration = [0.0, -1.0], density = { fill_sand = 19.0, clay = 19.0 } }
support = [{ on = "base" }, { on = "left", components = "x" }, { on = "right", components = "x" }]
load = [{ on = "road", pressure = 10.0, constant = true }]

[material]
fill_sand = { law = "tresca", young = 1e4, poisson = 0.3, cohesion = 90.0 }
clay = { law = "tresca", young = 1e4, poisson = 0.3, cohesion = 60.0 }
"""


@pytest.fixture
def drawing() -> Any:
    """Return a new drawing of ezdxf."""
    return pytest.importorskip("ezdxf", reason="ezdxf is not installed").new()


def polyline(drawing: Any, layer: str, points: Sequence[Any], close: bool = True) -> Any:
    space = drawing.modelspace()
    return space.add_lwpolyline(points, close=close, dxfattribs={"layer": layer})


def section(drawing: Any) -> None:
    """Draw two regions, one of them with single segments, and a line."""
    polyline(drawing, "Fill, sand", SAND)
    ends = [*CLAY, CLAY[0]]
    for start, end in [(ends[k], ends[k + 1]) for k in (3, 0, 4, 2, 1)]:
        drawing.modelspace().add_line(end, start, dxfattribs={"layer": "clay"})
    polyline(drawing, "road", [(55, 35), (65, 35)], close=False)
    drawing.modelspace().add_text("ACADS", dxfattribs={"layer": "notes"})


def read(drawing: Any, tmp_path: Path) -> DxfDrawing:
    drawing.saveas(tmp_path / "section.dxf")
    return read_dxf(tmp_path / "section.dxf")


def test_regions_and_lines_have_the_names_of_layers(drawing: Any, tmp_path: Path) -> None:
    section(drawing)
    found = read(drawing, tmp_path)
    assert [it.name for it in found.regions] == ["fill_sand", "clay"]
    assert sorted(found.regions[1].points) == sorted([float(x), float(y)] for x, y in CLAY)
    assert [(it.name, it.points) for it in found.lines] == [("road", [[55, 35], [65, 35]])]
    assert not found.remarks
    assert len(DrawnGround(found.regions, lines=found.lines).outline().sides) == 4


def test_curves_blocks_and_layers_that_are_off(drawing: Any, tmp_path: Path) -> None:
    polyline(drawing, "clay", CLAY)
    drawing.layers.add("frame").off()
    polyline(drawing, "frame", [(0, 0), (90, 0), (90, 90)])
    block = drawing.blocks.new("lining")
    block.add_circle((0, 0), 2.0, dxfattribs={"layer": "tunnel"})
    drawing.modelspace().add_blockref("lining", (50, 25))
    drawing.modelspace().add_3dface([(0, 0), (1, 0), (0, 1)], dxfattribs={"layer": "clay"})
    drawing.modelspace().add_text("a note", dxfattribs={"layer": "clay"})
    found = read(drawing, tmp_path)
    assert [it.name for it in found.regions] == ["clay", "tunnel"]
    away = np.linalg.norm(np.array(found.regions[1].points) - (50, 25), axis=1)
    assert away == pytest.approx(2.0, rel=1e-3)
    assert "curves are chords within 0.05" in found.remarks[0]
    assert "are ignored: 3DFACE" in found.remarks[1]


def test_a_case_takes_its_ground_from_a_file(drawing: Any, tmp_path: Path) -> None:
    section(drawing)
    drawing.saveas(tmp_path / "section.dxf")
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    mesh = read_case(tmp_path / "case.toml").tagged_mesh(MPI.COMM_SELF)
    assert sorted(mesh.volumes) == ["clay", "fill_sand"]
    assert {"base", "left", "right", "surface", "road"} <= set(mesh.surfaces)


def two_regions_overlap(drawing: Any) -> None:
    polyline(drawing, "clay", CLAY)
    polyline(drawing, "sand", [(30, 25), (70, 30), (70, 35), (50, 35)])


def lines_branch(drawing: Any) -> None:
    for end in ((1, 0), (0, 1), (-1, 0)):
        drawing.modelspace().add_line((0, 0), end, dxfattribs={"layer": "clay"})


def a_line_leaves_the_plane(drawing: Any) -> None:
    drawing.modelspace().add_line((0, 0, 0), (3, 0, 2), dxfattribs={"layer": "clay"})


@pytest.mark.parametrize(
    ("draw", "words"),
    [
        (lambda _: None, "no line in a layer"),
        (lines_branch, r"layer 'clay' .* branch at \(0, 0\)"),
        (a_line_leaves_the_plane, r"is not in the plane, at \(3, 0, 2\)"),
        (two_regions_overlap, r"case.toml: 'clay' and 'sand' overlap"),
    ],
)
def test_drawings_that_are_no_ground(
    drawing: Any, tmp_path: Path, draw: Callable[[Any], None], words: str
) -> None:
    draw(drawing)
    drawing.saveas(tmp_path / "section.dxf")
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    with pytest.raises(InputError, match=words):
        read_case(tmp_path / "case.toml")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    pytest.importorskip("ezdxf", reason="ezdxf is not installed")
    with pytest.raises(InputError, match=r"'none\.dxf' cannot be read as DXF"):
        read_dxf(tmp_path / "none.dxf")
    (tmp_path / "bad.dxf").write_bytes(b"\xff\x00 no drawing")
    with pytest.raises(InputError, match=r"'bad\.dxf' cannot be read as DXF"):
        read_dxf(tmp_path / "bad.dxf")


def test_a_pipe_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.dxf")
    with pytest.raises(InputError, match=r"'pipe\.dxf' is not a regular file"):
        read_dxf(tmp_path / "pipe.dxf")


def test_a_missing_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr(dxf_file, "import_module", missing)
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    with pytest.raises(InputError, match=r"needs the package ezdxf, .* \(pip install ezdxf\)"):
        read_case(tmp_path / "case.toml")
