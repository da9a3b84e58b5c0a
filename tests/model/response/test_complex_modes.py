"""Complex modes against closed forms and dense linear algebra, and their derivatives."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model import ConfiguredModel, solve_modes
from femtune.model.damping import ModalDamping, as_hysteretic, constant_damping
from femtune.model.response import ComplexModes, complex_eigen, complex_mode_derivative, complex_modes
from femtune.model.response.dynamic_stiffness import DynamicStiffness
from structures.frames import bars, make_structure

from .models import SECTION, beam, chain, configured, matrices, point, rising

SPRINGS = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0), (0, 2, 150.0)]
MASSES = [1.0, 2.0, 1.5, 1.0]
LOSS = [0.02, 0.1, 0.0, 0.3, 0.0]
DASHPOTS = [(-1, 1, 3.0), (2, 3, 5.0)]


def _of(*arguments: object, count: int = 10, **more: object) -> ComplexModes:
    return complex_modes(solve_modes(point(chain(*arguments, **more)), count))  # type: ignore[arg-type]


def _companion(K: NDArray, M: NDArray, C: NDArray) -> tuple[NDArray, NDArray]:
    """All poles and vectors of λ²M + λC + K by the companion matrix."""
    n = len(K)
    inverse = np.linalg.inv(M)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ K, -inverse @ C]])
    poles, vectors = la.eig(state)
    return poles, vectors[:n]


def test_one_mass_underdamped() -> None:
    m, k, c = 2.0, 800.0, 8.0
    modes = _of([(-1, 0, k)], [m], [(-1, 0, c)])
    wn, zeta = np.sqrt(k / m), c / (2 * np.sqrt(k * m))
    np.testing.assert_allclose(modes.poles, [-zeta * wn + 1j * wn * np.sqrt(1 - zeta**2)], rtol=1e-12)
    np.testing.assert_allclose((modes.freq_hz[0], modes.damping_ratio[0]), (wn / (2 * np.pi), zeta), rtol=1e-12)
    # A = 2λm + c, so ψ² = 1/(2λm + c)
    np.testing.assert_allclose(modes.shapes[0, 0] ** 2, 1 / (2 * modes.poles[0] * m + c), rtol=1e-12)
    assert modes.complete
    assert modes.kinds == ("oscillating",)


def test_one_mass_overdamped_has_two_real_poles() -> None:
    m, k, c = 2.0, 800.0, 200.0
    modes = complex_modes(solve_modes(point(chain([(-1, 0, k)], [m], [(-1, 0, c)])), 1), 2)
    root = np.sqrt(c**2 - 4 * k * m)
    np.testing.assert_allclose(modes.poles, [(-c + root) / (2 * m), (-c - root) / (2 * m)], rtol=1e-12)
    assert modes.kinds == ("real", "real")
    np.testing.assert_allclose(modes.damping_ratio, 1.0)


def test_loss_factor_gives_one_pole_in_the_upper_half_plane() -> None:
    m, k, eta = 2.0, 800.0, 0.2
    modes = complex_modes(solve_modes(point(chain([(-1, 0, k)], [m], loss=eta)), 1), 5)
    np.testing.assert_allclose(modes.poles, [1j * np.sqrt(k * (1 + 1j * eta) / m)], rtol=1e-12)
    assert modes.poles.real < 0


def test_spring_and_dashpot_in_series_creep() -> None:
    """A massless point between a spring k and a dashpot c to ground: a pole at −k/c."""
    k, c = 300.0, 600.0
    modes = complex_modes(solve_modes(point(chain([(-1, 0, 9e5), (0, 1, k)], [1.0, 0.0], [(-1, 1, c)])), 1), 2)
    assert modes.kinds == ("real", "oscillating")
    np.testing.assert_allclose(modes.poles[0], -k / c, rtol=1e-3)


def test_a_free_mass_on_a_dashpot() -> None:
    """mλ² + cλ = 0: at rest anywhere, and slowing down with −c/m."""
    m, c = 2.0, 3.0
    modes = complex_modes(
        solve_modes(point(chain([(0, 1, 1e4)], [m / 2, m / 2], [(-1, 0, c / 2), (-1, 1, c / 2)])), 2), 3
    )
    assert modes.kinds == ("rigid", "real", "oscillating")
    np.testing.assert_allclose(modes.poles[:2], [0.0, -c / m], atol=1e-9)
    assert np.isnan(modes.damping_ratio[0])


def test_rigid_body_modes_that_nothing_damps_stay_apart() -> None:
    modes = _of([(0, 1, 100.0), (1, 2, 50.0)], [1.0, 1.0, 2.0], [(0, 1, 1.0)])
    assert modes.kinds == ("rigid", "oscillating", "oscillating")
    assert modes.poles[0] == 0.0
    np.testing.assert_allclose(np.abs(modes.shapes[:, 0]), 0.5, rtol=1e-12)


def test_proportional_damping_keeps_the_real_shapes() -> None:
    real = solve_modes(point(chain(SPRINGS, MASSES, loss=0.04)), 4)
    modes = complex_modes(real)
    np.testing.assert_allclose(modes.poles, 1j * np.sqrt(real.eigenvalues[:4] * (1 + 0.04j)), rtol=1e-10)
    np.testing.assert_allclose(modes.phase_collinearity, 1.0, rtol=1e-10)


def test_poles_of_modal_damping() -> None:
    real = solve_modes(point(chain(SPRINGS, MASSES)), 4)
    damping = rising(0.02, 3.0)
    modes = complex_modes(real, damping=damping)
    np.testing.assert_allclose(modes.damping_ratio, damping.ratio(real.freq_hz), rtol=1e-9)
    np.testing.assert_allclose(modes.freq_hz, real.freq_hz, rtol=1e-10)


@pytest.mark.parametrize("loss", [0.0, LOSS])
def test_all_poles_of_a_damped_chain(loss: float | list[float]) -> None:
    at = point(chain(SPRINGS, MASSES, DASHPOTS, loss))
    K, M, C, H = matrices(at)
    poles, _ = _companion(K + 1j * H, M, C)
    upper = poles[poles.imag > 0]
    modes = complex_modes(solve_modes(at, 4))
    np.testing.assert_allclose(modes.poles, upper[np.argsort(np.abs(upper))], rtol=1e-11)
    assert modes.residuals.max() < 1e-12
    assert (modes.phase_collinearity < 0.999).any()


def test_residues_of_viscous_modes_add_up_to_the_receptance() -> None:
    """H = Σ ψψᵀ/(iω − λ) + ψ*ψ*ᵀ/(iω − λ*) with modal A = 1."""
    at = point(chain(SPRINGS, MASSES, DASHPOTS))
    K, M, C, _ = matrices(at)
    modes = complex_modes(solve_modes(at, 4))
    w = 7.0
    upper = (modes.shapes / (1j * w - modes.poles)) @ modes.shapes.T
    lower = (modes.shapes.conj() / (1j * w - modes.poles.conj())) @ modes.shapes.T.conj()
    sums = upper + lower
    np.testing.assert_allclose(sums, np.linalg.inv(K - w**2 * M + 1j * w * C), rtol=1e-9)


def test_coinciding_poles_are_bilinearly_orthogonal() -> None:
    at = point(chain([(-1, i, 100.0) for i in range(3)], [1.0] * 3, [(-1, i, 2.0) for i in range(3)]))
    modes = complex_modes(solve_modes(at, 3))
    _, M, C, _ = matrices(at)
    np.testing.assert_allclose(modes.shapes.T @ (2 * modes.poles[0] * M + C) @ modes.shapes, np.eye(3), atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("clamped", [True, False])
@pytest.mark.parametrize("loss", [0.0, 0.02])
def test_iteration_finds_the_poles_of_the_dense_way(
    clamped: bool, loss: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A beam with dashpots to ground and between its points."""
    n = 20
    at = beam(n, clamped=clamped, dashpots=[(6 * n + 1, -1, 20.0), (6 * 7 + 1, 6 * 15 + 1, 50.0)], GE=loss)
    real = solve_modes(at, 10)
    dense = complex_modes(real)
    monkeypatch.setattr(complex_eigen, "DENSE_UP_TO", 10)
    found = complex_modes(real)
    assert dense.complete
    assert not found.complete
    assert [n.code for n in found.notices] == ["complex.not-counted"]
    assert found.kinds == dense.kinds
    np.testing.assert_allclose(found.poles, dense.poles, rtol=1e-8, atol=1e-7)
    assert found.residuals.max() <= 1e-8


def test_a_pole_at_zero_without_damping_is_as_exact_as_any_other() -> None:
    """What rounding may make of it is divided by the damping, where there is some."""
    modes = solve_modes(point(chain(SPRINGS, MASSES, loss=0.02)), 4)
    problem = complex_eigen.quadratic_problem(modes, DynamicStiffness(modes.point))
    zero, other = problem.rounding_of(np.array([0.0, 20j]), np.ones((4, 2)))
    assert zero == other < 1e-3 * problem.origin


def test_the_backward_error_does_not_depend_on_the_signs_of_directions() -> None:
    """Displacement frames turned by half a turn about z: x and y the other way around at every second grid point."""
    xyz = [[0.3 * i, 0.1 * i * i, 0.0] for i in range(4)]
    turned = np.tile(np.eye(3), (4, 1, 1))
    turned[::2] = np.diag([-1.0, -1.0, 1.0])
    signs = np.concatenate([np.diag(frame) for frame in np.repeat(turned, 2, axis=0)])
    psi = np.random.default_rng(1).standard_normal(24) + 0.3j
    errors = []
    for frames, shape in ((None, psi), (turned, signs * psi)):
        at = point(make_structure(xyz, [bars([[0, 1], [1, 2], [2, 3]], SECTION)], frames, consistent_mass=True))
        errors.append(complex_eigen.backward_error(DynamicStiffness(at), 3e5j, shape))
    assert errors[1] == pytest.approx(errors[0], rel=1e-12)


def test_critical_damping_is_refused() -> None:
    with pytest.raises(FemtuneError) as caught:
        _of([(-1, 0, 100.0)], [1.0], [(-1, 0, 20.0)], count=1)
    assert caught.value.code == "response.defective"


FACTORS = {"k": ("K", 2), "m": ("M", 3), "c": ("B", 1), "g": ("GE", 2)}


def _model() -> ConfiguredModel:
    return configured(chain(SPRINGS, MASSES, DASHPOTS, LOSS), FACTORS)


def _dense_mode(model: ConfiguredModel, x: NDArray, pole: complex, shape: NDArray) -> tuple[complex, NDArray]:
    """The mode nearest to a known one at a complex parameter vector, A = 1 and of the same sign."""
    K, M, C, H = matrices(model.at(x))
    poles, vectors = _companion(K + 1j * H, M, C)
    j = int(np.argmin(np.abs(poles - pole)))
    v = vectors[:, j]
    v = v / np.sqrt(v @ (2 * poles[j] * M + C) @ v)
    return poles[j], v * np.sign((v @ shape.conj()).real)


@pytest.mark.slow
@pytest.mark.parametrize("mode", range(4))
def test_derivatives_by_complex_difference(mode: int) -> None:
    model, h = _model(), 1e-6
    modes = complex_modes(solve_modes(model.at(np.zeros(4)), 4))
    found = complex_mode_derivative(modes, mode)
    assert found.residuals.max() < 1e-13
    for i in range(4):
        step = 1j * h * np.eye(4)[i]
        ends = [_dense_mode(model, x, modes.poles[mode], modes.shapes[:, mode]) for x in (step, -step)]
        pole, shape = ((a - b) / (2j * h) for a, b in zip(*ends))
        np.testing.assert_allclose(found.pole[i], pole, rtol=1e-7, atol=3e-9 * abs(modes.poles[mode]))
        np.testing.assert_allclose(found.shape[:, i], shape, rtol=1e-6, atol=1e-7 * np.abs(shape).max() + 1e-9)


@pytest.mark.quick(0)
@pytest.mark.parametrize("damping", [rising(0.03, 4.0), as_hysteretic(rising(0.03, 4.0))])
def test_derivatives_with_modal_damping(damping: ModalDamping) -> None:
    """By differences of fourth order: the damper follows the real modes, which are not complex-differentiable here."""
    model, h = _model(), 1e-4
    modes = complex_modes(solve_modes(model.at(np.zeros(4)), 4), damping=damping)
    found = complex_mode_derivative(modes, 1)
    for i in range(4):
        at = [complex_modes(solve_modes(model.at(s * h * np.eye(4)[i]), 4), damping=damping) for s in (1, -1, 2, -2)]
        p, v = [m.poles[1] for m in at], [m.shapes[:, 1] for m in at]
        np.testing.assert_allclose(found.pole[i], (8 * (p[0] - p[1]) - (p[2] - p[3])) / (12 * h), rtol=1e-6, atol=1e-7)
        difference = (8 * (v[0] - v[1]) - (v[2] - v[3])) / (12 * h)
        np.testing.assert_allclose(found.shape[:, i], difference, rtol=1e-5, atol=1e-8)


def test_derivative_of_one_mass_with_a_loss_factor() -> None:
    """λ = iω√(1 + iη): dλ/dx is λ/2 for a factor on k, and the shape changes with A = 2λm alone."""
    at = configured(chain([(-1, 0, 800.0)], [2.0], loss=[0.07]), {"k": ("K", 1)}).at(np.array([0.3]))
    modes = complex_modes(solve_modes(at, 1))
    found = complex_mode_derivative(modes, 0)
    np.testing.assert_allclose(found.pole, modes.poles / 2.0 / 1.3, rtol=1e-10)
    np.testing.assert_allclose(found.shape, -modes.shapes / 4.0 / 1.3, rtol=1e-10)


def test_derivative_at_some_rows() -> None:
    modes = complex_modes(solve_modes(_model().at(np.zeros(4)), 4))
    rows = sp.csr_array([[0.0, 0.0, 1.0, -2.0]])
    whole, some = complex_mode_derivative(modes, 0), complex_mode_derivative(modes, 0, rows)
    np.testing.assert_allclose(some.shape, rows @ whole.shape, rtol=1e-12)


@pytest.mark.parametrize("what", ["coinciding", "rigid"])
def test_modes_without_derivatives_of_their_own_are_refused(what: str) -> None:
    springs = [(-1, i, 100.0) for i in range(2)] if what == "coinciding" else [(0, 1, 100.0)]
    modes = complex_modes(
        solve_modes(point(chain(springs, [1.0] * 2), {"k": ("K", 1)}), 2), damping=constant_damping(0.01)
    )
    with pytest.raises(FemtuneError) as caught:
        complex_mode_derivative(modes, 0)
    assert caught.value.code == "derivative.close-poles"
