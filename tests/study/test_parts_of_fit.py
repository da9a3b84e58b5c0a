"""The residuals in parts in a run: named in the verdict, in results, and on the page."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import femtune as ft
from femtune.steps.judge.record.parts import PartRecord, PartsResults
from femtune.steps.run.result import RunResult

from .cantilever import Bench, bounded


def _judgement(run: RunResult) -> Any:
    assert run.results.judgement is not None
    return run.results.judgement


def _codes(run: RunResult) -> dict[str, Any]:
    return {r.code: r for r in _judgement(run).reasons}


def _noisy(bench: Bench, frequency: float, shape: float, deck: Any = None, seed: int = 5) -> None:
    test, rng = bench.measure(deck or bench.truth()), np.random.default_rng(seed)
    modes = test.modes
    assert modes is not None
    object.__setattr__(modes, "freq_hz", modes.freq_hz * (1.0 + frequency * rng.standard_normal(len(modes))))
    size = np.abs(modes.shapes).max(axis=0)
    object.__setattr__(modes, "shapes", modes.shapes + shape * size * rng.standard_normal(modes.shapes.shape))
    bench.uff(test)


@pytest.mark.slow
def test_a_prior_that_hides_a_misfit_is_named(bench: Bench) -> None:
    """A tight prior of the root, which is 30 % stiffer; the tip is free and takes what it can."""
    _noisy(bench, 0.002, 0.01)
    tight = bounded("root", "PBAR 1 I1", "sd = 0.002\n") + bounded("tip", "PBAR 2 I1")
    run = ft.run(bench.study(f'{tight}[residuals]\nfrequency_sd = 0.002\n[update]\nregularisation = "prior"\n'))
    assert run.results.update is not None
    goodness = run.results.update.goodness
    assert goodness is not None
    assert goodness.verdict == "fail"
    assert "larger than noise" in goodness.sentence
    found = _codes(run)["judge.misfit"]
    assert (found.weight, found.place) == ("not accepted", "prior root")
    assert "the prior of root contradicts the data" in _judgement(run).line
    # what the prior holds is a parameter, and not a missing one
    missing = _codes(run).get("judge.missing")
    assert missing is None or (missing.weight == "reservation" and not missing.place.startswith("PBAR 1 I1"))
    assert run.report is not None
    page = run.report.read_text()
    assert "The residuals in parts" in page
    assert "the prior of root" in page


@pytest.mark.slow
@pytest.mark.parametrize(
    ("keys", "reservation"),
    [
        ("frequency_sd = 0.1\nshape_sd = 0.01", "frequency_sd = 0.1 is"),
        ("frequency_sd = 0.002\nshape_sd = 0.3", "shape_sd = 0.3 is"),
        ("shape_sd = 0.01", ""),  # the default of the frequencies is an assumption
        ('frequency_sd = 0.1\nshape_sd = 0.01\nassumed = ["frequency_sd"]', ""),
    ],
)
def test_standard_deviations_that_are_too_large_are_a_reservation(bench: Bench, keys: str, reservation: str) -> None:
    _noisy(bench, 0.0005, 0.01)
    run = ft.run(bench.study(f"{bench.parameters}[residuals]\n{keys}\n"))
    found = _codes(run)
    assert ("judge.overstated" in found) is bool(reservation)
    if reservation:
        assert found["judge.overstated"].weight == "reservation"
        assert reservation in found["judge.overstated"].sentence
    else:
        assert "judge.misfit" not in found


@pytest.mark.slow
def test_assumed_deviations_that_are_too_small_are_a_reservation(bench: Bench) -> None:
    _noisy(bench, 0.002, 0.05)
    keys = 'frequency_sd = 0.002\nshape_sd = 0.01\nassumed = ["shape_sd"]'
    found = _codes(ft.run(bench.study(f"{bench.parameters}[residuals]\n{keys}\n")))
    assert found["judge.larger-than-assumed"].weight == "reservation"
    assert "shape_sd = 0.01" in found["judge.larger-than-assumed"].sentence
    assert "judge.neighbour" not in found


@pytest.mark.slow
def test_a_hidden_spring_is_no_accepted_model(bench: Bench) -> None:
    """With deviations of ten times the noise the shapes tell: they contain their neighbours."""
    sprung = bench.text.replace("CONM2", "CELAS2,77,3.+5,4,3\nCONM2")
    _noisy(bench, 0.002, 0.003, bench.truth((), sprung))
    run = ft.run(bench.study(f"{bench.parameters}[residuals]\nfrequency_sd = 0.02\nshape_sd = 0.1\n"))
    found = _codes(run)
    assert {"judge.neighbour", "judge.misfit"} & set(found)
    assert _judgement(run).verdict != "accepted"


def _part(family: Any, p: float, kind: str = "frequency", mode: str = "") -> PartRecord:
    return PartRecord(
        family=family, kind=kind, configuration="beam", mode=mode, sensor="", values=1, chi_square=9.0,
        degrees_of_freedom=1.0, p_value=p, p_family_wise=p,
    )  # fmt: skip


def _named(level: float, *parts: PartRecord, only_prior: bool = False) -> PartRecord | None:
    return PartsResults(parts=parts, neighbours=(), kinds=(), only_prior=only_prior).named(level)


def test_the_part_is_named_that_says_where() -> None:
    kind = _part("kinds", 1e-9)
    modes = [_part("modes", p, mode=str(i)) for i, p in enumerate((0.6, 1e-5, 0.8, 0.3))]
    one = _named(0.01, kind, *modes)
    assert one is not None
    assert one.words == "the frequency residual of mode 1 (beam)"
    all_modes = tuple(_part("modes", 1e-4, mode=str(i)) for i in range(4))
    assert _named(0.01, kind, *all_modes) is kind
    assert _named(0.01, kind) is kind
    assert _named(1e-6, *modes) is None
    prior = _part("priors", 1e-3, "prior", "E")
    assert _named(0.01, kind, *modes, prior) is modes[1]
    assert _named(0.01, kind, *modes, prior, only_prior=True) is prior


@pytest.mark.slow
def test_a_stated_deviation_that_is_too_small_is_named_with_the_one_that_fits(bench: Bench) -> None:
    """The shapes have noise of 1 %, and a third of it is stated; the neighbours, which need no statement, are quiet."""
    _noisy(bench, 0.001, 0.01)
    run = ft.run(bench.study(f"{bench.parameters}[residuals]\nfrequency_sd = 0.001\nshape_sd = 0.0033\n"))
    found = _codes(run)
    assert found["judge.misfit"].weight == "not accepted"
    (named,) = re.findall(r"shape_sd of about ([0-9.]+) would fit", found["judge.misfit"].sentence)
    assert float(named) == pytest.approx(0.01, rel=0.3)
    assert "judge.neighbour" not in found
    update = run.results.update
    assert update is not None
    factors = {c.kind: c.error_factor for c in update.residual_counts}
    assert factors["shape"] == pytest.approx(3.0, rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [False, True], ids=["right model", "wrong model"])
def test_estimated_errors_narrow_intervals_of_right_models_only(bench: Bench, wrong: bool) -> None:
    """Stated deviations that are ten times too large, as weights; in the wrong model the tip mass is 30 % too small."""
    deck = bench.truth()
    if wrong:
        deck.write_text(
            deck.read_text().replace("CONM2   9       5               2.0", "CONM2   9       5               2.6")
        )
    _noisy(bench, 0.001, 0.003, deck)
    keys = '[residuals]\nfrequency_sd = 0.01\nshape_sd = 0.03\nscatter = "estimated"\n'
    update = ft.run(bench.study(f"{bench.parameters}{keys}")).results.update
    assert update is not None
    assert all(c.error_factor >= 1.0 for c in update.residual_counts) is wrong
