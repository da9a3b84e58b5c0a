"""FRFs of reduced models: values by the direct solution, derivatives by complex differences, what is estimated."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray
from tests.model.plates import three_thirds

from femtune.model import (
    ConfiguredModel,
    solve_modes,
)
from femtune.model.damping import ModalDamping, constant_damping
from femtune.model.reduce import ReducedPoint, Trained, Trainer, TrainingRules, reduce_model, reduced_modes
from femtune.model.reduce.function_estimate import FunctionsWanted, log_difference, missed_responses
from femtune.model.reduce.functions_in_basis import BasisPorts, FunctionsInBasis, reduced_functions
from femtune.model.response import Ports, frf, frf_gradient, make_ports
from structures.springs import factor_model, spring_structure

# a ring of six masses: two pairs of repeated modes, which the parameters split
SPRINGS = [(i, (i + 1) % 6, 40.0) for i in range(6)] + [(-1, i, 10.0) for i in range(6)]
LINES = np.linspace(0.1, 1.3, 50)
REPEATED, APART = np.zeros(3), np.array([0.05, -0.02, 0.1])
ZETA = 0.02

DAMPED = {
    "no damping": {},
    "one loss factor": {"loss": 0.03},
    "loss factors": {"loss": [0.03] * 5 + [0.1] * 7},
    "dashpots": {"dashpots": [(0, 2, 0.3)]},
}
MODAL = {
    "no modal damping": None,
    "viscous": constant_damping(ZETA),
    "hysteretic": replace(constant_damping(ZETA), hysteretic=True),
    "over frequency": ModalDamping(np.array([0.01, 0.05]), np.array([0.4, 2.0])),
}


@lru_cache
def ring(damped: str = "no damping") -> ConfiguredModel:
    structure = spring_structure(SPRINGS, [1.0] * 6, **DAMPED[damped])  # type: ignore[arg-type]
    return factor_model(structure, {"a": [1], "b": [3], "m": [1002]})


@pytest.mark.parametrize(("inputs", "outputs"), [(37, 3), (3, 37), (2, 2)])
def test_what_modes_miss_of_the_responses_to_many_forces(inputs: int, outputs: int) -> None:
    """Beside the dense inverse; more forces than are solved for at a time."""
    point = ring().at(APART)
    solution = solve_modes(point, 3)
    dense = np.random.default_rng(2).standard_normal((point.configured.n_free, inputs + outputs))
    dense[np.abs(dense) < 0.5] = 0.0
    some = ports_of(ring())
    ports = replace(some, inputs=sp.csc_array(dense[:, :inputs]), outputs=sp.csr_array(dense[:, inputs:].T))
    phi = solution.shapes
    shifted = (point.stiffness - solution.shift * point.mass).toarray()
    whole = la.solve(shifted, dense)
    static = whole - phi @ ((phi.T @ dense) / (solution.eigenvalues - solution.shift)[:, None])
    fewer = static[:, :inputs] if inputs <= outputs else static[:, inputs:]
    expected = np.hstack([static, la.solve(shifted, point.mass @ fewer)])
    wanted = FunctionsWanted(ports, LINES, 3)
    found = missed_responses(solution, wanted.forces, wanted.fewer)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(whole).max())


@pytest.mark.parametrize("inputs", [["1X+"], ["1X+", "9X+", "20X+"]])
def test_what_modes_miss_leaves_an_error_of_the_sixth_power_of_the_line(inputs: list[str]) -> None:
    """A chain of 40 masses on a basis of five modes and what they miss, beside direct solutions."""
    springs = [(i - 1, i, 40.0 + 3.0 * (i % 4)) for i in range(40)]
    model = factor_model(spring_structure(springs, [1.0 + 0.1 * (i % 3) for i in range(40)]), {"a": [1]})
    solution = solve_modes(model.at(np.zeros(1)), 5)
    ports = make_ports(model, inputs, ["4X+", "13X+"])
    K, M = solution.point.stiffness.toarray(), solution.point.mass.toarray()
    wanted = FunctionsWanted(ports, LINES, 5)
    missed = missed_responses(solution, wanted.forces, wanted.fewer)
    basis = la.qr(np.hstack([solution.shapes, missed]), mode="economic")[0]
    errors = []
    # the next mode is the sixth
    next_hz = float(solve_modes(model.at(np.zeros(1)), 6).freq_hz[5])
    for part in (0.5, 0.25):
        s = 2.0 * np.pi * part * next_hz
        dynamic = K - s**2 * M
        exact = ports.outputs @ la.solve(dynamic, ports.inputs.toarray())
        found = (ports.outputs @ basis) @ la.solve(basis.T @ dynamic @ basis, basis.T @ ports.inputs.toarray())
        static = ports.outputs @ la.solve(K, ports.inputs.toarray())
        errors.append(float(np.abs(found - exact).max() / np.abs(static).max()))
    assert errors[0] < 1e-3
    assert errors[0] / errors[1] > 2.0**5


def ports_of(model: ConfiguredModel) -> Ports:
    return make_ports(model, ["1X+"], ["1X+", "2X+", "4X+"])


def in_basis(
    model: ConfiguredModel, x: NDArray, lines: NDArray, damping: ModalDamping | None, damped: int,
    left_out: tuple[int, ...] = (), decay: float = 0.0,
) -> FunctionsInBasis:  # fmt: skip
    """On a basis of all motions, turned at random."""
    basis = la.qr(np.random.default_rng(3).standard_normal((model.n_free, model.n_free)))[0]
    ports = ports_of(model)
    on = BasisPorts(basis.T @ ports.inputs.toarray(), ports.outputs @ basis)
    modes = reduced_modes(reduce_model(model, basis).at(x), model.n_free)
    return reduced_functions(modes, on, decay + 2j * np.pi * lines, damped, damping, left_out=left_out)


@pytest.mark.quick(0, gate=20)
@pytest.mark.parametrize("damped", DAMPED)
@pytest.mark.parametrize("modal", MODAL)
@pytest.mark.parametrize("x", [REPEATED, APART], ids=["repeated", "apart"])
@pytest.mark.parametrize("number", [3, 6])
def test_on_a_basis_of_all_motions_they_are_those_of_the_full_model(
    damped: str, modal: str, x: NDArray, number: int
) -> None:
    model, damping = ring(damped), MODAL[modal]
    full = frf_gradient(
        solve_modes(model.at(x), number), ports_of(model), LINES, "receptance", "direct", damping=damping
    )
    found = in_basis(model, x, LINES, damping, number)
    values, gradient = np.moveaxis(full.frfs.values, -1, 0), np.moveaxis(full.gradient, 2, 0)
    np.testing.assert_allclose(found.values, values, atol=1e-11 * np.abs(values).max())
    np.testing.assert_allclose(found.gradient, gradient, atol=1e-10 * np.abs(gradient).max())


@pytest.mark.quick(0, gate=12)
@pytest.mark.parametrize("damped", DAMPED)
@pytest.mark.parametrize("modal", MODAL)
@pytest.mark.parametrize("left_out", [(0,), (1, 3)])
def test_modes_that_are_left_out_are_those_of_the_full_model(
    damped: str, modal: str, left_out: tuple[int, ...]
) -> None:
    model, damping = ring(damped), MODAL[modal]
    full = frf_gradient(
        solve_modes(model.at(APART), 4), ports_of(model), LINES, "receptance", "direct", damping=damping,
        left_out=left_out,
    )  # fmt: skip
    found = in_basis(model, APART, LINES, damping, 4, left_out)
    values, gradient = np.moveaxis(full.frfs.values, -1, 0), np.moveaxis(full.gradient, 2, 0)
    np.testing.assert_allclose(found.values, values, atol=1e-10 * np.abs(values).max())
    np.testing.assert_allclose(found.gradient, gradient, atol=1e-8 * np.abs(gradient).max())


def by_square_root(model: ConfiguredModel, x: NDArray, lines: NDArray) -> NDArray:
    """Receptances at complex parameters with C = 2ζ M (M⁻¹K)^½, constant damping of all modes, by dense algebra."""
    point, ports = model.at(x), ports_of(model)
    K, M = point.stiffness.toarray(), point.mass.toarray()
    # M is diagonal: the symmetric form of M⁻¹K
    root = np.sqrt(np.diag(M))
    C = 2.0 * ZETA * root[:, None] * la.sqrtm(K / root[:, None] / root) * root
    s = 2j * np.pi * lines
    Z = s[:, None, None] ** 2 * M + s[:, None, None] * C + K
    return np.asarray(ports.outputs.toarray() @ np.linalg.solve(Z, ports.inputs.toarray()[None]))


@pytest.mark.parametrize("x", [REPEATED, APART], ids=["repeated", "apart"])
def test_derivatives_of_damping_are_those_of_a_function_of_the_matrix(x: NDArray) -> None:
    """(H(p + ih) − H(p − ih))/2ih, in directions that split repeated modes and in those of single parameters."""
    model, h = ring(), 1e-6
    found = in_basis(model, x, LINES, constant_damping(ZETA), 6).gradient
    for direction in (*np.eye(3), np.array([0.6, -0.5, 0.3])):
        ends = [by_square_root(model, x + sign * 1j * h * direction, LINES) for sign in (1, -1)]
        exact = (ends[0] - ends[1]) / (2j * h)
        np.testing.assert_allclose(found @ direction, exact, rtol=0.0, atol=1e-8 * np.abs(exact).max())


@pytest.mark.slow
def test_far_modes_are_interpolated_over_many_lines() -> None:
    """Lines below half of most natural frequencies, so that the far modes are most of the model."""
    model, lines = ring(), np.geomspace(0.05, 0.3, 60)
    full = frf_gradient(
        solve_modes(model.at(APART), 2), ports_of(model), lines, "receptance", "direct", damping=constant_damping(0.02)
    )
    found = in_basis(model, APART, lines, constant_damping(0.02), 2)
    values, gradient = np.moveaxis(full.frfs.values, -1, 0), np.moveaxis(full.gradient, 2, 0)
    assert np.abs(found.values / values - 1.0).max() < 1e-8
    np.testing.assert_allclose(found.gradient, gradient, atol=1e-8 * np.abs(gradient).max())


@pytest.mark.slow
@pytest.mark.parametrize("damped", DAMPED)
def test_functions_with_an_exponential_window_are_those_of_the_full_model(damped: str) -> None:
    """Many lines, so that the far modes are interpolated where no damping couples the modes."""
    model, lines, decay = ring(damped), np.geomspace(0.05, 0.3, 60), 0.2
    modes = solve_modes(model.at(APART), 2)
    damping = constant_damping(0.02)
    full = frf_gradient(modes, ports_of(model), lines, "receptance", "direct", damping=damping, decay=decay)
    found = in_basis(model, APART, lines, damping, 2, decay=decay)
    values, gradient = np.moveaxis(full.frfs.values, -1, 0), np.moveaxis(full.gradient, 2, 0)
    np.testing.assert_allclose(found.values, values, atol=1e-8 * np.abs(values).max())
    np.testing.assert_allclose(found.gradient, gradient, atol=1e-8 * np.abs(gradient).max())


def test_an_undamped_resonance_has_no_value() -> None:
    model = ring()
    resonance = float(solve_modes(model.at(REPEATED), 1).freq_hz[0])
    modes = reduced_modes(reduce_model(model, np.eye(6)).at(REPEATED), 6)
    exactly = np.array([1j * np.sqrt(modes.eigenvalues[0])])
    ports = BasisPorts(np.eye(6)[:, :1], np.eye(6))
    with np.errstate(invalid="ignore"):
        lost = reduced_functions(modes, ports, exactly, 6).values
    near = reduced_functions(modes, ports, 1.01 * exactly, 6).values
    assert resonance > 0.0
    assert not np.isfinite(lost).all() or np.abs(lost).max() > 1e12 * np.abs(near).max()


# ----------------------------------------------------------------------------------------------------
# A reduced model of a free plate that is trained for FRFs.


BAND = np.geomspace(30.0, 200.0, 60)
SOME = [f"{n}Z+" for n in (1, 7, 23, 40, 58)]


@pytest.fixture(scope="module")
def plate() -> ConfiguredModel:
    return three_thirds()


@pytest.fixture(scope="module")
def wanted(plate: ConfiguredModel) -> FunctionsWanted:
    ports = make_ports(plate, [SOME[0], SOME[2]], SOME)
    damped = solve_modes(plate.at(np.zeros(3)), None, 2.0 * BAND[-1]).wanted
    return FunctionsWanted(ports, BAND, damped, constant_damping(0.01))


@pytest.fixture(scope="module")
def trained(plate: ConfiguredModel, wanted: FunctionsWanted) -> Trained:
    trainer = Trainer(plate, TrainingRules(13, 1e-3, 6, 200, 8), functions=(wanted,))
    return trainer.train(trainer.start())


def _log_errors(trained: Trained, wanted: FunctionsWanted, x: NDArray) -> tuple[float, float, float]:
    """Of values and gradients, and the estimate."""
    plate = trained.model.configured
    damped = solve_modes(plate.at(x), wanted.damped)
    full = frf(damped, wanted.ports, BAND, "receptance", "direct", damping=wanted.damping).values
    modes = reduced_modes(trained.model.at(x), wanted.damped)
    found = reduced_functions(modes, wanted.on(trained.basis), 2j * np.pi * BAND, wanted.damped, wanted.damping)
    there = trained.estimator.at(trained.model, trained.basis, x)
    error = log_difference(np.moveaxis(found.values, 0, -1), full)
    return error, float(np.abs(found.gradient).max()), there.function_error


@pytest.mark.slow
def test_functions_are_those_of_the_full_model_over_the_box(trained: Trained, wanted: FunctionsWanted) -> None:
    assert trained.status.ok
    points = np.random.default_rng(5).uniform(-0.25, 0.25, (4, 3))
    errors, _, estimates = np.array([_log_errors(trained, wanted, x) for x in points]).T
    # the tolerance counts an error of 1 as one of 2 % in a frequency
    assert errors.max() < 1e-3 / 0.02
    # the estimate is of the size of the error
    assert (estimates > 0.5 * errors).all()
    assert (estimates < 10.0 * errors).all()


@pytest.mark.slow
def test_where_the_full_model_was_solved_values_and_gradients_are_its_own(
    plate: ConfiguredModel, trained: Trained, wanted: FunctionsWanted
) -> None:
    x = trained.certified[-1].x
    # superposed modes of the full model lack those above twice the band, which the basis has in part
    damped = solve_modes(plate.at(x), wanted.damped)
    full = frf_gradient(damped, wanted.ports, BAND, "receptance", "direct", damping=wanted.damping)
    modes = reduced_modes(trained.model.at(x), wanted.damped)
    found = reduced_functions(modes, wanted.on(trained.basis), 2j * np.pi * BAND, wanted.damped, wanted.damping)
    values, gradient = np.moveaxis(full.frfs.values, -1, 0), np.moveaxis(full.gradient, 2, 0)
    assert log_difference(found.values, values) < 1e-3
    off = np.linalg.norm(found.gradient / found.values[..., None] - gradient / values[..., None])
    assert off < 0.02 * np.linalg.norm(gradient / values[..., None])


def test_response_vectors_make_static_displacements_exact(plate: ConfiguredModel, wanted: FunctionsWanted) -> None:
    start = Trainer(plate, TrainingRules(13, 1e-3, 6, 200, 0), functions=(wanted,)).start()
    bare = Trainer(plate, TrainingRules(13, 1e-3, 6, 200, 0)).start()
    point = plate.at(np.zeros(3))
    A = point.symmetric_stiffness.plus(-start.model.shift, point.symmetric_mass)
    F = wanted.ports.inputs.toarray()
    exact = start.estimator.factor.solve(np.asfortranarray(F))
    for trained, tolerance in ((start, 1e-3), (bare, 1.0)):
        small = trained.basis @ np.linalg.solve(trained.basis.T @ (A @ trained.basis), trained.basis.T @ F)
        off = np.einsum("ij,ij->j", F, exact - small) / np.einsum("ij,ij->j", F, exact)
        assert (off < tolerance).all()
    assert isinstance(start.model.at(np.zeros(3)), ReducedPoint)
