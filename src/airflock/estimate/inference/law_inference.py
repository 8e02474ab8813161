"""Infer the flocking law of tracks: `infer`, its result, and maps of forces."""

import datetime
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.estimate.inference import law_selection
from airflock.estimate.inference.fit_checks import PredictiveCheck, lack_of_fit, run_predictive_check
from airflock.estimate.inference.innovation_filter import FitModel
from airflock.estimate.inference.law_candidates import (
    METRIC,
    FitParameter as Sought,
    LawCandidate,
    law_scenarios,
    make_candidate,
)
from airflock.estimate.inference.likelihood_fit import Fit, climb_to_maximum
from airflock.estimate.inference.observed_tracks import (
    ABSENT,
    SpanTracks,
    TrackScale,
    shifted_in_time,
    tracks_from_recording,
    tracks_scale,
)
from airflock.estimate.inference.parametric_bootstrap import CorrectedFit, FitNoise, correct_fit
from airflock.estimate.inference.posterior_sample import sample_posterior, search_onward
from airflock.recordings import load_recording, load_tracks
from airflock.scenarios import CallerParts, Scenario, build_scenario
from airflock.support import AirflockError, RecordingError, expand_path, interval_lines, result_group, result_table
from airflock.world import half_sizes

Array = NDArray[np.float64]
LAG = 0.3  # s; half of the window over which an acceleration is taken
CELLS = 15  # of a map, along each side
WIDE = 5.0  # nearest distances from the middle of a map to its edge
PAIRS = 1_500_000  # of which maps are made, at most
LEAST = 30  # pairs in a cell that counts


@dataclass(frozen=True)
class ForceMaps:
    """Mean acceleration by place of a neighbour, (forward or left, front-back, left-right), m/s^2.

    edges : of cells, m; seen, law : of the tracks and of the law; nan where there are too few pairs
    """

    edges: Array
    seen: Array
    law: Array


def force_maps(model: FitModel, point: Array, scale: TrackScale, spans: Sequence[int] | None = None) -> ForceMaps:
    """Map the forces of the tracks and of a law at a point of its numbers, on some spans."""
    edge = min(WIDE * scale.near, 0.6 * scale.far)
    edges = np.linspace(-edge, edge, CELLS + 1)
    size = CELLS * CELLS
    count, seen, law = np.zeros(size), np.zeros((2, size)), np.zeros((2, size))
    for walk, own in model.parts(spans):
        tracks, axes = walk.tracks, walk.axes
        kept, pushes = np.zeros((len(walk.seen), 2 * axes, tracks.individual_count)), np.zeros_like(tracks.seen)
        walk.errors(*model.split(point), own, kept, pushes)
        lag = max(1, round(LAG / tracks.period))
        weights = lag - np.abs(np.arange(-lag + 1, lag))
        frames = np.concatenate([np.arange(tracks.spans[s][0] + lag, tracks.spans[s][1] - lag) for s in own])
        for k in frames[:: max(1, len(frames) * tracks.individual_count**2 // PAIRS)]:
            window = tracks.seen[k - lag : k + lag + 1]
            turned = tracks.nearest(window[-1] - window[lag]) - tracks.nearest(window[lag] - window[0])
            felt = turned / (lag * tracks.period) ** 2
            commanded = np.tensordot(weights, pushes[k - lag + 1 : k + lag], 1) / (lag * lag * tracks.period)
            there: Any = (tracks.state[k - lag : k + lag + 1] > ABSENT).all(axis=0) & np.isfinite(felt).all(axis=0)
            cell, who, h, left = _cells(kept[k], there, tracks.state[k] > ABSENT, edge, tracks.nearest)
            count += np.bincount(cell, minlength=size)
            for table, force in ((seen, felt), (law, commanded)):
                for part, axis in enumerate((h, left)):
                    own_force = (axis * np.nan_to_num(force)).sum(axis=0)
                    table[part] += np.bincount(cell, own_force[who], size)
    shape, enough = (2, CELLS, CELLS), count >= LEAST
    divisor = np.maximum(count, 1.0)
    return ForceMaps(
        edges,
        np.where(enough, seen / divisor, np.nan).reshape(shape),
        np.where(enough, law / divisor, np.nan).reshape(shape),
    )


def _cells(
    motion: Array, there: NDArray[np.bool_], around: NDArray[np.bool_], edge: float, nearest: Callable[[Array], Array]
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
    """Return the cell of every neighbour, its individual, and headings and directions left (axis, individual)."""
    axes, n = len(motion) // 2, motion.shape[1]
    x, v = motion[:axes], motion[axes:]
    h = v / np.maximum(np.linalg.norm(v, axis=0), 1e-12)
    flat = np.maximum(np.linalg.norm(h[:2], axis=0), 1e-12)
    left = np.zeros_like(h)
    left[0], left[1] = -h[1] / flat, h[0] / flat
    d = nearest((x[:, None, :] - x[:, :, None]).reshape(axes, -1)).reshape(axes, n, n)
    places = [np.einsum("ai,aij->ij", axis, d) for axis in (h, left)]
    row, column = (np.floor((p + edge) / (2.0 * edge) * CELLS).astype(int) for p in places)
    inside = (row >= 0) & (row < CELLS) & (column >= 0) & (column < CELLS)
    inside &= there[:, None] & around[None, :] & ~np.eye(n, dtype=bool)
    who, _ = np.nonzero(inside)
    return row[inside] * CELLS + column[inside], who, h, left


SURE = 2.0  # standard errors by which a law must predict better than going straight on, and
MOST = 0.75  # share of the spans in which it must
APART = 2.0  # standard errors by which the best law must be ahead of the second
# The one-standard-error rule of Breiman et al. (1984): eight numbers won by 12.7 units with an
# error of 28.3.
SIMPLER = 1.0  # standard errors within which a law of fewer numbers is the better explanation
EDGE = 0.01  # of a range: an end nearer to the end of the range counts as no limit


@dataclass(frozen=True)
class ParameterEstimate:
    """A number of a law with its intervals; an end is None where the tracks set no limit.

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
    """Score and numbers of one law on the tracks.

    gain, error : log-likelihood of held-out steps above that of going straight on, and its standard
                  error
    ahead       : share of spans in which it predicts better
    price       : gain that so many numbers bring by chance: half of each times log(steps) (Schwarz
                  1978)
    criterion   : Akaike's, of the fit, below that of going straight on; negative is better
    inside      : share of held-out differences within the 95 % that are predicted
    missed      : share of what is explained with a free answer to neighbours beside the law that it
                  leaves over, 0 to 1
    numbers     : fitted; with intervals for the best law alone
    by_chance   : of the best law, gain and error where individuals are shifted in time
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
    maps: ForceMaps | None
    negative_log_likelihoods: Array
    by_chance: tuple[float, float] | None = None


@dataclass
class InferResult:
    """Result of `infer`: laws from best to worst, the one that explains the tracks if any does, and its certainty.

    best   : None where no law predicts better than going straight on
    steps  : individual steps that were predicted; fitted: frames on which laws were fitted, of all
             frames
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

    def __rich__(self) -> Any:
        """Return the laws, and the numbers and the check of the best one, for a terminal."""
        rows = [
            (
                law.name, f"{law.gain:.0f} ± {law.error:.0f}", f"{law.ahead:.0%}", f"{law.aic_difference:.0f}",
                f"{law.inside:.1%}", f"{law.missed:.1%}", str(len(law.numbers)),
            )
            for law in self.laws
        ]  # fmt: skip
        fitted, every = self.fitted
        title = f"{self.individual_count} individuals, {self.steps} steps; fitted on {fitted} of {every} frames"
        heads = "law; >gain; >ahead; >AIC; >in 95 %; >left over; >numbers"
        return result_group(
            result_table(title, heads, rows, no_wrap=True),
            "compared with going straight on: gain in log-likelihood of held-out steps; AIC of the fit, negative is "
            "better",
            self.verdict,
            *(self._best_parts(self.best) if self.best is not None else ()),
        )

    def _best_parts(self, best: LawResult) -> list[Any]:
        """Return a table of the numbers of the best law, the noise, and the check against the tracks."""
        rows = [
            (
                key, f"{number.value:.4g}", "" if number.unit == "1" else number.unit,
                ends_text(number.low, number.high), ends_text(number.least, number.most),
            )
            for key, number in best.numbers.items()
        ]  # fmt: skip
        heads = "number; >value; unit; 95 % for it alone; 95 % for all together"
        parts: list[Any] = [result_table(f"numbers of {best.name}", heads, rows, no_wrap=True)]
        parts += [f"noise of the tracks {self.noise.seen:.3g} m"] if self.noise is not None else []
        if self.check is not None:
            parts.append("check: flocks of this law, flown freely from the first frame, against the tracks")
            parts += interval_lines(self.check.found)
        return parts

    def document(self) -> dict[str, Any]:
        """Return a scenario file's content: the best law with its numbers; raise AirflockError where there is none."""
        if self.best is None:
            raise AirflockError(f"infer: {self.verdict}; nothing can be written")
        scenario = self.best.candidate.scenario
        found: dict[str, Any] = {k: dict(v) if isinstance(v, Mapping) else v for k, v in scenario.document.items()}
        found.pop("published", None)
        found["title"] = f"{self.best.name}, inferred from tracks of {self.individual_count} individuals"
        length = _short(max(self.scale.length, scenario.flight.dt))
        found |= {"agents": self.individual_count, "duration": length, "dt": scenario.flight.dt}
        for key, value in self.settings.items():
            section, _, name = key.partition(".")
            entry: dict[str, Any] = {"value": _short(value), "source": self.sources[key]}
            found.setdefault(section, {})[name] = entry
        # Flocks start as wide as the tracks do: a shoal that begins five times as wide never meets.
        begin = {"speed": _short(self.scale.speed), "separation": 0.0}
        room = math.inf if scenario.world.arena == "none" else min(half_sizes(scenario.world)[:2])
        periodic = scenario.world.edges == "periodic"
        if not periodic and self.scale.begin < 0.7 * room:
            found["start"] = {"kind": "ball", "radius": _short(max(self.scale.begin, 1e-6)), **begin}
        else:
            found["start"] = {"kind": "arena", **begin}
        return found

    def scenario(self) -> Scenario:
        """Return the best law as a scenario that flies."""
        document = self.document()
        assert self.best is not None
        own = self.best.candidate.scenario
        given = CallerParts(law=own.model, body=own.body.rule, sensors=own.sensors.rule)
        return build_scenario(document, f"{self.best.name}, inferred", caller_parts=given)


def judge_laws(laws: list[LawResult]) -> tuple[LawResult | None, str]:
    """Return the law that explains the tracks, if one does, and the verdict.

    Of laws that predict as well within a standard error it is the one with the fewest numbers
    (Breiman et al. 1984).
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
    """Return the verdict on a law that is ahead in most spans, by gains that vary too much to be certain."""
    if law.gain <= law.parameter_penalty or law.ahead < MOST:
        return ""
    return (
        f" for sure: {law.name} is ahead in {law.ahead:.0%} of the spans, but its gain of {law.gain:.0f} is less than "
        f"{SURE:g} standard errors ({law.error:.0f}); longer tracks would tell"
    )


def _explains(law: LawResult) -> bool:
    """Return True if a law predicts better than going straight on, and than so many numbers would by chance."""
    return law.gain > max(SURE * law.error, law.parameter_penalty) and law.ahead >= MOST


def indistinguishable_laws(laws: list[LawResult], sigmas: float = APART) -> list[LawResult]:
    """Return the laws whose predictions are not significantly worse than those of the first, the best one.

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
    """Describe the 95 % interval of a number by itself."""
    return (
        f"95 % in {ends_text(estimate.low, estimate.high)}"
        if estimate.low is not None and estimate.high is not None
        else (ends_text(estimate.low, estimate.high))
    )


def ends_text(low: float | None, high: float | None) -> str:
    """Describe two ends; None: the tracks set no limit."""
    if low is None and high is None:
        return "not told by the tracks"
    if low is None:
        return f"at most {high:.4g}"
    if high is None:
        return f"at least {low:.4g}"
    return f"{low:.4g} to {high:.4g}"


def _short(value: float) -> float:
    return float(f"{value:.4g}") if math.isfinite(value) else value


# One set of points ended in the wrong mode (238 units below a climb from the truth); of three
# others two found the right one.
RACES = 2  # from new points, of a law that is searched deeper
LAWS = ("couzin_2002", "reynolds_1987", "vicsek_1995", "vasarhelyi_2018")


def infer(
    tracks: Any,
    models: Sequence[str | Scenario] = LAWS,
    *,
    settings: Mapping[str, Any] | None = None,
    topologies: Sequence[str] = ("metric",),
    check: int = 20,
    seed: int = 0,
    trust: bool = False,
    done: Callable[[str], None] | None = None,
) -> InferResult:
    """Infer which flocking law explains these tracks, with which numbers, and how much it misses.

    Parameters
    ----------
    tracks : xarray.Dataset, path, or several of them (TRACKS...)
        Recordings of individuals that fly or swim together: several are held out in turn.
    models : sequence of str or Scenario (LAW,FILE,...)
        Laws by name, presets, scenario files or files with a law of your own.
    settings : mapping, optional
        Keys that hold for every candidate, such as {"world.arena": "square", "world.side": 40.0}.
    topologies : sequence of str (KIND,...)
        Neighbourhoods by which every law is tried: metric, as the law itself has it; nearest, the k nearest, k fitted;
        voronoi, whose cells border its own.
    check : int in [0, inf]
        Flights of the law found that are compared with the tracks; 0: none.
    seed : int in [0, inf]
        Seed of the search for the best fit.
    trust : bool
        Whether laws in files may run.
    done : callable, optional
        Called with the progress, now and then.

    Returns
    -------
    Inferred
        `laws` from best to worst, `best` or None, `verdict`, `scenario()` of the law found.

    Raises
    ------
    AirflockError
        If the tracks or a law cannot be used, one line each.

    Examples
    --------
    >>> import airflock
    >>> airflock.infer("fish.nc", models=[])
    Traceback (most recent call last):
    airflock.support.errors.AirflockError: infer: no laws to choose from; name models, such as couzin_2002
    >>> found = airflock.infer("fish.nc")  # doctest: +SKIP
    >>> found.verdict  # doctest: +SKIP
    'couzin_2002 explains the tracks best'
    """
    result, comparison = name_law(tracks, models, settings, topologies, seed=seed, trust=trust, done=done)
    if result.best is not None:
        best, say = result.best, done or (lambda _: None)
        model, fit, draws = comparison.sample(best)
        teller = _teller(say, f"{best.name}, flown again")
        corrected = correct_fit(model, fit, draws, comparison.spans, teller)
        set_parameters(result, model, corrected)
        if check:
            result.check = run_predictive_check(model, corrected.place, corrected.noise, check, _teller(say, "check"))
    return result


def name_law(
    tracks: Any,
    models: Sequence[str | Scenario],
    settings: Mapping[str, Any] | None = None,
    topologies: Sequence[str] = (METRIC,),
    *,
    seed: int = 0,
    trust: bool = False,
    done: Callable[[str], None] | None = None,
) -> tuple[InferResult, "_Comparison"]:
    """Return the result of `infer` before its intervals and flights, and the comparison of the laws."""
    models = [models] if isinstance(models, str) else models
    topologies = [topologies] if isinstance(topologies, str) else topologies
    if not isinstance(models, Iterable):
        raise AirflockError(f"infer: models = {models!r}: give a list of laws, such as ['couzin_2002']")
    if not models:
        raise AirflockError("infer: no laws to choose from; name models, such as couzin_2002")
    say = done or (lambda _: None)
    scenarios, box = law_scenarios(models, dict(settings or {}), topologies, trust=trust)
    recordings = read_recordings(tracks)
    followed = [tracks_from_recording(recording, name, box=box) for name, recording in recordings]
    _alike(followed)
    scale = tracks_scale(followed)
    comparison = _Comparison(followed, scale, seed, say)
    laws = comparison.of([make_candidate(each, scale, followed[0].axes) for each in scenarios])
    if judge_laws(laws)[0] is not None:
        comparison.contest(laws)
    for law in laws:
        comparison.finish(law)
    best, verdict = judge_laws(laws)
    result = InferResult(
        laws, best, verdict, sum(each.counted for each in followed), comparison.frames(), scale,
        max(each.individual_count for each in followed),
    )  # fmt: skip
    if best is not None:
        best.by_chance = comparison.by_chance(best)
        if not beats_chance(best):
            result.best, result.verdict = None, (
                f"none of these explains the tracks: {best.name} gains {best.gain:.0f} ± {best.error:.0f}, and "
                f"{best.by_chance[0]:.0f} ± {best.by_chance[1]:.0f} where each individual is shifted in time, so that "
                "nobody meets anybody"
            )  # fmt: skip
    return result, comparison


def beats_chance(law: LawResult) -> bool:
    """Return True if a law gains more than on tracks on which nobody meets anybody."""
    gain, error = law.by_chance or (0.0, 0.0)
    return law.gain - max(gain, 0.0) > SURE * math.hypot(law.error, error)


class _Comparison:
    """Comparison of laws with going straight on, on the same tracks.

    spans : those on which the law found is fitted; halves : spans of which each half is predicted
            by the other
    """

    def __init__(self, followed: Sequence[SpanTracks], scale: TrackScale, seed: int, say: Callable[[str], None]):
        self.followed, self.scale, self.seed, self.say = followed, scale, seed, say
        self.reference, self.straight = law_selection.straight_model(followed, scale)
        self.halves = law_selection.make_halves(self.reference)
        self.own = [law_selection.straight_model(followed, scale, half) for half in self.halves]
        self.plain = law_selection.predict_held_out(self.own, self.halves)
        self.spans = law_selection.sample_spans(self.reference)
        self.laws: dict[str, LawCandidate] = {}
        self.fits: dict[str, list[tuple[FitModel, Fit]]] = {}

    def frames(self) -> tuple[int, int]:
        """Return the number of frames on which laws are fitted, and of all."""
        chosen = (self.followed[t].spans[s] for t, s in (self.reference.spans[k] for k in self.spans))
        return sum(end - begin for begin, end in chosen), sum(len(each.seen) for each in self.followed)

    def of(self, candidates: Sequence[LawCandidate]) -> list[LawResult]:
        """Return laws from best to worst."""
        self.laws = {each.name: each for each in candidates}
        for each in candidates:
            self.fits[each.name] = self.fitted(each, self.seed, _teller(self.say, each.name))
        return sorted((self.judged(each.name) for each in candidates), key=lambda law: -law.gain)

    def fitted(self, law: LawCandidate, seed: int, say: Callable[[], None]) -> list[tuple[FitModel, Fit]]:
        """Fit a law to each half alone, raced from points drawn by a seed."""
        found = []
        for half, (straight, plain) in zip(self.halves, self.own, strict=True):
            gains = plain.place[straight.named :]
            found.append(law_selection.fit_law(law, self.followed, self.scale, gains, seed, half, say))
        return found

    def contest(self, laws: list[LawResult]) -> None:
        """Search deeper for the best law, and for each that is not worse with certainty; sort the laws again.

        A law may lose for want of searching alone: a short search ends on another hill now and
        then. Which search was the better one is decided by the half that was fitted.
        """
        searched: set[str] = set()
        while waiting := [law for law in (laws[0], *indistinguishable_laws(laws)) if law.name not in searched]:
            law = waiting[0]
            deeper = self.deeper(law.name)
            laws[:] = sorted((deeper if each is law else each for each in laws), key=lambda each: -each.gain)
            searched.add(law.name)

    def deeper(self, name: str) -> LawResult:
        """Search a law from more points, and judge it again."""
        for more in range(1, RACES):
            tried = self.fitted(self.laws[name], self.seed + more, _teller(self.say, f"{name}, searched again"))
            both = zip(self.fits[name], tried, strict=True)
            self.fits[name] = [min(pair, key=lambda each: each[1].loss) for pair in both]
        return self.judged(name)

    def judged(self, name: str) -> LawResult:
        """Judge how well a law predicts the half that its fit has not seen."""
        held = law_selection.predict_held_out(self.fits[name], self.halves)
        ahead = self.plain.negative_log_likelihoods - held.negative_log_likelihoods
        model, fit = max(self.fits[name], key=lambda each: each[0].named)
        return LawResult(
            name, float(ahead.sum()), float(np.sqrt(len(ahead)) * ahead.std(ddof=1)), float((ahead > 0.0).mean()),
            0.5 * model.named * math.log(max(sum(each.counted for each in model.tracks), 2)), 0.0, held.inside, 0.0,
            _estimates(model, fit), self.laws[name], fit, None, held.negative_log_likelihoods,
        )  # fmt: skip

    def by_chance(self, law: LawResult) -> tuple[float, float]:
        """Return the gain of a law, and its error, on the tracks with each individual shifted in time.

        Everybody moves as before, and meets the walls; but neighbours are where others were. What
        the law gains there is what the best of many places gains without any interaction.
        """
        say = lambda _: self.say(f"{law.name}, by chance")  # noqa: E731
        null = _Comparison([shifted_in_time(each) for each in self.followed], self.scale, self.seed, say)
        null.of([self.laws[law.name]])
        # It is searched as deeply as the tracks were, and from the law found as well.
        null.deeper(law.name)
        for number, (half, (model, fit)) in enumerate(zip(null.halves, self.fits[law.name], strict=True)):
            own = FitModel(model.law, null.followed, self.scale).on(half)
            refitted = own, climb_to_maximum(own, fit.place, fit.free, law_selection.sample_spans(own))
            null.fits[law.name][number] = min(null.fits[law.name][number], refitted, key=lambda each: each[1].loss)
        found = null.judged(law.name)
        return found.gain, found.error

    def finish(self, law: LawResult) -> None:
        """Fit a law to all spans from what was fitted to the halves, for its numbers, its maps and what it misses."""
        self.complete(law, *law_selection.merge_fits(self.laws[law.name], self.fits[law.name]))

    def sample(self, law: LawResult) -> tuple[FitModel, Fit, Array]:
        """Sample the numbers of the law found that are needed, on all spans; return the model, fit and draws."""
        say = _teller(self.say, f"{law.name}, sampled")
        plain = FitModel(law.candidate, self.followed, self.scale)
        whole = plain.robust()
        fit, places = search_onward(whole, law.fit, self.spans, say)
        self.complete(law, plain, climb_to_maximum(plain, fit.place, fit.free, self.spans))
        model, fit = law_selection.drop_redundant(whole, fit, say)
        kept = [n in model.numbers for n in whole.numbers[: whole.named]]
        places = places[:, [*kept, *[True] * (len(whole.numbers) - whole.named)]]
        fit, draws = sample_posterior(model, fit, places, self.spans, say)
        return model, fit, draws

    def complete(self, law: LawResult, model: FitModel, fit: Fit) -> None:
        """Enter what a fit to all spans says."""
        assert model.law is not None
        bare = fit.score.loss() + len(fit.free), self.straight.score.loss() + len(self.straight.free)
        left = lack_of_fit(model, fit.place, self.spans)
        gained = max(self.straight.score.loss() - fit.score.loss(), 0.0)
        law.candidate, law.fit, law.numbers = model.law, fit, _estimates(model, fit)
        law.aic_difference, law.missed = 2.0 * (bare[0] - bare[1]), left / max(gained + left, 1e-9)
        law.maps = force_maps(model, fit.place, self.scale, self.spans)


def _estimates(model: FitModel, fit: Fit) -> dict[str, ParameterEstimate]:
    named = enumerate(model.numbers[: model.named])
    return {n.key: ParameterEstimate(n.key, n.value(fit.place[k]), None, None, n.unit) for k, n in named}


def _teller(say: Callable[[str], None], name: str) -> Callable[[], None]:
    return lambda: say(name)


def read_recordings(tracks: Any) -> list[tuple[str, xr.Dataset]]:
    """Return recordings by name: recordings, saved ones, or files that `load_tracks` reads without options."""
    several: Iterable[Any] = [tracks] if isinstance(tracks, (xr.Dataset, str, Path)) else tracks
    if not isinstance(several, Iterable):
        raise RecordingError(f"{type(tracks).__name__} holds no tracks; give recordings or files")
    recordings = []
    for number, each in enumerate(several, 1):
        if isinstance(each, xr.Dataset):
            recordings.append((f"recording {number}", each))
        elif str(each).endswith(".nc"):
            recordings.append((str(each), load_recording(each)))
        else:
            recordings.append((str(each), _read(expand_path(each))))
    if not recordings:
        raise RecordingError("no tracks to infer a law from")
    return recordings


def _read(path: Path) -> xr.Dataset:
    """Read a file of tracks that needs no options; where it needs some, the error contains the command."""
    try:
        return load_tracks(path)
    except RecordingError as error:
        if not path.is_file() or " --" not in str(error):  # it is nothing that an option would mend
            raise
        raise RecordingError(
            f"{error}\n{path}: infer takes no options of import: airflock import {path.name} ... --save tracks.nc, "
            "then give tracks.nc"
        ) from error


def _alike(followed: Sequence[SpanTracks]) -> None:
    first = followed[0]
    for other in followed[1:]:
        if other.axes != first.axes or abs(other.period - first.period) > 0.01 * first.period:
            raise RecordingError(
                f"{other.name}: {other.axes} axes, a frame every {other.period:g} s; {first.name} has {first.axes}, "
                f"{first.period:g} s; import both with the same --rate"
            )
