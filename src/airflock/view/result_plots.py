"""Plots of results: certificates, identified bodies, inferred laws, reception of the radio, and displays."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from airflock import certificates
from airflock.displays import Show
from airflock.estimate import FlightLogs, IdentifyResult, InferResult, LogCheck
from airflock.parts.bodies import held
from airflock.recordings import BINS, packet_age
from airflock.view import style
from airflock.view.flight_paths import scenario_or_none, short_name, title_details

if TYPE_CHECKING:
    from airflock.certificates import Certificate


def plot_certificate(certificate: "Certificate", *, ax: Axes | None = None) -> Figure:
    """Plot upper bounds by flights, smallest distances, tolerances of the environment, and a map of two numbers.

    Panels without data are left out.
    """
    draws = [_bounds]
    if certificate.rows and "r_min" in certificate.rows[0]:
        draws.append(_distances)
    if certificate.tolerance.get("axis"):
        draws.append(_tolerances)
    if certificate.over:
        draws.append(_bound_map)
    figure, panels = style.figure_and_panels(ax, 1, len(draws), 3.6 * len(draws) + 0.4, 3.2, layout="")
    for axes, draw, name in zip(panels[0], draws, "ABCD", strict=False):
        draw(axes, certificate)
        style.set_panel_letter(axes, name)
    verdict = "shown" if certificate.shown else "not shown"
    details = f"{verdict}, {100.0 * certificate.campaign.confidence:g} % confidence"
    return style.set_figure_title(figure, certificate.campaign.scenario.name, details)


def plot_why(why: "certificates.WhyResult | certificates.HitCauses", *, ax: Axes | None = None) -> Figure:
    """Plot the probability of the event over the time before it, one line for each thing taken away; bars: 95 %.

    Of the flights of a certificate: in how many of them each is named.
    """
    figure, axes = style.figure_and_axes(ax, 5.0, 3.2)
    if isinstance(why, certificates.HitCauses):
        table = why.table[::-1]
        axes.barh(table["without"], table["named_in"], height=0.6, color=style.BLUE)
        style.style_axes(axes, f"flights that name it, of {len(why.flights)} with an event")
        style.set_title(axes, why.name)
        return style.root_figure(figure)
    for number, name in enumerate(dict.fromkeys(row.without for row in why.rows)):
        rows = sorted((row for row in why.rows if row.without == name), key=lambda row: row.lead)
        shares = np.array([row.share for row in rows])
        bars = np.abs(np.array([[row.low for row in rows], [row.high for row in rows]]) - shares)
        color = style.LINE_COLOURS[number % len(style.LINE_COLOURS)]
        axes.errorbar(
            [row.lead for row in rows], shares, bars, fmt="o-", ms=3, lw=1.2, color=color, label=why.change(name)
        )
    axes.set_ylim(-0.03, 1.03)
    axes.invert_xaxis()  # time runs to the right
    style.style_axes(axes, "time before the event (s)", "probability of the event")
    style.add_legend(axes, columns=2)
    style.set_title(axes, why.scenario.name, why.event)
    return style.root_figure(figure)


def _bounds(axes: Axes, certificate: "Certificate") -> None:
    """Draw the upper and lower bound of every limit at every look, and the limit itself."""
    if not any(look.flights for verdict in certificate.verdicts for look in verdict.looks):
        _empty(axes, "no flight was counted")  # a budget of no time: there is nothing on logarithmic axes
        return
    for verdict, color in zip(certificate.verdicts, style.LINE_COLOURS, strict=False):
        if verdict.looks:
            n = [look.flights for look in verdict.looks]
            highs = [look.high if look.above > 0.0 else math.nan for look in verdict.looks]  # nan: not looked at
            axes.plot(n, highs, "o-", ms=3, lw=1.2, color=color, label=verdict.limit.event)
            lows = [look.low if look.low > 0.0 else math.nan for look in verdict.looks]
            axes.plot(n, lows, "o:", ms=2, lw=1.0, color=color)
        if verdict.probability is not None:
            axes.axhline(verdict.probability, color=color, lw=0.8, ls="--")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_minor_formatter(NullFormatter())
    shown = [line for verdict in certificate.verdicts for line in (verdict.high, verdict.probability) if line]
    axes.set_ylim(
        min([look.low for v in certificate.verdicts for look in v.looks if look.low > 0.0] + shown) / 3.0, 1.0
    )
    style.style_axes(axes, "flights", "probability of a flight with an event", legend=True)


def _distances(axes: Axes, certificate: "Certificate") -> None:
    """Draw the share of flights whose smallest distance was below a value; dashed: limits on it.

    Dotted: the tail as extreme value theory extrapolates it (`extrapolated_tail`), to look at; no
    bound comes from it.
    """
    from_rows = [row.get("closest") if row.get("closest") is not None else row["r_min"] for row in certificate.rows]
    values = np.sort(np.array(from_rows, float))
    values = values[np.isfinite(values)]
    if len(values):
        axes.step(values, np.arange(1, len(values) + 1) / len(values), where="post", color=style.BLUE, lw=1.2)
        axes.set_yscale("log")
        fitted = extrapolated_tail(values)
        if fitted is not None:
            axes.plot(*fitted, ":", color=style.GREY, lw=1.2, label="extrapolated, no guarantee")
            axes.set_ylim(bottom=max(0.3 / len(values), 1e-12) / 30.0)
            style.add_legend(axes)
    for verdict in certificate.verdicts:
        if verdict.limit.score == "r_min":
            axes.axvline(verdict.limit.value, color=style.RED, lw=0.8, ls="--")
    axes.set_xlim(left=0.0)
    style.style_axes(axes, "smallest distance in a flight (m)", "share of flights below")


def extrapolated_tail(distances: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Extrapolate the share of flights (point,) below distances (point,), m, from the nearest flights.

    distances : smallest one of each flight, growing

    A generalised Pareto distribution of how far the lowest fifth fall below its end, by moments
    (Hosking & Wallis 1987). Nearer than anybody came other causes may rule, of which it knows
    nothing. None of fewer than 100 flights.
    """
    few = len(distances) // 5
    if few < 20:
        return None
    end = float(distances[few])
    # Excesses below the 20 % quantile: enough data to fit, few enough to follow the tail alone.
    below = end - distances[:few]
    mean, variance = float(below.mean()), float(below.var(ddof=1))
    if not (mean > 0.0 and variance > 0.0):
        return None
    # Moments instead of likelihood: they always exist here, and the curve is only looked at.
    ratio = mean * mean / variance
    shape, scale = 0.5 * (1.0 - ratio), 0.5 * mean * (1.0 + ratio)
    at = np.linspace(0.0, end, 200)
    inside = 1.0 + shape * (end - at) / scale
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (
            np.exp(-(end - at) / scale) if abs(shape) < 1e-9 else np.where(inside > 0.0, inside, 0.0) ** (-1.0 / shape)
        )
    return at, few / len(distances) * np.where(inside > 0.0, share, 0.0)


def _tolerances(axes: Axes, certificate: "Certificate") -> None:
    """Draw a tornado plot: the factor by which each number may move; numbers with nominal value zero get no bar.

    Black: the interval that the scenario's file gives, as identified.
    """
    rows = sorted(
        certificate.tolerance["axis"], key=lambda axis: abs(math.log(axis["factor"])) if "factor" in axis else -1.0,
        reverse=True,
    )  # fmt: skip
    for y, axis in enumerate(rows):
        factor, unit = axis.get("factor", 1.0), axis["unit"] if axis["unit"] != "1" else ""
        axes.barh(y, factor - 1.0, left=1.0, height=0.6, color=style.BLUE)
        if "not_shown" in axis and "factor" in axis:
            axes.plot(axis["not_shown"] / axis["nominal"], y, "|", ms=10, color=style.RED)
        if "interval" in axis and "factor" in axis:
            axes.plot([end / axis["nominal"] for end in axis["interval"]], [y, y], color="black", lw=2.0)
        left, begin = factor < 1.0, "" if "factor" in axis else "0 to "
        axes.annotate(
            f"{begin}{axis['safe']:.3g} {unit}".rstrip(), (factor, y), (-4 if left else 4, 0),
            textcoords="offset points", va="center", ha="right" if left else "left", fontsize=style.SMALL_SIZE,
        )  # fmt: skip
    axes.set_xscale("log")
    axes.axvline(1.0, color=style.GREY, lw=0.6)
    axes.set_yticks(range(len(rows)), [axis["key"] for axis in rows])
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.margins(x=0.3)
    style.style_axes(axes, "safe factor on the nominal value (red: not shown)")


def _bound_map(axes: Axes, certificate: "Certificate") -> None:
    """Draw the upper bound over two numbers; the line is the level below which a cell is safe."""
    table = certificate.over
    rows, columns = (np.array(values) for values in table["axes"])
    high = np.array([cell["high"] for cell in table["cell"]]).reshape(len(rows), len(columns))
    shown = axes.pcolormesh(
        columns, rows, high, norm=LogNorm(table["level"] / 10.0, 1.0), cmap="viridis_r", shading="nearest"
    )
    if high.min() < table["level"] < high.max():
        axes.contour(columns, rows, high, levels=[table["level"]], colors=style.RED, linewidths=1.2)
    axes.plot([], [], color=style.RED, label=f"{100.0 * table['level']:g} % of flights")
    across, down = (
        key if unit == "1" else f"{key} ({unit})" for key, unit in zip(table["keys"], table["units"], strict=True)
    )
    style.style_axes(axes, down, across, grid=False)
    style.add_legend(axes, above=True)
    figure = axes.get_figure(root=True)
    assert figure is not None
    style.add_colour_bar(figure, shown, axes, "flights with an event, at most")


MAX_SECONDS = 20.0  # s of one drone in the first panel
MAX_POINTS = 4000  # points in the second
FEW = 20  # of them, with which the panel says nothing


def plot_identified(result: IdentifyResult, check: LogCheck | None = None, *, ax: Axes | None = None) -> Figure:
    """Plot commanded, flown and computed velocity; acceleration limit; noise by lag; ground error; reception;
    order.
    """
    figure, panels = style.figure_and_panels(ax, 2, 3, 10.0, 5.6)
    axes = panels.reshape(-1)
    flying = result.logs.flying()
    for panel, draw in zip(axes, (_draw_step_response, _draw_saturation, _noise), strict=False):
        if "tau" in result.body.value and np.isfinite(result.body.value["tau"]) and len(flying.time) > 50:
            draw(panel, flying, result)
        else:
            _empty(panel, "no commands in the log")
    _draw_ground_error(axes[3], result)
    _reception(axes[4], result)
    _order(axes[5], check)
    for panel, name in zip(axes, "ABCDEF", strict=True):
        style.set_panel_letter(panel, name)
    return style.set_figure_title(figure, "identified", f"{result.logs.drones} drones, like {result.like.name}")


def _empty(panel: Axes, text: str) -> None:
    style.style_axes(panel, grid=False)
    panel.set_xticks([])
    panel.set_yticks([])
    panel.text(
        0.5, 0.5, text, ha="center", va="center", fontsize=style.SMALL_SIZE, color=style.GREY, transform=panel.transAxes
    )


def _draw_step_response(panel: Axes, logs: FlightLogs, result: IdentifyResult) -> None:
    """Draw velocity east: commanded, logged, and computed from its first row on by the fitted body."""
    rows = logs.of(int(logs.who[0]))
    run = np.cumsum(logs.is_new[rows])
    rows = rows[run == np.bincount(run).argmax()]
    rows = rows[logs.time[rows] <= logs.time[rows[0]] + MAX_SECONDS]
    value, time = result.body.value, logs.time[rows]
    rate = held.decay_rate(value["tau"], result.like.flight.dt)
    state, computed = logs.velocity[rows[0]].copy(), []
    for k in range(len(rows)):
        if k:
            wish = logs.command[rows[k - 1]]
            size = max(float(np.linalg.norm(wish - state)), 1e-12)
            left, _ = held.gap_left(size, float(time[k] - time[k - 1]), value["tau"], rate, value["a_max"])
            state = wish - (wish - state) * (left / size)
        computed.append(state[0])
    time = time - time[0]
    panel.step(time, logs.command[rows, 0], where="post", color=style.GREY, linewidth=0.8, label="commanded")
    panel.plot(time, logs.velocity[rows, 0], color=style.BLUE, linewidth=0.9, label="logged")
    panel.plot(time, computed, color=style.RED, linewidth=1.0, linestyle="--", label="computed without noise")
    style.style_axes(panel, "time (s)", "velocity east (m/s)", legend=True)


def _draw_saturation(panel: Axes, logs: FlightLogs, result: IdentifyResult) -> None:
    """Draw acceleration along the gap against gap / tau, with the limit."""
    run = np.cumsum(logs.is_new)
    k = np.arange(len(run) - 3)
    k = k[(run[k] == run[k + 3]) & (np.abs(logs.command[k + 2] - logs.command[k]).max(axis=1) < 1e-9)]
    k = k[:: max(1, len(k) // MAX_POINTS)]
    if len(k) < FEW:
        _empty(panel, "the command never stands still")
        return
    # four rows: the outer two give the gap, the inner two the acceleration, so that no noise of the
    # log is in both
    gap = logs.command[k] - 0.5 * (logs.velocity[k] + logs.velocity[k + 3])
    size = np.maximum(np.linalg.norm(gap, axis=1), 1e-9)
    step = (logs.time[k + 2] - logs.time[k + 1])[:, None]
    pull = ((logs.velocity[k + 2] - logs.velocity[k + 1]) / step * gap).sum(axis=1) / size
    value = result.body.value
    demanded = size / value["tau"]
    panel.plot(demanded, pull, ".", color=style.SKY, markersize=1.5, alpha=0.4, rasterized=True)
    edges = np.linspace(0.0, float(np.quantile(demanded, 0.998)), 15)
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        inside = (demanded >= low) & (demanded < high)
        if inside.sum() >= 20 and 0.5 * (low + high) > 3.0 * value["white"] / value["tau"]:  # else noise hides the gap
            panel.plot(0.5 * (low + high), np.median(pull[inside]), "o", color=style.BLUE, markersize=3.5)
    panel.plot([], [], "o", color=style.BLUE, markersize=3.5, label="median of the log")
    line = np.linspace(0.0, float(edges[-1]), 100)
    panel.plot(line, np.minimum(line, value["a_max"]), color=style.RED, linewidth=1.0, label="fit")
    panel.set_ylim(*np.quantile(pull, [0.01, 0.99]))
    style.style_axes(panel, "gap / tau (m/s²)", "acceleration along the gap (m/s²)", legend=True)


def _noise(panel: Axes, logs: FlightLogs, result: IdentifyResult) -> None:
    """Draw the mean squared error of one-row predictions by lag, below saturation: log noise and outer noise."""
    value, step = result.body.value, logs.step
    run = np.cumsum(logs.is_new)
    rate = held.decay_rate(value["tau"], result.like.flight.dt)
    lags, seen = [], []
    for lag in range(1, 5):
        k = np.arange(len(logs.time) - lag)
        k = k[run[k] == run[k + lag]]
        # The command must have stood still in between, or the prediction from one row does not
        # hold.
        for between in range(1, lag):
            k = k[np.abs(logs.command[k + between] - logs.command[k]).max(axis=1) < 1e-9]
        gap = logs.command[k] - logs.velocity[k]
        k = k[np.linalg.norm(gap, axis=1) < 0.8 * value["a_max"] * value["tau"]]
        if len(k) < 50:
            continue
        gap, h = logs.command[k] - logs.velocity[k], (logs.time[k + lag] - logs.time[k])[:, None]
        off = logs.velocity[k + lag] - logs.command[k] + gap * np.exp(-rate * h)
        lags.append(lag * step)
        seen.append(float((off**2).mean()))
    line = np.linspace(0.0, 5.0 * step, 60)
    keep = np.exp(-2.0 * rate * line)
    outer = result.body.value["noise"] + result.like.sensors.noise * result.like.sensors.damping
    panel.plot(
        line,
        value["white"] ** 2 * (1.0 + keep) + outer / rate * (1.0 - keep),
        color=style.RED,
        linewidth=1.0,
        label="fit",
    )
    panel.plot(lags, seen, "o", color=style.BLUE, markersize=4.0, label="log")
    panel.axhline(2.0 * value["white"] ** 2, color=style.GREY, linewidth=0.7, linestyle=":", label="noise of the log")
    panel.set_ylim(bottom=0.0)
    style.style_axes(panel, "lag (s)", "square of prediction error (m²/s²)", legend=True)


def _draw_ground_error(panel: Axes, result: IdentifyResult) -> None:
    """Draw the variogram of the velocity on the ground, with that of the fitted error."""
    ground, value = result.logs.grounded_rows(), result.sensors.value
    if len(ground.time) < 50 or not np.isfinite(value["noise"]):
        _empty(panel, "no drone stood on the ground")
        return
    step, run = ground.step, np.cumsum(ground.is_new)
    lags, seen = [], []
    for lag in np.unique(np.geomspace(1, max(2, len(ground.time) // (4 * result.logs.drones)), 18).astype(int)):
        k = np.arange(len(ground.time) - lag)
        k = k[run[k] == run[k + lag]]
        # Fewer pairs make a variogram that jumps more than it shows.
        if len(k) > 30:
            lags.append(lag * step)
            seen.append(0.5 * float(((ground.velocity[k + lag] - ground.velocity[k]) ** 2).mean()))
    if not lags:
        _empty(panel, "no drone stood long enough on the ground")
        return
    spring = np.sqrt(2.0 * value["damping"] * value["noise"]) / value["scale"]
    line = np.geomspace(step, max(lags), 80)
    # stationary covariance of the velocity of a damped oscillator, as sensors.langevin draws it
    root = np.sqrt(complex(value["damping"] ** 2 / 4.0 - spring))
    root = root if abs(root) > 1e-9 else complex(1e-9)
    swing = np.exp(-0.5 * value["damping"] * line) * (
        np.cosh(root * line) - value["damping"] / (2.0 * root) * np.sinh(root * line)
    )
    panel.plot(
        line, value["white"] ** 2 + value["noise"] * (1.0 - swing.real), color=style.RED, linewidth=1.0, label="fit"
    )
    panel.plot(lags, seen, "o", color=style.BLUE, markersize=3.5, label="on the ground")
    panel.set_xscale("log")
    panel.set_ylim(bottom=0.0)
    style.style_axes(panel, "lag (s)", "variogram of velocity (m²/s²)", legend=True)


def _reception(panel: Axes, result: IdentifyResult) -> None:
    """Draw the share of decisions with a packet, by distance (Vásárhelyi et al. 2018, Fig. 8 in this form)."""
    if result.radio is None or not len(result.radio.picture_bins):
        _empty(panel, "no table of packets")
        return
    bins: Any = result.radio.picture_bins[result.radio.picture_bins["due"] >= 20]
    panel.plot(bins["distance"], bins["share"], ".", color=style.BLUE, markersize=3.0, label="log")
    panel.plot(bins["distance"], bins["model"], color=style.RED, linewidth=1.0, label="fit")
    panel.set_ylim(0.0, 1.05)
    style.style_axes(panel, "distance (m)", "heard in one decision (1)", legend=True)


def _order(panel: Axes, check: LogCheck | None) -> None:
    """Draw the polarisation of the log inside the band of the flights."""
    if check is None or not check.band.size or not np.isfinite(check.polarisation).any():
        _empty(panel, "no flights to compare with")
        return
    length = min(len(check.times), check.band.shape[1])
    time = check.times[:length]
    panel.fill_between(
        time, *check.band[:, :length], color=style.SKY, alpha=0.4, linewidth=0.0, label="95 % of flights"
    )
    panel.plot(time, check.polarisation[:length], color=style.BLUE, linewidth=0.7, label="log")
    panel.set_ylim(0.0, 1.05)
    style.style_axes(panel, "time (s)", "polarisation (1)", legend=True)


MAX_LAWS = 5  # laws that are drawn


def plot_inferred(result: InferResult, *, ax: Axes | None = None) -> Figure:
    """Plot force maps, the tracks' first and then each law's, best first: along the heading above, to the left below.

    Katz et al., PNAS 108, 18720 (2011). A law that acts by velocities alone, such as alignment,
    shows no map.
    """
    maps = [(law.name, law.maps) for law in result.laws if law.maps is not None][:MAX_LAWS]
    columns = [("tracks", maps[0][1].seen, maps[0][1].edges), *((name, own.law, own.edges) for name, own in maps)]
    figure, panels = style.figure_and_panels(
        ax, 2, len(columns), 1.0 + 2.2 * len(columns), 4.8, sharex=True, sharey=True
    )
    for part, what in enumerate(("forwards", "to the left")):
        sizes = np.abs(np.concatenate([table[part].ravel() for _, table, _ in columns[:2]]))
        most = float(np.nanquantile(sizes, 0.98)) if np.isfinite(sizes).any() else 1.0
        drawn: Any = None
        for panel, (name, table, edges) in zip(panels[part], columns, strict=True):
            style.style_axes(panel, grid=False)
            drawn = panel.pcolormesh(
                -edges, edges, np.ma.masked_invalid(table[part]), cmap="RdBu_r", vmin=-most, vmax=most, rasterized=True
            )
            panel.plot(0.0, 0.0, marker="^", color=style.INK, markersize=4.0)
            panel.set_aspect("equal")
            if part == 0:
                panel.set_title(name, fontsize=style.TEXT_SIZE, color=style.INK)
            else:
                panel.set_xlabel("left – right (m)", fontsize=style.SMALL_SIZE)
        panels[part][0].set_ylabel("back – front (m)", fontsize=style.SMALL_SIZE)
        style.add_colour_bar(figure, drawn, list(panels[part]), f"acceleration {what} (m/s²)", shrink=0.85)
    return style.set_figure_title(figure, "inferred", result.verdict)


MIN_PAIRS = 10  # pairs of a bin below which it is not drawn


def received(heard: xr.Dataset | pd.DataFrame, *, bins: int = BINS, ax: Axes | None = None) -> Figure:
    """Plot how old the agents' data of each other are: median, 50 % and 90 % bands; and the share heard so far.

    heard : a recording with `age` (time, receiver, sender), s, or a table of packets (`recordings.reception`)
    bins  : of distance; ax : axes of a grid, whose place the panels take, instead of a new figure
    The picture is that of Vásárhelyi et al. 2018, Fig. 8.

    Raises RecordingError where the recording holds no ages or the table lacks a column, and
    AirflockError for an `ax` that is none of a grid.

    Examples
    --------
    >>> import airflock
    >>> lossy = {"agents": 5, "duration": 10.0, "radio.kind": "links"}
    >>> heard = airflock.simulate(airflock.load("vasarhelyi_2018/4ms", lossy), keep=("heard",))
    >>> airflock.plots.received(heard, bins=4).axes[1].get_xlabel()
    'distance (m)'
    """
    table = packet_age(heard, bins)
    shown = table[table["count"] >= min(MIN_PAIRS, int(table["count"].max()))]
    figure, panels = style.figure_and_panels(ax, 2, 1, 6.0, 4.2, sharex=True, height_ratios=(3.0, 1.0))
    upper, lower = panels[:, 0]
    x = shown["distance"].to_numpy()
    for low, high, alpha, label in (("q05", "q95", 0.15, "90 % of all"), ("q25", "q75", 0.3, "half of all")):
        upper.fill_between(x, shown[low], shown[high], color=style.BLUE, alpha=alpha, linewidth=0.0, label=label)
    upper.plot(x, shown["median"], color=style.BLUE, linewidth=1.8, label="median")
    if np.nanmax(shown["q95"]) > 20.0 * max(float(np.nanmin(shown["median"])), 1e-3):
        upper.set_yscale("log")
    else:
        upper.set_ylim(bottom=0.0)
    style.style_axes(upper, y="time since the last packet (s)")
    scenario = scenario_or_none(heard) if isinstance(heard, xr.Dataset) else None
    if scenario is not None:
        upper.axhline(scenario.radio.delay, color=style.RED, linewidth=1.0, linestyle=(0, (5, 3)), label="delay")
    style.add_legend(upper)
    lower.plot(x, shown["heard"], color=style.GREEN, linewidth=1.8)
    lower.set_ylim(-0.03, 1.05)
    style.style_axes(lower, "distance (m)", "heard so far")
    lower.set_xlim(0.0, float(x[-1]) if len(x) else None)
    if isinstance(heard, xr.Dataset):
        return style.set_figure_title(figure, short_name(heard), title_details(heard))
    rows = f"{len(heard)} rows, {heard['receiver'].nunique()} receivers"
    return style.set_figure_title(figure, "reception", rows)


def stood(show: Show, titles: list[str], *, ax: Axes | None = None) -> Figure:
    """Plot every shape from the south, at the end of its leg; failed drones are not shown.

    titles : one for each shape; ax : axes of a grid, whose place the panels take, instead of a new figure

    Raises AirflockError for an `ax` that is none of a grid.

    Examples
    --------
    >>> import airflock
    >>> show = airflock.display(["AIR"], 20)
    >>> len(airflock.plots.stood(show, ["AIR"]).axes)
    1
    """
    count = len(show.shape_reports)
    figure, panels = style.figure_and_panels(ax, 1, count, 2.6 * count, 2.8, background=style.NIGHT_SKY, layout="")
    for axes, title, formed, frame in zip(panels[0], titles, show.shape_reports, show.ends, strict=True):
        x, z = show.frames[frame, 0], show.frames[frame, 2]
        axes.scatter(x, z, s=6.0, color=style.ORANGE, linewidths=0.0)
        axes.set_facecolor(style.NIGHT_SKY)
        axes.set_aspect("equal")
        axes.axis("off")
        axes.set_title(
            f"{title}\n{formed.drones} drones, {formed.time:.0f} s", fontsize=style.SMALL_SIZE, color="white"
        )
    return style.root_figure(figure)
