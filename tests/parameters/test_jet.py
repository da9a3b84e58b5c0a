"""Gradient and Hessian of jets against complex step: the jet's own arithmetic on complex arguments."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from femtune.parameters import jet
from femtune.parameters.jet import Jet

_STEP = 1e-30
_FORMULAS: dict[str, Callable[[Jet], Jet]] = {
    "bending stiffness E t^3 / (1 - nu^2)": lambda v: v[0] * v[1] ** 3 / (1.0 - (v[2] / 10.0) ** 2),
    "shear-flexible bar": lambda v: 12.0 * v[0] * v[1] / (1.0 + 12.0 * v[1] / (v[2] * 0.4)),
    "square root of a product": lambda v: jet.sqrt(v[0] * v[1]) - v[2],
    "logarithm of a quotient": lambda v: jet.log(v[0] / v[1]) * v[2],
    "parameter in the exponent": lambda v: v[0] ** v[1] + 2.0 ** v[2],
    "angles": lambda v: jet.sin(v[0]) * jet.cos(v[1]) + jet.tan(v[2] / 4.0),
    "exponential": lambda v: jet.exp(-v[0] * v[1]) / v[2],
    "number on the left": lambda v: 1.0 - 3.0 / v[0] + 2.0 * v[1] * np.float64(0.5) + (-v[2]),
}
_POINTS = st.lists(st.floats(0.3, 3.0), min_size=3, max_size=3).map(np.array)


def _at(formula: Callable[[Jet], Jet], x: NDArray) -> Jet:
    return formula(jet.variables(x))


def _shifted(x: NDArray, k: int) -> NDArray:
    return x + 1j * _STEP * np.eye(x.size)[k]


@pytest.mark.quick(3)
@pytest.mark.parametrize("formula", _FORMULAS.values(), ids=_FORMULAS.keys())
@given(x=_POINTS)
@settings(max_examples=25)
def test_gradient_and_hessian_are_those_of_complex_step(formula: Callable[[Jet], Jet], x: NDArray) -> None:
    exact = _at(formula, x)
    steps = [_at(formula, _shifted(x, k)) for k in range(3)]
    grad = np.array([s.value.imag / _STEP for s in steps])
    hess = np.array([s.grad.imag / _STEP for s in steps])
    np.testing.assert_allclose(exact.grad, grad, rtol=1e-9, atol=1e-9 * np.abs(grad).max())
    np.testing.assert_allclose(exact.hess, hess, rtol=1e-9, atol=1e-9 * np.abs(hess).max())
    short = formula(jet.variables(x, curved=False))
    assert short.hess.shape == (0, 0)
    np.testing.assert_array_equal(short.grad, exact.grad)


@given(x=st.floats(-3.0, 3.0), n=st.integers(0, 4))
def test_whole_powers_are_exact_at_zero_and_below(x: float, n: int) -> None:
    power = jet.variables(np.array([x]))[0] ** n
    polynomial = np.polynomial.Polynomial([0.0] * n + [1.0])
    # numbers below the smallest normal one have fewer digits
    near = {"rtol": 1e-12, "atol": np.finfo(float).tiny}
    np.testing.assert_allclose(power.value, polynomial(x), **near)
    np.testing.assert_allclose(power.grad[0], polynomial.deriv(1)(x), **near)
    np.testing.assert_allclose(power.hess[0, 0], polynomial.deriv(2)(x), **near)


def test_arrays_of_jets_follow_their_entries() -> None:
    v = jet.variables(np.array([1.5, 2.0]))
    both = jet.stack([v[0] * v[1], v[0] ** 2])
    np.testing.assert_array_equal(both.value, [3.0, 2.25])
    np.testing.assert_array_equal(both.grad, [[2.0, 1.5], [3.0, 0.0]])
    np.testing.assert_array_equal(both.hess, [[[0, 1], [1, 0]], [[2, 0], [0, 0]]])


def test_numpy_numbers_on_the_left_leave_the_arithmetic_to_the_jet() -> None:
    v = jet.variables(np.array([2.0]))[0]
    for product in (np.float64(3.0) * v, np.array(3.0) * v, v * np.float64(3.0)):
        assert isinstance(product, Jet)
        assert product.grad[0] == 3.0


def test_an_array_of_jets_times_an_array_of_numbers() -> None:
    scaled = jet.variables(np.array([1.0, 2.0])) * np.array([10.0, 20.0]) + np.array([0.0, 5.0])
    np.testing.assert_array_equal(scaled.value, [10.0, 45.0])
    np.testing.assert_array_equal(scaled.grad, np.diag([10.0, 20.0]))
