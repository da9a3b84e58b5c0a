"""What the topics of the verdict read: the update with its residuals and Jacobian, and the results so far."""

from __future__ import annotations

from collections.abc import MutableMapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from numpy.typing import NDArray

if TYPE_CHECKING:
    from femtune.residuals import Evaluation
    from femtune.steps.results import Results
    from femtune.study.progress import Progress
    from femtune.study.study import Study
    from femtune.updating import ReducedSearch, UpdateResult


@dataclass(frozen=True, eq=False)
class FinishedUpdate:
    """A finished update.

    Parameters
    ----------
    study : the study in which the update ended, which is that of the last stage if the update had stages
    initial : the update problem at the initial values
    result : the update, with the update problem at its end (`result.after`)
    results : the records of all steps so far
    arrays : arrays of the records, by key; a topic may add its own
    progress : receives progress reports
    search : the reduced models of the update, accurate at its end; None without reduced models
    """

    study: Study
    initial: Evaluation
    result: UpdateResult
    results: Results
    arrays: MutableMapping[str, NDArray]
    progress: Progress
    search: ReducedSearch | None = None
