"""Criteria on measured FRFs that were not used: shape of the functions, levels, resonance frequencies.

Sources: FRAC, W. Heylen, S. Lammens (1996); FDAC, R. Pascual, J. C. Golinval, M. Razeto, A frequency domain correlation
technique for model correlation and updating, IMAC XV (1997).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Complexes, Flags, Reals
from femtune.correlation import NotTested
from femtune.modal import frac
from femtune.modal.assignment import linear_sum_assignment
from femtune.validation.criteria import (
    FDAC,
    FRAC,
    MAX_LEVEL,
    MEAN_LEVEL,
    RESONANCE,
    Criterion,
    Verdict,
    judge,
    not_tested,
)

_PROMINENCE_DB = 10.0
"""Level by which a resonance stands out of its surroundings."""
_DEPTH_DB = 60.0
"""Level below the highest resonance down to which others count: a thousandth of its amplitude."""
_FAR = 0.20
"""Resonances of test and model that differ by more are not the same."""
_FEWEST_OUTPUTS = 3
"""Outputs without which a correlation of response vectors is high by chance."""
_SILENT = 1e-10
"""Largest value of a function of the model relative to that of all, at or below which it is rounding of zero."""


@dataclass(frozen=True)
class FrfMatch:
    """One function of the model beside the measured one.

    Parameters
    ----------
    output, input : labels
    frac : frequency response assurance criterion; None for fewer than two lines
    mean_db, max_db : mean and largest |20 lg |H|/|H_test|| over the lines
    max_hz : line of the largest one
    """

    output: str
    input: str
    frac: float | None
    mean_db: float
    max_db: float
    max_hz: float

    @property
    def label(self) -> str:
        """Output and input."""
        return f"{self.output} / {self.input}"


@dataclass(frozen=True)
class MatchedResonance:
    """A peak of the measured functions of one input, and the model's; None if no peak of the model is near."""

    input: str
    test_hz: float
    model_hz: float | None

    @property
    def error(self) -> float:
        """|model − test|/test; infinite without a peak of the model."""
        return np.inf if self.model_hz is None else abs(self.model_hz / self.test_hz - 1.0)


@dataclass(frozen=True, eq=False)
class PredictedFrfs:
    """Measured functions that were not used, and those that the model predicts.

    Parameters
    ----------
    outputs, inputs : labels
    freq_hz : (k,) lines
    model, test : (outputs, inputs, k); NaN in `test` where nothing is compared
    """

    outputs: Sequence[str]
    inputs: Sequence[str]
    freq_hz: Reals
    model: Complexes
    test: Complexes

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """(outputs, inputs, k) where test and model have values other than zero, the model beyond its rounding."""
        silent = np.abs(self.model).max(axis=2, keepdims=True) <= _SILENT * np.abs(self.model).max(initial=0.0)
        return np.asarray(np.isfinite(self.test) & (self.test != 0.0) & (self.model != 0.0) & ~silent)

    @cached_property
    def matches(self) -> tuple[FrfMatch, ...]:
        """Values of every function with a known value, input by input."""
        places = [(i, j) for j in range(len(self.inputs)) for i in range(len(self.outputs))]
        return tuple(self._match(i, j) for i, j in places if self.known[i, j].any())

    def _match(self, i: int, j: int) -> FrfMatch:
        known = self.known[i, j]
        model, test, lines = self.model[i, j, known], self.test[i, j, known], self.freq_hz[known]
        level = np.abs(20.0 * np.log10(np.abs(model / test)))
        at = int(level.argmax())
        same = frac(model, test) if len(lines) > 1 else None
        return FrfMatch(self.outputs[i], self.inputs[j], same, float(level.mean()), float(level[at]), float(lines[at]))

    def fdac(self) -> list[tuple[str, float]]:
        """|uᴴu_test|²/(uᴴu · u_testᴴu_test) of the deflections u at one frequency: the mean over the lines, by input.

        The diagonal of `femtune.modal.fdac`, without the rest, which would be lines by lines in size.
        Of inputs whose deflection is known at three outputs at least; with fewer it says little, with one nothing.
        """
        out = []
        for j, label in enumerate(self.inputs):
            known = self.known[:, j]
            enough = known.sum(axis=0) >= _FEWEST_OUTPUTS
            if enough.any():
                a, b = (np.where(known, h[:, j], 0.0)[:, enough] for h in (self.model, self.test))
                size = np.sum(np.abs(a) ** 2, axis=0) * np.sum(np.abs(b) ** 2, axis=0)
                out.append((label, float(np.mean(np.abs(np.sum(a.conj() * b, axis=0)) ** 2 / size))))
        return out

    @cached_property
    def resonances(self) -> tuple[MatchedResonance, ...]:
        """Peaks of the sum of the squares of all functions of an input, each with the nearest one of the model."""
        return tuple(m for j in range(len(self.inputs)) for m in self._resonances(j))

    def _resonances(self, j: int) -> Iterator[MatchedResonance]:
        some = self.known[:, j].any(axis=1)
        lines = np.flatnonzero(self.known[some, j].all(axis=0)) if some.any() else np.zeros(0, int)
        if not len(lines):
            return
        model, test = (_peaks(self.freq_hz[lines], h[some, j][:, lines]) for h in (self.model, self.test))
        far = np.abs(np.log(model[None, :] / test[:, None])) if len(model) else np.zeros((len(test), 0))
        partner = dict(zip(*linear_sum_assignment(far))) if far.size else {}
        for i, hz in enumerate(test):
            k = partner.get(i)
            near = k is not None and abs(model[k] / hz - 1.0) <= _FAR
            yield MatchedResonance(self.inputs[j], float(hz), float(model[k]) if near else None)


def _peaks(freq_hz: Reals, values: Complexes) -> Reals:
    """Frequencies of the peaks of Σ|H|².

    Near a resonance 1/Σ|H|² is a parabola, even if the lines are wider apart than the resonance is.
    """
    from scipy.signal import find_peaks  # noqa: PLC0415  most commands want none

    power = np.sum(np.abs(values) ** 2, axis=0)
    level = 10.0 * np.log10(power)
    at = find_peaks(level, prominence=_PROMINENCE_DB, height=level.max() - _DEPTH_DB)[0]
    x, y = (np.array([one[at - 1], one[at], one[at + 1]]) for one in (freq_hz, power.max() / power))
    first, second = (y[1] - y[0]) / (x[1] - x[0]), (y[2] - y[1]) / (x[2] - x[1])
    bend = (second - first) / (x[2] - x[0])
    return np.asarray(0.5 * (x[0] + x[1]) - 0.5 * first / bend)


Measured = tuple[float, str] | NotTested
"""The worst value, and its place."""


def assess_frfs(predicted: PredictedFrfs, criteria: Sequence[Criterion]) -> tuple[Verdict, ...]:
    """A verdict on each criterion of FRFs, by the worst function, input or resonance.

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.validation.criteria import FRAC, MAX_LEVEL, Criterion
    >>> test = np.array([[[1.0, 2.0 + 1.0j, 3.0j]]])
    >>> found = PredictedFrfs(["1X+"], ["1X+"], np.array([1.0, 2.0, 3.0]), 2.0 * test, test)
    >>> criteria = Criterion("own", FRAC, 0.9, False), Criterion("own", MAX_LEVEL, 3.0, True)
    >>> [(v.outcome.value, round(v.measured, 2)) for v in assess_frfs(found, criteria)]
    [('pass', 1.0), ('fail', 6.02)]
    """
    return tuple(_verdict(predicted, c) for c in criteria)


def _verdict(predicted: PredictedFrfs, criterion: Criterion) -> Verdict:
    if not predicted.matches:
        return not_tested(criterion, "the unused FRFs are zero in the model, or outside of the frequency lines")
    measured = _MEASURES[criterion.quantity](predicted)
    if isinstance(measured, NotTested):
        return not_tested(criterion, measured.reason)
    return judge(criterion, *measured)


def _frac(predicted: PredictedFrfs) -> Measured:
    known = [(m.frac, m.label) for m in predicted.matches if m.frac is not None]
    return min(known) if known else NotTested("the FRFs have fewer than two common frequency lines")


def _fdac(predicted: PredictedFrfs) -> Measured:
    known = [(value, f"input {label}") for label, value in predicted.fdac()]
    return min(known) if known else NotTested("no input has unused FRFs of three outputs or more")


def _mean_level(predicted: PredictedFrfs) -> Measured:
    return max((m.mean_db, m.label) for m in predicted.matches)


def _max_level(predicted: PredictedFrfs) -> Measured:
    worst = max(predicted.matches, key=lambda m: m.max_db)
    return worst.max_db, f"{worst.label} at {worst.max_hz:.4g} Hz"


def _resonance(predicted: PredictedFrfs) -> Measured:
    if not predicted.resonances:
        return NotTested("the measured FRFs have no distinct resonance peak")
    worst = max(predicted.resonances, key=lambda m: m.error)
    if worst.model_hz is None:
        place = f"the model has no peak within {100 * _FAR:.0f} % of {worst.test_hz:.4g} Hz"
    else:
        place = f"test {worst.test_hz:.4g} Hz, model {worst.model_hz:.4g} Hz"
    return worst.error, f"{place}, input {worst.input}"


_MEASURES: dict[str, Callable[[PredictedFrfs], Measured]] = {
    FRAC: _frac,
    FDAC: _fdac,
    MEAN_LEVEL: _mean_level,
    MAX_LEVEL: _max_level,
    RESONANCE: _resonance,
}


def squared_deviation(model: Complexes, test: Complexes, known: Flags) -> Reals:
    """(outputs, inputs) δ over the known lines; NaN without any.

    Examples
    --------
    >>> import numpy as np
    >>> test = np.array([[[1.0, 2.0j]]])
    >>> squared_deviation(10.0 * test, test, np.isfinite(test)).tolist()
    [[1.0]]
    """
    used = known & (model != 0.0) & (test != 0.0)
    ratio = np.divide(model, test, out=np.ones(test.shape, complex), where=used)
    squares = np.where(used, np.abs(np.log(ratio) / np.log(10.0)) ** 2, 0.0).sum(axis=2)
    count = used.sum(axis=2)
    return np.where(count > 0, squares / np.maximum(count, 1), np.nan)
