"""What to do with a tuned set: watch its worst flights, and prepare the first real one."""

from itertools import zip_longest

from airflock.core.parameters import declarations, with_unit
from airflock.runs.space import with_parameters
from airflock.search.tune.result import TUNED, Tuned
from airflock.support.errors import CardError

REPLAYS = 3  # of the worst flights; more where there are more limits
SHOWN = ("speed_max", "accel", "response", "brake", "soft_margin", "base", "mission_time")  # limits that the set moves


def replays(found: Tuned) -> dict[int, str]:
    """Seed → file beside the report that plays this flight: the worst of each limit, then their second worst."""
    from airflock.recordings.flights import simulate
    from airflock.view.replays.build import replay

    made = found.certificate
    of_limit: dict[str, list[int]] = {}
    for entry in made.worst:
        of_limit.setdefault(str(entry["limit"]), []).append(int(entry["seed"]))
    in_turn = [seed for row in zip_longest(*of_limit.values()) for seed in row if seed is not None]
    seeds = list(dict.fromkeys(in_turn))[: max(REPLAYS, len(of_limit))]
    written = {}
    for number, seed in enumerate(seeds, 1):
        flown = with_parameters(found.scenario, made.campaign.parameters(seed))
        name = f"worst_{number}.html"
        replay(simulate(flown, seed=seed)).save(found.folder / name)
        written[seed] = name
    return written


def card(found: Tuned) -> tuple[list[tuple[str, str, str]], str]:
    """Limits of the flight card of this set (name, value, meaning), and what to run; or no limits, and why not."""
    from airflock.fleets.prepare import card_document

    scenario = found.scenario
    members = range(1, int(scenario.flight.agents) + 1)
    try:
        document = card_document(scenario, site=(0.0, 0.0, 0.0), members=members, mission=1, expires=0)
    except CardError as fault:
        return [], f"No flight card can be made of it: {str(fault).splitlines()[0]}"
    from airflock.drones.onboard.safety import Safety

    known = {name: how for name, how, _ in declarations(Safety())}
    safety, fence = document["safety"], document["fence"]
    rows = [
        (f"safety.{name}", with_unit(f"{safety[name]:.4g}", known[name].unit), known[name].meaning)  # type: ignore[union-attr]
        for name in SHOWN
        if name in safety and name in known
    ]
    rows.append(("fence", f"{fence['low']:.4g} to {fence['high']:.4g} m high", f"{len(fence['corners'])} corners"))
    path = found.folder / TUNED
    return rows, f"airflock fly prepare {path} --site LAT,LON,ALT --members 1-{len(members)} --out mission.json"
