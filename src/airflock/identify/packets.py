"""Radio from packets that were heard: age and clocks by least squares, reception by distance by likelihood."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import minimize

from airflock.body import radio
from airflock.errors import RecordingError

LINKS = ("near", "far", "received_near", "received_far")
COLUMNS = ("receiver", "sender", "t", "stamp")
FEW = 500  # rows below which no curve is fitted


@dataclass
class RadioFit:
    """Values and 95 % intervals by key of the section [radio]; reasons for what is refused; bins for a picture."""

    value: dict[str, float]
    interval: dict[str, tuple[float, float]]
    refused: dict[str, str]
    notes: list[str]
    bins: pd.DataFrame


def checked(heard: pd.DataFrame) -> pd.DataFrame:
    """A table of packets with the columns that are needed; raises RecordingError otherwise."""
    lacking = [name for name in COLUMNS if name not in heard]
    if lacking:
        raise RecordingError(
            f"heard: no column {', '.join(lacking)}; give receiver, sender, t (receiver's clock, s), "
            "stamp (sender's clock, s), and for reception distance (m) and got (0 or 1, one row per decision and pair)"
        )
    return heard


def fit_delay(heard: pd.DataFrame) -> tuple[float, tuple[float, float], str, float]:
    """Give radio.delay, its interval, a reason to refuse it, and the scatter of single packets, all s.

    The age of a packet is delay + clock of the receiver - clock of the sender; with both directions of a pair the
    clocks cancel. An asymmetry of the two directions cannot be told from an offset of the clocks.
    """
    got = heard[heard["got"] > 0] if "got" in heard else heard
    names = pd.unique(pd.concat([got["receiver"], got["sender"]]))
    i, j = (pd.Categorical(got[name], names).codes.astype(int) for name in ("receiver", "sender"))
    age = (got["t"] - got["stamp"]).to_numpy(float)
    n = len(names)
    key = i * n + j
    pairs, where, count = np.unique(key, return_inverse=True, return_counts=True)
    mean = np.bincount(where, age) / count
    both = np.isin(pairs % n * n + pairs // n, pairs)
    nan = float("nan")
    if not both.any():
        return nan, (nan, nan), "packets of one direction only: clocks and delay cannot be told apart", nan
    a, b = pairs[both] // n, pairs[both] % n
    design = np.zeros((both.sum() + 1, n + 1))
    rows = np.arange(both.sum())
    design[rows, a], design[rows, b] = 1.0, -1.0
    design[:-1, n] = 1.0
    design[-1, :n] = 1.0
    weight = np.append(np.sqrt(count[both]), 1e3)
    target = np.append(mean[both], 0.0)
    found, *_ = np.linalg.lstsq(design * weight[:, None], target * weight, rcond=None)
    left = target[:-1] - design[:-1] @ found
    scatter = float(np.sqrt(np.mean((age - mean[where]) ** 2)))
    freedom = max(int(both.sum()) - n, 1)
    error = float(np.sqrt((count[both] * left**2).sum() / freedom / count[both].sum()))
    wide = 1.96 * max(error, scatter / np.sqrt(len(age)))
    delay = float(found[n])
    return delay, (delay - wide, delay + wide), "", scatter


def fit_links(heard: pd.DataFrame, period: float, k: Any) -> RadioFit:
    """Reception curve of `body.radio.received` from rows of got and not got per decision and pair.

    period : time between decisions, s; k: radio parameters whose rates of packets are kept
    """
    nan = float("nan")
    empty = RadioFit(dict.fromkeys(LINKS, nan), dict.fromkeys(LINKS, (nan, nan)), {}, [], pd.DataFrame())
    lacking = [name for name in ("distance", "got") if name not in heard]
    if lacking or len(heard) < FEW:
        reason = (
            f"no column {lacking[0]} in the table of packets" if lacking else f"{len(heard)} rows are fewer than {FEW}"
        )
        empty.refused = dict.fromkeys(LINKS, reason)
        return empty
    edges = np.floor(heard["distance"].to_numpy(float)).astype(int)
    total = np.bincount(edges)
    hits = np.bincount(edges, heard["got"].to_numpy(float))
    summed = np.bincount(edges, heard["distance"].to_numpy(float))
    used = total > 0
    n, g, d = total[used], hits[used], summed[used] / total[used]
    rates = [rate * period for rate in (k.fast_rate, k.slow_rate)]

    def curve(z: Any) -> Any:
        p = SimpleNamespace(**dict(zip(LINKS, unpacked(z), strict=True)))
        missed = np.ones(len(d))
        for slow, rate in enumerate(rates):
            arrives = np.array([radio.received(x, float(slow), p) for x in d])
            whole, part = int(rate + 1e-9), rate - int(rate + 1e-9)
            # a packet that is sent in a share of the decisions, whose phase the log does not tell
            missed *= (1.0 - arrives) ** whole * (1.0 - part * arrives)
        return np.clip(missed, 1e-9, 1.0 - 1e-9)

    def loss(z: Any) -> float:
        if np.abs(z).max() > 12.0:
            return 1e15
        missed = curve(z)
        return float(-(g * np.log(1.0 - missed) + (n - g) * np.log(missed)).sum())

    starts = ([2.7, 3.4, 3.0, -0.5], [2.3, 2.5, 1.0, 0.5], [3.3, 3.0, 2.0, -1.0])
    options = {"maxiter": 1500, "xatol": 1e-3, "fatol": 1e-2}
    best = min((minimize(loss, s, method="Nelder-Mead", options=options) for s in starts), key=lambda f: float(f.fun))
    z = np.asarray(best.x)
    value = dict(zip(LINKS, unpacked(z), strict=True))
    interval = _intervals(loss, z)
    found = RadioFit(
        value, interval, {}, [], pd.DataFrame({"distance": d, "due": n, "share": g / n, "model": 1.0 - curve(z)})
    )
    reach = float(d[n > 20].max()) if (n > 20).any() else 0.0
    if value["far"] > reach:
        for name in ("far", "received_far"):
            found.refused[name] = f"nobody flew farther apart than {reach:.0f} m: fly pairs to {2 * reach:.0f} m"
    return found


def unpacked(z: Any) -> tuple[float, float, float, float]:
    """Give near, far (m), received_near, received_far from unbounded numbers."""
    near = float(np.exp(z[0]))
    high = 1.0 / (1.0 + np.exp(-z[2]))
    return near, near + float(np.exp(z[1])), float(high), float(high / (1.0 + np.exp(-z[3])))


def _intervals(loss: Any, z: Any) -> dict[str, tuple[float, float]]:
    """95 % intervals by the curvature and the derivative of the numbers by what is fitted."""
    step, size = 0.02, len(z)
    unit, curve = np.eye(size) * step, np.zeros((size, size))
    for i in range(size):
        for j in range(size):
            curve[i, j] = (
                loss(z + unit[i] + unit[j]) - loss(z + unit[i] - unit[j])
                - loss(z - unit[i] + unit[j]) + loss(z - unit[i] - unit[j])
            ) / (4.0 * step * step)  # fmt: skip
    by = np.array([(np.array(unpacked(z + u)) - np.array(unpacked(z - u))) / (2 * step) for u in unit]).T
    spread = np.sqrt(np.clip(np.diag(by @ np.linalg.pinv(curve) @ by.T), 0.0, None))
    return {n: (v - 1.96 * s, v + 1.96 * s) for n, v, s in zip(LINKS, unpacked(z), spread, strict=True)}
