"""The kinds of fault that a scenario can name: the key `kind` of an entry of [[faults]]."""

from airflock.core import Fault, fault
from airflock.parts.faults import (
    battery,
    clock,
    fails,
    gnss_drift,
    gnss_frozen,
    gnss_offset,
    gnss_spoofed,
    motor,
    pretender,
    radio_deaf,
    radio_frozen,
    radio_range,
    radio_silent,
    stuck,
)

KINDS: dict[str, Fault] = {
    found.name: found
    for found in map(
        fault,
        (
            motor, gnss_offset, gnss_drift, gnss_frozen, gnss_spoofed, radio_silent, radio_deaf, radio_range,
            radio_frozen, pretender, clock, battery, stuck, fails,
        ),
    )
}  # fmt: skip
