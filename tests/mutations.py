"""What a mutation is: one changed operator, constant, condition, bound or call; and which ones are drawn."""

from __future__ import annotations

import ast
import hashlib
import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from types import CodeType

ROOT = Path(__file__).parents[1]
SOURCES = ("core/toposeam", "cli/toposeam_cli", "plugin_gimp/toposeam_engine")

_COMPARED = {
    "<": "<=",
    "<=": "<",
    ">": ">=",
    ">=": ">",
    "==": "!=",
    "!=": "==",
    "is": "is not",
    "is not": "is",
    "in": "not in",
    "not in": "in",
}
_OPERATORS = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Is: "is",
    ast.IsNot: "is not",
    ast.In: "in",
    ast.NotIn: "not in",
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.FloorDiv: "//",
    ast.BitAnd: "&",
    ast.BitOr: "|",
    ast.Mod: "%",
    ast.Pow: "**",
}
_SWAPPED = {"+": "-", "-": "+", "*": "/", "/": "*", "&": "|", "|": "&", "//": "*", "%": "+", "**": "*"}
_CALLS = {
    "min": "max",
    "max": "min",
    "any": "all",
    "all": "any",
    "minimum": "maximum",
    "maximum": "minimum",
    "argmin": "argmax",
    "argmax": "argmin",
    "floor": "ceil",
    "ceil": "floor",
}


#: Guards of what is true anyway, and options of dataclasses: how they are called and shown is no computation,
#: and test_house.py checks that they are frozen, and compared by identity where they hold arrays.
_DECLARED = ("strict", "slots", "frozen", "eq", "kw_only", "repr")


@dataclass(frozen=True, slots=True)
class Mutation:
    """One changed expression."""

    file: str
    line: int
    start: int
    end: int
    before: str
    after: str

    @property
    def name(self) -> str:
        return f"{self.file}:{self.line}: {self.before!r} → {self.after!r}"


def mutations_of(path: Path) -> list[Mutation]:
    """Every mutation of a file, in the order of its text."""
    text = path.read_text(encoding="utf-8")
    name = path.relative_to(ROOT).as_posix()
    begin = [0]
    for line in text.splitlines(keepends=True):
        begin.append(begin[-1] + len(line.encode()))
    raw = text.encode()
    found: list[Mutation] = []

    def place(node: ast.expr | ast.stmt) -> tuple[int, int]:
        return begin[node.lineno - 1] + node.col_offset, begin[node.end_lineno - 1] + node.end_col_offset  # type: ignore[operator]

    def add(node: ast.expr | ast.stmt, start: int, end: int, after: str) -> None:
        before = raw[start:end].decode()
        if before != after:
            found.append(Mutation(name, node.lineno, start, end, before, after))

    def between(node: ast.expr, left: ast.expr, right: ast.expr, operator: str, after: str) -> None:
        start, end = place(left)[1], place(right)[0]
        gap = raw[start:end].decode()
        if gap.count(operator) == 1 and "#" not in gap:
            at = start + len(gap[: gap.index(operator)].encode())
            add(node, at, at + len(operator), after)

    tree = ast.parse(text)
    silent = [node for node in ast.walk(tree) if _says_only(node)]
    silent += [node.annotation for node in ast.walk(tree) if isinstance(node, ast.AnnAssign)]
    silent += [node.returns for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.returns]
    skipped = {id(child) for node in silent for child in ast.walk(node)}
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            operator = _OPERATORS[type(node.ops[0])]
            between(node, node.left, node.comparators[0], operator, _COMPARED[operator])
        elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            operator = _OPERATORS[type(node.op)]
            if not _is_text(node.left):
                between(node, node.left, node.right, operator, _SWAPPED[operator])
        elif isinstance(node, ast.BoolOp):
            operator, other = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
            if len(node.values) == 2:
                between(node, node.values[0], node.values[1], operator, other)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.Invert | ast.USub):
            start, _ = place(node)
            add(node, start, place(node.operand)[0], "")
        elif (
            isinstance(node, ast.Constant)
            and isinstance(node.value, int | float)
            and not isinstance(node.value, bool)
        ):
            start, end = place(node)
            add(node, start, end, repr(node.value + 1 if isinstance(node.value, int) else node.value * 2))
        elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
            start, end = place(node)
            add(node, start, end, repr(not node.value))
        elif isinstance(node, ast.Call):
            called = node.func
            word = (
                called.attr
                if isinstance(called, ast.Attribute)
                else called.id
                if isinstance(called, ast.Name)
                else ""
            )
            if word in _CALLS:
                _, end = place(called)
                add(node, end - len(word), end, _CALLS[word])
        elif isinstance(node, ast.If | ast.IfExp):
            start, end = place(node.test)
            add(node.test, start, end, f"not ({raw[start:end].decode()})")
        elif isinstance(node, ast.AugAssign) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
        ):
            start, end = place(node)
            add(node, start, end, "pass")
    return found


def at_import(file: str, line: int) -> bool:
    """Whether a line stands in no function: it is executed once, whatever hangs on it."""
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    return not any(node.body[0].lineno <= line <= (node.end_lineno or 0) for node in functions)


def _says_only(node: ast.AST) -> bool:
    """Whether a node is about texts, types or options, not about what is computed."""
    if isinstance(node, ast.Raise | ast.JoinedStr | ast.AnnAssign) and not (
        isinstance(node, ast.AnnAssign) and node.value
    ):
        return True
    if isinstance(node, ast.FunctionDef) and node.name in ("__repr__", "__str__"):
        return True
    if isinstance(node, ast.FunctionDef):
        return False
    if (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr in ("option", "argument", "command", "echo")
    ):
        return True
    if isinstance(node, ast.keyword) and node.arg in _DECLARED:
        return True
    return isinstance(node, ast.arg | ast.Import | ast.ImportFrom)


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def chosen(count: int, seed: int, only: str, tests: dict[str, dict[int, list[str]]] | None) -> list[Mutation]:
    """Some mutations, with a map those of executed lines, spread over the files by their square roots, so
    that no room is left out. Each one's chance follows from the seed and its own text, as if it drew a lot
    (Efraimidis and Spirakis 2006, doi:10.1016/j.ipl.2005.11.003): a change of the code changes the draw by
    the lines that changed, so that a share which once was reached stays comparable.
    """
    lots: list[tuple[float, Mutation]] = []
    for source in SOURCES:
        for path in sorted((ROOT / source).rglob("*.py")):
            if not path.relative_to(ROOT).as_posix().startswith(only):
                continue
            found = mutations_of(path)
            lines = path.read_text(encoding="utf-8").splitlines()
            met: Counter[str] = Counter()
            for mutation in found:
                text = "\0".join((lines[mutation.line - 1].strip(), mutation.before, mutation.after))
                met[text] += 1
                told = hashlib.sha256(f"{seed}\0{mutation.file}\0{text}\0{met[text]}".encode()).digest()
                chance = (int.from_bytes(told[:8]) + 1) / 2.0**64
                lots.append((-math.log(chance) * len(found) ** 0.5, mutation))
    drawn: dict[str, Mutation] = {}
    for _, mutation in sorted(lots, key=lambda lot: lot[0]):
        if len(drawn) == count:
            break
        executed = tests is None or mutation.line in tests.get(mutation.file, {})
        if executed and mutation.name not in drawn and _parses(mutation):
            drawn[mutation.name] = mutation
    return list(drawn.values())


def same_code(mutation: Mutation) -> bool:
    """Whether the mutated file compiles to the same instructions and constants."""
    raw = (ROOT / mutation.file).read_bytes()
    changed = raw[: mutation.start] + mutation.after.encode() + raw[mutation.end :]
    before, after = (compile(text, mutation.file, "exec", optimize=2) for text in (raw, changed))
    return _instructions(before) == _instructions(after)


def _instructions(code: CodeType) -> tuple[object, ...]:
    """What a code object does, without the places of its text."""
    constants = tuple(
        _instructions(value) if isinstance(value, CodeType) else (type(value), repr(value))
        for value in code.co_consts
    )
    return code.co_code, constants, code.co_names, code.co_varnames, code.co_freevars, code.co_flags


def _parses(mutation: Mutation) -> bool:
    raw = (ROOT / mutation.file).read_bytes()
    try:
        ast.parse(raw[: mutation.start] + mutation.after.encode() + raw[mutation.end :])
    except SyntaxError:
        return False
    return True
