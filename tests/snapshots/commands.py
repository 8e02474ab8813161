"""Command lines in blocks of code of README, docs and CONTRIBUTING, and the status with which each ends.

The list of commands is the record: pages may change, and what they once showed must still work. Where there is no
record, the commands are collected from the pages (delete `commands.json` and write it anew to collect them again).
The commands of a page run one after the other in a folder that begins with the files that pages speak of. Large ones
run in a smaller form. Of what opens a page, waits for an autopilot or installs something only the words are checked.
"""

import json
import re
import shlex
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from haswell import python
from snapshots import options
from snapshots._files import write_files

ROOT = Path(__file__).parents[2]
RECORD = Path(__file__).with_suffix(".json")
PAGES = ("README.md", "CONTRIBUTING.md", "SECURITY.md", "docs/*.md")
SHELLS = ("", "sh", "bash", "console")
COMMAND = r"(airflock |python3? (-m airflock|examples/)|pip install|pytest\b|bash \.ci)"
NOT_RUN = {  # words of a command, and why it is not run
    r"^`": "stands in a sentence",
    r"^(pip|pytest|bash)": "is not a command of Airflock",
    r"^airflock watch": "opens a page",
    r"^python -m airflock\.onboard": "waits for an autopilot",
    r"^airflock fly (order|card)": "waits for drones",
    r"--mode processes": "flies on the real clock",
    r"--scheduler": "waits for a scheduler",
    r"\.\.\.": "a pattern, not a command",
}
SMALLER = {  # words of a command, and options that make it small; of two values of an option the last counts
    r"^airflock evolve .*--limit": "--out study_of_limits",  # pages name one folder in blocks that are alternatives
    r"^airflock evolve .*--fast": "--out study_fast",
    r"^airflock tune logs": "--out tuned_by_logs",
    r"^airflock run": "--agents 5 --duration 5 --seeds 2",
    r"^airflock evolve": "--population 4 --generations 2 --agents 5 --duration 5",
    r"^airflock harden": "--duration 5 --seeds 2",
    r"^airflock certify (?!.*--check)": "--agents 5 --duration 5 --budget 5s",
    r"^airflock fleet": "--agents 3 --duration 5",
    r"^airflock sweep": "--agents 4 --duration 5 --seeds 1",
    r"^airflock tune": "--agents 4 --duration 5 --limit 'r_min<0.1 at 10%' --budget 8s",
    r"^airflock plot mine": "--agents 4 --duration 5",
}
SECONDS = 180
OFFLINE = {"http_proxy": "http://127.0.0.1:9", "https_proxy": "http://127.0.0.1:9", "BROWSER": "true"}


def collect() -> dict[str, list[str]]:
    """Return the commands of each page in their order; those within a sentence stand in backticks."""
    found = {}
    for path in sorted(path for pattern in PAGES for path in ROOT.glob(pattern)):
        text, commands = path.read_text(encoding="utf-8"), []
        for kind, block in re.findall(r"^```([^\n]*)\n(.*?)^```", text, re.S | re.M):
            if kind not in SHELLS:
                continue
            for line in re.sub(r"\\\n", " ", block).splitlines():
                parts = re.sub(r"(^|\s)#.*", "", line).split("&&")
                commands += [" ".join(part.split()) for part in parts if re.match(rf"\s*{COMMAND}", part)]
        sentences = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
        spans = [span for span in re.findall(r"`([^`\n]+)`", sentences) if re.match(COMMAND, span)]
        commands += [f"`{span}`" for span in dict.fromkeys(spans)]
        if commands:
            found[str(path.relative_to(ROOT))] = commands
    return found


def _run(command: str, folder: Path) -> dict[str, Any]:
    """Run a command in a folder; return its status and its errors."""
    program, *words = shlex.split(command)
    words = [name for word in words for name in _matching(word, folder)]
    words = [str(ROOT / word) if word.startswith("examples/") else word for word in words]
    try:
        done = python(
            folder, *(["-m", "airflock"] if program == "airflock" else []), *words, seconds=SECONDS, **OFFLINE
        )
    except subprocess.TimeoutExpired:
        return {"status": "took too long"}
    lines = done.stderr.replace(str(folder), "FOLDER").splitlines()
    errors = [line for line in lines if line.startswith("airflock: ")]
    return {"status": done.returncode} | ({"errors": errors} if errors else {})


def _matching(word: str, folder: Path) -> list[str]:
    """Return the files of a pattern as a shell does."""
    found = sorted(folder.glob(word)) if "*" in word else ()
    return [str(path.relative_to(folder)) for path in found] or [word]


def _unknown(command: str, verbs: dict[str, Any]) -> list[str]:
    """Return the words of a command of airflock that are neither a verb nor one of its options."""
    plain = re.sub(r"'[^']*'|\"[^\"]*\"", "QUOTED", command.strip("`"))
    plain = re.split(r"\s[|>;&]|\.\.\.|…", plain)[0]
    if plain.startswith("python"):
        name, words = "python -m airflock.drones.onboard", plain.split()[3:]
    else:
        name, words = "airflock", plain.split()[1:]
    while words and f"{name} {words[0]}" in verbs:
        name, words = f"{name} {words[0]}", words[1:]
    if name == "airflock fly card" or words[:1] == ["VERB"]:
        return []
    if verbs[name]["verbs"] and words and not words[0].startswith("-"):
        return words[:1] if name == "airflock" else []  # `airflock fly CARD` runs a node
    spellings = {"--help"} | {each for one in verbs[name]["parameters"].values() for each in one["spellings"]}
    return [word for word in words if word.startswith("-") and word.partition("=")[0] not in spellings]


def _smaller(command: str) -> str:
    """Return a command with the options that make it small."""
    return " ".join([command, *(more for words, more in SMALLER.items() if re.search(words, command))])


def _page(commands: list[str], verbs: dict[str, Any], files: Path) -> list[dict[str, Any]]:
    """Run the commands of one page in a folder with these files, or check their words."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(files, folder, dirs_exist_ok=True)
        for command in commands:
            why = next((why for words, why in NOT_RUN.items() if re.search(words, command)), None)
            row: dict[str, Any] = {"command": command}
            if command.strip("`").startswith(("airflock", "python -m airflock.drones.onboard")):
                row["unknown"] = _unknown(command, verbs)
            if why is None:
                ran = _smaller(command)
                row |= ({"smaller": ran} if ran != command else {}) | _run(ran, folder)
            else:
                row["not run"] = why
            rows.append(row)
    return rows


def take() -> dict[str, Any]:
    """Return the commands of each page with their statuses, or with why they are not run."""
    if RECORD.exists():
        pages = json.loads(RECORD.read_text(encoding="utf-8"))
        pages = {page: [row["command"] for row in rows] for page, rows in pages.items()}
    else:
        pages = collect()
    verbs = options.take()
    with tempfile.TemporaryDirectory() as files:
        write_files(Path(files))
        return {page: _page(commands, verbs, Path(files)) for page, commands in pages.items()}
