"""Close and repeated modes as subspaces: clusters, rotation of one set to another, principal angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.modal.assignment import linear_sum_assignment
from femtune.modal.shape_criteria import check_rows, check_shapes, unit_largest

RANK_TOLERANCE = 1e-3
"""Observability of a direction of a subspace at the DOFs, relative to the best one, up to which it is not used.

Measured shapes have errors of 1e-2 to 1e-3, which would be amplified beyond the signal.
"""


@dataclass(frozen=True)
class Rotation:
    """Model vectors of a cluster rotated to test vectors.

    Parameters
    ----------
    q : (m, t) orthonormal columns (rows where m < t): the rotated model vectors are model @ q
    aligned : (n, t) the rotated model vectors, at the sensors
    principal_angles_deg : ascending angles between the two subspaces; NaN where too few entries are common
    nearest : model column nearest to each rotated vector, each used once (−1 if none is left)
    angle_deg : largest angle in modal coordinates between a rotated vector and its nearest model column;
        0 if the test has the same vectors as the model, in any order and with any sign
    independence : smallest singular value of the unit modal coordinates, 1 if the test's vectors are orthogonal in the
        cluster, 0 if two of them are the same motion
    """

    q: Reals
    aligned: Reals
    principal_angles_deg: Reals
    nearest: tuple[int, ...]
    angle_deg: float
    independence: float


def clusters(freq_hz: Reals, relative_gap: float = 0.01) -> tuple[tuple[int, ...], ...]:
    """Chains of close modes: every mode is in one group; a mode without close neighbours forms a group alone.

    Neighbours in frequency belong together when they lie within `relative_gap` of the higher one, or both within
    1e-5 of the highest frequency of all (rigid-body modes, whose frequencies are round-off). A negative gap groups
    only these.

    Returns
    -------
    groups of positions, groups and members by ascending frequency
    """
    freq = np.asarray(freq_hz, float)
    if not len(freq):
        return ()
    order = np.argsort(freq, kind="stable")
    ranked = freq[order]
    close = np.diff(ranked) <= relative_gap * ranked[1:]
    close |= ranked[1:] <= 1e-5 * ranked[-1]
    parts = np.split(order, np.flatnonzero(~close) + 1)
    return tuple(tuple(int(i) for i in part) for part in parts)


def rotate_to(model: Reals, test: NDArray) -> Rotation:
    """Orthogonal rotation that brings model vectors nearest to test vectors.

    q is the polar factor of the test's modal coordinates, each column of unit length. The coordinates are the
    least-squares solution of model · x = test rather than modelᵀ test: thus a rotation is recovered exactly although
    vectors that are orthogonal over the whole structure are not orthogonal at a few sensors. If they are, both agree.

    Parameters
    ----------
    model : (n, m) real, mass-normalised over the whole model; no NaN
    test : (n, t) real or complex; NaN marks entries that were not measured

    Raises
    ------
    FemtuneError : ``modal.zero-shape``, ``modal.rows-differ``, ``modal.complex-model``

    Source: orthogonal Procrustes problem, Schönemann (1966), Psychometrika 31.
    """
    check_rows(model, test)
    check_shapes(model, "the model")
    check_shapes(test, "the test")
    if np.iscomplexobj(model):
        raise FemtuneError("modal.complex-model")
    q, independence = _polar_factor(modal_coordinates(model, test))
    nearest = _nearest_columns(q)
    angles = [_angle_deg(abs(q[j, i])) for i, j in enumerate(nearest) if j >= 0]
    return Rotation(q, model @ q, principal_angles_deg(model, test), nearest, max(angles), independence)


def modal_coordinates(model: Reals, test: NDArray) -> Reals:
    """Least-squares coordinates of each test vector in the model's, (m, t), columns of unit length.

    Complex test vectors are rotated to the phase at which they are most nearly real; a vector orthogonal to the
    subspace gives a zero column.
    """
    columns = [_coordinates_of(model, mostly_real(test[:, i])) for i in range(test.shape[1])]
    x = np.column_stack(columns)
    length = np.linalg.norm(x, axis=0)
    return x / np.where(length > 0.0, length, 1.0)


def projection(model: NDArray, test: NDArray) -> Reals:
    """Share |Pψ|²/|ψ|² of each test vector that lies in the model's subspace: its best MAC there, (t,)."""
    check_rows(model, test)
    check_shapes(test, "the test")
    return np.array([_share(model, test[:, i]) for i in range(test.shape[1])])


def principal_angles_deg(a: NDArray, b: NDArray) -> Reals:
    """Principal angles between two subspaces in degrees, ascending, over the rows without NaN in either."""
    small = min(a.shape[1], b.shape[1])
    cosines = _cosines(a, b)
    angles = np.degrees(np.arccos(np.clip(cosines, 0.0, 1.0)))
    return np.concatenate([angles, np.full(small - len(angles), np.nan)])


def mostly_real(shape: NDArray) -> Reals:
    """Real part of a complex shape after rotation to the phase with the largest real part."""
    if not np.iscomplexobj(shape):
        return shape
    phase = 0.5 * np.angle(np.nansum(shape**2))
    return np.asarray((shape * np.exp(-1j * phase)).real)


def _coordinates_of(model: Reals, shape: Reals) -> Reals:
    known = ~np.isnan(shape)
    return np.linalg.pinv(model[known], rcond=RANK_TOLERANCE) @ shape[known]


def _polar_factor(x: Reals) -> tuple[Reals, float]:
    u, s, vt = np.linalg.svd(x, full_matrices=False)
    return u @ vt, float(s.min())


def _nearest_columns(q: Reals) -> tuple[int, ...]:
    rows, columns = linear_sum_assignment(-np.abs(q))
    row_of = dict(zip(columns.tolist(), rows.tolist()))
    return tuple(row_of.get(i, -1) for i in range(q.shape[1]))


def _angle_deg(cosine: float) -> float:
    return float(np.degrees(np.arccos(min(cosine, 1.0))))


def _basis(vectors: NDArray) -> NDArray:
    """Orthonormal basis of the span of unit columns; directions up to `RANK_TOLERANCE` are dropped."""
    vectors = unit_largest(vectors)
    length = np.linalg.norm(vectors, axis=0)
    u, s, _ = np.linalg.svd(vectors[:, length > 0.0] / length[length > 0.0], full_matrices=False)
    return u[:, s > RANK_TOLERANCE * max(s.max(initial=0.0), 1e-300)]


def _cosines(a: NDArray, b: NDArray) -> Reals:
    check_rows(a, b)
    known = ~(np.isnan(a).any(axis=1) | np.isnan(b).any(axis=1))
    if not known.any():
        return np.zeros(0)
    return np.linalg.svd(_basis(a[known]).conj().T @ _basis(b[known]), compute_uv=False)


def _share(model: NDArray, shape: NDArray) -> float:
    known = ~np.isnan(shape) & ~np.isnan(model).any(axis=1)
    psi = unit_largest(shape[known])
    whole = float(np.sum(np.abs(psi) ** 2))
    if whole == 0.0:
        return float("nan")
    return float(np.sum(np.abs(_basis(model[known]).conj().T @ psi) ** 2)) / whole
