"""Modes and parameters of the autopilots that a vehicle in software imitates, by their numbers.

Sources: PX4 user guide, Parameter Reference; ArduPilot Copter, pages Flight Modes and GCS Failsafe.
"""

from airflock.drones import px4_mode

GUIDED, LAND_MODE, RETURN_MODE, HOLD_MODE, TAKEOFF_MODE, PILOT_MODE = "OURS", "LAND", "RTL", "HOLD", "TAKEOFF", "PILOT"
MODE_NUMBERS = {
    "px4": {GUIDED: px4_mode(6), LAND_MODE: px4_mode(4, 6), RETURN_MODE: px4_mode(4, 5), HOLD_MODE: px4_mode(4, 3),
            TAKEOFF_MODE: px4_mode(4, 2), PILOT_MODE: px4_mode(3)},
    "ardupilot": {GUIDED: 4, LAND_MODE: 9, RETURN_MODE: 6, HOLD_MODE: 17, PILOT_MODE: 5},
}  # fmt: skip
DEFAULT_PARAMETERS: dict[str, dict[str, float | int]] = {
    "px4": {"COM_OF_LOSS_T": 1.0, "COM_OBL_RC_ACT": 4, "GF_ACTION": 3, "MIS_TAKEOFF_ALT": 10.0, "MAV_SYS_ID": 1},
    "ardupilot": {
        "GUID_TIMEOUT": 1.0, "FENCE_ENABLE": 1, "FENCE_ACTION": 1, "FS_GCS_ENABLE": 5, "FS_GCS_TIMEOUT": 5.0,
        "SYSID_MYGCS": 255, "SYSID_THISMAV": 1,
    },
}  # fmt: skip
LOST_SETPOINT_MODES = {3: RETURN_MODE, 4: LAND_MODE, 5: HOLD_MODE}  # COM_OBL_RC_ACT of PX4
LOST_STATION_MODES = {
    5: LAND_MODE,
    7: HOLD_MODE,
}  # FS_GCS_ENABLE of ArduPilot; all others return, by the way they came or straight
