"""The result of `select`: what the data determine, for Python users."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.study.rows import Rows, rows_of

if TYPE_CHECKING:
    from femtune.errors import Notice
    from femtune.steps.select.record.identifiability import SelectionResults
from femtune.steps.result import Arrays, StepResult


@dataclass(frozen=True, eq=False, repr=False)
class SelectResult(StepResult):
    """Which parameters and combinations of parameters the data determine.

    `record` is that of results.json, ``selection``; `arrays` by its keys; `remarks` as those of the other steps.
    """

    record: SelectionResults
    arrays: Arrays = field(repr=False)
    remarks: tuple[Notice, ...] = ()

    @property
    def parameters(self) -> Rows:
        """One line a free parameter: posterior over prior standard deviation, and the verdict."""
        return rows_of(self.record.parameters, "parameter", "sd_ratio", "verdict", "sentence")

    @property
    def sensitivities(self) -> Rows:
        """Change of each frequency in % for 1 % of each parameter's initial value; one column per parameter."""
        names = self.record.column_labels
        return Rows.of(
            {"configuration": s.configuration, "test_label": s.test_label, **dict(zip(names, s.percent_per_percent))}
            for s in self.record.sensitivities
        )

    @property
    def jacobian(self) -> NDArray[np.float64]:
        """(residuals, parameters) scaled Jacobian; rows are ``record.row_labels``, columns ``record.column_labels``."""
        return np.asarray(self.arrays[str(self.record.jacobian_key)])

    @property
    def correlation(self) -> NDArray[np.float64] | None:
        """(parameters, parameters) posterior correlation of the parameters; None where it is not known."""
        key = self.record.correlation_key
        return None if key is None else np.asarray(self.arrays[key])

    @property
    def singular_values(self) -> NDArray[np.float64]:
        """Singular values of the scaled Jacobian, falling."""
        return np.array(self.record.singular_values)

    def _sentences(self) -> list[str]:
        of = f"{self.record.rank} of {len(self.record.column_labels)} combinations of parameters are determined"
        return [of, *self.record.sentences, *map(str, self.remarks)]

    def _table(self) -> Rows:
        return self.parameters
