"""What to do with a tuned set: watch its worst flights, and prepare the first real one."""

from itertools import zip_longest

from airflock.core import declarations, format_with_unit
from airflock.runs import with_parameters
from airflock.search.tune.result import TUNED_FILE, TuneResult
from airflock.support import CardError

REPLAYS = 3  # of the worst flights; more where there are more limits
SHOWN = ("speed_max", "accel", "response", "brake", "soft_margin", "base", "mission_time")  # limits that the set moves


def replay_files(result: TuneResult) -> dict[int, str]:
    """Seed → file beside the report that plays this flight: the worst of each limit, then their second worst."""
    from airflock.recordings import simulate
    from airflock.view import replay

    made = result.certificate
    of_limit: dict[str, list[int]] = {}
    for entry in made.worst:
        of_limit.setdefault(str(entry["limit"]), []).append(int(entry["seed"]))
    in_turn = [seed for row in zip_longest(*of_limit.values()) for seed in row if seed is not None]
    seeds = list(dict.fromkeys(in_turn))[: max(REPLAYS, len(of_limit))]
    written = {}
    for number, seed in enumerate(seeds, 1):
        flown = with_parameters(result.scenario, made.campaign.parameters(seed))
        name = f"worst_{number}.html"
        replay(simulate(flown, seed=seed)).save(result.folder / name)
        written[seed] = name
    return written


def flight_card_limits(result: TuneResult) -> tuple[list[tuple[str, str, str]], str]:
    """Limits of the flight card of this set (name, value, meaning), and what to run; or no limits, and why not."""
    from airflock.fleets import make_card_document

    scenario = result.scenario
    members = range(1, int(scenario.flight.agents) + 1)
    try:
        document = make_card_document(scenario, site=(0.0, 0.0, 0.0), members=members, mission=1, expires=0)
    except CardError as fault:
        return [], f"No flight card can be made of it: {str(fault).splitlines()[0]}"
    from airflock.drones import SafetyLimits

    known = {name: how for name, how, _ in declarations(SafetyLimits())}
    safety, fence = document["safety"], document["fence"]
    rows = [
        (f"safety.{name}", format_with_unit(f"{safety[name]:.4g}", known[name].unit), known[name].meaning)  # type: ignore[union-attr]
        for name in SHOWN
        if name in safety and name in known
    ]
    rows.append(("fence", f"{fence['low']:.4g} to {fence['high']:.4g} m high", f"{len(fence['corners'])} corners"))
    path = result.folder / TUNED_FILE
    return rows, f"airflock fly prepare {path} --site LAT,LON,ALT --members 1-{len(members)} --out mission.json"
