"""What identify found, in six panels: steps, saturation, noise, standing error, reception, order over time."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.estimate import FlightLogs, IdentifyResult, LogCheck
from airflock.parts.bodies import held
from airflock.view.plots import style

MAX_SECONDS = 20.0  # s of one drone in the first panel
MAX_POINTS = 4000  # points in the second


def plot_identified(result: IdentifyResult, check: LogCheck | None = None, *, ax: Axes | None = None) -> Figure:
    """Commanded, flown and computed velocity; limit of acceleration; noise by lag; standing error; reception; order."""
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
    style.set_figure_title(figure, "identified", f"{result.logs.drones} drones, like {result.like.name}")
    return style.root_figure(figure)


def _empty(panel: Axes, text: str) -> None:
    style.style_axes(panel, grid=False)
    panel.set_xticks([])
    panel.set_yticks([])
    panel.text(
        0.5, 0.5, text, ha="center", va="center", fontsize=style.SMALL_SIZE, color=style.GREY, transform=panel.transAxes
    )


def _draw_step_response(panel: Axes, logs: FlightLogs, result: IdentifyResult) -> None:
    """Velocity east: commanded, logged, and computed from its first row on by the fitted body."""
    rows = logs.of(int(logs.who[0]))
    run = np.cumsum(logs.is_new[rows])
    rows = rows[run == np.bincount(run).argmax()]
    rows = rows[logs.time[rows] <= logs.time[rows[0]] + MAX_SECONDS]
    value, time = result.body.value, logs.time[rows]
    rate = held.decay_rate(value["tau"], result.like.flight.dt)
    state, computed = logs.velocity[rows[0]].copy(), []
    for k, row in enumerate(rows):
        if k:
            wish = logs.command[rows[k - 1]]
            size = max(float(np.linalg.norm(wish - state)), 1e-12)
            left, _ = held.gap_left(size, float(time[k] - time[k - 1]), value["tau"], rate, value["a_max"])
            state = wish - (wish - state) * (left / size)
        computed.append(state[0])
        del row
    time = time - time[0]
    panel.step(time, logs.command[rows, 0], where="post", color=style.GREY, linewidth=0.8, label="commanded")
    panel.plot(time, logs.velocity[rows, 0], color=style.BLUE, linewidth=0.9, label="logged")
    panel.plot(time, computed, color=style.RED, linewidth=1.0, linestyle="--", label="computed without noise")
    style.style_axes(panel, "time (s)", "velocity east (m/s)")
    style.add_legend(panel)


def _draw_saturation(panel: Axes, logs: FlightLogs, result: IdentifyResult) -> None:
    """Acceleration along the gap against gap / tau, with the limit."""
    run = np.cumsum(logs.is_new)
    k = np.arange(len(run) - 3)
    k = k[(run[k] == run[k + 3]) & (np.abs(logs.command[k + 2] - logs.command[k]).max(axis=1) < 1e-9)]
    k = k[:: max(1, len(k) // MAX_POINTS)]
    # four rows: the outer two give the gap, the inner two the acceleration, so that no noise of the log is in both
    gap = logs.command[k] - 0.5 * (logs.velocity[k] + logs.velocity[k + 3])
    size = np.maximum(np.linalg.norm(gap, axis=1), 1e-9)
    step = (logs.time[k + 2] - logs.time[k + 1])[:, None]
    pull = ((logs.velocity[k + 2] - logs.velocity[k + 1]) / step * gap).sum(axis=1) / size
    value = result.body.value
    asked = size / value["tau"]
    panel.plot(asked, pull, ".", color=style.SKY, markersize=1.5, alpha=0.4, rasterized=True)
    edges = np.linspace(0.0, float(np.quantile(asked, 0.998)), 15)
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        inside = (asked >= low) & (asked < high)
        if inside.sum() >= 20 and 0.5 * (low + high) > 3.0 * value["white"] / value["tau"]:  # else noise hides the gap
            panel.plot(0.5 * (low + high), np.median(pull[inside]), "o", color=style.BLUE, markersize=3.5)
    panel.plot([], [], "o", color=style.BLUE, markersize=3.5, label="median of the log")
    line = np.linspace(0.0, float(edges[-1]), 100)
    panel.plot(line, np.minimum(line, value["a_max"]), color=style.RED, linewidth=1.0, label="fit")
    panel.set_ylim(*np.quantile(pull, [0.01, 0.99]))
    style.style_axes(panel, "gap / tau (m/s²)", "acceleration along the gap (m/s²)")
    style.add_legend(panel)


def _noise(panel: Axes, logs: FlightLogs, result: IdentifyResult) -> None:
    """Mean square of what one row predicts wrongly, by lag, below saturation: the log's floor and the outer noise."""
    value, step = result.body.value, logs.step
    run = np.cumsum(logs.is_new)
    rate = held.decay_rate(value["tau"], result.like.flight.dt)
    lags, seen = [], []
    for lag in range(1, 5):
        k = np.arange(len(logs.time) - lag)
        k = k[run[k] == run[k + lag]]
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
    style.style_axes(panel, "lag (s)", "square of prediction error (m²/s²)")
    style.add_legend(panel)


def _draw_ground_error(panel: Axes, result: IdentifyResult) -> None:
    """Variogram of the velocity on the ground, with that of the fitted error."""
    ground, value = result.logs.grounded_rows(), result.sensors.value
    if len(ground.time) < 50 or not np.isfinite(value["noise"]):
        _empty(panel, "no drone stood on the ground")
        return
    step, run = ground.step, np.cumsum(ground.is_new)
    lags, seen = [], []
    for lag in np.unique(np.geomspace(1, max(2, len(ground.time) // (4 * result.logs.drones)), 18).astype(int)):
        k = np.arange(len(ground.time) - lag)
        k = k[run[k] == run[k + lag]]
        if len(k) > 30:
            lags.append(lag * step)
            seen.append(0.5 * float(((ground.velocity[k + lag] - ground.velocity[k]) ** 2).mean()))
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
    style.style_axes(panel, "lag (s)", "variogram of velocity (m²/s²)")
    style.add_legend(panel)


def _reception(panel: Axes, result: IdentifyResult) -> None:
    """Share of decisions with a packet, by distance (Vásárhelyi et al. 2018, Fig. 8 in this form)."""
    if result.radio is None or not len(result.radio.picture_bins):
        _empty(panel, "no table of packets")
        return
    bins: Any = result.radio.picture_bins[result.radio.picture_bins["due"] >= 20]
    panel.plot(bins["distance"], bins["share"], ".", color=style.BLUE, markersize=3.0, label="log")
    panel.plot(bins["distance"], bins["model"], color=style.RED, linewidth=1.0, label="fit")
    panel.set_ylim(0.0, 1.05)
    style.style_axes(panel, "distance (m)", "heard in one decision (1)")
    style.add_legend(panel)


def _order(panel: Axes, check: LogCheck | None) -> None:
    """Polarisation of the log inside the band of the flights."""
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
    style.style_axes(panel, "time (s)", "polarisation (1)")
    style.add_legend(panel)
