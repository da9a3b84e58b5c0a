"""The files of a run folder: each is declared here once, with the steps that make it, its role, and who wants it.

The protection of inputs, the names that changed INCLUDE files must not take, the list of files after a run, and what
``--fresh`` removes are made from `RUN_FILES`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from femtune.files.study_file import StudyFile

REPORT_FILE = "report.html"
DIGEST_FILE = "report.html.sha256"
"""The SHA-256 of the report, which cannot contain it itself."""
RESULTS_FILE = "results.json"
ARRAYS_FILE = "arrays.npz"
HISTORY_FILE = "history.jsonl"
DECK_FILE = "updated.bdf"
UNVERIFIED_FILE = "unverified.bdf"
"""The updated deck until it has been compared with the update; it stays if it differs."""
CATALOGUE_FILE = "damping.toml"
"""Identified damping values, for the catalogue that later studies use."""
FRFS_FILE = "frfs.uff"
"""The functions of the model at its last stage."""
EXPANDED_FILE = "expanded.uff"
"""The test shapes expanded to the model at its last stage."""
VTU_FILE = "shapes.vtu"
"""The modes and parameters after the update."""
STARTS_FILE = "starts.jsonl"
BOOTSTRAP_FILE = "bootstrap.jsonl"
POSTERIOR_FILE = "posterior.jsonl"
PREDICTIONS_FILE = "predictions.jsonl"
SAMPLES_FILE = "samples.jsonl"
CANDIDATES_FILE = "candidates.jsonl"
JOURNAL_FOLDER = "journal"
RUNS_FOLDER = "external"
"""Folders of the runs of an external solver."""
LOCK_FILE = "running.lock"
OWNER_FILE = "owner.json"

UPDATES = ("update", "validate", "bootstrap", "posterior", "run")
"""Steps that update the model, and write all that follows from that."""

RUNNING_SOLVER = (
    "check", "info", "modes", "respond", "plan", "correlate", "compare", "select", "quantify", "screen", "search",
)  # fmt: skip
"""Steps that write nothing into the run folder but the runs of an external solver."""
HOLDING = (*UPDATES, "candidates", *RUNNING_SOLVER)
"""Steps that hold the run folder: the last ones for a model of an external solver, while it may be run."""


class Role(StrEnum):
    """What a file of a run is for."""

    RESULT = "result"
    """Made for the user."""
    RESUME = "resume"
    """What an interrupted run goes on from; ``--fresh`` empties it."""
    LOCK = "lock"
    """Says whose the folder is, and whether a run is at work."""


def _always(file: StudyFile) -> bool:
    return True


@dataclass(frozen=True)
class RunFile:
    """A file or folder of a run folder.

    Parameters
    ----------
    name : in the folder
    steps : that make it
    role : what it is for
    wanted : whether the runs of a study may make it
    each : with several configurations, each has its own, with its number in the name
    of_specimen : each specimen has its own, in a folder of its name
    folder : it is a folder, of which all belongs to the run
    """

    name: str
    steps: tuple[str, ...]
    role: Role = Role.RESULT
    wanted: Callable[[StudyFile], bool] = _always
    each: bool = False
    of_specimen: bool = False
    folder: bool = False

    def names(self, file: StudyFile) -> tuple[str, ...]:
        """Paths relative to the run folder, of the files that a study has of it."""
        if self.each:
            return tuple(str(path) for path in numbered(Path(self.name), len(file.configurations)))
        return tuple(f"{s}/{self.name}" for s in file.specimens if self.of_specimen) or (self.name,)


def numbered(path: Path, count: int) -> list[Path]:
    """A file for each configuration: the path itself, or with several its name and a number."""
    if count == 1:
        return [path]
    return [path.with_name(f"{path.stem}_{i + 1}{path.suffix}") for i in range(count)]


def _with_damping(file: StudyFile) -> bool:
    return any(entry.moves_damping for entry in file.parameter)


def _of_deck(file: StudyFile) -> bool:
    """The updated deck is that of a study whose model is a deck, if it is wanted."""
    return file.write.deck and not file.matrix and file.runs is None and file.solver is None


RUN_FILES = (
    RunFile(REPORT_FILE, ("run", "report")),
    RunFile(DIGEST_FILE, ("run", "report")),
    RunFile(FRFS_FILE, UPDATES, wanted=lambda file: file.response is not None, each=True),
    RunFile(EXPANDED_FILE, UPDATES, wanted=lambda file: file.correlate.expand != "none", each=True),
    RunFile(VTU_FILE, UPDATES, wanted=lambda file: file.output.vtu, each=True),
    RunFile(CATALOGUE_FILE, UPDATES, wanted=_with_damping),
    RunFile(RESULTS_FILE, UPDATES),
    RunFile(ARRAYS_FILE, UPDATES),
    RunFile(HISTORY_FILE, UPDATES),
    RunFile(DECK_FILE, UPDATES, wanted=_of_deck, of_specimen=True),
    RunFile(UNVERIFIED_FILE, UPDATES, wanted=_of_deck, of_specimen=True),
    RunFile(STARTS_FILE, UPDATES, Role.RESUME),
    RunFile(BOOTSTRAP_FILE, UPDATES, Role.RESUME),
    RunFile(POSTERIOR_FILE, UPDATES, Role.RESUME),
    RunFile(PREDICTIONS_FILE, UPDATES, Role.RESUME),
    RunFile(SAMPLES_FILE, UPDATES, Role.RESUME),
    RunFile(CANDIDATES_FILE, ("candidates",), Role.RESUME),
    RunFile(JOURNAL_FOLDER, HOLDING, Role.RESUME, folder=True),
    RunFile(RUNS_FOLDER, HOLDING, Role.RESUME, lambda file: file.solver is not None, folder=True),
    RunFile(LOCK_FILE, HOLDING, Role.LOCK),
    RunFile(OWNER_FILE, HOLDING, Role.LOCK),
)


def made_by(step: str, file: StudyFile, *roles: Role) -> Iterator[tuple[RunFile, str]]:
    """The files that a step may make for a study, with their names in the run folder; of some roles, or of all."""
    for one in RUN_FILES:
        if step in one.steps and one.wanted(file) and (not roles or one.role in roles):
            yield from ((one, name) for name in one.names(file))


def forget(folder: Path, step: str) -> None:
    """Remove what an interrupted run of a step would go on from, but for the journals, which empty themselves.

    Raises
    ------
    OSError : a file cannot be removed
    """
    for one in RUN_FILES:
        if step in one.steps and one.role is Role.RESUME and not one.folder:
            (folder / one.name).unlink(missing_ok=True)
