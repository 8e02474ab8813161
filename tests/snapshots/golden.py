"""Short flights of every preset, compiled as for a Haswell: bits of all order parameters and of the recording.

A process of its own flies, in which neither drivers nor NumPy use AVX-512, so that the record does not depend on the
width of vectors. It still belongs to one kind of processor: on another one some 440 values of the very text that was
recorded differ, as functions such as sin come from the C library.
"""

import json
import os
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

BY_PROCESSOR = True
HASWELL = Path(__file__).resolve().parents[2] / ".ci" / "haswell"
NARROW = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR",
    "OPENBLAS_CORETYPE": "Haswell",
}
SEED = 1
SECONDS = {"vasarhelyi_2018/faulty": 120.0, "vasarhelyi_2018/faulty_evolved": 120.0}  # so that faults happen
USUAL, LEAST = 20.0, 40  # s, and steps of motion at least


def take():
    """Return the bits of every flight, from a process that compiles as for a Haswell."""
    command = [str(HASWELL), sys.executable, "-W", "ignore", __file__]
    done = subprocess.run(command, env=os.environ | NARROW, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout)


def fly(name):
    """Return the bits of a flight of a preset: order parameters in hexadecimal, digests of what is recorded."""
    import airflock

    whole = airflock.load(name)
    seconds = min(whole.flight.duration, max(SECONDS.get(name, USUAL), LEAST * whole.flight.dt))
    scenario = airflock.load(name, {"duration": seconds})
    [scores] = airflock.score(scenario, [SEED]).to_dict("records")
    recording = airflock.simulate(scenario, SEED)
    found = {"duration": repr(seconds)} | {key: bits(value) for key, value in scores.items() if key != "seed"}
    for variable in ("position", "velocity"):
        found[variable] = sha256(recording[variable].values.tobytes()).hexdigest()[:16]
    return found


def bits(value):
    """Return a number in hexadecimal, or those of a list."""
    return [bits(one) for one in value] if isinstance(value, list | tuple) else float(value).hex()


def main():
    """Fly every preset."""
    import airflock

    sys.stdout.write(json.dumps({name: fly(name) for name in airflock.presets()}))


if __name__ == "__main__":
    main()
