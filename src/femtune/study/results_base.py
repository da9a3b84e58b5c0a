"""What every record of the results shares: frozen, no unknown keys, no NaN, documented fields."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

Level = Literal["info", "warning", "problem"]
Stage = Literal["before", "after", "after as written"]
VerdictWord = Literal["pass", "fail", "not tested"]
Vector3 = tuple[float, float, float]


class Record(BaseModel):
    """Base of all records: frozen; a key that the schema does not know, NaN and infinity are errors."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True, protected_namespaces=()
    )


class Alert(Record):
    """Something that the reader should know."""

    level: Level
    """"info", "warning" or "problem"."""
    code: str
    """Stable code ``area.problem``; docs/errors has a page for each."""
    sentence: str
    """What was found, in words."""
    where: str = ""
    """File, line and record, "" where there is none."""


class Citation(Record):
    """A publication behind a method that ran."""

    key: str
    """Key of the BibTeX entry."""
    text: str
    """Authors, year, title, source."""
    bibtex: str
    """The whole BibTeX entry."""


class InputFile(Record):
    """A file that was read, and what it was at that time."""

    path: str
    """Path as the study names it, relative to the study file."""
    sha256: str
    """SHA-256 of its bytes, in hexadecimal digits."""


class StepDuration(Record):
    """How long a step took."""

    step: str
    """Name of the step: "read", "modes", "correlate", "select", "update", "write"."""
    duration_s: float
    """Wall-clock time in s."""


class Provenance(Record):
    """Where these results come from."""

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
    """Eigen-solver and sparse solver that solved the modes; several where models of different size are in the run."""
    durations: tuple[StepDuration, ...] = ()
    """Time of each step."""


class StudyFacts(Record):
    """What the study file says about itself."""

    title: str
    """Title of the study."""
    units: str
    """Coherent system of units, length-mass-time: "m-kg-s"; all values without a unit are in it."""
    deck_file: str
    """The deck as the study names it; the first file of matrices where the model is made of them."""
    configurations: tuple[str, ...]
    """Names of the configurations, in the order of the study."""
    imported: bool = False
    """True where the model is made of matrices of another solver, so that there is no deck."""
    description: str = ""
    """Free text of the study."""
