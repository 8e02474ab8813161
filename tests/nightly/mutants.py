"""Do the tests notice errors? 200 small errors (mutants), drawn once: each is put into the source, and tests are run.

    python tests/nightly/mutants.py rows                   print the rows that do not apply to this tree
    python tests/nightly/mutants.py rename REVISION        rewrite them, if only names have changed since a revision
    python tests/nightly/mutants.py run FOLDER [ID ...]    run the rows that have a result, here, and compare
    python tests/nightly/mutants.py run FOLDER --baseline --tree TREE
                                                           run the rows that have no result, and write it into the table
    python tests/nightly/mutants.py draw TREE OTHER ...    draw the table again, from a revision of Git

The table is `mutants.csv` beside this file, one mutant a row: `killed` is its result before the modules moved (yes, no,
or empty for not run), `tests` the files of tests that were run, `by` the test that failed. The same mutants must be
killed by the same files later: not fewer `yes` than in the table. Some mutants change nothing that can be observed, so
not all can be killed. The table was drawn from 66fb6ba3; its results are those of d0341249, and `module` is that of
c840a19d.

A mutant is found by its text, since modules move: `line` (without its comment) in a function of the name `function`
anywhere in src/airflock, or `line` alone where only one line reads so. Where names inside a line have changed, `rename`
edits `function`, `line` and `mutant`: it finds the function that differs from the old one in names and texts only. The
rest is edited by hand, and nothing but these three; where a file of tests has another name, edit `tests`. `rows` and
`run` print the rows that need it.

The draw is stratified over the packages by their lines of code. It leaves out messages, types, code of a GPU, functions
that open sockets, start processes or browsers, or delete files, and lines that the OTHER revisions do not have.

A mutant is killed if a test fails, crashes or reaches its limit of time with it, and passes without it in that tree.
Limits are processor seconds, so that a busy machine changes nothing; compiled code is never reused. Files of tests are
chosen by what they import and by the words that they share with the function, the nearest first, up to BUDGET seconds;
FILE:7 means the first seven tests of a slow file. Files that compare texts with records (tests/snapshots, test_trees)
are left out, since they notice any change. The row ends with the first file that fails, and a later `run` begins with
that file, and with the rows that were killed. Both kinds of `run` are resumable; each tree needs a FOLDER of its own.
"""

import argparse
import ast
import contextlib
import csv
import io
import json
import keyword
import math
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tarfile
import tempfile
import textwrap
import time
import tokenize
import warnings
from collections import Counter
from difflib import SequenceMatcher
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
TABLE = Path(__file__).with_suffix(".csv")
FIELDS = ("id", "module", "function", "line", "occurrence", "mutant", "kind", "tests", "killed", "by", "seconds")
SEED, COUNT = 2018, 200
BUDGET, FILE_LIMIT, WALL_LIMIT = 45.0, 30, 300  # s of a processor of a mutant, of a file of tests; s of the clock
MEMORY = 12 << 30  # bytes of address space
MOST_FILES = 5
SHARE = 0.6  # of the tests of a slow file that end before its limit, those that are used
UNTOUCHED = re.compile(  # a mutant of such a function could do harm, wait for ever, or need a device
    r"socket|subprocess|Popen|multiprocessing|playwright|chromium|serve|rmtree|unlink|rmdir|\.kill|killpg|os\.remove|"
    r"signal\.|fork|[cC]uda|\bgpu|setrlimit|TYPE_CHECKING"
)
WORD = re.compile(r"[a-z]{3,}")
LEFT_OUT = re.compile(  # files of tests
    r"tests/(gpu|browser|papers|nightly|snapshots|typed)/|test_(trees|packaging|fuzz|cuda\w*|\w*gpu\w*)\.py"
)

LAYOUT = {tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.COMMENT, tokenize.ENDMARKER}
COMPARED = {"<": (">", "<="), "<=": (">", "<"), ">": ("<", ">="), ">=": ("<", ">"), "==": ("!=",), "!=": ("==",),
            "is": ("is not",), "is not": ("is",), "in": ("not in",), "not in": ("in",)}  # fmt: skip
COMPUTED = {"+": "-", "-": "+", "*": "/", "/": "*", "//": "*", "%": "*", "**": "*"}
EXTREMES = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum"}


class Function(NamedTuple):
    """A function of the source: its module, its name with those around it, its syntax, and its own lines by number."""

    module: str
    name: str
    node: ast.FunctionDef | ast.AsyncFunctionDef
    lines: dict[int, str]


Body = tuple[Function, list[tokenize.TokenInfo]]


class Site(NamedTuple):
    """A place for a mutant: columns (bytes) of a line, the text that replaces them, and the kind of the change."""

    line: int
    start: int
    end: int
    text: str
    kind: str


# --- the source -------------------------------------------------------------------------------------------------------


def code_lines(text: str) -> list[str]:
    """Lines of a module without comments, stripped."""
    rows = text.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            rows[token.start[0] - 1] = token.line[: token.start[1]]
    return [row.strip() for row in rows]


def functions_of(module: str, text: str) -> list[Function]:
    """Functions of a module; a line belongs to the innermost one around it."""
    rows, out = code_lines(text), []

    def visit(node: ast.AST, names: tuple[str, ...]) -> set[int]:
        """Add the functions inside a node; return their lines."""
        taken: set[int] = set()
        for child in ast.iter_child_nodes(node):
            if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
                inner = visit(child, (*names, child.name))
                if not isinstance(child, ast.ClassDef):
                    span = set(range(child.body[0].lineno, (child.end_lineno or 0) + 1))
                    own = {number: rows[number - 1] for number in sorted(span - inner)}
                    out.append(Function(module, ".".join((*names, child.name)), child, own))
                    inner |= span
                taken |= inner
            else:
                taken |= visit(child, names)
        return taken

    visit(ast.parse(text), ())
    return out


class Tree:
    """The functions of a source tree, found again by their text."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.paths: dict[str, Path] = {}
        self.functions: list[Function] = []
        for path in sorted((root / "src" / "airflock").rglob("*.py")):
            parts = path.relative_to(root / "src").with_suffix("").parts
            module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            self.paths[module] = path
            self.functions += functions_of(module, path.read_text(encoding="utf-8"))

    def find(self, row: dict[str, str]) -> tuple[Function, int] | None:
        """Return the function and the number of the line of a row; None where no place or several places fit."""
        nth, name = int(row["occurrence"]), row["function"]
        for fits in (
            lambda function: function.name == name,
            lambda function: function.name.rpartition(".")[2] == name.rpartition(".")[2],
            lambda function: True,
        ):
            places = []
            for function in filter(fits, self.functions):
                same = [number for number, line in function.lines.items() if line == row["line"]]
                if len(same) >= nth:
                    places.append((function, same[nth - 1]))
            if places:
                return places[0] if len(places) == 1 else None
        return None


def tree_of(revision: str, folder: Path) -> Tree:
    """Return the source of a revision of Git, unpacked into a folder."""
    archive = subprocess.check_output(["git", "-C", ROOT, "archive", revision, "src"])
    with tarfile.open(fileobj=io.BytesIO(archive)) as files:
        files.extractall(folder / revision, filter="data")
    return Tree(folder / revision)


# --- names that have changed ------------------------------------------------------------------------------------------


def tokens_of(text: str) -> list[tokenize.TokenInfo]:
    """Tokens of a text, without comments, breaks of lines, and commas before a bracket that closes."""
    read = tokenize.generate_tokens(io.StringIO(textwrap.dedent(text)).readline)
    tokens = [token for token in read if token.type not in LAYOUT]
    return [
        a for a, b in zip(tokens, [*tokens[1:], tokens[-1]], strict=True) if a.string != "," or b.string not in ")]}"
    ]


def bodies(tree: Tree) -> dict[str, list[Body]]:
    """Functions of a tree with their tokens, by shape: their text with names and strings taken out."""
    blank = {tokenize.NAME: "name", tokenize.STRING: "text"}
    texts = {module: path.read_text(encoding="utf-8").splitlines(keepends=True) for module, path in tree.paths.items()}
    out: dict[str, list[Body]] = {}
    for function in tree.functions:
        tokens = tokens_of("".join(texts[function.module][function.node.lineno - 1 : function.node.end_lineno]))
        shape = [t.string if keyword.iskeyword(t.string) else blank.get(t.type, t.string) for t in tokens]
        out.setdefault(" ".join(shape), []).append((function, tokens))
    return out


def renamed(mutant: str, old: list[tokenize.TokenInfo], new: list[tokenize.TokenInfo]) -> str:
    """Return a mutated line with the names and texts of the new line in place of those of the old one."""
    other = {a.string: b.string for a, b in zip(old, new, strict=True) if a.type in (tokenize.NAME, tokenize.STRING)}
    names = sorted(other, key=len, reverse=True)
    pattern = "|".join(rf"(?<!\w){re.escape(name)}(?!\w)" for name in names) or r"(?!)"
    return re.sub(pattern, lambda match: other[match[0]], mutant)


def followed(row: dict[str, str], place: tuple[Body, int], bodies: list[Body], now: Tree) -> dict[str, str] | None:
    """Return a row with the names of a tree in which its function has the same shape; None where its line differs."""
    (function, tokens), number = place
    if not bodies:
        return None
    strings = [token.string for token in tokens]
    other, others = max(bodies, key=lambda body: SequenceMatcher(None, strings, [t.string for t in body[1]]).ratio())
    span = [k for k, token in enumerate(tokens) if token.start[0] == number - function.node.lineno + 1]
    line = others[span[0]].start[0]
    if [k for k, token in enumerate(others) if token.start[0] == line] != span:
        return None  # the formatter has broken the line elsewhere
    at = line + other.node.lineno - 1
    nth = sum(other.lines[at] == text for k, text in other.lines.items() if k <= at)
    words = [tokens[k] for k in span], [others[k] for k in span]
    changed = row | {"module": other.module, "function": other.name, "line": other.lines[at], "occurrence": str(nth)}
    changed["mutant"] = renamed(row["mutant"], *words)
    return changed if renamed(row["line"], *words) == changed["line"] and now.find(changed) == (other, at) else None


def rename(revision: str, folder: Path) -> None:
    """Rewrite the rows whose names have changed since a revision; print what was done."""
    before, now, rows = tree_of(revision, folder), Tree(ROOT), read(TABLE)
    new_bodies = bodies(now)
    old_bodies = {body[0].node: (shape, body) for shape, alike in bodies(before).items() for body in alike}
    for row in rows:
        place, found = before.find(row), now.find(row)
        if place and not (found and found[0].name == row["function"]):
            shape, body = old_bodies[place[0].node]
            changed = followed(row, (body, place[1]), new_bodies.get(shape, []), now)
            if changed and changed != row:
                print(f"{row['id']}: {row['line']}  ->  {changed['line']}  ->  {changed['mutant']}")
                row |= changed
    write(TABLE, rows)


# --- the draw ---------------------------------------------------------------------------------------------------------


class Sites(ast.NodeVisitor):
    """Places for mutants in the body of one function, on its own lines."""

    def __init__(self, function: Function, rows: list[str]) -> None:
        self.rows = [row.encode() for row in rows]
        self.own = function.lines
        self.sites: list[Site] = []
        body = function.node.body
        for statement in body[1:] if ast.get_docstring(function.node) else body:
            self.visit(statement)

    def add(self, line: int, start: int, end: int, text: str, kind: str) -> None:
        if line in self.own:
            self.sites.append(Site(line, start, end, text, kind))

    def whole(self, node: ast.expr | ast.stmt, text: str, kind: str) -> None:
        """Replace a node that stands on one line; `{}` is its text."""
        if node.lineno == node.end_lineno:
            old = self.rows[node.lineno - 1][node.col_offset : node.end_col_offset].decode()
            self.add(node.lineno, node.col_offset, node.end_col_offset or 0, text.replace("{}", old), kind)

    def between(self, left: ast.expr, right: ast.expr, changes: dict[str, tuple[str, ...]], kind: str) -> None:
        """Replace the operator between two operands that stand on one line."""
        if left.end_lineno == right.lineno:
            start, end = left.end_col_offset or 0, right.col_offset
            gap = self.rows[right.lineno - 1][start:end].decode()
            operator = gap.strip(" ()")
            for other in changes.get(operator, ()):
                self.add(right.lineno, start, end, gap.replace(operator, other), kind)

    def visit_FunctionDef(self, node: ast.AST) -> None:
        """A function inside has sites of its own."""

    visit_AsyncFunctionDef = visit_ClassDef = visit_JoinedStr = visit_Assert = visit_FunctionDef
    visit_Import = visit_ImportFrom = visit_FunctionDef

    def visit_Raise(self, node: ast.Raise) -> None:
        self.whole(node, "pass", "statement removed")

    visit_Continue = visit_Break = visit_Raise  # type: ignore[assignment]

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value:
            self.visit(node.value)

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self.whole(node, "pass", "statement removed")
        self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> None:
        if isinstance(node.targets[0], (ast.Attribute, ast.Subscript)):
            self.whole(node, "pass", "statement removed")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.whole(node, "pass", "statement removed")
        self.between(node.target, node.value, {f"{old}=": (f"{new}=",) for old, new in COMPUTED.items()}, "arithmetic")
        self.generic_visit(node)

    def visit_Return(self, node: ast.Return) -> None:
        value = node.value
        if value is None or isinstance(value, ast.Constant):
            text = ""
        elif isinstance(value, (ast.Compare, ast.BoolOp)):
            text = "return not ({})"
        else:
            text = "return -({})" if isinstance(value, ast.BinOp) else "return None"
        if text and value and node.lineno == value.lineno == value.end_lineno:
            old = self.rows[value.lineno - 1][value.col_offset : value.end_col_offset].decode()
            self.whole(node, text.replace("{}", old), "return value")
        self.generic_visit(node)

    def condition(self, node: ast.If | ast.While | ast.IfExp) -> None:
        self.whole(node.test, "not ({})", "condition negated")
        self.generic_visit(node)

    visit_If = visit_While = visit_IfExp = condition

    def visit_comprehension(self, node: ast.comprehension) -> None:
        for test in node.ifs:
            self.whole(test, "not ({})", "condition negated")
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        for left, right in zip([node.left, *node.comparators], node.comparators, strict=False):
            self.between(left, right, COMPARED, "comparison")
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        for left, right in zip(node.values, node.values[1:], strict=False):
            self.between(left, right, {"and": ("or",), "or": ("and",)}, "and/or")
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        text = (ast.JoinedStr, ast.List, ast.Tuple, ast.ListComp)
        if not any(isinstance(x, text) or isinstance(x, ast.Constant) and isinstance(x.value, (str, bytes))
                   for x in (node.left, node.right)):  # fmt: skip
            self.between(node.left, node.right, {old: (new,) for old, new in COMPUTED.items()}, "arithmetic")
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, (ast.Not, ast.USub)) and node.lineno == node.operand.lineno:
            kind = "condition negated" if isinstance(node.op, ast.Not) else "arithmetic"
            if not isinstance(node.operand, ast.Constant):
                self.add(node.lineno, node.col_offset, node.operand.col_offset, "", kind)
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self.whole(node, str(not value), "constant")
        elif isinstance(value, int):
            self.whole(node, str(value + 1), "off by one")
            if value > 0:
                self.whole(node, str(value - 1), "off by one")
        elif isinstance(value, float):
            self.whole(node, repr(2.0 * value) if value else "1.0", "constant")

    def visit_Call(self, node: ast.Call) -> None:
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in EXTREMES and node.func.lineno == node.func.end_lineno:
            end = node.func.end_col_offset or 0
            self.add(node.func.lineno, end - len(name), end, EXTREMES[name], "min/max")
        texts = [x for x in node.args if isinstance(x, ast.JoinedStr) or
                 isinstance(x, ast.Constant) and isinstance(x.value, str) and " " in x.value]  # fmt: skip
        if name != "cast" and not texts:  # a number inside a message is text
            self.generic_visit(node)


def mutants_of(function: Function, text: str) -> list[tuple[Site, str]]:
    """Sites of a function, each with the stripped line that it makes; the module with it is read by Python."""
    rows, out = text.splitlines(), []
    if UNTOUCHED.search("\n".join(rows[number - 1] for number in function.lines)):
        return []
    before = ast.dump(ast.parse(text))
    for site in Sites(function, rows).sites:
        row = rows[site.line - 1].encode()
        row = row[: site.start] + site.text.encode() + row[site.end :]
        line = row.decode().rstrip()
        changed = "\n".join([*rows[: site.line - 1], line, *rows[site.line :]]) + "\n"
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                if ast.dump(ast.parse(changed)) != before:
                    comment = rows[site.line - 1].strip().removeprefix(function.lines[site.line])
                    out.append((site, line.strip().removesuffix(comment).strip()))
        except SyntaxError:
            continue
    return out


def lines_of_code(text: str) -> int:
    """Count the lines that hold tokens, less those of strings that are statements."""
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in LAYOUT:
            lines |= set(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            lines -= set(range(node.lineno, (node.end_lineno or 0) + 1))
    return len(lines)


def draw(revisions: list[str], folder: Path) -> None:
    """Draw the table from the first revision, of lines that all the others have."""
    trees = [tree_of(revision, folder) for revision in revisions]
    first = trees[0]
    strata: dict[str, list[Function]] = {}
    size: Counter[str] = Counter()
    for module, path in first.paths.items():
        if "cuda" in module or "gpu" in module:
            continue
        package = module.split(".")[1] if module.count(".") > 1 or path.name == "__init__.py" and "." in module else ""
        size[package] += lines_of_code(path.read_text(encoding="utf-8"))
        strata.setdefault(package, []).extend(f for f in first.functions if f.module == module)
    total, drawer = sum(size.values()), random.Random(SEED)
    share = {package: COUNT * lines / total for package, lines in sorted(size.items())}
    quota = {package: int(x) for package, x in share.items()}
    for package in sorted(share, key=lambda package: quota[package] - share[package])[: COUNT - sum(quota.values())]:
        quota[package] += 1  # the largest remainders
    rows: list[dict[str, str]] = []
    for package, number in quota.items():
        lines = [(function, line) for function in strata[package] for line in function.lines]
        drawer.shuffle(lines)
        drawn = 0
        for function, line in lines:
            if drawn == number:
                break
            text = first.paths[function.module].read_text(encoding="utf-8")
            here = [(site, mutant) for site, mutant in mutants_of(function, text) if site.line == line]
            if not here:
                continue
            kind = drawer.choice(sorted({site.kind for site, _ in here}))
            site, mutant = drawer.choice([one for one in here if one[0].kind == kind])
            same = [at for at, other in function.lines.items() if other == function.lines[line]]
            row = {"function": function.name, "line": function.lines[line], "occurrence": str(same.index(line) + 1)}
            places = [tree.find(row) for tree in trees]
            if places[0] == (function, line) and all(places):
                last = places[-1]
                assert last is not None
                rows.append(row | {"module": last[0].module, "mutant": mutant, "kind": kind})
                drawn += 1
        assert drawn == number, f"{package} has {drawn} of {number}"
    rows.sort(key=lambda row: (row["module"], row["function"], row["line"], row["occurrence"]))
    for number, row in enumerate(rows):
        row["id"] = str(number)
    write(TABLE, rows)
    print(f"{len(rows)} mutants:", ", ".join(f"{package or 'top'} {n}" for package, n in quota.items()))
    print(", ".join(f"{kind} {n}" for kind, n in Counter(row["kind"] for row in rows).most_common()))


# --- the choice of tests ----------------------------------------------------------------------------------------------


class Imports:
    """Which modules of Airflock a file of tests reaches, in how many steps."""

    def __init__(self, tree: Tree) -> None:
        self.paths = dict(tree.paths)
        self.files = {}
        for path in sorted((tree.root / "tests").rglob("*.py")):
            name = path.relative_to(tree.root).as_posix()
            if path.name.startswith("test_") and not LEFT_OUT.search(name):
                self.files[name] = path.read_text(encoding="utf-8")
            self.paths.setdefault(path.stem if not path.name.startswith("test_") else name, path)
        self.bound: dict[str, dict[str, tuple[str, str]]] = {}
        self.uses: dict[str, set[str]] = {}

    def names(self, module: str) -> dict[str, tuple[str, str]]:
        """Names that a module imports: (module, name) of each; a stub beside it counts."""
        if module not in self.bound:
            out: dict[str, tuple[str, str]] = {}
            self.bound[module] = out
            path = self.paths[module]
            package = module if path.name == "__init__.py" else module.rpartition(".")[0]
            for file in (path, path.with_suffix(".pyi")):
                for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if file.exists() else ():
                    if isinstance(node, ast.Import):
                        out |= {alias.asname or alias.name: (alias.name, "") for alias in node.names}
                    elif isinstance(node, ast.ImportFrom):
                        base = package.split(".")[: len(package.split(".")) + 1 - node.level] if node.level else []
                        source = ".".join([*base, *filter(None, [node.module])])
                        out |= {alias.asname or alias.name: (source, alias.name) for alias in node.names}
                    elif isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "airflock":
                        out[f"airflock.{node.attr}"] = ("airflock", node.attr)
        return self.bound[module]

    def resolve(self, module: str, name: str, depth: int = 0) -> str | None:
        """Return the module in which a name is made, through doors."""
        if f"{module}.{name}" in self.paths:
            return f"{module}.{name}"
        if module not in self.paths:
            return None
        if depth < 4 and self.paths[module].name == "__init__.py" and name in self.names(module):
            return self.resolve(*self.names(module)[name], depth + 1) or module
        return module

    def used(self, module: str) -> set[str]:
        """Modules that a module imports."""
        if module not in self.uses:
            found = {self.resolve(*pair) for pair in self.names(module).values()}
            self.uses[module] = {other for other in found if other} - {module, "airflock"}
        return self.uses[module]

    def steps(self, file: str, module: str) -> float:
        """Count the imports from a file of tests to a module; infinite where none leads there."""
        distance, reached, edge = 0, {file}, {file}
        while edge and module not in reached:
            edge = set().union(*(self.used(other) for other in edge)) - reached
            reached |= edge
            distance += 1
        return distance if module in reached else math.inf

    def alike(self, function: Function) -> dict[str, float]:
        """Cosine of the words of a function and of each file of tests, rare words weighted."""
        words = {file: Counter(WORD.findall(text.lower())) for file, text in self.files.items()}
        among = Counter(word for counts in words.values() for word in counts)
        weight = {word: math.log(len(words) / number) for word, number in among.items()}

        def vector(counts: Counter[str]) -> dict[str, float]:
            out = {word: (1.0 + math.log(n)) * weight[word] for word, n in counts.items() if word in weight}
            size = math.sqrt(sum(x * x for x in out.values())) or 1.0
            return {word: x / size for word, x in out.items()}

        doc = ast.get_docstring(function.node) or ""
        text = " ".join([function.module, function.name, doc, *function.lines.values()])
        own = vector(Counter(WORD.findall(text.lower())))
        return {file: sum(x * own.get(w, 0.0) for w, x in vector(counts).items()) for file, counts in words.items()}

    def ranked(self, function: Function, seconds: dict[str, float]) -> list[str]:
        """Files of tests, the nearest to a function first."""
        name, stem = function.name.rpartition(".")[2], function.module.rpartition(".")[2]
        called, word = re.compile(rf"\b{name.strip('_')}\b"), re.compile(rf"\b{stem}\b")
        mentions = {file for file, text in self.files.items() if called.search(text)}
        alike, scores = self.alike(function), {}
        for file, text in self.files.items():
            score = 8.0 / self.steps(file, function.module) + 20.0 * alike[file]
            score += 8.0 / math.sqrt(len(mentions)) if file in mentions and len(name) > 3 else 0.0
            score += 3.0 if word.search(text) or stem in file else 0.0
            score += ("interpreted" in text) - ("compiled" in text) - seconds.get(file, 5.0) / 10.0
            scores[file] = score
        return sorted(scores, key=lambda file: (-scores[file], file))


# --- the run ----------------------------------------------------------------------------------------------------------


class Result(NamedTuple):
    """How a run of tests ended: the test (or file) that failed, empty if all passed; seconds; tests that passed."""

    failed: str
    limit: bool
    seconds: float
    passed: int


class Runner:
    """A copy of a tree in which tests run; what is known of the tests without mutants is kept in the folder."""

    def __init__(self, tree: Path, folder: Path) -> None:
        self.folder, self.copy = folder, folder / "tree"
        shutil.rmtree(self.copy, ignore_errors=True)
        listed = subprocess.check_output(["git", "-C", tree, "ls-files", "-z"], text=True)
        for name in filter(None, listed.split("\0")):
            if (tree / name).is_file():
                (self.copy / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(tree / name, self.copy / name)
        self.tree = Tree(self.copy)
        self.collected: dict[str, list[str]] = {}
        self.known = folder / "clean.json"
        self.clean: dict[str, str] = json.loads(self.known.read_text()) if self.known.exists() else {}

    def targets(self, choice: str) -> list[str]:
        """Return what pytest is given for FILE, FILE::TEST, or FILE:7, which means its first seven tests."""
        file, _, number = choice.partition(":")
        if not number.isdigit():
            return [choice]
        if file not in self.collected:
            command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-n", "0", file]
            environment = os.environ | {"PYTHONPATH": f"{self.copy / 'src'}:{self.copy / 'papers' / 'src'}"}
            output = subprocess.run([*command, "-p", "no:cacheprovider", "-o", "addopts="], cwd=self.copy, text=True,
                                    env=environment, capture_output=True, check=False).stdout  # fmt: skip
            self.collected[file] = [line for line in output.splitlines() if line.startswith(f"{file}::")]
        return self.collected[file][: int(number)]

    def tests(self, choice: str, without: tuple[str, ...] = ()) -> Result:
        """Run a file of tests, its first tests or one test, up to the first failure."""
        for name in ("tmp", "cache"):
            shutil.rmtree(self.folder / name, ignore_errors=True)
        for name in ("tmp", "cache", "home"):
            (self.folder / name).mkdir(mode=0o700, exist_ok=True)
        environment = os.environ | {
            "PYTHONPATH": f"{self.copy / 'src'}:{self.copy / 'papers' / 'src'}",
            "AIRFLOCK_CACHE": str(self.folder / "cache"),
            "TMPDIR": str(self.folder / "tmp"),
            "HOME": str(self.folder / "home"),
            "HYPOTHESIS_STORAGE_DIRECTORY": str(self.folder / "tmp" / "hypothesis"),
            "COLUMNS": "400",
            "PYTHONUNBUFFERED": "1",
        }
        command = [sys.executable, "-m", "pytest", "-x", "-vv", "-n", "0", "-p", "no:cacheprovider", "--tb=no", "-rfE",
                   "--hypothesis-seed=2018", *(f"--deselect={name}" for name in without),
                   *self.targets(choice)]  # fmt: skip

        def limit() -> None:
            resource.setrlimit(resource.RLIMIT_CPU, (FILE_LIMIT, FILE_LIMIT + 5))
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        with (self.folder / "output.txt").open("w+") as output:
            process = subprocess.Popen(command, cwd=self.copy, env=environment, stdin=subprocess.DEVNULL, stdout=output,
                                       stderr=output, start_new_session=True, preexec_fn=limit)  # fmt: skip
            try:
                status = process.wait(WALL_LIMIT)
            except subprocess.TimeoutExpired:
                status = -signal.SIGXCPU
            finally:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)  # the children that a test left
                process.wait()
            output.seek(0)
            text = output.read()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        passed = len(re.findall(r"^\S+::.* (?:PASSED|SKIPPED|XFAIL)", text, re.MULTILINE))
        if status in (0, 5):
            return Result("", False, seconds, passed)
        match = re.search(r"^(?:FAILED|ERROR) (\S.*?)(?: - .*)?$", text, re.MULTILINE)
        limited = status in (-signal.SIGXCPU, -signal.SIGKILL)
        return Result(match[1] if match and not limited else choice, limited, seconds, passed)

    def measure(self, choice: str) -> str:
        """Run tests without a mutant: their seconds, `first N` where not all end in time, or the test that fails."""
        if choice not in self.clean:
            result = self.tests(choice)
            self.keep(choice, result.failed or f"{result.seconds:.1f}")
            if result.limit:
                self.keep(choice, f"first {int(SHARE * result.passed)}")
        return self.clean[choice]

    def keep(self, choice: str, value: str) -> None:
        """Keep what is known of tests without a mutant."""
        self.clean[choice] = value
        self.known.write_text(json.dumps(self.clean, indent=1))

    def cost(self) -> dict[str, float]:
        """Seconds of the files that have run; one that is too slow costs its limit."""
        return {name: float(value) if value[0].isdigit() else FILE_LIMIT * (SHARE if value[-2:] != " 0" else 1.0)
                for name, value in self.clean.items() if ":" not in name}  # fmt: skip

    def kills(self, path: Path, texts: tuple[str, str], choice: str) -> tuple[str, str]:
        """Return the test that kills a mutant (or empty), and the tests that were run: empty if they are of no use."""
        file = choice.partition(":")[0]
        known = self.clean.get(file, "")
        if known.startswith("first") and choice == file:
            choice = f"{file}:{known[6:]}" if known != "first 0" else ""
        broken = (name for name, value in self.clean.items() if "::" in name and not value[0].isdigit())
        without = tuple(name for name in broken if name.startswith(f"{file}::"))
        while choice:
            self.targets(choice)  # collected without the mutant
            self.put(path, texts[1])
            try:
                result = self.tests(choice, without)
            finally:
                self.put(path, texts[0])
            if not result.failed:
                if choice not in self.clean:
                    self.keep(choice, f"{result.seconds:.1f}")
                return "", choice
            clean = self.measure(result.failed)
            if result.failed != choice:  # one test
                if clean[0].isdigit():
                    return result.failed, choice
                without += (result.failed,)
            elif clean[0].isdigit():  # the file is not imported any more, crashes or takes too long
                enough = not result.limit or float(clean) < SHARE * FILE_LIMIT + 5.0
                return (choice + " (limit)" * result.limit, choice) if enough else ("", "")
            elif clean.startswith("first") and clean != "first 0" and choice == file:
                choice = f"{file}:{clean[6:]}"
            else:
                choice = ""
        return "", ""

    @staticmethod
    def put(path: Path, text: str) -> None:
        """Write a module; Python compares compiled ones by the second and the size only."""
        path.write_text(text, encoding="utf-8")
        for file in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
            file.unlink()

    def run(self, row: dict[str, str], imports: Imports | None) -> dict[str, str] | None:
        """Run one mutant; by the tests of its row, or by those that are chosen for it; None if it does not apply."""
        place = self.tree.find(row)
        if place is None:
            return None
        function, number = place
        path = self.tree.paths[function.module]
        text = path.read_text(encoding="utf-8")
        rows = text.splitlines()
        old = rows[number - 1]
        rows[number - 1] = old[: len(old) - len(old.lstrip())] + row["mutant"]
        changed = "\n".join(rows) + "\n"
        files = row["tests"].split()[::-1]  # the one that failed is the last
        if imports:
            files = imports.ranked(function, self.cost())
        begun, used, by = time.monotonic(), 0.0, ""
        ran: list[str] = []
        for file in files:
            cost = self.cost().get(file, 5.0)
            if imports and (len(ran) == MOST_FILES or used + cost > BUDGET):
                continue
            if not (self.copy / file.partition(":")[0]).exists():
                print(f"{row['id']}: {file} is not there: edit the table")
                continue
            by, choice = self.kills(path, (text, changed), file)
            if choice:
                ran.append(choice)
                used += self.cost().get(file, 5.0)
            if by:
                break
        killed = ("yes" if by else "no") if ran else ""
        return {"tests": " ".join(ran), "killed": killed, "by": by, "seconds": f"{time.monotonic() - begun:.0f}"}


def read(path: Path) -> list[dict[str, str]]:
    """Rows of a table."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def write(path: Path, rows: list[dict[str, str]]) -> None:
    """Write a table whole."""
    with path.with_suffix(".new").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    path.with_suffix(".new").replace(path)


def unfit(tree: Tree) -> int:
    """Print the rows that do not apply to a tree; return their number."""
    rows = [row for row in read(TABLE) if tree.find(row) is None]
    for row in rows:
        print(f"{row['id']} does not apply: {row['module']}.{row['function']}: {row['line']}")
    return len(rows)


def run(folder: Path, tree: Path, baseline: bool, minutes: float, chosen: list[str]) -> int:
    """Run what has no result yet, in a drawn order, so that a part is a sample; the status is 1 if fewer are killed."""
    folder.mkdir(parents=True, exist_ok=True)
    table, rows, end = TABLE, read(TABLE), time.monotonic() + 60.0 * minutes
    expected = {row["id"] for row in rows if row["killed"] == "yes"}
    if not baseline:
        table = folder / "mutants.csv"
        done = {(row["id"], row["mutant"]): row for row in read(table)} if table.exists() else {}
        rows = [done.get((row["id"], row["mutant"]), row | dict.fromkeys(("killed", "by", "seconds"), ""))
                for row in rows if row["killed"]]  # fmt: skip
    runner = Runner(tree, folder)
    imports = Imports(runner.tree) if baseline else None
    order = list(range(COUNT))
    random.Random(SEED).shuffle(order)
    for row in sorted(rows, key=lambda row: (not baseline and row["id"] not in expected, order[int(row["id"])])):
        if row["killed"] or (chosen and row["id"] not in chosen) or time.monotonic() > end:
            continue
        result = runner.run(row, imports)
        if result is None:
            print(f"{row['id']} does not apply: {row['function']}: {row['line']}")
            continue
        if not baseline:
            result["tests"] = row["tests"]
        row |= result
        write(table, rows)
        print(row["id"], row["killed"] or "no test", row["seconds"], row["kind"], row["by"], flush=True)
    ran = {row["id"] for row in rows if row["killed"]}
    killed = {row["id"] for row in rows if row["killed"] == "yes"}
    lost = sorted(expected & ran - killed, key=int)
    print(f"{len(killed)} of {len(ran)} killed; no longer killed: {' '.join(lost) or 'none'}")
    return int(len(killed) < len(expected & ran))


def main() -> int:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("draw").add_argument("revisions", nargs="+")
    commands.add_parser("rows")
    commands.add_parser("rename").add_argument("revision")
    part = commands.add_parser("run")
    part.add_argument("folder", type=Path)
    part.add_argument("ids", nargs="*")
    part.add_argument("--baseline", action="store_true", help="choose tests and write results into the table")
    part.add_argument("--tree", type=Path, default=ROOT, help="a work tree of another revision")
    part.add_argument("--minutes", type=float, default=math.inf, help="begin no mutant after this time")
    options = parser.parse_args()
    if options.command in ("draw", "rename"):
        with tempfile.TemporaryDirectory() as folder:
            if options.command == "draw":
                draw(options.revisions, Path(folder))
            else:
                rename(options.revision, Path(folder))
    if options.command == "draw":
        return 0
    if options.command in ("rows", "rename"):
        return int(unfit(Tree(ROOT)) > 0)
    return run(options.folder.resolve(), options.tree.resolve(), options.baseline, options.minutes, options.ids)


if __name__ == "__main__":
    sys.exit(main())
