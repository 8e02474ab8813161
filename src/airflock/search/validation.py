"""Whether a scenario or study file can be flown, or a recording flown again."""

import os
from collections.abc import Mapping
from typing import Any, NamedTuple

from airflock.engine import plan_of
from airflock.recordings import load_recording, replay_recording
from airflock.scenarios import load
from airflock.search.study import is_study, load_study
from airflock.support import AirflockError


class ValidationReport(NamedTuple):
    """What a valid file is, in one sentence, and notes on it for a person to read."""

    verdict: str
    notes: tuple[str, ...]


def validate(
    name: str | os.PathLike[str], settings: Mapping[str, Any] | None = None, law: Any = None, *, trust: bool = False
) -> ValidationReport:
    """Check a scenario, a study or a recording; a recording is flown again and its bits are compared.

    Parameters
    ----------
    name : str or path
        A preset, a scenario file, a study file, or a recording (.nc).
    settings : mapping, optional
        Keys to change before the check. Of a recording only {"metrics.kind": "mine.py"} and the like: the file of what
        it was flown with and does not hold.
    law : optional
        A flocking law of your own, or one by its name or file, instead of the file's; for a recording that was flown
        with a law of its own, that law.
    trust : bool
        Whether code that the file names may run.

    Returns
    -------
    Valid
        Verdict and notes.

    Raises
    ------
    AirflockError
        With one line for each fault: key, value, unit, allowed range, and the nearest right key.

    Examples
    --------
    >>> import airflock
    >>> airflock.validate("vasarhelyi_2018/4ms").verdict
    'valid; vasarhelyi_2018, 100 agents, 600 s'
    >>> airflock.validate("vasarhelyi_2018/4ms", {"radio.delay": -1.0})
    Traceback (most recent call last):
    airflock.support.errors.ScenarioError: vasarhelyi_2018/4ms: radio.delay = -1 s lies outside [0, 30] s
    """
    text = str(name)
    if text.lower().endswith(".nc"):
        same, differences = replay_recording(load_recording(name), law, settings, trust=trust)
        if not same:
            told = "".join(f"\n{text}: {line}" for line in differences)
            reason = "see below" if differences else "although nothing relevant differs"
            raise AirflockError(f"{text}: flown again, the positions differ, {reason}{told}")
        return ValidationReport("flown again with the same bits", tuple(differences))
    if is_study(text):
        if law is not None:
            raise AirflockError(f"{text}: is a study; --law is for scenarios and recordings")
        study = load_study(text, settings=settings, trust=trust)
        for scenario in study.scenarios:
            plan_of(scenario)
        where = ", ".join(study.labels)
        what = f"{len(study.space.axes)} parameters of {where} vary"
        return ValidationReport(f"valid study; {what}; begin it with airflock evolve {text} --out DIR", ())
    found = load(name, settings, law, trust=trust)
    plan_of(found)  # probes the rules
    return ValidationReport(
        f"valid; {found.model.name}, {found.agents} agents, {found.flight.duration:g} s", found.notes
    )
