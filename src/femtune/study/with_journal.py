"""Studies whose full-model solutions come from the journal of their run folder where it has them."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from femtune.study.journal import JOURNAL_FOLDER, Journal, open_journal
from femtune.study.journaled import JournaledSolver
from femtune.study.load import Study, solved_by
from femtune.study.results_journal import JournalResults, SolutionCount


@contextmanager
def looking_up(study: Study, fresh: bool, remarks: list[str] | None) -> Iterator[Study]:
    """The study for a step that writes nothing: what an earlier run solved is taken from its journal.

    Warnings of the reader are said in `remarks` at once; what came from the journal, and what was damaged, afterwards.
    """
    folder, table = study.file.output_folder, study.file.study
    if remarks is not None:
        remarks += warnings_of(study)
    if fresh or not table.journal or not os.path.isdir(folder / JOURNAL_FOLDER):
        yield study
        return
    journal = open_journal(folder, table.journal_gib, writes=False)
    yield solved_by(study, JournaledSolver(journal))
    if remarks is not None:
        remarks += [text for text in (journal.sentence, *map(str, journal.notices)) if text]


def warnings_of(study: Study) -> list[str]:
    """What the reader warns of, the first of each kind with the number of the others."""
    loud = [n for n in (*study.built.notices, *study.notices) if n.level != "info"]
    counts = Counter(n.code for n in loud)
    first = {n.code: n for n in reversed(loud)}
    more = {code: f"; and {count - 1} more of this kind" if count > 1 else "" for code, count in counts.items()}
    return [f"{first[code]}{more[code]}" for code in counts]


def keeping(study: Study, folder: Path, fresh: bool) -> tuple[Study, Journal | None]:
    """The study for a run into `folder`, which must be locked, and the journal that it keeps; None where it keeps none.

    `fresh` empties the journal, in a study without one too.
    """
    table = study.file.study
    if not table.journal and not fresh:
        return study, None
    journal = open_journal(folder, table.journal_gib, fresh=fresh)
    return (solved_by(study, JournaledSolver(journal)), journal) if table.journal else (study, None)


def journal_results(journal: Journal | None) -> JournalResults | None:
    """How much was solved and how much taken from the journal."""
    if journal is None:
        return None
    kinds = sorted({*journal.solved, *journal.recalled}, reverse=True)
    return JournalResults(
        solved=journal.solved.total(),
        recalled=journal.recalled.total(),
        kinds=tuple(SolutionCount(kind=k, solved=journal.solved[k], recalled=journal.recalled[k]) for k in kinds),
    )
