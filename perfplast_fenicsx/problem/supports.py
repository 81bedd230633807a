"""Supports, named by physical surface."""

from dataclasses import dataclass

from perfplast_fenicsx.errors import InputError

AXES = "xyz"


@dataclass(frozen=True)
class Support:
    """Known displacement of some components on a surface.

    Args:
        on: Physical surface.
        components: Any of the letters x, y, z; the default holds all that the mesh has.
        value: Their displacement (length), the same at any load factor, such as a settlement; the
            default is none.
    """

    on: str
    components: str = AXES
    value: float = 0.0

    def axes(self, gdim: int) -> list[int]:
        """Indices of the supported components, in a mesh of dimension ``gdim``."""
        wanted = AXES[:gdim] if self.components == AXES else self.components
        if not wanted or set(wanted) - set(AXES[:gdim]) or len(set(wanted)) < len(wanted):
            raise InputError(
                f"components = '{self.components}' of the support on '{self.on}' is not a choice of"
                f" the letters in '{AXES[:gdim]}'; write for instance components = 'x'."
            )
        return sorted(AXES.index(letter) for letter in wanted)
