"""Equalised damping: a system with uneven damping becomes the same system with one damping ratio."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.identification import InputKnown, fit_system, identify_frfs, residual_poles
from femtune.modal import FrfSet, StateSpace, equalise_damping, freq_and_damping, half_band_lines, pole_of
from femtune.modal.kinds import FrfKind
from femtune.model import ConfiguredModel, constant_damping, damping_by_mode, solve_modes
from femtune.model.response import frf, make_ports
from structures.springs import factor_model, spring_structure

from ..messages.shown import check_shown

UNEVEN = (0.004, 0.03, 0.012, 0.02, 0.001, 0.01)
LINES = np.linspace(0.3, 4.0, 400)


def chain() -> ConfiguredModel:
    springs = [(i - 1, i, 100.0 + 10.0 * i) for i in range(6)]
    return factor_model(spring_structure(springs, [1.0, 1.2, 0.9, 1.0, 1.1, 1.0]), {"a": [1]})


def functions(kind: FrfKind, ratios: tuple[float, ...] | float, lines: np.ndarray = LINES) -> FrfSet:
    model = chain()
    damping = constant_damping(ratios) if isinstance(ratios, float) else damping_by_mode(ratios)
    ports = make_ports(model, ["1X+", "3X+"], ["1X+", "3X+", "4X+", "6X+"])
    return frf(solve_modes(model.at(np.zeros(1)), 6), ports, lines, kind, damping=damping)


def exact_system(kind: FrfKind) -> StateSpace:
    """The state-space model of the chain with uneven damping, from its own poles."""
    hertz = solve_modes(chain().at(np.zeros(1)), 6).freq_hz
    return fit_system(functions(kind, UNEVEN), pole_of(hertz, np.array(UNEVEN)), direct=kind == "accelerance")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["receptance", "mobility", "accelerance"])
@pytest.mark.parametrize("ratio", [0.002, 0.02])
def test_the_equalised_system_is_the_model_with_one_damping_ratio(kind: FrfKind, ratio: float) -> None:
    found = equalise_damping(exact_system(kind), ratio, (0.01, 10.0))
    want = functions(kind, ratio).values
    np.testing.assert_allclose(found.system.frf(LINES).values, want, atol=1e-5 * np.abs(want).max())
    np.testing.assert_allclose(found.damping_ratio, UNEVEN, rtol=1e-9)
    np.testing.assert_allclose(freq_and_damping(found.system.poles())[1], ratio, rtol=1e-9)


def test_poles_outside_the_band_stay() -> None:
    """Rigid-body and residual poles, those of bands that are left out, and real ones."""
    system = exact_system("receptance")
    hertz = np.sort(freq_and_damping(system.poles())[0])[::2]
    band = (0.5 * (hertz[0] + hertz[1]), 0.5 * (hertz[4] + hertz[5]))
    out = (hertz[2] - 0.01, hertz[2] + 0.01)
    found = equalise_damping(system, 0.02, band, [out])
    np.testing.assert_allclose(found.freq_hz, hertz[[1, 3, 4]])
    want = np.array(UNEVEN)
    want[[1, 3, 4]] = 0.02
    freq, zeta = freq_and_damping(found.system.poles())
    np.testing.assert_allclose(freq[::2], hertz, rtol=1e-9)
    np.testing.assert_allclose(zeta[::2], want, rtol=1e-8)
    # what is not moved responds as before: by itself, without the moved modes
    ratios = tuple(float(z) for z in want)
    values = functions("receptance", ratios).values
    np.testing.assert_allclose(found.system.frf(LINES).values, values, atol=1e-5 * np.abs(values).max())


def test_a_band_without_poles_changes_nothing() -> None:
    system = exact_system("accelerance")
    found = equalise_damping(system, 0.02, (20.0, 30.0))
    assert not len(found.freq_hz)
    np.testing.assert_allclose(found.system.frf(LINES).values, system.frf(LINES).values, rtol=1e-9)


def test_shifted_poles_of_the_other_form_change_the_frequencies() -> None:
    """λ′ = Im λ(−ζ + i), which the literature prints too, is 2e-4 off in |λ| at 2 %."""
    found = equalise_damping(exact_system("receptance"), 0.02, (0.01, 10.0))
    before = np.sort(np.abs(exact_system("receptance").poles()))
    np.testing.assert_allclose(np.sort(np.abs(found.system.poles())), before, rtol=1e-12)
    printed = np.abs(before * np.sqrt(1.0 - np.repeat(UNEVEN, 2) ** 2) * (-0.02 + 1j))
    assert np.abs(printed / before - 1.0).max() > 1.5e-4


@pytest.mark.slow
def test_an_identified_test_with_noise() -> None:
    """N4SID and the fit of the system, residual modes included; in the mean the error is that of the noise."""
    model = chain()
    hertz = solve_modes(model.at(np.zeros(1)), 6).freq_hz
    lines = np.linspace(0.3, 0.5 * (hertz[3] + hertz[4]), 1500)
    test = functions("accelerance", (0.01, 0.03, 0.012, 0.02, 0.01, 0.01), lines)
    random = np.random.default_rng(0).standard_normal((2, *test.values.shape))
    noisy = FrfSet(
        lines, test.values * (1.0 + 0.01 * (random[0] + 1j * random[1])), test.responses, test.references, test.kind
    )
    band = (float(lines[0]), float(lines[-1]))
    made = identify_frfs(noisy, InputKnown(band, 20, ("N4SID",)))
    found = equalise_damping(made.system, 0.01, band)
    np.testing.assert_allclose(found.freq_hz, hertz[:4], rtol=1e-3)
    at = half_band_lines((0.4, band[1]), 0.01)
    want = functions("accelerance", 0.01, at).values
    off = np.log(found.system.frf(at).values / want)
    assert np.sqrt(np.mean(np.abs(off) ** 2)) < 0.03
    # residual poles keep their damping
    residual = freq_and_damping(residual_poles(band))[0]
    freq, zeta = freq_and_damping(found.system.poles())
    near = np.abs(freq[:, None] / residual - 1.0).min(axis=1) < 1e-9
    assert near.sum() == 6
    np.testing.assert_allclose(zeta[near], 1e-3, rtol=1e-6)


def test_lines_of_half_bandwidths() -> None:
    lines = half_band_lines((40.0, 400.0), 0.01, 3.0, [(90.0, 110.0)])
    assert lines[0] == pytest.approx(40.0)
    assert lines[-1] == pytest.approx(400.0)
    assert not ((lines >= 90.0) & (lines <= 110.0)).any()
    steps = np.diff(np.log(lines))
    assert np.sort(steps)[-2] <= 2.0 * 0.01 / 3.0 * (1.0 + 1e-12)
    assert np.sort(steps)[-2] > 0.99 * 2.0 * 0.01 / 3.0


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.0, 1.0, -0.1, float("nan")])
def test_ratios_that_are_none(ratio: float) -> None:
    with pytest.raises(FemtuneError, match="is not between 0 and 1"):
        equalise_damping(exact_system("receptance"), ratio, (1.0, 2.0))
    with pytest.raises(FemtuneError, match="is not between 0 and 1"):
        half_band_lines((1.0, 2.0), ratio)


def test_more_lines_than_memory_are_refused() -> None:
    with pytest.raises(FemtuneError) as caught:
        half_band_lines((40.0, 400.0), 1e-9)
    check_shown("system.equalise, too many lines", caught.value)


def test_a_sampled_system_is_refused() -> None:
    continuous = exact_system("receptance")
    sampled = StateSpace(
        continuous.A, continuous.B, continuous.C, continuous.D, continuous.responses, continuous.references,
        continuous.kind, sampling_hz=100.0,
    )  # fmt: skip
    with pytest.raises(FemtuneError) as caught:
        equalise_damping(sampled, 0.01, (1.0, 2.0))
    check_shown("system.equalise", caught.value)
