"""Functions that are made of data, and that can be sent to another process, by their maker and its arguments."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from importlib import import_module
from typing import Any


class MadeRule:
    """What a function with `makes_rules` returns.

    Examples
    --------
    >>> from femtune.files.nastran.shell_properties import corner_mean
    >>> corner_mean(2)(1.0, 2.0)
    1.5
    """

    def __init__(self, maker: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        self._maker, self._arguments = maker, arguments
        self._function: Callable[..., Any] = maker(*arguments)

    def __call__(self, *values: Any) -> Any:
        """The value of the function."""
        return self._function(*values)

    def __reduce__(self) -> tuple[Any, ...]:
        """By the name of the maker: Python cannot send the function itself."""
        return _made, (self._maker.__module__, self._maker.__qualname__, self._arguments)


def _made(module: str, name: str, arguments: tuple[Any, ...]) -> Any:
    return getattr(import_module(module), name)(*arguments)


def makes_rules(maker: Callable[..., Callable[..., Any]]) -> Callable[..., MadeRule]:
    """For a function of a module that returns a function: what it returns can be sent to another process."""

    @wraps(maker)
    def made(*arguments: Any) -> MadeRule:
        return MadeRule(maker, arguments)

    return made
