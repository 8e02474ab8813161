"""Attack the doors with mutated text and damaged files, and count what is not an AirflockError of one line a fault.

python tests/security/fuzz.py scenarios 1000000 --seed 7
python tests/security/fuzz.py studies 100000
python tests/security/fuzz.py recordings 10000
python tests/security/fuzz.py commands 3000
python tests/security/fuzz.py caches 200
python tests/security/fuzz.py disks 1000

Cases run in forked children of one warm process, many in each, so that a hang or a crash costs one child and is told
with its number. A case is a function of the seed and its number alone: --only NUMBER repeats one with its traceback.
Exit status 0 if nothing failed. A case fails by an exception that is no AirflockError, by the last resort of
`doors.from_outside`, by a line of more than 2,100 letters, by taking longer than 20 s (a recording:
than its reader may), or by ending the process.
"""

import argparse
import os
import select
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path

import damages
import mutations

HANG = 20.0  # s
BATCH = 400  # cases of a child
PATIENCE = {"recordings": 70.0}  # s; a reader has 15 s of a processor, four times as long where others use it, too
SLOW = ("recordings", "caches", "disks")
CASES = mutations.CASES | damages.CASES


def attack(case, count, seed, *, folder, begin=0, say=None, batch=BATCH, hang=HANG):
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
        if say is not None:
            say(number - begin, failures)
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
            if not select.select([pipe], [], [], hang)[0]:
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


def main():
    """Exit status 0 if nothing failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=sorted(CASES))
    parser.add_argument("count", type=int, nargs="?", default=1000)
    parser.add_argument("--seed", type=int, default=2018)
    parser.add_argument("--begin", type=int, default=0, help="number of the first case")
    parser.add_argument("--only", type=int, help="repeat one case in this process, with its traceback")
    asked = parser.parse_args()
    case = CASES[asked.what]
    mutations.warm(asked.what)
    with tempfile.TemporaryDirectory() as folder:
        if asked.only is not None:
            sys.stdout.write(f"accepted: {case(asked.seed, asked.only, Path(folder), tell=True)}\n")
            return 0
        began, told = time.monotonic(), time.monotonic()

        def say(done, failures):
            nonlocal told
            if time.monotonic() - told > 10.0:
                told = time.monotonic()
                sys.stderr.write(f"{done} of {asked.count}, {len(failures)} failures, {told - began:.0f} s\n")

        how = {"begin": asked.begin, "say": say, "batch": 25 if asked.what in SLOW else BATCH}
        how["hang"] = PATIENCE.get(asked.what, HANG)
        failures, accepted = attack(case, asked.count, asked.seed, folder=Path(folder), **how)
        for number, reason in failures:
            sys.stdout.write(f"case {number}: {reason}\n")
        sys.stdout.write(
            f"{asked.what}, seed {asked.seed}: {asked.count} cases, {accepted} accepted, {len(failures)} failures, "
            f"{time.monotonic() - began:.0f} s\n"
        )
        return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
