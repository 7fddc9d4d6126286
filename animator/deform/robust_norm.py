"""How much a residual costs: quadratic while small, bounded once it is clearly meant."""

import dataclasses
from typing import TypeVar, cast

import numpy as np
import torch

_Array = TypeVar("_Array", np.ndarray, torch.Tensor)


@dataclasses.dataclass(frozen=True, kw_only=True)
class RobustNorm:
    """The Geman-McClure norm on a quadratic floor, of squared residuals.

    A sum of squares spreads a bend over everything near it, for many small residuals are cheaper
    than one large: bodies turn to rubber. Under this norm one joint that bends is cheaper, so
    parts stay rigid and joints emerge where the frame asks for them. The floor keeps what is
    bent from coming apart.
    """

    reach: float = float("inf")
    """Residual at which the cost has come to half of the quadratic's; infinite for plain squares."""
    floor: float = 0.0
    """Share of the quadratic that never lets go, 0..1."""

    def cost(self, squared: _Array) -> _Array:
        """Return the cost of squared residuals, of their shape."""
        kept = self.floor + (1.0 - self.floor) / (1.0 + squared / self.reach**2)
        return cast(_Array, squared * kept)

    def weight(self, squared: _Array) -> _Array:
        """Return the slope of the cost: the weight in iteratively reweighted least squares."""
        kept = self.floor + (1.0 - self.floor) / (1.0 + squared / self.reach**2) ** 2
        return cast(_Array, kept)
