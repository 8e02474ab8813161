"""What must turn a claim red is made and seen to do so; verdicts of the small form are compared and kept."""

import json
import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

import airflock
import airflock_papers
from airflock.cli.main import app
from airflock.support.errors import AirflockError
from airflock_papers import breaks, quick, statistics
from airflock_papers.claims import Claim, Measured, read_claims
from airflock_papers.flights import Flights, scenario_keys, with_changes
from airflock_papers.paper import Paper
from airflock_papers.statements import Statement, read
from airflock_papers.vasarhelyi_2018.optima import STOPS, evolved


def statement(name: str, bound: str, changes: dict) -> Statement:
    return Statement(
        id=f"part.{name}", kind="ours", where="here", statement="a saying", quantity="n_coll", at="here",
        bound=bound, breaks=changes,
    )  # fmt: skip


def fly(parts, flights):
    """Collisions fall with p_rep; what is called flat does not know of it."""
    scenario = flights.as_changed(airflock.load("vasarhelyi_2018/4ms"))
    n = 0.0 if scenario.parameters.p_rep > 0.01 else 9.0
    values = {"falls": [n, n], "flat": [0.0, 0.0], "never": [1.0, 1.0]}
    asked = {k: v for k, v in values.items() if flights.wanted is None or f"part.{k}" in flights.wanted}
    return [Measured(f"part.{k}", "n_coll", "here", statistics.mean(v)) for k, v in asked.items()], {}


PAPER = Paper("A paper", "none", ("part",), fly)
STATEMENTS = [
    statement("falls", "ours == 0", {"model.p_rep": 0.0}),
    statement("flat", "ours == 0", {"model.p_rep": 0.0}),
    statement("never", "ours == 0", {"model.p_rep": 0.0}),
]


def test_a_claim_turns_red_under_its_change_or_is_told_to_say_nothing() -> None:
    found = {row.id: row for row in breaks.of(PAPER, STATEMENTS, None, Flights(quick=True))}
    assert {name: row.result for name, row in found.items()} == {
        "part.falls": breaks.RED, "part.flat": breaks.GREEN, "part.never": breaks.UNSHOWN,
    }  # fmt: skip
    assert found["part.falls"].ours == 0.0 and found["part.falls"].changed == 9.0


def test_a_change_is_not_flown_for_a_claim_that_is_red_without_it() -> None:
    flown: list[dict] = []

    def counted(parts, flights):
        flown.append(dict(flights.changes))
        return fly(parts, flights)

    (found,) = breaks.of(Paper("A paper", "none", ("part",), counted), STATEMENTS[2:], None, Flights(quick=True))
    assert flown == [{}]
    assert found.result == breaks.UNSHOWN and found.ours == 1.0 and math.isnan(found.changed)


def test_a_part_without_changes_is_refused() -> None:
    with pytest.raises(AirflockError, match="no claim of other names a change; parts that do: part"):
        breaks.of(PAPER, STATEMENTS, "other", Flights())


def test_a_change_sets_or_multiplies_what_a_scenario_has() -> None:
    scenario = airflock.load("vasarhelyi_2018/4ms")
    halved = with_changes(scenario, {"model.r0_rep": "times 0.5", "agents": 7, "duration": "times 2"})
    assert halved.parameters.r0_rep == pytest.approx(0.5 * scenario.parameters.r0_rep)
    assert halved.agents == 7 and halved.flight.duration == 2.0 * scenario.flight.duration


@pytest.mark.parametrize("name", airflock_papers.PAPERS)
def test_every_change_is_of_keys_that_scenarios_have(name: str) -> None:
    presets = {
        "kidger": "kidger/city", "vasarhelyi_2018": "vasarhelyi_2018/4ms", "zapotecatl_2016": "zapotecatl_2016/best",
        "dimock_2003": "dimock_2003/published",
    }  # fmt: skip
    searches = {"search.stops": set(STOPS), "search.generations": {1, 5}}
    for found in breaks.load(f"airflock_papers.{name}").values():
        if found.breaks:
            before = airflock.load(presets[name])
            keys = scenario_keys(found.breaks)
            after = with_changes(before, keys)
            assert all(found.breaks[key] in searches[key] for key in set(found.breaks) - set(keys)), found.id
            for key, value in keys.items():
                section, _, field = key.rpartition(".")
                old, new = (
                    getattr(each.records[section] if section else each.flight, field) for each in (before, after)
                )
                wanted = old * float(value[6:]) if str(value).startswith("times ") else value
                assert list(new) == wanted if isinstance(wanted, list) else new == wanted, found.id


def test_a_search_that_stops_at_an_end_of_its_space_has_its_lowest_or_highest_numbers() -> None:
    low, middle, high = (evolved(4, stops).parameters for stops in STOPS)
    assert (low.r0_rep, middle.r0_rep, high.r0_rep) == pytest.approx((10.0, 35.0, 60.0))
    assert evolved(4).parameters.r0_rep == pytest.approx(airflock.load("vasarhelyi_2018/evolved_4ms").parameters.r0_rep)


def test_a_table_of_statements_fills_names_in_their_changes_too() -> None:
    text = """
    [[statement]]
    id = "part.{v}"
    kind = "ours"
    statement = "at {v} m/s"
    where = "here"
    breaks = { "search.stops" = "{end}", "model.p_rep" = 0.0 }
    each = [{ v = 4, end = "low" }, { v = 6, end = "high" }]
    """
    found = read(text, "a file")
    assert found["part.4"].breaks == {"search.stops": "low", "model.p_rep": 0.0}
    assert found["part.6"].breaks["search.stops"] == "high" and found["part.6"].statement == "at 6 m/s"


def test_only_verdicts_that_differ_are_told() -> None:
    old = [quick.Verdict("p", "a", "x", "holds", 1.0, "zen"), quick.Verdict("p", "a", "y", "holds", 1.0, "zen")]
    new = [old[0]._replace(ours=2.0), quick.Verdict("p", "a", "z", "finding", 3.0, "zen")]
    assert quick.changed(old, new) == [("p", "y", "holds", "", ""), ("p", "z", "", "finding", "")]


def test_flights_of_another_processor_are_other_flights() -> None:
    old = [quick.Verdict("p", "a", name, "holds", 1.0, "zen") for name in "xy"]
    new = [old[0]._replace(verdict="does not hold", processor="lake"), old[1]._replace(verdict="does not hold")]
    here, there = (row.elsewhere for row in quick.changed(old, new))
    assert (here, there) == ("zen", "")  # what the same kind of processor judges otherwise is a fault
    gone, told = quick.changed(old, [new[0]])  # what few flights elsewhere do not have is none
    assert (gone.id, gone.elsewhere) == ("x", "zen") and (told.found, told.elsewhere) == ("", "zen")


def test_a_part_that_was_flown_is_not_flown_again_unless_the_texts_changed(tmp_path, monkeypatch) -> None:
    flown = []

    def fly_part(name, part, threads, tell):
        flown.append((name, part))
        tell("flights", 1, 2)
        if part == "last" and len(flown) == 2:
            raise KeyboardInterrupt
        return [(f"{part}.claim", "holds", 0.5)]

    monkeypatch.setattr(quick, "parts", lambda: [("one", "first"), ("one", "last")])
    monkeypatch.setattr(quick, "_flown", fly_part)
    said: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        quick.fly(tmp_path, said.append)
    rows = quick.fly(tmp_path, said.append)
    assert flown == [("one", "first"), ("one", "last"), ("one", "last")]
    assert [row.id for row in rows] == ["first.claim", "last.claim"]
    assert said[0] == "1/2 one first: flights, 1 of 2" and said[0] in (tmp_path / "log.txt").read_text()
    kept = tmp_path / "one.first.json"
    kept.write_text(json.dumps(json.loads(kept.read_text()) | {"texts": "others"}))
    quick.fly(tmp_path, said.append)
    assert flown[3:] == [("one", "first")]
    for damaged in ("[]", "{", '{"texts": "x"}', '{"verdicts": [[1]]}'):
        kept.write_text(damaged)
        assert quick._kept(kept, "x") is None


def test_the_committed_verdicts_are_of_known_claims_and_parts() -> None:
    rows = quick.committed()
    silent = {("kidger", "readings")}  # a table without a claim
    assert {(row.paper, row.part) for row in rows} | silent == set(quick.parts())
    for name in airflock_papers.PAPERS:
        known = breaks.load(f"airflock_papers.{name}")
        assert {row.id for row in rows if row.paper == name} <= set(known), name


ROOT = Path(__file__).parents[2] / "papers"


@pytest.mark.parametrize("name", airflock_papers.PAPERS)
def test_no_sentence_that_is_reproduced_still_holds_under_its_change(name: str) -> None:
    """Each was seen red, or the table says that its change was not made yet, or with too few flights."""
    good = {claim.id for path in (ROOT / name).glob("*.toml") for claim in read_claims(path)[1] if _holds(claim)}
    rows = {row.id: row.result for row in breaks.committed() if row.paper == name}
    assert good <= set(rows)
    assert all(rows[claim] != breaks.GREEN for claim in good)


@pytest.mark.parametrize("name", airflock_papers.PAPERS)
def test_every_sentence_that_is_judged_names_its_change_and_what_came_of_it(name: str) -> None:
    judged = {
        claim.id for path in (ROOT / name).glob("*.toml") for claim in read_claims(path)[1]
        if claim.verdict in ("reproduced", "not reproduced")
    }  # fmt: skip
    rows = {row.id: row for row in breaks.committed() if row.paper == name}
    assert judged <= set(rows)
    stated = breaks.load(f"airflock_papers.{name}")
    assert all(rows[id].change for id in judged)
    assert all(stated[id].breaks or rows[id].result == breaks.ALREADY for id in judged)  # who can turn red is flown


@pytest.mark.parametrize("name", airflock_papers.PAPERS)
def test_red_as_they_are_are_the_sentences_that_their_page_does_not_count_as_reproduced(name: str) -> None:
    pages = {claim.id: claim.verdict for path in (ROOT / name).glob("*.toml") for claim in read_claims(path)[1]}
    for row in breaks.committed():
        if row.paper == name:
            assert (row.result == breaks.ALREADY) == (pages.get(row.id) == "not reproduced"), row


def _holds(claim: Claim) -> bool:
    return claim.kind == "paper" and claim.verdict == breaks.GOOD["paper"]


def test_the_committed_changes_are_those_of_the_statements() -> None:
    rows = breaks.committed()
    for name in airflock_papers.PAPERS:
        told = {row.id: (row.part, row.change) for row in rows if row.paper == name}
        statements = breaks.load(f"airflock_papers.{name}").values()
        keys = {s.id: (breaks.part_of(s), breaks.in_words(s.breaks)) for s in statements if s.breaks}
        words = {s.id: (breaks.part_of(s), s.fails_if) for s in statements if s.kind == "paper" and s.bound}
        assert told == words | keys


ROWS = [
    breaks.Row("kidger", "first", "first.a", "x = 1", breaks.RED, "0.5", "nan", "zen"),
    breaks.Row("kidger", "last", "last.a", "x = 1", breaks.UNSHOWN),
    breaks.Row("kidger", "last", "last.b", "x = 2", breaks.ALREADY),
]


def broken(flown: list):
    """A flight of changes that is cut off at the second part, once."""

    def fly(paper, *, only, seeds, threads, progress, ids):
        flown.append((only, seeds, sorted(ids)))
        progress("flights", 1, 2)
        if only == "last" and len(flown) == 2:
            raise KeyboardInterrupt
        return [breaks.Break(f"{only}.a", only, "x = 1", breaks.RED, 0.5, math.nan)]

    return fly


def test_changes_of_all_papers_go_on_where_they_were_cut_off_and_leave_out_claims_that_are_red_as_they_are(
    tmp_path, monkeypatch
) -> None:
    flown: list = []
    monkeypatch.setattr(breaks, "committed", lambda: ROWS)
    monkeypatch.setattr(breaks, "SEEDS", {("kidger", "last"): 7})
    monkeypatch.setattr(breaks, "processor_kind", lambda: "zen")
    monkeypatch.setattr(breaks, "fly", broken(flown))
    with pytest.raises(KeyboardInterrupt):
        breaks.fly_all(tmp_path, print)
    rows = breaks.fly_all(tmp_path, print)
    assert flown == [("first", None, ["first.a"]), ("last", 7, ["last.a"]), ("last", 7, ["last.a"])]
    assert rows == [ROWS[0], ROWS[1]._replace(result=breaks.RED, ours="0.5", changed="nan", processor="zen"), ROWS[2]]
    kept = tmp_path / "kidger.first.breaks.json"
    assert breaks._kept(kept, json.loads(kept.read_text())["texts"], {"first.a"}) == ROWS[:1]
    assert breaks._kept(kept, json.loads(kept.read_text())["texts"], {"first.a", "first.b"}) is None
    assert breaks._kept(kept, "others", {"first.a"}) is None
    monkeypatch.setattr(breaks, "processor_kind", lambda: "lake")  # where other flights were kept
    elsewhere = breaks.fly_all(tmp_path, print)
    assert flown[3:] == flown[:2] and [row.processor for row in elsewhere] == ["lake", "lake", ""]


def test_claims_that_their_change_does_not_break_are_listed() -> None:
    rows = ROWS[:1]
    lost = [rows[0]._replace(result=breaks.UNSHOWN), rows[0]._replace(id="other", result=breaks.GREEN)]
    assert breaks.worse(rows, rows) == []
    assert breaks.worse(rows, lost) == [(lost[0], ""), (lost[1], "")]
    assert breaks.worse(lost, lost) == [(lost[1], "")]  # never seen red, it cannot get worse; what still holds is told


def test_few_flights_on_another_processor_are_not_judged_and_a_claim_that_still_holds_is_judged_everywhere() -> None:
    red = ROWS[0]
    for result in (breaks.UNSHOWN, breaks.UNMEASURED):
        lost = red._replace(result=result, processor="lake")
        assert breaks.worse([red], [lost]) == [(lost, "zen")]
        assert breaks.worse([red._replace(processor="")], [lost]) == [(lost, "")]  # where it flew was not kept
        assert breaks.worse([red._replace(processor="lake")], [lost]) == [(lost, "")]
    holds = red._replace(result=breaks.GREEN, processor="lake")
    assert breaks.worse([red], [holds]) == [(holds, "")]


@pytest.mark.parametrize(("result", "status"), [(breaks.RED, 0), (breaks.UNSHOWN, 0), (breaks.GREEN, 1)])
def test_all_breaks_fails_only_for_claims_that_are_judged(result, status, tmp_path, monkeypatch) -> None:
    flown = ROWS[0]._replace(result=result, processor="lake")
    monkeypatch.setattr(breaks, "committed", lambda: ROWS[:1])
    monkeypatch.setattr(breaks, "fly_all", lambda folder, say, threads: [flown])
    command = ["paper", "all", "--breaks", "--keep", str(tmp_path)]
    found = CliRunner().invoke(app, command)
    assert found.exit_code == status and f"1 claims under their changes: 1 {result}" in found.output
    assert ("(not judged: turned red on zen)" in found.output) == (result == breaks.UNSHOWN)
    (claim,) = json.loads(CliRunner().invoke(app, [*command, "--json"]).output)["worse"] or [{}]
    assert claim.get("elsewhere") == {breaks.RED: None, breaks.UNSHOWN: "zen", breaks.GREEN: ""}[result]
