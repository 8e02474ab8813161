"""What `infer` found: laws with their numbers, the one that explains the tracks, and how sure that is."""

import datetime
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.infer.bootstrap import Corrected
from airflock.estimate.infer.candidates import Candidate
from airflock.estimate.infer.candidates import Number as Sought
from airflock.estimate.infer.fit import Fit
from airflock.estimate.infer.flights import Noise
from airflock.estimate.infer.likelihood import Model
from airflock.estimate.infer.maps import Maps
from airflock.estimate.infer.predictive import Check
from airflock.estimate.infer.tracks import Scale
from airflock.scenarios.families import Given
from airflock.scenarios.making import make
from airflock.scenarios.scenario import Scenario
from airflock.support.errors import AirflockError

Array = NDArray[np.float64]
SURE = 2.0  # standard errors by which a law must predict better than going straight on, and
MOST = 0.75  # share of the spans in which it must
APART = 2.0  # standard errors by which the best law must be ahead of the second
SIMPLER = 1.0  # standard errors within which a law of fewer numbers is the better explanation
EDGE = 0.01  # of a range: an end nearer to the end of the range counts as no limit


@dataclass(frozen=True)
class Number:
    """A number of a law with its intervals; an end of one is None where the tracks set no limit.

    low, high   : 95 % interval of this number alone
    least, most : wider interval; those of all numbers of the law hold together in 95 %
    """

    key: str
    value: float
    low: float | None
    high: float | None
    unit: str
    least: float | None = None
    most: float | None = None


@dataclass
class Law:
    """How well one law explains the tracks.

    gain, error : log-likelihood of held-out steps above that of going straight on, and its standard error
    ahead       : share of spans in which it predicts better
    price       : gain that so many numbers bring by chance: half of each times log(steps) (Schwarz 1978)
    criterion   : Akaike's, of the fit, below that of going straight on; negative is better
    inside      : share of held-out differences within the 95 % that are predicted
    missed      : share of what is explained with a free answer to neighbours beside the law that it leaves over, 0 to 1
    numbers     : fitted; with intervals for the best law alone
    """

    name: str
    gain: float
    error: float
    ahead: float
    price: float
    criterion: float
    inside: float
    missed: float
    numbers: dict[str, Number]
    candidate: Candidate
    fit: Fit
    maps: Maps
    surprise: Array


@dataclass
class Inferred:
    """What infer found: laws from best to worst, the one that explains the tracks if any does, and how sure that is.

    best   : None where no law predicts better than going straight on
    steps  : individual steps that were predicted; fitted: frames on which laws were fitted, of all frames
    check  : flights of the best law against the tracks
    """

    laws: list[Law]
    best: Law | None
    verdict: str
    steps: int
    fitted: tuple[int, int]
    scale: Scale
    individuals: int
    noise: Noise | None = None
    check: Check | None = None
    settings: Mapping[str, float] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)

    def document(self) -> dict[str, Any]:
        """A scenario file's content: the best law with its numbers; raises AirflockError where there is none."""
        if self.best is None:
            raise AirflockError(f"infer: {self.verdict}; nothing can be written")
        scenario = self.best.candidate.scenario
        found: dict[str, Any] = {k: dict(v) if isinstance(v, Mapping) else v for k, v in scenario.document.items()}
        found.pop("published", None)
        found["title"] = f"{self.best.name}, inferred from tracks of {self.individuals} individuals"
        found |= {"agents": self.individuals, "duration": 120.0, "dt": scenario.flight.dt}
        for key, value in self.settings.items():
            section, _, name = key.partition(".")
            entry: dict[str, Any] = {"value": _short(value), "source": self.sources[key]}
            found.setdefault(section, {})[name] = entry
        if "arena" not in found.get("world", {}) or found["world"]["arena"] == "none":
            found["start"] = {
                "kind": "ball", "radius": _short(max(0.5 * self.scale.far, 1e-3)), "speed": _short(self.scale.speed),
                "separation": 0.0,
            }  # fmt: skip
        else:
            found["start"] = {"kind": "arena", "speed": _short(self.scale.speed), "separation": 0.0}
        return found

    def scenario(self) -> Scenario:
        """The best law as a scenario that flies."""
        document = self.document()
        assert self.best is not None
        own = self.best.candidate.scenario
        given = Given(law=own.model, vehicle=own.vehicle, sensor=own.sensor)
        return make(document, f"{self.best.name}, inferred", given=given)


def verdict_of(laws: list[Law]) -> tuple[Law | None, str]:
    """The law that explains the tracks, if one does, and the line that says so.

    Of laws that foretell as well within a standard error it is that with the fewest numbers (Breiman et al. 1984).
    """
    first = laws[0]
    if not _explains(first):
        return None, f"none of these explains the tracks better than going straight on{_perhaps(first)}"
    as_well = [law for law in rivals(laws, SIMPLER) if _explains(law)]
    best = min([first, *as_well], key=lambda law: len(law.numbers))  # of equally many the first
    missed = (
        f"; a free answer to neighbours would explain {best.missed:.0%} of the whole beside it"
        if best.missed > 0.05
        else ""
    )
    if best is not first:
        few, many = f"{best.name} explains the tracks with {len(best.numbers)} numbers", len(first.numbers)
        return best, f"{few} as well as {first.name} with {many}{missed}"
    if beside := rivals(laws)[:1]:
        return best, f"{best.name} explains the tracks best, but {beside[0].name} cannot be told from it{missed}"
    return best, f"{best.name} explains the tracks best{missed}"


def _perhaps(law: Law) -> str:
    """What is said of a law that is ahead in most spans, but by gains that differ too much to be sure of."""
    if law.gain <= law.price or law.ahead < MOST:
        return ""
    return (
        f" for sure: {law.name} is ahead in {law.ahead:.0%} of the spans, but its gain of {law.gain:.0f} is less than "
        f"{SURE:g} standard errors ({law.error:.0f}); longer tracks would tell"
    )


def _explains(law: Law) -> bool:
    """Whether a law foretells better than going straight on, and than so many numbers would by chance."""
    return law.gain > max(SURE * law.error, law.price) and law.ahead >= MOST


def rivals(laws: list[Law], apart: float = APART) -> list[Law]:
    """Laws that cannot be told from the first, which explains the tracks best, by what each foretells.

    apart : standard errors by which the first is ahead of all others
    """
    found = []
    for law in laws[1:]:
        ahead = law.surprise - laws[0].surprise
        if ahead.sum() < apart * float(np.sqrt(len(ahead)) * ahead.std(ddof=1)):
            found.append(law)
    return found


def set_numbers(found: Inferred, model: Model, corrected: Corrected) -> None:
    """Give the best law its corrected numbers with their intervals, and the scenario file what it is to say of them."""
    assert found.best is not None
    numbers: dict[str, Number] = {}
    for k, n in enumerate(model.numbers[: model.named]):
        ends = [end for low, high in (corrected.alone, corrected.joint) for end in (_low(n, low[k]), _high(n, high[k]))]
        numbers[n.key] = Number(n.key, n.value(corrected.place[k]), ends[0], ends[1], n.unit, ends[2], ends[3])
    noise = corrected.noise
    known = {n.column: (n.key, n.unit) for n in found.best.candidate.noises}
    if found.best.candidate.body_noise >= 0:
        known[found.best.candidate.body_noise] = ("body.noise", "m^2/s^3")
    if noise.column in known:
        key, unit = known[noise.column]
        (low, high), (least, most) = corrected.noises
        numbers[key] = Number(key, noise.law, low, high, unit, least, most)
    found.best.numbers, found.noise = numbers, noise
    today = datetime.date.today().isoformat()
    found.settings = {key: number.value for key, number in numbers.items()}
    found.sources = {key: f"infer, {today}: {interval(number)}" for key, number in numbers.items()}


def _low(number: Sought, place: float) -> float | None:
    return number.value(place) if place > EDGE else None


def _high(number: Sought, place: float) -> float | None:
    return number.value(place) if place < 1.0 - EDGE else None


def interval(number: Number) -> str:
    """The 95 % interval of a number by itself, in words."""
    return (
        f"95 % in {between(number.low, number.high)}"
        if number.low is not None and number.high is not None
        else (between(number.low, number.high))
    )


def between(low: float | None, high: float | None) -> str:
    """Two ends in words; None: the tracks set no limit."""
    if low is None and high is None:
        return "not told by the tracks"
    if low is None:
        return f"at most {high:.4g}"
    if high is None:
        return f"at least {low:.4g}"
    return f"{low:.4g} to {high:.4g}"


def _short(value: float) -> float:
    return float(f"{value:.4g}") if math.isfinite(value) else value
