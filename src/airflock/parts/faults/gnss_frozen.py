"""GNSS frozen: the receiver keeps reporting its last position; the agent believes it, and sends it to the others."""


def sense(vx, vy, vz, at_x, at_y, at_z):
    """Position (m) as it was last reported; the velocity, which inertial sensors hold for a while, is right."""
    return at_x, at_y, at_z, vx, vy, vz
