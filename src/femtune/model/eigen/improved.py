"""Modes of a model improved by inverse iteration from good approximations, such as those of a reduced model.

One factorisation and one block of solves a step: a part of the cost of `solve_modes`. Nothing proves that no mode is
missing, and the values are upper bounds whose error is not known: for training bases, not for results.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.model.eigen.solution import EigenSolution
from femtune.model.linear.blocks import recycled
from femtune.model.linear.dense_products import transposed_times, turn
from femtune.model.linear.sparse_products import column_major, product, row_major
from femtune.model.solvers.factorise import factorise

_COLUMNS_OF_A_SOLVE = 32
"""Right-hand sides solved together: each costs less than in narrower blocks, and the memory stays small."""
_METHOD = "inverse iteration from the modes of a reduced model, not counted"


@recycled()
def improved_modes(start: EigenSolution, steps: int = 1) -> EigenSolution:
    """Modes by inverse iteration, Y = (K − σM)⁻¹MX with Rayleigh and Ritz among Y.

    A part of λ_k in a mode of λ_j becomes smaller by (λ_j − σ)/(λ_k − σ) with each step, and the error of the
    eigenvalue by the square.

    Parameters
    ----------
    start : X, vectors near the modes of its point, some more than the wanted ones, and σ
    steps : number of iterations

    Returns
    -------
    EigenSolution : as many modes as `start` has, the last of them the least accurate; they are not counted

    Source: K.-J. Bathe, E. L. Wilson, Large eigenvalue problems in dynamic analysis, 1972.
    """
    point = start.point
    factor = factorise(point.symmetric_stiffness.plus(-start.shift, point.symmetric_mass))
    mass, X, values = product(point.symmetric_mass), column_major(start.shapes), start.eigenvalues
    for _ in range(steps):
        Y = np.empty_like(X)
        inverted, squared = np.empty((2, X.shape[1], X.shape[1]))
        parts = [slice(i, i + _COLUMNS_OF_A_SOLVE) for i in range(0, X.shape[1], _COLUMNS_OF_A_SOLVE)]
        for part in parts:
            heavy = column_major(mass @ X[:, part])
            Y[:, part] = factor.solve(heavy)
        # (K − σM)Y = MX, so that a product with K is not needed
        for part in parts:
            inverted[:, part] = transposed_times(Y, column_major(mass @ X[:, part]))
            squared[:, part] = transposed_times(Y, column_major(mass @ Y[:, part]))
        theta, vectors = la.eigh(0.5 * (squared + squared.T), 0.5 * (inverted + inverted.T))
        theta, vectors = theta[::-1], vectors[:, ::-1]
        X, values = turn(Y, vectors / np.sqrt(theta)), start.shift + 1.0 / theta
    shapes: Reals = row_major(X)
    return EigenSolution(point, values, shapes, start.wanted, start.shift, 0.0, -1, known_factor=factor, method=_METHOD)
