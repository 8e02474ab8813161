"""A flight card: which test flights of about ten minutes would make every number identifiable."""

from typing import NamedTuple

from airflock.estimate.identification.hills import CURVE_PARAMETERS
from airflock.estimate.identification.packets import TABLE_KEYS, curve_parameters
from airflock.parts.radios import ENTRIES
from airflock.scenarios import Scenario


class Flight(NamedTuple):
    """One part of the card: what to fly, for how long (s), and which keys it tells."""

    title: str
    seconds: float
    instructions: str
    keys: tuple[str, ...]


def flight_card(like: Scenario) -> list[Flight]:
    """Parts of the card, sized by the numbers of a scenario that is thought to be near."""
    tau, a_max = like.body.tau, like.body.a_max
    step = 3.0 * tau * a_max  # a step of this size is at the limit for two thirds of its way
    hold = max(4.0 * tau + step / a_max, 2.0)
    repeats = max(8, round(180.0 / (2.0 * hold)))
    cruise = min(step, 10.0)
    tabled = like.transceiver.name == "table"
    far = 0.5 * (ENTRIES - 1) * like.radio.spacing if tabled else curve_parameters(like.radio).far  # type: ignore[attr-defined]
    curve = TABLE_KEYS if tabled else tuple(f"radio.{name}" for name in CURVE_PARAMETERS)
    return [
        Flight(
            "stand", 120.0,
            "all drones switched on, side by side on the ground, clear sky, logging at the rate of flight",
            ("sensors.noise", "sensors.damping", "sensors.scale"),
        ),
        Flight(
            "steps", 2.0 * hold * repeats,
            f"one drone at a time, or all at 50 m: command {step / 2:.1f} m/s east, then {step / 2:.1f} m/s west, "
            f"{hold:.1f} s each, {repeats} times; then north and south. Velocity set-points only, no feed-forward; "
            f"log commands and raw estimates at {max(10.0, 10.0 / tau):.0f} Hz or more",
            ("body.tau", "body.a_max", "body.noise"),
        ),
        Flight(
            "pairs", max(60.0, 2.0 * 2.0 * far / cruise),
            f"two drones from 5 m to {2.0 * far:.0f} m apart and back at {cruise:.0f} m/s; both log "
            "receiver, sender, own time and stamp of every packet",
            ("radio.delay", *curve),
        ),
        Flight(
            "flock", 180.0, "the flock flies its law; decisions logged as they are made",
            ("sensors.period", "model.v_max"),
        ),
    ]  # fmt: skip
