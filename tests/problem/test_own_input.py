"""Test Python objects that are refused in a sentence that names the cause."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx.mesh import (
    CellType,
    GhostMode,
    Mesh,
    MeshTags,
    compute_midpoints,
    create_unit_square,
    locate_entities_boundary,
    meshtags,
)

from perfplast_fenicsx import Contact, Plane, Pressure, Problem, Support, TaggedMesh, Tie, Traction
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import ElasticLaw
from perfplast_fenicsx.mesh.tagged_mesh import Tags
from perfplast_fenicsx.problem.judged.resultants import load_resultants
from tests.models import STEEL, touching_blocks

Change = Callable[[TaggedMesh], TaggedMesh]


@dataclass(frozen=True)
class Own:
    """An elastic material without checks of its parameters."""

    law: ClassVar[type[ElasticLaw]] = ElasticLaw

    young: float
    poisson: float

    def parameters(self) -> dict[str, float]:
        """Return the parameters of Hooke's law."""
        bulk, shear = self.young / (3 - 6 * self.poisson), self.young / (2 + 2 * self.poisson)
        return {"bulk": bulk, "shear": shear}


@pytest.mark.parametrize(
    ("material", "part"),
    [
        (Own(-1e4, 0.3), "'lower' (Own) has an elastic stiffness"),
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
    """Return a unit square with a volume of tag 1, and a surface of tag 1 on the left."""
    mesh = create_unit_square(MPI.COMM_WORLD, 2, 2, kind)
    mesh.topology.create_connectivity(1, 2)
    cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
    left = np.flatnonzero(np.arange(mesh.topology.index_map(1).size_local) < 1).astype(np.int32)
    tags = meshtags(mesh, 2, cells, np.full(len(cells), cell_tag, dtype=np.int32))
    facets = meshtags(mesh, 1, left, np.full(len(left), facet_tag, dtype=np.int32))
    return TaggedMesh(mesh, tags, facets, {"body": 1}, {"left": 1})


def without_a_cell(mesh: TaggedMesh) -> TaggedMesh:
    """Remove the tag of the first cell on each rank."""
    some = mesh.cell_tags.indices[1:]
    tags = meshtags(mesh.mesh, 2, some, np.ones(len(some), dtype=np.int32))
    return replace(mesh, cell_tags=tags)


@pytest.mark.parametrize(
    ("mesh", "part"),
    [
        (lambda: square(CellType.quadrilateral), "cells of type quadrilateral,"),
        (lambda: square(cell_tag=7), "without a volume: 7"),
        (lambda: without_a_cell(square()), "belong to no named volume"),
        (lambda: square(facet_tag=9), "'left' has the tag 1,"),
    ],
)
def test_meshes_made_by_hand(mesh: Callable[[], TaggedMesh], part: str) -> None:
    with pytest.raises(InputError) as refusal:
        Problem(mesh(), {"body": STEEL}, [Support("left")], [Pressure("left", 1.0)])
    assert part in str(refusal.value)


def tagged_square(
    kind: CellType = CellType.triangle, ghosts: GhostMode = GhostMode.shared_facet
) -> tuple[Mesh, MeshTags, MeshTags]:
    """Return a unit square with cell tags 3 below and 4 above, and facet tags 1 to 3.

    Only the owner of a cell or facet has its tag. Facets at x = 0 have the tag 1, at x = 1 the tag
    2, at y = 1 the tag 3.
    """
    mesh = create_unit_square(MPI.COMM_WORLD, 4, 4, kind, ghost_mode=ghosts)
    owned = mesh.topology.index_map(2).size_local
    middle = compute_midpoints(mesh, 2, np.arange(owned, dtype=np.int32))[:, 1]
    cells = meshtags(
        mesh, 2, np.arange(owned, dtype=np.int32), np.where(middle < 0.5, 3, 4).astype(np.int32)
    )
    mesh.topology.create_connectivity(1, 2)
    sides = [
        locate_entities_boundary(mesh, 1, lambda x, axis=axis, at=at: np.isclose(x[axis], at))
        for axis, at in ((0, 0.0), (0, 1.0), (1, 1.0))
    ]
    own = [side[side < mesh.topology.index_map(1).size_local] for side in sides]
    numbers = np.repeat(np.array([1, 2, 3], dtype=np.int32), [len(side) for side in own])
    facets = np.concatenate(own)
    order = np.argsort(facets)
    return mesh, cells, meshtags(mesh, 1, facets[order], numbers[order])


NAMES: dict[str, Any] = {
    "volumes": {"lower": 3, "upper": 4},
    "surfaces": {"left": 1, "right": 2, "sides": (1, 2)},
}


@pytest.mark.mpi2
def test_names_for_tags_of_dolfinx() -> None:
    """A side has its whole length on any number of ranks, with and without ghost cells."""
    for ghosts in (GhostMode.shared_facet, GhostMode.none):
        tagged_mesh = TaggedMesh.from_tags(*tagged_square(ghosts=ghosts), **NAMES)
        assert tagged_mesh.volumes == {"lower": 3, "upper": 4}
        assert tagged_mesh.surfaces == {"left": 1, "right": 2, "sides": (1, 2)}
        assert tagged_mesh.remarks == ("facets with the tags 3 have no name and are ignored",)
        cells = tagged_mesh.mesh.topology.index_map(2)
        assert len(tagged_mesh.cell_tags.indices) == cells.size_local + cells.num_ghosts
        problem = Problem(
            tagged_mesh,
            {"lower": STEEL, "upper": STEEL},
            [Support("left", "x"), Support("right", "y")],
            [Traction("right", (1.0, 0.0))],
        )
        assert problem.num_dofs == 2 * 25
        assert load_resultants(problem)[0].force == pytest.approx((1.0, 0.0))


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"volumes": {"lower": 3}}, "without a volume: 4"),
        ({"volumes": {"lower": 3, "upper": 7}}, "'upper' has the tag 7,"),
        ({"volumes": {"a": 3, "b": 3, "c": 4}}, "'b' has the tag 3 of 'a';"),
        ({"volumes": {"lower": 3.0, "upper": 4}}, "'lower' has the tag 3.0"),
        ({"volumes": {"lower": (3, 4)}}, "'lower' has the tags (3, 4);"),
        (
            {"surfaces": {"left": 9}},
            "'left' has the tag 9,",
        ),
        ({"surfaces": {"left": ()}}, "'left' has the tag (),"),
        ({"surfaces": {"left": "1"}}, "'left' has the tag '1',"),
        ({"kind": CellType.quadrilateral}, "cells of type quadrilateral,"),
        ({"swap": True}, "belong to entities of dimension 1,"),
    ],
)
def test_names_for_wrong_tags(changes: dict[str, Any], part: str) -> None:
    changes = dict(changes)
    mesh, cells, facets = tagged_square(changes.pop("kind", CellType.triangle))
    tags = (facets, cells) if changes.pop("swap", False) else (cells, facets)
    with pytest.raises(InputError) as refusal:
        TaggedMesh.from_tags(mesh, *tags, **NAMES | changes)
    assert part in str(refusal.value)


PAIR = Contact("lower_top", "upper_bottom")
ABOVE = Plane("top", (0.0, 0.0, 3.0), (0.0, 0.0, -1.0))


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        (
            {"contacts": [PAIR, Support("top")]},
            "contacts = [...] contains an object",
        ),
        ({"supports": [ABOVE]}, "objects of type Support or RigidSurface"),
        ({"supports": Support("top")}, "an object of type Support, not a list"),
        (
            {"contacts": 2 * [PAIR]},
            "contact 1 ('lower_top', 'upper_bottom');",
        ),
        (
            {"contacts": [Tie("upper_bottom", "lower_top"), PAIR]},
            "tie 1 ('upper_bottom', 'lower_top') has th",
        ),
        ({"obstacles": 2 * [ABOVE]}, "and their surfaces share facets"),
        (
            {"loads": [Traction("top", lambda x: x)]},  # type: ignore[arg-type]
            "'top' is a function",
        ),
        (
            {"loads": [Traction("top", (0.0, 0.0, lambda x: x))]},  # type: ignore[arg-type]
            "'top' is a function",
        ),
    ],
)
def test_things_in_the_wrong_place(changes: dict[str, Any], part: str) -> None:
    with pytest.raises(InputError) as refusal:
        touching_blocks(**({"contacts": [Contact("lower_top", "upper_bottom")]} | changes))
    assert part in str(refusal.value)


def with_parts() -> TaggedMesh:
    """Return two stacked cubes; a part of each side has a separate name."""
    whole = touching_blocks().tagged_mesh
    tags, dim = whole.facet_tags, whole.mesh.topology.dim
    at = compute_midpoints(whole.mesh, dim - 1, tags.indices)[:, 0] < 0.5
    values = np.where(at, tags.values + 100, tags.values).astype(np.int32)
    surfaces: dict[str, Tags] = {}
    for name, tag in whole.surfaces.items():
        assert isinstance(tag, int)
        surfaces |= {name: (tag, tag + 100), f"{name}_part": tag + 100}
    facets = meshtags(whole.mesh, dim - 1, tags.indices, values)
    return replace(whole, facet_tags=facets, surfaces=surfaces)


@pytest.mark.parametrize(
    ("contacts", "part"),
    [
        ([PAIR, Contact("lower_top_part", "upper_bottom_part")], "contact 2 ('lower_top_part'"),
        ([Contact("upper_bottom", "lower_top_part"), PAIR], "on both surfaces with contact 1"),
        ([PAIR, Tie("lower_top_part", "upper_bottom_part")], "tie 1 ('lower_top_part', "),
        ([Tie("lower_top", "lower_top_part")], "the two surfaces share facets"),
    ],
)
def test_facets_in_two_contacts_or_ties(contacts: list[Contact | Tie], part: str) -> None:
    with pytest.raises(InputError) as refusal:
        touching_blocks(with_parts(), contacts=contacts)
    assert part in str(refusal.value)
