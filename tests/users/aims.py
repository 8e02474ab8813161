"""Fitness functions: order parameters of one flight make a number."""


def calm(values):
    """Slow and apart."""
    return values["r_min"] / (1.0 + values["phi_vel"])
