"""Poles beyond the band that stand for what lies there: as many as the functions want."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from femtune.identification import fit_quality, in_band, residual_poles, system_fit
from femtune.identification.beyond_band import LEAST, MOST, system_beyond
from femtune.modal import FrfSet, StateSpace, pole_of

_LINES = np.linspace(4.0, 65.0, 400)
_BAND = (10.0, 30.0)


def _noisy(frfs: FrfSet, part: float) -> FrfSet:
    chance = np.random.default_rng(3).standard_normal((2, *frfs.values.shape))
    size = part * np.abs(frfs.values).mean(axis=2, keepdims=True)
    return replace(frfs, values=frfs.values + size * (chance[0] + 1j * chance[1]))


@pytest.mark.slow
def test_as_many_as_exact_functions_want(eight_modes: Any) -> None:
    frfs = in_band(eight_modes.frfs(_LINES), *_BAND)
    hertz = eight_modes.freq_hz
    inside = pole_of(hertz, eight_modes.damping_ratio)[(hertz > _BAND[0]) & (hertz < _BAND[1])]
    few = system_fit(frfs, np.concatenate([inside, residual_poles(_BAND, *LEAST)]))
    chosen = system_beyond(frfs, inside, _BAND, None, None, reciprocal=False)
    assert sum(LEAST) < len(chosen.poles) - len(inside) <= sum(MOST)
    errors = [np.median(fit_quality(fit.system.frf(frfs.freq_hz), frfs).error) for fit in (few, chosen)]
    assert errors[1] < 0.2 * errors[0]
    stated = system_beyond(frfs, inside, _BAND, 1, 1, reciprocal=False)
    assert len(stated.poles) == len(inside) + 2


@pytest.mark.parametrize("noise", [0.02, 0.2])
def test_no_more_than_noise_allows(eight_modes: Any, noise: float) -> None:
    """Functions of the modes of the band alone: nothing lies outside."""
    hertz = eight_modes.freq_hz
    at = (hertz > _BAND[0]) & (hertz < _BAND[1])
    poles = pole_of(hertz, eight_modes.damping_ratio)
    whole = in_band(eight_modes.frfs(_LINES), *_BAND)
    fit = system_fit(whole, np.concatenate([poles[at], poles[~at]]))
    keep = 2 * int(at.sum())
    system = StateSpace(
        fit.system.A[:keep, :keep], fit.system.B[:keep], fit.system.C[:, :keep], fit.system.D, whole.responses,
        whole.references, whole.kind,
    )  # fmt: skip
    frfs = _noisy(system.frf(whole.freq_hz), noise)
    chosen = system_beyond(frfs, poles[at], _BAND, None, None, reciprocal=False)
    assert len(chosen.poles) == at.sum() + sum(LEAST)
