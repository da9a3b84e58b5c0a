"""The term list on a basis: exact in the parameters, with exact derivatives."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
from tests.model.decks import deck, structure_of
from tests.model.plates import two_halves

from femtune.errors import FemtuneError
from femtune.fem import FieldRef
from femtune.model import (
    Assignment,
    Configuration,
    ConfiguredModel,
    configure,
    parametric_model,
    solve_modes,
    subspace_derivative,
)
from femtune.model.reduce import reduce_model, reduced_derivative, reduced_model, reduced_modes, sensor_model
from femtune.model.reduce.condensation import guyan, irs
from femtune.model.reduce.reduced_model import enlarge
from femtune.parameters import Parameter, ParameterSet

X = np.array([0.11, -0.2, 0.05])


@pytest.fixture(scope="module")
def plate() -> ConfiguredModel:
    return two_halves(4, 3)


@pytest.fixture(scope="module")
def basis(plate: ConfiguredModel) -> np.ndarray:
    return solve_modes(plate.at(np.zeros(3)), 14).shapes


def _close(a: np.ndarray, b: np.ndarray, tolerance: float = 1e-12) -> None:
    np.testing.assert_allclose(a, b, rtol=0.0, atol=tolerance * np.abs(b).max())


def test_reduced_matrices_are_the_projected_ones_at_any_point(plate: ConfiguredModel, basis: np.ndarray) -> None:
    model = reduce_model(plate, basis)
    for x in np.random.default_rng(0).uniform(-0.4, 0.6, (4, 3)):
        full, small = plate.at(x), model.at(x)
        _close(small.stiffness, basis.T @ (full.stiffness @ basis))
        _close(small.mass, basis.T @ (full.mass @ basis))


DAMPED = [
    "SPOINT,1,THRU,4", "CELAS2,1,100.,1,,,,.04", "CELAS2,2,80.,1,,2", "CELAS2,3,60.,2,,3,,.1", "CELAS2,4,90.,3,,4",
    "CDAMP2,11,.6,1,,3", "CDAMP2,12,.3,4", *(f"CMASS2,{20 + i},{i}.,{i}" for i in range(1, 5)), "PARAM,G,.03",
]  # fmt: skip


def test_reduced_damping_is_the_projected_one_with_its_derivatives() -> None:
    """Dashpots, loss factors of springs, and the loss factor of the whole structure as a parameter."""
    fields = [FieldRef("PARAM", 0, "G"), FieldRef("CELAS2", 3, "GE"), FieldRef("CELAS2", 1, "K")]
    values, names = (0.03, 0.1, 100.0), ("G", "GE", "K")
    parameters = ParameterSet(tuple(Parameter(n, v, 0.0, 2.0 * v) for n, v in zip(names, values)))
    assignments = [Assignment(n, field, relative=False) for n, field in zip(names, fields)]
    damped = configure(parametric_model(structure_of(deck(DAMPED)), parameters, assignments), Configuration())
    basis = np.random.default_rng(4).standard_normal((4, 3))
    full, small = damped.at(X), reduce_model(damped, basis).at(X)
    for kind in ("viscous", "hysteretic"):
        _close(getattr(small, kind), basis.T @ (getattr(full, kind) @ basis))
        for one, whole in zip(getattr(small, f"{kind}_derivatives"), getattr(full, f"{kind}_derivatives")):
            projected = basis.T @ (whole @ basis)
            np.testing.assert_allclose(one, projected, atol=1e-12 * np.abs(projected).max())


def test_derivatives_are_those_by_complex_step(plate: ConfiguredModel, basis: np.ndarray) -> None:
    model = reduce_model(plate, basis)
    point = model.at(X)
    for i in range(3):
        step = X.astype(complex)
        step[i] += 1e-30j
        moved = model.at(step)
        _close(point.stiffness_derivatives[i], moved.stiffness.imag / 1e-30)
        _close(point.mass_derivatives[i], moved.mass.imag / 1e-30)
        for j in range(3):
            # some are zero but for the rounding of coefficients that are as large as those of the stiffness
            _close(
                point.second_derivative("stiffness", i, j) + 1e-3 * point.stiffness,
                moved.stiffness_derivatives[j].imag / 1e-30 + 1e-3 * point.stiffness,
            )


def test_a_complete_basis_gives_the_full_model_and_its_derivatives(plate: ConfiguredModel) -> None:
    n = plate.n_free
    rows = np.random.default_rng(1).standard_normal((5, n))
    basis = la.qr(np.random.default_rng(2).standard_normal((n, n)))[0]
    small, full = reduced_modes(reduce_model(plate, basis, rows).at(X), 12), solve_modes(plate.at(X), 12)
    np.testing.assert_allclose(small.freq_hz[6:], full.freq_hz[6:], rtol=1e-7)
    signs = np.sign(np.sum(small.seen * (rows @ full.shapes[:, :12]), axis=0))
    for j in (7, 10):
        a, b = reduced_derivative(small, [j]), subspace_derivative(full, [j])
        np.testing.assert_allclose(a.eigenvalue_gradient, b.eigenvalue_gradient, rtol=1e-6)
        _close(signs[j] * a.shape_gradient, rows @ b.shape_gradient, 1e-5)


def test_mode_derivatives_are_exact_within_the_basis(plate: ConfiguredModel, basis: np.ndarray) -> None:
    model = reduce_model(plate, basis, np.eye(plate.n_free)[:4])
    modes, h = reduced_modes(model.at(X), 12), 1e-6
    for i, step in enumerate(h * np.eye(3)):
        up, down = (reduced_modes(model.at(X + s * step), 12) for s in (1.0, -1.0))
        for j in (7, 9):
            exact = reduced_derivative(modes, [j])
            slope = (up.eigenvalues[j] - down.eigenvalues[j]) / (2 * h)
            np.testing.assert_allclose(exact.eigenvalue_gradient[i], slope, rtol=1e-6)
            aligned = [m.seen[:, j] * np.sign(m.seen[:, j] @ modes.seen[:, j]) for m in (up, down)]
            _close(exact.shape_gradient[:, i], (aligned[0] - aligned[1]) / (2 * h), 1e-5)


def test_reduced_frequencies_are_never_below_the_true_ones(plate: ConfiguredModel, basis: np.ndarray) -> None:
    small = reduced_modes(reduce_model(plate, basis[:, :14]).at(X), 12).eigenvalues[:12]
    full = solve_modes(plate.at(X), 12).eigenvalues[:12]
    assert (small[6:] >= full[6:] * (1 - 1e-9)).all()
    assert (small[6:] > full[6:] * (1 + 1e-9)).any()


def test_an_enlarged_model_is_the_model_on_the_larger_basis(plate: ConfiguredModel, basis: np.ndarray) -> None:
    rows = np.eye(plate.n_free)[:3]
    whole = reduce_model(plate, basis, rows)
    grown = enlarge(reduce_model(plate, basis[:, :6], rows), basis, rows)
    for i, values in whole.terms.items():
        _close(grown.terms[i], values)
    np.testing.assert_allclose(grown.rows, whole.rows)


def test_terms_that_would_be_larger_than_the_model_are_refused(
    plate: ConfiguredModel, basis: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reduced_model, "MOST_BYTES", 1000)
    with pytest.raises(FemtuneError, match="order 14") as error:
        reduce_model(plate, basis[:, :14])
    assert error.value.code == "reduce.too-many-terms"


def test_models_at_sensors_are_the_named_reductions(plate: ConfiguredModel) -> None:
    mesh = Configuration(supports_added=((1, "123456"), (5, "123456")))
    point = configure(plate.model, mesh).at(X)
    masters = [3, 17, 40, 55]
    rows = np.eye(point.configured.n_free)[masters]
    for method, reduction in (("guyan", guyan), ("irs", irs)):
        expected = reduction(point.stiffness, point.mass, masters)
        found = sensor_model(point, rows, method)  # type: ignore[arg-type]
        _close(found.mass, expected.mass, 1e-6)
        _close(found.stiffness, expected.stiffness, 1e-6)


def test_a_free_structure_has_exact_orthogonality_at_the_sensors_by_serep(plate: ConfiguredModel) -> None:
    point = plate.at(X)
    random = np.random.default_rng(3)
    rows = random.standard_normal((10, plate.n_free))
    shapes = solve_modes(point, 10).shapes[:, :10]
    found = sensor_model(point, rows, "serep")
    np.testing.assert_allclose(found.orthogonality(rows @ shapes), np.eye(10), atol=1e-8)
    np.testing.assert_allclose(np.abs(found.cross_orthogonality(rows @ shapes, -rows @ shapes)), np.eye(10), atol=1e-8)
    sensors = [6 * node + c for node in (0, 4, 15, 19) for c in range(3)]
    static = sensor_model(point, np.eye(plate.n_free)[sensors])
    values = la.eigvalsh(static.stiffness, static.mass)
    assert np.sum(np.abs(values) < 1e-6 * values.max()) == 6


def test_models_at_sensors_refuse_what_cannot_be_told(plate: ConfiguredModel) -> None:
    point, rows = plate.at(X), np.eye(plate.n_free)
    with pytest.raises(FemtuneError, match="linear combination"):
        sensor_model(point, np.vstack([rows[:8], rows[:1] + rows[1:2]]))
    with pytest.raises(FemtuneError, match="when all sensors are fixed"):
        sensor_model(point, rows[:2])
    with pytest.raises(FemtuneError, match="cannot be distinguished"):
        sensor_model(point, rows[:3], "serep", 4)
