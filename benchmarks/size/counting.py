"""Factorisations and solves of femtune's own eigen-solver, counted and timed while they run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import Any

from numpy.typing import NDArray

from femtune.model.eigen import pencil
from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.solvers.factorise import factorise
from femtune.model.solvers.interface import Factor


@dataclass
class Counts:
    """Number and seconds; a column is one right side of a block solve."""

    factorisations: int = 0
    factor_seconds: float = 0.0
    solves: int = 0
    columns: int = 0
    solve_seconds: float = 0.0

    def rounded(self) -> dict[str, float]:
        """For the journal."""
        return {name: round(value, 3) for name, value in asdict(self).items()}


class CountedFactor:
    """A factor that tells of its solves."""

    def __init__(self, factor: Factor, counts: Counts) -> None:
        self._factor, self._counts, self.name = factor, counts, factor.name

    @property
    def negative_pivots(self) -> int | None:
        """As of the factor."""
        return self._factor.negative_pivots

    def solve(self, b: NDArray) -> NDArray:
        """As of the factor."""
        start = time.perf_counter()
        x = self._factor.solve(b)
        self._counts.solve_seconds += time.perf_counter() - start
        self._counts.solves += 1
        self._counts.columns += 1 if b.ndim == 1 else b.shape[1]
        return x


def _counted(counts: Counts) -> Callable[..., CountedFactor]:
    def counting(matrix: SymmetricMatrix, *arguments: Any) -> CountedFactor:
        start = time.perf_counter()
        factor = factorise(matrix, *arguments)
        counts.factor_seconds += time.perf_counter() - start
        counts.factorisations += 1
        return CountedFactor(factor, counts)

    return counting


@contextmanager
def counted() -> Iterator[Counts]:
    """Count what the eigen-solver asks of the factorisation; factors that live on go on counting."""
    counts = Counts()
    before = pencil.factorise
    pencil.factorise = _counted(counts)
    try:
        yield counts
    finally:
        pencil.factorise = before
