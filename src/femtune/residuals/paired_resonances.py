"""Resonances of the test that have partners in the model, as regions of frequency lines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from femtune.errors import FemtuneError, Notice
from femtune.residuals.case import CaseState
from femtune.residuals.frf_lines import Resonance, Resonances
from femtune.residuals.pairing import pair_case


@dataclass(frozen=True)
class PairedResonances:
    """Which paired test modes have a region, and how wide it is.

    Parameters
    ----------
    labels : of test modes; None takes all that are paired
    ratio : damping ratio of modes whose test tells none; None takes the test's word for it
    aligned : True takes the model's functions at lines that make its peaks coincide with the test's
    bandwidths, lines : as of `Resonances`
    """

    labels: tuple[str, ...] | None = None
    ratio: float | None = None
    aligned: bool = False
    bandwidths: float = 2.0
    lines: int = 3

    def found(self, state: CaseState) -> tuple[Resonances, tuple[Notice, ...]]:
        """Regions of the modes that are paired in a state, and the others with their reasons.

        Raises
        ------
        FemtuneError : ``residual.resonance`` where no mode is left, or one has no damping ratio
        """
        modes = tuple(self._paired(state))
        if not modes:
            raise FemtuneError(
                "residual.resonance",
                f"configuration {state.case.name}: FRFs are compared around paired resonances, and no mode is paired",
                hint="compare a band, or widen the gates in [correlate]",
            )
        return Resonances(modes, self.bandwidths, self.lines), tuple(self._left(state))

    def _wanted(self, label: str) -> bool:
        return self.labels is None or label in self.labels

    def _paired(self, state: CaseState) -> Iterator[Resonance]:
        test, solution = state.case.test, state.solution
        for tests, models in state.groups:
            for i, j in zip(sorted(tests), sorted(models)):
                label, freq = test.labels[i], float(test.freq_hz[i])
                if self._wanted(label):
                    partner = float(solution.freq_hz[j]) if self.aligned else None
                    yield Resonance(label, freq, self._ratio(state, i), partner)

    def _ratio(self, state: CaseState, i: int) -> float:
        given = state.case.test.damping_ratio
        known = float(given[i]) if given is not None else 0.0
        return known if known > 0.0 else self.ratio or 0.0

    def _left(self, state: CaseState) -> Iterator[Notice]:
        labels = state.case.test.labels
        for u in pair_case(state.case, state.solution).unpaired_test:
            if self._wanted(labels[u.test]):
                what = f"{state.case.name}: FRFs are not compared around test mode {labels[u.test]}: {u.reason}"
                yield Notice("residual.resonance-unpaired", what, level="info")
