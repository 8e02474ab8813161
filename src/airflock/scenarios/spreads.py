"""Spreads: tolerances of manufacture, standard deviations in the unit of a number or as a share of it."""

import math
from collections.abc import Mapping
from typing import Any

from airflock.core import Quantity, format_with_unit
from airflock.scenarios import units

OF_IT = "a share of the number such as '10 %'"


class RelativeSpread(float):
    """A standard deviation that is a share of the number itself."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, RelativeSpread) and float(self) == float(other)

    __hash__ = float.__hash__

    @classmethod
    def parse(cls, entry: Any) -> "RelativeSpread | None":
        """That of a text or table such as "10 %"; None where it says another unit, or none."""
        match = units.NUMBER_WITH_UNIT.fullmatch(entry) if isinstance(entry, str) else None
        value, unit = (match[1], match[2]) if match else ("", "")
        if isinstance(entry, Mapping):
            value, unit = entry.get("value"), entry.get("unit")
        if isinstance(value, bool) or not isinstance(unit, str) or units.conversion_factor(unit, "1") in (None, 1.0):
            return None
        try:
            return cls(float(f"{float(value) / 100.0:.12g}"))
        except (TypeError, ValueError):
            return None


def standard_deviation(spread: float, value: float) -> float:
    """The standard deviation of a number."""
    return spread * abs(value) if isinstance(spread, RelativeSpread) else spread


def relative_spread(entry: Any, declared: Any) -> RelativeSpread | None:
    """A spread that is a share of the number; of a number that is a share itself "10 %" is 0.1."""
    relative = isinstance(declared, Quantity) and declared.unit not in ("", "1")
    return RelativeSpread.parse(entry) if relative else None


def with_share_hint(line: str, spread_prefix: str, known: Mapping[str, Any]) -> str:
    """What else may be written, at the end of a line about the unit of a spread."""
    key = line.removeprefix(f"{spread_prefix}.").partition(" ")[0]
    declared = known.get(key) if line.startswith(f"{spread_prefix}.") else None
    return f", or {OF_IT}" if isinstance(declared, Quantity) and declared.unit not in ("", "1") else ""


def check_spreads(where: str, table: Mapping[str, Any], known: Mapping[str, Any]) -> tuple[dict[str, float], list[str]]:
    """Standard deviations in declared units."""
    found, faults = {}, []
    for key, entry in table.items():
        value = entry.get("value", entry) if isinstance(entry, Mapping) else entry
        declared = known.get(key)
        if not isinstance(declared, Quantity):
            faults.append(f"{where}.{key}: unknown number")
        elif isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value < math.inf:
            other = with_share_hint(f"{where}.spread.{key}", f"{where}.spread", known)
            least = format_with_unit("0", declared.unit)
            faults.append(
                f"{where}.{key}.spread = {_told(value)} is not a standard deviation of {least} or more{other}"
            )
        else:
            found[key] = value if isinstance(value, RelativeSpread) else float(value)
    return found, faults


def _told(spread: Any) -> str:
    """A spread as it was written."""
    return f"'{100.0 * spread:g} %'" if isinstance(spread, RelativeSpread) else repr(spread)
