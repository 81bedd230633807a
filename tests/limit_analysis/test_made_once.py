"""Test that data for bounds are computed once for each mesh, and that the proof file uses them."""

import gc
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from weakref import ref

import pytest
from dolfinx.mesh import Mesh

from perfplast_fenicsx import Problem, ResultFolder, limit_bounds
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.limit_analysis.discrete import body_cones, discrete_limit
from perfplast_fenicsx.limit_analysis.facets import bound_body, contact_facets
from perfplast_fenicsx.limit_analysis.stress import static_form
from perfplast_fenicsx.limit_analysis.velocity import cell_dissipation
from perfplast_fenicsx.problem.once import once_a_problem
from tests.limit_analysis.test_body_bounds import quadratic_blocks
from tests.limit_analysis.test_interior_point import COMM, footing
from tests.models import touching_blocks

FACTS: dict[str, tuple[ModuleType, str]] = {
    "body": (bound_body, "facet_numbers"),
    "interfaces": (bound_body, "interfaces_of"),
    "cones": (body_cones, "_cones"),
    "facets in contact": (contact_facets, "facet_numbers"),
    "equilibrium": (static_form, "bound_body"),
    "strains of the program": (discrete_limit, "PointStrains"),
    "strains of the mechanism": (cell_dissipation, "PointStrains"),
}
"""By fact, the function that computes it."""

SEARCHED = {"cones": 2, "facets in contact": 2}
"""Facts of a problem; the problem of the search has other contact rows than the given problem."""


def mesh_of(it: Problem | Mesh) -> Mesh:
    """Return the mesh of a problem, or a mesh itself."""
    return it.tagged_mesh.mesh if isinstance(it, Problem) else it


@pytest.mark.parametrize("body", ["footing", "punch", "blocks"])
def test_each_fact_is_made_once_a_mesh(
    body: str, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: dict[str, list[Mesh]] = {name: [] for name in FACTS}

    def counted(name: str, make: Callable[..., object]) -> Callable[..., object]:
        def call(it: Problem | Mesh, *more: object) -> object:
            made[name].append(mesh_of(it))
            return make(it, *more)

        return call

    for name, (module, function) in FACTS.items():
        monkeypatch.setattr(module, function, counted(name, getattr(module, function)))
    blocks = body == "blocks"
    problem = quadratic_blocks() if blocks else footing(shared_tmp_path, punch=body == "punch")
    bounds = limit_bounds(problem, 1e-3)
    assert bounds.strict
    for name, meshes in made.items():
        assert meshes or name == "facets in contact"
        times = Counter(id(mesh) for mesh in meshes)
        assert max(times.values(), default=0) <= SEARCHED.get(name, 1), name
    before = {name: len(meshes) for name, meshes in made.items()}
    folder = ResultFolder(COMM, shared_tmp_path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    assert {name: len(meshes) for name, meshes in made.items()} == before


def test_facts_live_as_long_as_their_problem() -> None:
    asked: list[int] = []

    @once_a_problem
    def cells(problem: Problem) -> int:
        asked.append(1)
        return int(problem.tagged_mesh.mesh.topology.index_map(3).size_global)

    problem, other = touching_blocks(), touching_blocks()
    assert cells(problem) == cells(problem) == cells(other) > 0
    assert len(asked) == 2
    gone = ref(problem)
    del problem
    gc.collect()
    assert gone() is None
