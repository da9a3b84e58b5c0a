"""An error that all frequencies share: generalised least squares, its χ², and intervals that hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.residuals import FrequencyResidual, ShapeResidual, UpdateProblem
from femtune.residuals.frequency import FrequencyCovariance
from femtune.residuals.weights import ResidualBlock, without_common_error
from femtune.updating import SensitivityMethod, update
from femtune.validation import Outcome, goodness_of_fit
from structures.springs import factor_model, simulated_case, spring_structure

CHAIN = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0), (3, 4, 600.0)]
MASSES = [1.0, 2.0, 1.5, 1.0, 1.2]
GROUPS = {"a": [1], "b": [2, 3], "c": [4, 5]}
MODEL = factor_model(spring_structure(CHAIN, MASSES), GROUPS)  # type: ignore[arg-type]


def test_it_is_generalised_least_squares() -> None:
    rng = np.random.default_rng(0)
    sizes, sd = (1, 1, 3, 2), 0.02
    common = [np.array([100.0]), np.array([50.0]), rng.uniform(10.0, 90.0, 3), None]
    blocks = [
        ResidualBlock("frequency", "free", str(i), rng.normal(size=n), rng.normal(size=(n, 4)), 0.01, common=u)
        for i, (n, u) in enumerate(zip(sizes, common))
    ]
    r, J = np.concatenate([b.values for b in blocks]), np.vstack([b.jacobian for b in blocks])
    u = sd * np.concatenate([np.zeros(n) if c is None else c for n, c in zip(sizes, common)])
    weight = np.linalg.inv(np.eye(len(r)) + np.outer(u, u))
    found = without_common_error(blocks, sd)
    s, G = np.concatenate([b.values for b in found]), np.vstack([b.jacobian for b in found])
    assert s @ s == pytest.approx(r @ weight @ r)
    np.testing.assert_allclose(G.T @ G, J.T @ weight @ J, atol=1e-12)
    np.testing.assert_allclose(G.T @ s, J.T @ weight @ r, atol=1e-12)
    np.testing.assert_array_equal(found[3].values, blocks[3].values)
    assert without_common_error(blocks, 0.0) == tuple(blocks)


@pytest.mark.parametrize("form", ["frequency", "eigenvalue"])
def test_one_standard_deviation_is_that_of_the_frequencies(form: str) -> None:
    """Of λ = ω² the relative error is twice that of ω; a covariance whitens it with the rest."""
    case = simulated_case(MODEL, (0.1, -0.1, 0.2), range(5), 4)
    times = 2.0 if form == "eigenvalue" else 1.0
    one = UpdateProblem((case,), MODEL.model.parameters, (FrequencyResidual(0.01 * times, form),))  # type: ignore[arg-type]
    matrix = np.diag((0.01 * case.test.freq_hz) ** 2)
    whole = replace(case, residuals=(FrequencyCovariance(matrix, form),))  # type: ignore[arg-type]
    other = UpdateProblem((whole,), MODEL.model.parameters)
    first, second = (replace(p, common_sd=0.05).start(np.zeros(3)) for p in (one, other))
    assert first.objective == pytest.approx(second.objective)
    np.testing.assert_allclose(first.jacobian, second.jacobian, atol=1e-9)
    assert first.mean_error == pytest.approx(one.start(np.zeros(3)).mean_error)
    # a common error of the stated size costs one unit of χ², not one for each mode
    block = first.blocks[0]
    assert block.common is not None
    shifted = [replace(b, values=0.05 * b.common) for b in first.blocks if b.common is not None]
    u = np.concatenate([b.values for b in shifted])
    square = sum(float(b.values @ b.values) for b in without_common_error(shifted, 0.05))
    assert square == pytest.approx(u @ u / (1.0 + u @ u))


@pytest.mark.slow
@pytest.mark.quick(1, rest="long")
@pytest.mark.parametrize("common_sd", [0.04, 0.0])
def test_a_wrong_mass_is_covered_where_it_is_allowed_for(common_sd: float) -> None:
    """All masses of the structure are wrong by 8 %, one standard deviation: 4 % of each frequency."""
    rng, truth, held, passed = np.random.default_rng(1), np.array([0.1, -0.15, 0.2]), [], 0
    for _ in range(40):
        masses = [m * (1.0 + 0.08 * error) for error in [rng.normal()] for m in MASSES]
        wrong = factor_model(spring_structure(CHAIN, masses), GROUPS)  # type: ignore[arg-type]
        test = simulated_case(wrong, truth, range(5), 5).test  # type: ignore[arg-type]
        freq = test.freq_hz * (1.0 + 0.004 * rng.normal(size=5))
        case = replace(simulated_case(MODEL, truth, range(5), 5), test=replace(test, freq_hz=freq))  # type: ignore[arg-type]
        problem = UpdateProblem(
            (case,), MODEL.model.parameters, (FrequencyResidual(0.004), ShapeResidual(0.1)), common_sd=common_sd
        )
        result = update(problem, SensitivityMethod())
        intervals = result.interval()
        held += [intervals[n][0] <= 1.0 + t <= intervals[n][1] for n, t in zip("abc", truth)]
        passed += goodness_of_fit(result.after.weighted).outcome is not Outcome.FAIL
    # the wrong mass is taken up by the stiffnesses: the residuals cannot show it
    assert passed > 33
    if common_sd:
        assert np.mean(held) > 0.9
    else:
        assert np.mean(held) < 0.6
