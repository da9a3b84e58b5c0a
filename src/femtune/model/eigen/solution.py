"""Eigen-solution of K φ = λ M φ with rigid-body modes, checked by the Sturm count."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice
from femtune.model.configured import ModelPoint
from femtune.model.distributed import slepc_count
from femtune.model.eigen.default_count import MOST_MODES, default_count
from femtune.model.eigen.nearby import Nearby, modes_nearby
from femtune.model.eigen.pairs import DENSE_UP_TO, EigenSearch, Pairs, is_iterative, lowest, method_of
from femtune.model.eigen.pencil import Pencil, indefinite_mass
from femtune.model.eigen.shift import first_guess, near_shift, negative_stiffness, spectral_shift
from femtune.model.eigen.slepc import goes_to_slepc, small_for_slepc, solve_by_slepc
from femtune.model.eigen.sturm import Count, Cut, count_below, cut_above, missed, not_counted, separates, with_repeats
from femtune.model.linear.blocks import recycled
from femtune.model.linear.sparse_products import row_major
from femtune.model.solvers.factorise import factorise
from femtune.model.solvers.interface import Factor

__all__ = ["DENSE_UP_TO", "EigenSolution", "solve_modes"]

_EXTRA_MODES = 6
"""Modes beyond the wanted ones: they serve the derivatives, and the count needs a gap above the wanted modes."""
MOST_EXTRA = 400
"""Extra modes after which a count that does not agree is an error."""
_LARGEST = 1e90
"""Largest entry of K and M, and of 1/λ: products of three of them stay below the largest double, 1.8e308."""
ONE_FACTOR_FROM = 60_000
"""DOFs from which on factors are released before others are computed: two at a time would fill the memory. So would the
element matrices, which a configured model does not need."""


@dataclass(frozen=True, eq=False)
class EigenSolution:
    """The lowest modes of a model point.

    Parameters
    ----------
    eigenvalues : (m,) λ = ω² in rad²/s², ascending
    shapes : (n_free, m), φᵀMφ = 1
    wanted : number of modes that were requested, a repeated one at the end kept whole; the others serve the
        derivatives
    shift : σ below the spectrum, at which the eigenproblem was inverted
    sturm_shift, sturm_count : number of eigenvalues below a shift that separates the modes found from the rest,
        counted from the inertia of K − σM; −1 where it could not be counted
    sturm_factor : factors of K − σM at `sturm_shift`, kept for large models in place of those at `shift`
    method : eigen-solver and sparse solver that ran, in words; "" if unknown
    """

    point: ModelPoint = field(repr=False)
    eigenvalues: NDArray[np.float64]
    shapes: NDArray[np.float64] = field(repr=False)
    wanted: int
    shift: float
    sturm_shift: float
    sturm_count: int
    notices: tuple[Notice, ...] = ()
    known_factor: Factor | None = field(default=None, repr=False)
    sturm_factor: Factor | None = field(default=None, repr=False)
    method: str = ""

    @cached_property
    def factor(self) -> Factor:
        """Factors of K − σM, computed again if the solution has none; those of the count of a large model are released
        first."""
        if self.known_factor is not None:
            return self.known_factor
        if len(self.shapes) >= ONE_FACTOR_FROM:
            object.__setattr__(self, "sturm_factor", None)
        return factorise(self.point.symmetric_stiffness.plus(-self.shift, self.point.symmetric_mass))

    def forget_factors(self) -> None:
        """Release the memory of the factors; they are computed again when they are next needed."""
        for name in ("known_factor", "sturm_factor"):
            object.__setattr__(self, name, None)
        self.__dict__.pop("factor", None)

    @property
    def freq_hz(self) -> NDArray[np.float64]:
        """Natural frequencies of the wanted modes; those of rigid-body modes are (nearly) zero."""
        return np.sqrt(np.maximum(self.eigenvalues[: self.wanted], 0.0)) / (2.0 * np.pi)


@recycled()
def solve_modes(
    point: ModelPoint, count: int | None = None, max_hz: float | None = None, start: EigenSolution | None = None
) -> EigenSolution:
    """The `count` lowest modes, or all up to `max_hz` but at least one, with a notice if that one is above it.

    If neither is given, ten elastic modes (`default_count`) and the rigid-body modes are solved. If both are given, all
    up to `max_hz`, at least `count` elastic ones, and at most `MOST_MODES`, with a notice.

    The Sturm count proves that no mode was missed; a model with fewer modes returns all of its modes.

    Parameters
    ----------
    start : modes of the same configured model at other values of its parameters, from which the iteration starts. If
        the model is large, the factors that it keeps are released first

    Raises
    ------
    FemtuneError : ``eigen.mechanism`` (a motion without stiffness and mass, naming the DOFs), ``eigen.no-mass``,
        ``eigen.no-dofs``, ``eigen.missed-modes``, ``eigen.inaccurate``, ``eigen.negative``, ``eigen.no-convergence``,
        ``eigen.uncounted``, ``eigen.other-start``
    """
    if max_hz is None:
        solution = _solved(point, default_count(point) if count is None else count, None, start)
        if count is None or solution.wanted <= count:
            return solution
        whole = Notice("eigen.whole-group", level="info", count=count, wanted=solution.wanted)
        return replace(solution, notices=(*solution.notices, whole))
    if count is not None:
        return _reaching(point, count, max_hz, start)
    solution = _solved(point, None, max_hz, start)
    if not solution.wanted or solution.freq_hz[0] <= max_hz:
        return solution
    notice = Notice("eigen.none-below", max_hz=max_hz, lowest=float(solution.freq_hz[0]))
    return replace(solution, notices=(*solution.notices, notice))


def _reaching(point: ModelPoint, elastic: int, max_hz: float, start: EigenSolution | None) -> EigenSolution:
    """At least some elastic modes, and as many more as it takes to reach a frequency."""
    count = default_count(point, elastic)
    solution = _solved(point, count, None, start)
    if solution.freq_hz[-1] >= max_hz or solution.wanted < count:
        return solution
    below = _number_below(point, max_hz)
    if below is None or below <= solution.wanted:
        return solution
    most = max(MOST_MODES, count)
    more = _solved(point, min(below, most), None, solution)
    if below <= most:
        return more
    notice = Notice("eigen.many-modes", below=below, max_hz=max_hz, solved=most, reached=float(more.freq_hz[-1]))
    return replace(more, notices=(*more.notices, notice))


def _number_below(point: ModelPoint, max_hz: float) -> int | None:
    """Number of modes below a frequency, None where it cannot be counted."""
    value = (2.0 * np.pi * max_hz) ** 2
    if goes_to_slepc(point.symmetric_mass, 1):
        return slepc_count(point.symmetric_stiffness, point.symmetric_mass, value)
    return count_below(Pencil(point.symmetric_stiffness, point.symmetric_mass), value).below


def _solved(point: ModelPoint, count: int | None, max_hz: float | None, start: EigenSolution | None) -> EigenSolution:
    """The lowest modes, by SLEPc or in this process."""
    _check_start(point, start)
    if point.configured.n_free >= ONE_FACTOR_FROM:
        point.configured.model.release_terms()
    pencil = Pencil(point.symmetric_stiffness, point.symmetric_mass)
    _check_matrices(point, pencil)
    if goes_to_slepc(pencil.M, count):
        return _by_slepc(point, count, max_hz)
    limit = None if max_hz is None else count_below(pencil, (2.0 * np.pi * max_hz) ** 2)
    wanted = _wanted(count, limit)
    known = None if start is None else _from_start(point, pencil, start, wanted, limit)
    if known is not None:
        return known
    if limit is not None:
        limit = replace(limit, factor=None)
    search = _search(point, pencil, wanted, start)
    if limit is not None and limit.below is None:
        raise _uncounted(max_hz)
    return _proven(point, search, wanted, limit)


def _from_start(
    point: ModelPoint, pencil: Pencil, start: EigenSolution, wanted: int, limit: Count | None
) -> EigenSolution | None:
    """By one factorisation just above the modes; None if this does not find them."""
    if pencil.n >= ONE_FACTOR_FROM:
        start.forget_factors()
    if not is_iterative(pencil, wanted):
        return None
    nearby = Nearby(start.eigenvalues, start.shapes, start.shift, start.sturm_shift, wanted)
    modes = modes_nearby(pencil, nearby, limit)
    if modes is None:
        return None
    above, kept = modes.above, row_major(modes.shapes)
    assert above.below is not None
    factor = above.factor if _is_accurate(above.factor) else None
    return EigenSolution(
        point, modes.values, kept, modes.whole, start.shift, above.value, above.below, sturm_factor=factor
    )


def _search(point: ModelPoint, pencil: Pencil, wanted: int, start: EigenSolution | None) -> EigenSearch:
    if start is not None:
        return near_shift(point, pencil, start.eigenvalues, start.shift, start.shapes)
    return spectral_shift(point, pencil, wanted + _EXTRA_MODES)


def _proven(point: ModelPoint, search: EigenSearch, wanted: int, limit: Count | None) -> EigenSolution:
    """Modes until their number is that of the inertia."""
    possible, extra = search.pencil.heavy.size, _EXTRA_MODES
    wanted, known = min(wanted, possible), None
    while True:
        asked = min(wanted + extra, possible)
        values, shapes, accurate = lowest(search, asked, wanted, known)
        search = replace(search, start=None, basis=None, solved=None)
        whole = with_repeats(values, min(wanted, accurate), search.shift)
        complete = asked == possible or len(values) < asked
        cut, count = _counted(search, values, (whole, accurate), complete, limit)
        if cut is not None and count.below in (None, cut[1]):
            solution = _solution(point, search, values[:accurate], shapes[:, :accurate], (whole, cut, count))
            return replace(solution, method=method_of(search, asked))
        if asked == possible or extra > MOST_EXTRA:
            raise missed(cut, count.below)
        known = _to_keep(search, values[:accurate], shapes[:, :accurate], cut, count.below)
        extra *= 4


def _counted(
    search: EigenSearch, values: NDArray, sizes: tuple[int, int], complete: bool, limit: Count | None
) -> tuple[Cut | None, Count]:
    """Where to count, and the count: if possible that at the limit of frequency, which saves a factorisation."""
    whole, accurate = sizes
    if limit is not None and separates(values, whole, accurate, search.shift, limit):
        return (limit.value, whole), limit
    cut = cut_above(values, whole, accurate, search.shift, complete)
    if cut is None:
        return None, Count(0.0, None)
    if search.pencil.n >= ONE_FACTOR_FROM:
        search.inverse.forget()
    return cut, count_below(search.pencil, cut[0])


def _to_keep(search: EigenSearch, values: NDArray, shapes: NDArray, cut: Cut | None, below: int | None) -> Pairs | None:
    """The pairs beside which missing ones are sought; None if there are too many."""
    too_many = cut is not None and below is not None and below < cut[1]
    return None if too_many or not is_iterative(search.pencil, len(values) + 1) else (values, shapes)


def _solution(
    point: ModelPoint, search: EigenSearch, values: NDArray, shapes: NDArray, proof: tuple[int, Cut, Count]
) -> EigenSolution:
    whole, cut, count = proof
    notices = (*((not_counted(),) if count.below is None else ()), *small_for_slepc(search.pencil.M))
    number_below = -1 if count.below is None else count.below
    # one order in memory, so that later results are the same to the last bit whichever solver computed the shapes
    kept = row_major(shapes)
    factor = search.inverse.at_hand
    sturm = count.factor if factor is None and _is_accurate(count.factor) else None
    return EigenSolution(
        point=point,
        eigenvalues=values,
        shapes=kept,
        wanted=whole,
        shift=search.shift,
        sturm_shift=cut[0],
        sturm_count=number_below,
        notices=notices,
        known_factor=factor,
        sturm_factor=sturm,
    )


def _is_accurate(factor: Factor | None) -> bool:
    """False for a solver that does not exchange pivots, as an indefinite matrix requires."""
    return factor is not None and factor.name != "SuperLU"


def _by_slepc(point: ModelPoint, count: int | None, max_hz: float | None) -> EigenSolution:
    modes = solve_by_slepc(point.symmetric_stiffness, point.symmetric_mass, count, max_hz, _end)
    notices = (not_counted(),) if modes.sturm_count < 0 else ()
    return EigenSolution(
        point,
        modes.values,
        np.ascontiguousarray(modes.shapes),
        modes.wanted,
        modes.shift,
        modes.sturm_shift,
        modes.sturm_count,
        notices,
        method="SLEPc (Krylov-Schur) over MPI, sparse factors by MUMPS",
    )


def _end(
    values: NDArray, wanted: int, known: int, shift: float, complete: bool
) -> tuple[int, tuple[float, int] | None]:
    whole = with_repeats(values, wanted, shift)
    return whole, cut_above(values, whole, known, shift, complete)


def _check_matrices(point: ModelPoint, pencil: Pencil) -> None:
    name = point.configured.configuration.name
    if not point.configured.n_free:
        raise FemtuneError("eigen.no-dofs", configuration=name)
    if not pencil.M.data.any():
        raise FemtuneError("eigen.no-mass", configuration=name)
    if indefinite_mass(pencil.M):
        raise negative_stiffness(point)
    _check_sizes(pencil)


def _check_sizes(pencil: Pencil) -> None:
    """The iteration multiplies a mass by the square of a flexibility: that must not overflow."""
    stiffness, mass, lowest_value = float(np.abs(pencil.K.data).max()), float(np.abs(pencil.M.data).max()), 0.0
    if max(stiffness, mass) < _LARGEST:
        lowest_value = first_guess(pencil)
    if not lowest_value * _LARGEST > 1.0:
        raise FemtuneError(
            "eigen.inaccurate/overflow",
            values={"largest stiffness": f"{stiffness:.6g}", "largest mass": f"{mass:.6g}"},
        )


def _check_start(point: ModelPoint, start: EigenSolution | None) -> None:
    if start is not None and len(start.shapes) != point.configured.n_free:
        raise FemtuneError(
            "eigen.other-start",
            values={"DOFs of the model": point.configured.n_free, "DOFs of the modes": len(start.shapes)},
        )


def _wanted(count: int | None, limit: Count | None) -> int:
    if limit is not None:
        return max(limit.below or 0, 1)
    return max(count or 0, 1)


def _uncounted(max_hz: float | None) -> FemtuneError:
    return FemtuneError("eigen.uncounted", max_hz=max_hz)
