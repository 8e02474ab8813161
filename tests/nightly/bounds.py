"""Every preset flown compiled with each index checked: no rule and no stage may read or write beside its array.

    python tests/nightly/bounds.py FOLDER

Each preset flies with its own agents, with two and with one alone, to a second or 40 motion steps (whichever is more),
recorded and measured again, at both precisions for the first of each law. What is done stands in FOLDER/bounds.csv, so
that a run that was cut off goes on. Compiled code lies in a cache of its own, since its text is that of the usual one.
"""

import csv
import os
import sys
from pathlib import Path

FIELDS = ("preset", "precision", "agents", "steps", "result")


def main(folder: Path) -> int:
    """Fly what is not done yet; the status is 1 if an index was out of bounds."""
    os.environ["NUMBA_BOUNDSCHECK"] = "1"  # read when Numba is imported
    os.environ["AIRFLOCK_CACHE"] = str(folder / "cache")
    import numba

    import airflock
    from airflock.support.errors import AirflockError

    assert numba.config.BOUNDSCHECK == 1
    table = folder / "bounds.csv"
    done = {}
    if table.exists():
        with table.open(newline="", encoding="utf-8") as file:
            done = {(row["preset"], row["precision"], row["agents"]): row["result"] for row in csv.DictReader(file)}
    laws: set[str] = set()
    with table.open("a", newline="", encoding="utf-8") as file:
        rows = csv.DictWriter(file, FIELDS)
        if not done:
            rows.writeheader()
        for name in airflock.presets():
            law = name.partition("/")[0]
            for precision in (32,) if law in laws else (32, 64):
                for agents in (None, 2, 1):
                    key = (name, str(precision), str(agents or "own"))
                    if key not in done:
                        try:
                            steps = flown(airflock, name, precision, agents)
                            result = "in bounds"
                        except IndexError as fault:
                            steps, result = 0, f"out of bounds: {fault}"
                        except AirflockError as fault:  # a display of one agent, a formation of one
                            steps, result = 0, f"does not fly: {str(fault).splitlines()[0]}"
                        done[key] = result
                        rows.writerow(dict(zip(FIELDS, (*key, steps, result), strict=True)))
                        file.flush()
                        print(*key, result, flush=True)
            laws.add(law)
    out = sum(result.startswith("out") for result in done.values())
    flew = sum(result == "in bounds" for result in done.values())
    print(f"{flew} flights of {len(laws)} laws with every index checked, {out} out of bounds")
    return int(out > 0)


def flown(airflock, name: str, precision: int, agents: int | None) -> int:
    """Fly a preset and measure its recording; motion steps flown."""
    scenario = airflock.load(name)
    dt = scenario.flight.dt
    steps = max(40, round(1.0 / dt))
    settings = {"duration": steps * dt, "metrics.period": min(scenario.metrics.period, 0.5 * steps * dt)}
    settings |= {} if agents is None else {"agents": agents}
    recording = airflock.simulate(airflock.load(name, settings), seed=1, precision=precision)
    airflock.score(recording)
    return steps


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]).resolve()))
