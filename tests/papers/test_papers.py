"""Every publication that is recomputed can be asked for by name, and its committed page says how."""

import tomllib
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import pytest
from typer.testing import CliRunner

import airflock
import airflock_papers
from airflock.cli.main import app
from airflock_papers import PAPERS, programs
from airflock_papers.catalogue import find
from airflock_papers.sentences import PARTS, faults, in_order, letters, sentences, without_row

ROOT = Path(__file__).parents[2]


def test_every_module_with_a_paper_is_listed() -> None:
    names = [item.name for item in iter_modules(airflock_papers.__path__)]
    found = {name for name in names if hasattr(import_module(f"airflock_papers.{name}"), "PAPER")}
    assert found == set(PAPERS)


@pytest.mark.parametrize("name", PAPERS)
def test_the_committed_page_is_of_that_paper(name: str) -> None:
    paper = find(name)
    folder = ROOT / "papers" / name
    assert (folder / "README.md").read_text(encoding="utf-8").startswith(f"# {paper.title}\n")
    header = tomllib.loads((folder / "claims.toml").read_text(encoding="utf-8"))
    assert header["command"].startswith(f"airflock paper {name}")
    assert {"paper", "command", "seeds", "version", "precision"} <= set(header)


@pytest.mark.parametrize("name", PARTS)
def test_every_claim_of_a_paper_has_a_sentence_and_every_sentence_a_claim_or_a_reason(name: str) -> None:
    assert not faults(name, ROOT / "papers" / name, None)


def test_a_list_of_sentences_is_checked_against_a_text() -> None:
    text = "One sentence of five words here. (A second one, e.g. with a point inside.) 3\t4\n\nThe last of them ends."
    assert list(sentences(text)) == [
        "One sentence of five words here.",
        "(A second one, e.g. with a point inside.",
        "The last of them ends.",
    ]


def test_a_sentence_that_ends_like_an_abbreviation_ends() -> None:
    text = (
        "It could be flown by UAVs. Whereas others have flown none, this rule saves power. See Fig. 3 and ref. 4 of it."
    )
    assert list(sentences(text)) == [
        "It could be flown by UAVs.",
        "Whereas others have flown none, this rule saves power.",
        "See Fig. 3 and ref. 4 of it.",
    ]


def test_every_sentence_has_a_row_of_its_own() -> None:
    every = ["We will then implement the rule of Alignment.", "We will then implement the rule of Cohesion."]
    assert without_row(every, ["We will then implement the"]) == [f"no row of its own: {every[1]}"]
    assert not without_row(every, ["We will then implement the", "We will then implement the rule of C"])
    assert without_row(every[:1], ["Nothing of it"]) == [f"no row: {every[0]}"]
    assert without_row(every[:1], ["We will then", "we will then"]) == ["wewillthen: two rows begin so"]


def test_the_parts_of_a_quote_follow_one_another() -> None:
    whole = letters("It reaches a fitness of -9.8 HP. The parameters are as follows.")
    assert in_order("a fitness of −9.8 HP … parameters are as follows", whole)
    assert not in_order("parameters are as follows … a fitness of −9.8 HP", whole)


def test_an_identity_names_a_test_that_is_there(tmp_path: Path) -> None:
    table = (ROOT / "papers" / "zapotecatl_2016" / "sentences.csv").read_text(encoding="utf-8")
    folder = tmp_path / "papers" / "zapotecatl_2016"
    folder.mkdir(parents=True)
    (tmp_path / "test_x.py").write_text("def test_y():\n    assert True\n", encoding="utf-8")
    for proof, wrong in (("test_x.py::test_y", []), ("test_x.py::test_z", ["test_x.py::test_z: no such test"])):
        (folder / "sentences.csv").write_text(
            f"{table}End,It is so by construction,{proof},identity\n", encoding="utf-8"
        )
        assert faults("zapotecatl_2016", folder, None) == wrong


@pytest.mark.parametrize("name", PAPERS)
def test_an_unknown_part_is_refused_before_anything_flies(name: str) -> None:
    paper = find(name)
    with pytest.raises(airflock.AirflockError, match=f"only = 'nothing': unknown part; known: .*{paper.parts[0]}"):
        paper.run(only="nothing")


def test_a_mistyped_paper_is_told_its_name() -> None:
    said = CliRunner().invoke(app, ["paper", "vicsek_1996"])
    assert said.exit_code != 0
    assert "did you mean vicsek_1995?" in f"{said.output}{said.exception}"


def test_the_page_of_the_programs_is_that_of_the_committed_claims() -> None:
    assert (ROOT / "papers" / "programs.md").read_text(encoding="utf-8") == programs.page(ROOT / "papers")
