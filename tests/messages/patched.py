"""Acts that fail under changed limits and functions only."""

from __future__ import annotations

from collections.abc import Callable

import pytest


def patched(act: Callable[[], object], *patches: tuple[object, str, object]) -> Callable[[], object]:
    """The act with other values of attributes, as (owner, name, value)."""

    def changed() -> object:
        with pytest.MonkeyPatch.context() as monkeypatch:
            for target, name, value in patches:
                monkeypatch.setattr(target, name, value)
            return act()

    return changed
