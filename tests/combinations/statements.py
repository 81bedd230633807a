"""Define statements that a case can contain, all about the same two blocks in contact.

The blocks are plane. The lower block is (-1, 1)×(-1, 0), fixed at the bottom. The upper block is
(-1, 1)×(0, 1), under a pressure. Both are held along x at the left side. A statement consists of
tables by their headings; tables that may occur several times are lists.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

VON_MISES = {"law": "von-mises", "young": 2e5, "poisson": 0.3, "yield_stress": 300.0}
PRESSURE = {"on": "top", "pressure": 1.0}
CONTACT = {"primary": "lower_seam", "secondary": "upper_seam"}
LEFT = {"on": "left", "components": "x"}
HELD = [{"on": "bottom"}, LEFT]


@dataclass(frozen=True)
class Statement:
    """A statement about the two blocks, in addition to contact and pressure.

    Attributes:
        words: The statement in a few words.
        mesh: Name of the mesh: "blocks", blocks that are meshed "apart", have a "round" top or lie
            beside the "axis"; or keys of ``[mesh]``.
        tables: Tables that are added, or that replace those with the same heading.
        level: Load factor that the blocks carry.
        work: Work of the loads at about this level.
    """

    words: str
    mesh: str | Mapping[str, Any] = "blocks"
    tables: Mapping[str, Any] = field(default_factory=dict)
    level: float = 200.0
    work: float = 0.003


def _loads(*more: Mapping[str, Any]) -> Mapping[str, Any]:
    return {"load": [PRESSURE, *more]}


def _contact(**more: object) -> Mapping[str, Any]:
    return {"contact": [CONTACT | more]}


def _both(law: Mapping[str, Any]) -> Mapping[str, Any]:
    return {"material.lower": law, "material.upper": law}


RIGID: Mapping[str, Any] = {
    "support": [{"on": "bottom"}],
    "rigid_surface": [{"on": "top", "held": "x"}],
    "load": [{"on": "top", "force": [0.0, -2.0]}],
}
STATEMENTS = (
    Statement("contact without friction"),
    Statement(
        "a traction in addition to the pressure",
        tables=_loads({"on": "right", "traction": [-0.2, 0.0]}),
    ),
    Statement(
        "a body force in addition to the pressure",
        tables=_loads({"on": "upper", "body_force": [0.0, -0.5]}),
    ),
    Statement(
        "a constant load (weight)",
        tables=_loads({"on": "upper", "body_force": [0.0, -5.0], "constant": True}),
    ),
    Statement(
        "pore pressure", tables=_loads({"on": "lower", "pore_pressure": 0.1, "constant": False})
    ),
    Statement("a linear pressure", tables={"load": [{"on": "top", "pressure": "1 + 0.1*x"}]}),
    Statement("a quadratic pressure", tables={"load": [{"on": "top", "pressure": "1 - 0.1*x**2"}]}),
    Statement("a rigid surface under a force", tables=RIGID),
    Statement(
        "a support that moves (settlement)",
        tables={
            "support": [{"on": "bottom", "value": -1e-4, "constant": True, "components": "y"}, LEFT]
        },
    ),
    Statement("a gap that closes", tables=_contact(gap=1e-4)),
    Statement("a press fit", tables=_contact(gap=-1e-4, interference=True)),
    Statement(
        "a temperature",
        tables={"temperature": [{"on": "upper", "change": 10.0}]}
        | _both(VON_MISES | {"expansion": 1e-5}),
    ),
    Statement(
        "an initial stress",
        tables={"initial_stress": [{"on": "lower", "stress": [-10.0, -10.0, -6.0, 0.0]}]},
    ),
    Statement(
        "a bolt that is tightened",
        tables={"bolt": [{"on": "lower", "preload": 10.0, "axis": [1.0, 0.0]}]},
    ),
    Statement("Tresca friction", tables=_contact(tresca=20.0)),
    Statement("Coulomb friction", tables=_contact(coulomb=0.2)),
    Statement("a joint that dilates", tables=_contact(coulomb=0.2, associated=True)),
    Statement("contact with nonmatching nodes", mesh="apart"),
    Statement("a tie", tables={"contact": [], "tie": [CONTACT]}),
    Statement(
        "a tie with nonmatching nodes", mesh="apart", tables={"contact": [], "tie": [CONTACT]}
    ),
    Statement(
        "a plane obstacle",
        tables={
            "support": [LEFT],
            "obstacle": [
                {"shape": "plane", "on": "bottom", "point": [0.0, -1.0], "normal": [0.0, 1.0]}
            ],
        },
    ),
    Statement(
        "a round obstacle",
        tables={
            "obstacle": [{"shape": "sphere", "on": "right", "centre": [6.0, 0.0], "radius": 5.0}],
        },
    ),
    Statement(
        "an elastic body",
        tables={"material.upper": {"law": "elastic", "young": 2e5, "poisson": 0.3}},
    ),
    Statement(
        "hardening",
        tables=_both(VON_MISES | {"law": "von-mises-hardening", "isotropic": 1e3}),
    ),
    Statement(
        "ground (Drucker–Prager)",
        tables=_both(
            {
                "law": "drucker-prager",
                "young": 2e5,
                "poisson": 0.3,
                "cohesion": 150.0,
                "friction_angle": 10.0,
                "match": "plane-strain",
            }
        ),
    ),
    Statement("bodies of revolution", mesh="axis", tables={"model": {"kind": "axisymmetric"}}),
    Statement("curved cells", mesh="round"),
    Statement("linear elements", tables={"element": {"degree": 1}}),
    Statement(
        "three dimensions",
        mesh={"builder": "stacked_blocks", "n": 1},
        tables={
            "support": [
                {"on": "x0", "components": "x"},
                {"on": "y0", "components": "y"},
                {"on": "bottom", "components": "z"},
            ],
            "contact": [{"primary": "lower_top", "secondary": "upper_bottom"}],
        },
    ),
    Statement(
        "ground (Mohr–Coulomb)",
        tables=_both(
            {
                "law": "mohr-coulomb",
                "young": 2e5,
                "poisson": 0.3,
                "cohesion": 150.0,
                "friction_angle": 10.0,
            }
        ),
    ),
    Statement("plane stress", tables={"model": {"kind": "plane-stress"}}),
    Statement(
        "a support along the normal of a surface",
        tables={"support": [{"on": "bottom"}, {"on": "left", "components": "normal"}]},
    ),
)
