"""Measures: what helps against collisions beside the numbers of the law, tried and told, and never part of a set.

A neighbour whose packet is late seems to be where it was. Carried forward with the velocity in its packet, it is where
it is by now. And who has lost a neighbour that could be near may stop (`core.silence`). Both are programs on board,
which a set of numbers cannot bring along: whoever has them sets them in the scenario and tunes again.
"""

from collections.abc import Sequence
from typing import Any

from airflock.scenarios import Scenario, rebuilt
from airflock.search.steps import HardeningStep
from airflock.support import ScenarioError

CARRIED = "neighbours carried forward"
STOPS = "stop near a lost neighbour"


def measures(scenarios: Sequence[Scenario]) -> list[tuple[HardeningStep, list[Scenario], str]]:
    """Measures that could change a flight in any of the scenarios: step, scenarios with it, and what to set."""
    found = []
    for name, reason, settings in (
        (CARRIED, "Vásárhelyi et al. 2018, Drone setup: positions are carried forward by velocities", _carried),
        (STOPS, "our choice: a neighbour that is not heard may still be near", _stops),
    ):
        changes = [settings(scenario) for scenario in scenarios]
        if not any(changes):
            continue
        try:
            flown = [rebuilt(s, change) if change else s for s, change in zip(scenarios, changes, strict=True)]
        except ScenarioError:  # the law has no such form, or the flock is too large for it
            continue
        first = next(change for change in changes if change)
        found.append(
            (HardeningStep(name, {}, reason), flown, " ".join(f"--set {key}={value}" for key, value in first.items()))
        )
    return found


def _carried(scenario: Scenario) -> dict[str, Any]:
    """The same packets, none of them lost that is not lost without it, and carried forward until the next one comes."""
    if scenario.transceiver.name != "constant" or scenario.radio.delay <= 0.0:
        return {}
    rate = max(10.0, 1.0 / max(scenario.sensors.period, scenario.flight.dt))
    far = min(max(scenario.radio.range, 1.0), 1e6)
    whole = {"radio.received_near": 1.0, "radio.received_far": 1.0, "radio.near": 0.5 * far, "radio.far": far}
    return {"radio.kind": "links", **whole, "radio.fast_rate": rate}


def _stops(scenario: Scenario) -> dict[str, Any]:
    """Stopping where a neighbour that is lost could be near, where some may be lost."""
    deaf = any(entry.fault.radio is not None for entry in scenario.faults)
    lost = deaf or scenario.transceiver.name not in ("constant", "vision") or scenario.radio.loss > 0.0
    return {"silence.rule": "stop"} if lost and scenario.silence.rule == "fly_on" else {}
