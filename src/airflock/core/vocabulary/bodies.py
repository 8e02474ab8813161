"""What the rules of a body may ask for."""

STATE = {
    "x": "position, east, m",
    "y": "position, north, m",
    "z": "position, up, m",
    "vx": "velocity, east, m/s",
    "vy": "velocity, north, m/s",
    "vz": "velocity, up, m/s",
}
COMMAND = {
    "cx": "command, east; m/s or m/s² as the model's COMMAND says",
    "cy": "command, north; m/s or m/s² as the model's COMMAND says",
    "cz": "command, up; m/s or m/s² as the model's COMMAND says",
}
MOTION = {
    "vx": "true velocity, east, m/s",
    "vy": "true velocity, north, m/s",
    "vz": "true velocity, up, m/s",
    "mx": "own velocity as measured, east, m/s",
    "my": "own velocity as measured, north, m/s",
    "mz": "own velocity as measured, up, m/s",
    **COMMAND,
    "gx": "normal random number, east",
    "gy": "normal random number, north",
    "gz": "normal random number, up",
    "wx": "wind, east, m/s",
    "wy": "wind, north, m/s",
    "wz": "wind, up, m/s",
    "dt": "time step, s",
    "memory": "the body's Memory of this agent",
    "wing": "parameters of the wing (aero.wing)",
}
RULES = {
    "move": {**MOTION, "b": "the body's parameters"},
    "limits": {
        "b": "the body's parameters",
        "dt": "time step, s",
        "speed": "preferred speed of the law, m/s; 0.0 if it has none",
        "start": "speed at the start, m/s",
        "wing": "parameters of the wing (aero.wing)",
    },
    "endures": {
        "memory": "the body's Memory of this agent",
        "b": "the body's parameters",
        "wing": "parameters of the wing (aero.wing)",
    },
}
