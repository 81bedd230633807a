"""Define the units of a case: consistent systems, in which a force is a stress times an area.

No result depends on the units; they only give the numbers a meaning.
"""

from dataclasses import dataclass
from typing import Literal

from perfplast_fenicsx.errors import InputError

Name = Literal[
    "mm-N-MPa",
    "mm-kN-GPa",
    "m-kN-kPa",
    "m-MN-MPa",
    "SI",
    "in-lbf-psi",
    "in-kip-ksi",
    "ft-lbf-psf",
    "ft-kip-ksf",
]

INCH, FOOT = 0.0254, 0.3048
"""Exact lengths in m (international yard and pound agreement of 1959)."""

POUND_FORCE = 4.4482216152605
"""Exact force in N: 0.45359237 kg times the standard gravity 9.80665 m/s²."""


MASSES = {("N", "m"): "kg", ("kN", "m"): "t", ("N", "mm"): "t"}
"""Names of the units of mass, force · s² / length, by the units of force and length."""


@dataclass(frozen=True)
class System:
    """A consistent system of units.

    Attributes:
        length: Unit of lengths.
        force: Unit of forces.
        stress: Unit of stresses, which is force / length².
        metres: Unit of lengths in metres.
        pascals: Unit of stresses in pascals.
        arm: Unit of lever arms in printed moments.
        arm_metres: Unit of lever arms in metres.
    """

    length: str
    force: str
    stress: str
    metres: float
    pascals: float
    arm: str = "m"
    arm_metres: float = 1.0

    @property
    def density(self) -> str:
        """Return the unit of densities, such as t/mm³; it is force · s² / length⁴."""
        mass = MASSES.get((self.force, self.length))
        return f"{mass}/{self.length}³" if mass else f"{self.force} s²/{self.length}⁴"


SYSTEMS: dict[Name, System] = {
    "mm-N-MPa": System("mm", "N", "MPa", 1e-3, 1e6),
    "mm-kN-GPa": System("mm", "kN", "GPa", 1e-3, 1e9),
    "m-kN-kPa": System("m", "kN", "kPa", 1.0, 1e3),
    "m-MN-MPa": System("m", "MN", "MPa", 1.0, 1e6),
    "SI": System("m", "N", "Pa", 1.0, 1.0),
    "in-lbf-psi": System("in", "lbf", "psi", INCH, POUND_FORCE / INCH**2, "ft", FOOT),
    "in-kip-ksi": System("in", "kip", "ksi", INCH, 1e3 * POUND_FORCE / INCH**2, "ft", FOOT),
    "ft-lbf-psf": System("ft", "lbf", "psf", FOOT, POUND_FORCE / FOOT**2, "ft", FOOT),
    "ft-kip-ksf": System("ft", "kip", "ksf", FOOT, 1e3 * POUND_FORCE / FOOT**2, "ft", FOOT),
}
"""Systems of units by their names in case files."""


@dataclass(frozen=True)
class Units:
    """The units of a case's numbers; the program converts nothing.

    Args:
        length: Unit of length of the mesh, such as "mm"; not needed if there is a system.
        stress: Unit of stress of the materials and loads, such as "MPa"; not needed if there is a
            system.
        system: A consistent system of lengths, forces and stresses. The systems with inches and
            feet are "in-lbf-psi", "in-kip-ksi", "ft-lbf-psf" and "ft-kip-ksf".
    """

    length: str = ""
    stress: str = ""
    system: Name | None = None

    def __post_init__(self) -> None:
        """Check that the units of length and stress agree with the system.

        Raises:
            InputError: If one of them does not agree.
        """
        if self.system is None:
            return
        if self.system not in SYSTEMS:
            known = ", ".join(SYSTEMS)
            raise InputError(f"system = '{self.system}' is unknown; give one of {known}.")
        for key in ("length", "stress"):
            given, meant = getattr(self, key), getattr(SYSTEMS[self.system], key)
            if given not in ("", meant):
                raise InputError(
                    f"{key} = '{given}' contradicts system = '{self.system}', in which the unit of "
                    f"{key} is {meant}; remove {key}, or choose another system."
                )

    @property
    def name(self) -> Name | None:
        """Return the name of the given system, or of the system with these units, or None."""
        if self.system is not None:
            return self.system
        for name, system in SYSTEMS.items():
            if (system.length, system.stress) == (self.length, self.stress):
                return name
        return None

    @property
    def known(self) -> System | None:
        """Return the system of units with the name :attr:`name`, or None if there is no name."""
        return SYSTEMS[self.name] if self.name else None

    def table(self, whole: bool = True) -> dict[str, str]:
        """Return the unit of each quantity for ``summary.json``.

        Args:
            whole: Whether bodies are finite in all directions. If not, forces, works and
                volumes are per unit of depth.

        Returns:
            Units of ``length``, ``volume``, ``stress``, ``force``, ``work``, ``moment`` and
            ``force_density`` (force per volume), and the ``system``. Unknown units are empty texts.
            In a system, lever arms of moments are in metres or feet (:meth:`moment_scale`).
        """
        system = self.known
        length = system.length if system else self.length
        stress = system.stress if system else self.stress
        force = work = density = moment = ""
        if system:
            moment = f"{system.force} {system.arm}" + ("" if whole else f"/{system.arm}")
            force = system.force if whole else f"{system.force}/{length}"
            work = f"{system.force} {length}" + ("" if whole else f"/{length}")
            density = f"{system.force}/{length}^3"
        elif length and stress:
            force = f"{stress} {length}²" if whole else f"{stress} {length}"
            work = f"{stress} {length}³" if whole else f"{stress} {length}²"
            moment = work
            density = f"{stress}/{length}"
        return {
            "system": self.name or "",
            "length": length,
            "volume": "" if not length else f"{length}^3" if whole else f"{length}^3/{length}",
            "stress": stress,
            "force": force,
            "work": work,
            "moment": moment,
            "force_density": density,
        }

    def moment_scale(self, whole: bool = True) -> float:
        """Return the factor that converts moments (force × length) to the unit of :meth:`table`.

        Args:
            whole: As for :meth:`table`; N mm per millimetre of depth equals N m per metre.
        """
        system = self.known
        return system.metres / system.arm_metres if system and whole else 1.0

    def of_length(self) -> str:
        """Return the unit of lengths, for the brackets after a length."""
        return self.table()["length"] or "the mesh's unit of length"

    def of_stress(self) -> str:
        """Return the unit of stresses, for the brackets after a stress."""
        return self.table()["stress"] or "the materials' unit of stress"

    def of_work(self, whole: bool) -> str:
        """Return the unit of works, for the brackets after a work; empty if it is not known."""
        return self.table(whole)["work"]

    def in_words(self, whole: bool = True) -> str:
        """Return the units in words, without a full stop; empty if no unit is known."""
        table = self.table(whole)
        kinds = {"length": "lengths", "force": "forces", "stress": "stresses", "work": "works"}
        if table["moment"] != table["work"]:
            kinds["moment"] = "moments of results"
        said = [f"{word} in {table[kind]}" for kind, word in kinds.items() if table[kind]]
        return ", ".join(said)
