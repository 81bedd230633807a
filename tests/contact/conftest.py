"""Define meshes for the tests of contact."""

import pytest

from meshes.wedge import write_wedge
from perfplast_fenicsx import TaggedMesh
from tests.models import Read


@pytest.fixture
def wedge(read: Read) -> TaggedMesh:
    """Return two blocks that meet on an inclined plane."""
    return read(write_wedge, size=0.4)
