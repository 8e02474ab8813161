"""A compass that breaks: what is forward seems to lie to the right."""


def sense(x, y, z, vx, vy, vz):
    """What the agent believes."""
    return x, y, z, vy, -vx, vz
