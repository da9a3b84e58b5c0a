"""Records of one version of the model: modes and correlations before the update, after it, and as written."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice
from femtune.model import EigenSolution
from femtune.residuals import CaseState, Evaluation, state_at
from femtune.steps.correlate.criteria import of_whole_tests
from femtune.steps.correlate.expansion import expansion_results
from femtune.steps.correlate.facts import array_prefix, correlate_case, correlation_results
from femtune.steps.correlate.placement import placement_results
from femtune.steps.info.facts import model_modes
from femtune.steps.modes.shapes import mode_shapes
from femtune.study.cases import StudyCase
from femtune.study.error_places import errors_at, errors_at_configuration, errors_at_grid, errors_at_residuals, place_of
from femtune.study.exchanged_axes import fitting_axes
from femtune.study.progress import silent
from femtune.study.solved import nominal, solve, solved_if_any
from femtune.study.stages import reduction_rules
from femtune.updating.on_reduced_model import keep_functions

if TYPE_CHECKING:
    from femtune.correlation import Correlation
    from femtune.steps.correlate.record.correlation import CorrelationResults
    from femtune.steps.info.record.model import ModelModes
    from femtune.steps.modes.record import ModeShapes
    from femtune.steps.respond.record import ResponseResults
    from femtune.study.progress import Progress
    from femtune.study.record import ModelVersion
    from femtune.study.study import Study


Arrays = dict[str, NDArray]
Solutions = Mapping[str, EigenSolution]
Solved = Callable[[StudyCase, EigenSolution], None]
_SAME_HZ = 1e-5
"""Largest relative difference between a stated frequency of a model mode and that of the same mode: six digits in the
results of external solvers."""
_RIGID_HZ = 1e-3
"""The same, as a part of the lowest frequency of the test, for rigid-body modes, whose frequencies are rounding."""


def nothing(case: StudyCase, solution: EigenSolution) -> None:
    """Ignores the solution."""


@dataclass(frozen=True, eq=False)
class ModelRecords:
    """Modes, correlations and responses of all configurations at one parameter vector; `raw` by configuration."""

    modes: tuple[ModelModes, ...]
    correlations: tuple[CorrelationResults, ...]
    shapes: tuple[ModeShapes, ...]
    raw: dict[str, Correlation]
    responses: tuple[ResponseResults, ...] = ()


def start(study: Study, progress: Progress) -> Evaluation:
    """The update problem at the initial values; its errors point into the study or the deck.

    Raises
    ------
    FemtuneError : ``study.no-test``, ``correlate.no-pairs``, ``residual.*``, ``eigen.*``
    """
    problem, x, states = study.problem(), nominal(study), []
    cases = [c for c in study.cases if c.used is not None]
    for i, case in enumerate(cases):
        progress.step(f"solving and pairing the modes: {case.name}", i, len(cases))
        assert case.used is not None
        solution = solve(study, case, x) if case.modal is not None else None
        with errors_at_configuration(study.file, case.entry, "test"):
            states.append(state_at(case.used, x, solution))
    of_modes = next((c.entry for c in cases if c.modal is not None), cases[0].entry)
    with errors_at(place_of(study.file, of_modes, "test")), _hint_of_axes(study, states):
        problem.check_paired(states)
    rules = reduction_rules(study)
    with errors_at_residuals(study.file):
        if rules is not None and not study.file.stage:
            keep_functions(problem, rules, states)
        state = problem.assess(x, states)
        problem.check_compared(state)
        return state


@contextmanager
def _hint_of_axes(study: Study, states: Sequence[CaseState]) -> Iterator[None]:
    """The error that no mode is paired says with which axes of the test they would be, if there are such axes."""
    try:
        yield
    except FemtuneError as error:
        cases = {case.name: case for case in study.cases}
        solved = ((cases[s.case.name], s.solution) for s in states if s.solution is not None)
        error.hint = next(
            (w for case, solution in solved if (w := fitting_axes(study.file, case, solution))), error.hint
        )
        raise


def model_records(
    study: Study,
    version: ModelVersion,
    x: NDArray,
    known: Solutions,
    arrays: Arrays,
    progress: Progress,
    solved: Solved = nothing,
) -> ModelRecords:
    """Modes and correlations at `x`; what `known` has is not solved again. `solved` is called with each solution."""
    natural_modes, records, shapes, raw = [], [], [], {}
    criteria = of_whole_tests(study)
    # where nothing is written back, what comes after the update is the last version
    last = version != "after" or not study.writes_deck
    for i, case in enumerate(study.cases):
        progress.step(f"modes and correlation, {version}: {case.name}", i, len(study.cases))
        solution = known[case.name] if case.name in known else solved_if_any(study, case, x)
        if solution is None:
            continue
        if version == "before":
            _check_numbers(study, case, solution)
        solved(case, solution)
        natural_modes.append(model_modes(case.name, version, solution))
        prefix = array_prefix(version, case.name, i + 1)
        if last:
            shapes.append(mode_shapes(case, version, solution, prefix, arrays))
        if case.modal is not None:
            with errors_at_configuration(study.file, case.entry, "test"):
                raw[case.name] = correlate_case(case.modal, solution, natural_modes[-1].rigid_body_modes)
            rigid, notices = natural_modes[-1].rigid_body_modes, solution.notices
            if words := fitting_axes(study.file, case, solution):
                notices = (*notices, Notice("correlate.axes", configuration=case.name, change=words))
            record = correlation_results(
                case.name, version, raw[case.name], prefix, arrays, criteria, rigid, notices
            )  # fmt: skip
            more: dict[str, object] = {"mac_gate": case.modal.rules.mac_gate}
            more["placement"] = placement_results(case, raw[case.name], solution)
            if last and study.file.correlate.expand != "none":
                progress.step(f"expansion of the test shapes, {version}: {case.name}", i, len(study.cases))
                more["expansion"] = expansion_results(
                    case, study.file.correlate, raw[case.name], solution, prefix, arrays
                )
            records.append(record.model_copy(update=more))
    return ModelRecords(tuple(natural_modes), tuple(records), tuple(shapes), raw)


def _check_numbers(study: Study, case: StudyCase, solution: EigenSolution) -> None:
    """Refuse pairs whose model mode has another frequency at the initial values than is stated beside its number (error
    ``correlate.renumbered``)."""
    if case.modal is None:
        return
    rigid_hz = _RIGID_HZ * float(np.min(case.modal.test.freq_hz))
    for key in ("pairs", "never_pairs"):
        for i, pair in enumerate(getattr(case.entry, key)):
            if pair.model_hz is None or pair.model > len(solution.freq_hz):
                continue
            now = float(solution.freq_hz[pair.model - 1])
            if abs(now - pair.model_hz) > max(_SAME_HZ * pair.model_hz, rigid_hz * (pair.model_hz <= rigid_hz)):
                nearest = int(np.argmin(np.abs(solution.freq_hz - pair.model_hz)))
                values = {
                    f"model mode {pair.model} when the pair was chosen": f"{pair.model_hz:.7g} Hz",
                    f"model mode {pair.model} now": f"{now:.7g} Hz",
                    "nearest now": f"model mode {nearest + 1}, {solution.freq_hz[nearest]:.7g} Hz",
                }
                raise FemtuneError(
                    "correlate.renumbered", where=place_of(study.file, case.entry, key, i), values=values,
                    test=pair.test, model=pair.model,
                )  # fmt: skip


def as_written(study: Study, after: Evaluation) -> Evaluation:
    """The study on the written deck, its modes paired as at the end of the update.

    Modes are tracked by their shapes, so that the two mean errors compare the same pairs; if the free DOFs
    differ, they are paired again.
    """
    problem = study.problem()
    same = all(c.configured.n_free == s.case.configured.n_free for c, s in zip(problem.cases, after.states))
    if not same:
        return start(study, silent)
    states = tuple(CaseState(c, s.point, s.groups, s.solved) for c, s in zip(problem.cases, after.states))
    with errors_at_grid(study.built):
        return problem.follow(np.zeros(0), Evaluation(np.zeros(0), states, ()))
