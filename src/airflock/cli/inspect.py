"""Verbs presets, validate and doctor: what there is, whether it is right, and whether this machine can run it."""

from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.doors import from_outside, is_file, read_text
from airflock.errors import AirflockError

PACKAGES = ("numba", "llvmlite", "numpy", "xarray", "h5netcdf", "h5py", "pydantic", "matplotlib", "cma")
EXTRAS = ("numba-cuda", "trimesh", "pymoo", "SALib", "pyarrow", "distributed")  # of extras: cuda, scenes, evolve, ...


def presets(
    name: Annotated[
        str | None, typer.Argument(metavar="PRESET", help="Show one preset in full.", show_default=False)
    ] = None,
    for_speed: Annotated[
        float | None, typer.Option(min=0.1, max=100.0, help="Starting set for this speed, m/s.")
    ] = None,
    as_json: options.Json = False,
) -> None:
    """List the presets, show one as TOML, or derive a starting set for any speed.

    Example: airflock presets --for-speed 12 > mine.toml
    """
    from airflock.scenarios import files

    known = files.presets()
    if for_speed is not None:
        from airflock.scenarios.scaling import starting_set

        typer.echo(starting_set(for_speed), nl=False)
        return
    if name is not None:
        if name not in known and not is_file(name):
            files.load(name)  # complains about a wrong name
        with from_outside(name):
            typer.echo(read_text(known.get(name) or name), nl=False)
        return
    found = {key: str(files.load(key).document.get("title", "")) for key in known}
    if as_json:
        tables.emit_json(found)
        return
    width = max(len(key) for key in found)
    for key, title in found.items():
        typer.echo(f"{key:<{width}}  {title}")


def validate(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE...", help="Scenario files, presets, studies or recordings.")
    ],
    changes: options.Set = None,
    law: options.Law = None,
    trust: options.Trust = False,
) -> None:
    """Check scenario and study files (every fault at once), or fly a recording again and compare the bits.

    Example: airflock validate mine.toml
    """
    changed = options.settings(changes)
    faults: list[str] = []
    for name in files:
        found: list[str] = []
        with options.gathering(found):
            _validate(name, changed, law, trust)
        faults += [fault if name in fault else f"{name}: {fault}" for fault in found]
    options.refuse(faults)


def _validate(name: str, changed: dict[str, Any], law: str | None, trust: bool) -> None:
    if name.lower().endswith(".nc"):
        from airflock.recordings.files import fly_again, load_recording

        same, differences = fly_again(load_recording(name), law)
        for line in differences:
            tables.say(f"note: {name}: {line}")
        if not same:
            reason = "see the notes above" if differences else "although nothing that should matter differs"
            raise AirflockError(f"{name}: flown again, the positions differ, {reason}")
        typer.echo(f"{name}: flown again with the same bits")
        return
    from airflock.engine.simulate import plan_of
    from airflock.evolve.study import is_study, load_study
    from airflock.scenarios.files import load

    if is_study(name):
        if law is not None:
            raise AirflockError(f"{name}: is a study; --law is for scenarios and recordings")
        study = load_study(name, settings=changed, trust=trust)
        plan_of(study.scenario)
        what = f"{len(study.space.axes)} parameters of {study.scenario.name} vary"
        typer.echo(f"{name}: valid study; {what}; begin it with airflock evolve {name} --out DIR")
        return
    found = load(name, changed, law, trust=trust)
    plan_of(found)  # probes the rules
    for note in found.notes:
        tables.say(f"note: {name}: {note}")
    typer.echo(f"{name}: valid; {found.model.name}, {found.agents} agents, {found.flight.duration:g} s")


def doctor(
    clear: Annotated[
        bool, typer.Option("--clear-cache", help="Remove all compiled drivers, and do nothing else.")
    ] = False,
    as_json: options.Json = False,
) -> None:
    """Show versions, cores, extras, GPUs and cache, and fly a ten-second self-check on each device.

    Example: airflock doctor
    """
    if clear:
        from airflock.engine.store import clear_cache, usual_folder

        count, size = clear_cache()
        if as_json:
            tables.emit_json({"cache": str(usual_folder()), "removed": count, "freed_mb": round(size / 1e6, 1)})
        else:
            typer.echo(f"{usual_folder()}: {count} drivers removed, {size / 1e6:.1f} MB")
        return
    import platform
    import shutil
    import time
    from importlib.metadata import PackageNotFoundError, version

    from airflock import __version__
    from airflock.engine.simulate import score_flight
    from airflock.engine.store import cache_folder, cache_trouble, drivers, usual_folder
    from airflock.engine.threads import cores
    from airflock.recordings.flights import processor
    from airflock.scenarios.files import load

    found: dict[str, Any] = {"airflock": __version__, "python": platform.python_version(), "processor": processor()}
    found |= {"cores": cores(), "cache": str(cache_folder())}
    trouble = cache_trouble(usual_folder())
    found |= {"cache_note": f"for this process only: {trouble}"} if trouble else {}
    kept = drivers(cache_folder())
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
    found["self_check"] = "passed" if healthy else "failed"
    found |= _gpu(scenario, values)
    healthy = healthy and found.get("gpu_self_check") != "failed"
    if as_json:
        tables.emit_json(found)
    else:
        for key, text in found.items():
            typer.echo(f"{key:<16} {text}")
    if not healthy:
        raise AirflockError(f"self-check failed: {values}")


def _gpu(scenario: Any, known: dict[str, float]) -> dict[str, Any]:
    """What GPUs there are, or why none can be used; and the same flight on the first of them."""
    import time

    from airflock.engine.cuda.device import describe, trouble
    from airflock.engine.simulate import score_flights

    fault = trouble()
    if fault is not None:
        return {"gpu": fault}
    found: dict[str, Any] = {}
    for number, device in enumerate(describe()):
        text = "{name}, compute capability {compute_capability}, {multiprocessors} multiprocessors, {free_gb} of "
        found[f"gpu_{number}" if number else "gpu"] = (text + "{memory_gb} GB free").format(**device)
    for name in ("first", "second"):
        began = time.perf_counter()
        values = score_flights([scenario], [0], device="cuda")[0]
        found[f"gpu_{name}_flight_s"] = round(time.perf_counter() - began, 4)
    near = all(abs(values[key] - known[key]) < 0.02 * max(1.0, abs(known[key])) for key in ("phi_vel", "r_min_mean"))
    found["gpu_self_check"] = "passed" if near else "failed"
    return found
