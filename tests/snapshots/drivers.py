"""Texts of the drivers of every preset: SHA-256 and length, byte by byte.

`python tests/snapshots/run.py drivers --show PRESET` prints the texts themselves, so that those of two checkouts can be
compared with diff.
"""

from contextlib import suppress
from functools import cache
from hashlib import sha256

import airflock
from airflock.engine import driver_text, plan_of
from inside import cuda_cells, cuda_crowd, kernel_text, layout_of, no_cuda, passes_driver

MANY = 8000  # agents of one big flock: neighbours and order parameters by cells, where its law allows it


@cache
def _cpu(plan):
    return passes_driver.flight_driver_text(plan)


@cache
def _cuda(plan, shape):
    return kernel_text(plan, shape)


@cache
def _crowd(plan):
    return cuda_cells.large_flock_text(plan)


def texts(name):
    """Return the texts of the drivers of a preset by what they are for."""
    scenario = airflock.load(name)
    single, double = (plan_of(scenario, precision=bits) for bits in (32, 64))
    found = {
        "single": driver_text(scenario),
        "single, recording": _cpu(plan_of(scenario, record=True)),
        "single, given start": _cpu(plan_of(scenario, given_start=True)),
        "single, absence": _cpu(plan_of(scenario, absence=True)),
        "double": driver_text(scenario, precision=64),
        "double, recording": _cpu(plan_of(scenario, precision=64, record=True)),
    }
    if no_cuda(single, scenario.agents) is None:
        for label, plan, flocks in (("one flock", single, 1), ("1000 flocks", single, 1000), ("double", double, 1)):
            found[f"GPU, {label}"] = _cuda(plan, layout_of(plan, scenario.agents, flocks))
    with suppress(airflock.AirflockError):  # so many do not fit everywhere
        big = airflock.load(name, {"agents": MANY})
        plan = plan_of(big)
        if plan.grid:
            found[f"{MANY} agents"] = driver_text(big)
            if cuda_crowd.cell_plan_error(plan, 1000) is None:
                found[f"GPU, {MANY} agents"] = _crowd(plan)
    return found


def take():
    """Return digest and length of every text by preset."""
    return {
        name: {label: f"{sha256(text.encode()).hexdigest()} {len(text)}" for label, text in texts(name).items()}
        for name in airflock.presets()
    }


def show(name):
    """Return the different texts of a preset, each under a line that says what it is for."""
    labels = {}
    for label, text in texts(name).items():
        labels.setdefault(text, []).append(label)
    return "\n".join(f"# {'; '.join(names)}\n{text}" for text, names in labels.items())
