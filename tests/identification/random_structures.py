"""Beams, plates and frames of random sizes, supports, masses and damping, and their functions without noise."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.linalg import eigh

from femtune.modal import FrfSet

from .conftest import Known

Random = np.random.Generator
Modes = tuple[NDArray, NDArray]
"""ω², and displacements (places, modes)."""


def member(length: float, EI: float, EA: float) -> Modes:
    """Stiffness and consistent mass (6, 6) of a plane member of unit mass a length: u, w, θ of both ends."""
    a, b = [0, 3], [1, 2, 4, 5]
    K, M, s = np.zeros((6, 6)), np.zeros((6, 6)), length
    K[np.ix_(a, a)] = EA / s * np.array([[1, -1], [-1, 1]])
    M[np.ix_(a, a)] = s / 6 * np.array([[2, 1], [1, 2]])
    K[np.ix_(b, b)] = EI / s**3 * np.array(
        [[12, 6 * s, -12, 6 * s], [6 * s, 4 * s**2, -6 * s, 2 * s**2],
         [-12, -6 * s, 12, -6 * s], [6 * s, 2 * s**2, -6 * s, 4 * s**2]]
    )  # fmt: skip
    M[np.ix_(b, b)] = s / 420 * np.array(
        [[156, 22 * s, 54, -13 * s], [22 * s, 4 * s**2, 13 * s, -3 * s**2],
         [54, 13 * s, 156, -22 * s], [-13 * s, -3 * s**2, -22 * s, 4 * s**2]]
    )  # fmt: skip
    return K, M


def frame(points: NDArray, members: list[tuple[int, int, float]], held: list[int]) -> Modes:
    """A plane frame: points (n, 2), members with their bending stiffness, held DOFs; displacements of its points."""
    K, M = np.zeros((2, 3 * len(points), 3 * len(points)))
    for i, j, EI in members:
        length = float(np.linalg.norm(points[j] - points[i]))
        c, s = (points[j] - points[i]) / length
        T = np.kron(np.eye(2), [[c, s, 0], [-s, c, 0], [0, 0, 1]])
        at = np.ix_(*[np.r_[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]] * 2)
        for whole, own in zip((K, M), member(length, EI, 2e4)):
            whole[at] += T.T @ own @ T
    free = np.setdiff1d(np.arange(len(K)), held)
    values, vectors = eigh(K[np.ix_(free, free)], M[np.ix_(free, free)])
    shapes = np.zeros((len(K), len(values)))
    shapes[free] = vectors
    return values, shapes[np.arange(len(K)) % 3 < 2]


def random_beam(rng: Random) -> Modes:
    """Bending in two planes, the second a little stiffer; sensors look in any direction across."""
    n = 16
    points = np.column_stack([np.linspace(0, 1, n), np.zeros(n)])
    held = [[], [0, 1, 2], [1, 3 * n - 2], [0, 1, 2, 3 * n - 3, 3 * n - 2, 3 * n - 1]][rng.integers(4)]
    values, shapes = frame(points, [(i, i + 1, 1.0) for i in range(n - 1)], [*range(0, 3 * n, 3), *held])
    across, turn = shapes[1::2], rng.uniform(0.0, 2.0 * np.pi, (n, 1))
    stiffer = (1.0 + rng.choice([0.005, 0.02, 0.2])) ** 2
    return np.append(values, stiffer * values), np.hstack([across * np.cos(turn), across * np.sin(turn)])


def random_frame(rng: Random) -> Modes:
    """A portal frame of two storeys, symmetric or not, clamped or free."""
    corners = {(x, y): (float(x), 0.7 * y) for x in range(2) for y in range(3)}
    spans = [((x, y), (x, y + 1)) for x in range(2) for y in range(2)] + [((0, y), (1, y)) for y in (1, 2)]
    points: list[tuple[float, float]] = list(corners.values())
    number, members, alike = {key: i for i, key in enumerate(corners)}, [], rng.random() < 0.5
    for a, b in spans:
        own = [tuple(np.array(corners[a]) * (1 - t) + np.array(corners[b]) * t) for t in (0.25, 0.5, 0.75)]
        line = [number[a], *range(len(points), len(points) + 3), number[b]]
        points += own
        EI = 1.0 if alike else rng.uniform(0.5, 2.0)
        members += [(i, j, EI) for i, j in pairwise(line)]
    held = [] if rng.random() < 0.3 else [0, 1, 2, 9, 10, 11]
    return frame(np.array(points), members, held)


def random_plate(rng: Random) -> Modes:
    """A free Kirchhoff plate by Ritz's method in Legendre polynomials, nearly square or not, with two masses."""
    p = 10
    x, w = legendre.leggauss(p + 3)
    value = [np.array([legendre.legval(x, legendre.legder(one, d)) for one in np.eye(p)]) for d in range(3)]
    A = [[(a * w) @ b.T for b in value] for a in value]
    sx, sy, nu = 2.0, 2.0 / rng.choice([0.999, 0.9, 0.67]), 0.3
    bending = sx**4 * np.kron(A[2][2], A[0][0]) + sy**4 * np.kron(A[0][0], A[2][2])
    coupling = nu * (np.kron(A[2][0], A[0][2]) + np.kron(A[0][2], A[2][0])) + 2 * (1 - nu) * np.kron(A[1][1], A[1][1])
    K, M = bending + sx**2 * sy**2 * coupling, np.kron(A[0][0], A[0][0])
    grid = np.array([legendre.legval(np.linspace(-1, 1, 7), one) for one in np.eye(p)])
    places = np.kron(grid, grid).T
    for row in places[rng.integers(0, len(places), 2)]:
        M = M + rng.uniform(0.02, 0.2) * np.outer(row, row)
    values, vectors = eigh(K, M)
    return values, places @ vectors


@dataclass(frozen=True)
class Simulated:
    """Functions, and the modes inside their band that move at resonance by more than a thousandth of all."""

    frfs: FrfSet
    modes: Known


def simulated(kind: str, seed: int) -> Simulated:
    """A structure, with the modes outside the band or without, damping of 0.1 to 3 %, exact or rounded values."""
    rng = np.random.default_rng(seed)
    values, shapes = {"beam": random_beam, "frame": random_frame, "plate": random_plate}[kind](rng)
    elastic = np.flatnonzero(values > 1e-6 * np.median(values))
    order = elastic[np.argsort(values[elastic])]
    freq = np.sqrt(values[order])
    freq, shapes = 20.0 * freq / freq[0], shapes[:, order]
    last = int(rng.integers(4, 10))
    while freq[last + 1] < 1.05 * freq[last]:
        last += 1
    band = 0.6 * freq[0], 0.5 * (freq[last] + freq[last + 1])
    known = len(freq) if rng.random() < 0.5 else last + 1
    even = rng.random() < 0.5
    damping = 10.0 ** rng.uniform(-3.0, np.log10(0.03), 1 if even else known) * np.ones(known)
    moving = np.flatnonzero(np.linalg.norm(shapes, axis=1) > 1e-3 * np.linalg.norm(shapes, axis=1).max())
    rows = rng.choice(moving, 8, replace=False)
    whole = Known(freq[:known], damping, shapes[rows][:, :known], (0, 1))
    # elastic modes alone: what is rigid moves as a mass does, which the terms outside the band stand for
    frfs = whole.frfs(
        np.linspace(*band, int(rng.integers(500, 1000))), kind=str(rng.choice(["accelerance", "mobility"]))
    )
    return Simulated(_rounded(frfs, int(rng.integers(3))), _inside(whole, frfs, last + 1))


def _rounded(frfs: FrfSet, how: int) -> FrfSet:
    values = frfs.values
    if how == 1:
        values = values.astype(np.complex64).astype(complex)
    if how == 2:
        parts = [np.array([f"{x:.5e}" for x in part.ravel()], float) for part in (values.real, values.imag)]
        values = (parts[0] + 1j * parts[1]).reshape(values.shape)
    return FrfSet(frfs.freq_hz, values, frfs.responses, frfs.references, frfs.kind)


def _inside(whole: Known, frfs: FrfSet, count: int) -> Known:
    size = np.linalg.norm(frfs.values, axis=(0, 1))
    own = [
        np.linalg.norm(
            Known(whole.freq_hz[[r]], whole.damping_ratio[[r]], whole.shapes[:, [r]], whole.inputs)
            .frfs(np.array([whole.freq_hz[r]]), kind=frfs.kind).values
        ) / np.interp(whole.freq_hz[r], frfs.freq_hz, size)
        for r in range(count)
    ]  # fmt: skip
    some = np.flatnonzero(np.array(own) > 1e-3)
    return Known(whole.freq_hz[some], whole.damping_ratio[some], whole.shapes[:, some], whole.inputs)
