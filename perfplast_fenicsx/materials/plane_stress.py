"""Convert materials of bodies to plane stress."""

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.law import Material


@runtime_checkable
class Thin(Protocol):
    """A material that supports plane stress."""

    def in_plane_stress(self) -> Material | None:
        """Return the same body with σ_zz = 0, whatever ε_zz is; None if there is no such law."""
        ...


def thin(material: Material) -> Material | None:
    """Return the material for plane stress; None if it has no such law."""
    return material.in_plane_stress() if isinstance(material, Thin) else None


def in_plane_stress(materials: Mapping[str, Material]) -> dict[str, Material]:
    """Return the materials of bodies for plane stress.

    Args:
        materials: Materials of each volume.

    Raises:
        InputError: If a material does not support plane stress.
    """
    found = {}
    for name, material in materials.items():
        flat = thin(material)
        if flat is None:
            raise InputError(
                f"the law of volume '{name}', {type(material).__name__}, does not support "
                "plane stress; give VonMises, Hill or Elastic, or kind = 'plane-strain'."
            )
        found[name] = flat
    return found
