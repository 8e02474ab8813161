"""Options of an import that cannot be meant, refused all at once."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from airflock.recordings.imports import headers
from airflock.recordings.imports.track import ACCEPTABLE_ERRORS, ImportOptions, ImportReport
from airflock.support import is_number


def check_options(
    options: ImportOptions, findings: ImportReport, numbers: Mapping[str, Any], precision: Any, accept: Any, origin: Any
) -> None:
    """Refuse options that cannot be meant, all at once. Raises RecordingError."""
    faults = findings.faults
    known = {
        "unit": ("", *headers.LENGTH_UNITS, *headers.PIXEL_UNITS),
        "time_unit": ("", *headers.TIME_UNITS, "frames"),
    }
    for name, allowed in {**known, "axes": ("", "enu", "ned"), "decimal": (".", ",")}.items():
        value = getattr(options, name)
        if not isinstance(value, str) or value not in allowed:
            faults.append(f"{name} = {value!r} is none of {', '.join(text for text in allowed if text)}")
    given = {name: getattr(options, name) for name in ("keypoint", "delimiter")}
    faults += [f"{name} = {value!r} is no text" for name, value in given.items() if not isinstance(value, str)]
    if not isinstance(options.map, Mapping):
        faults.append(f'map = {options.map!r}: give targets with expressions, such as {{"t": "time_us*1e-6"}}')
    else:
        said = [(key, text) for key, text in options.map.items() if not isinstance(text, str)]
        faults += [f"map: {key} = {text!r} is no text; an expression is one" for key, text in said]
    for name, number in {"scale": options.scale, "fps": options.fps, "rate": numbers["rate"]}.items():
        if number is not None and not (is_number(number) and 0.0 < number < 1e9):
            faults.append(f"{name} = {_shown(number)} must be a number above 0")
    if not (is_number(numbers["bridge"]) and 0.0 <= numbers["bridge"] < 1e9):
        faults.append(f"bridge = {_shown(numbers['bridge'])} s must be a number, 0 or more")
    for name in ("begin", "end"):
        if numbers[name] is not None and not (is_number(numbers[name]) and np.isfinite(numbers[name])):
            faults.append(f"{name} = {_shown(numbers[name])} is not a time in s")
    if not is_number(precision) or precision not in (32, 64):
        faults.append(f"precision = {precision} is none of 32, 64")
    if origin is not None and not _is_origin(origin):
        faults.append(f"origin = {origin!r} is not (latitude, longitude, height) in degrees, degrees and m")
    kinds = [accept] if isinstance(accept, str) or not isinstance(accept, Iterable) else list(accept)
    faults += [
        f"accept = {kind} is none of {', '.join(ACCEPTABLE_ERRORS)}"
        for kind in kinds
        if str(kind) not in ACCEPTABLE_ERRORS
    ]
    findings.raise_errors()


def _shown(value: Any) -> str:
    return f"{value:g}" if is_number(value) else repr(value)


def _is_origin(given: Any) -> bool:
    """Whether something is a latitude, a longitude and a height."""
    numbers = list(given) if isinstance(given, Iterable) else []
    sound = len(numbers) == 3 and all(is_number(number) and np.isfinite(number) for number in numbers)
    return sound and abs(numbers[0]) <= 90.0 and abs(numbers[1]) <= 360.0
