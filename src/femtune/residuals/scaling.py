"""Scales in which a model shape is compared with a test shape, and the derivative of each."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Scaled = tuple[Reals, Reals, NDArray[np.int64]]
Scaling = Literal["unit-norm", "largest-entry", "scale-factor", "mass"]


def scaled_difference(shape: Reals, gradient: Reals, test: Reals, scaling: Scaling = "unit-norm") -> Scaled:
    """Differences of a model shape and a test shape in one scale, their Jacobian, and the positions compared.

    Parameters
    ----------
    shape, gradient : (s,) and (s, k) model shape at the sensors; of unit modal mass for "mass", in any scale otherwise
    test : (s,) test shape; NaN entries were not measured and are left out
    scaling :
        "unit-norm", both of unit Euclidean norm over what was measured: |difference| = √(2(1 − √MAC));
        "largest-entry", both one where the test is largest, and that entry left out;
        "scale-factor", the model by the modal scale factor φᵀψ/φᵀφ, which makes the difference least, over |ψ|:
        |difference| = √(1 − MAC);
        "mass", as they are, both of unit modal mass, over |ψ|; only the sign is aligned
    """
    known = np.flatnonzero(~np.isnan(test))
    phi, slope, reference = shape[known], gradient[known], test[known]
    if scaling == "largest-entry":
        values, jacobian, rest = _largest_entry(phi, slope, reference)
        return values, jacobian, known[rest]
    of = {"unit-norm": _unit_norm, "scale-factor": _scale_factor, "mass": _mass}[scaling]
    values, jacobian = of(phi, slope, reference)
    return values, jacobian, known


def _unit_norm(phi: Reals, slope: Reals, test: Reals) -> tuple[Reals, Reals]:
    norm = np.sign(phi @ test or 1.0) * np.linalg.norm(phi)
    unit = phi / norm
    return unit - test / np.linalg.norm(test), (slope - np.outer(unit, unit @ slope)) / norm


def _largest_entry(phi: Reals, slope: Reals, test: Reals) -> tuple[Reals, Reals, NDArray[np.bool_]]:
    top = int(np.argmax(np.abs(test)))
    rest = np.arange(len(test)) != top
    ratio = phi / phi[top]
    jacobian = (slope - np.outer(ratio, slope[top])) / phi[top]
    return (ratio - test / test[top])[rest], jacobian[rest], rest


def _scale_factor(phi: Reals, slope: Reals, test: Reals) -> tuple[Reals, Reals]:
    square = phi @ phi
    factor = phi @ test / square
    d_factor = (test - 2.0 * factor * phi) @ slope / square
    size = np.linalg.norm(test)
    return (factor * phi - test) / size, (factor * slope + np.outer(phi, d_factor)) / size


def _mass(phi: Reals, slope: Reals, test: Reals) -> tuple[Reals, Reals]:
    side, size = np.sign(phi @ test or 1.0), np.linalg.norm(test)
    return (side * phi - test) / size, side * slope / size
