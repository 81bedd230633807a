"""State the bounds that the proof files of a run prove, in a form that is hard to misread."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.result_files import FALLS, PROOF, STANDS
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.report.case_words import CaseWords
from perfplast_fenicsx.report.proof_section import fingerprint, proofs_of
from perfplast_fenicsx.report.stored_summary import check_summary
from perfplast_fenicsx.rounding import rounded_down, rounded_up


@dataclass(frozen=True)
class Claim:
    """Bounds that the checker has proven again from their files.

    Attributes:
        quantity: "load factor", "multiple of the constant loads", or "factor of safety".
        sentence: The bounds in words.
        meaning: The loads that the quantity multiplies, or the strengths that it divides.
        lower: The largest value at which the bodies provably carry the loads; None if no value is
            proven.
        upper: The smallest value at which they provably collapse; None if no value is proven.
        proofs: For each bound: its proof file, the SHA-256, and the command that checks the file.
        taken_as_written: Bodies, strengths, supports and loads for which the proof holds.
        assumptions: Assumptions of the results.
        not_proven: Reasons why a bound is missing.
        units: Units of the case's numbers by kind; empty if the case names no units.
        version: Version of the program.
    """

    quantity: str
    sentence: str
    meaning: str
    lower: float | None
    upper: float | None
    proofs: tuple[dict[str, str], ...]
    taken_as_written: tuple[str, ...]
    assumptions: tuple[str, ...]
    not_proven: tuple[str, ...]
    units: dict[str, str]
    version: str

    def table(self) -> dict[str, Any]:
        """Return the claim as a table for JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """Return the claim in lines: the sentence, its meaning, the files and the assumptions."""
        files = [
            f"{one['half']} bound: {one['file']}, SHA-256 {one['sha256']}" for one in self.proofs
        ]
        missing = [f"Not proven: {why}." for why in self.not_proven]
        return "\n".join([self.sentence, self.meaning, *files, *self.taken_as_written, *missing])


def claim_of(folder: str | Path) -> Claim:
    """Return the claim that the proof files in a result folder prove. Not collective.

    Raises:
        InputError: If there are no results, or if their files prove no bound of a single number.
    """
    reader = ResultReader(folder)
    check_summary(reader)
    summary, limit = reader.summary, reader.summary.limit or {}
    proofs = proofs_of(reader)
    strength, body = limit.get("strength"), limit.get("body") or {}
    if limit.get("envelope"):
        raise InputError(
            f"'{folder}' contains an envelope, which is not a single claim; check each direction "
            "with python3 -m perfplast_fenicsx.proof."
        )
    if strength and strength.get("estimate"):
        raise InputError(
            f"'{folder}' contains only Davis' estimate of a factor of safety, which proves no "
            "bound for nonassociated ground, so there is no claim; for bounds give nonassociated "
            "= 'radenkovic'."
        )
    names = {"lower": STANDS, "upper": FALLS} if strength else {"lower": PROOF, "upper": PROOF}
    found = {kind: proofs.get(name, {}).get(kind) for kind, name in names.items()}
    halves = {kind: half for kind, half in found.items() if half is not None}
    numbers = {
        kind: float(strength[kind]) if strength else half.proven
        for kind, half in halves.items()
        if half.proven is not None
    }
    if not numbers:
        reasons = "; ".join(body.get("why_not", [])) or "no run with bounds has finished there"
        raise InputError(
            f"nothing is proven in '{folder}' ({reasons}), so there is no claim; run the case with"
            ' control = "bounds" or "strength".'
        )
    standing = bool(body.get("standing"))
    words = CaseWords.of(summary)
    meaning = words.meaning(reader.scene.driven)
    if strength:
        meaning = (
            "F divides yield stresses, cohesions and coefficients of friction (tan φ); the loads "
            "are constant."
        )
    elif standing:
        meaning = "The number multiplies the constant loads."
    quantity = "multiple of the constant loads" if standing else "load factor"
    return Claim(
        quantity="factor of safety" if strength else quantity,
        sentence=_sentence("F" if strength else "ζ", numbers),
        meaning=meaning,
        lower=numbers.get("lower"),
        upper=numbers.get("upper"),
        proofs=tuple(
            {
                "half": kind,
                "file": str(Path(folder) / names[kind]),
                "sha256": fingerprint([reader.path / names[kind]]),
                "check": f"python3 -m perfplast_fenicsx.proof {Path(folder) / names[kind]}",
            }
            for kind in numbers
        ),
        taken_as_written=tuple(
            dict.fromkeys(
                text
                for kind in numbers
                for text in halves[kind].words
                if text.startswith("Taken as written")
            )
        ),
        assumptions=tuple(words.assumptions(summary.model["kind"], body.get("taken", ()), True)),
        not_proven=tuple(
            why for why in body.get("why_not", []) if why.partition(" ")[0] not in numbers
        ),
        units={kind: unit for kind, unit in summary.units.items() if unit},
        version=summary.version,
    )


def _sentence(letter: str, numbers: dict[str, float]) -> str:
    """Return the bounds in a sentence, rounded such that they remain bounds."""
    proven = []
    if "lower" in numbers:
        proven.append(f"carry {letter} = {rounded_down(numbers['lower'])} for certain")
    if "upper" in numbers:
        proven.append(f"collapse at {letter} = {rounded_up(numbers['upper'])} at the latest")
    return f"The bodies {', and '.join(proven)}."
