"""Attack what reads files from outside: count what is no AirflockError of one line a fault.

Text is mutated, files are damaged.

python tests/security/fuzz.py scenarios 1000000 --seed 7
python tests/security/fuzz.py studies 100000
python tests/security/fuzz.py recordings 10000
python tests/security/fuzz.py files 100000
python tests/security/fuzz.py commands 3000
python tests/security/fuzz.py caches 200
python tests/security/fuzz.py disks 1000

Cases run in forked children of one warm process, many in each, so that a hang or a crash costs one child and is told
with its number. A case is a function of the seed and its number alone: --only NUMBER repeats one with its traceback.
Exit status 0 if nothing failed. A case fails by an exception that is no AirflockError, by the last resort of
`support.untrusted.from_outside`, by a line of more than 2,100 letters, by taking longer than 20 s of a processor or ten
times as long by the clock (a recording: than its reader may), or by ending the process.
"""

import argparse
import json
import os
import select
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path

# whoever forks has one thread: what libraries begin in theirs is not there in a child (Python 3.12 warns of it)
os.environ.update(JE_ARROW_MALLOC_CONF="background_thread:false", OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")

import damages  # noqa: E402
import mutations  # noqa: E402
import other_files  # noqa: E402

HANG = 20.0  # s of a processor
WAITS = 10.0  # times as long by the clock: on a busy machine a case waits for its turn
BATCH = 400  # cases of a child
PATIENCE = {"recordings": 70.0, "files": 70.0}  # s; a reader has 15 s of a processor, four times as long by the clock
SLOW = ("recordings", "caches", "disks", "files")
CASES = mutations.CASES | damages.CASES | other_files.CASES


def attack(case, count, seed, *, folder, begin=0, batch=BATCH, hang=HANG):
    """Run case(seed, number, folder) for `count` numbers; the failures as (number, reason), and how many were refused.

    A case returns whether it was accepted, and raises for anything else than that or an AirflockError.
    """
    failures, accepted, number = [], 0, begin
    while number < begin + count:
        stop = min(number + batch, begin + count)
        reading, writing = os.pipe()
        pid = os.fork()
        if pid == 0:
            os.close(reading)
            _batch(case, range(number, stop), seed, folder, writing)
        os.close(writing)
        number, more, taken = _watch(pid, reading, number, stop, hang)
        failures += more
        accepted += taken
    return failures, accepted


def _batch(case, numbers, seed, folder, pipe):
    """In a child: one letter a case; a failure is told in words."""
    sink = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(sink, stream)
    try:
        for number in numbers:
            try:
                told = b"+\n" if case(seed, number, folder) else b"-\n"
            except BaseException as fault:  # whatever it is, it is what we look for
                last = traceback.extract_tb(fault.__traceback__)[-1]
                place = f"{Path(last.filename).name}:{last.lineno}"
                told = f"! {type(fault).__name__}: {' '.join(str(fault).split())[:300]} at {place}\n".encode()
            os.write(pipe, told)
    finally:
        os._exit(0)


def _watch(pid, pipe, number, stop, hang):
    """Read what a child tells; the number to go on with, failures, and how many cases were accepted."""
    failures, accepted, rest = [], 0, b""
    try:
        while number < stop:
            begun, until = worked(pid), time.monotonic() + WAITS * hang
            while not select.select([pipe], [], [], 0.25 * hang)[0]:
                if worked(pid) - begun > hang or time.monotonic() > until:
                    os.kill(pid, signal.SIGKILL)
                    failures.append((number, f"took longer than {hang:g} s"))
                    return number + 1, failures, accepted
            got = os.read(pipe, 65536)
            if not got:
                failures.append((number, "ended the process"))
                return number + 1, failures, accepted
            *lines, rest = (rest + got).split(b"\n")
            for line in lines:
                accepted += line == b"+"
                if line.startswith(b"!"):
                    failures.append((number, line[2:].decode(errors="replace")))
                number += 1
        return number, failures, accepted
    finally:
        os.close(pipe)
        os.waitpid(pid, 0)


def worked(pid):
    """Seconds of a processor that a child has used, with those of its own children that have ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:  # there is no such table on this system: the clock alone decides
        return 0.0
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def main():
    """Exit status 0 if nothing failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=sorted(CASES))
    parser.add_argument("count", type=int, nargs="?", default=1000)
    parser.add_argument("--seed", type=int, default=2018)
    parser.add_argument("--begin", type=int, default=0, help="number of the first case")
    parser.add_argument("--batch", type=int, help="cases of a child")
    parser.add_argument("--only", type=int, help="repeat one case in this process, with its traceback")
    parser.add_argument("--kept", type=Path, help="file of what has been done, to go on after it was cut off")
    asked = parser.parse_args()
    case = CASES[asked.what]
    mutations.warm(asked.what)
    with tempfile.TemporaryDirectory() as folder:
        if asked.only is not None:
            sys.stdout.write(f"accepted: {case(asked.seed, asked.only, Path(folder), tell=True)}\n")
            return 0
        return campaign(case, asked, Path(folder))


def campaign(case, asked, folder):
    """All cases, in parts that are kept; status 0, 1 if something failed, 3 if the time was over before the end."""
    done = {"cases": 0, "accepted": 0, "seconds": 0.0, "failures": []}
    if asked.kept and asked.kept.exists():
        done = json.loads(asked.kept.read_text())
    limit = time.monotonic() + float(os.environ.get("AIRFLOCK_LIMIT", "inf"))
    told = 0.0
    how = {"batch": asked.batch or (25 if asked.what in SLOW else BATCH), "hang": PATIENCE.get(asked.what, HANG)}
    while done["cases"] < asked.count and time.monotonic() < limit:
        began, count = time.monotonic(), min(how["batch"], asked.count - done["cases"])
        first = asked.begin + done["cases"]
        failures, accepted = attack(case, count, asked.seed, folder=folder, begin=first, **how)
        done["cases"] += count
        done["accepted"] += accepted
        done["seconds"] += time.monotonic() - began
        done["failures"] += failures
        if asked.kept:
            asked.kept.write_text(json.dumps(done))
        if time.monotonic() - told > 10.0:
            told = time.monotonic()
            sys.stderr.write(told_of(asked, done))
    for number, reason in done["failures"]:
        sys.stdout.write(f"case {number}: {reason}\n")
    sys.stdout.write(told_of(asked, done))
    return 3 if done["cases"] < asked.count else int(bool(done["failures"]))


def told_of(asked, done):
    """One line: cases, how many were accepted, failures, seconds, cases a second."""
    rate = done["cases"] / max(done["seconds"], 1e-9)
    return (
        f"{asked.what}, seed {asked.seed}: {done['cases']} of {asked.count} cases, {done['accepted']} accepted, "
        f"{len(done['failures'])} failures, {done['seconds']:.0f} s, {rate:.3g} a second\n"
    )


if __name__ == "__main__":
    sys.exit(main())
