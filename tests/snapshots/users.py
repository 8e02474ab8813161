"""Files as users write them, with parts of their own (tests/users): digests of what each of them flies.

They hold scores, and positions and velocities at all samples, of a flight that is interpreted and of one that is
compiled as for a Haswell; of a study what it finds. All flew at 66fb6ba3, and the values of znver5 are those of that
commit: `PYTHONPATH=TREE/src .ci/haswell python tests/snapshots/users.py` prints the values of another tree.
"""

import json
import os
import subprocess
import sys
import tempfile
from hashlib import sha256
from pathlib import Path

HERE = Path(__file__).resolve()
FOLDER, HASWELL = HERE.parents[1] / "users", HERE.parents[2] / ".ci" / "haswell"
BY_PROCESSOR = True  # functions such as sin come from the C library, also for a flight that is interpreted
NARROW = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR",
    "OPENBLAS_CORETYPE": "Haswell",
}
SEED = 1
INTERPRETED, COMPILED = {"device": "python", "precision": 64}, {"device": "cpu", "precision": 32}


def names():
    """Return the names of the files of users."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def take():
    """Return the digests of all files, from a process that compiles as for a Haswell."""
    command = [str(HASWELL), sys.executable, "-W", "ignore", __file__]
    done = subprocess.run(command, env=os.environ | NARROW, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout)


def fly(name, **how):
    """Return the digest of a flight of a file."""
    import airflock

    scenario = airflock.load(FOLDER / f"{name}.toml", trust=True)
    recording = airflock.simulate(scenario, SEED, **how)
    [scores] = airflock.score(scenario, [SEED], **how).to_dict("records")
    found = sha256(repr(sorted((key, float(value).hex()) for key, value in scores.items())).encode())
    for variable in ("position", "velocity"):
        found.update(recording[variable].values.tobytes())
    return found.hexdigest()[:16]


def search(name):
    """Return what the search of a study finds."""
    import airflock

    with tempfile.TemporaryDirectory() as folder:
        found = airflock.evolve(FOLDER / f"{name}.toml", folder, trust=True)
    return {key: float(value).hex() for key, value in {**found.parameters, "fitness": found.fitness}.items()}


def values(name):
    """Return what is on record of a file."""
    if name.startswith("study_"):
        return {"found": search(name)}
    return {"interpreted": fly(name, **INTERPRETED), "compiled": fly(name, **COMPILED)}


if __name__ == "__main__":
    sys.stdout.write(json.dumps({name: values(name) for name in names()}))
