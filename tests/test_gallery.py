"""The cards of the gallery: each has a picture, a question, an answer, and a command whose example exists."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[1]
_TEXT = (_ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
_CARDS = re.findall(r"^````\{container\} card\n(.*?)^````$", _TEXT, re.M | re.S)


def test_there_are_at_least_sixteen() -> None:
    assert len(_CARDS) >= 16
    assert len(set(re.findall(r"python (\S+)", _TEXT))) == len(_CARDS)


@pytest.mark.parametrize("card", _CARDS, ids=lambda card: re.findall(r"\*\*\[(.*?)\]", card)[0])
def test_a_card_is_complete(card: str) -> None:
    (picture,), (page,) = re.findall(r"\{image\} (\S+)", card), re.findall(r"\*\*\[.*?\]\((\S+)\)\*\*", card)
    (script,) = re.findall(r"^python (\S+) --quick$", card, re.M)
    assert (_ROOT / "docs" / picture).is_file()
    assert (_ROOT / "docs" / page).is_file()
    assert "--quick" in (_ROOT / script).read_text(encoding="utf-8") + _shared(script)
    assert re.search(r"^\*Asked:\* .*\?$", card, re.M)
    assert re.search(r"^\*Found:\* .*\.$", card, re.M)
    assert re.search(r"^:alt: \S", card, re.M)


def _shared(script: str) -> str:
    """The text of the module that reads the options of all examples."""
    return "".join(p.read_text(encoding="utf-8") for p in (_ROOT / "examples").glob("*.py"))
