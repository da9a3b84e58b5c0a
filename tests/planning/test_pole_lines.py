"""Frequency lines for an identification: variances of the poles, and the lines that make them small."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.arrays import Reals
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.identification import fit_modes
from femtune.modal import FrfSet, pole_of
from femtune.planning import PoleTest, by_half_bandwidths, pole_lines

_HERTZ = np.array([41.0, 64.0, 66.0, 120.0])
_ZETA = np.array([0.01, 0.008, 0.008, 0.012])
_BAND = (35.0, 135.0)


def _test() -> PoleTest:
    shapes = np.random.default_rng(5).standard_normal((4, 4))
    return PoleTest(_HERTZ, _ZETA, (shapes[:, None] * shapes[:1]).reshape(-1, 4), 0.01, 0.002)


def _functions(test: PoleTest, lines_hz: Reals) -> tuple[Reals, Reals]:
    """Accelerances of the modes, and the standard deviations of their noise."""
    omega, resonance = 2.0 * np.pi * lines_hz, 2.0 * np.pi * _HERTZ[:, None]
    modes = -(omega**2) / (resonance**2 - omega**2 + 2j * _ZETA[:, None] * resonance * omega)
    at_peaks = -(resonance.T**2) / (resonance**2 - resonance.T**2 + 2j * _ZETA[:, None] * resonance * resonance.T)
    values = test.residues @ modes
    largest = np.abs(test.residues @ at_peaks).max(axis=1, keepdims=True)
    return values, np.hypot(test.relative * np.abs(values), test.floor * largest)


@pytest.mark.slow
def test_stated_variances_are_those_of_repeated_tests() -> None:
    test, lines = _test(), np.geomspace(*_BAND, 160)
    values, sd = _functions(test, lines)
    poles, off = pole_of(_HERTZ, _ZETA), []
    dofs = DofSet.parse([f"{i}Z+" for i in range(1, 5)])
    for i in range(150):
        noise = np.random.default_rng(i).standard_normal((2, *values.shape))
        measured = values + sd * (noise[0] + 1j * noise[1])
        frfs = FrfSet(lines, measured[:, None], dofs, DofSet.parse(["1Z+"]), "accelerance")
        off.append((fit_modes(frfs, poles, np.sqrt(2.0) * sd[:, None]).poles - poles) / (2.0 * np.abs(poles.real)))
    found = np.sqrt(np.mean(np.abs(off) ** 2, axis=0))
    np.testing.assert_allclose(test.relative_sd(lines), found, rtol=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("count", [6, 8, 10, 12, 20, 30, 90])
def test_the_best_lines_are_better_than_each_simple_spacing(count: int) -> None:
    found = pole_lines(_test(), *_BAND, count)
    assert [one.spacing for one in found] == ["uniform", "logarithmic", "by half bandwidths", "best"]
    *others, best = found
    assert best.root_mean_square < 0.99 * min(one.root_mean_square for one in others)
    for one in found:
        assert len(one.lines_hz) == count
        assert _BAND[0] <= one.lines_hz[0] <= one.lines_hz[-1] <= _BAND[1]
        np.testing.assert_array_equal(one.relative_sd, _test().relative_sd(one.lines_hz))
        assert (np.diff(one.lines_hz) > 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("count", [10, 12, 20])
def test_no_other_line_in_place_of_one_is_better(count: int) -> None:
    test, best = _test(), pole_lines(_test(), *_BAND, count)[-1]
    own = best.root_mean_square
    for hertz in (
        *np.geomspace(*_BAND, 25),
        *(f * (1.0 + 2.0 * _ZETA[0] * t) for f in _HERTZ for t in (-1.0, 0.0, 1.0)),
    ):
        for i in range(0, count, 2):
            other = np.sort(np.append(np.delete(best.lines_hz, i), hertz))
            # candidates are finite in number, so that lines between them may be a little better
            assert np.sqrt(np.mean(test.relative_sd(other) ** 2)) > 0.98 * own


def test_more_lines_tell_more_and_too_few_nothing() -> None:
    lines = np.geomspace(*_BAND, 200)
    all_, half = _test().relative_sd(lines), _test().relative_sd(lines[::2])
    assert (all_ < half).all()
    assert np.isinf(_test().relative_sd(lines[:4])).all()
    with pytest.raises(FemtuneError) as caught:
        pole_lines(_test(), *_BAND, 5)
    assert caught.value.code == "plan.pole-lines"


@pytest.mark.parametrize(("functions", "least"), [(1, 9), (2, 7), (4, 6), (16, 6)])
def test_the_least_number_of_lines_is_that_from_which_the_poles_follow(functions: int, least: int) -> None:
    residues = np.random.default_rng(3).standard_normal((functions, 4))
    test = PoleTest(_HERTZ, _ZETA, residues, 0.01, 0.002)
    assert test.least_lines == least
    near = np.concatenate([_HERTZ * (1.0 - _ZETA), _HERTZ * (1.0 + _ZETA), [50.0]])
    lines = np.sort(near[:least])
    assert np.isfinite(test.relative_sd(lines)).all()
    assert np.isinf(test.relative_sd(lines[1:])).all()
    # a line twice is no further one
    assert np.isinf(test.relative_sd(np.append(lines[1:], lines[-1]))).all()


def test_a_silent_function_does_not_count() -> None:
    residues = np.vstack([np.ones((1, 4)), np.zeros((3, 4))])
    assert PoleTest(_HERTZ, _ZETA, residues, 0.01, 0.002).least_lines == 9


def test_half_bandwidths_share_the_lines_among_the_modes() -> None:
    lines = by_half_bandwidths(_HERTZ, _ZETA, *_BAND, 22)
    assert len(lines) == 22
    near = [int(np.sum(np.abs(lines - f) <= 2.0001 * z * f)) for f, z in zip(_HERTZ, _ZETA)]
    assert near[0] == 6
    assert near[3] == 5
