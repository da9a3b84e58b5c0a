"""The reference: every name for users has a page, and its docstring the form that the page needs."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest

import femtune as ft

_DOCS = Path(__file__).resolve().parents[1] / "docs"
sys.path.insert(0, str(_DOCS / "_ext"))

object_pages = pytest.importorskip("object_pages")
plain_docstrings = pytest.importorskip("plain_docstrings")

_INDEX = (_DOCS / "api" / "index.md").read_text(encoding="utf-8")
_NAMES = [name for name in ft.__all__ if not isinstance(getattr(ft, name), ModuleType)]


def test_every_name_for_users_is_listed_once() -> None:
    assert sorted(object_pages.objects_of(_INDEX)) == sorted(_NAMES)


def test_each_has_a_page_and_a_row_with_its_first_sentence(tmp_path: Path) -> None:
    (tmp_path / "index.md").write_text(_INDEX, encoding="utf-8")
    assert object_pages.write_object_pages(tmp_path) == set(_NAMES)
    assert "autofunction:: femtune.read_deck" in (tmp_path / "objects" / "read_deck.md").read_text()
    assert "autoclass:: femtune.Study" in (tmp_path / "objects" / "Study.md").read_text()
    text = object_pages.with_objects(_INDEX)
    assert "| [`read_deck`](objects/read_deck.md) | Read a Nastran deck, with its INCLUDEs. |" in text
    assert "{objects}" not in text


def test_descriptions_do_not_stand_in_the_place_of_types() -> None:
    lines = ["Text : as it is", "", "Parameters", "----------", "count, max_hz : number", "    of modes", "", "Raises"]
    lines += ["------", "FemtuneError : ``deck.*``, ``nothing.such``", "    twice"]
    assert plain_docstrings.with_descriptions(lines) == [
        "Text : as it is", "", "Parameters", "----------", "count", "    number", "    of modes", "max_hz",
        "    see ``count``", "", "Raises", "------", "FemtuneError",
        "    `deck.* <../errors/deck.html>`__, ``nothing.such``", "    twice",
    ]  # fmt: skip
