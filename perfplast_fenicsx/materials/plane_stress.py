"""What bodies are in plane stress: their materials say so, where it is known."""

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.law import Material


@runtime_checkable
class Thin(Protocol):
    """A material that knows of plane stress."""

    def in_plane_stress(self) -> Material:
        """The same body with σ_zz = 0, whatever ε_zz is."""
        ...


def in_plane_stress(materials: Mapping[str, Material]) -> dict[str, Material]:
    """What the materials of bodies are in plane stress.

    Args:
        materials: Of each volume.

    Raises:
        InputError: If one is not known there.
    """
    found = {}
    for name, material in materials.items():
        if not isinstance(material, Thin):
            raise InputError(
                f"the law of volume '{name}', {type(material).__name__}, is not known in plane"
                " stress; give VonMises or Hill without stages, or Elastic, or kind ="
                " 'plane-strain'."
            )
        found[name] = material.in_plane_stress()
    return found
