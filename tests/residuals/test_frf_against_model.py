"""Mistakes of measured FRFs that show beside the model: signs, kinds, levels; and nothing where there is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.messages.shown import check_shown
from tests.residuals.damped import LINES, TRUTH, chain, noisy, ports_of

from femtune.errors import Notice
from femtune.modal import FrfSet, as_kind
from femtune.model import solve_modes
from femtune.model.response import frf
from femtune.residuals.frf.against_model import against_model

FOUR = ("1X+", "2X+", "3X+", "4X+")


def functions(x: np.ndarray) -> FrfSet:
    model = chain()
    return frf(solve_modes(model.at(x), 5), ports_of(model, FOUR), LINES, "accelerance", "complex-modes")


def found(test: FrfSet, model: FrfSet) -> list[Notice]:
    return list(against_model(test, model.values, np.isfinite(test.values), "baseline"))


@pytest.fixture(scope="module")
def start() -> FrfSet:
    """The model before an update: frequencies are off by up to eight per cent."""
    return functions(np.array([0.0, -0.05, 0.0, 0.0]))


@pytest.fixture(scope="module")
def test() -> FrfSet:
    return noisy(functions(TRUTH), 0.003, 4)


def test_a_right_test_is_not_doubted(test: FrfSet, start: FrfSet) -> None:
    assert found(test, start) == []


@pytest.mark.parametrize("channel", range(4))
def test_a_wrong_sign_of_an_output_is_named(test: FrfSet, start: FrfSet, channel: int) -> None:
    sign = np.where(np.arange(4) == channel, -1.0, 1.0)[:, None, None]
    (notice,) = found(replace(test, values=sign * test.values), start)
    assert notice.code == "residual.frf-sign"
    assert f"output {FOUR[channel]} are opposite" in notice.what
    if channel == 2:
        check_shown("residual.frf-sign", notice)


def test_a_wrong_sign_of_an_input_is_named(test: FrfSet, start: FrfSet) -> None:
    (notice,) = found(replace(test, values=test.values * np.array([1.0, -1.0])[:, None]), start)
    assert "input 3X+ are opposite" in notice.what


def test_the_same_sign_everywhere_is_no_sensor(test: FrfSet, start: FrfSet) -> None:
    """All channels reversed: nothing tells which; the driving points do."""
    assert "residual.frf-sign" not in [n.code for n in found(replace(test, values=-test.values), start)]


@pytest.mark.parametrize("really", ["receptance", "mobility"])
def test_another_kind_is_named(test: FrfSet, start: FrfSet, really: str) -> None:
    wrong = replace(test, values=as_kind(test, really).values)
    (notice,) = [n for n in found(wrong, start) if n.code == "residual.frf-kind"]
    assert f"look like {really}, not accelerance" in notice.what
    if really == "mobility":
        check_shown("residual.frf-kind", notice)


@pytest.mark.parametrize(
    ("factor", "guess"), [(1.0 / 9.80665, "g instead of m/s²"), (1000.0, "mm instead of m"), (17.0, "")]
)
def test_another_level_is_told_with_its_likely_cause(test: FrfSet, start: FrfSet, factor: float, guess: str) -> None:
    (notice,) = found(replace(test, values=factor * test.values), start)
    assert notice.code == "residual.frf-level"
    assert (guess in notice.what) if guess else ("cause" not in notice.what)
    if factor == 1000.0:
        check_shown("residual.frf-level", notice)


@pytest.mark.parametrize(("channel", "factor"), [(0, 1.0 / 9.80665), (1, 1000.0), (2, 9.80665), (3, 0.2)])
def test_another_level_of_one_output_is_named(test: FrfSet, start: FrfSet, channel: int, factor: float) -> None:
    one = np.where(np.arange(4) == channel, factor, 1.0)[:, None, None]
    (notice,) = found(replace(test, values=one * test.values), start)
    assert notice.code == "residual.frf-channel-level"
    assert f"output {FOUR[channel]} are" in notice.what
    assert ("g instead of m/s²" in notice.what) == (channel in (0, 2))
    if channel == 0:
        check_shown("residual.frf-channel-level", notice)


def test_one_output_that_the_model_misses_has_no_level_of_its_own(test: FrfSet, start: FrfSet) -> None:
    """A factor that changes with the line, as errors of the model make it."""
    wrong = test.values.copy()
    wrong[1] *= np.exp(3.0 * np.sin(np.linspace(0.0, 40.0, wrong.shape[2])))
    assert "residual.frf-channel-level" not in [n.code for n in found(replace(test, values=wrong), start)]


def test_too_few_values_say_nothing(test: FrfSet, start: FrfSet) -> None:
    few = np.zeros(test.values.shape, bool)
    few[0, 0, :5] = True
    assert against_model(replace(test, values=-test.values), start.values, few, "baseline") == ()
