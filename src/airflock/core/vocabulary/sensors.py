"""What the rules of a sensor may ask for."""

SENSED = {
    "x": "true position, east, m",
    "y": "true position, north, m",
    "z": "true position, up, m",
    "vx": "true velocity, east, m/s",
    "vy": "true velocity, north, m/s",
    "vz": "true velocity, up, m/s",
    "memory": "the sensor's Memory of this agent",
    **{f"g{k}": "normal random number, new at each measurement" for k in range(12)},
    **{f"u{k}": "uniform random number between 0 and 1, new at each measurement" for k in range(4)},
    "time": "time of the measurement, s",
    "period": "time between two measurements, s",
}
AXIS_ERROR = {
    "dx": "error of the position along one axis at the last measurement, m",
    "dv": "error of the velocity along this axis at the last measurement, m/s",
    "g": "normal random number of this axis",
    "period": "time between two measurements, s",
}
RULES = {
    "measure": {**SENSED, "s": "the sensor's parameters"},
    "error": {**AXIS_ERROR, "s": "the sensor's parameters"},
    "exact": {"s": "the sensor's parameters"},
    "bounds": {"s": "the sensor's parameters", "period": "time between two measurements, s", "dt": "time step, s"},
}
