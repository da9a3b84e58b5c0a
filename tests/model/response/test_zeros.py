"""Zeros of FRFs: constrained structures, closed forms, determinants, complex steps."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

from femtune.model import ConfiguredModel, solve_modes
from femtune.model.response import frf, make_ports, zero_finder

from .models import chain, configured, matrices

SPRINGS = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0), (0, 2, 150.0)]
FACTORS = {"k": ("K", 2), "m": ("M", 3), "l": ("K", 4)}
AT = np.array([0.1, -0.2, 0.3])


def model(n: int = 4) -> ConfiguredModel:
    springs = SPRINGS if n == 4 else [(i - 1, i, 900.0 + 10 * i) for i in range(n)]
    return configured(chain(springs, [1.0, 2.0, 1.5, 1.0] * (n // 4)), FACTORS)


def test_zeros_of_a_point_function_are_the_modes_of_the_structure_held_there() -> None:
    one = model()
    modes = solve_modes(one.at(AT), 4)
    finder = zero_finder(modes, make_ports(one, ["2X+"], ["2X+"]))
    K, M, _, _ = matrices(modes.point)
    held = [0, 2, 3]
    exact = la.eigh(K[np.ix_(held, held)], M[np.ix_(held, held)], eigvals_only=True)
    found = finder.candidates(0, 0, 100.0)
    np.testing.assert_allclose(found, exact, rtol=1e-9)
    np.testing.assert_allclose([finder.refined(0, 0, mu).eigenvalue for mu in found], exact, rtol=1e-12)


def test_two_masses_by_hand() -> None:
    """k at the ground, l between: the point function of the first mass vanishes at ω² = l/m₂, the transfer nowhere."""
    one = configured(chain([(-1, 0, 900.0), (0, 1, 700.0)], [1.0, 2.0]), {"l": ("K", 2), "m": ("M", 2)})
    finder = zero_finder(solve_modes(one.at(np.zeros(2)), 2), make_ports(one, ["1X+"], ["1X+", "2X+"]))
    (mu,) = finder.candidates(0, 0, 100.0)
    zero = finder.refined(0, 0, mu)
    assert zero.eigenvalue == pytest.approx(350.0, rel=1e-12)
    assert zero.freq_hz == pytest.approx(np.sqrt(350.0) / (2 * np.pi))
    np.testing.assert_allclose(zero.gradient, [350.0, -350.0], rtol=1e-9)
    assert not finder.candidates(1, 0, 100.0).size


@pytest.mark.parametrize(("output", "reference"), [("1X+", "3X+"), ("4X+", "1X+"), ("2X-", "4X+"), ("1X+", "1X+")])
def test_functions_vanish_there_and_nowhere_else(output: str, reference: str) -> None:
    """Sign changes of the real undamped function that are no poles."""
    one = model()
    modes = solve_modes(one.at(AT), 4)
    ports = make_ports(one, [reference], [output])
    finder = zero_finder(modes, ports)
    found = [finder.refined(0, 0, mu) for mu in finder.candidates(0, 0, 12.0)]
    lines = np.linspace(0.01, 12.0, 20001)
    seen, driven = (ports.outputs @ modes.shapes)[0], (ports.inputs.T @ modes.shapes)[0]
    values = (seen * driven / (modes.eigenvalues - (2 * np.pi * lines[:, None]) ** 2)).sum(axis=1)
    changes = np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1]))
    zeros = [i for i in changes if min(abs(values[i]), abs(values[i + 1])) < 0.1 * np.abs(values).mean()]
    zeros = [i for i in zeros if not ((modes.freq_hz > lines[i] - 1e-3) & (modes.freq_hz < lines[i + 1] + 1e-3)).any()]
    np.testing.assert_allclose([z.freq_hz for z in found], lines[zeros], atol=1e-3)
    for zero in found:
        at = frf(modes.point, ports, [zero.freq_hz], "receptance", "direct").values
        assert abs(at).max() < 1e-12 * np.abs(values).max()


@pytest.mark.parametrize(("output", "reference"), [("1X+", "1X+"), ("4X+", "1X+"), ("1X+", "3X+")])
def test_derivatives_by_complex_step_of_the_bordered_problem(output: str, reference: str) -> None:
    """Standard form: the inverse of the bordered stiffness times the bordered mass has 1/μ."""
    one = model()
    modes = solve_modes(one.at(AT), 4)
    ports = make_ports(one, [reference], [output])
    finder, h = zero_finder(modes, ports), 1e-20
    b, c = ports.inputs.toarray(), ports.outputs.toarray()
    for mu in finder.candidates(0, 0, 12.0):
        zero = finder.refined(0, 0, mu)
        for i, e in enumerate(np.eye(3)):
            K, M, _, _ = matrices(one.at(AT + 1j * h * e))
            A, B = np.block([[K, b], [c, np.zeros((1, 1))]]), la.block_diag(M, 0.0)
            inverse = np.linalg.eigvals(np.linalg.solve(A, B))
            near = inverse[np.argmin(np.abs(inverse - 1 / zero.eigenvalue))]
            assert (1 / near).imag / h == pytest.approx(zero.gradient[i], rel=1e-8, abs=1e-9 * zero.eigenvalue)


def test_few_modes_are_enough_to_find_them() -> None:
    """Six modes of forty: residual vectors bring the candidates near, Newton's method the rest of the way."""
    one = model(40)
    point = one.at(AT)
    ports = make_ports(one, ["20X+"], ["20X+"])
    exact = zero_finder(solve_modes(point, 40), ports)
    few = zero_finder(solve_modes(point, 6), ports)
    top = 0.6 * few.modes.freq_hz[5]
    whole, part = exact.candidates(0, 0, top), few.candidates(0, 0, top)
    assert len(whole) == len(part) >= 3
    assert 1e-12 < np.abs(part / whole - 1.0).max() < 0.02
    np.testing.assert_allclose([few.refined(0, 0, mu).eigenvalue for mu in part], whole, rtol=1e-9)


def test_free_structures_have_zeros_too() -> None:
    """A free pair of masses: the point function vanishes at the frequency of the other on its spring."""
    one = configured(chain([(0, 1, 700.0)], [1.0, 2.0]), {"l": ("K", 1), "m": ("M", 2)})
    finder = zero_finder(solve_modes(one.at(np.zeros(2)), 2), make_ports(one, ["1X+"], ["1X+"]))
    (mu,) = finder.candidates(0, 0, 100.0)
    assert finder.refined(0, 0, mu).eigenvalue == pytest.approx(350.0, rel=1e-9)
