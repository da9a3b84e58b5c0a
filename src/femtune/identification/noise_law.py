"""Noise of functions that follows their magnitude: a floor and a part of each value, by what a fit leaves."""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr
from scipy.special import chdtri

from femtune.arrays import Complexes, Reals
from femtune.identification.modal_fit import NO_POLES, ModalFit
from femtune.identification.modal_solve import LEAST_NOISE, OutsideTerms, modal_basis, real_rows
from femtune.identification.near_band import fit_with_neighbours
from femtune.identification.shapes import without_noise

BY_CHANCE = 1e-4
"""Probability with which noise of one level is taken for noise that follows the magnitude."""
_ROUNDS = 4
"""Fits at most, each with the noise that the errors of the one before show."""
_SAME = 0.02
"""Median relative change of the standard deviations at which these end."""
_STEPS = 300
"""Steps of the likelihood of both variances at most."""
_SMALL = 1e-4
"""Relative change of a variance in a step, at which they end."""
_MOST_LEVERAGE = 0.95
"""Leverage of a value at most."""


def with_noise_by_magnitude(fit: ModalFit, start: Complexes, terms: OutsideTerms) -> ModalFit:
    """The fit with the noise of each function as its errors show it: a floor and a part of its magnitude.

    Modes outside the band are looked for again as long as the noise changes: what one level takes for noise at the
    resonances hides what they do between them.

    Parameters
    ----------
    fit : by one level of noise a function
    start, terms : of the fit, as for `fit_with_neighbours`, whose errors are raised

    Returns
    -------
    the fit as it was where one level explains its errors as well, or where there is no noise
    """
    known = NO_POLES
    for _ in range(_ROUNDS):
        sd = None if without_noise(fit) else noise_by_magnitude(fit, terms)
        if sd is None or (fit.line_sd is not None and np.median(np.abs(np.log(sd / fit.line_sd))) < _SAME):
            break
        fit = fit_with_neighbours(fit.measured, start, sd, terms, known=known)
        start, known = fit.poles[~fit.outside][np.argsort(fit.begun_at[~fit.outside])], fit.poles[fit.outside]
    return fit


def noise_by_magnitude(fit: ModalFit, terms: OutsideTerms) -> Reals | None:
    """(n, u, k) standard deviations √E|error|² of a floor and a part of the magnitude of each function.

    Parameters
    ----------
    fit : to all functions, with any weights
    terms : of it

    Returns
    -------
    None if one level of each function explains the errors as well
    """
    measured = fit.measured
    shape, k = measured.values.shape, len(measured.freq_hz)
    error = (np.abs(measured.values - fit.synthesised.values) ** 2).reshape(-1, k)
    power = (np.abs(fit.synthesised.values) ** 2).reshape(-1, k)
    free = 1.0 - np.minimum(_leverage(fit, terms), _MOST_LEVERAGE)
    # a function that is fitted exactly, as that of a dead response is
    exact = error.sum(axis=1) <= LEAST_NOISE**2 * power.sum(axis=1)
    power[exact & ~power.any(axis=1)] = 1.0
    error[exact] = LEAST_NOISE**2 * power[exact].mean(axis=1, keepdims=True)
    level = error.sum(axis=1, keepdims=True) / free.sum(axis=1, keepdims=True)
    variance = _likeliest(error, power, free)
    gain = np.sum(free * np.log(level / variance) + error / level - error / variance)
    if 2.0 * gain < chdtri(len(error), BY_CHANCE):
        return None
    return np.asarray(np.sqrt(variance).reshape(shape))


def noise_at_peaks(fit: ModalFit) -> tuple[float, float]:
    """Largest and least standard deviation relative to the largest magnitude of a function; medians over functions."""
    assert fit.line_sd is not None
    peak = np.abs(fit.synthesised.values).max(axis=2)
    some = peak > 0.0
    most, least = fit.line_sd.max(axis=2)[some] / peak[some], fit.line_sd.min(axis=2)[some] / peak[some]
    return float(np.median(most)), float(np.median(least))


def _likeliest(error: Reals, power: Reals, free: Reals) -> Reals:
    """(F, k) variances a + b|H|² of the largest restricted likelihood of squared errors (F, k).

    Both numbers are multiplied in turn, which raises the likelihood in each step and keeps them positive (C. Fevotte,
    J. Idier 2011, Algorithms for nonnegative matrix factorization with the beta-divergence, Neural Computation 23).
    """
    a = 0.5 * error.sum(axis=1) / free.sum(axis=1)
    b = a / power.mean(axis=1)
    variance = a[:, None] + b[:, None] * power
    for _ in range(_STEPS):
        left, by = error / variance**2, free / variance
        a = a * np.sqrt(left.sum(axis=1) / by.sum(axis=1))
        b = b * np.sqrt((left * power).sum(axis=1) / (by * power).sum(axis=1))
        before, variance = variance, a[:, None] + b[:, None] * power
        if np.abs(np.log(variance / before)).max() < _SMALL:
            break
    return np.asarray(variance)


def _leverage(fit: ModalFit, terms: OutsideTerms) -> Reals:
    """(F, k) part of the error of each value that residues and terms of its function hide."""
    k = len(fit.measured.freq_hz)
    columns = modal_basis(fit.measured.freq_hz, fit.poles, fit.measured.kind, terms).columns
    functions = fit.residues.shape[0] * fit.residues.shape[1]
    if fit.line_sd is None:
        return np.broadcast_to(_hat(columns, np.ones(k)), (functions, k))
    return np.stack([_hat(columns, weights) for weights in 1.0 / fit.line_sd.reshape(functions, k)])


def _hat(columns: Complexes, weights: Reals) -> Reals:
    rows = real_rows(columns * weights[:, None])
    Q = qr(rows / np.linalg.norm(rows, axis=0), mode="economic", check_finite=False)[0]
    return np.asarray(np.sum(Q**2, axis=1).reshape(2, -1).mean(axis=0))
