"""The public door: a scenario and limits in, a certificate out; begun or continued in a folder of flights."""

import math
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product, takewhile
from pathlib import Path
from typing import Any

from airflock.certificates.campaign import (
    FIRST_VALUE,
    MAP_PURPOSE,
    TOLERANCE_PURPOSE,
    Campaign,
    campaign_from_request,
    campaign_of_request,
    certificate_seed,
    check_certify_budget,
    check_workers,
    environment_numbers,
    read_intervals,
    tolerance_keys,
    worse_direction,
)
from airflock.certificates.certificate import Certificate, EventTiming, event_timing
from airflock.certificates.counting import CampaignFlyer, CountResult, count_events
from airflock.certificates.limits import InterimLook, alpha_share, flights_needed, look_schedule, take_look
from airflock.certificates.splitting import check_split
from airflock.core import Quantity
from airflock.runs import (
    RESULT_FILE,
    CandidateBatch,
    Executor,
    Flight,
    OnProgress,
    declared_numbers,
    held_request,
    make_executor,
    open_folder,
    open_run,
    program_versions,
    read_request,
    run_folder,
    to_toml_values,
    write_toml_file,
)
from airflock.scenarios import Scenario, formats, scenario_variant
from airflock.support import ErrorCollector, ScenarioError, StudyError, suggest

# A tolerance says how far a number of the environment may move until a limit can no longer be shown.
# Every value that is tried flies the same seeds, so that values differ by nothing but themselves. A value is safe where
# the upper bound falls below the limit. It is not shown where the bound does not fall below the limit within
# MAX_FLIGHTS_FACTOR times the fewest flights that could show it, or where the lower bound exceeds the limit. Rare
# limits would need too many flights at each value: they are screened at LEVEL per flight. Numbers that are zero are
# moved up from a first value (`FIRST_VALUE`).

LEVEL = 0.02  # probability per flight at which rare limits are screened
MAX_FLIGHTS_FACTOR = 4.0  # flights at one value, as a multiple of those that show the level without an event
REACH = 8.0  # factor up to which a number is moved; of zero: of the first value
HALVINGS = 3  # after a value that is safe and one that is not are known
TIME_OVER = "time was over"


def find_tolerances(flyer: CampaignFlyer, counted: CountResult, keys: Sequence[str]) -> dict[str, Any]:
    """Find the largest value of each key at which the events of all limits stay below a level, and the next value.

    Returns plain values: level, and for each key nominal, unit, safe, not_shown, factor (safe to
    nominal; of zero none), flights, and the interval that the scenario's file gives, if any.
    """
    campaign = flyer.campaign
    level = screening_level(campaign)
    screen = ValueScreen(flyer, level)
    events = sum(any(limit.has_happened(row) for limit in campaign.limits) for row in counted.rows)
    result: dict[str, Any] = {"level": level, "confidence": campaign.confidence, "axis": []}
    if not counted.rows or take_look(len(counted.rows), events, 1.0 - campaign.confidence, 0.0).high > level:
        result["reason"] = f"without any change, the scenario is not shown to stay below {100.0 * level:g} % per flight"
        return result
    known, said = environment_numbers(campaign.scenario), read_intervals(campaign.scenario.document)
    for done, key in enumerate(keys):
        flyer.report(f"tolerance of {key}")
        screen.share_time(len(keys) - done)
        axis = _axis(screen, key, *known[key])
        result["axis"].append(axis | ({"interval": list(said[key])} if key in said else {}))
    return result


def screening_level(campaign: Campaign) -> float:
    """Return the probability per flight against which values are judged: that of the limits, at least LEVEL."""
    return max([LEVEL, *(p for p in map(campaign.probability, campaign.limits) if p is not None)])


class ValueScreen:
    """Screen that judges one value at a time against a level per flight, on seeds that all values share.

    end : moment of `time.monotonic` at which the time for all values is spent, s
    """

    def __init__(self, flyer: CampaignFlyer, level: float, purpose: int = TOLERANCE_PURPOSE):
        self.flyer, self.level, self.purpose, self.end = flyer, level, purpose, flyer.until
        alpha = 1.0 - flyer.campaign.confidence
        most = MAX_FLIGHTS_FACTOR * flights_needed(level, alpha * alpha_share(1))
        self.look_schedule = list(takewhile(lambda due: due[0] <= most, look_schedule(level, alpha)))

    def begin(self, batch: CandidateBatch, parameters: Mapping[str, float]) -> None:
        """Fly the first flight of a value outside of the budget's time, so that its driver is compiled."""
        began, (flight,) = time.monotonic(), self._flights(parameters, [0])
        if self.flyer.is_time_over or self.flyer.store.flown(batch):
            return
        for _ in self.flyer.fly(batch, [flight]):
            pass
        # A new kind of number (a delay above zero) compiles another driver. That takes seconds and
        # is no flight time.
        waited = time.monotonic() - began
        self.end += waited
        self.flyer = replace(self.flyer, until=self.flyer.until + waited)

    def share_time(self, parts: int) -> None:
        """Give the next of so many parts its share of the time that is left."""
        left = self.end - time.monotonic()
        self.flyer = self.flyer.with_budget(left / parts)

    def _flights(self, parameters: Mapping[str, float], numbers: Sequence[int]) -> list[Flight]:
        campaign = self.flyer.campaign
        own = [certificate_seed(campaign.hash, self.purpose, number) for number in numbers]
        return [
            Flight(0, number, {**campaign.parameters(each), **parameters}, each)
            for number, each in zip(numbers, own, strict=True)
        ]

    def judged(self, stage: str, parameters: Mapping[str, float]) -> tuple[str, InterimLook | None]:
        """Return safe, unsafe, open, or a reason why it cannot be flown; and the last look."""
        batch = value_batch(stage, parameters)
        self.flyer.store.ask(batch, [list(parameters.values())], [parameters])
        # Flights in rounds between looks: a value that is clearly safe or unsafe needs few of them.
        campaign = self.flyer.campaign
        flown = {number: values for (_, number), values in self.flyer.store.flown(batch).items()}
        events, done, last = 0, 0, None
        for size, above, below in self.look_schedule:
            missing = [number for number in range(done, size) if number not in flown]
            if missing and self.flyer.is_time_over:
                return TIME_OVER, last
            for landed in self.flyer.fly(batch, self._flights(parameters, missing)):
                flown[landed.flight.repeat] = landed.values
                if landed.values is None:
                    return f"cannot be flown: {landed.reason}", last
            rows = [flown[number] for number in range(done, size)]
            if any(row is None for row in rows):
                return "cannot be flown", last
            events += sum(any(limit.has_happened(row or {}) for limit in campaign.limits) for row in rows)
            done, last = size, take_look(size, events, above, below)
            if last.high < self.level:
                return "safe", last
            if last.low > self.level:
                return "unsafe", last
        return "open", last


def value_batch(stage: str, parameters: Mapping[str, float]) -> CandidateBatch:
    """Return the batch of flights at these values. Its name holds them: a campaign may resume with other keys."""
    return CandidateBatch(f"{stage}: {', '.join(f'{key} = {value!r}' for key, value in parameters.items())}", 0, 0)


def _axis(screen: ValueScreen, key: str, how: Quantity, nominal: float) -> dict[str, Any]:
    """Move one number until it is no longer safe, then halve the way between."""
    # Doubling brackets the first unsafe value in few trials. Bisection is geometric: tolerances are
    # factors.
    first = nominal or FIRST_VALUE[key]
    last, end = first * REACH ** worse_direction(key), ""
    safe, bad, flights, verdict = nominal, math.nan, 0, ""

    def is_safe(value: float) -> bool | None:
        """Return None if time ended before that was known."""
        nonlocal flights, verdict
        parameters = {key: value}
        if not nominal and not flights:
            screen.begin(value_batch("tolerance", parameters), parameters)
        verdict, look = screen.judged("tolerance", parameters)
        flights += look.flights if look else 0
        return None if verdict == TIME_OVER else verdict == "safe"

    while worse_direction(key) * (last - safe) > 1e-9 * last:
        candidate = _whole(how, min(max(safe * 2.0 ** worse_direction(key) or first, how.low), how.high))
        if candidate == safe:
            end = f"the end of its range, {how.span}"
            break
        good = is_safe(candidate)
        if not good:
            bad = candidate if good is not None else math.nan
            break
        safe = candidate
    for _ in range(0 if math.isnan(bad) else HALVINGS):
        middle = _whole(how, math.sqrt(safe * bad) if safe else 0.5 * bad)
        if middle in (safe, bad):
            break
        good = is_safe(middle)
        if good is None:
            break
        safe, bad = (middle, bad) if good else (safe, middle)
    said = "" if verdict in ("safe", "unsafe", "open") else verdict
    note = "; ".join(text for text in (_kind(screen.flyer.campaign, key), end or said) if text)
    made: dict[str, Any] = {"key": key, "unit": how.unit, "nominal": nominal, "safe": safe, "flights": flights}
    made |= ({"factor": safe / nominal} if nominal else {}) | ({} if math.isnan(bad) else {"not_shown": bad})
    return made | ({"note": note} if note else {})


def _kind(campaign: Campaign, key: str) -> str:
    """Return the kind of the fault to which a number belongs; else empty."""
    place = key.removeprefix("faults[").partition("]")[0]
    return campaign.scenario.faults[int(place)].fault.name if place.isdecimal() else ""


def _whole(how: Quantity, value: float) -> float:
    return float(round(value)) if how.whole else value


MAX_CELLS = 400  # cells


def check_map_axes(scenario: Scenario, axes: Mapping[str, Sequence[float]]) -> dict[str, list[float]]:
    """The two axes of a map; ScenarioError with everything that is wrong with them."""
    known, faults = declared_numbers(scenario), []
    if len(axes) != 2:
        faults.append(f"map: needs two keys, not {len(axes)}")
    for key, values in axes.items():
        if key not in known:
            faults.append(f"map: {key} is not a number of {scenario.name}{suggest(key, known, lead='; ')}")
            continue
        how = known[key][0]
        for value in values:
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not how.low <= value <= how.high:
                faults.append(f"map: {key} = {value!r} lies outside {how.span}")
        if len(set(values)) < 2 or sorted(values) != list(values):
            faults.append(f"map: {key}: give at least two values that grow")
    if math.prod(len(values) for values in axes.values()) > MAX_CELLS:
        faults.append(f"map: more than {MAX_CELLS} cells")
    if faults:
        raise ScenarioError(faults)
    return {key: [float(value) for value in values] for key, values in axes.items()}


def map_bounds(flyer: CampaignFlyer, axes: Mapping[str, Sequence[float]]) -> dict[str, Any]:
    """Verdict and bounds of every cell, on seeds that all cells share.

    Returns plain values: level, keys, their units, values, and for each cell values, verdict, low,
    high (per flight), flights.
    """
    screen = ValueScreen(flyer, screening_level(flyer.campaign), MAP_PURPOSE)
    cells = []
    for number, values in enumerate(product(*axes.values())):
        flyer.report(f"map: cell {number + 1} of {math.prod(len(v) for v in axes.values())}")
        parameters = dict(zip(axes, values, strict=True))
        verdict, found = screen.judged("map", parameters)
        cell: dict[str, Any] = {"values": list(values), "verdict": verdict, "low": 0.0, "high": 1.0, "flights": 0}
        if found is not None:
            cell |= {"low": found.low, "high": found.high, "flights": found.flights, "events": found.events}
        cells.append(cell)
    units = [declared_numbers(flyer.campaign.scenario)[key][0].unit for key in axes]
    result: dict[str, Any] = {"level": screen.level, "keys": list(axes), "units": units}
    return result | {"axes": [list(values) for values in axes.values()], "cell": cells}


BUDGET = 600.0  # s
COUNT_BUDGET_SHARE = 2.0 / 3.0  # share of the budget that counting may take if tolerances are requested


def certify(
    scenario: Scenario | str | os.PathLike[str] | None = None,
    limit: str | Sequence[str] = (),
    *,
    confidence: float = 0.95,
    budget: float | None = None,
    flights: int | None = None,
    folder: str | os.PathLike[str] | None = None,
    resume: bool = False,
    settings: Mapping[str, Any] | None = None,
    law: Any = None,
    uncertain: bool = False,
    tolerance: bool | Sequence[str] = False,
    split: bool = False,
    over: Mapping[str, Sequence[float]] | None = None,
    precision: int = 32,
    device: str = "cpu",
    scheduler: str | None = None,
    threads: int | None = None,
    timeout: float | None = None,
    watch: OnProgress | None = None,
    trust: bool = False,
) -> Certificate:
    """Show by counting that an event is rare: exact bounds that hold over all looks, seeds fixed by the scenario.

    Parameters
    ----------
    scenario : Scenario, str or path (PRESET|FILE), optional
        What is flown; none to continue what a folder holds; with --check a certificate.
    limit : str or list of str
        "r_min<1 at 1e-3/h", "n_coll>=1 at 1e-2/drone-h", "clearance<0 at 1%", "phi_vel>=3 in 99%"; without a rate the
        event is bounded as well as the flights allow. All limits hold together.
    confidence : float
        Confidence that all limits hold together, in (0, 1).
    budget : float, optional
        Time that may be spent, s, for a command also 10min or 2h; a campaign that is over takes more only if it is
        given; by default 600.
    flights : int, optional
        Fly so many, whatever the time, and look once.
    folder : str or path, optional
        Folder that keeps every flight, so that what was interrupted can be continued.
    resume : bool
        Continue the campaign in the folder, which holds its scenario, limits and options.
    settings : mapping, optional
        Keys of the scenario to change.
    law : optional
        A flocking law of your own, as `airflock.load` takes it.
    uncertain : bool
        Each flight draws its numbers from the intervals in the scenario file (`airflock identify --uncertain`).
    tolerance : bool or list of str
        Also find how far each number of the environment may move; or only the keys that are named.
    split : bool
        Also estimate limits on r_min by splitting, which finds and ranks rare flights but shows nothing.
    over : mapping (KEY=VALUES), optional
        Two keys with their values: also bounds over this grid, {"radio.delay": [0.5, 1.0], "body.noise": [0.2, 0.4]};
        for a command twice, such as radio.delay=0.5:1.5:5.
    precision : int
        Bits per number: 32 or 64.
    device : str
        cpu, or python (no compiler, double precision).
    scheduler : str, optional
        Address of a dask scheduler; by default flights fly in this process.
    threads : int, optional
        Flights side by side; by default one per core.
    timeout : float, optional
        Time that a flight may take on a dask worker, s.
    watch : callable, optional
        Called with a Progress now and then.
    trust : bool
        Whether code that files name may run.

    Returns
    -------
    Certificate
        Verdicts, bounds, worst flights; `save` writes certificate.toml, `check` flies one flight in a hundred again.

    Raises
    ------
    ScenarioError, StudyError
        If the scenario, a limit or the folder cannot be used, or a flight fails.
    Interrupted
        At Ctrl-C.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 3, "duration": 1.0})
    >>> found = airflock.certify(short, "r_min<0.01 at 20%", flights=14)
    >>> found.shown, found.verdicts[0].events
    (True, 0)
    """
    errors = ErrorCollector()
    if scenario is None:
        campaign, also = resumed_campaign(
            folder if resume else None, trust=trust, limit=limit, flights=flights, settings=settings, law=law,
            uncertain=uncertain, confidence=confidence != 0.95, precision=precision != 32, device=device != "cpu",
        )  # fmt: skip
        tolerance, split, over = tolerance or also["tolerance"], split or also["split"], over or also["map"]
        found = campaign.scenario
    else:
        found = scenario_variant(scenario, settings, law, trust=trust)
        chosen: dict[str, Any] = {"uncertain": uncertain, "precision": precision, "device": device}
        campaign = errors.read(campaign_from_request, found, limit, confidence, flights, **chosen)
    if split:
        errors.read(check_split, campaign)
    keys = errors.read(tolerance_keys, found, tolerance)
    axes = errors.read(check_map_axes, found, over) if over else {}
    if budget is not None:
        errors.read(check_certify_budget, budget)
    errors.read(check_workers, timeout, scheduler, device)
    errors.raise_errors()
    return fly_campaign(
        campaign, folder, budget, watch, resume=resume, keys=keys, split=split, axes=axes, scheduler=scheduler,
        threads=threads, timeout=timeout,
    )  # fmt: skip


def resumed_campaign(
    folder: str | os.PathLike[str] | None, *, trust: bool = False, **given: Any
) -> tuple[Campaign, Mapping[str, Any]]:
    """Return the campaign that a folder holds, and what is done besides: `tolerance`, `split` and `map`.

    given : options that the folder holds itself, and that are refused
    """
    held = held_request(folder, Campaign.kind, given)
    also = {"tolerance": [], "split": False, "map": {}, **held.get("also", {})}
    return campaign_of_request(held, trust=trust), also


def fly_campaign(
    campaign: Campaign,
    folder: str | os.PathLike[str] | None,
    budget: float | None = None,
    on_progress: OnProgress | None = None,
    *,
    resume: bool | None = None,
    keys: Sequence[str] = (),
    split: bool = False,
    axes: Mapping[str, Sequence[float]] | None = None,
    scheduler: str | None = None,
    threads: int | None = None,
    timeout: float | None = None,
) -> Certificate:
    """Run a campaign in a folder, or in a temporary one; begin or continue it as `airflock.runs.open_folder` does.

    budget : s; None: BUDGET for one that is not over yet
    """
    extras: dict[str, Any] = {"tolerance": list(keys), "split": split, "map": dict(axes or {})}
    extras = {key: to_toml_values(value) for key, value in extras.items() if value}
    with run_folder(folder) as path:
        held = read_request(path, campaign.kind, resume=resume) or {}
        is_over = budget is None and (path / RESULT_FILE).is_file() and extras.items() <= held.get("also", {}).items()
        executor = make_executor([campaign.task], scheduler=scheduler, threads=threads, timeout=timeout)
        try:
            if scheduler is None and campaign.device == "cpu" and not is_over:
                campaign.task.compile()  # which takes none of the time for flights
            budget = 0.0 if is_over else BUDGET if budget is None else budget
            campaign = with_planned_flights(campaign, executor, budget, path, resume is not False)
            open_folder(path, campaign, resume=resume, also=extras)
            return run_campaign(
                campaign, path, executor, budget, on_progress, keys=keys, split=split, axes=axes, threads=threads,
                is_stored=folder is not None,
            )  # fmt: skip
        finally:
            executor.close()


def run_campaign(
    campaign: Campaign,
    folder: Path,
    executor: Executor,
    budget: float,
    on_progress: OnProgress | None = None,
    *,
    keys: Sequence[str] = (),
    split: bool = False,
    axes: Mapping[str, Sequence[float]] | None = None,
    threads: int | None = None,
    is_stored: bool = True,
) -> Certificate:
    """Count, find tolerances of `keys`, split, and map over `axes`, in a folder that `open_folder` has accepted.

    is_stored : True if the folder stays
    """
    began = time.monotonic()
    where = str(folder / "scenario.toml") if is_stored else campaign.scenario.name

    def left(share: float = 1.0) -> float:
        return share * (budget if campaign.flights else max(0.0, budget - (time.monotonic() - began)))

    with open_run(folder, executor, is_stored=is_stored) as store:
        write_toml_file(folder / "scenario.toml", {formats.KEY: formats.FORMAT, **campaign.scenario.document})
        flyer = CampaignFlyer(campaign, store, executor, watch=on_progress)
        # Counting first, with its share: splitting and tolerances start from its flights.
        part = COUNT_BUDGET_SHARE if keys or split or axes else 1.0
        counted = count_events(flyer if campaign.flights else flyer.with_budget(budget * part))
        rare: Mapping[str, Any] = {}
        tolerances: Mapping[str, Any] = {}
        if split:
            from airflock.certificates.splitting import estimate_by_splitting as splitting

            rare = splitting(flyer.with_budget(left(0.5 if keys else 1.0)), counted, threads, where)
        if keys:
            tolerances = find_tolerances(flyer.with_budget(left(0.5 if axes else 1.0)), counted, keys)
        cells = map_bounds(flyer.with_budget(left()), axes) if axes else {}
    made = Certificate(
        campaign, tuple(counted.verdicts), event_timings(campaign, counted), counted.rows, program_versions(),
        time.monotonic() - began, counted.rate, tolerances, rare, cells, where,
    )  # fmt: skip
    if is_stored and (budget > 0.0 or not (folder / RESULT_FILE).is_file()):
        made.save(folder / RESULT_FILE)
    return made


def event_timings(campaign: Campaign, counted: CountResult) -> dict[int, EventTiming]:
    """Return the timing of events over a flight for each limit whose event has a moment."""
    found = {}
    timed = [i for i, limit in enumerate(campaign.limits) if limit.is_timed]
    for place, i in enumerate(timed):
        times = [row["first"][place] for row in counted.rows if row.get("first") and row["first"][place] is not None]
        found[i] = event_timing(times, len(counted.rows), campaign.scenario.flight.duration)
    return found


TRIAL = 16  # flights by which the time of one flight is measured


def with_planned_flights(campaign: Campaign, executor: Executor, budget: float, folder: Path, resume: bool) -> Campaign:
    """Return the campaign with a number of flights if a limit has no rate: as many as the budget allows.

    A few flights on seeds of their own measure how long one takes; the number is fixed before the
    first one counts.
    """
    if campaign.flights is not None or all(limit.rate is not None for limit in campaign.limits):
        return campaign
    if resume and (held := read_request(folder, campaign.kind)):
        known = held.get("flights")
        return replace(campaign, flights=known if isinstance(known, int) else None)
    began = time.monotonic()
    # Seeds of their own, far behind those of tolerances: a flight that chose the number must not
    # count.
    own = [certificate_seed(campaign.hash, TOLERANCE_PURPOSE, (1 << 29) + i) for i in range(TRIAL)]
    for landed in executor.fly([Flight(0, i, campaign.parameters(s), s) for i, s in enumerate(own)]):
        if landed.values is None:
            raise StudyError(f"{campaign.scenario.name}: seed {landed.flight.seed}: {landed.reason}")
    able = 0.9 * budget * TRIAL / max(time.monotonic() - began, 1e-6)
    # Two digits: a round number shows that the count did not choose it. A tenth of the time is kept
    # as a margin.
    digits = 10.0 ** max(0, math.floor(math.log10(max(able, 1.0))) - 1)
    return replace(campaign, flights=max(1, min(int(able / digits) * int(digits), (1 << 30) - 1)))
