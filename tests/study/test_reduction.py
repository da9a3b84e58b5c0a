"""Studies that search on reduced models: the same truth, with price and certificate in the results."""

from __future__ import annotations

from typing import Any

import pytest

from femtune import steps
from femtune.errors import FemtuneError
from femtune.report.build import build_report
from femtune.study import RunFolder

Bench = Any

EI = """
[[parameter]]
name = "root"
fields = ["PBAR 1 I1"]
lower = 0.5
upper = 2.0

[[parameter]]
name = "tip"
fields = ["PBAR 2 I1"]
lower = 0.5
upper = 2.0
"""


def _run(bench: Bench, table: str) -> RunFolder:
    bench.uff(bench.measure(bench.truth()))
    return steps.update(bench.study(EI + table))


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


def test_what_is_not_certified_is_a_problem(bench: Bench) -> None:
    run = _run(bench, "[reduction]\ntolerance = 1e-15\nfull_solutions = 4\norder = 12\n")
    assert run.results.update is not None
    assert run.results.update.reduction is not None
    assert not run.results.update.reduction.certified
    (alert,) = [a for a in run.results.alerts if a.code == "update.not-certified"]
    assert alert.level == "problem"
    assert "more than the tolerance" in alert.sentence


def test_a_run_that_is_repeated_solves_nothing_again(bench: Bench) -> None:
    first = _run(bench, "[reduction]\n")
    second = steps.update(bench.folder / "study.toml")
    assert first.results.journal is not None
    assert second.results.journal is not None
    assert first.results.journal.solved > 0
    assert second.results.journal.solved == 0
    assert second.results.update == first.results.update


@pytest.mark.parametrize("key", ["tolerance = 0.0", "full_solutions = 1", "order = 3", "basis = 4"])
def test_keys_are_checked(bench: Bench, key: str) -> None:
    with pytest.raises(FemtuneError):
        _run(bench, f"[reduction]\n{key}\n")


def test_the_report_says_order_price_and_errors(bench: Bench) -> None:
    run = _run(bench, "[reduction]\n")
    assert run.results.update is not None
    assert run.results.update.reduction is not None
    text = str(build_report(run.results, run.arrays))
    (model,) = run.results.update.reduction.models
    assert "The search ran on reduced models" in text
    assert f"order {model.order}" in text
