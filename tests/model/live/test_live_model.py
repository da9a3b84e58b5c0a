"""The model of a page: its polynomials, its matrices and its modes beside the model that it was made of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.fem import FieldRef
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model
from femtune.model.live import LiveModel, live_model, second_basis, separated_terms
from femtune.model.reduce import ReducedModel, reduce_model, reduced_modes
from femtune.parameters import Parameter, ParameterSet
from femtune.parameters.parameter_set import tied
from structures.shells import Isotropic, Section, ShellPart, rectangle, shell_mesh, shell_structure

COUNT = 12
_NU, _RHO = 0.3, 7850.0


def _plate(free: tuple[str, ...], fields: dict[str, FieldRef], ties: tuple[Parameter, ...] = ()) -> ConfiguredModel:
    """A free plate of two thicknesses; fields by the parameter that sets them."""
    mesh = shell_mesh(rectangle(1.0, 0.7), 5, 4, distort=0.1)
    parts = [
        ShellPart(c, Section(Isotropic(2.1e11, _NU, _RHO), 0.01 + 0.004 * i))
        for i, c in enumerate(np.array_split(mesh.cells, 2))
    ]
    structure = shell_structure(mesh.xyz, parts, consistent_mass=True)
    parameters = ParameterSet((*(Parameter(n, lower=0.6, upper=1.8) for n in free), *ties))
    model = parametric_model(structure, parameters, [Assignment(n, f) for n, f in fields.items()])
    return configure(model, Configuration())


_T1, _T2, _E = FieldRef("PSHELL", 1, "T"), FieldRef("PSHELL", 2, "T"), FieldRef("MAT1", 1, "E")


@pytest.fixture(scope="module")
def plate() -> ConfiguredModel:
    """Its thicknesses and its modulus are parameters: each thickness with the modulus in one coefficient."""
    return _plate(("t1", "t2", "E"), {"t1": _T1, "t2": _T2, "E": _E})


@pytest.fixture(scope="module")
def whole(plate: ConfiguredModel) -> ReducedModel:
    """The full model on all its degrees of freedom."""
    return reduce_model(plate, np.eye(plate.n_free))


def _points(configured: ConfiguredModel, count: int, seed: int = 3) -> np.ndarray:
    lower, upper = configured.model.parameters.bounds
    return np.random.default_rng(seed).uniform(lower, upper, (count, len(lower)))


def _live(whole: ReducedModel, order: int, snapshots: int = 10, **stored: int) -> LiveModel:
    configured = whole.configured
    at = np.full(len(configured.model.parameters.free), 0.1)
    groups = separated_terms(configured, at, ("stiffness", "mass"))
    assert not isinstance(groups, str)
    basis = second_basis(whole, at, list(_points(configured, snapshots, 1)), COUNT, order)
    return live_model(whole, basis.leading(order), groups, at, COUNT, **stored)


def _error(live: LiveModel, whole: ReducedModel, x: np.ndarray) -> float:
    """Largest relative difference of the elastic frequencies."""
    full, found = reduced_modes(whole.at(x), COUNT).eigenvalues[6:COUNT], live.modes(x).eigenvalues[6:COUNT]
    return float(np.abs(np.sqrt(found / full) - 1.0).max())


@pytest.mark.slow
def test_polynomials_are_the_coefficients(plate: ConfiguredModel) -> None:
    at, (lower, upper) = np.array([0.2, -0.1, 0.3]), plate.model.parameters.bounds
    groups = separated_terms(plate, at, ("stiffness", "mass"))
    assert not isinstance(groups, str)
    assert {g.functions.parameters for g in groups if g.kind == "stiffness"} == {(0, 2), (1,)}
    assert {g.functions.parameters for g in groups if g.kind == "mass"} == {(0,), (1,)}
    start = plate.at(at)
    for x in _points(plate, 10):
        point = plate.at(x)
        for g in groups:
            change = [point.weights(t, ())[c] - start.weights(t, ())[c] for t, c in g.columns]
            np.testing.assert_allclose(g.functions.at(x, lower, upper), change, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_a_tie_is_part_of_the_polynomial() -> None:
    configured = _plate(("t1", "E"), {"t1": _T1, "E": _E, "t2": _T2}, (tied("t2", "0.5 + 0.5/t1"),))
    groups = separated_terms(configured, np.zeros(2), ("stiffness", "mass"))
    assert not isinstance(groups, str)
    lower, upper = configured.model.parameters.bounds
    for x in _points(configured, 10):
        point, start = configured.at(x), configured.at(np.zeros(2))
        for g in groups:
            change = [point.weights(t, ())[c] - start.weights(t, ())[c] for t, c in g.columns]
            np.testing.assert_allclose(g.functions.at(x, lower, upper), change, rtol=1e-6, atol=1e-7)


def test_a_coefficient_of_three_parameters_is_refused_in_words() -> None:
    configured = _plate(("a", "b", "c"), {"t": _T1}, (tied("t", "a*b*c"),))
    refused = separated_terms(configured, np.zeros(3), ("stiffness", "mass"))
    assert refused == "a coefficient of its matrices depends on 3 parameters at once, and a page can follow 2"


@pytest.mark.slow
def test_all_degrees_of_freedom_give_the_modes_at_every_point(plate: ConfiguredModel, whole: ReducedModel) -> None:
    live = _live(whole, whole.order)
    for x in _points(plate, 10):
        assert _error(live, whole, x) < 1e-4
    start = reduced_modes(whole.at(live.at), COUNT).eigenvalues[6:COUNT]
    np.testing.assert_allclose(live.modes(live.at).eigenvalues[6:], start, rtol=1e-9)


@pytest.mark.slow
def test_errors_fall_with_the_order(plate: ConfiguredModel, whole: ReducedModel) -> None:
    points = _points(plate, 10)
    models = [_live(whole, order) for order in (18, 30, 60)]
    errors = [max(_error(live, whole, x) for x in points) for live in models]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-3


@pytest.mark.slow
def test_steps_of_16_bits_do_not_spoil_high_modes(plate: ConfiguredModel, whole: ReducedModel) -> None:
    live = _live(whole, 80, exact_bytes=0)
    assert {t.triangle.dtype for t in live.terms} == {np.dtype(np.int16)}
    rough = replace(
        live,
        terms=tuple(
            replace(t, triangle=np.round(t.triangle / 64.0).astype(np.int16), scale=64.0 * t.scale) for t in live.terms
        ),
    )
    x = _points(plate, 1)[0]
    exact = reduced_modes(whole.at(x), COUNT).eigenvalues[6:COUNT]
    fine, coarse = (np.abs(m.modes(x).eigenvalues[6:] / exact - 1.0) for m in (live, rough))
    assert fine.max() < 1e-4
    assert coarse.max() > fine.max()


def test_motions_without_mass_are_kept() -> None:
    """They follow the others by their stiffness: without them the model would be too stiff."""
    mesh = shell_mesh(rectangle(1.0, 0.7), 3, 3, distort=0.1)
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(Isotropic(2.1e11, _NU, _RHO), 0.01))])
    parameters = ParameterSet((Parameter("t", lower=0.6, upper=1.8),))
    configured = configure(parametric_model(structure, parameters, [Assignment("t", _T1)]), Configuration())
    whole = reduce_model(configured, np.eye(configured.n_free))
    assert np.linalg.matrix_rank(whole.at(np.zeros(1)).mass) < whole.order
    live = _live(whole, whole.order)
    assert _error(live, whole, np.array([0.5])) < 1e-4


@pytest.mark.slow
def test_shapes_have_unit_modal_mass_and_are_followed_by_the_mass(whole: ReducedModel) -> None:
    live = _live(whole, 60)
    modes = live.modes(live.at + 0.05)
    np.testing.assert_allclose(modes.shapes.T @ modes.mass @ modes.shapes, np.eye(COUNT), atol=1e-8)
