"""Read statements of an ``.inp`` file besides its mesh: materials, sections, loads, contact."""

from collections import Counter
from dataclasses import replace

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.models.foreign_model import ForeignMaterial
from perfplast_fenicsx.models.inp_keywords import Keyword, number_of
from perfplast_fenicsx.models.inp_mesh import SCOPES

SILENT = {
    *("HEADING", "PREPRINT", "RESTART", "STEP", "END STEP", "STATIC", "OUTPUT", "NODE OUTPUT"),
    *("ELEMENT OUTPUT", "CONTACT OUTPUT", "NODE FILE", "EL FILE", "NODE PRINT", "EL PRINT"),
    *("CONTACT FILE", "CONTACT PRINT", "SECTION PRINT", "FILE OUTPUT", "PHYSICAL CONSTANTS"),
    *("SURFACE BEHAVIOR", "SYSTEM", "MONITOR", "CONTROLS", "PRINT", "DATA CHECK", "INCLUDE"),
    *("ELEMENT PRINT", "ENERGY OUTPUT", "ENERGY FILE", "ENERGY PRINT", "SOLID SECTION", *SCOPES),
}
"""Keywords that do not affect a limit load, or that are read elsewhere."""

LOADS = ("CLOAD", "DLOAD", "DSLOAD")


class Statements:
    """Read keywords, and turn them into statements once the mesh is known.

    Attributes:
        sections: Part, element set and material of each section.
        materials: Materials by name, in capitals.
        surfaces: ``*SURFACE`` keywords.
        frictions: Coefficients by interaction.
        thicknesses: Thicknesses of elements in the plane that sections give.
    """

    def __init__(self) -> None:
        self.sections: list[tuple[str, str, str]] = []
        self._part = ""
        self.materials: dict[str, ForeignMaterial] = {}
        self._material = ""
        self.frictions: dict[str, float] = {}
        self._interaction = ""
        self.thicknesses: set[float] = set()
        self.surfaces: list[Keyword] = []
        self._on_surfaces: list[tuple[int, Keyword]] = []
        self._steps = 0
        self._unknown: Counter[str] = Counter()
        self._noted: list[str] = []

    @property
    def remarks(self) -> list[str]:
        """Remarks on keywords without a counterpart, and on changes."""
        told = [
            f"*{name} ({number} times) has no counterpart and is left out"
            if number > 1
            else f"*{name} has no counterpart and is left out"
            for name, number in self._unknown.items()
        ]
        loaded = {step for step, keyword in self._on_surfaces if keyword.name in LOADS}
        if len(loaded) > 1:
            told.append(
                f"of {self._steps} steps, loads and supports of step {min(loaded)} are taken, the"
                " first that has loads"
            )
        return self._noted + told

    def chosen(self) -> list[Keyword]:
        """Return the keywords on surfaces, in the model and up to the first step with loads."""
        loaded = [step for step, keyword in self._on_surfaces if keyword.name in LOADS]
        last = min(loaded, default=self._steps)
        return [keyword for step, keyword in self._on_surfaces if step <= last]

    def take(self, keyword: Keyword) -> None:
        """Read a keyword that does not belong to the mesh."""
        name = keyword.name
        if name == "SOLID SECTION":
            elset, material = keyword.option("ELSET"), keyword.option("MATERIAL")
            self.sections.append((self._part, elset, material))
            cells = [row[0] for row in keyword.rows() if row and row[0]]
            self.thicknesses |= {number_of(cell, keyword) for cell in cells[:1]}
        elif name in ("PART", "END PART"):
            self._part = keyword.option("NAME")
        elif name == "MATERIAL":
            self._material = keyword.option("NAME")
            self.materials[self._material] = ForeignMaterial()
        elif name in ("ELASTIC", "PLASTIC", "DENSITY", "EXPANSION"):
            self._property(keyword)
        elif name == "SURFACE INTERACTION":
            self._interaction = keyword.option("NAME")
        elif name == "FRICTION":
            rows = keyword.rows()
            given = number_of(rows[0][0], keyword) if rows and rows[0] else 0.0
            self.frictions[self._interaction] = given
        elif name == "SURFACE":
            self.surfaces.append(keyword)
        elif name in ("BOUNDARY", "CLOAD", "DLOAD", "DSLOAD", "TIE", "CONTACT PAIR"):
            self._on_surfaces.append((self._steps, keyword))
        elif name not in SILENT:
            self._unknown[name] += 1
        if name == "STEP":
            self._steps += 1

    def _property(self, keyword: Keyword) -> None:
        """Read a property of the last material."""
        now, rows = self.materials.get(self._material), [row for row in keyword.rows() if row]
        if now is None or not rows:
            raise InputError(f"line {keyword.number}: *{keyword.name} belongs to no *MATERIAL.")
        values = [[number_of(cell, keyword) for cell in row] for row in rows]
        if keyword.name == "ELASTIC":
            kind = keyword.option("TYPE", "ISOTROPIC")
            if kind not in ("ISO", "ISOTROPIC") or len(values[0]) < 2:
                self._noted.append(
                    f"*ELASTIC of '{self._material}' is {kind.lower()}, which the program does not"
                    " support: its body has no material yet"
                )
                return
            now = replace(now, young=values[0][0], poisson=values[0][1])
        elif keyword.name == "PLASTIC":
            stresses = [row[0] for row in values]
            now = replace(now, yield_stress=stresses[0])
            if len(values) > 1 and any(stress != stresses[0] for stress in stresses):
                self._noted.append(
                    f"*PLASTIC of '{self._material}' has {len(values)} points: its first yield"
                    f" stress {stresses[0]:g} is taken without hardening, as limit loads want it"
                )
        elif keyword.name == "DENSITY":
            now = replace(now, density=values[0][0])
        else:
            now = replace(now, expansion=values[0][0])
        self.materials[self._material] = now
