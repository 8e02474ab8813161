"""What identify found, in six panels: steps, saturation, noise, standing error, reception, order over time."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.estimate.identify.check import Check
from airflock.estimate.identify.logs import Logs
from airflock.estimate.identify.run import Identified
from airflock.parts.bodies import held
from airflock.view.plots import style

SHOWN = 20.0  # s of one drone in the first panel
MOST = 4000  # points in the second


def identified(found: Identified, check: Check | None = None, *, ax: Axes | None = None) -> Figure:
    """Commanded, flown and computed velocity; limit of acceleration; noise by lag; standing error; reception; order."""
    figure, panels = style.panels(ax, 2, 3, 10.0, 5.6)
    axes = panels.reshape(-1)
    flying = found.logs.flying()
    for panel, draw in zip(axes, (_steps, _corner, _noise), strict=False):
        if "tau" in found.body.value and np.isfinite(found.body.value["tau"]) and len(flying.time) > 50:
            draw(panel, flying, found)
        else:
            _empty(panel, "no commands in the log")
    _standing(axes[3], found)
    _reception(axes[4], found)
    _order(axes[5], check)
    for panel, name in zip(axes, "ABCDEF", strict=True):
        style.letter(panel, name)
    style.overall(figure, "identified", f"{found.logs.drones} drones, like {found.like.name}")
    return style.root(figure)


def _empty(panel: Axes, text: str) -> None:
    style.dress(panel, grid=False)
    panel.set_xticks([])
    panel.set_yticks([])
    panel.text(
        0.5, 0.5, text, ha="center", va="center", fontsize=style.SMALL, color=style.GREY, transform=panel.transAxes
    )


def _steps(panel: Axes, flying: Logs, found: Identified) -> None:
    """Velocity east: commanded, logged, and computed from its first row on by the fitted body."""
    rows = flying.of(int(flying.who[0]))
    run = np.cumsum(flying.new[rows])
    rows = rows[run == np.bincount(run).argmax()]
    rows = rows[flying.time[rows] <= flying.time[rows[0]] + SHOWN]
    value, time = found.body.value, flying.time[rows]
    rate = held.decay_rate(value["tau"], found.like.flight.dt)
    state, computed = flying.velocity[rows[0]].copy(), []
    for k, row in enumerate(rows):
        if k:
            wish = flying.command[rows[k - 1]]
            size = max(float(np.linalg.norm(wish - state)), 1e-12)
            left, _ = held.gap_left(size, float(time[k] - time[k - 1]), value["tau"], rate, value["a_max"])
            state = wish - (wish - state) * (left / size)
        computed.append(state[0])
        del row
    time = time - time[0]
    panel.step(time, flying.command[rows, 0], where="post", color=style.GREY, linewidth=0.8, label="commanded")
    panel.plot(time, flying.velocity[rows, 0], color=style.BLUE, linewidth=0.9, label="logged")
    panel.plot(time, computed, color=style.RED, linewidth=1.0, linestyle="--", label="computed without noise")
    style.dress(panel, "time (s)", "velocity east (m/s)")
    style.legend(panel)


def _corner(panel: Axes, flying: Logs, found: Identified) -> None:
    """Acceleration along the gap against gap / tau, with the limit."""
    run = np.cumsum(flying.new)
    k = np.arange(len(run) - 3)
    k = k[(run[k] == run[k + 3]) & (np.abs(flying.command[k + 2] - flying.command[k]).max(axis=1) < 1e-9)]
    k = k[:: max(1, len(k) // MOST)]
    # four rows: the outer two give the gap, the inner two the acceleration, so that no noise of the log is in both
    gap = flying.command[k] - 0.5 * (flying.velocity[k] + flying.velocity[k + 3])
    size = np.maximum(np.linalg.norm(gap, axis=1), 1e-9)
    step = (flying.time[k + 2] - flying.time[k + 1])[:, None]
    pull = ((flying.velocity[k + 2] - flying.velocity[k + 1]) / step * gap).sum(axis=1) / size
    value = found.body.value
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
    style.dress(panel, "gap / tau (m/s²)", "acceleration along the gap (m/s²)")
    style.legend(panel)


def _noise(panel: Axes, flying: Logs, found: Identified) -> None:
    """Mean square of what one row predicts wrongly, by lag, below saturation: the log's floor and the outer noise."""
    value, step = found.body.value, flying.step
    run = np.cumsum(flying.new)
    rate = held.decay_rate(value["tau"], found.like.flight.dt)
    lags, seen = [], []
    for lag in range(1, 5):
        k = np.arange(len(flying.time) - lag)
        k = k[run[k] == run[k + lag]]
        for between in range(1, lag):
            k = k[np.abs(flying.command[k + between] - flying.command[k]).max(axis=1) < 1e-9]
        gap = flying.command[k] - flying.velocity[k]
        k = k[np.linalg.norm(gap, axis=1) < 0.8 * value["a_max"] * value["tau"]]
        if len(k) < 50:
            continue
        gap, h = flying.command[k] - flying.velocity[k], (flying.time[k + lag] - flying.time[k])[:, None]
        off = flying.velocity[k + lag] - flying.command[k] + gap * np.exp(-rate * h)
        lags.append(lag * step)
        seen.append(float((off**2).mean()))
    line = np.linspace(0.0, 5.0 * step, 60)
    keep = np.exp(-2.0 * rate * line)
    outer = found.body.value["noise"] + found.like.sensors.noise * found.like.sensors.damping
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
    style.dress(panel, "lag (s)", "square of prediction error (m²/s²)")
    style.legend(panel)


def _standing(panel: Axes, found: Identified) -> None:
    """Variogram of the velocity on the ground, with that of the fitted error."""
    ground, value = found.logs.grounded(), found.sensors.value
    if len(ground.time) < 50 or not np.isfinite(value["noise"]):
        _empty(panel, "no drone stood on the ground")
        return
    step, run = ground.step, np.cumsum(ground.new)
    lags, seen = [], []
    for lag in np.unique(np.geomspace(1, max(2, len(ground.time) // (4 * found.logs.drones)), 18).astype(int)):
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
    style.dress(panel, "lag (s)", "variogram of velocity (m²/s²)")
    style.legend(panel)


def _reception(panel: Axes, found: Identified) -> None:
    """Share of decisions with a packet, by distance (Vásárhelyi et al. 2018, Fig. 8 in this form)."""
    if found.radio is None or not len(found.radio.bins):
        _empty(panel, "no table of packets")
        return
    bins: Any = found.radio.bins[found.radio.bins["due"] >= 20]
    panel.plot(bins["distance"], bins["share"], ".", color=style.BLUE, markersize=3.0, label="log")
    panel.plot(bins["distance"], bins["model"], color=style.RED, linewidth=1.0, label="fit")
    panel.set_ylim(0.0, 1.05)
    style.dress(panel, "distance (m)", "heard in one decision (1)")
    style.legend(panel)


def _order(panel: Axes, check: Check | None) -> None:
    """Polarisation of the log inside the band of the flights."""
    if check is None or not check.band.size or not np.isfinite(check.course).any():
        _empty(panel, "no flights to compare with")
        return
    length = min(len(check.times), check.band.shape[1])
    time = check.times[:length]
    panel.fill_between(
        time, *check.band[:, :length], color=style.SKY, alpha=0.4, linewidth=0.0, label="95 % of flights"
    )
    panel.plot(time, check.course[:length], color=style.BLUE, linewidth=0.7, label="log")
    panel.set_ylim(0.0, 1.05)
    style.dress(panel, "time (s)", "polarisation (1)")
    style.legend(panel)
