"""Pictures that the code of a page draws: the code runs, its text says what it prints, and the pictures are its own."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

_DOCS = Path(__file__).resolve().parents[1] / "docs"
sys.path.insert(0, str(_DOCS / "_ext"))

page_pictures = pytest.importorskip("page_pictures")


def test_the_pictures_were_made_by_the_code_of_their_pages() -> None:
    assert page_pictures.are_current(), "run make pictures"
    for name in page_pictures.sources():
        assert (_DOCS / "_static" / "pictures" / name).read_text(encoding="utf-8").startswith("<?xml")


@pytest.mark.slow
def test_posterior_and_intervals_differ_as_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    page = "guide/posterior-or-intervals.md"
    run: dict[str, object] = {"__name__": "__main__"}
    exec(compile(page_pictures.code_of(page), page, "exec"), run)
    printed = [float(x) for x in re.findall(r"\d\.\d\d", capsys.readouterr().out)]
    (told,) = re.findall(r"```text\n(.*?)```", (_DOCS / page).read_text(encoding="utf-8"), re.S)
    assert printed == pytest.approx([float(x) for x in re.findall(r"\d\.\d\d", told)], abs=0.02)
    # in the valley 1/a + 1/b = 2, cut at 5, no spring is below 1/(2 - 1/5)
    assert min(printed) == pytest.approx(1.0 / 1.8, abs=0.04)
    assert run["sides"] == [pytest.approx((0.42, 1.58), abs=0.01), pytest.approx((0.43, 1.64), abs=0.01)]
