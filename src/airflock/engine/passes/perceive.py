"""Perceive: the stages that bring an agent what it knows, as functions of a driver."""

from airflock.engine.passes.build import Builder
from airflock.engine.plan import Plan
from airflock.engine.replace import checked_replace
from airflock.engine.specialise.stage import specialise
from airflock.engine.specialise.values import driver_argument
from airflock.engine.stages import meet as meeting, perceive as measuring, receive as hearing

MEET_ARGUMENTS = "i, k_, n, m, row, whole, work"  # what the stage is called with
RECEIVE_CALLS = {  # whether each pair draws for itself: what stage draws
    False: "receive(i, k_, n, m, whole, work, words)",
    True: "receive(i, j, k_, n, world, seed_low, seed_high)",
}


def add_error_functions(build: Builder) -> measuring.ErrorFunctions | None:
    """Functions wander and err, whose rows are told to lie apart; None where their loops stand where needed."""
    plan = build.plan
    if not build.apart or plan.sequential or not plan.has_sensor_error or plan.senses:
        return None
    made = specialise(build, measuring.wander)
    build.function("wander(m, q, u, g, row, work)", ["apart()", *made.lines], once=True)
    made = specialise(build, measuring.err)
    build.function("err(m, place, rate, x, v, q, u)", ["apart()", *made.lines], once=True)
    return measuring.ErrorFunctions(build.stages["wander"], build.stages["err"])


def add_snapshot(build: Builder) -> None:
    """Function snapshot: the true states into a slot of the ring."""
    made = specialise(build, measuring.snapshot)
    build.function("snapshot(slot, m, work, ring)", ["apart()"] * build.apart, made.lines, once=True)


def add_meet(build: Builder) -> None:
    """Function meet, where agents meet but some of whom they hear: fills row met for one agent."""
    plan = build.plan
    if plan.topology is not None and not plan.grid:
        made = specialise(build, meeting.meet, decision=driver_argument("k_"))
        build.function(f"meet({', '.join([MEET_ARGUMENTS, *world_arguments(plan)])})", made.lines, "return 0")


def world_arguments(plan: Plan) -> tuple[str, ...]:
    """What stands in the world, where it may hide neighbours or shade the radio: more arguments of the two stages."""
    return ("edges", "spans", "scene") if plan.hides or plan.shades else ()


def pair_word(plan: Plan) -> str:
    """What draws the random word of a pair, called for agents i and j, which may lie elsewhere than by their number."""
    called = RECEIVE_CALLS[True]
    return checked_replace([called], "(i, j, k_, n,", "(order[i], order[j], k_, born,")[0] if plan.absence else called


def add_receive(build: Builder) -> None:
    """Function receive, where packets are lost: random words of what is sent to four agents, or to one of a pair."""
    if not build.plan.draws:
        return
    made = specialise(build, hearing.word if build.draws_per_pair else hearing.draw, decision=driver_argument("k_"))
    build.function(RECEIVE_CALLS[build.draws_per_pair], made.lines, f"return {made.answer}")
