"""The result of `correlate` and `compare`: one comparison of modes for each configuration, for Python users."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.steps.correlate.record.correlation import CorrelationResults
from femtune.study.rows import Rows, rows_of

if TYPE_CHECKING:
    from femtune.modal import ModeSet
    from femtune.steps.judge.record.judgement import JudgementResults
    from femtune.steps.results import Results
from femtune.steps.result import Arrays, OfConfigurations, ResultWithPage


@dataclass(frozen=True, eq=False, repr=False)
class CorrelateResult(OfConfigurations[CorrelationResults], ResultWithPage):
    """Test against model in each configuration with a test.

    `records` are those of results.json, ``correlations``, `arrays` by their keys; `files` were written; `remarks` what
    a user should know. `judgement` is the verdict on the comparison; None of `compare`, and of one stage of a run.
    `whole` gives all that a page shows, None where there is no verdict; `report` is the page that was written, None
    without one.
    """

    page = "judgement"
    arrays: Arrays = field(kw_only=True)
    files: tuple[Path, ...] = field(default=(), kw_only=True)
    judgement: JudgementResults | None = field(default=None, kw_only=True)
    whole: Callable[[], Results] | None = field(default=None, kw_only=True)
    report: Path | None = field(default=None, kw_only=True)

    @property
    def results(self) -> Results:  # type: ignore[override]  # made when first used
        """The comparison with the facts of study and model (error ``run.no-page`` where there is no verdict)."""
        if self.whole is None:
            raise FemtuneError("run.no-page")
        return self.whole()

    @property
    def pairs(self) -> Rows:
        """Paired modes: frequencies in Hz, error in %, MAC."""
        columns = ("test_label", "test_freq_hz", "model_number", "model_freq_hz", "freq_error_percent", "mac")
        return Rows.of(
            {"configuration": c.configuration, **row} for c in self.records for row in rows_of(c.pairs, *columns)
        )

    @property
    def unpaired(self) -> Rows:
        """Modes of the test without a partner, and those that the study leaves out, with the reason."""
        return Rows.of(
            {"configuration": c.configuration, **row}
            for c in self.records
            for row in rows_of((*c.unpaired_test, *c.suspension, *c.left_out), "test_label", "test_freq_hz", "reason")
        )

    @property
    def criteria(self) -> Rows:
        """Acceptance criteria with measured value, limit and verdict."""
        columns = ("name", "sense", "limit", "measured", "unit", "verdict", "remark")
        return Rows.of(
            {"configuration": c.configuration, **row} for c in self.records for row in rows_of(c.criteria, *columns)
        )

    @property
    def comac(self) -> Rows:
        """COMAC of each measured DOF over the paired modes."""
        return Rows.of(
            {"configuration": c.configuration, **row} for c in self.records for row in rows_of(c.comac, "dof", "comac")
        )

    @property
    def contributions(self) -> Rows:
        """eCOMAC of each measured DOF, and the change of the MAC when it is left out."""
        columns = ("dof", "ecomac", "mac_change", "largest_change", "largest_change_label")
        return Rows.of(
            {"configuration": c.configuration, **row}
            for c in self.records
            for row in rows_of(c.contributions, *columns)
        )

    @property
    def expanded(self) -> dict[str, ModeSet]:
        """Test shapes expanded to the DOFs of the model's grid points, in basic axes, by configuration."""
        from femtune.steps.correlate.expansion import expanded_modes  # noqa: PLC0415

        return {
            c.configuration: expanded_modes(c.expansion, self.arrays) for c in self.records if c.expansion is not None
        }

    @property
    def expansion(self) -> Rows:
        """Error of each expansion method at sensors that were left out, in %, one line a test mode; `misfit_percent` is
        that of the method in use at all sensors."""
        return Rows.of(
            {
                "configuration": c.configuration,
                "test_label": m.test_label,
                "test_freq_hz": m.test_freq_hz,
                "method": c.expansion.method,
                "misfit_percent": m.misfit_percent,
                **{e.method: e.error_percent for e in m.errors},
            }
            for c in self.records
            if c.expansion is not None
            for m in c.expansion.modes
        )

    @property
    def macs(self) -> dict[str, NDArray[np.float64]]:
        """MAC (test modes, model modes) by configuration."""
        return {c.configuration: self.arrays[c.mac_key] for c in self.records if c.mac_key is not None}

    @property
    def mac(self) -> NDArray[np.float64]:
        """(test modes, model modes) MAC of the only configuration (error ``study.unknown-configuration`` for several).

        Raises
        ------
        FemtuneError : ``correlate.no-shapes`` where the test has no shapes
        """
        key = self._only("mac").mac_key
        if key is None:
            raise FemtuneError("correlate.no-shapes")
        return np.asarray(self.arrays[key])

    def _sentences(self) -> list[str]:
        sentences = []
        for c in self.records:
            tests = len(c.pairs) + len(c.unpaired_test)
            worst = max(c.pairs, key=lambda p: abs(p.freq_error_percent), default=None)
            macs = [p.mac for p in c.pairs if p.mac is not None]
            text = f"{c.configuration}: {len(c.pairs)} of {tests} test modes paired"
            if c.suspension:
                text += f", and {len(c.suspension)} of the suspension set apart"
            if worst is not None:
                text += f"; largest frequency error {worst.freq_error_percent:+.3g} % (mode {worst.test_label})"
            sentences.append(text + (f"; lowest MAC {min(macs):.3f}" if macs else ""))
        return [*sentences, *map(str, self.remarks)]

    def _table(self) -> Rows:
        return self.pairs
