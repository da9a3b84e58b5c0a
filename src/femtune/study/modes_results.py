"""Modes with everything that a page of them shows: the model's facts, shapes for drawing, provenance."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.model import EigenSolution
from femtune.study.cases import StudyCase
from femtune.study.load import Study, is_deck, load_study, with_modes_asked
from femtune.study.progress import Progress, silent
from femtune.study.provenance import Inputs, Stopwatch, input_paths, inputs_of, provenance, study_facts
from femtune.study.record_correlation import array_prefix
from femtune.study.record_model import model_facts, model_modes
from femtune.study.record_shapes import MOST_MODES, mode_shapes
from femtune.study.results import Results
from femtune.study.results_base import StudyFacts
from femtune.study.results_model import ModelModes
from femtune.study.results_shapes import ModeShapes
from femtune.study.simulated_test import SimulatedTest, check_simulated, write_simulated
from femtune.study.stages import solved_cases
from femtune.study.with_journal import looking_up

Arrays = dict[str, NDArray]


def modes_results(
    path: Path | str,
    progress: Progress = silent,
    *,
    fresh: bool = False,
    remarks: list[str] | None = None,
    keep: Sequence[Path] = (),
    count: int | None = None,
    max_hz: float | None = None,
    simulate: SimulatedTest | None = None,
) -> tuple[Results, Arrays]:
    """Modes of a study, or of a deck, at the start values of the parameters, as `modes` finds them.

    Parameters
    ----------
    path, progress, fresh, remarks, count, max_hz, simulate : as for `modes`
    keep : files that will be written with what this returns; none of them may be one that was read

    Raises
    ------
    FemtuneError : ``write.overwrites-input``, and as `modes`
    """
    watch = Stopwatch(f"femtune.modes_report({str(path)!r})")
    arrays: Arrays = {}
    with watch.step("read"):
        loaded = with_modes_asked(load_study(path, progress), count, max_hz)
        _check_kept(loaded, keep)
        if simulate is not None:
            check_simulated(loaded, simulate)
        inputs = _each_once(inputs_of(loaded))
    with watch.step("modes"), looking_up(loaded, fresh, remarks) as study:
        solved = list(solved_cases(study, progress))
        modes, shapes = _records(solved, arrays)
    if simulate is not None:
        write_simulated(loaded, simulate, solved)
    progress.step("mass and rigid-body check", 0, None)
    with watch.step("checks"):
        model = model_facts(loaded)
    facts = _facts(loaded, is_deck(path))
    found = Results(
        provenance=provenance(inputs, watch, modes),
        study=facts,
        model=model,
        modes=tuple(modes),
        mode_shapes=tuple(shapes),
    )
    return found, arrays


def _records(
    solved: Sequence[tuple[StudyCase, EigenSolution]], arrays: Arrays
) -> tuple[list[ModelModes], list[ModeShapes]]:
    modes, shapes = [], []
    for i, (case, solution) in enumerate(solved):
        modes.append(model_modes(case.name, "before", solution))
        first = replace(solution, wanted=min(solution.wanted, MOST_MODES))
        # what was measured is no matter here
        alone = replace(case, test=None, sensors=None, compared=None)
        shapes.append(mode_shapes(alone, "before", first, array_prefix("before", case.name, i + 1), arrays))
    return modes, shapes


def _each_once(inputs: Inputs) -> Inputs:
    """A deck alone stands for its study."""
    return replace(inputs, files=tuple(file for file in inputs.files if file != inputs.study_file))


def _facts(study: Study, deck_alone: bool) -> StudyFacts:
    """A deck alone tells no units."""
    facts = study_facts(study)
    return facts.model_copy(update={"units": ""}) if deck_alone else facts


def _check_kept(study: Study, keep: Sequence[Path]) -> None:
    inputs = {os.path.realpath(path) for path in (study.file.path, *input_paths(study))}
    for path in keep:
        if os.path.realpath(path) in inputs:
            raise FemtuneError(
                "write.overwrites-input",
                "the page would overwrite a file that was read",
                where=Where(str(path)),
                hint="give the page another name",
            )
