"""What bodies are in plane stress: their materials say so, where it is known."""

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.law import Material


@runtime_checkable
class Thin(Protocol):
    """A material that knows of plane stress."""

    def in_plane_stress(self) -> Material | None:
        """The same body with σ_zz = 0, whatever ε_zz is; None where that is not known."""
        ...


def thin(material: Material) -> Material | None:
    """What a material is in plane stress; None where that is not known."""
    return material.in_plane_stress() if isinstance(material, Thin) else None


def in_plane_stress(materials: Mapping[str, Material]) -> dict[str, Material]:
    """What the materials of bodies are in plane stress.

    Args:
        materials: Of each volume.

    Raises:
        InputError: If one is not known there.
    """
    found = {}
    for name, material in materials.items():
        flat = thin(material)
        if flat is None:
            raise InputError(
                f"the law of volume '{name}', {type(material).__name__}, is not known in plane"
                " stress; give VonMises, Hill or Elastic, or kind = 'plane-strain'."
            )
        found[name] = flat
    return found
