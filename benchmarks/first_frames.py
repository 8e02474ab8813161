"""First flock: how long a user waits for a live page whose driver nobody has compiled, from the command on.

    python benchmarks/first_frames.py [PRESET|FILE|LAW.py ...]

Each starts `airflock watch` in a process of its own with an empty cache, and a client that decodes what the page sends.
Told are the seconds by the clock until the address is printed, until agents have moved in three frames, and until the
compiled driver flies (nan: nothing had to be compiled). Run it on idle cores: the compiler works beside the page. A
second look follows, in which code is read from the cache.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from studio import connected

HERE = Path(__file__).resolve().parents[1]
USUAL = ("vasarhelyi_2018/4ms", "kidger/city", str(HERE / "examples" / "own_rule.py"))
LAWLESS = USUAL[0]  # what a law of one's own flies in
PATIENCE = 60.0  # s
MOVED = 3  # frames


def messages(raw):
    """Messages of a packet of the page: 16 bytes of lengths, compressed MessagePack, arrays."""
    import msgspec
    import zstandard

    length = int.from_bytes(raw[8:16], "little")
    plain = zstandard.ZstdDecompressor().decompress(raw[16 : 16 + length])
    return msgspec.msgpack.decode(plain)["messages"]


def seconds(what, cache):
    """(address printed, agents moved, compiled driver flies), s; nan for what did not come."""
    import msgspec  # noqa: F401  # before the clock runs
    import zstandard  # noqa: F401

    begun = time.perf_counter()
    flown = [LAWLESS, "--law", what, "--trust"] if what.endswith(".py") else [what]
    command = [sys.executable, "-u", "-m", "airflock", "watch", *flown, "--port", "0"]
    process = subprocess.Popen(
        command, env=os.environ | {"AIRFLOCK_CACHE": cache}, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    printed = moved = compiled = float("nan")
    try:
        told = []
        for line in process.stdout:
            told.append(line)
            if found := re.search(r"http://\S+", line):
                break
        else:
            raise SystemExit(f"{what}: no page: {''.join(told).strip()}")
        address = found.group()
        printed = time.perf_counter() - begun
        socket, frames, line = connected(address), 0, None
        while time.perf_counter() - begun < PATIENCE and not (moved > 0.0 and (compiled > 0.0 or line is None)):
            for message in messages(socket.recv()):
                now, updates = time.perf_counter() - begun, message.get("updates") or {}
                frames += message.get("name") == "/agents" and "batched_positions" in updates
                moved = now if frames == MOVED and not moved > 0.0 else moved
                said = str(updates.get("content", ""))
                line = message["uuid"] if "compiling" in said else line
                compiled = now if line and message.get("uuid") == line and "compiling" not in said else compiled
        socket.close()
    finally:
        process.terminate()
        process.wait()
    return printed, moved, compiled


def main():
    """Print a row for each page and cache."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", default=USUAL, metavar="PRESET|FILE|LAW.py")
    asked = parser.parse_args()
    print(f"{'':44}{'address':>9}{'moved':>9}{'compiled':>10}")
    for what in asked.what:
        with tempfile.TemporaryDirectory() as cache:
            for how in ("empty cache", "compiled"):
                printed, moved, compiled = seconds(what, cache)
                print(f"{Path(what).name + ', ' + how:44}{printed:9.2f}{moved:9.2f}{compiled:10.2f}", flush=True)


if __name__ == "__main__":
    main()
