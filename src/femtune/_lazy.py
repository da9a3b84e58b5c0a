"""Packages that load a module when one of its names is first used, not when the package is imported."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any


def lazy_names(package: str, more: str = "") -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """``__getattr__`` and ``__dir__`` of a package (PEP 562) whose names are imported on first use.

    The names and their modules are those of the imports under ``if TYPE_CHECKING:`` in the package itself, so that they
    are written once, in the form that type checkers and editors read.

    Parameters
    ----------
    package : ``__name__`` of the package
    more : ``module:function`` that returns further names with their modules; asked for a name that the package lacks

    Examples
    --------
    >>> import femtune.modal
    >>> "mac" in dir(femtune.modal)
    True
    >>> femtune.modal.mac.__module__
    'femtune.modal.shape_criteria'
    """

    def get(name: str) -> Any:
        module = _modules_of_names(package).get(name)
        if module is None and not name.startswith("_"):
            module = _further_names(more).get(name)
        if module is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name)
        if module == package:
            return import_module(f"{package}.{name}")
        value = getattr(import_module(module), name)
        setattr(sys.modules[package], name, value)
        return value

    def names() -> list[str]:
        # completion shows what users call, not what the package itself imports
        own = vars(sys.modules[package])
        special = (name for name in own if name.startswith("__"))
        return sorted({*special, *own.get("__all__", ()), *_modules_of_names(package), *_further_names(more)})

    return get, names


@cache
def _modules_of_names(package: str) -> dict[str, str]:
    """The module of each name that the package imports under ``if TYPE_CHECKING:``."""
    import ast  # noqa: PLC0415  ``import femtune`` does without

    spec = sys.modules[package].__spec__
    source = spec.loader.get_source(package)  # type: ignore[union-attr]
    blocks = [s for s in ast.parse(source).body if isinstance(s, ast.If) and ast.unparse(s.test) == "TYPE_CHECKING"]
    imports = [s for block in blocks for s in block.body if isinstance(s, ast.ImportFrom) and s.module]
    return {alias.name: str(statement.module) for statement in imports for alias in statement.names}


@cache
def _further_names(more: str) -> dict[str, str]:
    """What the function ``module:function`` returns; {} without one."""
    module, _, function = more.partition(":")
    return getattr(import_module(module), function)() if more else {}
