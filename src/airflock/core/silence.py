"""Silence: a neighbour that is not heard may be near. A plain rule, for a drone on board and for a simulated one.

Nobody heard is not nobody there. Flocks whose agents forget a silent neighbour fly into it. An
agent that follows this rule stops as soon as a neighbour whose data have grown old could be near by
now, and stays where it stopped until it hears of it again or gives it up, and for a pause beyond.
Until data are that old, they count as heard. Of forty simulated flights with 15 s of silence, forty
came below 3 m without the rule and none with it
(`docs/decisions/0021-stop-near-silent-neighbours.md`).
"""

from dataclasses import dataclass, replace

from airflock.core.maths import shorten
from airflock.core.parameters import Parameters as Record, choice, quantity

# Patience is the delay of the radio and 0.5 s: with 2 s the second without data is flown blind, and
# four of forty flights came below 3 m.
SPARE = 0.5  # s; our choice: two decisions without news; with 1 s, four flights of 40 came below 3 m
GRACE = 1e-3  # s; two clocks that count the same decisions differ by less
USUAL = 4.0  # m/s; our choice: the speed at which the numbers were found
OURS = "our choice, from flights of 10 drones at 4 m/s with 15 s of silence"


@dataclass(frozen=True, kw_only=True)
class SilenceParameters(Record):
    """Parameters of the rule by which an agent stops because a neighbour that it has lost could be near."""

    rule: str = choice(
        "fly_on", ("fly_on", "stop"), source=OURS,
        meaning="an agent forgets a neighbour that it no longer hears; or it stops while that neighbour could be near",
    )  # fmt: skip
    keep: float = quantity(
        5.0, "m", low=0.0, high=1000.0, source=OURS, meaning="smallest distance to keep from a lost neighbour"
    )
    patience: float | None = quantity(
        None, "s", low=0.0, high=600.0, source=OURS,
        meaning="age of data up to which a neighbour is not lost: its last packet counts on; by default 0.5 s more "
        "than radio.delay",
    )  # fmt: skip
    closing: float | None = quantity(
        None, "m/s", low=0.0, high=1e5, source=OURS,
        meaning="speed at which the reach of a lost neighbour grows with the age of its data; by default twice the "
        "speed that the law prefers",
    )  # fmt: skip
    hold: float = quantity(
        0.5, "1/s", low=0.0, high=10.0, source=OURS,
        meaning="speed, per distance, at which an agent that has stopped returns to the place where it stopped",
    )  # fmt: skip
    pause: float = quantity(
        1.0, "s", low=0.0, high=60.0, source=OURS,
        meaning="an agent that has stopped goes on once no lost neighbour could have been near for this long",
    )  # fmt: skip
    # By then the autopilot of the neighbour has landed it. A failsafe that hovers would keep it at
    # the height of the flock.
    forget: float = quantity(
        20.0, "s", low=0.0, high=3600.0, source=OURS, meaning="age of data after which a neighbour is given up"
    )


Parameters = SilenceParameters  # the name under which a rule's file declares its numbers


def with_defaults(s: SilenceParameters, speed: float, delay: float = 0.0, rule: str | None = None) -> SilenceParameters:
    """Return a copy of the parameters with the defaults of the scenario filled in, and with `rule` if one is passed.

    speed : that the law prefers, m/s; 0 where it prefers none, which counts as 4 m/s
    delay : of the radio, s
    """
    # Twice the speed of the flock, as if both flew towards each other. The own way is counted
    # already, but this margin was enough in forty blackouts.
    closing = 2.0 * (speed or USUAL) if s.closing is None else s.closing
    patience = delay + SPARE if s.patience is None else s.patience
    return replace(s, closing=closing, patience=patience, rule=rule or s.rule)


def for_standing_neighbour(s: SilenceParameters) -> SilenceParameters:
    """Return the parameters for a lost neighbour that announced to hold or return: its reach grows half as fast.

    Its distance is measured from where an agent is now, so that half of twice the flock's speed
    still covers one that has flown on at the speed of the flock. At the full speed, four of forty
    fleets in which one drone holds because its clock is 0.5 s ahead came below 3 m.
    """
    assert s.closing is not None, "complete"
    return replace(s, closing=0.5 * s.closing)


def counts(age, s):
    """1.0 if what is known of a neighbour, data of this age (s), still counts as heard, else 0.0.

    One missing packet says nothing of where its sender is; who forgot it at once would not be
    repelled by it.
    """
    return 1.0 if age <= s.patience else 0.0


def could_be_near(distance, age, s):
    """1.0 if a neighbour, last known at a distance (m) from here, data of this age (s), could be near by now, else 0.0.

    Data younger than `s.patience` stop nobody. Its reach grows at `s.closing`; it is given up at
    the age `s.forget`.
    """
    # The reach grows with the whole age of the data, not from `patience` on: for so long the
    # neighbour may have flown. The weaker rule left 31 of 40 flights below 3 m.
    lost = (age > s.patience) & (age < s.forget)
    return 1.0 if lost & (distance - s.keep < s.closing * age) else 0.0


def stands_until(near, now, until, s):
    """Time (s) until which an agent stands, from that of the last decision and whether one it lost could be near now.

    Who went on at the first decision in which it hears all would creep: 1 to 2 m each time, towards
    who does the same.
    """
    return now + s.pause + GRACE if near > 0.5 else until


def back(dx, dy, dz, s):
    """Velocity (m/s) of an agent that stopped, from the offset (m) to where it stopped; at most half of `s.closing`.

    A body that is pushed about would else drift: by 2.4 m in 15 s where its noise is that of the
    paper's drones.
    """
    return shorten(s.hold * dx, s.hold * dy, s.hold * dz, 0.5 * s.closing)
