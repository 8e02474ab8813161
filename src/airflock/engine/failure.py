"""Failure: what to say of a flight that could not be started or went wrong, and the step at which it did."""

from airflock.engine.state import DriverState
from airflock.scenarios import Scenario


def no_place_message(scenario: Scenario, seed: int, agent: int) -> str:
    """One line for an agent that found no place at the start."""
    walls = scenario.start.wall_clearance
    keys = ["start.separation", *(["start.wall_clearance"] if walls else [])]
    room = f"{keys[0]} = {scenario.separation():g} m" + (f" and {keys[1]} = {walls:g} m" if walls else "")
    return (
        f"{scenario.name}: seed {seed}: agent {agent} of {scenario.agents} found no place at {room}; "
        f"enlarge the arena or lower {' or '.join(keys)}"
    )


def not_finite_message(scenario: Scenario, seed: int, agent: int, step: int) -> str:
    """One line for an agent whose state stopped being finite at a step."""
    return (
        f"{scenario.name}: seed {seed}: agent {agent} left the finite numbers at step {step} "
        f"(t = {step * scenario.flight.dt:g} s)"
    )


def first_bad_step(state: DriverState, low: int, high: int, half: int = 0) -> int:
    """First step after which a state is not finite, by halves.

    state : of a flight that is about to fly the step `low`, is finite there, and is not before the step `high`
    half  : as in `State.advance`, for the step `low`
    """
    while high - low > 1:
        middle, kept = (low + high) // 2, state.buffer.copy()
        state.advance(low, middle, half)
        if state.is_finite:
            low, half = middle, 0
        else:
            high = middle
            state.buffer[:] = kept
    return high
