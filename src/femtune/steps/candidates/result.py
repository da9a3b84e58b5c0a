"""The result of `candidates`: the candidates compared, for Python users."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.study.rows import Rows, rows_of

if TYPE_CHECKING:
    from femtune.errors import Notice
    from femtune.steps.candidates.record import CandidatesResults
    from femtune.steps.results import Results
from femtune.steps.result import Arrays, ResultWithPage


@dataclass(frozen=True, eq=False, repr=False)
class CandidatesResult(ResultWithPage):
    """Candidate models, each updated from the same test, and their comparison.

    `record` is that of results.json, ``candidates``; `results` has it with the facts of the study, `arrays` the arrays
    by key, `report` the page, None without one; `remarks` what a user should know.
    """

    page = "candidates"
    record: CandidatesResults
    results: Results
    arrays: Arrays
    remarks: tuple[Notice, ...] = ()
    report: Path | None = None

    @property
    def candidates(self) -> Rows:
        """Models with their criteria; see `CandidateResults` in the schema of the results."""
        columns = (
            "name", "status", "rank", "error_percent", "prediction_percent", "bic", "bic_weight", "log_evidence",
            "probability", "sampled_log_evidence", "sampled_log_evidence_sd", "sampled_effective", "sampled_k_hat",
            "sampled_probability", "worst_residual",
            "least_worst_residual", "worst_label", "admissible",
            "cluster", "starts_at_best",
        )  # fmt: skip
        return rows_of(self.record.candidates, *columns)

    @property
    def values(self) -> dict[str, dict[str, float]]:
        """By candidate that was solved, the values of all parameters at its optimum."""
        return {c.name: {v.parameter: v.value for v in c.values} for c in self.record.solved}

    @property
    def distances(self) -> NDArray[np.float64]:
        """(m, m) root mean square difference of the parameters of the solved candidates, relative to initial values."""
        return self.arrays[self.record.distances_key]

    def _sentences(self) -> list[str]:
        alerts = [f"{a.level}: {a.sentence}" for a in self.record.alerts]
        return [f"{len(self.record.candidates)} models", *self.record.sentences, *alerts, *map(str, self.remarks)]

    def _table(self) -> Rows:
        return self.candidates
