"""From tracks to the law that explains them: `infer`."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from airflock.estimate.infer import select
from airflock.estimate.infer.bootstrap import correct
from airflock.estimate.infer.candidates import Candidate, candidate, scenarios_of
from airflock.estimate.infer.fit import Fit
from airflock.estimate.infer.lack_of_fit import lack_of_fit
from airflock.estimate.infer.likelihood import Model
from airflock.estimate.infer.maps import maps
from airflock.estimate.infer.predictive import posterior
from airflock.estimate.infer.result import Inferred, Law, Number, rivals, set_numbers, verdict_of
from airflock.estimate.infer.tracks import Scale, Tracks, scale_of, tracks_of
from airflock.recordings.files import load_recording
from airflock.recordings.imports.load import load_tracks
from airflock.scenarios.scenario import Scenario
from airflock.support.errors import AirflockError, RecordingError
from airflock.support.untrusted import own_path

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
) -> Inferred:
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
    scenarios, box = scenarios_of(models, settings, trust=trust)
    recordings = recordings_of(tracks)
    followed = [tracks_of(recording, name, box=box) for name, recording in recordings]
    _alike(followed)
    scale = scale_of(followed)
    comparison = _Comparison(followed, scale, seed, say)
    laws, by_name = comparison.of([candidate(each, scale, followed[0].axes) for each in scenarios])
    best, verdict = verdict_of(laws)
    result = Inferred(
        laws, best, verdict, sum(each.counted for each in followed), comparison.frames(), scale,
        max(each.individuals for each in followed),
    )  # fmt: skip
    if best is None:
        return result
    comparison.contest(laws, by_name)
    result.best, result.verdict = verdict_of(laws)
    if result.best is not None:
        best, model = result.best, by_name[result.best.name]
        teller = _teller(say, f"{best.name}, flown again")
        corrected = correct(comparison.laws[best.name], model, best.fit, comparison.spans, teller)
        set_numbers(result, model, corrected)
        if check:
            result.check = posterior(model, corrected.place, corrected.noise, check, _teller(say, "check"))
    return result


class _Comparison:
    """Laws against going straight on, on the same tracks.

    spans : those on which is fitted
    """

    def __init__(self, followed: Sequence[Tracks], scale: Scale, seed: int, say: Callable[[str], None]):
        self.followed, self.scale, self.seed, self.say = followed, scale, seed, say
        self.reference, self.straight = select.straight(followed, scale)
        self.plain = select.hold_out(self.reference, self.straight, lambda: say("going straight on"))
        self.spans = select.sample(self.reference)
        self.laws: dict[str, Candidate] = {}

    def frames(self) -> tuple[int, int]:
        """Frames on which laws are fitted, of all."""
        chosen = (self.followed[t].spans[s] for t, s in (self.reference.spans[k] for k in self.spans))
        return sum(end - begin for begin, end in chosen), sum(len(each.seen) for each in self.followed)

    def of(self, candidates: Sequence[Candidate]) -> tuple[list[Law], dict[str, Model]]:
        """Laws from best to worst, and the model of each by its name."""
        self.laws = {each.name: each for each in candidates}
        laws, models = [], {}
        for each in candidates:
            say = _teller(self.say, each.name)
            models[each.name], fit = self.fitted(each, self.seed, say)
            laws.append(self.judged(each.name, models[each.name], fit, say))
        laws.sort(key=lambda law: -law.gain)
        return laws, models

    def fitted(self, law: Candidate, seed: int, say: Callable[[], None]) -> tuple[Model, Fit]:
        """A law at its likeliest, raced from places drawn by a seed."""
        gains = self.straight.place[self.reference.named :]
        return select.fit(law, self.followed, self.scale, gains, seed, say)

    def contest(self, laws: list[Law], models: dict[str, Model]) -> None:
        """Search deeper for the best law, and for each that cannot be told from it; laws are sorted anew.

        A law may lose for want of searching alone: a short search ends on another hill now and then.
        """
        searched: set[str] = set()
        while waiting := [law for law in (laws[0], *rivals(laws)) if law.name not in searched]:
            law = waiting[0]
            models[law.name], deeper = self.deeper(law, models[law.name])
            laws[:] = sorted((deeper if each is law else each for each in laws), key=lambda each: -each.gain)
            searched.add(law.name)

    def deeper(self, law: Law, model: Model) -> tuple[Model, Law]:
        """A law after more searching, and without numbers that the others make up for; judged anew."""
        own, say = self.laws[law.name], _teller(self.say, f"{law.name}, simplified")
        tried = [(model, law.fit), *(self.fitted(own, self.seed + more, say) for more in range(1, RACES))]
        model, fit = select.simpler(own, *min(tried, key=lambda each: each[1].loss), say)
        return model, self.judged(law.name, model, fit, say)

    def judged(self, name: str, model: Model, fit: Fit, say: Callable[[], None]) -> Law:
        """How well a fitted law foretells what it has not seen."""
        assert model.law is not None
        held = select.hold_out(model, fit, say)
        ahead = self.plain.surprise - held.surprise
        numbers = {
            n.key: Number(n.key, n.value(fit.place[k]), None, None, n.unit)
            for k, n in enumerate(model.numbers[: model.named])
        }
        bare = fit.score.loss() + len(fit.free), self.straight.score.loss() + len(self.straight.free)
        left, gained = (
            lack_of_fit(model, fit.place, self.spans),
            max(self.straight.score.loss() - fit.score.loss(), 0.0),
        )
        return Law(
            name, float(ahead.sum()), float(np.sqrt(len(ahead)) * ahead.std(ddof=1)), float((ahead > 0.0).mean()),
            0.5 * len(numbers) * math.log(max(sum(each.counted for each in model.tracks), 2)),
            2.0 * (bare[0] - bare[1]), held.inside, left / max(gained + left, 1e-9), numbers, model.law, fit,
            maps(model, fit.place, self.scale, self.spans), held.surprise,
        )  # fmt: skip


def _teller(say: Callable[[str], None], name: str) -> Callable[[], None]:
    return lambda: say(name)


def recordings_of(what: Any) -> list[tuple[str, xr.Dataset]]:
    """Recordings by name: given ones, saved ones, or files that `load_tracks` reads without options."""
    several: Iterable[Any] = [what] if isinstance(what, (xr.Dataset, str, Path)) else what
    if not isinstance(several, Iterable):
        raise RecordingError(f"{type(what).__name__} holds no tracks; give recordings or files")
    recordings = []
    for number, each in enumerate(several, 1):
        if isinstance(each, xr.Dataset):
            recordings.append((f"recording {number}", each))
        elif str(each).endswith(".nc"):
            recordings.append((str(each), load_recording(each)))
        else:
            recordings.append((str(each), _read(own_path(each))))
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


def _alike(followed: Sequence[Tracks]) -> None:
    first = followed[0]
    for other in followed[1:]:
        if other.axes != first.axes or abs(other.period - first.period) > 0.01 * first.period:
            raise RecordingError(
                f"{other.name}: {other.axes} axes, a frame every {other.period:g} s; {first.name} has {first.axes}, "
                f"{first.period:g} s; import both with the same --rate"
            )
