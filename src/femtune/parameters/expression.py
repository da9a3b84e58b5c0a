"""Expressions that tie a constrained parameter to free ones: arithmetic on names, read and never executed."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from femtune.errors import FemtuneError, Where, did_you_mean
from femtune.parameters import jet
from femtune.parameters.jet import Jet

_FUNCTIONS: dict[str, Callable[[Jet], Jet]] = {
    "sqrt": jet.sqrt, "exp": jet.exp, "log": jet.log, "sin": jet.sin, "cos": jet.cos, "tan": jet.tan,
}  # fmt: skip
_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b,
}
_MAX_LENGTH, _MAX_DEPTH = 500, 40


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
        FemtuneError : ``tie.value`` where the result, or a derivative of it, is no finite number
        """
        with np.errstate(all="ignore"):
            result = _evaluate(self._tree, values)
        if not _finite(result):
            raise self._no_number(values)
        return result

    def _no_number(self, values: Mapping[str, Any]) -> FemtuneError:
        at = {n: values[n].value if isinstance(values[n], Jet) else values[n] for n in self.names}
        return FemtuneError(
            "tie.value",
            f"'{self.text}' has no finite value or derivative",
            where=self.where,
            values=at,
            hint="mend the expression, or set bounds that keep it off a division by zero, a root or logarithm "
            "of a negative number and an overflow",
        )


def parse_expression(text: str, where: Where | None = None) -> Expression:
    """Read an expression.

    Raises
    ------
    FemtuneError : ``tie.syntax`` for anything but arithmetic on names and numbers
    """
    if len(text) > _MAX_LENGTH:
        raise _refused(text[:40] + "…", f"is longer than {_MAX_LENGTH} characters", where)
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise _refused(text, "is not an expression", where) from error
    names: dict[str, None] = {}
    _check(tree, names, text, where, 0)
    return Expression(text, tuple(names), tree, where)


def _refused(text: str, why: str, where: Where | None, hint: str = "") -> FemtuneError:
    hint = hint or "use + - * / ** ( ) numbers, parameter names and sqrt exp log sin cos tan"
    return FemtuneError("tie.syntax", f"'{text}' {why}", where=where, hint=hint)


def _check(node: ast.expr, names: dict[str, None], text: str, where: Where | None, depth: int) -> None:
    if depth > _MAX_DEPTH:
        raise _refused(text, "is nested too deeply", where)
    if isinstance(node, ast.Name):
        names[node.id] = None
    elif isinstance(node, ast.Constant):
        if not _is_number(node.value):
            raise _refused(text, f"has a value that is no number: {ast.unparse(node)[:40]}", where)
    else:
        for child in _children(node, text, where):
            _check(child, names, text, where, depth + 1)


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return bool(np.isfinite(float(value)))
    except OverflowError:
        return False


def _children(node: ast.expr, text: str, where: Where | None) -> list[ast.expr]:
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return [node.left, node.right]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        return [node.operand]
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and len(node.args) == 1 and not node.keywords:
        if node.func.id in _FUNCTIONS:
            return [node.args[0]]
        raise _refused(text, f"calls '{node.func.id}'", where, did_you_mean(node.func.id, _FUNCTIONS))
    raise _refused(text, f"has a part that is not arithmetic: {ast.unparse(node)[:40]}", where)


def _evaluate(node: ast.expr, values: Mapping[str, Any]) -> Any:
    if isinstance(node, ast.Name):
        return values[node.id]
    if isinstance(node, ast.Constant):
        # numpy's float: overflow and division by zero give inf, which is refused once, at the end
        return np.float64(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.BinOp):
        return _OPERATORS[type(node.op)](_evaluate(node.left, values), _evaluate(node.right, values))
    if isinstance(node, ast.UnaryOp):
        operand = _evaluate(node.operand, values)
        return -operand if isinstance(node.op, ast.USub) else operand
    assert isinstance(node, ast.Call)
    assert isinstance(node.func, ast.Name)
    return _apply(node.func.id, _evaluate(node.args[0], values))


def _finite(x: Any) -> bool:
    parts = (x.value, x.grad, x.hess) if isinstance(x, Jet) else (x,)
    return all(bool(np.isfinite(part).all()) for part in parts)


def _apply(name: str, x: Any) -> Any:
    if isinstance(x, Jet):
        return _FUNCTIONS[name](x)
    return getattr(np, name)(x)
