"""Test water in case files: pressures, water above the ground, weights, and refusals."""

from typing import Any

import numpy as np
import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.formulas import evaluate
from perfplast_fenicsx.geometry.drawn_ground import DrawnGround, Region
from perfplast_fenicsx.io.case.gravity_table import GravityTable
from perfplast_fenicsx.io.case.water_table import Water, WaterTable, level, water_of
from perfplast_fenicsx.problem.declared.loads import ForceBelow, PorePressure, Pressure
from perfplast_fenicsx.units import Units

pytestmark = pytest.mark.serial

SLOPE = DrawnGround([Region("soil", [[0, 0], [60, 0], [60, 10], [40, 10], [20, 20], [0, 20]])])
INSIDE: list[list[float]] = [[0.0, 18], [20, 16], [40, 8], [60, 8]]
POND: list[list[float]] = [[0.0, 18], [20, 16], [40, 12], [60, 12]]
WEIGHT = GravityTable([0.0, -1.0], {"soil": 19.0})
METRES = Units(system="m-kN-kPa")


def water(ground: DrawnGround | None = SLOPE, units: Units = METRES, **said: Any) -> Water:
    return water_of(WaterTable(**said), ground, WEIGHT, ["soil"], units)


def test_the_level_is_that_of_the_polyline() -> None:
    rng = np.random.default_rng(5)
    line = np.column_stack([np.sort(rng.uniform(-50, 90, 12)), rng.uniform(-9, 9, 12)])
    x = rng.uniform(line[0, 0], line[-1, 0], (40, 3))
    values = evaluate(level(line), x, "here")
    np.testing.assert_allclose(values, np.interp(x[:, 0], *line.T), atol=1e-11)


def test_pressure_below_the_table_and_its_lines() -> None:
    found = water(table=INSIDE)
    (load,) = found.loads
    assert isinstance(load, PorePressure) and load.constant
    assert isinstance(load.value, str)
    depth = evaluate(load.value, np.array([[10.0, 5, 0], [50, 9, 0], [40, 2, 0]]), "here")
    assert depth == pytest.approx(9.81 * np.array([12, 0, 6]))
    ends = [line[[0, -1]].tolist() for line in found.kinks]
    assert ends == [[[0, 18], [60, 8]], [[20, 16], [20, 0]], [[40, 8], [40, 0]]]


def test_water_above_the_ground_presses_on_its_surface() -> None:
    pore, pond = water(table=POND).loads
    assert isinstance(pond, Pressure) and pond.on == "surface" and pond.value == pore.value
    assert isinstance(water(table=POND, on="toe").loads[1], Pressure)
    assert len(water(table=INSIDE, piezometric={"soil": POND}).loads) == 1


def test_saturated_ground_weighs_more_below_the_table() -> None:
    _, more = water(table=INSIDE, saturated={"soil": 20.5}).loads
    assert isinstance(more, ForceBelow)
    assert more.value == pytest.approx([0, -1.5])
    cells = np.array([[[0.0, 0], [9, 0], [0, 9]], [[0, 18], [9, 19], [0, 20]]])
    assert more.cells_below(cells).tolist() == [True, False]
    with pytest.raises(InputError, match=r"divides cells, one .* at \(0\.3.*edges along"):
        more.cells_below(np.array([[[0.0, 17.0], [1, 17], [0, 19]]]))


def test_a_share_of_the_weight_above() -> None:
    """The ground has layers of different weights; one layer ends inside the ground."""
    low: list[list[float]] = [[0.0, 0], [60, 0], [60, 10], [40, 10], [20, 12], [0, 16]]
    top: list[list[float]] = [[0.0, 20], [20, 20], [40, 10], [20, 12], [0, 16]]
    ground = DrawnGround([Region("top", top), Region("soil", low)])
    weight = GravityTable([0.0, -2.0], {"soil": 19.0, "top": 17.0})
    bodies = ["soil", "top"]
    said = WaterTable(ru={"soil": 0.5, "top": 0.25})
    soil, upper = water_of(said, ground, weight, bodies, Units()).loads
    x = np.array([[20.0, 2, 0], [50, 4, 0], [10, 14, 0], [40, 10, 0], [40, 0, 0], [30, 11, 0]])
    assert isinstance(soil, PorePressure) and isinstance(soil.value, str)
    wanted = [8 * 17 + 10 * 19, 6 * 19, 6 * 17, 0, 10 * 19, 4 * 17]
    assert evaluate(soil.value, x, "") == pytest.approx(np.array(wanted, dtype=float))
    assert isinstance(upper, PorePressure) and isinstance(upper.value, str)
    assert evaluate(upper.value, x, "") == pytest.approx(np.array(wanted) / 2)
    lines = [
        line[[0, -1]].tolist() for line in water_of(said, ground, weight, bodies, Units()).kinks
    ]
    assert [[20, 20], [20, 0]] in lines and [[40, 10], [40, 0]] in lines


def test_saturated_ground_counts_in_the_weight_above() -> None:
    said = WaterTable([[0, 9], [60, 9]], ru={"soil": 1.0}, saturated={"soil": 20.0})
    load = water_of(said, SLOPE, WEIGHT, ["soil"], METRES).loads[0]
    assert isinstance(load, PorePressure) and isinstance(load.value, str)
    found = evaluate(load.value, np.array([[10.0, 5, 0], [50, 9.5, 0]]), "")
    assert found == pytest.approx(np.array([11 * 19 + 4 * 20, 0.5 * 19]))


def test_units_have_their_unit_weight_of_water() -> None:
    for system, weight in {"m-MN-MPa": 9.81e-3, "SI": 9810.0, "ft-lbf-psf": 62.45}.items():
        (load,) = water(units=Units(system=system), table=INSIDE).loads  # type: ignore[arg-type]
        assert isinstance(load, PorePressure)
        assert evaluate(load.value, np.array([[10.0, 16, 0]]), "") == pytest.approx(
            weight, rel=1e-3
        )


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({}, "no water is defined"),
        ({"table": [[0, 5], [50, 5]]}, "from x = 0 to 50"),
        (
            {"table": [[0, -5], [60, -1]]},
            "entirely below the ground",
        ),
        ({"table": [[0, 5], [30, 6], [30, 7], [60, 7]]}, r"between \(30, 6\) and \(30, 7\)"),
        (
            {"table": INSIDE, "unit_weight": 9.81e-3},
            r"9\.81 kN/m\^3; correct it, or correct \[units\]",
        ),
        ({"table": INSIDE, "unit_weight": -1.0}, "unit_weight = -1"),
        ({"table": INSIDE, "dry": ["clay"]}, "dry has .* 'clay', .*; known: soil"),
        (
            {"table": INSIDE, "dry": ["soil"], "piezometric": {"soil": POND}},
            "'soil' is in piezometric and in dry",
        ),
        ({"table": INSIDE, "saturated": {"soil": 18.0}}, "18 for 'soil', less than its density 19"),
        ({"table": INSIDE, "saturated": {"soil": 196.0}}, "10.3 times its density 19"),
        ({"ru": {"soil": 1.5}}, r"1\.5 for 'soil'"),
        ({"piezometric": {"soil": POND}, "saturated": {"soil": 20.0}}, "there is no water table"),
    ],
)
def test_water_that_cannot_be_is_refused(said: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        water(**said)


def test_without_units_water_is_compared_with_the_ground() -> None:
    light = GravityTable([0.0, -1.0], {"soil": 19e-3})
    with pytest.raises(InputError, match=r"weighs 0\.019 per unit of volume, 0\.00194 times"):
        water_of(WaterTable(INSIDE, 9.81), SLOPE, light, ["soil"], Units())
    assert water_of(WaterTable(INSIDE, 9.81e-3), SLOPE, light, ["soil"], Units()).loads
    with pytest.raises(InputError, match="unit_weight is missing"):
        water(units=Units(), table=INSIDE)


def test_ground_without_sides_needs_the_name_of_its_surface() -> None:
    apart = DrawnGround(
        [Region("soil", [[0, 0], [4, 0], [4, 4]]), Region("b", [[60, 0], [56, 0], [56, 4]])]
    )
    with pytest.raises(InputError, match="several parts; draw a"):
        water(apart, table=POND)
    assert len(water(apart, table=POND, on="a").loads) == 2
