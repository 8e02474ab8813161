"""Verbs presets, validate, doctor, keys and types: list scenarios and their keys, check files and this machine."""

import tomllib
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import typer

from airflock import check, engine, recordings, scenarios, search, support
from airflock.cli import options, terminal
from airflock.cli.command import verb
from airflock.support import AirflockError, as_error, collect_errors, printable, read_text

if TYPE_CHECKING:
    from airflock.scenarios import Key


PANEL = "Look something up"


@verb(PANEL, shared="json")
def presets(name: str | None = None, *, for_speed: float | None = None, json: bool = False) -> None:
    """List the presets, show one as TOML, or derive a starting set for a speed (--for-speed 12 > mine.toml).

    Example: airflock presets vasarhelyi_2018/4ms

    Parameters
    ----------
    name : str (PRESET), optional
        Show one preset in full.
    for_speed : float in [0.1, 100], optional
        Print a starting set for this speed, m/s.
    """
    known = scenarios.presets()
    if for_speed is not None:
        return _show(scenarios.starting_set(for_speed), json)
    if name is not None:
        scenarios.load(name)  # nothing but a scenario is printed: a name may be a link to any file
        with as_error(name):
            text = read_text(known.get(name) or name)
        return _show(text, json)
    titles = {key: str(scenarios.load(key).document.get("title", "")) for key in known}
    if json:
        return terminal.print_json(titles)
    width = max(len(key) for key in titles)
    for key, title in titles.items():
        typer.echo(f"{key:<{width}}  {title}")
    return None


def _show(text: str, as_json: bool) -> None:
    """Print a scenario as it is written, or as one JSON object."""
    if as_json:
        terminal.print_json(tomllib.loads(text))
    else:
        typer.echo("".join(c if c in "\n\t" else printable(c) for c in text), nl=False)


@verb(PANEL, "airflock.validate", "settings law trust json")
def validate(o: SimpleNamespace) -> None:
    """Check scenario and study files (every error at once), or fly a recording again and compare the bits.

    With --json, each file has a verdict (null if it is wrong), its faults and its notes. Exit status 2 if any is wrong.

    Example: airflock validate mine.toml
    """
    changed = options.parse_settings(o.settings)
    checked = []
    for name in map(str, o.name):
        entry = _checked(name, changed, o.law, o.trust)
        checked.append(entry)
        if not o.json and entry["verdict"] is not None:
            for note in entry["notes"]:
                terminal.print_message(f"note: {name}: {note}")
            typer.echo(f"{name}: {entry['verdict']}")
    errors = [error for entry in checked for error in entry["faults"]]
    if not o.json:
        return options.raise_errors(errors)
    terminal.print_json({"files": checked})
    if errors:
        raise typer.Exit(2)
    return None


def _checked(name: str, changed: dict[str, Any], law: str | None, trust: bool) -> dict[str, Any]:
    """Return verdict, notes and errors of one file; each error begins with its name."""
    errors: list[str] = []
    valid: search.ValidationReport | None = None
    with collect_errors(errors):
        valid = search.validate(name, changed, law, trust=trust)
    return {
        "file": name,
        "verdict": valid.verdict if valid else None,
        "notes": list(valid.notes) if valid else [],
        "faults": [error if name in error else f"{name}: {error}" for error in errors],
    }


@verb(PANEL, "airflock.doctor", "json")
def doctor(o: SimpleNamespace) -> None:
    """Show versions, cores, extras, GPUs and cache, and fly a ten-second self-check on each device.

    Example: airflock doctor
    """
    if o.clear:
        count, size = support.clear_cache()
        if o.json:
            terminal.print_json(
                {"cache": str(support.default_cache_folder()), "removed": count, "freed_mb": round(size / 1e6, 1)}
            )
        else:
            typer.echo(f"{support.default_cache_folder()}: {count} drivers removed, {size / 1e6:.1f} MB")
        return

    found = recordings.doctor()
    if o.json:
        terminal.print_json(found)
    else:
        for key, text in found.items():
            typer.echo(f"{key:<16} {text}")
    failed = [text for key, text in found.items() if key.endswith("self_check") and text != "passed"]
    if failed:
        raise AirflockError(f"self-check {'; '.join(failed)}")


@verb(PANEL, "airflock.keys", "json")
def keys(o: SimpleNamespace) -> None:
    """List the sections of a scenario file, or every key of one: meaning, unit, range, default and source.

    Example: airflock keys radio
    """
    if o.schema:
        if o.section is not None:
            raise AirflockError(f"--schema is of a whole file; leave {o.section} out")
        return terminal.print_json(scenarios.keys.json_schema())
    listed_keys = scenarios.keys.keys(o.section)
    if o.json:
        terminal.print_json([{**key._asdict(), "options": list(key.options)} for key in listed_keys])
    elif o.section is not None:
        _print_keys(listed_keys)
    else:
        width = max(map(len, scenarios.keys.sections()))
        for name, listed in scenarios.keys.sections().items():
            count = len(listed.keys)
            typer.echo(f"{name:<{width}}  {count:>2} key{'s' if count != 1 else ' '}  {listed.about}")
    return None


def _print_keys(listed_keys: "list[Key]") -> None:
    from rich.console import Console
    from rich.padding import Padding
    from rich.text import Text

    console = Console()
    width = max(len(key.name) for key in listed_keys)
    for key in listed_keys:
        owner = f"   ({key.of})" if len({key.of for key in listed_keys}) > 1 and key.of else ""
        line = Text.assemble((f"{key.name:<{width}}", "bold"), f"   {key.standard}   [{key.allowed}]", (owner, "cyan"))
        source = f" ({key.source})" if key.source else ""
        console.print(line)
        console.print(Padding(Text.assemble(key.meaning, (source, "dim")), (0, 0, 0, 4)))


@verb(PANEL, "airflock.print_law", "settings trust json", name="print")
def print_part(o: SimpleNamespace) -> None:
    """Print a law, or another part of a scenario, as C for firmware, with a test that replays plain Python.

    Example: airflock print vasarhelyi_2018/4ms --out law
    """
    files = engine.print_law(
        o.law, to=o.to, part=o.part, settings=options.parse_settings(o.settings), precision=o.precision, out=o.out,
        trust=o.trust,
    )  # fmt: skip
    if o.json:
        terminal.print_json({"files": [str(file) for file in files]})
    else:
        terminal.print_message(f"saved {', '.join(str(file) for file in files)}")


@verb(PANEL, "airflock.check_types", "json")
def types(o: SimpleNamespace) -> None:
    """Removed: use mypy, and airflock.check_model in Python.

    Example: airflock types mine.py
    """
    check.check_types(o.files or (), out=o.out)
