"""Pages made from the code: models, order parameters, robots, rules, keys, commands, presets.

All are written to docs/generated when a build begins; a page is only touched when its text changes.
"""

import ast
import re
from collections.abc import Iterable, Mapping
from inspect import getsource
from typing import Any

import kinds
import pictures
from repository import repository
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from writing import LAWS, key_table, plain, prose, put, table

RULES = ("neighbour", "boundary", "flock", "decide")
PAPERS = {
    "vasarhelyi_2018": "vasarhelyi_2018", "viragh_2014": "vasarhelyi_2018", "reynolds_1987": "zapotecatl_2016",
    "vicsek_1995": "vicsek_1995", "couzin_2002": "couzin_2002", "kidger": "kidger", "dimock_2003": "dimock_2003",
    "formation": "kidger",
}  # fmt: skip


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages before sphinx looks for them."""
    app.connect("config-inited", lambda app, _: write_all(pictures.executed(app)), priority=1)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def write_all(drawn: bool = False) -> None:
    """Write every generated page, with pictures of the gallery if it is `drawn`."""
    models(drawn)
    order_parameters(drawn)
    robots()
    kinds.faults()
    kinds.topologies()
    kinds.formats()
    vocabulary()
    keys()
    commands()
    presets()
    repository()


def equations(name: str) -> dict[str, str]:
    """Equations of a model by the function that computes them."""
    parts = re.split(r"^## (\w+)\n", (LAWS / name / "equations.md").read_text(encoding="utf-8"), flags=re.M)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def models(drawn: bool) -> None:
    """A page for each model: docstring, picture, equations beside code, parameters, presets, what reproduces."""
    from airflock.scenarios.files import load, presets as known
    from airflock.scenarios.keys import keys as keys_of
    from airflock.scenarios.named_code import MODELS, find_law

    scenarios = {name: load(name) for name in known()}
    rows = []
    for name in MODELS:
        model = find_law(name)
        title, _, rest = model.doc.strip().partition("\n")
        source = (LAWS / name / "law.py").read_text(encoding="utf-8")
        functions = {
            node.name: ast.get_source_segment(source, node) or ""
            for node in ast.parse(source).body
            if isinstance(node, ast.FunctionDef)
        }
        written = equations(name)
        missing = sorted(set(written) - set(functions))
        if missing:
            raise ExtensionError(f"{name}/equations.md: no function {', '.join(missing)} in the model")
        pieces = [f"# `{name}`\n\n**{plain(title)}**\n\n{prose(rest)}\n"]
        pieces.append(f"\nIts command is {model.command}; the source is `src/airflock/parts/laws/{name}/law.py`.\n\n")
        example = pictures.of_model(name)
        pieces += [pictures.shown(example, 1, "A picture of it", there=drawn)] if example else []
        pieces.append("\n## Equations beside code\n")
        for rule, text in written.items():
            code = functions[rule]
            pieces.append(
                f"\n### {rule}\n\n:::::{{container}} beside\n::::{{container}} equation\n{text.strip()}\n::::\n"
                f"::::{{container}} code\n```python\n{code}\n```\n::::\n:::::\n"
            )
        pieces.append("\n## Parameters\n\n" + key_table(keys_of(name)))
        mine = {key: found for key, found in scenarios.items() if found.model.name == name}
        if mine:
            listed = ((f"`{key}`", plain(str(found.document.get("title", "")))) for key, found in mine.items())
            pieces.append("\n## Presets\n\n" + table(("preset", "what it is"), listed))
            first = next(iter(mine))
            pieces.append(f"\n```sh\nairflock run {first} --plot flight.png\n```\n")
        pieces.append(f"\n## What reproduces\n\n{_reproduced(name)}\n")
        put(f"models/{name}.md", "".join(pieces))
        rows.append((f"[`{name}`]({name}.md)", plain(title), model.command, len(mine)))
    index = "# Models\n\nOne publication, one file. Each page has the paper's equations beside the code that flies.\n\n"
    index += table(("model", "publication", "command", "presets"), rows)
    index += "\n```{toctree}\n:hidden:\n\n" + "\n".join(MODELS) + "\n```\n"
    put("models/index.md", index)


def _reproduced(name: str) -> str:
    if name not in PAPERS:
        return "The publication's text was not at hand: closed forms that follow from the law are tested exactly."
    paper = PAPERS[name]
    link = f"[{paper}](../papers/{paper}/index.md)"
    if name == "viragh_2014":
        return f"It is Algorithm A of {link}, and is compared there."
    if name == "formation":
        return f"It is ours. What its displays do is on the page of {link}."
    return f"Every number that was compared with the publication, hit or miss, is on the page of {link}."


def order_parameters(drawn: bool) -> None:
    """Definition, unit, range, reference and a picture of low and high of every order parameter."""
    from airflock.parts.metrics import metric_sets as registry

    homes: dict[str, Any] = {}
    absent: dict[str, str] = {}
    units: dict[str, tuple[str, str]] = {}
    sets: dict[str, list[str]] = {}
    formulas: dict[str, dict[str, tuple[str, ...]]] = {}
    known = dict(registry.SETS)
    reported = {name for found in known.values() for name in registry.reported_values(found)}
    for kind, metric in registry.METRICS.items():  # of no set: measured by metrics = ["NAME"]
        known |= {} if set(metric.reports) <= reported else {kind: registry.to_metric_set(metric)}
    for kind, found in known.items():
        for name, about in registry.formulas(found).items():
            formulas.setdefault(name, {}).setdefault(kind, about)
        for metric in found.metrics:
            homes |= {name: metric.sample for name in metric.reports if name not in homes}
            absent |= {name: metric.absence(name) for name in metric.reports}
        for name, about in registry.reported_values(found).items():
            units.setdefault(name, about)
            sets.setdefault(name, []).append(kind)
    for found in known.values():
        homes |= dict.fromkeys(found.reports, found.fitness)
    wrong = sorted(set(units) ^ set(formulas))
    if wrong:
        raise ExtensionError(f"REPORTS and FORMULAS of order parameters differ in {', '.join(wrong)}")
    import sys

    pairs = pictures.pairs()
    pieces = [
        "# Order parameters\n\nWhat a flight is scored with. The key `metrics.kind` picks a set; "
        "`airflock keys metrics` lists their parameters.\n\n",
        table(
            ("metrics.kind", "order parameters"),
            ((f"`{k}`", _names(registry.reported_values(found))) for k, found in known.items()),
        ),
        "\nHere $N$ is the number of agents, $r_{ij}$ a distance, $h_i$ a heading (unit vector), a bar a mean over the "
        "flock, and $\\langle\\cdot\\rangle_t$ a mean over the samples of a flight. "
        "$\\Theta$ is 1 above zero, else 0.\n\n"
        "Absent agents are not measured: each instant is that of the smaller flock, and "
        "one with fewer than two of several agents does not count. `present` is the share that was there. "
        "What is computed from other order parameters, such as a fitness, uses these values.\n",
    ]
    for name, (unit, meaning) in units.items():
        meant = plain(meaning)
        pieces.append(f"\n({name})=\n## {name}\n\n{meant[0].upper()}{meant[1:]}.\n\n")
        # Sets may judge by different formulas of one name, such as their fitness.
        several = len(set(formulas[name].values())) > 1
        for kind, (formula, *_) in formulas[name].items():
            pieces += [f"In the set `{kind}`:\n\n"] if several else []
            pieces += [f"$${formula}$$\n\n"] if several or kind == sets[name][0] else []
        home = homes.get(name)
        reference = ""
        if home is not None:
            module = sys.modules[home.__module__]
            reference = plain((module.__doc__ or "").strip().split("\n\n")[0].replace("\n", " "))
        abouts = list(dict.fromkeys(formulas[name].values()))
        ranges = " or ".join(dict.fromkeys(about[1] for about in abouts))
        rows = [("unit", unit or "none"), ("range", ranges), ("sets", ", ".join(f"`{k}`" for k in sets[name]))]
        rows += [("where some are absent", absent[name])] if name in absent else []
        rows += [("defined in", f"`{home.__module__}`: {reference}")] if home is not None else []
        pieces.append(table(("property", "value"), rows))
        pieces += [f"\n{text}\n" for _, _, *more in abouts for text in more]
        if name in pairs:
            pieces.append("\n" + pictures.shown(*pairs[name], f"{name}, low and high", there=drawn))
    put("order_parameters.md", "".join(pieces))


def _names(found: Iterable[str]) -> str:
    return ", ".join(f"[{name}](#{name})" for name in found)


def robots() -> None:
    """Bodies, sensors, radio, silence and wind: what stands between a command and a motion."""
    import sys

    from airflock.core import radio as radios, silence
    from airflock.parts import BODIES, RADIOS, SENSORS
    from airflock.parts.bodies import wind
    from airflock.scenarios.keys import keys as keys_of

    pieces = [
        "# Bodies, sensors, radio, silence, wind\n\nA model commands; a body obeys as far as it can. "
        "Neighbours hear of it through the radio, and an agent knows itself through its sensors. "
        "How to choose and write one: [sensors](../sensors.md), [radios](../radios.md).\n",
        _abilities(BODIES),
    ]
    for name, body in BODIES.items():
        module = sys.modules[body.move.__module__]
        pieces.append(f'\n## body.kind = "{name}"\n\n{prose(module.__doc__ or "")}\n\n')
        pieces.append(f"It takes a command of kind {body.accepts}.\n\n```python\n{getsource(body.move)}```\n\n")
        pieces.append(key_table(keys_of(name)))
    for name, sensor in SENSORS.items():
        rule = sensor.measure or sensor.error
        module = sys.modules[rule.__module__]
        pieces.append(f'\n## sensors.kind = "{name}"\n\n{prose(module.__doc__ or "")}\n\n')
        pieces.append(f"{prose(sensor.Parameters.__doc__ or '')}\n\n```python\n{getsource(rule)}```\n\n")
        pieces.append(key_table(keys_of(name)))
    for name, radio in RADIOS.items():
        kinds = [kind for kind in radios.RULES if getattr(radio, kind) is not None]
        module = sys.modules[getattr(radio, kinds[0]).__module__ if kinds else f"airflock.parts.radios.{name}"]
        pieces.append(f'\n## radio.kind = "{name}"\n\n{prose(module.__doc__ or "")}\n\n')
        pieces.append(f"{prose(radio.Parameters.__doc__ or '')}\n\n")
        for rule in (getattr(radio, kind) for kind in kinds):
            pieces.append(f"```python\n{getsource(rule)}```\n\n")
        pieces.append(key_table(keys_of(name if name != "constant" and name != "links" else "radio")))
    for name, module in (("silence", silence), ("wind", wind)):
        pieces.append(f"\n## {name}\n\n{prose(module.__doc__ or '')} {prose(module.Parameters.__doc__ or '')}\n\n")
        rules = [value for value in vars(module).values() if getattr(value, "__module__", "") == module.__name__]
        for rule in rules:
            if not isinstance(rule, type):
                pieces.append(f"```python\n{getsource(rule)}```\n\n")
        pieces.append(key_table(keys_of(name)))
    put("robots.md", "".join(pieces))


def _abilities(bodies: Mapping[str, Any]) -> str:
    """Table of what each body has, from what its rule asks for."""
    from inspect import signature

    words = "body | takes | inertia | uses measured velocity | noise | wind | battery | remembers | limits"
    lines = ["", f"| {words} |", "|---|---|---|---|---|---|---|---|---|"]
    for name, body in bodies.items():
        asked = set(signature(body.move).parameters)
        has = ["yes" if word in asked else "no" for word in ("vx", "mx", "gx", "wx")]
        has.append("yes" if hasattr(body.Parameters, "battery") else "no")
        kept = ", ".join(getattr(body.Memory, "_fields", ())) or "nothing"
        lines.append(f"| `{name}` | {body.accepts} | {' | '.join(has)} | {kept} | {'yes' if body.limits else 'no'} |")
    return "\n".join(lines) + "\n"


def vocabulary() -> None:
    """What each kind of rule may ask for, by name."""
    from airflock.core.vocabulary import VOCABULARY, Percept

    told = {
        "reach": "of a model: the largest distance at which a neighbour matters, m",
        "sight": "of a model: how far `percept.cast` looks, m",
        "wall_reach": "of a model: the distance beyond which a surface does not matter, m",
        "neighbour": "of a model: called for each neighbour that is heard; returns Sums",
        "boundary": "of a model: called for each wall and obstacle; returns Walls",
        "flock": "of a model: called once for the whole flock; fills the columns of Shared",
        "decide": "of a model: returns the command, and its Memory if it has one",
        "steer": "of the package: makes of a law's command one that the body takes ([steer])",
        "meet": "of a topology: says whom of those that it hears an agent meets",
        "missed": "of a radio: the probability that nothing arrives of what one agent sends another at a decision",
        "missed_few": "of a radio: the same, if few packets are sent at a decision",
        "receive": "of a radio: 1 if a packet arrives, else 0, and its Packet if it has one",
        "late": "of a radio: how much later than the delay a packet comes, s",
        "see": "of a radio: offset (m) and velocity (m/s) of a neighbour that is seen, after a picture of it",
        "lasts": "of a radio: 1.0 while the newest packet counts, by its age",
        "carry": "of a radio: where the sender of the newest packet is believed to be now, m",
        "move": "of a body: returns the velocity after a step",
        "pair": "of an order parameter: called for each pair of agents",
        "linked": "of an order parameter: whether two agents belong to one cluster",
        "agent": "of an order parameter: called for each agent",
        "member": "of an order parameter: called for each member of a cluster",
        "cluster": "of an order parameter: called for each cluster",
        "sample": "of an order parameter: the values of one instant",
        "survey": "of an order parameter: called once for the whole flock",
        "within": "of an order parameter: distance beyond which it contributes nothing, m",
        "linked_within": "of an order parameter: distance beyond which no two agents are linked, m",
        "settled": "of an order parameter: whether nobody farther than `beyond` (m) can change its Pair",
        "fitness": "of a metric set: named values of a whole flight, from its order parameters",
        "limits": "of a body: what it cannot fly of a scenario, as lines of text",
        "endures": "of a body: time for which its battery lasts at least, s; 0 once it is empty",
        "measure": "of a sensor: the position and velocity that an agent believes, and its Memory if it has one",
        "error": "of a sensor: the errors of position and velocity along one axis after one more measurement",
        "exact": "of a sensor: whether it has no error with these numbers",
        "bounds": "of a sensor: what it cannot measure of a scenario, as lines of text",
        "sense": "of a fault: the position and velocity that an agent believes, after its sensors",
        "tell": "of a fault: the position and velocity that it sends to the others",
        "radio": "of a fault: how far its radio hears and is heard",
        "clock": "of a fault: how far its clock is ahead, s",
        "overrule": "of a fault: the command that reaches the body",
        "motion": "of a fault: the velocity after a step of motion",
        "leaves": "of a fault: time from its beginning until the agent is absent, s",
        "errors": "of a metric set: what is wrong with its parameters beyond single ranges, as lines of text",
    }
    wrong = sorted(set(told) ^ set(VOCABULARY))
    if wrong:
        raise ExtensionError(f"the page of the vocabulary does not know the rules {', '.join(wrong)}")
    pieces = [
        "# What a rule may ask for\n\nA rule is a plain function of floats. Its argument names, in any order, say what "
        "it needs; a flight computes only what is asked for. Differences are always neighbour minus own.\n"
    ]
    for kind, names in VOCABULARY.items():
        rows = ((f"`{name}`", plain(text)) for name, text in names.items())
        pieces.append(f"\n## {kind}\n\nA rule {told[kind]}.\n\n{table(('name', 'what it is'), rows)}")
    pieces.append("\n## percept\n\nWhat `decide` may call of its percept.\n\n")
    methods = (getattr(Percept, name) for name in ("ray", "cast", "normal", "uniform"))
    rows = ((f"`percept.{m.__name__}`", plain(" ".join((m.__doc__ or "").split()))) for m in methods)
    put("vocabulary.md", "".join(pieces) + table(("call", "what it gives"), rows))


def keys() -> None:
    """Every key of a scenario file, and the units that values may carry."""
    from airflock.scenarios.keys import sections
    from airflock.scenarios.schema import UNITS

    pieces = [
        "# Every key of a scenario file\n\n`airflock keys`, `airflock keys radio` and `airflock keys delay` print the "
        "same lists, with `--json` for machines. A dash means that the value comes from the rest of the "
        "scenario, or that there is none.\n"
    ]
    for section in sections().values():
        pieces.append(f"\n## {plain(section.head)}\n\n{plain(section.about)}\n\n")
        pieces.append(key_table(section.keys) if section.keys else "It has no numbers of its own.\n")
    pieces.append(
        '\n## Units\n\nA plain number is in the declared SI unit. Text such as `"400 ms"`, or a table with value '
        "and unit, is converted; a note reports each conversion.\n\n"
    )
    rows = ((f"`{unit}`", ", ".join(f"`{other}`" for other in known)) for unit, known in UNITS.items())
    pieces.append(table(("declared", "also"), rows))
    put("keys.md", "".join(pieces))


def commands() -> None:
    """Every command with its options, and the function that does the same."""
    import typer.main

    from airflock.cli.command import VERBS
    from airflock.cli.main import app
    from airflock.cli.options import read_declaration

    group = typer.main.get_command(app)
    calls = {
        name: f"`{verb.function}({', '.join(read_declaration(verb.function).required)})`"
        for name, verb in VERBS.items()
        if verb.function
    }
    pieces = [
        "# Commands and functions\n\nEvery command has a Python function that does the same; its options are the "
        "function's arguments.\n\n",
        table(("command", "in Python"), ((f"[`airflock {name}`](#{name})", call) for name, call in calls.items())),
    ]
    listed = dict(group.commands)  # type: ignore[attr-defined]
    for name, command in group.commands.items():  # type: ignore[attr-defined]
        inner = {key: found for key, found in getattr(command, "commands", {}).items() if not found.hidden}
        listed |= {f"{name} {key}": found for key, found in inner.items()}
    for name, command in sorted(listed.items()):
        pieces.append(f"\n({name.replace(' ', '-')})=\n## {name}\n\n{_help(command.help or '')}\n\n")
        arguments = read_declaration(VERBS[name].function).arguments if name in calls else ()
        rows = []
        for option in command.params:
            named = option.opts[0].startswith("-")
            flag = ", ".join(f"`{text}`" for text in option.opts) if named else f"`{option.metavar or option.name}`"
            origin = VERBS[name].options[option.name].origin
            python = option.name if option.name in arguments else origin.partition(": ")[0]
            about = "–" if python.startswith("airflock.cli") else f"`{python}`"
            rows.append((flag, _help(getattr(option, "help", "") or ""), about))
        pieces.append(table(("option", "meaning", "in Python"), rows) if rows else "")
    put("commands.md", "".join(pieces))


def _help(text: str) -> str:
    """Help of a command as Markdown: without a terminal's markup, its examples as code that can be copied."""
    pieces = re.split(r"Example: (airflock .*?)(?=,?$)", text.replace("\\[", "["), flags=re.M)
    return "".join(f"\n\nExample: `{piece}`" if k % 2 else plain(piece) for k, piece in enumerate(pieces))


def presets() -> None:
    """All presets with their titles."""
    from airflock.scenarios.files import load, presets as known

    rows = []
    for name in known():
        found = load(name)
        size = f"{found.agents} agents, {found.flight.duration:g}\u00a0s"
        rows.append((f"`{name}`", plain(str(found.document.get("title", ""))), size))
    text = "# Presets\n\nFly one with `airflock run NAME`, see its file with `airflock presets NAME`, "
    text += 'start your own file with `extends = "NAME"`.\n\n'
    put("presets.md", text + table(("name", "what it is", "size"), rows))
