"""Print a law, body, sensor, radio or fault as C99: header, source, and a test that replays answers of plain Python."""

import ast
import math
import os
import random
import re
import struct
from collections.abc import Callable, Mapping, Sequence
from importlib import resources
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from airflock.core import (
    FAR,
    FAULT_RULES,
    TINY,
    HeardNeighbour,
    Own,
    Parameters,
    Percept,
    Quantity,
    State,
    declarations,
    norm,
    number_names,
    pair_arguments,
    tree_of,
    vector_sizes,
)
from airflock.engine.text.c99 import PRELUDE, REAL, WHOLE, CPrinter, Function, fits_float
from airflock.engine.text.rewrite import RuleRewriter
from airflock.scenarios import MODELS, Scenario, find_law, scenario_variant
from airflock.support import AirflockError, RuleError, as_error, expand_path, suggest, to_identifier

# The rules that are printed of each kind, and the letter of its numbers. Others (`flock`, `limits`,
# `lasts`, `see`) speak of a whole flock or scenario.
KINDS: Mapping[str, tuple[str, str]] = {
    "law": ("p", "preferred_speed interaction_range reach sight wall_reach neighbour boundary decide steer"),
    "body": ("b", "move endures"),
    "sensor": ("s", "measure error"),
    "radio": ("k", "missed late carry receive"),
    "fault": ("f", " ".join(FAULT_RULES)),
}
RECORDS = {"sums": "Sums", "walls": "Walls", "memory": "Memory", "packet": "Packet"}  # argument → record of the part
STUBS = ("crazyflie.c", "stm32.c", "px4.cpp")
CASES = 10_000


class PrintedPart(NamedTuple):
    """A part as C: its name in C, the part, its numbers, its rules by their names, and what the header has to note."""

    name: str
    part: Any
    numbers: Any
    letter: str
    steer: Any  # numbers of [steer], None where the body takes what the law commands
    notes: list[str]
    rules: dict[str, Callable[..., Any]]
    printer: CPrinter
    functions: dict[str, Function]


def print_law(
    law: Scenario | str | os.PathLike[str],
    *,
    to: str = "c",
    part: str = "law",
    settings: Mapping[str, Any] | None = None,
    precision: int = 32,
    out: str | os.PathLike[str] | None = None,
    trust: bool = False,
) -> list[Path]:
    """Print a flocking law, or another part of a scenario, as C99 without allocation, globals or recursion.

    Parameters
    ----------
    law : Scenario, str or path (LAW|PRESET|FILE)
        A preset or scenario file, whose numbers become the defaults; or a law by its name or its file.
    to : str
        The language: c, which is C99.
    part : str (PART)
        law, body, sensor, radio, or the name of one of the scenario's faults.
    settings : mapping, optional
        Keys of the scenario to change, such as {"model.p_rep": 0.14}.
    precision : int
        Bits of a number, 32 or 64; AIRFLOCK_PRECISION chooses the other one when the files are compiled.
    out : str or path (FOLDER), optional
        Folder to write to; by default one named after the part.
    trust : bool
        Whether code that a file names may run.

    Returns
    -------
    list of Path
        The files: header, source, test with its cases, CMakeLists.txt, and of a law stubs for firmware.

    Raises
    ------
    RuleError
        Where a rule has no form in C, such as a loop over a list: with file, line, and what to write instead.
    AirflockError
        For a part that the scenario lacks, another language, or another precision.
    ScenarioError
        If there is no such law, preset or file, or a key is wrong.

    Examples
    --------
    >>> import airflock
    >>> files = airflock.print_law("vasarhelyi_2018/4ms", out="law")  # doctest: +SKIP
    """
    if to != "c":
        raise AirflockError(f"to = {to!r}: rules are printed as c alone")
    if precision not in (32, 64):
        raise AirflockError(f"precision = {precision!r} is none of 32, 64")
    printed = printed_part(law, part, settings, trust)
    folder = Path(printed.name) if out is None else expand_path(out)
    name = printed.name
    files: dict[str, str | bytes] = {
        f"{name}.h": header_text(printed, precision),
        f"{name}.c": source_text(printed),
        f"test_{name}.c": test_text(printed),
        f"{name}.cases": cases_of(printed, CASES),
        "CMakeLists.txt": _template("CMakeLists.txt", name),
    }
    # Stubs send velocities, and call a law without a memory, rays or draws: they have none to hand it.
    calls = any("percept->context" in function.text for function in printed.functions.values())
    if getattr(printed.part, "command", "") == "velocity" and printed.part.Memory is None and not calls:
        files |= {f"stub_{stub}": _template(stub, name) for stub in STUBS}
    with as_error(folder, AirflockError):
        folder.mkdir(parents=True, exist_ok=True)
        for file, content in files.items():
            (folder / file).write_bytes(content if isinstance(content, bytes) else content.encode())
    return [folder / file for file in files]


def _template(file: str, name: str, **parts: str) -> str:
    text = resources.files("airflock.engine.text").joinpath(f"templates/{file}").read_text(encoding="utf-8")
    known = parts | {"LAW": name}
    return re.sub(r"@([A-Z]+)@", lambda place: known[place[1]], text)  # an unknown place is a KeyError


def printed_part(
    law: Scenario | str | os.PathLike[str], part: str, settings: Mapping[str, Any] | None, trust: bool
) -> PrintedPart:
    """Return a part of a scenario, or a law by its name or file, with its rules as C functions."""
    kind = part
    text = law if isinstance(law, Scenario) else os.fspath(law)
    if part == "law" and isinstance(text, str) and not settings and (text in MODELS or text.endswith(".py")):
        rules: Any = find_law(text, where="law", trust=True)
        numbers, steer, notes = rules.Parameters(), None, []
    elif isinstance(text, str) and text in MODELS:
        raise AirflockError(f"{text} is a law alone; other parts and settings are those of a preset or scenario file")
    else:
        scenario = scenario_variant(law, settings, trust=trust)
        faults = {entry.fault.name: entry for entry in scenario.faults}
        known: dict[str, tuple[Any, Any]] = {"law": (scenario.model, scenario.parameters)}
        for name, own in (("body", scenario.body), ("sensor", scenario.sensors), ("radio", scenario.radio)):
            known[name] = (own.rule, own.numbers)
        known |= {name: (entry.fault, entry.numbers) for name, entry in faults.items()}
        if part not in known:
            some = suggest(part, known, f"known: {', '.join(known)}")
            raise AirflockError(f"part = {part!r}: {scenario.name} has no such part; {some}")
        rules, numbers = known[part]
        steer = scenario.resolved_steer() if getattr(rules, "steer", None) is not None else None
        notes = [f"Agents of group {each.name} have a law or numbers of their own, which are not these."
                 for each in scenario.groups if each.law is not None or each.numbers]  # fmt: skip
        if scenario.topology.rule is not None:
            notes.append(f"Give it those heard whom topology {scenario.topology.rule.name} selects.")
        if scenario.dimensions == 2:
            notes.append("The scenario flies in a plane: set z and vz of all states to 0.")
        kind = "fault" if part in faults else part
    letter, names = KINDS[kind][0], KINDS[kind][1].split()
    if getattr(rules, "flock", None) is not None or getattr(rules, "added", None) is not None:
        raise RuleError(
            f"{rules.name} solves for the whole flock at once, which no single drone can do; it is not printed"
        )
    chosen = {name: value for name, value in vars(numbers).items() if isinstance(value, str)}
    plain = number_names(numbers)
    for key in plain:
        if getattr(numbers, key) is None or not fits_float(getattr(numbers, key)):
            value = getattr(numbers, key)
            raise AirflockError(f"{rules.name}: {key} = {value}; give a number that fits single precision")
    name = to_identifier(rules.name)
    printer = CPrinter(name, {letter: chosen}, {letter: vector_sizes(plain)})
    types = {"fast": WHOLE, "slow": WHOLE, letter: printer.record(f"{name}_Parameters", plain)}
    types["own"] = printer.record(f"{name}_Own", Own._fields)
    types["percept"] = printer.record(f"{name}_Percept", Percept._fields)
    if steer is not None:
        types["steer"] = printer.record(f"{name}_Steer", number_names(steer))
    for argument, record in RECORDS.items():
        found = getattr(rules, record, None)
        if found is not None:
            types[argument] = printer.source.name(found)
    own_rules = {each: getattr(rules, each) for each in names if getattr(rules, each, None) is not None}
    functions = {each: printer.rule(rule, types) for each, rule in own_rules.items()}
    if not functions:
        raise RuleError(f"{rules.name} has no rule that can be printed; {kind} rules are {', '.join(names)}")
    return PrintedPart(name, rules, numbers, letter, steer, notes, own_rules, printer, functions)


def header_text(printed: PrintedPart, precision: int) -> str:
    """Return the header: numbers with unit, range and source, records, and the rules."""
    name, printer = printed.name, printed.printer
    chosen = [f"{key} = {value}" for key, value in vars(printed.numbers).items() if isinstance(value, str)]
    notes = [f"Choices that are compiled in: {', '.join(chosen)}."] if chosen else []
    lines: list[str] = []
    about = {key: declared for key, declared, _ in declarations(printed.numbers) if isinstance(declared, Quantity)}
    source = command_text(printed)  # first, as it declares structs of its own
    for record, fields in printer.structs.items():
        lines.append("typedef struct {")
        for field, kind in fields.items():
            note = about.get(field) if record == f"{name}_Parameters" else None
            lines.append(f"  {kind} {field};" + (f"  {_note(note)}" if note else ""))
        if record == f"{name}_Percept":
            lines.append(_template("percept.h", name).rstrip())
        lines += [*([] if fields else ["  char nothing;  /* C has no empty struct */"]), f"}} {record};", ""]
    values = {"DEFAULTS": printed.numbers, "STEER": printed.steer}
    if getattr(printed.part, "Memory", None) is not None:
        values["START"] = printed.part.Memory()  # of a memory, before the first decision
    for what, record in values.items():
        if record is not None:
            lines.append(f"#define {name}_{what} {{{', '.join(f'R({each!r})' for each in _flat(record)) or '0'}}}")
    lines.append("")
    for rule, function in printed.functions.items():
        head, _, _ = function.text.partition(" {")
        lines += [_comment((printed.rules[rule].__doc__ or rule).strip().partition("\n")[0]), f"{head};", ""]
    lines += [source.partition("{")[0].rstrip() + ";", ""] if source else []
    title = (getattr(printed.part, "doc", "") or "").strip().partition("\n")[0]
    return _template(
        "header.h", name, TITLE=_comment(f"{name}: {title or 'printed rules'}"), GUARD=f"AIRFLOCK_{name.upper()}_H",
        NOTES="".join(f"{_comment(each)}\n" for each in (*notes, *printed.notes)), PRECISION=str(precision),
        DECLARED="\n".join(lines),
    )  # fmt: skip


def _comment(text: str) -> str:
    """Return a text as one comment of C, which it cannot end."""
    return f"/* {' '.join(text.replace('*/', '').replace('/*', '').split())} */"


def _note(declared: Quantity) -> str:
    unit = "" if declared.unit == "1" else f"{declared.unit}, "
    source = f" ({declared.source})" if declared.source else ""
    return _comment(f"{unit}{declared.low:g} to {declared.high:g}: {declared.meaning}{source}")


def source_text(printed: PrintedPart) -> str:
    """Return the source: what rules call, the rules, and of a law its whole decision."""
    printer, rules = printed.printer, {function.name for function in printed.functions.values()}
    decision = command_text(printed)
    used = sorted(printer.used - PRELUDE.keys())
    lines = [f'#include "{printed.name}.h"', "", "#include <math.h>", ""]
    lines += ["#if AIRFLOCK_PRECISION == 32", *(f"#define r_{each} {each}f" for each in used)]
    lines += ["#else", *(f"#define r_{each} {each}" for each in used), "#endif", ""]
    for name in (each for each in PRELUDE if each in printer.used):
        lines += [PRELUDE[name], ""]
    for function in printer.functions.values():
        lines += [("" if function.name in rules else "static ") + function.text, ""]
    return "\n".join([*lines, *([decision, ""] if decision else [])])


def _pair_function(printed: PrintedPart, wanted: Sequence[str], types: Sequence[str]) -> str:
    """Print what a rule of neighbours asks for, from the text by which a pilot computes it; return its name in C."""
    printer, name = printed.printer, f"{printed.name}_pair"
    rewriter = RuleRewriter(pair_arguments, printer.source, {})
    *body, last = (rewriter.visit(each) for each in tree_of(pair_arguments).body)
    # C has no dict: in its place stands a record of those that the rule takes.
    values = {ast.literal_eval(key): value for key, value in zip(last.value.keys, last.value.values, strict=True)}
    pair = ast.Name(printer.record(f"{printed.name}_Pair", wanted), ast.Load())
    names = ast.arguments([], [ast.arg(each) for each in ("own", "heard", "index", "group")], None, [], [], None, [])
    body.append(ast.Return(ast.Call(pair, [values[each] for each in wanted], [])))
    printer.trees[name] = ast.FunctionDef(name, names, body, [])
    return printer.called(name, types).name


def command_text(printed: PrintedPart) -> str:
    """Return the function that makes a whole decision from what was heard; empty for what is no law of one drone."""
    rule = printed.functions.get("decide")
    if rule is None or any(each in rule.arguments for each in ("wing", "aero", "shared")):
        return ""
    name, printer, part = printed.name, printed.printer, printed.part
    start = {"sum": "R(0.0)", "min": f"R({FAR!r})", "max": f"-R({FAR!r})"}
    lines = [
        f"  const real f = R(1.0) / {printer.source.name(norm)}(state->vx, state->vy, state->vz);",
        f"  const {name}_Own own = {{state->vx, state->vy, state->vz, f * state->vx, f * state->vy, f * state->vz}};",
        "  (void)own;",
    ]
    printer.called(printer.source.name(norm), [REAL] * 3)
    heard = printer.struct(f"{name}_Heard", {"state": printer.record(f"{name}_State", State._fields),
                                     "age": REAL, "who": WHOLE, "group": REAL})  # fmt: skip
    printer.record(f"{name}_Surface", ("distance", "nx", "ny", "nz"))
    for record, argument, many, kind in (
        ("Sums", "sums", "neighbours", "neighbour"),
        ("Walls", "walls", "walls_near", "boundary"),
    ):
        if getattr(part, record, None) is None:
            continue
        fields = getattr(part, record)._fields
        how = part.reduce if record == "Sums" else {}
        struct_name = printer.source.name(getattr(part, record))
        lines.append(f"  {struct_name} {argument} = {{{', '.join(start[how.get(each, 'sum')] for each in fields)}}};")
        function = printed.functions.get(kind)
        if function is None:
            continue
        lines.append(f"  for (int i = 0; i < {many}; i++) {{")
        given = [each for each in function.arguments if each != "p"]
        if kind == "neighbour":
            wanted = list(dict.fromkeys([*given, "r2"]))
            pair = _pair_function(printed, wanted, [f"{name}_State", heard, WHOLE, REAL])
            lines.append(f"    const {name}_Pair pair = {pair}(state, &heard[i], index, group);")
            if "reach" in printed.functions:
                lines.append(f"    const real near = {printed.functions['reach'].name}(p);")
                lines.append(f"    if (!(pair.r2 <= near * near + R({TINY!r}))) continue;")
            places = {each: f"pair.{each}" for each in given}
        else:
            places = {each: f"state->{each}" if each in State._fields else f"surfaces[i].{each}" for each in given}
        handed = ", ".join(places.get(each, each) for each in function.arguments)
        lines.append(f"    const {struct_name} term = {function.name}({handed});")
        for each in fields:
            total, value = f"{argument}.{each}", f"term.{each}"
            called = {"min": "least", "max": "most"}.get(how.get(each, "sum"))
            printer.used |= {called} if called else set()
            lines.append(f"    {total} = " + (f"{called}({total}, {value});" if called else f"{total} + {value};"))
        lines.append("  }")
    places = {each: f"&{each}" for each in ("own", "sums", "walls")}
    made = f"{rule.name}({', '.join(places.get(each, each) for each in rule.arguments)})"
    steer = printed.functions.get("steer")
    if steer is None:
        lines.append(f"  return {made};")
    else:  # the body takes another kind of command than the law gives
        places |= {"cx": "made.v0", "cy": "made.v1", "cz": "made.v2", "steer": "&steer"}
        handed = ", ".join(places.get(each, each) for each in steer.arguments)
        sets = (f"made.v{k} = taken.v{k};" for k in range(3))
        lines += [f"  const {name}_Steer steer = {name}_STEER;", "  (void)steer;", f"  {rule.returned} made = {made};",
                  f"  const {steer.returned} taken = {steer.name}({handed});", f"  {' '.join(sets)}",
                  "  return made;"]  # fmt: skip
    text = "\n".join(lines)
    names = ("p", "index", "group", "heard", "neighbours", "surfaces", "walls_near", "percept", "period")
    unread = [each for each in names if not re.search(rf"\b{each}\b", text)]
    memory = f"const {rule.arguments['memory']} *memory, " if "memory" in rule.arguments else ""
    head = (
        f"/* One decision of agent `index` of group `group` (-1: of none), from its own state and what it hears. */\n"
        f"{rule.returned} {name}_command(\n"
        f"    const {name}_Parameters *p, const {name}_State *state, int index, real group,\n"
        f"    const {name}_Heard *heard, int neighbours, const {name}_Surface *surfaces, int walls_near, {memory}"
        f"const {name}_Percept *percept, real period)"
    )
    return "\n".join([head + " {", *(f"  (void){each};" for each in unread), *lines, "}"])


class CasePercept(Percept):
    """Percept whose ranges and draws are simple functions of their arguments, the same in C."""

    def ray(self, ux: float, uy: float, uz: float, length: float) -> float:
        """Return the whole length in a cone to the north-east, else half of it."""
        return length if 0.8 * ux + 0.6 * uy > 0.3 else 0.5 * length

    def cast(self, ux: float, uy: float, uz: float, length: float, radius: float) -> float:
        """Return the same for a sphere."""
        return self.ray(ux, uy, uz, length)

    def normal(self, draw: int) -> float:
        """Return a number that differs from draw to draw."""
        return 0.25 * draw - 0.75

    def uniform(self, draw: int) -> float:
        """Return a number that differs from draw to draw."""
        return 0.125 + 0.03125 * draw


def cases_of(printed: PrintedPart, size: int, seed: int = 0) -> bytes:
    """Return so many cases of each rule as doubles: its arguments, then the answers of plain Python."""
    rng, found = random.Random(seed), bytearray()
    for name, rule in printed.rules.items():
        found += struct.pack("<d", size)
        done = 0
        for _ in range(50 * size):
            given = drawn_arguments(printed, name, rng)
            try:
                row = _flat((*given.values(), rule(*given.values())))
            except (ZeroDivisionError, OverflowError, ValueError):
                continue  # plain Python raises where a processor gives inf or nan
            if all(math.isfinite(each) for each in row):
                found += struct.pack(f"<{len(row)}d", *row)
                done += 1
            if done == size:
                break
        else:
            raise RuleError(f"{printed.printer.place(printed.functions[name].name)}: gives hardly ever a finite number")
    return bytes(found)


def _flat(value: Any) -> list[float]:
    """Return the numbers of a value, of a record, or of several values."""
    if isinstance(value, Parameters):
        return [float(getattr(value, name)) for name in number_names(value)]
    return [x for each in value for x in _flat(each)] if isinstance(value, tuple) else [float(value)]


def drawn_arguments(printed: PrintedPart, name: str, rng: random.Random) -> dict[str, Any]:
    """Draw the arguments of a rule: flights of some m/s, some ten metres from each other."""
    part, numbers = printed.part, printed.numbers
    if rng.random() < 0.5:
        about = {key: declared for key, declared, _ in declarations(numbers) if isinstance(declared, Quantity)}
        moved = {key: getattr(numbers, key) * rng.uniform(0.5, 1.5) for key in about}
        within = {key: min(max(value, about[key].low), about[key].high) for key, value in moved.items()}
        numbers = type(numbers)(**vars(numbers) | within)
    own, heard = (State(*(rng.gauss(0.0, 25.0 if axis in "xyz" else 4.0) for axis in State._fields)) for _ in range(2))
    values: dict[str, Any] = pair_arguments(own, HeardNeighbour(rng.randrange(9), heard, rng.expovariate(1.0)), 4)
    normal = [rng.gauss(0.0, 1.0) for _ in range(3)]
    values |= {key: each / norm(*normal) for key, each in zip(("nx", "ny", "nz"), normal, strict=True)}
    values["own"] = Own(*(values[each] for each in Own._fields))
    values["percept"] = CasePercept(*(rng.gauss(0.0, 50.0) for _ in Percept._fields))
    values |= {"distance": rng.gauss(10.0, 20.0), "period": 0.1, "dt": rng.uniform(0.005, 0.1), printed.letter: numbers}
    values |= {"steer": printed.steer}
    for argument, record in RECORDS.items():
        kind = getattr(part, record, None)
        if kind is not None:
            start = getattr(kind, "_field_defaults", {})
            spread = 1.0 if start else 3.0
            values[argument] = kind(*(start.get(each, 0.0) + rng.gauss(0.0, spread) for each in kind._fields))
    values |= {each: rng.randrange(30) for each in ("fast", "slow")}
    values |= {each: float(rng.randrange(most)) for each, most in (("talkers", 20), ("step", 1000), ("clear", 2))}
    values |= {each: rng.expovariate(0.1) for each in ("since", "reach", "age")}
    values |= {f"u{c}": rng.random() for c in range(4)}
    return {each: values[each] if each in values else rng.gauss(0.0, 1.0 if each.startswith("g") else 5.0)
            for each in printed.functions[name].arguments}  # fmt: skip


def test_text(printed: PrintedPart) -> str:
    """Return the test program, which counts the numbers that differ from those of plain Python."""
    name, printer = printed.name, printed.printer
    percept = f"{name}_Percept"
    takes = any(percept in function.arguments.values() for function in printed.functions.values())
    lines = [_template("test_percept.c", name)] if takes else []
    for rule, function in printed.functions.items():
        outputs, inputs, declared = _paths(printer, function.returned), count(), []
        for argument, kind in function.arguments.items():
            if kind in (REAL, WHOLE):
                declared.append(f"    const {kind} {argument} = ({kind})v[{next(inputs)}];")
                continue
            values = [f"(real)v[{next(inputs)}]" for _ in printer.structs[kind]]
            values += ["ray", "cast", "normal", "uniform", "0"] if kind == percept else []
            declared.append(f"    const {kind} {argument} = {{{', '.join(values) or '0'}}};")
        first = next(inputs)
        given = ", ".join(each if kind in (REAL, WHOLE) else f"&{each}" for each, kind in function.arguments.items())
        lines += [f"static int replay_{rule}(FILE *file, Outcome *outcome) {{",
                  f"  double count, v[{first + len(outputs)}];",
                  "  if (fread(&count, sizeof count, 1, file) != 1) return 0;",
                  "  for (int i = 0; i < (int)count; i++) {",
                  "    if (fread(v, sizeof v, 1, file) != 1) return 0;",
                  *declared, f"    const {function.returned} found = {function.name}({given});",
                  *(f"    compare(outcome, (real)found{path}, v[{k}]);" for k, path in enumerate(outputs, first)),
                  "  }", "  return 1;", "}", ""]  # fmt: skip
    calls = "\n".join(f'  bad |= report("{rule}", replay_{rule}, file);' for rule in printed.functions)
    return _template("test.c", name, REPLAYS="\n".join(lines), CALLS=calls)


def _paths(printer: CPrinter, kind: str) -> list[str]:
    """Return how each number of an answer is read."""
    if kind in (REAL, WHOLE):
        return [""]
    return [f".{name}{rest}" for name, each in printer.structs[kind].items() for rest in _paths(printer, each)]
