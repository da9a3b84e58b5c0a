"""The input files of a study: those that its keys name, and those that these files name in turn.

Checksums in the results, and the rule that no command writes, moves or deletes an input, are made from this list.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.errors import FemtuneError, Where
from femtune.files.identification_file import IdentifyFile, is_identification_file
from femtune.files.nastran.source import read_source
from femtune.files.study_file import StudyFile, is_deck
from femtune.files.study_file.named_files import files_named
from femtune.files.study_file.reading import is_file, toml_data, toml_text

if TYPE_CHECKING:
    from femtune.study.study import Study


@dataclass(frozen=True)
class Input:
    """A file that a study reads: what names it, and what it is."""

    path: Path
    where: Where
    what: str


def named_inputs(file: StudyFile | IdentifyFile) -> tuple[Input, ...]:
    """The file itself, and those that its keys name."""
    kind = "study file" if isinstance(file, StudyFile) else "identification file"
    inputs = [Input(file.path, Where(str(file.path)), kind)] if is_file(file.path) else []
    given = file.given.names if isinstance(file, StudyFile) else set()
    for key in files_named(type(file), file):
        path = file.path.parent / key.name
        # an object that was given may be of no file, and a word of a command may name none
        if is_file(path) or (key.kind.needed and key.name not in given):
            inputs.append(Input(path, file.where(*key.place), key.kind.what))
    return tuple(inputs)


def inputs_of_study(study: Study) -> tuple[Input, ...]:
    """All input files of a study, each once: with INCLUDEs, files beside matrices, and those of described tests."""
    named = named_inputs(study.file)
    deck = study.file.where("study", "deck")
    inputs = {os.path.abspath(name): Input(Path(name), deck, "deck") for name in study.built.files}
    for one in named:
        inputs.setdefault(os.path.abspath(one.path), one)
    for one in named:
        for further in _named_by(one, inputs):
            inputs.setdefault(os.path.abspath(further.path), further)
    return tuple(inputs.values())


def _named_by(one: Input, known: Iterable[str]) -> Iterator[Input]:
    """Files that an input names in turn; what is wrong with them is told where they are read."""
    try:
        if one.what == "test file" and is_identification_file(one.path):
            for key in files_named(IdentifyFile, toml_data(toml_text(one.path), one.path)):
                yield Input(one.path.parent / key.name, Where(str(one.path)), key.kind.what)
        elif one.what in ("deck", "file of grid points") and is_deck(one.path):
            files = read_source(one.path).files
            yield from (Input(Path(f.file), one.where, one.what) for f in files if f.file not in known)
    except FemtuneError:
        return


def check_outputs(inputs: Iterable[Input], outputs: Iterable[Path], folders: Iterable[Path] = ()) -> None:
    """Refuse to write to, or to empty, what is read: also through a link, or another spelling of the path.

    Parameters
    ----------
    outputs : files that would be written or removed
    folders : of which all belongs to the run

    Raises
    ------
    FemtuneError : ``write.overwrites-input``
    """
    inputs = tuple(inputs)
    taken = {identity: one for one in inputs for identity in _identities(one.path)}
    for output in outputs:
        for identity in _identities(output):
            if identity in taken:
                raise _overwrites(taken[identity], output)
    inside = {os.path.realpath(folder) for folder in folders}
    for one in inputs:
        for parent in Path(os.path.realpath(one.path)).parents:
            if str(parent) in inside:
                raise _overwrites(one, one.path)


def _identities(path: Path) -> Iterator[object]:
    """What two names of one file have in common: the path without links, and the file itself where it exists."""
    yield os.path.realpath(path)
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return
    if status.st_ino:
        yield status.st_dev, status.st_ino


def _overwrites(one: Input, output: Path) -> FemtuneError:
    values = {"input": one.path, "would be written": output}
    return FemtuneError("write.overwrites-input/input", where=one.where, values=values, input_kind=one.what)
