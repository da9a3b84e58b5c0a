"""Pictures of the guide: each page has one, and they are those of the present tutorial and module."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

_DOCS = Path(__file__).resolve().parents[1] / "docs"
sys.path.insert(0, str(_DOCS / "_ext"))

guide_pictures = pytest.importorskip("guide_pictures")


def test_every_page_of_the_guide_has_a_picture() -> None:
    without = [p.stem for p in (_DOCS / "guide").glob("*.md") if "{figure}" not in p.read_text(encoding="utf-8")]
    assert without == []


def test_the_pictures_are_current_and_small() -> None:
    assert guide_pictures.are_current(), "run make pictures"
    for page in guide_pictures.DRAWN:
        picture = _DOCS / "_static" / "pictures" / f"guide_{page}.svg"
        assert re.search(r"<svg ", picture.read_text(encoding="utf-8"))
        assert picture.stat().st_size < 50_000


def test_the_landing_page_has_the_numbers_of_the_tutorial() -> None:
    """Its text is of the run that its pictures are of."""
    landing, tutorial = ((_DOCS / name).read_text(encoding="utf-8") for name in ("index.md", "tutorial.md"))
    pattern = r"(?:Mean frequency error|Lowest MAC of a pair) +[\d.]+(?: %)? → [\d.]+"
    assert re.findall(pattern, landing) == re.findall(pattern, tutorial)
    rows = re.findall(r"T_PSHELL_\d +(PSHELL \d T) +m +([\d.]+) +([\d.]+) +([\d.]+) … ([\d.]+)", tutorial)
    told = re.findall(r"(PSHELL \d T) +([\d.]+) m → ([\d.]+) m +95 %: ([\d.]+) … ([\d.]+)", landing)
    assert len(told) == 2
    for (field, initial, *ours), (known, first, *theirs) in zip(told, rows, strict=True):
        assert (field, initial) == (known, first)
        assert ours == [f"{float(v):.5f}" for v in theirs]
