"""What was flown for a tuning: flights and seeds of each stage, how and on what, and the sums that tell its files."""

import hashlib
from pathlib import Path

from airflock.certificates import COUNT_BATCH
from airflock.runs import FlightStore
from airflock.scenarios import step_counts
from airflock.search.trial import MAX_FRESH_ROUNDS
from airflock.search.tune.folder import read_plan
from airflock.search.tune.result import CERTIFICATE_FILE, PLAN_FILE, STUDY_FOLDER, TUNED_FILE, TuneResult

STAGES = {
    "search": "search", "race": "candidates that race for the final", "final": "final",
    "again": "best finalists once more", "score": "fitness of the winner", COUNT_BATCH.stage: "certificate",
    "tolerance": "how far numbers may change",
}  # fmt: skip
BY_STAGE = "SELECT stage, count(*), min(seed), max(seed) FROM flight GROUP BY stage"


def flight_rows(result: TuneResult) -> list[tuple[str, str, str]]:
    """What for, number of flights, and their seeds; in the order of the stages."""
    plan = read_plan(result.folder / PLAN_FILE)[0]
    rows = _stored(result.folder / STUDY_FOLDER)
    if result.steps:
        tried, fresh = len(result.steps) - 1, plan.seeds * (1 + MAX_FRESH_ROUNDS)
        rows.append(("hardening: sets that were tried", f"{tried * plan.seeds:,}", f"0 to {plan.seeds - 1}"))
        rows.append(
            (
                "hardening: what was kept",
                f"up to {MAX_FRESH_ROUNDS * plan.seeds:,} a set",
                f"{plan.seeds} to {fresh - 1}",
            )
        )
    return rows + _stored(result.folder / "certificate_flights")


def _stored(folder: Path) -> list[tuple[str, str, str]]:
    """Flights that a folder keeps; those at all values of all numbers together."""
    kept: dict[str, tuple[int, int, int]] = {}
    with FlightStore(folder, write=False) as store:
        for stage, count, low, high in store.rows(BY_STAGE):
            name = str(stage).partition(":")[0]
            n, least, most = kept.get(name, (0, int(low), int(high)))
            kept[name] = (n + int(count), min(least, int(low)), max(most, int(high)))
    return [
        (STAGES.get(name, name), f"{n:,}", f"{least} to {most}")
        for name, (n, least, most) in sorted(kept.items(), key=lambda each: _place(each[0]))
    ]


def _place(stage: str) -> int:
    """Of a stage in their order; others behind."""
    return list(STAGES).index(stage) if stage in STAGES else len(STAGES)


def circumstance_sentences(result: TuneResult) -> list[str]:
    """Sentences: how flights were flown and measured, by which program on which machine, and checksums of the files."""
    made, scenario = result.certificate, result.scenario
    times, dt = step_counts(made.campaign.flown), scenario.flight.dt
    near, look = times["collide_every"] * dt, times["sample_every"] * dt
    document = made.document()
    flown = document["flown"]
    also = ", ".join(f"{name} {value}" for name, value in made.versions.items() if name not in ("airflock", "cpu"))
    tuned = hashlib.sha256((result.folder / TUNED_FILE).read_bytes()).hexdigest()
    return [
        f"Flights of {scenario.flight.duration:g} s in motion steps of {dt:g} s. Distances between agents were looked "
        f"at every {near:g} s, walls, obstacles and all else every {look:g} s.",
        f"Airflock {flown['airflock']}, rules {flown['rules']}, {flown['precision']} bits, device {flown['device']}; "
        f"{made.versions.get('cpu', 'unknown processor')}; {also}.",
        f"Seeds of the certificate follow from the scenario alone (identity {made.campaign.hash[:16]}); no flight that "
        "chose a number is among them.",
        f"{TUNED_FILE}: SHA-256 {tuned}.",
        f"{CERTIFICATE_FILE}: checksum {document['seal']}; "
        f"airflock certify {result.folder / CERTIFICATE_FILE} --check flies one "
        "flight in a hundred again.",
    ]
