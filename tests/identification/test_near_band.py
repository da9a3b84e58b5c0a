"""Modes just outside the band: found where they matter, not where noise alone would suggest them."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from femtune.identification import as_modes, fit_modes
from femtune.identification.input_known import InputKnown, identify_frfs
from femtune.identification.modal_solve import OUT_OF_BAND
from femtune.identification.near_band import fit_with_neighbours
from femtune.modal import pole_of

_LINES = np.linspace(8.0, 25.0, 250)


def _beside(known: Any, *freq: float) -> Any:
    """The modes and further ones of other shapes."""
    shapes = 0.5 * np.array([[0.9, -0.7], [0.5, 0.8], [0.8, -0.6]])[:, : len(freq)]
    damping = np.concatenate([known.damping_ratio, np.full(len(freq), 0.012)])
    together = np.hstack([known.shapes, shapes])
    return dataclasses.replace(
        known, freq_hz=np.concatenate([known.freq_hz, freq]), damping_ratio=damping, shapes=together
    )


@pytest.mark.parametrize("outside", [(25.6,), (7.6,), (25.6, 27.0), (7.6, 25.6)])
def test_without_noise_the_modes_inside_are_exact(three_modes: Any, outside: tuple[float, ...]) -> None:
    frfs = _beside(three_modes, *outside).frfs(_LINES)
    start = pole_of(three_modes.freq_hz * 1.001, three_modes.damping_ratio)
    fit = fit_with_neighbours(frfs, start, None, OUT_OF_BAND)
    # without noise any further pole explains something
    found = np.abs(fit.poles[fit.outside]) / (2 * np.pi)
    for freq in outside:
        assert np.abs(found / freq - 1.0).min() < 1e-3
    modes = as_modes(fit)
    assert modes.labels == ("1", "2", "3")
    np.testing.assert_allclose(modes.freq_hz, three_modes.freq_hz, rtol=1e-6)
    sign = np.sign(np.sum(modes.shapes * three_modes.shapes, axis=0))
    np.testing.assert_allclose(modes.shapes * sign, three_modes.shapes, atol=1e-4)
    plain = as_modes(fit_modes(frfs, start))
    assert np.abs(plain.shapes * sign - three_modes.shapes).max() > 1e-3


@pytest.mark.parametrize("stated", [False, True])
@pytest.mark.slow
def test_noise_is_no_mode(three_modes: Any, stated: bool) -> None:
    for seed in range(10):
        frfs = three_modes.frfs(_LINES, 0.02, seed)
        size = 0.02 * np.sqrt(np.mean(np.abs(three_modes.frfs(_LINES).values) ** 2))
        sd = np.full(frfs.values.shape, size) if stated else None
        start = pole_of(three_modes.freq_hz, three_modes.damping_ratio)
        assert not fit_with_neighbours(frfs, start, sd, OUT_OF_BAND).outside.any()


def test_lines_too_few_for_a_further_mode(three_modes: Any) -> None:
    frfs = _beside(three_modes, 25.6).frfs(_LINES[::45])
    start = pole_of(three_modes.freq_hz, three_modes.damping_ratio)
    assert not fit_with_neighbours(frfs, start, None, ()).outside.any() or len(frfs.freq_hz) > 4


def test_the_identification_fits_it_and_says_so(three_modes: Any) -> None:
    known = _beside(three_modes, 25.6)
    found = identify_frfs(known.frfs(np.linspace(2.0, 40.0, 600), 0.01), InputKnown((8.0, 25.0), 20))
    np.testing.assert_allclose(found.modes.freq_hz, three_modes.freq_hz, rtol=2e-3)
    notices = {n.code: n.what for n in found.notices}
    assert "at 25.6" in notices["identify.near-band"]
    assert all(remark.mode < 3 for remark in found.remarks)
    assert found.modes.freq_sd_hz is not None
    assert (np.abs(found.modes.freq_hz - three_modes.freq_hz) < 4.0 * found.modes.freq_sd_hz).all()
