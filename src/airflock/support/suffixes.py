"""Suffixes of the files that are written: the name of a file says its format."""

import os
from pathlib import Path

PICTURES = (".png", ".pdf", ".svg")
VIDEOS = (".mp4", ".gif")
RECORDINGS = (".nc",)
TABLES = (".csv",)
PAGES = (".html",)
SCENARIOS = (".toml",)


def suffix_error(path: str | os.PathLike[str], suffixes: tuple[str, ...]) -> str:
    """What is wrong with the ending of a file to be written; empty if nothing is."""
    target = Path(path)
    if target.suffix.lower() in suffixes:
        return ""
    said = f"ending {target.suffix}" if target.suffix else "name without an ending"
    if len(suffixes) == 1:
        return f"{target}: {said} is not {suffixes[0]}, the only format written here"
    return f"{target}: {said}: unknown format; give one of {', '.join(suffixes)}"
