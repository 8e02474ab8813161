"""Progress of long work in a log: when a line is told, what it says of the time that is left."""

import math

import pytest
from hypothesis import given, strategies as st

from airflock.cli.terminal import (
    FIRST_LINE_AFTER,
    LINE_INTERVAL,
    LogProgress,
    TimeLeft,
    counting_parts,
    format_duration,
    progress_line,
)


class Clock:
    """A clock that a test moves."""

    now = 0.0

    def __call__(self):
        return self.now


def told(capsys, moments, total=None):
    """Moments (s) at which a log told of work that went on at each of `moments`, and its lines."""
    clock, found = Clock(), []
    log = LogProgress(clock)
    for k, clock.now in enumerate(moments):
        log.update("flying", k, total)
        found += [(clock.now, text) for text in capsys.readouterr().err.splitlines()]
    return [moment for moment, _ in found], [text for _, text in found]


def test_what_is_soon_over_says_nothing(capsys):
    assert told(capsys, range(math.ceil(FIRST_LINE_AFTER)))[0] == []


def test_lines_are_rarer_the_longer_work_takes(capsys):
    moments, _ = told(capsys, range(24 * 3600))
    assert moments[:3] == [FIRST_LINE_AFTER, FIRST_LINE_AFTER + LINE_INTERVAL, FIRST_LINE_AFTER + 2 * LINE_INTERVAL]
    gaps = [b - a for a, b in zip(moments, moments[1:], strict=False)]
    assert all(
        max(LINE_INTERVAL, 0.1 * a) <= gap <= max(LINE_INTERVAL, 0.1 * a) + 1.0
        for a, gap in zip(moments, gaps, strict=False)
    )
    assert len(moments) == pytest.approx(300.0 / LINE_INTERVAL + math.log(86400.0 / 300.0) / math.log(1.1), abs=2)


def test_a_line_says_how_much_is_done_and_what_is_left(capsys):
    _, lines = told(capsys, range(41), total=2000)  # a flight each second
    assert lines == ["flying: 10 of 2,000 (0%), 33 min left", "flying: 40 of 2,000 (2%), 33 min left"]
    assert told(capsys, range(12))[1] == ["flying: 10"]  # nobody knows how much there is


@given(st.floats(0.1, 10.0), st.integers(0, 500), st.integers(1, 400))
def test_steady_work_ends_when_it_was_said_to(rate, before, more):
    """Also where a run that was cut off did some of it before, in no time; and other work has a pace of its own."""
    clock = Clock()
    pace = TimeLeft(clock)
    total = before + more
    for k in range(more + 1):
        clock.now = k / rate
        pace.update(before + k, total)
        assert (pace.left is None) == (k == 0)
        if k:
            assert pace.left == pytest.approx((more - k) / rate, abs=1e-6)
    clock.now += 100.0
    pace.update(0 if total > 0 else -1, 10)
    assert pace.left is None
    clock.now += 5.0
    pace.update(1, 10)
    assert pace.left == pytest.approx(45.0)


def test_times_are_spoken():
    assert [format_duration(s) for s in (9.6, 99.0, 600.0, 5940.0, 12600.0)] == [
        "10 s",
        "99 s",
        "10 min",
        "99 min",
        "3.5 h",
    ]


def test_a_command_that_is_quiet_tells_nothing(capsys, monkeypatch):
    monkeypatch.setattr("airflock.cli.terminal.FIRST_LINE_AFTER", 0.0)
    with counting_parts("flights", 2, quiet=True) as done:
        done()
    with progress_line(quiet=True) as silent:
        silent.say("a limit cannot be shown")
    assert capsys.readouterr().err == ""
    with counting_parts("flights", 2) as done:
        done()
    assert capsys.readouterr().err == "flights: 0 of 2 (0%)\n"  # the next one is not due
