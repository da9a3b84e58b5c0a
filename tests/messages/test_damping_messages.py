"""The pages of what is said about damping show the very message that a user gets."""

from __future__ import annotations

from pathlib import Path

import pytest

from femtune.files.nastran import read_deck
from femtune.files.nastran.build import BuiltModel, build_structure

_PAGES = Path(__file__).resolve().parents[2] / "docs" / "errors"
_BASE = (
    "MAT1,1,2.1+11,,.3,7850.\nPBAR,3,1,1.-3,2.-6,3.-6,4.-6\nPROD,8,1,1.-4\nPBAR,5,1,1.-3,2.-6,3.-6,4.-6\n"
    "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\n"
)
NOTICES = {
    "deck.nonlinear-damper": _BASE + "PBUSH1D,4,1.,2.\n,SHOCKA,TABLE,.5\nCBUSH1D,1,4,1,2\n",
}


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def _page(code: str) -> str:
    return (_PAGES / f"{code}.md").read_text(encoding="utf-8")


def _built(text: str) -> BuiltModel:
    Path("deck.bdf").write_text(text)
    return build_structure(read_deck("deck.bdf"))


@pytest.mark.parametrize("code", NOTICES)
def test_page_shows_the_notice(code: str) -> None:
    notice = _built(NOTICES[code]).notices[-1]
    assert notice.code == code
    assert str(notice) in _page(code)
