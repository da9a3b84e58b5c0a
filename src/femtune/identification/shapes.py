"""A modal fit as a ModeSet, with the covariance of what it holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Complexes, Flags, Reals
from femtune.dofs import DofSet
from femtune.errors import Notice
from femtune.identification.modal_fit import ModalFit
from femtune.identification.mode_checks import ModeRemark, collinearity_remarks, damping_remarks, mass_remarks
from femtune.modal import FrfSet, ModeSet, freq_and_damping
from femtune.modal.shape_criteria import turn_to_real_axis
from femtune.testdata.checks import mean_phase_deviation_deg, phase_collinearity

# ----------------------------------------------------------------------------------------------------
# Shapes out of residues: one vector a mode, real if wanted, scaled by driving points, with standard deviations.


SURE_OF_SIGN = 4.0
"""Standard deviations below zero from which a modal mass is negative: there are many modes and tests."""


@dataclass(frozen=True)
class DrivingPoint:
    """A reference whose motion is measured too: positions of response and reference, and the product of their signs."""

    response: int
    reference: int
    sign: float


@dataclass(frozen=True, eq=False)
class ScaledShapes:
    """Shapes of a fit.

    Parameters
    ----------
    shapes : (n, m) real or complex
    sd : (n, m) √E|error|²
    mass_normalised : whether driving points gave the scale; else the largest entry of each shape is 1
    mass_sign : (m,) real part of R_dd·2iω_d over its modulus, at the driving points: 1 for a real mode, negative where
        force and motion have opposite signs; NaN without a driving point, and where noise may have made it negative
    rank_share : (m,) share of a residue matrix that one shape explains, 1 for one reference
    """

    shapes: NDArray
    sd: Reals
    mass_normalised: bool
    mass_sign: Reals
    rank_share: Reals


def driving_points(frfs: FrfSet) -> tuple[DrivingPoint, ...]:
    """Every reference whose DOF is among the responses."""
    points = []
    for j, dof in enumerate(frfs.references):
        if dof in frfs.responses:
            at, sign = DofSet([dof]).align(frfs.responses)
            points.append(DrivingPoint(int(at[0]), j, float(sign[0])))
    return tuple(points)


def scaled_shapes(fit: ModalFit, points: Sequence[DrivingPoint] = (), real: bool = True) -> ScaledShapes:
    """Shapes of every mode of a fit.

    A residue matrix is R = ψ ψ_refᵀ / a. Its leading singular vector is ψ but for a factor α; a = 2iω_d, which is the
    scale of a real mode of unit modal mass, asks that α² u u_refᵀ = 2iω_d R, and α² is its least-squares solution over
    all responses and the references that are driving points.

    Parameters
    ----------
    points : driving points; without any the largest entry is scaled to 1
    real : turn each shape to the phase in which it is most nearly real, and keep the real part
    """
    m = len(fit.poles)
    made = _scaled(np.moveaxis(fit.residues, 2, 0), fit.poles, points, real)
    sd = [_sd(fit, r, points, real) for r in range(m)]
    return ScaledShapes(
        made.T,
        np.column_stack(sd),
        bool(points),
        np.array([_mass_sign(fit, r, points) for r in range(m)]),
        np.array([_rank_share(fit.residues[:, :, r]) for r in range(m)]),
    )


def _scaled(residues: NDArray, poles: NDArray, points: Sequence[DrivingPoint], real: bool) -> NDArray:
    """(s, n) the scaled shapes of residue matrices (s, n, u) and their poles (s,)."""
    # one column a shape from here on
    leading = _leading(residues).T
    turned = leading * turn_to_real_axis(leading)
    u: NDArray = turned.real if real else turned
    largest = np.take_along_axis(u, np.abs(u).argmax(axis=0)[None], axis=0)[0]
    if not points:
        return np.asarray((u / largest).T)
    square = _square_of_scale(u, residues, poles, points)
    scale = np.sqrt(np.abs(square.real)) if real else np.sqrt(square)
    return np.asarray((scale * u * np.where(largest.real < 0.0, -1.0, 1.0)).T)


def _leading(residues: NDArray) -> Complexes:
    """(s, n) leading left singular vectors: references are few, and so are the rows of RᴴR."""
    _, n, u = residues.shape
    adjoint = residues.conj().swapaxes(1, 2)
    if u > n:
        return np.asarray(np.linalg.eigh(residues @ adjoint)[1][:, :, -1])
    leading = (residues @ np.linalg.eigh(adjoint @ residues)[1][:, :, -1:])[:, :, 0]
    return np.asarray(leading / np.linalg.norm(leading, axis=1, keepdims=True))


def _square_of_scale(u: NDArray, residues: NDArray, poles: NDArray, points: Sequence[DrivingPoint]) -> Complexes:
    """(s,) α² of least squares of α² u_i u_d = 2iω_d R_id, for shapes u (n, s)."""
    model = np.concatenate([u * u[p.response] * p.sign for p in points])
    wanted = np.concatenate([2j * poles.imag * residues[:, :, p.reference].T for p in points])
    return np.asarray(np.sum(model.conj() * wanted, axis=0) / np.sum(np.abs(model) ** 2, axis=0))


def _mass_sign(fit: ModalFit, r: int, points: Sequence[DrivingPoint]) -> float:
    omega = float(fit.poles[r].imag)
    signs = [2j * omega * complex(fit.residues[p.response, p.reference, r]) * p.sign for p in points]
    size = sum(abs(x) for x in signs)
    if not size:
        return float("nan")
    real = sum(x.real for x in signs)
    if real < 0.0:
        # a mode whose node is at the driving point moves the other responses, and has no sign there
        own = sum(fit.own_covariance[p.response, p.reference, r, 1, 1] for p in points)
        shared = sum(p.sign * fit.pole_effect[p.response, p.reference, r, 1] for p in points)
        sd = 2.0 * omega * float(np.sqrt(own + shared @ fit.pole_covariance @ shared))
        if real > -SURE_OF_SIGN * sd:
            return float("nan")
    return float(real / size)


def _rank_share(residue: Complexes) -> float:
    s = np.linalg.svd(residue, compute_uv=False)
    return float(s[0] ** 2 / np.sum(s**2)) if s[0] else float("nan")


def _sd(fit: ModalFit, r: int, points: Sequence[DrivingPoint], real: bool) -> Reals:
    """First order: errors of residues that each function has of its own, and of the poles, which all share."""
    by_residue, by_pole = _slopes(fit.residues[:, :, r], fit.poles[r], points, real)
    m = len(fit.poles)
    residue_variance = np.einsum(
        "ncap,cpq,ncaq->n", by_residue, _flat(fit.own_covariance[:, :, r]), by_residue, optimize=True
    )
    shared = np.einsum("ncap,cpx->nax", by_residue, _flat(fit.pole_effect[:, :, r]), optimize=True)
    shared[:, :, [r, m + r]] += by_pole
    return np.sqrt(residue_variance + np.einsum("nax,xy,nay->n", shared, fit.pole_covariance, shared, optimize=True))


def _flat(array: Reals) -> Reals:
    return array.reshape(-1, *array.shape[2:])


def _slopes(residue: Complexes, pole: complex, points: Sequence[DrivingPoint], real: bool) -> tuple[Reals, Reals]:
    """Derivatives of a shape by (Re R, Im R) of each function, (n, functions, 2, 2), and by (Re λ, Im λ), (n, 2, 2).

    Central differences; the second last axis is real and imaginary part of the shape.
    """
    base = _scaled(residue[None], np.array([pole]), points, real)[0]
    n, u = residue.shape
    step, move = 1e-6 * np.abs(residue).max(), 1e-6 * abs(pole)
    units, still = np.array([1.0, 1j]), np.zeros(2)
    by_residue = np.zeros((n, n, u, 2, 2))
    for i in range(n):
        # a response at a time: all of them together are large where there are many
        changes = np.zeros((u, 2, n, u), complex)
        changes[range(u), :, i, range(u)] = step * units
        slopes = _differences(base, residue, changes.reshape(2 * u, n, u), pole, np.tile(still, u), points, real)
        by_residue[:, i] = slopes.reshape(n, 2, u, 2).transpose(0, 2, 1, 3) / (2.0 * step)
    unchanged = np.zeros((2, n, u))
    by_pole = _differences(base, residue, unchanged, pole, move * units, points, real) / (2.0 * move)
    return by_residue.reshape(n, n * u, 2, 2), by_pole


def _differences(
    base: NDArray,
    residue: Complexes,
    changes: NDArray,
    pole: complex,
    moves: NDArray,
    points: Sequence[DrivingPoint],
    real: bool,
) -> Reals:
    """(n, 2, s) difference of the two sides of each of s changes (s, n, u) and moves (s,) of the pole.

    Real and imaginary parts, with the sign of the shape in the middle.
    """
    sides = [_scaled(residue + s * changes, pole + s * moves, points, real) for s in (1.0, -1.0)]
    if points:
        sides = [side * np.sign((side @ base.conj()).real)[:, None] for side in sides]
    else:
        # the largest entry stays 1, even where another one is as large
        largest = np.argmax(np.abs(base))
        sides = [side / side[:, [largest]] for side in sides]
    gap = sides[0] - sides[1]
    return np.stack([gap.T.real, gap.T.imag], axis=1)


NOT_ONE_SHAPE = 0.95
"""Residues of several references that one shape explains to less than this share are more than one mode, or wrong."""
NOT_QUITE_ONE = 0.98
"""The same for a larger share, if noise does not explain what is left."""
BEYOND_NOISE = 10.0
"""What is left relative to what errors of the residues alone leave, beyond which noise does not explain it."""


NO_NOISE = 1e-5
"""Misfit of functions relative to their size, below which they were not measured. Good measurements have 1e-4."""
NO_NOISE_LINES = 5e-6
"""Noise from line to line, likewise. Values that were written with six digits have 1e-6."""
LARGE_SPREAD = 4.0
"""Spread of a pole between the functions above which it is reported."""


def as_modes(fit: ModalFit, real: bool = True, labels: tuple[str, ...] = ()) -> ModeSet:
    """Frequencies, damping ratios, shapes and modal scale, with their covariance.

    Parameters
    ----------
    real : real shapes; complex ones where false
    labels : names of the modes, else they are counted

    Returns
    -------
    the modes that are reported: mass-normalised where a reference is among the responses (``modal_a`` is 2iω_d then),
    else scaled to 1 at the largest entry, without ``modal_a``
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
    modes = ModeSet(
        freq,
        shapes,
        fit.measured.responses,
        (),
        damping,
        "mass" if made.mass_normalised else "unit-max",
        freq_sd_hz=sd[:m],
        shapes_sd=shapes_sd,
        source=fit.measured.source,
        damping_sd=sd[m:],
        covariance=covariance,
        modal_a=modal_a if made.mass_normalised else None,
    ).select_modes(fit.reported)
    return replace(modes, labels=labels)


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


def leading_shapes(fit: ModalFit) -> Complexes:
    """(n, m) complex shapes of the modes that are reported, the leading singular vectors of the residues."""
    residues = fit.residues[:, :, fit.reported]
    return np.stack(
        [np.linalg.svd(residues[:, :, r], full_matrices=False)[0][:, 0] for r in range(residues.shape[2])], axis=1
    )


def fit_remarks(fit: ModalFit, made: ScaledShapes, noise_only: Sequence[bool] | None = None) -> tuple[ModeRemark, ...]:
    """Remarks on the modes that are reported: damping, complex shapes, wrong signs, functions that disagree.

    Parameters
    ----------
    noise_only : of each pole from which the fit started, whether it leaves noise only near its end
    """
    inside = fit.reported
    freq, damping = freq_and_damping(fit.poles[inside])
    damping_sd = np.sqrt(np.diag(freq_damping_covariance(fit)))[len(inside) :][inside]
    shapes = leading_shapes(fit).T
    collinearity, deviation = ([f(s) for s in shapes] for f in (phase_collinearity, mean_phase_deviation_deg))
    known = None if noise_only is None else [noise_only[b] for b in fit.begun_at[inside].tolist()]
    remarks = [
        *damping_remarks(freq, damping, damping_sd, known),
        *collinearity_remarks(freq, collinearity, deviation),
        *mass_remarks(freq, made.mass_sign[inside]),
    ]
    beyond, no_noise = _beyond_noise(fit)[inside], without_noise(fit)
    for r, (f, share, spread) in enumerate(zip(freq, made.rank_share[inside], fit.spread[inside])):
        if share < (NOT_QUITE_ONE if beyond[r] else NOT_ONE_SHAPE):
            notice = Notice("identify.references-disagree", frequency_hz=float(f), share=float(share))
            remarks.append(ModeRemark(r, notice))
        if spread > LARGE_SPREAD and not no_noise:
            notice = Notice("identify.functions-disagree", frequency_hz=float(f), times=float(np.sqrt(spread)))
            remarks.append(ModeRemark(r, notice))
    if fit.by_parts is not None and fit.by_noise is not None and fit.by_force is not None:
        parts = zip(freq, fit.by_parts[inside], fit.by_noise[inside], fit.by_force[inside])
        for r, (f, times, noise, (change, ratio)) in enumerate(parts):
            if times > 1.0:
                said: dict[str, Any] = {"frequency_hz": float(f), "times": float(times), "wider": float(1.0 / noise)}
                if np.isfinite(change):
                    said |= {"percent": 100.0 * float(change), "ratio": float(ratio)}
                    remarks.append(ModeRemark(r, Notice("identify.parts-disagree/force", **said)))
                else:
                    remarks.append(ModeRemark(r, Notice("identify.parts-disagree", **said)))
    return tuple(sorted(remarks, key=lambda remark: remark.mode))


def without_noise(fit: ModalFit) -> bool:
    """Whether functions without stated standard deviations have less noise than any measurement.

    By what the fit leaves, and by fourth differences from line to line at the middle of the lines, which noise has and
    a sum of modes between its resonances has not.
    """
    if np.isfinite(fit.misfit):
        return False
    values = fit.measured.values
    size = np.sqrt(np.mean(np.abs(values) ** 2, axis=2))
    moving = size > 0.0
    if not moving.any():
        return False
    left = np.median(fit.sd[moving] / size[moving])
    rough = np.median(np.abs(np.diff(values[moving], 4, axis=1)), axis=1) / np.sqrt(70.0)
    return bool(left < NO_NOISE or np.median(rough / np.median(np.abs(values[moving]), axis=1)) < NO_NOISE_LINES)


def _beyond_noise(fit: ModalFit) -> Flags:
    """(m,) Whether what one shape leaves of the residues is more than their own errors."""
    left = [np.sum(np.linalg.svd(residue, compute_uv=False)[1:] ** 2) for residue in np.moveaxis(fit.residues, 2, 0)]
    noise = np.einsum("numaa->m", fit.own_covariance)
    return np.asarray(left > BEYOND_NOISE * noise)
