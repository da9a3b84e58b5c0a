"""Analysis of variance: the published table of a rack, closed forms, and comparison of nested fits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.experiments import main_effects, orthogonal_array
from structures import rack_tables


def test_the_table_of_the_rack_gives_its_f_values_to_the_last_published_digit() -> None:
    effects = main_effects(rack_tables.LEVELS, rack_tables.FREQUENCIES)
    assert (effects.error_freedom, effects.freedom.tolist()) == (7, [2] * 5)
    published = rack_tables.F_VALUES
    last_digit = np.where(published % 1.0 == 0.0, 1.0, 0.1)
    assert np.all(np.abs(effects.f_values - published) <= 0.5 * last_digit)


def test_the_flags_of_the_source_follow_from_contributions_and_not_from_f() -> None:
    effects = main_effects(rack_tables.LEVELS, rack_tables.FREQUENCIES)
    assert np.all(effects.p_values[:, :5] < 0.001)
    assert np.sum((effects.contribution > 0.077) == rack_tables.FLAGS) == 28


def test_an_orthogonal_array_divides_the_total_into_the_deviations_of_the_means() -> None:
    array = orthogonal_array("L36")
    responses = np.random.default_rng(2).standard_normal((36, 3))
    levels = array.levels[:, :16]
    effects = main_effects(levels, responses)
    for i, column in enumerate(levels.T):
        means = np.array([responses[column == level].mean(axis=0) for level in np.unique(column)])
        counts = np.bincount(column)
        np.testing.assert_allclose(effects.level_means[i], means)
        np.testing.assert_allclose(effects.ranges[i], means.max(axis=0) - means.min(axis=0))
        np.testing.assert_allclose(effects.squares[i], counts @ (means - responses.mean(axis=0)) ** 2, rtol=1e-9)
    total = effects.squares.sum(axis=0) + effects.error_squares
    np.testing.assert_allclose(total, effects.total_squares)
    np.testing.assert_allclose(effects.contribution.sum(axis=0) + effects.error_contribution, 1.0)


def test_missing_runs_compare_nested_fits() -> None:
    rng = np.random.default_rng(5)
    levels = rack_tables.LEVELS[[i for i in range(18) if i not in (3, 11)]]
    responses = rng.standard_normal((16, 1))
    effects = main_effects(levels, responses)

    def error(factors: list[int]) -> float:
        columns = [np.ones(16)] + [(levels[:, f] == level).astype(float) for f in factors for level in (1, 2)]
        return float(np.linalg.lstsq(np.column_stack(columns), responses, rcond=None)[1][0])

    full = error([0, 1, 2, 3, 4])
    assert effects.error_freedom == 5
    for i in range(5):
        gain = error([f for f in range(5) if f != i]) - full
        assert effects.squares[i, 0] == pytest.approx(gain, rel=1e-9)
        assert effects.f_values[i, 0] == pytest.approx(gain / 2 / (full / 5), rel=1e-9)


def test_without_effects_p_values_are_uniform() -> None:
    """Kolmogorov-Smirnov test at a significance of 0.1 %."""
    responses = np.random.default_rng(11).standard_normal((18, 2000))
    effects = main_effects(orthogonal_array("L18").levels, responses)
    for p in effects.p_values:
        assert stats.kstest(p, "uniform").pvalue > 0.001


def test_a_response_that_main_effects_explain_exactly() -> None:
    levels = orthogonal_array("L9").levels[:, :3]
    responses = np.column_stack([levels @ [1.0, 2.0, 0.0], np.full(9, 7.0)])
    effects = main_effects(levels, responses)
    assert np.isinf(effects.f_values[:2, 0]).all()
    assert np.isnan(effects.f_values[2, 0])
    assert np.isnan(effects.f_values[:, 1]).all()
    np.testing.assert_array_equal(effects.contribution[:, 1], 0.0)


def test_a_saturated_design_has_no_f() -> None:
    effects = main_effects(orthogonal_array("L9").levels, np.arange(9.0)[:, None])
    assert effects.error_freedom == 0
    assert np.isnan(effects.f_values).all()


_L9 = orthogonal_array("L9").levels


@pytest.mark.parametrize(
    ("name", "levels", "responses"),
    [
        ("screen.one-level", _L9 * [1, 0, 1, 1], np.arange(9.0)),
        ("screen.confounded", _L9[:, [0, 1, 0]], np.arange(9.0)),
        ("screen.too-few-runs", _L9[:8], np.arange(8.0)),
        ("screen.not-finite", _L9, np.where(np.arange(9) == 4, np.nan, 1.0)),
    ],
)
def test_errors(name: str, levels: np.ndarray, responses: np.ndarray) -> None:
    with pytest.raises(FemtuneError) as caught:
        main_effects(levels, responses[:, None])
    check_shown(name, caught.value)
