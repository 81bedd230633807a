"""Draw the picture of a case: its bodies with the surfaces that carry loads and supports."""

import logging
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.cli.understood import Understood
from perfplast_fenicsx.compat import geometry_dofmap
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.pictures import drawing_process, result_figures
from perfplast_fenicsx.problem.judged.sides import OuterFacets
from perfplast_fenicsx.problem.problem import Problem

PICTURE = "case.png"
"""Name of the picture that ``check`` draws next to a case file."""


@dataclass(frozen=True, eq=False)
class Section:
    """Cells of plane bodies, which the picture fills with one colour for each body.

    Attributes:
        cells: Corners of the cells, shape (n, 3, 2).
        bodies: Number of the body to which each cell belongs, shape (n,).
        names: Names of the bodies.
        water: Points of the water table, shape (n, 2); no points if there is no water table.
    """

    cells: Floats = field(default_factory=lambda: np.zeros((0, 3, 2)))
    bodies: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    names: tuple[str, ...] = ()
    water: Floats = field(default_factory=lambda: np.zeros((0, 2)))


def _section(case: Case, problem: Problem) -> Section:
    """Return the plane bodies, gathered on rank 0; no cells for 3D bodies. Collective."""
    tagged_mesh = problem.tagged_mesh
    mesh, comm = tagged_mesh.mesh, problem.comm
    if mesh.topology.dim != 2:
        return Section()
    owned = mesh.topology.index_map(2).size_local
    corners = mesh.geometry.x[geometry_dofmap(mesh)[:owned, :3], :2]
    body = np.zeros(owned, dtype=np.int32)
    for number, name in enumerate(tagged_mesh.volumes):
        own = tagged_mesh.cells(name)
        body[own[own < owned]] = number
    cells: Floats = np.concatenate(comm.gather(corners) or [corners])
    bodies: Ints = np.concatenate(comm.gather(body) or [body])
    return Section(cells, bodies, tuple(tagged_mesh.volumes), case.water.table)


def draw_case(case: Case, problem: Problem, meant: Understood | None, picture: Path) -> bool:
    """Draw a case with its loads and supports; return whether the system can draw. Collective.

    Args:
        case: The case; the picture has its title.
        problem: The problem of the case.
        meant: The result of :func:`perfplast_fenicsx.cli.understood.understood`.
        picture: A PNG file.

    Returns:
        Whether the picture was drawn, the same on every rank. Plane bodies are drawn by rank 0. 3D
        bodies need a graphics system; without it a warning is logged and nothing is drawn.
    """
    section = _section(case, problem)

    def draw() -> None:
        assert meant is not None  # on rank 0
        arrays: dict[str, Any] = arrays_of(
            case.title, meant, section, problem.tagged_mesh.axisymmetric
        )
        if problem.bodies.gdim == 2:
            logging.getLogger("matplotlib").setLevel(logging.ERROR)  # no words about font caches
            result_figures.draw_case(arrays, picture)
            return
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "case.npz"
            np.savez(file, **arrays)
            drawing_process.draw_case(file, picture)

    return drawing_process.drawn_on_rank0(problem.comm, draw)


def arrays_of(
    title: str, meant: Understood, section: Section, revolved: bool
) -> dict[str, npt.NDArray[Any]]:
    """Return the data for the picture.

    Args:
        title: Title of the case.
        meant: The description of the case.
        section: The plane bodies.
        revolved: Whether the plane bodies are the half sections of bodies of revolution.
    """
    sides, facets = meant.sides, meant.sides.facets
    mark, rest = np.full(len(facets.area), -1), np.zeros(len(facets.area), dtype=np.bool_)
    labels, roles, places, forces, of_force = [], [], [], [], []
    numbers = {name: number for number, name in enumerate(meant.marked)}
    for name in sorted(numbers, key=sides.area, reverse=True):
        # smaller surfaces are marked later, so that they remain visible inside larger ones
        mark[sides.on(name)] = numbers[name]
    for number, (name, marked) in enumerate(meant.marked.items()):
        own = sides.on(name)
        if marked.part:
            rest |= sides.rest(name)
        part = f"  -  only a part: {marked.part}" if marked.part else ""
        labels.append(f"'{name}': {', '.join(dict.fromkeys(marked.words))}{part}")
        roles.append(marked.roles[0])
        weights = facets.area[own]
        if weights.sum() > 0:
            middle = weights @ facets.x[own].mean(axis=1) / weights.sum()
            places += [middle] * len(marked.force)
            forces += marked.force
            of_force += [number] * len(marked.force)
    gdim = facets.x.shape[2]
    return dict(
        title=np.array(title),
        x=_turned_outward(facets),
        body=facets.body,
        mark=mark,
        rest=rest & (mark < 0),
        labels=np.array(labels, dtype=np.str_),
        roles=np.array(roles, dtype=np.str_),
        places=np.array(places).reshape(-1, gdim),
        forces=np.array(forces).reshape(-1, gdim),
        of_force=np.array(of_force, dtype=np.int64),
        cells=section.cells,
        bodies=section.bodies,
        names=np.array(section.names, dtype=np.str_),
        water=section.water,
        revolved=np.array(revolved),
    )


def _turned_outward(facets: OuterFacets) -> Floats:
    """Return the vertices of facets, ordered such that normals of triangles point outwards.

    The picture draws an edge as sharp if the normals on its two sides differ.
    """
    x = facets.x
    if x.shape[2] == 2:
        return x
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    inward = np.einsum("ni,ni->n", normal, facets.normal) < 0
    return np.where(inward[:, None, None], x[:, ::-1], x)
