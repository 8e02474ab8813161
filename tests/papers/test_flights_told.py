"""How far the flights of a paper are, where no terminal is."""

from types import SimpleNamespace

from airflock_papers import progress


def test_a_log_has_a_line_every_ten_seconds_and_none_of_short_work(capsys, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: now[0]))
    with progress.progress_bar() as tell:
        for done in range(61):  # a flight each 0.5 s, half a minute in all
            now[0] = 0.5 * done
            tell("Table S2", done, 1_600)
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["Table S2, 20 of 1,600", "Table S2, 40 of 1,600", "Table S2, 60 of 1,600"]
    with progress.progress_bar() as tell:
        tell("Table S2", 0, 1_600)
    assert capsys.readouterr().err == ""
