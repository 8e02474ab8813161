"""Radio from packets that were heard: age and clocks by least squares, reception by distance by likelihood."""

from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from airflock.core import PacketParameters
from airflock.estimate.identification.hills import CURVE_PARAMETERS, best_mode, profile_intervals, unpack
from airflock.parts.radios import links, table
from airflock.support import RecordingError

TABLE_KEYS = tuple(f"radio.received_{n}" for n in range(table.ENTRIES))
COLUMNS = ("receiver", "sender", "t", "stamp")
NUMBERS = ("t", "stamp", "distance", "got", "fast", "slow")
OLDEST = 60.0  # s; no radio brings packets so late (radio.delay ends at 30 s)
# half of an interval, relative, beyond which a number is not told
WIDEST = {"near": 0.15, "far": 0.1, "received_near": 0.1, "received_far": 0.15}
FEW = 500  # rows below which no curve is fitted
EXPECTED = 20.0  # packets that a curve would still bring; where none came, the radio's range ends before
INSIDE = 0.9  # share of that end within which a curve is fitted, for distances are measured with errors
MANY = 20  # packets due in a metre of distance, above which pairs count as having flown there


@dataclass
class RadioFit:
    """Values and 95 % intervals by key of the section [radio]; reasons for what is refused; bins for a picture."""

    value: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    refused: dict[str, str]
    notes: list[str]
    picture_bins: pd.DataFrame


class CurveParameters(NamedTuple):
    """What `parts.radios.links.received` reads of the radio's parameters."""

    near: float
    far: float
    received_near: float
    received_far: float


def curve_parameters(k: PacketParameters) -> links.Parameters:
    """Numbers of a radio by which reception curves are fitted; the usual ones of a radio that has none of its own."""
    return k if isinstance(k, links.Parameters) else links.Parameters(delay=k.delay, range=k.range)


@cache
def _kernel() -> Any:
    """Probability that nothing arrives, by row, compiled from the rule itself."""
    from numba import njit
    from numba.extending import register_jitable

    register_jitable(links.share)  # which the rule calls
    received = njit(links.received)

    @njit
    def kernel(distance, fast, slow, k):  # type: ignore[no-untyped-def]
        missed = np.ones(len(distance))
        for row in range(len(distance)):
            for link in range(2):
                sent = fast[row] if link == 0 else slow[row]
                arrives = received(distance[row], float(link), k)
                whole = np.floor(sent + 1e-9)
                # a packet that is sent in a share of the decisions, where the log does not tell in which
                missed[row] *= (1.0 - arrives) ** whole * (1.0 - (sent - whole) * arrives)
            missed[row] = min(max(missed[row], 1e-9), 1.0 - 1e-9)
        return missed

    return kernel


def check_packets(heard: pd.DataFrame, where: str = "heard") -> pd.DataFrame:
    """A table of packets with the columns that are needed; raises RecordingError otherwise, with every fault.

    where : its name in faults; rows are counted as an editor does, the header being the first
    """
    lacking = [name for name in COLUMNS if name not in heard]
    if lacking:
        raise RecordingError(
            f"{where}: no column {', '.join(lacking)}; give receiver, sender, t (receiver's clock, s), "
            "stamp (sender's clock, s), and for reception distance (m) and got (0 or 1, one row per decision and pair)"
        )
    numbers = {name: pd.to_numeric(heard[name], errors="coerce") for name in NUMBERS if name in heard}
    came = numbers["got"] > 0 if "got" in numbers else pd.Series(True, heard.index)
    faults = []
    for name, values in numbers.items():
        needed = came if name in ("t", "stamp") else pd.Series(True, heard.index)  # what never came has no stamp
        bad = needed & ~np.isfinite(values.astype(float))
        odd, what = (~values.isin([0, 1]), "0 or 1") if name == "got" else (bad, "a number")
        if odd.any():
            row = int(np.flatnonzero(odd)[0])
            faults.append(f"{where}: column {name}, row {row + 2}: {heard[name].iloc[row]} is not {what}")
    if faults:
        raise RecordingError("\n".join(faults))
    found = heard.assign(**numbers)
    late = fit_delay(found)
    if not late.reason and late.value > OLDEST:
        raise RecordingError(
            f"{where}: packets are {late.value:.3g} s old when they come; give t and stamp in s: divide them by 1e6 "
            "if they count microseconds, by 1e3 if milliseconds"
        )
    return found


@dataclass
class DelayFit:
    """radio.delay and its 95 % interval, a reason to refuse it, scatter of packets, clocks ahead by name, all s."""

    value: float
    interval: tuple[float, float]
    reason: str = ""
    scatter: float = float("nan")
    ahead: dict[str, float] = field(default_factory=dict)


def fit_delay(heard: pd.DataFrame) -> DelayFit:
    """Fit the age of packets and the clocks of the drones by least squares.

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
        return DelayFit(nan, (nan, nan), "packets in one direction only: clocks and delay cannot be separated")
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
    ahead = {str(name): float(offset) for name, offset in zip(names, found[:n], strict=True)}
    return DelayFit(delay, (delay - wide, delay + wide), "", scatter, ahead)


def fit_links(heard: pd.DataFrame, period: float, k: Any) -> RadioFit:
    """Reception curve of `parts.radios.links.received` from rows of got and not got per decision and pair.

    heard  : receiver, sender, t, stamp, distance, got; if it is known, fast and slow: packets due on each link
    period : time between decisions, s; k: radio parameters whose rates of packets are kept
    """
    nan = float("nan")
    empty = RadioFit(
        dict.fromkeys(CURVE_PARAMETERS, nan), dict.fromkeys(CURVE_PARAMETERS, (nan, nan)), {}, [], pd.DataFrame()
    )
    lacking = [name for name in ("distance", "got") if name not in heard]
    if lacking or len(heard) < FEW:
        reason = (
            f"no column {lacking[0]} in the table of packets" if lacking else f"{len(heard)} rows are fewer than {FEW}"
        )
        empty.refused = dict.fromkeys(CURVE_PARAMETERS, reason)
        return empty
    every = _due(heard, period, k)
    end = radio_range(every)
    due = every[every["distance"] <= INSIDE * end]
    d, n, g = (due[name].to_numpy(float) for name in ("distance", "due", "got"))
    fast, slow = due["fast"].to_numpy(float), due["slow"].to_numpy(float)
    kernel = _kernel()

    def curve(z: Any) -> Any:
        return kernel(d, fast, slow, CurveParameters(*unpack(z)))

    def loss(z: Any) -> float:
        if np.abs(z).max() > 12.0:
            return 1e15
        missed = curve(z)
        return float(-(g * np.log(1.0 - missed) + (n - g) * np.log(missed)).sum())

    z, *others = best_mode(loss, float(d.max()))
    value = dict(zip(CURVE_PARAMETERS, unpack(z), strict=True))
    interval = profile_intervals(loss, z)
    for other in others:  # a second hill of the likelihood belongs to the interval as well
        for name, (low, high) in profile_intervals(loss, other).items():
            interval[name] = min(low, interval[name][0]), max(high, interval[name][1])
    fitted = 1.0 - kernel(
        *(every[name].to_numpy(float) for name in ("distance", "fast", "slow")), CurveParameters(*unpack(z))
    )
    shown = _pictured(every.assign(model=np.where(every["distance"] <= end, fitted, 0.0)))
    notes = [f"no packet from beyond {end:.0f} m, where the curve would bring some: the radio's range"]
    found = RadioFit(value, interval, {}, notes if np.isfinite(end) else [], shown)
    found.refused = _refused(found, shown[shown["distance"] <= INSIDE * end], len(heard))
    return found


def radio_range(due: pd.DataFrame) -> float:
    """Distance (m) beyond which nothing is heard although reception would still allow it; infinite if there is none.

    due : packets due and got by distance. Power falls with the square of the distance, and reception no faster.
    """
    some = due[due["got"] > 0]
    if not len(some):
        return float("inf")
    last = float(some["distance"].max())
    edge = due[(due["distance"] > INSIDE * last) & (due["distance"] <= last)]
    beyond = due[due["distance"] > last]
    share = float(edge["got"].sum() / edge["due"].sum())
    return last if float((share * beyond["due"] * (last / beyond["distance"]) ** 2).sum()) > EXPECTED else float("inf")


def _refused(fit: RadioFit, bins: pd.DataFrame, rows: int) -> dict[str, str]:
    """Numbers of a reception curve that so many rows cannot tell, and why not; bins: those that it was fitted to."""
    flown = bins["distance"][bins["due"] > MANY]
    closest, farthest = (float(flown.min()), float(flown.max())) if len(flown) else (0.0, 0.0)
    refused: dict[str, str] = {}
    if fit.intervals["near"][0] < closest:
        reason = f"nobody flew closer than {closest:.0f} m, and reception may be even only below: fly pairs"
        refused |= dict.fromkeys(("near", "received_near"), reason)
    if fit.value["far"] > farthest:
        reason = f"nobody flew farther apart than {farthest:.0f} m: fly pairs to {2 * farthest:.0f} m"
        refused |= dict.fromkeys(("far", "received_far"), reason)
    for name in CURVE_PARAMETERS:
        low, high = fit.intervals[name]
        half = 0.5 * (high - low) / fit.value[name]
        if half > WIDEST[name] and name not in refused:
            refused[name] = f"only known to ± {half:.0%} from {rows} rows: fly more, and pairs farther apart"
    return refused


def table_entries(heard: pd.DataFrame, spacing: float) -> dict[str, float]:
    """Entries of a radio of kind "table" from rows of got and not got per decision and pair.

    heard   : with the columns distance (m) and got (0 or 1)
    spacing : distance between one entry and the next, m

    Returns spacing and received_0 to received_15: the least-squares fit of the table's straight lines. An entry without
    a row within one spacing takes the value of the nearest one that has any.

    Raises RecordingError where a column is missing, no row is left, or the spacing is not positive.
    """
    shares, _ = fit_table(heard, spacing)
    return {"spacing": float(spacing), **{f"received_{n}": float(share) for n, share in enumerate(shares)}}


def fit_table(heard: pd.DataFrame, spacing: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Entries of a table of reception, and their standard errors; nan of an entry that no row is near.

    Errors are those of independent packets, each of which arrives with the probability of its distance. As in
    `table_entries`, which says what is raised.
    """
    lacking = [name for name in ("distance", "got") if name not in heard]
    if lacking:
        raise RecordingError(f"heard: no column {', '.join(lacking)}; give distance (m) and got (0 or 1)")
    if not spacing > 0.0:
        raise RecordingError(f"spacing = {spacing:g} m is not positive")
    s, got = heard["distance"].to_numpy(float) / spacing, heard["got"].to_numpy(float)
    number = np.arange(table.ENTRIES)
    hats = np.maximum(1.0 - np.abs(s[:, None] - number), 0.0)
    seen = np.flatnonzero(hats.sum(axis=0) > 0.0)
    if not len(seen):
        raise RecordingError(f"heard: no pair within {table.ENTRIES * spacing:g} m; give a longer spacing")
    inside = s <= table.ENTRIES - 1
    rows = hats[np.ix_(inside, seen)]
    found = lsq_linear(rows, got[inside], (0.0, 1.0)).x
    expected = np.clip(rows @ found, 1.0 / (2.0 + len(rows)), 1.0 - 1.0 / (2.0 + len(rows)))  # never sure of 0 or 1
    inverse = np.linalg.pinv(rows.T @ rows)
    spread = inverse @ (rows.T * (expected * (1.0 - expected))) @ rows @ inverse
    errors = np.full(table.ENTRIES, np.nan)
    errors[seen] = np.sqrt(np.maximum(np.diag(spread), 0.0))
    return found[np.abs(number[:, None] - seen).argmin(axis=1)], errors


def _due(heard: pd.DataFrame, period: float, k: Any) -> pd.DataFrame:
    """Packets due and got by metre of distance and by how many each link sent: distance, fast, slow, due, got."""
    table = pd.DataFrame({"distance": heard["distance"].astype(float), "got": heard["got"].astype(float)})
    for link, rate in (("fast", k.fast_rate), ("slow", k.slow_rate)):
        table[link] = heard[link].astype(float) if link in heard else rate * period
    table["metre"] = np.floor(table["distance"])
    sums = table.groupby(["metre", "fast", "slow"]).agg(
        distance=("distance", "mean"), due=("got", "size"), got=("got", "sum")
    )
    found = sums.reset_index()
    means = (found["distance"] * found["due"]).groupby(found["metre"]).sum() / found.groupby("metre")["due"].sum()
    return found.assign(distance=found["metre"].map(means))


def _pictured(due: pd.DataFrame) -> pd.DataFrame:
    """By metre: distance, packets due, share that came, share of the model."""
    due = due.assign(expected=due["model"] * due["due"])
    sums = due.groupby("distance")[["due", "got", "expected"]].sum().reset_index()
    return sums.assign(share=sums["got"] / sums["due"], model=sums["expected"] / sums["due"])
