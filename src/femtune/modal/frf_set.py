"""FrfSet: frequency response functions between references and responses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal.kinds import FrfKind
from femtune.modal.mode_set import read_only

KINDS: tuple[str, ...] = get_args(FrfKind)


@dataclass(frozen=True, eq=False, repr=False)
class FrfSet:
    """Frequency response functions, convention e^{iωt}; its arrays are read-only.

    Parameters
    ----------
    freq_hz : (k,) frequency lines
    values : (responses, references, k) complex, in units of motion per force; NaN for pairs that were not measured
    responses, references : the DOFs of the first two axes
    kind : one of KINDS
    coherence : (responses, references, k) in 0 … 1, or None
    source : origin of the functions, a text
    response_names, reference_names : names of the axes if some are combinations of DOFs, which have the label of the
        one DOF that they represent; empty if the labels suffice

    Raises
    ------
    FemtuneError : ``frf.shape`` if the sizes disagree, ``frf.kind``, ``frf.values`` for frequency lines that are
        not finite, negative or do not increase, or infinite values

    Examples
    --------
    >>> import numpy as np
    >>> import femtune as ft
    >>> hz, point = np.array([1.0, 2.0]), ft.DofSet.parse(["3Z+"])
    >>> ft.FrfSet(hz, np.array([[[1.0, 2.0j]]]), point, point, "accelerance")
    FrfSet: 1 × 1 accelerance, 2 lines from 1 to 2 Hz
    """

    freq_hz: NDArray[np.float64]
    values: NDArray[np.complex128]
    responses: DofSet
    references: DofSet
    kind: str
    coherence: NDArray[np.float64] | None = None
    source: str = ""
    response_names: tuple[str, ...] = ()
    reference_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "freq_hz", read_only(self.freq_hz, float))
        object.__setattr__(self, "values", read_only(self.values, complex))
        object.__setattr__(self, "coherence", read_only(self.coherence, float))
        if self.kind not in KINDS:
            raise FemtuneError("frf.kind", kind=self.kind, kinds=", ".join(KINDS))
        self._check_sizes()
        self._check_values()

    def __repr__(self) -> str:
        lines = f", {len(self.freq_hz)} lines from {self.freq_hz[0]:g} to {self.freq_hz[-1]:g} Hz" * bool(
            len(self.freq_hz)
        )
        words = f", {self.source}" if self.source else ""
        return f"FrfSet: {len(self.responses)} × {len(self.references)} {self.kind}{lines}{words}"

    def transposed(self) -> FrfSet:
        """The functions with responses and references exchanged: those of the same structure if it is reciprocal."""
        return replace(
            self,
            values=np.swapaxes(self.values, 0, 1),
            responses=self.references,
            references=self.responses,
            coherence=None if self.coherence is None else np.swapaxes(self.coherence, 0, 1),
            response_names=self.reference_names,
            reference_names=self.response_names,
        )

    def _check_sizes(self) -> None:
        wanted = (len(self.responses), len(self.references), np.size(self.freq_hz))
        for name, array in (("values", self.values), ("coherence", self.coherence)):
            if array is not None and array.shape != wanted:
                raise FemtuneError("frf.shape", name=name, array_shape=array.shape, required_shape=wanted)
        for names, wanted_names in ((self.response_names, wanted[0]), (self.reference_names, wanted[1])):
            if names and len(names) != wanted_names:
                raise FemtuneError("frf.shape/names", n_names=len(names), n_rows_or_columns=wanted_names)

    def _check_values(self) -> None:
        lines = self.freq_hz
        if not np.isfinite(lines).all() or (lines < 0).any() or (np.diff(lines) <= 0).any():
            raise FemtuneError("frf.values")
        if np.isinf(self.values).any():
            raise FemtuneError("frf.values/infinite")


# ----------------------------------------------------------------------------------------------------
# Conversion of FRFs to another kind, and criteria that compare two FRFs.


def as_kind(frfs: FrfSet, kind: str) -> FrfSet:
    """The same functions as receptance, mobility or accelerance: each is iω times the one before.

    At 0 Hz the receptance cannot be computed from mobility or accelerance and becomes NaN; conversely, these are 0.

    Raises
    ------
    FemtuneError : ``frf.kind``
    """
    if kind not in KINDS:
        raise FemtuneError("frf.kind", kind=kind, kinds=", ".join(KINDS))
    power = KINDS.index(kind) - KINDS.index(frfs.kind)
    i_omega = 2j * np.pi * frfs.freq_hz
    still = i_omega == 0.0
    factor = np.where(still, 1.0, i_omega) ** power
    if power:
        factor[still] = 0.0 if power > 0 else np.nan
    return replace(frfs, values=frfs.values * factor, kind=kind)


def inward_power(mobility: NDArray) -> float:
    """Part of Σ|Re Y||Y| that is positive, Y (k,) the mobility at a driving point: 1 for a passive structure.

    Weighted by |Y|, so that resonances count and noise between them does not; NaN without any power.
    """
    inward = mobility.real * np.abs(mobility)
    total = np.abs(inward).sum()
    return float(np.clip(inward, 0.0, None).sum() / total) if total else float("nan")


def frac(a: NDArray, b: NDArray) -> float | None:
    """Frequency response assurance criterion |aᴴb|²/(aᴴa · bᴴb) of two functions (k,) at the same lines.

    Lines where one of them is not known (NaN) are ignored; None if no lines remain, or one function is zero.

    Source: W. Heylen, S. Lammens, FRAC: a consistent way of comparing frequency response functions, 1996.
    """
    known = np.isfinite(a) & np.isfinite(b)
    a, b = a[known], b[known]
    a, b = (v / np.abs(v).max(initial=np.finfo(float).tiny) for v in (a, b))
    size = float(np.vdot(a, a).real * np.vdot(b, b).real)
    return float(abs(np.vdot(a, b)) ** 2 / size) if size > 0.0 else None


def fdac(test: NDArray, model: NDArray) -> NDArray[np.float64]:
    """Frequency domain assurance criterion |tᴴm|²/(tᴴt · mᴴm) of the deflection shapes t and m at two frequencies.

    Parameters
    ----------
    test, model : (n, k) and (n, l) functions of n responses to one input, at k lines of the test and l of the model

    Returns
    -------
    (k, l) in 0 … 1; NaN where one of the shapes is zero or not known. Responses that are nowhere known on both sides
    are ignored

    Source: Pascual, Golinval and Razeto (1997).

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.modal import fdac
    >>> fdac(np.array([[1.0], [1.0j]]), np.array([[2.0, 1.0], [2.0j, 0.0]])).round(3)
    array([[1. , 0.5]])
    """
    used = np.isfinite(test).any(axis=1) & np.isfinite(model).any(axis=1)
    t, m = test[used], model[used]
    sizes = [np.sqrt(np.sum(np.abs(v) ** 2, axis=0)) for v in (t, m)]
    with np.errstate(invalid="ignore", divide="ignore"):
        t, m = t / sizes[0], m / sizes[1]
    return np.asarray(np.minimum(np.abs(t.conj().T @ m) ** 2, 1.0))


@dataclass(frozen=True)
class FrequencyShift:
    """Shift of the frequencies at which the deflection shapes agree best (FDAC).

    Parameters
    ----------
    ratio : frequency of the model over that of the test at which the deflection shapes agree best; NaN if that is at
        the end of the searched range
    mean : mean FDAC over the test's lines along this ratio; NaN without one
    mean_unshifted : mean FDAC at equal frequencies; NaN if model and test have no common frequency range
    """

    ratio: float
    mean: float
    mean_unshifted: float


LARGEST_SHIFT = 1.25
"""Largest frequency ratio that is searched, and inverse of the smallest.

Frequencies that differ by more than a quarter are of other modes, or of a model too poor for a single ratio.
"""


def frequency_shift(values: NDArray[np.float64], test_hz: NDArray, model_hz: NDArray) -> FrequencyShift | None:
    """The one ratio of frequencies along which the FDAC is largest on average.

    Parameters
    ----------
    values : (k, l) `fdac`
    test_hz, model_hz : (k,) and (l,) ascending lines, above 0

    Returns
    -------
    None if no ratio brings at least half of the test's lines into the model's range

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.modal import frequency_shift
    >>> test_hz, model_hz = np.linspace(5.0, 20.0, 100), np.linspace(4.0, 24.0, 200)
    >>> values = np.exp(-((model_hz - 1.1 * test_hz[:, None]) ** 2))
    >>> round(frequency_shift(values, test_hz, model_hz).ratio, 2)
    1.1
    """
    ratios = np.exp(np.linspace(-1.0, 1.0, 1001) * np.log(LARGEST_SHIFT))
    means = np.array([_mean_along(values, test_hz, model_hz, r) for r in ratios])
    if np.isnan(means).all():
        return None
    middle = len(ratios) // 2
    # of equally good ratios, the one nearest to one
    good = np.flatnonzero(means >= np.nanmax(means) - 1e-12)
    best = int(good[np.argmin(np.abs(good - middle))])
    if best in (0, len(ratios) - 1):
        return FrequencyShift(np.nan, np.nan, float(means[middle]))
    return FrequencyShift(float(ratios[best]), float(means[best]), float(means[middle]))


def _mean_along(values: NDArray[np.float64], test_hz: NDArray, model_hz: NDArray, ratio: float) -> float:
    """Mean over the test's lines of the FDAC at `ratio` times their frequency; NaN below half of the lines."""
    wanted = ratio * test_hz
    rows = np.flatnonzero((wanted >= model_hz[0] * (1.0 - 1e-9)) & (wanted <= model_hz[-1] * (1.0 + 1e-9)))
    if len(model_hz) < 2 or 2 * len(rows) < len(test_hz):
        return np.nan
    right = np.clip(np.searchsorted(model_hz, wanted[rows]), 1, len(model_hz) - 1)
    part = np.clip((wanted[rows] - model_hz[right - 1]) / (model_hz[right] - model_hz[right - 1]), 0.0, 1.0)
    along = (1.0 - part) * values[rows, right - 1] + part * values[rows, right]
    known = np.isfinite(along)
    return float(along[known].mean()) if 2 * known.sum() >= len(test_hz) else np.nan
