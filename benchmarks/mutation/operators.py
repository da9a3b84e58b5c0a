"""Small faults that could be made in numerical code, each a replacement of one piece of a file's text.

Text, annotations, decorators and what only builds a message are left alone: a fault there changes no number.
"""

from __future__ import annotations

import ast
import hashlib
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

_OTHER_OPERATOR = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.Pow: "*", ast.FloorDiv: "*", ast.Mod: "*",
    ast.BitAnd: "|", ast.BitOr: "&",
}  # fmt: skip
_OTHER_COMPARISON = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==", ast.Is: "is not",
    ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in",
}  # fmt: skip
_PAIRS = (
    ("min", "max"), ("minimum", "maximum"), ("argmin", "argmax"), ("any", "all"), ("sum", "mean"), ("sin", "cos"),
    ("floor", "ceil"), ("zeros", "ones"), ("real", "imag"), ("nanmin", "nanmax"), ("vstack", "hstack"),
    ("sinh", "cosh"), ("rows", "columns"),
)  # fmt: skip
_OTHER_NAME = dict(_PAIRS) | {b: a for a, b in _PAIRS}
_MAY_BE_LEFT_OUT = {"abs", "conj", "conjugate", "sqrt", "real", "transpose", "sorted", "reversed", "square"}
_SPEED_ONLY = {"copy", "dtype", "optimize", "check_finite", "overwrite_a", "overwrite_b", "strict", "order"}
_OF_MESSAGES = {"FemtuneError", "Notice"}
SMALL = 1e-3
"""Numbers below are taken for tolerances, and are multiplied by a million; a factor of two is no fault there."""


@dataclass(frozen=True)
class Mutant:
    """One fault.

    Parameters
    ----------
    file, function : where; the function is "" at the level of the module
    line, last : lines of the piece that is replaced
    start, end : bytes of it in the file
    before, after : the piece, and what stands there instead
    around : first and last line of the function, or of the statement outside of functions
    number : 0, 1, … among equal replacements in one function
    """

    file: str
    function: str
    line: int
    last: int
    start: int
    end: int
    before: str
    after: str
    around: tuple[int, int]
    number: int = 0

    @property
    def key(self) -> str:
        """What names the mutant; it stays when other lines of the file move."""
        return f"{self.file}::{self.function} | {_one_line(self.before)} -> {_one_line(self.after)} | {self.number}"

    def applied(self, source: bytes) -> bytes:
        """The file with the fault."""
        return source[: self.start] + self.after.encode() + source[self.end :]


def mutants(root: Path, file: Path) -> list[Mutant]:
    """All faults of a file, in the order of its text."""
    source = file.read_bytes()
    found = _File(source, str(file.relative_to(root))).found(ast.parse(source))
    seen: Counter[str] = Counter()
    numbered = []
    for mutant in sorted(set(found), key=lambda m: (m.start, m.end, m.after)):
        numbered.append(Mutant(**{**vars(mutant), "number": seen[mutant.key]}))
        seen[mutant.key] += 1
    return numbered


def sample(all_of_them: Iterable[Mutant], count: int, seed: int) -> list[Mutant]:
    """Mutants by the hash of seed and name: a change of the code moves the sample only where it changes mutants."""
    return sorted(all_of_them, key=lambda m: hashlib.sha256(f"{seed} {m.key}".encode()).digest())[:count]


class _File:
    def __init__(self, source: bytes, name: str) -> None:
        self.source, self.name = source, name
        self.starts = [0]
        for line in source.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))

    def found(self, tree: ast.Module) -> Iterator[Mutant]:
        for statement in tree.body:
            yield from self._below(statement, "", _span(statement))

    def _below(self, node: ast.AST, function: str, around: tuple[int, int]) -> Iterator[Mutant]:
        if _left_alone(node):
            return
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            function = f"{function}.{node.name}" if function else node.name
        if isinstance(node, ast.FunctionDef):
            around = _span(node)
        for old, new in self._faults(node):
            yield Mutant(self.name, function, *_span(old), *self._bytes(old), self.text(old), new, around)
        for child in _children(node):
            yield from self._below(child, function, around if function else _span(child, around))

    def _faults(self, node: ast.AST) -> Iterator[tuple[ast.AST, str]]:
        """Nodes and what replaces them."""
        for kind, faults in _FAULTS.items():
            if isinstance(node, kind):
                yield from faults(self, node)

    def text(self, node: ast.AST) -> str:
        start, end = self._bytes(node)
        return self.source[start:end].decode()

    def _bytes(self, node: ast.AST) -> tuple[int, int]:
        first, last = self.starts[node.lineno - 1], self.starts[node.end_lineno - 1]  # type: ignore[attr-defined]
        return first + node.col_offset, last + node.end_col_offset  # type: ignore[attr-defined]


def _binary(file: _File, node: ast.BinOp) -> Iterator[tuple[ast.AST, str]]:
    if any(isinstance(side, ast.List | ast.Tuple) or _is_text(side) for side in (node.left, node.right)):
        return
    left, right = file.text(node.left), file.text(node.right)
    if type(node.op) in _OTHER_OPERATOR:
        yield node, f"(({left}) {_OTHER_OPERATOR[type(node.op)]} ({right}))"
    if isinstance(node.op, ast.MatMult):
        yield node, f"(({right}) @ ({left}))"
    if isinstance(node.op, ast.Add | ast.Sub | ast.Mult | ast.Div | ast.Pow):
        yield node, f"({left})"
    if isinstance(node.op, ast.Add | ast.Mult):
        yield node, f"({right})"


def _unary(file: _File, node: ast.UnaryOp) -> Iterator[tuple[ast.AST, str]]:
    yield node, f"({file.text(node.operand)})"


def _comparison(file: _File, node: ast.Compare) -> Iterator[tuple[ast.AST, str]]:
    sides = [file.text(side) for side in (node.left, *node.comparators)]
    for i, operator in enumerate(node.ops):
        signs = [_sign(o) for o in node.ops]
        signs[i] = _OTHER_COMPARISON[type(operator)]
        yield node, f"({sides[0]} " + " ".join(f"{s} {side}" for s, side in zip(signs, sides[1:])) + ")"


def _sign(operator: ast.cmpop) -> str:
    comparison = ast.unparse(ast.Compare(ast.Name("a"), [operator], [ast.Name("b")]))
    return comparison.removeprefix("a ").removesuffix(" b")


def _boolean(file: _File, node: ast.BoolOp) -> Iterator[tuple[ast.AST, str]]:
    word = " or " if isinstance(node.op, ast.And) else " and "
    yield node, "(" + word.join(f"({file.text(value)})" for value in node.values) + ")"


def _constant(file: _File, node: ast.Constant) -> Iterator[tuple[ast.AST, str]]:
    value = node.value
    if isinstance(value, bool):
        yield node, str(not value)
    elif isinstance(value, int):
        yield node, str(value + 1)
    elif isinstance(value, float | complex) and value != 0.0:
        yield node, f"({file.text(node)} * {'1e6' if abs(value) < SMALL else '2'})"
    elif isinstance(value, float):
        yield node, "1.0"


def _branch(file: _File, node: ast.If | ast.IfExp | ast.While) -> Iterator[tuple[ast.AST, str]]:
    yield node.test, f"(not ({file.text(node.test)}))"


def _filter(file: _File, node: ast.comprehension) -> Iterator[tuple[ast.AST, str]]:
    for condition in node.ifs:
        yield condition, f"(not ({file.text(condition)}))"


def _call(file: _File, node: ast.Call) -> Iterator[tuple[ast.AST, str]]:
    function, arguments = node.func, [file.text(a) for a in node.args]
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    if name in _MAY_BE_LEFT_OUT and arguments:
        yield node, f"({arguments[0]})"
    elif name in _MAY_BE_LEFT_OUT and isinstance(function, ast.Attribute):
        yield node, f"({file.text(function.value)})"
    for keyword in node.keywords:
        if keyword.arg and keyword.arg not in _SPEED_ONLY:
            rest = [f"{k.arg}={file.text(k.value)}" if k.arg else f"**{file.text(k.value)}" for k in node.keywords
                    if k is not keyword]  # fmt: skip
            yield node, f"{file.text(function)}({', '.join([*arguments, *rest])})"


def _attribute(file: _File, node: ast.Attribute) -> Iterator[tuple[ast.AST, str]]:
    if node.attr == "T":
        yield node, f"({file.text(node.value)})"
    elif node.attr in _OTHER_NAME:
        yield node, file.text(node).removesuffix(node.attr) + _OTHER_NAME[node.attr]


def _name(file: _File, node: ast.Name) -> Iterator[tuple[ast.AST, str]]:
    if node.id in ("min", "max", "any", "all") and isinstance(node.ctx, ast.Load):
        yield node, _OTHER_NAME[node.id]


def _slice(file: _File, node: ast.Slice) -> Iterator[tuple[ast.AST, str]]:
    for bound in (node.lower, node.upper):
        if bound is not None and not isinstance(bound, ast.Constant):
            yield bound, f"({file.text(bound)} + 1)"


def _augmented(file: _File, node: ast.AugAssign) -> Iterator[tuple[ast.AST, str]]:
    if type(node.op) in _OTHER_OPERATOR:
        yield node, f"{file.text(node.target)} {_OTHER_OPERATOR[type(node.op)]}= {file.text(node.value)}"
    yield node, "pass"


def _statement(file: _File, node: ast.Expr) -> Iterator[tuple[ast.AST, str]]:
    if isinstance(node.value, ast.Call) and not any(_is_text(a) for a in node.value.args):
        yield node, "pass"


def _jump(file: _File, node: ast.Break | ast.Continue) -> Iterator[tuple[ast.AST, str]]:
    yield node, "continue" if isinstance(node, ast.Break) else "break"


_FAULTS = {
    ast.BinOp: _binary, ast.UnaryOp: _unary, ast.Compare: _comparison, ast.BoolOp: _boolean, ast.Constant: _constant,
    ast.If: _branch, ast.IfExp: _branch, ast.While: _branch, ast.comprehension: _filter, ast.Call: _call,
    ast.Attribute: _attribute, ast.Name: _name, ast.Slice: _slice, ast.AugAssign: _augmented, ast.Expr: _statement,
    ast.Break: _jump, ast.Continue: _jump,
}  # fmt: skip


def _left_alone(node: ast.AST) -> bool:
    """Text, types and what builds messages."""
    if isinstance(node, ast.FunctionDef):
        return node.name in ("__repr__", "__str__") or _returns_text(node.returns)
    if isinstance(node, ast.Assign):
        return _is_type(node.value) or any(getattr(target, "id", "") == "__all__" for target in node.targets)
    if isinstance(node, ast.Call):
        name = getattr(node.func, "id", getattr(node.func, "attr", ""))
        return name in _OF_MESSAGES or name.endswith("Error") or name in ("TypeVar", "field")
    return isinstance(node, ast.Raise | ast.JoinedStr | ast.Import | ast.ImportFrom | ast.Assert)


def _returns_text(annotation: ast.expr | None) -> bool:
    words = {n.id for n in ast.walk(annotation) if isinstance(n, ast.Name)} if annotation is not None else set()
    return words in ({"str"}, {"tuple", "str"}, {"list", "str"}, {"FemtuneError"}, {"Notice"})


def _is_type(node: ast.expr) -> bool:
    """An alias such as X = Literal["a", "b"] or X = A | B; names of types begin with a capital."""
    if isinstance(node, ast.Subscript):
        return _is_type(node.value)
    if isinstance(node, ast.BinOp):
        sides = (node.left, node.right)
        return isinstance(node.op, ast.BitOr) and any(_is_type(s) or ast.unparse(s) == "None" for s in sides)
    return isinstance(node, ast.Name) and node.id[0].isupper() and not node.id.isupper()


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _children(node: ast.AST) -> Iterator[ast.AST]:
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "bases", "format_spec"):
            continue
        yield from (v for v in (value if isinstance(value, list) else [value]) if isinstance(v, ast.AST))


def _span(node: ast.AST, otherwise: tuple[int, int] = (0, 0)) -> tuple[int, int]:
    first = getattr(node, "lineno", None)
    return otherwise if first is None else (first, node.end_lineno)  # type: ignore[attr-defined]


def _one_line(text: str) -> str:
    return " ".join(text.split())
