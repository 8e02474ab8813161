"""From tracks to the law that explains them: `infer`, and what it found."""

import datetime
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.errors import AirflockError, RecordingError
from airflock.infer import select
from airflock.infer.bootstrap import Again, Noise, again
from airflock.infer.candidates import Candidate, candidate, scenarios_of
from airflock.infer.fit import Fit
from airflock.infer.leftover import left_over
from airflock.infer.likelihood import Model
from airflock.infer.maps import Maps, maps
from airflock.infer.predictive import Check, posterior
from airflock.infer.tracks import Scale, Tracks, scale_of, tracks_of
from airflock.recordings.files import load_recording
from airflock.recordings.imports.load import load_tracks
from airflock.scenarios.making import make
from airflock.scenarios.scenario import Scenario

Array = NDArray[np.float64]
LAWS = ("couzin_2002", "reynolds_1987", "vicsek_1995", "vasarhelyi_2018")
SURE = 2.0  # standard errors by which a law must predict better than going straight on, and
MOST = 0.75  # share of the spans in which it must
APART = 2.0  # standard errors by which the best law must be ahead of the second
MISSED = 0.05  # share that is worth a word
EDGE = 0.01  # of a range: nearer to its end nothing is told


@dataclass(frozen=True)
class Number:
    """A number of a law: value and 95 % interval; an end of it is None where the tracks set no limit."""

    key: str
    value: float
    low: float | None
    high: float | None
    unit: str


@dataclass
class Law:
    """How well one law explains the tracks.

    gain, error : log-likelihood of held-out steps above that of going straight on, and its standard error
    ahead       : share of spans in which it predicts better
    price       : gain that so many numbers bring by chance: half of each times log(steps) (Schwarz 1978)
    criterion   : Akaike's, of the fit, below that of going straight on; negative is better
    inside      : share of held-out differences within the 95 % that are predicted
    missed      : share of what is explained with a free sum of forces added that the law alone leaves over, 0 to 1
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
        return make(document, f"{self.best.name}, inferred", law=own.model, vehicle=own.vehicle, sensor=own.sensor)


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
        Of the search for the best fit.
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
    airflock.errors.AirflockError: infer: no laws to choose from; give models, such as couzin_2002
    >>> found = airflock.infer("fish.nc")  # doctest: +SKIP
    >>> found.verdict  # doctest: +SKIP
    'couzin_2002 explains the tracks best'
    """
    if not models:
        raise AirflockError("infer: no laws to choose from; give models, such as couzin_2002")
    say = done or (lambda _: None)
    settings = dict(settings or {})
    scenarios, box = scenarios_of(models, settings, trust=trust)
    recordings = recordings_of(tracks)
    followed = [tracks_of(recording, name, box=box) for name, recording in recordings]
    _alike(followed)
    scale = scale_of(followed)
    candidates = [candidate(each, scale, followed[0].axes) for each in scenarios]
    reference, straight = select.straight(followed, scale)
    plain = select.hold_out(reference, straight, lambda: say("going straight on"))
    gains = straight.place[reference.named :]
    fitted = []
    for law in candidates:
        tell = _teller(say, law.name)
        model, found = select.fit(law, followed, scale, gains, seed, tell)
        held = select.hold_out(model, found, tell)
        fitted.append((_law(law.name, model, found, held, plain, straight, scale), model))
    fitted.sort(key=lambda pair: -pair[0].gain)
    laws = [law for law, _ in fitted]
    best, verdict = _verdict(laws)
    spans = select.sample(reference)
    frames = sum(each[1] - each[0] for each in (followed[t].spans[s] for t, s in (reference.spans[k] for k in spans)))
    every = sum(len(each.seen) for each in followed)
    individuals = max(each.individuals for each in followed)
    found_all = Inferred(
        laws, best, verdict, sum(each.counted for each in followed), (frames, every), scale, individuals
    )
    if best is not None:
        model, best.fit = select.simpler(fitted[0][1], best.fit, scale, seed, _teller(say, f"{best.name}, simplified"))
        held = select.hold_out(model, best.fit, lambda: None)
        best = laws[0] = _law(best.name, model, best.fit, held, plain, straight, scale)
        found_all.best, found_all.verdict = _verdict(laws)
    if found_all.best is not None:
        best = found_all.best
        sure = again(model, best.fit.place, best.fit.free, spans, _teller(say, f"{best.name}, flown again"))
        _tell(found_all, model, sure)
        if check:
            found_all.check = posterior(model, sure.place, sure.noise, check, _teller(say, "check"))
    return found_all


def _teller(say: Callable[[str], None], name: str) -> Callable[[], None]:
    return lambda: say(name)


def recordings_of(what: Any) -> list[tuple[str, xr.Dataset]]:
    """Recordings by name: given ones, saved ones, or files that `load_tracks` reads without being told more."""
    several: Iterable[Any] = [what] if isinstance(what, (xr.Dataset, str, Path)) else what
    found = []
    for number, each in enumerate(several, 1):
        if isinstance(each, xr.Dataset):
            found.append((f"recording {number}", each))
        elif str(each).endswith(".nc"):
            found.append((str(each), load_recording(each)))
        else:
            found.append((str(each), load_tracks(each)))
    if not found:
        raise RecordingError("no tracks to infer a law from")
    return found


def _alike(followed: Sequence[Tracks]) -> None:
    first = followed[0]
    for other in followed[1:]:
        if other.axes != first.axes or abs(other.period - first.period) > 0.01 * first.period:
            raise RecordingError(
                f"{other.name}: {other.axes} axes, a frame every {other.period:g} s; {first.name} has {first.axes}, "
                f"{first.period:g} s; import both with the same --rate"
            )


def _law(
    name: str, model: Model, found: Fit, held: select.Held, plain: select.Held, straight: Fit, scale: Scale
) -> Law:
    ahead = plain.surprise - held.surprise
    spans = len(ahead)
    assert model.law is not None
    numbers = {
        n.key: Number(n.key, n.value(found.place[k]), None, None, n.unit)
        for k, n in enumerate(model.numbers[: model.named])
    }
    bare = found.score.loss() + len(found.free), straight.score.loss() + len(straight.free)
    spans_of_fit = select.sample(model)
    left, gained = left_over(model, found.place, spans_of_fit), max(straight.score.loss() - found.score.loss(), 0.0)
    return Law(
        name, float(ahead.sum()), float(np.sqrt(spans) * ahead.std(ddof=1)), float((ahead > 0.0).mean()),
        0.5 * len(numbers) * math.log(max(sum(each.counted for each in model.tracks), 2)),
        2.0 * (bare[0] - bare[1]), held.inside,
        left / max(gained + left, 1e-9), numbers, model.law, found, maps(model, found.place, scale, spans_of_fit),
        held.surprise,
    )  # fmt: skip


def _verdict(laws: list[Law]) -> tuple[Law | None, str]:
    """The law that explains the tracks, if one does, and the line that says so."""
    best = laws[0]
    if not (best.gain > max(SURE * best.error, best.price) and best.ahead >= MOST):
        return None, "none of these explains the tracks better than going straight on"
    missed = (
        f"; a free sum of forces would explain {best.missed:.0%} of the whole beside it" if best.missed > 0.05 else ""
    )
    if len(laws) > 1:
        ahead = laws[1].surprise - best.surprise
        error = float(np.sqrt(len(ahead)) * ahead.std(ddof=1))
        if ahead.sum() < APART * error:
            return best, f"{best.name} explains the tracks best, but {laws[1].name} cannot be told from it{missed}"
    return best, f"{best.name} explains the tracks best{missed}"


def _tell(found: Inferred, model: Model, sure: Again) -> None:
    """Write the numbers of the best law, put right, with their intervals."""
    assert found.best is not None
    numbers: dict[str, Number] = {}
    for k, n in enumerate(model.numbers[: model.named]):
        low, high = sure.low[k], sure.high[k]
        numbers[n.key] = Number(
            n.key, n.value(sure.place[k]), n.value(low) if low > EDGE else None,
            n.value(high) if high < 1.0 - EDGE else None, n.unit,
        )  # fmt: skip
    noise = sure.noise
    known = {n.column: (n.key, n.unit) for n in found.best.candidate.noises}
    if found.best.candidate.body_noise >= 0:
        known[found.best.candidate.body_noise] = ("body.noise", "m^2/s^3")
    if noise.column in known:
        key, unit = known[noise.column]
        numbers[key] = Number(key, noise.law, sure.noise_low, sure.noise_high, unit)
    found.best.numbers, found.noise = numbers, noise
    today = datetime.date.today().isoformat()
    found.settings = {key: number.value for key, number in numbers.items()}
    found.sources = {key: f"infer, {today}: {interval(number)}" for key, number in numbers.items()}


def interval(number: Number) -> str:
    """A 95 % interval in words."""
    if number.low is None and number.high is None:
        return "not told by the tracks"
    if number.low is None:
        return f"at most {number.high:.4g}"
    if number.high is None:
        return f"at least {number.low:.4g}"
    return f"95 % in {number.low:.4g} to {number.high:.4g}"


def _short(value: float) -> float:
    return float(f"{value:.4g}") if math.isfinite(value) else value
