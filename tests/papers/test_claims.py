"""Claims and statements: verdicts follow from bounds, and a bound looks where the quote says."""

import re
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from airflock.support.errors import AirflockError
from airflock_papers import PAPERS, bounds, statistics
from airflock_papers.claims import Claim, Measured, judge, read_claims, verdict_of, write_claims
from airflock_papers.counts import count, headline
from airflock_papers.page import PART_BY_PART, flown_by
from airflock_papers.statements import LONGEST, load, read

ROOT = Path(__file__).parents[2] / "papers"
COMMITTED = [path for name in PAPERS for path in sorted((ROOT / name).glob("*.toml"))]
GENERATION = """
[[statement]]
id = "timid"
kind = "paper"
quote = "avoidance gain took hold within 10 generations, causing over 75% of all controllers to have K_a < 2"
where = "Results"
quantity = "share of K_a below 2"
at = "generation 10"
bound = "ours > published"
published = 0.75
fails_if = "generation 10 itself"
"""


def test_a_statement_about_generation_10_is_read() -> None:
    assert read(GENERATION, "a file")["timid"].published == 0.75


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('at = "generation 10"', 'at = "generation 149"', "another generation than the quote's 10"),
        ('"share of K_a below 2"', '"phi_corr"', "not what the quote speaks of"),
        ("published = 0.75", "published = 0.5", "does not stand in the quote"),
        ('"ours > published"', '"ours > published or ours <= published"', "holds whatever is measured"),
        ('"ours > published"', '"__import__(1)"', "neither a field, a number nor a comparison"),
        ('fails_if = "generation 10 itself"', "", "needs fails_if"),
        ("took hold within", "took hold " + "very " * LONGEST + "within", f"more than {LONGEST} words"),
        ('kind = "paper"', 'kind = "identity"', "none of paper, program, ours"),
        ('kind = "paper"', 'kind = "ours"', "no quote"),
        ('bound = "ours > published"', 'verdict = "reproduced"', "others are computed"),
        ('bound = "ours > published"', 'verdict = "not flown yet"\nreason = "long"', "without the command"),
    ],
)
def test_a_statement_that_looks_elsewhere_is_refused(old: str, new: str, said: str) -> None:
    with pytest.raises(AirflockError, match=re.escape(said)):
        read(GENERATION.replace(old, new), "a file")


def test_all_faults_of_a_file_are_told_at_once() -> None:
    wrong = GENERATION.replace("published = 0.75", "published = 0.5").replace('"generation 10"', '"generation 9"')
    with pytest.raises(AirflockError, match="another generation.*does not stand in the quote"):
        read(wrong, "a file")


@pytest.mark.parametrize(
    ("share", "verdict"), [(0.38, "not reproduced"), (0.75, "not reproduced"), (0.8, "reproduced")]
)
def test_the_verdict_is_that_of_the_bound(share: float, verdict: str) -> None:
    statements = read(GENERATION, "a file")
    found = Measured("timid", "share of K_a below 2", "generation 10", statistics.one(share, 3))
    (claim,) = judge(statements, [found])
    assert claim.verdict == verdict
    with pytest.raises(AirflockError, match="but its bound says"):
        Claim(**asdict(claim) | {"verdict": "reproduced" if verdict != "reproduced" else "not reproduced"})


def test_what_was_measured_elsewhere_is_refused() -> None:
    late = Measured("timid", "share of K_a below 2", "generation 149", statistics.one(0.96, 3))
    with pytest.raises(AirflockError, match="is about at 'generation 10', but 'generation 149' was measured"):
        judge(read(GENERATION, "a file"), [late])
    with pytest.raises(AirflockError, match="measured without a statement: other"):
        judge(read(GENERATION, "a file"), [Measured("other", "", "", statistics.one(1.0))])


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(0, 1e6))
def test_bounds_are_the_comparisons_that_they_look_like(ours: float, published: float, slack: float) -> None:
    fields = {"ours": ours, "published": published, "sd": slack}
    assert bounds.holds("abs(ours - published) <= 2 * sd", fields) == (abs(ours - published) <= 2 * slack)
    assert bounds.holds("0 < ours and ours <= published", fields) == (0 < ours <= published)


def test_a_bound_on_what_was_not_measured_is_told() -> None:
    with pytest.raises(AirflockError, match="p was not measured"):
        bounds.holds("p >= 0.05", {"ours": 1.0})


@pytest.mark.parametrize("name", PAPERS)
def test_shipped_statements_are_sound(name: str) -> None:
    statements = load(f"airflock_papers.{name}")
    assert all(s.fails_if for s in statements.values() if s.kind == "paper" and s.bound)
    assert all(s.published is None or s.quote for s in statements.values())


@pytest.mark.parametrize("path", COMMITTED, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_committed_claims_are_those_of_the_statements(path: Path) -> None:
    """Every field that a statement has stands in the committed claim, and the verdict follows from the bound."""
    statements = load(f"airflock_papers.{path.parent.name}")
    for claim in read_claims(path)[1]:
        told = statements[claim.id]
        for key, value in asdict(told).items():
            if key not in ("published", "published_sd", "verdict", "command"):
                assert getattr(claim, key) == value, f"{claim.id}: {key}"
        assert claim.verdict == verdict_of(claim)


@pytest.mark.parametrize("name", PAPERS)
def test_every_statement_stands_on_a_committed_page(name: str) -> None:
    flown = {claim.id for path in sorted((ROOT / name).glob("*.toml")) for claim in read_claims(path)[1]}
    missing = [key for key in load(f"airflock_papers.{name}") if key not in flown]
    assert not missing


def test_claims_survive_a_file(tmp_path: Path) -> None:
    found = Measured("timid", "share of K_a below 2", "generation 10", statistics.mean([0.2, 0.3, 0.4]), "by seed")
    claims = judge(read(GENERATION, "a file"), [found])
    write_claims(tmp_path / "claims.toml", claims, {"command": "c", "version": "0"})
    header, again = read_claims(tmp_path / "claims.toml")
    assert header == {"command": "c", "version": "0"}
    assert [(c.id, c.verdict, c.quote, c.note, c.runs) for c in again] == [
        ("timid", "not reproduced", claims[0].quote, "by seed", 3)
    ]
    text = (tmp_path / "claims.toml").read_text(encoding="utf-8").replace("not reproduced", "reproduced")
    (tmp_path / "claims.toml").write_text(text, encoding="utf-8")
    with pytest.raises(AirflockError, match="its bound says 'not reproduced'"):
        read_claims(tmp_path / "claims.toml")


@pytest.mark.parametrize("name", PAPERS)
def test_the_table_of_papers_has_the_counts_of_each_page(name: str) -> None:
    """Reproduced, of what is judged by a bound: claims, and quotes of which every claim is."""
    front = (ROOT / "README.md").read_text(encoding="utf-8")
    told = re.search(rf"\| (\d+) of (\d+); (\d+) of (\d+): \[{name}\]", front)
    claims = read_claims(ROOT / name / "claims.toml")[1]
    found = count(claims)
    good, bad = (found.verdicts[verdict] for verdict in ("reproduced", "not reproduced"))
    assert (told is None) == (good + bad == 0)
    assert told is None or tuple(map(int, told.groups())) == (good, good + bad, found.whole, found.judged)
    assert not headline(claims) or f"**{headline(claims)}.**" in (ROOT / name / "README.md").read_text(encoding="utf-8")


def test_one_quote_flown_in_two_places_is_two_claims_and_holds_in_both_or_not_at_all() -> None:
    name, statement = next((k, s) for k, s in load("airflock_papers.dimock_2003").items() if k == "ga.vee.n")
    places = {"a": 1.0, "b": 0.5}
    statements = {f"{name}.{at}": replace(statement, id=f"{name}.{at}") for at in places}
    found = [
        Measured(key, statement.quantity, statement.at, statistics.Estimate(value, None, value, value, 3))
        for key, value in zip(statements, places.values(), strict=True)
    ]
    both = judge(statements, found)
    assert [claim.verdict for claim in both] == ["reproduced", "not reproduced"]
    assert (count(both).quotes, count(both).judged, count(both).whole) == (1, 1, 0)
    assert count(both[:1])[1:] == (1, 1, 1) and headline([]) == ""
    assert headline(both).endswith("1 not reproduced; of 1 judged quotes 0 in all their claims")


def test_a_page_tells_which_text_flew_it() -> None:
    header = {"texts": "0123", "version": "1.0", "precision": "32 bits"}
    assert flown_by(header).startswith("`0123`. Version 1.0, 32 bits.")
    assert flown_by(header | {"renewed": "ga: 45; static: 67"}).startswith(
        "`0123`, later parts by others: ga `45`, static `67`."
    )
    assert flown_by(header | {"texts": PART_BY_PART, "renewed": "ga: 45"}).startswith(
        "Each part by the text of its day: ga `45`."
    )


@pytest.mark.parametrize("path", sorted(ROOT.glob("*/*.toml")), ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_every_committed_page_says_which_text_flew_it(path: Path) -> None:
    name = {"claims": "README", "evolved": "EVOLVED", "rounding": "ROUNDING"}[path.stem]
    header, _ = read_claims(path)
    hashes = [each.rpartition(": ")[2] for each in str(header.get("renewed", "")).split("; ") if each]
    hashes += [header["texts"]] if header["texts"] != PART_BY_PART else []
    assert hashes and all(re.fullmatch("[0-9a-f]{16}", each) for each in hashes)
    assert flown_by(header) in path.with_name(f"{name}.md").read_text(encoding="utf-8")
