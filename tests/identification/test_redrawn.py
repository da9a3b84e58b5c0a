"""Equalised FRFs of changed measured ones: against the fits themselves, and against Monte Carlo."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.identification import InputKnown, equalised_test
from femtune.identification.redrawn import RedrawnTest

from .conftest import Known

LINES = np.arange(5.0, 40.0, 0.1)


def known(inputs: tuple[int, ...], responses: int = 6) -> Known:
    shapes = np.random.default_rng(3).standard_normal((responses, 4)) / 3.0
    return Known(np.array([8.0, 13.0, 21.0, 33.0]), np.array([0.01, 0.02, 0.015, 0.008]), shapes, inputs)


def redrawn(inputs: tuple[int, ...], noise: float, seed: int = 1, responses: int = 6) -> RedrawnTest:
    test = equalised_test(known(inputs, responses).frfs(LINES, noise, seed), 0.01, InputKnown(largest_order=16))
    np.testing.assert_allclose(test.redrawn.equalised, test.frfs.values, rtol=1e-8)
    return test.redrawn


def noise_of(test: RedrawnTest, inputs: tuple[int, ...], noise: float, seed: int) -> np.ndarray:
    """What turns the measured functions into those of another test."""
    return np.asarray(known(inputs).frfs(LINES, noise, seed).values - test.measured.values)


@pytest.mark.slow
def test_one_function_by_differences_of_converged_fits() -> None:
    """Without noise the Gauss-Newton step is the derivative of the fits."""
    test = redrawn((0,), 0.0, responses=1)
    rng = np.random.default_rng(0)
    size = np.abs(test.measured.values).mean()
    change = size * (rng.standard_normal(test.measured.values.shape) + 1j * rng.standard_normal(LINES.size))
    h = 1e-6
    exact = (test.refitted(h * change) - test.refitted(-h * change)) / (2.0 * h)
    found = (test.functions(h * change) - test.functions(-h * change)) / (2.0 * h)
    np.testing.assert_allclose(found, exact, rtol=1e-4, atol=1e-4 * np.abs(exact).max())


@pytest.mark.parametrize("inputs", [(0,), (0, 3)])
@pytest.mark.slow
def test_small_noise_by_converged_fits(inputs: tuple[int, ...]) -> None:
    test = redrawn(inputs, 1e-3)
    change = 0.1 * test.draw("noise", np.random.default_rng(5))
    exact = test.refitted(change) - test.refitted(0.0 * change)
    found = test.functions(change) - test.equalised
    # with two references the residual modes of rank one are nearly dependent, and the fits far from linear there
    close = 1e-3 if len(inputs) == 1 else 0.1
    assert np.linalg.norm(found - exact) < close * np.linalg.norm(exact)


@pytest.mark.parametrize("inputs", [(0,), (0, 3)])
@pytest.mark.slow
def test_leverage_is_the_number_of_unknowns(inputs: tuple[int, ...]) -> None:
    test = redrawn(inputs, 1e-3)
    n, u, _ = test.measured.values.shape
    poles, modes = len(test.system.poles), len(test.fit.poles)
    # two equations each value; shapes and direct terms of each response, and the poles. Participations are few
    shapes = n * (2 * poles + u)
    assert 2.0 * n * test.leverage.sum() == pytest.approx(shapes + 2 * modes, rel=1e-6)


@pytest.mark.slow
def test_lines_are_drawn_with_all_functions() -> None:
    test = redrawn((0, 3), 1e-3)
    times = test.draw("lines", np.random.default_rng(2)) / test.errors + 1.0
    np.testing.assert_allclose(times, np.broadcast_to(times[:1, :1], times.shape), atol=1e-9)
    counts = times[0, 0].real
    np.testing.assert_allclose(counts, counts.round(), atol=1e-9)
    assert counts.sum() == pytest.approx(len(LINES))
    single = (test.draw("entries", np.random.default_rng(2)) / test.errors + 1.0).real
    assert single.sum() == pytest.approx(test.measured.values.size)
    assert np.ptp(single, axis=0).max() > 0.5


@pytest.mark.slow
def test_noise_is_as_large_as_the_errors() -> None:
    noise = 0.01
    test = redrawn((0,), noise)
    rms = np.sqrt(np.mean(np.abs(known((0,)).frfs(LINES).values) ** 2))
    # 2100 values: known to 1.1 %, four of them and the responses of unequal leverage
    assert np.sqrt(np.mean(test.noise_sd**2)) == pytest.approx(noise * rms / np.sqrt(2.0), rel=0.06)
    draws = np.array([test.draw("noise", np.random.default_rng(i)) for i in range(50)])
    assert np.sqrt(np.mean(np.abs(draws) ** 2)) == pytest.approx(noise * rms, rel=0.06)


@pytest.mark.slow
@pytest.mark.parametrize("inputs", [(0,), pytest.param((0, 3), marks=pytest.mark.long)])
def test_spread_is_that_of_repeated_tests(inputs: tuple[int, ...]) -> None:
    """Scatter of the equalised FRFs over tests with new noise, each fitted anew, against that of the draws of one."""
    noise, runs = 0.01, 150
    test = redrawn(inputs, noise)
    repeated = np.array([test.refitted(noise_of(test, inputs, noise, 100 + i)) for i in range(runs)]).std(axis=0)
    for how in ("lines", "entries", "noise"):
        drawn = np.array([test.functions(test.draw(how, np.random.default_rng(i))) for i in range(runs)]).std(axis=0)
        # standard deviations of 150 draws are known to 6 %; lines near the resonances are few
        assert np.median(drawn / repeated) == pytest.approx(1.0, abs=0.15)


@pytest.mark.slow
def test_a_pickle_gives_the_same_draws() -> None:
    test = redrawn((0, 3), 1e-3)
    change = test.draw("lines", np.random.default_rng(9))
    again = pickle.loads(pickle.dumps(test))
    assert len(pickle.dumps(test)) == len(pickle.dumps(again))
    np.testing.assert_array_equal(
        again.functions(again.draw("lines", np.random.default_rng(9))), test.functions(change)
    )


@pytest.mark.slow
def test_bands_that_leave_out_all_lines_are_named() -> None:
    options = InputKnown(largest_order=16)
    with pytest.raises(FemtuneError, match="leave_out_hz leaves out all frequency lines"):
        equalised_test(known((0,), 6).frfs(LINES, 1e-3, 1), 0.01, options, left_out_hz=((0.0, 1e4),))


def test_a_mode_that_was_missed_is_no_noise_beside_its_peak() -> None:
    """The mean of the errors contains the peak itself, so that it seemed hardly higher than noise."""
    structure = known((0,), 4)
    frfs = structure.frfs(LINES, 0.002, 1)
    missed = int(np.argmax(structure.freq_hz > 0.5 * structure.freq_hz.max()))
    whole = equalised_test(frfs, 0.01, InputKnown(largest_order=16)).redrawn
    line = int(np.argmin(np.abs(LINES - structure.freq_hz[missed])))
    # of noise alone both are the same, to the scatter of a median of 21 squares in each of the functions
    ratio = np.mean(np.log(whole.noise_beside_peak(line) / whole.noise_sd[:, :, line]))
    assert abs(ratio) < 0.3
    lacks = InputKnown(largest_order=16, drop=(float(structure.freq_hz[missed]),))
    test = equalised_test(frfs, 0.01, lacks).redrawn
    assert np.median(test.noise_sd[:, :, line] / test.noise_beside_peak(line)) > 1.5
