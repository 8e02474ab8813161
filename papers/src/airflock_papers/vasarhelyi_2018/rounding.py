"""Rounding: what the digits that Tables S1 and S2 print leave open, and the test of a whole column of Table S2.

Written before anything was flown. A set of parameters lies inside the printed digits if each of the 11 values of a
column is within half of its last digit. It reproduces the column if none of the 11 rows is rejected: Welch's test of
100 fresh flights against the printed mean and SD, p corrected by Holm's method over the column (which multiplies the
least p by the number of its rows). The least corrected p is the column's joint p; the bound is 0.05. F_wall, and the
fitness with it, is taken once by the average of Eq. 15 and once by that of the authors' program, and either is told.
Table S2 is rounded, too: with `digits`, a printed mean stands for every number that rounds to it.
"""

import math
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from airflock.scenarios import Scenario, load
from airflock.support import holm_correction
from airflock_papers.vasarhelyi_2018 import program_wall
from airflock_papers.vasarhelyi_2018.published import COLUMNS, EVALUATIONS, SPEEDS, optimum

PRINTED: Mapping[str, tuple[str, ...]] = {  # Table S1, as its digits stand there, by the speeds of its columns
    "r0_rep": ("25.6", "41.1", "52.9", "103", "200"),
    "p_rep": ("0.13", "0.07", "0.06", "0.03", "0.03"),
    "r0_frict": ("85.3", "88.5", "86.8", "182", "228"),
    "c_frict": ("0.05", "0.05", "0.06", "0.07", "0.09"),
    "v_frict": ("0.63", "0.93", "1.48", "2.47", "3.46"),
    "p_frict": ("3.20", "5.32", "6.87", "5.92", "5.38"),
    "a_frict": ("4.16", "9.94", "0.98", "2.57", "0.70"),
    "r0_shill": ("0.3", "0.5", "0.1", "0.5", "4.2"),
    "v_shill": ("13.6", "19.7", "22.8", "49.2", "76.4"),
    "p_shill": ("3.55", "5.44", "8.12", "9.49", "4.87"),
    "a_shill": ("3.02", "3.54", "4.18", "9.50", "9.99"),
}
MEANS: Mapping[str, tuple[str, ...]] = {  # Table S2, likewise; the rows that are not here are printed to 0.001
    "phi_vel": ("3.78", "5.60", "7.26", "15.01", "29.6"),
    "r_min_mean": ("12.2", "13.4", "14.7", "23.2", "41.7"),
    "phi_coll": ("0.94e-6", "1.6e-6", "1.0e-6", "2.1e-6", "6.0e-6"),
    "n_coll": ("1.18", "1.65", "0.89", "1.57", "3.53"),
}
NAMES = tuple(PRINTED)
WALLS = ("eq15", "program")  # averages of the excursion
ALPHA = 0.05  # bound of the joint p
SURE = ("f_disc", "f_cluster")  # 1 in every flight inside the digits
READINGS = ("", "digits")  # of the means of Table S2: exact, or what rounds to them


class Target(NamedTuple):
    """What a column is judged by: wall : eq15 or program; digits : whether S2's means are intervals."""

    wall: str
    digits: bool

    @property
    def name(self) -> str:
        """As claims are called."""
        return f"digits.{self.wall}" if self.digits else self.wall


TARGETS = tuple(Target(wall, digits) for digits in (False, True) for wall in WALLS)


def half_digit(printed: str) -> float:
    """Half of the last digit of a printed number.

    >>> half_digit("0.13"), half_digit("103"), half_digit("1.6e-6")
    (0.005, 0.5, 5e-08)
    """
    digits, _, power = printed.partition("e")
    places = len(digits.partition(".")[2])
    return float(f"5e{int(power or 0) - places - 1}")


def box(v: int) -> NDArray[np.float64]:
    """Lowest and highest value of each parameter of a column, (11, 2); v: speed in m/s."""
    texts = [PRINTED[name][SPEEDS.index(v)] for name in NAMES]
    return np.array([[float(t) - half_digit(t), float(t) + half_digit(t)] for t in texts])


def scenario(v: int, x: NDArray[np.float64]) -> Scenario:
    """A column with the parameters x (11), measured by both averages of the excursion."""
    settings = {f"model.{name}": float(value) for name, value in zip(NAMES, x, strict=True)}
    return load(f"vasarhelyi_2018/{v}ms", settings, metrics=program_wall)


def measured_as(row: str, target: Target) -> str:
    """Order parameter behind a row of Table S2."""
    return f"{row}_program" if target.wall == "program" and row in ("f_wall", "fitness") else row


def slack(v: int, row: str) -> float:
    """Half of the last digit of a mean of Table S2."""
    return half_digit(MEANS[row][SPEEDS.index(v)]) if row in MEANS else 0.0005


def row_p(
    v: int, row: str, means: NDArray[np.float64], sds: NDArray[np.float64], runs: int, digits: bool
) -> NDArray[np.float64]:
    """P of Welch's test of several means and SDs against one entry of Table S2; as in `airflock_papers.statistics`."""
    published, sd = printed(v, row)
    half = slack(v, row) if digits else 0.0
    gap = means - np.clip(means, published - half, published + half)
    ours, theirs = sds**2 / runs, sd**2 / EVALUATIONS
    variance = ours + theirs
    with np.errstate(invalid="ignore", divide="ignore"):
        freedom = variance**2 / (ours**2 / (runs - 1) + theirs**2 / (EVALUATIONS - 1))  # Welch and Satterthwaite
        p = 2.0 * special.stdtr(freedom, -np.abs(gap) / np.sqrt(variance))
    return np.where(variance > 0.0, p, np.where(gap == 0.0, 1.0, 0.0))


@cache
def printed(v: int, row: str) -> tuple[float, float]:
    """Mean and SD of an entry of Table S2."""
    mean, sd = optimum(v).published[row]
    return mean, sd or 0.0


def judged(v: int, flown: Mapping[str, NDArray[np.float64]], target: Target) -> tuple[float, dict[str, float]]:
    """Joint p of a column, and the corrected p of each of its rows; flown: order parameters of the flights."""
    ps = []
    for row in COLUMNS:
        x = flown[measured_as(row, target)]
        mean, sd = np.array([x.mean()]), np.array([x.std(ddof=1)])
        ps.append(float(row_p(v, row, mean, sd, x.size, target.digits)[0]))
    corrected = holm_correction([0.0 if math.isnan(p) else p for p in ps])
    return min(corrected), dict(zip(COLUMNS, corrected, strict=True))
