"""Forces that are late or early against all responses: found by the phases of the residues of several modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from femtune.arrays import Complexes, Reals
from femtune.errors import Notice
from femtune.identification.modal_fit import ModalFit

LEVEL = 1e-3
"""Probability with which a force that is on time is called late, over all delays that are tried and all forces."""
LEAST_MODES = 3
"""Modes that tell a delay, whose phase grows with the frequency, from complex shapes."""
LEAST_PART = 0.2
"""Part of a sample from which a delay is told. The square of a shape is too small by
about cos(2πfτ): by 1 % at f = 0.11 of the sampling rate."""
MOST_SAMPLES = 10.0
"""Samples up to which delays are tried."""
LEAST_PHASE = np.deg2rad(0.3)
"""Error of a phase that is assumed at least, for what the model leaves out."""


@dataclass(frozen=True)
class LateForce:
    """Delay of a force against the responses in s (negative: it is early), its standard deviation, and the
    probability that a force on time looks like this."""

    delay_s: float
    sd_s: float
    probability: float


def late_force(phases: Reals, sd: Reals, freq_hz: Reals, step_s: float, forces: int = 1) -> LateForce | None:
    """The delay of a force by the phases of its residues.

    The residues of a real mode of unit modal mass are φφᵀ/(2iω). A force that is late by τ turns all of its residues by
    +ωτ. The delay that leaves least of the phases, mod 180°, is compared with none (F test, with Bonferroni's
    correction for the delays that can be told apart and for all forces). The error of the phases is
    the scatter that is left, so that complex shapes are not called late.

    Parameters
    ----------
    phases : (m,) rad, mean phase of 2iωR over the responses, of any multiple of 180°
    sd : (m,) their standard deviations, up to a common factor
    freq_hz : (m,)
    step_s : between two samples
    forces : that are tested

    Returns
    -------
    None where the force is on time, is late by less than a fifth of a sample, or is not told from on time
    """
    m = len(phases)
    if m < LEAST_MODES or not (np.isfinite(phases).all() and np.isfinite(sd).all()):
        return None
    omega, weight = 2.0 * np.pi * freq_hz, 1.0 / sd**2
    most = MOST_SAMPLES * step_s
    fine = 1.0 / (200.0 * float(freq_hz.max()))
    delays = np.linspace(-most, most, 2 * int(np.ceil(most / fine)) + 1)

    def left(turned: Reals) -> Reals:
        return np.asarray((weight * _within_90(turned) ** 2).sum(axis=-1))

    tried = left(phases - np.outer(delays, omega))
    delay = float(delays[tried.argmin()])
    # near its best value the sum of squares is quadratic
    delay += float((weight * omega * _within_90(phases - omega * delay)).sum() / (weight * omega**2).sum())
    rest, none = max(float(left(phases - omega * delay)), np.finfo(float).tiny), float(left(phases))
    if min(rest, none) > float(left(phases - 0.5 * np.pi)):
        return None  # another quantity than stated turns all modes by 90°
    variance = rest / (m - 1)
    apart = 1.0 + 4.0 * most * float(freq_hz.max())
    probability = min(1.0, forces * apart * float(fdtrc(1, m - 1, max(none - rest, 0.0) / variance)))
    if probability > LEVEL or abs(delay) < LEAST_PART * step_s:
        return None
    return LateForce(delay, float(np.sqrt(variance / (weight * omega**2).sum())), probability)


def late_force_notices(fit: ModalFit, names: Sequence[str], step_s: float, *, counted: bool) -> tuple[Notice, ...]:
    """``identify.late-channel/force``, with the delay in samples where `step_s` is `counted` as the step of a record.

    Forces that outnumber the responses are those of one hammer that roves.
    """
    kept = fit.reported
    freq_hz = np.abs(fit.poles[kept].imag) / (2.0 * np.pi)
    n, u, _ = fit.residues.shape
    groups = [("the force", list(range(u)))] if u == 1 or u > n else [(f"the force {names[j]}", [j]) for j in range(u)]
    said = []
    for name, columns in groups:
        phases, sd = _phases(fit, columns)
        found = late_force(phases[kept], sd[kept], freq_hz, step_s, len(groups))
        if found is not None:
            in_samples = f", {abs(found.delay_s) / step_s:.2f} samples" if counted else ""
            word = "late" if found.delay_s > 0.0 else "early"
            said.append(f"{name} ({abs(found.delay_s):.3g} ± {found.sd_s:.1g} s{in_samples} {word})")
    return (Notice("identify.late-channel/force", channels=", ".join(said)),) if said else ()


def _phases(fit: ModalFit, columns: list[int]) -> tuple[Reals, Reals]:
    """(m,) half the phase of Σ(2iωR)² over the functions of some forces, and its standard deviation.

    To the stated standard deviations of the residues comes the scatter of the phases over the functions, which is the
    size of what makes a shape complex.
    """
    size = 2j * np.abs(fit.poles.imag)
    made: Complexes = fit.residues[:, columns] * size
    squares = (made**2).sum(axis=(0, 1))
    phases = 0.5 * np.angle(squares)
    power = np.maximum((np.abs(made) ** 2).sum(axis=(0, 1)), np.finfo(float).tiny)
    # ½ arg of the sum moves by Im(Σ R dR conj(Σ R²)) / |Σ R²|²
    towards = made * squares.conj() / np.maximum(np.abs(squares) ** 2, np.finfo(float).tiny) * size
    moves = np.stack([towards.imag, towards.real], axis=-1)
    own = np.einsum("numa,numab,numb->m", moves, fit.own_covariance[:, columns], moves)
    by_poles = np.einsum("numa,numap->mp", moves, fit.pole_effect[:, columns])
    stated = own + np.einsum("mp,pq,mq->m", by_poles, fit.pole_covariance, by_poles)
    complexity = ((made * np.exp(-1j * phases)).imag ** 2).sum(axis=(0, 1)) / power
    return phases, np.sqrt(stated + complexity + LEAST_PHASE**2)


def _within_90(phases: Reals) -> Reals:
    """Phases mod 180°, from −90° to 90°."""
    return np.asarray((phases + 0.5 * np.pi) % np.pi - 0.5 * np.pi)
