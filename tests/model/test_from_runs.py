"""Models of runs: a chain of masses that has a closed form, with modes that cross, change places and change signs."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

from femtune.errors import FemtuneError
from femtune.fem import NodeTable
from femtune.model import Assignment, Configuration, configure, parametric_model, solve_modes
from femtune.model.imported.fitted_matrices import SurrogateCoefficient
from femtune.model.imported.from_runs import FittedRuns, Runs, fit_runs
from femtune.model.imported.model import field_of_variable
from femtune.model.response.rigid import is_rigid
from femtune.parameters import Parameter, ParameterSet
from femtune.parameters.jet import Jet, constant, variables
from femtune.surrogates import ChaosRules, KrigingRules, RadialRules, SurrogateRules, fit_surrogate

from .chain_runs import MASS, modes, sample

NODES = NodeTable(np.arange(1, 5), np.zeros((4, 3)), np.tile(np.eye(3), (4, 1, 1)), has_coordinates=False)
DOFS = 6 * np.arange(4)
NAMES = ("k1", "k2")


def runs_at(points: np.ndarray, count: int = 4, seed: int = 1) -> Runs:
    """Runs with signs at random, as solvers give them."""
    rng = np.random.default_rng(seed)
    found = [modes(p, count) for p in points]
    shapes = np.array([phi * rng.choice([-1.0, 1.0], count) for _, phi in found])
    return Runs(NAMES, points, np.array([hz for hz, _ in found]), shapes, DOFS)


def solved(fitted: FittedRuns, point: np.ndarray, count: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies of the model at a point, and its shapes at the four masses."""
    parameters = ParameterSet(tuple(Parameter(name, v, 0.1 * v, 10.0 * v) for name, v in zip(NAMES, fitted.nominal)))
    model = parametric_model(
        fitted.structure, parameters, [Assignment(name, field_of_variable(name), relative=False) for name in NAMES]
    )
    configured = configure(model, Configuration("runs"))
    solution = solve_modes(configured.at(point / fitted.nominal - 1.0), count)
    return solution.freq_hz, (configured.transformation @ solution.shapes[:, :count])[DOFS]


def alignment(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """|φᵀMψ| of shapes of unit modal mass."""
    return np.abs(np.einsum("im,ij,jm->m", one, MASS, other))


@pytest.mark.slow
def test_with_all_modes_a_linear_model_is_met_exactly_wherever_its_modes_lie() -> None:
    fitted = fit_runs(runs_at(sample(8)), NODES, 1, crossed=False)
    for point in sample(6, 0.9, seed=7):
        hz, shapes = solved(fitted, point)
        exact, phi = modes(point)
        np.testing.assert_allclose(hz, exact, rtol=1e-9)
        np.testing.assert_allclose(alignment(shapes, phi), 1.0, rtol=1e-8)
    assert np.abs(fitted.error).max() < 1e-9


@pytest.mark.quick(0)
@pytest.mark.parametrize("count", [2, 3])
def test_with_some_of_the_modes_the_runs_are_met_and_the_space_between_with_the_order_of_the_polynomial(
    count: int,
) -> None:
    """The error of a polynomial of degree two falls with the third power of the range."""
    errors = []
    for width in (0.2, 0.1, 0.05):
        grid = np.array([[1e4 * (1 + width * i), 2e4 * (1 + width * j)] for i in (-1, 0, 1) for j in (-1, 0, 1)])
        fitted = fit_runs(runs_at(grid, count), NODES, 2, crossed=True)
        point = np.array([1e4, 2e4]) * (1 + width * np.array([0.4, -0.6]))
        hz, shapes = solved(fitted, point, count)
        exact, phi = modes(point, count)
        errors.append(max(np.abs(hz / exact - 1.0).max(), np.abs(1.0 - alignment(shapes, phi)).max()))
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (slopes > 2.4).all(), (errors, slopes)


@pytest.mark.slow
def test_order_signs_and_the_choice_among_repeated_modes_do_not_matter() -> None:
    points = sample(12, 0.2)
    one = fit_runs(runs_at(points, 3), NODES, 2, crossed=True)
    runs = runs_at(points, 3, seed=5)
    rng = np.random.default_rng(3)
    orders = [rng.permutation(3) for _ in points]
    mixed = Runs(
        NAMES, points,
        np.array([hz[order] for hz, order in zip(runs.freq_hz, orders)]),
        np.array([phi[:, order] for phi, order in zip(runs.shapes, orders)]),  # type: ignore[arg-type]
        DOFS,
    )  # fmt: skip
    other = fit_runs(mixed, NODES, 2, crossed=True)
    for point in sample(4, 0.2, seed=9):
        np.testing.assert_allclose(solved(one, point, 3)[0], solved(other, point, 3)[0], rtol=1e-9)


def test_without_shapes_each_column_is_a_polynomial_of_its_own_also_where_columns_cross() -> None:
    points = sample(9)
    hz = np.sqrt(np.stack([points[:, 0], points[:, 1]], axis=1))
    assert (hz[:, 0] > hz[:, 1]).any()
    assert (hz[:, 0] < hz[:, 1]).any()
    nodes = NodeTable(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))
    fitted = fit_runs(Runs(NAMES, points, hz), nodes, 1, crossed=False)
    parameters = ParameterSet(tuple(Parameter(name, v, 0.1 * v, 10.0 * v) for name, v in zip(NAMES, fitted.nominal)))
    model = parametric_model(
        fitted.structure, parameters, [Assignment(name, field_of_variable(name), relative=False) for name in NAMES]
    )
    configured = configure(model, Configuration("runs"))
    for point in ([9e3, 1.1e4], [1.3e4, 8.5e3]):
        found = solve_modes(configured.at(np.array(point) / fitted.nominal - 1.0), 2)
        np.testing.assert_allclose(found.freq_hz, np.sort(np.sqrt(point)), rtol=1e-10)
        # the shape of a column is its own scalar point
        assert np.abs(found.shapes).argmax(axis=0).tolist() == np.argsort(point).tolist()


def test_the_error_of_a_run_that_is_left_out_is_that_of_a_fit_without_it() -> None:
    runs = runs_at(sample(14), 4)
    hz = runs.freq_hz**1.3
    runs = Runs(NAMES, runs.points, hz)
    nodes = NodeTable(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))
    whole = fit_runs(runs, nodes, 2, crossed=True)
    V = np.array([[1, a, b, a * a, a * b, b * b] for a, b in runs.points / 1e4])
    for i in (0, 5, 13):
        rest = np.arange(14) != i
        predicted = V[i] @ np.linalg.lstsq(V[rest], hz[rest] ** 2, rcond=None)[0]
        np.testing.assert_allclose(whole.error[i], np.sort(np.sqrt(predicted)) / hz[i] - 1.0, rtol=1e-6)


def test_runs_whose_modes_have_left_the_set_are_not_used() -> None:
    """In some runs a torsion mode is the second one: in a set of two the bending mode is gone."""
    runs = runs_at(sample(12), 2)
    assert runs.shapes is not None
    shapes = runs.shapes.copy()
    shapes[3] = np.linalg.qr(np.column_stack([shapes[3, :, 0], la.null_space(runs.shapes[0].T)[:, 0]]))[0]
    # what is left of the second mode in the first shape of the run is none of the set
    shapes[3, :, 0] = la.null_space(np.vstack([runs.shapes[0].T, shapes[3, :, 1]]))[:, 0]
    found = fit_runs(Runs(NAMES, runs.points, runs.freq_hz, shapes, DOFS), NODES, 1, crossed=False, centre=0)
    assert np.flatnonzero(~found.used).tolist() == [3]


@pytest.mark.parametrize(
    ("points", "code"),
    [
        (np.zeros((0, 2)), "runs.too-few"),
        (sample(5), "runs.too-few"),
        (np.column_stack([np.full(9, 1e4), sample(9)[:, 1]]), "runs.one-value"),
        (sample(9)[:, :1] * [1.0, 2.0], "runs.not-determined"),
    ],
)
def test_runs_that_do_not_determine_the_polynomials_are_refused(points: np.ndarray, code: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        fit_runs(Runs(NAMES, points, np.ones((len(points), 2))), NODES, 2, crossed=True)
    assert caught.value.code == code


NO_NODES = NodeTable(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))


@pytest.mark.slow
def test_kriging_of_runs_with_shapes_follows_modes_that_change_places() -> None:
    """Closer to the chain than the quadratic polynomials of the same runs, with shapes, and the runs themselves met."""
    runs = runs_at(sample(40), 3)
    smooth = fit_runs(runs, NODES, 2, crossed=True, rules=KrigingRules("quadratic"))
    polynomial = fit_runs(runs, NODES, 2, crossed=True)
    errors, others, shapes = [], [], []
    for point in sample(10, 0.5, seed=7):
        exact, phi = modes(point, 3)
        hz, found = solved(smooth, point, 3)
        errors.append(np.abs(hz / exact - 1.0).max())
        others.append(np.abs(solved(polynomial, point, 3)[0] / exact - 1.0).max())
        shapes.append(np.abs(1.0 - alignment(found, phi)).max())
    assert max(errors) < 2e-3
    assert max(shapes) < 2e-2
    assert np.mean(errors) < 0.2 * np.mean(others)
    for i in (0, 17):
        np.testing.assert_allclose(solved(smooth, runs.points[i], 3)[0], runs.freq_hz[i], rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("rules", [RadialRules("cubic"), ChaosRules(6)], ids=lambda rules: rules.label)
def test_other_surrogates_of_runs_with_shapes(rules: SurrogateRules) -> None:
    """Chain with modes that change places: closer than quadratic polynomials, shapes too."""
    runs = runs_at(sample(40), 3)
    fitted = fit_runs(runs, NODES, 2, crossed=True, rules=rules)
    polynomial = fit_runs(runs, NODES, 2, crossed=True)
    errors, others, shapes = [], [], []
    for point in sample(10, 0.5, seed=7):
        exact, phi = modes(point, 3)
        hz, found = solved(fitted, point, 3)
        errors.append(np.abs(hz / exact - 1.0).max())
        others.append(np.abs(solved(polynomial, point, 3)[0] / exact - 1.0).max())
        shapes.append(np.abs(1.0 - alignment(found, phi)).max())
    assert np.mean(errors) < 0.5 * np.mean(others)
    # they are less accurate than Kriging where modes change places
    assert np.mean(shapes) < 2e-2


@pytest.mark.quick(0)
@pytest.mark.parametrize(
    "rules",
    [
        KrigingRules("quadratic"),
        KrigingRules("quadratic", "matern-5/2"),
        KrigingRules("linear", "none"),
        RadialRules("cubic"),
        RadialRules("quintic"),
        ChaosRules(3),
    ],
    ids=lambda rules: rules.label,
)
def test_the_coefficients_of_surrogates_and_their_derivatives(rules: SurrogateRules) -> None:
    """Value as the surrogate predicts; gradient and Hessian by complex step."""
    points = sample(20)
    # with noise, so that rounding is not amplified by nearly singular correlations
    y = np.cos(points / 7e3) + 0.03 * np.random.default_rng(4).standard_normal(points.shape)
    surrogate = fit_surrogate(points, y, rules, parameters=NAMES)
    for response in (0, 1):
        coefficient = SurrogateCoefficient(surrogate, response)

        def at(x: np.ndarray, coefficient: SurrogateCoefficient = coefficient) -> Jet:
            moving = variables(x)
            factor = constant(np.array([1.5]), 2)
            return coefficient({"FACTOR": factor, **{name: moving[[i]] for i, name in enumerate(NAMES)}}, {})

        x = np.array([0.93e4, 2.1e4])
        found = at(x)
        assert found.value[0] == pytest.approx(1.5 * surrogate.predict(x[None])[0, response], rel=1e-9)
        for i in range(2):
            moved = at(x + 1e-20j * np.eye(2)[i])
            assert moved.value[0].imag / 1e-20 == pytest.approx(found.grad[0, i], rel=1e-9)
            np.testing.assert_allclose(moved.grad[0].imag / 1e-20, found.hess[0, i], rtol=1e-9, atol=1e-20)


@pytest.mark.slow
def test_the_error_of_a_run_that_is_left_out_of_kriging() -> None:
    """As predicted by Kriging of the other runs, at the lengths and the noise that all runs have."""
    runs = Runs(NAMES, sample(14), runs_at(sample(14), 4).freq_hz ** 1.3)
    whole = fit_runs(runs, NO_NODES, 1, crossed=True, rules=KrigingRules("linear"))
    values = (2.0 * np.pi * runs.freq_hz) ** 2
    fitted = fit_surrogate(runs.points, values - values.mean(axis=0), KrigingRules("linear"), parameters=NAMES)
    for i in (0, 6):
        rest = np.arange(14) != i
        part = fitted.with_runs(fitted.x[rest], fitted.y[rest])
        hz = np.sqrt(part.predict(runs.points[i])[0] + values.mean(axis=0)) / (2.0 * np.pi)
        np.testing.assert_allclose(whole.error[i], np.sort(hz) / np.sort(runs.freq_hz[i]) - 1.0, rtol=1e-4, atol=1e-9)


@pytest.mark.slow
def test_rigid_body_modes_that_are_listed_as_zero_do_not_hide_the_others() -> None:
    """A solver lists zero, or a small number, for the motion of a free chain; its elastic modes stay."""
    K = np.diag([1e4, 3e4, 4e4, 2e4]) - np.diag([1e4, 2e4, 2e4], 1) - np.diag([1e4, 2e4, 2e4], -1)
    values, shapes = la.eigh(K, MASS)
    exact = np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi)
    for listed in (0.0, 1e-12, 1e-4):
        hz = np.append(listed, exact[1:])
        points = np.array([[1e4, 2e4], [1.1e4, 2.2e4]])
        fitted = fit_runs(
            Runs(NAMES, points, np.tile(hz, (2, 1)), np.tile(shapes, (2, 1, 1)), DOFS), NODES, 0, False, 0
        )
        found, phi = solved(fitted, fitted.nominal)
        np.testing.assert_allclose(found[1:], exact[1:], rtol=1e-9)
        assert found[0] < 2e-6 * exact[-1] or found[0] == pytest.approx(listed, rel=1e-6)
        np.testing.assert_allclose(alignment(phi, shapes), 1.0, atol=1e-9)


def free_chain(k1: float, k2: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and shapes of twelve masses in a free chain."""
    K = np.zeros((12, 12))
    for i, k in enumerate([k1] * 4 + [k2] * 4 + [3e4] * 3):
        K[i : i + 2, i : i + 2] += k * np.array([[1.0, -1.0], [-1.0, 1.0]])
    values, shapes = la.eigh(K, np.diag(FREE_MASS))
    return np.sqrt(np.maximum(values[:count], 0.0)) / (2 * np.pi), shapes[:, :count]


FREE_MASS = np.linspace(1.0, 2.0, 12)
FREE_NODES = NodeTable(np.arange(1, 13), np.zeros((12, 3)), np.tile(np.eye(3), (12, 1, 1)), has_coordinates=False)


def free_runs(points: np.ndarray, count: int = 5) -> Runs:
    """As a solver lists them: a small frequency of the rigid-body mode, and six digits of the shapes."""
    rng = np.random.default_rng(0)
    hz, shapes = map(np.array, zip(*(free_chain(*point, count) for point in points)))
    hz[:, 0] = 10.0 ** rng.uniform(-4.0, -3.0, len(points))
    size = np.abs(shapes).max(axis=1, keepdims=True)
    return Runs(NAMES, points, hz, shapes + 5e-7 * size * rng.uniform(-1.0, 1.0, shapes.shape), 6 * np.arange(12))


@pytest.mark.parametrize("correlation", [None, pytest.param("gaussian", marks=pytest.mark.slow)])
def test_rounding_of_rigid_body_modes_is_not_magnified_by_runs_that_lie_side_by_side(correlation: str | None) -> None:
    """The free structure stays free away from the runs, and its elastic modes are extrapolated as they are."""
    centre = np.array([1e4, 2e4])
    sides = [centre * (1.0 + 0.01 * s * np.eye(2)[i]) for i in range(2) for s in (1.0, -1.0)]
    rules = None if correlation is None else KrigingRules(correlation=correlation)
    fitted = fit_runs(free_runs(np.array([centre, *sides])), FREE_NODES, 1, False, 0, rules)
    parameters = ParameterSet(tuple(Parameter(name, v, 0.1 * v, 10.0 * v) for name, v in zip(NAMES, centre)))
    assigned = [Assignment(name, field_of_variable(name), relative=False) for name in NAMES]
    configured = configure(parametric_model(fitted.structure, parameters, assigned), Configuration("runs"))
    for x in ([0.0, 0.0], [0.1, -0.1], [0.15, 0.15], [-0.15, 0.1]):
        found = solve_modes(configured.at(np.array(x)), 5)
        assert is_rigid(found)[:5].tolist() == [True, False, False, False, False], x
        exact = free_chain(*(centre * (1.0 + np.array(x))), 5)[0]
        np.testing.assert_allclose(found.freq_hz[1:5], exact[1:], rtol=0.02)


def test_a_soft_suspension_is_no_rigid_body_mode() -> None:
    """A frequency of half a hundredth of the highest one is that of a spring, which a parameter may change."""
    points = np.array([[0.5, 2e4], [0.7, 2e4], [0.5, 2.4e4], [1.0, 2.2e4]])
    hz = np.sqrt(points) / (2 * np.pi)
    fitted = fit_runs(Runs(NAMES, points, hz), NO_NODES, 1, crossed=False)
    found, _ = solved_without_shapes(fitted, np.array([0.8, 2.1e4]))
    assert found[0] == pytest.approx(np.sqrt(0.8) / (2 * np.pi), rel=1e-9)


@pytest.mark.parametrize("correlation", [None, pytest.param("gaussian", marks=pytest.mark.slow)])
def test_runs_without_shapes_keep_a_column_of_rigid_body_modes(correlation: str | None) -> None:
    points = sample(9)
    hz = np.column_stack([np.linspace(1e-6, 9e-6, 9), np.sqrt(points[:, 0]), np.sqrt(points[:, 1])])
    rules = None if correlation is None else KrigingRules(trend="linear", correlation=correlation)
    fitted = fit_runs(Runs(NAMES, points, hz), NO_NODES, 1, False, rules=rules)
    found, rigid = solved_without_shapes(fitted, np.array([9e3, 1.1e4]))
    assert rigid.tolist() == [True, False, False]
    np.testing.assert_allclose(found[1:], np.sqrt([9e3, 1.1e4]), rtol=1e-6 if correlation else 1e-9)


def solved_without_shapes(fitted: FittedRuns, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies at a point, and which of the modes are rigid-body modes."""
    parameters = ParameterSet(tuple(Parameter(name, v, 0.1 * v, 10.0 * v) for name, v in zip(NAMES, fitted.nominal)))
    assigned = [Assignment(name, field_of_variable(name), relative=False) for name in NAMES]
    configured = configure(parametric_model(fitted.structure, parameters, assigned), Configuration("runs"))
    found = solve_modes(configured.at(point / fitted.nominal - 1.0), len(fitted.error[0]))
    return found.freq_hz, is_rigid(found)


@pytest.mark.parametrize("other", ["number", "space"])
def test_runs_whose_rigid_body_modes_differ_are_fitted_as_they_are(other: str) -> None:
    """A mode that is rigid in some runs alone, or moves otherwise in them, keeps its small frequency and its shape."""
    runs = free_runs(np.array([[1e4, 2e4], [1.1e4, 2.2e4]]))
    hz, shapes = runs.freq_hz.copy(), np.array(runs.shapes)
    if other == "number":
        hz[1, 0] = 0.1
    else:
        shapes[1, :, 0] += 0.1 * shapes[1, :, 1]
    fitted = fit_runs(Runs(NAMES, runs.points, hz, shapes, runs.dofs), FREE_NODES, 0, False, 0)
    assert min(np.diag(fitted.structure.assembled[0].upper.toarray())[-5:]) > 0.0


@pytest.mark.slow
def test_the_stated_deviation_is_that_of_drawn_matrices() -> None:
    """Components are drawn from their distributions, and the spread of the frequencies is counted."""
    fitted = fit_runs(runs_at(sample(12), 3), NODES, 1, crossed=False, rules=KrigingRules())
    coverage = fitted.coverage
    K, M = coverage.stiffness, coverage.mass
    assert K is not None
    assert M is not None
    assert K.surrogate is not None
    assert M.surrogate is not None
    point = np.array([[1.05e4, 2.1e4]])
    there, sd = (K.at(point), M.at(point)), [part.surrogate.predict_sd(point)[0] for part in (K, M)]
    rng, drawn = np.random.default_rng(3), []
    for _ in range(2000):
        away = [
            np.tensordot(s * rng.standard_normal(len(part.parts)), part.parts, axes=1) for s, part in zip(sd, (K, M))
        ]
        drawn.append(np.sqrt(la.eigh(there[0] + away[0], there[1] + away[1], eigvals_only=True)))
    counted = np.std(drawn, axis=0) / np.mean(drawn, axis=0)
    stated = coverage.frequency_sd(dict(zip(NAMES, point[0])))
    assert stated is not None
    # the last one belongs to the direction that is no mode
    np.testing.assert_allclose(stated[:3], counted[:3], rtol=0.1)


@pytest.mark.slow
def test_the_stated_deviation_grows_away_from_the_runs() -> None:
    points = sample(12)
    coverage = fit_runs(runs_at(points), NODES, 1, crossed=False, rules=KrigingRules()).coverage
    at_run, far = (coverage.frequency_sd(dict(zip(NAMES, p))) for p in (points[4], np.array([4e4, 8e4])))
    assert at_run is not None
    assert far is not None
    assert far.max() > 10.0 * at_run.max()
    assert [name for name, *_ in coverage.outside({"k1": 4e4, "k2": 2e4})] == ["k1"]
    assert list(coverage.outside(dict(zip(NAMES, points.max(axis=0))))) == []
    assert fit_runs(runs_at(points), NODES, 1, crossed=False).coverage.frequency_sd({"k1": 1e4, "k2": 2e4}) is None
