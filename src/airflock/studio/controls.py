"""Controls: what a page needs to know of each parameter to make a slider or a menu of it, from the declarations."""

import math
import shlex
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from airflock.core import Choice, Quantity, declarations, format_with_unit
from airflock.scenarios import FaultEntry, Scenario, fault_declarations, group_declarations, split_key

CONTROL_SECTIONS = ("model", "body", "sensors", "radio", "topology", "wind", "goals", "wing", "metrics")
DEFAULT_SPAN_FACTOR = 4.0  # a slider ends at so many times the preset's value
SLIDER_STEPS = 400  # of a slider


class ParameterControl(NamedTuple):
    """One control: a number with a span, or a choice with options.

    key   : as in a scenario file, such as model.p_rep
    label : name and unit
    hint  : meaning, allowed range and source
    value : of the scenario at hand
    low, high, step : of the slider; nan for a choice
    """

    key: str
    label: str
    hint: str
    value: Any
    low: float = math.nan
    high: float = math.nan
    step: float = math.nan
    options: tuple[str, ...] = ()

    @property
    def is_choice(self) -> bool:
        """Whether this is a menu, not a slider."""
        return bool(self.options)


def scenario_controls(
    scenario: Scenario, default_spans: Mapping[str, tuple[float, float]] | None = None
) -> dict[str, list[ParameterControl]]:
    """Controls by section, in the order in which the paper's parameters are declared; empty sections are left out.

    The law's section is sorted into the parts that the law names, "model: repulsion" and so on. Numbers that a group
    has of its own follow: those that the file names for it, and all of a law of its own.
    usual : spans of sliders by key, as a study of the law has them

    A number that is derived from the rest of the scenario (None) gets no control, nor do lists and texts.
    """
    parts = scenario.model.parts
    part_of = {f"model.{name}": f"model: {part}" for part, names in parts.items() for name in names}
    found: dict[str, list[ParameterControl]] = {f"model: {part}": [] for part in parts}
    for section in CONTROL_SECTIONS:
        record = scenario.parameters if section == "model" else getattr(scenario, section)
        for name, declared, _ in declarations(record):
            value = getattr(record, name)
            key = f"{section}.{name}"
            if isinstance(declared, Quantity) and value is not None:
                made = make_slider(key, declared, value, (default_spans or {}).get(key))
            elif isinstance(declared, Choice):
                hint = _hint_text(declared.meaning, "", declared.source)
                made = ParameterControl(key, name, hint, value, options=declared.options)
            else:
                continue
            found.setdefault(part_of.get(key, section), []).append(made)
    for key, declared, value in group_declarations(scenario):
        if isinstance(declared, Quantity) and value is not None:
            group, section, _ = split_key(key)
            found.setdefault(f"group {group}: {section}", []).append(make_slider(key, declared, value))
    return {part: made for part, made in found.items() if made}


def fault_controls(entries: Sequence[FaultEntry]) -> dict[str, list[ParameterControl]]:
    """Controls of the numbers of each fault of a scenario, in the order of its entries; many kinds have none."""
    found: dict[str, list[ParameterControl]] = {}
    for key, kind, declared, value in fault_declarations(entries):
        if isinstance(declared, Quantity):
            found.setdefault(f"fault {key.split('.')[1]}: {kind}", []).append(make_slider(key, declared, value))
    return found


def make_slider(
    key: str, declared: Quantity, value: float, study_span: tuple[float, float] | None = None
) -> ParameterControl:
    """Slider of a number, over the span of a study or the usual one that is declared, widened to hold the value.

    Without either from 0 to 4 times the value, or as far on both sides of 0, within the declared range.
    """
    usual = study_span or declared.usual
    low, high = (
        (min(usual[0], value), max(usual[1], value)) if usual else slider_span(declared.low, declared.high, value)
    )
    label = format_with_unit(key.rpartition(".")[2], f"({declared.unit})" if declared.unit not in ("", "1") else "")
    hint = _hint_text(declared.meaning, declared.span, declared.source)
    step = _round_step((high - low) / SLIDER_STEPS)
    return ParameterControl(key, label, hint, value, low, high, max(1.0, round(step)) if declared.whole else step)


def slider_span(low: float, high: float, value: float) -> tuple[float, float]:
    """Ends of a slider: inside [low, high], around the value, and not so wide that it cannot be set by hand."""
    reach = DEFAULT_SPAN_FACTOR * abs(value) if value else min(1.0, max(abs(low), abs(high)))
    begin, end = max(low, -reach if low < 0.0 else 0.0), min(high, reach)
    return min(begin, value), max(end, value)


def set_options(settings: Mapping[str, Any]) -> str:
    """Keys and values as options of the command: --set model.p_rep=0.2 ..."""
    return " ".join(f"--set {shlex.quote(f'{key}={_toml_text(value)}')}" for key, value in settings.items())


def _toml_text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value).removesuffix(".0") if isinstance(value, float) else str(value)


def _round_step(step: float) -> float:
    """A step of 1, 2 or 5 times a power of ten, at most as large."""
    if step <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(step))
    return max(digit * power for digit in (1.0, 2.0, 5.0) if digit * power <= step * (1.0 + 1e-9))


def _hint_text(meaning: str, allowed: str, source: str) -> str:
    return "; ".join(part for part in (meaning, allowed and f"allowed {allowed}", source) if part)
