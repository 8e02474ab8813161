"""Timing: the times of a scenario in motion steps, and those that a flight cannot keep, or keeps only rounded."""

from typing import Any

from airflock.scenarios.scenario import Scenario
from airflock.scenarios.sections import Flight


def step_counts(scenario: Scenario) -> dict[str, int]:
    """All times of a scenario in motion steps."""
    dt, q = scenario.flight.dt, scenario.resolved_metrics()
    decide_every = max(1, round(scenario.sensors.period / dt))
    delay = round(scenario.radio.delay / dt)
    return {
        "steps": round(scenario.flight.duration / dt),
        "decide_every": decide_every,
        "sample_every": max(1, round(q.period / dt)),
        "collide_every": round((q.collision_period or dt) / dt),
        "delay": delay,
        "ring": delay // decide_every + 2,
    }


def timing_errors(flight: Flight, period: float, metrics: Any) -> list[str]:
    """Periods below a step, and more steps than can be counted."""
    dt = flight.dt
    times = {
        "sensors.period": period,
        "metrics.period": metrics.period,
        "metrics.collision_period": metrics.collision_period or dt,
    }
    found = [
        f"{key} = {value:g} s is shorter than dt = {dt:g} s" for key, value in times.items() if 0.0 < value < 0.5 * dt
    ]
    if flight.duration / dt > 2**31:
        found.append(f"duration = {flight.duration:g} s takes more than 2^31 steps of dt = {dt:g} s")
    return found


def timing_notes(scenario: Scenario) -> list[str]:
    """What is rounded to steps, for a person to read; nothing here stops a flight."""
    told, dt = [], scenario.flight.dt
    times = {
        "sensors.period": scenario.sensors.period,
        "radio.delay": scenario.radio.delay,
        "metrics.period": scenario.metrics.period,
        "metrics.collision_period": scenario.metrics.collision_period or dt,
    }
    for key, value in times.items():
        steps = round(value / dt)
        if abs(steps * dt - value) > 1e-9 * max(value, dt):
            told.append(f"{key} = {value:g} s is rounded to {steps * dt:g} s, {steps} steps of dt = {dt:g} s")
    period, delay = scenario.sensors.period, scenario.radio.delay
    if period > 0.0 and abs(delay / period - round(delay / period)) > 1e-9:
        told.append(
            f"radio.delay = {delay:g} s is not a multiple of sensors.period = {period:g} s: decisions use "
            "states exactly that old, which lie between two measurements"
        )
    return told
