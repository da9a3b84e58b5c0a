"""What a command was run on, as its tables on the terminal name it."""

from __future__ import annotations

from pathlib import Path

from femtune.files.study_file import is_deck, read_study_file
from femtune.steps.report_source import Subject
from femtune.study.model_source import FromDeck, model_source


def subject_of(path: Path | str) -> Subject:
    """Of the study or the deck at `path`.

    Raises
    ------
    FemtuneError : ``study.*``, what is wrong with the study file
    """
    path = Path(path)
    if is_deck(path):
        return Subject(path.name, str(path), "", "", FromDeck.title, FromDeck.has_elements)
    file = read_study_file(path)
    length, mass, _ = file.study.units.split("-")
    source = model_source(file)
    return Subject(file.study.title, source.name, length, mass, source.title, source.has_elements)
