"""Falling: a body that nothing holds up any more. What air takes off its speed is left out. Ours."""

GRAVITY = 9.80665  # m/s², standard gravity


def fall(x, y, z, vx, vy, vz, dt):
    """Position (m) and velocity (m/s) after dt (s) of free fall: x' = x + v dt + g dt²/2, exact for any dt."""
    return x + vx * dt, y + vy * dt, z + vz * dt - 0.5 * GRAVITY * dt * dt, vx, vy, vz - GRAVITY * dt
