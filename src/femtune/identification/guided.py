"""A mode where a model has one and the identification has none: looked for in the functions, and judged by chance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from femtune.errors import FemtuneError
from femtune.identification.modal_fit import ModalFit, deviance_at, fit_modes
from femtune.identification.modal_solve import OutsideTerms
from femtune.identification.near_band import APART, explains, fit_with_neighbours
from femtune.modal import freq_and_damping, pole_of
from femtune.modal.equalise import LARGEST_DAMPING_RATIO

_PLACES = (0.0, -0.002, 0.002, -0.006, 0.006, -0.015, 0.015)
"""Relative distances from the frequency of the model at which the mode is looked for first."""
_DAMPING = (1.0, 0.25, 4.0)
"""Factors on the damping ratio with which it is looked for."""
_FARTHEST = 0.03
"""Relative distance from the frequency of the model within which a mode is taken for its partner."""


def with_mode_near(
    fit: ModalFit, terms: OutsideTerms, freq_hz: float, damping_ratio: float, decay: float = 0.0
) -> ModalFit | None:
    """The fit with a further mode near a frequency.

    The pole is placed at some distances from the frequency, with some damping ratios; the best of these is refined
    together with all others. If it explains more than noise does, all modes are fitted again, with others beyond the
    band where the functions want them.

    Parameters
    ----------
    fit : the modal fit without it
    terms : for what lies outside the band, as in the fit
    freq_hz, damping_ratio : where the mode is expected
    decay : σ in rad/s that an exponential window has subtracted from all poles of the fit

    Returns
    -------
    None if a further mode explains no more than noise does, or is not near the frequency
    """
    inside, outside, lines = fit.poles[~fit.outside], fit.poles[fit.outside], fit.measured.freq_hz
    if 2 * len(lines) <= 2 * (len(fit.poles) + 1) + len(terms):
        return None
    at = np.array([(freq_hz * (1.0 + place), factor * damping_ratio) for factor in _DAMPING for place in _PLACES])
    places = pole_of(at[:, 0], np.minimum(at[:, 1], 0.9 * LARGEST_DAMPING_RATIO)) - decay
    best: complex | None = None
    least = np.inf
    for pole in places:
        try:
            deviance = deviance_at(fit.measured, np.append(fit.poles, pole), fit.line_sd, terms)
        except (np.linalg.LinAlgError, FemtuneError):
            continue
        if deviance < least:
            best, least = pole, deviance
    if best is None:
        return None
    try:
        trial = fit_modes(fit.measured, np.append(inside, best), fit.line_sd, terms, neighbours=outside)
    except (np.linalg.LinAlgError, FemtuneError):
        return None
    if not trial.converged or not explains(trial, fit) or not _is_near(trial, len(inside), freq_hz, decay):
        return None
    start = trial.poles[~trial.outside][np.argsort(trial.begun_at[~trial.outside])]
    whole = fit_with_neighbours(fit.measured, start, fit.line_sd, terms)
    return _left_as(fit, whole if _is_near(whole, len(inside), freq_hz, decay) else trial)


def _left_as(before: ModalFit, fit: ModalFit) -> ModalFit:
    """The fit, of which the modes that were none before are none, such as motions on a suspension."""
    none = np.append(before.left[~before.outside], False)
    left = np.where(fit.outside, fit.left, none[fit.begun_at])
    return replace(fit, left=left)


def _is_near(fit: ModalFit, number: int, freq_hz: float, decay: float) -> bool:
    """Whether the mode that began with a number is near a frequency, and is none of the others."""
    of_number = fit.begun_at == number
    pole = fit.poles[of_number][0]
    found_hz, found_ratio = (float(value[0]) for value in freq_and_damping(fit.poles[of_number] + decay))
    apart = float(np.abs(fit.poles[~of_number] - pole).min(initial=np.inf))
    near = abs(found_hz / freq_hz - 1.0) <= _FARTHEST and 0.0 < found_ratio < LARGEST_DAMPING_RATIO
    return near and apart > APART * abs(pole.real)
