"""Checks of derivatives that models and residuals inherit, each where it holds.

=====================================  =====================================================  ========
what                                   how                                                    to
=====================================  =====================================================  ========
matrices K(x), M(x), C(x), H(x)        complex step                                           1e-9
simple eigenpairs, small models        complex step through the dense standard form M⁻¹K      1e-9
eigenvectors of any model              residual of the derivative equation                    1e-7
whatever is smooth (residuals)         Taylor slope 2 over five halvings                      0.1
clusters and repeated modes            central difference along one direction, h ≈ 1e-6       1e-6
=====================================  =====================================================  ========
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.model import EigenSolution, ModelPoint, solve_modes, subspace_derivative
from femtune.residuals import UpdateProblem

if TYPE_CHECKING:
    from femtune.study.described import Study

STEP = 1e-30
"""Complex step: nothing is subtracted, so it may be this small."""
EIGEN_STEP = 1e-20
"""Complex step through an eigen-solution, whose vectors are divided by their largest entry."""
DIFFERENCE_STEP = 1e-6
"""Central difference: its errors of truncation (h²) and of rounding (ε/h) are both below 1e-9."""
MASSLESS = 1e12
"""Condition number of a mass matrix beyond which some direction counts as massless."""
TOLERANCE = 1e-9
"""Difference of a derivative from its complex step, relative to its largest entry."""
VANISHING = 1e-12
"""Part of the first derivative below which a second one is rounding."""


def check_model(point: ModelPoint, modes: Sequence[int] = (), count: int | None = None) -> None:
    """All checks of a model at a point: matrices, then the given simple modes (positions).

    Raises AssertionError. Modes are checked by complex step where the model has at most 60 DOFs with mass, and by the
    residual of the derivative equation always.
    """
    check_matrix_derivatives(point)
    if not modes:
        return
    solution = solve_modes(point, count if count is not None else max(modes) + 1)
    for j in modes:
        check_derivative_equation(solution, [j])
        if point.configured.n_free <= 60:
            check_simple_mode(solution, j)


@dataclass(frozen=True)
class _Matrix:
    """A matrix of a model point, its first derivatives, and a second one."""

    name: str
    value: Callable[[ModelPoint], sp.sparray]
    first: Callable[[ModelPoint], Sequence[sp.sparray]]
    second: Callable[[ModelPoint, int, int], sp.sparray]


_MATRICES = (
    _Matrix(
        "stiffness",
        lambda p: p.stiffness,
        lambda p: p.stiffness_derivatives,
        lambda p, i, j: p.stiffness_second_derivative(i, j),
    ),
    _Matrix("mass", lambda p: p.mass, lambda p: p.mass_derivatives, lambda p, i, j: p.mass_second_derivative(i, j)),
    _Matrix(
        "viscous",
        lambda p: p.viscous,
        lambda p: p.viscous_derivatives,
        lambda p, i, j: p.viscous_second_derivative(i, j),
    ),
    _Matrix(
        "hysteretic",
        lambda p: p.hysteretic,
        lambda p: p.hysteretic_derivatives,
        lambda p, i, j: p.hysteretic_second_derivative(i, j),
    ),
)


def check_matrix_derivatives(point: ModelPoint) -> None:
    """K, M, C and H are symmetric; first and second derivatives agree with complex steps."""
    for kind in _MATRICES:
        matrix = kind.value(point)
        _close(matrix - matrix.T, 0.0 * matrix, matrix, f"{kind.name}: symmetry")
    for i in range(point.n_parameters):
        stepped = replace(point, x=point.x + 1j * STEP * np.eye(point.n_parameters)[i])
        for kind in _MATRICES:
            exact = kind.first(point)[i]
            _close(kind.value(stepped).imag / STEP, exact, exact, f"{kind.name}: derivative {i}")
            _check_second(point, stepped, kind, i)


def _check_second(point: ModelPoint, stepped: ModelPoint, kind: _Matrix, i: int) -> None:
    for j in range(point.n_parameters):
        exact = kind.second(point, i, j)
        by_step = kind.first(stepped)[j].imag / STEP
        # a second derivative that vanishes except for rounding is compared with the first
        first = kind.first(point)[j]
        scale = exact if _size(exact) > VANISHING * _size(first) else first
        _close(by_step, exact, scale, f"{kind.name}: second derivative {i}, {j}")


def _close(by_step: Any, exact: Any, scale: Any, what: str) -> None:
    size = _size(scale)
    worst = float(np.abs((by_step - exact).toarray()).max(initial=0.0))
    assert worst <= TOLERANCE * size, f"{what}: off by {worst:.3g} of {size:.3g}"


def _size(matrix: Any) -> float:
    return float(np.abs(matrix.data).max(initial=0.0))


def check_simple_mode(solution: EigenSolution, j: int, tolerance: float = TOLERANCE) -> float:
    """Gradients of eigenvalue and mass-normalised shape of a simple mode against complex steps; the worst error.

    Dense, standard form M⁻¹K, or (K − σM)⁻¹M with the solution's shift σ where some direction has no mass.
    """
    point = solution.point
    exact = subspace_derivative(solution, [j])
    worst = 0.0
    for i in range(point.n_parameters):
        value, shape = _complex_mode(solution, i, j)
        slope = solution.eigenvalues[j] - solution.shift
        errors = (
            abs(value.imag / EIGEN_STEP - exact.eigenvalue_gradient[i]) / slope,
            float(np.abs(shape.imag / EIGEN_STEP - exact.shape_gradient[:, i]).max() / np.abs(exact.shapes).max()),
        )
        worst = max(worst, *errors)
        assert worst <= tolerance, (
            f"mode {j}, parameter {i}: eigenvalue off by {errors[0]:.2g}, shape by {errors[1]:.2g}"
        )
    return worst


def _complex_mode(solution: EigenSolution, i: int, j: int) -> tuple[complex, NDArray]:
    """Mode j at x + ih eᵢ, normalised by φᵀMφ = 1 (no conjugate)."""
    point = solution.point
    stepped = point.configured.at(point.x + 1j * EIGEN_STEP * np.eye(point.n_parameters)[i])
    K, M = stepped.stiffness.toarray(), stepped.mass.toarray()
    values, vectors = _standard_form(K, M, solution.shift)
    nearest = int(np.argmin(np.abs(values - solution.eigenvalues[j])))
    phi = vectors[:, nearest]
    phi = phi / phi[np.argmax(np.abs(phi))]
    phi = phi / np.sqrt(phi @ M @ phi)
    return values[nearest], phi * np.sign((phi.real) @ solution.shapes[:, j])


def _standard_form(K: NDArray, M: NDArray, shift: float) -> tuple[NDArray, NDArray]:
    """Eigenvalues λ and vectors; the infinite ones of massless directions are left out."""
    if np.linalg.cond(M.real) < MASSLESS:
        values, vectors = np.linalg.eig(np.linalg.solve(M, K))
        return values, vectors
    inverse, vectors = np.linalg.eig(np.linalg.solve(K - shift * M, M))
    finite = np.abs(inverse) > np.abs(inverse).max() / MASSLESS
    return shift + 1.0 / inverse[finite], vectors[:, finite]


def check_derivative_equation(solution: EigenSolution, members: Sequence[int], tolerance: float = 1e-7) -> float:
    """Residual of (K − λM)Φ′ + (K′ − λM′)Φ, as energy, outside the subspace; its worst ratio to the force.

    Holds for single modes, for clusters and at any size of the model.
    """
    point, derivative = solution.point, subspace_derivative(solution, members)
    phi = solution.shapes[:, list(members)]
    m_phi, worst = point.mass @ phi, 0.0
    for j, value in enumerate(derivative.eigenvalues):
        for i in range(point.n_parameters):
            force = point.stiffness_derivatives[i] @ phi[:, j] - value * (point.mass_derivatives[i] @ phi[:, j])
            u = derivative.outside[:, j, i]
            rest = point.stiffness @ u - value * (point.mass @ u) + force
            rest = rest - m_phi @ (phi.T @ rest)
            ratio = _energy(solution, rest) / max(_energy(solution, force), 1e-300)
            worst = max(worst, ratio)
            assert ratio <= tolerance, f"mode {members[j]}, parameter {i}: the equation is off by {ratio:.2g}"
    return worst


def _energy(solution: EigenSolution, force: Reals) -> float:
    return float(np.sqrt(abs(force @ solution.factor.solve(force))))


def check_taylor_slope(
    function: Callable[[Reals], Reals], value: Reals, jacobian: Reals, x: Reals, length: float = 0.01, seed: int = 0
) -> float:
    """|f(x + t d) − f(x) − t J d| falls with slope 2 over five halvings; returns the slope that is nearest to 2.

    A function that is linear to rounding passes.
    """
    d = length * np.random.default_rng(seed).uniform(-1.0, 1.0, len(x))
    steps = 0.5 ** np.arange(6)
    rest = np.array([np.linalg.norm(function(x + t * d) - value - t * (jacobian @ d)) for t in steps])
    if rest[0] <= 1e-11 * max(np.linalg.norm(value), np.linalg.norm(jacobian @ d)):
        return 2.0
    slopes = np.log2(rest[:-1] / rest[1:])
    best = float(slopes[np.argmin(np.abs(slopes - 2.0))])
    assert np.median(np.abs(slopes - 2.0)) < 0.1, f"Taylor slopes {slopes} are not 2"
    return best


def check_directional(
    function: Callable[[Reals], Reals],
    jacobian: Reals,
    x: Reals,
    direction: Reals,
    tolerance: float = 1e-6,
    step: float = DIFFERENCE_STEP,
) -> float:
    """J d against a central difference along one direction; the relative error.

    For functions of clusters and repeated modes, where complex steps fail.
    """
    difference = (function(x + step * direction) - function(x - step * direction)) / (2.0 * step)
    exact = jacobian @ direction
    size = max(float(np.linalg.norm(exact)), float(np.linalg.norm(jacobian)), 1e-300)
    error = float(np.linalg.norm(difference - exact)) / size
    assert error <= tolerance, f"directional derivative off by {error:.2g}"
    return error


def check_residual(problem: UpdateProblem | Study, x: Reals, tolerance: float = 1e-6, length: float = 0.01) -> None:
    """Jacobian of all residual blocks: along each parameter by central difference, and by Taylor slope.

    The pairing is frozen and each motion is tracked, as in an update.

    Parameters
    ----------
    problem : or a study, whose problem it is
    x : (k,) relative changes of the free parameters
    tolerance : largest relative error of a directional derivative
    length : largest step of the Taylor slope

    Raises
    ------
    AssertionError : the derivatives are not those of the values
    FemtuneError : ``residual.own`` for blocks that do not fit, and errors of the study
    """
    if not isinstance(problem, UpdateProblem):
        from femtune.study.study import load_study  # noqa: PLC0415  checks of models need no study

        problem = load_study(problem.file).problem()
    start = problem.start(np.asarray(x, dtype=float))

    def residuals(at: Reals) -> Reals:
        return problem.follow(at, start).residuals

    for direction in np.eye(len(x)):
        check_directional(residuals, start.jacobian, start.x, direction, tolerance)
    check_taylor_slope(residuals, start.residuals, start.jacobian, start.x, length)


class ModelDerivativeChecks:
    """Base of test classes: subclasses define `make_point` and the simple modes, and inherit the checks."""

    simple_modes: tuple[int, ...] = (0,)
    clusters: tuple[tuple[int, ...], ...] = ()

    def make_point(self) -> ModelPoint:
        """The model at the point where its derivatives are checked."""
        raise AssertionError("a subclass says which model is checked")

    def test_matrices(self) -> None:
        check_matrix_derivatives(self.make_point())

    def test_simple_modes(self) -> None:
        check_model(self.make_point(), self.simple_modes)

    def test_clusters(self) -> None:
        point = self.make_point()
        for members in self.clusters:
            check_derivative_equation(solve_modes(point, max(members) + 1), members)


class ResidualDerivativeChecks:
    """Base of test classes: subclasses define `make_problem` and the points, and inherit the checks."""

    points: tuple[tuple[float, ...], ...] = ()

    def make_problem(self) -> UpdateProblem:
        """The problem whose Jacobian is checked."""
        raise AssertionError("a subclass says which problem is checked")

    def test_jacobian(self) -> None:
        problem = self.make_problem()
        for x in self.points or ((0.0,) * len(problem.parameters.free),):
            check_residual(problem, np.array(x))
