"""What is measured for Figs 4-8: the captions' values and places, the trends of the text, distances to the figures."""

from typing import Any

import numpy as np
import pandas as pd

from airflock_papers import statistics
from airflock_papers.claims import Measured

NOISY_COLUMN = 10  # r_a in cm: there the order of updates changes the result
WITHOUT = (10, 20, 30, 40, 50)  # r_s in cm: columns without alignment, which spread little
DENSE = 10  # r_s in cm: there a quarter of the boids collide, so that the way of counting shows
FLIGHTS = 15  # behind each number of the captions
# the captions' minima: place in cm and value
MINIMA = {
    "extension_cm": ((0, 30), 1.64),
    "polarization_deg": ((50, 50), 0.79),
    "f_collision": ((50, 50), 0.0001),
}
BEST = (20, 30)  # cm, Fig. 8
# Figs 4-6: a measure falls as a radius grows (-1) or grows with it (+1); axis 0 is r_s, axis 1 is r_a
TRENDS = {"extension_cm": {0: 1, 1: -1}, "polarization_deg": {1: -1}, "f_collision": {0: -1}}


def measured(part: str, flown: pd.DataFrame, figures: pd.DataFrame) -> list[Measured]:
    """Everything measured in one part; `flown` has the index (r_s, r_a, seed) in cm."""
    means = flown.groupby(level=[0, 1]).mean()
    if part == "printed":
        best = means["quality"].idxmax()
        note = (
            f"at {_cm(best)}, polarization there {means['polarization_deg'][best]:.0f}°: without dt a step is a second"
        )
        return [Measured("printed.quality", "quality", "best of 36 configurations", _peak(means, len(flown)), note)]
    found = [
        *(distance(part, column, flown, means, figures) for column in ("quality", "cns_ext", "cns_pol")),
        row_without_separation(part, means, figures),
        *(band(part, r_s, flown) for r_s in WITHOUT),
    ]
    return found + (sentences(flown, means) if part == "sequential" else [])


def sentences(flown: pd.DataFrame, means: pd.DataFrame) -> list[Measured]:
    """What the text and the captions print."""
    q = means["quality"]
    region = q[[(s, a) for s, a in q.index if 20 <= s <= a <= 50]]
    ranked = ", ".join(f"{_cm(place)} {value:.3f}" for place, value in q.nlargest(3).items())
    worst = flown.loc[region.idxmin(), "quality"]
    return [
        Measured(
            "quality.maximum", "quality", "best of 36 configurations", _peak(means, len(flown)), f"best: {ranked}"
        ),
        Measured(
            "quality.region",
            "quality",
            "least of those with 20 <= r_s <= r_a <= 50 cm",
            statistics.mean(worst),
            f"least at {_cm(region.idxmin())}; {(region >= 0.9).sum()} of {len(region)} reach 0.90",
        ),
        Measured("quality.best", "rank by quality", _at(BEST), _rank(-q, BEST), f"best: {ranked}"),
        *(part for column, (at, value) in MINIMA.items() for part in minimum(column, at, value, flown, means)),
        *(trend(column, axis, sign, flown) for column, axes in TRENDS.items() for axis, sign in axes.items()),
        Measured(
            "alignment.f_collision",
            "f_collision",
            "r_s = 20 cm, r_a = 30 cm less r_a = 0 cm",
            _gap(flown, "f_collision", (20, 30), (20, 0)),
        ),
        Measured(
            "separation.f_collision",
            "f_collision",
            "r_a = 30 cm, r_s = 0 cm less r_s = 30 cm",
            _gap(flown, "f_collision", (0, 30), (30, 30)),
        ),
    ]


def minimum(column: str, at: tuple[int, int], value: float, flown: pd.DataFrame, means: pd.DataFrame) -> list[Measured]:
    """Value and place of a minimum that a caption prints."""
    least: Any = means[column].idxmin()
    values = flown.loc[at, column]
    note = f"least of ours {means[column].min():.3g} at {_cm(least)}; median here {values.median():.3g}"
    return [
        at_minimum(column, at, value, values, note),
        Measured(f"minimum.{column}.place", f"rank by {column}", _at(at), _rank(means[column], at), note),
    ]


def seldom(flown: pd.DataFrame) -> Measured:
    """The value of the minimum of collisions by as many flights as settle it."""
    at, value = MINIMA["f_collision"]
    values = flown.loc[at, "f_collision"]
    return at_minimum("f_collision", at, value, values, f"median {values.median():.3g}")


def at_minimum(column: str, at: tuple[int, int], value: float, flown: pd.Series, note: str) -> Measured:
    """Value of a minimum that a caption prints, by flights at its place."""
    found = statistics.mean(flown)
    p = statistics.welch(found, value, found.sd or 0.0, FLIGHTS)  # the caption has no SD: ours for both
    return Measured(f"minimum.{column}.value", column, _at(at), found, note, p)


def trend(column: str, axis: int, sign: int, flown: pd.DataFrame) -> Measured:
    """Share of the steps from one radius to the next that are wrong beyond the 95 % interval, or change nothing."""
    places = sorted(set(flown.index.droplevel(2)))
    wrong = []
    for place in places:
        following = (place[0] + 10, place[1]) if axis == 0 else (place[0], place[1] + 10)
        if following in places:
            gap = _gap(flown, column, following, place)
            against = (gap.high or 0.0) < 0.0 if sign > 0 else (gap.low or 0.0) > 0.0
            wrong.append(bool(against or gap.ours == 0.0))
    name = ("r_s", "r_a")[axis]
    note = f"{sum(wrong)} of {len(wrong)} steps"
    share = statistics.one(float(np.mean(wrong)), len(flown))
    return Measured(
        f"trend.{column}.{name}", f"steps with the wrong sign, {column}", f"steps of 10 cm in {name}", share, note
    )


def distance(part: str, column: str, flown: pd.DataFrame, means: pd.DataFrame, figures: pd.DataFrame) -> Measured:
    """Root mean square distance of one surface to the digitised figure."""
    off = (means[column] - figures[column]).dropna()
    at = "all configurations"
    if part == "synchronous":
        off = off[off.index.get_level_values(1) != NOISY_COLUMN]
        at = f"without the column r_a = {NOISY_COLUMN}"
    worst = off.abs().idxmax()
    rmse = statistics.one(float(np.sqrt((off**2).mean())), len(flown))
    return Measured(
        f"{part}.rmse.{column}", column, f"RMS distance, {at}", rmse, f"largest at {_cm(worst)}: {off[worst]:+.3f}"
    )


def row_without_separation(part: str, means: pd.DataFrame, figures: pd.DataFrame) -> Measured:
    """The row r_s = 0, where everybody collides; synchronous boids differ at (0, 0), which is left out."""
    off = (means["quality"] - figures["quality"]).dropna().xs(0, level=0)
    off = off.drop(0) if part == "synchronous" and 0 in off.index else off
    worst = off.abs().idxmax()
    return Measured(
        f"{part}.row.0",
        "quality",
        "r_s = 0 cm, largest distance",
        statistics.one(float(off[worst])),
        f"at r_a = {worst} cm",
    )


def band(part: str, r_s: int, flown: pd.DataFrame) -> Measured:
    """Quality without alignment, which hardly spreads over seeds."""
    return Measured(
        f"{part}.band.{r_s}", "quality", f"r_s = {r_s} cm, r_a = 0 cm", statistics.mean(flown.loc[(r_s, 0), "quality"])
    )


def by_eq_18(flown: pd.DataFrame) -> Measured:
    """The same at the densest flock with every colliding boid counted."""
    found = statistics.mean(flown.loc[(DENSE, 0), "quality"])
    return Measured("eq_18.band.10", "quality", f"r_s = {DENSE} cm, r_a = 0 cm", found)


def _peak(means: pd.DataFrame, runs: int) -> statistics.Estimate:
    return statistics.one(float(means["quality"].max()), runs)


def _rank(values: pd.Series, at: tuple[int, int]) -> statistics.Estimate:
    return statistics.one(float(values.rank()[at]))


def _gap(flown: pd.DataFrame, column: str, a: tuple[int, int], b: tuple[int, int]) -> statistics.Estimate:
    return statistics.difference(flown.loc[a, column], flown.loc[b, column])


def _at(place: tuple[int, int]) -> str:
    return f"r_s = {place[0]} cm, r_a = {place[1]} cm"


def _cm(place: Any) -> str:
    return f"({int(place[0])}, {int(place[1])}) cm"
