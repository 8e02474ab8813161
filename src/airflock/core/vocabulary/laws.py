"""What the rules of a flocking law may ask for."""

PAIR = {
    "dx": "offset to the neighbour as heard, east, m",
    "dy": "offset to the neighbour as heard, north, m",
    "dz": "offset to the neighbour as heard, up, m",
    "r": "length of the offset, m",
    "r2": "its square, m²; cheaper than r",
    "dvx": "velocity of the neighbour minus own, east, m/s",
    "dvy": "velocity of the neighbour minus own, north, m/s",
    "dvz": "velocity of the neighbour minus own, up, m/s",
    "dv": "length of the velocity difference, m/s",
    "vx": "own velocity as measured, east, m/s",
    "vy": "own velocity as measured, north, m/s",
    "vz": "own velocity as measured, up, m/s",
    "hx": "own heading (unit vector), east",
    "hy": "own heading (unit vector), north",
    "hz": "own heading (unit vector), up",
    "nhx": "heading of the neighbour as heard, east",
    "nhy": "heading of the neighbour as heard, north",
    "nhz": "heading of the neighbour as heard, up",
    "age": "age of the neighbour's data, s",
    "lower": "1.0 if the neighbour has the lower index, else 0.0",
    "kin": "1.0 if the neighbour is of the own group, else 0.0",
    "group": "number of the neighbour's group in [[groups]], the first being 0.0; -1.0 if it is in none",
}
SURFACE = {
    "distance": "distance to the surface, m; negative on its far side",
    "nx": "unit normal of the surface, pointing to where flying is allowed, east",
    "ny": "unit normal of the surface, pointing to where flying is allowed, north",
    "nz": "unit normal of the surface, pointing to where flying is allowed, up",
    "vx": "own velocity as measured, east, m/s",
    "vy": "own velocity as measured, north, m/s",
    "vz": "own velocity as measured, up, m/s",
}
FLOCK = {
    "n": "number of agents",
    "x": "true positions of all agents, east, m; x[i] is that of agent i",
    "y": "true positions of all agents, north, m; y[i] is that of agent i",
    "z": "true positions of all agents, up, m; z[i] is that of agent i",
    "vx": "their velocities, east, m/s",
    "vy": "their velocities, north, m/s",
    "vz": "their velocities, up, m/s",
    "wing": "parameters of the wing (aero.wing)",
    "aero": "parameters of the drag descent (aero.descent)",
    "work": "scratch arrays in the shapes that `workspace` gives, kept from call to call; work.name[row][column]",
    "shared": "columns of Shared to fill: shared.name[i] for every agent i",
}
AGENT = {
    "own": "Own: velocity vx vy vz (m/s) and heading hx hy hz as measured",
    "sums": "what `neighbour` summed up over all neighbours",
    "walls": "what `boundary` summed up over all surfaces",
    "memory": "the model's Memory of this agent",
    "percept": "Percept: time (s), the offsets centre_x centre_y centre_z to the arena's centre "
    "and goal_x goal_y goal_z to the goal (m), rays and noise",
    "period": "time between two decisions, s",
    "shared": "what `flock` found for this agent",
    "wing": "parameters of the wing (aero.wing)",
    "aero": "parameters of the drag descent (aero.descent)",
}
RULES = {
    "reach": {"p": "parameters"},
    "sight": {"p": "parameters"},
    "wall_reach": {"p": "parameters"},
    "neighbour": {**PAIR, "p": "the model's parameters"},
    "boundary": {**SURFACE, "p": "the model's parameters"},
    "flock": {**FLOCK, "p": "the model's parameters"},
    "decide": {**AGENT, "p": "the model's parameters"},
}
