"""Identify the numbers of a vehicle from its logs: `identify`, its result, and a plan of test flights."""

import datetime
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from scipy.stats import norm

from airflock.estimate.identification import (
    body_and_sensor,
    radio_links,
    vehicle_logs,
)
from airflock.estimate.identification.radio_links import CURVE_PARAMETERS, TABLE_KEYS, curve_parameters
from airflock.estimate.identification.vehicle_logs import FlightLogs, logs_from_recording, logs_from_tracks
from airflock.parts.bodies import motion
from airflock.parts.radios import ENTRIES
from airflock.parts.sensors import langevin
from airflock.recordings import ImportOptions, ImportReport, read_tracks, refuse_archive
from airflock.scenarios import Scenario, build_scenario, load_if_named
from airflock.support import (
    AirflockError,
    RecordingError,
    expand_path,
    format_cell,
    is_file,
    result_group,
    result_table,
)

# key → whether a larger number makes a flight harder
HARDER = {
    "body.tau": True, "body.delay": True, "body.a_max": False, "body.noise": True, "sensors.period": True,
    "sensors.noise": True, "sensors.damping": False, "sensors.scale": True, "radio.delay": True,
    "radio.near": False, "radio.far": False, "radio.received_near": False, "radio.received_far": False,
    "model.v_max": True,
}  # fmt: skip
KEY_UNITS = {
    "body.tau": "s", "body.delay": "s", "body.a_max": "m/s^2", "body.noise": "m^2/s^3", "sensors.period": "s",
    "sensors.noise": "m^2/s^2", "sensors.damping": "1/s", "sensors.scale": "m s^(1/2)", "radio.delay": "s",
    "radio.near": "m", "radio.far": "m", "radio.received_near": "1", "radio.received_far": "1", "model.v_max": "m/s",
}  # fmt: skip
HARDER |= dict.fromkeys(radio_links.TABLE_KEYS, False)
KEY_UNITS |= dict.fromkeys(radio_links.TABLE_KEYS, "1")
UNIDENTIFIABLE = {  # by a flight, and why
    "wind.east, wind.north": "steady wind and drag act as one push; kept from --like",
    "radio.range": "a flight shows no packet beyond the farthest pair; kept from --like",
}


@dataclass(frozen=True)
class IdentifiedParameter:
    """One number of a scenario: value and 95 % interval if the logs identify it, else the reason why not."""

    key: str
    value: float
    low: float
    high: float
    like: float | None
    origin: str
    reason: str = ""

    @property
    def told(self) -> bool:
        """Return True if the logs identify it."""
        return not self.reason and bool(np.isfinite(self.value))

    def pessimistic_end(self, level: float) -> float:
        """Return the end of the interval at which flying is harder, for a confidence level of both ends."""
        end = self.high if HARDER[self.key] else self.low
        # The interval is symmetric in the logarithm, so other levels scale the ratio by quantiles
        # of the normal distribution; beside a delay of zero the end itself.
        share = norm.ppf(0.5 + 0.5 * level) / norm.ppf(0.975)
        ratio = max(end, 1e-12) / self.value if self.value > 0.0 else 0.0
        value = float(self.value * ratio**share if self.value > 0.0 else end * share)
        return min(value, 1.0) if KEY_UNITS[self.key] == "1" else value


class IdentifiedParameters:
    """Identified numbers, each beside that of the scenario that is flown by the same law."""

    def __init__(self, like: Scenario):
        self.like, self.by_key = like, dict[str, IdentifiedParameter]()

    def add(self, key: str, value: float, interval: tuple[float, float], origin: str, reason: str = "") -> None:
        """Add a number with its interval and what it comes from; reason: why the logs cannot tell it, if so."""
        low, high = interval
        self.by_key[key] = IdentifiedParameter(
            key, float(value), float(low), float(high), self.reference_value(key), origin, reason
        )

    def reference_value(self, key: str) -> float | None:
        """Return the scenario's own number; None where it has none."""
        section, _, name = key.partition(".")
        value = getattr(self.like.records[section], name, None)
        return None if value is None else float(value)

    def refuse_out_of_range(self) -> None:
        """Give each number that the scenario would not take the reason why."""
        document = {key: value for key, value in self.like.document.items() if key != "published"}
        for key, number in self.by_key.items():
            if not number.told:
                continue
            try:
                build_scenario(document, self.like.name, {key: number.value})
            except AirflockError as error:
                reason = str(error).splitlines()[0].partition(": ")[2] or str(error)
                self.by_key[key] = replace(number, reason=reason)


# A share of 0 has no logarithm.
LEAST = 1e-6  # share of packets; what nothing was heard of
WIDE = 0.2  # half of an interval of a share of packets, beyond which it says too little


@dataclass
class IdentifyResult:
    """Result of `identify`: numbers by key, notes, and the fits for pictures."""

    like: Scenario
    numbers: dict[str, IdentifiedParameter]
    notes: list[str]
    logs: FlightLogs
    body: body_and_sensor.BodyFit
    sensors: body_and_sensor.SensorFit
    radio: radio_links.RadioFit | None
    has_one_clock: bool
    sources: list[str] = field(default_factory=list)

    @property
    def log_noise(self) -> float | None:
        """Return the standard deviation of the noise of logged velocities per axis, m/s; None without a fit."""
        noise = self.body.value["white"]
        return float(noise) if np.isfinite(noise) and "white" not in self.body.refused else None

    def settings(self, level: float | None = None) -> dict[str, float]:
        """Return keys and values that replace those of `like`: identified values, or their pessimistic ends."""
        return {
            key: number.value if level is None else number.pessimistic_end(level)
            for key, number in self.numbers.items()
            if number.told
        }

    def scenario(self, level: float | None = None) -> Scenario:
        """Return the scenario `like` with these numbers; without `published`, which describes other numbers."""
        document = {key: value for key, value in self.like.document.items() if key != "published"}
        return build_scenario(document, self.like.name, self.settings(level))

    def reasons(self) -> list[str]:
        """Return why numbers cannot be identified, a line for each reason."""
        keys: dict[str, list[str]] = {}
        for key, number in self.numbers.items():
            if not number.told:
                keys.setdefault(number.reason, []).append(key)
        return [f"{', '.join(own)}: {reason}" for reason, own in keys.items()]

    def __rich__(self) -> Any:
        """Return the identified numbers, and why the others are not, for a terminal."""
        rows = [
            (
                key,
                format_cell(number.value),
                f"{number.low:.3g} to {number.high:.3g}",
                "" if KEY_UNITS[key] == "1" else KEY_UNITS[key],
                "" if number.like is None else format_cell(number.like),
                number.origin,
            )
            for key, number in self.numbers.items()
            if number.told
        ]
        title = f"{self.logs.drones} drones, like {self.like.name}"
        noise = f"noise of logged velocities {self.log_noise:.3g} m/s per axis" if self.log_noise is not None else None
        none = f"{self.logs.drones} drones: no number can be identified from these logs; all are kept from --like:"
        return result_group(
            result_table(title, "|number; |>value; |>95 %; |>unit; |>like; from", rows) if rows else None,
            noise if rows else None,
            "not identified, kept from --like:" if rows else none,
            *(f"  {line}" for line in self.reasons()),
            *(f"  {key}: {reason}" for key, reason in UNIDENTIFIABLE.items()),
        )

    def document(self, conservative: float | None = None, *, uncertain: bool = False) -> dict[str, Any]:
        """Return a scenario file's content: each number with unit and source, on request with its interval.

        Parameters
        ----------
        conservative : float, optional
            Write the pessimistic end of each interval of this level, such as 0.95, instead of the number.
        uncertain : bool
            Also write the intervals into the scenario.
        """
        document = _copied(self.like.document)
        document.pop("published", None)
        document["title"] = f"{self.like.name} with the numbers of {len(self.sources) or self.logs.drones} logs"
        today = datetime.date.today().isoformat()
        for key, value in self.settings(conservative).items():
            section, _, name = key.partition(".")
            number = self.numbers[key]
            half = 0.5 * (number.high - number.low)
            how = f"identify, {today}: {number.origin}, ± {half:.2g}"
            entry: dict[str, Any] = {"value": _short(value)}
            if KEY_UNITS[key] != "1":
                entry["unit"] = KEY_UNITS[key]
            entry["source"] = how + (f"; pessimistic end at {conservative:g}" if conservative is not None else "")
            if uncertain:
                entry["interval"] = [_short(max(number.low, 0.0)), _short(number.high)]
            document.setdefault(section, {})[name] = entry
        return document


def identify(
    flight_logs: Any,
    like: Scenario | str,
    *,
    heard: pd.DataFrame | None = None,
    standing: tuple[float, float] | None = None,
    same_clock: bool = False,
    options: ImportOptions | None = None,
    accept: Iterable[str] = (),
    begin: float | None = None,
    end: float | None = None,
) -> IdentifyResult:
    """Identify numbers of a scenario from flight logs, with 95 % intervals, and reasons where logs do not suffice.

    Parameters
    ----------
    flight_logs : path, list of paths, xarray.Dataset or FlightLogs (FILE...)
        Files (as in `load_tracks`), a recording, or logs.
    like : Scenario or str (PRESET|FILE)
        Scenario or preset that is flown by the same law; what is not identified stays as it is there.
    heard : pandas.DataFrame (FILE.csv), optional
        Packets: receiver, sender, t (receiver's clock, s), stamp (sender's clock, s), and for reception distance (m)
        and got (0 or 1; one row per decision and pair), or seq, the number that the sender gave each packet: then
        gaps of seq are losses, and distances come from the positions of the logs.
    standing : tuple of float (BEGIN:END), optional
        First and last time on the ground, s after each log begins, unless the logs tell it.
    same_clock : bool
        The clocks of all files agree.
    options : ImportOptions, optional
        How files are read (`airflock.recordings.imports.track.ImportOptions`), as in `load_tracks`.
    accept : iterable of str (KIND)
        Kinds of errors that are intended, as in `load_tracks`.
    begin : float, optional
        First instant of the files that is used, s.
    end : float, optional
        Last instant of the files that is used, s.

    Returns
    -------
    IdentifyResult
        `numbers`: key → value, interval, origin, or the reason why the logs cannot tell; `scenario()` has them in it.

    Raises
    ------
    AirflockError
        If body or sensor are not the multirotor and the langevin that this knows, or the logs lack what it needs.

    Examples
    --------
    >>> import airflock
    >>> scenario = airflock.load("vasarhelyi_2018/real_6ms", {"agents": 3, "duration": 30.0})
    >>> found = airflock.identify(airflock.simulate(scenario, seed=1), scenario)
    >>> tau = found.numbers["body.tau"]
    >>> tau.low < 1.0 < tau.high
    True
    >>> found.numbers["radio.delay"].told
    False
    """
    scenario = load_if_named(like)
    if not isinstance(scenario.body.numbers, motion.Parameters):
        raise AirflockError(f"{scenario.name}: its body is not the multirotor that identify knows")
    if not isinstance(scenario.sensors.numbers, langevin.Parameters):
        raise AirflockError(
            f"{scenario.name}: its sensor is {scenario.sensors.rule.name}; identify knows langevin alone"
        )
    findings = ImportReport(frozenset([accept] if isinstance(accept, str) else accept))
    logs, comparable, sources = _logs(
        flight_logs, options or ImportOptions(), findings, standing, same_clock, (begin, end)
    )
    if heard is not None:
        heard = radio_links.check_packets(heard)
        logs, aligned = _on_one_clock(logs, heard)
        comparable = comparable or aligned
        findings.notes += ["clocks of the drones aligned by the ages of their packets"] * aligned
    notes = list(findings.notes)
    numbers = IdentifiedParameters(scenario)
    # The sensor first: its noise is part of what the body seems to do.
    still = body_and_sensor.fit_sensors(logs, scenario.sensors.period)
    for name in ("noise", "damping", "scale"):
        origin = f"{still.seconds:.0f} s of standing"
        numbers.add(f"sensors.{name}", still.value[name], still.intervals[name], origin, still.refused.get(name, ""))
    sensor_numbers = {
        n: still.value[n] if n not in still.refused else getattr(scenario.sensors.numbers, n)
        for n in ("noise", "damping")
    }
    moving = body_and_sensor.fit_body(logs, scenario.flight.dt, sensor_numbers["noise"] * sensor_numbers["damping"])
    rows = f"{moving.rows} rows, {moving.saturated_rows} limited"
    for name in ("delay", "tau", "a_max", "noise"):
        numbers.add(f"body.{name}", moving.value[name], moving.intervals[name], rows, moving.refused.get(name, ""))
    notes += moving.notes
    period, interval, reason = vehicle_logs.decision_period(logs)
    numbers.add("sensors.period", period, interval, "changes of commands", reason)
    sent = heard
    if heard is not None and "seq" in heard and "got" not in heard:
        sent, words = radio_links.lost_by_sequence(heard, logs, comparable)
        notes += words
    links = _radio(heard, sent, numbers)
    if heard is not None and (apart := radio_links.clocks_apart(radio_links.fit_delay(heard))):
        notes.append(
            f"clocks of the drones differ by up to {apart:.3g} s: radio.delay is the mean of both directions of each "
            "pair, and a difference between the directions would look like one of the clocks"
        )
    if links is not None and links.notes:
        notes += [
            f"{note}; {numbers.reference_value('radio.range'):g} m in --like, which is kept" for note in links.notes
        ]
    v_flock = numbers.reference_value("model.v_flock")
    most, reason = vehicle_logs.largest_command(logs, v_flock, scenario.dimensions)
    if hasattr(scenario.parameters, "v_max"):
        numbers.add("model.v_max", most, (0.995 * most, most), "largest command", reason)
    numbers.refuse_out_of_range()
    return IdentifyResult(scenario, numbers.by_key, notes, logs, moving, still, links, comparable, sources)


def _logs(
    what: Any,
    options: ImportOptions,
    findings: ImportReport,
    standing: tuple[float, float] | None,
    same_clock: bool,
    window: tuple[float | None, float | None],
) -> tuple[FlightLogs, bool, list[str]]:
    if isinstance(what, FlightLogs):
        return what, same_clock, []
    if isinstance(what, xr.Dataset):
        return logs_from_recording(what), bool(what.attrs.get("airflock_comparable", 1)), []
    tracks, _ = read_tracks(what, options, findings, same_clock=True, begin=window[0], end=window[1])
    sources = sorted({track.source for track in tracks})
    comparable = same_clock or len(sources) == 1 or all(track.clock == "utc" for track in tracks)
    return logs_from_tracks(tracks, standing), comparable, sources


def _on_one_clock(logs: FlightLogs, heard: pd.DataFrame) -> tuple[FlightLogs, bool]:
    """Put logs on one clock, by packets in both directions, if these name the drones as the logs do."""
    ahead = radio_links.fit_delay(heard).ahead
    if not set(logs.names) <= set(ahead):
        return logs, False
    own = np.array([ahead[name] for name in logs.names])
    return replace(logs, time=logs.time - own[logs.who]), True


def _radio(
    heard: pd.DataFrame | None, sent: pd.DataFrame | None, numbers: IdentifiedParameters
) -> radio_links.RadioFit | None:
    """Add the numbers of the radio, or why there are none; return its fit, for pictures.

    heard, sent : packets that came with their stamps; and one row for each that may have come
    """
    nan, scenario = float("nan"), numbers.like
    if heard is None or sent is None:
        reason = "no table of packets (--heard): neither PX4 nor ArduPilot logs them, the companion computer must"
        for name in ("delay", *CURVE_PARAMETERS):
            numbers.add(f"radio.{name}", nan, (nan, nan), "", reason)
        return None
    late = radio_links.fit_delay(heard)
    origin = f"stamps, ± {1e3 * late.scatter:.0f} ms each"
    numbers.add("radio.delay", late.value, late.interval, origin, late.reason)
    links = radio_links.fit_links(sent, scenario.sensors.period, radio_links.curve_parameters(scenario.radio.numbers))
    if scenario.radio.rule.name == "table":
        _table(sent, numbers)
        return links
    lossy = scenario.radio.rule.name == "links"
    # One curve has four numbers: three of them with a default for the fourth were off by 0.07 to 0.17.
    lacking = ", ".join(f"radio.{name}" for name in links.refused)
    for name in CURVE_PARAMETERS:
        why = links.refused.get(name, "")
        if not why and not lossy:
            why = "radio.kind of --like has no such curve: --set radio.kind=links"
        elif not why and lacking:
            why = f"belongs to one curve with {lacking}, which the packets do not tell"
        numbers.add(f"radio.{name}", links.value[name], links.intervals[name], f"{len(sent)} packets", why)
    return links


def _table(heard: pd.DataFrame, numbers: IdentifiedParameters) -> None:
    """Add the entries of a radio of kind "table", at the spacing that the scenario has."""
    k: Any = numbers.like.radio.numbers
    shares, errors = radio_links.fit_table(heard, k.spacing)
    half = norm.ppf(0.975) * errors
    for n, (share, off) in enumerate(zip(shares.tolist(), half.tolist(), strict=True)):
        near = f"no pair flew within {k.spacing:g} m of {n * k.spacing:g} m apart; kept from --like"
        wide = f"only known to ± {off:.2f}: more packets at {n * k.spacing:g} m" if off > WIDE else ""
        ends = (max(share - off, 0.0), min(share + off, 1.0))
        share = max(share, LEAST)
        numbers.add(f"radio.received_{n}", share, ends, f"{len(heard)} packets", near if np.isnan(off) else wide)


def _copied(document: Mapping[str, Any]) -> dict[str, Any]:
    return {k: _copied(v) if isinstance(v, Mapping) else v for k, v in document.items()}


def _short(value: float) -> float:
    return float(f"{value:.4g}")


def read_heard(path: Any) -> pd.DataFrame:
    """Read a table of packets (CSV); raises RecordingError for what is none."""
    place = expand_path(path)
    if not is_file(place):
        raise RecordingError(f"{path}: no such file")
    refuse_archive(place)
    try:
        table = pd.read_csv(place, skipinitialspace=True)
    except (OSError, ValueError, pd.errors.ParserError) as error:
        raise RecordingError(f"{path}: is not a table of packets: {str(error).splitlines()[0]}") from error
    if len(table.columns) == 1 and ";" in str(table.columns[0]):
        raise RecordingError(f"{path}: has ; between its columns; write it with commas, and points in its numbers")
    return radio_links.check_packets(table, str(path))


class Flight(NamedTuple):
    """One part of the flight card: the flight, its duration (s), and the keys that it identifies."""

    title: str
    seconds: float
    instructions: str
    keys: tuple[str, ...]


def flight_card(like: Scenario) -> list[Flight]:
    """List the test flights that make every number identifiable, sized by a scenario that is thought to be near."""
    tau, a_max = like.body.tau, like.body.a_max
    step = 3.0 * tau * a_max  # a step of this size is at the limit for two thirds of its way
    hold = max(4.0 * tau + step / a_max, 2.0)
    repeats = max(8, round(180.0 / (2.0 * hold)))
    cruise = min(step, 10.0)
    tabled = like.radio.rule.name == "table"
    far = 0.5 * (ENTRIES - 1) * like.radio.spacing if tabled else curve_parameters(like.radio.numbers).far  # type: ignore[attr-defined]
    curve = TABLE_KEYS if tabled else tuple(f"radio.{name}" for name in CURVE_PARAMETERS)
    return [
        Flight(
            "stand", 120.0,
            "all drones switched on, side by side on the ground, clear sky, logging at the rate of flight",
            ("sensors.noise", "sensors.damping", "sensors.scale"),
        ),
        Flight(
            "steps", 2.0 * hold * repeats,
            f"one drone at a time, or all at 50 m: command {step / 2:.1f} m/s east, then {step / 2:.1f} m/s west, "
            f"{hold:.1f} s each, {repeats} times; then north and south. Velocity set-points only, no feed-forward; "
            f"log commands and raw estimates at {max(10.0, 10.0 / tau):.0f} Hz or more",
            ("body.delay", "body.tau", "body.a_max", "body.noise"),
        ),
        Flight(
            "pairs", max(60.0, 2.0 * 2.0 * far / cruise),
            f"two drones from 5 m to {2.0 * far:.0f} m apart and back at {cruise:.0f} m/s; both log "
            "receiver, sender, own time and stamp of every packet",
            ("radio.delay", *curve),
        ),
        Flight(
            "flock", 180.0, "the flock flies its law; decisions logged as they are made",
            ("sensors.period", "model.v_max"),
        ),
    ]  # fmt: skip
