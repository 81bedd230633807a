"""Test cases that are set up only by clicks, against the same cases written by hand.

Six drawings are STEP files by other authors, which are not in the repository. Debian has two of
them; the others must be in the folder that ``PERFPLAST_DRAWINGS`` names. The sources are:

- ``screw.step``, ``linkrods.step``: Open-Cascade-SAS/OCCT, in Debian's package opencascade;
- ``step_boundary_colors.stp``, ``component8.step``: examples of gmsh (gitlab.onelab.info);
- ``Welle.step``, ``part.step``: calculix/CalculiX-Examples (``Test/Supports1``, ``CAD``).
"""

import json
import os
import time
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from perfplast_fenicsx.__main__ import main
from perfplast_fenicsx.cli.parser import SOLVED
from tests.functional.browser_page import alone
from tests.functional.test_setup_page import SetupPage, in_scene

pytestmark = [alone, pytest.mark.long, pytest.mark.usefixtures("undrawn")]

ROOT = Path(__file__).parents[2]

FOLDERS = [ROOT / "docs", ROOT / "docs" / "gallery", Path("/usr/share/opencascade/data/step")]
FOLDERS += [Path(name) for name in [os.environ.get("PERFPLAST_DRAWINGS")] if name]

SEEN = """(() => {
  const number = data.setup.faces.find((one) => one.name === NAME).number;
  const all = [...faces.keys()].filter((t) => faces[t] === number);
  const some = all.filter((_, k) => k % Math.ceil(all.length / 12) === 0);
  const corners = (t) => [0, 1, 2].map((i) => points.subarray(3 * triangles[3 * t + i]));
  const middles = new Map(some.map((t) => [t, [0, 1, 2].map((k) =>
    corners(t).reduce((sum, corner) => sum + corner[k] / 3, 0))]));
  const normals = new Map(some.map((t) => {
    const [a, b, c] = corners(t);
    const [u, v] = [b, c].map((end) => [0, 1, 2].map((k) => end[k] - a[k]));
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    return [t, n.map((one) => one / Math.hypot(...n))];
  }));
  const { clientWidth: width, clientHeight: height } = document.getElementById("canvas");
  const held = { mesh, motion: new Float32Array(points.length) };
  const views = [];
  for (let right = -18; right <= 18; right++) {
    for (let up = -6; up <= 11; up++) views.push([right, up]);
  }
  views.sort((a, b) => Math.abs(a[0]) + Math.abs(a[1]) - Math.abs(b[0]) - Math.abs(b[1]));
  for (const [right, up] of data.plane ? [[0, 0]] : views) {
    const from = new Camera(points, data.plane, 0.12 * data.size, []);
    from.orbit(10 * right, -10 * up);
    const look = { camera: from, amount: 0, hidden: new Set(), cut: [0, 0, 0, 1] };
    const scale = from.half(width, height) / (height / 2);
    const towards = from.axes[2];
    const cosine = (t) => normals.get(t).reduce((sum, a, k) => sum + a * towards[k], 0);
    const facing = data.plane ? some : some.filter((t) => cosine(t) > 0.3);
    for (const t of facing.slice(0, 4)) {
      const middle = middles.get(t);
      const [x, y] = from.axes.slice(0, 2).map((axis) =>
        Math.round(axis.reduce((sum, a, k) => sum + a * (middle[k] - from.centre[k]), 0) / scale));
      if (Math.abs(x) > 0.45 * width || Math.abs(y) > 0.45 * height) continue;
      const found = Drawing.prototype.pick.call(held, look, scale * x, scale * y);
      if (found >= 0 && faces[found] === number) return [right, up, x, -y];
    }
  }
  return null;
})()"""
"""Number of quarter turns by key that shows a face, and the position of the face on the canvas."""


class Hand(SetupPage):
    """Control the page as a user does, by clicks and text, and count clicks and texts."""

    def __init__(self, browser: Any, path: Path) -> None:
        super().__init__(browser, path)
        self.wait("document.getElementById('drawn').dataset.ready === ''")
        self.clicks = self.texts = 0
        self._began = time.monotonic()

    @property
    def seconds(self) -> float:
        """Return the seconds since the page was ready."""
        return time.monotonic() - self._began

    def _idle(self) -> None:
        self.wait("document.getElementById('cards').ariaBusy === 'false'")

    def click(self, element: Any) -> None:
        self._idle()
        element.click()
        self.clicks += 1

    def press(self, *names: str) -> None:
        for name in names:
            self._idle()
            self.click(self._browser.find_element("xpath", f"//button[normalize-space()='{name}']"))

    def select(self, name: str, value: str) -> None:
        """Open a list, and click one of its options."""
        from selenium.webdriver.support.ui import Select

        self._idle()
        Select(self.part(name)).select_by_value(value)
        self.clicks += 2

    def write(self, name: str, text: str) -> None:
        """Click a field, replace its text, and leave the field."""
        self._idle()
        self.type(name, text)
        self.clicks += 1
        self.texts += 1

    def face(self, name: str) -> None:
        """Turn the bodies by keys until a face is visible, and click the face in the picture."""
        from selenium.webdriver import ActionChains, Keys

        self._idle()
        canvas = self.part("canvas")
        self._browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", canvas)
        seen = in_scene(self._browser, SEEN.replace("NAME", json.dumps(name)))
        assert seen, f"{name} is seen from nowhere"
        right, up, x, y = seen
        turn = (Keys.ARROW_RIGHT if right > 0 else Keys.ARROW_LEFT) * abs(right)
        tilt = (Keys.ARROW_UP if up > 0 else Keys.ARROW_DOWN) * abs(up)
        canvas.send_keys("0" + turn + tilt)
        self.clicks += abs(right) + abs(up)
        ActionChains(self._browser).move_to_element_with_offset(canvas, x, y).click().perform()
        self.clicks += 1
        self.wait(f"document.getElementById('chosen').textContent.includes({json.dumps(name)})")

    def entry(self, kind: str, *faces: str, **fields: str) -> None:
        """Choose faces, fill in the form for an entry, and send it."""
        listed = self("JSON.parse(document.getElementById('data').textContent).setup.faces")
        single = {one["name"] for one in listed}
        for name in faces:
            if name in single:
                self.face(name)
            else:
                self.select("choose", name)
        self.select("kind", kind)
        for name, text in fields.items():
            if self.part(f"add-{name}").tag_name == "select":
                self.select(f"add-{name}", text)
            else:
                self.part(f"add-{name}").send_keys(text)
                self.clicks += 1
                self.texts += 1
        self.press("Add")

    def key(self, card: str, key: str, text: str) -> None:
        """Add a key to a card, and give it a value."""
        self.select(f"{card}-more", key)
        self._idle()
        if self.part(f"{card}-{key}").tag_name == "select":
            self.select(f"{card}-{key}", text)
        else:
            self.write(f"{card}-{key}", text)


@dataclass(frozen=True)
class Clicked:
    """A case by clicks, and the same case by hand.

    Attributes:
        drawing: Name of the file.
        size: Size of elements that ``perfplast mesh`` is given.
        clicks: Clicks and entries of a user on the page.
        by_hand: The case as one writes it, without title, geometry and element.
        steel: Whether ``perfplast mesh`` is given a material.
    """

    drawing: str
    size: float
    clicks: Callable[[Hand], None]
    by_hand: str
    steel: bool = True

    @property
    def name(self) -> str:
        """Return the name of the drawing, which is the title of the first case."""
        return Path(self.drawing).stem


ONE_MESH = "{ until = 0.5, cells = 100 }"
"""With more cells than this, only the first mesh is solved."""


def prop(hand: Hand) -> None:
    hand.entry("support", "beam_x_low", "block_z_low")
    hand.entry("pressure", "beam_z_high", pressure="1.0")


def cube(hand: Hand) -> None:
    hand.entry("support", "part_z_low")
    hand.entry(
        "traction", "part_green", **{"traction-x": "1", "traction-y": "0", "traction-z": "-2"}
    )
    hand.entry("pressure", "part_blue", pressure="10", constant="true")


def nut(hand: Hand) -> None:
    hand.entry("support", "rhino_product_face_1", components='"normal"')
    hand.entry("support", "rhino_product_cylinder_17")
    hand.entry("pressure", "rhino_product_face_5", "rhino_product_face_8", pressure="1.5")


def screw(hand: Hand) -> None:
    hand.entry("support", "part_face_10")
    hand.entry(
        "traction", "part_face_1", **{"traction-x": "1", "traction-y": "0", "traction-z": "0"}
    )


def rods(hand: Hand) -> None:
    hand.entry("support", "part_face_36", "part_face_37")
    hand.entry(
        "traction", "part_face_38", **{"traction-x": "0", "traction-y": "0.5", "traction-z": "0"}
    )


def shaft(hand: Hand) -> None:
    hand.entry("support", "welle_x_low", "welle_face_11")
    hand.entry("face", "welle_x_high", "welle_face_12", name="end")
    hand.select("kind", "force")
    for axis, number in zip("xyz", ("0", "0", "-1000"), strict=True):
        hand.part(f"add-force-{axis}").send_keys(number)
        hand.clicks, hand.texts = hand.clicks + 1, hand.texts + 1
    hand.press("Add")


def bracket(hand: Hand) -> None:
    hand.entry("support", "part_1_z_low")
    hand.entry(
        "traction", "part_1_z_high", **{"traction-x": "0", "traction-y": "0", "traction-z": "-1"}
    )
    gravity = {"acceleration-x": "0", "acceleration-y": "0", "acceleration-z": "-9810"}
    hand.entry("gravity", **gravity, **{"density-part_1": "7.85e-9"})


def ground(hand: Hand, body: str, cohesion: str, friction: str) -> None:
    """Define a body of ground by clicks."""
    card = f"e-material-{body}-"
    hand.select(f"{card}-law", "mohr-coulomb")
    hand.write(f"{card}-young", "30000.0")
    hand.write(f"{card}-poisson", "0.3")
    hand.key(card, "cohesion", cohesion)
    hand.key(card, "friction_angle", friction)


def concrete(hand: Hand, body: str) -> None:
    """Define an elastic body of concrete by clicks."""
    card = f"e-material-{body}-"
    hand.select(f"{card}-law", "elastic")
    hand.write(f"{card}-young", "3e7")
    hand.write(f"{card}-poisson", "0.2")


def sides(hand: Hand, body: str) -> None:
    """Hold the base of the ground by clicks, and let its sides move down."""
    hand.entry("support", f"{body}_y_low")
    hand.entry("support", f"{body}_x_low", f"{body}_x_high", components='"x"')


def weights(hand: Hand, **densities: str) -> None:
    named = {f"density-{body}": number for body, number in densities.items()}
    hand.entry("gravity", **{"acceleration-x": "0", "acceleration-y": "-1"}, **named)


def footing(hand: Hand) -> None:
    ground(hand, "ground", "10.0", "25.0")
    concrete(hand, "footing")
    sides(hand, "ground")
    hand.entry("pressure", "footing_y_high", pressure="100.0", constant="true")
    weights(hand, ground="18.0", footing="24.0")
    hand.select("question", "strength")
    hand.press("Ask this")


def wall(hand: Hand) -> None:
    ground(hand, "ground", "5.0", "25.0")
    concrete(hand, "wall")
    hand.press("Contact instead")
    hand.key("e-contact-0", "coulomb", "0.3")
    hand.key("e-contact-0", "associated", "true")
    sides(hand, "ground")
    weights(hand, ground="18.0", wall="24.0")
    hand.select("question", "strength")
    hand.press("Ask this")


def slope(hand: Hand) -> None:
    for key, text in (("young", "20000.0"), ("poisson", "0.45"), ("yield_stress", "86.6025")):
        hand.write(f"e-material-clay--{key}", text)
    sides(hand, "clay")
    hand.entry("pressure", "clay_face_6", pressure="1.0")
    weights(hand, clay="18.0")


def dovetail(hand: Hand) -> None:
    hand.press("Contact instead")
    hand.entry("support", "disc_y_low", components='"y"')
    hand.entry("support", "disc_x_low", components='"x"')
    hand.entry("pressure", "blade_y_high", pressure="-1.0")


def steel(*bodies: str, fine: bool = False) -> str:
    """Return materials and the other entries of a first case in steel, as written by hand.

    Args:
        bodies: The bodies.
        fine: Whether the first mesh is so fine that it is the only one.
    """
    keys = 'law = "von-mises", young = 210000.0, poisson = 0.3, yield_stress = 235.0'
    materials = "\n".join(f"material.{body} = {{ {keys} }}" for body in bodies)
    asked = 'loading = { control = "bounds", limit_tolerance = 5e-3 }'
    asked = 'loading.control = "bounds"' if fine else f"{asked}\nmesh.adapt = {ONE_MESH}"
    return f'{materials}\n{asked}\nunits.system = "mm-N-MPa"\n'


def plane(body: str, asked: str = "") -> str:
    """Return supports and the other entries of a first case in ground, as written by hand."""
    held = f'''
support = [
  {{ on = "{body}_y_low" }},
  {{ on = "{body}_x_low", components = "x" }},
  {{ on = "{body}_x_high", components = "x" }},
]
'''
    asked = asked or 'loading = { control = "bounds", limit_tolerance = 5e-3 }'
    return f'{held}{asked}\nunits.system = "m-kN-kPa"\nmesh.adapt = {ONE_MESH}\n'


STRENGTH = 'loading = { control = "strength", limit_tolerance = 5e-3 }'

CLAY = (
    'material.clay = { law = "von-mises", young = 20000.0, poisson = 0.45, yield_stress = 86.6025 }'
)

CONCRETE = '{ law = "elastic", young = 3e7, poisson = 0.2 }'


def soil(cohesion: float, friction: float) -> str:
    strength = f"cohesion = {cohesion}, friction_angle = {friction}"
    return f'{{ law = "mohr-coulomb", young = 30000.0, poisson = 0.3, {strength} }}'


CASES = [
    Clicked(
        "prop.step",
        60.0,
        prop,
        steel("beam", "block")
        + """
support = [{ on = "beam_x_low" }, { on = "block_z_low" }]
load = [{ on = "beam_z_high", pressure = 1.0 }]
contact = [{ primary = "beam_joint_1", secondary = "block_joint_1" }]
""",
    ),
    Clicked(
        "step_boundary_colors.stp",
        40.0,
        cube,
        steel("part")
        + """
support = [{ on = "part_z_low" }]
load = [
  { on = "part_green", traction = [1, 0, -2] },
  { on = "part_blue", pressure = 10, constant = true },
]
""",
    ),
    Clicked(
        "component8.step",
        10.0,
        nut,
        steel("rhino_product")
        + """
support = [
  { on = "rhino_product_face_1", components = "normal" },
  { on = "rhino_product_cylinder_17" },
]
load = [{ on = "loaded_1", pressure = 1.5 }]
geometry.face = [
  { name = "loaded_1", faces = ["rhino_product_face_5", "rhino_product_face_8"] },
]
""",
    ),
    Clicked(
        "screw.step",
        6.0,
        screw,
        steel("part")
        + """
support = [{ on = "part_face_10" }]
load = [{ on = "part_face_1", traction = [1, 0, 0] }]
""",
    ),
    Clicked(
        "linkrods.step",
        0.6,
        rods,
        steel("part", fine=True)
        + """
support = [{ on = "part_face_36" }, { on = "part_face_37" }]
load = [{ on = "part_face_38", traction = [0, 0.5, 0] }]
""",
    ),
    Clicked(
        "Welle.step",
        20.0,
        shaft,
        steel("welle")
        + """
support = [{ on = "welle_x_low" }, { on = "welle_face_11" }]
load = [{ on = "end", force = [0, 0, -1000] }]
geometry.face = [{ name = "end", faces = ["welle_x_high", "welle_face_12"] }]
""",
    ),
    Clicked(
        "part.step",
        20.0,
        bracket,
        steel("part_1")
        + """
support = [{ on = "part_1_z_low" }]
load = [{ on = "part_1_z_high", traction = [0, 0, -1] }]
gravity = { acceleration = [0, 0, -9810], density = { part_1 = 7.85e-9 } }
""",
    ),
    Clicked(
        "footing.geo",
        2.0,
        footing,
        plane("ground", STRENGTH)
        + f"""
material = {{ ground = {soil(10.0, 25.0)}, footing = {CONCRETE} }}
load = [{{ on = "footing_y_high", pressure = 100.0, constant = true }}]
gravity = {{ acceleration = [0, -1], density = {{ ground = 18.0, footing = 24.0 }} }}
tie = [{{ primary = "ground_joint_1", secondary = "footing_joint_1" }}]
""",
        steel=False,
    ),
    Clicked(
        "retaining_wall.geo",
        2.0,
        wall,
        plane("ground", STRENGTH)
        + f"""
material = {{ ground = {soil(5.0, 25.0)}, wall = {CONCRETE} }}
gravity = {{ acceleration = [0, -1], density = {{ ground = 18.0, wall = 24.0 }} }}

[[contact]]
primary = "ground_joint_1"
secondary = "wall_joint_1"
coulomb = 0.3
associated = true
""",
        steel=False,
    ),
    Clicked(
        "slope.geo",
        2.0,
        slope,
        plane("clay")
        + f"""
{CLAY}
load = [{{ on = "clay_face_6", pressure = 1.0 }}]
gravity = {{ acceleration = [0, -1], density = {{ clay = 18.0 }} }}
""",
        steel=False,
    ),
    Clicked(
        "dovetail.geo",
        3.0,
        dovetail,
        steel("blade", "disc")
        + """
support = [{ on = "disc_y_low", components = "y" }, { on = "disc_x_low", components = "x" }]
load = [{ on = "blade_y_high", pressure = -1.0 }]
contact = [
  { primary = "blade_joint_1", secondary = "disc_joint_1" },
]
""",
    ),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_clicks_make_the_case_that_a_hand_writes(
    case: Clicked,
    tmp_path: Path,
    browser: Any,
    capsys: pytest.CaptureFixture[str],
    record_property: Callable[[str, object], None],
) -> None:
    """The tables agree, the page sends no request, and a run gives the same bounds."""
    drawing = next((one / case.drawing for one in FOLDERS if (one / case.drawing).exists()), None)
    if drawing is None:
        pytest.skip(f"{case.drawing} is not here; PERFPLAST_DRAWINGS names its folder")
    folder = tmp_path / "case"
    options = [
        "--size",
        str(case.size),
        "--trust",
        "--patience",
        "600",
        *(["--material", "s235"] * case.steel),
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("perfplast_fenicsx.cli.mesh_command.draw_parts", lambda *of: None)
        assert main(["mesh", str(drawing), "-o", str(folder), *options]) == SOLVED

    hand = Hand(browser, folder / "setup.html")
    case.clicks(hand)
    if "adapt" in tomllib.loads(hand.case).get("mesh", {}):  # the fine first mesh is the only mesh
        hand.write("e-mesh--adapt", ONE_MESH)
    if not case.steel:
        hand.select("e-units--system", "m-kN-kPa")
    hand.wait("document.querySelector('#left .wrong') === null")
    saved = saved_by(hand, browser, tmp_path / "saved")
    record_property("clicks", hand.clicks)
    record_property("texts", hand.texts)
    record_property("seconds", round(hand.seconds, 1))
    with capsys.disabled():
        print(f" {hand.clicks} clicks and keys, {hand.texts} texts, {hand.seconds:.1f} s", end=" ")

    clicked, first = tomllib.loads(saved), tomllib.loads((folder / "case.toml").read_text("utf-8"))
    written = tomllib.loads(case.by_hand)
    written |= {key: first[key] for key in ("title", "element")}
    written["geometry"] = first["geometry"] | written.get("geometry", {})
    assert clicked == written
    assert requests(browser) == {"file": 1}

    paths = {"clicked": saved, "by_hand": by_hand(case, folder)}
    told = []
    for name, text in paths.items():
        path = folder / f"{name}.toml"
        path.write_text(text, encoding="utf-8")
        capsys.readouterr()
        assert main(["check", str(path), "--trust"]) == SOLVED
        lines = capsys.readouterr().out.splitlines()
        told.append([line for line in lines if line.startswith("  ")])
    assert told[0] == told[1]
    assert len(told[0]) >= 2
    pairs = [bounds_of(folder / name, folder / f"{name}.toml") for name in paths]
    assert pairs[0] == pytest.approx(pairs[1], rel=1e-9)
    assert 0 < pairs[0][0] < pairs[0][1]


def bounds_of(results: Path, case: Path) -> tuple[float, float]:
    """Run a case, and return both bounds."""
    assert main(["run", str(case), "-o", str(results), "--trust"]) == SOLVED
    limit = json.loads((results / "summary.json").read_text(encoding="utf-8"))["limit"]
    found = limit.get("strength") or limit["body"]
    return found["lower"], found["upper"]


def by_hand(case: Clicked, folder: Path) -> str:
    """Return the case as a user writes it, with the drawing of the first case."""
    first = tomllib.loads((folder / "case.toml").read_text(encoding="utf-8"))
    keys = {"file": first["geometry"]["file"], "size": case.size}
    geometry = "\n".join(f"geometry.{key} = {json.dumps(value)}" for key, value in keys.items())
    return f"element.degree = 2\n{geometry}\n{case.by_hand}"


def saved_by(hand: Hand, browser: Any, folder: Path) -> str:
    """Press the button, and return the file that the browser has saved."""
    browser.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(folder)}
    )
    hand.press("Save case.toml")
    for _ in range(600):
        if (folder / "case.toml").exists():
            break
        hand.pixels()  # wait for two frames
    text = (folder / "case.toml").read_text(encoding="utf-8")
    assert text == hand.case
    return text


def requests(browser: Any) -> dict[str, int]:
    """Return the number of requests from the page, by the kind of their address."""
    assert [line["message"] for line in browser.get_log("browser")] == []
    messages = [json.loads(line["message"])["message"] for line in browser.get_log("performance")]
    sent = [
        message["params"]["request"]["url"].split(":")[0]
        for message in messages
        if message["method"] == "Network.requestWillBeSent"
    ]
    return {kind: sent.count(kind) for kind in set(sent) - {"data", "blob"}}
