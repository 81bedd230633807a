"""The step at which a meshing program took too long."""

import pytest

from perfplast_fenicsx.geometry.kept_mesh import last_of

pytestmark = pytest.mark.serial

MESHING = 'perfplast {"doing":"meshing","faces":{"1":"plate","7":"bolt"}}'
FACE = "Info    : [ 40%] Meshing surface 7 (Plane, Frontal-Delaunay)"


def test_the_part_is_named() -> None:
    said = ['perfplast {"doing":"reading it","faces":{}}', "Info    : Reading", MESHING]
    assert last_of("\n".join(said[:2])) == "reading it"
    assert last_of("\n".join([*said, FACE])) == "meshing a face of 'bolt'"
    assert last_of("\n".join([*said, FACE, "Info    : Meshing 3D..."])).startswith("filling")
    assert last_of("") == "beginning"
