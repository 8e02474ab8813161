"""Fit the radio to a table of packets: delay, clocks, and the share received by distance."""

import math
from dataclasses import dataclass, field
from functools import cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import lsq_linear, minimize

from airflock.core import PacketParameters
from airflock.estimate.identification.body_and_sensor import hessian
from airflock.estimate.identification.vehicle_logs import FlightLogs
from airflock.parts.radios import links, table
from airflock.support import RecordingError

TABLE_KEYS: tuple[str, ...] = tuple(f"radio.received_{n}" for n in range(table.ENTRIES))
COLUMNS = ("receiver", "sender", "t", "stamp")
# what tables of companion computers call these columns
ALIASES = {"rx": "receiver", "tx": "sender", "t_rx": "t", "t_tx": "stamp", "rx_time": "t", "tx_time": "stamp"}
NUMBERS = ("t", "stamp", "distance", "got", "fast", "slow", "seq")
OLDEST = 60.0  # s; no radio brings packets so late (radio.delay ends at 30 s)
# half of an interval, relative, beyond which a number is refused. At 20 % one fleet in twenty may
# be 65 % off and raise the rms from 1.8 to 17 %; at 15 % the worst was 13.8 %.
WIDEST = {"near": 0.15, "far": 0.1, "received_near": 0.1, "received_far": 0.15}
FEW = 500  # rows below which no curve is fitted
EXPECTED = 20.0  # packets that a curve would still bring; where none came, the radio's range ends before
INSIDE = 0.9  # share of that end within which a curve is fitted, for distances are measured with errors
MANY = 20  # packets due in a metre of distance, above which pairs count as having flown there


@dataclass
class RadioFit:
    """Fit of the radio: values and 95 % intervals by key of [radio]; reasons for refused ones; bins for a picture."""

    value: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    refused: dict[str, str]
    notes: list[str]
    picture_bins: pd.DataFrame


class CurveParameters(NamedTuple):
    """The radio's parameters that `parts.radios.links.received` reads."""

    near: float
    far: float
    received_near: float
    received_far: float


def curve_parameters(k: PacketParameters) -> links.Parameters:
    """Return the numbers from which reception curves are fitted; the defaults for a radio without such numbers."""
    return k if isinstance(k, links.Parameters) else links.Parameters(delay=k.delay, range=k.range)


@cache
def _kernel() -> Any:
    """Compile the probability that nothing arrives, by row, from the rule itself."""
    from numba import njit
    from numba.extending import register_jitable

    register_jitable(links.share)  # which the rule calls
    received = njit(links.received)

    @njit
    def kernel(distance, fast, slow, k):  # type: ignore[no-untyped-def]
        missed = np.ones(len(distance))
        # The rule itself is compiled in, so that the fitted curve is the one that flights use.
        for row in range(len(distance)):
            for link in range(2):
                sent = fast[row] if link == 0 else slow[row]
                arrives = received(distance[row], float(link), k)
                whole = np.floor(sent + 1e-9)
                # a packet that is sent in a share of the decisions, where the log does not tell in
                # which
                missed[row] *= (1.0 - arrives) ** whole * (1.0 - (sent - whole) * arrives)
            missed[row] = min(max(missed[row], 1e-9), 1.0 - 1e-9)
        return missed

    return kernel


def check_packets(heard: pd.DataFrame, where: str = "heard") -> pd.DataFrame:
    """Return a table of packets with the needed columns; raise RecordingError with all errors otherwise.

    where : its name in errors; rows are counted as an editor does, the header being the first
    """
    heard = heard.rename(columns={other: name for other, name in ALIASES.items() if name not in heard})
    lacking = [name for name in COLUMNS if name not in heard]
    if lacking:
        raise RecordingError(
            f"{where}: no column {', '.join(lacking)}; give receiver, sender, t (receiver's clock, s), "
            "stamp (sender's clock, s), and for reception distance (m) and got (0 or 1, one row per decision and "
            "pair), or seq (the sender's number of each packet, one row per packet that came)"
        )
    numbers = {name: pd.to_numeric(heard[name], errors="coerce") for name in NUMBERS if name in heard}
    came = numbers["got"] > 0 if "got" in numbers else pd.Series(True, heard.index)
    errors = []
    for name, values in numbers.items():
        needed = came if name in ("t", "stamp") else pd.Series(True, heard.index)  # what never came has no stamp
        bad = needed & ~np.isfinite(values.astype(float))
        odd, what = (~values.isin([0, 1]), "0 or 1") if name == "got" else (bad, "a number")
        if odd.any():
            row = int(np.flatnonzero(odd)[0])
            errors.append(f"{where}: column {name}, row {row + 2}: {heard[name].iloc[row]} is not {what}")
    if errors:
        raise RecordingError("\n".join(errors))
    found = heard.assign(**numbers)
    late = fit_delay(found)
    if not late.reason and late.value > OLDEST:
        raise RecordingError(
            f"{where}: packets are {late.value:.3g} s old when they come; give t and stamp in s: divide them by 1e6 "
            "if they count microseconds, by 1e3 if milliseconds"
        )
    return found


def lost_by_sequence(heard: pd.DataFrame, logs: FlightLogs, comparable: bool) -> tuple[pd.DataFrame, list[str]]:
    """Return a row with got and distance for each packet that was sent, from those that came; and notes.

    heard      : one row per packet that came, with seq, which counts the packets of each sender
    comparable : the logs are on one clock, to which stamps are put by the ages of packets

    Packets count as sent on the fast link. Losses are gaps of seq between two packets that came;
    the stamp of a lost one lies between theirs. Distances are those of the two logs at that time;
    rows outside of either are left out.
    """
    if not comparable:
        return heard, ["no losses from seq: the clocks of the logs are not known to agree (--same-clock)"]
    ahead = fit_delay(heard).ahead
    number = {name: k for k, name in enumerate(logs.names)}
    parts: list[pd.DataFrame] = []
    again = 0
    for (receiver, sender), own in heard.groupby(["receiver", "sender"]):
        if str(receiver) not in number or str(sender) not in number:
            continue
        own = own.sort_values("stamp")  # packets may overtake each other, and come twice
        own = own[own["seq"].diff() != 0]
        # A counter that wraps around or starts again would look like thousands of losses.
        run = (own["seq"].diff() < 0).cumsum()
        again += int(run.max())
        for _, part in own.groupby(run):
            came = part["seq"].to_numpy(np.int64)
            sent = np.arange(came[0], came[-1] + 1)
            stamp = np.interp(sent, came, part["stamp"].to_numpy(float)) - ahead.get(str(sender), 0.0)
            parts.append(pd.DataFrame({
                "receiver": receiver, "sender": sender, "got": np.isin(sent, came).astype(float),
                "fast": 1.0, "slow": 0.0, "distance": _apart(logs, number[str(receiver)], number[str(sender)], stamp),
            }))  # fmt: skip
    if not parts:
        return heard, ["no losses from seq: receiver and sender are no names of the logs: " + ", ".join(logs.names)]
    found = pd.concat(parts, ignore_index=True)
    found = found[np.isfinite(found["distance"])]
    notes = [f"losses from gaps of seq ({1.0 - found['got'].mean():.1%} of {len(found)}), distances from the positions"]
    return found, notes + [f"seq starts again {again} times; nothing counts as lost there"] * (again > 0)


def _apart(logs: FlightLogs, one: int, other: int, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return distances (m) of two drones at times; nan outside of the log of either."""
    places = []
    for rows in (logs.of(one), logs.of(other)):
        own = logs.time[rows]
        columns = logs.position[rows].T
        places.append(np.array([np.interp(time, own, column, np.nan, np.nan) for column in columns]))
    found: NDArray[np.float64] = np.linalg.norm(places[0] - places[1], axis=0)
    return found


@dataclass
class DelayFit:
    """Fit of radio.delay with its 95 % interval, a reason to refuse it, scatter of packets, clocks ahead by name, all
    s.
    """

    value: float
    interval: tuple[float, float]
    reason: str = ""
    scatter: float = float("nan")
    ahead: dict[str, float] = field(default_factory=dict)


def fit_delay(heard: pd.DataFrame) -> DelayFit:
    """Fit the age of packets and the clocks of the drones by least squares.

    The age of a packet is delay + clock of the receiver - clock of the sender; with both directions
    of a pair the clocks cancel. An asymmetry of the two directions cannot be separated from an
    offset of the clocks.
    """
    got = heard[heard["got"] > 0] if "got" in heard else heard
    names = pd.unique(pd.concat([got["receiver"], got["sender"]]))
    i, j = (pd.Categorical(got[name], names).codes.astype(int) for name in ("receiver", "sender"))
    age = (got["t"] - got["stamp"]).to_numpy(float)
    n = len(names)
    key = i * n + j
    pairs, where, count = np.unique(key, return_inverse=True, return_counts=True)
    mean = np.bincount(where, age) / count
    # Only pairs heard both ways: in one direction a clock that is ahead looks like a shorter delay.
    both = np.isin(pairs % n * n + pairs // n, pairs)
    nan = float("nan")
    if not both.any():
        return DelayFit(nan, (nan, nan), "packets in one direction only: clocks and delay cannot be separated")
    a, b = pairs[both] // n, pairs[both] % n
    design = np.zeros((both.sum() + 1, n + 1))
    rows = np.arange(both.sum())
    design[rows, a], design[rows, b] = 1.0, -1.0
    design[:-1, n] = 1.0
    # Clocks are only known relative to each other; the last row sets their mean to zero.
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


def clocks_apart(late: DelayFit) -> float:
    """Return how far the clocks of the drones are apart, s; 0 if no farther than packets scatter, or than 1 ms."""
    apart = max(late.ahead.values(), default=0.0) - min(late.ahead.values(), default=0.0)
    return apart if not late.reason and apart > max(late.scatter, late.interval[1] - late.interval[0], 1e-3) else 0.0


def fit_links(heard: pd.DataFrame, period: float, k: Any) -> RadioFit:
    """Fit the reception curve of `parts.radios.links.received` to rows of got and not got per decision and pair.

    heard  : receiver, sender, t, stamp, distance, got; if it is known, fast and slow: packets due
             on each link
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
    """Return the distance (m) beyond which nothing arrives although the curve still allows it; infinite if there is
    none.

    due : packets due and got by distance. Power falls with the square of the distance, and
          reception no faster.
    """
    some = due[due["got"] > 0]
    if not len(some):
        return float("inf")
    last = float(some["distance"].max())
    # The share at the edge, extrapolated by the inverse square, says how many packets the curve
    # would still bring beyond.
    edge = due[(due["distance"] > INSIDE * last) & (due["distance"] <= last)]
    beyond = due[due["distance"] > last]
    share = float(edge["got"].sum() / edge["due"].sum())
    return last if float((share * beyond["due"] * (last / beyond["distance"]) ** 2).sum()) > EXPECTED else float("inf")


def _refused(fit: RadioFit, bins: pd.DataFrame, rows: int) -> dict[str, str]:
    """Return the numbers of a curve that so many rows cannot identify, and why; bins: those that it was fitted to."""
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
    """Fit the entries of a radio of kind "table" to rows of got and not got per decision and pair.

    heard   : with the columns distance (m) and got (0 or 1)
    spacing : distance between one entry and the next, m

    Returns spacing and received_0 to received_15: the least-squares fit of the table's straight
    lines. An entry without a row within one spacing takes the value of the nearest one that has
    any.

    Raises RecordingError where a column is missing, no row is left, or the spacing is not positive.
    """
    shares, _ = fit_table(heard, spacing)
    return {"spacing": float(spacing), **{f"received_{n}": float(share) for n, share in enumerate(shares)}}


def fit_table(heard: pd.DataFrame, spacing: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fit the entries of a table of reception, with standard errors; nan for an entry without a row near it.

    Errors are those of independent packets, each of which arrives with the probability of its
    distance. As in `table_entries`, which says what is raised.
    """
    lacking = [name for name in ("distance", "got") if name not in heard]
    if lacking:
        raise RecordingError(f"heard: no column {', '.join(lacking)}; give distance (m) and got (0 or 1)")
    if not spacing > 0.0:
        raise RecordingError(f"spacing = {spacing:g} m is not positive")
    s, got = heard["distance"].to_numpy(float) / spacing, heard["got"].to_numpy(float)
    number = np.arange(table.ENTRIES)
    # Entries of straight lines between knots: each row is a mean of the two entries beside it, so
    # the fit is linear.
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
    """Count packets due and got by metre and by packets sent on each link: distance, fast, slow, due, got."""
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
    """Return by metre: distance, packets due, share that arrived, share of the model."""
    due = due.assign(expected=due["model"] * due["due"])
    sums = due.groupby("distance")[["due", "got", "expected"]].sum().reset_index()
    return sums.assign(share=sums["got"] / sums["due"], model=sums["expected"] / sums["due"])


# Modes of the likelihood of a reception curve, and their width. Four numbers
# (`parts.radios.links`): near, far (m) and the shares received there. The search is unbounded, in
# the numbers of `unpack`.
CURVE_PARAMETERS = ("near", "far", "received_near", "received_far")
EQUALLY_LIKELY = 3.0  # of log-likelihood: half of a chi-square at 95 % and what the descent leaves open
FARS = 20  # lengths of far that are tried, and from where the others are fitted:
SHARES, RATIOS = (0.2, 0.5), (0.0, -1.5)  # of near in far; of the far share in the near one, by its logit
# A far of 50 m hid between two tried lengths, 42.7 and 55.1 m, whose profile falls towards the
# wrong mode only.
BETWEEN = 20.0  # of log-likelihood above the best of these lengths, up to which all four are fitted from there
SAME = 0.01  # relative distance of two lengths of far up to which they are one hill
RESTARTS = 6  # of a descent
HARDLY = 1.92  # of log-likelihood: half of a chi-square at 95 %
LOOKS = 20  # at values of a number, for one end of its interval
CLOSE = 0.02  # share of half an interval to which its end is found
FLAT = 0.005  # distance of a share from 0 and 1 at which a search begins at least
NEAREST, FARTHEST = (0.1, 0.2, 1e-5, 1e-5), (1e4, 1e4, 1.0 - 1e-5, 1.0 - 1e-5)  # edges of what is looked at


def best_mode(loss: Any, farthest: float) -> list[Any]:
    """Find the best mode of the likelihood along far: a longer far hides behind a smaller share there.

    At each of many lengths of far the other three are fitted; all four are from each length that is
    better than both beside it, or likely enough for a hill to stand between it and the next.
    Returns the best, and others that are nearly as likely.
    """
    # Lengths grow by a constant factor: the likelihood depends on the ratio of far to the distances
    # flown.
    fars = np.geomspace(0.08, 0.9, FARS) * farthest
    profile = [min((_beside(loss, far, *start) for start in product(SHARES, RATIOS)), key=_fun) for far in fars]
    height = np.array([np.inf, *(_fun(found) for found in profile), np.inf])
    tops = (height[1:-1] <= height[:-2]) & (height[1:-1] <= height[2:])
    tops |= height[1:-1] < height.min() + BETWEEN
    ends = sorted((_settled(loss, pack_at_far(fars[k], profile[k].x)) for k in np.flatnonzero(tops)), key=_fun)
    found: list[Any] = []
    for each in (np.asarray(end.x) for end in ends if _fun(end) < _fun(ends[0]) + EQUALLY_LIKELY):
        if all(abs(unpack(each)[1] / unpack(other)[1] - 1.0) > SAME for other in found):
            found.append(each)
    return found


def _fun(found: Any) -> float:
    return float(found.fun)


def pack_at_far(far: float, y: Any) -> Any:
    """Return the unbounded numbers of a far (m) and of the other three: logit of near over far, then as in `unpack`."""
    near = far / (1.0 + np.exp(-np.clip(y[0], -8.0, 8.0)))
    return np.array([np.log(near), np.log(far - near), y[1], y[2]])


def _beside(loss: Any, far: float, share: float, ratio: float) -> Any:
    """Return the other three numbers at a given far."""
    start = [np.log(share / (1.0 - share)), 2.5, ratio]
    return minimize(
        lambda y: loss(pack_at_far(far, y)), start, method="Nelder-Mead", options={"maxiter": 120, "fatol": 0.05}
    )


def _settled(loss: Any, z: Any) -> Any:
    """Descend in all four numbers, several times: a simplex that has shrunk on a slope is spread again."""
    options = {"maxiter": 400, "xatol": 1e-3, "fatol": 1e-2}
    found = minimize(loss, z, method="Nelder-Mead", options=options)
    for _ in range(RESTARTS):
        before = _fun(found)
        found = minimize(loss, found.x, method="Nelder-Mead", options=options)
        if _fun(found) > before - 0.1:
            break
    return found


def unpack(z: Any) -> tuple[float, float, float, float]:
    """Give near, far (m), received_near, received_far from unbounded numbers."""
    near = float(np.exp(z[0]))
    high = 1.0 / (1.0 + np.exp(-z[2]))
    return near, near + float(np.exp(z[1])), float(high), float(high / (1.0 + np.exp(-z[3])))


def pack(near: float, far: float, received_near: float, received_far: float) -> Any:
    """Return the unbounded numbers of `unpack`; shares of 0 and 1 are moved to the edge of the searched range."""
    high = _logit(received_near)
    return np.array([np.log(near), np.log(max(far - near, 1e-5)), high, _logit(received_far * (1.0 + np.exp(-high)))])


def profile_intervals(loss: Any, z: Any) -> dict[str, tuple[float, float]]:
    """Return 95 % intervals: the range of each number where the likelihood is hardly lower (its profile).

    At each value of a number the other three are fitted again. Curvature says too little where a
    share is nearly 1, or where far and the share there make up for each other along a ridge.
    """
    lowest_loss, spread, values = float(loss(z)), _spread(loss, z), unpack(z)
    ends = np.array([values, values])
    # Each end of each number by itself; likely points on the way to one end may widen the interval
    # of another number.
    for k in range(len(CURVE_PARAMETERS)):
        for row, side in enumerate((-1.0, 1.0)):
            end, likely = _end(loss, values, lowest_loss, k, side, float(spread[k]))
            for place in likely:  # numbers that are likely enough together are so for each of them
                ends = np.array([np.minimum(ends[0], place), np.maximum(ends[1], place)])
            ends[row, k] = max(side * ends[row, k], side * end) * side
    return {name: (float(low), float(high)) for name, low, high in zip(CURVE_PARAMETERS, *ends, strict=True)}


def _end(
    loss: Any, values: tuple[float, ...], lowest_loss: float, k: int, side: float, wide: float
) -> tuple[float, list[Any]]:
    """Return the value of number k on one side where its profile reaches the limit, and likely numbers on the way.

    values : the likeliest four numbers; wide : a guess of how far the end is
    """
    likely: list[Any] = []
    edge = (FARTHEST if side > 0.0 else NEAREST)[k]
    near, there = values[k], np.asarray(values)  # within the limit so far, and all numbers there
    step, low, high = float(np.clip(wide, 0.01 * near, 0.3 * near)), -(HARDLY**0.5), math.inf
    beyond = near
    # First double the step until the likelihood is too low, then regula falsi on the root of the
    # loss, which is nearly straight.
    for _ in range(LOOKS):
        if math.isinf(high):  # farther, until the likelihood is too low
            beyond = near + side * step
            beyond = min(beyond, edge) if side > 0.0 else max(beyond, edge)
            tried, step = beyond, 2.0 * step
        else:  # the root of the loss grows as a straight line: where that meets the limit
            tried = near + (beyond - near) * float(np.clip(low / (low - high), 0.1, 0.9))
        off, place = _others(loss, k, tried, there)
        above = max(off - lowest_loss, 0.0) ** 0.5 - HARDLY**0.5
        if above > 0.0:
            beyond, high = tried, above
        else:
            near, low, there = tried, above, place
            likely.append(place)
        if near == edge or (abs(beyond - near) < CLOSE * abs(beyond - values[k]) and not math.isinf(high)):
            break
    return (near if math.isinf(high) else near + (beyond - near) * low / (low - high)), likely


def _others(loss: Any, k: int, value: float, there: Any) -> tuple[float, Any]:
    """Return the least loss with number k fixed, and all four numbers there; numbers elsewhere are the start."""

    # Four numbers by the free three, so that near stays below far and the far share below the near
    # one.
    def all_four(y: Any) -> Any:
        one, two, three = np.clip(y, -11.9, 11.9)
        if k == 1:
            near, far, high = value * _share(one), value, _share(two)
        else:
            near = value if k == 0 else float(np.exp(one))
            far = near + float(np.exp(one if k == 0 else two))
            high = value if k == 2 else _share(two)
        if k == 3:
            return near, far, value + (1.0 - value) * _share(three), value
        return near, far, high, high * _share(three)

    near, far, high, low = there
    gap, top, ratio = (  # not on the plateau at a share of 1, where nothing has a slope
        float(np.log(max(far - near, 0.01))), _logit(high, FLAT), _logit(low / high, FLAT)
    )  # fmt: skip
    start = {
        0: (gap, top, ratio),
        1: (_logit(near / far, FLAT), top, ratio),
        2: (float(np.log(near)), gap, ratio),
        3: (float(np.log(near)), gap, _logit((high - value) / (1.0 - value), FLAT)),
    }[k]
    simplex = np.vstack([start, *(np.asarray(start) + 0.1 * side for side in np.eye(3))])
    found = minimize(
        lambda y: loss(pack(*all_four(y))), start, method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxiter": 250, "fatol": 0.01, "xatol": 0.01},
    )  # fmt: skip
    return _fun(found), np.asarray(all_four(found.x))


def _share(y: float) -> float:
    return float(1.0 / (1.0 + np.exp(-y)))


def _logit(share: float, edge: float = 1e-5) -> float:
    inside = min(max(share, edge), 1.0 - edge)
    return float(np.log(inside / (1.0 - inside)))


def _spread(loss: Any, z: Any) -> Any:
    """Return half of 95 % intervals, by the curvature and the derivative of the numbers by the fitted ones."""
    step = 0.02
    unit = np.eye(len(z)) * step
    by = np.array([(np.array(unpack(z + u)) - np.array(unpack(z - u))) / (2 * step) for u in unit]).T
    return 1.96 * np.sqrt(np.clip(np.diag(by @ np.linalg.pinv(hessian(loss, z, step)) @ by.T), 0.0, None))
