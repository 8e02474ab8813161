"""The radios that a scenario can name: the key radio.kind."""

from airflock.core.radio import Radio, radio
from airflock.parts.radios import bursts, congestion, jitter, links, shadow, table, vision
from airflock.parts.radios.constant import CONSTANT

RADIOS: dict[str, Radio] = {
    "constant": CONSTANT,
    "links": radio(links, "links"),
    "table": radio(table, "table"),
    "congestion": radio(congestion, "congestion"),
    "shadow": radio(shadow, "shadow"),
    "bursts": radio(bursts, "bursts"),
    "jitter": radio(jitter, "jitter"),
    "vision": radio(vision, "vision"),
}
USUAL = "constant"  # the radio of a scenario without radio.kind
