"""Rows of a study's store that somebody tampered with are one line, and none is taken for a number."""

import math

import pytest

from airflock.runs.executors import Flight, FlightResult
from airflock.runs.flight_store import FILE, CandidateBatch, FlightStore
from airflock.search import study_result as tables
from airflock.support.errors import StudyError

BATCH = CandidateBatch("search", 0, 0)


@pytest.fixture
def store(tmp_path):
    with FlightStore(tmp_path) as found:
        found.begin({})
        found.ask(BATCH, [[0.5, 0.1], [0.25, 0.2]], [{"model.p_rep": 0.1}, {"model.p_rep": 0.2}])
        for i in range(2):
            found.land(BATCH, FlightResult(Flight(i, 0, {}, 7), {"fitness": 0.5, "lost": math.nan}))
        found.tell(BATCH, [[0.5], [None]])
        yield found


def read(store):
    """Everything that is read of a store."""
    return (
        store.asked(BATCH),
        store.flown(BATCH),
        tables.candidate_table(store, ["fitness"]).to_dict("list"),
        tables.flight_table(store).to_dict("list"),
    )


def test_a_sound_store_is_read_as_it_was_written(store):
    points, flown, candidates, flights = read(store)
    assert points == [[0.5, 0.1], [0.25, 0.2]] and flown[0, 0]["fitness"] == 0.5 and math.isnan(flown[1, 0]["lost"])
    assert candidates["model.p_rep"] == [0.1, 0.2] and math.isnan(candidates["fitness"][1])
    assert flights["seed"] == [7, 7]


@pytest.mark.parametrize(
    "value", ["", "x", "[1", "5", "[]", '["a"]', "{}", "[" * 5000, "1e999", b"\x00\xff", 7, "[NaN, 1]"]
)
@pytest.mark.parametrize("column", ["point", "parameters", "fitness", "scores"])
def test_a_tampered_row_is_one_line_or_another_row(store, column, value):
    table = "flight" if column == "scores" else "candidate"
    before = read(store)
    store.connection.execute(f"UPDATE {table} SET {column}=? WHERE candidate=0", (value,))
    try:
        after = read(store)
    except StudyError as fault:
        assert "\n" not in str(fault) and FILE in str(fault) and "cannot be used: " not in str(fault)
    else:  # an empty object says nothing, and nothing is made of it
        assert value in ("{}", "") and column in ("parameters", "scores") and str(after) != str(before)


def test_what_is_no_database_does_not_claim_that_flights_are_kept(tmp_path):
    (tmp_path / FILE).write_bytes(b"no database" * 1000)
    with pytest.raises(StudyError, match="file is not a database; its flights cannot be read"):
        FlightStore(tmp_path)
