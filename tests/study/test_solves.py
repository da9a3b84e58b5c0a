"""How often a run solves modes: what is known is not solved again."""

from __future__ import annotations

from typing import Any

import pytest

from femtune import steps
from femtune.residuals import solver

Bench = Any


def test_start_and_end_are_solved_once(beam: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    solved: list[tuple[float, ...]] = []
    solve = solver.solve_modes

    def counted(point: Any, *limits: Any) -> Any:
        solved.append(tuple(point.x))
        return solve(point, *limits)

    monkeypatch.setattr(solver, "solve_modes", counted)
    run = steps.update(beam.study())
    update = run.results.update
    assert update is not None
    # each point of the way once, and the written deck, which has no parameters; the last trial may be refused
    assert len(update.history) + 1 <= len(solved) <= len(update.history) + 3
    assert solved.count((0.0, 0.0)) == 1
    assert solved.count(()) == 1
