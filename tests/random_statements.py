"""Make random cases of two stacked blocks that combine many statements.

Every third case has a known limit load: the blocks are compressed between smooth planes. Other
statements do not change the limit load, or change it by an amount from statics.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from random import Random
from typing import Any

from mpi4py import MPI

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Elastic,
    Force,
    InitialStress,
    Plane,
    PorePressure,
    Pressure,
    Problem,
    RigidSurface,
    Support,
    Temperature,
    Tie,
    Traction,
    VonMises,
)
from tests.contact.blocks_apart import blocks_apart

KINDS = ("plane", "plane", "axis", "plane", "space", "plane", "axis")
SEAM = ("lower_top", "upper_bottom")
BLOCKS = ("lower", "upper")


@dataclass(frozen=True)
class Case:
    """A problem, its description, and its limit load if it is known.

    Attributes:
        words: Description of the problem.
        problem: The problem.
        exact: The limit load; None if it is not known.
    """

    words: tuple[str, ...]
    problem: Problem
    exact: float | None


class _Draw:
    """A case under construction: random numbers, and the statements so far.

    Attributes:
        kind: "plane", "axis" or "space".
        known: Whether the limit load must be known.
        say: Function that adds a statement with a probability, and returns whether it did.
    """

    def __init__(self, seed: int) -> None:
        self.random = Random(seed)
        self.kind, self.known = KINDS[seed % len(KINDS)], seed % 3 == 0
        self.words: list[str] = [self.kind]
        self.gdim = 3 if self.kind == "space" else 2

    def say(self, words: str, chance: float) -> bool:
        """Return whether the case contains a statement."""
        said = self.random.random() < chance
        if said:
            self.words.append(words)
        return said

    def pick(self, words: Sequence[str]) -> str:
        """Return a random one of several values."""
        word = self.random.choice(words)
        self.words.append(word)
        return word

    def number(self, low: float, high: float) -> float:
        """Return a random number between two numbers."""
        return self.random.uniform(low, high)

    @property
    def down(self) -> str:
        """Return the index of the vertical axis."""
        return "xyz"[self.gdim - 1]

    def vector(self, across: float, down: float) -> list[float]:
        """Return a random downward force with a limited lateral part."""
        sides = [self.number(-across, across) for _ in range(self.gdim - 1)]
        return [*sides, -down]


def random_case(seed: int) -> Case:
    """Return a random case; every third case has a known limit load. Collective."""
    it = _Draw(seed)
    strengths = dict.fromkeys(BLOCKS, it.random.choice([1.0, it.number(0.5, 2.0)]))
    alike = it.say("of one strength", 0.5)
    if not alike:
        strengths["upper"] *= it.number(0.6, 1.6)
    seam = _seam(it, alike)
    plate = it.say("a rigid surface", 0.25)
    stiff = ""
    if plate and it.known:  # the other block can then widen freely
        stiff, seam = "upper", Contact(*SEAM)
        it.words.append("frictionless, and elastic above")
    elif it.say("an elastic body", 0.2) and not (it.known and _rubs(seam)):
        stiff = it.random.choice(BLOCKS)
    materials = {
        name: Elastic(1e3, 0.3, expansion=1e-5) if name == stiff else _metal(strength)
        for name, strength in strengths.items()
    }
    given: dict[str, Any] = {"materials": materials, "degree": 2, "contacts": [seam]}
    given["initial"] = _initial(it)
    supports, given["obstacles"], rigid = _held(it)
    straight = it.known or it.kind == "axis" or it.random.random() < 0.5
    held = "xyz"[: it.gdim - 1] if straight else ""
    if plate:
        rigid.append(RigidSurface("top", held=held))
        # supports must not hold any of its nodes
        supports = [one for one in supports if not one.on.startswith("upper")]
    given["supports"] = [*supports, *rigid]
    weakest = min(strength for name, strength in strengths.items() if name != stiff)
    given["loads"], exact = _loads(it, weakest, plate, held)
    mesh = _mesh(it, seam)
    return Case(tuple(it.words), Problem(mesh, **given), exact)


def _metal(strength: float) -> VonMises:
    return VonMises(1e3, 0.3, strength, expansion=1e-5)


def _rubs(seam: Contact | Tie) -> bool:
    """Return whether friction or a tie resists slip at a seam."""
    return isinstance(seam, Tie) or seam.tresca is not None or seam.coulomb is not None


def _mesh(it: _Draw, seam: Contact | Tie) -> Any:
    """Return blocks whose facets match or do not match."""
    apart = it.kind != "space" and it.say("meshed apart", 0.35)
    most = 2 if it.kind == "space" else 3
    count = it.random.randint(1 if it.kind == "space" else 2, most)
    lower, upper = [count] * it.gdim, [count + apart] * it.gdim
    flat = it.known or (isinstance(seam, Contact) and seam.gap is not None)
    slope = 0.0 if flat or not it.say("inclined", 0.4) else it.number(-0.3, 0.3)
    mesh = blocks_apart(MPI.COMM_WORLD, lower, upper, slope=slope, moved_by=0.5 * apart)
    return mesh.turned() if it.kind == "axis" else mesh


def _seam(it: _Draw, alike: bool) -> Contact | Tie:
    """Return a random connection between the blocks."""
    smooth = it.known and not alike
    what = it.pick(
        ("contact", "a gap", "a press fit")
        if smooth
        else (
            "contact",
            "a gap",
            "a press fit",
            "a tie",
            "Tresca",
            "Coulomb",
            "with adhesion",
            "associated",
        )
    )
    if what == "a tie":
        return Tie(*SEAM)
    more: dict[str, Any] = {
        "contact": {},
        "a gap": {"gap": 1e-3},
        "a press fit": {"gap": -1e-3, "interference": True},
        "Tresca": {"tresca": it.number(0.01, 0.8)},
        "Coulomb": {"coulomb": it.number(0.05, 0.4)},
        "with adhesion": {"coulomb": it.number(0.05, 0.4), "tresca": it.number(0.01, 0.4)},
        "associated": {"coulomb": it.number(0.05, 0.4), "associated": True},
    }[what]
    return Contact(*SEAM, **more)


def _initial(it: _Draw) -> list[Any]:
    """Return random initial stresses and temperatures, which do no work."""
    found: list[Any] = []
    if it.say("heat", 0.3):
        found.append(Temperature(it.random.choice(BLOCKS), "40*y"))
    if it.say("initial stress", 0.3):
        count = 6 if it.gdim == 3 else 4
        stress: list[Any] = [it.number(-0.3, 0.3) for _ in range(count)]
        stress[0] = "-0.3*x"
        found.append(InitialStress(it.random.choice(BLOCKS), stress))
    return found


def _held(it: _Draw) -> tuple[list[Support], list[Plane], list[RigidSurface]]:
    """Return random supports, planes and rigid surfaces that hold the blocks."""
    axes = "xy"[: it.gdim - 1] if it.kind != "axis" else ""
    supports = [Support(f"{side}{axis}0", axis) for side in ("", "upper_") for axis in axes]
    settles = 0.0 if not it.say("a settlement", 0.3) else -1e-3
    if it.say("a floor", 0.3):
        rubs = {} if it.known else {"tresca": it.number(0.0, 0.3)}
        normal = [0.0] * (it.gdim - 1) + [1.0]
        return supports, [Plane("bottom", [0.0] * it.gdim, normal, name="floor", **rubs)], []
    if it.kind == "plane" and it.say("a plate below that is turned", 0.2):
        given = {"displacement": (0.0, settles), "rotation": 1e-3}
        held = [one for one in supports if one.on.startswith("upper")]
        if it.known:
            return supports, [], [RigidSurface("bottom", components="y", **given)]
        return held, [], [RigidSurface("bottom", **given)]
    rough = not it.known and it.say("glued below", 0.6)
    down = "xyz" if rough and settles == 0.0 else it.down
    return [*supports, Support("bottom", down[: it.gdim] if rough else down, settles)], [], []


def _loads(it: _Draw, strength: float, plate: bool, held: str) -> tuple[list[Any], float | None]:
    """Return loads, and the factor at which blocks between smooth planes collapse."""
    loads: list[Any] = []
    side = 0.0
    if it.say("dead pressure aside", 0.4):
        side = strength * it.number(-0.6, 0.6)
        loads += [Pressure(on, side, constant=True) for on in ("x1", "upper_x1")]
    if it.kind == "space":
        exact = side / 2 + math.sqrt(strength**2 - 0.75 * side**2)
    else:
        exact = side + strength * (2 / math.sqrt(3) if it.kind == "plane" else 1.0)
    if it.say("dead load above", 0.4):
        dead = strength * it.number(-0.3, 1.5 if it.known else 0.9)
        exact -= dead
        value: Any = dead
        if plate:
            loads.append(Force("top", _down(it, dead), constant=True))
        else:
            loads.append(Pressure("top", value, constant=True))
    for name in BLOCKS:
        if it.say(f"pores of {name}", 0.25):
            value = it.random.choice([0.3, "0.2 + 0.1*x - 0.3*y"])
            stays = it.random.random() < 0.5
            loads.append(PorePressure(name, value, constant=stays))
    if it.kind != "space" and it.known and it.say("under water", 0.25):
        water = it.number(0.05, 0.4)
        loads += [BodyForce(name, [0.0, -water], constant=True) for name in BLOCKS]
        deep = f"{water!r}*(2 - y)"
        loads += [Pressure(on, deep, constant=True) for on in ("x1", "upper_x1")]
    if plate:
        loads.append(Force("top", _down(it, 1.0)))
    else:
        loads.append(Pressure("top", 1.0))
    if it.known:
        return loads, exact
    if it.say("pushed aside", 0.4):
        across = it.vector(0.3, 0.0)
        across[0] = across[0] if it.kind != "axis" else 0.0
        if not plate:
            loads.append(Traction("top", across))
        elif not held:
            loads.append(Force("top", across))
    if it.say("weight", 0.4):
        stays = it.random.random() < 0.6
        across = it.vector(0.0 if it.kind == "axis" else 0.1, it.number(0.0, 0.4))
        loads.append(BodyForce(it.random.choice(BLOCKS), across, constant=stays))
    if it.say("a linear pressure", 0.3):
        loads.append(Pressure("x1", f"0.2*y - {it.number(0.0, 0.2)!r}"))
    if it.say("a quadratic pressure", 0.03):
        loads.append(Pressure("x1", "0.1*y**2"))
    if plate and not held and it.say("a moment", 0.5):
        turn: Any = it.number(-0.1, 0.1)
        turn = turn if it.gdim == 2 else [turn, 0.0, 0.0]
        loads.append(Force("top", (), turn, point=[0.5] * (it.gdim - 1) + [2.0]))
    return loads, None


def _down(it: _Draw, pressure: float) -> list[float]:
    """Return the force of a pressure on top."""
    area = math.pi if it.kind == "axis" else 1.0
    return [0.0] * (it.gdim - 1) + [-area * pressure]
