"""Probe: call every rule of a model once as plain Python, so that an error names the author's own file and line."""

import math
import traceback
from bdb import BdbQuit
from collections.abc import Callable, Mapping
from functools import cache
from inspect import signature
from typing import Any

from airflock.core import (
    COMPONENTS,
    FAULT_RULES,
    PAIR,
    RULES,
    SURFACE,
    VOCABULARY,
    Body,
    Fault,
    Model,
    Own,
    Percept,
    Radio,
    Sensor,
    Topology,
    argument_names,
    law,
)
from airflock.parts.aero import descent, wing as wings
from airflock.support import RuleError, describe_error

VALUES = dict(zip([*PAIR, *(name for name in SURFACE if name not in PAIR)], (
    3.0, -4.0, 0.0, 5.0, 25.0, 0.6, 0.8, 0.0, 1.0, 1.0, 2.0, 0.0, 0.6, 0.8, 0.0, 0.8, 0.6, 0.0, 0.2, 1.0, 0.0, 1.0,
    7.0, 0.0, 1.0, 0.0,
), strict=True))  # fmt: skip


def probe_model(model: Model, parameters: Any) -> None:
    """Raise a RuleError that names file, line and error, if a rule fails or returns something else than it declares."""
    given: dict[str, Any] = {**VALUES, "p": parameters, "period": 0.2, "percept": Percept(1.0, 10.0, 20.0, 0.0)}
    given["wing"], given["aero"] = wings.Parameters(segments="5"), descent.Parameters()
    given["own"] = Own(1.0, 2.0, 0.0, 0.4472, 0.8944, 0.0)
    # Neighbour and boundary rules first: their answers are what the deciding rule is called with.
    for kind, rule in (("reach", model.reach), ("neighbour", model.neighbour), ("boundary", model.boundary)):
        if rule is not None:
            law.check_rule(rule)
            answer = _call(rule, kind, given, model.name)
            if kind != "reach":
                record: Any = model.Sums if kind == "neighbour" else model.Walls
                _same_length(rule, answer, record, model.name)
                if getattr(answer, "_fields", None) != record._fields:
                    fields = ", ".join(record._fields)
                    told = f"{model.name}.{kind} must return {record.__name__}({fields}), not a plain tuple"
                    raise RuleError(f"{_place(rule)}: {told}")
                given["sums" if kind == "neighbour" else "walls"] = answer
    for word, record in (("sums", model.Sums), ("walls", model.Walls)):
        if word not in given and record is not None:
            given[word] = record(*([0.0] * len(record._fields)))
    if model.Memory is not None:
        given["memory"] = model.Memory()
    if model.flock is not None:
        law.check_rule(model.flock)
        given["shared"] = _shared(model, given)
    if model.steer is not None:
        law.check_rule(model.steer)
    if model.added is not None:
        law.check_rule(model.added.decide)
        _call(model.added.decide, "decide", given, model.added.name)
    _answer(model.decide, "decide", given, model.name, "x", "y", "z", *["Memory(...)"] * (model.Memory is not None))


@cache
def probe_fault(kind: Fault) -> None:
    """Probe the rules of a kind of fault, as `probe_model` does."""
    names = {name for rule in kind.rules for name in VOCABULARY[rule]}
    given: dict[str, Any] = {name: 0.5 + 0.1 * k for k, name in enumerate(sorted(names))}
    given["f"] = kind.Parameters()
    for name, rule in kind.rules.items():
        law.check_rule(rule)
        answer = _call(rule, name, given, kind.name)
        count, what = FAULT_RULES[name]
        found = len(answer) if isinstance(answer, tuple) else 1
        if found != count:
            raise RuleError(f"{_place(rule)}: {kind.name}.{name} returns {found} of {count} numbers: {what}")


@cache
def probe_sensor(sensor: Sensor) -> None:
    """Probe the rule of a sensor, as `probe_model` does."""
    kind = "measure" if sensor.error is None else "error"
    rule = sensor.measure or sensor.error
    assert rule is not None
    given: dict[str, Any] = {name: 0.5 + 0.01 * k for k, name in enumerate(VOCABULARY[kind])}
    given["s"], given["memory"] = sensor.Parameters(), sensor.Memory() if sensor.Memory is not None else None
    parts = ("dx", "dv") if kind == "error" else (*COMPONENTS, *["Memory(...)"] * (sensor.Memory is not None))
    answer = _answer(rule, kind, given, sensor.name, *parts)
    if sensor.Memory is not None:
        _same_length(rule, answer[-1], sensor.Memory, sensor.name)


@cache
def probe_body(body: Body, chosen: tuple[tuple[str, str], ...]) -> None:
    """Probe the rule of a body with these choices of its parameters, as `probe_model` does."""
    given: dict[str, Any] = {name: 9.0 + 0.1 * k for k, name in enumerate(VOCABULARY["move"])}
    given |= {"dt": 0.01, "b": body.Parameters(**dict(chosen)), "wing": wings.Parameters(segments="5")}
    given["memory"] = body.Memory() if body.Memory is not None else None
    parts = ("x", "y", "z", *["Memory(...)"] * (body.Memory is not None))
    answer = _answer(body.move, "move", given, body.name, *parts)
    if body.Memory is not None:
        _same_length(body.move, answer[3], body.Memory, body.name)


@cache
def probe_radio(radio: Radio) -> None:
    """Probe the rules of a radio, as `probe_model` does."""
    for kind in RULES:
        rule = getattr(radio, kind)
        if rule is None:
            continue
        given: dict[str, Any] = {name: 0.5 + 0.01 * place for place, name in enumerate(VOCABULARY[kind])}
        given |= {"fast": 2, "slow": 1, "k": radio.Parameters()}
        given["packet"] = radio.Packet() if radio.Packet is not None else None
        receives = ("1.0 or 0.0", *["Packet(...)"] * (radio.Packet is not None))
        wanted = {"receive": receives, "see": COMPONENTS, "carry": ("x", "y", "z")}.get(kind, ("one number",))
        answer = _answer(rule, kind, given, radio.name, *wanted)
        if kind == "receive" and radio.Packet is not None:
            _same_length(rule, answer[1], radio.Packet, radio.name)


@cache
def probe_topology(kind: Topology) -> None:
    """Probe the rule of a topology, which marks each of two others by 1.0 or 0.0 as met or not."""
    law.check_rule(kind.meet)
    rows = {name: [0.5, 2.0] for name in VOCABULARY["meet"]}
    rows |= {"hidden": [0.0, 1.0], "met": [2.0, 2.0], "heap": [1e30] * 2, "weak": [1e30] * 2}
    given: dict[str, Any] = {**rows, "n": 2, "t": kind.Parameters() if kind.Parameters is not None else None}
    if _call(kind.meet, "meet", given, kind.name) is not None:
        raise RuleError(f"{_place(kind.meet)}: {kind.name}.meet must return nothing; it fills met")
    if not set(rows["met"]) <= {0.0, 1.0}:
        raise RuleError(f"{_place(kind.meet)}: {kind.name}.meet must fill met with 1.0 or 0.0 for each of n")


def _shared(model: Model, given: dict[str, Any]) -> Any:
    """Run the rule of the whole flock for three agents; returns Shared of the first one."""
    assert model.flock is not None and model.workspace is not None and model.Shared is not None
    shapes = scratch_shapes(model.workspace, 3, given)
    work = type(shapes)(*[[[0.0] * columns for _ in range(rows)] for rows, columns in shapes])
    fields = model.Shared._fields
    shared = model.Shared(*[[0.0] * 3 for _ in fields])
    level = dict.fromkeys(("z", "vx", "vy", "vz"), [0.1, 0.2, 0.3])
    places = {"x": [0.0, -2.0, -2.5], "y": [0.0, 2.0, -2.1], **level}
    _call(model.flock, "flock", {**given, **places, "n": 3, "work": work, "shared": shared}, model.name)
    return model.Shared(*[column[0] for column in shared])


def scratch_shapes(workspace: Callable[..., Any], agents: int, records: Mapping[str, Any]) -> Any:
    """Shapes of the scratch for so many agents: what `workspace` returns for those of n and the records it asks for."""
    given = {**records, "n": agents}
    return workspace(*(given[name] for name in signature(workspace).parameters))


def _answer(rule: Callable[..., Any], kind: str, given: dict[str, Any], owner: str, *parts: str) -> Any:
    """Call a rule on a probe; its answer must have these parts, and a single part is no tuple."""
    law.check_rule(rule)
    answer = _call(rule, kind, given, owner)
    if (len(answer) if isinstance(answer, tuple) else 1) != len(parts):
        raise RuleError(f"{_place(rule)}: {owner}.{kind} must return {', '.join(parts)}")
    return answer


def _call(rule: Callable[..., Any], kind: str, given: dict[str, Any], owner: str) -> Any:
    names = argument_names(rule, kind, owner)
    missing = [name for name in names if name not in given]
    if missing:
        raise RuleError(f"{_place(rule)}: {owner}.{kind} asks for {missing[0]}, which this model does not provide")
    try:
        answer = rule(*(given[name] for name in names))
    except BdbQuit:  # the reader left the debugger: no fault of the rule
        raise
    except Exception as fault:  # a user's rule may fail in any way; show where
        frames = [
            frame
            for frame in traceback.extract_tb(fault.__traceback__)
            if frame.filename not in (__file__, "<string>")  # text of a dataclass
        ]
        spot = f"{frames[-1].filename}:{frames[-1].lineno}" if frames else _place(rule)
        raise RuleError(f"{spot}: {owner}.{kind} fails on a probe: {describe_error(fault)}") from fault
    numbers = answer if isinstance(answer, tuple) else (answer,)
    for number in numbers:
        if isinstance(number, (int, float)) and not math.isfinite(number):
            raise RuleError(f"{_place(rule)}: {owner}.{kind} returns {number} on a probe; use FAR instead of infinity")
    return answer


def _same_length(rule: Callable[..., Any], answer: Any, record: Any, owner: str) -> None:
    if not hasattr(record, "_fields"):
        raise RuleError(f"{_place(rule)}: {owner}: {record.__name__} must be a NamedTuple")
    if not isinstance(answer, tuple) or len(answer) != len(record._fields):
        raise RuleError(f"{_place(rule)}: {owner}.{rule.__name__} must return {record.__name__}{record._fields}")


def _place(rule: Callable[..., Any]) -> str:
    return f"{rule.__code__.co_filename}:{rule.__code__.co_firstlineno}"
