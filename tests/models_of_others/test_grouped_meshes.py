"""Test meshes with groups from other programs: .med, .unv, .bdf, .vtu."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import pyvista
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

from perfplast_fenicsx import InputError
from perfplast_fenicsx.models.bdf_file import read_bdf
from perfplast_fenicsx.models.element_types import HEXAHEDRON, TETRAHEDRON, WEDGE
from perfplast_fenicsx.models.foreign_model import ForeignModel
from perfplast_fenicsx.models.inp_file import read_inp
from perfplast_fenicsx.models.med_file import TYPES, read_med
from perfplast_fenicsx.models.unv_file import KINDS, read_unv
from perfplast_fenicsx.models.vtu_file import read_vtu
from tests.models_of_others.meshes import FACES, POINTS, SOLIDS, bdf_text, unv_text, write_med

pytestmark = pytest.mark.serial


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="latin-1")
    return path


def areas(model: ForeignModel) -> dict[str, float]:
    """Return the areas of the surfaces by name."""
    p = model.points[model.facets]
    each = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1) / 2
    return {name: float(each[model.surface == k].sum()) for k, name in enumerate(model.surfaces)}


def volumes(model: ForeignModel) -> dict[str, float]:
    """Return the volumes of the bodies by name."""
    edges = model.points[model.cells[:, 1:]] - model.points[model.cells[:, :1]]
    each = np.linalg.det(edges) / 6
    assert (each > 0).all()
    return {name: float(each[model.body == k].sum()) for k, name in enumerate(model.bodies)}


READ: dict[str, Callable[[Path], ForeignModel]] = {
    "med": lambda folder: read_med(write_med(folder / "a.med")),
    "med, bytes the other way round": lambda folder: read_med(
        write_med(folder / "a.med", ">f8", ">i4")
    ),
    "med, 64 bits": lambda folder: read_med(write_med(folder / "a.med", whole="<i8")),
    "med 2.3": lambda folder: read_med(write_med(folder / "a.med", old=True)),
    "unv": lambda folder: read_unv(written(folder / "a.unv", unv_text())),
    "unv, older groups": lambda folder: read_unv(written(folder / "a.unv", unv_text(2))),
}


@pytest.mark.parametrize("how", READ)
def test_groups_are_bodies_and_surfaces(tmp_path: Path, how: str) -> None:
    """Groups of nodes also count if they form a surface; a remark names all others."""
    found = READ[how](tmp_path)
    assert volumes(found) == pytest.approx({"lower": 1.0, "upper": 1.5})
    measured = areas(found)
    foot = next(name for name in measured if "foot" in name)
    assert "footnodes" in foot  # equal faces give one surface with both names
    assert measured == pytest.approx({foot: 1.0, "top": 1.0, "side": 2.5})
    told = " ".join(found.remarks)
    assert "'all' consists of smaller groups" in told
    assert "outside all bodies, which are ignored: 'between'" in told
    assert "nodes that do not form a surface are ignored: 'edge'" in told


@pytest.mark.parametrize("options", [{}, {"comma": True}, {"long": True}])
def test_nastran(tmp_path: Path, options: dict[str, bool]) -> None:
    found = read_bdf(written(tmp_path / "a.bdf", bdf_text(**options)))
    assert volumes(found) == pytest.approx({"lower": 1.0, "upper": 1.5})
    (foot,) = [name for name in found.surfaces if "pid_11" in name]
    assert foot == "pid_11_and_held_123_of_set_1"
    assert areas(found) == pytest.approx({foot: 1.0, "pid_12": 1.0})
    steel = found.materials["lower"]
    assert (steel.young, steel.poisson, steel.density) == pytest.approx((2.1e5, 0.3, 7.85e-9))
    assert any("FORCE (1 cards) has no counterpart" in remark for remark in found.remarks)


def test_vtk(tmp_path: Path) -> None:
    cells = [[8, *nodes] for nodes in SOLIDS] + [[4, *nodes] for nodes in FACES[:2]]
    kinds = [pyvista.CellType.HEXAHEDRON] * 2 + [pyvista.CellType.QUAD] * 2
    grid = pyvista.UnstructuredGrid(np.concatenate(cells), kinds, POINTS)
    grid.cell_data["region"] = np.array([1, 2, 7, 8])
    grid.cell_data["rank"] = np.array([0, 1, 0, 1])
    grid.cell_data["stress"] = np.ones(4)
    grid.save(tmp_path / "a.vtu")
    found = read_vtu(tmp_path / "a.vtu")
    assert volumes(found) == pytest.approx({"region_1": 1.0, "region_2": 1.5})
    assert areas(found) == pytest.approx({"region_7": 1.0, "region_8": 1.0})
    assert any("other arrays ('rank') are ignored" in remark for remark in found.remarks)


def test_vtk_with_bytes_the_other_way_round(tmp_path: Path) -> None:
    grid = pyvista.UnstructuredGrid({pyvista.CellType.HEXAHEDRON: SOLIDS}, POINTS)
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(str(tmp_path / "a.vtu"))
    writer.SetByteOrderToBigEndian()
    assert writer.Write()
    assert b"BigEndian" in (tmp_path / "a.vtu").read_bytes()
    assert volumes(read_vtu(tmp_path / "a.vtu")) == pytest.approx({"rest": 2.5})


def test_a_mesh_with_sets_alone(tmp_path: Path) -> None:
    """The .inp file has the form of gmsh and Salome: its sets are bodies and surfaces."""
    text = "*NODE\n" + "".join(f"{k},{x},{y},{z}\n" for k, (x, y, z) in enumerate(POINTS, start=1))
    for k, nodes in enumerate(SOLIDS, start=1):
        text += f"*ELEMENT, TYPE=C3D8, ELSET=BODY{k}\n{k}," + ",".join(map(str, nodes + 1)) + "\n"
    text += "*ELEMENT, TYPE=S4, ELSET=FOOT\n9," + ",".join(map(str, FACES[0] + 1)) + "\n"
    text += "*NSET, NSET=TOP\n9,10,11,12\n*NSET, NSET=NALL, GENERATE\n1,12\n"
    found = read_inp(written(tmp_path / "a.inp", text))
    assert volumes(found) == pytest.approx({"body1": 1.0, "body2": 1.5})
    assert areas(found) == pytest.approx({"foot": 1.0, "top": 1.0})
    assert any("'NALL' is the whole surface" in remark for remark in found.remarks)


@pytest.mark.parametrize("number", [113, 116, 118])
def test_midsides_of_unv_stand_between_corners(number: int) -> None:
    """Nodes run around quadratic elements in this format.

    Midside nodes of straight edges are central.
    """
    kind, order = KINDS[number]
    corners = {
        TETRAHEDRON: "000 200 020 002",
        WEDGE: "000 200 020 002 202 022",
        HEXAHEDRON: "000 200 220 020 002 202 222 022",
    }[kind.shape]
    places = np.array([[float(x) for x in corner] for corner in corners.split()])
    n = kind.shape.corners
    base = n // 2 if n > 4 else 3
    around = [(k, (k + 1) % base) for k in range(base)]
    up = [(k, k + base) for k in range(base)] if n > 4 else [(k, 3) for k in range(3)]
    rows = [row for k in range(base) for row in (places[k], places[list(around[k])].mean(axis=0))]
    rows += [places[list(pair)].mean(axis=0) for pair in up]
    if n == 4:
        rows.append(places[3])
    for k in range(base if n > 4 else 0):
        rows += [places[base + k], places[[base + i for i in around[k]]].mean(axis=0)]
    ordered = np.array(rows)[order]
    assert ordered[:n] == pytest.approx(places)
    for (a, b), middle in zip(kind.shape.midsides, ordered[n:], strict=True):
        assert middle == pytest.approx(places[[a, b]].mean(axis=0))


def test_med_names_have_as_many_nodes_as_they_say() -> None:
    digits = {name: int("".join(c for c in name if c.isdigit())) for name in TYPES}
    assert {name: kind.nodes for name, kind in TYPES.items()} == digits


BROKEN_TEXT = {
    "nothing": ("", "no nodes"),
    "other words": ("hello\n", "no nodes"),
    "no text": ("\0\0", "not a text file"),
    "unv cut off": (unv_text()[:700], "cut off or damaged|no solid elements|no nodes"),
    "unv with a word for a number": (
        unv_text().replace("1.0000000000000000D+00", "x"),
        "are expected",
    ),
    "unv without a node": (
        unv_text().replace(f"{15:10}\n", f"{99:10}\n"),
        "no node with the number 99",
    ),
    "unv with an infinite place": (
        unv_text().replace("1.0000000000000000D+00", "inf                   "),
        "not finite",
    ),
    "unv of faces alone": (unv_text().replace(f"{115:10}", f"{999:10}"), "only shells"),
    "unv with a group cut off": (unv_text().removesuffix("    -1\n")[:-30] + "\n    -1\n", "group"),
}


@pytest.mark.parametrize("fault", BROKEN_TEXT)
def test_broken_unv_is_one_sentence(tmp_path: Path, fault: str) -> None:
    text, says = BROKEN_TEXT[fault]
    with pytest.raises(InputError, match=says) as caught:
        read_unv(written(tmp_path / "a.unv", text))
    assert str(caught.value).startswith(f"'{tmp_path / 'a.unv'}'")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("CHEXA ", "CHEXB "), "only shells"),
        (("GRID    11              0.0", "GRID    11              zero"), "not numbers"),
        (("GRID    11              0.0", "GRID    11      7       0.0"), "coordinate system 7"),
        (
            ("CHEXA   1       1       11", "CHEXA   1       1       99"),
            "no node with the number 99",
        ),
        (("BEGIN BULK\n", "BEGIN BULK\n+       1\n"), "is a continuation line"),
        (("GRID ", "DIRG "), "no nodes"),
    ],
)
def test_broken_bdf_is_one_sentence(tmp_path: Path, change: tuple[str, str], says: str) -> None:
    text = bdf_text()
    assert change[0] in text
    with pytest.raises(InputError, match=says):
        read_bdf(written(tmp_path / "a.bdf", text.replace(*change)))


def _spoil(path: Path, what: str) -> None:
    with h5py.File(path, "a") as file:
        mesh = file["ENS_MAA/Mesh_1/-0000000000000000001-0000000000000000001"]
        if what == "node":
            mesh["MAI/HE8/NOD"][0] = 99
        elif what == "family":
            del mesh["MAI/HE8/FAM"]
            mesh["MAI/HE8/FAM"] = np.zeros(7, dtype=np.int32)
        elif what == "place":
            mesh["NOE/COO"][0] = np.nan
        elif what == "places":
            del mesh["NOE"]
        elif what == "mesh":
            del file["ENS_MAA/Mesh_1"]
        elif what == "groups":
            del file["FAS"]


@pytest.mark.parametrize(
    ("what", "says"),
    [
        ("node", "nodes that do not exist"),
        ("family", "7 family numbers"),
        ("place", "finite coordinates"),
        ("places", "no nodes"),
        ("mesh", "no mesh"),
    ],
)
def test_broken_med_is_one_sentence(tmp_path: Path, what: str, says: str) -> None:
    path = write_med(tmp_path / "a.med")
    _spoil(path, what)
    with pytest.raises(InputError, match=says) as caught:
        read_med(path)
    assert "\n" not in str(caught.value)


def test_a_med_without_groups_is_one_body(tmp_path: Path) -> None:
    path = write_med(tmp_path / "a.med")
    _spoil(path, "groups")
    assert read_med(path).bodies == ["rest"]


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("kind", ["med", "vtu"])
def test_files_that_are_cut_off_are_one_sentence(tmp_path: Path, kind: str, share: float) -> None:
    path = tmp_path / f"a.{kind}"
    if kind == "med":
        write_med(path)
    else:
        grid = pyvista.ImageData(dimensions=(3, 3, 3)).cast_to_unstructured_grid()
        grid.save(path)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(InputError) as caught:
        {"med": read_med, "vtu": read_vtu}[kind](path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("read", [read_med, read_unv, read_bdf, read_vtu, read_inp])
def test_files_that_are_not_there(tmp_path: Path, read: Callable[[Path], ForeignModel]) -> None:
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read(tmp_path / "none.x")


@pytest.mark.parametrize("read", [read_med, read_unv, read_bdf, read_vtu, read_inp])
def test_files_of_noise(tmp_path: Path, read: Callable[[Path], ForeignModel]) -> None:
    path = tmp_path / "noise.vtu"
    path.write_bytes(np.random.default_rng(1).bytes(3000))
    with pytest.raises(InputError) as caught:
        read(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ["med", "unv", "bdf"])
def test_files_with_random_faults_are_read_or_refused(tmp_path: Path, kind: str) -> None:
    """With bytes changed, removed or repeated, a file gives a model or one sentence."""
    path, random = tmp_path / f"a.{kind}", np.random.default_rng(7)
    if kind == "med":
        write_med(path)
    else:
        written(path, {"unv": unv_text(), "bdf": bdf_text()}[kind])
    whole, refused = path.read_bytes(), 0
    for _ in range(60):
        raw = bytearray(whole)
        for _ in range(int(random.integers(1, 4))):
            at, many = int(random.integers(len(raw))), int(random.integers(1, 40))
            how = random.integers(3) if kind != "med" else 0
            if how == 0:
                raw[at] = int(random.integers(256))
            elif how == 1:
                del raw[at : at + many]
            else:
                raw[at:at] = raw[at : at + many]
        path.write_bytes(bytes(raw))
        try:
            model = {"med": read_med, "unv": read_unv, "bdf": read_bdf}[kind](path)
            assert len(model.cells) == len(model.body) > 0
        except InputError as error:
            assert "\n" not in str(error)
            refused += 1
    assert 0 < refused < 60


def test_names_in_latin_1(tmp_path: Path) -> None:
    """Files from old systems are not in UTF-8; names keep their plain characters."""
    text = unv_text().replace("lower", "unterer Körper")
    path = tmp_path / "a.unv"
    path.write_bytes(text.encode("latin-1"))
    assert read_unv(path).bodies[0] == "unterer_k_rper"
