"""Charts of a page: lines over an axis that ends at round numbers and grows with what is shown."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import uplot

ROUND_STEPS = (1.0, 2.0, 5.0, 10.0)  # times a power of ten
PARTS_PER_SPAN = 4  # an axis ends within a part, so large, of the span that is shown
MIN_RELATIVE_SPAN = 1e-9  # a span below this share of its ends is none
ZERO_BELOW = 1e-12  # values nearer to 0 are drawn as 0
FLAT_SHARE = 1e-4  # of values, which are numbers of seven digits


def round_ends(values: NDArray[np.float64]) -> tuple[float, float]:
    """Round ends of an axis that holds all values, which ascend: from the first to the last, and a little more."""
    low, high = (float(values[0]), float(values[-1])) if len(values) else (0.0, 0.0)
    span = high - low
    if not span > MIN_RELATIVE_SPAN * max(abs(low), abs(high), 1.0):
        return low, high + 1.0
    power = 10.0 ** np.floor(np.log10(span / PARTS_PER_SPAN))
    part = next(power * step for step in ROUND_STEPS if PARTS_PER_SPAN * power * step >= span * (1.0 - 1e-9))
    return float(np.floor(low / part + 1e-9) * part), float(np.ceil(high / part - 1e-9) * part)


def axis_ranges(columns: tuple[NDArray[np.float64], ...]) -> dict[str, tuple[float, float]]:
    """Ends of the axes that a page must be told: that of x always, that of y where the page finds none itself.

    That is where a value is missing (nan), and where all are the same but for rounding, as the speeds of fish.
    """
    found = {"x": round_ends(columns[0])}
    values = np.concatenate([column[np.isfinite(column)] for column in columns[1:]])
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)
    size = max(abs(low), abs(high))
    if high - low <= FLAT_SHARE * size or size < ZERO_BELOW:
        far = round_ends(np.array([0.0, 1.5 * size]))[1] if size >= ZERO_BELOW else 1.0
        return {**found, "y": (-far, 0.0) if low < -ZERO_BELOW else (0.0, far)}
    return found if len(values) == sum(map(len, columns[1:])) else {**found, "y": round_ends(np.array([low, high]))}


class Chart:
    """One chart of viser, whose axis is set.

    Left alone, the page scales the axis of new values by that of the last ones. A chart that was made while it was
    hidden, or drawn too slowly, has none yet, and then shows the first second for ever (viser 1.1). An axis that is
    set is never scaled; setting it draws a new picture, so it is done only where a round end is passed. The other
    axis scales itself unless a value is not a number, with which it would end nowhere and nothing would be drawn, or
    all are the same but for rounding, at which the page looks for ticks until its memory is full.
    """

    def __init__(self, handle: Any):
        self._handle = handle
        self._axis_ranges: dict[str, tuple[float, float]] = {}

    @property
    def data(self) -> tuple[NDArray[np.float64], ...]:
        """(time or what else is across, *values), one array a line, all of one length."""
        return tuple(self._handle.data)

    @data.setter
    def data(self, columns: tuple[NDArray[np.float64], ...]) -> None:
        if (told := axis_ranges(columns)) != self._axis_ranges:
            self._axis_ranges = told
            self._handle.scales = {axis: uplot.Scale(time=False, range=given) for axis, given in told.items()}
        self._handle.data = columns

    def remove(self) -> None:
        """Take it from the page."""
        self._handle.remove()
