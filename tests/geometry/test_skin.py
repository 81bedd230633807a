"""Test the drawn surface of a geometry."""

from pathlib import Path

import gmsh
import matplotlib.image as mpimg
import numpy as np
import pytest

from perfplast_fenicsx.geometry import MeshingOptions, mesh_geometry
from perfplast_fenicsx.mesh import gmsh_session
from perfplast_fenicsx.pictures.drawing_process import draw_parts

pytestmark = pytest.mark.serial


@pytest.mark.long(but=["2"])
@pytest.mark.parametrize("dim", [2, 3])
def test_skin_and_picture(tmp_path: Path, dim: int) -> None:
    """Two squares or cubes side by side have all free faces, each with its number on it."""
    geo, skin, picture = (tmp_path / name for name in ("two.brep", "skin.npz", "two.png"))
    if dim == 2:
        geo = geo.with_suffix(".geo")
        places = ("1, 0, 0, 0, 1, 1", "2, 1, 0, 0, 1, 1")
        squares = [f"Rectangle({p.split(',')[0]}) = {{{p.partition(',')[2]}}};" for p in places]
        geo.write_text("\n".join(['SetFactory("OpenCASCADE");', *squares]))
    else:
        with gmsh_session():
            for x in (0, 1):
                gmsh.model.occ.addBox(x, 0, 0, 1, 1, 1)
            gmsh.model.occ.synchronize()
            gmsh.write(str(geo))
    found = mesh_geometry(geo, tmp_path / "two.msh", MeshingOptions(size=0.5), skin, trust=True)
    with np.load(skin) as file:
        arrays = {name: file[name] for name in file.files}
    corners = arrays["points"][arrays["triangles"]]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.bincount(arrays["body"], np.linalg.norm(sides, axis=1) / 2)
    assert areas == pytest.approx([1, 1] if dim == 2 else [5, 5])
    assert list(arrays["names"]) == [body.name for body in found.bodies]
    for face, number, place in zip(found.faces, arrays["numbers"], arrays["places"], strict=True):
        assert face.number == number
        if face.name.endswith("_y_low"):
            assert place[1] == pytest.approx(0, abs=1e-12)

    draw_parts(skin, picture)
    colours = np.unique(mpimg.imread(picture)[..., :3].reshape(-1, 3), axis=0)
    assert len(colours) > 20


@pytest.mark.long
@pytest.mark.parametrize("size", [(1, 1, 3), (6, 1, 1), (1, 6, 1)])
def test_long_bodies_are_not_cut_off(tmp_path: Path, size: tuple[int, int, int]) -> None:
    """The picture of a box ends in corners on all sides; if cut off, it would end in a line."""
    geo, skin, picture = (tmp_path / name for name in ("bar.brep", "skin.npz", "bar.png"))
    with gmsh_session():
        gmsh.model.occ.addBox(0, 0, 0, *size)
        gmsh.model.occ.synchronize()
        gmsh.write(str(geo))
    mesh_geometry(geo, tmp_path / "bar.msh", MeshingOptions(size=3), skin)
    draw_parts(skin, picture)
    image = mpimg.imread(picture)[60:-60, :, :3]
    blue = image[..., 2] - image[..., 0] > 0.2
    for half in np.array_split(blue, 2, axis=1):
        rows = np.flatnonzero(half.any(axis=1))
        assert half[rows[[0, -1]]].sum(axis=1).max() < 30
        assert max(np.ptp(rows) / half.shape[0], np.ptp(half.any(axis=0).nonzero()) / 700) > 0.5
