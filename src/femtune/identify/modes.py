"""A modal fit as a ModeSet, with the covariance of what it holds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.errors import Notice
from femtune.identify.modal_fit import ModalFit
from femtune.identify.scaling import ScaledShapes, driving_points, scaled_shapes
from femtune.modal import ModeSet, freq_and_damping
from femtune.testdata.checks import mean_phase_deviation_deg, phase_collinearity

Reals = NDArray[np.float64]

NOT_ONE_SHAPE = 0.95
"""Residues of several references that one shape explains to less than this share are more than one mode, or wrong."""


LARGE_SPREAD = 4.0
"""Spread of a pole between the functions above which it is told."""


def as_modes(fit: ModalFit, real: bool = True, labels: tuple[str, ...] = ()) -> ModeSet:
    """Frequencies, damping ratios, shapes and modal scale, with their covariance.

    Parameters
    ----------
    real : real shapes; complex ones where false
    labels : names of the modes, else they are counted

    Returns
    -------
    mass-normalised where a reference is among the responses (``modal_a`` is 2iω_d then), else scaled to 1 at the
    largest entry, without ``modal_a``
    """
    made = scaled_shapes(fit, driving_points(fit.measured), real)
    freq, damping = freq_and_damping(fit.poles)
    covariance = freq_damping_covariance(fit)
    sd = np.sqrt(np.diag(covariance))
    m = len(freq)
    modal_a = np.asarray(2j * fit.poles.imag, dtype=complex)
    # a response that is zero throughout was not measured: no shape, and above all no shape without error
    dead = ~np.any(fit.measured.values != 0.0, axis=(1, 2))
    shapes, shapes_sd = (np.where(dead[:, None], np.nan, x) for x in (made.shapes, made.sd))
    return ModeSet(
        freq,
        shapes,
        fit.measured.responses,
        labels,
        damping,
        "mass" if made.mass_normalised else "unit-max",
        freq_sd_hz=sd[:m],
        shapes_sd=shapes_sd,
        source=fit.measured.source,
        damping_sd=sd[m:],
        covariance=covariance,
        modal_a=modal_a if made.mass_normalised else None,
    )


def freq_damping_covariance(fit: ModalFit) -> Reals:
    """(2m, 2m) of |λ|/2π and −Re λ/|λ|, to first order."""
    x, y, size = fit.poles.real, fit.poles.imag, np.abs(fit.poles)
    slopes = np.block(
        [
            [np.diag(x / size), np.diag(y / size)],
            [np.diag(-(y**2) / size**3), np.diag(x * y / size**3)],
        ]
    )
    slopes[: len(x)] /= 2.0 * np.pi
    covariance = slopes @ fit.pole_covariance @ slopes.T
    return 0.5 * (covariance + covariance.T)


def fit_notices(fit: ModalFit, made: ScaledShapes, low_collinearity: float = 0.9) -> tuple[Notice, ...]:
    """What a user should know of the modes: complex shapes, wrong signs, functions that disagree."""
    found = []
    for r, freq in enumerate(freq_and_damping(fit.poles)[0]):
        shape = np.linalg.svd(fit.residues[:, :, r], full_matrices=False)[0][:, 0]
        value = phase_collinearity(shape)
        if value < low_collinearity:
            off = mean_phase_deviation_deg(shape)
            what = f"the mode at {freq:.4g} Hz is complex: phase collinearity {value:.2f}, phases {off:.0f} degrees off"
            found.append(Notice("identify.complex-mode", what))
        if made.mass_sign[r] < 0.0:
            what = f"the mode at {freq:.4g} Hz has a negative modal mass at the driving point"
            found.append(Notice("identify.driving-point-sign", what))
        if made.rank_share[r] < NOT_ONE_SHAPE:
            what = f"one shape explains {made.rank_share[r]:.0%} of the residues of the mode at {freq:.4g} Hz"
            found.append(Notice("identify.references-disagree", what))
        if fit.spread[r] > LARGE_SPREAD:
            times = np.sqrt(fit.spread[r])
            what = f"the functions disagree on the mode at {freq:.5g} Hz {times:.1f} times more than noise"
            found.append(Notice("identify.functions-disagree", what))
    return tuple(found)
