"""A motor with a share of its thrust."""


def motion(vx, vy, vz, nx, ny, nz, since):
    """Velocity after the step, m/s."""
    k = 0.3 + 0.1 * since
    return vx + k * (nx - vx), vy + k * (ny - vy), vz + k * (nz - vz)
