"""Standard deviations that follow from other numbers: from coherence, from the floor, from those of frequencies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import FrfSet
from femtune.residuals import FrfScatter, PairingRules, UpdateProblem
from femtune.residuals.frequency import FrequencyCovariance, FrequencyResidual
from structures.springs import factor_model, simulated_case, spring_structure

_HZ = np.array([1.0, 2.0, 3.0, 4.0])


def _frfs(values: np.ndarray, coherence: np.ndarray | None = None) -> FrfSet:
    dof = DofSet.parse(["1Z+"])
    shaped = None if coherence is None else coherence[None, None, :]
    return FrfSet(_HZ[: len(values)], values[None, None, :].astype(complex), dof, dof, "receptance", coherence=shaped)


def test_the_deviation_from_coherence_is_that_of_averaged_spectra() -> None:
    """H₁ estimates from n averages of Gaussian spectra, with noise on the output that makes the coherence 0.7."""
    rng = np.random.default_rng(3)
    n, draws, coherence, H = 50, 10_000, 0.7, 2.0 - 1.0j
    x, noise = ((rng.standard_normal((draws, n)) + 1j * rng.standard_normal((draws, n))) for _ in range(2))
    y = H * x + np.abs(H) * np.sqrt(1.0 / coherence - 1.0) * noise
    estimates = np.sum(x.conj() * y, axis=1) / np.sum(np.abs(x) ** 2, axis=1)
    frfs = _frfs(np.full(3, H), np.full(3, coherence))
    # the smallest relative deviation that is taken leaves what the coherence says
    stated = FrfScatter(relative=1e-9, averages=n)
    for part in (estimates.real, estimates.imag):
        assert stated.linear(frfs)[0, 0, 1] == pytest.approx(np.std(part), rel=0.03)
    assert stated.logarithmic(frfs)[0][0, 0, 1] == pytest.approx(np.std(np.log(np.abs(estimates))), rel=0.03)


def test_variances_of_all_sources_add() -> None:
    """|H|²(relative² + ε²) + (floor·max|H|)²; |H|² of a line is the mean of those of the lines beside."""
    frfs = _frfs(np.array([3.0, 1.0, 4.0j, 2.0]), np.array([1.0, 0.9, 0.5, 0.8]))
    size = np.array([1.0, (9.0 + 16.0) / 2.0, (1.0 + 4.0) / 2.0, 16.0])
    epsilon2 = (1.0 - np.array([1.0, 0.9, 0.5, 0.8])) / (2.0 * np.array([1.0, 0.9, 0.5, 0.8]) * 20)
    expected = np.sqrt(size * (0.03**2 + epsilon2) + (0.1 * 4.0) ** 2)
    assert FrfScatter(0.03, 0.1, 20).linear(frfs)[0, 0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    "given", [(-0.1,), (np.inf,), (0.1, -0.1), (0.1, np.nan), (0.0, 0.0), (0.1, 0.0, 0), (0.0, 0.0, 5)]
)
def test_what_is_no_deviation_is_refused(given: tuple) -> None:
    with pytest.raises(FemtuneError) as error:
        FrfScatter(*given)
    assert error.value.code == "residual.frf-scatter"


def test_one_average_is_a_measurement() -> None:
    """ε² = (1 − γ²)/(2 γ²) of one average, 1/2 for γ² = 1/2."""
    frfs = _frfs(np.full(3, 2.0), np.full(3, 0.5))
    assert FrfScatter(1e-9, averages=1).linear(frfs)[0, 0] == pytest.approx(np.full(3, 2.0 * np.sqrt(0.5)))


def _case():
    chain = spring_structure([(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0)], [1.0, 2.0, 1.5, 1.0])
    case = simulated_case(factor_model(chain, {"a": [1, 2], "b": [3], "m": [1002]}), (0.15, -0.2, 0.1), (0, 2, 3), 3)
    return replace(case, rules=PairingRules(mac_gate=0.2))


@pytest.mark.parametrize("correlated", [False, True])
def test_eigenvalues_have_the_covariance_that_follows_from_that_of_frequencies(correlated: bool) -> None:
    """λ = (2πf)² has ∂λ/∂f = 8π²f: the objective is the Mahalanobis distance of the eigenvalues."""
    case, covariance = _case(), 1e-4 * (np.eye(3) + 0.3 * correlated)
    if correlated:
        residual: FrequencyCovariance | FrequencyResidual = FrequencyCovariance(covariance, "eigenvalue")
    else:
        residual = FrequencyResidual("test", "eigenvalue")
        case = replace(case, test=replace(case.test, freq_sd_hz=np.sqrt(np.diag(covariance))))
    problem = UpdateProblem((replace(case, residuals=(residual,)),), case.configured.model.parameters)
    at = problem.start(np.zeros(3))
    slope = np.diag(8.0 * np.pi**2 * case.test.freq_hz)
    error = (2.0 * np.pi) ** 2 * (at.states[0].solution.freq_hz[:3] ** 2 - case.test.freq_hz**2)
    distance = error @ np.linalg.solve(slope @ covariance @ slope, error)
    assert 2.0 * at.objective == pytest.approx(distance, rel=1e-9)


def _triaxial(values: np.ndarray) -> FrfSet:
    """Functions (3, 1, lines) of a triaxial sensor at node 4."""
    dofs = DofSet.parse(("4X+", "4Y+", "4Z+"))
    return FrfSet(np.arange(1.0, 1.0 + values.shape[2]), values, dofs, DofSet.parse(("9Z+",)), "accelerance")


def test_the_deviation_of_turned_sensors_is_that_of_random_rotations() -> None:
    """Small rotations about all axes, at functions with random phases."""
    rng, angle, lines = np.random.default_rng(4), 0.05, 2000
    size = np.array([1.0, 3.0, 0.5])[:, None, None]
    H = size * np.exp(2j * np.pi * rng.random((3, 1, lines)))
    turns = angle * rng.standard_normal((lines, 3))
    off = np.cross(turns, H[:, 0].T).T
    stated = FrfScatter(1e-9, angles={0: angle})
    sd = stated.linear(_triaxial(H))[:, 0]
    logs = stated.logarithmic(_triaxial(H))[0][:, 0]
    for i in range(3):
        for part in (off[i].real, off[i].imag):
            assert np.std(part / sd[i]) == pytest.approx(1.0, rel=0.08)
        assert np.std((off[i] / H[i, 0]).real / logs[i]) == pytest.approx(1.0, rel=0.08)
    # sensors of other nodes, and outputs with deviations of their own
    other = FrfScatter(0.02, outputs={(4, "Y"): 0.3}, angles={5: angle}).logarithmic(_triaxial(H))[0]
    assert other[:, 0, 1:-1] == pytest.approx(np.array([0.02, 0.3, 0.02])[:, None] * np.ones(lines - 2))
