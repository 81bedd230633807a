"""Test the step at which a meshing program took too long."""

import pytest

from perfplast_fenicsx.geometry.kept_mesh import _cause, last_of

pytestmark = pytest.mark.serial

MESHING = 'perfplast {"doing":"meshing","faces":{"1":"plate","7":"bolt"}}'
FACE = "Info    : [ 40%] Meshing surface 7 (Plane, Frontal-Delaunay)"


def test_the_part_is_named() -> None:
    said = ['perfplast {"doing":"reading it","faces":{}}', "Info    : Reading", MESHING]
    assert last_of("\n".join(said[:2])) == "reading it"
    assert last_of("\n".join([*said, FACE])) == "meshing a face of 'bolt'"
    assert last_of("\n".join([*said, FACE, "Info    : Meshing 3D..."])).startswith("filling")
    assert last_of("") == "beginning"


def test_a_program_that_gmsh_has_ended() -> None:
    """The first error that gmsh printed is the reason."""
    said = "Warning : 1\nError   : Invalid boundary mesh on surface 279\nError   : No elements\n"
    words = _cause("part.step", 1, said)
    assert "could not mesh 'part.step' (Invalid boundary mesh on surface 279);" in words
    assert "(status 3)" in _cause("part.step", 3, "")
