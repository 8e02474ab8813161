"""Spreads: tolerances of manufacture, standard deviations in the unit of a number or as a share of it."""

import math
from collections.abc import Mapping
from typing import Any

from airflock.core.parameters import Quantity, with_unit
from airflock.scenarios import units

OF_IT = "a share of the number such as '10 %'"


class Share(float):
    """A standard deviation that is a share of the number itself."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Share) and float(self) == float(other)

    __hash__ = float.__hash__

    @classmethod
    def written(cls, given: Any) -> "Share | None":
        """That of a text or table such as "10 %"; None where it says another unit, or none."""
        match = units.NUMBER.fullmatch(given) if isinstance(given, str) else None
        value, unit = (match[1], match[2]) if match else ("", "")
        if isinstance(given, Mapping):
            value, unit = given.get("value"), given.get("unit")
        if isinstance(value, bool) or not isinstance(unit, str) or units.factor(unit, "1") in (None, 1.0):
            return None
        try:
            return cls(float(f"{float(value) / 100.0:.12g}"))
        except (TypeError, ValueError):
            return None


def deviation(spread: float, value: float) -> float:
    """The standard deviation of a number."""
    return spread * abs(value) if isinstance(spread, Share) else spread


def share_of(given: Any, declared: Any) -> Share | None:
    """A spread that is a share of the number; of a number that is a share itself "10 %" is 0.1."""
    relative = isinstance(declared, Quantity) and declared.unit not in ("", "1")
    return Share.written(given) if relative else None


def or_share(line: str, apart: str, known: Mapping[str, Any]) -> str:
    """What else may be written, at the end of a line about the unit of a spread."""
    key = line.removeprefix(f"{apart}.").partition(" ")[0]
    declared = known.get(key) if line.startswith(f"{apart}.") else None
    return f", or {OF_IT}" if isinstance(declared, Quantity) and declared.unit not in ("", "1") else ""


def checked(where: str, given: Mapping[str, Any], known: Mapping[str, Any]) -> tuple[dict[str, float], list[str]]:
    """Standard deviations in declared units."""
    found, faults = {}, []
    for key, entry in given.items():
        value = entry.get("value", entry) if isinstance(entry, Mapping) else entry
        declared = known.get(key)
        if not isinstance(declared, Quantity):
            faults.append(f"{where}.{key}: unknown number")
        elif isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value < math.inf:
            other = or_share(f"{where}.spread.{key}", f"{where}.spread", known)
            least = with_unit("0", declared.unit)
            faults.append(
                f"{where}.{key}.spread = {_told(value)} is not a standard deviation of {least} or more{other}"
            )
        else:
            found[key] = value if isinstance(value, Share) else float(value)
    return found, faults


def _told(spread: Any) -> str:
    """A spread as it was written."""
    return f"'{100.0 * spread:g} %'" if isinstance(spread, Share) else repr(spread)
