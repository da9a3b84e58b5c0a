"""A chain of masses on springs as a deck and as plain matrices: test plans beside independent computations.

Fourteen masses that move along X, clamped at one end and free at the other, springs of three groups whose stiffnesses
are parameters. The solution is by dense matrices, without femtune.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.linalg as la
from scipy.optimize import least_squares

from femtune.arrays import Complexes, Reals

MASSES = 14
GROUPS = ((1, 2, 3, 4, 5), (6, 7, 8, 9), (10, 11, 12, 13, 14))
"""Springs of each parameter; spring i is below mass i."""
NAMES = ("root", "middle", "tip")
BOUNDS = (0.6, 1.5)
_STIFFNESS, _MASS = 4.0e5, 2.0


def chain_deck(folder: Path) -> Path:
    """Write ``chain.bdf``: masses at grid points 2 … 15, the spring of group g has the number 100·g + i."""
    lines = ["SOL 103", "CEND", "SPC = 1", "BEGIN BULK", "SPC1,1,123456,1"]
    lines += [f"GRID,{i + 1},,{0.1 * i:.1f},0.,0.,,23456" for i in range(MASSES + 1)]
    lines += [f"CONM2,{900 + i},{i + 1},,{_mass(i)}" for i in range(1, MASSES + 1)]
    for g, springs in enumerate(GROUPS):
        lines += [f"PELAS,{g + 1},{_STIFFNESS}"]
        lines += [f"CELAS1,{100 * (g + 1) + i},{g + 1},{i},1,{i + 1},1" for i in springs]
    path = folder / "chain.bdf"
    path.write_text("\n".join([*lines, "ENDDATA", ""]), encoding="ascii")
    return path


def _mass(i: int) -> float:
    return _MASS * (1.0 + 0.05 * i)


def chain_modes(factors: Reals, count: int) -> tuple[Reals, Reals]:
    """Frequencies in Hz and mass-normalised shapes (masses, count) at factors on the three groups of springs."""
    values, shapes = la.eigh(*_matrices(factors), subset_by_index=(0, count - 1))
    return np.sqrt(values) / (2.0 * np.pi), shapes


def chain_frfs(factors: Reals, freq_hz: Reals, ratio: float) -> Complexes:
    """(masses, masses, lines) accelerances along X, all modes with one damping ratio."""
    values, shapes = la.eigh(*_matrices(factors))
    omega, own = 2.0 * np.pi * freq_hz, np.sqrt(values)[:, None]
    modal = -(omega**2) / (own**2 - omega**2 + 2j * ratio * own * omega)
    return np.asarray(np.einsum("ij,kj,jl->ikl", shapes, shapes, modal))


def _matrices(factors: Reals) -> tuple[Reals, Reals]:
    k = np.zeros(MASSES)
    for factor, springs in zip(factors, GROUPS):
        k[np.array(springs) - 1] = factor * _STIFFNESS
    K = np.diag(k + np.append(k[1:], 0.0)) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    M = np.diag([_mass(i) for i in range(1, MASSES + 1)])
    return K, M


def scatter_of_calibrations(
    masses: Reals, inputs: Reals, freq_hz: Reals, ratio: float, relative: float, floor: float, tests: int, seed: int = 0
) -> Reals:
    """(tests, 3) factors found by non-linear least squares from simulated FRFs at nominal values, in logarithms.

    Parameters
    ----------
    masses, inputs : measured and driven masses from 1
    relative, floor : standard deviation of real and imaginary parts, of the magnitude and of the largest magnitude of
        each function
    """
    at = np.ix_(np.asarray(masses, int) - 1, np.asarray(inputs, int) - 1)
    exact = chain_frfs(np.ones(3), freq_hz, ratio)[at]
    size = np.abs(exact)
    noise = floor * size.max(axis=2, keepdims=True)
    sd = np.sqrt((relative * size) ** 2 + noise**2)
    # logarithms of values that may be noise are left out
    known = size > 3.0 * noise
    rng, found = np.random.default_rng(seed), []
    for _ in range(tests):
        test = exact + sd * (rng.standard_normal(size.shape) + 1j * rng.standard_normal(size.shape))

        def residuals(x: Reals, test: Complexes = test) -> Reals:
            off = np.log(chain_frfs(x, freq_hz, ratio)[at] / test)[known] / (sd / size)[known]
            return np.concatenate([off.real, off.imag])

        found.append(least_squares(residuals, np.ones(3), x_scale=0.1, method="lm").x)
    return np.array(found)


def scatter_of_updates(
    masses: Reals, modes: Reals, frequency_sd: float, entry_sd: Reals, tests: int, seed: int = 0
) -> Reals:
    """(tests, 3) factors found by full non-linear least squares from simulated tests at nominal values.

    Parameters
    ----------
    masses, modes : measured masses from 1, and target modes from 1
    frequency_sd : relative
    entry_sd : (m,) standard deviation of a shape entry of each mode, mass-normalised
    """
    rows, columns = np.asarray(masses, int) - 1, np.asarray(modes, int) - 1
    count = int(columns.max()) + 1
    hz, shapes = chain_modes(np.ones(3), count)
    hz, shapes = hz[columns], shapes[np.ix_(rows, columns)]
    rng, found = np.random.default_rng(seed), []
    for _ in range(tests):
        test_hz = hz * (1.0 + frequency_sd * rng.standard_normal(len(hz)))
        test = shapes + entry_sd * rng.standard_normal(shapes.shape)

        def residuals(x: Reals, test_hz: Reals = test_hz, test: Reals = test) -> Reals:
            f, phi = chain_modes(x, count)
            phi = phi[np.ix_(rows, columns)]
            # each shape in its best scale
            phi = phi * (np.einsum("ij,ij->j", phi, test) / np.einsum("ij,ij->j", phi, phi))
            return np.concatenate([(f[columns] / test_hz - 1.0) / frequency_sd, ((phi - test) / entry_sd).ravel()])

        found.append(least_squares(residuals, np.ones(3), x_scale=0.1).x)
    return np.array(found)
