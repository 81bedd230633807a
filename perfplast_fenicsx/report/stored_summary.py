"""Check, before a page is made, the parts of ``summary.json`` that the page needs.

An error after these checks is a fault of the program, not of the file.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NotRequired, TypedDict

import msgspec

from perfplast_fenicsx.pictures.result_reader import ResultReader


class _Mesh(TypedDict):
    cells: int
    vertices: int
    dofs: int


class _Model(TypedDict):
    kind: str
    axes: str
    forces: str


class _Material(TypedDict):
    kind: str
    body: NotRequired[dict[str, Any] | None]


class _Support(TypedDict):
    on: str
    components: str
    value: float
    constant: bool


class _Rigid(TypedDict):
    on: str
    displacement: list[float]
    rotation: Any
    held: NotRequired[str]


class _Load(TypedDict):
    kind: str
    on: str
    value: Any
    constant: bool


class _Initial(TypedDict):
    kind: str
    on: str
    change: NotRequired[Any]
    stress: NotRequired[Any]
    preload: NotRequired[Any]


class _Contact(TypedDict):
    primary: str
    secondary: str
    gap: float | str | None


class _Obstacle(TypedDict):
    kind: str
    on: str
    move: NotRequired[list[float] | None]


class _Tie(TypedDict):
    primary: str
    secondary: str


class _Given(TypedDict, total=False):
    materials: dict[str, _Material]
    supports: list[_Support]
    loads: list[_Load]
    contacts: list[_Contact]
    obstacles: list[_Obstacle]
    initial: list[_Initial]
    ties: list[_Tie]
    rigid: list[_Rigid]


class _Step(TypedDict):
    converged: bool
    zeta: float
    reactions: dict[str, list[float]]


class _Round(TypedDict):
    cells: int
    lower: float | None
    upper: float | None
    gap: float | None


class _Least(TypedDict):
    in_words: str


class _Body(TypedDict):
    lower: float | None
    upper: float | None
    least: NotRequired[_Least | None]
    why_not: list[str]
    friction: NotRequired[str | None]
    taken: NotRequired[list[str]]
    meshes: list[_Round]


class _Drucker(TypedDict):
    words: str


class _Loaded(TypedDict):
    name: str
    on: str
    constant: bool
    force: list[float]
    moment: list[float]


class _Forces(TypedDict):
    zeta: float
    strict: NotRequired[bool]
    reactions: dict[str, list[float]]
    moments: dict[str, list[float]]


class _Design(TypedDict):
    in_words: str


class _Times(TypedDict):
    factor: float
    lower: float | None
    upper: float | None


class _PathPoint(TypedDict):
    factor: float
    work: float


class _StrengthPath(TypedDict):
    in_words: str
    points: list[_PathPoint]


class _Strength(TypedDict):
    lower: float | None
    upper: float | None
    curve: list[_Times]
    cells: NotRequired[list[int]]
    estimate: NotRequired[bool]
    path: NotRequired[_StrengthPath | None]


class _Degree(TypedDict):
    angle: float


class _Envelope(TypedDict):
    names: list[str]
    directions: list[list[float]]
    gap: float | None
    rows: list[_Degree]
    in_words: str


class _Shakedown(TypedDict):
    names: list[str]
    corners: list[list[float]]
    load: float | None
    koiter: float | None
    accumulated: float | None
    failure: str
    within_cells: bool
    diagram: list[_Degree]
    in_words: str


class _Limit(TypedDict):
    lower: float | None
    estimate: float | None
    upper: float | None
    levelled_off: bool
    reason: str
    theorem: NotRequired[bool]
    drucker: NotRequired[_Drucker | None]
    body: NotRequired[_Body | None]
    next_steps: NotRequired[list[str]]
    forces: NotRequired[_Forces | None]
    design: NotRequired[_Design | None]
    answer: NotRequired[str]
    strength: NotRequired[_Strength | None]
    envelope: NotRequired[_Envelope | None]
    shakedown: NotRequired[_Shakedown | None]


class _Case(TypedDict, total=False):
    file: str
    text: str


class _Head(TypedDict, total=False):
    project: str
    number: str
    author: str
    client: str
    revision: str
    prepared: str
    checked: str
    approved: str


class _Surroundings(TypedDict, total=False):
    versions: dict[str, str]
    petsc_options: str
    command: str
    began: str


class _Summary(TypedDict):
    mesh: _Mesh
    model: _Model
    given: _Given
    case: _Case
    report: NotRequired[_Head]
    surroundings: _Surroundings
    loads: NotRequired[list[_Loaded]]
    remarks: NotRequired[list[str]]
    warnings: NotRequired[list[str]]
    steps: list[_Step]
    limit: _Limit | None


def _missing(summary: _Summary) -> Iterator[str]:
    """Yield the names of missing data that other data require."""
    if 0 < len(summary["case"]) < len(_Case.__annotations__):
        yield "file, or text, of the case"
    for material in summary["given"].get("materials", {}).values():
        if material["kind"] == "Flow" and "kind" not in (material.get("body") or {}):
            yield "kind of a material with a history"
    for first in summary["given"].get("initial", []):
        key = {"temperature": "change", "bolt": "preload"}.get(first["kind"], "stress")
        if key not in first:
            yield f"{key} on {first['on']}"


def check_summary(reader: ResultReader) -> None:
    """Check that ``summary.json`` has the data that a page needs.

    Raises:
        InputError: If data are missing.
    """

    def check(path: Path) -> None:
        try:
            summary = msgspec.json.decode(path.read_bytes(), type=_Summary)
        except msgspec.DecodeError as error:
            raise ValueError(error) from error
        if what := next(_missing(summary), None):
            raise ValueError(f"it has no {what}")

    reader.read("summary.json", check)
