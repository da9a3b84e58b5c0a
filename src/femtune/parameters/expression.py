"""Expressions that tie a constrained parameter to free ones: arithmetic on names, parsed and never executed."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from femtune.errors import FemtuneError, Where, did_you_mean

_FUNCTIONS = ("sqrt", "exp", "log", "sin", "cos", "tan")
"""Each is a function of `femtune.parameters.jet`, and of numpy."""
_OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow)
_MOST_CHARACTERS = 500
"""Longest expression; ties are short, and a text from a file must not keep the parser busy."""
_MOST_LEVELS = 40
"""Deepest nesting of an expression, far below the limit of Python's recursion."""


@dataclass(frozen=True)
class Expression:
    """An expression such as ``0.5*(Icx1 + Icx2)``: + − * / **, sqrt exp log sin cos tan, numbers and names."""

    text: str
    names: tuple[str, ...]
    _tree: ast.expr = field(repr=False, compare=False)
    where: Where | None = field(default=None, compare=False)

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """Evaluate on jets, or on real or complex numbers, by name.

        Raises
        ------
        FemtuneError : ``tie.value`` if the result, or a derivative of it, is not a finite number
        """
        # numpy is imported when an expression is evaluated, not when a study file is checked
        from femtune.parameters.evaluation import evaluate, is_finite, plain_value  # noqa: PLC0415

        result = evaluate(self._tree, values)
        if is_finite(result):
            return result
        at = {n: plain_value(values[n]) for n in self.names}
        raise FemtuneError("tie.value", where=self.where, values=at, text=self.text)


def parse_expression(text: str, where: Where | None = None) -> Expression:
    """Read an expression.

    Raises
    ------
    FemtuneError : ``tie.syntax`` for anything but arithmetic on names and numbers
    """
    if len(text) > _MOST_CHARACTERS:
        raise _refused(text[:40] + "…", f"is longer than {_MOST_CHARACTERS} characters", where)
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise _refused(text, "is not an expression", where) from error
    names: dict[str, None] = {}
    _check(tree, names, text, where, 0)
    return Expression(text, tuple(names), tree, where)


def _refused(text: str, why: str, where: Where | None, hint: str = "") -> FemtuneError:
    hint = hint or "use + - * / ** ( ) numbers, parameter names and sqrt exp log sin cos tan"
    return FemtuneError("tie.syntax", where=where, hint=hint, text=text, reason=why)


def _check(node: ast.expr, names: dict[str, None], text: str, where: Where | None, depth: int) -> None:
    if depth > _MOST_LEVELS:
        raise _refused(text, "is nested too deeply", where)
    if isinstance(node, ast.Name):
        names[node.id] = None
    elif isinstance(node, ast.Constant):
        if not _is_number(node.value):
            raise _refused(text, f"has a value that is not a number: {ast.unparse(node)[:40]}", where)
    else:
        for child in _children(node, text, where):
            _check(child, names, text, where, depth + 1)


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _children(node: ast.expr, text: str, where: Where | None) -> list[ast.expr]:
    if isinstance(node, ast.BinOp) and isinstance(node.op, _OPERATORS):
        return [node.left, node.right]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        return [node.operand]
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and len(node.args) == 1 and not node.keywords:
        if node.func.id in _FUNCTIONS:
            return [node.args[0]]
        raise _refused(text, f"calls '{node.func.id}'", where, did_you_mean(node.func.id, _FUNCTIONS))
    raise _refused(text, f"contains something other than arithmetic: {ast.unparse(node)[:40]}", where)
