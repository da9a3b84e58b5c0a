"""Messages of stochastic updating and of the selection, word for word where a user meets them."""

from __future__ import annotations

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError, Notice
from femtune.selection import cosine_distances
from femtune.uncertainty import (
    FunctionOutputs,
    StochasticRules,
    given_statistics,
    held_out_repeats,
    interval_bounds,
    interval_update,
    latin_hypercube,
    statistics_of_repeats,
    stochastic_update,
)

LINEAR = FunctionOutputs(lambda t: 2.0 + t, lambda t: np.eye(2))
TABLE = np.array([[1.0, 2.0], [1.1, 2.1], [0.9, 2.3], [1.05, 1.9]])


def _text(error: pytest.ExceptionInfo[FemtuneError]) -> str:
    return str(error.value)


def test_an_output_that_was_never_measured() -> None:
    with pytest.raises(FemtuneError) as error:
        statistics_of_repeats(np.array([[1.0, np.nan], [1.1, np.nan], [1.2, 3.0]]), ("f1", "f2"))
    check_shown("quantify.not-measured", _text(error))


def test_an_infinite_repeat() -> None:
    with pytest.raises(FemtuneError, match=r"f1 in repeat 2 is infinite") as error:
        statistics_of_repeats(np.array([[1.0, 2.0], [np.inf, 2.1]]), ("f1", "f2"))
    assert error.value.code == "quantify.infinite"


def test_one_repeat() -> None:
    with pytest.raises(FemtuneError) as error:
        statistics_of_repeats(np.array([[1.0, 2.0], [np.nan, 3.0], [2.0, np.nan]]), missing="complete")
    check_shown("quantify.too-few-repeats", _text(error))


def test_two_outputs_never_measured_together() -> None:
    table = np.array([[1.0, np.nan], [1.2, np.nan], [np.nan, 2.0], [np.nan, 2.1]])
    with pytest.raises(FemtuneError, match="measured together in 0 repeats") as error:
        statistics_of_repeats(table, missing="pairwise")
    assert error.value.code == "quantify.too-few-repeats"


def test_no_scatter() -> None:
    with pytest.raises(FemtuneError) as error:
        statistics_of_repeats(np.array([[1.0, 2.0], [1.0, 2.1], [1.0, 2.3]]), ("f1", "f2"))
    check_shown("quantify.zero-variance", _text(error))


def test_no_covariance() -> None:
    with pytest.raises(FemtuneError) as error:
        given_statistics(np.ones(2), np.array([[1.0, 2.0], [2.0, 1.0]]))
    check_shown("quantify.not-positive", _text(error))


def _contradicting() -> np.ndarray:
    nan = np.nan
    a = [[0, 0, nan], [1, 1, nan], [2, 2.1, nan]]
    b = [[nan, 0, 0], [nan, 1, 1.1], [nan, 2, 2]]
    c = [[0, nan, 2], [1, nan, 1.1], [2, nan, 0]]
    return np.array([*a, *b, *c], float)


def test_pairs_that_contradict_each_other() -> None:
    with pytest.raises(FemtuneError, match="covariance of the repeats is not positive definite") as error:
        statistics_of_repeats(_contradicting(), missing="pairwise")
    assert 'use missing = "em"' in _text(error)


@pytest.mark.slow
def test_what_is_advised_for_contradicting_pairs_works() -> None:
    assert np.linalg.eigvalsh(statistics_of_repeats(_contradicting()).covariance).min() > -1e-9


def test_an_asymmetric_covariance() -> None:
    with pytest.raises(FemtuneError, match="not symmetric"):
        given_statistics(np.ones(2), np.array([[1.0, 0.2], [0.1, 1.0]]))


def test_a_singular_covariance_is_no_weight() -> None:
    measured = statistics_of_repeats(TABLE[:2])
    rules = StochasticRules(weighting="covariance")
    with pytest.raises(FemtuneError) as error:
        stochastic_update(LINEAR, measured, ("a", "b"), np.ones(2), np.ones(2), rules)
    check_shown("quantify.singular", _text(error))


def test_a_mean_of_zero() -> None:
    with pytest.raises(FemtuneError, match="output 1 has a mean of zero") as error:
        stochastic_update(LINEAR, given_statistics(np.array([0.0, 1.0]), np.eye(2)), ("a", "b"), np.ones(2), np.ones(2))
    assert error.value.code == "quantify.zero-mean"


@pytest.mark.parametrize(
    ("names", "start", "sd", "code"),
    [
        (("a", "b"), np.ones(2), np.array([0.1, 0.0]), "quantify.start-sd"),
        (("a", "b"), np.ones(2), np.array([np.nan, 0.1]), "quantify.start-sd"),
        (("a",), np.ones(2), np.ones(2), "quantify.size"),
    ],
)
def test_a_start_that_is_none(names, start, sd, code) -> None:
    with pytest.raises(FemtuneError) as error:
        stochastic_update(LINEAR, statistics_of_repeats(TABLE), names, start, sd)
    assert error.value.code == code


def test_another_number_of_outputs() -> None:
    with pytest.raises(FemtuneError, match="differs from the number of measured outputs") as error:
        stochastic_update(LINEAR, given_statistics(np.ones(3), np.eye(3)), ("a", "b"), np.ones(2), np.ones(2))
    assert error.value.code == "quantify.size"


def test_a_model_without_numbers() -> None:
    broken = FunctionOutputs(lambda t: np.full(2, np.nan), lambda t: np.eye(2))
    with pytest.raises(FemtuneError, match="not finite for one of the samples") as error:
        stochastic_update(broken, statistics_of_repeats(TABLE), ("a", "b"), np.ones(2), np.ones(2))
    assert error.value.code == "quantify.not-finite"


def test_too_few_samples() -> None:
    with pytest.raises(FemtuneError, match="too few samples to impose a correlation") as error:
        latin_hypercube(np.zeros(3), np.eye(3), 4)
    assert error.value.code == "quantify.too-few-samples"


def test_an_interval_without_room() -> None:
    with pytest.raises(FemtuneError, match="is empty") as error:
        interval_bounds(LINEAR, np.ones(2), np.array([2.0, 1.0]))
    assert error.value.code == "quantify.interval"
    with pytest.raises(FemtuneError, match="no interval of a parameter agrees"):
        interval_update(LINEAR, (np.array([3.0, 3.0]), np.array([3.5, 2.9])), (np.zeros(2), np.ones(2)))


def test_means_and_names_that_do_not_fit() -> None:
    with pytest.raises(FemtuneError, match="differs from the number of columns"):
        statistics_of_repeats(TABLE, ("f1",))
    with pytest.raises(FemtuneError, match="differs from the number of columns"):
        given_statistics(np.ones(3), np.eye(2))


def test_repeats_that_are_not_independent_and_normal() -> None:
    table = np.array([15.5, 44.6]) + 0.1 * np.random.default_rng(5).standard_normal((20, 2))
    table[:, 1] += np.linspace(0.0, 0.4, 20)
    table[6] += 2.0
    order, outlier = statistics_of_repeats(table, ("mode 1", "mode 2")).notices
    check_shown("quantify.order-dependence", order)
    check_shown("quantify.outlier", outlier)


def test_a_repeat_to_hold_out_that_does_not_exist() -> None:
    with pytest.raises(FemtuneError) as error:
        held_out_repeats(12, (3, 13), seed=1)
    check_shown("quantify.hold-out", _text(error))


def test_measurement_errors_without_a_mode() -> None:
    error = FemtuneError("quantify.noise", values={"compared modes": "1, 3"}, mode="3")
    check_shown("quantify.noise", str(error))


def test_shapes_of_a_table() -> None:
    check_shown("quantify.shapes", str(FemtuneError("quantify.shapes")))


def test_held_out_repeats_that_differ() -> None:
    sentence = "The 6 repeats that were held out differ from the predicted distribution (p-values: means 0.004)"
    check_shown("quantify.held-out-differ", Notice("quantify.held-out-differ", found=sentence))


def test_too_few_repeats_for_a_robust_covariance() -> None:
    with pytest.raises(FemtuneError) as error:
        statistics_of_repeats(TABLE, estimate="robust")
    check_shown("quantify.robust", _text(error))


def test_an_output_without_a_scale() -> None:
    with pytest.raises(FemtuneError) as error:
        cosine_distances(np.diag([0.0, 1.0]), np.array([0.0, 1.0]), np.eye(2), np.ones(2), ("a", "b"))
    check_shown("select.covariance, no scale", _text(error))
