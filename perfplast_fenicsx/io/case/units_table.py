"""Read ``[units]``, and check the magnitudes of materials and mesh in these units."""

import math
from collections.abc import Iterable, Iterator, Mapping

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.io.case.schema import Table, at, convert
from perfplast_fenicsx.materials.common import check_soil_units, check_units, odd_numbers
from perfplast_fenicsx.materials.laws import Material
from perfplast_fenicsx.parallel import bounding_box
from perfplast_fenicsx.problem.declared.loads import BodyForce, Load
from perfplast_fenicsx.spatial_fields import SpatialField
from perfplast_fenicsx.units import System, Units

LIGHTEST, HEAVIEST = 1e2, 1e7
"""Plausible weights of materials (N/m³): foam weighs 300 N/m³, and gold 190 000 N/m³."""


def odd_magnitudes(
    units: Units,
    materials: Mapping[str, Material],
    loads: Iterable[Load],
    comm: MPI.Intracomm,
    points: Floats,
) -> list[str]:
    """Return a remark on each number that is implausible in these units. Collective.

    Args:
        units: Units of the case.
        materials: Materials by names of bodies.
        loads: Loads, whose weights are tested.
        comm: The ranks of the run.
        points: Points of the mesh on this rank, shape (n, 3).
    """
    told = []
    for body, material in materials.items():
        numbers = (getattr(material, key, None) for key in ("young", "yield_stress"))
        young, yield_stress = (one if isinstance(one, float) else None for one in numbers)
        if young:
            odd = odd_numbers(young, yield_stress, units.name)
            told += [f"material '{body}': {text}?" for text in odd]
    if units.known:
        told += _odd_weights(units.known, loads)
    low, high = bounding_box(comm, points)
    size = float(np.max(high - low))
    # plausible sizes of bodies (m): a thousandth of a millimetre to ten kilometres
    least, most = 1e-6, 1e4
    # smallest plausible unit of length in a case without [units] (m)
    millimetre = 1e-3
    if units.known and not least <= size * units.known.metres <= most:
        length = units.known.length
        told.append(
            f"the mesh is {size:.3g} {length} large, that is "
            f"{size * units.known.metres:.3g} m; is it in {length}, as [units] says?"
        )
    elif not units.known and not least <= size <= most / millimetre:
        told.append(f"the mesh is {size:.3g} large, in an unknown unit; is that right?")
    return told


def _odd_weights(system: System, loads: Iterable[Load]) -> Iterator[str]:
    """Yield a remark on each constant weight that no material has on earth."""
    for load in loads:
        if not (isinstance(load, BodyForce) and load.constant):
            continue
        numbers = [one for one in load.value if isinstance(one, float | int)]
        if len(numbers) < len(load.value):  # a formula may be a centrifugal force
            continue
        weight = math.hypot(*numbers) * system.pascals / system.metres
        if weight and not LIGHTEST <= weight <= HEAVIEST:
            yield (
                f"'{load.on}' weighs {weight / 1e3:.3g} kN/m³, and steel weighs 77 kN/m³; is the "
                f"density in {system.density}, and the acceleration in {system.length}/s²?"
            )


def read_units(table: Table, materials: Mapping[str, Material], name: str) -> Units:
    """Return the units of a case, after checks against its materials.

    Args:
        table: The parsed TOML table.
        materials: Materials by names of bodies.
        name: Name of the case file.

    Raises:
        InputError: If keys are not valid or contradict each other, or if a material has the numbers
            of a common material in another system of units.
    """
    units = convert(table, Units, f"{name}, [units]")
    if units.name is None:
        return units
    # properties that `perfplast materials` shows
    for strength, check in (("yield_stress", check_units), ("cohesion", check_soil_units)):
        copied = ("young", "poisson", strength)
        for body, material in materials.items():
            if all(hasattr(material, key) for key in copied):
                young, poisson, most = (getattr(material, key) for key in copied)
                if isinstance(most, SpatialField):
                    continue
                with at(f"{name}, [material.{body}]"):
                    check(young, poisson, most, units.name)
    return units
