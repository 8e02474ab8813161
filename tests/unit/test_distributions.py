"""Two distributions of one repository: airflock, and airflock-papers above it."""

import sys
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

import airflock
import airflock_papers
from airflock.cli.main import app

ROOT = Path(__file__).parents[2]
INSTALL = "papers need airflock-papers: pip install -e ./papers in a clone of Airflock"


def test_both_distributions_have_one_version_and_the_papers_ask_for_it():
    project = tomllib.loads((ROOT / "papers/pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert airflock_papers.__version__ == airflock.__version__
    assert f"airflock[evolve]=={airflock.__version__}" in project["dependencies"]


@pytest.mark.parametrize(
    "words", [["vasarhelyi_2018"], ["kidger", "--breaks"], ["all", "--quick"]], ids=lambda words: words[-1]
)
def test_where_the_papers_are_not_installed_the_command_says_what_to_install(words, monkeypatch):
    monkeypatch.setitem(sys.modules, "airflock_papers", None)
    said = CliRunner().invoke(app, ["paper", *words])
    assert said.exit_code != 0 and said.stdout == "" and str(said.exception) == INSTALL
    with pytest.raises(airflock.AirflockError, match="papers need airflock-papers"):
        airflock.paper("vasarhelyi_2018")
