"""Import paths that pages, examples and users' rule files use: whether each resolves, or in which line it ends.

The list of paths is the record: pages may change, and what they once showed must still work. Where there is no record,
the paths are collected from the tree (delete `imports.json` and write it anew to collect them again).
"""

import ast
import json
import re
import subprocess
import textwrap
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import airflock

ROOT = Path(__file__).parents[2]
RECORD = Path(__file__).with_suffix(".json")
PAGES = ("README.md", "CONTRIBUTING.md", "SECURITY.md", "docs/**/*.md", "docs/**/*.toml", "papers/**/*.md")
SCRIPTS = ("examples/**/*.py", "docs/gallery/*.py", "docs/notebooks/*.py", "docs/tours/*.py", "tests/typed/*.py")
TESTS = ("tests/**/*.py",)  # of these only the strings that are rule files
FILES = ("toml", "css", "sock", "json", "nc", "py", "md", "js")  # airflock.toml is no import path
RULES = r"@airflock\.|airflock\.(Parameters|quantity|choice)\b|class Parameters|def (decide|move|agent|sample)\b"
PATH = r"\bairflock(?:\.[A-Za-z_]\w*)+(?::[A-Za-z_]\w*)?"


def _tracked(patterns: tuple[str, ...]) -> list[Path]:
    """Return the files of some patterns that are under version control."""
    known = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    names = set(known.splitlines())
    found = {path for pattern in patterns for path in ROOT.glob(pattern)}
    return sorted(path for path in found if str(path.relative_to(ROOT)) in names)


def _chain(node: ast.AST) -> str:
    """Return `a.b.c` of an attribute of a name, or nothing."""
    if isinstance(node, ast.Attribute):
        inner = _chain(node.value)
        return inner and f"{inner}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def of_code(tree: ast.AST) -> Iterator[str]:
    """Yield the import paths of parsed code: imports, and chains of attributes of what was imported."""
    names = {"airflock": "airflock"}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.split(".")[0] == "airflock":
                    yield alias.name
                    names[alias.asname or "airflock"] = alias.name if alias.asname else "airflock"
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "airflock":
            for alias in node.names:
                path = f"{node.module}.{alias.name}".removesuffix(".*")
                yield path
                names[alias.asname or alias.name] = path
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from (path for path in re.findall(PATH, node.value) if ":" in path)
    inner = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and id(node) not in inner:
            head, _, rest = _chain(node).partition(".")
            if head in names and _is_module(names[head]):
                yield f"{names[head]}.{_resolving(names[head], rest)}"


def _is_module(path: str) -> bool:
    """Return True if a path is that of a module: attributes of an object, such as a recording, are no import paths."""
    value = _value(path)
    return type(value).__name__ == "module" or hasattr(value, "__path__")


def _resolving(path: str, rest: str) -> str:
    """Return the attributes up to the first that is no module: what follows belongs to an object."""
    words = rest.split(".")
    for count in range(1, len(words)):
        if not _is_module(".".join([path, *words[:count]])):
            return ".".join(words[:count])
    return rest


def of_text(text: str) -> Iterator[str]:
    """Yield the import paths of a page: of its blocks of code where they can be parsed, and of its words."""
    for block in re.findall(r"```[^\n]*\n(.*?)```", text, re.S):
        try:
            yield from of_code(ast.parse(textwrap.dedent(block)))
        except SyntaxError:
            yield from of_lines(block)
    yield from of_lines(text)


def of_lines(text: str) -> Iterator[str]:
    """Yield the import paths that stand in a text that cannot be parsed."""
    for path in re.findall(PATH, text):
        if path.rpartition(".")[2] not in FILES:
            head, _, rest = path.partition(".")
            yield path if ":" in path else f"{head}.{_resolving(head, rest)}"
    for module, names in re.findall(r"from (airflock[\w.]*) import \(?([\w, ]+)", text):
        yield from (f"{module}.{name.split(' as ')[0].strip()}" for name in names.split(",") if name.strip())


def _rule_files(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield the rule files that a test holds in strings, parsed; the places of a template are filled."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            text = node.value
        elif isinstance(node, ast.JoinedStr):
            text = "".join(str(part.value) if isinstance(part, ast.Constant) else "x" for part in node.values)
        else:
            continue
        if re.search(r"import airflock|from airflock", text) and re.search(RULES, text):
            try:
                yield ast.parse(textwrap.dedent(text))
            except SyntaxError:  # a piece of a file, or one that shall be wrong
                continue


def collect() -> dict[str, list[str]]:
    """Return the import paths of the tree, each with the files that use it."""
    found: dict[str, set[str]] = {}

    def note(paths: Iterator[str], where: Path) -> None:
        for path in paths:
            found.setdefault(path, set()).add(str(where.relative_to(ROOT)))

    for path in _tracked(PAGES):
        note(of_text(path.read_text(encoding="utf-8")), path)
    for path in _tracked(SCRIPTS):
        note(of_code(ast.parse(path.read_text(encoding="utf-8"))), path)
    for path in _tracked(TESTS):
        for tree in _rule_files(ast.parse(path.read_text(encoding="utf-8"))):
            note(of_code(tree), path)
    return {path: sorted(where) for path, where in sorted(found.items())}


def _value(path: str) -> Any:
    """Return what a path leads to, or None."""
    words = path.replace(":", ".").split(".")
    for count in range(len(words), 0, -1):
        try:
            value = import_module(".".join(words[:count]))
        except ModuleNotFoundError:
            continue
        try:
            for word in words[count:]:
                value = getattr(value, word)
        except AttributeError:
            continue
        return value
    return None


def _error(path: str) -> str:
    """Return the line in which the import of a path ends, as a person sees it first."""
    words = path.replace(":", ".").split(".")
    try:
        for count in range(2, len(words) + 1):
            import_module(".".join(words[:count]))
    except ModuleNotFoundError as error:
        return str(error)
    return ""


def take() -> dict[str, Any]:
    """Return the public names; of each path where it was used, and whether it resolves or the line in which it ends."""
    if RECORD.exists():
        used = {path: known["where"] for path, known in json.loads(RECORD.read_text(encoding="utf-8"))["paths"].items()}
    else:
        used = collect()
    paths = {
        path: {"where": where, "resolves": _value(path) is not None or _error(path)} for path, where in used.items()
    }
    return {"public": sorted(airflock.__all__), "paths": paths}
