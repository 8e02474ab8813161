"""Small logs of PX4 (ULog), ArduPilot (DataFlash) and receivers (tlog), written from the published formats."""

import struct

import numpy as np

ULOG_FIELDS = {
    "vehicle_local_position": (
        "uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz;double ref_lat;double ref_lon;"
        "float ref_alt;bool xy_valid;bool v_xy_valid;uint8_t xy_reset_counter;",
        "<Q6fddf2?B",
    ),
    "trajectory_setpoint": ("uint64_t timestamp;float[3] position;float[3] velocity;", "<Q6f"),
    "vehicle_gps_position": ("uint64_t timestamp;uint64_t time_utc_usec;", "<QQ"),
    "vehicle_land_detected": ("uint64_t timestamp;bool landed;", "<Q?"),
}


def write_ulog(path, time, ned, speed, asked, *, origin=(47.0, 19.0, 100.0), utc=None, resets=None, landed=()):
    """One drone: time (s since boot), position and velocity (row, 3) north-east-down, commanded velocity.

    utc    : s since 1970 at time 0; landed: pairs of time and whether it stands
    resets : (row,) counter of the estimator
    """
    resets = np.zeros(len(time), int) if resets is None else resets
    names = list(ULOG_FIELDS)
    rows = []
    for k, t in enumerate(time):
        us = round(t * 1e6)
        rows.append((us, 0, (us, *ned[k], *speed[k], *origin, True, True, int(resets[k]))))
        rows.append((us, 1, (us, *[float("nan")] * 3, *asked[k])))
        if utc is not None and k % 10 == 0:
            rows.append((us, 2, (us, round((utc + t) * 1e6))))
    rows += [(round(t * 1e6), 3, (round(t * 1e6), bool(down))) for t, down in landed]
    with open(path, "wb") as file:

        def message(kind, body):
            file.write(struct.pack("<HB", len(body), ord(kind)) + body)

        file.write(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", round(time[0] * 1e6)))
        message("B", bytes(40))
        for name in names:
            message("F", f"{name}:{ULOG_FIELDS[name][0]}".encode())
        for number, name in enumerate(names):
            message("A", struct.pack("<BH", 0, number) + name.encode())
        for _, number, values in sorted(rows, key=lambda row: row[0]):
            message("D", struct.pack("<H", number) + struct.pack(ULOG_FIELDS[names[number]][1], *values))


CODES = {"Q": "Q", "f": "f", "L": "i", "B": "B", "H": "H", "I": "I", "b": "b", "d": "d", "Z": "64s", "N": "16s"}
DATAFLASH = {
    140: ("PSCN", "Qffffff", "TimeUS,TPN,PN,DVN,TVN,VN,AN"),
    141: ("PSCE", "Qffffff", "TimeUS,TPE,PE,DVE,TVE,VE,AE"),
    142: ("ORGN", "QBLLf", "TimeUS,Type,Lat,Lng,Alt"),
    143: ("GPS", "QBBIH", "TimeUS,I,Status,GMS,GWk"),
    144: ("PSCD", "Qffffff", "TimeUS,TPD,PD,DVD,TVD,VD,AD"),
    145: ("GUIP", "QBffffff", "TimeUS,Type,pX,pY,pZ,vX,vY,vZ"),
    146: ("UNIT", "QbZ", "TimeUS,Id,Label"),
    147: ("MULT", "Qbd", "TimeUS,Id,Mult"),
    148: ("FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
}


def write_dataflash(
    path, time, ned, speed, asked, *, origin=(47.0, 19.0, 100.0), week=None, deep=False, inner=None, unit="", kinds=None
):
    """One drone, in the plane unless `deep`: as write_ulog; week: GPS week whose first second is time 0.

    asked : (row, 3) velocity north-east-down that a companion requests, m/s, as GUIP has it; None: never
    inner : (row, 3) what the position controller makes of it, TV*; the velocity if it is not here
    unit  : of GUIP as the log says it: "cm/s" (north-east-up), "m/s" (north-east-down), or not at all (cm/s)
    kinds : (row,) GUIP.Type, where it is not 4, a velocity; -1: no message
    """
    inner = speed if inner is None else inner
    with open(path, "wb") as file:

        def declare(number, length, name, form, columns):
            text = struct.pack("<BB4s16s64s", number, length, name.encode(), form.encode(), columns.encode())
            file.write(b"\xa3\x95\x80" + text)

        def put(number, *values):
            form = "<" + "".join(CODES[c] for c in DATAFLASH[number][1])
            file.write(b"\xa3\x95" + bytes([number]) + struct.pack(form, *values))

        declare(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
        for number, (name, form, columns) in DATAFLASH.items():
            declare(number, 3 + struct.calcsize("<" + "".join(CODES[c] for c in form)), name, form, columns)
        if unit:
            put(146, 0, ord("n"), b"m/s")
            for letter, factor in (("B", 0.01), ("0", 1.0)):
                put(147, 0, ord(letter), factor)
            put(148, 0, 145, b"-----nnn", b"-----" + 3 * (b"B" if unit == "cm/s" else b"0"))
        put(142, round(time[0] * 1e6), 0, round(origin[0] * 1e7), round(origin[1] * 1e7), origin[2])
        for k, t in enumerate(time):
            us = round(t * 1e6)
            if week is not None and k % 10 == 0:
                put(143, us, 0, 3, round(t * 1e3), week)
            if asked is not None and (kinds is None or kinds[k] >= 0):
                wish = asked[k] if unit == "m/s" else asked[k] * (100.0, 100.0, -100.0)
                put(145, us, 4 if kinds is None else kinds[k], 0.0, 0.0, 0.0, *wish)
            for axis, number in ((0, 140), (1, 141), *([(2, 144)] if deep else [])):
                put(number, us, 0.0, ned[k, axis], inner[k, axis], inner[k, axis], speed[k, axis], 0.0)


def write_tlog(path, messages):
    """Messages as a receiver keeps them: pairs of the time of arrival (s since 1970) and the bytes of a message."""
    with open(path, "wb") as file:
        for arrival, data in messages:
            file.write(struct.pack(">Q", round(arrival * 1e6)) + data)
