"""Studies that search on reduced models: the same truth, with price and certificate in the results."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.steps.report.build import build_report
from femtune.steps.run.result import RunResult
from femtune.steps.update.on_reduced_model import TrainingProgress

from .cantilever import EI, Bench


def _run(bench: Bench, table: str) -> RunResult:
    bench.uff(bench.measure(bench.truth()))
    return ft.update(bench.study(EI + table))


@pytest.mark.slow
def test_the_truth_is_found_and_certified(bench: Bench) -> None:
    run = _run(bench, "[reduction]\n")
    update = run.results.update
    assert update is not None
    assert update.reduction is not None
    assert {p.name: p.value for p in update.parameters} == pytest.approx({"root": 1.3, "tip": 0.85}, rel=1e-3)
    assert update.reduction.certified
    (model,) = update.reduction.models
    assert 2 <= model.full_solutions <= 20
    assert model.order <= 24
    assert model.certified_error_percent <= update.reduction.tolerance_percent == pytest.approx(0.01)
    assert update.objective_after_percent < 1e-3
    assert not [a for a in run.results.alerts if a.code == "update.not-certified"]


@pytest.mark.slow
def test_what_is_not_certified_is_a_problem(bench: Bench) -> None:
    run = _run(bench, "[reduction]\ntolerance = 1e-15\nfull_solutions = 4\norder = 12\n")
    assert run.results.update is not None
    assert run.results.update.reduction is not None
    assert not run.results.update.reduction.certified
    (alert,) = [a for a in run.results.alerts if a.code == "update.not-certified"]
    assert alert.level == "problem"
    assert "above the tolerance" in alert.sentence


@pytest.mark.slow
def test_a_run_that_is_repeated_solves_nothing_again(bench: Bench) -> None:
    first = _run(bench, "[reduction]\n")
    second = ft.update(bench.folder / "study.toml")
    assert first.results.journal is not None
    assert second.results.journal is not None
    assert first.results.journal.solved > 0
    assert second.results.journal.solved == 0
    assert second.results.update == first.results.update


@pytest.mark.parametrize("key", ["tolerance = 0.0", "full_solutions = 1", "order = 3", "basis = 4"])
def test_keys_are_checked(bench: Bench, key: str) -> None:
    with pytest.raises(FemtuneError):
        _run(bench, f"[reduction]\n{key}\n")


@pytest.mark.slow
def test_the_report_says_order_price_and_errors(bench: Bench) -> None:
    run = _run(bench, "[reduction]\n")
    assert run.results.update is not None
    assert run.results.update.reduction is not None
    text = str(build_report(run.results, run.arrays))
    (model,) = run.results.update.reduction.models
    assert "The search used reduced models" in text
    assert f"order {model.order}" in text


class _Heard:
    """A progress that keeps what it is told."""

    def __init__(self) -> None:
        self.lines: list[tuple[str, int, int | None]] = []

    def step(self, text: str, done: int, total: int | None) -> None:
        self.lines.append((text, done, total))


@pytest.mark.slow
def test_progress_says_cost_order_and_errors(bench: Bench) -> None:
    bench.uff(bench.measure(bench.truth()))
    heard = _Heard()
    run = ft.update(bench.study(EI + "[reduction]\nfull_solutions = 12\n"), progress=heard)
    first = "reduced model of baseline: at most 12 full solutions; computing the first"
    own = [line for line in heard.lines if line[0].startswith(("reduced model", "search"))]
    assert own[0] == (first, 0, 12)
    solved = [done for text, done, total in own if total == 12]
    assert solved == sorted(solved)
    assert any("order " in text and "estimate " in text and "of 48 points evaluated" in text for text, *_ in own)
    assert any("worst error at the last point" in text for text, *_ in own)
    assert ("search 1 has ended; solving the full model at its final point", 0, None) in own
    assert run.results.update is not None
    assert run.results.update.reduction is not None
    (model,) = run.results.update.reduction.models
    ends = sum(text.startswith("search") for text, *_ in own)
    assert model.full_solutions == max(solved) + ends


def test_the_time_that_is_left_is_told() -> None:
    heard, now = _Heard(), [100.0]
    told = TrainingProgress(heard, 20, clock=lambda: now[0])
    told.begin(["a"])
    model = SimpleNamespace(order=90)
    points = [SimpleNamespace(error=float("nan")), SimpleNamespace(error=0.0123)]
    for n, seconds in ((1, 110.0), (2, 130.0)):
        now[0] = seconds
        told.trained("a", SimpleNamespace(model=model, certified=points[:n]))  # type: ignore[arg-type]
    assert [text for text, *_ in heard.lines[1:]] == [
        "reduced model of a: order 90, 10 s a solution, at most 3 min more; full solutions",
        "reduced model of a: order 90, worst error at the last point 1.2 %, 15 s a solution, at most 4 min more; "
        "full solutions",
    ]
