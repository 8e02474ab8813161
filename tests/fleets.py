"""Fleets and cards that several tests fly."""

import airflock
from airflock.drones.mavlink.orders import new_operator_keys
from airflock.drones.onboard.card import card_hash, parse_card
from airflock.fleets.card_document import make_card_document
from airflock.fleets.lockstep import LockstepFleet

SITE = (47.5, 19.0, 120.0)
QUIET = {"body.noise": 0.0, "sensors.noise": 0.0}
PRIVATE, PUBLIC = new_operator_keys()


def scenario(agents=3, duration=60.0, noisy=False, **more):
    """Real drones at 4 m/s in an arena of 120 m."""
    settings = {"agents": agents, "duration": duration, "world.side": 120.0, "metrics.period": 0.2}
    return airflock.load("vasarhelyi_2018/real_4ms", settings | ({} if noisy else QUIET) | more)


def document(found, **more):
    """Document of a card without hash."""
    usual = {"site": SITE, "members": range(1, found.agents + 1), "mission": 7, "expires": 1_900_000_000}
    limits = {"tick": 0.2, "status_period": 0.2} | more.pop("safety", {})
    return make_card_document(found, **(usual | {"operator": PUBLIC, "margin": 40.0, "safety": limits} | more))


def card(found, **more):
    """A checked card."""
    made = document(found, **more)
    return parse_card({**made, "hash": card_hash(made)})


def fleet(found, seed=0, start=None, faults=(), **more):
    """A fleet in lock-step."""
    return LockstepFleet(found, card(found, **more), seed, start=start, faults=faults, operator=PRIVATE)
