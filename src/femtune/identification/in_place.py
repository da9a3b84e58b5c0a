"""The fit of the chosen poles, each of which must end where its cluster is.

The fit improves poles that are already those of modes. A pole that goes far away has been used for something else: for
what the real terms outside the band lack, for another mode, or for the leakage of a window. Its cluster says nothing
about the place where it ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from femtune.arrays import Complexes, Flags, Reals
from femtune.errors import Notice, with_notices
from femtune.identification.choice import Candidate, chosen_poles
from femtune.identification.modal_fit import ModalFit
from femtune.identification.mode_checks import ModeRemark
from femtune.identification.near_band import fit_with_neighbours
from femtune.identification.pole_table import PoleTable
from femtune.modal import FrfSet, freq_and_damping

FARTHEST = 0.05
"""Distance |λ_end − λ_start| / |λ_start| beyond which a pole has left its cluster; poles within it are one cluster."""
FARTHEST_FREQUENCY = 0.01
"""Relative change of frequency beyond which a pole may have left: stable poles of two orders differ by less."""
HALF_BANDWIDTHS = 3.0
"""Change of frequency in half bandwidths, of the start or the end, which it must exceed too."""
SAME = 0.1
"""Distance of two ends in half bandwidths below which their residues cannot be told apart by one reference."""


def fit_in_place(
    frfs: FrfSet,
    candidates: Sequence[Candidate],
    table: PoleTable,
    by_hand: Sequence[bool],
    sd: Reals | None,
    terms: tuple[str, ...],
) -> tuple[ModalFit, tuple[Candidate, ...], tuple[Notice, ...], tuple[ModeRemark, ...]]:
    """The fit of the chosen candidates, without those whose poles leave their clusters.

    Parameters
    ----------
    frfs, sd, terms : as for `fit_modes`
    candidates, table : clusters with their choice, and the poles that they are made of
    by_hand : of each candidate, whether the user chose it; such a pole is held at its cluster where it would leave

    Returns
    -------
    the fit; the candidates, of which those that left are not chosen; notices that name what left; remarks on the modes
    that are held

    Raises
    ------
    FemtuneError : as `fit_with_neighbours`; ``identify.no-poles`` also where all poles leave, with the notices
    """
    kept, held = list(candidates), np.zeros(len(candidates), bool)
    told: list[Notice] = []
    while True:
        chosen = np.flatnonzero([c.chosen for c in kept])
        poles = chosen_poles(kept, table).poles
        with with_notices(told):
            fit = fit_with_neighbours(frfs, poles, sd, terms, held[chosen])
        of_mode = chosen[fit.begun_at[~fit.outside]]
        away = np.where(held[of_mode], 0.0, _away(fit, poles))
        if not away.any():
            remarks = [_remark(r, kept[i]) for r, i in enumerate(of_mode) if held[i]]
            return fit, tuple(kept), tuple(told), tuple(remarks)
        r = int(np.argmax(away))
        i = int(of_mode[r])
        if by_hand[i]:
            held[i] = True
            continue
        hz, ratio = (float(x[r]) for x in freq_and_damping(fit.poles[~fit.outside]))
        told.append(Notice("identify.left-cluster", cluster_hz=kept[i].freq_hz, end_hz=hz, end_ratio=ratio))
        reason = f"its fit ends at {hz:.4g} Hz with a damping ratio of {ratio:.2%}"
        kept[i] = replace(kept[i], chosen=False, reason=reason)


def _remark(mode: int, candidate: Candidate) -> ModeRemark:
    return ModeRemark(mode, Notice("identify.held-at-cluster", cluster_hz=candidate.freq_hz))


def _away(fit: ModalFit, start: Complexes) -> Reals:
    """(m,) relative distance of the modes inside the band from their starts; 0 where they are in their places."""
    ends, begun = fit.poles[~fit.outside], start[fit.begun_at[~fit.outside]]
    distance = np.abs(ends - begun) / np.abs(begun)
    freq, begun_freq = freq_and_damping(ends)[0], freq_and_damping(begun)[0]
    half_bandwidth = np.maximum(np.abs(ends.real), np.abs(begun.real)) / (2.0 * np.pi)
    change = np.abs(freq - begun_freq)
    left = distance > FARTHEST
    left |= (change > FARTHEST_FREQUENCY * begun_freq) & (change > HALF_BANDWIDTHS * half_bandwidth)
    lines = fit.measured.freq_hz
    left |= ((freq < lines[0]) | (freq > lines[-1])) & (begun_freq >= lines[0]) & (begun_freq <= lines[-1])
    left |= _moved_onto_another(fit, ends, distance)
    return np.where(left, np.maximum(distance, np.finfo(float).tiny), 0.0)


def _moved_onto_another(fit: ModalFit, ends: Complexes, distance: Reals) -> Flags:
    """(m,) modes of one reference whose pole is that of another mode, which was nearer to it."""
    if len(fit.measured.references) > 1:
        return np.zeros(len(ends), bool)
    damped = np.abs(ends.real)
    near = np.abs(ends[:, None] - ends) < SAME * np.minimum(damped[:, None], damped)
    return np.asarray((near & (distance[:, None] > distance)).any(axis=1))
