"""What came of every change: kept part by part, committed beside the rows that stay, and judged where it may be."""

import json

import pytest
from typer.testing import CliRunner

from airflock.cli.main import app
from airflock.errors import AirflockError
from airflock_papers import breaks, campaign
from airflock_papers.statements import Statement

ROWS = [
    campaign.Row("kidger", "first", "first.a", "x = 1", breaks.RED, "0.5", "nan", "zen"),
    campaign.Row("kidger", "last", "last.a", "x = 1", campaign.UNMADE),
    campaign.Row("kidger", "last", "last.b", "x = 2", breaks.ALREADY),
]


def broken(flown: list, result: str = breaks.RED):
    """A flight of changes that is cut off at the second part, once."""

    def fly(paper, *, only, seeds, threads, progress, ids):
        flown.append((only, seeds, sorted(ids)))
        progress("flights", 1, 2)
        if only == "last" and len(flown) == 2:
            raise KeyboardInterrupt
        return [breaks.Break(f"{only}.a", only, "x = 1", result, 0.5, float("nan"))]

    return fly


def test_a_campaign_goes_on_where_it_was_cut_off_and_leaves_out_what_is_red_as_it_is(tmp_path, monkeypatch) -> None:
    flown: list = []
    monkeypatch.setattr(campaign, "committed", lambda: ROWS)
    monkeypatch.setattr(campaign, "SEEDS", {("kidger", "last"): 7})
    monkeypatch.setattr(campaign, "kind", lambda: "zen")
    monkeypatch.setattr(breaks, "fly", broken(flown))
    with pytest.raises(KeyboardInterrupt):
        campaign.fly(tmp_path, print)
    rows = campaign.fly(tmp_path, print)
    assert flown == [("first", None, ["first.a"]), ("last", 7, ["last.a"]), ("last", 7, ["last.a"])]
    assert rows == [ROWS[0], ROWS[1]._replace(result=breaks.RED, ours="0.5", changed="nan", processor="zen"), ROWS[2]]
    kept = tmp_path / "kidger.first.breaks.json"
    assert campaign._kept(kept, json.loads(kept.read_text())["texts"], {"first.a"}) == ROWS[:1]
    assert campaign._kept(kept, json.loads(kept.read_text())["texts"], {"first.a", "first.b"}) is None
    assert campaign._kept(kept, "others", {"first.a"}) is None
    monkeypatch.setattr(campaign, "kind", lambda: "lake")  # where other flights were kept
    elsewhere = campaign.fly(tmp_path, print)
    assert flown[3:] == flown[:2] and [row.processor for row in elsewhere] == ["lake", "lake", ""]


def test_what_a_campaign_found_is_committed_part_by_part_beside_the_rows_that_stay(tmp_path, monkeypatch) -> None:
    table, flown = tmp_path / "breaks.csv", []
    monkeypatch.setattr(campaign, "committed", lambda: ROWS)
    monkeypatch.setattr(campaign, "kind", lambda: "zen")
    monkeypatch.setattr(campaign, "as_stated", lambda rows, statements: rows)
    monkeypatch.setattr(campaign, "verdicts", lambda papers: {("kidger", "last.b"): "not reproduced"})
    monkeypatch.setattr(breaks, "fly", broken(flown))
    with pytest.raises(AirflockError, match=r"kidger\.lost: no such part; known: kidger\.first, kidger\.last"):
        campaign.renew(tmp_path, tmp_path, table, ["kidger.lost"], True)
    with pytest.raises(KeyboardInterrupt):
        campaign.renew(tmp_path, tmp_path, table, ["kidger.first", "kidger.last"])
    assert table.read_text().splitlines()[1:] == [",".join(row) for row in ROWS]
    campaign.renew(tmp_path, tmp_path, table, only_open=True)
    assert [part for part, *_ in flown] == ["first", "last", "last"]
    assert table.read_text().splitlines()[2] == f"kidger,last,last.a,x = 1,{breaks.RED},0.5,nan,zen"


def test_a_sentence_that_its_page_does_not_count_as_reproduced_has_nothing_to_break() -> None:
    pages = {("kidger", "last.a"): "not reproduced", ("kidger", "last.b"): "reproduced"}
    judged = campaign.as_judged(ROWS, pages)
    assert [row.result for row in judged] == [breaks.RED, breaks.ALREADY, campaign.UNMADE]
    lost = campaign.as_judged(ROWS, {("kidger", "first.a"): "not reproduced"})
    assert lost[0] == ROWS[0]._replace(result=breaks.ALREADY)  # few flights had seen it red, those of its page had not


def test_a_row_is_of_the_change_that_its_statement_names_now() -> None:
    stated = [
        Statement(
            id=f"part.{name}", kind="ours", where="here", statement="a saying", quantity="n_coll", at="here",
            bound="ours == 0", breaks={"x": value},
        )
        for name, value in (("a", 1), ("b", 2), ("c", 3))
    ]  # fmt: skip
    before = [campaign.Row("kidger", "part", f"part.{n}", "x = 1", breaks.RED, "0", "9") for n in "ab"]
    after = campaign.as_stated(before, {"kidger": stated})
    assert after == [
        before[0],
        campaign.Row("kidger", "part", "part.b", "x = 2", campaign.UNMADE),
        campaign.Row("kidger", "part", "part.c", "x = 3", campaign.UNMADE),
    ]


def test_what_got_worse_is_told() -> None:
    rows = ROWS[:1]
    lost = [rows[0]._replace(result=breaks.UNSHOWN), rows[0]._replace(id="other", result=breaks.GREEN)]
    assert campaign.worse(rows, rows) == []
    assert campaign.worse(rows, lost) == [(lost[0], ""), (lost[1], "")]
    assert campaign.worse(lost, lost) == [
        (lost[1], "")
    ]  # never seen red, it cannot get worse; what still holds is told


def test_that_few_flights_elsewhere_show_nothing_is_told_and_that_nothing_breaks_is_a_fault_everywhere() -> None:
    red = ROWS[0]
    for result in (breaks.UNSHOWN, breaks.UNMEASURED):
        lost = red._replace(result=result, processor="lake")
        assert campaign.worse([red], [lost]) == [(lost, "zen")]
        assert campaign.worse([red._replace(processor="")], [lost]) == [(lost, "")]  # where it flew was not kept
        assert campaign.worse([red._replace(processor="lake")], [lost]) == [(lost, "")]
    holds = red._replace(result=breaks.GREEN, processor="lake")
    assert campaign.worse([red], [holds]) == [(holds, "")]


@pytest.mark.parametrize(("result", "status"), [(breaks.RED, 0), (breaks.UNSHOWN, 0), (breaks.GREEN, 1)])
def test_all_breaks_ends_in_a_fault_only_for_what_is_judged(result, status, tmp_path, monkeypatch) -> None:
    flown = ROWS[0]._replace(result=result, processor="lake")
    monkeypatch.setattr(campaign, "committed", lambda: ROWS[:1])
    monkeypatch.setattr(campaign, "fly", lambda folder, say, threads: [flown])
    command = ["paper", "all", "--breaks", "--keep", str(tmp_path)]
    found = CliRunner().invoke(app, command)
    assert found.exit_code == status and f"1 claims under their changes: 1 {result}" in found.output
    assert ("(not judged: turned red on zen)" in found.output) == (result == breaks.UNSHOWN)
    (claim,) = json.loads(CliRunner().invoke(app, [*command, "--json"]).output)["worse"] or [{}]
    assert claim.get("elsewhere") == {breaks.RED: None, breaks.UNSHOWN: "zen", breaks.GREEN: ""}[result]
