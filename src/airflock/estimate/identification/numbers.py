"""Numbers of a scenario as logs tell them: value, interval, and the reason where logs cannot tell."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from airflock.estimate.identification import packets
from airflock.scenarios import Scenario, build_scenario
from airflock.support import AirflockError

# key → whether a larger number makes a flight harder
HARDER = {
    "body.tau": True, "body.a_max": False, "body.noise": True, "sensors.period": True, "sensors.noise": True,
    "sensors.damping": False, "sensors.scale": True, "radio.delay": True, "radio.near": False, "radio.far": False,
    "radio.received_near": False, "radio.received_far": False, "model.v_max": True,
}  # fmt: skip
KEY_UNITS = {
    "body.tau": "s", "body.a_max": "m/s^2", "body.noise": "m^2/s^3", "sensors.period": "s", "sensors.noise": "m^2/s^2",
    "sensors.damping": "1/s", "sensors.scale": "m s^(1/2)", "radio.delay": "s", "radio.near": "m", "radio.far": "m",
    "radio.received_near": "1", "radio.received_far": "1", "model.v_max": "m/s",
}  # fmt: skip
HARDER |= dict.fromkeys(packets.TABLE_KEYS, False)
KEY_UNITS |= dict.fromkeys(packets.TABLE_KEYS, "1")
UNIDENTIFIABLE = {  # by a flight, and why
    "wind.east, wind.north": "steady wind and drag act as one push; kept from --like",
    "radio.range": "a flight shows no packet beyond the farthest pair; kept from --like",
}


@dataclass(frozen=True)
class IdentifiedParameter:
    """One number of a scenario: value and 95 % interval where the logs tell it, else the reason why not."""

    key: str
    value: float
    low: float
    high: float
    like: float | None
    origin: str
    reason: str = ""

    @property
    def told(self) -> bool:
        """Whether the logs tell it."""
        return not self.reason and bool(np.isfinite(self.value))

    def pessimistic_end(self, level: float) -> float:
        """The end of the interval at which flying is harder, for a confidence level of both ends."""
        end = self.high if HARDER[self.key] else self.low
        ratio = max(end, 1e-12) / self.value
        value = float(self.value * ratio ** (norm.ppf(0.5 + 0.5 * level) / norm.ppf(0.975)))
        return min(value, 1.0) if KEY_UNITS[self.key] == "1" else value


class IdentifiedParameters:
    """Numbers as they are identified, each beside that of the scenario that is flown by the same law."""

    def __init__(self, like: Scenario):
        self.like, self.by_key = like, dict[str, IdentifiedParameter]()

    def add(self, key: str, value: float, interval: tuple[float, float], origin: str, reason: str = "") -> None:
        """Add a number with its interval and what it comes from; reason: why the logs cannot tell it, if so."""
        low, high = interval
        self.by_key[key] = IdentifiedParameter(
            key, float(value), float(low), float(high), self.reference_value(key), origin, reason
        )

    def reference_value(self, key: str) -> float | None:
        """The scenario's own number; None where it has none."""
        section, _, name = key.partition(".")
        record = self.like.parameters if section == "model" else getattr(self.like, section)
        value = getattr(record, name, None)
        return None if value is None else float(value)

    def refuse_out_of_range(self) -> None:
        """Give each number that the scenario would not take the reason why."""
        document = {key: value for key, value in self.like.document.items() if key != "published"}
        for key, number in self.by_key.items():
            if not number.told:
                continue
            try:
                build_scenario(document, self.like.name, {key: number.value})
            except AirflockError as fault:
                reason = str(fault).splitlines()[0].partition(": ")[2] or str(fault)
                self.by_key[key] = replace(number, reason=reason)
