"""Define shared parts of verification cases: table rows, limit loads, pictures, command line."""

import argparse
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from pathlib import Path

from mpi4py import MPI

from perfplast_fenicsx import (
    BodyBounds,
    InputError,
    Level,
    LimitLoad,
    Problem,
    TaggedMesh,
    limit_bounds,
    limit_load,
    raise_together,
    read_gmsh,
)
from perfplast_fenicsx.cli import Terminal
from perfplast_fenicsx.io import ResultFolder, ResultWriter, Scene
from perfplast_fenicsx.pictures import draw
from perfplast_fenicsx.problem import Prescribed

MOST_FACTORISATIONS, MOST_SOLVES = 35, 80
"""Largest numbers of factorisations and solves in the interior point method."""


@dataclass(frozen=True)
class Row:
    """A computed number and its exact value.

    Attributes:
        case: Name of the case.
        quantity: Name of the computed quantity.
        element: Name of the element, such as "P2", or "P2, curved" on second-order geometry.
        size: Edge length of the mesh, from which rates of convergence follow.
        dofs: Displacement unknowns.
        computed: The computed number.
        exact: Exact value; 0 for differences that should vanish.
        allowed: Largest relative error (absolute if ``exact`` is 0); None if it is not checked.
        solves: Number of linear systems solved.
        seconds: Wall time (s).
        bound: Whether ``exact`` is an upper bound.
        factorisations: Number of factorisations of the interior point method, if it was used.
        bracket: Strict bounds for the body, in words.
    """

    case: str
    quantity: str
    element: str
    size: float
    dofs: int
    computed: float
    exact: float
    allowed: float | None
    solves: int
    seconds: float
    bound: bool = False
    factorisations: int | None = None
    bracket: str = ""

    @property
    def error(self) -> float:
        """Return the signed relative error; absolute if the exact value is 0."""
        return (self.computed - self.exact) / (abs(self.exact) or 1.0)

    @property
    def right(self) -> bool:
        """Return whether the error and the interior point method's cost are within limits."""
        if self.factorisations is not None and (
            self.factorisations > MOST_FACTORISATIONS or self.solves > MOST_SOLVES
        ):
            return False
        if self.allowed is None:
            return True
        error = self.error if self.bound else abs(self.error)
        return error <= self.allowed  # False for nan


Study = Callable[[MPI.Intracomm, ResultFolder, bool], list[Row]]
"""Function of communicator, folder and a flag for coarse meshes that solves and draws a case."""


def mesh(folder: ResultFolder, write: Callable[..., None], **arguments: object) -> TaggedMesh:
    """Write a mesh with a function of ``meshes/``, and read the mesh on all ranks. Collective."""
    path, fault = folder.file(f"{write.__name__.removeprefix('write_')}.msh"), None
    if folder.comm.rank == 0:
        try:
            write(path, **arguments)
        except (InputError, OSError) as error:
            fault = f"the mesh '{path}' cannot be made: {error}"
    raise_together(folder.comm, fault)
    return read_gmsh(folder.comm, path)


@dataclass(frozen=True)
class Collapse:
    """A limit load and its cost.

    Attributes:
        problem: The problem.
        limit: Bounds, mechanism and levels.
        bracket: Strict bounds for the body.
        seconds: Wall time (s) of the limit load alone.
    """

    problem: Problem
    limit: LimitLoad
    bracket: str
    seconds: float

    @property
    def solves(self) -> int:
        """Return the number of linear systems solved."""
        return self.limit.linear_solves

    def row(
        self, case: str, size: float, exact: float, allowed: float | None, bound: bool = False
    ) -> Row:
        """Return the limit load as a :class:`Row`."""
        return Row(
            case=case,
            quantity="limit load",
            element=f"P{self.problem.degree}",
            size=size,
            dofs=self.problem.num_dofs,
            computed=self.zeta,
            exact=exact,
            allowed=allowed,
            solves=self.solves,
            seconds=self.seconds,
            bound=bound,
            factorisations=self.limit.factorisations,
            bracket=self.bracket,
        )

    @property
    def zeta(self) -> float:
        """Return the estimate of the limit load, or the largest ζ if ζ does not level off.

        It is infinite if no upper bound was found, for example with elements that lock.
        """
        if not self.limit.collapses:
            return math.inf
        return self.limit.lower if self.limit.estimate is None else self.limit.estimate

    def write(self, folder: ResultFolder, scene: Scene) -> None:
        """Write the path, the fields of its end, limit load and mechanism. Collective."""
        writer = ResultWriter(
            folder, self.problem, scene, str(self.limit.method), prescribed=Prescribed.WORK
        )
        drawn = next((lv for lv in reversed(self.limit.levels) if lv.report.converged), None)
        for level in self.limit.levels:
            writer.write(level, fields=level is drawn)
        writer.write_limit(self.limit)


def collapse(problem: Problem, rtol: float = 1e-4, method: str = "interior-point") -> Collapse:
    """Return the limit load of a problem, with strict bounds for the body. Collective."""
    began = time.perf_counter()
    limit = limit_load(problem, rtol, method=method)
    seconds = time.perf_counter() - began
    bracket = ""
    if problem.degree == 2 and limit.factorisations is not None:
        if problem.tagged_mesh.axisymmetric and any(on.law.dilates for on in problem.laws):
            bracket = "none: axisymmetric"
        else:
            bracket = in_brackets(limit_bounds(problem, rtol))
    return Collapse(problem, limit, bracket, seconds)


def in_brackets(bounds: BodyBounds) -> str:
    """Return the strict bounds for the body as text, or the reason why no bounds exist."""
    lower, upper = bounds.lower, bounds.upper
    if bounds.strict:
        return f"{lower.shown} ... {upper.shown}"
    if upper.strict:
        return f"<= {upper.shown}"
    return f">= {lower.shown}" if lower.strict else f"none: {', '.join(upper.why_not)}"


def show(folder: ResultFolder, problem: Problem, scene: Scene, levels: Sequence[Level]) -> None:
    """Write load levels with their fields, and draw them. Collective."""
    writer = ResultWriter(folder, problem, scene, "newton", prescribed=Prescribed.LOAD_FACTOR)
    for level in levels:
        writer.write(level)
    draw(folder)


def on_rank_0(comm: MPI.Intracomm, save: Callable[[], None]) -> None:
    """Write a picture on one rank, or fail together. Collective."""
    fault = None
    if comm.rank == 0:
        try:
            save()
        except OSError as error:
            fault = f"the picture cannot be written: {error}"
    raise_together(comm, fault)


HEADING = (
    f"{'case':<26} {'quantity':<26} {'element':<12} {'dofs':>8} {'computed':>13} {'exact':>13}"
    f" {'error':>10} {'allowed':>8} {'solves':>6} {'factors':>7} {'time/s':>7}"
    f" {'bracket of the body'}"
)


def line(row: Row) -> str:
    """Return a row as a line of the printed table."""
    allowed = "" if row.allowed is None else f"{row.allowed:.2g}"
    exact = f"{'<= ' if row.bound else ''}{row.exact:.7g}"
    factors = "" if row.factorisations is None else row.factorisations
    return (
        f"{row.case:<26} {row.quantity:<26} {row.element:<12} {row.dofs:>8} {row.computed:>13.7g}"
        f" {exact:>13} {row.error:>+10.2e} {allowed:>8} {row.solves:>6} {factors:>7}"
        f" {row.seconds:>7.1f} {row.bracket}{'' if row.right else '   WRONG'}"
    )


def rates(rows: Sequence[Row]) -> list[str]:
    """Return a line with the orders of convergence for each sequence of meshes."""
    lines = []
    values = [row for row in rows if not row.bound]
    for names, group in groupby(values, key=lambda row: (row.case, row.quantity, row.element)):
        found = orders(list(group))
        if found:
            shown = ", ".join(f"{order:.2f}" for order in found)
            lines.append(f"order of convergence in h, {', '.join(names)}: {shown}")
    return lines


def orders(rows: Sequence[Row]) -> list[float]:
    """Return the orders of convergence from mesh to mesh, except for rounding errors."""
    found = []
    for coarse, fine in pairwise(rows):
        if min(abs(coarse.error), abs(fine.error)) > 1e-5 and coarse.size > fine.size:
            found.append(
                math.log(abs(coarse.error / fine.error)) / math.log(coarse.size / fine.size)
            )
    return found


def costs(rows: Sequence[Row]) -> list[str]:
    """Return a line with the cost of interior point limit loads for each case."""
    lines = []
    found = [row for row in rows if row.factorisations is not None]
    for case in dict.fromkeys(row.case for row in found):
        own = [row for row in found if row.case == case]
        factors = _span([row.factorisations or 0 for row in own])
        solves = _span([row.solves for row in own])
        lines.append(f"limit loads, {case}: {factors} factorisations, {solves} linear solves")
    return lines


def _span(counts: Sequence[int]) -> str:
    low, high = min(counts), max(counts)
    return f"{low}" if low == high else f"{low} to {high}"


def run(title: str, study: Study, argv: Sequence[str] | None = None) -> None:
    """Run a case from the command line: solve, print the table and check it. Collective.

    Raises:
        SystemExit: If a number is wrong; raised on every rank.
    """
    parser = argparse.ArgumentParser(description=title)
    name = title.lower().replace(",", "").replace(" ", "_")
    parser.add_argument("-o", "--output", default=f"results/{name}", help="replaced if there")
    parser.add_argument("--coarse", action="store_true", help="coarse meshes, for a quick look")
    arguments = parser.parse_args(argv)
    comm = MPI.COMM_WORLD
    terminal = Terminal(comm)
    terminal.say(f"{title}\n\n{HEADING}")
    rows = solve(comm, study, Path(arguments.output), arguments.coarse, terminal)
    for text in rates(rows):
        terminal.say(text)
    terminal.say(f"\nPictures are in {arguments.output}.")
    if not all(row.right for row in rows):
        raise SystemExit(1)


def solve(
    comm: MPI.Intracomm, study: Study, path: Path, coarse: bool, terminal: Terminal
) -> list[Row]:
    """Solve a study, print its rows and return them. Collective."""
    folder = ResultFolder(comm, path, force=True)
    folder.create()
    rows = study(comm, folder, coarse)
    for row in rows:
        terminal.say(line(row))
    return rows
