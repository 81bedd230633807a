"""Test the checker's results for a factor that divides strengths."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from perfplast_fenicsx import DruckerPrager
from perfplast_fenicsx.materials.drucker_prager import Match
from perfplast_fenicsx.proof.__main__ import PAIR, main
from perfplast_fenicsx.proof.body import Body
from perfplast_fenicsx.proof.checker import check_pair
from perfplast_fenicsx.proof.cone_shapes import strengths_of
from perfplast_fenicsx.proof.halves import differences
from perfplast_fenicsx.proof.plain_arrays import ProofError
from perfplast_fenicsx.proof.reduction import KEPT, division_of, reduction_of, reduction_words
from tests.proof.forging import Arrays, Halves, blocks, copied, write
from tests.proof.small_bodies import with_velocity
from tests.proof.test_balance import row_of_cubes, strip


@pytest.fixture(scope="module")
def half(tmp_path_factory: pytest.TempPathFactory) -> Arrays:
    """Return a half for two blocks with yield stresses 1 and 3, without a factor."""
    return blocks(tmp_path_factory.mktemp("reduction"), 2)["lower"]


def test_strengths_before_they_are_divided(half: Arrays) -> None:
    body = Body.of(half)
    assert reduction_words(body, half) == []
    (told,) = reduction_words(body, {**half, "strength_factor": np.array(2.0)})
    radii = np.sqrt(2 / 3) * np.array([1.0, 3.0])
    for radius in radii:
        assert f"a yield radius of {2 * radius:.6g}" in told
    assert "Not divided" not in told
    kept = body.cone == body.cone[0]
    (told,) = reduction_words(body, {**half, "strength_factor": np.array(2.0), "cell_kept": kept})
    mine = body.yield_radius[0]
    assert f"a yield radius of {2 * mine:.6g}" not in told
    assert f"Not divided: strengths in a volume of {body.volumes[kept].sum():.6g}." in told
    rubs = {**half, "contact_adhesion": np.array([0.5]), "contact_friction": np.array([0.2])}
    (told,) = reduction_words(Body.of(rubs), {**rubs, "strength_factor": np.array(1.5)})
    assert "an adhesion of 0.75 and a friction of 0.3" in told
    kept = np.array([True])
    (told,) = reduction_words(
        Body.of(rubs), {**rubs, "strength_factor": np.array(1.5), "contact_kept": kept}
    )
    assert "friction on surface" in told


def without_factor(them: Arrays) -> None:
    del them["strength_factor"]


def too_few(them: Arrays) -> None:
    them["cell_kept"] = them["cell_kept"][1:]


def in_some_cells(them: Arrays) -> None:
    them["cell_kept"][0] = 1


def negative(them: Arrays) -> None:
    them["strength_factor"] = np.array(-1.0)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (without_factor, "strength_factor, which is missing"),
        (too_few, "the shape of cell_kept"),
        (in_some_cells, "in some cells but not in others"),
        (negative, "strength_factor is not positive"),
    ],
)
def test_what_fits_no_bodies_is_refused(
    half: Arrays, change: Callable[[Arrays], None], named: str
) -> None:
    them = {**half, "strength_factor": np.array(2.0)}
    them["cell_kept"] = np.zeros(len(half["cells"]), dtype=np.uint8)
    change(them)
    with pytest.raises(ProofError, match=named):
        reduction_words(Body.of(half), them)


@pytest.fixture(scope="module")
def sides(tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return both sides of a factor of safety of two blocks: reduced strengths carry the loads."""
    halves = blocks(tmp_path_factory.mktemp("sides"), 2)
    for kind, half in halves.items():
        bound = float(half["bound"])
        factor = bound * (1 - 1e-9 if kind == "lower" else 1 + 1e-9)
        half["strength_factor"] = np.array(factor)
        half["cone_bound"] = half["cone_bound"] / factor
        half["bound"] = np.array(1.0)
        if kind == "lower":
            half["stress"] = half["stress"] / bound
    return halves


def pair_of(sides: Halves, folder: Path) -> tuple[Path, Path]:
    """Write both sides into separate files."""
    stands, falls = folder / "stands.h5", folder / "falls.h5"
    write(stands, {"lower": sides["lower"]})
    write(falls, {"upper": sides["upper"]})
    return stands, falls


def scaled(name: str, factor: float) -> Callable[[Arrays], None]:
    """Return a function that multiplies an array."""

    def change(them: Arrays) -> None:
        them[name] = them[name] * factor

    return change


def half_as_much(them: Arrays) -> None:
    them["bound"] = them["bound"] / 2
    them["stress"] = them["stress"] / 2


def with_kept_cells(them: Arrays) -> None:
    """Mark the second block as not reduced."""
    kept = them["cone"] != them["cone"][0]
    them["cell_kept"] = kept.astype(np.uint8)


def moved(them: Arrays) -> None:
    them["vertices"] = them["vertices"] + 1e-3


def held_elsewhere(them: Arrays) -> None:
    them["held"] = np.roll(them["held"], 1, axis=0)


def renamed(them: Arrays) -> None:
    them["surface"] = np.where(them["surface"] == 0, 9, them["surface"])


PAIRS: dict[str, tuple[str, Callable[[Arrays], None], str]] = {
    "stronger from below": ("lower", scaled("cone_bound", 1.001), "weaker bodies"),
    "weaker from above": ("upper", scaled("cone_bound", 0.999), "weaker bodies"),
    "another factor from below": ("lower", scaled("strength_factor", 1.01), "weaker bodies"),
    "another factor from above": ("upper", scaled("strength_factor", 0.99), "weaker bodies"),
    "less load": ("lower", scaled("traction", 0.99), "loads"),
    "less weight": ("lower", scaled("body_force", 0.99), "loads"),
    "another place": ("lower", moved, "position"),
    "other supports": ("upper", held_elsewhere, "supports"),
    "other surfaces": ("upper", renamed, "surfaces"),
    "strengths that stay": ("upper", with_kept_cells, "weaker bodies"),
    "too little of the load": ("lower", half_as_much, "does not carry"),
    "too much dissipation": ("upper", scaled("bound", 2.0), ""),
}


def test_both_sides_of_a_factor_of_safety(sides: Halves, tmp_path: Path) -> None:
    found = check_pair(*pair_of(sides, tmp_path))
    assert not found.faults
    assert found.carried == pytest.approx(float(sides["lower"]["strength_factor"]))
    assert found.not_carried == pytest.approx(float(sides["upper"]["strength_factor"]))
    assert main([PAIR, *map(str, pair_of(sides, tmp_path))]) == 0


@pytest.mark.parametrize("name", PAIRS)
def test_sides_of_other_bodies_are_no_factor(sides: Halves, tmp_path: Path, name: str) -> None:
    forged = copied(sides)
    kind, change, why = PAIRS[name]
    change(forged[kind])
    paths = pair_of(forged, tmp_path)
    found = check_pair(*paths)
    if not why:  # a bound that is smaller than the claim is still proven
        assert not found.faults
        return
    assert why in "; ".join(found.faults)
    assert main([PAIR, *map(str, paths)]) == 1


def test_files_that_are_no_pair_are_refused(sides: Halves, tmp_path: Path) -> None:
    stands, falls = pair_of(sides, tmp_path)
    assert main([PAIR, str(stands)]) == 2
    with pytest.raises(ProofError, match="lower half of a factor of safety"):
        check_pair(falls, stands)
    whole = copied(sides)
    del whole["upper"]["strength_factor"]
    with pytest.raises(ProofError, match="no strength_factor"):
        check_pair(*pair_of(whole, tmp_path))


@pytest.mark.parametrize("factor", [0.3, 1.0, 1.7])
def test_ground_before_its_strength_is_divided(factor: float) -> None:
    """Cohesion and tan φ of both kinds of cones, and the tensile strength, are multiplied."""
    whole, _ = principal_cell(2.0, 0.7, 0.5)
    reduced, _ = principal_cell(2.0 / factor, 0.7 / factor, 0.5 / factor)
    kept = dict(zip(KEPT, (np.zeros(n, dtype=bool) for n in (2, 0, 0)), strict=True))
    divisions = division_of(Body.of(reduced), factor, kept), division_of(Body.of(whole), 1.0, kept)
    bodies = Body.of(reduced), Body.of(whole)
    found, expected = strengths_of(*bodies, divisions=divisions)
    assert (found.family == expected.family).all()
    assert found.slope == pytest.approx(expected.slope)
    assert found.bound == pytest.approx(expected.bound)
    assert expected.slope == pytest.approx([0.7, 0.7])
    assert expected.bound[0] == pytest.approx(2 * 2.0)


def principal_cell(cohesion: float, tangent: float, tension: float) -> tuple[Arrays, float]:
    """Return a square of two cells, one with Mohr–Coulomb's cone, one with the plane cone."""
    cosine = 1 / np.sqrt(1 + tangent**2)
    sine = tangent * cosine
    them = strip(1.0, 1)
    deviator = them["cone_matrix"][0]
    unit = np.array([1.0, 1.0, 0.0])
    them["cone"] = np.array([0, 1])
    them["cone_bound"] = cohesion * cosine * np.array([2.0, np.sqrt(2.0)])
    them["cone_slope"] = np.array([0 * unit, np.sqrt(2.0) * sine * unit / 2])
    them["cone_matrix"] = np.array([0 * deviator, deviator])
    them["cone_sine"] = np.array([sine, np.nan])
    them["cone_tension"] = np.array([tension, np.nan])
    return them, sine


MATCHES: tuple[Match, ...] = ("plane-strain", "compression", "extension")

CARRIED, NOT_CARRIED = 1.0, 10.0
"""Factors for which ground with c = 0.2 and φ = 20° carries, and does not carry, a pressure."""


def pressed_cube(kind: str, match: Match) -> Arrays:
    """Return a half of a cube of Drucker–Prager ground on rollers, under a pressure of 0.25."""
    factor = CARRIED if kind == "lower" else NOT_CARRIED
    ground = DruckerPrager(1e4, 0.3, 0.2, 20.0, match).divided_by(factor)
    eta, strength = ground.cone
    them = row_of_cubes(1)
    points, cells = them["vertices"][them["facets"]], them["cells"]
    deviator, slope = np.eye(6), np.zeros(6)
    deviator[:3, :3] -= 1 / 3
    slope[:3] = np.sqrt(2) * eta / 3
    traction = np.zeros((len(points), 3, 3))
    traction[(points[..., 2] == 1).all(axis=1), :, 2] = -0.25
    them |= {
        "cone": np.zeros(len(cells), dtype=int),
        "cone_bound": np.array([np.sqrt(2) * strength]),
        "cone_slope": slope[None],
        "cone_matrix": deviator[None],
        "cone_sine": np.full(1, np.nan),
        "body_force": np.zeros((len(cells), 3)),
        "surface": np.zeros(len(points), dtype=int),
        "held": (points == 0).all(axis=1).astype(np.uint8),
        "traction": traction,
        "contacts": np.zeros((0, 2), dtype=int),
        "obstacles": np.zeros(0, dtype=int),
        "obstacle_normals": np.zeros((0, 3)),
        "bound": np.array(1.0),
        "strength_factor": np.array(factor),
    }
    if kind == "lower":
        stress = np.zeros((len(cells), 4, 3, 3))
        stress[..., 2, 2] = -0.25
        return them | {"stress": stress}
    return with_velocity(them, lambda x, y, z: (0.6 * x, 0.6 * y, -z), 1.0)


def written_cubes(
    folder: Path, match: Match, change: Callable[[Arrays], None]
) -> tuple[Path, Path]:
    """Write a pair of files for a cube of ground, with a changed upper half."""
    upper = pressed_cube("upper", match)
    change(upper)
    return pair_of({"lower": pressed_cube("lower", match), "upper": upper}, folder)


def flatter(half: Arrays) -> None:
    """Reduce the slope and the bound of the cone, so that its apex remains.

    The slopes of the matches differ by less.
    """
    half["cone_slope"], half["cone_bound"] = 0.7 * half["cone_slope"], 0.7 * half["cone_bound"]


def with_a_larger_factor(half: Arrays) -> None:
    half["strength_factor"] = 1.2 * half["strength_factor"]


@pytest.mark.parametrize("match", MATCHES)
def test_the_slope_of_ground_in_space_is_compared(match: Match, tmp_path: Path) -> None:
    """Both files must have the same friction angle before the division, for some match."""
    found = check_pair(*written_cubes(tmp_path, match, lambda half: None))
    assert not found.faults
    assert (found.carried, found.not_carried) == (CARRIED, NOT_CARRIED)
    for change in (flatter, scaled("cone_slope", 0.7), scaled("cone_bound", 0.7)):
        (fault,) = check_pair(*written_cubes(tmp_path, match, change)).faults
        assert "weaker bodies" in fault
    assert not check_pair(*written_cubes(tmp_path, match, with_a_larger_factor)).faults
    half = pressed_cube("upper", match)
    (told,) = reduction_words(Body.of(half), half)
    assert f"0.2 with tan φ = {np.tan(np.radians(20.0)):.6g} ({match})" in told


def test_ground_with_a_vertical_slope_has_no_match() -> None:
    """The slope of the match is infinite for one of these η, and hides that the apex is low."""
    lower, upper = (pressed_cube(kind, "plane-strain") for kind in ("lower", "upper"))
    upper["cone_bound"] = 1e-3 * lower["cone_bound"]
    for off in range(-8, 9):
        eta = np.sqrt(0.75 if off % 2 else 3.0) * (1 + off * 2.0**-53)
        upper["cone_slope"] = np.sqrt(2) / 3 * eta * np.array([[1.0, 1, 1, 0, 0, 0]])
        assert "weaker" in found_differences(lower, upper)[0]


def test_sand_of_unlike_friction_is_not_the_same() -> None:
    """Without cohesion only the slope distinguishes both halves."""
    halves = [pressed_cube(kind, "compression") for kind in ("lower", "upper")]
    for half, slope in zip(halves, (0.3, 0.03), strict=True):
        half["cone_bound"], half["strength_factor"] = np.zeros(1), np.array(1.0)
        half["cone_slope"] = slope * np.array([[1.0, 1, 1, 0, 0, 0]])
    assert "weaker" in found_differences(*halves)[0]
    assert not found_differences(*reversed(halves))


def found_differences(*halves: Arrays) -> list[str]:
    """Return the differences of undivided bodies."""
    bodies = [Body.of(half) for half in halves]
    given = [reduction_of(body, half) for body, half in zip(bodies, halves, strict=True)]
    divisions = [division_of(body, *of) for body, of in zip(bodies, given, strict=True) if of]
    with np.errstate(all="ignore"):
        return differences(bodies[0], bodies[1], divisions)


def plane_ground(match: Match, angle: float, factor: float) -> Arrays:
    """Return a square of Drucker–Prager ground in plane strain, with divided strength."""
    eta, strength = DruckerPrager(1e4, 0.3, 0.2, angle, match).divided_by(factor).cone
    size = np.sqrt(1 - eta**2 / 3)  # of the projection onto in-plane stresses
    them = strip(1.0, 1)
    return them | {
        "cone_bound": np.array([np.sqrt(2) * strength / size]),
        "cone_slope": np.sqrt(2) * eta / size / 2 * np.array([[1.0, 1.0, 0.0]]),
        "strength_factor": np.array(factor),
    }


def steep_ground(match: Match, angle: float, factor: float) -> Arrays:
    """Return a cube of ground, with divided strength."""
    eta, strength = DruckerPrager(1e4, 0.3, 0.2, angle, match).divided_by(factor).cone
    slope = np.sqrt(2) * eta / 3 * np.array([[1.0, 1, 1, 0, 0, 0]])
    return pressed_cube("lower", match) | {
        "cone_bound": np.array([np.sqrt(2) * strength]),
        "cone_slope": slope,
        "strength_factor": np.array(factor),
    }


@pytest.mark.parametrize("match", MATCHES)
@pytest.mark.parametrize("ground", [plane_ground, steep_ground])
def test_any_match_in_plane_strain_and_in_space(
    ground: Callable[[Match, float, float], Arrays], match: Match
) -> None:
    """The checker finds the match of each ground, also of ground too steep for other matches."""
    for angle, smaller in ((30.0, 20.0), (45.0, 30.0)):
        lower, upper = (ground(match, angle, factor) for factor in (1.01, 2.1))
        assert not found_differences(lower, upper)
        assert "weaker" in found_differences(lower, ground(match, smaller, 2.1))[0]


def test_strength_that_one_half_keeps() -> None:
    """Undivided strengths are equal, but F does not divide one of them."""
    lower = {**steep_ground("compression", 30.0, 1.0), "strength_factor": np.array(1000.0)}
    lower["cell_kept"] = np.ones(len(lower["cells"]), dtype=np.uint8)
    upper = steep_ground("compression", 30.0, 1.0)
    assert "weaker" in found_differences(lower, upper)[0]
    assert "weaker" in found_differences(upper, lower)[0]


@pytest.mark.parametrize("of", ["contact", "obstacle"])
def test_friction_that_one_half_keeps(of: str) -> None:
    """In the lower half F = 1000 does not divide the friction."""
    plane = {"obstacles": np.array([5]), "obstacle_normals": np.array([[0.0, 1.0]])}
    them = strip(1.0, 1) | (plane if of == "obstacle" else {"contacts": np.array([[5, 6]])})
    them["surface"][:2] = 5, 6
    them |= {f"{of}_adhesion": np.zeros(1), "strength_factor": np.array(1000.0)}
    lower = {**them, f"{of}_friction": np.array([0.3]), f"{of}_kept": np.ones(1, dtype=np.uint8)}
    upper = {**them, f"{of}_friction": np.array([0.3 / 1000])}
    lower["cone"] = upper["cone"] = np.full(2, -1)
    (fault,) = found_differences(lower, upper)
    assert "contacts" in fault
    assert not found_differences(lower, lower)
    assert not found_differences(upper, upper)


def test_rounding_of_undivided_friction() -> None:
    """F · (μ/F) differs from μ in the last digit, for the lower half only."""
    lower_factor, factor = 13.823657983211707, 16.279926214105057
    them = strip(1.0, 1) | {"contacts": np.array([[5, 6]]), "contact_adhesion": np.zeros(1)}
    them["cone"] = np.full(2, -1)
    them["surface"][:2] = 5, 6
    for mu in np.linspace(0.1, 0.9, 50):
        lower, upper = (
            {**them, "contact_friction": np.array([mu / by]), "strength_factor": np.array(by)}
            for by in (lower_factor, factor)
        )
        assert not found_differences(lower, upper)


@pytest.mark.parametrize("offset", [1e-13, -1e-13])
def test_both_halves_divide_cones_alike(offset: float) -> None:
    """Cones of one shape are not Mohr–Coulomb's in one half and of another shape in the other."""
    halves = [plane_ground("plane-strain", 30.0, factor) for factor in (1.5, 2.0)]
    for half, more in zip(halves, (offset, -offset), strict=True):
        half["cone_matrix"] = half["cone_matrix"].copy()
        half["cone_matrix"][0, 2, 2] *= 1 + 1e-9 + more
    assert "weaker" in found_differences(*halves)[0]


def test_constant_loads_are_no_factor_of_safety(sides: Halves, tmp_path: Path) -> None:
    """A stress at twice the other loads does not show that the bodies carry the loads once."""
    forged = copied(sides)
    for half in forged.values():
        half["constant_body_force"] = 0 * half["body_force"]
        half["constant_body_force"][0] = 1e-3
    assert any("constant loads" in fault for fault in check_pair(*pair_of(forged, tmp_path)).faults)
