"""Modes and parameters of the autopilots that a vehicle in software imitates, by their numbers.

Sources: PX4 user guide, Parameter Reference; ArduPilot Copter, pages Flight Modes and GCS Failsafe.
"""

from airflock.drones.mavlink.autopilots import px4_mode

OURS, LAND, RTL, HOLD, TAKEOFF, PILOT = "OURS", "LAND", "RTL", "HOLD", "TAKEOFF", "PILOT"
MODES = {
    "px4": {OURS: px4_mode(6), LAND: px4_mode(4, 6), RTL: px4_mode(4, 5), HOLD: px4_mode(4, 3),
            TAKEOFF: px4_mode(4, 2), PILOT: px4_mode(3)},
    "ardupilot": {OURS: 4, LAND: 9, RTL: 6, HOLD: 17, PILOT: 5},
}  # fmt: skip
PARAMETERS: dict[str, dict[str, float | int]] = {
    "px4": {"COM_OF_LOSS_T": 1.0, "COM_OBL_RC_ACT": 4, "GF_ACTION": 3, "MIS_TAKEOFF_ALT": 10.0, "MAV_SYS_ID": 1},
    "ardupilot": {
        "GUID_TIMEOUT": 1.0, "FENCE_ENABLE": 1, "FENCE_ACTION": 1, "FS_GCS_ENABLE": 5, "FS_GCS_TIMEOUT": 5.0,
        "SYSID_MYGCS": 255, "SYSID_THISMAV": 1,
    },
}  # fmt: skip
ON_LOSS = {3: RTL, 4: LAND, 5: HOLD}  # COM_OBL_RC_ACT of PX4
ON_SILENCE = {5: LAND, 7: HOLD}  # FS_GCS_ENABLE of ArduPilot; all others return, by the way they came or straight
