"""Cases of the fuzz: scenarios, studies, recordings and command lines, each a function of a seed and a number."""

import datetime
import io
import json
import random
import shutil
import sys
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from pathlib import Path

import documents
import forked

from airflock.support import untrusted
from airflock.support.errors import AirflockError, ScenarioError

GOLDEN = Path(__file__).parents[1] / "golden" / "0.1"
LONGEST = 2100  # letters of one line
LAST_RESORT = "cannot be used: "


def check(fault):
    """A refusal as it must be: of bounded lines, foreseen, and no empty one."""
    lines = str(fault).splitlines()
    assert lines and all(lines), "a refusal without words"
    assert len(lines) <= 60, f"{len(lines)} lines"
    assert max(map(len, lines)) <= LONGEST, f"a line of {max(map(len, lines))} letters"
    cause = fault.__cause__
    foreseen = isinstance(cause, (AirflockError, OSError, RecursionError, type(None)))
    if LAST_RESORT in str(fault) and not foreseen:
        raise cause


def numbers(rng):
    """A number that somebody may write, or not."""
    return rng.choice([
        0, 1, -1, 2, 0.5, 1e-300, 1e300, -1e308, 2**31, 2**63, 2**64, 10**30, float("inf"), float("nan"),
        10**400, -(10**310), 1e15, 1e-6, 0.1, 10, 100, rng.uniform(-10, 1000), rng.randint(-5, 10**6),
    ])  # fmt: skip


def anything(rng, depth=0):
    """A value of any kind."""
    kind = rng.randrange(12 if depth < 3 else 6)
    if kind < 3:
        return numbers(rng)
    if kind == 3:
        return rng.choice([True, False])
    if kind == 4:
        return rng.choice([
            "", "x", "aaa" * 200, "mine.py", "a" * 300 + ".py", "../../etc/passwd", "/dev/zero", "\0", "é\u202e\n\x1b[",
            "none", "square", "nearest", "visible", "gnss", "links", "stop", "motor", "dryden", "quadrotor",
            "cap", "vicsek_1995", "kidger", "points", "mesh", "periodic", "fitness", "nsga2", "1",
        ])  # fmt: skip
    if kind == 5:
        return datetime.date(2018, 7, 18)
    if kind in (6, 7, 8):
        return [anything(rng, depth + 1) for _ in range(rng.choice([0, 1, 2, 3, 5]))]
    if kind == 9:
        return [[rng.uniform(-500, 500) for _ in range(rng.choice([1, 2, 2, 2, 3]))] for _ in range(rng.randrange(6))]
    if kind == 10:
        return {"value": anything(rng, depth + 1), "unit": rng.choice(["m", "s", 5, ""]), "source": "fuzz"}
    return {rng.choice(["value", "low", "kind", "mean", "x" * 300, "", "a.b"]): anything(rng, depth + 1)}


def toml(value):
    """A value as TOML, in one line; our own, because the usual writers refuse what a stranger may write."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(str(k))} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, int) and abs(value) > 10**4000:
        return "9" * 4400
    return str(value)


def lines_of(document):
    """A document as TOML: keys and small tables in one line, then sections."""
    found = [f"{json.dumps(k)} = {toml(v)}" for k, v in document.items() if not isinstance(v, dict)]
    for key, section in document.items():
        if isinstance(section, dict):
            found += [f"[{json.dumps(key)}]", *(f"{json.dumps(str(k))} = {toml(v)}" for k, v in section.items())]
    return "\n".join(found) + "\n"


def mutate(rng, document):
    """A copy of a document with one to four things changed, also inside lists of tables."""
    document = json.loads(json.dumps(document, default=str))
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        table = document
        while rng.random() < 0.75 and (inside := _inside(table)):
            table = rng.choice(inside)
        key = rng.choice([*table, "new"]) if table else "new"
        what = rng.randrange(8)
        if what == 0:
            table.pop(key, None)
        elif what == 1:
            table[key + rng.choice(["x", " ", "é", "." * 3])] = table.pop(key, 1)
        elif what == 2:
            table[
                rng.choice(
                    [
                        "kind",
                        "model",
                        "scene",
                        "goals",
                        "world",
                        "format",
                        "published",
                        "aero",
                        "search",
                        "sensors",
                        "topology",
                        "silence",
                        "groups",
                        "faults",
                        "extends",
                        "body",
                        "wind",
                        "scenarios",
                        "over_scenarios",
                        "objective",
                    ]
                )
            ] = anything(rng)
        elif what == 3 and isinstance(table.get(key), list) and table[key]:
            entry = rng.randrange(len(table[key]))
            table[key] = [*table[key][:entry], anything(rng), *table[key][entry + 1 :]]
        else:
            table[key] = anything(rng)
    return document


def _inside(table):
    """Tables that a table holds, alone or in lists."""
    found = [value for value in table.values() if isinstance(value, dict)]
    lists = [value for value in table.values() if isinstance(value, list)]
    return found + [entry for entries in lists for entry in entries if isinstance(entry, dict)]


def damage(rng, content):
    """A copy of bytes with something cut, changed, doubled or put in."""
    content = bytearray(content)
    for _ in range(rng.choice([1, 1, 2, 5])):
        at, size = rng.randrange(len(content) + 1), rng.choice([1, 1, 4, 16, 64, 350])
        what = rng.randrange(6)
        if what == 0:
            content = content[:at]
        elif what == 1:
            for place in range(at, min(at + size, len(content))):
                content[place] ^= 1 << rng.randrange(8)
        elif what == 2:
            content[at : at + size] = bytes(min(size, len(content) - at))
        elif what == 3:
            del content[at : at + size]
        elif what == 4:
            content[at:at] = bytes(rng.randrange(256) for _ in range(size))
        else:
            content[at:at] = content[at : at + size] * rng.choice([1, 2, 50])
        if not content:
            content = bytearray(b"\n")
    return bytes(content)


@cache
def scenarios():
    """Documents of all presets, of the golden scenario, and of every section."""
    from airflock.scenarios.files import presets

    shipped_studies = [untrusted.read_toml(path) for path in (*presets().values(), GOLDEN / "scenario.toml")]
    return shipped_studies + [*documents.SCENARIOS] * (
        len(shipped_studies) // len(documents.SCENARIOS)
    )  # half of all cases


@cache
def studies():
    """Documents of all studies and of the golden one, with a preset for its scenario."""
    from airflock.search.study import shipped_studies

    found = [untrusted.read_toml(path) for path in (*shipped_studies().values(), GOLDEN / "study.toml")]
    named = [document for document in found if "scenario" in document]
    rest = [document for document in found if "scenario" not in document]
    preset = "vasarhelyi_2018/4ms"
    named = [{**document, "scenario": document["scenario"].replace("scenario.toml", preset)} for document in named]
    return named + rest + [*documents.STUDIES] * (len(named) // len(documents.STUDIES))  # half of all cases


def _written(rng, documents, path):
    document = rng.choice(documents)
    if rng.random() < 0.8:
        path.write_text(lines_of(mutate(rng, document)))
    else:
        path.write_bytes(damage(rng, lines_of(document).encode()))


def scenario(seed, number, folder, tell=False):
    """Load a mutated scenario, with settings now and then."""
    from airflock.scenarios.files import load

    rng, path = random.Random(f"scenario {seed} {number}"), folder / "mutated.toml"
    _written(rng, scenarios(), path)
    settings = {"agents": rng.choice([5, numbers(rng)])} if rng.random() < 0.1 else {}
    return _judged(lambda: load(path, settings), path, tell)


def study(seed, number, folder, tell=False):
    """Load a mutated study."""
    from airflock.search.study import load_study

    rng, path = random.Random(f"study {seed} {number}"), folder / "mutated.toml"
    _written(rng, studies(), path)
    return _judged(lambda: load_study(path), path, tell)


def _judged(use, path, tell=False):
    """Whether a file was accepted; raises where it was refused badly."""
    if tell:
        shutil.copy(path, f"last{path.suffix}")
    try:
        use()
        return True
    except AirflockError as fault:
        if tell:
            sys.stdout.write(f"{fault}\n")
        check(fault)
        if path.suffix == ".toml":
            assert isinstance(fault, ScenarioError), f"{type(fault).__name__}: {fault}"
        return False


@cache
def undamaged():
    """Bytes and scores of the recording that is damaged: one of today's, made of the golden one."""
    from airflock.recordings.attributes import CHECKSUM_ATTRIBUTE, recording_checksum
    from airflock.recordings.recording_files import load_recording
    from airflock.recordings.scores import measure_recording

    recording = load_recording(GOLDEN / "recording.nc")
    recording = recording.assign_attrs({"airflock_format": 2})
    recording = recording.assign_attrs({CHECKSUM_ATTRIBUTE: recording_checksum(recording)})
    return bytes(recording.to_netcdf(None, engine="h5netcdf")), recording, measure_recording(recording)[0]


def recording(seed, number, folder, tell=False):
    """Load and score a damaged recording: its score is that of the undamaged one, or it was said to be changed."""
    import warnings

    from airflock.recordings.recording_files import load_recording
    from airflock.recordings.scores import measure_recording

    rng, path = random.Random(f"recording {seed} {number}"), folder / "damaged.nc"
    content, whole, wanted = undamaged()
    if rng.random() < 0.75:
        path.write_bytes(damage(rng, content))
    else:
        changed = whole.copy(deep=True)
        key = rng.choice([*whole.attrs, "airflock_scenario", "airflock_metrics"])
        what = rng.randrange(4)
        if what == 0:
            del changed.attrs[key]
        elif what == 1:
            changed.attrs[key] = rng.choice(["", "x", "[]", "5", '{"model": 5}', "[" * 5000, 5, 1e400, -1, "é"])
        elif what == 2:
            document = json.loads(whole.attrs["airflock_scenario"])
            changed.attrs["airflock_scenario"] = json.dumps(mutate(rng, document), default=str)
        else:
            name = rng.choice(list(changed.variables))
            changed = changed.drop_vars(name) if rng.random() < 0.3 else changed
            if name in changed and changed[name].dtype.kind == "f":
                values = changed[name].values.copy()
                values.flat[rng.randrange(values.size)] = rng.choice([float("nan"), 1e300, -1.0, float("inf")])
                changed = changed.assign_coords(time=values) if name == "time" else changed.assign(
                    {name: (changed[name].dims, values)}
                )  # fmt: skip
        try:
            path.write_bytes(bytes(changed.to_netcdf(None, engine="h5netcdf")))
        except (OSError, ValueError, TypeError):  # nobody can write such a file
            return False

    def use():
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            found = load_recording(path)
        values, _ = measure_recording(found)
        if not any("was changed" in str(warning.message) for warning in caught) and "airflock_checksum" in found.attrs:
            assert repr(values) == repr(wanted), "another score, and nothing was said"

    return _judged(use, path, tell)


VERBS = (
    "run",
    "score",
    "sweep",
    "plot",
    "video",
    "presets",
    "validate",
    "display",
    "paper",
    "evolve",
    "harden",
    "replay",
    "certify",
    "tune",
    "import",
    "export",
    "identify",
    "infer",
    "fleet",
    "keys",
    "doctor",
    "types",
)
VALUES = (
    "", "0", "-1", "1e400", "nan", "inf", "9" * 50, "9" * 4400, "x", "model.p_rep=1", "model.p_rep=[[[[", "=1", "a=b=c",
    "model.p_rep={value=0.1}", "agents=" + "9" * 400, "model." + "x" * 5000 + "=1", "a" + ".a" * 50000 + "=1", "é=",
    "radio.delay=0:2:3", "radio.delay=0:2:1000000000", "radio.delay=::", "model.p_rep=" + "[" * 3000, "/dev/full",
    "/nowhere/x.nc", "a" * 300 + ".nc", "flight.png", "flight.txt", "x.toml", "vasarhelyi_2018/4ms", "mine.py", "cuda",
    "fitness", "sobol", "\x1b[2J", "kidger/city", "../..", "model.kind=evil.py", "scene.file=/etc/passwd", "16", "33",
)  # fmt: skip


@cache
def options_of(verb):
    """Options of a verb, and whether each takes a value; and one that there is not."""
    import typer

    from airflock.cli.main import app

    group = typer.main.get_command(app)
    found = [p for p in group.commands[verb].params if p.param_type_name == "option"]
    return [(p.opts[0], not p.is_flag) for p in found] + [("--nope", True)]


class Flown(BaseException):
    """A command got as far as a flight: that is not what is tested."""


def command(seed, number, folder, tell=False):
    """A command line of verbs, options and values that hardly go together; whatever would fly is taken for fine."""
    rng = random.Random(f"command {seed} {number}")
    words = [rng.choice(VERBS)]
    names = ("vasarhelyi_2018/4ms", "kidger/city", "x.toml", str(GOLDEN / "scenario.toml"), str(GOLDEN / "study.toml"),
             str(GOLDEN), "/dev/zero", "a" * 300, "AIR", "vicsek_1995", str(GOLDEN / "scores.json"))  # fmt: skip
    words += [rng.choice(names) for _ in range(rng.choice([0, 1, 1, 1, 2]))]
    for _ in range(rng.randrange(5)):
        option, takes = rng.choice(options_of(words[0]))
        words += [option, rng.choice(VALUES)] if takes == (rng.random() < 0.95) else [option]
    if tell:
        sys.stdout.write(f"{[word[:60] for word in words]}\n")
    return commanded([word.replace("\0", "") for word in words], folder, tell)


def commanded(words, folder, tell=False):
    """Status 0 or flown: accepted. Status 2: refused, in lines that begin with the command's name or typer's usage."""
    import os

    from airflock.cli.main import main

    os.chdir(folder)
    os.environ["AIRFLOCK_CACHE"] = str(folder / "cache")  # `doctor --clear-cache` is a command, too
    no_flights()
    out, err = io.StringIO(), io.StringIO()
    sys.argv = ["airflock", *words]
    try:
        with redirect_stdout(out), redirect_stderr(err):
            main()
        status = 0
    except SystemExit as end:
        status = end.code
    except Flown:
        return True
    said = err.getvalue()
    if tell:
        sys.stdout.write(f"{status}: {said[:2000]}\n")
    assert status in (0, 2, None), f"status {status}: {said[:300]}"
    assert "Traceback" not in said and "airflock: unexpected" not in said and LAST_RESORT not in said, said[:300]
    assert max(map(len, said.splitlines() or [""])) <= LONGEST + 20, "a long line"
    return status in (0, None)


@cache
def no_flights():
    """Whatever would compile or fly in this process ends there."""
    from airflock.displays import shows as show
    from airflock.fleets.lockstep import LockstepFleet
    from inside import drivers, interpreted, measuring, simulate, store

    def flown(*_, **__):
        raise Flown

    store.load_driver = drivers.load_driver = measuring.load_driver = flown
    LockstepFleet.advance = flown
    interpreted.flight_driver = flown
    simulate.compile_for = show.fly_show = flown
    simulate.in_threads = flown


def warm(what):
    """Import and read beforehand what every child needs."""
    if what == "recordings":
        forked.readers_are_forked()
        undamaged()
    elif what == "studies":
        studies()
    elif what == "commands":
        import airflock.cli.main
        import airflock.recordings.recording_files  # noqa: F401
    elif what == "files":
        import other_files

        forked.readers_are_forked()
        other_files.sound()
    elif what == "disks":
        import damages
        import other_files

        damages.results()
        damages.stored()
        other_files.certificate()
    else:
        scenarios()


CASES = {"scenarios": scenario, "studies": study, "recordings": recording, "commands": command}
