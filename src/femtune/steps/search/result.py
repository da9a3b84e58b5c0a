"""The result of `search`: the minimum found in the whole box, for Python users."""

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
    from femtune.steps.search.record import GlobalSearchResults
from femtune.steps.result import Arrays, ResultWithPage


@dataclass(frozen=True, eq=False, repr=False)
class SearchResult(ResultWithPage):
    """The minimum of the squared residuals within the bounds, by a search of the whole box.

    `record` is that of results.json, ``search``; `results` has it with the facts of the study, `arrays` the arrays by
    key, `report` the page, None without one; `remarks` what a user should know.
    """

    page = "search"
    record: GlobalSearchResults
    results: Results
    arrays: Arrays
    remarks: tuple[Notice, ...] = ()
    report: Path | None = None

    @property
    def parameters(self) -> Rows:
        """The free parameters: `initial`, `found` by the search, and `value` after least squares on the model."""
        return rows_of(
            self.record.parameters, "name", "unit", "lower", "upper", "initial", "found", "value", "at_bound"
        )

    @property
    def values(self) -> dict[str, float]:
        """Values after least squares on the model, by name."""
        return {p.name: p.value for p in self.record.parameters}

    @property
    def seeds(self) -> Rows:
        """The searches: `evaluations`, `chi2` at the end, whether it is the `same` minimum."""
        return rows_of(self.record.seeds, "seed", "evaluations", "chi2", "same", "converged")

    @property
    def history(self) -> NDArray[np.float64]:
        """(points, 3) convergence of the searches: seed, evaluations, smallest χ² so far."""
        return self.arrays[self.record.history_key]

    @property
    def front(self) -> NDArray[np.float64]:
        """(points, parameters + objectives) front: values of the free parameters, frequency errors, other errors (and
        the third objective, if asked for); (0, …) without one."""
        if self.record.front is None:
            return np.zeros((0, len(self.record.parameters) + 2))
        return self.arrays[self.record.front.front_key]

    def _sentences(self) -> list[str]:
        alerts = [f"{a.level}: {a.sentence}" for a in self.record.alerts]
        return [
            f"{self.record.method} on the {self.record.on}",
            *self.record.sentences,
            *alerts,
            *map(str, self.remarks),
        ]

    def _table(self) -> Rows:
        return self.parameters
