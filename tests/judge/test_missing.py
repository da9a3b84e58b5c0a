"""The score test beside least squares with the field as a parameter, and by simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, f

from femtune.arrays import Reals
from femtune.judge.missing import mode_that_asks, p_of_refit, score_test
from femtune.judge.whitened import Whitened


def _record(r: Reals, J: Reals, kinds: tuple[str, ...]) -> Whitened:
    blank = ("",) * len(r)
    names = tuple(f"p{i}" for i in range(J.shape[1]))
    return Whitened(
        r, J, names, np.zeros((len(r), 0)), kinds, blank, blank, blank, ("data",) * len(r), np.ones(len(r)),
        np.zeros((len(r), 0)),
    )  # fmt: skip


def _wide(m: int) -> Reals:
    return np.full((m, 2), 1e9)


def test_of_one_kind_is_the_partial_f_test() -> None:
    random, n, k = np.random.default_rng(1), 30, 3
    J, c, r = random.normal(size=(n, k)), random.normal(size=(n, 2)), random.normal(size=n)
    found = score_test(_record(r, J, ("frequency",) * n), c, _wide(2))
    assert found is not None
    for j in range(2):
        first = np.linalg.lstsq(J, -r, rcond=None)[1][0]
        x, after, *_ = np.linalg.lstsq(np.column_stack([J, c[:, j]]), -r, rcond=None)
        expected = (first - after[0]) / (after[0] / (n - k - 1))
        np.testing.assert_allclose(found.change[j], x[-1], rtol=1e-9)
        np.testing.assert_allclose(found.f[j], expected, rtol=1e-6)
        np.testing.assert_allclose(found.p_alone[j], f.sf(expected, 1, n - k - 1), rtol=1e-6)


def test_stated_deviations_do_not_matter() -> None:
    """Each kind has its own size, so that the statistic is the same whatever sizes are stated."""
    random, n = np.random.default_rng(2), 40
    kinds = ("frequency",) * 12 + ("shape",) * 28
    J, c, r = random.normal(size=(n, 3)), random.normal(size=(n, 4)), random.normal(size=n)
    size = np.where(np.arange(n) < 12, 10.0, 0.3)
    first = score_test(_record(r, J, kinds), c, _wide(4))
    other = score_test(_record(r * size, J * size[:, None], kinds), c * size[:, None], _wide(4))
    assert first is not None
    assert other is not None
    np.testing.assert_allclose(other.f, first.f, rtol=1e-3)
    np.testing.assert_allclose(other.p, first.p, atol=0.003)


@pytest.mark.slow
@pytest.mark.parametrize("rank", [3, 30])
def test_level_of_many_fields(rank: int) -> None:
    """Of 60 right models at most 5 % may be suspected, also if 30 fields span three directions only."""
    random, hits, runs, n = np.random.default_rng(3), 0, 60, 34
    kinds = ("frequency",) * 9 + ("shape",) * 25
    for i in range(runs):
        J = random.normal(size=(n, 3))
        c = random.normal(size=(n, rank)) @ random.normal(size=(rank, 30))
        r = random.normal(size=n) * np.where(np.arange(n) < 9, 0.2, 3.0)
        found = score_test(_record(r, J, kinds), c, _wide(30), draws=150, seed=i)
        assert found is not None
        hits += found.p.min() < 0.05
    assert binom.sf(hits - 1, runs, 0.05) > 0.001


def test_what_the_parameters_represent_is_invisible() -> None:
    random, n = np.random.default_rng(4), 20
    J = random.normal(size=(n, 2))
    c = np.column_stack([J @ [1.0, 2.0], random.normal(size=n), np.zeros(n)])
    found = score_test(_record(random.normal(size=n), J, ("shape",) * n), c, _wide(3))
    assert found is not None
    assert found.invisible.tolist() == [True, False, True]
    assert found.order.tolist() == [1]
    assert found.p[0] == 1.0


def test_fields_that_look_alike_are_one_group() -> None:
    random, n = np.random.default_rng(5), 25
    J, c = random.normal(size=(n, 2)), random.normal(size=(n, 2))
    three = np.column_stack([c, -2.0 * c[:, 1] + 0.01 * random.normal(size=n)])
    found = score_test(_record(-0.5 * c[:, 1] + 0.1 * random.normal(size=n), J, ("shape",) * n), three, _wide(3))
    assert found is not None
    assert found.group[1] == found.group[2] == 0
    assert found.group[0] == 1
    assert found.change[1] == pytest.approx(0.5, rel=0.2)
    assert found.change[2] == pytest.approx(-0.25, rel=0.2)


def test_a_plausible_change_ranks_first() -> None:
    """Of two fields that explain nearly the same, the one that needs a change of 300 % comes second."""
    random, n = np.random.default_rng(6), 40
    J, c = random.normal(size=(n, 2)), random.normal(size=n)
    both = np.column_stack([c / 20.0, c + 0.35 * random.normal(size=n)]) * 50.0
    r = -0.15 * 50.0 * c + 0.3 * random.normal(size=n)
    usual = np.full((2, 2), 0.2)
    found = score_test(_record(r, J, ("shape",) * n), both, usual)
    free = score_test(_record(r, J, ("shape",) * n), both, _wide(2))
    assert found is not None
    assert free is not None
    assert free.order.tolist() == [0, 1]
    assert found.order.tolist() == [1, 0]


def test_the_digits_of_exact_data_say_nothing() -> None:
    """Residuals are the rounding of a file: a pattern of it explains them, and nothing is missing. At a size that a
    reader could use the same pattern is found."""
    random, n = np.random.default_rng(9), 40
    J, c = random.normal(size=(n, 2)), random.normal(size=(n, 1))
    pattern = c[:, 0] + 0.2 * random.normal(size=n)
    kinds = ("frequency",) * 10 + ("shape",) * (n - 10)
    p, refit = [], []
    for size in (1e-4, 1.0):
        record = _record(size * pattern, J, kinds)
        found = score_test(record, c, _wide(1))
        assert found is not None
        p.append(found.p[0])
        after = record.r + found.change[0] * c[:, 0]
        refit.append(p_of_refit(record, _record(after, np.hstack([J, c]), kinds)))
    assert p[0] > 0.9
    assert p[1] < 0.01
    assert refit[0] > 0.9
    assert refit[1] < 0.01


def test_too_few_degrees_of_freedom() -> None:
    random = np.random.default_rng(7)
    J, c = random.normal(size=(5, 3)), random.normal(size=(5, 1))
    assert score_test(_record(random.normal(size=5), J, ("frequency",) * 5), c, _wide(1)) is None


def test_refit_of_a_linear_model_has_the_p_value_of_the_field() -> None:
    random, n = np.random.default_rng(8), 30
    J, c, r = random.normal(size=(n, 2)), random.normal(size=(n, 1)), random.normal(size=n)
    kinds = ("frequency",) * n
    found = score_test(_record(r, J, kinds), c, _wide(1))
    assert found is not None
    wide = np.hstack([J, c])
    p = p_of_refit(_record(r, J, kinds), _record(r, wide, kinds))
    np.testing.assert_allclose(p, found.p_alone[0], rtol=1e-6)
    assert p_of_refit(_record(r, J, kinds), _record(r[1:], wide[1:], kinds[1:])) is None


def _of_modes(r: Reals, J: Reals) -> Whitened:
    """Five modes of a frequency and five entries of a shape each."""
    kinds = ("frequency", *("shape",) * 5) * 5
    return replace(_record(r, J, kinds), modes=tuple(str(1 + i // 6) for i in range(30)))


def _after(record: Whitened, column: Reals) -> Reals:
    """Residuals of a refit with the field of a column, of a linear model."""
    return replace(record, J=np.column_stack([record.J, column])).left


def test_the_one_mode_that_asks_for_a_field() -> None:
    """A field whose effect the third mode alone has, and the same field with its effect on all modes."""
    random = np.random.default_rng(5)
    J, column = random.normal(size=(30, 2)), random.normal(size=30)
    record = _of_modes(random.normal(size=30), J)
    third = np.array([m == "3" for m in record.modes])
    alone = replace(record, r=record.across(record.r + 6.0 * third * column))
    found = mode_that_asks(alone, column, _after(alone, column))
    assert found is not None
    assert (found.configuration, found.mode) == ("", "3")
    assert found.before > found.after
    assert found.p_without > 0.05
    everywhere = replace(record, r=record.across(record.r + 6.0 * column))
    assert mode_that_asks(everywhere, column, _after(everywhere, column)) is None
    # a refit that lowers nothing, and two modes, of which one has most anyway
    assert mode_that_asks(alone, column, alone.r) is None
    two = replace(alone, modes=tuple("3" if m == "3" else "1" for m in alone.modes))
    assert mode_that_asks(two, column, _after(two, column)) is None
    # where the other modes do not see the field at all
    own = np.where(third, column, 0.0)
    seen = mode_that_asks(replace(alone, J=np.zeros((30, 0))), own, _after(alone, own))
    assert seen is not None
    assert seen.p_without == 1.0


@pytest.mark.slow
def test_doubtful_modes_are_named_and_fields_of_all_modes_are_not() -> None:
    """Of 200 tests with one bad mode nearly all are named; of 200 with a wrong field, as many as the level."""
    random, named = np.random.default_rng(11), np.zeros(2)
    for _ in range(200):
        J, column = random.normal(size=(30, 3)), random.normal(size=30)
        record = _of_modes(random.normal(size=30), J)
        bad = np.array([m == "2" for m in record.modes])
        for k, effect in enumerate((np.where(bad, column, 0.0), column)):
            size = 6.0 / np.linalg.norm(record.across(effect))
            one = replace(record, r=record.across(record.r + size * effect))
            found = mode_that_asks(one, column, _after(one, column))
            named[k] += found is not None and (k == 1 or found.mode == "2")
    bad_mode, wrong_field = named / 200
    assert bad_mode > 0.85
    assert wrong_field < 0.05


def test_the_errors_of_all_modes_are_those_of_none() -> None:
    random, n = np.random.default_rng(3), 60
    record = replace(
        _record(random.normal(size=n), np.zeros((n, 0)), ("shape",) * n),
        modes=tuple(str(i // 10) for i in range(n)), configurations=("",) * n,
    )  # fmt: skip
    assert mode_that_asks(record, record.r, 0.5 * record.r) is None
