"""Test that every reader refuses HDF5 files that lead elsewhere or exaggerate their content."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.export.vtu_writer import vtu_of
from perfplast_fenicsx.io.results.vtkhdf import read_rows
from perfplast_fenicsx.models.inp_keywords import read_keywords
from perfplast_fenicsx.models.med_file import read_med
from perfplast_fenicsx.models.number_text import text_of
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.proof.checker import check
from perfplast_fenicsx.proof.plain_arrays import ProofError
from perfplast_fenicsx.proof.stored_file import MOST_OBJECTS, stored_file

pytestmark = pytest.mark.serial

SECRET = 4711.0
"""A number in a file that no reader may open."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder beside a file to which it must not lead."""
    with h5py.File(tmp_path / "elsewhere.h5", "w") as file:
        file["a"] = np.full(10, SECRET)
    (tmp_path / "in").mkdir()
    return tmp_path / "in"


def external_link(file: h5py.File) -> None:
    file["a"] = h5py.ExternalLink("../elsewhere.h5", "/a")


def link_to_a_file_that_may_be_meant(file: h5py.File) -> None:
    """The file itself is a symbolic link."""
    beside = Path(file.filename).parent / "mesh.h5"
    beside.symlink_to("../elsewhere.h5")
    file["a"] = h5py.ExternalLink("mesh.h5", "/a")


def soft_link(file: h5py.File) -> None:
    file["b"] = 1.0
    file["a"] = h5py.SoftLink("/b")


def dangling_link(file: h5py.File) -> None:
    file["a"] = h5py.SoftLink("/nowhere")


def in_a_group(file: h5py.File) -> None:
    file.create_group("deep/er")["a"] = h5py.ExternalLink("../elsewhere.h5", "/a")


def virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((10,), "f8")
    layout[:] = h5py.VirtualSource("../elsewhere.h5", "a", shape=(10,))
    file.create_virtual_dataset("a", layout)


def external_storage(file: h5py.File) -> None:
    place = Path(file.filename).parents[1] / "elsewhere.h5"
    file.create_dataset("a", (10,), "f8", external=[(str(place), 0, 80)])


def without_storage(file: h5py.File) -> None:
    file.create_dataset("a", (2**36, 3), "f8", chunks=(1024, 3))


def bomb(file: h5py.File) -> None:
    """Write an array with a thousand times as many bytes as are stored."""
    data = file.create_dataset("a", (2**36,), "u1", chunks=(2**20,), compression="gzip")
    data[: 2**20] = 0


def ring(file: h5py.File) -> None:
    file.create_group("a")["b"] = file["/"]


def one_text_many_times(file: h5py.File) -> None:
    file.create_dataset("a", (10**5,), h5py.string_dtype("ascii"))[:10] = "a" * 10**4


HOSTILE: list[tuple[Callable[[h5py.File], None], str]] = [
    (external_link, "a is a link"),
    (link_to_a_file_that_may_be_meant, "mesh.h5 is a link"),
    (soft_link, "a is a link"),
    (dangling_link, "a is a link"),
    (in_a_group, "a is a link"),
    (virtual, "not in the file itself"),
    (external_storage, "not in the file itself"),
    (without_storage, "the file contains fewer"),
    (bomb, "the file contains fewer"),
    (ring, "another name"),
    (one_text_many_times, "texts"),
]


@pytest.mark.parametrize(("make", "words"), HOSTILE)
def test_what_is_not_in_the_file(
    folder: Path, make: Callable[[h5py.File], None], words: str
) -> None:
    path = folder / "it.h5"
    with h5py.File(path, "w") as file:
        make(file)
    with pytest.raises(ValueError, match=words), stored_file(path, ("mesh.h5",)):
        pass
    with pytest.raises(InputError, match=words.replace("mesh.h5", "a")):
        read_med(path)
    with pytest.raises(ProofError, match=words.replace("mesh.h5", "a")):
        check(path)
    with pytest.raises(ValueError, match=words.replace("mesh.h5", "a")):
        vtu_of(path)
    assert MOST_OBJECTS >= 1000  # honest files of other programs have this number of groups


def test_links_to_the_mesh_beside_it(folder: Path) -> None:
    """A file of fields takes its mesh only from the same folder."""
    with h5py.File(folder / "mesh.h5", "w") as file:
        file["a"] = [1.0, 2.0]
    with h5py.File(folder / "it.h5", "w") as file:
        file["a"] = h5py.ExternalLink("mesh.h5", "/a")
    with stored_file(folder / "it.h5", ("mesh.h5",)) as file:
        assert np.asarray(file["a"]).sum() == pytest.approx(3.0)
    with h5py.File(folder / "mesh.h5", "w") as file:
        external_link(file)
    with (
        pytest.raises(ValueError, match="a is a link"),
        stored_file(folder / "it.h5", ("mesh.h5",)),
    ):
        pass


def test_compressed_arrays_of_other_programs(folder: Path) -> None:
    """Zeros are compressed by a factor of a thousand, and can be read if there are not too many."""
    path = folder / "it.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("a", data=np.zeros(10**5), compression="gzip")
    with stored_file(path) as file:
        assert not np.asarray(file["a"]).any()


@pytest.mark.parametrize("name", ["mesh.med", "mesh.inp", "mesh.unv", "bounds.h5", "rows.h5"])
def test_a_pipe_in_the_place_of_a_file(folder: Path, name: str) -> None:
    """Nobody writes to the pipe, so a reader would wait for ever."""
    path = folder / name
    os.mkfifo(path)
    read: dict[str, Callable[[], object]] = {
        "mesh.med": lambda: read_med(path),
        "mesh.inp": lambda: read_keywords(path),
        "mesh.unv": lambda: text_of(path),
        "bounds.h5": lambda: check(path),
        "rows.h5": lambda: read_rows(path, "a", None),  # type: ignore[arg-type]
    }
    with pytest.raises((InputError, ProofError, OSError), match="not a regular file"):
        read[name]()


def results(folder: Path, entries: list[object]) -> ResultReader:
    """Return a folder with a list of fields."""
    for name in ("summary.json", "path.csv", "scene.json"):
        (folder / name).write_text("{}")
    (folder / "fields.vtkhdf.series").write_text(
        json.dumps({"files": [{"name": name, "time": 0.0} for name in entries]})
    )
    return ResultReader(folder)


@pytest.mark.parametrize(
    "name", ["../elsewhere.h5", "fields/../../elsewhere.h5", "linked.h5", "pipe.h5", 7, None]
)
def test_a_list_of_fields_that_leads_elsewhere(folder: Path, name: object) -> None:
    (folder / "linked.h5").symlink_to("../elsewhere.h5")
    os.mkfifo(folder / "pipe.h5")
    with pytest.raises(InputError, match=r"lies outside|not a regular file|No such file"):
        _ = results(folder, [name]).levels


@pytest.mark.parametrize("name", ["summary.json", "scene.json"])
def test_a_table_that_is_a_link(folder: Path, name: str) -> None:
    reader = results(folder, [])
    (folder / name).unlink()
    (folder.parent / "secret.json").write_text('{"number": 4711}')
    (folder / name).symlink_to("../secret.json")
    with pytest.raises(InputError, match="lies outside"):
        _ = reader.summary if name == "summary.json" else reader.named


def test_files_that_include_each_other_many_times(folder: Path) -> None:
    """Two thousand lines in each of four files would be 1.6e13 lines."""
    files = [folder / f"{letter}.inp" for letter in "abcd"]
    for path, other in zip(files, [*files[1:], None], strict=True):
        line = "*NODE\n" if other is None else f"*INCLUDE, INPUT={other.name}\n"
        path.write_text(2000 * line)
    with pytest.raises(InputError, match="100 inclusions"):
        read_keywords(files[0])


def test_a_file_that_is_included_twice(folder: Path) -> None:
    (folder / "a.inp").write_text(2 * "*INCLUDE, INPUT=b.inp\n")
    (folder / "b.inp").write_text("*NODE\n1, 0.0\n")
    assert [keyword.name for keyword in read_keywords(folder / "a.inp")] == ["NODE", "NODE"]
