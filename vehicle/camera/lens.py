"""The distortion of a lens, as data: a model by name and its coefficients, as OpenCV orders them."""

from __future__ import annotations

import math
from dataclasses import dataclass

MODELS = {"none": 0, "pinhole": 5, "rational": 8, "fisheye": 4}
"""Model -> number of coefficients: pinhole k1, k2, p1, p2, k3; rational k1, k2, p1, p2, k3, k4, k5, k6 (both of Brown
and Conrady); fisheye k1, k2, k3, k4 (Kannala and Brandt 2006, of the angle to the optical axis)."""


@dataclass(frozen=True)
class Lens:
    """Distortion of one of MODELS. Raises ValueError for an unknown model or coefficients that do not suit it."""

    model: str = "none"
    coefficients: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise ValueError(f'there is no distortion model "{self.model}": choose {", ".join(MODELS)}')
        count = MODELS[self.model]
        if len(self.coefficients) != count:
            raise ValueError(f"distortion model {self.model} has {count} coefficients, not {len(self.coefficients)}")
        if not all(math.isfinite(k) for k in self.coefficients):
            raise ValueError(f"a coefficient of the distortion is not finite: {self.coefficients}")

    @property
    def bends(self) -> bool:
        """Whether a point moves: a fisheye does so with all coefficients at zero."""
        return self.model == "fisheye" or any(self.coefficients)
