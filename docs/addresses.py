"""Check that every address outside that the repository's texts name answers.

python docs/addresses.py      # one line for each address; exit status 1 if one does not answer or none can be asked

A DOI is asked of doi.org's register, as publishers turn programs away. A server that answers 403, 405 or 429 is there,
and only lets no program in. What belongs to a release to come, such as the address of a package, is not asked.
"""

import json
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.error import HTTPError, URLError
from urllib.request import Request, urlopen

ROOT = Path(__file__).resolve().parents[1]
TEXTS = {".md", ".py", ".bib", ".toml", ".cff", ".yaml", ".yml", ".txt"}
ADDRESS = re.compile(r"https?://[^\s\[\]()<>{}\"'`,;|\\]+")
DOI = re.compile(r"\b10\.\d{4,9}/[^\s\[\]<>{}\"'`,;|\\]+")
OWN = re.compile(r"https?://(localhost|127\.|192\.168\.|0\.0\.0\.0|example\.|github\.com/airflock)")
TO_COME = re.compile(r"https?://pypi\.org/packages/")
PATIENCE, TRIES = 20.0, 2  # s, times
ROBOTS = (403, 405, 406, 429)  # there, but not for programs


def addresses(root: Path = ROOT) -> dict[str, list[str]]:
    """Every address outside, and the files that name it; tests name addresses that nobody has."""
    listed = subprocess.run(["git", "ls-files"], cwd=root, capture_output=True, text=True, check=True).stdout
    found: dict[str, list[str]] = {}
    for name in listed.splitlines():
        if Path(name).suffix not in TEXTS or name.startswith("tests/") or name == "docs/addresses.py":
            continue
        text = (root / name).read_text(encoding="utf-8")
        named = {address for address in ADDRESS.findall(text) if not (OWN.match(address) or TO_COME.match(address))}
        named = {address for address in named if "." in address and "doi.org/" not in address}
        named |= {f"https://doi.org/{doi}" for doi in DOI.findall(text)}
        for address in named:
            found.setdefault(address.rstrip(".)*:_"), []).append(name)
    return found


def answer(address: str) -> str:
    """What an address says: empty if it answers, else why not."""
    registered = address.startswith("https://doi.org/")
    asked = address.replace("https://doi.org/", "https://doi.org/api/handles/") if registered else address
    why = ""
    for _ in range(TRIES):
        try:
            with urlopen(Request(asked, headers={"User-Agent": "airflock docs"}), timeout=PATIENCE) as told:
                code = json.load(told).get("responseCode") if registered else 1
                return "" if code == 1 else f"doi.org answers {code}"
        except HTTPError as fault:
            return "" if fault.code in ROBOTS and not registered else f"status {fault.code}"
        except (URLError, OSError, ValueError) as fault:
            why = f"no answer: {getattr(fault, 'reason', fault)}"
    return why


def main() -> int:
    """Exit status 1 if an address does not answer."""
    found = addresses()
    with ThreadPoolExecutor(8) as together:
        told = dict(zip(found, together.map(answer, found), strict=True))
    for address in sorted(found):
        print(f"{address}: {told[address] or 'answers'} ({', '.join(sorted(set(found[address])))})")
    wrong = [address for address, why in told.items() if why]
    if wrong and all(told[address].startswith("no answer") for address in found):
        print(f"offline: none of {len(found)} addresses could be asked")
        return 1
    print(f"{len(found) - len(wrong)} of {len(found)} addresses answer")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
