"""What is made in Python by hand, and is refused by a sentence that names the cause."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx.mesh import CellType, create_unit_square, meshtags

from perfplast_fenicsx import Contact, Pressure, Problem, Support, TaggedMesh, Tie, Traction
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import ElasticLaw
from tests.models import STEEL, touching_blocks

Change = Callable[[TaggedMesh], TaggedMesh]


@dataclass(frozen=True)
class Own:
    """An elastic material whose author checks nothing."""

    law: ClassVar[type[ElasticLaw]] = ElasticLaw

    young: float
    poisson: float

    def parameters(self) -> dict[str, float]:
        """Of Hooke's law."""
        bulk, shear = self.young / (3 - 6 * self.poisson), self.young / (2 + 2 * self.poisson)
        return {"bulk": bulk, "shear": shear}


@pytest.mark.parametrize(
    ("material", "part"),
    [
        (Own(-1e4, 0.3), "'lower' (Own) has an elastic stiffness that is not positive (bulk = -"),
        (Own(1e4, 0.7), "give young > 0 and poisson between -1 and 1/2"),
        (Own(1e4, 0.5), "divides by zero"),
        (Own(float("nan"), 0.3), "has bulk = nan"),
        (Own(0.0, 0.3), "not positive"),
    ],
)
def test_materials_of_ones_own_are_checked(material: Own, part: str) -> None:
    with pytest.raises(InputError) as refusal:
        touching_blocks(materials={"lower": material, "upper": STEEL})
    assert part in str(refusal.value)


def test_a_material_of_ones_own_that_is_right() -> None:
    assert touching_blocks(materials={"lower": Own(1e4, 0.3), "upper": STEEL}).num_dofs


def square(kind: CellType = CellType.triangle, cell_tag: int = 1, facet_tag: int = 1) -> TaggedMesh:
    """A unit square with a volume of tag 1 and a surface of tag 1 on the left."""
    mesh = create_unit_square(MPI.COMM_WORLD, 2, 2, kind)
    mesh.topology.create_connectivity(1, 2)
    cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
    left = np.flatnonzero(np.arange(mesh.topology.index_map(1).size_local) < 1).astype(np.int32)
    tags = meshtags(mesh, 2, cells, np.full(len(cells), cell_tag, dtype=np.int32))
    facets = meshtags(mesh, 1, left, np.full(len(left), facet_tag, dtype=np.int32))
    return TaggedMesh(mesh, tags, facets, {"body": 1}, {"left": 1})


def without_a_cell(mesh: TaggedMesh) -> TaggedMesh:
    """The first cell of each rank has no tag."""
    some = mesh.cell_tags.indices[1:]
    tags = meshtags(mesh.mesh, 2, some, np.ones(len(some), dtype=np.int32))
    return replace(mesh, cell_tags=tags)


@pytest.mark.parametrize(
    ("mesh", "part"),
    [
        (lambda: square(CellType.quadrilateral), "cells of the kind quadrilateral, but only tri"),
        (lambda: square(cell_tag=7), "belong to no named volume (there are the tags 7, which no"),
        (lambda: without_a_cell(square()), "belong to no named volume; name every body"),
        (lambda: square(facet_tag=9), "'left' has the tag 1, which no facet of the mesh has"),
    ],
)
def test_meshes_made_by_hand(mesh: Callable[[], TaggedMesh], part: str) -> None:
    with pytest.raises(InputError) as refusal:
        Problem(mesh(), {"body": STEEL}, [Support("left")], [Pressure("left", 1.0)])
    assert part in str(refusal.value)


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"contacts": [Tie("lower_top", "upper_bottom")]}, "give it as ties = [...]"),
        (
            {"loads": [Traction("top", lambda x: x)]},  # type: ignore[arg-type]
            "the load on 'top' has a function as value; give numbers, or formulas",
        ),
        (
            {"loads": [Traction("top", (0.0, 0.0, lambda x: x))]},  # type: ignore[arg-type]
            "the load on 'top' has a function as value",
        ),
    ],
)
def test_things_in_the_wrong_place(changes: dict[str, Any], part: str) -> None:
    with pytest.raises(InputError) as refusal:
        touching_blocks(**({"contacts": [Contact("lower_top", "upper_bottom")]} | changes))
    assert part in str(refusal.value)
