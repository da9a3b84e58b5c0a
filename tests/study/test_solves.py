"""How often a run solves modes: what is known is not solved again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import femtune as ft
from femtune.files.uff import scan_uff
from femtune.residuals import direct
from femtune.study.study import read_study

from .cantilever import Bench


@pytest.mark.slow
def test_start_and_end_are_solved_once(beam: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    solved: list[tuple[float, ...]] = []
    solve = direct.modes

    def counted(point: Any, *limits: Any) -> Any:
        solved.append(tuple(point.x))
        return solve(point, *limits)

    monkeypatch.setattr(type(direct), "modes", staticmethod(counted))
    run = ft.update(beam.study())
    update = run.results.update
    assert update is not None
    # each point of the way once, and the written deck, which has no parameters; the last trial may be refused
    judgement = run.results.judgement
    assert judgement is not None
    assert judgement.linearity is not None
    beside = len(judgement.linearity.points)
    assert beside == 4  # two on each principal axis
    assert len(update.history) + 1 <= len(solved) - beside <= len(update.history) + 3
    assert solved.count((0.0, 0.0)) == 1
    assert solved.count(()) == 1


def test_a_file_of_several_tests_is_parsed_once(beam: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    parsed: list[str] = []

    def counted(path: Any) -> Any:
        parsed.append(Path(path).name)
        return scan_uff(path)

    monkeypatch.setattr("femtune.files.uff.read.scan_uff", counted)
    tables = "".join(f'[[configuration]]\nname = "{name}"\ntest = "beam.uff"\n' for name in ("A", "B"))
    study = read_study(beam.study(head=tables, test=None))
    assert [len(case.modal.test) for case in study.cases if case.modal is not None] == [4, 4]
    assert parsed == ["beam.uff"]
