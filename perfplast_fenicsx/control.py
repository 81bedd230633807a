"""How the loading is controlled: the choices of ``[loading]`` in case files."""

import math
from dataclasses import dataclass

from perfplast_fenicsx.errors import InputError


@dataclass(frozen=True)
class LoadControl:
    """Loading by the load factor ζ.

    Args:
        values: Load factors, increasing, not negative.

    Raises:
        InputError: No value at all, or values that are not finite, negative or not increasing.
    """

    values: list[float]

    def __post_init__(self) -> None:
        if not self.values:
            raise InputError("values is empty; give at least one load factor.")
        for before, value in zip([-math.inf, *self.values], self.values, strict=False):
            if not math.isfinite(value) or value < 0:
                raise InputError(
                    f"values has {value}, but load factors are finite numbers >= 0; correct it."
                )
            if value <= before:
                raise InputError(
                    f"values has {value} after {before}, but load factors must increase; sort them"
                    " and give each once."
                )


LOADINGS = {"load": LoadControl}
