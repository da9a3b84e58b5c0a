"""Modes and correlations of all configurations before the update, after it, and as written."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.correlate import Correlation
from femtune.errors import FemtuneError
from femtune.model import EigenSolution
from femtune.residuals import CaseState, Evaluation, solve_case, state_at
from femtune.study.cases import StudyCase
from femtune.study.criteria import of_whole_tests
from femtune.study.load import Study
from femtune.study.located import located, located_in, located_in_deck, place_of
from femtune.study.progress import Progress, silent
from femtune.study.record_correlation import array_prefix, correlate_case, correlation_results
from femtune.study.record_model import model_modes
from femtune.study.record_shapes import mode_shapes
from femtune.study.results_base import Stage
from femtune.study.results_correlation import CorrelationResults
from femtune.study.results_model import ModelModes
from femtune.study.results_response import ResponseResults
from femtune.study.results_shapes import ModeShapes

Arrays = dict[str, NDArray]
Solutions = Mapping[str, EigenSolution]
Solved = Callable[[StudyCase, EigenSolution], None]


def nothing(case: StudyCase, solution: EigenSolution) -> None:
    """Nobody wants to know of a solution."""


@dataclass(frozen=True, eq=False)
class StageRecords:
    """Modes, correlations and responses of all configurations at one parameter vector; `raw` by configuration."""

    modes: tuple[ModelModes, ...]
    correlations: tuple[CorrelationResults, ...]
    shapes: tuple[ModeShapes, ...]
    raw: dict[str, Correlation]
    responses: tuple[ResponseResults, ...] = ()


def nominal(study: Study) -> NDArray[np.float64]:
    """Normalised parameters of the start."""
    return np.zeros(len(study.parameters.free))


def start(study: Study, progress: Progress) -> Evaluation:
    """The update problem at the start values; its errors point into the study or the deck.

    Raises
    ------
    FemtuneError : ``study.no-test``, ``correlate.no-pairs``, ``residual.*``, ``eigen.*``
    """
    problem, x, states = study.problem(), nominal(study), []
    cases = [c for c in study.cases if c.used is not None]
    for i, case in enumerate(cases):
        progress.step(f"solving and pairing the modes: {case.name}", i, len(cases))
        states.append(_state(study, case, x))
    of_modes = next((c.entry for c in cases if c.modal is not None), cases[0].entry)
    with located(place_of(study.file, of_modes, "test")):
        problem.check_paired(states)
    at_fault = ("residual",) if study.file.residual else ("residuals", "frequency_sd")
    with located(study.file.where(*at_fault)):
        found = problem.assess(x, states)
        problem.check_compared(found)
        return found


def _state(study: Study, case: StudyCase, x: NDArray) -> CaseState:
    used = case.used
    assert used is not None
    if case.modal is None:
        return state_at(used, x)
    solution = solve(study, case, x)
    with located_in(study.file, case.entry, "test"):
        return state_at(used, x, solution)


def solve(study: Study, case: StudyCase, x: NDArray) -> EigenSolution:
    """Modes of one configuration."""
    with located_in_deck(study.built.deck):
        if case.compared is not None:
            return solve_case(case.compared, x)
        table = study.file.modes
        return study.solver.modes(case.configured.at(x), table.wanted, table.max_hz)


def _solved_if_any(study: Study, case: StudyCase, x: NDArray) -> EigenSolution | None:
    """Modes of a configuration; None where none were measured and the model has no mass that could move."""
    try:
        return solve(study, case, x)
    except FemtuneError as error:
        if case.modal is None and case.compared is not None and error.code == "eigen.no-mass":
            return None
        raise


def solutions_of(evaluation: Evaluation) -> Solutions:
    """What an evaluation has solved, by name of the configuration."""
    found = {state.case.name: state.solved for state in evaluation.states}
    return {name: solution for name, solution in found.items() if solution is not None}


def solved_cases(study: Study, progress: Progress) -> Iterator[tuple[StudyCase, EigenSolution]]:
    """Each configuration with its modes at the start values."""
    for i, case in enumerate(study.cases):
        progress.step(f"modes of {case.name}", i, len(study.cases))
        yield case, solve(study, case, nominal(study))


def stage_records(
    study: Study,
    stage: Stage,
    x: NDArray,
    known: Solutions,
    arrays: Arrays,
    progress: Progress,
    solved: Solved = nothing,
) -> StageRecords:
    """Modes and correlations at `x`; what `known` has is not solved again. `solved` is told each solution."""
    found, records, shapes, raw = [], [], [], {}
    criteria = of_whole_tests(study)
    for i, case in enumerate(study.cases):
        progress.step(f"modes and correlation, {stage}: {case.name}", i, len(study.cases))
        solution = known[case.name] if case.name in known else _solved_if_any(study, case, x)
        if solution is None:
            continue
        solved(case, solution)
        found.append(model_modes(case.name, stage, solution))
        prefix = array_prefix(stage, case.name, i + 1)
        # a model of matrices is never written: what comes after the update is its last stage
        if stage != "after" or study.file.imported:
            shapes.append(mode_shapes(case, stage, solution, prefix, arrays))
        if case.modal is not None:
            with located_in(study.file, case.entry, "test"):
                raw[case.name] = correlate_case(case.modal, solution)
            record = correlation_results(
                case.name, stage, raw[case.name], prefix, arrays, criteria, found[-1].rigid_body_modes
            )
            records.append(record.model_copy(update={"mac_gate": case.modal.rules.mac_gate}))
    return StageRecords(tuple(found), tuple(records), tuple(shapes), raw)


def as_written(study: Study, after: Evaluation) -> Evaluation:
    """The study on the written deck, its modes paired as at the end of the update.

    Modes are tracked by their shapes, so that the two mean errors compare the same pairs; where the free DOFs
    differ they are paired afresh.
    """
    problem = study.problem()
    same = all(c.configured.n_free == s.case.configured.n_free for c, s in zip(problem.cases, after.states))
    if not same:
        return start(study, silent)
    states = tuple(CaseState(c, s.point, s.groups, s.solved) for c, s in zip(problem.cases, after.states))
    with located_in_deck(study.built.deck):
        return problem.follow(np.zeros(0), Evaluation(np.zeros(0), states, ()))
