"""Multirotor that holds one command: the closed form of `motion.move` without noise, over any time. Ours."""

import math


def decay_rate(tau, dt):
    """Rate 1/s at which a gap to the command closes below saturation, flown in steps of dt (s).

    A step of `motion.move` keeps the share 1 - dt/tau of the gap; for dt = 0 the rate is 1/tau.
    """
    return -math.log1p(-dt / tau) / dt if dt > 0.0 else 1.0 / tau


def wander(tau, dt):
    """Variance of a velocity about a held command after a long time, per unit of outer noise, s.

    A step keeps the share 1 - dt/tau of the gap and adds 2 dt; for dt = 0 this is tau.
    """
    # Noise is drawn at every motion step, so the variance is larger than tau by dt / (2 tau); the
    # continuous form biased the outer noise by 0.9 %.
    return tau / (1.0 - 0.5 * dt / tau)


def gap_left(gap, time, tau, rate, a_max):
    """Return the velocity gap (m/s) left after `time` (s), and for how long of it a_max limited the motion (s).

    Saturated while the gap exceeds a_max tau, where it falls by a_max; then exponential with `rate`
    (`decay_rate`).
    """
    limited = min(max((gap - a_max * tau) / a_max, 0.0), time)
    return (gap - a_max * limited) * math.exp(-(time - limited) * rate), limited
