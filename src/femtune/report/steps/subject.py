"""What a step was run on: a study, or a deck alone."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from femtune.files.study_file import read_study_file
from femtune.report.document import Document, Level, Section
from femtune.study.load import is_deck


@dataclass(frozen=True)
class Subject:
    """Title, deck (or first file of matrices), and units of length and mass, "" for a deck alone, which tells none."""

    title: str
    deck: str
    length_unit: str = ""
    mass_unit: str = ""
    imported: bool = False

    def document(self, verdict: str, level: Level, sections: Iterable[Section]) -> Document:
        """A document that has nothing but sections for the terminal."""
        return Document(self.title, verdict, level, (), (), short=tuple(s for s in sections if s.blocks))


def subject_of(path: Path | str) -> Subject:
    """Of the study or the deck at `path`.

    Raises
    ------
    FemtuneError : ``study.*``, what is wrong with the study file
    """
    path = Path(path)
    if is_deck(path):
        return Subject(path.name, str(path))
    file = read_study_file(path)
    length, mass, _ = file.study.units.split("-")
    return Subject(file.study.title, file.source_name, length, mass, file.imported)
