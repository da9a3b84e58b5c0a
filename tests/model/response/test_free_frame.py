"""A plane free frame with modal damping: its FRFs against an assembly by hand, and one step of its superposition."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la

from femtune.model import constant_damping, damping_by_mode, solve_modes
from femtune.model.response import frf
from femtune.model.response.basis import modal_basis
from femtune.model.response.dynamic_stiffness import DynamicStiffness
from femtune.model.response.modal_damping import modal_damper
from femtune.model.response.reduced import reduce
from structures.cross_frame import DENSITY, DEPTH, WIDTH, Campaigns, E, cross_frame, frequency_lines, ports_of

RATIO = 0.02


def by_hand(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """K, M (3 DOFs a node: u, v, θ) of Euler beams with consistent mass, and the points of the nodes."""
    points: list[tuple[float, float]] = []
    bars = []
    sides = [((0, 0), (0, 0.6), 6, 2), ((1, 0), (1, 0.6), 6, 2)]
    for a, b, n, group in [((0, 0), (1, 0), 8, 0), ((0, 0.6), (1, 0.6), 8, 1), *sides, ((0.5, 0), (0.5, 0.6), 6, 3)]:
        ends = [tuple(np.round(p, 6)) for p in np.linspace(a, b, n + 1)]
        points += [p for p in ends if p not in points]
        bars += [(points.index(p), points.index(q), group) for p, q in itertools.pairwise(ends)]
    K, M = np.zeros((2, 3 * len(points), 3 * len(points)))
    A, I = WIDTH * DEPTH, WIDTH * DEPTH**3 / 12.0  # noqa: E741
    for i, j, group in bars:
        d = np.subtract(points[j], points[i])
        L = np.hypot(*d)
        c, s = d / L
        e = E * (1.0 + x[group])
        k = np.zeros((6, 6))
        k[np.ix_([0, 3], [0, 3])] = e * A / L * np.array([[1, -1], [-1, 1]])
        bend = np.array([[12, 6 * L, -12, 6 * L], [6 * L, 4 * L**2, -6 * L, 2 * L**2],
                         [-12, -6 * L, 12, -6 * L], [6 * L, 2 * L**2, -6 * L, 4 * L**2]])  # fmt: skip
        k[np.ix_([1, 2, 4, 5], [1, 2, 4, 5])] = e * I / L**3 * bend
        m = np.zeros((6, 6))
        m[np.ix_([0, 3], [0, 3])] = np.array([[140, 70], [70, 140]])
        m[np.ix_([1, 2, 4, 5], [1, 2, 4, 5])] = np.array(
            [[156, 22 * L, 54, -13 * L], [22 * L, 4 * L**2, 13 * L, -3 * L**2],
             [54, 13 * L, 156, -22 * L], [-13 * L, -3 * L**2, -22 * L, 4 * L**2]]
        )  # fmt: skip
        m *= DENSITY * A * L / 420.0
        turn = la.block_diag(*[np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])] * 2)
        at = [3 * i, 3 * i + 1, 3 * i + 2, 3 * j, 3 * j + 1, 3 * j + 2]
        K[np.ix_(at, at)] += turn.T @ k @ turn
        M[np.ix_(at, at)] += turn.T @ m @ turn
    return K, M, np.array(points)


def test_frfs_are_those_of_an_assembly_by_hand() -> None:
    model, x = cross_frame(), np.array([0.1, -0.05, 0.2, -0.1])
    K, M, points = by_hand(x)
    values, phi = la.eigh(K, M)
    assert np.abs(values[:3]).max() < 1e-6 * values[3]
    modes = solve_modes(model.at(x), 40)
    np.testing.assert_allclose(modes.eigenvalues[3:40], values[3:40], rtol=1e-7)
    ports, lines = ports_of(model), frequency_lines(RATIO)[::20]
    found = frf(
        modes, ports, lines, "accelerance", "real-modes", damping=constant_damping(RATIO), residual_vectors=False
    )

    def row(dof: object) -> int:
        xyz = model.model.structure.nodes.xyz[dof.node - 1]  # type: ignore[attr-defined]
        at = int(np.linalg.norm(points - xyz[:2], axis=1).argmin())
        return 3 * at + int(dof.direction in ("Y", "Y+"))  # type: ignore[attr-defined]

    outputs, inputs = [row(d) for d in found.responses], [row(d) for d in found.references]
    w = 2.0 * np.pi * lines
    omega = np.sqrt(np.where(np.arange(len(values)) < 3, 0.0, values))[:40]
    parts = -(w[:, None] ** 2) / (omega**2 - w[:, None] ** 2 + 2j * RATIO * omega * w[:, None])
    exact = np.einsum("om,im,km->oik", phi[outputs, :40], phi[inputs, :40], parts)
    np.testing.assert_allclose(found.values, exact, rtol=1e-6, atol=1e-8 * np.abs(exact).max())


def test_modal_damping_of_a_free_structure_couples_no_modes() -> None:
    """Rounding between rigid-body modes, which have no damping, and elastic ones must not count as damping."""
    model = cross_frame()
    modes = solve_modes(model.at(np.zeros(4)), 40)
    damper = modal_damper(modes, constant_damping(RATIO))
    reduced = reduce(DynamicStiffness(modes.point, damper), modal_basis(modes, None), ports_of(model))
    assert reduced.is_diagonal
    exact = 2.0 * RATIO * np.sqrt(np.maximum(modes.eigenvalues[3:40], 0.0))
    np.testing.assert_allclose(reduced.viscous[3:40], exact, rtol=1e-9)
    assert np.abs(reduced.viscous[:3]).max() <= 1e-12 * exact.max()


def test_campaigns_differ_by_their_noise_only() -> None:
    campaigns = replace(Campaigns(), in_band=1)
    one, other = campaigns.test(1).values, campaigns.test(2).values
    size = campaigns.floor * np.abs(campaigns.exact.values).max(axis=2, keepdims=True)
    z = np.concatenate([((v - campaigns.exact.values) / size).ravel() for v in (one, other)])
    # 4368 values: 4 σ of their variance
    assert abs(np.var(z.real) - 1.0) < 4.0 * np.sqrt(2.0 / len(z))
    assert not np.allclose(one, other)


@pytest.mark.slow
def test_modal_damping_couples_no_modes() -> None:
    """With many modes and residual vectors, whatever the rounding of their orthogonality: one matrix a line is then
    divided by, not inverted."""
    model = cross_frame()
    chance = np.random.default_rng(0)
    for _ in range(2):
        modes = solve_modes(model.at(chance.uniform(-0.3, 0.3, 4)), 40)
        ports = ports_of(model)
        ratios = np.exp(chance.uniform(np.log(0.002), np.log(0.02), 40))
        stiffness = DynamicStiffness(modes.point, modal_damper(modes, damping_by_mode(tuple(ratios))))
        forces = np.hstack([ports.inputs.toarray(), ports.outputs.T.toarray()])
        small = reduce(stiffness, modal_basis(modes, forces), ports)
        assert small.viscous.shape == (len(small.basis.mass),)
        assert np.all(small.viscous[40:] == 0.0)
