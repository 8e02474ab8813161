"""The radios that a scenario can name: the key radio.kind."""

from airflock.core import Radio, radio as packets
from airflock.parts.radios import bursts, congestion, jitter, links, shadow, table, vision
from airflock.parts.radios.constant import CONSTANT

RADIOS: dict[str, Radio] = {
    "constant": CONSTANT,
    "links": packets.radio(links, "links"),
    "table": packets.radio(table, "table"),
    "congestion": packets.radio(congestion, "congestion"),
    "shadow": packets.radio(shadow, "shadow"),
    "bursts": packets.radio(bursts, "bursts"),
    "jitter": packets.radio(jitter, "jitter"),
    "vision": packets.radio(vision, "vision"),
}
DEFAULT_RADIO = "constant"  # the radio of a scenario without radio.kind
