"""Describe the case in words: model, bodies, supports, loads and contacts, with units."""

from collections.abc import Mapping, Sequence
from typing import Any

from perfplast_fenicsx.io.results.summary import Summary
from perfplast_fenicsx.problem.declared.loads import LOADS, FieldPores, ForceBelow

Table = Mapping[str, Any]
Row = tuple[str, str]

LAWS = {
    "von-mises": "elastic, perfectly plastic (von Mises)",
    "von-mises-hardening": "elastic, plastic with linear hardening (von Mises)",
    "drucker-prager": "elastic, perfectly plastic (Drucker–Prager)",
    "mohr-coulomb": "elastic, perfectly plastic (Mohr–Coulomb)",
    "tresca": "elastic, perfectly plastic (Tresca)",
    "hoek-brown": "elastic, perfectly plastic (Hoek–Brown, a = ½)",
    "hill": "elastic, perfectly plastic (Hill 1948)",
    "elastic": "elastic, never plastic",
}

NUMBERS = {
    "young": ("Young's modulus", "stress"),
    "poisson": ("Poisson's ratio", ""),
    "yield_stress": ("yield stress", "stress"),
    "cohesion": ("cohesion", "stress"),
    "friction_angle": ("friction angle in degrees", ""),
    "tensile_strength": ("tensile strength", "stress"),
    "compressive_strength": ("uniaxial compressive strength of intact rock", "stress"),
    "m_b": ("m_b of the rock mass", ""),
    "s": ("s of the rock mass", ""),
    "dilatancy_angle": ("dilatancy angle in degrees", ""),
    "nonassociated": ("method for ground with less dilatancy", ""),
    "match": ("matches Mohr–Coulomb in", ""),
    "isotropic": ("isotropic hardening", "stress"),
    "kinematic": ("kinematic hardening", "stress"),
    "r11": ("ratio of yield stresses, first axis", ""),
    "r22": ("ratio of yield stresses, second axis", ""),
    "r33": ("ratio of yield stresses, z", ""),
    "r12": ("ratio of shear stresses, first and second axis", ""),
    "r13": ("ratio of shear stresses, first axis and z", ""),
    "r23": ("ratio of shear stresses, second axis and z", ""),
    "angle": ("first axis from x in degrees", ""),
    "expansion": ("thermal expansion", ""),
}

MODELS = {
    "space": "in space (3D)",
    "plane-strain": "plane strain",
    "plane-stress": "plane stress: sheets without out-of-plane stress",
    "axisymmetric": "axisymmetric: half of a section through bodies of revolution",
}


MEANINGS = {
    "plane-strain": "Plane strain: no point moves along z, and no quantity changes along z.",
    "plane-stress": "Plane stress: no stress acts in the out-of-plane direction.",
    "axisymmetric": "Bodies, supports and loads are the same in every section through the axis.",
}

HARDENING = "von-mises-hardening"


class CaseWords:
    """A description of the case in words."""

    @classmethod
    def of(cls, summary: Summary) -> "CaseWords":
        """Return the description of the case of a run."""
        found = summary.limit or {}
        several = bool(found.get("envelope") or found.get("shakedown"))
        staged = any(step.get("stage") for step in summary.steps)
        return cls(summary.given, summary.units, summary.model["axes"], staged, several)

    def __init__(
        self,
        given: Table,
        units: Mapping[str, str],
        axes: str,
        staged: bool = False,
        several: bool = False,
    ) -> None:
        """Store the data of ``summary.json``.

        Args:
            given: The declaration of the problem.
            units: Units of numbers by kind.
            axes: Letters of the model's axes.
            staged: Whether the case has stages, with a factor for each named load.
            several: Whether each load has its own factor without stages, as in an envelope.
        """
        self._given, self._units, self._axes = given, units, axes
        self._staged, self._several = staged, several
        self._times = "times its factor" if staged or several else "times ζ"

    def bodies(self) -> list[Row]:
        """Return the name and the material of each body."""
        rows = []
        for name, material in self._given.get("materials", {}).items():
            numbers, remembers = material, ""
            if material["kind"] == "Flow":
                numbers, remembers = material["body"], "; keeps plastic strains from level to level"
            words = LAWS.get(numbers["kind"], numbers["kind"])
            told = self._numbers(numbers)
            rows.append((name, f"{words}{remembers}{': ' if told else ''}{told}"))
        return folded(rows, "bodies")

    def supports(self) -> list[Row]:
        """Return a row for each support: the held surface and how it is held."""
        rows = []
        for support in self._given.get("supports", []):
            along = self._letters(support["components"])
            text = f"held in {along}"
            if support["components"] == "normal":
                text = "held along its normal"
            if support["value"]:
                text = f"moved by {self.number(support['value'], 'length')} in {along}"
                text += "" if support["constant"] else f", {self._times}"
            rows.append((support["on"], text))
        for rigid in self._given.get("rigid", []):
            rows.append((rigid["on"], f"rigid, {self._rigid_motion(rigid)}"))
        return rows

    def _rigid_motion(self, rigid: Table) -> str:
        """Return how a rigid surface moves."""
        if rigid.get("held"):
            return f"moves without turning, held in {self._letters(rigid['held'])}"
        about = f" about {self.number(rigid['point'], 'length')}" if rigid.get("point") else ""
        how = []
        if rigid["displacement"] not in ([], None):
            how.append(f"moved by {self.number(rigid['displacement'], 'length')}")
        if rigid["rotation"] not in ([], None):
            how.append(f"turned by {self.number(rigid['rotation'], '')} rad{about}")
        if not how:
            return "is free to move"
        along = self._letters(rigid.get("components", "xyz"))
        every = len(along.split(", ")) == len(self._axes)
        only = "" if every else f" in {along}"
        times = "" if rigid.get("constant", True) else f", {self._times}"
        return f"{' and '.join(how)}{only}{times}"

    def loads(self) -> list[Row]:
        """Return a row for each load: where and how it acts."""
        rows = []
        for load in self._given.get("loads", []):
            how = "constant" if load["constant"] else self._times
            name = f"{load['name']}: " if load.get("name") else ""
            rows.append((load["on"], f"{name}{self._load(load)}, {how}"))
        for first in self._given.get("initial", []):
            if first["kind"] == "temperature":
                text = f"change of temperature {self.number(first['change'], '')}"
            elif first["kind"] == "bolt":
                text = f"bolt, tightened to {self.number(first['preload'], 'force')}"
            else:
                text = f"initial stress {self.number(first['stress'], 'stress')}"
            rows.append((first["on"], text))
        return rows

    def meaning(self, driven: bool) -> str:
        """Return a sentence that explains ζ; empty if ζ multiplies nothing.

        Args:
            driven: Whether ζ multiplies motions of supports or obstacles, or overlaps, while no
                load does work.
        """
        if self._staged:
            return "ζ is the time: it grows by 1 in each stage."
        if driven:
            return (
                "At ζ = 1, motions of supports and obstacles, and overlaps, have the values in "
                "the case file."
            )
        live = []
        for load in self._given.get("loads", []):
            if not load["constant"]:
                live.append(f"{self._load(load)} on {load['on']}")
        if not live:
            return ""
        most_named = (
            4  # largest number of loads that the explanation of ζ names; the case lists all
        )
        more = f" and {len(live) - most_named} more loads" if len(live) > most_named else ""
        one = "A factor of 1" if self._several else "ζ is the load factor: ζ = 1"
        return f"{one} is {'; '.join(live[:most_named])}{more}."

    def contacts(self) -> list[Row]:
        """Return the rows of contacts, obstacles and ties."""
        rows = []
        for contact in self._given.get("contacts", []):
            gap = contact["gap"]
            text = (
                "gap measured in the mesh" if gap is None else f"gap {self.number(gap, 'length')}"
            )
            if not contact.get("constant", True):
                text += f", where overlaps act {self._times}"
            where = f"{contact['primary']} – {contact['secondary']}"
            rows.append((where, f"contact, {self._friction(contact)}, {text}"))
        for obstacle in self._given.get("obstacles", []):
            text = f"rigid {self._shape(obstacle)}, {self._friction(obstacle)}"
            if any(obstacle.get("move") or ()):
                text += f", moves by {self.number(obstacle['move'], 'length')} {self._times}"
            rows.append((obstacle.get("name") or obstacle["on"], text))
        for tie in self._given.get("ties", []):
            rows.append((f"{tie['primary']} – {tie['secondary']}", "glued together"))
        return folded(rows, "places")

    def _shape(self, obstacle: Table) -> str:
        """Return the kind of an obstacle with its place and size."""
        found = "hollow " if obstacle.get("hollow") else ""
        found += str(obstacle["kind"])
        if "radius" in obstacle:
            found += f" of radius {self.number(obstacle['radius'], 'length')}"
        through = "around the axis through" if "axis" in obstacle else "through"
        for key, words in (("point", through), ("centre", "around")):
            if key in obstacle:
                found += f" {words} {self.number(obstacle[key], 'length')}"
        for key, words in (("normal", "with the normal"), ("axis", "along")):
            if key in obstacle:
                found += f" {words} {self.number(obstacle[key], '')}"
        return found

    def assumptions(self, kind: str, taken: Sequence[str], of_bodies: bool) -> list[str]:
        """Return the assumptions of the results in sentences.

        Args:
            kind: Kind of the model.
            taken: Idealisations that the bounds name, as clauses.
            of_bodies: Whether there are bounds for the bodies, not only results for a mesh.
        """
        listed = [MEANINGS[kind]] if kind in MEANINGS else []
        listed.append("Displacements are small: equilibrium holds on the undeformed bodies.")
        listed.append("Loads act slowly. Buckling, fracture and fatigue are not examined.")
        listed += self._assumed_flow()
        if self._given.get("contacts") or self._given.get("obstacles"):
            listed.append("Surfaces in contact can push and separate, but not pull.")
        if self._given.get("ties"):
            listed.append("Glued surfaces never separate, whatever force they transmit.")
        if not any(self._units.values()):
            listed.append(
                "The case names no units; its numbers must belong to one consistent system."
            )
        whose = "The bodies are the regions that the straight-sided elements of the mesh fill."
        listed.append(whose if of_bodies else "Results hold for the mesh, not for the bodies.")
        return [*listed, *(f"{text[:1].upper()}{text[1:].rstrip('.')}." for text in taken)]

    def _assumed_flow(self) -> list[str]:
        """Return the assumptions on the constitutive laws, each with the names of its bodies."""
        bodies: dict[str, list[str]] = {}
        for name, material in self._given.get("materials", {}).items():
            numbers = material["body"] if material["kind"] == "Flow" else material
            law = numbers["kind"]
            if law == "rigid":
                text = "rigid"
            elif law == "elastic":
                text = "elastic at any stress"
            elif law == HARDENING:
                text = "unlimited hardening at any strain"
            else:
                text = "perfectly plastic at any strain"
                dilates = numbers.get("dilatancy_angle")
                if dilates is None or dilates == numbers.get("friction_angle"):
                    text += ", with associated flow"
            bodies.setdefault(text, []).append(name)
        return [f"Taken as {text}: {', '.join(names)}." for text, names in bodies.items()]

    def number(self, value: Any, kind: str) -> str:
        """Return a number, formula or vector with the unit of its kind, if the unit is known."""
        if isinstance(value, Sequence) and not isinstance(value, str):
            text = f"({', '.join(map(plain, value))})"
        else:
            text = plain(value)
        return f"{text} {self._units.get(kind, '')}".rstrip()

    def _load(self, load: Table) -> str:
        """Return the kind and size of a load."""
        if load["kind"] == FieldPores.__name__:
            return f"pore pressure of {load['value']}"
        known = ForceBelow if load["kind"] == ForceBelow.__name__ else LOADS.get(load["kind"])
        acts = []
        for field, unit in (known.quantities if known else {"value": ""}).items():
            words = field.replace("_", " ")
            if field == "value":
                words = known.words if known else load["kind"]
                if load["kind"] == "traction" and load.get("total"):
                    words, unit = "evenly spread force", "force"
            if said := load.get(f"{field}_in_words"):
                acts.append(f"{words}, {said}")
            elif load.get(field, []) != []:
                acts.append(f"{words} {self.number(load[field], unit)}")
        text = " and ".join(acts)
        if load["kind"] == "force" and load.get("point"):
            text += f" at the point {self.number(load['point'], 'length')}"
        if known is ForceBelow and load["depth"]:
            text += f", where {load.get('depth_in_words', load['depth'] + ' > 0')}"
        return text

    def _letters(self, components: str) -> str:
        """Return components as letters of the model's axes."""
        # Case files use these letters for components, whatever the model's axes are called.
        axes = "xyz"
        names = dict(zip(axes, self._axes, strict=False))
        return ", ".join(names[a] for a in components if a in names)

    def _friction(self, place: Table) -> str:
        adhesion = self.number(place["tresca"], "stress") if place.get("tresca") else ""
        if place.get("coulomb"):
            law = "Coulomb, associated" if place.get("associated") else "Coulomb"
            words = f"friction coefficient {plain(place['coulomb'])} ({law})"
            return f"{words} in addition to an adhesion of {adhesion}" if adhesion else words
        return f"friction {adhesion} (Tresca)" if adhesion else "without friction"

    def _numbers(self, material: Table) -> str:
        told = []
        for key, value in material.items():
            usual = key in ("kind", "reduced") or value is None
            if usual or (key == "expansion" and not value):
                continue
            words, unit = NUMBERS.get(key, (key.replace("_", " "), ""))
            told.append(f"{words} {self.number(value, unit)}")
        if material.get("reduced") is False:
            told.append("not divided by F")
        return ", ".join(told)


def folded(rows: Sequence[Row], what: str) -> list[Row]:
    """Return the rows after merging rows with equal descriptions into one row with all names.

    Args:
        rows: Names and their descriptions.
        what: The kind of object that the names belong to, such as "bodies".
    """
    names: dict[str, list[str]] = {}
    for name, text in rows:
        names.setdefault(text, []).append(name)
    told = []
    least_alike = 3  # least number of equal rows that are merged
    for name, text in rows:
        alike = names[text]
        if len(alike) < least_alike:
            told.append((name, text))
        elif name == alike[0]:
            told.append((f"{len(alike)} {what}", f"{text}: {', '.join(alike)}"))
    return told


def plain(value: Any) -> str:
    """Return a number with few digits, or a formula unchanged."""
    return f"{value + 0.0:.6g}" if isinstance(value, int | float) else str(value)
