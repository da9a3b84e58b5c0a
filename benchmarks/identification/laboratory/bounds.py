"""Cramér-Rao bounds of frequencies and damping ratios: with known force, and Whittle's for responses alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from simulated import BAND, QUANTITIES, RATE, Recorded, Structure

Reals = NDArray[np.float64]
MOST_CHANNELS = 16
"""Channels up to which Whittle's bound is computed; with more it takes minutes."""


def bounds(one: Structure, test: Recorded) -> tuple[Reals, Reals]:
    """(m,) least standard deviations of frequencies in Hz and of damping ratios; NaN where they are not computed."""
    if test.force is not None:
        return _known_force(one, test)
    if len(one.shapes) > MOST_CHANNELS:
        return np.full(one.inside, np.nan), np.full(one.inside, np.nan)
    return _whittle(one, test)


def _known_force(one: Structure, test: Recorded) -> tuple[Reals, Reals]:
    """All residues, and two real terms a function for what lies outside of the band, are unknown too.

    The lines of a block are Y = H (F + ν) + N with the noises of the force and of the responses, which are white. ν is
    the same for all responses, whose noise together is N Nᴴ + |ν|² H Hᴴ.
    """
    assert test.force is not None
    m, poles = one.inside, one.poles[: one.inside]
    omega, weight = _spectrum(test)
    s = 1j * omega[:, None]
    fractions, mirrored = s**2 / (s - poles), s**2 / (s - poles.conj())
    outside = np.stack([np.ones(len(omega), complex), -(omega**2) + 0j], axis=1)
    outside /= np.abs(outside).max(axis=0)
    basis = weight[:, None] * np.hstack([fractions + mirrored, 1j * (fractions - mirrored), outside])
    span, _ = np.linalg.qr(_real(basis / np.linalg.norm(basis, axis=0)))
    k, n = len(omega), len(one.shapes)
    own = 2.0 * np.pi * one.freq_hz * np.sqrt(1.0 - one.damping_ratio**2)
    # the lines of a block have half of samples · variance in each part
    samples = 0.5 * (test.blocks[0][1] - test.blocks[0][0])
    slopes, loaded = np.empty((n, k, 2 * m), complex), np.empty((n, k), complex)
    for f, (shape, sd) in enumerate(zip(one.shapes, test.noise_sd)):
        residues = shape * one.shapes[0] / (2j * own)
        first = residues[:m] * s**2 / (s - poles) ** 2
        second = residues[:m].conj() * s**2 / (s - poles.conj()) ** 2
        moved = _real(weight[:, None] * np.hstack([first + second, 1j * (first - second)]))
        moved -= span @ (span.T @ moved)
        slopes[f] = (moved[:k] + 1j * moved[k:]) / np.sqrt(samples * sd**2)
        every = residues * s**2 / (s - one.poles) + residues.conj() * s**2 / (s - one.poles.conj())
        loaded[f] = every.sum(axis=1) / np.sqrt(samples * sd**2)
    information = np.einsum("fka,fkb->ab", slopes.conj(), slopes, optimize=True).real
    information = _with_force(information, slopes, span[:k] + 1j * span[k:], loaded, samples * test.force_sd**2)
    return _of_poles(_inverse(information, keep=2 * m), poles)


def _with_force(
    information: Reals,
    slopes: NDArray[np.complex128],
    span: NDArray[np.complex128],
    loaded: NDArray[np.complex128],
    force: float,
) -> Reals:
    """The information on poles and columns beside the noise of the force; lines with less than 1 % of it have none."""
    g = np.sum(np.abs(loaded) ** 2, axis=0)
    kept = np.flatnonzero(force * g > 0.01)
    root = np.sqrt(force / (1.0 + force * g[kept]))
    to_poles = root[:, None] * np.einsum("fk,fka->ka", loaded[:, kept].conj(), slopes[:, kept])
    to_columns = (root * loaded[:, kept].conj()).T[:, :, None] * span[kept, None, :]
    shared = _real(np.hstack([to_poles, to_columns.reshape(len(kept), len(loaded) * span.shape[1])]))
    every = np.eye(shared.shape[1])
    every[: len(information), : len(information)] = information
    return np.asarray(every - shared.T @ shared)


def _spectrum(test: Recorded) -> tuple[Reals, Reals]:
    """Lines in the band, rad/s, and the size that the force of all blocks together has there."""
    begin, end = test.blocks[0]
    hz = np.fft.rfftfreq(end - begin, 1.0 / RATE)
    inside = (hz >= BAND[0]) & (hz <= BAND[1])
    power = sum(np.abs(np.fft.rfft(test.force[a:b])) ** 2 for a, b in test.blocks)
    return 2.0 * np.pi * hz[inside], np.sqrt(power[inside])


def _of_poles(covariance: Reals, poles: NDArray[np.complex128]) -> tuple[Reals, Reals]:
    m, size = len(poles), np.abs(poles)
    of_freq = np.hstack([np.diag(poles.real / size), np.diag(poles.imag / size)]) / (2.0 * np.pi)
    # ζ = −Re λ/|λ|
    of_ratio = np.hstack([np.diag(-(poles.imag**2) / size**3), np.diag(poles.real * poles.imag / size**3)])
    both = [np.sqrt(np.einsum("ij,jk,ik->i", J, covariance, J)) for J in (of_freq, of_ratio)]
    assert all(len(b) == m for b in both)
    return both[0], both[1]


def _whittle(one: Structure, test: Recorded) -> tuple[Reals, Reals]:
    """S(ω) = D Φ h Q hᴴ Φᵀ Dᴴ + noise; shapes, spectra of the modal forces and noise levels are unknown too.

    Information: T ∫ tr(S⁻¹ ∂S S⁻¹ ∂S) df over the band.
    """
    n, m = len(one.shapes), len(one.freq_hz)
    forces = one.forced @ one.forced.T / RATE
    power = np.array([QUANTITIES.index(q) for q in test.quantities], float)
    lines, widths = _quadrature(one)
    information = 0.0
    duration = test.responses.shape[1] / RATE
    rows, columns = np.triu_indices(m)
    own, ratio = 2.0 * np.pi * one.freq_hz, one.damping_ratio
    for hz, width in zip(lines, widths):
        w = 2.0 * np.pi * hz
        below = own**2 - w**2 + 2j * ratio * own * w
        h = -(w**2) / below
        scaled = (1j * w) ** (-power)
        seen = scaled[:, None] * one.shapes
        loaded = seen * h
        inner = forces @ loaded.conj().T
        S = loaded @ inner + np.diag(test.noise_sd**2 / RATE)
        L = np.linalg.inv(np.linalg.cholesky(S))
        parts = []
        for dh in (-h * (2.0 * own + 2j * ratio * w) / below * 2.0 * np.pi, -h * 2j * own * w / below):
            half = np.einsum("im,m,mj->mij", seen, dh, inner)[: one.inside]
            parts.append(half + half.conj().transpose(0, 2, 1))
        unit = np.zeros((n * m, n, n), complex)
        for i in range(n):
            unit[np.arange(m) * n + i, i] = scaled[i] * (h[:, None] * inner)
        parts.append(unit + unit.conj().transpose(0, 2, 1))
        pair = np.einsum("ik,jk->kij", loaded[:, rows], loaded[:, columns].conj())
        parts.append(0.5 * (pair + pair.conj().transpose(0, 2, 1)))
        noise = np.zeros((n, n, n), complex)
        noise[np.arange(n), np.arange(n), np.arange(n)] = 1.0
        parts.append(noise)
        white = (L @ np.concatenate(parts) @ L.conj().T).reshape(-1, n * n)
        flat = np.hstack([white.real, white.imag])
        information = information + duration * width * (flat @ flat.T)
    k = one.inside
    sd = np.sqrt(np.diag(_inverse(information, keep=2 * k)))
    return sd[:k], sd[k : 2 * k]


def _quadrature(one: Structure) -> tuple[Reals, Reals]:
    """Lines over the band, dense at the modes, and what each stands for."""
    turns = np.tan(np.linspace(-1.45, 1.45, 31))
    at = [f * (1.0 + z * turns) for f, z in zip(one.freq_hz, one.damping_ratio)]
    edges = np.unique(np.concatenate([np.linspace(*BAND, 60), *at]))
    edges = edges[(edges >= BAND[0]) & (edges <= BAND[1])]
    return 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)


def _inverse(information: Reals, keep: int = 0) -> Reals:
    """The covariance; with `keep` of the first parameters, whatever the others are that the data do not tell apart."""
    size = np.sqrt(np.diag(information))
    scaled = information / np.outer(size, size)
    if keep:
        rest = scaled[keep:, keep:]
        value, vector = np.linalg.eigh(rest)
        used = value > 1e-11 * value[-1]
        across = vector[:, used].T @ scaled[keep:, :keep]
        scaled = scaled[:keep, :keep] - across.T @ (across / value[used, None])
        size = size[:keep]
    return np.asarray(np.linalg.pinv(scaled, rcond=1e-13, hermitian=True) / np.outer(size, size))


def _real(columns: NDArray[np.complex128]) -> Reals:
    return np.concatenate([columns.real, columns.imag])
