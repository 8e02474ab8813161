"""From tracks to the law that explains them: `infer`."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from airflock.estimate.inference import select
from airflock.estimate.inference.bootstrap import correct_fit
from airflock.estimate.inference.candidates import LawCandidate, law_scenarios, make_candidate
from airflock.estimate.inference.fit import Fit
from airflock.estimate.inference.lack_of_fit import lack_of_fit
from airflock.estimate.inference.likelihood import FitModel
from airflock.estimate.inference.maps import force_maps
from airflock.estimate.inference.predictive import run_predictive_check
from airflock.estimate.inference.result import (
    InferResult,
    LawResult,
    ParameterEstimate,
    indistinguishable_laws,
    judge_laws,
    set_parameters,
)
from airflock.estimate.inference.tracks import SpanTracks, TrackScale, tracks_from_recording, tracks_scale
from airflock.recordings import load_recording, load_tracks
from airflock.scenarios import Scenario
from airflock.support import AirflockError, RecordingError, expand_path

RACES = 3  # from places drawn anew, of a law that is searched deeper
LAWS = ("couzin_2002", "reynolds_1987", "vicsek_1995", "vasarhelyi_2018")


def infer(
    tracks: Any,
    models: Sequence[str | Scenario] = LAWS,
    *,
    settings: Mapping[str, Any] | None = None,
    check: int = 20,
    seed: int = 0,
    trust: bool = False,
    done: Callable[[str], None] | None = None,
) -> InferResult:
    """Which flocking law explains these tracks, with which numbers, and how much it misses.

    Parameters
    ----------
    tracks : xarray.Dataset, path, or several of them
        Recordings of individuals that fly or swim together: several are held out in turn.
    models : sequence of str or Scenario
        Laws by name, presets, scenario files or files with a law of your own.
    settings : mapping, optional
        Keys that hold for every candidate, such as {"world.arena": "square", "world.side": 40.0}.
    check : int
        Flights of the law found that are compared with the tracks; 0: none.
    seed : int
        Seed of the search for the best fit.
    trust : bool
        Whether laws in files may run.
    done : callable, optional
        Told what has been done, now and then.

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
    models = [models] if isinstance(models, str) else models
    if not isinstance(models, Iterable):
        raise AirflockError(f"infer: models = {models!r}: give a list of laws, such as ['couzin_2002']")
    if not models:
        raise AirflockError("infer: no laws to choose from; name models, such as couzin_2002")
    say = done or (lambda _: None)
    settings = dict(settings or {})
    scenarios, box = law_scenarios(models, settings, trust=trust)
    recordings = read_recordings(tracks)
    followed = [tracks_from_recording(recording, name, box=box) for name, recording in recordings]
    _alike(followed)
    scale = tracks_scale(followed)
    comparison = _Comparison(followed, scale, seed, say)
    laws, by_name = comparison.of([make_candidate(each, scale, followed[0].axes) for each in scenarios])
    best, verdict = judge_laws(laws)
    result = InferResult(
        laws, best, verdict, sum(each.counted for each in followed), comparison.frames(), scale,
        max(each.individual_count for each in followed),
    )  # fmt: skip
    if best is None:
        return result
    comparison.contest(laws, by_name)
    result.best, result.verdict = judge_laws(laws)
    if result.best is not None:
        best, model = result.best, by_name[result.best.name]
        teller = _teller(say, f"{best.name}, flown again")
        corrected = correct_fit(comparison.laws[best.name], model, best.fit, comparison.spans, teller)
        set_parameters(result, model, corrected)
        if check:
            result.check = run_predictive_check(model, corrected.place, corrected.noise, check, _teller(say, "check"))
    return result


class _Comparison:
    """Laws against going straight on, on the same tracks.

    spans : those on which is fitted
    """

    def __init__(self, followed: Sequence[SpanTracks], scale: TrackScale, seed: int, say: Callable[[str], None]):
        self.followed, self.scale, self.seed, self.say = followed, scale, seed, say
        self.reference, self.straight = select.straight_model(followed, scale)
        self.plain = select.cross_validate(self.reference, self.straight, lambda: say("going straight on"))
        self.spans = select.sample_spans(self.reference)
        self.laws: dict[str, LawCandidate] = {}

    def frames(self) -> tuple[int, int]:
        """Frames on which laws are fitted, of all."""
        chosen = (self.followed[t].spans[s] for t, s in (self.reference.spans[k] for k in self.spans))
        return sum(end - begin for begin, end in chosen), sum(len(each.seen) for each in self.followed)

    def of(self, candidates: Sequence[LawCandidate]) -> tuple[list[LawResult], dict[str, FitModel]]:
        """Laws from best to worst, and the model of each by its name."""
        self.laws = {each.name: each for each in candidates}
        laws, models = [], {}
        for each in candidates:
            say = _teller(self.say, each.name)
            models[each.name], fit = self.fitted(each, self.seed, say)
            laws.append(self.judged(each.name, models[each.name], fit, say))
        laws.sort(key=lambda law: -law.gain)
        return laws, models

    def fitted(self, law: LawCandidate, seed: int, say: Callable[[], None]) -> tuple[FitModel, Fit]:
        """A law at its likeliest, raced from places drawn by a seed."""
        gains = self.straight.place[self.reference.named :]
        return select.fit_law(law, self.followed, self.scale, gains, seed, say)

    def contest(self, laws: list[LawResult], models: dict[str, FitModel]) -> None:
        """Search deeper for the best law, and for each that cannot be told from it; laws are sorted anew.

        A law may lose for want of searching alone: a short search ends on another hill now and then.
        """
        searched: set[str] = set()
        while waiting := [law for law in (laws[0], *indistinguishable_laws(laws)) if law.name not in searched]:
            law = waiting[0]
            models[law.name], deeper = self.deeper(law, models[law.name])
            laws[:] = sorted((deeper if each is law else each for each in laws), key=lambda each: -each.gain)
            searched.add(law.name)

    def deeper(self, law: LawResult, model: FitModel) -> tuple[FitModel, LawResult]:
        """A law after more searching, and without numbers that the others make up for; judged anew."""
        own, say = self.laws[law.name], _teller(self.say, f"{law.name}, simplified")
        tried = [(model, law.fit), *(self.fitted(own, self.seed + more, say) for more in range(1, RACES))]
        model, fit = select.fit_minimal(own, *min(tried, key=lambda each: each[1].loss), say)
        return model, self.judged(law.name, model, fit, say)

    def judged(self, name: str, model: FitModel, fit: Fit, say: Callable[[], None]) -> LawResult:
        """How well a fitted law foretells what it has not seen."""
        assert model.law is not None
        held = select.cross_validate(model, fit, say)
        ahead = self.plain.negative_log_likelihoods - held.negative_log_likelihoods
        numbers = {
            n.key: ParameterEstimate(n.key, n.value(fit.place[k]), None, None, n.unit)
            for k, n in enumerate(model.numbers[: model.named])
        }
        bare = fit.score.loss() + len(fit.free), self.straight.score.loss() + len(self.straight.free)
        left, gained = (
            lack_of_fit(model, fit.place, self.spans),
            max(self.straight.score.loss() - fit.score.loss(), 0.0),
        )
        return LawResult(
            name, float(ahead.sum()), float(np.sqrt(len(ahead)) * ahead.std(ddof=1)), float((ahead > 0.0).mean()),
            0.5 * len(numbers) * math.log(max(sum(each.counted for each in model.tracks), 2)),
            2.0 * (bare[0] - bare[1]), held.inside, left / max(gained + left, 1e-9), numbers, model.law, fit,
            force_maps(model, fit.place, self.scale, self.spans), held.negative_log_likelihoods,
        )  # fmt: skip


def _teller(say: Callable[[str], None], name: str) -> Callable[[], None]:
    return lambda: say(name)


def read_recordings(tracks: Any) -> list[tuple[str, xr.Dataset]]:
    """Recordings by name: given ones, saved ones, or files that `load_tracks` reads without options."""
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
    """A file of tracks that import reads without options; where it needs some, the fault gives the command."""
    try:
        return load_tracks(path)
    except RecordingError as fault:
        if not path.is_file() or " --" not in str(fault):  # it is nothing that an option would mend
            raise
        raise RecordingError(
            f"{fault}\n{path}: infer takes no options of import: airflock import {path.name} ... --save tracks.nc, "
            "then give tracks.nc"
        ) from fault


def _alike(followed: Sequence[SpanTracks]) -> None:
    first = followed[0]
    for other in followed[1:]:
        if other.axes != first.axes or abs(other.period - first.period) > 0.01 * first.period:
            raise RecordingError(
                f"{other.name}: {other.axes} axes, a frame every {other.period:g} s; {first.name} has {first.axes}, "
                f"{first.period:g} s; import both with the same --rate"
            )
