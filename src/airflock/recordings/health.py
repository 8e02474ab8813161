"""Self-check of this machine: versions, processor, GPUs, and the same short flight on each device."""

import platform
import shutil
import time
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from airflock import __version__
from airflock.engine import score_flight, score_flights
from airflock.scenarios import Scenario, load
from airflock.support import (
    available_cores,
    cache_folder,
    cache_folder_error,
    default_cache_folder,
    gpu as gpu,
    list_drivers,
    processor_name,
)

PACKAGES = ("numba", "llvmlite", "numpy", "xarray", "h5netcdf", "h5py", "typer", "matplotlib", "cma")
EXTRAS = ("numba-cuda", "trimesh", "pymoo", "SALib", "pyarrow", "distributed")  # of extras: cuda, scenes, evolve, ...


def doctor() -> dict[str, Any]:
    """Report versions, processor, GPUs and cache of this machine, and run a ten-second self-check on each device.

    Returns
    -------
    dict
        Names and findings. `self_check` (and `gpu_self_check` where there is a GPU) is "passed" or "failed";
        `first_flight_s` and `second_flight_s` are s, `cache_free_gb` is GB, `cache_mb` is MB.

    Raises
    ------
    AirflockError
        Where this machine cannot fly at all: the first flight of the self-check is refused.

    Examples
    --------
    >>> import airflock
    >>> airflock.doctor()["self_check"]
    'passed'
    """
    found: dict[str, Any] = {
        "airflock": __version__,
        "python": platform.python_version(),
        "processor": processor_name(),
    }
    found |= {"cores": available_cores(), "cache": str(cache_folder())}
    trouble = cache_folder_error(default_cache_folder())
    found |= {"cache_note": f"for this process only: {trouble}"} if trouble else {}
    kept = list_drivers(cache_folder())
    found |= {"cache_drivers": len(kept), "cache_mb": round(sum(size for _, size, _ in kept) / 1e6, 1)}
    found["cache_free_gb"] = round(shutil.disk_usage(cache_folder()).free / 1e9, 1)
    for name in (*PACKAGES, *EXTRAS):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    began = time.perf_counter()
    scenario = load("vasarhelyi_2018/4ms", {"duration": 10.0})
    values = score_flight(scenario, 0)
    found["first_flight_s"] = round(time.perf_counter() - began, 3)
    began = time.perf_counter()
    again = score_flight(scenario, 0)
    found["second_flight_s"] = round(time.perf_counter() - began, 4)
    healthy = values == again and 0.5 < values["phi_vel"] < 5.0 and values["r_min"] > 0.0
    found["self_check"] = "passed" if healthy else f"failed: {values}"
    return found | _gpu(scenario, values)


def _gpu(scenario: Scenario, known: dict[str, float]) -> dict[str, Any]:
    """Report the GPUs, or why none can be used, and the same flight on the first of them."""
    reason = gpu.unavailable_reason()
    if reason is not None:
        return {"gpu": reason}
    found: dict[str, Any] = {}
    for number, device in enumerate(gpu.describe_gpus()):
        text = "{name}, compute capability {compute_capability}, {multiprocessors} multiprocessors, {free_gb} of "
        found[f"gpu_{number}" if number else "gpu"] = (text + "{memory_gb} GB free").format(**device)
    for name in ("first", "second"):
        began = time.perf_counter()
        values = score_flights([scenario], [0], device="cuda")[0]
        found[f"gpu_{name}_flight_s"] = round(time.perf_counter() - began, 4)
    near = all(abs(values[key] - known[key]) < 0.02 * max(1.0, abs(known[key])) for key in ("phi_vel", "r_min_mean"))
    found["gpu_self_check"] = "passed" if near else f"failed: {values}"
    return found
