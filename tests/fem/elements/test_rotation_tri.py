"""CTRIAR: patch test, published cantilever, convergence, and the moment that it carries about its normal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.fem.elements.shells.tri import membrane_rows, rotation_rows, tri_area

E, NU = 30000.0, 0.25
LAW = E / (1 - NU**2) * np.array([[1, NU, 0], [NU, 1, 0], [0, 0, (1 - NU) / 2]])


def stiffness(corners: NDArray) -> NDArray:
    """(m, 9, 9) of unit thickness on (u, v, θ) of each corner."""
    rows = rotation_rows(corners).reshape(len(corners), 3, 3, 9)
    return np.einsum("mpia,ij,mpjb->mab", rows, LAW, rows)


def test_constant_strains_and_rigid_motions() -> None:
    corners = np.array([[[0.1, 0.2], [2.0, 0.5], [0.7, 1.9]]])
    x, y = corners[0].T
    root = np.sqrt(tri_area(corners)[0] / 3.0)
    for g in (np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[0.0, -1.0], [1.0, 0.0]])):
        u, v = g[0, 0] * x + g[0, 1] * y, g[1, 0] * x + g[1, 1] * y
        turn = np.full(3, 0.5 * (g[1, 0] - g[0, 1]))
        strain = np.einsum("pica,ca->pi", rotation_rows(corners)[0], np.stack([u, v, turn], axis=1))
        np.testing.assert_allclose(strain / root, np.tile([g[0, 0], g[1, 1], g[0, 1] + g[1, 0]], (3, 1)), atol=1e-12)


def test_without_rotations_the_mean_is_the_constant_triangle() -> None:
    corners = np.array([[[0.1, 0.2], [2.0, 0.5], [0.7, 1.9]]])
    mean = rotation_rows(corners)[0, :, :, :, :2].sum(axis=0) / np.sqrt(3.0)
    np.testing.assert_allclose(mean, membrane_rows(corners)[0, 0], atol=1e-13)


def cantilever(nx: int, ny: int) -> float:
    """Deflection of the tip of 48 × 12 under a parabolic shear of 40, clamped; exact 0.3558 (Timoshenko)."""
    length, depth, force = 48.0, 12.0, 40.0
    number = lambda i, j: i * (ny + 1) + j  # noqa: E731
    xy = np.array([[length * i / nx, depth * j / ny - depth / 2] for i in range(nx + 1) for j in range(ny + 1)])
    cells = [
        (number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)) for i in range(nx) for j in range(ny)
    ]
    parts = [t for k, (a, b, c, d) in enumerate(cells) for t in ((a, b, d), (b, c, d))]
    K = np.zeros((3 * len(xy), 3 * len(xy)))
    for nodes, own in zip(parts, stiffness(xy[np.array(parts)])):
        at = np.concatenate([3 * n + np.arange(3) for n in nodes])
        K[np.ix_(at, at)] += own
    load = np.zeros(len(K))
    for j in range(ny):
        y = np.linspace(xy[number(nx, j), 1], xy[number(nx, j + 1), 1], 201)
        tau = 1.5 * force / depth * (1 - (2 * y / depth) ** 2)
        s = (y - y[0]) / (y[-1] - y[0])
        for end, share in ((number(nx, j), 1 - s), (number(nx, j + 1), s)):
            load[3 * end + 1] += np.trapezoid(tau * share, y)
    clamped = [3 * number(0, j) + k for j in range(ny + 1) for k in range(3)]
    free = np.setdiff1d(np.arange(len(K)), clamped)
    moved = np.zeros(len(K))
    moved[free] = np.linalg.solve(K[np.ix_(free, free)], load[free])
    return float(np.mean([moved[3 * number(nx, j) + 1] for j in range(ny + 1)]))


def test_the_cantilever_of_allman() -> None:
    found = np.array([cantilever(n, n // 4) for n in (4, 8, 16, 32)])
    errors = 1.0 - found / 0.3558
    assert (np.abs(errors) < [0.25, 0.085, 0.024, 0.0065]).all()
    assert (errors[:-1] / errors[1:] > 2.9).all()


def test_equal_rotations_alone_strain_nothing() -> None:
    corners = np.array([[[0.0, 0.0], [2.0, 0.0], [0.5, 1.5]]])
    own = np.linalg.eigvalsh(stiffness(corners)[0])
    assert (own < 1e-9 * own[-1]).sum() == 4  # three rigid motions, and the rotations that a weak spring holds
