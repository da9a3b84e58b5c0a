"""Lazy imports of libraries that the numerical floors do not need."""

from __future__ import annotations

import importlib
import importlib.util
from types import ModuleType

from femtune.errors import FemtuneError


def require(module: str, *, extra: str = "") -> ModuleType:
    """Import `module`, or say whether it is missing or broken and which pip command installs it.

    Raises
    ------
    FemtuneError : ``install.missing`` or ``install.broken``
    """
    target = f"femtune[{extra}]" if extra else "femtune"
    top = module.partition(".")[0]
    if importlib.util.find_spec(top) is None:
        raise FemtuneError("install.missing", library=top, target=target)
    try:
        return importlib.import_module(module)
    except Exception as broken:
        raise FemtuneError("install.broken", library=top, problem=broken, target=target) from broken
