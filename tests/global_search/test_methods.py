"""Global searches: functions whose minimum is known, infinite regions, and what is kept of a search."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.global_search import GlobalMinimum, SearchRules, global_minimum, surrogate_minimum
from femtune.global_search.kinds import METHODS
from femtune.surrogates import KrigingRules, SumOfSquares, Surrogate, fit_surrogate
from structures import rack_tables

_METHODS = [
    pytest.param(m, marks=pytest.mark.skipif(m == "cma-es" and not importlib.util.find_spec("cma"), reason="needs cma"))
    for m in METHODS
]


def _rastrigin(x: np.ndarray) -> np.ndarray:
    return 10.0 * x.shape[1] + np.sum((x - 0.7) ** 2 - 10.0 * np.cos(2.0 * np.pi * (x - 0.7)), axis=1)


def _found(objective: object, method: str, **rules: object) -> GlobalMinimum:
    box = np.full(3, -4.0), np.full(3, 5.0)
    return global_minimum(objective, *box, SearchRules(method, **rules))  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("method", _METHODS)
def test_the_global_minimum_among_many_local_ones(method: str) -> None:
    """Rastrigin's function has 10³ minima in this box; the best three differ by 1 in the objective."""
    found = _found(_rastrigin, method, population=120)
    np.testing.assert_allclose(found.x, 0.7, atol=0.02)
    assert found.value < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("method", _METHODS)
def test_a_minimum_on_a_bound_and_points_that_cannot_be_computed(method: str) -> None:
    def objective(x: np.ndarray) -> np.ndarray:
        assert np.all((x >= -4.0) & (x <= 5.0))
        return np.where(x[:, 1] > 0.0, np.nan, np.sum((x - [-6.0, -1.0, 2.0]) ** 2, axis=1))

    found = _found(objective, method)
    np.testing.assert_allclose(found.x, [-4.0, -1.0, 2.0], atol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("method", _METHODS)
def test_the_history_is_of_the_best_value(method: str) -> None:
    counted = []

    def objective(x: np.ndarray) -> np.ndarray:
        counted.append(len(x))
        return np.asarray(np.sum(x**2, axis=1))

    found = _found(objective, method, generations=12, tolerance=0.0)
    assert np.all(np.diff(found.history) <= 0.0)
    assert found.history[-1] == found.value == np.sum(found.x**2)
    assert found.evaluations.tolist() == np.cumsum(counted).tolist()
    assert not found.converged
    again = _found(lambda x: np.sum(x**2, axis=1), method, generations=12, tolerance=0.0)
    np.testing.assert_array_equal(again.x, found.x)


def _rack() -> Surrogate:
    return fit_surrogate(rack_tables.RUNS, rack_tables.FREQUENCIES, KrigingRules(logarithms=True))


@pytest.mark.slow
def test_the_rack_has_a_lower_minimum_than_the_published_one() -> None:
    """On a surrogate of the array's runs: below 0.0053, and at most half of the value at the published parameters."""
    objective, surrogate = SumOfSquares(rack_tables.MEASURED, rack_tables.MEASURED), _rack()
    lower, upper = rack_tables.BOUNDS.T
    found = surrogate_minimum(surrogate, objective, (lower, upper), SearchRules("genetic"))
    published = 2.0 * objective(surrogate.predict(rack_tables.PUBLISHED_OPTIMUM))[0]
    assert 2.0 * found.value < 0.0053
    assert 2.0 * found.value <= 0.5 * published
    assert found.same == 3
    assert found.x[3] == rack_tables.BEAM_DENSITY
    # optimality within the bounds: the gradient points out of the box at bounds, and vanishes elsewhere
    residuals = (surrogate.predict(found.x)[0] - objective.target) / objective.sd**2
    slope = residuals @ surrogate.gradient(found.x)[0] * (upper - lower)
    assert np.all(slope[found.at_bound == -1] > 0.0)
    assert np.all(slope[found.at_bound == 1] < 0.0)
    inside = (found.at_bound == 0) & (upper > lower)
    assert np.all(np.abs(slope[inside]) < 1e-6)


@pytest.mark.slow
def test_twenty_populations_end_at_the_same_minimum() -> None:
    objective = SumOfSquares(rack_tables.MEASURED, rack_tables.MEASURED)
    box = (rack_tables.BOUNDS[:, 0], rack_tables.BOUNDS[:, 1])
    rules = SearchRules("genetic", population=100, crossover=0.8, mutation=0.005, generations=100)
    found = surrogate_minimum(_rack(), objective, box, rules, seeds=range(20))
    assert found.same == 20
    np.testing.assert_allclose(found.values, found.value, rtol=1e-6)


def test_without_its_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(FemtuneError) as caught:
        _found(_rastrigin, "cma-es")
    check_shown("install.missing, cma", caught.value)
