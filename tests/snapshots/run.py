"""Compare snapshots of what must not change with the records beside this file, or write the records.

    python tests/snapshots/run.py NAME [...]|all [--write]
    python tests/snapshots/run.py drivers --show PRESET

Every other module of this folder is one snapshot: its docstring says what it freezes, and `take() -> dict` returns it
as plain values of JSON. A module may have `show(name) -> str`, which prints one item in full. Where it has
BY_PROCESSOR = True, last bits depend on the processor, and its record holds a snapshot for each kind that is on record.
"""

import argparse
import json
import os
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCES = [str(HERE.parents[1] / folder) for folder in ("src", "papers/src")]  # of this checkout, installed or not
MOST = 20  # differences that are printed of one snapshot
LONGEST = 400  # letters that are printed of one value
MISSING = "(missing)"


def names():
    """Return the names of all snapshots; modules named _* and test_* are none."""
    stems = (path.stem for path in HERE.glob("*.py"))
    return sorted(stem for stem in stems if stem != "run" and not stem.startswith(("_", "test_")))


def module(name):
    """Import the module of one snapshot; it may import the helpers of the tests."""
    if str(HERE.parent) not in sys.path:
        sys.path[:0] = [str(HERE.parent), *SOURCES]
        os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (*SOURCES, os.environ.get("PYTHONPATH"))))
    qualified = f"snapshot_{name}"  # `golden` or `store` alone may be something else on the path
    if qualified not in sys.modules:
        spec = spec_from_file_location(qualified, HERE / f"{name}.py")
        sys.modules[qualified] = module_from_spec(spec)
        spec.loader.exec_module(sys.modules[qualified])
    return sys.modules[qualified]


def take(name):
    """Take one snapshot, in the form in which JSON returns it."""
    return json.loads(text_of(module(name).take()))


def text_of(snapshot):
    """Return the text of a record: one item a line, in the order of the keys."""
    return json.dumps(snapshot, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n"


def record(name):
    """Return the path of the record of one snapshot."""
    return HERE / f"{name}.json"


def processor():
    """Return the kind of this processor, such as znver4, whatever drivers are compiled for."""
    from llvmlite.binding import get_host_cpu_name

    return get_host_cpu_name()


def recorded(name):
    """Return what is on record of a snapshot, on this kind of processor; None where that is not on record."""
    found = json.loads(record(name).read_text(encoding="utf-8"))
    return found.get(processor()) if getattr(module(name), "BY_PROCESSOR", False) else found


def write(name):
    """Write the record of a snapshot, or its part for this kind of processor."""
    taken = take(name)
    if getattr(module(name), "BY_PROCESSOR", False):
        others = json.loads(record(name).read_text(encoding="utf-8")) if record(name).exists() else {}
        taken = {**others, processor(): taken}
    record(name).write_text(text_of(taken), encoding="utf-8")


def items(value, key=""):
    """Yield the keys (joined by " / ") and plain values inside a snapshot."""
    if isinstance(value, dict | list) and value:
        for inner, one in value.items() if isinstance(value, dict) else enumerate(value):
            yield from items(one, f"{key} / {inner}" if key else str(inner))
    else:
        yield key, value


def differences(old, new):
    """Return the items that differ between two snapshots: (key, old, new)."""
    old, new = dict(items(old)), dict(items(new))
    keys = [*old, *(key for key in new if key not in old)]
    pairs = ((key, old.get(key, MISSING), new.get(key, MISSING)) for key in keys)
    return [(key, before, after) for key, before, after in pairs if before != after]


def compare(name):
    """Return the differences between the record of a snapshot and the snapshot taken now."""
    return differences(recorded(name), take(name))


def main():
    """Compare, write or show; the status is 1 if anything differs."""
    known = names()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="+", metavar="NAME", choices=[*known, "all"], help=f"{', '.join(known)}, or all")
    parser.add_argument("--write", action="store_true", help="write the records instead of comparing with them")
    parser.add_argument("--show", metavar="ITEM", help="print one item of a snapshot in full")
    options = parser.parse_args()
    chosen = known if "all" in options.names else options.names
    if options.show is not None:
        if len(chosen) != 1 or not hasattr(module(chosen[0]), "show"):
            parser.error("--show needs the name of one snapshot that has items to show")
        print(module(chosen[0]).show(options.show))
        return 0
    status = 0
    for name in chosen:
        if options.write:
            write(name)
            print(f"{name}: written")
        elif not record(name).exists():
            status = 1
            print(f"{name}: has no record; write it with --write")
        elif recorded(name) is None:
            print(f"{name}: not on record for {processor()}; --write adds it, best at the commit that has the record")
        else:
            found = compare(name)
            status |= bool(found)
            print(f"{name}: {f'{len(found)} differ' if found else 'as recorded'}")
            for key, old, new in found[:MOST]:
                print(f"  {key}\n    old: {str(old)[:LONGEST]}\n    new: {str(new)[:LONGEST]}")
            if len(found) > MOST:
                print(f"  ... and {len(found) - MOST} more")
    return status


if __name__ == "__main__":
    sys.exit(main())
