"""Write the results of a run: the scene, the levels and the limit load."""

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from perfplast_fenicsx._version import __version__
from perfplast_fenicsx.io.case.scene import Scene, write_scene
from perfplast_fenicsx.io.results.checkpoints import Saved
from perfplast_fenicsx.io.results.claims import direction_file
from perfplast_fenicsx.io.results.field_series import FieldSeries, write_flow
from perfplast_fenicsx.io.results.output_fields import OutputFields, bound_fields, dissipation
from perfplast_fenicsx.io.results.proof_file import judge
from perfplast_fenicsx.io.results.result_files import FALLS, FLOW, LEAST, PROOF, STANDS
from perfplast_fenicsx.io.results.result_folder import ResultantTables, ResultFolder, Results
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import AdaptiveBounds
from perfplast_fenicsx.limit_analysis.body.body_bounds import (
    BodyBounds,
    LeastLoad,
    standing_in_words,
)
from perfplast_fenicsx.limit_analysis.body.interaction import Angles, Envelope
from perfplast_fenicsx.limit_analysis.body.safety_factor import FactorOfSafety
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.shakedown.shakedown_load import Direction, ShakedownLoad
from perfplast_fenicsx.limit_analysis.statements.load_factor import (
    Bound,
    DesignFactor,
    Question,
    Scope,
)
from perfplast_fenicsx.outcome_words import MeshEstimate, PathBracket
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.judged.state import Level
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.seepage.flow import flow_of

LIMIT_KEYS = (
    *("method", "lower", "estimate", "upper", "alpha", "levelled_off", "reason"),
    *("iterations", "linear_solves", "factorisations", "theorem"),
)
"""Keys of ``limit`` in ``summary.json`` that are attributes of the limit load of the mesh."""


class ResultWriter:
    """Writes ``scene.json``, then ``summary.json``, ``path.csv`` and fields level by level.

    Attributes:
        results: Summary and path.
    """

    def __init__(
        self,
        folder: ResultFolder,
        problem: Problem,
        scene: Scene,
        method: str,
        *,
        prescribed: Prescribed,
        fields: bool = True,
        points: bool = False,
        saved: Saved | None = None,
    ) -> None:
        """Write the files that exist before the first level. Collective.

        Args:
            folder: Result folder, which must exist.
            problem: The problem that is solved.
            scene: Data for pictures.
            method: Name of the solution method.
            prescribed: Prescribed quantity of the loading, which is the time of the fields.
            fields: Whether to write fields.
            points: Whether to write fields at the quadrature points too.
            saved: State of the earlier run that this run continues; None for a new run.

        Raises:
            InputError: On every rank, if files cannot be written.
        """
        self._problem = problem
        saved = saved or Saved()
        scene_file = folder.file("scene.json")
        folder.on_root(lambda: write_scene(scene, problem.tagged_mesh, scene_file))
        self.results = Results(
            folder, problem, scene.title, __version__, method, prescribed, saved.reports
        )
        self.results.summary.units = scene.units.table(problem.kinematics.whole)
        self._resultants = ResultantTables(scene.units, problem.kinematics.whole)
        self.results.summary.loads = self._resultants.loads(problem)
        if (flow := flow_of(problem.given.loads)) is not None:
            self.results.summary.seepage = flow.table()
            flow_file = folder.file(FLOW)
            folder.on_root(lambda: write_flow(flow, flow_file))
        self._output = OutputFields(problem) if fields else None
        self._fields, self._points = None, points
        self._judged: BodyBounds | None = None
        self._judged_safety: FactorOfSafety | None = None
        if fields:
            self._fields = FieldSeries(folder, problem, prescribed, saved.reports, points)

    def __repr__(self) -> str:
        return (
            f"ResultWriter({str(self.results.folder.path)!r}; {len(self.results.reports)} levels)"
        )

    def write(self, level: Level, fields: bool = True) -> None:
        """Write a level; a level without a solution has no fields. Collective.

        Args:
            level: The next level.
            fields: Whether to write the fields of the level.

        Raises:
            InputError: On every rank, if files cannot be written; earlier files remain complete.
        """
        with self.results.timed("output"):
            solved = fields and level.report.converged
            if solved and self._output is not None and self._fields is not None:
                number = len(self.results.reports) + 1
                found = self._output.update(level)
                self._fields.write(number, found, level.report, self._output.at_points)
            self.results.add(level.report)

    def write_limit(
        self,
        limit: LimitLoad,
        body: BodyBounds | None = None,
        adaptive: AdaptiveBounds | None = None,
        steps: Sequence[str] = (),
        design: DesignFactor | None = None,
        answer: str = "",
        fields: bool = True,
        proven: bool = True,
    ) -> None:
        """Write a limit load with its collapse mechanism. Collective.

        Args:
            limit: The limit load of the mesh.
            body: Proven bounds of the body.
            adaptive: The bounds from a sequence of meshes; None for one mesh.
            steps: Next steps for the user, each a sentence without a full stop.
            design: Comparison of the limit load with the design load.
            answer: Meaning of the bounds in words, if the bounded quantity is not a load factor.
            fields: Whether to write the mechanism. If its mesh differs from the mesh of the levels,
                the fields of the levels are removed.
            proven: Whether to write the proofs of the bounds.

        Raises:
            InputError: On every rank, if files cannot be written; earlier files remain complete.
        """
        if body is not None and proven:
            body, adaptive = self.judged(body, adaptive)
        with self.results.timed("output"):
            shown = fields and limit.collapses
            if self._fields is not None and self._output is not None and shown:
                problem = body.problem if body else self._problem
                if problem is not self._problem:  # true if the mesh was split or refined
                    folder, prescribed = self.results.folder, Prescribed.WORK
                    self._fields = FieldSeries(folder, problem, prescribed, points=self._points)
                    self._output = OutputFields(problem)
                found = {"mechanism": limit.mechanism}
                if body is None or body.joints is None:
                    found["dissipation"] = dissipation(problem, limit.mechanism)
                at_points = None
                if limit.stress is not None and limit.contact_forces is not None:
                    found |= self._output.of_stress(limit.stress, limit.contact_forces)
                    at_points = self._output.at_points
                if body is not None:
                    found |= bound_fields(body)
                alpha = 0.0 if limit.alpha is None else limit.alpha
                zeta = limit.lower if math.isfinite(limit.lower) else 0.0
                self._fields.write_mechanism(found, zeta, alpha, at_points)
            table = {key: getattr(limit, key) for key in LIMIT_KEYS}
            table |= {"drucker": limit.drucker and limit.drucker.table()}
            table |= {"body": body and _table(body, adaptive)}
            table["verdict"] = verdict_of(limit, body)
            table["standing"] = standing_in_words(limit, body)
            found_on = body.problem if body else self._problem
            best = adaptive.low if adaptive else body
            table["forces"] = self._resultants.at_limit(found_on, limit, best if proven else None)
            table["design"] = design and asdict(design) | {"in_words": design.in_words()}
            table["answer"] = answer
            self.results.summary.limit = table | {"next_steps": list(steps)}
            self.results.write()

    def judged(
        self, body: BodyBounds, adaptive: AdaptiveBounds | None = None
    ) -> tuple[BodyBounds, AdaptiveBounds | None]:
        """Write the proofs of bounds; only bounds that the checker proves remain strict.

        Collective.

        Args:
            body: The bounds.
            adaptive: The bounds from a sequence of meshes; None for one mesh.

        Returns:
            ``body`` and ``adaptive``, in which bounds that the checker refuses are only estimates
            of the mesh.

        Raises:
            InputError: On every rank, if files cannot be written.
        """
        if body is self._judged:
            return body, adaptive
        with self.results.timed("output"):
            folder = self.results.folder
            low, high = (adaptive.low, adaptive.high) if adaptive else (body, body)
            low, high = judge(folder, folder.file(PROOF), low, high)
            least = body.least
            if least is not None:
                least = LeastLoad(*judge(folder, folder.file(LEAST), least.low, least.high))
        if adaptive is not None:
            adaptive = replace(adaptive, low=low, high=high)
        body = replace(body, lower=low.lower, upper=high.upper, least=least)
        self._judged = body
        return body, adaptive

    def judged_safety(self, found: FactorOfSafety) -> FactorOfSafety:
        """Write the proofs of a factor of safety, and remove unproven bounds. Collective.

        The two bounds have separate files, because their strengths differ.

        Raises:
            InputError: On every rank, if files cannot be written.
        """
        if found is self._judged_safety:
            return found
        with self.results.timed("output"):
            folder = self.results.folder
            if found.stands is not None:
                stands = _alone(found.stands, "lower")
                low, _ = judge(folder, folder.file(STANDS), stands, stands, found.lower)
                if not _as_before(low.lower, stands.lower) or (low.lower.value or 0.0) < 1.0:
                    found = replace(found, lower=None, stands=None)
            if found.falls is not None:
                falls = _alone(found.falls, "upper")
                _, high = judge(folder, folder.file(FALLS), falls, falls, found.upper)
                if not _as_before(high.upper, falls.upper) or (high.upper.value or 0.0) > 1.0:
                    found = replace(found, upper=None, falls=None)
        self._judged_safety = found
        return found

    def write_safety(self, found: FactorOfSafety) -> None:
        """Write a factor of safety with a collapse mechanism. Collective.

        Raises:
            InputError: On every rank, if files cannot be written; earlier files remain complete.
        """
        shown = found.falls or found.last
        self.write_limit(shown.mesh, shown, proven=False)
        with self.results.timed("output"):
            limit = self.results.summary.limit or {}
            both = found.lower is not None and found.upper is not None
            told = {"strength": found.table(), "verdict": found.in_words(), "levelled_off": both}
            self.results.summary.limit = limit | told
            self.results.write()

    def judged_direction(
        self, angles: Angles, low: BodyBounds, high: BodyBounds
    ) -> tuple[BodyBounds, BodyBounds]:
        """Write the proofs of the bounds in one direction of an envelope. Collective.

        Returns:
            ``low`` and ``high``, in which bounds that the checker refuses are only estimates of the
            mesh.

        Raises:
            InputError: On every rank, if files cannot be written.
        """
        with self.results.timed("output"):
            folder = self.results.folder
            return judge(folder, folder.file(direction_file(angles)), low, high)

    def write_envelope(self, found: Envelope, names: Sequence[str]) -> None:
        """Write an envelope of load multiples, and the mechanism of its last direction. Collective.

        Raises:
            InputError: On every rank, if files cannot be written; earlier files remain complete.
        """
        self.write_limit(found.last.mesh, found.last, proven=False)
        table = {
            "names": names,
            "carried": found.carried.tolist(),
            "sides": found.sides.tolist(),
            "directions": found.directions,
            "gap": found.gap if math.isfinite(found.gap) else None,
            "rows": found.rows(),
            "in_words": found.in_words(),
        }
        with self.results.timed("output"):
            limit = self.results.summary.limit or {}
            told = {"envelope": table, "verdict": found.in_words()}
            self.results.summary.limit = limit | told | {"body": None, "design": None}
            self.results.write()

    def write_shakedown(self, found: ShakedownLoad, diagram: Sequence[Direction]) -> None:
        """Write a shakedown load with its mechanism and residual stress. Collective.

        Raises:
            InputError: On every rank, if files cannot be written; earlier files remain complete.
        """
        limit = found.as_limit()
        with self.results.timed("output"):
            if self._fields is not None and found.converged and found.load is not None:
                output = OutputFields(found.problem)
                fields = output.of_stress(found.residual, np.zeros(0))
                fields |= {"mechanism": found.mechanism, "dissipation": found.of_cells()}
                self._fields.write_mechanism(fields, found.load, 0.0)
            table = {key: getattr(limit, key) for key in LIMIT_KEYS}
            shakedown = found.table() | {"diagram": [asdict(one) for one in diagram]}
            table |= {"shakedown": shakedown, "verdict": found.in_words(), "body": None}
            table |= {"drucker": None, "standing": "", "forces": None, "design": None}
            self.results.summary.limit = table | {"next_steps": []}
            self.results.write()


def _alone(found: BodyBounds, kind: str) -> BodyBounds:
    """Return bounds in which the bound of the other kind is only an estimate of the mesh."""
    if kind == "lower":
        return replace(found, upper=replace(found.upper, of=Scope.MESH))
    return replace(found, lower=replace(found.lower, of=Scope.MESH))


def _as_before(bound: Bound, before: Bound) -> bool:
    """Return whether a bound is strict after the check, or was not strict before it."""
    return bound.strict or not before.strict


def verdict_of(limit: LimitLoad, body: BodyBounds | None = None) -> str:
    """Return the outcome in words: the proven bounds if there are any, otherwise the estimate.

    Args:
        limit: Limit load of the mesh.
        body: Proven bounds of the body.
    """
    if body is not None and (body.lower.strict or body.upper.strict):
        return body.in_words()
    if words := standing_in_words(limit, body):
        return words
    if not limit.theorem:
        return f"This path {PathBracket(limit.lower, limit.upper).in_words()}."
    estimate = MeshEstimate(limit.lower, limit.estimate, limit.upper)
    friction = " with associated friction" if body is not None and body.friction else ""
    return f"Limit load of this mesh{friction}: {estimate.in_words()}."


def _table(body: BodyBounds, adaptive: AdaptiveBounds | None) -> dict[str, Any]:
    """Return the table ``body`` of ``summary.json``, which contains only strict bounds."""
    lower, upper = body.limits
    standing = None
    if body.question is Question.STANDS:
        standing = [body.lower.strict_value, body.upper.strict_value]
    return {
        "lower": lower.strict_value,
        "upper": upper.strict_value,
        "strict": body.strict,
        "standing": standing,
        "least": body.least and {**body.least.table(), "in_words": body.least_in_words},
        "why_not": body.why_not,
        "faults": body.faults,
        "friction": body.friction,
        "taken": list(body.taken),
        "certificates": dict(body.certificates),
        "meshes": [asdict(round_) for round_ in adaptive.rounds] if adaptive else [],
    }
