"""Verbs of the command: options with spellings, types, choices, defaults, help, panel, and the text of the help."""

from typing import Any

import typer.main

from airflock.cli.main import app
from airflock.drones.onboard.node_program import make_parser


def _type_of(kind: Any) -> dict[str, Any]:
    """Return the plain data of one option's type: its name, choices and range where it has them."""
    data: dict[str, Any] = {"name": kind.name}
    if hasattr(kind, "choices"):
        data["choices"] = [str(getattr(each, "value", each)) for each in kind.choices]
    if hasattr(kind, "types"):
        data["parts"] = [_type_of(each) for each in kind.types]
    for key in ("min", "max", "min_open", "max_open", "clamp", "exists", "file_okay", "dir_okay"):
        if hasattr(kind, key):
            data[key] = getattr(kind, key)
    return data


def _plain(value: Any) -> Any:
    """Return a default as plain data; floats keep their bits as text."""
    value = getattr(value, "value", value)  # typer wraps a default that nobody gave
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if type(value).__name__ == "Sentinel" or "UNSET" in repr(value):
        return None
    return repr(value) if isinstance(value, float) else str(value)


def _written(parameter: Any) -> str:
    """Return what a person writes for an option, or the name of an argument in the help."""
    if parameter.param_type_name == "argument":
        return str(parameter.metavar)
    return max(parameter.opts, key=len)


def _parameter(parameter: Any) -> dict[str, Any]:
    """Return the plain data of one option or argument."""
    return {
        "kind": parameter.param_type_name,
        "spellings": [*parameter.opts, *parameter.secondary_opts],
        "type": _type_of(parameter.type),
        "required": parameter.required,
        "multiple": bool(getattr(parameter, "multiple", False)),
        "nargs": parameter.nargs,
        "flag": bool(getattr(parameter, "is_flag", False)),
        "default": _plain(parameter.default),
        "metavar": parameter.metavar,
        "help": getattr(parameter, "help", None),
        "hidden": bool(getattr(parameter, "hidden", False)),
        "panel": _plain(getattr(parameter, "rich_help_panel", None)),
    }


def _verbs(command: Any, name: str) -> dict[str, Any]:
    """Return a verb and its sub-verbs by their full names."""
    text = command.help or ""
    data = {
        name: {
            "panel": _plain(getattr(command, "rich_help_panel", None)),
            "hidden": bool(command.hidden),
            "help": text.splitlines(),
            "examples": [line.strip() for line in text.splitlines() if "airflock " in line],
            "epilog": command.epilog,
            "parameters": {_written(each): _parameter(each) for each in command.params},
            "order": [_written(each) for each in command.params],
            "verbs": list(getattr(command, "commands", {})),
        }
    }
    for verb, inner in getattr(command, "commands", {}).items():
        data |= _verbs(inner, f"{name} {verb}")
    return data


def _node() -> dict[str, Any]:
    """Return the options of the node on board, which argparse reads: the flying computer has no other library."""
    node = make_parser()
    shown = {
        each.dest: {
            "kind": "option" if each.option_strings else "argument",
            "spellings": each.option_strings or [each.dest],
            "type": {"name": getattr(each.type, "__name__", "str") if each.nargs != 0 else "boolean"},
            "required": each.required,
            "multiple": type(each).__name__ == "_AppendAction",
            "default": _plain(each.default),
            "metavar": each.metavar,
            "help": each.help,
        }
        for each in node._actions
    }
    text = f"{node.description}\n{node.epilog}".splitlines()
    examples = [line.strip() for line in text if "airflock" in line]
    return {"help": text, "examples": examples, "parameters": shown, "order": list(shown), "verbs": []}


def take() -> dict[str, Any]:
    """Return the plain data of each verb by its full name, such as `airflock fly prepare`."""
    return _verbs(typer.main.get_command(app), "airflock") | {"python -m airflock.drones.onboard": _node()}
