"""Give a common material to a model whose file has none that yields."""

from dataclasses import replace

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.common import TABLE, find
from perfplast_fenicsx.models.foreign_model import ForeignMaterial, ForeignModel
from perfplast_fenicsx.units import SYSTEMS


def with_material(model: ForeignModel, name: str) -> tuple[ForeignModel, str]:
    """Return the model with one material, and the unit of its stresses.

    Young's moduli in the file show the unit; a file without them gets numbers in MPa.

    Raises:
        InputError: If there is no such material, if bodies yield already, or if their Young's
            moduli fit the material in no unit.
    """
    common = find(name)
    yields = [body for body, given in model.materials.items() if given.yield_stress is not None]
    if yields:
        raise InputError(
            f"'{yields[0]}' has a yield stress in the file; leave out --material, and change the"
            " yield stress in the case."
        )
    known = [given.young for given in model.materials.values() if given.young is not None]
    # Ratio of two Young's moduli of one material in the same unit: moduli of steels differ by less,
    # units by more.
    alike = 2.0
    fitting = [
        system
        for system in (SYSTEMS if known else [TABLE])
        if all(1 / alike < young / common.in_system(system).young < alike for young in known)
    ]
    if not fitting:
        raise InputError(
            f"Young's moduli in the file ({', '.join(f'{young:g}' for young in known)}) fit"
            f" {name} in no unit; leave out --material, and fill in the yield stress."
        )
    one = common.in_system(fitting[0])
    given = ForeignMaterial(one.young, one.poisson, one.yield_stress)
    materials = {}
    for body in model.bodies:
        before = model.materials.get(body, ForeignMaterial())
        materials[body] = replace(given, density=before.density, expansion=before.expansion)
    return replace(model, materials=materials), SYSTEMS[fitting[0]].stress
