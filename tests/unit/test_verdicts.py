"""The benchmark of a GPU judges what it measured: bounds hold or are missed, and only disagreement is an error."""

import sys
from pathlib import Path

from needed import needed

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from verdicts import rows, table  # noqa: E402

needed("numba_cuda")
from gpu import LIMITS, Sizes  # noqa: E402

SIZES = Sizes()


def measured(**changes):
    """What the script finds on a machine where everything just holds."""
    evaluations = [
        {"flocks": 100, "speed against CUDA C": 1.0 / 1.2, "airflock per second": 4000.0},
        {"flocks": 15_000, "speed against CUDA C": 0.92, "airflock per second": 10_000.0},
    ]
    found = {
        "evaluations": evaluations,
        "evolution": {"seconds": 8.0},
        "big flock": {"airflock steps per second": 1700.0, "neighbours": 16.0},
        "JAX": {"speed against JAX": 3.0, "apart in float64": 1e-12},
        "agreement": {"order parameters": {"phi_vel": {"z": -3.0}, "phi_corr": {"z": 1.0}}},
        "apart": {"largest difference": 1e-10},
        "second start": {"second": 2.0},
    }  # fmt: skip
    return found | changes


def test_every_bound_is_a_row_and_holds_at_its_edge():
    text, wrong = table(measured(), SIZES)
    assert len(text.splitlines()) == 2 + len(rows(SIZES))
    assert not wrong and text.count("| holds |") == len(rows(SIZES))


def test_a_missed_time_is_no_error_but_a_disagreement_is():
    text, wrong = table(measured(evolution={"seconds": 8.1}), SIZES)
    assert "| 8.1 | misses |" in text and not wrong
    text, wrong = table(measured(apart={"largest difference": 1e-8}), SIZES)
    assert "| 1e-08 | misses |" in text and wrong


def test_what_failed_or_was_left_out_is_not_measured():
    text, wrong = table(measured(evaluations="failed: RuntimeError: no nvrtc"), SIZES)
    assert text.count("not measured") == 3 and wrong
    found = measured()
    del found["JAX"]["speed against JAX"], found["second start"]
    text, wrong = table(found, SIZES)
    assert text.count("not measured") == 2 and not wrong


def test_all_parts_together_end_within_four_minutes():
    assert sum(limit for name, limit in LIMITS.items() if name != "trial") <= 240.0
