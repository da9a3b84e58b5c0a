"""The best one-to-one assignment of rows to columns."""

from __future__ import annotations

from numpy.typing import NDArray

from femtune.arrays import Integers


def linear_sum_assignment(cost: NDArray, maximize: bool = False) -> tuple[Integers, Integers]:
    """Rows and columns of the assignment with the smallest sum, or the largest if `maximize`; the function of SciPy.

    ``scipy.optimize`` is imported at the first assignment, since most commands need none.
    """
    from scipy import optimize  # noqa: PLC0415

    rows, columns = optimize.linear_sum_assignment(cost, maximize=maximize)
    return rows, columns
