"""Compute the initial strain of bodies: from temperature or from initial stress.

With the initial strain e₀, the law receives ε(u) − e₀. A change of temperature T has e₀ = aTδ with
the coefficient of expansion a of the material. A stress σ₀ in the undeformed bodies has e₀ =
−C⁻¹σ₀. :mod:`shanks` computes the strain that tightened bolts add.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.formulas import evaluate
from perfplast_fenicsx.materials.law import Material
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.assembled.law_on_cells import LawExpression, LawOnCells
from perfplast_fenicsx.problem.assembled.spaces import Spaces, coordinates_of_points
from perfplast_fenicsx.problem.declared.initial import Initial, InitialStress, Temperature


def initial_strain(
    tagged_mesh: TaggedMesh,
    spaces: Spaces,
    materials: Mapping[str, Material],
    laws: Sequence[LawOnCells],
    given: Sequence[Initial],
) -> fem.Function | None:
    """Return e₀ as Mandel vectors at the quadrature points, 0 in bolts.

    None without initial strain.

    Collective.

    Raises:
        InputError: For an unknown volume, a material without expansion, a wrong number of
            components, or a value that is not finite.
    """
    if not given:
        return None
    S, comm = spaces.S, tagged_mesh.mesh.comm
    width = S.dofmap.index_map_bs
    stress, strain = fem.Function(S), fem.Function(S)
    thermal: Floats = np.zeros((len(strain.x.array) // width, width))
    before = np.zeros_like(thermal)
    x = coordinates_of_points(S)
    x = np.pad(x, ((0, 0), (0, 3 - x.shape[1])))
    message = None
    for one in given:
        points = np.unique(S.dofmap.list[tagged_mesh.cells(one.on)])
        try:
            if isinstance(one, Temperature):
                thermal[points, :3] += _expansion(materials, one, x, points)
            elif isinstance(one, InitialStress):
                before[points] += _mandel(one, x, points, width)
        except InputError as error:
            message = message or str(error)
    raise_together(comm, message)
    stress.x.array[:] = before.ravel()
    LawExpression(laws, S, lambda on: -on.law.elastic.compliance(stress)).interpolate(strain)
    strain.x.array[:] += thermal.ravel()
    return strain


def _expansion(
    materials: Mapping[str, Material], given: Temperature, x: Floats, points: Ints
) -> Floats:
    """Return the thermal strain a T at points, shape (num_points, 1)."""
    expansion = float(getattr(materials.get(given.on), "expansion", 0.0))
    if not expansion:
        raise InputError(
            f"the temperature of '{given.on}' changes, but its material has no expansion; "
            "give the material one, such as expansion = 1.2e-5."
        )
    change = evaluate(given.change, x[points], f"the temperature of '{given.on}'")
    return expansion * change[:, None]


def _mandel(given: InitialStress, x: Floats, points: Ints, width: int) -> Floats:
    """Return σ₀ at points as Mandel vectors, shape (num_points, width)."""
    if len(given.stress) != width:
        # The components of an initial stress, by the number of Mandel components.
        components = {4: "xx, yy, zz and xy", 6: "xx, yy, zz, yz, xz and xy"}
        raise InputError(
            f"the initial stress of '{given.on}' has {len(given.stress)} components, but "
            f"this mesh needs {components[width]}; give these {width}."
        )
    place = f"the initial stress of '{given.on}'"
    values = np.column_stack([evaluate(value, x[points], place) for value in given.stress])
    values[:, 3:] *= math.sqrt(2)
    return values
