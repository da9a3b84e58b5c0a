"""Do the poles of a fit end where their clusters are?

The fit improves poles that are already those of modes. A pole that goes far away stands for something else: for what
the real terms outside the band lack, for another mode, or for the leakage of a window. It improves the fit, and stays
in it; its cluster says nothing about the place where it ends, so it is no mode.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from femtune.arrays import Complexes, Reals
from femtune.errors import FemtuneError, Notice
from femtune.identification.choice import Candidate
from femtune.identification.modal_fit import ModalFit
from femtune.identification.mode_checks import ModeRemark
from femtune.identification.pole_table import PoleTable
from femtune.identification.shapes import leading_shapes
from femtune.modal import freq_and_damping
from femtune.modal.shape_criteria import mac_where_defined

LEAST = 0.01
"""Distance |λ_end − λ| / |λ| from the nearest pole λ of the cluster that is always allowed: stable poles of two orders
differ by less."""
HALF_BANDWIDTHS = 3.0
"""Allowed distance in half bandwidths of the cluster."""
MOST = 0.05
"""What these half bandwidths are limited to: the distance within which poles are one cluster. One half bandwidth is
always allowed."""
DAMPING = 5.0
"""Factor between the damping ratios of the end and of the cluster's poles beyond which they are different modes."""
DAMPING_FLOOR = 2e-3
"""Damping ratios below this count as this: methods are wrong about the damping of sharp peaks."""
LEAST_MAC = 0.5
"""MAC of the shapes of start and end, below which they are different modes."""
SAME = 0.1
"""Distance of two ends in half bandwidths below which two modes of one shape are one pole."""
SAME_MAC = 0.9
"""MAC from which their shapes are one."""


ON_SUSPENSION = "rigid-body motion on the suspension"
"""Reason of a candidate below the frequency of the suspension."""


def in_place(
    fit: ModalFit,
    candidates: Sequence[Candidate],
    by_hand: Sequence[bool],
    table: PoleTable,
    band_hz: tuple[float, float],
    suspension_hz: float = 0.0,
) -> tuple[ModalFit, tuple[Candidate, ...], tuple[Notice, ...], tuple[ModeRemark, ...]]:
    """Mark the modes whose poles have left their clusters.

    Parameters
    ----------
    fit : started from the poles of the chosen candidates, in their order
    candidates, table : clusters with their choice, and the poles that they are made of
    by_hand : of each candidate, whether the user chose it; its mode is kept, with a remark
    band_hz : outside which there are no modes
    suspension_hz : below which modes are motions on a suspension, and are left out without a remark

    Returns
    -------
    the fit, in which such modes are `left`; the candidates, of which theirs are not chosen; notices that name them;
    remarks on the modes that are kept, because the user chose them or only their shapes differ

    Raises
    ------
    FemtuneError : ``identify.no-poles`` where no mode is in place
    """
    kept, left, told, doubts = list(candidates), np.zeros(len(fit.poles), bool), [], []
    chosen = np.flatnonzero([c.chosen for c in candidates]).tolist()
    for r, code in _away(fit, [candidates[i] for i in chosen], table, band_hz).items():
        i = chosen[fit.begun_at[r]]
        hz, ratio = (float(x[r]) for x in freq_and_damping(fit.poles))
        notice = Notice(code, cluster_hz=candidates[i].freq_hz, end_hz=hz, end_ratio=ratio)
        if by_hand[i] or code == "identify.left-cluster/shape":
            doubts.append((r, notice))
            continue
        left[r] = True
        told.append(notice)
        kept[i] = replace(
            kept[i], chosen=False, left=True, reason=f"its fit ends at {hz:.4g} Hz, damping ratio {ratio:.2%}"
        )
    freq = freq_and_damping(fit.poles)[0]
    for r in np.flatnonzero(~fit.outside & ~left & (freq < suspension_hz)).tolist():
        i = chosen[fit.begun_at[r]]
        left[r], kept[i] = True, replace(kept[i], chosen=False, reason=ON_SUSPENSION)
        doubts = [one for one in doubts if one[0] != r]
    fit = replace(fit, left=left)
    if not fit.reported.any():
        raise FemtuneError("identify.no-poles/left", n_clusters=len(chosen))
    position = np.cumsum(fit.reported) - 1
    remarks = tuple(ModeRemark(int(position[r]), notice) for r, notice in doubts)
    return fit, tuple(kept), tuple(told), remarks


def _away(fit: ModalFit, chosen: Sequence[Candidate], table: PoleTable, band_hz: tuple[float, float]) -> dict[int, str]:
    """The modes of a fit that are not in place, each with the code of the notice that says why."""
    inside = np.flatnonzero(~fit.outside)
    ends, shapes = fit.poles[inside], leading_shapes(fit)
    clusters = [chosen[i] for i in fit.begun_at[inside].tolist()]
    freq, ratio = freq_and_damping(ends)
    damping = np.array([c.damping_ratio for c in clusters])
    distance = np.array([distance_from(end, table.poles[c.members]) for end, c in zip(ends, clusters)])
    allowed = allowed_distance(damping)
    alike = np.diag(mac_where_defined(shapes, table.shapes[:, [c.at for c in clusters]]))
    found = {}
    for r, i in enumerate(inside.tolist()):
        damped = np.maximum(table.damping_ratio[clusters[r].members], DAMPING_FLOOR)
        same = damped.min() / DAMPING <= max(ratio[r], DAMPING_FLOOR) <= DAMPING * damped.max()
        if distance[r] > allowed[r] or not same:
            found[i] = "identify.left-cluster"
        elif not band_hz[0] <= freq[r] <= band_hz[1]:
            found[i] = "identify.left-cluster/band"
        elif len(shapes) > 1 and alike[r] < LEAST_MAC and not clusters[r].divided:
            found[i] = "identify.left-cluster/shape"
        elif _is_another(r, ends, shapes, distance):
            found[i] = "identify.left-cluster/another"
    return found


def allowed_distance(damping: Reals) -> Reals:
    """Relative distance of an end from the poles of a cluster up to which it is in place."""
    return np.asarray(np.maximum(np.clip(HALF_BANDWIDTHS * damping, LEAST, MOST), damping))


def distance_from(end: complex, members: Complexes) -> float:
    """Relative distance of a pole from the nearest one of a cluster, whose poles may be far from each other."""
    return float(np.min(np.abs(end - members) / np.abs(members)))


def _is_another(r: int, ends: Complexes, shapes: Complexes, distance: Reals) -> bool:
    """Whether a pole has moved to that of another mode, which came from nearer."""
    near = np.abs(ends - ends[r]) < SAME * np.minimum(np.abs(ends.real), abs(ends[r].real))
    near &= distance < distance[r]
    if near.any() and len(shapes) > 1:
        near &= mac_where_defined(shapes[:, [r]], shapes)[0] > SAME_MAC
    return bool(near.any())
