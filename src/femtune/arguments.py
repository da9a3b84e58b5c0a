"""Arguments of the functions that users call, checked against the annotations of their signature."""

from __future__ import annotations

import ast
import os
from collections.abc import Callable, Mapping, Sequence
from functools import cache, wraps
from inspect import Parameter, Signature, signature
from numbers import Integral, Real
from reprlib import repr as shortened
from types import UnionType
from typing import Any, ParamSpec, TypeVar, get_args, get_origin

from femtune.errors import FemtuneError, did_you_mean

P = ParamSpec("P")
T = TypeVar("T")


def checked(function: Callable[P, T]) -> Callable[P, T]:
    """The function, with a `FemtuneError` instead of a TypeError for a call that does not fit its signature.

    The annotations are the texts of the signature. Classes are compared by name, so that classes that are imported for
    type checkers only are not needed. Elements of ``Sequence[...]`` and values of ``Mapping[str, ...]`` are checked as
    well.

    Raises
    ------
    FemtuneError : ``call.signature`` for missing, superfluous or misspelt arguments, ``call.argument`` for an argument
        of the wrong type

    Examples
    --------
    >>> from femtune.arguments import checked
    >>> @checked
    ... def half(value: "float") -> "float":
    ...     return value / 2
    >>> half("three")
    Traceback (most recent call last):
    femtune.errors.FemtuneError: [call.argument] the argument 'value' of half should be float, not str
      value = 'three'
    <BLANKLINE>
    hint: see help(femtune.half)
    """
    declared = signature(function)
    called = function.__qualname__.removesuffix(".__init__")
    if function.__module__ == "femtune.plot":
        called = f"plot.{called}"
    names = getattr(function, "__globals__", {})

    @wraps(function)
    def call(*args: P.args, **words: P.kwargs) -> T:
        try:
            given = declared.bind(*args, **words).arguments
        except TypeError as error:
            unknown = [word for word in words if word not in declared.parameters]
            hint = did_you_mean(unknown[0], list(declared.parameters)) if unknown else _named(declared, len(args))
            raise FemtuneError("call.signature", function=called, reason=error, hint=hint or None) from None
        for name, value in given.items():
            parameter = declared.parameters[name]
            if parameter.kind is Parameter.VAR_KEYWORD or not isinstance(parameter.annotation, str):
                continue
            allowed = _alternatives(_parsed(parameter.annotation), names)
            _check(value, allowed, name, called)
        return function(*args, **words)

    return call


def _named(declared: Signature, given: int) -> str:
    """What to write if more arguments were given without a name than may be; "" if that is not so."""
    kinds = (Parameter.POSITIONAL_ONLY, Parameter.POSITIONAL_OR_KEYWORD)
    free = [p.name for p in declared.parameters.values() if p.kind in kinds]
    named = [p.name for p in declared.parameters.values() if p.kind is Parameter.KEYWORD_ONLY and p.name != "progress"]
    if given <= len(free) or not named:
        return ""
    allowed = f"only {' and '.join(free)} may stand without a name" if free else "no argument may stand without a name"
    return f"{allowed}; write the others as {', '.join(f'{name}=…' for name in named[:4])}"


@cache
def _parsed(annotation: str) -> ast.expr:
    return ast.parse(annotation, mode="eval").body


def _check(value: Any, allowed: Sequence[tuple[str, ast.expr | None]], name: str, called: str) -> None:
    fitting = [of for word, of in allowed if _fits(value, word)]
    if not fitting:
        kinds = " or ".join(dict.fromkeys(word for word, _ in allowed))
        facts: dict[str, Any] = {"name": name, "function": called, "allowed": kinds, "given": type(value).__name__}
        raise FemtuneError("call.argument", values={name: shortened(value)}, **facts)
    if isinstance(value, str) and "\0" in value:
        raise FemtuneError("call.argument/nul", values={name: shortened(value)}, name=name, function=called)
    if fitting[0] is not None:
        within = _alternatives(fitting[0], {})
        keyed = isinstance(value, Mapping)
        for key, item in value.items() if keyed else enumerate(value):
            if keyed:
                _check(key, [("str", None)], f"key of {name}", called)
            _check(item, within, f"{name}[{key!r}]", called)


def _alternatives(annotation: ast.expr, names: Mapping[str, Any]) -> list[tuple[str, ast.expr | None]]:
    """Name of each class of a union, with the annotation of a sequence's elements or a mapping's values."""
    match annotation:
        case ast.BinOp(left=left, right=right):
            return _alternatives(left, names) + _alternatives(right, names)
        case ast.Subscript(value=ast.Name(id=word), slice=ast.Tuple(elts=[_, of])) if word == "Mapping":
            return [(word, of)]
        case ast.Subscript(value=ast.Name(id=word), slice=of):
            return [(word, of if word == "Sequence" else None)]
        case ast.Name(id=word) if isinstance(names.get(word), UnionType):
            kinds = (get_origin(kind) or kind for kind in get_args(names[word]))
            return [("None" if kind is type(None) else kind.__name__, None) for kind in kinds]
        case ast.Name(id=word):
            return [(word, None)]
        case _:
            return [("None", None)]


_ABSTRACT: dict[str, Callable[[Any], bool]] = {
    "Any": lambda _: True,
    "None": lambda value: value is None,
    "int": lambda value: isinstance(value, Integral) and not isinstance(value, bool),
    "float": lambda value: isinstance(value, Real) and not isinstance(value, bool),
    "Path": lambda value: isinstance(value, os.PathLike),
    "Sequence": lambda value: isinstance(value, Sequence) and not isinstance(value, str | bytes),
    "Mapping": lambda value: isinstance(value, Mapping),
    "NDArray": lambda value: hasattr(value, "__array_interface__"),
    "Progress": lambda value: callable(getattr(value, "step", None)),
}
"""Annotations that are not a class or that permit several, such as numbers of numpy."""


def _fits(value: Any, word: str) -> bool:
    test = _ABSTRACT.get(word)
    return test(value) if test else word in (kind.__name__ for kind in type(value).__mro__)
