"""Studies that take full-model solutions from the journal of their run folder."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.errors import FemtuneError, Notice, folded
from femtune.journal.journal import open_journal
from femtune.journal.run_files import JOURNAL_FOLDER
from femtune.study.record import JournalResults, SolutionCount
from femtune.study.study import solved_by

if TYPE_CHECKING:
    from femtune.journal.journal import Journal
    from femtune.study.study import Study


@dataclass(frozen=True)
class LookedUp:
    """A study that takes solutions from its journal, and the remarks on them."""

    study: Study
    remarks: list[Notice]


@contextmanager
def looking_up(study: Study, fresh: bool) -> Iterator[LookedUp]:
    """The study for a step that writes nothing: what an earlier run solved is taken from its journal.

    The remarks have the warnings of the reader from the beginning, and after the block what came from the journal and
    what was damaged. An error inside the block carries the warnings as notes.
    """
    folder, table = study.file.output_folder, study.file.study
    looked_up = LookedUp(study, warnings_of(study))
    journal = None
    if not fresh and table.journal and os.path.isdir(folder / JOURNAL_FOLDER):
        journal = open_journal(folder, table.journal_gib, writes=False)
        looked_up = LookedUp(_journaled(study, journal), looked_up.remarks)
    try:
        yield looked_up
    except FemtuneError as error:
        for remark in looked_up.remarks:
            error.add_note(str(remark))
        raise
    if journal is not None:
        looked_up.remarks.extend((*journal.reused, *journal.notices))


def _journaled(study: Study, journal: Journal) -> Study:
    """The study with a solver that looks up solutions in the journal."""
    from femtune.journal.solver import JournaledSolver  # noqa: PLC0415  most folders have no journal yet

    return solved_by(study, JournaledSolver(journal))


def warnings_of(study: Study) -> list[Notice]:
    """Warnings of the reader: the first of each kind, with the number of the others."""
    return folded(n for n in (*study.built.notices, *study.notices) if n.level != "info")


def keeping(study: Study, folder: Path, fresh: bool) -> tuple[Study, Journal | None]:
    """The study for a run into `folder`, which must be locked, and its journal; None if it keeps none. `fresh` empties
    the journal, even if the study does not keep one.
    """
    table = study.file.study
    if not table.journal and not fresh:
        return study, None
    journal = open_journal(folder, table.journal_gib, fresh=fresh)
    return (_journaled(study, journal), journal) if table.journal else (study, None)


def journal_results(journal: Journal | None) -> JournalResults | None:
    """Numbers of solutions that were solved and that the journal had."""
    if journal is None:
        return None
    kinds = sorted({*journal.solved, *journal.recalled}, reverse=True)
    return JournalResults(
        solved=journal.solved.total(),
        recalled=journal.recalled.total(),
        kinds=tuple(SolutionCount(kind=k, solved=journal.solved[k], recalled=journal.recalled[k]) for k in kinds),
    )
