"""The radios that a scenario can name: the key radio.kind."""

from airflock.core import Radio, find_members, radio
from airflock.parts.radios.constant import CONSTANT

DEFAULT_RADIO = "constant"  # the radio of a scenario without radio.kind
RADIOS: dict[str, Radio] = {
    DEFAULT_RADIO: CONSTANT,
    **find_members("airflock.parts.radios", ["missed", "receive", "late", "see"], radio.radio),
}
