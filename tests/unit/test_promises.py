"""What README and the pages promise exists: commands and their options, Python names, files, counts of sentences."""

import re
import shlex
from importlib import import_module
from pathlib import Path

import pytest
import typer.main

import airflock
from airflock.cli.main import app

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "SECURITY.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")])
COMMANDS = typer.main.get_command(app).commands


def spans(text):
    """What stands in code, inline or in blocks of a shell."""
    blocks = re.findall(r"```(?:sh|bash|console)?\n(.*?)```", text, re.S)
    inline = re.findall(r"`([^`\n]+)`", re.sub(r"```.*?```", "", text, flags=re.S))
    return [line for block in blocks for line in block.splitlines()] + inline


def calls(path):
    """Each call of `airflock`, as words."""
    for span in spans(path.read_text(encoding="utf-8")):
        unquoted = re.sub(r"'[^']*'|\"[^\"]*\"", "QUOTED", span)
        for part in re.split(r"&&|;|\|", unquoted.partition("#")[0]):
            if part.strip().startswith("airflock "):
                yield shlex.split(re.sub(r"[<>].*", "", part.strip()))


def problem(words):
    """What is wrong with a call; empty if nothing is."""
    if len(words) < 2 or words[1] in ("--help", "--version", "--show-completion", "VERB"):
        return ""
    command = COMMANDS.get(words[1])
    if command is None:
        return f"there is no verb {words[1]}"
    if hasattr(command, "commands"):
        if len(words) < 3:
            return ""
        command = command.commands.get(words[2])
        if command is None:
            return f"{words[1]} has no verb {words[2]}"
    known = {name for option in command.params for name in option.opts} | {"--help"}
    wrong = [word for word in words if word.startswith("--") and word.partition("=")[0] not in known]
    return f"{words[1]} has no {', '.join(wrong)}" if wrong else ""


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_every_command_that_a_page_shows_exists(path):
    assert [(" ".join(words), problem(words)) for words in calls(path) if problem(words)] == []


def test_the_check_of_commands_finds_what_is_wrong(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "`airflock rum x`, `airflock run x --sed 3`\n```sh\nls && airflock fly prepar x  # airflock no\n```\n"
    )
    assert [problem(words) for words in calls(page)] == [
        "fly has no verb prepar",
        "there is no verb rum",
        "run has no --sed",
    ]
    assert sum(1 for path in PAGES for _ in calls(path)) > 60


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_every_public_name_that_a_page_shows_exists(path):
    text = path.read_text(encoding="utf-8")
    for name in sorted(set(re.findall(r"\bairflock((?:\.[A-Za-z_]\w*)+)", text))):
        parts = name.strip(".").split(".")
        if parts[-1] in ("toml", "css", "sock", "onboard") or hasattr(airflock, parts[0]):
            continue
        home, last = ".".join(["airflock", *parts[:-1]]), parts[-1]
        try:
            import_module(f"{home}.{last}")
        except ModuleNotFoundError:
            assert hasattr(import_module(home), last), f"{path.name}: airflock{name}"


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_every_file_that_a_page_links_to_exists(path):
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", path.read_text(encoding="utf-8")):
        if not re.match(r"https?:|mailto:|/generated/", target):
            assert (path.parent / target).exists(), f"{path.name}: {target}"
