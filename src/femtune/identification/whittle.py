"""Maximum likelihood of modes from the Fourier transform of responses to unmeasured forces (Whittle's likelihood).

The lines Y of the transform of a long record are nearly independent complex normal vectors with the covariance

    S(ω) = D Φ h Q hᴴ Φᵀ Dᴴ c(ω) + R

with the response h_j of each mode, the shapes Φ, the spectra Q of the modal forces, which may be coherent, the noises R
of the channels, and c(ω), which is 1 for white forces. D are the time derivatives between displacements and channels.
The minimum of Σ log |S| + Yᴴ S⁻¹ Y is found by Fisher scoring; the inverse of the information is the covariance.

Sources: P. Whittle (1953), Estimation and information in stationary time series, Arkiv för Matematik 2; S.-K. Au
(2011), Fast Bayesian FFT method for ambient modal identification with separated modes, Journal of Engineering Mechanics
137; B. Li, S.-K. Au (2019), An expectation-maximization algorithm for Bayesian operational modal analysis with
multiple (possibly close) modes, Mechanical Systems and Signal Processing 132.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Complexes, Flags, Integers, Reals

_STEP = 0.15
"""Width of a bin over the distance of its first line from the nearest pole; the mean of the spectrum of one mode in it
differs from that at its middle by 0.7 % at most."""
_LEAST_GAIN = 0.03
"""Gain of the log-likelihood below which the search ends; a quarter of a standard deviation is such a gain."""
ROUNDS = 12
"""Steps of scoring at most."""


@dataclass(frozen=True, eq=False)
class SpectrumLines:
    """Mean products of the lines of a transform, over bins that are narrow beside the distance to the poles.

    Parameters
    ----------
    omega : (b,) rad/s
    count : (b,) lines in each bin
    power : (b, n, n) mean of Y Yᴴ, per Hz
    first, last : (b,) positions of the lines in the transform, the last one not included
    """

    omega: Reals
    count: Reals
    power: Complexes
    first: Integers
    last: Integers

    def select(self, keep: Flags) -> SpectrumLines:
        """Some of the bins."""
        return SpectrumLines(self.omega[keep], self.count[keep], self.power[keep], self.first[keep], self.last[keep])

    def mixed(self, by: Reals) -> SpectrumLines:
        """Of the channels `by` (r, n) times the channels."""
        return replace(self, power=by @ self.power @ by.T)


def in_bins(transform: Complexes, step_hz: float, usable: Flags, poles: Complexes, derivatives: Reals) -> SpectrumLines:
    """Bins of the usable lines of a transform (n, k) that begins at 0 Hz, finest near the poles (m,) in rad/s."""
    where = np.flatnonzero(usable)
    hz = step_hz * where
    own, half = np.abs(poles) / (2.0 * np.pi), np.abs(poles.real) / (2.0 * np.pi)
    starts, i = [0], 0
    while i < len(where):
        width = _STEP * float(np.min(np.hypot(hz[i] - own, half)))
        j = max(int(np.searchsorted(hz, hz[i] + width, side="left")), i + 1)
        gap = np.flatnonzero(np.diff(where[i:j]) > 1)
        i = i + int(gap[0]) + 1 if len(gap) else j
        starts.append(i)
    first, last = where[np.array(starts[:-1])], where[np.array(starts[1:]) - 1] + 1
    power = np.empty((len(first), len(transform), len(transform)), complex)
    for k, (a, b) in enumerate(zip(first, last)):
        # channels of different quantities with the ratios that they have at the middle of the bin: with those at each
        # line, the mean would have parts that no mode has, which are above a low noise
        one = transform[:, a:b] * (0.5 * (a + b - 1.0) / np.arange(a, b)) ** derivatives[:, None]
        power[k] = one @ one.conj().T / (b - a)
    return SpectrumLines(np.pi * step_hz * (first + last - 1.0), (last - first).astype(float), power, first, last)


@dataclass(frozen=True, eq=False)
class ModalSpectrum:
    """Model of the spectra of responses.

    Parameters
    ----------
    freq_hz, damping_ratio : (m,)
    shapes : (n, m) real
    forces : (m, m) spectra of the modal forces, symmetric
    noise : (n,) of the channels, per Hz
    derivatives : (n,) time derivatives between displacements and the channels
    size : (m,) constants by which the responses of the modes are multiplied
    unit : rad/s, of the derivatives
    colour : (c,) coefficients of log c(ω) in powers of ω/unit − 1
    """

    freq_hz: Reals
    damping_ratio: Reals
    shapes: Reals
    forces: Reals
    noise: Reals
    derivatives: Reals
    size: Reals
    unit: float
    colour: Reals

    def powers(self, omega: Reals) -> Reals:
        """(b, c) by which the coefficients of the colour are multiplied."""
        return np.asarray((omega[:, None] / self.unit - 1.0) ** np.arange(1, len(self.colour) + 1))

    def scales(self, omega: Reals) -> Complexes:
        """(b, n) D √c."""
        load = np.exp(0.5 * self.powers(omega) @ self.colour)
        return np.asarray((1j * omega[:, None] / self.unit) ** self.derivatives * load[:, None])

    def responses(self, omega: Reals) -> Complexes:
        """(b, m) h."""
        own, w = 2.0 * np.pi * self.freq_hz, omega[:, None]
        return np.asarray(self.size / (own**2 - w**2 + 2j * self.damping_ratio * own * w))

    def columns(self, omega: Reals) -> Complexes:
        """(b, n, m) D Φ h √c."""
        return np.asarray(self.scales(omega)[:, :, None] * self.shapes * self.responses(omega)[:, None, :])

    def at(self, omega: Reals) -> Complexes:
        """(b, n, n) S."""
        columns, n = self.columns(omega), np.arange(len(self.noise))
        S = (columns @ self.forces) @ columns.conj().transpose(0, 2, 1)
        S[:, n, n] += self.noise
        return np.asarray(S)


@dataclass(frozen=True, eq=False)
class SpectrumFit:
    """A spectrum at the minimum of its objective.

    Parameters
    ----------
    spectrum : the model
    objective : −log of the likelihood without its constant
    free : modes whose frequencies, damping and shapes were fitted
    covariance : (k, k) of the relative frequencies, of the relative damping ratios, and of the entries of the shapes of
        the free modes but the largest of each
    slopes : (b, n, n, 2 f) what a product Y Yᴴ − S of a line moves the relative frequencies and damping ratios by
    converged : whether the search ended by its own
    """

    spectrum: ModalSpectrum
    objective: float
    free: Integers
    covariance: Reals
    slopes: Complexes
    converged: bool


def objective(spectrum: ModalSpectrum, lines: SpectrumLines) -> float:
    """−log of the likelihood, without its constant; infinite where S is not positive."""
    try:
        lower = np.linalg.cholesky(spectrum.at(lines.omega))
    except np.linalg.LinAlgError:
        return float("inf")
    back = np.linalg.inv(lower)
    logs = 2.0 * np.log(np.einsum("bii->bi", lower).real).sum(axis=1)
    left = np.einsum("bij,bij->b", back @ lines.power, back.conj()).real
    return float(lines.count @ (logs + left))


def derivatives(spectrum: ModalSpectrum, omega: Reals, free: Integers) -> tuple[Complexes, Complexes]:
    """x and y (b, n, p) of ∂S = x yᴴ + y xᴴ, of every parameter but the colour.

    These are the logarithms of the frequencies and of the damping ratios of the free modes, the entries of their shapes
    but the largest of each, the entries of the forces on and above the diagonal, and the logarithms of the noises.
    """
    n, m = spectrum.shapes.shape
    b, w, own = len(omega), omega[:, None], 2.0 * np.pi * spectrum.freq_hz
    columns, h = spectrum.columns(omega), spectrum.responses(omega)
    loaded = columns @ spectrum.forces
    damped = 2j * spectrum.damping_ratio * own * w
    moves = (-(2.0 * own**2 + damped) * h / spectrum.size, -damped * h / spectrum.size)
    x = [columns[:, :, free] * of[:, None, free] for of in moves]
    y = [loaded[:, :, free]] * 2
    scaled = spectrum.scales(omega)
    for j in free:
        entries = _entries(spectrum, j)
        unit = np.zeros((b, n, len(entries)), complex)
        unit[:, entries, np.arange(len(entries))] = scaled[:, entries] * h[:, j : j + 1]
        x.append(unit)
        y.append(np.broadcast_to(loaded[:, :, j : j + 1], unit.shape))
    rows, cols = np.triu_indices(m)
    x += [columns[:, :, rows] * np.where(rows == cols, 0.5, 1.0)]
    y += [columns[:, :, cols]]
    x += [np.broadcast_to(np.diag(0.5 * spectrum.noise).astype(complex), (b, n, n))]
    y += [np.broadcast_to(np.eye(n, dtype=complex), (b, n, n))]
    return np.concatenate(x, axis=2), np.concatenate(y, axis=2)


def _entries(spectrum: ModalSpectrum, j: int) -> Integers:
    """Entries of a shape that are free: all but the largest."""
    return np.asarray(np.delete(np.arange(len(spectrum.shapes)), np.argmax(np.abs(spectrum.shapes[:, j]))))


def moved(spectrum: ModalSpectrum, free: Integers, by: Reals) -> ModalSpectrum:
    """With other parameters, in the order of `derivatives` and then the colour."""
    n, m = spectrum.shapes.shape
    f = len(free)
    freq, ratio, shapes = spectrum.freq_hz.copy(), spectrum.damping_ratio.copy(), spectrum.shapes.copy()
    freq[free] *= np.exp(by[:f])
    ratio[free] *= np.exp(by[f : 2 * f])
    at = 2 * f
    for j in free:
        entries = _entries(spectrum, j)
        shapes[entries, j] += by[at : at + len(entries)]
        at += len(entries)
    rows, cols = np.triu_indices(m)
    upper = np.zeros((m, m))
    upper[rows, cols] = by[at : at + len(rows)]
    forces = spectrum.forces + upper + np.triu(upper, 1).T
    at += len(rows)
    noise = spectrum.noise * np.exp(np.clip(by[at : at + n], -2.0, 2.0))
    return replace(
        spectrum, freq_hz=freq, damping_ratio=ratio, shapes=shapes, forces=forces, noise=noise,
        colour=spectrum.colour + by[at + n :],
    )  # fmt: skip


def _packed(hermitian: NDArray[Any]) -> Reals:
    """(b, n², …) of (b, n, n, …): the sum of the products of two is the trace of the product of the matrices."""
    n = hermitian.shape[1]
    rows, cols = np.triu_indices(n, 1)
    upper = np.sqrt(2.0) * hermitian[:, rows, cols]
    return np.concatenate([hermitian[:, np.arange(n), np.arange(n)].real, upper.real, upper.imag], axis=1)


def information(spectrum: ModalSpectrum, lines: SpectrumLines, free: Integers) -> tuple[Reals, Reals]:
    """(p, p) Fisher information, and (p,) gradient of the objective."""
    back = np.linalg.inv(np.linalg.cholesky(spectrum.at(lines.omega)))
    x, y = derivatives(spectrum, lines.omega, free)
    x, y = back @ x, back @ y
    b, n, _ = x.shape
    rows, cols = np.triu_indices(n, 1)
    upper = np.sqrt(2.0) * (x[:, rows] * y[:, cols].conj() + y[:, rows] * x[:, cols].conj())
    flat = np.concatenate([2.0 * (x * y.conj()).real, upper.real, upper.imag], axis=1)
    if len(spectrum.colour):
        of_load = _packed(np.eye(n) - (back * spectrum.noise) @ back.conj().transpose(0, 2, 1))
        flat = np.concatenate([flat, of_load[:, :, None] * spectrum.powers(lines.omega)[:, None, :]], axis=2)
    rest = _packed(back @ lines.power @ back.conj().transpose(0, 2, 1) - np.eye(n))
    root = np.sqrt(lines.count)[:, None]
    flat, rest = (flat * root[:, :, None]).reshape(b * n * n, -1), (rest * root).ravel()
    return np.asarray(flat.T @ flat), np.asarray(-(flat.T @ rest))


def expected(spectrum: ModalSpectrum, lines: SpectrumLines, rounds: int) -> ModalSpectrum:
    """Forces and noises after rounds of the expectation-maximisation algorithm, which never lowers the likelihood."""
    total, columns = lines.count.sum(), spectrum.columns(lines.omega)
    across = columns.conj().transpose(0, 2, 1)
    for _ in range(rounds):
        gain = spectrum.forces @ across @ np.linalg.inv(spectrum.at(lines.omega))
        back = gain.conj().transpose(0, 2, 1)
        second = spectrum.forces - gain @ columns @ spectrum.forces + gain @ lines.power @ back
        forces = np.tensordot(lines.count, second, 1).real / total
        seen = columns @ (gain @ lines.power)
        rest = np.einsum("bii->bi", lines.power - 2.0 * seen).real
        rest = rest + np.einsum("bij,bji->bi", columns @ second, across).real
        noise = np.maximum(lines.count @ rest / total, 1e-3 * spectrum.noise)
        spectrum = replace(spectrum, forces=0.5 * (forces + forces.T), noise=noise)
    return spectrum


def fit(spectrum: ModalSpectrum, lines: SpectrumLines, free: Integers, rounds: int = ROUNDS) -> SpectrumFit:
    """The minimum that Fisher scoring with Levenberg's damping finds from a start.

    Raises
    ------
    numpy.linalg.LinAlgError : where the start is no spectrum
    """
    now, damping, converged = objective(spectrum, lines), 1e-3, False
    if not np.isfinite(now):
        raise np.linalg.LinAlgError("no spectrum")
    for _ in range(rounds):
        matrix, gradient = information(spectrum, lines, free)
        scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
        unit, slope = matrix / np.outer(scale, scale), gradient / scale
        gained = 0.0
        while damping < 1e5:
            step = -np.linalg.solve(unit + damping * np.eye(len(unit)), slope) / scale
            if np.abs(step[: 2 * len(free)]).max() < 0.7:
                trial = moved(spectrum, free, step)
                value = objective(trial, lines)
                if value < now:
                    gained, spectrum, now = now - value, trial, value
                    damping = max(0.2 * damping, 1e-8)
                    break
            damping = max(5.0 * damping, 1e-6)
        if gained < _LEAST_GAIN:
            converged = True
            break
    keep = 2 * len(free) + len(free) * (len(spectrum.shapes) - 1)
    covariance, weights = _of_first(information(spectrum, lines, free)[0], keep)
    slopes = _slopes(spectrum, lines, free, weights[: 2 * len(free)])
    return SpectrumFit(spectrum, now, free, covariance, slopes, converged)


def score(found: SpectrumFit, lines: SpectrumLines, count: int) -> float:
    """Score test of a load with `count` coefficients of colour beside the white one: χ² with as many degrees."""
    spectrum = replace(found.spectrum, colour=np.zeros(count))
    matrix, gradient = information(spectrum, lines, found.free)
    turned = np.roll(np.roll(matrix, count, axis=0), count, axis=1)
    covariance, weights = _of_first(turned, count)
    slope = weights @ np.roll(gradient, count)
    return float(slope @ np.linalg.pinv(covariance, hermitian=True) @ slope)


def _of_first(matrix: Reals, keep: int) -> tuple[Reals, Reals]:
    """Covariance of the first parameters, whatever the others are, and the weights (keep, p) of the gradient."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    unit = matrix / np.outer(scale, scale)
    value, vector = np.linalg.eigh(unit[keep:, keep:])
    used = value > 1e-10 * value[-1]
    across = unit[:keep, keep:] @ (vector[:, used] / value[used]) @ vector[:, used].T
    own = np.linalg.pinv(unit[:keep, :keep] - across @ unit[keep:, :keep], rcond=1e-12, hermitian=True)
    weights = own @ np.hstack([np.eye(keep), -across])
    return own / np.outer(scale[:keep], scale[:keep]), weights / scale[:keep, None] / scale


def _slopes(spectrum: ModalSpectrum, lines: SpectrumLines, free: Integers, weights: Reals) -> Complexes:
    """S⁻¹ (Σ weights ∂S) S⁻¹ of each of the first parameters."""
    x, y = derivatives(spectrum, lines.omega, free)
    signal, n, p = spectrum.at(lines.omega), np.arange(len(spectrum.noise)), x.shape[2]
    inverse, powers = np.linalg.inv(signal), spectrum.powers(lines.omega)
    signal[:, n, n] -= spectrum.noise
    out = np.empty((*inverse.shape, len(weights)), complex)
    for i, row in enumerate(weights):
        half = (x * row[:p]) @ y.conj().transpose(0, 2, 1)
        whole = half + half.conj().transpose(0, 2, 1) + (powers @ row[p:])[:, None, None] * signal
        out[..., i] = inverse @ whole @ inverse
    return out


_SEGMENTS = 16
"""Parts of the band over which the misfit is looked at."""


def misfit(found: SpectrumFit, lines: SpectrumLines) -> float:
    """How far the means of L⁻¹ Y Yᴴ L⁻ᴴ over parts of the band are from one, S = L Lᴴ, beyond chance.

    Σ N |mean − 1|² over the parts with N lines is nearly χ² distributed; this is its distance from the degrees of
    freedom in standard deviations.
    """
    spectrum = found.spectrum
    back = np.linalg.inv(np.linalg.cholesky(spectrum.at(lines.omega)))
    white = back @ lines.power @ back.conj().transpose(0, 2, 1)
    n, m = spectrum.shapes.shape
    edges = np.unique(np.linspace(0, len(lines.omega), _SEGMENTS + 1).astype(int))
    total = 0.0
    for a, b in pairwise(edges.tolist()):
        count = lines.count[a:b]
        mean = np.tensordot(count, white[a:b], 1) / count.sum()
        total += float(count.sum() * np.sum(np.abs(mean - np.eye(n)) ** 2))
    terms = (len(edges) - 1) * n * n
    freedom = max(terms - len(found.free) * (1 + n) - m * (m + 1) // 2 - n - len(spectrum.colour), terms // 3, 1)
    return float((total - freedom) / np.sqrt(2.0 * freedom))


def spread(
    found: SpectrumFit, lines: SpectrumLines, transform: Complexes, parts: int, which: Sequence[int] | None = None
) -> Reals:
    """(2 f,) standard deviations of the relative frequencies and damping ratios by parts of the record's time.

    Each value moves by a sum of products of the record with a filtered record, of which parts of the time have parts.
    Their scatter has in it a level that is not stationary, and forces that are not normally distributed.
    """
    first = int(lines.first[0])
    size = int(lines.last[-1]) - first
    bins = [slice(a, b) for a, b in zip(lines.first - first, lines.last - first)]
    seen = np.zeros((transform.shape[0], size), complex)
    # as one quantity: all lines have the shapes of the modes then
    powers = (found.spectrum.derivatives - found.spectrum.derivatives.max())[:, None]
    step = lines.omega[0] / (0.5 * (lines.first[0] + lines.last[0] - 1.0))
    for one, a, b in zip(bins, lines.first, lines.last):
        seen[:, one] = transform[:, a:b] / (1j * step * np.arange(a, b) / found.spectrum.unit) ** powers
    scales = (1j * lines.omega / found.spectrum.unit) ** powers
    of_time, long = np.fft.ifft(seen).conj(), size // parts * parts
    sd = []
    for p in range(found.slopes.shape[3]) if which is None else which:
        moved = np.zeros_like(seen)
        for one, slope, scale in zip(bins, found.slopes[..., p], scales.T):
            moved[:, one] = scale.conj()[:, None] * (slope @ (scale[:, None] * seen[:, one]))
        products = np.einsum("ik,ik->k", of_time, np.fft.ifft(moved)).real * size
        sd.append(np.sqrt(parts) * products[:long].reshape(parts, -1).sum(axis=1).std(ddof=1))
    return np.array(sd)
