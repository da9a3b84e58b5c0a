"""Set-ups that were measured one after another, merged by the degrees of freedom that they share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.identification.choice import joined_by_average
from femtune.modal import Channel, ModeSet, TimeSeries
from femtune.modal.shape_criteria import mac


def merge_setups(setups: Sequence[ModeSet]) -> ModeSet:
    """One set of modes at all DOFs; the scales of all set-ups are found together from all DOFs that they share.

    The shape φ and the factors α_s of each mode minimise Σ_s ‖α_s ψ_s − φ‖² over the entries of each set-up, at fixed
    Σ_s |α_s|², where ψ_s has unit norm at the shared DOFs: the smallest eigenvector of a matrix that has a row for each
    set-up. References that all set-ups have and points in which only two overlap count alike.

    Parameters
    ----------
    setups : the same modes in the same order, real or complex shapes; see `same_modes`

    Returns
    -------
    ModeSet : frequencies and damping are means over the set-ups, the deviations those of the means; shapes are scaled
        like those of the first set-up, and at shared DOFs they are the mean

    Raises
    ------
    FemtuneError : ``identify.setups`` where the numbers of modes differ, set-ups share no DOF with the others, or a
        mode does not move where they do
    """
    counts = [len(s) for s in setups]
    if len(set(counts)) > 1:
        raise FemtuneError("identify.setups", values={"modes of each set-up": counts})
    dofs, rows, signs = _places(setups)
    _check_joined(rows, len(dofs))
    shapes = np.full((len(setups), len(dofs), counts[0]), np.nan, dtype=setups[0].shapes.dtype)
    for k, setup in enumerate(setups):
        shapes[k, rows[k]] = signs[k][:, None] * setup.shapes
    merged = np.stack([_merged(shapes[:, :, i], i, setups) for i in range(counts[0])], axis=1)
    freq = np.array([s.freq_hz for s in setups])
    return ModeSet(
        freq.mean(axis=0),
        merged,
        dofs,
        setups[0].labels,
        _mean([s.damping_ratio for s in setups]),
        freq_sd_hz=_sd_of_mean(freq),
        source=f"{len(setups)} set-ups merged",
    )


def _places(setups: Sequence[ModeSet]) -> tuple[DofSet, list[NDArray], list[Reals]]:
    """All DOFs, and rows and signs of each set-up's among them."""
    seen: dict[tuple[int, str], Dof] = {}
    for dof in (d for s in setups for d in s.dofs):
        seen.setdefault((dof.node, dof.direction), dof)
    dofs = DofSet(seen.values())
    places = [s.dofs.align(dofs) for s in setups]
    return dofs, [rows for rows, _ in places], [signs for _, signs in places]


def _check_joined(rows: Sequence[NDArray], size: int) -> None:
    """Every set-up is joined to the first one by shared DOFs, directly or through others."""
    joined, left = np.zeros(size, bool), list(range(len(rows)))
    joined[rows[left.pop(0)]] = True
    while more := [k for k in left if joined[rows[k]].any()]:
        for k in more:
            joined[rows[k]] = True
            left.remove(k)
    if left:
        raise FemtuneError("identify.setups/not-joined", numbers=", ".join(str(k + 1) for k in left))


def _merged(shapes: NDArray, mode: int, setups: Sequence[ModeSet]) -> NDArray:
    """(d,) the shape from (s, d) those of the set-ups, NaN where one has no sensor."""
    known = np.isfinite(shapes)
    shared = known & (known.sum(axis=0) > 1)
    filled = np.where(known, shapes, 0.0)
    filled_shared = np.where(shared, filled, 0.0)
    size, whole = np.linalg.norm(filled_shared, axis=1), np.linalg.norm(filled, axis=1)
    if (still := np.flatnonzero(size <= 1e-6 * whole)).size and len(setups) > 1:
        raise FemtuneError(
            "identify.setups/no-motion-at-references", mode=setups[0].labels[mode], number=int(still[0]) + 1
        )
    unit = filled_shared / np.where(size > 0.0, size, 1.0)[:, None]
    matrix = np.eye(len(setups)) - (unit.conj() / np.maximum(known.sum(axis=0), 1)) @ unit.T
    if len(setups) == 1:
        return np.asarray(filled[0])
    values, vectors = np.linalg.eigh(matrix)
    if values[1] <= _SINGULAR:
        raise FemtuneError("identify.setups/mode-not-joined", mode=setups[0].labels[mode])
    scale = vectors[:, 0] / size
    scaled = filled * (scale / scale[0])[:, None]
    return np.asarray(scaled.sum(axis=0) / known.sum(axis=0))


_SINGULAR = 1e-9
"""A second eigenvalue as small as this: two groups of set-ups have no common motion in a mode."""


# ----------------------------------------------------------------------------------------------------
# The same modes in every set-up: alike in frequency, and in shape where enough sensors are shared.


_LARGEST_GAP = 0.03
"""Relative distance of the frequencies of one mode in two set-ups at most."""
_LEAST_MAC = 0.5
"""MAC at the common sensors, below which modes of two set-ups are not one."""
_LEAST_COMMON = 3
"""Common sensors without which shapes are not compared."""
_NEVER_JOINED = 1e3
"""Distance of two modes of the same set-up: far beyond 1, the largest distance within a group."""


@dataclass(frozen=True)
class PartlyFound:
    """A mode that only some set-ups have: mean frequency, and positions of the set-ups."""

    freq_hz: float
    having: tuple[int, ...]


def same_modes(setups: Sequence[ModeSet]) -> tuple[list[ModeSet], list[PartlyFound]]:
    """The modes that all set-ups have, in one order, and the others.

    Modes of two set-ups are one if their frequencies differ by less than 3 % and, where they share at least three DOFs,
    their MAC there is above 0.5; groups are formed by average linkage, so that of close modes the nearest are joined.
    """
    freq = np.concatenate([s.freq_hz for s in setups])
    source = np.repeat(np.arange(len(setups)), [len(s) for s in setups])
    if len(freq) < 2:
        return list(setups), []
    apart = np.abs(freq[:, None] - freq) / np.minimum(freq[:, None], freq) / _LARGEST_GAP
    distance = np.maximum(apart, _unlike(setups))
    distance[(source[:, None] == source) & ~np.eye(len(freq), dtype=bool)] = _NEVER_JOINED
    groups = [_one_of_each(g, freq, source) for g in joined_by_average(distance, 1.0)]
    groups.sort(key=lambda g: float(freq[g].mean()))
    whole = [g for g in groups if len(g) == len(setups)]
    first = np.concatenate([[0], np.cumsum([len(s) for s in setups])])
    kept = [s.select_modes([int(g[k]) - int(first[k]) for g in whole]) for k, s in enumerate(setups)]
    labels = tuple(str(i + 1) for i in range(len(whole)))
    some = [g for g in groups if len(g) < len(setups)]
    left = [PartlyFound(float(freq[g].mean()), tuple(int(k) for k in source[g])) for g in some]
    return [replace(s, labels=labels) for s in kept], left


def _one_of_each(group: NDArray, freq: Reals, source: NDArray) -> NDArray:
    """At most one mode of each set-up, that nearest to the middle; in the order of the set-ups."""
    near = group[np.argsort(np.abs(freq[group] - np.median(freq[group])), kind="stable")]
    _, first = np.unique(source[near], return_index=True)
    return np.asarray(near[first])


def _unlike(setups: Sequence[ModeSet]) -> Reals:
    """(1 − MAC)/(1 − least MAC) of all modes at the DOFs that two set-ups share; 0 for too few of them."""
    blocks = [[np.zeros((len(a), len(b))) for b in setups] for a in setups]
    for i, a in enumerate(setups):
        for j, b in enumerate(setups):
            common = a.dofs.common(b.dofs)
            if i != j and len(common) >= _LEAST_COMMON:
                one, other = a.select_dofs(common).shapes, b.select_dofs(common).shapes
                moving = np.linalg.norm(one, axis=0).min() > 0.0 and np.linalg.norm(other, axis=0).min() > 0.0
                blocks[i][j] = (1.0 - mac(one, other)) / (1.0 - _LEAST_MAC) if moving else blocks[i][j]
    return np.block(blocks)


def _mean(values: Sequence[Reals | None]) -> Reals | None:
    known = [v for v in values if v is not None]
    return np.asarray(np.mean(known, axis=0)) if len(known) == len(values) else None


def _sd_of_mean(values: Reals) -> Reals | None:
    return None if len(values) < 2 else np.asarray(values.std(axis=0, ddof=1) / np.sqrt(len(values)))


# ----------------------------------------------------------------------------------------------------
# Many sensors on a rigid body made into its few motions, by least squares.


def to_rigid_motion(record: TimeSeries, rows: Reals, motions: DofSet) -> tuple[TimeSeries, Reals]:
    """The motions of rigid bodies that fit all responses best, and what each response has besides them.

    Parameters
    ----------
    record : its responses are taken together; inputs stay as they are
    rows : (responses, motions) what each response sees of each motion
    motions : the DOFs that stand for the motions

    Returns
    -------
    the record of the motions (as responses) and of the inputs, and (responses,) rms of what is left over the rms of the
    response: the body bends, or a sensor is wrong, where it is not small

    Raises
    ------
    FemtuneError : ``identify.rigid-motion`` where the sizes disagree, the responses do not determine the motions or are
        of several quantities
    """
    at = record.positions("response")
    if rows.shape != (len(at), len(motions)):
        sizes = {"rows": rows.shape, "responses": len(at), "motions": len(motions)}
        raise FemtuneError("identify.rigid-motion", values=sizes)
    if np.linalg.matrix_rank(rows) < len(motions):
        raise FemtuneError(
            "identify.rigid-motion/not-determined",
            values={"rank": int(np.linalg.matrix_rank(rows))},
            n_responses=len(at),
            n_motions=len(motions),
        )
    quantities = sorted({record.channels[i].quantity for i in at})
    if len(quantities) > 1:
        raise FemtuneError("identify.rigid-motion/quantities", quantities=", ".join(quantities))
    values = record.values[at]
    fitted = np.linalg.lstsq(rows, values, rcond=None)[0]
    rest = (values - rows @ fitted).std(axis=1) / np.maximum(values.std(axis=1), np.finfo(float).tiny)
    others = [i for i in range(len(record)) if i not in at]
    channels = (
        *(Channel(dof, record.channels[at[0]].quantity) for dof in motions),
        *(record.channels[i] for i in others),
    )
    return replace(record, values=np.vstack([fitted, record.values[others]]), channels=channels), np.asarray(rest)
