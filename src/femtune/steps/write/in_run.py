"""The updated deck in `femtune run`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.journal.run_files import DECK_FILE, Role, made_by
from femtune.steps.run.outcomes import AsWritten, Final, Made, Outcomes, Updated, Written
from femtune.steps.write.run import check_written, write_back
from femtune.steps.write.verify import frequency_differences, named_if_same
from femtune.study.study import on_decks

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def write_deck(run: Run, outcomes: Outcomes, made: Made) -> Written:
    """The updated deck, under another name until it has been compared with the update."""
    run.progress.step("writing the updated deck", 0, None)
    # that of an earlier run must not be taken for the one of this run
    for _, name in made_by("update", run.study.file, Role.RESULT):
        if Path(name).name == DECK_FILE:
            run.place.drop(run.study, name)
    deck = write_back(run.study, outcomes.of(Updated).parameters.result, run.folder, run.wide)
    for built in deck.built.values():
        check_written(built, run.study)
    return Written(deck, on_decks(outcomes.of(Updated).study(run.study), deck.built))


def verify(run: Run, outcomes: Outcomes, made: Made) -> Written:
    """The written deck gets its name if it has the frequencies of the update."""
    written, final, deck = outcomes.of(Written), outcomes.of(Final), outcomes.of(AsWritten)
    pairs = zip(final.records.modes, deck.records.modes, strict=True)
    differences = [
        d for after, there in pairs for d in frequency_differences(there.configuration, after.freq_hz, there.freq_hz)
    ]
    return replace(
        written, deck=replace(written.deck, record=named_if_same(written.deck.record, differences, run.folder))
    )
