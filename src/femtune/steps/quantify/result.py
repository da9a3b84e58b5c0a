"""The result of `quantify`: distribution of the parameters over repeated tests, for Python users."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.study.rows import Rows, rows_of

if TYPE_CHECKING:
    from femtune.errors import Notice
    from femtune.steps.quantify.record import QuantifyResults
from femtune.steps.result import Arrays, StepResult


@dataclass(frozen=True, eq=False, repr=False)
class QuantifyResult(StepResult):
    """Mean and covariance of the parameters from repeated tests.

    `record` is that of results.json, ``quantify``; `arrays` by its keys; `remarks` as those of the other steps.
    """

    record: QuantifyResults
    arrays: Arrays = field(repr=False)
    remarks: tuple[Notice, ...] = ()

    @property
    def ok(self) -> bool:
        """True if mean and covariance may be used."""
        return self.record.ok

    @property
    def parameters(self) -> Rows:
        """One line per free parameter: initial value, mean and standard deviation, in its unit."""
        return rows_of(self.record.parameters, "parameter", "start", "mean", "sd", "outside_bounds")

    @property
    def frequencies(self) -> Rows:
        """One line a compared frequency: mean and standard deviation of the repeats and of the model, in Hz."""
        columns = ("label", "repeats", "measured_mean_hz", "measured_sd_hz", "model_mean_hz", "model_sd_hz")
        return rows_of(self.record.outputs, *columns)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(parameters, parameters) covariance of the parameters, in their units."""
        return np.asarray(self.arrays[str(self.record.parameter_covariance_key)])

    @property
    def cloud(self) -> NDArray[np.float64]:
        """(samples, frequencies) frequencies of the updated distribution, in Hz."""
        return np.asarray(self.arrays[str(self.record.cloud_key)])

    @property
    def repeats(self) -> NDArray[np.float64]:
        """(repeats, frequencies) measured frequencies in Hz; NaN where one was not measured."""
        return np.asarray(self.arrays[str(self.record.repeats_key)])

    def _sentences(self) -> list[str]:
        r = self.record
        return [f"{r.status}, {r.repeats} repeats of {r.configuration}", *r.sentences, *map(str, self.remarks)]

    def _table(self) -> Rows:
        return self.parameters
