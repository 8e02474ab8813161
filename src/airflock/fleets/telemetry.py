"""What a vehicle in software tells: one function per message, and how often each is due."""

from collections.abc import Callable
from typing import Any

from airflock.drones import ARMED_FLAG, dialect
from airflock.support import swap_enu_ned

MESSAGE_RATES = {
    "heartbeat": 2.0, "sys_status": 1.0, "system_time": 1.0, "gps": 5.0, "local": 20.0, "global": 20.0, "landed": 5.0,
    "attitude": 5.0, "home": 0.5, "battery": 0.5,
}  # fmt: skip
MESSAGE_NAMES = {
    0: "heartbeat", 1: "sys_status", 2: "system_time", 24: "gps", 32: "local", 33: "global", 245: "landed",
    30: "attitude", 242: "home", 147: "battery", 49: "origin", 148: "version",
}  # fmt: skip
ALL_SENSORS = 0x0FFFFFFF
CUSTOM_MODE_FLAG, GUIDED_FLAG = 1, 8  # MAV_MODE_FLAG
CAPABILITY_FLAGS = 0x1 | 0x2 | 0x8 | 0x10 | 0x80 | 0x100 | 0x2000


def _heartbeat(v: Any) -> Any:
    base = CUSTOM_MODE_FLAG | (ARMED_FLAG if v.armed else 0) | (GUIDED_FLAG if v.mode == "OURS" else 0)
    return dialect.common_dialect().MAVLink_heartbeat_message(
        2, v.autopilot.number, base, v.mode_numbers.get(v.mode, 0), 4 if v.armed else 3, 3
    )


def _sys_status(v: Any) -> Any:
    on = ALL_SENSORS
    return dialect.common_dialect().MAVLink_sys_status_message(
        on, on, on, 200, 15800, 1000, int(v.battery), 0, 0, 0, 0, 0, 0
    )


def _system_time(v: Any) -> Any:
    return dialect.common_dialect().MAVLink_system_time_message(v.start_time + round(v.now * 1e6), _boot_ms(v))


def _gps(v: Any) -> Any:
    at = v.site.to_geodetic(*v.measured[:3])
    return dialect.common_dialect().MAVLink_gps_raw_int_message(
        round((v.now - v.booted_at) * 1e6), 3, round(at.latitude * 1e7), round(at.longitude * 1e7),
        round(at.altitude * 1e3), 80, 120, 0, 0, 14, 0, round(v.accuracy * 1e3),
    )  # fmt: skip


def _local(v: Any) -> Any:
    s = v.measured
    lat, lon, alt = _origin_integers(v)
    ox, oy, oz = v.site.local(lat * 1e-7, lon * 1e-7, alt * 1e-3)
    north, east, down = swap_enu_ned(s.x - ox, s.y - oy, s.z - oz)
    return dialect.common_dialect().MAVLink_local_position_ned_message(
        _boot_ms(v), north, east, down, *swap_enu_ned(*s[3:])
    )


def _global(v: Any) -> Any:
    s = v.measured
    at = v.site.to_geodetic(*s[:3])
    return dialect.common_dialect().MAVLink_global_position_int_message(
        _boot_ms(v), round(at.latitude * 1e7), round(at.longitude * 1e7), round(at.altitude * 1e3),
        round((s.z - v.home[2]) * 1e3), *(round(100.0 * u) for u in swap_enu_ned(*s[3:])), 0,
    )  # fmt: skip


def _landed(v: Any) -> Any:
    return dialect.common_dialect().MAVLink_extended_sys_state_message(0, 2 if v.flying else 1)


def _attitude(v: Any) -> Any:
    return dialect.common_dialect().MAVLink_attitude_message(_boot_ms(v), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _home(v: Any) -> Any:
    return dialect.common_dialect().MAVLink_home_position_message(
        *_origin_integers(v), 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0
    )


def _battery(v: Any) -> Any:
    cells = [3950] * 4 + [65535] * 6
    return dialect.common_dialect().MAVLink_battery_status_message(0, 0, 3, 2500, cells, 100, -1, -1, int(v.battery))


def _gps_origin(v: Any) -> Any:
    return dialect.common_dialect().MAVLink_gps_global_origin_message(*_origin_integers(v))


def _version(v: Any) -> Any:
    return dialect.common_dialect().MAVLink_autopilot_version_message(
        CAPABILITY_FLAGS, 0x010F00FF, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 4711 + v.system, [0] * 18
    )


def _boot_ms(v: Any) -> int:
    return int(round((v.now - v.booted_at) * 1e3)) & 0xFFFFFFFF


def _origin_integers(v: Any) -> tuple[int, int, int]:
    return round(v.origin.latitude * 1e7), round(v.origin.longitude * 1e7), round(v.origin.altitude * 1e3)


MESSAGE_MAKERS: dict[str, Callable[[Any], Any]] = {
    "heartbeat": _heartbeat, "sys_status": _sys_status, "system_time": _system_time, "gps": _gps, "local": _local,
    "global": _global, "landed": _landed, "attitude": _attitude, "home": _home, "battery": _battery,
    "origin": _gps_origin, "version": _version,
}  # fmt: skip
