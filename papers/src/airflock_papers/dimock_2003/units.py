"""The paper's units at the border, and its chromosome."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FOOT, POUND = 0.3048, 4.4482216152605  # m, N
FT_LBF = FOOT * POUND  # W in a ft lbf/s
HORSEPOWER = 550.0 * FT_LBF  # W
SPAN = 5.0  # ft
LOW = np.array([0.0, 0.0, 0.0, 3.0, 2.5])
HIGH = np.array([100.0, 100.0, 100.0, 100.0, 50.0])


class Gains(NamedTuple):
    """K_c, K_a (ft/s), K_d (ft²/(lbf s)), R_c, R_a (ft), as the paper prints them."""

    k_c: float
    k_a: float
    k_d: float
    r_c: float
    r_a: float

    def si(self) -> dict[str, float]:
        """The same as parameters of the model, SI."""
        return {
            "k_c": self.k_c * FOOT,
            "k_a": self.k_a * FOOT,
            "k_d": self.k_d * FOOT * FOOT / POUND,
            "r_c": self.r_c * FOOT,
            "r_a": self.r_a * FOOT,
        }

    def text(self) -> str:
        """For a table."""
        return ", ".join(f"{name} {value:.4g}" for name, value in zip(self._fields, self, strict=True))


BEST = Gains(31.05, 0.29, 7.42, 33.37, 3.52)


def gains(unit: NDArray[np.float64]) -> Gains:
    """Gains from numbers in [0, 1): the paper's bounds."""
    return Gains(*(float(x) for x in LOW + (HIGH - LOW) * np.asarray(unit)))


def both(watts: float) -> str:
    """A power in W with ft lbf/s beside it."""
    return f"{watts:.4g} W ({watts / FT_LBF:.4g} ft lbf/s)"
