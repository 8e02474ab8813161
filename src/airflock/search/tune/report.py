"""The report of a tuning: one HTML file that prints on A4, and its figures as a PDF."""

import base64
import io
import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from airflock import __version__
from airflock.core import format_with_unit
from airflock.estimate import KEY_UNITS
from airflock.runs import FlightStore, declared_numbers
from airflock.scenarios import summary
from airflock.search import tables
from airflock.search.safe import limit_report_line
from airflock.search.tune.assumed import default_rows, document_rows
from airflock.search.tune.flown import circumstance_sentences, flight_rows
from airflock.search.tune.next_flight import flight_card_limits, replay_files
from airflock.search.tune.result import STUDY_FOLDER, TuneResult
from airflock.support import atomic
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
        table = tables.candidate_table(store, ["fitness"])
    return {
        "What the search found, generation by generation.": convergence(table, "fitness", what=found.start.name),
        "Bounds by number of flights, distances, and how far numbers may change.": plot_certificate(found.certificate),
    }


def _png(figure: Figure) -> str:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=150, bbox_inches="tight")
    return base64.b64encode(stream.getvalue()).decode()


def report_html(
    result: TuneResult, pictures: Sequence[str], captions: Sequence[str], replay_files: Mapping[int, str]
) -> str:
    """The report as one HTML text; pictures are PNGs in base64, `shows` files beside it that play flights by seed."""
    body = [
        *_summary(result),
        *_assumed(result),
        *_identified(result.identify_report),
        *_flown(result),
        *_searched(result),
        *_hardened(result),
        *_certified(result),
        *_worst_flights(result, replay_files),
        *_next_card(result),
        *(
            f'<h2>Figure {i}</h2><img alt="{escape(text)}" src="data:image/png;base64,{picture}"><p>{escape(text)}</p>'
            for i, (picture, text) in enumerate(zip(pictures, captions, strict=True), 1)
        ),
        '<h2>Signed</h2><table class="sign"><tr><td>Name, date</td><td>Signature</td></tr></table>',
    ]
    title = escape(result.scenario.name)
    head = f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>'
    return f"{head}<style>{STYLE}</style><body>{''.join(body)}</body></html>\n"


def _summary(found: TuneResult) -> list[str]:
    """What was tuned, and whether all limits are shown."""
    shown, start = found.certificate.shown, found.start
    return [
        f"<h1>{escape(str(start.document.get('title') or start.name))}</h1>",
        f"<p>{escape(summary(start))}. Airflock {__version__}.</p>",
        f'<p class="verdict{"" if shown else " no"}">{"All" if shown else "Not all"} limits are shown.</p>',
        _list(found.certificate.statements),
    ]


def _assumed(found: TuneResult) -> list[str]:
    """What the tuning took for granted."""
    return [
        "<h2>What was assumed</h2>",
        _table(
            ("key", "value", "source"),
            [*document_rows(found.start, found.result.parameters), *default_rows(found.start)],
        ),
        _list([*found.notes, *found.start.notes]),
    ]


def _flown(found: TuneResult) -> list[str]:
    """How many flights each stage flew on which seeds, and how."""
    return [
        "<h2>What was flown</h2>",
        _table(("for", "flights", "seeds"), flight_rows(found)),
        _list(circumstance_sentences(found)),
    ]


def _searched(found: TuneResult) -> list[str]:
    """What the search found: fitness, limits, and each number before and after."""
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
    """What each step of hardening cost and gained."""
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


def _between(told: tuple[float, float, float], form: str) -> str:
    """A mean with its interval."""
    mean, low, high = (format(value, form) for value in told)
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


def _worst_flights(found: TuneResult, shows: Mapping[int, str]) -> list[str]:
    """The worst flights of each limit, with how to fly and to watch them."""
    rows = [
        (entry["limit"], f"{entry['value']:.4g}", entry["replay"], shows.get(int(entry["seed"]), ""))
        for entry in found.certificate.worst
    ]
    return ["<h2>Worst flights</h2>", _table(("limit", "value", "fly it again", ""), rows)]


def _next_card(found: TuneResult) -> list[str]:
    """The flight card of the first real flight."""
    limits, to_run = flight_card_limits(found)
    head = "<h2>The flight card to fly next</h2>"
    if not limits:
        return [head, f"<p>{escape(to_run)}</p>"]
    return [head, _table(("limit on board", "value", "meaning"), limits), f"<p><code>{escape(to_run)}</code></p>"]


def _range(span: tuple[float, float] | None) -> str:
    return "" if span is None else f"{span[0]:.3g} to {span[1]:.3g}"


def _identified(told: Mapping[str, Any]) -> list[str]:
    """What logs told of the drones; nothing where it did not begin with logs."""
    if not told:
        return []
    rows = []
    for number in told["numbers"]:
        key, unit = str(number["key"]), KEY_UNITS.get(str(number["key"]), "")
        if "reason" in number:
            rows.append((key, "", "", f"as in {told['name']}: {number['reason']}"))
        else:
            span = f"{number['low']:.3g} to {number['high']:.3g}"
            rows.append((key, format_with_unit(f"{number['value']:.4g}", unit), span, str(number["origin"])))
    files = ", ".join(f"{name} ({digest})" for name, digest in told["logs"].items())
    return [
        "<h2>What was identified</h2>",
        f"<p>From the logs of {told['drones']} drones: {escape(files)}.</p>",
        _table(("number", "value", "95 % interval", "from"), rows),
        _list([str(note) for note in told["notes"]]),
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
