"""The certificate of a live model finds what is wrong with it, and leaves no pair out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from femtune.model.live import LiveModel, live_model, second_basis, separated_terms
from femtune.model.reduce import ReducedModel, reduce_model
from femtune.residuals import CaseState
from femtune.steps.live.certificate import CertifiedLive, FirstModel, FullModel, frequency_error
from femtune.steps.live.residuals import PagePart
from femtune.study.study import load_study

from .cantilever import CANTILEVER, Bench, bounded

pytestmark = pytest.mark.slow

_EI = f"\n{bounded('root', 'PBAR 1 I1')}\n{bounded('tip', 'PBAR 2 I1')}\n"
_ROUND = _EI.replace('"PBAR 1 I1"', '"PBAR 1 I1", "PBAR 1 I2"').replace('"PBAR 2 I1"', '"PBAR 2 I1", "PBAR 2 I2"')
_POINTS = np.random.default_rng(3).uniform(-0.4, 0.9, (10, 2))


@dataclass(frozen=True)
class _Made:
    state: CaseState
    first: ReducedModel
    vectors: np.ndarray
    live: LiveModel
    rows: np.ndarray

    def certified(self, live: LiveModel | None = None, rows: np.ndarray | None = None) -> CertifiedLive:
        """A live model, its own one where none is given, with the residuals of the frequencies of the pairs."""
        parts = [
            PagePart("frequency", "frequency", "eigenvalue", i, 0.01) for tests, _ in self.state.groups for i in tests
        ]
        return CertifiedLive(live or self.live, (self.rows if rows is None else rows) @ self.vectors, self.state, parts)

    @property
    def other(self) -> FirstModel:
        """The full model in all its degrees of freedom."""
        return FirstModel("full model", self.first, self.rows, self.vectors)


def _made(bench: Bench, parameters: str) -> _Made:
    problem = load_study(bench.study(f"{parameters}[residuals]\nfrequency_sd = 0.01\n")).problem()
    x = np.zeros(2)
    (state,) = problem.start(x).states
    configured, shift = state.case.configured, float(state.solution.shift)
    first = reduce_model(configured, np.eye(configured.n_free), shift=shift)
    groups = separated_terms(configured, x, ("stiffness", "mass"))
    assert not isinstance(groups, str)
    vectors = second_basis(first, x, [], 6, first.order).leading(first.order)
    return _Made(state, first, vectors, live_model(first, vectors, groups, x, 6), state.case.sensors.toarray())


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> _Made:
    bench = Bench(tmp_path_factory.mktemp("certificate"))
    bench.write("beam.bdf", CANTILEVER)
    bench.uff(bench.measure(bench.truth()))
    return _made(bench, _EI)


def test_a_right_one_has_errors_of_rounding_alone(made: _Made) -> None:
    found, errors = made.certified().beside(made.other, _POINTS, 0)
    assert found is not None
    assert (found.points, found.without_modes, found.mac_pairs) == (10, 0, 10 * 4)
    assert found.mac is not None
    assert found.chi_square_percent is not None
    assert max(found.frequency_percent, found.mac, found.chi_square_percent) < 1e-3
    assert errors.max() == found.frequency_percent


def test_the_full_model_solved_again_says_the_same(made: _Made) -> None:
    told: list[int] = []
    whole = FullModel(made.state, made.state.case.configured, made.vectors, lambda: told.append(1))
    found, _ = made.certified().beside(whole, _POINTS[:3], 0)
    assert found is not None
    assert len(told) == found.points == 3
    assert found.compared_with == "full model"
    assert (found.compared_order, found.mac_pairs) == (24, 3 * 4)
    assert found.mac is not None
    assert max(found.frequency_percent, found.mac) < 1e-3


def test_a_wrong_stiffness_is_found_in_frequencies_and_chi_square_and_drops_no_pair(made: _Made) -> None:
    terms = tuple(replace(t, scale=1.1 * t.scale) for t in made.live.terms)
    found, _ = made.certified(replace(made.live, terms=terms)).beside(made.other, _POINTS, 0)
    assert found is not None
    assert found.frequency_percent > 1.0
    assert found.chi_square_percent is not None
    assert found.chi_square_percent > 1.0
    assert found.mac_pairs == 10 * 4


def test_wrong_sensors_are_found_in_the_mac(made: _Made) -> None:
    found, _ = made.certified(rows=made.rows[::-1]).beside(made.other, _POINTS, 0)
    assert found is not None
    assert found.mac is not None
    assert found.mac > 0.1
    assert found.frequency_percent < 1e-3


def test_points_with_modes_in_one_model_alone_are_no_small_error(made: _Made) -> None:
    wild = replace(made.live, terms=tuple(replace(t, scale=50.0 * t.scale) for t in made.live.terms))
    found, errors = made.certified(wild).beside(made.other, np.array([[0.0, 0.0], [-0.4, -0.4]]), 1)
    assert found is not None
    assert (found.points, found.corners, found.without_modes) == (2, 1, 0)
    assert found.frequency_percent == 1e9
    assert errors[0] < 1e-3
    assert np.isinf(errors[1])


def test_where_neither_has_modes_the_point_is_counted(made: _Made) -> None:
    found, errors = made.certified().beside(made.other, np.array([[0.0, 0.0], [-1.0, 0.0]]), 0)
    assert found is not None
    assert (found.points, found.without_modes) == (2, 1)
    assert found.frequency_percent < 1e-3
    assert errors[1] == -1.0


def test_repeated_modes_are_compared_as_a_subspace(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Two models turn them differently, and the MAC of the pairs is that of the subspace."""
    bench = Bench(tmp_path_factory.mktemp("round"))
    text = CANTILEVER.replace("2.0-7   5.0-7", "2.0-7   2.0-7")
    bench.write("beam.bdf", text)
    bench.uff(bench.measure(bench.write("truth/true.bdf", text.replace("2.0-7   2.0-7", "2.3-7   2.3-7", 1))))
    made = _made(bench, _ROUND)
    assert {len(models) for _, models in made.state.groups} == {2}
    whole = FullModel(made.state, made.state.case.configured, made.vectors, lambda: None)
    found, _ = made.certified().beside(whole, _POINTS, 0)
    assert found is not None
    assert found.mac_pairs == 10 * 4
    assert found.mac is not None
    assert found.chi_square_percent is not None
    assert max(found.mac, found.chi_square_percent) < 1e-3


def test_missing_modes_are_an_infinite_error() -> None:
    assert frequency_error(np.array([4.0]), np.array([4.0, 9.0])) == np.inf
    assert frequency_error(np.array([4.0, 9.18]), np.array([4.0, 9.0])) == pytest.approx(0.00995, rel=1e-3)
    # rigid-body modes are rounding in both
    assert frequency_error(np.array([1e-7, 9.0]), np.array([-1e-7, 9.0])) == 0.0
