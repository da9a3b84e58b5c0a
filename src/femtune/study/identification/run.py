"""The step as a whole: read, identify, write."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from femtune.errors import FemtuneError, Where
from femtune.files.identify_file import IdentifyFile
from femtune.identify.record_checks import check_record
from femtune.study.identification.asked import asked_of
from femtune.study.identification.found import Found
from femtune.study.identification.from_forces import found_from_forces, has_forces
from femtune.study.identification.from_frfs import found_from_file
from femtune.study.identification.from_record import found_from_record, read_asked
from femtune.study.identification.records import Identification, identification
from femtune.study.identification.usable import check_methods, check_usable
from femtune.study.identification.write import write_found
from femtune.study.progress import Progress, silent
from femtune.study.results_base import InputFile
from femtune.study.run_folder import check_writable


@dataclass(frozen=True, eq=False)
class IdentifiedFolder:
    """A folder with the files of an identification, and what is in them."""

    folder: Path
    record: Identification
    found: Found = field(repr=False)
    files: tuple[str, ...]


def identify(
    path: Path | str,
    output: Path | str | None = None,
    progress: Progress = silent,
    *,
    options: Mapping[str, Any] | None = None,
) -> IdentifiedFolder:
    """Modes of a record in time or of measured functions, in a folder of files.

    Parameters
    ----------
    path : an identification file (TOML), a record (CSV, UFF 58, .npy, .npz, .mat, HDF5, WAV), or functions (UFF 58)
    output : folder instead of that of the file; ``identified`` beside it where nothing is said
    options : keys of [identify] that take the place of the file's, or stand for them: ``{"band_hz": (2.0, 40.0)}``

    Raises
    ------
    FemtuneError : ``record.*``, ``uff.*``, ``identify.*``, ``study.*`` of the file, ``run.unwritable``
    """
    file = asked_of(path, options or {})
    folder = Path(output) if output is not None else file.output_folder
    _check_folder(folder, file)
    progress.step("reading the measurement", 0, None)
    with _at_the_file(file):
        found = _found(file, progress)
    source = InputFile(path=file.measured_path.name, sha256=_digest(file.measured_path))
    record = identification(found, file.identify.title or file.measured_path.name, source, file.identify.units)
    names = write_found(folder, found, record)
    return IdentifiedFolder(folder, record, found, tuple(names))


def _found(file: IdentifyFile, progress: Progress) -> Found:
    if file.identify.frfs is not None:
        progress.step("poles of every order", 0, None)
        return found_from_file(file)
    record = read_asked(file)
    check_usable(record)
    notices = check_record(record)
    check_methods(file, has_forces(record))
    found = found_from_forces(record, file) if has_forces(record) else found_from_record(record, file, progress)
    return replace(found, notices=(*notices, *found.notices))


@contextmanager
def _at_the_file(file: IdentifyFile) -> Iterator[None]:
    """Methods know arrays, no files: what they refuse is said of the measured file."""
    try:
        yield
    except FemtuneError as error:
        if not str(error.where or ""):
            error.where = Where(str(file.measured_path))
        raise


def _check_folder(folder: Path, file: IdentifyFile) -> None:
    check_writable(folder)
    inputs = {os.path.realpath(p) for p in (file.path, file.measured_path)}
    if any(os.path.realpath(p) in inputs for p in folder.iterdir()):
        raise FemtuneError(
            "write.overwrites-input",
            "the folder of the results is that of the measurement",
            where=Where(str(folder)),
            hint="choose another folder: results have names of their own, but so may the measurement",
        )


def _digest(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
