"""Modes of the configurations of a study."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.study.error_places import errors_at_grid

if TYPE_CHECKING:
    from femtune.model import EigenSolution
    from femtune.residuals import Evaluation
    from femtune.study.cases import StudyCase
    from femtune.study.progress import Progress
    from femtune.study.study import Study


def nominal(study: Study) -> NDArray[np.float64]:
    """Initial values of the normalised parameters."""
    return np.zeros(len(study.parameters.free))


def solve(study: Study, case: StudyCase, x: NDArray) -> EigenSolution:
    """Modes of one configuration."""
    with errors_at_grid(study.built):
        if case.compared is not None:
            return case.compared.solver.modes(case.compared.configured.at(x), case.compared.count, case.compared.max_hz)
        return study.solver.modes(case.configured.at(x), study.file.modes.count, study.file.modes.max_hz)


def solved_if_any(study: Study, case: StudyCase, x: NDArray) -> EigenSolution | None:
    """Modes of a configuration; None if none were measured and the model has no free mass."""
    try:
        return solve(study, case, x)
    except FemtuneError as error:
        if case.modal is None and case.compared is not None and error.code == "eigen.no-mass":
            return None
        raise


def solutions_of(evaluation: Evaluation) -> dict[str, EigenSolution]:
    """What an evaluation has solved, by name of the configuration."""
    solutions = {state.case.name: state.solved for state in evaluation.states}
    return {name: solution for name, solution in solutions.items() if solution is not None}


def solved_cases(study: Study, progress: Progress) -> Iterator[tuple[StudyCase, EigenSolution]]:
    """Each configuration with its modes at the initial values."""
    for i, case in enumerate(study.cases):
        progress.step(f"modes of {case.name}", i, len(study.cases))
        yield case, solve(study, case, nominal(study))
