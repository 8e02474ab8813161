"""Rules as C99: the text that drivers are made of, function by function, in the subset of a law for one drone.

`DriverSource` binds choices, writes out vectors and brings along what a rule calls; what is left
are assignments, branches, loops, calls and arithmetic, of which each has one form in C. Types
follow from the arguments: a number is `real`, a truth or a count `int`, a record a struct that is
passed by a pointer, several values a struct of their own.
"""

import ast
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, NoReturn

from airflock.core import PERCEPT_METHODS, law, tree_of, walk_tree
from airflock.engine.text.generate import DriverSource
from airflock.support import RuleError

REAL, WHOLE = "real", "int"
RESERVED = frozenset((
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum", "extern", "float",
    "for", "goto", "if", "inline", "int", "long", "register", "restrict", "return", "short", "signed", "sizeof",
    "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "while", "real", "R",
    "NAN", "INFINITY", "HUGE_VAL",
))  # fmt: skip
BINARY = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
LOGICAL = {ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^", ast.RShift: ">>", ast.LShift: "<<"}
COMPARED = {ast.Lt: "<", ast.Gt: ">", ast.LtE: "<=", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
# of math.h, each with a form for float; Python's `math` has them under the same names
MATHS = frozenset((
    "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "pow", "fabs", "fmod", "floor", "ceil",
    "hypot", "tanh", "sinh", "cosh",
))  # fmt: skip
# As Python has them: the first of two equal numbers, and a remainder with the sign of the divisor.
PRELUDE = {
    "most": "static inline real most(real a, real b) { return b > a ? b : a; }",
    "least": "static inline real least(real a, real b) { return b < a ? b : a; }",
    "remainder_of": (
        "static inline real remainder_of(real a, real b) {\n"
        "  real m = r_fmod(a, b);\n"
        "  return m != R(0.0) && (m < R(0.0)) != (b < R(0.0)) ? m + b : m;\n"
        "}"
    ),
}
CALLED = {ast.Pow: ("r_pow", {"pow"}), ast.Mod: ("remainder_of", {"fmod", "remainder_of"})}
DRAWS = ("normal", "uniform")  # methods of a percept that take a whole number


class Function(NamedTuple):
    """A function as C: its name, the types of its arguments by name, the type that it returns, and its text."""

    name: str
    arguments: dict[str, str]
    returned: str
    text: str


class CPrinter:
    """Prints rules, and what they call, as C functions; structs and functions stand in the order of their need.

    constants, vectors : choices, and vectors with their sizes, by record name, as `DriverSource`
                         takes them
    prefix             : begins the names of structs that have none of their own
    """

    def __init__(
        self,
        prefix: str,
        constants: Mapping[str, Mapping[str, str | float]],
        vectors: Mapping[str, Mapping[str, int]],
    ):
        self.prefix = prefix
        self.source = DriverSource("", constants, vectors)
        self.structs: dict[str, dict[str, str]] = {}  # name → fields with their types
        self.functions: dict[str, Function] = {}
        self.used: set[str] = set()  # of MATHS and PRELUDE
        self.trees: dict[str, ast.FunctionDef] = {}
        self.begun: set[str] = set()
        self._read = 0

    def record(self, name: str, fields: Sequence[str]) -> str:
        """Declare a struct of numbers; return its type."""
        for field in fields:
            if field in RESERVED:
                raise RuleError(f"{name}.{field}: C reserves this name; call the number otherwise")
        return self.struct(name, dict.fromkeys(fields, REAL))

    def struct(self, name: str, fields: dict[str, str]) -> str:
        """Declare a struct by its fields and their types; return its type."""
        self.structs.setdefault(name, fields)
        return name

    def rule(self, rule: Callable[..., Any], types: Mapping[str, str]) -> Function:
        """Print a rule and all that it calls; types : of its arguments that are records, by name."""
        name = self.source.name(rule)
        names = rule.__code__.co_varnames[: rule.__code__.co_argcount]
        return self.called(name, [types.get(each, REAL) for each in names])

    def called(self, name: str, types: Sequence[str]) -> Function:
        """Return a function of the source as C for arguments of these types; RuleError where it has no form in C."""
        found = self.functions.get(name)
        if found is None:
            if name in self.begun:
                raise RuleError(f"{self.place(name)}: calls itself; a rule that is printed has a loop instead")
            self.begun.add(name)
            self.parse_blocks()
            tree = self.trees[name]
            arguments = dict(zip([each.arg for each in tree.args.args], types, strict=True))
            found = self.functions[name] = _Body(self, name, tree, arguments).function()
            self.functions[name] = self.functions.pop(name)  # behind what it calls
        elif list(found.arguments.values()) != list(types):
            raise RuleError(
                f"{self.place(name)}: is called with arguments of other kinds at two places; write it twice"
            )
        return found

    def parse_blocks(self) -> None:
        """Take what the source has gathered since: functions, and NamedTuple classes as structs."""
        for block in self.source.blocks[self._read :]:
            (node,) = ast.parse(block).body
            if isinstance(node, ast.FunctionDef):
                self.trees[node.name] = node
            elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Call):
                name, fields = (ast.literal_eval(each) for each in node.value.args)
                self.record(name, fields)
        self._read = len(self.source.blocks)

    def place(self, name: str, node: ast.AST | None = None) -> str:
        """File and line of a function of the source; of a node in it, where one of its text stands."""
        rule = self.source.originals().get(name)
        if rule is None:
            return name
        line = 0
        if node is not None:
            same = [item for item in walk_tree(tree_of(rule)) if type(item) is type(node) and hasattr(item, "lineno")]
            line = same[0].lineno - 1 if same else 0
        return f"{law.place_of(rule, line)}: rule {rule.__name__}"

    def tuple_of(self, types: Sequence[str]) -> str:
        """Return the type of several values: a struct of v0, v1, ..."""
        rest = "_".join(each for each in types if each != REAL)
        count = sum(each == REAL for each in types)
        name = f"{self.prefix}_Real{count}" + (f"_{rest}" if rest else "")
        return self.struct(name, {f"v{k}": each for k, each in enumerate(types)})


class _Body(ast.NodeVisitor):
    """The body of one function while it is printed."""

    def __init__(self, printer: CPrinter, name: str, tree: ast.FunctionDef, arguments: dict[str, str]):
        self.printer, self.name, self.tree, self.arguments = printer, name, tree, arguments
        self.types = dict(arguments)  # of all variables
        self.hoisted: dict[str, str] = {}  # variables that a branch sets first
        self.returned: str | None = None
        self.temporaries, self.depth = 0, 1
        # In C a variable may not hide a function that its own block calls, and a record that came by a
        # pointer is copied before it is set: both go under another name, which no third one has.
        names = {*arguments, *self.tree_targets()}
        self.written = {each: f"{each}_" for each in names if each in MATHS or each.endswith("_")}
        self.copied = {each for each in self.tree_targets() if arguments.get(each, REAL) not in (REAL, WHOLE)}
        self.written |= {each: f"{each}_" for each in self.copied}
        self.read = {
            item.id for item in walk_tree(tree) if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Load)
        }

    def function(self) -> Function:
        """Return the function as C."""
        for each in (*self.arguments, *self.tree_targets()):
            if each in RESERVED:
                self.refuse(self.tree, f"{each} is a name that C reserves; give the variable another name")
        lines = self.block(self.tree.body, 1)
        if self.returned is None:
            self.refuse(self.tree, "returns nothing; a rule that is printed returns numbers or a record")
        named = {each: each if each in self.copied else self.written.get(each, each) for each in self.arguments}
        handed = {each: f"{kind} " if kind in (REAL, WHOLE) else f"const {kind} *"
                  for each, kind in self.arguments.items()}  # fmt: skip
        head = ", ".join(f"{kind}{named[each]}" for each, kind in handed.items()) or "void"
        zero = {REAL: "R(0.0)", WHOLE: "0"}
        begin = [f"  {kind} {self.c_name(name)} = {zero.get(kind, '{R(0.0)}')};" for name, kind in self.hoisted.items()]
        begin += [f"  {self.arguments[each]} {self.c_name(each)} = *{each};" for each in self.copied]
        # What only another choice reads is still an argument or a variable here.
        unread = [each for each in self.types if each not in self.read]
        begin += [f"  (void){self.c_name(each)};" for each in unread if each in self.arguments]
        lines[-1:] = [*(f"  (void){self.c_name(each)};" for each in unread if each not in self.arguments), lines[-1]]
        text = "\n".join([f"{self.returned} {self.name}({head}) {{", *begin, *lines, "}"])
        return Function(self.name, self.arguments, str(self.returned), text)

    def c_name(self, name: str) -> str:
        """Return the name of a variable in C."""
        return self.written.get(name, name)

    def pointed(self, name: str) -> bool:
        """Return True if a variable is a record that came by a pointer."""
        return name not in self.copied and self.arguments.get(name, REAL) not in (REAL, WHOLE)

    def tree_targets(self) -> list[str]:
        """Return the names that the function sets."""
        return [
            item.id for item in walk_tree(self.tree) if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store)
        ]

    def refuse(self, node: ast.AST, text: str) -> NoReturn:
        raise RuleError(f"{self.printer.place(self.name, node)}: {text}")

    # Statements: each is lines of C.

    def block(self, statements: Sequence[ast.stmt], depth: int) -> list[str]:
        """Return statements as lines, `depth` levels from the left."""
        self.depth, outer = depth, self.depth
        lines = [f"  {line}" for statement in statements for line in self.visit(statement)]
        self.depth = outer
        return lines

    def visit_Pass(self, node: ast.Pass) -> list[str]:
        return []

    def visit_Expr(self, node: ast.Expr) -> list[str]:
        return [] if isinstance(node.value, ast.Constant) else self.generic_visit(node)

    def visit_Break(self, node: ast.Break) -> list[str]:
        return ["break;"]

    def visit_Continue(self, node: ast.Continue) -> list[str]:
        return ["continue;"]

    def visit_Assign(self, node: ast.Assign) -> list[str]:
        target, value = node.targets[0], node.value
        if isinstance(target, ast.Name) and len(node.targets) == 1:
            return [self.set(target.id, *self.value(value))]
        if not isinstance(target, ast.Tuple) or not all(isinstance(each, ast.Name) for each in target.elts):
            self.refuse(target, f"sets {ast.unparse(target)}; set variables one by one")
        names = [each.id for each in target.elts if isinstance(each, ast.Name)]
        if not isinstance(value, ast.Tuple):
            kind, text = self.value(value)
            fields = self.printer.structs.get(kind, {})
            if len(fields) != len(names):
                self.refuse(value, f"takes {len(names)} values from {ast.unparse(value)}")
            whole = self.temporary()
            parts = [(each, f"{whole}.{field}") for field, each in fields.items()]
            sets = [self.set(name, *part) for name, part in zip(names, parts, strict=True)]
            return [f"const {kind} {whole} = {text};", *sets]
        # All values are taken before one variable is set, as in Python: a, b = b, a.
        parts = [self.value(each) for each in value.elts]
        kept = [self.temporary() for _ in parts]
        taken = [f"const {kind} {name} = {text};" for name, (kind, text) in zip(kept, parts, strict=True)]
        return taken + [self.set(name, kind, at) for name, (kind, _), at in zip(names, parts, kept, strict=True)]

    def visit_AugAssign(self, node: ast.AugAssign) -> list[str]:
        if not isinstance(node.target, ast.Name):
            self.refuse(node.target, f"sets {ast.unparse(node.target)}; set variables one by one")
        read = ast.copy_location(ast.Name(node.target.id, ast.Load()), node.target)
        return [self.set(node.target.id, *self.visit(ast.BinOp(read, node.op, node.value)))]

    def visit_If(self, node: ast.If) -> list[str]:
        lines = [f"if ({self.truth(node.test)}) {{", *self.block(node.body, self.depth + 1)]
        lines += ["} else {", *self.block(node.orelse, self.depth + 1)] if node.orelse else []
        return [*lines, "}"]

    def visit_While(self, node: ast.While) -> list[str]:
        if node.orelse:
            self.refuse(node, "has an else behind a loop; write it behind the loop, with an if")
        return [f"while ({self.truth(node.test)}) {{", *self.block(node.body, self.depth + 1), "}"]

    def visit_For(self, node: ast.For) -> list[str]:
        call = node.iter if isinstance(node.iter, ast.Call) and ast.unparse(node.iter.func) == "range" else None
        ends = [self.visit(each) for each in call.args] if call is not None else []
        if not 1 <= len(ends) <= 2 or {kind for kind, _ in ends} != {WHOLE} or not isinstance(node.target, ast.Name):
            self.refuse(node, "has a loop that is not printed; write for k in range(...)")
        if node.orelse:
            self.refuse(node, "has an else behind a loop; write it behind the loop, with an if")
        first, last = ["0", *(text for _, text in ends)][-2:]
        # As in Python the variable keeps the value of the last turn, and the end is that of the first one,
        # so the loop counts by others.
        turn, end = self.temporary(), self.temporary()
        self.depth += 1
        taken = self.set(node.target.id, WHOLE, turn)
        self.depth -= 1
        return [f"for (int {turn} = {first}, {end} = {last}; {turn} < {end}; {turn}++) {{", f"  {taken}",
                *self.block(node.body, self.depth + 1), "}"]  # fmt: skip

    def visit_Return(self, node: ast.Return) -> list[str]:
        if node.value is None:
            self.refuse(node, "returns nothing; a rule that is printed returns numbers or a record")
        kind, text = self.value(node.value)
        if kind == WHOLE and self.returned == REAL:
            kind, text = REAL, f"(real)({text})"
        if self.returned not in (None, kind):
            self.refuse(node.value, f"returns {self.returned} at one place and {kind} at another; write 1.0, not 1")
        self.returned = kind
        return [f"return {text};"]

    def temporary(self) -> str:
        """Return a name that no variable has."""
        self.temporaries += 1
        return f"t{self.temporaries}_"

    def set(self, name: str, kind: str, text: str) -> str:
        """Return the line that sets a variable, which it declares where no branch or loop stands around it."""
        known = self.types.get(name)
        if known is None:
            self.types[name] = kind
            if self.depth == 1:
                return f"{kind} {self.c_name(name)} = {text};"
            self.hoisted[name] = kind
        elif known == REAL and kind == WHOLE:
            text = f"(real)({text})"
        elif known != kind:
            self.refuse(self.tree, f"{name} holds {known} at one place and {kind} at another; use two variables")
        return f"{self.c_name(name)} = {text};"

    # Expressions: each is its type and its text.

    def generic_visit(self, node: ast.AST) -> NoReturn:
        """Refuse what has no form in C."""
        text = ast.unparse(node).partition("\n")[0]
        self.refuse(node, f"{text} has no form in C; write it with numbers, records and plain functions")

    def value(self, node: ast.expr) -> tuple[str, str]:
        """Return a value of its own: a record that came by a pointer is copied."""
        kind, text = self.visit(node)
        return kind, f"*{text}" if isinstance(node, ast.Name) and self.pointed(node.id) else text

    def real(self, node: ast.expr) -> str:
        """Return an expression as a number."""
        kind, text = self.visit(node)
        if kind not in (REAL, WHOLE):
            self.refuse(node, f"{ast.unparse(node)} is no number")
        return f"(real)({text})" if kind == WHOLE else text

    def truth(self, node: ast.expr) -> str:
        """Return an expression as a condition or a whole number."""
        kind, text = self.visit(node)
        if kind != WHOLE:
            self.refuse(node, f"{ast.unparse(node)} is no condition; compare it with a number")
        return str(text)

    def visit_Constant(self, node: ast.Constant) -> tuple[str, str]:
        if isinstance(node.value, int) and node.value < 2**31:  # True and False, too
            return WHOLE, str(int(node.value))
        if not isinstance(node.value, float):
            self.generic_visit(node)
        if not fits_float(node.value):
            self.refuse(node, f"{node.value!r} is no number of single precision")
        return REAL, f"R({node.value!r})"

    def visit_Name(self, node: ast.Name) -> tuple[str, str]:
        return (self.types[node.id], self.c_name(node.id)) if node.id in self.types else self.generic_visit(node)

    def visit_Attribute(self, node: ast.Attribute) -> tuple[str, str]:
        record = node.value.id if isinstance(node.value, ast.Name) else ""
        kind = self.printer.structs.get(self.types.get(record, ""), {}).get(node.attr)
        if kind is None:
            self.generic_visit(node)
        return kind, f"{self.c_name(record)}{'->' if self.pointed(record) else '.'}{node.attr}"

    def visit_Tuple(self, node: ast.Tuple) -> tuple[str, str]:
        parts = [self.value(each) for each in node.elts]
        kind = self.printer.tuple_of([each for each, _ in parts])
        return kind, f"({kind}){{{', '.join(text for _, text in parts)}}}"

    def visit_UnaryOp(self, node: ast.UnaryOp) -> tuple[str, str]:
        if isinstance(node.op, ast.Not):
            return WHOLE, f"(!{self.truth(node.operand)})"
        kind, text = self.visit(node.operand)
        return (kind, f"(-{text})") if isinstance(node.op, ast.USub) else self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> tuple[str, str]:
        joint = " && " if isinstance(node.op, ast.And) else " || "
        return WHOLE, f"({joint.join(self.truth(each) for each in node.values)})"

    def visit_Compare(self, node: ast.Compare) -> tuple[str, str]:
        sides = [node.left, *node.comparators]
        if not all(type(each) in COMPARED for each in node.ops):
            self.generic_visit(node)
        whole = all(self.visit(each)[0] == WHOLE for each in sides)
        texts = [self.truth(each) if whole else self.real(each) for each in sides]
        signs = [COMPARED[type(each)] for each in node.ops]
        pairs = [f"{a} {sign} {b}" for a, sign, b in zip(texts[:-1], signs, texts[1:], strict=True)]
        return WHOLE, f"({' && '.join(pairs)})"

    def visit_IfExp(self, node: ast.IfExp) -> tuple[str, str]:
        test, (kind, yes), (other, no) = self.truth(node.test), self.value(node.body), self.value(node.orelse)
        if {kind, other} == {REAL, WHOLE}:
            kind, yes, no = REAL, self.real(node.body), self.real(node.orelse)
        elif kind != other:
            self.generic_visit(node)
        return kind, f"({test} ? {yes} : {no})"

    def visit_BinOp(self, node: ast.BinOp) -> tuple[str, str]:
        if type(node.op) in LOGICAL:
            return WHOLE, f"({self.truth(node.left)} {LOGICAL[type(node.op)]} {self.truth(node.right)})"
        if type(node.op) in CALLED:
            called, more = CALLED[type(node.op)]
            self.printer.used |= more
            return REAL, f"{called}({self.real(node.left)}, {self.real(node.right)})"
        if type(node.op) not in BINARY:
            self.generic_visit(node)
        (left, a), (right, b) = self.visit(node.left), self.visit(node.right)
        if left == right == WHOLE and not isinstance(node.op, ast.Div):
            return WHOLE, f"({a} {BINARY[type(node.op)]} {b})"
        return REAL, f"({self.real(node.left)} {BINARY[type(node.op)]} {self.real(node.right)})"

    def visit_Call(self, node: ast.Call) -> tuple[str, str]:
        name, own = ast.unparse(node.func), self.printer
        module, _, function = name.rpartition(".")
        method = name.removeprefix("percept_")
        own.parse_blocks()
        if name in ("real", "int"):
            return (REAL, self.real(node.args[0])) if name == "real" else (WHOLE, f"(int)({self.real(node.args[0])})")
        if name in ("least", "most", "abs") or (module == "math" and function in MATHS):
            own.used.add(used := "fabs" if name == "abs" else function)
            called = used if used in PRELUDE else f"r_{used}"
            return REAL, f"{called}({', '.join(self.real(each) for each in node.args)})"
        if method != name and method in PERCEPT_METHODS:
            given = [self.truth(each) if method in DRAWS else self.real(each) for each in node.args[1:]]
            return REAL, f"percept->{method}({', '.join(['percept->context', *given])})"
        if name in own.structs:
            kinds = zip(self.in_order(node, list(own.structs[name])), own.structs[name].values(), strict=True)
            given = [self.real(each) if kind == REAL else self.value(each)[1] for each, kind in kinds]
            return name, f"({name}){{{', '.join(given)}}}"
        if name not in own.trees:
            self.refuse(node, f"calls {name}, which has no form in C; of math.h there are {', '.join(sorted(MATHS))}")
        values = self.in_order(node, [each.arg for each in own.trees[name].args.args])
        types = [self.visit(each)[0] for each in values]
        if name in own.functions:  # a whole number may be handed where a number is expected
            known = own.functions[name].arguments.values()
            types = [REAL if (want, kind) == (REAL, WHOLE) else kind for want, kind in zip(known, types, strict=True)]
        found = own.called(name, types)
        return found.returned, f"{name}({', '.join(self.passed(each) for each in values)})"

    def in_order(self, node: ast.Call, names: list[str]) -> list[ast.expr]:
        """Return the values of a call in the order of the names; those by keyword, too."""
        values = dict(zip(names, node.args, strict=False)) | {str(each.arg): each.value for each in node.keywords}
        if len(node.args) > len(names) or set(values) != set(names):
            self.refuse(node, f"{ast.unparse(node)} needs {', '.join(names)}, each once")
        return [values[each] for each in names]

    def passed(self, node: ast.expr) -> str:
        """Return an argument as C: a record by its address."""
        kind, text = self.visit(node)
        given = kind in (REAL, WHOLE) or (isinstance(node, ast.Name) and self.pointed(node.id))
        return str(text) if given else f"&{text}"


def fits_float(number: float) -> bool:
    """Return True if a number is zero, or none that becomes zero or infinite in single precision."""
    return number == 0.0 or 1.2e-38 < abs(number) < 3.4e38
