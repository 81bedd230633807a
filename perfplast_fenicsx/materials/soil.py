"""List common soils as starting values, in any system of units.

For a design, use its own soil tests.
"""

from dataclasses import dataclass, replace

from perfplast_fenicsx.materials.common import TABLE
from perfplast_fenicsx.units import SYSTEMS, Name


@dataclass(frozen=True)
class Soil:
    """A common drained soil with Mohr and Coulomb's condition.

    Attributes:
        name: Name in lower case.
        young: Young's modulus (stress).
        poisson: Poisson's ratio.
        cohesion: Effective cohesion (stress).
        friction_angle: Effective angle of friction (degrees).
        unit_weight: Unit weight above the water table (stress/length).
        what: Description in words.
        source: Source of its numbers.
    """

    name: str
    young: float
    poisson: float
    cohesion: float
    friction_angle: float
    unit_weight: float
    what: str
    source: str

    def in_system(self, system: Name) -> "Soil":
        """Return the soil in another system of units, converted from that of :data:`SOILS`."""
        one, other = SYSTEMS[TABLE], SYSTEMS[system]
        factor = one.pascals / other.pascals
        return replace(
            self,
            young=self.young * factor,
            cohesion=self.cohesion * factor,
            unit_weight=self.unit_weight * factor * other.metres / one.metres,
        )


NEN_9997 = "NEN 9997-1+C2:2017, table 2.b, low values, E at 100 kPa; Poisson's ratio assumed"


def _soil(
    name: str, young: float, cohesion: float, friction_angle: float, weight: float, what: str
) -> Soil:
    """Return a soil by E (MPa), c (kPa), φ (degrees) and γ (kN/m³)."""
    # kN/m³ in N/mm³; limit loads do not depend on Poisson's ratio.
    return Soil(name, young, 0.3, 1e-3 * cohesion, friction_angle, 1e-6 * weight, what, NEN_9997)


SOILS = (
    _soil("loam-medium-drained", 3.0, 1.0, 27.5, 20.0, "loam, slightly sandy, medium"),
    _soil("loam-stiff-drained", 5.0, 2.5, 27.5, 21.0, "loam, slightly sandy, stiff"),
    _soil("clay-medium-drained", 2.0, 5.0, 17.5, 17.0, "clay, clean, medium"),
    _soil("clay-stiff-drained", 4.0, 13.0, 17.5, 19.0, "clay, clean, stiff"),
    _soil("sandy-clay-medium-drained", 3.0, 5.0, 22.5, 18.0, "clay, slightly sandy, medium"),
    _soil("sandy-clay-stiff-drained", 5.0, 13.0, 22.5, 20.0, "clay, slightly sandy, stiff"),
)
"""Common soils with cohesion, in the units of the table of common materials."""
