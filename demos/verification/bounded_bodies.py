"""Define plane bodies, and the gaps that the bounds on their limit loads should reach.

Lengths are relative to half the width of the loaded surface, and shear yield stresses are 1, except
for the beam. A uniform pressure, unlike a rigid punch, does not restrict the mechanisms. Where the
pressure ends, the lower bound needs a fan of cells. The platen on the two blocks is rough: it holds
the top surface.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from demos.verification.study import mesh
from meshes.beam_on_prop import write_beam_on_prop
from meshes.cracked_strip import write_cracked_strip
from meshes.platens import write_platens
from meshes.strip_footing import write_strip_footing
from meshes.tube_polygon import write_tube_polygon
from perfplast_fenicsx import Contact, Elastic, Pressure, Problem, Support, VonMises
from perfplast_fenicsx.io import ResultFolder
from perfplast_fenicsx.materials import Material

PRANDTL = 2 + math.pi


def of_shear(k: float) -> VonMises:
    """Return a von Mises material with the shear yield stress k."""
    return VonMises(young=1000.0, poisson=0.3, yield_stress=math.sqrt(3) * k)


GROUND = of_shear(1.0)
STEEL = VonMises(young=210e3, poisson=0.3, yield_stress=250.0)
HELD_GROUND = [Support("x0", "x"), Support("side"), Support("bottom")]
SEAM = [Contact("ground_footing", "punch_footing")]
WIDE = {"width": 5.0, "depth": 4.0, "grading": 1.0, "size": 0.5}


@dataclass(frozen=True)
class Case:
    """A problem, and the gap that the bounds should reach.

    Attributes:
                name: Name in the table.
        write: Function that writes the first mesh.
        arguments: Arguments of ``write``.
        materials: Materials of the volumes.
        supports: The supports.
        loads: The loads.
        asked: Required relative gap, and largest number of cells.
        exact: Limit load; None if it is not known.
        contacts: Contacts between the bodies.
        coarse: Gap and number of cells of a quick run; None if a quick run omits the case.
    """

    name: str
    write: Callable[..., None]
    arguments: Mapping[str, object]
    materials: Mapping[str, Material]
    supports: Sequence[Support]
    loads: Sequence[Pressure]
    asked: tuple[float, int]
    exact: float | None = None
    contacts: Sequence[Contact] = field(default_factory=list)
    coarse: tuple[float, int] | None = None

    def problem(self, folder: ResultFolder, **changes: object) -> Problem:
        """Return the problem on its first mesh; ``changes`` replace ``arguments``. Collective."""
        tagged_mesh = mesh(folder, self.write, **{**self.arguments, **changes})
        held = (self.supports, self.loads, self.contacts)
        return Problem(tagged_mesh, self.materials, *held, degree=2)


FOOTING = Case(
    name="footing, pressure",
    write=write_strip_footing,
    arguments=WIDE,
    materials={"ground": GROUND},
    supports=HELD_GROUND,
    loads=[Pressure("footing", 1.0)],
    asked=(0.006, 4000),
    exact=PRANDTL,
)
PUNCH = replace(
    FOOTING,
    name="footing, block in contact",
    arguments=WIDE | {"punch": True},
    materials={"ground": GROUND, "punch": of_shear(5.0)},
    loads=[Pressure("top", 1.0)],
    contacts=SEAM,
    asked=(0.008, 3000),
    coarse=(0.17, 200),
)
PLATENS = Case(
    name="rough platens",
    write=write_platens,
    arguments={"platen": True, "grading": 1.0, "size": 0.25},
    materials={"block": GROUND, "platen": Elastic(1e6, 0.3)},
    supports=[Support("x0", "x"), Support("y0", "y")],
    loads=[Pressure("top", 1.0)],
    asked=(0.003, 4000),
    exact=2.42768,
    coarse=(0.05, 300),
)
NOTCHES = Case(
    name="two notches",
    write=write_cracked_strip,
    arguments={"width": 10.0, "length": 20.0, "tip": 1.0, "grading": 1.0, "size": 0.5},
    materials={"strip": GROUND},
    supports=[Support("x0", "x"), Support("inner", "y")],
    loads=[Pressure("top", -1.0)],
    asked=(0.0025, 5073),
    exact=PRANDTL / 10,
)
SLIT = replace(
    NOTCHES,
    name="slit",
    arguments={"width": 2.0, "length": 3.0, "tip": 1.0, "grading": 1.0, "size": 0.25},
    supports=[Support("x0", "x"), Support("outer", "y")],
    asked=(0.002, 5841),
    exact=1.0,
)
BLOCKS = replace(
    PUNCH,
    name="block on a weaker block",
    arguments={"punch": True, "width": 2.0, "depth": 1.0, "grading": 1.0, "size": 0.5},
    materials={"ground": of_shear(0.6), "punch": GROUND},
    supports=[Support("x0", "x"), Support("top", "x"), Support("bottom")],
    asked=(0.005, 5000),
    exact=None,
    coarse=None,
)
BEAM = Case(
    name="beam on a prop",
    write=write_beam_on_prop,
    arguments={"size": 25.0},
    materials={"beam": STEEL, "block": STEEL},
    supports=[Support("wall"), Support("floor")],
    loads=[Pressure("top", 1.0)],
    contacts=[Contact("beam_seam", "block_seam")],
    asked=(0.005, 5000),
)
TUBE = Case(
    name="thick tube, two polygons",
    write=write_tube_polygon,
    arguments={},
    materials={"tube": GROUND},
    supports=[Support("x0", "x"), Support("y0", "y")],
    loads=[Pressure("inner", 1.0)],
    asked=(0.0041, 1536),
    exact=2 * math.log(2),
)
ADAPTED = (FOOTING, PUNCH, PLATENS, NOTCHES, SLIT, BLOCKS, BEAM)
