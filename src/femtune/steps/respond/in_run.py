"""The responses in `femtune run`."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from femtune.journal.run_files import FRFS_FILE, numbered
from femtune.steps.respond.run import responses_at, write_frf_files
from femtune.steps.run.outcomes import AsWritten, Final, Initial, Made, Outcomes, Updated, Written

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def respond_before(run: Run, outcomes: Outcomes, made: Made) -> Initial:
    """The responses at the initial values."""
    initial = outcomes.of(Initial)
    responses = responses_at(run.study, "before", initial.at.x, made.arrays, run.progress)
    return replace(initial, records=replace(initial.records, responses=responses))


def respond_as_written(run: Run, outcomes: Outcomes, made: Made) -> AsWritten:
    """The responses of the written deck."""
    study, deck = outcomes.of(Written).study, outcomes.of(AsWritten)
    # the written deck has no parameters
    responses = responses_at(study, "after as written", np.zeros(0), made.arrays, run.progress)
    made.add_files(write_frf_files(study, responses, made.arrays, numbered(run.folder / FRFS_FILE, len(study.cases))))
    return replace(deck, records=replace(deck.records, responses=responses))


def respond_after(run: Run, outcomes: Outcomes, made: Made) -> Final:
    """The responses at the end of the update, where no deck is written."""
    final, x = outcomes.of(Final), outcomes.of(Updated).parameters.result.x
    responses = responses_at(run.study, "after", x, made.arrays, run.progress)
    files = numbered(run.folder / FRFS_FILE, len(run.study.cases))
    made.add_files(write_frf_files(run.study, responses, made.arrays, files))
    return replace(final, records=replace(final.records, responses=responses))
