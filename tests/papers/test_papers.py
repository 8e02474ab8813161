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
from airflock_papers.sentences import PARTS, faults, first_words, letters, sentences

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
    found = [letters(first_words(sentence)) for sentence in sentences(text)]
    assert found == ["onesentenceoffivewords", "asecondoneegwith", "thelastofthemends"]


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
