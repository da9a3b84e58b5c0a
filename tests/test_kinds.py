"""Kinds: each is complete, what it names exists, and reading their words loads no numerical package."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Literal

import pytest

import femtune
from femtune.citations import citation
from femtune.kinds import Kind, Kinds

_MODULES = [f"femtune.{path.parent.name}.kinds" for path in sorted(Path(femtune.__file__).parent.glob("*/kinds.py"))]
_KINDS = {
    f"{name} {attribute}": value
    for name in _MODULES
    for attribute, value in vars(import_module(name)).items()
    if isinstance(value, Kinds)
}


@pytest.mark.parametrize("kinds", _KINDS.values(), ids=_KINDS)
def test_what_kinds_name_exists(kinds: Kinds[Kind]) -> None:
    for kind in kinds.values():
        assert all(citation(key).key == key for key in kind.citations)
        if kind.function:
            kind.load()


@pytest.mark.parametrize("kinds", _KINDS.values(), ids=_KINDS)
def test_kinds_of_one_key_say_alike_what_they_are(kinds: Kinds[Kind]) -> None:
    for field in ("label", "text", "function"):
        assert len({bool(getattr(kind, field)) for kind in kinds.values()}) == 1


def test_a_word_without_kind_is_refused() -> None:
    with pytest.raises(TypeError, match="a are not the words a, b"):
        Kinds(Literal["a", "b"], Kind("a"))


def test_words_are_read_without_numerical_packages() -> None:
    code = f"import sys, {', '.join(_MODULES)}; print([m for m in ('numpy', 'scipy') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
