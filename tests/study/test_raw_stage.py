"""[equalise]: the update with measured FRFs that follows, modes of one side, and notices of inner steps."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.deck_models import model_of

import femtune as ft
from femtune.errors import FemtuneError, Notice
from femtune.identification import equal_damping
from femtune.model import damping_by_mode, solve_modes
from femtune.model.response import frf, make_ports
from femtune.residuals.frf import measured_damping
from femtune.residuals.frf.refined_damping import refined_on_reduced, with_refined_damping
from femtune.steps.run.result import RunResult
from femtune.steps.update import raw
from femtune.steps.update import run as update_run

from ..messages.shown import check_shown
from .cantilever import CANTILEVER, EI, TRUE, Bench

ZETA = (0.004, 0.03, 0.02, 0.008, 0.012, 0.02, *([0.01] * 14))
LINES = np.arange(5.0, 240.0, 0.25)
TRUTH = {"root": 1.3, "tip": 0.85}


def measure(bench: Bench, noise: float, changes: tuple[tuple[str, str], ...] = TRUE) -> None:
    """Receptances of the true beam, with noise of each value and of a floor."""
    model = model_of(bench.truth(changes, CANTILEVER))
    ports = make_ports(model, ["5Y+"], ["2Y+", "3Y+", "4Y+", "5Y+"])
    exact = frf(solve_modes(model.at(np.zeros(0)), 20), ports, LINES, damping=damping_by_mode(ZETA))
    chance = np.random.default_rng(4).standard_normal((2, *exact.values.shape))
    size = noise * (np.abs(exact.values) + 0.1 * np.abs(exact.values).max(axis=2, keepdims=True))
    bench.functions(replace(exact, values=exact.values + size * (chance[0] + 1j * chance[1])))


def study(bench: Bench, more: str = "") -> Any:
    bench.write("beam.bdf", CANTILEVER)
    table = f"[equalise]\ndamping = 0.02\nlargest_order = 16\n{more}"
    return bench.study(f'{EI}\n[[residual]]\nkind = "frf"\n{table}', test="frfs.uff")


@dataclass(frozen=True)
class Told:
    """A run whose identification lacks a mode, with a notice planted in each inner step, and all notices made in it."""

    run: RunResult
    planted: tuple[str, ...]
    made: frozenset[str]


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Told:
    bench = Bench(tmp_path_factory.mktemp("raw"))
    measure(bench, 0.002)
    made, planted = set[str](), []

    def plant(name: str) -> Notice:
        planted.append(f"planted in {name}")
        return Notice("study.remark", what=planted[-1])

    with pytest.MonkeyPatch.context() as patch:
        identify, pair, then = equal_damping.identify_frfs, measured_damping.pair_modes, update_run.then_raw
        before = Notice.__init__

        def identified(*given: Any, **options: Any) -> Any:
            found = identify(*given, **options)
            return replace(found, notices=(*found.notices, plant("the identification")))

        def paired(*given: Any, **options: Any) -> Any:
            found = pair(*given, **options)
            return replace(found, notices=(*found.notices, plant("the pairing of measured damping")))

        def measured(*given: Any, **options: Any) -> Any:
            found, notices = then(*given, **options)
            return found, (*notices, plant("the update with measured FRFs"))

        def recorded(self: Notice, code: str, *given: Any, **facts: Any) -> None:
            before(self, code, *given, **facts)
            made.add(self.what)

        patch.setattr(equal_damping, "identify_frfs", identified)
        patch.setattr(measured_damping, "pair_modes", paired)
        patch.setattr(update_run, "then_raw", measured)
        patch.setattr(Notice, "__init__", recorded)
        run = ft.update(study(bench, "drop_hz = [203.4]\n"))
    return Told(run, tuple(dict.fromkeys(planted)), frozenset(made))


@pytest.mark.slow
def test_what_each_inner_step_says_reaches_the_reader(told: Told) -> None:
    assert len(told.planted) == 3
    assert {a.sentence for a in told.run.results.alerts} >= set(told.planted)


@pytest.mark.slow
def test_no_notice_that_is_made_during_a_run_is_lost(told: Told) -> None:
    text = (told.run.folder / "results.json").read_text("utf-8")
    # said by results that are written before the end of the run, and replaced by those of its end
    unfinished = Notice("run.unfinished").what
    lost = {what for what in told.made if json.dumps(what, ensure_ascii=False)[1:-1] not in text}
    assert lost <= {unfinished}


@pytest.mark.slow
def test_measured_frfs_correct_what_a_missed_mode_has_spoilt(told: Told) -> None:
    update = told.run.results.update
    assert update is not None
    assert update.ok
    assert update.raw is not None
    first = {v.parameter: v for v in update.raw.values}
    for p in update.parameters:
        assert p.sd is not None
        # a chance of one in a thousand for both
        assert abs(p.value - TRUTH[p.name]) < 3.5 * p.sd
        assert abs(first[p.name].equalised - TRUTH[p.name]) > 20.0 * p.sd
    codes = {a.code for a in told.run.results.alerts}
    assert {"update.raw", "update.mode-found"} <= codes
    (mapped,) = told.run.results.mapped_damping
    (found,) = [m for m in mapped.modes if m.found_hz is not None]
    assert found.model_hz == pytest.approx(203.4, rel=2e-3)
    assert found.found_hz == pytest.approx(203.4, rel=2e-3)
    # the damping that the test has there
    assert found.mapped_percent == pytest.approx(2.0, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("mass", ["2.0", "2.2"])
def test_a_wrong_mass_is_told_and_a_right_model_is_not_accused(bench: Bench, mass: str) -> None:
    """The noise of the functions is not that of the stated standard deviations."""
    right = mass == "2.0"
    changes = (
        TRUE if right else (*TRUE, ("CONM2   9       5               2.0", f"CONM2   9       5               {mass}"))
    )
    measure(bench, 0.002, changes)
    results = ft.run(study(bench)).results
    codes = {a.code for a in results.alerts}
    assert ("update.raw-misfit" in codes) is not right
    assert not (right and "update.raw-moved" in codes)
    assert "update.misfit" not in codes
    assert results.judgement is not None
    assert "judge.misfit" not in {reason.code for reason in results.judgement.reasons}


@pytest.mark.slow
@pytest.mark.parametrize("reduction", ["", "[reduction]\n"])
def test_exact_functions_give_exact_parameters(bench: Bench, reduction: str) -> None:
    measure(bench, 0.0)
    update = ft.update(study(bench, reduction)).results.update
    assert update is not None
    assert (update.reduction is not None) is bool(reduction)
    for p in update.parameters:
        assert p.value == pytest.approx(TRUTH[p.name], rel=1e-6)


@pytest.mark.slow
def test_the_update_with_equal_damping_alone(bench: Bench) -> None:
    measure(bench, 0.002)
    results = ft.update(study(bench, 'then = "nothing"\n')).results
    assert results.update is not None
    assert results.update.raw is None
    assert not {"update.raw", "update.raw-moved"} & {a.code for a in results.alerts}


@pytest.mark.parametrize("fails", [False, True])
def test_pairs_that_do_not_stay_are_told(monkeypatch: pytest.MonkeyPatch, fails: bool) -> None:
    end = SimpleNamespace(status=SimpleNamespace(ok=True))
    rounds: list[object] = []

    def another(*given: object) -> object:
        rounds.append(given)
        if fails and len(rounds) > 1:
            raise FemtuneError("correlate.no-damping", test="the test")
        return SimpleNamespace(result=end, reduced=None)

    monkeypatch.setattr(raw, "another_round", another)
    monkeypatch.setattr(raw, "is_asked", lambda study: True)
    monkeypatch.setattr(raw, "is_settled", lambda study, found: False)
    file = SimpleNamespace(equalise=SimpleNamespace(then="raw"), stage=())
    asked = SimpleNamespace(file=file, source=SimpleNamespace(needs_runs=False))
    found, told = raw.then_raw(asked, end, None, None)  # type: ignore[arg-type]
    assert found is not None
    assert [notice.code for notice in told] == ["update.raw-open"]
    assert ("could not be repeated" in told[0].what) is fails
    assert len(rounds) == (2 if fails else 3)


@pytest.mark.parametrize(
    ("code", "facts"),
    [
        ("update.no-raw", {"reason": "no paired mode of the test has a damping ratio"}),
        ("update.no-raw/not-converged", {"ending": "iteration limit reached"}),
        ("update.raw-open", {"rounds": 3}),
        ("update.raw-open/failed", {"reason": "no paired mode of the test has a damping ratio"}),
        ("update.raw", {"paired": 9, "median": 1.2, "moved": 0.8, "name": "root"}),
        ("update.raw-moved", {"names": "root, tip", "limit": 3.0}),
        ("update.raw-misfit", {"factor": 1.8}),
        (
            "update.mode-not-identified",
            {"configuration": "free", "modes": "mode 9 of the model (120.3 Hz), which should be seen in 12 FRFs"},
        ),
        ("update.mode-found", {"configuration": "free", "modes": "mode 9 (120.3 Hz; found at 120.1 Hz)"}),
        ("update.mode-not-in-model", {"configuration": "free", "modes": "50 Hz"}),
    ],
)
def test_what_the_notices_say(code: str, facts: dict[str, Any]) -> None:
    check_shown(code.replace("/", ", "), Notice(code, **facts))


@pytest.mark.slow
@pytest.mark.parametrize("reduction", ["", "[reduction]\n"])
def test_damping_of_a_mode_beside_the_band(bench: Bench, monkeypatch: pytest.MonkeyPatch, reduction: str) -> None:
    """Its ratio is found from exact functions that end below it; it is another one than those of the modes inside."""
    zeta = (0.004, 0.004, 0.02, 0.01, *([0.01] * 16))
    monkeypatch.setattr("tests.study.test_raw_stage.LINES", np.arange(5.0, 150.0, 0.25))
    monkeypatch.setattr("tests.study.test_raw_stage.ZETA", zeta)
    measure(bench, 0.0)
    found = []

    def kept(refine: Any, *given: Any) -> Any:
        found.append((given[3], refine(*given)))
        return found[-1][1]

    refine = refined_on_reduced if reduction else with_refined_damping
    monkeypatch.setattr(raw, refine.__name__, partial(kept, refine))
    assert ft.update(study(bench, reduction)).results.update is not None
    paired, refined = found[-1]
    beside = zeta.index(0.02)
    assert beside in set(refined.modes.tolist()) - set(paired)
    assert refined.ratios[beside] == pytest.approx(zeta[beside], rel=0.1)
    assert refined.common[0].shape[1] == len(refined.modes)
