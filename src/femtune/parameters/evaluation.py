"""The value of an expression, on jets or on real or complex numbers."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from femtune.parameters import jet
from femtune.parameters.jet import Jet

_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


def evaluate(tree: ast.expr, values: Mapping[str, Any]) -> Any:
    """The value of an expression that was checked when it was read; it need not be finite.

    Parameters
    ----------
    tree : the body of the expression
    values : jets or numbers, by name
    """
    with np.errstate(all="ignore"):
        return _evaluate(tree, values)


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
    argument = _evaluate(node.args[0], values)
    return getattr(jet if isinstance(argument, Jet) else np, node.func.id)(argument)


def is_finite(x: Any) -> bool:
    """Whether a value, and its derivatives if it has any, are finite numbers."""
    parts = (x.value, x.grad, x.hess) if isinstance(x, Jet) else (x,)
    return all(bool(np.isfinite(part).all()) for part in parts)


def plain_value(x: Any) -> Any:
    """The value without derivatives."""
    return x.value if isinstance(x, Jet) else x
