"""The kinds of residual that a study can ask for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from pkgutil import walk_packages
from types import MappingProxyType
from typing import Any

import femtune.residuals
from femtune.residuals.case import Residual


@cache
def kinds() -> Mapping[str, type[Residual]]:
    """The class of each kind by its key: every class in a module of this package that is built from a study."""
    for module in walk_packages(femtune.residuals.__path__, "femtune.residuals."):
        import_module(module.name)
    built = Residual.of_study.__func__  # type: ignore[attr-defined]
    own = (c for c in _below(Residual) if c.key and c.__module__.startswith("femtune.residuals."))
    return MappingProxyType({c.key: c for c in own if c.of_study.__func__ is not built})  # type: ignore[attr-defined]


def _below(parent: Any) -> Iterator[type[Residual]]:
    for child in parent.__subclasses__():
        yield child
        yield from _below(child)
