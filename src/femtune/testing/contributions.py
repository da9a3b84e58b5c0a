"""Check of an element's contribution: constant symmetric matrices, and exact derivatives of its coefficient."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.contribution import Contribution
from femtune.parameters.jet import Jet

STEP = 1e-30
"""Complex step: nothing is subtracted, so that it may be as small as this."""
TOLERANCE = 1e-9
"""Difference of a derivative from its complex step, relative to the largest derivative of the batch."""
ROUNDING = 1e-13
"""Remainder of a Taylor series relative to the value below which it is rounding."""


def check_contribution(term: Contribution, values: Mapping[str, Reals]) -> None:
    """Raise AssertionError if a term breaks its contract.

    Matrices must be symmetric, one an element; the gradient and the Hessian of the coefficient by each of its roles
    must agree with complex steps to TOLERANCE, its remainder after the gradient must fall with slope 2, and without
    second derivatives the gradient must be the same.

    Parameters
    ----------
    term : what an element's kernel returned
    values : (m,) values of the term's roles, for example those of the deck
    """
    check_matrices(term)
    x = np.stack([np.asarray(values[r], float) for r in term.roles], axis=1)
    check_gradient(term, x)
    check_hessian(term, x)
    check_taylor_slope(term, x)
    check_without_hessian(term, x)


def check_matrices(term: Contribution) -> None:
    """Matrices are (m, d, d), finite and symmetric; facts have one entry an element."""
    m = len(term.at)
    assert term.matrices.shape[0] == m
    assert term.matrices.shape[1] == term.matrices.shape[2]
    assert np.isfinite(term.matrices).all()
    np.testing.assert_array_equal(term.matrices, np.swapaxes(term.matrices, 1, 2), err_msg=f"{term.label}: symmetry")
    assert all(len(f) == m for f in term.facts.values())


def evaluate(term: Contribution, x: NDArray, curved: bool = True) -> Jet:
    """The coefficient at x (m, k), with derivatives by its k roles; second ones if `curved`."""
    k = x.shape[1]
    h = k if curved else 0
    unit = np.eye(k, dtype=x.dtype)
    roles = {
        role: Jet(x[:, i], np.broadcast_to(unit[i], x.shape).copy(), np.zeros((len(x), h, h), x.dtype))
        for i, role in enumerate(term.roles)
    }
    out = term.coefficient(roles, term.facts)
    assert isinstance(out, Jet)
    assert out.value.shape == (len(x),)
    return out


def _stepped(term: Contribution, x: Reals, i: int) -> Jet:
    # relative to the value: moduli of 1e11 and areas of 1e-6 stand side by side
    step = np.zeros(x.shape, complex)
    step[:, i] = 1j * STEP * _scale(x)[:, i]
    return evaluate(term, x + step)


def _scale(x: Reals) -> Reals:
    return np.where(x == 0.0, 1.0, np.abs(x))


def check_gradient(term: Contribution, x: Reals) -> None:
    """Gradient against complex steps of the value."""
    exact = evaluate(term, x).grad * _scale(x)
    for i, role in enumerate(term.roles):
        by_step = _stepped(term, x, i).value.imag / STEP
        _agree(exact[:, i], by_step, exact, f"{term.label}: derivative by {role}")


def check_hessian(term: Contribution, x: Reals) -> None:
    """Hessian against complex steps of the gradient."""
    scale = _scale(x)
    exact = evaluate(term, x).hess * scale[:, :, None] * scale[:, None, :]
    for i, role in enumerate(term.roles):
        by_step = _stepped(term, x, i).grad.imag / STEP * scale
        _agree(exact[:, i], by_step, exact, f"{term.label}: second derivatives by {role}")


def check_without_hessian(term: Contribution, x: Reals) -> None:
    """Without second derivatives: the same value and gradient."""
    whole, short = evaluate(term, x), evaluate(term, x, curved=False)
    assert short.hess.shape == (len(x), 0, 0)
    np.testing.assert_array_equal(short.value, whole.value, err_msg=term.label)
    np.testing.assert_array_equal(short.grad, whole.grad, err_msg=term.label)


def _agree(exact: Reals, by_step: Reals, whole: Reals, what: str) -> None:
    size = np.abs(whole).max(initial=0.0)
    np.testing.assert_allclose(by_step, exact, rtol=TOLERANCE, atol=TOLERANCE * size, err_msg=what)


def check_taylor_slope(term: Contribution, x: Reals, seed: int = 0) -> None:
    """Remainder f(x + t d) − f(x) − t ∇f·d falls with slope 2 over seven halvings, unless it is rounding."""
    direction = np.random.default_rng(seed).uniform(-1.0, 1.0, x.shape) * _scale(x)
    start = evaluate(term, x)
    slope = np.einsum("ei,ei->e", start.grad, direction)
    steps = 0.05 * 0.5 ** np.arange(8)
    rest = np.array(
        [np.abs(evaluate(term, x + t * direction).value - start.value - t * slope).max(initial=0.0) for t in steps]
    )
    if (rest <= ROUNDING * np.abs(start.value).max(initial=1e-300)).all():
        return
    rates = np.log2(rest[:-1] / rest[1:])
    assert abs(rates[-1] - 2.0) < 0.1, f"{term.label}: Taylor slopes {rates} are not 2"
