"""Typed copies of rule files: the same text, in which every argument that the vocabulary knows has its type.

A rule's argument names are its declaration, so a type checker need not be told them by hand. `typed_copy` writes them
into a copy: numbers are floats, `p`, `q`, `b` and `s` the records of parameters, `own`, `sums` and the others what the
contract says. Choices become the literal words that they may be. Nothing else of the text changes.
"""

import ast
import io
import tokenize
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from airflock.checking.rule_types import KNOWN, LETTERS, MEASURES, RECORDS, RESULTS, SPECIAL, kinds_of
from airflock.core.vocabulary import VOCABULARY
from airflock.spelling import meant


@dataclass(frozen=True)
class TypedCopy:
    """A typed copy of a rule file.

    text    : the copy
    rules   : the rules that were found, in the order of the file
    after   : line of the original after which lines were inserted; how many is `added`
    unknown : line, and what is wrong, of words that no rule of that kind may ask for
    """

    text: str
    rules: tuple[str, ...]
    after: int
    added: int
    unknown: tuple[tuple[int, str], ...]

    def line(self, number: int) -> int:
        """The line of the original that stands in this line of the copy."""
        return number if number <= self.after else max(number - self.added, self.after)


def typed_copy(text: str, scalar: bool = False) -> TypedCopy:
    """A copy of a rule file in which what the vocabulary knows has its type.

    text   : the file
    scalar : every function takes and returns plain numbers, as in `core.maths`

    Annotations that are there stay. Raises SyntaxError where the text is no Python.
    """
    tree = ast.parse(text)
    names = _Names(tree)
    functions = [item for item in tree.body if isinstance(item, ast.FunctionDef)]
    kinds = kinds_of({item.name for item in functions})
    handed = _handed_on(functions)
    insertions = [change for item in tree.body if isinstance(item, ast.ClassDef) for change in _fields(item, names)]
    ends = _ends(text, functions)
    unknown: list[tuple[int, str]] = []
    for item in functions:
        kind = kinds.get(item.name, "")
        arguments = [*item.args.posonlyargs, *item.args.args, *item.args.kwonlyargs]
        for argument in arguments:
            known = VOCABULARY.get(kind)
            if known is not None and argument.arg not in known:
                unknown.append((argument.lineno, _unknown(item.name, arguments, argument.arg, known)))
                continue
            if argument.annotation is not None or not (kind or scalar or (item.name, argument.arg) in handed):
                continue
            if not kind and not any(owner in kinds for owner in LETTERS.get(argument.arg, kinds)):
                continue  # a letter that stands for parameters in other files
            found = "float" if scalar else _type_of(argument.arg, kind, names)
            if found:
                insertions.append((argument.end_lineno or 0, argument.end_col_offset or 0, 0, f": {found}"))
        result = _result(item, kind, names, scalar)
        if result and item.returns is None:
            insertions.append((*ends[item.lineno], 0, f" -> {result}"))
    after, block = _block(tree, names)
    lines = _changed(text, insertions)
    lines[after:after] = [line.encode() + b"\n" for line in block]
    rules = tuple(item.name for item in functions if item.name in kinds)
    return TypedCopy(b"".join(lines).decode(), rules, after, len(block), tuple(unknown))


class _Names:
    """What a file binds at its top level, and what a copy must import for its types."""

    def __init__(self, tree: ast.Module) -> None:
        self.records: dict[str, list[str]] = {}  # fields of the classes
        self.words: dict[str, tuple[str, ...]] = {}  # tuples of words, such as options of choices
        self.bound: set[str] = set()
        self.wanted: dict[str, str] = {}  # word of KNOWN → the name it has in the copy
        self.columns = False
        for item in tree.body:
            if isinstance(item, ast.ClassDef):
                self.bound.add(item.name)
                self.records[item.name] = [
                    field.target.id
                    for field in item.body
                    if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
                ]
            elif isinstance(item, (ast.Import, ast.ImportFrom)):
                self.bound |= {name.asname or name.name.partition(".")[0] for name in item.names}
            elif isinstance(item, ast.Assign):
                for target in item.targets:
                    if isinstance(target, ast.Name):
                        self.bound.add(target.id)
                        self.words[target.id] = words_of(item.value, {})
            elif isinstance(item, ast.FunctionDef):
                self.bound.add(item.name)

    def known(self, word: str) -> str:
        """The name in the copy of a type that is imported for it."""
        return self.wanted.setdefault(word, f"_{word}" if word in self.bound else word)

    def record(self, word: str) -> str:
        """A record of the contract: the file's own, or one that is known; empty if there is none.

        In quotes, because a rule may stand above its record.
        """
        return f'"{word}"' if word in self.bound else self.known(word) if word in KNOWN else ""

    def spelled(self, kind: str) -> str:
        """A type with the names that its words have in the copy."""
        for word in ("Mapping", "MutableSequence", "Any"):
            if word in kind:
                kind = kind.replace(word, self.known(word))
        return kind


def _handed_on(functions: list[ast.FunctionDef]) -> set[tuple[str, str]]:
    """Helper and argument, where some function of the file hands on what it calls by the same name."""
    arguments = {item.name: [argument.arg for argument in item.args.args] for item in functions}
    calls = (call for item in functions for call in ast.walk(item) if isinstance(call, ast.Call))
    return {
        (call.func.id, name)
        for call in calls
        if isinstance(call.func, ast.Name) and call.func.id in arguments
        for given, name in zip(call.args, arguments[call.func.id], strict=False)
        if isinstance(given, ast.Name) and given.id == name
    }


def _type_of(name: str, kind: str, names: _Names) -> str:
    """Type of an argument; empty where nothing is known."""
    if kind == "total":
        return names.spelled("Mapping[str, float]")
    special = SPECIAL.get(kind, {}).get(name)
    if special == "Topology":
        return names.record("Parameters") or names.known("Topology")
    if special == "SharedColumns":
        names.columns = "Shared" in names.records
        return '"SharedColumns"' if names.columns else ""
    if special is not None:
        return names.spelled(special)
    record = RECORDS.get(name)
    if record is not None:
        if name == "q" and kind in MEASURES and record not in names.bound:
            record = "Measured"
        return names.record(record)
    return "float" if name in VOCABULARY.get(kind, {}) else ""


def _result(item: ast.FunctionDef, kind: str, names: _Names, scalar: bool) -> str:
    """Type of what a function returns; empty where nothing is known."""
    if kind == "total":
        return "dict[str, float]"
    if scalar:
        counts = {
            len(found.value.elts) if isinstance(found.value, ast.Tuple) else 1
            for found in ast.walk(item)
            if isinstance(found, ast.Return)
        }
        return "" if len(counts) != 1 else "float" if counts == {1} else f"tuple[{', '.join(['float'] * counts.pop())}]"
    found = RESULTS.get(kind, "")
    if "Memory" in names.bound and kind in ("decide", "move"):
        return 'tuple[float, float, float, "Memory"]'
    if "Memory" in names.bound and kind == "measure":
        return f'tuple[{", ".join(["float"] * 6)}, "Memory"]'
    if "Packet" in names.bound and kind == "receive":
        return 'tuple[float, "Packet"]'
    if "Memory" in names.bound and kind == "agent":
        return 'tuple["Agent", "Memory"]'
    if not found or found[0].islower() or found == "None":
        return found
    return names.spelled(found) if "[" in found else names.record(found)


def _fields(record: ast.ClassDef, names: _Names) -> Iterator[tuple[int, int, int, str]]:
    """Types of declared parameters as a rule meets them: numbers are there, choices are one of their words."""
    for field in record.body:
        if not isinstance(field, ast.AnnAssign) or not isinstance(field.value, ast.Call):
            continue
        made = field.value.func
        how = made.attr if isinstance(made, ast.Attribute) else made.id if isinstance(made, ast.Name) else ""
        kind = ""
        if how == "quantity" and ast.unparse(field.annotation) == "float | None":
            kind = "float"
        elif how == "choice" and len(field.value.args) > 1:
            words = words_of(field.value.args[1], names.words)
            kind = f"{names.known('Literal')}[{', '.join(map(repr, words))}]" if words else ""
        note = field.annotation
        if kind and note.lineno == note.end_lineno:
            yield note.lineno, note.col_offset, (note.end_col_offset or 0) - note.col_offset, kind


def words_of(value: ast.expr, words: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """The words of a tuple that stands there, or under a name; empty if it is none."""
    if isinstance(value, ast.Name):
        return words.get(value.id, ())
    if isinstance(value, (ast.Tuple, ast.List)):
        found = [item.value for item in value.elts if isinstance(item, ast.Constant) and isinstance(item.value, str)]
        return tuple(found) if len(found) == len(value.elts) else ()
    return ()


def _unknown(rule: str, arguments: Iterable[ast.arg], name: str, known: Mapping[str, str]) -> str:
    asked = ", ".join(argument.arg for argument in arguments)
    return f"{rule}({asked}) asks for {name!r}{meant(name, known, lead='; ', cutoff=0.6)}"


def _ends(text: str, functions: Iterable[ast.FunctionDef]) -> dict[int, tuple[int, int]]:
    """Line of each function → where the colon of its signature stands: line and column in bytes."""
    lines = text.splitlines(keepends=True)
    wanted, found = {item.lineno for item in functions}, {}
    begun = depth = 0
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        line, column = token.start
        if not begun and line in wanted and token.string == "def":
            begun, depth = line, 0
        elif begun and token.type == tokenize.OP:
            depth += (token.string in "([{") - (token.string in ")]}")
            if token.string == ":" and depth == 0:
                found[begun] = (line, len(lines[line - 1][:column].encode()))
                begun = 0
    return found


def _changed(text: str, changes: Iterable[tuple[int, int, int, str]]) -> list[bytes]:
    """The lines after all changes: line, column and length in bytes, and what to write there."""
    lines = text.encode().splitlines(keepends=True)
    for line, column, length, new in sorted(changes, reverse=True):
        old = lines[line - 1]
        lines[line - 1] = old[:column] + new.encode() + old[column + length :]
    return lines


def _block(tree: ast.Module, names: _Names) -> tuple[int, list[str]]:
    """The line after which imports are added, below the docstring and what comes from the future; and their lines."""
    after = 0
    for item in tree.body:
        docstring = isinstance(item, ast.Expr) and isinstance(item.value, ast.Constant)
        if not docstring and not (isinstance(item, ast.ImportFrom) and item.module == "__future__"):
            break
        after = item.end_lineno or 0
    lines = []
    if names.columns:
        sequence, base = names.known("MutableSequence"), "_Record" if "NamedTuple" in names.bound else "NamedTuple"
        lines = ["", "", "class SharedColumns(" + base + "):", '    """Shared, a column for each field."""', ""]
        lines += [f"    {field}: {sequence}[float]" for field in names.records["Shared"]]
        lines.insert(0, f"from typing import NamedTuple{' as _Record' if base == '_Record' else ''}")
    imports = []
    for word, name in sorted(names.wanted.items()):
        module, there = KNOWN[word]
        imports.append(f"from {module} import {there}{f' as {name}' if name != there else ''}")
    block = sorted(imports) + lines
    return after, ["", *block] if block and after else block
