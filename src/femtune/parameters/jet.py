"""Jet: a value that carries its exact gradient and Hessian through arithmetic.

Coefficients of model terms are functions of the whole parameter vector. They are written once in plain arithmetic and
give values, first and second derivatives by forward differentiation, for real or complex arguments.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Jet:
    """Array of values with derivatives in k variables.

    `value` has any shape s, `grad` shape s + (k,), `hess` shape s + (h, h): second derivatives in the first h
    variables. h is k, or zero where nobody needs second derivatives: they would take most of the time if there are
    many variables.
    """

    value: NDArray
    grad: NDArray
    hess: NDArray

    # numpy must hand arithmetic over to the methods below
    __array_ufunc__ = None

    @property
    def n_variables(self) -> int:
        """Number k of variables of the derivatives."""
        return self.grad.shape[-1]

    @property
    def n_curved(self) -> int:
        """Number h of variables of the second derivatives."""
        return self.hess.shape[-1]

    @property
    def bending(self) -> NDArray:
        """s + (h,) the gradient in the variables of the second derivatives."""
        return self.grad[..., : self.n_curved]

    def __getitem__(self, at: Any) -> Jet:
        return Jet(self.value[at], self.grad[at], self.hess[at])

    def chain(self, value: NDArray, first: NDArray, second: NDArray) -> Jet:
        """f(self) from f, f' and f'' at the value."""
        outer = self.bending[..., :, None] * self.bending[..., None, :]
        return Jet(
            value,
            first[..., None] * self.grad,
            second[..., None, None] * outer + first[..., None, None] * self.hess,
        )

    def _lift(self, other: Any) -> Jet:
        return other if isinstance(other, Jet) else constant(other, self.n_variables, self.n_curved)

    def __add__(self, other: Any) -> Jet:
        b = self._lift(other)
        return Jet(self.value + b.value, self.grad + b.grad, self.hess + b.hess)

    __radd__ = __add__

    def __neg__(self) -> Jet:
        return Jet(-self.value, -self.grad, -self.hess)

    def __sub__(self, other: Any) -> Jet:
        return self + (-self._lift(other))

    def __rsub__(self, other: Any) -> Jet:
        return self._lift(other) - self

    def __mul__(self, other: Any) -> Jet:
        b = self._lift(other)
        cross = self.bending[..., :, None] * b.bending[..., None, :]
        return Jet(
            self.value * b.value,
            self.value[..., None] * b.grad + b.value[..., None] * self.grad,
            self.value[..., None, None] * b.hess
            + b.value[..., None, None] * self.hess
            + cross
            + np.swapaxes(cross, -1, -2),
        )

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Jet:
        return self * self._lift(other) ** -1.0

    def __rtruediv__(self, other: Any) -> Jet:
        return self._lift(other) * self**-1.0

    def __pow__(self, exponent: Any) -> Jet:
        if isinstance(exponent, Jet):
            return exp(exponent * log(self))
        n, x = float(exponent), self.value
        return self.chain(
            x**n,
            n * x ** (n - 1.0) if n else 0.0 * x,
            n * (n - 1.0) * x ** (n - 2.0) if n not in (0.0, 1.0) else 0.0 * x,
        )

    def __rpow__(self, base: Any) -> Jet:
        return exp(self * np.log(base))


def constant(value: Any, n_variables: int, n_curved: int | None = None) -> Jet:
    """A jet with zero derivatives; second ones in all variables, or in the first `n_curved`."""
    v = np.asarray(value, dtype=complex if np.iscomplexobj(value) else float)
    h = n_variables if n_curved is None else n_curved
    return Jet(v, np.zeros((*v.shape, n_variables), v.dtype), np.zeros((*v.shape, h, h), v.dtype))


def variables(x: NDArray, curved: bool = True) -> Jet:
    """The k independent variables themselves, as a jet of shape (k,), with or without second derivatives."""
    v = np.asarray(x)
    v = v if np.iscomplexobj(v) else v.astype(float)
    h = v.size if curved else 0
    return Jet(v, np.eye(v.size, dtype=v.dtype), np.zeros((v.size, h, h), v.dtype))


def stack(jets: list[Jet]) -> Jet:
    """Scalar jets stacked to a jet of shape (len(jets),)."""
    return Jet(np.stack([j.value for j in jets]), np.stack([j.grad for j in jets]), np.stack([j.hess for j in jets]))


def exp(x: Jet) -> Jet:
    """Exponential."""
    e = np.exp(x.value)
    return x.chain(e, e, e)


def log(x: Jet) -> Jet:
    """Natural logarithm."""
    return x.chain(np.log(x.value), 1.0 / x.value, -1.0 / x.value**2)


def sqrt(x: Jet) -> Jet:
    """Square root."""
    return x**0.5


def sin(x: Jet) -> Jet:
    """Sine of an angle in radians."""
    s, c = np.sin(x.value), np.cos(x.value)
    return x.chain(s, c, -s)


def cos(x: Jet) -> Jet:
    """Cosine of an angle in radians."""
    s, c = np.sin(x.value), np.cos(x.value)
    return x.chain(c, -s, -c)


def tan(x: Jet) -> Jet:
    """Tangent of an angle in radians."""
    return sin(x) / cos(x)
