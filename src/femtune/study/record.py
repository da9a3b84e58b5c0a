"""Common base of all records of the results: frozen, no unknown keys, no NaN, documented fields."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from femtune.errors import Notice

Level = Literal["info", "warning", "problem"]
EndOfUpdate = Literal["before", "after"]
"""Start or end of the update."""
ModelVersion = Literal[EndOfUpdate, "after as written"]
"""The model before the update, after it, and as read again from the updated deck; records keep it as `stage`."""
LimitSense = Literal["at most", "at least"]
"""Which side of a limit passes."""
VerdictWord = Literal["pass", "fail", "not tested"]
Vector3 = tuple[float, float, float]


class Record(BaseModel):
    """Base of all records: frozen; a key that the schema does not know, NaN and infinity are errors."""

    # validators are built when the first record of a type is made, since no command makes records of all types
    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, protected_namespaces=(), defer_build=True
    )

    def __repr_args__(self) -> Iterator[tuple[str | None, object]]:
        """Numbers and texts in full, and only the length of longer lists: a whole run would fill hundreds of pages."""
        for name, value in super().__repr_args__():
            yield name, _short(value)


class _Said(str):
    """A text that shows itself without quotes."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


_MOST_ENTRIES_SHOWN = 4
"""Entries of a list that the representation of a record shows; longer ones are counted."""
_LONGEST_TEXT = 80
"""Characters of a text there, one line of a terminal; longer ones are cut."""


def _short(value: object) -> object:
    if isinstance(value, Record):
        return _Said(f"{type(value).__name__}(…)")
    if isinstance(value, tuple | dict) and (
        len(value) > _MOST_ENTRIES_SHOWN or any(isinstance(v, Record | tuple) for v in value)
    ):
        return _Said(f"({len(value)} entries)")
    if isinstance(value, str) and len(value) > _LONGEST_TEXT:
        return value[: _LONGEST_TEXT - 1] + "…"
    return value


class Alert(Record):
    """A remark for the reader of the results."""

    level: Level
    """"info", "warning" or "problem"."""
    code: str
    """Stable code ``area.problem``; docs/errors has a page for each."""
    sentence: str
    """The sentence."""
    where: str = ""
    """File, line and record, "" if there is none."""


def alert(level: Level, code: str, **facts: Any) -> Alert:
    """An alert in the wording of the registry."""
    said = Notice(code, **facts)
    return Alert(level=level, code=said.code, sentence=said.what)


class CitationRecord(Record):
    """A publication on a method that was used."""

    key: str
    """Key of the BibTeX entry."""
    text: str
    """Authors, year, title, source."""
    bibtex: str
    """The whole BibTeX entry."""


class InputFile(Record):
    """A file that was read, with its checksum at that time."""

    path: str
    """Path as the study names it, relative to the study file."""
    sha256: str
    """SHA-256 of its bytes, in hexadecimal digits; "" if the file, read earlier, no longer exists."""


class StepDuration(Record):
    """How long a step took."""

    step: str
    """Name of the step: "read", "modes", "correlate", "select", "update", "write"."""
    duration_s: float
    """Wall-clock time in s."""


class Provenance(Record):
    """Origin of these results: versions, files, command and times."""

    femtune_version: str
    """Version of femtune that wrote the results."""
    started_at: str
    """Begin of the run, ISO 8601 with time zone."""
    command: str
    """Command line, or the Python call, that made the run."""
    study_file: InputFile
    """The study file (TOML)."""
    input_files: tuple[InputFile, ...]
    """Decks with their INCLUDEs, and test files."""
    python_version: str
    """Version of Python."""
    numpy_version: str
    """Version of numpy."""
    scipy_version: str
    """Version of scipy."""
    eigen_solver: str
    """Eigen-solver and sparse solver that solved the modes; several for models of different size."""
    durations: tuple[StepDuration, ...] = ()
    """Time of each step."""


class ReportFacts(Record):
    """What the author of a report states on its first page; "" for what is not stated."""

    document: str = ""
    """Number of the document."""
    revision: str = ""
    """Revision of the document."""
    author: str = ""
    """Who prepared the report."""
    checked_by: str = ""
    """Who checks it."""
    approved_by: str = ""
    """Who approves it."""
    standard: str = ""
    """Standard with its edition and section."""
    boundary: str = ""
    """How the structure was held in the test."""
    excitation: str = ""
    """How the structure was excited in the test."""


class StudyFacts(Record):
    """What the study file says about itself."""

    title: str
    """Title of the study."""
    units: str
    """Coherent system of units, length-mass-time: "m-kg-s"; all values without a stated unit are in it."""
    deck_file: str
    """The deck as the study names it; for a model of matrices the first file."""
    configurations: tuple[str, ...]
    """Names of the configurations, in the order of the study."""
    imported: bool = False
    """True for a model from matrices of another solver, without a deck."""
    description: str = ""
    """Free text of the study."""
    choices_file: str = ""
    """File of choices that were made on the page of a report, relative to the study; "" without one."""
    report: ReportFacts = ReportFacts()
    """Document number, persons, and what is stated about criteria and test."""

    @property
    def has_deck(self) -> bool:
        """True for the model of a deck, which is changed and written back."""
        return not self.imported


class SolutionCount(Record):
    """Solutions of one kind."""

    kind: str
    """"modes" or "derivative"."""
    solved: int
    """Number of solutions in this run."""
    recalled: int
    """Number of solutions from the journal of an earlier run."""


class JournalResults(Record):
    """Solutions of the full model, by origin."""

    solved: int
    """Number of solutions in this run."""
    recalled: int
    """Number of solutions from the journal of an earlier run."""
    kinds: tuple[SolutionCount, ...]
    """The same by kind."""
