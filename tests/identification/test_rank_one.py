"""Residues of rank one: exact derivatives, the least sum of squares, and a report on how the iteration ended."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares
from tests.messages.shown import check_shown

from femtune.dofs import DofSet
from femtune.identification import InputKnown, identify_frfs, rank_one, residual_poles, system_fit
from femtune.identification.rank_one import rank_one_problem
from femtune.identification.shapes import DrivingPoint
from femtune.modal import FrfSet, StateSpace, pole_of

_BAND = (10.0, 50.0)


class _Made(NamedTuple):
    frfs: FrfSet
    poles: NDArray
    shapes: NDArray
    participations: NDArray
    direct: NDArray


def _random_system(seed: int, largest: bool) -> _Made:
    """3 to 6 modes in the band, 1 or 2 below and above, 4 to 12 responses, noise of 0.1 to 10 %; else smaller."""
    rng = np.random.default_rng(seed)
    low, inside, high = rng.integers(1, 3), rng.integers(3, 7 if largest else 5), rng.integers(1, 3)
    n, u = rng.integers(4, 13 if largest else 7), rng.integers(1, 4) if largest else 2
    freq = np.concatenate([rng.uniform(3.0, 9.0, low), rng.uniform(11.0, 49.0, inside), rng.uniform(52.0, 90.0, high)])
    poles = pole_of(freq, rng.uniform(0.003, 0.03, len(freq)))
    shapes = rng.standard_normal((n, len(freq))) * np.exp(0.1j * rng.standard_normal((n, len(freq))))
    participations = rng.standard_normal((len(freq), u)) * (poles.imag / 2j)[:, None]
    direct = rng.standard_normal((n, u))
    lines = np.linspace(*_BAND, 60)
    values = _values(lines, poles, shapes, participations, direct)
    noise = rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape)
    values = values + 10.0 ** rng.uniform(-3.0, -1.0) * np.sqrt(np.mean(np.abs(values) ** 2) / 2.0) * noise
    responses, references = (DofSet.parse(f"{i + first}Z+" for i in range(c)) for first, c in ((1, n), (101, u)))
    frfs = FrfSet(lines, values, responses, references, "accelerance")
    return _Made(frfs, poles, shapes, participations, direct)


def _values(lines: NDArray, poles: NDArray, shapes: NDArray, participations: NDArray, direct: NDArray) -> NDArray:
    residues = np.einsum("ir,rj->ijr", shapes, participations)
    s = 2j * np.pi * lines[:, None]
    both = residues @ (1.0 / (s - poles)).T + residues.conj() @ (1.0 / (s - poles.conj())).T
    return np.asarray(both + direct[:, :, None])


def _squares(frfs: FrfSet, values: NDArray) -> float:
    mean = np.mean(np.abs(frfs.values) ** 2, axis=(1, 2), keepdims=True)
    return float(np.sum(np.abs(values - frfs.values) ** 2 / mean))


class _Joint:
    """All shapes, participations and direct terms at once, line by line; nothing is eliminated or compressed."""

    def __init__(self, made: _Made) -> None:
        self.made = made
        self.n, self.u, _ = made.frfs.values.shape
        self.m = len(made.poles)
        self.size = np.abs(made.poles)
        self.root = np.sqrt(np.mean(np.abs(made.frfs.values) ** 2, axis=(1, 2), keepdims=True))
        s = 2j * np.pi * made.frfs.freq_hz[:, None]
        self.up, self.down = self.size / (s - made.poles), self.size / (s - made.poles.conj())

    def parts(self, x: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        a, b = self.n * self.m, self.m * self.u
        psi = (x[:a] + 1j * x[a : 2 * a]).reshape(self.n, self.m)
        part = (x[2 * a : 2 * a + b] + 1j * x[2 * a + b : 2 * a + 2 * b]).reshape(self.m, self.u)
        return psi, part, x[2 * a + 2 * b :].reshape(self.n, self.u)

    def unknowns(self, psi: NDArray, part: NDArray, direct: NDArray) -> NDArray:
        scaled = part / self.size[:, None]
        return np.concatenate(
            [psi.real.ravel(), psi.imag.ravel(), scaled.real.ravel(), scaled.imag.ravel(), direct.ravel()]
        )

    def errors(self, x: NDArray) -> NDArray:
        psi, part, direct = self.parts(x)
        values = _values(self.made.frfs.freq_hz, self.made.poles, psi, part * self.size[:, None], direct)
        gap = (values - self.made.frfs.values) / self.root
        return np.concatenate([gap.real.ravel(), gap.imag.ravel()])

    def jacobian(self, x: NDArray) -> NDArray:
        psi, part, _ = self.parts(x)
        n, u, m, k = self.n, self.u, self.m, len(self.up)
        of_psi = np.zeros((n, u, k, 2, n, m), complex)
        of_part = np.zeros((n, u, k, 2, m, u), complex)
        of_direct = np.zeros((n, u, k, n, u), complex)
        for i in range(n):
            for j in range(u):
                a, b = self.up * part[:, j], self.down * part[:, j].conj()
                of_psi[i, j, :, 0, i], of_psi[i, j, :, 1, i] = a + b, 1j * (a - b)
                a, b = self.up * psi[i], self.down * psi[i].conj()
                of_part[i, j, :, 0, :, j], of_part[i, j, :, 1, :, j] = a + b, 1j * (a - b)
                of_direct[i, j, :, i, j] = 1.0
        J = np.concatenate([d.reshape(n, u, k, -1) for d in (of_psi, of_part, of_direct)], axis=3)
        J = (J / self.root[..., None]).reshape(n * u * k, -1)
        return np.concatenate([J.real, J.imag])

    def optimum(self, starts: int) -> float:
        """Least sum of squares from the truth and from points about it."""
        rng, best = np.random.default_rng(0), np.inf
        truth = self.unknowns(self.made.shapes, self.made.participations, self.made.direct)
        for start in range(starts):
            x = truth * (1.0 + 0.3 * (start > 0) * rng.standard_normal(truth.shape))
            found = least_squares(self.errors, x, self.jacobian, method="lm", max_nfev=100)
            best = min(best, 2.0 * found.cost)
        return best


def _check_optimum(made: _Made, starts: int) -> None:
    fit = system_fit(made.frfs, made.poles)
    assert fit.converged
    assert fit.gradient < 1e-4
    assert _squares(made.frfs, fit.system.frf(made.frfs.freq_hz).values) < 1.01 * _Joint(made).optimum(starts)


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.slow
def test_the_sum_of_squares_is_that_of_a_joint_solution(seed: int) -> None:
    _check_optimum(_random_system(seed, largest=False), 2)


@pytest.mark.quick(2, rest="long")
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_the_sum_of_squares_is_least(seed: int) -> None:
    _check_optimum(_random_system(seed, largest=True), 3)


@pytest.mark.parametrize("seed", [1, 11])
@pytest.mark.slow
def test_residual_modes_at_assumed_frequencies_end_in_the_least_sum(seed: int) -> None:
    """Shapes and participations solved in turn, 50 times, end 2.5 and 2.2 times above it."""
    made = _random_system(seed, largest=False)
    inside = (made.poles.imag > 2.0 * np.pi * _BAND[0]) & (made.poles.imag < 2.0 * np.pi * _BAND[1])
    poles = np.concatenate([made.poles[inside], residual_poles(_BAND)])
    rng = np.random.default_rng(seed)
    shapes = np.hstack([made.shapes[:, inside], rng.standard_normal((len(made.shapes), 3))])
    participations = np.vstack([made.participations[inside], 100.0 * rng.standard_normal((3, 2))])
    _check_optimum(_Made(made.frfs, poles, shapes, participations, made.direct), 4)


@pytest.mark.parametrize("reciprocal", [False, True])
def test_the_derivative_is_that_of_differences(reciprocal: bool) -> None:
    """Of functions that have different lines, so that there are several groups of responses."""
    made = _random_system(3, largest=False)
    values = made.frfs.values.copy()
    values[0, 1, :7] = values[2, :, 20:24] = np.nan
    s = 2j * np.pi * made.frfs.freq_hz[:, None]
    up, down = 1.0 / (s - made.poles), 1.0 / (s - made.poles.conj())
    columns = np.hstack([up + down, 1j * (up - down)])
    points = (DrivingPoint(2, 0, -1.0), DrivingPoint(1, 1, 1.0)) if reciprocal else ()
    problem = rank_one_problem(dataclasses.replace(made.frfs, values=values), columns, True, points)
    rng = np.random.default_rng(0)
    at, move = ([1.0, 1j] @ rng.standard_normal((2, made.participations.size)) for _ in range(2))
    at, move = at.reshape(made.participations.shape), move.reshape(made.participations.shape)
    slope = np.tensordot(problem.jacobian(at), np.stack([move.real, move.imag]), 3)
    h = 1e-5
    differences = (problem.errors(at + h * move) - problem.errors(at - h * move)) / (2.0 * h)
    np.testing.assert_allclose(slope, differences, atol=1e-7 * np.abs(slope).max())


def test_the_certificate_is_the_gradient_of_the_whole_problem() -> None:
    """The errors' projection on all columns, those of shapes and direct terms included."""
    made = _random_system(1, largest=False)
    fit, joint = system_fit(made.frfs, made.poles), _Joint(made)
    m = len(made.poles)
    shapes = (fit.system.C[:, ::2] - 1j * fit.system.C[:, 1::2]) / 2.0
    participations = fit.system.B[::2] + 1j * fit.system.B[1::2]
    assert participations.shape == (m, 2)
    x = joint.unknowns(shapes, participations, fit.system.D)
    U, s, _ = np.linalg.svd(joint.jacobian(x), full_matrices=False)
    errors = joint.errors(x)
    along = U[:, s > 1e-10 * s[0]].T @ errors
    assert np.linalg.norm(along) / np.linalg.norm(errors) == pytest.approx(fit.gradient, abs=1e-6)


@pytest.mark.slow
def test_a_reciprocal_system_is_as_near_as_a_free_one(eight_modes: Any) -> None:
    """The structure is reciprocal, and what is tied takes only a small part of the noise."""
    frfs = eight_modes.frfs(np.linspace(5.0, 62.0, 300), noise=0.01)
    poles = np.concatenate([pole_of(eight_modes.freq_hz, eight_modes.damping_ratio), residual_poles((5.0, 62.0))])
    free, tied = (system_fit(frfs, poles, reciprocal=r) for r in (False, True))
    assert free.converged
    assert tied.converged
    squares = [_squares(frfs, f.system.frf(frfs.freq_hz).values) for f in (free, tied)]
    assert squares[0] < squares[1] < 1.01 * squares[0]


def test_one_reference_is_linear(three_modes: Any) -> None:
    fit = system_fit(three_modes.frfs(np.linspace(5.0, 30.0, 100)), pole_of(three_modes.freq_hz, [0.01, 0.015, 0.02]))
    assert isinstance(fit.system, StateSpace)
    assert (fit.converged, fit.steps, fit.gradient) == (True, 0, 0.0)


@pytest.mark.parametrize("level", [0.0, 2.3])
@pytest.mark.parametrize("reciprocal", [False, True])
def test_functions_without_modes_have_no_residues(eight_modes: Any, level: float, reciprocal: bool) -> None:
    frfs = eight_modes.frfs(np.linspace(5.0, 62.0, 100))
    frfs = dataclasses.replace(frfs, values=np.full(frfs.values.shape, level, complex))
    fit = system_fit(frfs, pole_of(eight_modes.freq_hz, eight_modes.damping_ratio), reciprocal=reciprocal)
    assert fit.converged
    np.testing.assert_allclose(fit.system.frf(frfs.freq_hz).values, level, atol=1e-9)


def test_a_failure_of_the_singular_values_does_not_end_the_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    made = _random_system(2, largest=False)
    expected = system_fit(made.frfs, made.poles)

    def failing(*args: Any, **options: Any) -> Any:
        if options.get("method") != "lm":
            raise np.linalg.LinAlgError("SVD did not converge")
        return least_squares(*args, **options)

    monkeypatch.setattr(rank_one, "least_squares", failing)
    found = system_fit(made.frfs, made.poles)
    assert found.converged
    squares = [_squares(made.frfs, f.system.frf(made.frfs.freq_hz).values) for f in (expected, found)]
    assert squares[1] == pytest.approx(squares[0], rel=1e-6)


@pytest.mark.slow
def test_an_iteration_that_does_not_converge_is_reported(eight_modes: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    frfs = eight_modes.frfs(np.linspace(5.0, 62.0, 400), noise=0.01)
    monkeypatch.setattr(rank_one, "MOST_STEPS", 1)
    monkeypatch.setattr(rank_one, "ROUGH_STEPS", 1)
    found = identify_frfs(frfs, InputKnown(methods=("N4SID",), largest_order=30))
    told = [n for n in found.notices if n.code == "identify.system-not-converged"]
    assert len(told) == 1
    check_shown("identify.system-not-converged", told[0])
