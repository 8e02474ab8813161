"""Seeds of a certificate: fixed by the scenario before anything flies, and never those of a search.

Seeds that people give by hand are small, those of studies lie from 2^40 to below 2^61 (`Study.seed`). Those of
certificates begin at 2^62 and stay below 2^63, so that every file format and database holds them.
"""

import hashlib
import json
from typing import Any

from airflock.parts.sensors import DEFAULT_SENSOR
from airflock.scenarios import Scenario
from airflock.support import StudyError

FIRST = 1 << 62
BITS = 30  # numbers of flights within one part
COUNT_PURPOSE, TOLERANCE_PURPOSE, SPLIT_PURPOSE, MAP_PURPOSE = range(4)  # parts of a certificate; they share no seed


def scenario_identity(scenario: Scenario) -> str:
    """Hash of everything that decides a flight of a scenario but its seed: its laws by name, its numbers and choices.

    What is only told (title, sources, published values) and how a flight is scored do not count.
    """
    told: dict[str, Any] = {
        key: {name: getattr(record, name) for name in record.__dataclass_fields__}
        for key, record in scenario.records.items()
        if key != "metrics"
    }
    stands = hashlib.sha256(scenario.stands().shapes.tobytes()).hexdigest() if scenario.scene.draw == "once" else ""
    told["scene"] = {**told["scene"], "file": "", "stands": stands}
    if not told["start"]["wall_clearance"]:  # as in flights from before there was one
        del told["start"]["wall_clearance"]
    told["laws"] = [scenario.model.name, scenario.vehicle.name]
    if scenario.sensor.name != DEFAULT_SENSOR:  # so that certificates from before there were others stay what they are
        told["laws"].append(scenario.sensor.name)
    if "kind" not in told["radio"]:  # which tells those of the usual record apart
        told["laws"].append(scenario.transceiver.name)
    if scenario.own_topology is not None:
        told["laws"].append(scenario.own_topology.name)
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


def certificate_seed(scenario_hash: str, purpose: int, index: int) -> int:
    """Seed of a flight of a certificate: of a part, COUNT or another, and its number from 0 on."""
    if not 0 <= index < 1 << BITS:
        raise StudyError(f"a certificate numbers at most {1 << BITS} flights; this would be number {index}")
    return FIRST + ((int(scenario_hash, 16) % (1 << 30)) << (BITS + 2)) + (purpose << BITS) + index
