"""Modes of imported matrices beside those that their own solver listed, and why they may differ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError, Where
from femtune.model.configured import ModelPoint

# ----------------------------------------------------------------------------------------------------
# Listed frequencies beside found ones: the digits of a list, and modes that only one of both has.


_COARSEST = 0.01
"""Relative difference that the rounding of a list explains at most: a list of fewer digits checks nothing."""


def rounding_hz(listed_hz: Sequence[float]) -> float:
    """Half a unit of the last decimal place that some number of the list has: 0.005 of 7.91 and 12.3."""
    places = [Decimal(repr(float(f))).normalize().as_tuple().exponent for f in listed_hz]
    return 0.5 * 10.0 ** min((p for p in places if isinstance(p, int)), default=0)


def excused(listed_hz: Reals, rounding: float) -> Reals:
    """Difference in Hz that the digits of the list explain."""
    return np.minimum(rounding * (1.0 + 1e-9), _COARSEST * listed_hz)


@dataclass(frozen=True)
class UnmatchedModes:
    """Positions of modes that only the matrices, or only the list, have, and the number of those that both have."""

    found: tuple[int, ...]
    listed: tuple[int, ...]
    paired: int

    @property
    def telling(self) -> bool:
        """Most modes are the same, and the others are more than the lowest ones of one side (missing supports)."""
        lowest = {(self.found, ()), ((), self.listed)}
        shifted = (self.found, self.listed) in lowest and max(self.found + self.listed) < len(self.found + self.listed)
        few = len(self.found) + len(self.listed) <= self.paired
        return self.paired > 1 and few and bool(self.found or self.listed) and not shifted


def unpaired(found: Reals, listed: Reals, allowed: Reals) -> UnmatchedModes:
    """Walk up both ascending lists; found modes above the last listed one do not count.

    Parameters
    ----------
    allowed : (listed,) difference in Hz of a pair
    """
    only_found: list[int] = []
    only_listed: list[int] = []
    i = j = 0
    while j < len(listed):
        if i < len(found) and abs(found[i] - listed[j]) <= allowed[j]:
            i, j = i + 1, j + 1
        elif i < len(found) and found[i] < listed[j]:
            only_found.append(i)
            i += 1
        else:
            only_listed.append(j)
            j += 1
    return UnmatchedModes(tuple(only_found), tuple(only_listed), len(listed) - len(only_listed))


RIGID = 1e-4
"""Frequency below which a mode counts as rigid, relative to the highest that is compared."""
_SAME_RATIO = 2e-3
"""Scatter of the ratios of all frequencies, relative to their mean, up to which they are one ratio."""
_KNOWN_RATIO = 5e-3
"""Relative difference up to which that ratio is one of `_UNITS`; these differ by more than 1 % from each other."""
_SHIFTED = 1e-3
"""Relative difference up to which two lists agree if the lowest modes of one of them are left out."""
_PENALTY = 1e6
"""Stiffness relative to the median of the diagonal that is a penalty for a held DOF."""
_SCATTERED = 0.02
"""Range of the ratios of frequencies that no mass of another kind explains if they do not grow with the mode number."""
_DRIFTING = 0.6
"""Correlation of the differences with the mode number from which on they grow with it."""

_UNITS = (
    (2.0 * np.pi, "the listed numbers are in rad/s, not in Hz"),
    (1e3**0.5, "mass and stiffness differ by a factor of 1000: grams, kilograms and tonnes, or N with m and mm"),
    (1e3, "mass and stiffness differ by 10⁶: N/m beside N/mm with kg beside t"),
    (386.089**0.5, "masses are weights in lbf: divide them by g = 386.09 in/s² (PARAM WTMASS)"),
    (32.174**0.5, "masses are weights in lbf: divide them by g = 32.174 ft/s²"),
    (9.80665**0.5, "masses are weights: divide them by g = 9.807 m/s²"),
    (9806.65**0.5, "masses are weights: divide them by g = 9807 mm/s²"),
    (12.0**0.5, "inches beside feet"),
)


@dataclass(frozen=True)
class Cause:
    """A likely cause; the larger its `weight`, the stronger the evidence for it."""

    weight: float
    sentence: str


@dataclass(frozen=True, eq=False)
class ListComparison:
    """Elastic modes in Hz, found and listed one beside the other, and the numbers of rigid ones.

    `difference` is the largest relative one, `excess` what the digits of the list (`rounding` in Hz) leave of it.
    """

    found: Reals
    listed: Reals
    rigid_found: int
    rigid_listed: int
    difference: float
    excess: float
    rounding: float


def compare_modes(found_hz: Reals, listed_hz: Sequence[float]) -> ListComparison:
    """The modes that both have, from the lowest elastic one on.

    A list without rigid-body modes is compared with the elastic modes.
    """
    listed = np.sort(np.abs(np.asarray(listed_hz, float)))
    ascending = np.sort(found_hz)
    limit = RIGID * max(listed[-1], 1e-300)
    rigid_listed, rigid_found = int((listed < limit).sum()), int((ascending < limit).sum())
    a, b = ascending[rigid_found:], listed[rigid_listed:]
    n = min(len(a), len(b))
    apart, rounding = np.abs(a[:n] - b[:n]), rounding_hz(b.tolist())
    all_there = len(a) >= len(b)
    difference = (apart / b[:n]).max(initial=0.0) if all_there else np.inf
    excess = ((apart - excused(b[:n], rounding)) / b[:n]).max(initial=0.0) if all_there else np.inf
    return ListComparison(a, b, rigid_found, rigid_listed, float(difference), float(excess), rounding)


def check_modes(
    point: ModelPoint, found_hz: Reals, listed_hz: Sequence[float], tolerance: float, where: Where
) -> ListComparison:
    """Refuse matrices whose modes are not those that the solver listed.

    Parameters
    ----------
    point : the model at its nominal values
    found_hz : some more modes than were listed, so that shifted lists are seen
    tolerance : largest relative difference of a frequency

    Raises
    ------
    FemtuneError : ``matrices.modes-differ`` with the likely causes, what the data show first
    """
    compared = compare_modes(found_hz, listed_hz)
    rigid = compared.rigid_listed and compared.rigid_found != compared.rigid_listed
    if compared.excess <= tolerance and not rigid:
        return compared
    causes = sorted(_causes(compared, point, tolerance), key=lambda c: -c.weight)
    shown = [f"{c.sentence}" for c in causes if c.weight > 0.0] or ["nothing points to one of the usual causes"]
    raise FemtuneError(
        "matrices.modes-differ",
        where=where,
        values={
            "Hz, matrices": _frequencies(compared.found, len(compared.listed)),
            "Hz, listed": _frequencies(compared.listed, len(compared.listed)),
            "rigid-body modes": f"{compared.rigid_found} of the matrices, {compared.rigid_listed} listed",
            "difference in %": _differences(compared),
            "largest difference": f"{100 * compared.difference:.3g} % (tolerance {100 * tolerance:.3g} %)",
            **{f"likely cause {i}": text for i, text in enumerate(shown, 1)},
        },
    )


def _frequencies(hz: Reals, count: int) -> str:
    return ", ".join(f"{f:.6g}" for f in hz[: min(count, 6)]) + (" …" if count > 6 else "")


def _differences(c: ListComparison) -> str:
    """By mode, with the number of the mode where it is not among the first."""
    percent = 100.0 * (_ratios(c) - 1.0)
    worst = int(np.argmax(np.abs(percent))) if len(percent) else 0
    shown = ", ".join(f"{p:+.2g}" for p in percent[:6]) + (" …" if len(percent) > 6 else "")
    return shown + (f" mode {worst + 1 + c.rigid_found}: {percent[worst]:+.2g}" if worst > 5 else "")


def _causes(c: ListComparison, point: ModelPoint, tolerance: float) -> Iterator[Cause]:
    yield from _held(c, point)
    yield from _units(c)
    single = list(_single(c, tolerance))
    yield from single
    if single:
        return
    yield from _lumping(c, point)
    yield from _order(c, point)


def _held(c: ListComparison, point: ModelPoint) -> Iterator[Cause]:
    """Supports that are still free, or penalties that are still in the matrix."""
    K = point.symmetric_stiffness.diagonal()
    typical = float(np.median(np.abs(K[K != 0.0]))) if K.any() else 0.0
    huge = int((np.abs(K) > _PENALTY * typical).sum())
    if huge:
        text = f"{huge} rows have a stiffness above {_PENALTY:.0e} times the usual"
        yield Cause(1.5, f"{text}: held DOFs are in the matrix as penalties")
    more = c.rigid_found - c.rigid_listed
    if more > 0:
        yield Cause(3.0, f"{more} rigid-body modes more than listed: supports are missing, name them in supports_added")
    elif more < 0 and c.rigid_listed:
        yield Cause(
            3.0, f"{-more} rigid-body modes fewer than listed: the matrices hold DOFs that were free in that run"
        )
    for k in range(1, 7):
        for a, b, which in ((c.found[k:], c.listed, "more"), (c.found, c.listed[k:], "fewer")):
            n = min(len(a), len(b))
            if n > 1 and np.abs(a[:n] / b[:n] - 1.0).max() < _SHIFTED:
                yield Cause(4.0, f"all listed modes are there when {k} of the lowest are left out: {k} modes {which} "
                                 "than listed, so supports or constraint equations differ")  # fmt: skip
                return


def _single(c: ListComparison, tolerance: float) -> Iterator[Cause]:
    """Most modes agree: some are missing from the list, or are wrong in it."""
    allowed = np.maximum(tolerance * c.listed, excused(c.listed, c.rounding))
    only = unpaired(c.found, c.listed, allowed)
    if not only.telling:
        return
    parts = []
    if only.found:
        parts.append(f"{_numbered(only.found, c.rigid_found, c.found)} of the matrices is not in the list")
    if only.listed:
        parts.append(
            f"{_numbered(only.listed, c.rigid_listed, c.listed)} of the list is not among those of the matrices"
        )
    yield Cause(4.2, f"{only.paired} modes agree; " + ", and ".join(parts))


def _numbered(at: tuple[int, ...], rigid: int, hz: Reals) -> str:
    """Numbers of modes, rigid ones counted, with their frequencies."""
    return ", ".join(f"mode {i + 1 + rigid} ({hz[i]:.6g} Hz)" for i in at)


def _ratios(c: ListComparison) -> Reals:
    n = min(len(c.found), len(c.listed))
    return c.found[:n] / c.listed[:n]


def _units(c: ListComparison) -> Iterator[Cause]:
    ratios = _ratios(c)
    if not len(ratios) or np.ptp(ratios) > _SAME_RATIO * ratios.mean() or abs(ratios.mean() - 1.0) < _SAME_RATIO:
        return
    r = float(ratios.mean())
    for factor, text in _UNITS:
        for value in (factor, 1.0 / factor):
            if abs(r / value - 1.0) < _KNOWN_RATIO:
                yield Cause(5.0, f"all frequencies are {r:.5g} times the listed ones: {text}")
                return
    text = f"all frequencies are {r:.5g} times the listed ones"
    yield Cause(4.5, f"{text}: units, or a factor {r * r:.5g} on stiffness over mass")


def _drift(ratios: Reals) -> float:
    """Correlation of the differences with the mode number; 0 where there are too few."""
    drift = np.abs(ratios - 1.0)
    return float(np.corrcoef(np.arange(len(drift)), drift)[0, 1]) if len(drift) > 2 and np.ptp(drift) > 0.0 else 0.0


def _lumping(c: ListComparison, point: ModelPoint) -> Iterator[Cause]:
    """A mass of the other kind shifts frequencies the more the higher they are."""
    ratios = _ratios(c)
    if len(ratios) < 3 or np.abs(ratios - 1.0).max() > 0.5:
        return
    order = _drift(ratios)
    M = point.symmetric_mass
    lumped = np.count_nonzero(M.data) == np.count_nonzero(M.diagonal())
    kind = "diagonal (lumped) and the listed run may have used a consistent one (or a coupled one, PARAM COUPMASS)"
    other = "consistent and the listed run may have used a lumped one"
    if order > _DRIFTING:
        yield Cause(2.0 + order, f"the difference grows with the mode number: the mass is {kind if lumped else other}")


def _order(c: ListComparison, point: ModelPoint) -> Iterator[Cause]:
    """Rows of stiffness and mass that do not belong together."""
    K, M = point.symmetric_stiffness.diagonal(), point.symmetric_mass.diagonal()
    loose = int(((M != 0.0) & (K == 0.0)).sum())
    if loose:
        yield Cause(2.5, f"{loose} rows have mass and no stiffness: stiffness and mass may be in another order of DOFs")
    ratios = _ratios(c)
    if len(ratios) and np.ptp(ratios) > _SCATTERED and _drift(ratios) <= _DRIFTING:
        yield Cause(1.0, "the differences follow no pattern: stiffness and mass may be in another order of DOFs")
