"""Verbs fleet and fly: fly a fleet in software; prepare and fly missions of real drones."""

import gc
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import typer

from airflock import core, drones, fleets, recordings
from airflock.cli import options, terminal
from airflock.cli.command import GroupOfVerbs, verb
from airflock.cli.terminal import counting_parts
from airflock.support import (
    INVALID,
    RECORDINGS,
    CardError,
    ErrorCollector,
    ScenarioError,
    is_file,
    suggest,
    value_or_default,
)

PANEL = "Towards real drones"


ALL_SYSTEM_IDS = tuple(range(1, 251))  # ids that drones may have


@verb(PANEL, "airflock.fleet", "scenario settings trust agents duration SEEDS save json")
def fleet(o: SimpleNamespace, errors: ErrorCollector) -> None:
    """Fly a fleet in software: one node and one MAVLink vehicle per drone, in lock-step or on the real clock.

    Example: airflock fleet vasarhelyi_2018/real_4ms --agents 10 --duration 60 --seeds 5 --against simulator

    Example: airflock fleet vasarhelyi_2018/real_4ms --agents 5 --duration 60 --mode processes --vehicle ardupilot

    Example: airflock fleet vasarhelyi_2018/real_4ms --agents 5 --duration 300 --mode processes --card fleet.json,
    and beside it airflock watch fleet.json
    """
    live, beside = o.mode not in (fleets.flying.LOCKSTEP_MODE, INVALID), o.beside is not None
    errors.read(options.check_writable, (o.save, RECORDINGS), (o.card, (".json",)))
    settings = options.collect_settings(errors, o)
    vehicle, body = value_or_default(o.vehicle, ""), value_or_default(o.body, None)
    settings = errors.read(fleets.flying.vehicle_body, o.scenario, settings, vehicle, body)
    loaded = options.collect_scenario(errors, o.scenario, settings, trust=o.trust)
    loaded = errors.read(
        lambda found: fleets.compare.with_metric_period(found, found.sensors.period or found.flight.dt), loaded
    )
    numbers = errors.read(options.seeds_from, o.first_seed, o.seeds)
    members = errors.read(lambda found: tuple(range(1, found.agents + 1)), loaded)
    broken = errors.read(_broken, o.faults, value_or_default(members, ALL_SYSTEM_IDS), live)
    if o.card is not None and o.mode == fleets.flying.LOCKSTEP_MODE:
        errors.add(f"--card {o.card}: in lock-step it flies too fast to watch; add --mode tasks or processes")
    if o.beside not in (None, "simulator"):
        errors.add(f"--against {o.beside}: only simulator is known")
    errors.read(_check_one_card, o.card, loaded, numbers)
    errors.raise_errors()
    terminal.print_notes(loaded.notes)
    how: dict[str, Any] = {name: getattr(o, name) for name in ("vehicle", "mode", "join")}
    how |= {"from_ground": o.ground, "card_file": o.card}
    how["stop_for_lost"] = True if o.silence is None and not beside else o.silence
    series = fleets.flying.FleetRuns(loaded, o.vehicle)
    ticks = o.seeds * int(loaded.flight.duration + (fleets.SECONDS_BEFORE_START if o.ground else 0.0))
    with counting_parts(f"{loaded.name}: fleet", ticks, quiet=o.json) as done, _frozen_imports():
        how |= {"on_done": done, "notify": terminal.print_message}
        for flown in fleets.flying.fly_seeds(loaded, numbers, faults=broken, **how):
            series.add(flown, with_simulator=beside, starts_alike=not o.ground and not live)
            if o.save is not None:
                _save(options.file_of_seed(o.save, flown.seed, numbers), flown)
    _print_runs(series, o.json)


def _broken(file: Path | None, members: tuple[int, ...], live: bool) -> Sequence[Any]:
    """Return the faults of a file, if there is one, that such a fleet can simulate."""
    found = () if file is None else fleets.read_injected_faults(file, members)
    options.raise_errors(fleets.realtime.lockstep_only_errors(found) if live else [])
    return found


def _check_one_card(file: Path | None, scenario: Any, seeds: Sequence[int]) -> None:
    """Refuse one card for several seeds where each seed has drones of its own."""
    if file is not None and scenario.varied and len(seeds) > 1:
        options.raise_errors([f"--card {file}: with tolerances each seed has its own card; add --seeds 1"])


@contextmanager
def _frozen_imports() -> Iterator[None]:
    """Keep the garbage collector off existing objects: one full collection takes a tenth of a second."""
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def _save(path: Path, flown: Any) -> None:

    terminal.print_message(f"saved {recordings.save(fleets.fleet_recording(flown), path)}")


def _print_runs(series: Any, as_json: bool) -> None:
    """Print the results of all flights."""
    from airflock.parts.metrics import reported_values

    scenario, lines, seeds = series.scenario, series.comparison, len(series.runs)
    if as_json:
        about = {"name": scenario.name, "agents": scenario.agents, "vehicle": series.vehicle, "seeds": seeds}
        content = {"fleet": about, "runs": series.runs, "comparison": [line._asdict() for line in lines]}
        terminal.print_json(content | ({"departure": series.divergence._asdict()} if series.divergence else {}))
        return
    flown = f"{scenario.flight.duration:g} s, {seeds} seed{'s' if seeds > 1 else ''}"
    title = f"{scenario.name}: fleet of {scenario.agents} {series.vehicle}, {flown}"
    terminal.print_score_table(title, series.measured, {}, reported_values(scenario.metrics.rule))
    for run in series.runs:
        _print_load(run.get("load"))
    for instant, member, note in series.runs[0]["notes"][:40]:
        terminal.print_message(f"{instant:8.2f} s  drone {member:3d}  {note}")
    if series.divergence:
        terminal.print_message(
            "largest distance to the simulated flight, m; and of the simulation itself after a nudge of 1 cm"
        )
        if scenario.has_sensor_error and scenario.sensors.rule.error is not None:
            terminal.print_message(
                "(a drone sends the position that it flies by; a simulated one has two errors: they part)"
            )
        for t, ours, theirs in zip(*series.divergence, strict=True):
            terminal.print_message(f"  after {t:g} s: {ours:.4f}   {theirs:.4f}")
    for line in lines:
        terminal.print_message(
            f"  {line.name:16s} simulator {line.simulator:10.4f}  fleet {line.fleet:10.4f}  z {line.z:+.2f}  "
            f"p (Holm) {line.p:.2f}"
        )
    if series.simulated and not lines:
        terminal.print_message("note: a table of differences needs two or more seeds: --seeds 2")


def _print_load(load: dict[str, Any] | None) -> None:
    """Print the load of a fleet on the real clock, and its lateness."""
    if load is None:
        return
    parts = ""
    if load["nodes"] is not None:
        parts = f" (nodes {load['nodes']:.2f}, vehicles and ether {load['vehicles']:.2f})"
    terminal.print_message(
        f"processor: {load['cores']:.2f} of a core{parts}; load of this computer {load['others']:.1f}"
    )
    share = load["late"] / max(load["ticks"], 1)
    terminal.print_message(
        f"ticks of the nodes: {load['ticks']}, {load['late']} ({share:.1%}) late by more than half a period, at most "
        f"by {load['worst']:.2f} s"
    )


DATAGRAM_BYTES = 95  # bytes of a signed status packet
OVERHEAD_BYTES = 64  # bytes of headers of the link; our choice, WiFi with UDP and IP has 64
PREAMBLE_SECONDS = 2e-4  # s of a packet before its first bit; WiFi's long preamble
DEFAULT_SITE = (0.0, 0.0, 0.0)
MAX_AIRTIME_SHARE = 0.6  # of the channel's time that a flock may take; our choice: random access breaks down beyond
FAST_BITS = 6e6  # bit/s: WiFi's multicast rate as it should be set
SLOW_BITS = 250e3  # bit/s: IEEE 802.15.4


@verb("", shared="scenario settings trust json", name="fly prepare")
def prepare(
    scenario: str,
    *,
    errors: ErrorCollector,
    site: str,
    members: str,
    settings: list[str] | None = None,
    trust: bool = False,
    autopilot: str = "px4",
    height: float | None = None,
    margin: float = 30.0,
    move_field: bool = False,
    hours: float = 12.0,
    limit: list[str] | None = None,
    fast_bits: float = FAST_BITS,
    slow_bits: float = SLOW_BITS,
    out: Path = Path("mission.json"),
    json: bool = False,
) -> None:
    """Write the flight card, the mission's key and the operator's key.

    Card and mission.key go to every drone; mission.operator stays with the operator.

    Example: airflock fly prepare vasarhelyi_2018/real_4ms --site 47.50,19.04,120 --members 1-10 --out mission.json

    Parameters
    ----------
    site : str (LAT,LON,ALT)
        Centre of the arena on the ground; ALT above sea level, m.
    members : str (1-10)
        System ids of the drones, such as 1-10 or 1,2,5.
    autopilot : str
        Autopilot of the drones: px4 or ardupilot.
    height : float, optional
        Height of the flock, m above the site; by default 20.
    margin : float in [0, inf]
        Distance of the fence outside the law's walls, m.
    move_field : bool
        Fly the outline of a map at --site, though the map lies elsewhere.
    hours : float in [0.1, 168]
        How long card and key stay valid, h.
    limit : sequence of str (KEY=VALUE)
        Change a limit, for instance brake=2.
    fast_bits : float in [100, inf]
        Bits per second of the fast radio.
    slow_bits : float in [100, inf]
        Bits per second of the slow radio.
    out : path (FILE.json)
        The card; keys are written beside it.
    """
    import secrets

    where, systems = errors.read(options.parse_position, "--site", site), errors.read(_members, members)
    errors.read(options.check_writable, (out, (".json",)))
    files = out, out.with_suffix(".key"), out.with_suffix(".operator")
    errors.add(*(f"{path}: exists; a mission is never overwritten" for path in files if path.exists()))
    loaded = options.collect_scenario(errors, scenario, errors.read(options.parse_settings, settings), trust=trust)
    safety = _limits(limit, loaded, errors)
    private, public = drones.new_operator_keys()

    def card_for(scenario: Any) -> dict[str, Any]:
        made = fleets.make_card_document(
            scenario,
            site=value_or_default(where, DEFAULT_SITE),
            members=value_or_default(systems, [1]),
            mission=1 + secrets.randbelow(2**32 - 1),
            expires=int(time.time() + 3600.0 * value_or_default(hours, 1.0)),
            operator=public,
            autopilot=autopilot,
            height=value_or_default(height, None),
            margin=value_or_default(margin, fleets.DEFAULT_FENCE_MARGIN),
            safety=safety,
        )
        drones.parse_card({**made, "hash": drones.card_hash(made)}, str(out))
        return made

    moved = errors.read(fleets.site_notes, loaded, where, move_field=move_field)
    document = errors.read(card_for, loaded)
    loads = errors.read(_airtimes, systems, document, fast_bits, slow_bits)
    errors.raise_errors()
    card = _write_mission(files, document, private)
    beside = fleets.deviation_notes(loaded, card.safety, len(card.members))
    terminal.print_notes([*loaded.notes, *fleets.omission_notes(loaded), *beside, *moved])
    if json:
        terminal.print_json({"card": str(out), "hash": card.hash, "members": list(card.members), "airtime": loads})
    else:
        _print_summary(files, card, loads)


def _airtimes(systems: list[int], card: dict[str, Any], fast: float, slow: float) -> dict[str, float]:
    """Return the share of each radio's time that the drones of a card take, from its bit/s and the card's limits.

    Raises CardError where it is too much.
    """
    shares, errors, count = {}, [], len(systems)
    for radio, limit, bits in (("fast", "status_period", fast), ("slow", "slow_period", slow)):
        packet = PREAMBLE_SECONDS + 8.0 * (DATAGRAM_BYTES + OVERHEAD_BYTES) / bits
        shares[radio] = share = count * packet / float(card["safety"][limit])
        if share > MAX_AIRTIME_SHARE:
            errors.append(
                f"{radio} radio: {count} drones would take {share:.0%} of its time; at most {MAX_AIRTIME_SHARE:.0%}: "
                f"lower the rate (--limit {limit}=...) or raise --{radio}-bits"
            )
    if errors:
        raise CardError(errors)
    return shares


def _limits(pairs: list[str] | None, scenario: Any, errors: ErrorCollector) -> dict[str, Any]:
    """Return the limits of the card that --limit changes; errors are noted, and their limits left out."""
    known = [name for name, _, _ in core.declarations(drones.SafetyLimits)]
    safety = value_or_default(errors.read(options.parse_settings, pairs, option="--limit"), {})
    wrong = [name for name in safety if name not in known]
    errors.add(*(f"--limit {name}: is not a limit; {suggest(name, known, ', '.join(known))}" for name in wrong))
    safety = {name: value for name, value in safety.items() if name in known}
    changed = errors.read(lambda flown: replace(fleets.default_safety(flown), **safety), scenario)
    return {} if changed is INVALID else safety


def _write_mission(files: Sequence[Path], document: dict[str, Any], private: bytes) -> Any:
    """Write card and keys, all of them or none; private: the operator's key. Return the written card."""
    import secrets

    try:
        card, key, operator = files
        written = drones.write_card(card, document)
        drones.write_key(key, secrets.token_bytes(32))
        drones.write_key(operator, private)
    # All files or none.
    except BaseException:  # a full disk, Ctrl-C: a card without its keys is of no use
        for path in files:
            path.unlink(missing_ok=True)
        raise
    return written


def _print_summary(files: Sequence[Path], card: Any, loads: dict[str, float]) -> None:
    """Print the written files, the height limits, and the settings that autopilots need."""
    terminal.print_message(f"wrote {files[0]} (hash {card.hash[:8]}), {files[1]}, {files[2]}")
    top = card.layer(card.members[-1])
    terminal.print_message(f"fence {card.low:g} to {card.high:g} m above the site; layers up to {top:g} m")
    for radio, share in loads.items():
        terminal.print_message(f"{radio} radio: {share:.0%} of its time, by an estimate from its bit rate")
    for guard in card.parameter_checks:
        why = guard.reason(card.safety.speed_max, card.safety.response + card.safety.delay)
        terminal.print_message(f"set {guard.instruction()}: {why}")
    for name, meaning in card.autopilot.battery_parameters.items():
        terminal.print_message(f"look at {name}: {meaning}")


def _members(text: str) -> list[int]:
    """Parse the system ids of a line."""
    members: list[int] = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        last = last if dash else first
        if not (first.isdigit() and last.isdigit() and 0 <= int(last) - int(first) <= 250):
            raise CardError([f"--members {text}: write 1-10 or 1,2,5"])
        members += range(int(first), int(last) + 1)
    return members


KILL_NOTE = "; the motors stop when kill --confirm follows within 5 s"


@verb("", name="fly order")
def order(
    card_file: Path,
    do: str,
    *,
    radio: str,
    target: int = 0,
    in_: float = 3.0,
    point: str | None = None,
    confirm: bool = False,
) -> None:
    """Send an order, signed with the operator's key beside the card. It is sent five times; each drone obeys it once.

    Example: airflock fly order mission.json start --radio 'udp:0.0.0.0:14601>192.168.1.255:14600'

    Parameters
    ----------
    card_file : path (CARD)
        The flight card.
    do : str (ORDER)
        start, go, goto, hold, resume, return, land, kill or ping.
    radio : str (PORT)
        udp:HOST:PORT>HOST:PORT or serial:/dev/NAME:BAUD.
    target : int in [0, 250]
        System id; 0 for all.
    in_ : float in [0, 60]
        Delay of a start, s.
    point : str (LAT,LON,ALT), optional
        Where to go, for goto; ALT above sea level, m.
    confirm : bool
        Second step of a kill, within 5 s of the first.
    """
    errors = ErrorCollector()
    what = drones.orders.OrderKind.__members__.get("CONFIRM_KILL" if confirm and do == "kill" else do.upper())
    if what is None or do == "confirm_kill":
        errors.add(f"{do}: is not an order; give start, go, goto, hold, resume, return, land, kill or ping")
    if (do == "goto") != (point is not None):
        errors.add("--point LAT,LON,ALT belongs to goto, and goto needs it")
    where = errors.read(options.parse_position, "--point", point) if point else (0.0, 0.0, 0.0)
    card = errors.read(drones.read_card, card_file)
    errors.read(_check_target, card, target)
    if point:
        errors.read(_check_inside_fence, card, where, point)
    key = errors.read(drones.read_key, card_file.with_suffix(".key"))
    private = errors.read(drones.read_key, card_file.with_suffix(".operator"))
    errors.read(drones.check_port, radio)
    errors.raise_errors()
    assert what is not None
    utc = time.time_ns() // 1000
    place = (round(where[0] * 1e7), round(where[1] * 1e7), round(where[2] * 1e3))
    command = drones.orders.OperatorOrder(what, target, card.mission, utc, utc + round(in_ * 1e6), place)
    _send(radio, drones.orders.order_message(command, private), drones.PacketSigner(key, drones.orders.OPERATOR_SYSTEM))
    effect = KILL_NOTE if what is drones.orders.OrderKind.KILL else ""
    terminal.print_message(f"sent {what.name} to {f'drone {target}' if target else 'all'}{effect}")


def _send(radio: str, message: Any, sign: Any) -> None:
    """Send an order five times; raises CardError where the port cannot."""
    port = drones.open_port(radio)
    try:
        for _ in range(5):
            if not port.write(sign(message, time.time_ns() // 1000)):
                raise CardError([f"{radio}: cannot send; does the port say where to send (>HOST:PORT)?"])
            time.sleep(0.1)
    finally:
        port.close()


def _check_target(card: Any, target: int) -> None:
    """Refuse a drone that is no member of the mission."""
    if target and target not in card.members:
        raise CardError([f"--target {target}: the card's members are {', '.join(map(str, card.members))}"])


def _check_inside_fence(card: Any, option: tuple[float, float, float], point: str) -> None:
    """Refuse a point outside the card's fence, which every drone would refuse by itself."""
    x, y, z = card.site.local(*option)
    if not card.low <= z <= card.high:
        line = (
            f"--point {point}: lies {z:.4g} m above the site; the fence reaches from {card.low:g} to {card.high:g} m "
            f"(ALT is above sea level, the site's is {option[2] - z:g} m)"
        )
        raise CardError([line])
    far = card.fence.outside(x, y)
    if far > 0.0:
        raise CardError([f"--point {point}: lies {far:.4g} m outside of the fence"])


class FlyGroup(GroupOfVerbs):
    """Subcommands of fly; any other word is a flight card, which is flown."""

    prefix = "fly"

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return a subcommand by its name; `run_node` for the name of a file."""
        if args and args[0] not in self.commands and (Path(args[0]).suffix or is_file(args[0])):
            args = ["card", *args]
        return super().resolve_command(ctx, args)


fly_app = typer.Typer(
    cls=FlyGroup, no_args_is_help=True, rich_markup_mode="rich",
    help="""Fly the same law on real drones: one card for all, a node beside each autopilot, orders from one operator.

    Example: airflock fly prepare vasarhelyi_2018/real_4ms --site 47.50,19.04,120 --members 1-10,
    then on each drone airflock fly mission.json --member 3 --autopilot udp:127.0.0.1:14540 --radio ...
    """,
)  # fmt: skip


@fly_app.command(
    "card", context_settings={"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}
)
def run_node(ctx: typer.Context) -> None:
    """Run a node, as python -m airflock.drones.onboard CARD ... does; `airflock fly card --help` lists its options."""
    raise typer.Exit(drones.main(ctx.args))


SPAN_GAP = 2.0  # s; ticks that differ are reported together unless so many agree between them


@verb("", shared="json", name="fly replay")
def replay(card_file: Path, log: Path, *, json: bool = False) -> None:
    """Fly the log of a node again: the same inputs must give the same outputs, to the bit.

    Example: airflock fly replay mission.json mission-3-20270115T101500Z.log

    Parameters
    ----------
    card_file : path (CARD)
        The flight card.
    log : path (LOG)
        Log of a node.
    """
    card, key = drones.read_card(card_file), drones.read_key(card_file.with_suffix(".key"))
    ticks, notes, version, phases = 0, [], drones.code_version(), ("", "")
    different: list[float] = []
    spans: list[tuple[float, float, int]] = []  # first and last time and number of ticks that differ
    for tick in drones.replay_log_file(log, card, key):
        ticks, version = ticks + 1, tick.version or "an earlier one"
        notes += [(tick.time, note) for note in tick.out.notes]
        before, phases = phases, (str(tick.entry.get("phase")), tick.phase.name)
        if phases != before and phases[0] != phases[1]:
            notes.append((tick.time, f"the log says {phases[0]}, this version {phases[1]}"))
        if not tick.same:
            different.append(tick.time)
            goes_on = bool(spans) and tick.time - spans[-1][1] <= SPAN_GAP
            begin, _, count = spans.pop() if goes_on else (tick.time, tick.time, 0)
            spans.append((begin, tick.time, count + 1))
    own = drones.code_version()
    other = "" if version == own else f"flown by another version ({version}; this is {own})"
    if json:
        terminal.print_json({"ticks": ticks, "different": different, "another_version": other or None, "notes": notes})
    else:
        for at, note in notes:
            terminal.print_message(f"{at:10.2f} s  {note}")
        for begin, end, count in spans:
            terminal.print_message(f"{begin:10.2f} to {end:.2f} s  {count} ticks with another output")
        terminal.print_message(f"{ticks} ticks, {len(different)} with another output than was logged")
        if other and not different:
            terminal.print_message(f"{log}: {other}; both decide alike here")
    if different:
        raise ScenarioError(
            [
                f"{log}: {len(different)} of {ticks} ticks differ when flown again, first at {different[0]:.2f} s"
                + (other and f"; {other}")
            ]
        )
