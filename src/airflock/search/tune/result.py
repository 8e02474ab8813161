"""The result of a tuning, and the names of the files in its folder."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

from airflock.certificates import Certificate
from airflock.scenarios import Scenario
from airflock.search.result import EvolveResult
from airflock.search.steps import StepResult

PLAN_FILE, START_FILE, STUDY_FOLDER, TUNED_FILE, CERTIFICATE_FILE, STEPS_FILE = (
    "tune.toml", "start.toml", "study", "tuned.toml", "certificate.toml", "hardening.json",
)  # fmt: skip


@dataclass(frozen=True)
class TuneResult:
    """What tuning found: the scenario to fly, and what each stage said.

    start      : the scenario that tuning began from; notes : what was noticed on the way
    result     : of the search
    steps      : of hardening; empty where the law has no recipe, and `why` says so
    seconds    : that it took, s
    identified : what logs said, where it began with logs
    """

    folder: Path
    scenario: Scenario
    start: Scenario
    notes: tuple[str, ...]
    result: EvolveResult
    steps: tuple[StepResult, ...]
    why: str
    certificate: Certificate
    seconds: float
    identify_report: Mapping[str, Any] = field(default_factory=dict)

    @property
    def shown(self) -> bool:
        """Whether the certificate shows all limits."""
        return self.certificate.shown

    def __repr__(self) -> str:
        return f"<Tuned {self.folder / TUNED_FILE}: fitness {self.result.fitness:.3f}; {self.certificate!r}>"

    def _repr_html_(self) -> str:
        """Which file to fly, what its certificate says of the limits, and its keys, for a notebook."""
        head = f"<p><b>{escape(str(self.folder / TUNED_FILE))}</b>, in {self.seconds:.0f} s</p>"
        return head + self.certificate._repr_html_() + self.scenario._repr_html_()

    def document(self) -> dict[str, Any]:
        """What was found as plain values, for --json."""
        return {
            "folder": str(self.folder),
            "tuned": str(self.folder / TUNED_FILE),
            "notes": list(self.notes),
            "evolved": self.result.document(),
            "hardening": [step.as_dict() for step in self.steps],
            "why_not_hardened": self.why,
            "certificate": self.certificate.document(),
            "seconds": self.seconds,
            **({"identified": dict(self.identify_report)} if self.identify_report else {}),
        }
