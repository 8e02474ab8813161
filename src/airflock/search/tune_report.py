"""The report of a tuning: one HTML file that prints on A4, and its figures as a PDF."""

import base64
import hashlib
import io
import math
import re
from collections.abc import Collection, Mapping, Sequence
from html import escape
from itertools import zip_longest
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from airflock import __version__
from airflock.certificates import COUNT_BATCH
from airflock.core import declarations, format_with_unit
from airflock.engine import driver_text
from airflock.estimate import KEY_UNITS
from airflock.runs import FlightStore, declared_numbers, with_parameters
from airflock.scenarios import Scenario, step_counts, summary
from airflock.search.limit_excess import limit_report_line
from airflock.search.study_result import candidate_table
from airflock.search.tuning_run import (
    CERTIFICATE_FILE,
    CERTIFICATE_FOLDER,
    HARDENING_FOLDER,
    STUDY_FOLDER,
    TUNED_FILE,
    TuneResult,
)
from airflock.support import CardError, atomic
from airflock.view import convergence, plot_certificate, print_settings

PAGE, FIGURES = "report.html", "figures.pdf"
STYLE = """
@page { size: A4; margin: 18mm }
body { font: 10pt/1.45 "Liberation Sans", Arial, sans-serif; color: #222; max-width: 174mm; margin: 0 auto }
h1 { font-size: 16pt; margin: 0 0 2mm } h2 { font-size: 12pt; margin: 7mm 0 2mm; break-after: avoid }
table { border-collapse: collapse; width: 100%; break-inside: avoid; font-size: 9pt }
th, td { text-align: left; padding: .6mm 2mm .6mm 0; border-bottom: .2mm solid #ccc; vertical-align: top }
td.n, th.n { text-align: right } img { max-width: 100%; break-inside: avoid }
.verdict { font-size: 12pt; font-weight: bold; padding: 2mm 3mm; border-left: 1.5mm solid #009E73 }
.no { border-color: #D55E00 } code { font-size: 8pt; overflow-wrap: anywhere } .sign td { height: 12mm; width: 50% }
"""


def save(found: TuneResult) -> None:
    """Write report.html, replays and figures.pdf into the folder of a tuning, each complete or not at all."""
    figures, shows = _figures(found), replay_files(found)
    pictures = [_png(figure) for figure in figures.values()]
    atomic.write_file(found.folder / PAGE, report_html(found, pictures, list(figures), shows))
    content = io.BytesIO()
    with print_settings(), PdfPages(content, metadata={"CreationDate": None}) as pdf:
        for figure in figures.values():
            pdf.savefig(figure, bbox_inches="tight")
    atomic.write_file(found.folder / FIGURES, content.getvalue())


def _figures(found: TuneResult) -> dict[str, Figure]:
    with FlightStore(found.folder / STUDY_FOLDER, write=False) as store:
        table = candidate_table(store, ["fitness"])
    return {
        "What the search found, generation by generation.": convergence(table, "fitness", what=found.start.name),
        "Bounds by number of flights, distances, and how far numbers may change.": plot_certificate(found.certificate),
    }


def _png(figure: Figure) -> str:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=150, bbox_inches="tight")
    # Inside of the page: a report is one file, which can be sent and signed.
    return base64.b64encode(stream.getvalue()).decode()


def report_html(
    result: TuneResult, pictures: Sequence[str], captions: Sequence[str], replay_files: Mapping[int, str]
) -> str:
    """The report as one HTML text; pictures are PNGs in base64, `shows` files beside it that play flights by seed."""
    start, certificate = result.start, result.certificate
    assumed = [*document_rows(start, result.result.parameters), *default_rows(start)]
    worst = [
        (entry["limit"], f"{entry['value']:.4g}", entry["replay"], replay_files.get(int(entry["seed"]), ""))
        for entry in certificate.worst
    ]
    limits, to_run = flight_card_limits(result)
    no = "" if result.shown else " no"
    body = [
        f"<h1>{escape(str(start.document.get('title') or start.name))}</h1>",
        f"<p>{escape(summary(start))}. Airflock {__version__}.</p>",
        f'<p class="verdict{no}">{"Not all" if no else "All"} limits are shown.</p>',
        _list(certificate.statements),
        "<h2>What was assumed</h2>",
        _table(("key", "value", "source"), assumed),
        _list([*result.notes, *start.notes]),
        *_identified(result.identify_report),
        "<h2>What was flown</h2>",
        _table(("for", "flights", "seeds"), flight_rows(result)),
        _list(circumstance_sentences(result)),
        *_searched(result),
        *_hardened(result),
        *_certified(result),
        "<h2>Worst flights</h2>",
        _table(("limit", "value", "fly it again", ""), worst),
        "<h2>The flight card to fly next</h2>",
        _table(("limit on board", "value", "meaning"), limits) if limits else "",
        f"<p><code>{escape(to_run)}</code></p>" if limits else f"<p>{escape(to_run)}</p>",
        *(
            f'<h2>Figure {i}</h2><img alt="{escape(text)}" src="data:image/png;base64,{picture}"><p>{escape(text)}</p>'
            for i, (picture, text) in enumerate(zip(pictures, captions, strict=True), 1)
        ),
        '<h2>Signed</h2><table class="sign"><tr><td>Name, date</td><td>Signature</td></tr></table>',
    ]
    title = escape(result.scenario.name)
    head = f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>'
    return f"{head}<style>{STYLE}</style><body>{''.join(body)}</body></html>\n"


def _searched(found: TuneResult) -> list[str]:
    """Return the section of the search: fitness, limits, and each number before and after."""
    r, before = found.result, declared_numbers(found.start)
    rows = [
        (
            key,
            format_with_unit(f"{before[key][1]:.4g}", how.unit),
            format_with_unit(f"{value:.4g}", how.unit),
            _range(r.ranges.get(key)),
        )
        for key, (how, value) in declared_numbers(found.scenario).items()
        if key in r.parameters and value is not None
    ]
    return [
        "<h2>What was found</h2>",
        f"<p>Fitness {r.fitness:.3f} (95 % interval {r.low:.3f} to {r.high:.3f}) on {r.seeds} fresh flights, from "
        f"{r.candidate_count:,} candidates.</p>",
        _list([limit_report_line(entry) for entry in r.limits]),
        _table(("number", "start", "tuned", "working range of the search"), rows),
    ]


def _hardened(found: TuneResult) -> list[str]:
    """Return the section of hardening: cost and gain of each step."""
    rows = [
        (s.name, f"{s.fitness:.3f}", _between(s.cost, ".3f"), f"{s.r_min:.2f}", _between(s.gain, ".2f"),
         _known(100.0 * s.contacts, ".1f"), _known(s.clearance, ".2f"), s.verdict)
        for s in found.steps
    ]  # fmt: skip
    heads = (
        "step", "fitness", "cost (95 %)", "smallest distance, m", "gain, m (95 %)", "flights with a contact, %",
        "room at walls, m", "verdict",
    )  # fmt: skip
    return [
        "<h2>What hardening cost and gained</h2>",
        _table(heads, rows) if rows else f"<p>Not hardened: {escape(found.why)}</p>",
    ]


def _between(interval: tuple[float, float, float], form: str) -> str:
    """A mean with its interval."""
    mean, low, high = (format(value, form) for value in interval)
    return f"{mean} ({low} to {high})"


def _known(value: float, form: str) -> str:
    """A number, or nothing where nobody looked."""
    return "" if math.isnan(value) else format(value, form)


def _certified(found: TuneResult) -> list[str]:
    """The certificate, and how far numbers may move."""
    made = found.certificate
    hazards = [
        f"{made.campaign.limits[i].event} over the time of a flight: {hazard.verdict}"
        for i, hazard in made.hazards.items()
        if hazard.events
    ]
    rows = [
        (a["key"], format_with_unit(f"{a['nominal']:.4g}", a["unit"]), format_with_unit(f"{a['safe']:.4g}", a["unit"]),
         f"{a['factor']:.3g}" if "factor" in a else "",
         format_with_unit(f"{a['not_shown']:.4g}", a["unit"]) if "not_shown" in a else "", f"{a['flights']:,}",
         a.get("note", ""))
        for a in made.tolerance.get("axis", ())
    ]  # fmt: skip
    return [
        "<h2>Certificate</h2>",
        made._repr_html_(),
        _list(hazards),
        "<h2>How far numbers may change</h2>",
        f"<p>One number at a time; safe is where fewer than {100.0 * made.tolerance['level']:g} % of flights are shown "
        f"to have an event, with {100.0 * made.tolerance['confidence']:g} % confidence at each value.</p>"
        if rows
        else "",
        _table(("number", "nominal", "safe to", "factor", "not shown at", "flights", ""), rows)
        if rows
        else f"<p>{escape(str(made.tolerance.get('reason', 'not asked for')))}</p>",
    ]


def _range(span: tuple[float, float] | None) -> str:
    return "" if span is None else f"{span[0]:.3g} to {span[1]:.3g}"


def _identified(fleet: Mapping[str, Any]) -> list[str]:
    """Return the section of numbers identified from logs; empty if the tuning did not begin with logs."""
    if not fleet:
        return []
    rows = []
    for number in fleet["numbers"]:
        key, unit = str(number["key"]), KEY_UNITS.get(str(number["key"]), "")
        if "reason" in number:
            rows.append((key, "", "", f"as in {fleet['name']}: {number['reason']}"))
        else:
            span = f"{number['low']:.3g} to {number['high']:.3g}"
            rows.append((key, format_with_unit(f"{number['value']:.4g}", unit), span, str(number["origin"])))
    files = ", ".join(f"{name} ({digest})" for name, digest in fleet["logs"].items())
    return [
        "<h2>What was identified</h2>",
        f"<p>From the logs of {fleet['drones']} drones: {escape(files)}.</p>",
        _table(("number", "value", "95 % interval", "from"), rows),
        _list([str(note) for note in fleet["notes"]]),
    ]


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    cells = ("".join(f"<td>{_cell(text)}</td>" for text in row) for row in rows)
    return f"<table><tr>{head}</tr>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>"


def _cell(text: str) -> str:
    if text.startswith("worst_"):
        return f'<a href="{escape(text)}">watch</a>'
    return f"<code>{escape(text)}</code>" if text.startswith("airflock ") else escape(text)


def _list(texts: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in texts)}</ul>" if texts else ""


ReportRow = tuple[str, str, str]  # key, value with its unit, source
LEFT_OUT = ("published", "title", "format")
READ_AS = {"body": "b", "sensors": "s", "radio": "k", "wind": "a"}  # section → what a driver calls its numbers
DRYDEN = ("at_6m", "height", "airspeed")  # a driver reads what follows from them
ALWAYS = ("sensors.period", "radio.delay", "body.delay")  # a driver reads them as numbers of steps


def document_rows(scenario: Scenario, searched: Collection[str]) -> list[ReportRow]:
    """Return key, value and source of all entries of the scenario's file except the searched numbers."""
    units = {
        f"{section}.{name}".lstrip("."): str(getattr(how, "unit", ""))
        for section, record in scenario.records.items()
        for name, how, _ in declarations(record)
    }
    rows = []
    for section, table in scenario.document.items():
        if section in LEFT_OUT:
            continue
        single = not isinstance(table, Mapping) or "value" in table
        for name, entry in (("", table),) if single else table.items():
            key = f"{section}.{name}".rstrip(".")
            if key not in searched:
                rows.append(_row(key, entry, units.get(key, "")))
    return rows


def _row(key: str, entry: Any, unit: str) -> ReportRow:
    """The row of a key; an entry may be a table with value, unit and source."""
    source = ""
    if isinstance(entry, Mapping):
        entry, unit, source = entry.get("value"), str(entry.get("unit", unit)), str(entry.get("source", ""))
    text = str(entry)
    text = text if len(text) < 80 else f"{text[:77]}..."
    return key, text if isinstance(entry, str) else format_with_unit(text, unit), source


def default_rows(scenario: Scenario) -> list[ReportRow]:
    """Return defaults of drones, sensors, radio and wind that the file does not set, are not zero, and are read."""
    read = _read(scenario)
    rows = []
    for key, (how, value) in declared_numbers(scenario).items():
        section, _, name = key.partition(".")
        given = scenario.document.get(section, {})
        if section in READ_AS and value and name not in given and key in read:
            rows.append(
                (key, format_with_unit(f"{value:.4g}", how.unit), f"default: {how.source}" if how.source else "default")
            )
    return rows


def _read(scenario: Scenario) -> set[str]:
    """Return the keys of drones, sensors, radio and wind that a flight of a scenario reads.

    Where groups have numbers of their own, drivers read these by agent: then all keys of the
    section count as read.
    """
    text = driver_text(scenario)
    own = {letter for letter, _ in scenario.varied}
    found = set(ALWAYS)
    for section, letter in READ_AS.items():
        names = {name for name, _, _ in declarations(scenario.records[section])}
        if letter not in own:
            names &= set(re.findall(rf"\b{letter}\.(\w+)", text))
        found |= {f"{section}.{name}" for name in names}
    if re.search(r"\bair\.", text):
        found |= {f"wind.{name}" for name in DRYDEN}
    return found


STAGES = {
    "search": "search", "race": "candidates that race for the final", "final": "final",
    "again": "best finalists once more", "score": "fitness of the winner", "harden": "hardening",
    COUNT_BATCH.stage: "certificate",
    "tolerance": "how far numbers may change",
}  # fmt: skip
# Flights of all values of a tolerance ("tolerance:KEY") count as one stage.
BY_STAGE = (
    "SELECT substr(stage || ':', 1, instr(stage || ':', ':') - 1) AS of, count(*), min(seed), max(seed) "
    "FROM flight GROUP BY of"
)


def flight_rows(result: TuneResult) -> list[tuple[str, str, str]]:
    """Return purpose, number of flights and their seeds, in the order of the stages."""
    folders = (STUDY_FOLDER, HARDENING_FOLDER, CERTIFICATE_FOLDER)
    return [row for name in folders if (result.folder / name).is_dir() for row in _stored(result.folder / name)]


def _stored(folder: Path) -> list[tuple[str, str, str]]:
    """Return the stored flights of a folder by stage, in the order of `STAGES`; unknown stages come last."""
    with FlightStore(folder, write=False) as store:
        known = {str(stage): numbers for stage, *numbers in store.rows(BY_STAGE)}
    order = [stage for stage in STAGES if stage in known] + [stage for stage in known if stage not in STAGES]
    found = [(STAGES.get(stage, stage), *known[stage]) for stage in order]
    return [(name, f"{count:,}", f"{low} to {high}") for name, count, low, high in found]


def circumstance_sentences(result: TuneResult) -> list[str]:
    """Sentences: how flights were flown and measured, by which program on which machine, and checksums of the files."""
    made, scenario = result.certificate, result.scenario
    times, dt = step_counts(made.campaign.flown), scenario.flight.dt
    near, look = times["collide_every"] * dt, times["sample_every"] * dt
    document = made.document()
    flown = document["flown"]
    also = ", ".join(f"{name} {value}" for name, value in made.versions.items() if name not in ("airflock", "cpu"))
    tuned = hashlib.sha256((result.folder / TUNED_FILE).read_bytes()).hexdigest()
    return [
        f"Flights of {scenario.flight.duration:g} s in motion steps of {dt:g} s. Distances between agents were looked "
        f"at every {near:g} s, walls, obstacles and all else every {look:g} s.",
        f"Airflock {flown['airflock']}, rules {flown['rules']}, {flown['precision']} bits, device {flown['device']}; "
        f"{made.versions.get('cpu', 'unknown processor')}; {also}.",
        f"Seeds of the certificate follow from the scenario alone (identity {made.campaign.hash[:16]}); no flight that "
        "chose a number is among them.",
        f"{TUNED_FILE}: SHA-256 {tuned}.",
        f"{CERTIFICATE_FILE}: checksum {document['seal']}; "
        f"airflock certify {result.folder / CERTIFICATE_FILE} --check flies one "
        "flight in a hundred again.",
    ]


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
    except CardError as error:
        return [], f"No flight card can be made of it: {str(error).splitlines()[0]}"
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
