"""Manage a result folder, and write ``summary.json`` and ``path.csv`` after each level.

An error on one rank is raised on every rank. A file is always replaced as a whole, so a reader
never finds a partial file, even after a crash or on a full disk.
"""

import dataclasses
import errno
import os
import resource
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.contact.declared.obstacles import OBSTACLES
from perfplast_fenicsx.errors import on_all_ranks, raise_together
from perfplast_fenicsx.formulas import WordedFormula
from perfplast_fenicsx.io.results.result_files import (
    BEFORE,
    DIRECTIONS,
    EARLIER,
    EXPORTED,
    FALLS,
    FIELDS,
    FLOW,
    KNOWN,
    LEAST,
    MECHANISM,
    MECHANISM_POINTS,
    NAMED,
    NEWEST,
    POINT_SERIES,
    PROOF,
    SERIES,
    STANDS,
    figures,
)
from perfplast_fenicsx.io.results.summary import Summary, limit_rows, to_json
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.limit_forces import limit_forces
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.materials.laws import MATERIALS
from perfplast_fenicsx.mesh.tagged_mesh import element_size
from perfplast_fenicsx.problem.declared.given import Given
from perfplast_fenicsx.problem.declared.initial import Bolt, InitialStress, Temperature
from perfplast_fenicsx.problem.declared.loads import LOADS
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.judged.report import LevelReport
from perfplast_fenicsx.problem.judged.resultants import load_resultants
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import ROUNDING
from perfplast_fenicsx.spatial_fields import SpatialField
from perfplast_fenicsx.tables import csv_table
from perfplast_fenicsx.units import Units

KINDS: tuple[Mapping[str, type[Any]], ...] = (
    MATERIALS,
    LOADS,
    OBSTACLES,
    {"temperature": Temperature, "initial_stress": InitialStress, "bolt": Bolt},
)
"""Classes of materials, loads, obstacles and initial strains, by their names in case files."""


def given_table(given: Given) -> dict[str, Any]:
    """Return the data of a problem in a form that JSON can store.

    Returns:
        A table whose keys are the fields of
        :class:`~perfplast_fenicsx.problem.declared.given.Given`. A dataclass becomes a table of its
        fields, with an additional key ``kind``: its name in case files, or the name of its class. A
        field with a formula that the program has written has a second key, such as
        ``value_in_words``.
    """
    return {field.name: _told(getattr(given, field.name)) for field in dataclasses.fields(given)}


def _told(value: Any) -> Any:
    if isinstance(value, SpatialField):
        return f"{value}"
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [field.name for field in dataclasses.fields(value)]
        fields = {name: _told(getattr(value, name)) for name in names}
        for name in names:
            if isinstance(formula := getattr(value, name), WordedFormula):
                fields[f"{name}_in_words"] = formula.words
        known = (name for kinds in KINDS for name, kind in kinds.items() if kind is type(value))
        return {"kind": next(known, type(value).__name__)} | fields
    if isinstance(value, Mapping):
        return {str(key): _told(entry) for key, entry in value.items()}
    if isinstance(value, str | bool | int | float) or value is None:
        return value
    if isinstance(value, Sequence):
        return [_told(entry) for entry in value]
    return _told(value.tolist()) if hasattr(value, "tolist") else repr(value)


DATA = ("summary.json", "path.csv", "run.log", "scene.json", SERIES)
"""Result files that are listed before the pictures from :func:`result_files.figures`."""

BESIDE = (
    *("loading.gif", MECHANISM, PROOF, LEAST, POINT_SERIES, MECHANISM_POINTS, STANDS, FALLS, KNOWN),
    "report.html",
    *(FLOW, NEWEST, BEFORE, *EARLIER),
)
"""Result files that are listed after the pictures."""


def result_files() -> tuple[str, ...]:
    """Return the names of all result files; with ``--force`` a run removes these files."""
    pictures = tuple(figure.file for figure in figures())
    return *DATA, *pictures, *BESIDE


STEP_KEYS = (
    *("zeta", "alpha", "converged", "reason"),
    *("newton_iterations", "active_set_iterations", "linear_iterations", "damping_min"),
    *("plastic_fraction", "plastic_cells", "active_contacts", "contact_pairs"),
    *("max_penetration", "duality_gap", "max_displacement", "seconds", "reactions", "balance"),
    *("driving_force", "stage", "factors", "works", "driving_forces", "bolts"),
    *("slipping", "friction_dissipation", "friction_excess", "rounds"),
    *("contact_programs", "snes_vi_programs", "snes_vi_iterations"),
)
"""Keys of a level in ``summary.json``, on which other tools rely; ``path.csv`` has all values."""


class ResultFolder:
    """A folder for the results of one run. Existing results are replaced only on request."""

    def __init__(
        self,
        comm: MPI.Intracomm,
        path: str | Path,
        force: bool = False,
        restart: bool = False,
    ) -> None:
        """Check that the folder can be used; do not write or remove files. Collective.

        Args:
            comm: The ranks of the run.
            path: The folder. :meth:`create` makes it, with its parents, if it does not exist.
            force: Whether to replace existing results.
            restart: Whether to continue from existing results.

        Raises:
            InputError: If ``path`` is not a folder or cannot be written, if it has results but
                neither ``force`` nor ``restart`` is set, or if a restart finds no checkpoint.
        """
        self.comm, self.path = comm, Path(path)
        # this call raises errors of entry points on all ranks; only rank 0 makes the other checks
        on_all_ranks(comm, figures)
        raise_together(comm, self._obstacle(force, restart) if comm.rank == 0 else None)

    def file(self, name: str) -> Path:
        """Return the path of a result file."""
        return self.path / name

    def found(self) -> list[str]:
        """Return the names of the result files that exist."""
        return [name for name in result_files() if self.file(name).exists()]

    def create(self) -> None:
        """Create the folder and remove older results from it. Collective.

        Raises:
            InputError: On every rank, if the folder cannot be written.
        """

        def create() -> None:
            self.path.mkdir(parents=True, exist_ok=True)
            for name in result_files():
                self.file(name).unlink(missing_ok=True)
            fields = self.file(FIELDS)
            rests = (fields.glob(f"*{end}*") for end in (".vtkhdf", ".h5"))
            proofs = self.path.glob(f"{DIRECTIONS}_*.h5")
            exported = self.file(EXPORTED)
            files = (exported.glob(f"*{end}") for end in (".vtu", ".pvd", ".csv"))
            for rest in chain(self.path.glob("*.part"), proofs, *rests, *files):
                rest.unlink()
            for folder in (fields, exported):
                if folder.is_dir() and not any(folder.iterdir()):
                    folder.rmdir()
            self.file("path.csv").touch()

        self.on_root(create)

    def on_root(self, action: Callable[[], None]) -> None:
        """Call, on rank 0 only, a function that writes files. Collective.

        Raises:
            InputError: On every rank, if the write fails.
        """
        self.on_each(action if self.comm.rank == 0 else lambda: None)

    def on_each(self, action: Callable[[], None]) -> None:
        """Call, on every rank, a function that writes files. Collective, but ``action`` is not.

        Raises:
            InputError: On every rank, if the write fails on any rank.
        """
        fault = None
        # error numbers of a full disk, a quota or a file size limit
        full = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
        try:
            action()
        except OSError as error:
            fault = self._unwritable(error.strerror or str(error))
            if error.errno in full:
                fault = (
                    f"the output folder '{self.path}' cannot be written ({error.strerror}); free "
                    "some space, then continue with --restart. Earlier files are complete."
                )
        raise_together(self.comm, fault)

    def _obstacle(self, force: bool, restart: bool) -> str | None:
        there = self.path
        try:
            while not there.exists() and there != there.parent:
                there = there.parent
            if not there.is_dir():
                return self._unwritable(f"'{there}' is not a folder")
            if not os.access(there, os.W_OK | os.X_OK):
                return self._unwritable(f"no permission to write in '{there}'")
            found, links = self.found(), self._links()
        except OSError as error:
            return self._unwritable(error.strerror or str(error))
        if links:
            return (
                f"'{links[0].name}' in '{links[0].parent}' is a link, so results would be written "
                "elsewhere; remove the link."
            )
        if restart and not self.path.exists():
            return (
                f"the folder '{self.path}' does not exist; give the folder of the run to continue."
            )
        if restart and not {NEWEST, BEFORE} & set(found):
            return (
                f"the folder '{self.path}' has no {NEWEST} to continue from; start again "
                f"with -o {self.path}."
            )
        if found and not (force or restart):
            return (
                f"the output folder '{self.path}' already has results "
                f"({', '.join(found)}); give another folder, --force to replace them, or "
                "--restart to continue from them."
            )
        return None

    def _links(self) -> list[Path]:
        """Return symbolic links at paths to which a run writes; the folder itself may be a link."""
        ours = [self.file(name) for name in (*result_files(), FIELDS)]
        fields = self.file(FIELDS)
        inside = [*fields.glob("*.vtkhdf"), *fields.glob("*.h5")]
        return [path for path in (*ours, *inside) if path.is_symlink()]

    def _unwritable(self, reason: str) -> str:
        return f"the output folder '{self.path}' cannot be written ({reason}); give another folder."


class Results:
    """The data of ``summary.json`` and ``path.csv``, which are written after each level."""

    def __init__(
        self,
        folder: ResultFolder,
        problem: Problem,
        title: str,
        version: str,
        method: str,
        prescribed: Prescribed,
        reports: Sequence[LevelReport] = (),
    ) -> None:
        """Write a summary, which contains the levels of an earlier run, if any. Collective."""
        mesh, kinematics = problem.tagged_mesh.mesh, problem.kinematics
        self.folder = folder
        self.summary = Summary(
            title=title,
            version=version,
            method=method,
            prescribed=prescribed.value,
            ranks=folder.comm.size,
            mesh={
                "cells": mesh.topology.index_map(mesh.topology.dim).size_global,
                "vertices": mesh.topology.index_map(0).size_global,
                "dofs": problem.num_dofs,
            },
            model={"kind": kinematics.name, "axes": kinematics.axes, "forces": kinematics.forces},
            given=given_table(dataclasses.replace(problem.given, loads=problem.stated_loads)),
            element_size=element_size(problem.tagged_mesh),
        )
        self.reports: list[LevelReport] = []
        for report in reports:
            self._append(report)
        self.write()

    def add(self, report: LevelReport) -> None:
        """Append a level to ``path.csv`` and ``summary.json``. Collective."""
        self._append(report)
        self.write()

    def _append(self, report: LevelReport) -> None:
        self.reports.append(report)
        table = dataclasses.asdict(report)
        self.summary.steps.append({key: table[key] for key in STEP_KEYS})

    def _path(self) -> bytes:
        """Return the content of ``path.csv``."""
        axes = self.summary.model["axes"]
        rows = [_row(step, report, axes) for step, report in enumerate(self.reports, start=1)]
        if not rows and self.summary.limit is not None:
            rows = limit_rows(self.summary)
        return csv_table(rows)

    @contextmanager
    def timed(self, activity: str) -> Iterator[None]:
        """Add the wall time of a ``with`` block to ``timings``."""
        began = time.perf_counter()
        yield
        timings = self.summary.timings
        timings[activity] = timings.get(activity, 0.0) + time.perf_counter() - began

    def write(self) -> None:
        """Replace ``path.csv`` and ``summary.json``. Collective."""
        self.summary.peak_memory_mb = self.folder.comm.allreduce(peak_memory())

        def write() -> None:
            replace(self.folder.file("path.csv"), self._path())
            text = to_json(dataclasses.asdict(self.summary))
            replace(self.folder.file("summary.json"), text.encode())

        self.folder.on_root(write)


def _row(step: int, report: LevelReport, axes: str) -> dict[str, Any]:
    """Return a row of ``path.csv``, with a column for each reaction component and named value."""
    row = {"step": step} | dataclasses.asdict(report)
    for key in NAMED:
        row |= {f"{key} {name}".replace(" ", "_"): a for name, a in row.pop(f"{key}s").items()}
    for name, force in row.pop("reactions").items():
        row |= {f"{name} {axis}".replace(" ", "_"): f for axis, f in zip(axes, force, strict=False)}
    if str(row["stage"]).startswith(
        ("=", "+", "-", "@")
    ):  # spreadsheets would read such a text as a formula
        row["stage"] = f"'{row['stage']}"
    return row


def peak_memory() -> float:
    """Return the peak resident size of this process (MiB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


class ResultantTables:
    """Makes tables of forces and moments of loads and supports."""

    def __init__(self, units: Units, whole: bool) -> None:
        """Store the units.

        Args:
            units: Units of the case. Without a system of units, the unit of moments is force ×
                length.
            whole: See :meth:`units.Units.table`.
        """
        self._scale = units.moment_scale(whole)

    def loads(self, problem: Problem) -> list[dict[str, Any]]:
        """Return for each load a table of its force and moment at ζ = 1. Collective."""
        found, rounding = load_resultants(problem), self._rounding(problem)
        return [
            asdict(load) | {"moment": self._told(load.moment, rounding * _largest([load.force]))}
            for load in found
        ]

    def at_limit(
        self, problem: Problem, limit: LimitLoad, body: BodyBounds | None
    ) -> dict[str, Any] | None:
        """Return the forces and moments of loads and supports at the limit. Collective."""
        found = limit_forces(problem, limit, body)
        if found is None:
            return None
        least = self._rounding(problem) * _largest(found.reactions.values())
        moments = {name: self._told(moment, least) for name, moment in found.moments.items()}
        return asdict(found) | {"moments": moments}

    def _rounding(self, problem: Problem) -> float:
        """Return the moment per unit force up to which moments count as zero. Collective."""
        mine = float(np.abs(problem.tagged_mesh.mesh.geometry.x).max(initial=0.0))
        return ROUNDING * problem.comm.allreduce(mine, MPI.MAX)

    def _told(self, moment: Sequence[float], least: float) -> list[float]:
        return [self._scale * number if abs(number) > least else 0.0 for number in moment]


def _largest(forces: Iterable[Sequence[float]]) -> float:
    return max((abs(number) for force in forces for number in force), default=0.0)
