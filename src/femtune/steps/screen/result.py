"""The result of `screen`: effects of the parameters, for Python users."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.study.rows import Rows, rows_of

if TYPE_CHECKING:
    from femtune.errors import Notice
    from femtune.steps.results import Results
    from femtune.steps.screen.record import ScreenResults
from femtune.steps.result import Arrays, ResultWithPage


@dataclass(frozen=True, eq=False, repr=False)
class ScreenResult(ResultWithPage):
    """Effects of the parameters on the natural frequencies, by designed runs.

    `record` is that of results.json, ``screen``; `results` has it with the facts of the study, `arrays` the arrays by
    key, `files` the files that were written, `report` the page, None without one; `remarks` what a user should know.
    """

    page = "screen"
    record: ScreenResults
    results: Results
    arrays: Arrays
    remarks: tuple[Notice, ...] = ()
    files: tuple[Path, ...] = ()
    report: Path | None = None

    @property
    def effects(self) -> Rows:
        """Effect of each parameter on each mode.

        Of a design by levels `contribution`, `f_value`, `p_value`, `range_hz`; of Morris `mean_hz`, `absolute_hz`,
        `absolute_margin_hz`, `spread_hz`; of Sobol `first`, `total`.
        """
        place, record = ("parameter", "configuration", "mode"), self.record
        if record.elementary:
            return rows_of(record.elementary, *place, "mean_hz", "absolute_hz", "absolute_margin_hz", "spread_hz")
        if record.indices:
            return rows_of(record.indices, *place, "first", "total")
        return rows_of(record.effects, *place, "contribution", "f_value", "p_value", "range_hz")

    @property
    def modes(self) -> Rows:
        """The modes: initial and mean frequency, what is not explained, smallest MAC of the followed shape."""
        columns = ("configuration", "mode", "freq_hz", "mean_hz", "error_contribution", "least_mac")
        return rows_of(self.record.modes, *columns)

    @property
    def runs(self) -> NDArray[np.float64]:
        """(runs, parameters + modes) values of the free parameters, and frequencies in Hz; NaN where a run failed."""
        return self.arrays[self.record.table_key]

    def _sentences(self) -> list[str]:
        alerts = [f"{a.level}: {a.sentence}" for a in self.record.alerts]
        return [
            f"{self.record.design}, {self.record.runs} runs",
            *self.record.sentences,
            *alerts,
            *map(str, self.remarks),
        ]

    def _table(self) -> Rows:
        return self.effects
