"""Equation errors, static residuals, mass: values against brute force and by hand, Jacobians, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from femtune.errors import FemtuneError
from femtune.fem import FieldRef
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import ComparedCase, Residual, UpdateProblem, case_without_modes, state_at
from femtune.residuals.dynamic import DynamicResidual, equation_error
from femtune.residuals.mass import CentreResidual, InertiaResidual, MassResidual
from femtune.residuals.static import DisplacementResidual, ForceResidual, StaticTest
from femtune.residuals.weights import Weights
from femtune.testing import check_residual
from femtune.updating import SensitivityMethod, update
from structures.frames import make_structure, masses
from structures.springs import factor_model, simulated_case, spring_structure

CHAIN = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0)]
TRUTH = (0.15, -0.2, 0.1)
MODEL = factor_model(spring_structure(CHAIN, [1.0, 2.0, 1.5, 1.0]), {"a": [1, 2], "b": [3], "m": [1002]})


def modal(residual: Residual, sensors: tuple[int, ...] = (0, 2), **more: object) -> UpdateProblem:
    case = replace(simulated_case(MODEL, TRUTH, sensors, 3, **more), residuals=(residual,))
    return UpdateProblem((case,), MODEL.model.parameters)


def alone(residual: Residual, model: ConfiguredModel = MODEL) -> UpdateProblem:
    return UpdateProblem((case_without_modes(model, (residual,)),), model.model.parameters)


def static_test(
    model: ConfiguredModel, x: tuple[float, ...], forces: dict[int, float], seen: tuple[int, ...]
) -> StaticTest:
    """Displacements of the masses `seen` under forces on masses."""
    n_g, n = model.transformation.shape
    load = np.zeros(n)
    load[list(forces)] = list(forces.values())
    u = np.linalg.solve(model.at(np.array(x)).stiffness.toarray(), load)
    at = model.free[list(seen)]
    rows = sp.csr_array((np.ones(len(at)), (range(len(at)), at)), shape=(len(at), n_g))
    on = model.free[list(forces)]
    force = sp.csr_array((list(forces.values()), (np.zeros(len(on), int), on)), shape=(1, n_g))
    return StaticTest("pull", force, rows, u[list(seen)])


def test_the_least_equation_error_by_brute_force():
    random = np.random.default_rng(1)
    A = random.normal(size=(7, 7))
    A, S, m = A + A.T, random.normal(size=(3, 7)), random.normal(size=3)
    f = random.normal(size=7)
    found = equation_error(sp.csr_array(A), [], sp.csr_array(S), m, f)
    particular, null = np.linalg.lstsq(S, m, rcond=None)[0], np.linalg.svd(S)[2][3:].T
    y = np.linalg.lstsq(A @ null, f - A @ particular, rcond=None)[0]
    np.testing.assert_allclose(found.error, A @ (particular + null @ y) - f, atol=1e-10)
    np.testing.assert_allclose(S @ found.shape, m, atol=1e-12)


def test_the_equation_error_where_the_matrix_is_singular():
    """At an eigenvalue of the model K − λM has no inverse; the shape is measured in part, and its error is zero."""
    problem = modal(DynamicResidual(1.0))
    found = problem.start(np.array(TRUTH))
    assert found.objective < 1e-18
    assert np.isfinite(found.jacobian).all()
    assert found.states[0].case.test.freq_hz[0] > 0.0


@pytest.mark.quick(0)
@pytest.mark.parametrize("sensors", [(0, 2), (3,), (0, 1, 2, 3)])
@pytest.mark.parametrize("x", [(0.02, 0.1, -0.1), TRUTH])
def test_jacobian_of_the_dynamic_residual(sensors: tuple[int, ...], x: tuple[float, ...]):
    check_residual(modal(DynamicResidual(5.0), sensors), np.array(x))


@pytest.mark.slow
def test_dynamic_residual_at_repeated_modes():
    """No mode of the model takes part, so that repeated ones do no harm."""
    springs = [(i, (i + 1) % 6, 40.0) for i in range(6)] + [(-1, i, 10.0) for i in range(6)]
    model = factor_model(spring_structure(springs, [1.0] * 6), {"a": [1], "b": [3], "m": [1002]})
    case = simulated_case(model, (0.2, 0.1, 0.1), (0, 1, 3, 4), 5)
    problem = UpdateProblem((replace(case, residuals=(DynamicResidual(1.0),)),), model.model.parameters)
    for x in ((0.0, 0.0, 0.0), (0.05, -0.02, 0.0)):
        check_residual(problem, np.array(x))
    result = update(problem, SensitivityMethod())
    np.testing.assert_allclose(result.x, (0.2, 0.1, 0.1), atol=1e-6)


def test_dynamic_residual_of_some_modes_and_entries():
    problem = modal(DynamicResidual(1.0, labels=("1", "3")), left_out={2: "doubtful"})
    assert [b.mode for b in problem.start(np.zeros(3)).blocks] == ["1"]
    case = problem.cases[0]
    shapes = np.array(case.test.shapes)
    shapes[1, 0] = np.nan
    part = replace(case, test=replace(case.test, shapes=shapes))
    check_residual(replace(problem, cases=(part,)), np.zeros(3))


STATIC = static_test(MODEL, TRUTH, {3: 10.0, 1: -4.0}, (0, 1, 3))
WITHOUT_MASS = factor_model(spring_structure(CHAIN, [1.0, 2.0, 1.5, 1.0]), {"a": [1, 2], "b": [3]})


@pytest.mark.slow
@pytest.mark.parametrize(
    "residual",
    [
        DisplacementResidual(STATIC, Weights(0.001)),
        DisplacementResidual(STATIC, Weights(covariance=1e-6 * (np.eye(3) + 0.5))),
        ForceResidual(STATIC, 0.1),
    ],
    ids=["displacement", "by covariance", "force"],
)
def test_jacobian_of_static_residuals(residual: Residual):
    problem = alone(residual)
    check_residual(problem, np.array([0.02, 0.1, -0.1]))
    assert problem.start(np.array(TRUTH)).objective < 1e-18
    assert problem.start(np.zeros(3)).objective > 1e-3


def two_dof(loads: tuple[tuple[float, float], ...]) -> ComparedCase:
    """Springs k1 and k3 to ground, k2 between two masses; measured at k = (1.2, 0.8, 1) (handbook chapter, Fig. 1)."""
    model = factor_model(
        spring_structure([(-1, 0, 1.0), (0, 1, 1.0), (-1, 1, 1.0)], [1.0, 1.0]), {"k1": [1], "k2": [2], "k3": [3]}
    )
    truth = (0.2, -0.2, 0.0)
    tests = (static_test(model, truth, {0: a, 1: b}, (0, 1)) for a, b in loads)
    return case_without_modes(model, tuple(ForceResidual(t, 1.0) for t in tests))


def test_static_example_of_the_handbook_chapter():
    case = two_dof(((1.0, 0.0),))
    parameters = case.configured.model.parameters
    np.testing.assert_allclose(case.residuals[0].test.measured, np.array([9.0, 4.0]) / 14.8)  # type: ignore[attr-defined]
    at = UpdateProblem((case,), parameters).start(np.zeros(3))
    # r = f − G(u)k is linear: the minimum-norm step is the published one
    step = -np.linalg.pinv(at.jacobian) @ at.residuals
    np.testing.assert_allclose(1.0 + step, [1.1398, 0.9084, 1.1354], atol=5e-5)
    both = two_dof(((1.0, 0.0), (1.0, 0.5)))
    found = update(UpdateProblem((both,), parameters), SensitivityMethod())
    np.testing.assert_allclose(found.x, (0.2, -0.2, 0.0), atol=1e-9)


MASSES = [
    MassResidual(5.8, Weights(0.1)),
    CentreResidual(np.array([1.6, np.nan, 0.4]), Weights(0.01)),
    InertiaResidual(
        np.array([[np.nan, -2.1, np.nan], [-2.1, 16.0, np.nan], [np.nan, np.nan, 16.0]]), (0.0, 0.0, 0.0), Weights(0.2)
    ),
]


def lumps() -> ConfiguredModel:
    """Masses 1, 2 and 1 at (0, 0, 0), (1, 1, 0) and (3, 0, 2)."""
    parts = [masses([0, 1, 2], {"M": [1.0, 2.0, 1.0]})]
    structure = make_structure(
        [[0, 0, 0], [1, 1, 0], [3, 0, 2]], parts, element_kinds=dict.fromkeys(range(1, 4), "CONM2")
    )
    names = ("a", "b", "c")
    fields = [Assignment(name, FieldRef("CONM2", 1 + i, "M")) for i, name in enumerate(names)]
    return configure(parametric_model(structure, ParameterSet(tuple(map(Parameter, names))), fields), Configuration())


@pytest.mark.parametrize("residual", MASSES, ids=["mass", "centre", "inertia"])
def test_jacobian_of_mass_residuals(residual: Residual):
    problem, x = alone(residual, lumps()), np.array([0.1, 0.2, -0.1])
    check_residual(problem, x)
    assert np.linalg.norm(problem.start(x).jacobian, axis=1).min() > 0.1


def test_centre_and_inertia_by_hand():
    """Centre at (2·1 + 3, 2·1, 2)/4; ∂x/∂m₃ = (3 − 5/4)/4. The length of a model is that of its box, √(9 + 1 + 4)."""
    centre = alone(CentreResidual(np.array([1.0, np.nan, 0.6]), Weights(0.05)), lumps()).start(np.zeros(3))
    np.testing.assert_allclose(centre.residuals, [0.25 / 0.05, -0.1 / 0.05])
    np.testing.assert_allclose(centre.jacobian[0], np.array([0.0 - 1.25, 2.0 * (1.0 - 1.25), 3.0 - 1.25]) / 4.0 / 0.05)
    assert centre.blocks[0].sd == pytest.approx(0.05 / np.sqrt(14.0))
    measured = np.array([[7.0, np.nan, np.nan], [np.nan, 14.0, np.nan], [np.nan, np.nan, 13.5]])
    inertia = alone(InertiaResidual(measured, (0.0, 0.0, 0.0), Weights(0.5)), lumps()).start(np.zeros(3))
    np.testing.assert_allclose(inertia.residuals, [(6.0 - 7.0) / 0.5, (15.0 - 14.0) / 0.5, (13.0 - 13.5) / 0.5])
    assert inertia.blocks[0].sd == pytest.approx(0.5 / 14.0)


def test_mass_by_hand():
    """Masses 1, 2, 1.5, 1 at x = 0 … 3 that move along X: a weighed mass is the mean over the three directions."""
    found = alone(MassResidual(5.5 / 3.0 + 0.1, Weights(0.05))).start(np.zeros(3))
    np.testing.assert_allclose(found.residuals, [-2.0], rtol=1e-9)
    assert found.blocks[0].sd == pytest.approx(0.05 / (5.5 / 3.0 + 0.1))
    assert found.jacobian[0, 2] == pytest.approx(2.0 / 3.0 / 0.05)


def test_mass_residuals_solve_nothing():
    at = alone(MASSES[0]).start(np.zeros(3))
    assert at.states[0].solved is None


@pytest.mark.parametrize(
    ("make", "code"),
    [
        (lambda: MassResidual(0.0, Weights(1.0)), "residual.mass-data"),
        (lambda: MassResidual(1.0, Weights(0.0)), "residual.zero-variance"),
        (lambda: CentreResidual(np.full(3, np.nan), Weights(1.0)), "residual.mass-data"),
        (lambda: CentreResidual(np.zeros(3), Weights([1.0, 1.0])), "residual.weights"),
        (lambda: InertiaResidual(np.arange(9.0).reshape(3, 3), (0, 0, 0), Weights(1.0)), "residual.mass-data"),
        (lambda: InertiaResidual(np.full((3, 3), np.nan), (0, 0, 0), Weights(1.0)), "residual.mass-data"),
        (lambda: DynamicResidual(0.0), "residual.zero-variance"),
        (lambda: ForceResidual(STATIC, 0.0), "residual.zero-variance"),
        (lambda: replace(STATIC, measured=np.array([1.0, np.nan, 0.0])), "residual.static-data"),
        (lambda: replace(STATIC, measured=np.zeros(3)), "residual.static-data"),
        (lambda: DisplacementResidual(STATIC, Weights([1.0, 2.0])), "residual.weights"),
    ],
)
def test_bad_data_are_refused(make: object, code: str):
    with pytest.raises(FemtuneError) as error:
        make()  # type: ignore[operator]
    assert error.value.code == code
    assert error.value.hint


def test_sensors_that_repeat_each_other():
    case = simulated_case(MODEL, TRUTH, (0, 2), 2)
    twice = sp.csr_array(sp.vstack([case.sensors[[0]], case.sensors[[0]]]))
    spoilt = replace(case, sensors=twice, residuals=(DynamicResidual(1.0),))
    with pytest.raises(FemtuneError, match=r"residual\.sensors-dependent"):
        UpdateProblem((spoilt,), MODEL.model.parameters).start(np.zeros(3))


def test_a_mode_without_an_entry_has_no_equation_error():
    case = simulated_case(MODEL, TRUTH, (0, 2), 2)
    state = state_at(case, np.zeros(3))
    shapes = np.column_stack([case.test.shapes[:, 0], [np.nan, np.nan]])
    empty = replace(case, test=replace(case.test, shapes=shapes))
    with pytest.raises(FemtuneError, match=r"residual\.unmeasured"):
        DynamicResidual(1.0).blocks(replace(state, case=empty), True)


def test_a_free_structure_under_a_load_that_does_not_balance():
    free = factor_model(spring_structure([(0, 1, 7.0)], [1.0, 1.0]), {"k": [1]})
    force, rows = sp.csr_array(np.eye(1, 12)), sp.csr_array(np.eye(1, 12))
    residual = DisplacementResidual(StaticTest("pull", force, rows, np.array([0.1])), Weights(0.01))
    with pytest.raises(FemtuneError, match=r"response\.static-free"):
        alone(residual, free).start(np.zeros(1))
