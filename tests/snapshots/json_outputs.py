"""Standard output of each verb that has --json, on small inputs, computed as on a Haswell; floats by their digits.

Times, versions, places and digests of code are masked. Of a verb whose numbers depend on how fast the machine is,
only the keys and the types of the values are kept.
"""

import json
import re
import shlex
import tempfile
from pathlib import Path
from typing import Any

from airflock.drones.mavlink.orders import OrderKind
from airflock.drones.onboard.card import card_hash
from airflock.drones.onboard.flight_log import LoggingNode
from airflock.drones.onboard.node import NodeMemory
from airflock.fleets.radio_channel import SOFTWARE_KEY
from fleets import card, document, fleet, scenario
from haswell import airflock
from snapshots import options
from snapshots._files import write_files

BY_PROCESSOR = True
SMALL = "--agents 5 --duration 5"
CASES = (  # in this order: later ones read what earlier ones wrote
    f"run vasarhelyi_2018/4ms {SMALL} --seeds 2 --json",
    f"run couzin_2002/torus {SMALL} --precision 64 --json",
    "run mine.toml --law mine.py --trust --device python --json",
    f"sweep vasarhelyi_2018/4ms --over radio.delay=0:1:2 {SMALL} --seeds 2 --json",
    "score flight.nc --json",
    "score fish.nc --body-length 0.04 --set metrics.kind=order --json",
    "display AIR --drones 12 --set duration=20 --json",
    f"evolve vasarhelyi_2018/6ms --out study --population 4 --generations 2 {SMALL} --seeds 2 --quiet --json",
    "harden study --out flyable.toml --seeds 10 --json",
    "certify vasarhelyi_2018/real_6ms --limit 'r_min<1 at 50%' --flights 12 --agents 4 --duration 5"
    " --out certificate.toml --json",
    "certify certificate.toml --check --json",
    "tune mine.toml --limit 'r_min<0.1 at 10%' --budget 8s --out tuned --json",
    "import fish.csv --unit mm --save imported.nc --json",
    "import log_0.ulg log_1.ulg log_2.ulg --save fleet.nc --json",
    "identify logs/0.ulg logs/1.ulg logs/2.ulg --heard heard.csv --standing 0:120 --like vasarhelyi_2018/real_6ms"
    " --out identified.toml --json",
    "infer fish.nc --models couzin_2002,vicsek_1995 --json",
    "fleet vasarhelyi_2018/real_4ms --agents 3 --duration 5 --set world.side=120 --seeds 2 --against simulator --json",
    "presets --json",
    "presets vasarhelyi_2018/4ms --json",
    "presets --for-speed 12 --json",
    "keys --json",
    "keys radio --json",
    "validate mine.toml --json",
    "validate mine.toml --set model.p_repp=1 --json",
    "types mine.py --json",
    "paper vicsek_1995 --quick --seeds 2 --json",
    "doctor --json",
    "fly prepare vasarhelyi_2018/real_4ms --site 47.50,19.04,120 --members 1-3 --set world.side=120 --out mission.json"
    " --json",
    "fly replay card.json node.log --json",
)
ONLY_TYPES = ("tune", "doctor", "paper")  # verbs whose numbers depend on the machine
MASKED = r"^(seal|version|versions|hash|began|ended|date|host|worker|took)$"
KEPT = "sha256"  # of a fleet: a digest of what was flown
DIGEST = r"\b[0-9a-f]{12,64}\b"


def plain(value: Any, masked: bool = False) -> Any:
    """Return a parsed output with floats as their digits and without what differs from run to run."""
    if isinstance(value, dict):
        return {
            key: one if key == KEPT else plain(one, masked or bool(re.search(MASKED, key)))
            for key, one in value.items()
        }
    if isinstance(value, list):
        return [plain(one, masked) for one in value]
    if masked and value is not None:
        return f"({type(value).__name__})"
    if isinstance(value, float):
        return repr(value)
    return re.sub(DIGEST, "(digest)", value) if isinstance(value, str) else value


def types(value: Any) -> Any:
    """Return the keys of an output with the types of their values; of a list, those of its first item."""
    if isinstance(value, dict):
        return {key: types(one) for key, one in value.items()}
    return [types(one) for one in value[:1]] if isinstance(value, list) else type(value).__name__


def _node_log(folder: Path) -> None:
    """Write the card, the key and the log of a node that took off with two others."""
    flown = scenario(3)
    lines: list[str] = []
    fly = fleet(flown)
    made = document(flown)
    (folder / "card.json").write_text(json.dumps({**made, "hash": card_hash(made)}), encoding="utf-8")
    (folder / "card.key").write_text(SOFTWARE_KEY.hex() + "\n", encoding="ascii")
    (folder / "card.key").chmod(0o600)
    assert card(flown).hash == fly.card.hash
    fly.nodes[0] = Watched(fly.nodes[0], lines.append, now=0.0, memory=NodeMemory(), radios=(0.2,))
    fly.advance(6.0)
    fly.order(OrderKind.START, at=6.2)
    fly.advance(8.0)
    (folder / "node.log").write_text("\n".join(lines) + "\n", encoding="utf-8")


class Watched(LoggingNode):
    """A node whose log is written, and which the fleet can ask for its state."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self.node, name)


def _output(words: str, folder: Path) -> dict[str, Any]:
    """Run one case; return its status, its parsed output and, where it failed, its errors."""
    done = airflock(folder, *shlex.split(words))
    row: dict[str, Any] = {"status": done.returncode}
    if done.stdout.strip():
        found = json.loads(done.stdout.replace(str(folder), "FOLDER"))
        if "seconds" in found:  # how long a search or a campaign took
            found["seconds"] = "(float)"
        row["output"] = types(found) if words.split()[0] in ONLY_TYPES else plain(found)
    if done.returncode:
        lines = done.stderr.replace(str(folder), "FOLDER").splitlines()
        row["errors"] = [line for line in lines if line.startswith("airflock: ")]
    return row


def take() -> dict[str, Any]:
    """Return the output of each case by its words; verbs with --json that no case calls are listed."""
    verbs = {
        name.removeprefix("airflock "): verb
        for name, verb in options.take().items()
        if any("--json" in each["spellings"] for each in verb["parameters"].values())
    }
    missing = [name for name in verbs if not any(f"{words} ".startswith(f"{name} ") for words in CASES)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_files(folder)
        _node_log(folder)
        return {"without a case": missing} | {words: _output(words, folder) for words in CASES}
