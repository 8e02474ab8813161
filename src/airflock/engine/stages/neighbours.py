"""Neighbours: sum a law's rule over all agents in range of each agent."""

from collections.abc import Callable, Iterable
from typing import Any

from airflock.core import Model, norm
from airflock.engine.plan import Plan
from airflock.engine.stages.air import fill_clear, talkers_in_range
from airflock.engine.stages.observe import observe
from airflock.engine.stages.pair import ADD, HEAR, HEAR_AND_ADD, LOOK, Sums, pair
from airflock.engine.stages.receive import first_of_four, packet_count
from airflock.engine.stages.records import Decision, FlightView, PairLoopAgent, SquaredRanges
from airflock.engine.stages.state import FlockRows, agent_numbers, all_agents
from airflock.engine.stages.words import *

SMALLEST = 1e-3  # m; width of the cells of a law without agents


def own_state(i: int, own: Any, v: Any, h: Any, true: Any, flock: FlockRows, *, plan: Plan) -> None:
    """Load the state of agent i into vectors: believed place (own), velocity (v), heading (h) and true place."""
    axes = range(plan.dimensions)
    for a in axes:
        own[a] = flock.measured_position[a][i]
        v[a] = flock.measured_velocity[a][i]
    # Ranges are a matter of true distances, laws of believed ones; true places are read only where
    # the two differ.
    if plan.perturbed or plan.packets:
        for a in axes:
            true[a] = flock.position[a][i]
    fill_heading(v, h, plan=plan)


def fill_heading(v: Any, h: Any, *, plan: Plan) -> None:
    """Put the direction of the velocity v into the vector h; in a plane neither has a height."""
    if plan.dimensions == 2:
        v[Z] = ZERO
    f = ONE / norm(v[X], v[Y], v[Z])
    # All three axes: a law may read the heading along z in a plane, where it is zero.
    for a in (X, Y, Z):
        h[a] = f * v[a]


def squared_reach(p: Any, *, plan: Plan, model: Model) -> Any:
    """Square of the law's reach with these numbers, m², as squares of distances are compared with it."""
    near = least(call_rule(model.reach, p=p), LIMIT)
    return near * near + TINY if plan.bits == 64 else near * near


def widest_reach(agents: Iterable[int], flock: FlockRows, numbers: Any, *, plan: Plan, model: Model) -> Any:
    """The widest reach of those who fly by a law whose numbers differ among them, m."""
    near = real(SMALLEST)
    # Cells must be as wide as the farthest look of any agent of this law; a narrower law pays
    # nothing for it, because each law sorts its own cells.
    for i in agents:
        own_p = agent_numbers(i, "p", flock, numbers, plan=plan)
        near = most(near, least(call_rule(model.reach, p=own_p), LIMIT))
    return near


def draw_words(i: int, flock: FlockRows, draw: Callable[[int], None], *, plan: Plan) -> None:
    """Have the random words of agent i and the others of its four drawn, once for all of them."""
    # Four receivers share one Philox call. With several laws, or in turn, the four are not
    # processed together, so each draws its own word: the same number, at four times the price.
    if plan.sequential or plan.laws:
        draw(i)
    else:
        if first_of_four(i, flock):
            draw(i)


def pair_parts(looks: bool, flight: FlightView) -> tuple[str, ...]:
    """Return the passes over the others of an agent; an observer receives what a law without neighbours does not."""
    return (
        (() if not flight.plan.observe[0] else (HEAR,) if flight.model.neighbour is None else (LOOK,))
        if looks
        else (HEAR_AND_ADD,)
        if flight.plan.topology is None
        else (HEAR, ADD)
    )


def neighbours(
    agents: Iterable[int], others: Iterable[int], flight: FlightView, n: int, decision: int, time: float, late: float,
    words: Any, draw: Callable[[int], None] | None, drawn: Callable[[int, int], Any] | None,
    meet: Callable[[int], None], *, sums: Sums, images: bool, looks: bool = False,
) -> None:  # fmt: skip
    """Sum the neighbour rule over all others in range of each agent, or over those that its topology lets it meet.

    late   : age of data on arrival, s
    draw   : where packets are lost, fills the rows of `words` for agent i and the others of its
             four
    drawn  : draws the random word of a packet from agent j to agent i instead; each pair then also
             finds by itself what stands between the two
    meet   : fills the row `met` of agent i, where it does not meet all that it hears
    sums   : each field of Sums that is summed, and how it is reduced
    images : whether offsets go to the nearest image (candidates that come by cells are at theirs)
    looks  : nothing is summed; each agent keeps what it observes
    """
    plan, model, flock, numbers = flight.plan, flight.model, flight.flock, flight.numbers
    k = numbers.k
    # A neighbour at exactly the range or the reach counts. Squares of distances that carry the
    # guard TINY, which only double precision can tell, are compared with squares that carry it,
    # too. Who is in range is a matter of true distances, which carry none. Lattices and formations
    # lie exactly on these limits, random places never do: without the guard a neighbour at the
    # range counted in single precision and not in double.
    range_ = least(k.range, LIMIT)
    range2 = range_ * range_ + TINY if plan.bits == 64 and not plan.perturbed else range_ * range_
    if model.reach is not None and not plan.varies("p"):
        near2 = squared_reach(numbers.p, plan=plan, model=model)
    else:
        near2 = LIMIT
    # A link sends a whole number of packets in a decision, the same for all pairs: counted once,
    # outside the loops.
    fast = packet_count(decision, getattr(k, plan.radio.rates[0]), numbers) if len(plan.radio.rates) > 0 else ZERO
    slow = packet_count(decision, getattr(k, plan.radio.rates[1]), numbers) if len(plan.radio.rates) > 1 else ZERO
    at = Decision(decision, n, time, late, fast, slow, drawn)
    # The loop over agents is the outer one and all tests of the plan stand outside the pair loop,
    # so that the inner loop over `others` becomes one vector loop without branches.
    for i in agents:
        ii = integer(i)
        own_p = agent_numbers(i, "p", flock, numbers, plan=plan)
        if model.reach is not None and plan.varies("p"):
            near2 = squared_reach(own_p, plan=plan, model=model)
        if plan.draws and draw is not None:
            draw_words(i, flock, draw, plan=plan)
            lot = words[flock.number[i] & 3]
        else:
            lot = ZERO  # no rule reads it
        own, v, true, h, total = vector(), vector(), vector(), vector(), totals()
        own_state(i, own, v, h, true, flock, plan=plan)
        # Totals live in registers during the pair loop and go to their rows once, after it.
        for c, how in sums:
            total[c] = REDUCTION_START[how]
        if plan.radio.asks_for("talkers"):  # noqa: SIM108 - as above
            talkers = talkers_in_range(i, others, range_ * range_, flock, numbers.w, plan=plan)
        else:
            talkers = ZERO
        # A cast per pair in range through the tree of shapes: in a city, shading costs 3.6 times
        # the flight with `constant`.
        if plan.shades and drawn is None:
            fill_clear(i, others, range_ * range_, flight)
        reach = SquaredRanges(range_ * range_, range2, near2)
        me = PairLoopAgent(i, ii, ii, None, own, v, h, true, own_p, talkers, lot, all_agents(flock), reach, at)
        # One pass where everybody in range is met; two where a topology first ranks those who are
        # heard.
        for part in pair_parts(looks, flight):
            for j in others:
                pair(me, j, j, part, total, flight, sums=sums, images=images)
            if part in (HEAR, LOOK) and plan.topology is not None:
                meet(i)
        if looks:
            observe(i, others, flight)
        for c, _ in sums:
            flock.sums[c][i] = total[c]
