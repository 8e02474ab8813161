"""What `infer` found: laws with their numbers, the one that explains the tracks, and how sure that is."""

import datetime
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.bootstrap import CorrectedFit
from airflock.estimate.inference.candidates import FitParameter as Sought, LawCandidate
from airflock.estimate.inference.fit import Fit
from airflock.estimate.inference.flights import FitNoise
from airflock.estimate.inference.likelihood import FitModel
from airflock.estimate.inference.maps import ForceMaps
from airflock.estimate.inference.predictive import PredictiveCheck
from airflock.estimate.inference.tracks import TrackScale
from airflock.scenarios import CallerParts, Scenario, build_scenario
from airflock.support import AirflockError

Array = NDArray[np.float64]
SURE = 2.0  # standard errors by which a law must predict better than going straight on, and
MOST = 0.75  # share of the spans in which it must
APART = 2.0  # standard errors by which the best law must be ahead of the second
SIMPLER = 1.0  # standard errors within which a law of fewer numbers is the better explanation
EDGE = 0.01  # of a range: an end nearer to the end of the range counts as no limit


@dataclass(frozen=True)
class ParameterEstimate:
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
class LawResult:
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
    parameter_penalty: float
    aic_difference: float
    inside: float
    missed: float
    numbers: dict[str, ParameterEstimate]
    candidate: LawCandidate
    fit: Fit
    maps: ForceMaps
    negative_log_likelihoods: Array


@dataclass
class InferResult:
    """What infer found: laws from best to worst, the one that explains the tracks if any does, and how sure that is.

    best   : None where no law predicts better than going straight on
    steps  : individual steps that were predicted; fitted: frames on which laws were fitted, of all frames
    check  : flights of the best law against the tracks
    """

    laws: list[LawResult]
    best: LawResult | None
    verdict: str
    steps: int
    fitted: tuple[int, int]
    scale: TrackScale
    individual_count: int
    noise: FitNoise | None = None
    check: PredictiveCheck | None = None
    settings: Mapping[str, float] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)

    def document(self) -> dict[str, Any]:
        """A scenario file's content: the best law with its numbers; raises AirflockError where there is none."""
        if self.best is None:
            raise AirflockError(f"infer: {self.verdict}; nothing can be written")
        scenario = self.best.candidate.scenario
        found: dict[str, Any] = {k: dict(v) if isinstance(v, Mapping) else v for k, v in scenario.document.items()}
        found.pop("published", None)
        found["title"] = f"{self.best.name}, inferred from tracks of {self.individual_count} individuals"
        found |= {"agents": self.individual_count, "duration": 120.0, "dt": scenario.flight.dt}
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
        given = CallerParts(law=own.model, vehicle=own.vehicle, sensor=own.sensor)
        return build_scenario(document, f"{self.best.name}, inferred", caller_parts=given)


def judge_laws(laws: list[LawResult]) -> tuple[LawResult | None, str]:
    """The law that explains the tracks, if one does, and the line that says so.

    Of laws that foretell as well within a standard error it is that with the fewest numbers (Breiman et al. 1984).
    """
    first = laws[0]
    if not _explains(first):
        return None, f"none of these explains the tracks better than going straight on{_perhaps(first)}"
    as_well = [law for law in indistinguishable_laws(laws, SIMPLER) if _explains(law)]
    best = min([first, *as_well], key=lambda law: len(law.numbers))  # of equally many the first
    missed = (
        f"; a free answer to neighbours would explain {best.missed:.0%} of the whole beside it"
        if best.missed > 0.05
        else ""
    )
    if best is not first:
        few, many = f"{best.name} explains the tracks with {len(best.numbers)} numbers", len(first.numbers)
        return best, f"{few} as well as {first.name} with {many}{missed}"
    if beside := indistinguishable_laws(laws)[:1]:
        return best, f"{best.name} explains the tracks best, but {beside[0].name} cannot be told from it{missed}"
    return best, f"{best.name} explains the tracks best{missed}"


def _perhaps(law: LawResult) -> str:
    """What is said of a law that is ahead in most spans, but by gains that differ too much to be sure of."""
    if law.gain <= law.parameter_penalty or law.ahead < MOST:
        return ""
    return (
        f" for sure: {law.name} is ahead in {law.ahead:.0%} of the spans, but its gain of {law.gain:.0f} is less than "
        f"{SURE:g} standard errors ({law.error:.0f}); longer tracks would tell"
    )


def _explains(law: LawResult) -> bool:
    """Whether a law foretells better than going straight on, and than so many numbers would by chance."""
    return law.gain > max(SURE * law.error, law.parameter_penalty) and law.ahead >= MOST


def indistinguishable_laws(laws: list[LawResult], sigmas: float = APART) -> list[LawResult]:
    """Laws that cannot be told from the first, which explains the tracks best, by what each foretells.

    apart : standard errors by which the first is ahead of all others
    """
    found = []
    for law in laws[1:]:
        ahead = law.negative_log_likelihoods - laws[0].negative_log_likelihoods
        if ahead.sum() < sigmas * float(np.sqrt(len(ahead)) * ahead.std(ddof=1)):
            found.append(law)
    return found


def set_parameters(result: InferResult, model: FitModel, corrected: CorrectedFit) -> None:
    """Give the best law its corrected numbers with their intervals, and the scenario file what it is to say of them."""
    assert result.best is not None
    numbers: dict[str, ParameterEstimate] = {}
    for k, n in enumerate(model.numbers[: model.named]):
        ends = [
            end for low, high in (corrected.alone, corrected.joint_ends) for end in (_low(n, low[k]), _high(n, high[k]))
        ]
        numbers[n.key] = ParameterEstimate(
            n.key, n.value(corrected.place[k]), ends[0], ends[1], n.unit, ends[2], ends[3]
        )
    noise = corrected.noise
    known = {n.column: (n.key, n.unit) for n in result.best.candidate.noise_parameters}
    if result.best.candidate.body_noise_column >= 0:
        known[result.best.candidate.body_noise_column] = ("body.noise", "m^2/s^3")
    if noise.column in known:
        key, unit = known[noise.column]
        (low, high), (least, most) = corrected.noise_ends
        numbers[key] = ParameterEstimate(key, noise.law, low, high, unit, least, most)
    result.best.numbers, result.noise = numbers, noise
    today = datetime.date.today().isoformat()
    result.settings = {key: number.value for key, number in numbers.items()}
    result.sources = {key: f"infer, {today}: {interval_text(number)}" for key, number in numbers.items()}


def _low(number: Sought, place: float) -> float | None:
    return number.value(place) if place > EDGE else None


def _high(number: Sought, place: float) -> float | None:
    return number.value(place) if place < 1.0 - EDGE else None


def interval_text(estimate: ParameterEstimate) -> str:
    """The 95 % interval of a number by itself, in words."""
    return (
        f"95 % in {ends_text(estimate.low, estimate.high)}"
        if estimate.low is not None and estimate.high is not None
        else (ends_text(estimate.low, estimate.high))
    )


def ends_text(low: float | None, high: float | None) -> str:
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
