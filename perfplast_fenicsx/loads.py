"""Supports and loads, named by physical surface or volume."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem

from perfplast_fenicsx.assembly import Assembly
from perfplast_fenicsx.errors import InputError

AXES = "xyz"


@dataclass(frozen=True)
class Support:
    """Zero displacement of some components on a surface.

    Args:
        on: Physical surface.
        components: Any of the letters x, y, z; the default holds all that the mesh has.
    """

    on: str
    components: str = AXES

    def axes(self, gdim: int) -> list[int]:
        """Indices of the supported components, in a mesh of dimension ``gdim``."""
        wanted = AXES[:gdim] if self.components == AXES else self.components
        if not wanted or set(wanted) - set(AXES[:gdim]) or len(set(wanted)) < len(wanted):
            raise InputError(
                f"components = '{self.components}' of the support on '{self.on}' is not a choice of"
                f" the letters in '{AXES[:gdim]}'; write for instance components = 'x'."
            )
        return sorted(AXES.index(letter) for letter in wanted)


@dataclass(frozen=True)
class Traction:
    """Force per area on a surface.

    Args:
        on: Physical surface.
        value: The force per area (stress), one number a direction.
    """

    on: str
    value: Sequence[float]


@dataclass(frozen=True)
class Pressure:
    """Pressure on a surface.

    Args:
        on: Physical surface.
        value: The pressure (stress); a positive one pushes on the body.
    """

    on: str
    value: float


@dataclass(frozen=True)
class BodyForce:
    """Force per volume.

    Args:
        on: Physical volume.
        value: The force per volume, one number a direction.
    """

    on: str
    value: Sequence[float]


Load = Traction | Pressure | BodyForce


def work_form(assembly: Assembly, loads: Sequence[Load], v: ufl.Argument) -> ufl.Form:
    """The linear form L(v) of all loads.

    Raises:
        InputError: No load at all, an unknown name, or a value that is not finite.
    """
    if not loads:
        raise InputError("no load is given, so nothing can be increased; give at least one load.")
    mesh = assembly.mesh
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=assembly.facet_tags)
    dx = ufl.Measure("dx", domain=mesh, subdomain_data=assembly.cell_tags)
    terms = []
    for load in loads:
        kind = type(load).__name__.lower()
        value = np.atleast_1d(np.asarray(load.value, dtype=default_scalar_type))
        expected = 1 if isinstance(load, Pressure) else mesh.geometry.dim
        if value.shape != (expected,) or not np.isfinite(value).all():
            raise InputError(
                f"the {kind} on '{load.on}' is {load.value}, where {expected} finite"
                f" number{'s are' if expected > 1 else ' is'} needed; correct its value."
            )
        if isinstance(load, BodyForce):
            assembly.cells(load.on)
            tag = assembly.volumes[load.on]
            terms.append(ufl.inner(fem.Constant(mesh, value), v) * dx(tag))
        else:
            assembly.facets(load.on)
            tag = assembly.surfaces[load.on]
            density = (
                -fem.Constant(mesh, value[0]) * ufl.FacetNormal(mesh)
                if isinstance(load, Pressure)
                else fem.Constant(mesh, value)
            )
            terms.append(ufl.inner(density, v) * ds(tag))
    return sum(terms[1:], start=terms[0])
