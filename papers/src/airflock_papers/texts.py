"""Texts: a hash of all that decides what a flight gives and how it is judged, for committed pages and kept flights."""

import hashlib
from functools import cache
from importlib import resources
from pathlib import Path

FOLDERS = ("core", "parts", "world", "engine", "scenarios")


@cache
def texts() -> str:
    """Hash of the rules, the engine, the presets and the papers of this version: 16 hexadecimal digits."""
    found = hashlib.sha256()
    root = Path(str(resources.files("airflock")))
    for folder in (*(root / name for name in FOLDERS), Path(str(resources.files("airflock_papers")))):
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".py", ".toml"):
                found.update(path.relative_to(folder.parent).as_posix().encode() + b"\n" + path.read_bytes())
    return found.hexdigest()[:16]
