"""Summarise the outcome of a run in one sentence, and state its validity."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from perfplast_fenicsx.io.results.result_files import DIRECTIONS, FALLS, STANDS
from perfplast_fenicsx.io.results.summary import Summary
from perfplast_fenicsx.outcome_words import NO_PAIR, SAID, MeshEstimate, PathBracket, factor_words
from perfplast_fenicsx.pictures.result_reader import ResultReader, StoredLimit
from perfplast_fenicsx.problem.judged.report import LevelReport
from perfplast_fenicsx.rounding import rounded_down, rounded_up

Mark = Literal["proven", "one-sided", "found", "open"]

FINER = "A finer mesh may give another limit load, usually a lower one."
"""The sentence for results that are not proven for the bodies."""


@dataclass(frozen=True)
class Verdict:
    """The outcome of a run.

    Attributes:
        mark: "proven" for the bodies, "one-sided" if only one bound is proven, "found" for a result
            on this mesh, or "open".
        sentence: The outcome.
        details: Sentences on the validity of the outcome.
    """

    mark: Mark
    sentence: str
    details: list[str]


def verdict_on(reader: ResultReader) -> Verdict:
    """Return the verdict on the stored results."""
    if reader.limit is not None:
        table = reader.summary.limit or {}
        found = _of_limit(reader.limit, table)
        if design := table.get("design"):
            decided = (design["lower"] or 0.0) >= 1 or (design["upper"] or 1.0) < 1
            words = design["in_words"].replace("zeta", "ζ")
            mark: Mark = "proven" if decided else "open"
            found = Verdict(mark, words, [found.sentence, *found.details])
        if answer := table.get("answer"):
            found = replace(found, sentence=answer, details=[found.sentence, *found.details])
        solved = [report.zeta for report in reader.reports if report.converged]
        if not solved:
            return found
        path = f"The run solved {len(solved)} levels, up to ζ = {max(solved):.6g}."
        return replace(found, details=[*found.details, path])
    return _of_levels(reader)


def _of_path(limit: StoredLimit, table: Mapping[str, Any]) -> Verdict:
    """Return the verdict on a path that loses equilibrium, for which no limit theorem holds."""
    found = PathBracket(limit.lower, limit.upper).in_words("ζ = ")
    pair = table.get("drucker")
    beside = f"In addition: {pair['words']}." if pair else NO_PAIR
    mark: Mark = "found" if table["levelled_off"] else "open"
    details = [SAID, beside, f"Reason for the end of the search: {table['reason']}.", FINER]
    return Verdict(mark, f"Loaded on this path, this mesh {found}.", details)


def _of_strength(table: Mapping[str, Any]) -> Verdict:
    """Return the verdict on a factor of safety."""
    lower, upper = table["lower"], table["upper"]
    estimate = table.get("estimate", False)
    sides = factor_words(lower, upper, estimate, many=True)
    files = [name for name, found in ((STANDS, lower), (FALLS, upper)) if found is not None]
    says = (
        "F divides yield stresses, cohesions and coefficients of friction (tan φ) by the same "
        "number, except strengths with reduced = false; the loads are constant. F is the factor of "
        "safety of the bodies."
    )
    beside = (
        [f"{path['in_words']} The curve is in strength.png."] if (path := table.get("path")) else []
    )
    if not sides:
        words = "No bound on the factor of safety is proven."
        return Verdict("open", words, [says, *beside, FINER])
    proof = " and ".join(f"python3 -m perfplast_fenicsx.proof {name}" for name in files)
    strict = "It is" if len(sides) == 1 else "Both are"
    if estimate:
        stands = (
            f"{strict} proven for the associated ground that replaces this ground, and no bound for"
            f" this ground. This command repeats the proof: {proof}."
        )
        words = f"By Davis' estimate the bodies {', and '.join(sides)}."
        return Verdict("found", words, [says, stands, *beside])
    repeat = "proves" if len(files) == 1 else "prove"
    details = [says, f"{strict} strict; {proof} {repeat} this again.", *beside]
    mark: Mark = "proven" if len(sides) == 2 else "one-sided"
    return Verdict(mark, f"The bodies {', and '.join(sides)}.", details)


def _of_envelope(table: Mapping[str, Any]) -> Verdict:
    """Return the verdict on combinations of two or three loads."""
    letters = "abc"[: len(table["names"])]
    times = [f"{a} times '{name}'" for a, name in zip(letters, table["names"], strict=True)]
    noun, degrees = ("pair", "each degree") if len(letters) == 2 else ("triple", "every 5 degrees")
    says = (
        f"A {noun} ({', '.join(letters)}) is {', '.join(times[:-1])} and {times[-1]}. The inner "
        f"region is the hull of {noun}s that strict lower bounds prove. Each side of the outer "
        "region comes from the mechanism of a strict upper bound. path.csv lists both for "
        f"{degrees}."
    )
    first = "_".join([DIRECTIONS, *["000.00"] * (len(letters) - 1)]) + ".h5"
    proof = (
        f"The proof of the bounds in each direction is in {DIRECTIONS}_ANGLE.h5. To prove them "
        f"again, run python3 -m perfplast_fenicsx.proof {first} and so on."
    )
    mark: Mark = "proven" if table["gap"] is not None else "open"
    return Verdict(mark, table["in_words"], [says, proof])


def _of_shakedown(table: Mapping[str, Any]) -> Verdict:
    """Return the verdict on loads that vary in a domain."""
    corners = "; ".join(
        ", ".join(f"{factor:g} × {name}" for name, factor in zip(table["names"], row, strict=True))
        for row in table["corners"]
    )
    where = "everywhere in each cell" if table["within_cells"] else "at the quadrature points"
    says = [
        f"The load domain is the convex hull of: {corners}. In addition, all constant loads act.",
        "By Melan's theorem the bodies respond elastically after some plastic flow if a "
        "self-equilibrated stress makes the stresses at all corners admissible. The run seeks "
        "such a stress on this mesh, with the elastic stresses of this mesh. The sum is "
        f"admissible {where}. The result is an estimate, not a bound for the bodies.",
    ]
    if table["load"] is None:
        return Verdict("open", table["in_words"], [*says, FINER])
    share = table["accumulated"]
    says.append(
        f"Koiter's value, from the plastic flow of a cycle, is {table['koiter']:.5g}. Of this flow "
        f"{share:.1%} remains at the end of the cycle: {table['failure']}."
    )
    if table["diagram"]:
        says.append(
            "path.csv and shakedown.png show the shakedown load at each ratio of both loads."
        )
    return Verdict("found", table["in_words"], [*says, FINER])


def _of_limit(limit: StoredLimit, table: Mapping[str, Any]) -> Verdict:
    if not limit.theorem:
        return _of_path(limit, table)
    if strength := table.get("strength"):
        return _of_strength(strength)
    if envelope := table.get("envelope"):
        return _of_envelope(envelope)
    if shakedown := table.get("shakedown"):
        return _of_shakedown(shakedown)
    if limit.standing:
        proven = any((table.get("body") or {}).get("standing") or ())
        ended = [f"{step[:1].upper()}{step[1:]}." for step in table.get("next_steps", [])]
        return Verdict("proven" if proven else "found", limit.standing, ended)
    lower, upper = limit.body.get("lower"), limit.body.get("upper")
    estimate = MeshEstimate(limit.lower, limit.estimate, limit.upper)
    mesh = "the last mesh" if limit.body.get("meshes") else "this mesh"
    mesh += " with associated friction" if limit.body.get("friction") else ""
    known = f"The limit load of {mesh} is {estimate.in_words('ζ = ')}."
    reasons = [f"{why[:1].upper()}{why[1:]}." for why in limit.body.get("why_not", [])]
    beside = [least["in_words"]] if (least := limit.body.get("least")) else []
    beside += [f"{words}." for words in [limit.body.get("friction")] if words]
    beside += [f"{words[:1].upper()}{words[1:]}." for words in limit.body.get("taken", [])]
    met = table["levelled_off"] and limit.upper is not None
    ended = [] if met else [f"Reason for the end of the search on {mesh}: {table['reason']}."]
    ended += [f"{step[:1].upper()}{step[1:]}." for step in table.get("next_steps", [])]
    if lower is not None and upper is not None:
        return Verdict(
            "proven",
            f"The bodies carry ζ = {rounded_down(lower)} for certain, and collapse at ζ = "
            f"{rounded_up(upper)} at the latest.",
            [
                "Both bounds are strict: they hold for the bodies that the mesh fills, not only "
                "for the mesh.",
                *beside,
                known,
                *ended,
            ],
        )
    if upper is not None:
        return Verdict(
            "one-sided",
            f"The bodies collapse at ζ = {rounded_up(upper)} at the latest.",
            [
                "This bound is strict. No lower bound is proven:",
                *reasons,
                *beside,
                known,
                *ended,
            ],
        )
    if lower is not None:
        return Verdict(
            "one-sided",
            f"The bodies carry ζ = {rounded_down(lower)} for certain.",
            [
                "This bound is strict. No upper bound is proven:",
                *reasons,
                *beside,
                known,
                *ended,
            ],
        )
    if limit.estimate is None:
        sentence = "No limit load was found"
        if limit.lower > 0:
            sentence += f"; {mesh} carries ζ = {rounded_down(limit.lower)}"
        return Verdict("open", f"{sentence}.", [*ended, FINER, *reasons])
    mark: Mark = "found" if table["levelled_off"] else "open"
    return Verdict(mark, known, [*ended, FINER, *reasons])


def _of_levels(reader: ResultReader) -> Verdict:
    reports, driven = reader.reports, reader.scene.driven
    solved = [report for report in reports if report.converged]
    if not reports:
        sentence = "No step is solved yet: the run is at its first step, or stopped there."
        if signal := reader.interrupted:
            sentence = f"No step is solved: the run was interrupted ({signal}) at its first step."
        return Verdict("open", sentence, [])
    last = reports[-1]
    details = []
    if solved:
        end = solved[-1]
        length = f"{end.max_displacement:.4g} {reader.summary.units.get('length', '')}".rstrip()
        details.append(
            f"At the last solved step {end.plastic_fraction:.1%} of the volume is plastic, "
            f"and the largest displacement is {length}."
        )
    details.append("All numbers hold for this mesh only.")
    if not last.stage and not driven:
        details[-1] += ' control = "bounds" computes what the bodies carry for certain.'
    if _coulomb(reader.summary.given):
        details.append("With Coulomb's friction a step may have further solutions.")
    if not last.converged:
        at = f"at ζ = {last.zeta:.6g} no solution was found"
        sentence = f"{_so_far(solved[-1], driven)}, but {at}." if solved else f"A{at[1:]}."
        return Verdict("open", sentence, [f"Why: {last.reason}.", *details])
    if _stopped(reader.summary, len(reports)):
        planned = reader.summary.planned
        what = "the limit load is not found"
        if planned:
            what = f"{len(reports)} of {planned} steps are solved"
        signal = reader.interrupted
        state = f"was interrupted ({signal})" if signal else "continues or was stopped"
        sentence = f"{_so_far(last, driven)}; {what}, and the run {state}."
        return Verdict("open", sentence, details)
    if last.stage:
        stages = len({report.stage for report in reports if report.stage})
        many = "stages" if stages > 1 else "stage"
        sentence = f"The whole history is solved: {len(reports)} steps in {stages} {many}."
    elif driven:
        most = max(reports, key=lambda report: abs(report.driving_force))
        sentence = (
            f"All {len(reports)} positions up to ζ = {last.zeta:.6g} are solved; the largest"
            f" driving force is {most.driving_force:.6g}, at ζ = {most.zeta:.6g}."
        )
    else:
        top = max(report.zeta for report in reports)
        count = f"All {len(reports)} load levels are" if len(reports) > 1 else "The load level is"
        sentence = f"{count} solved: on this mesh the bodies carry the loads up to ζ = {top:.6g}."
    return Verdict("found", sentence, details)


def _so_far(last: LevelReport, driven: bool) -> str:
    """Return a clause on the last solved level."""
    if driven or last.stage:
        return f"All steps are solved up to ζ = {last.zeta:.6g}"
    return f"The bodies carry ζ = {last.zeta:.6g} on this mesh"


def _stopped(summary: Summary, levels: int) -> bool:
    """Return whether planned levels or the requested limit load are missing."""
    if summary.planned is not None:
        return levels < summary.planned
    return bool(summary.case)  # the plan of a Python program is not known


def _coulomb(given: Mapping[str, Any]) -> bool:
    """Return whether any friction depends on the pressure."""
    places = [*given.get("contacts", []), *given.get("obstacles", [])]
    return any(place.get("coulomb") for place in places)
