"""The run folder of a study while a run is at work: held, of this study alone, and no danger to its inputs."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.files.study_file.reading import is_deck, is_file, read_study_file
from femtune.files.study_file.study import StudyFile
from femtune.files.whole_file import is_digest
from femtune.journal.finished import is_of_runs
from femtune.journal.owner import Owner, check_foreign, check_owner, digests, sign
from femtune.journal.run_files import (
    DIGEST_FILE,
    JOURNAL_FOLDER,
    OWNER_FILE,
    REPORT_FILE,
    VTU_FILE,
    Role,
    forget,
    made_by,
)
from femtune.steps.modes.vtu_files import check_cells
from femtune.steps.run_folder import check_writable, unwritable
from femtune.steps.run_lock import locked
from femtune.study.inputs import check_outputs, inputs_of_study, named_inputs
from femtune.study.study import check_solvers

if TYPE_CHECKING:
    from femtune.study.inputs import Input
    from femtune.study.study import Study


@dataclass(frozen=True)
class RunFolder:
    """A run folder that is held.

    Parameters
    ----------
    path : the folder
    file : the study
    step : that is at work
    owner : what its runs have made there
    before : files with names of a run, and contents of folders with such names, that were there when it was taken
    """

    path: Path
    file: StudyFile
    step: str
    owner: Owner
    before: frozenset[str] = frozenset()

    def check(self, study: Study) -> None:
        """Refuse to overwrite what the files of the study name in turn, such as INCLUDEs, before hours of work.

        Raises
        ------
        FemtuneError : ``write.overwrites-input``; as `check_cells` where a VTU file is asked for
        """
        if self.file.output.vtu and self.step != "candidates":
            check_cells(study, self.path / VTU_FILE)
        _check_inputs(inputs_of_study(study), self.file, self.path, self.step)

    def give_back(self) -> None:
        """Leave neither name nor empty journal in a folder where nothing was made."""
        with contextlib.suppress(OSError):
            if _there(self.path, self.file, self.step) <= self.before:
                (self.path / OWNER_FILE).unlink(missing_ok=True)
                (self.path / JOURNAL_FOLDER).rmdir()

    def end_failed(self) -> None:
        """Leave in the record only files that are there, after a run that did not come to its end."""
        there = {n: d for n, d in (self.owner.files or {}).items() if os.path.lexists(self.path / n)}
        with contextlib.suppress(OSError):
            sign(self.path, *identity(self.file), there)

    def forget(self) -> None:
        """Remove what an interrupted run would go on from (error ``run.unwritable``)."""
        try:
            forget(self.path, self.step)
        except OSError as error:
            raise unwritable(self.path, error) from error

    def drop(self, study: Study, name: str) -> None:
        """Remove a result of an earlier run that this one has not, if it is as that run left it, and no input.

        Raises
        ------
        FemtuneError : ``run.unwritable``
        """
        path = self.path / name
        read = {os.path.realpath(one.path) for one in inputs_of_study(study)}
        if self.owner.has_unchanged(self.path, name) and os.path.realpath(path) not in read:
            try:
                path.unlink()
            except OSError as error:
                raise unwritable(self.path, error) from error

    def keep(self, names: Iterable[str]) -> None:
        """Write down the files that the run has made (error ``run.unwritable``)."""
        known = self.owner.files or {}
        begun = {name for name, known_digest in known.items() if not known_digest} - {REPORT_FILE, DIGEST_FILE}
        earlier = {n: d for n, d in known.items() if n not in begun and os.path.lexists(self.path / n)}
        try:
            sign(self.path, *identity(self.file), {**earlier, **digests(self.path, names)})
        except OSError as error:
            raise unwritable(self.path, error) from error


@contextmanager
def held(file: StudyFile, folder: Path, step: str) -> Iterator[RunFolder]:
    """Hold the run folder for a step of a study; made if it is not there, and removed again if nothing came into it.

    Raises
    ------
    FemtuneError : ``write.overwrites-input``, ``run.other-study``, ``run.other-file``, ``run.locked``,
        ``run.unwritable``
    """
    where, title_and_path = file.where("output", "folder"), identity(file)
    _check_inputs(named_inputs(file), file, folder, step)
    check_owner(folder, *title_and_path, where)
    is_new = not os.path.lexists(folder)
    check_writable(folder)
    try:
        with locked(folder):
            owner = check_owner(folder, *title_and_path, where)
            planned = [name for _, name in made_by(step, file, Role.RESULT)]
            if REPORT_FILE in planned:
                # imported here, because it brings the renderer
                from femtune.reporting.html import check_page  # noqa: PLC0415

                # a page of an earlier report may be replaced
                check_page(folder / REPORT_FILE)
            replaced = {REPORT_FILE, *({DIGEST_FILE} if is_digest(folder / DIGEST_FILE) else ())}
            check_foreign(folder, owner, [name for name in planned if name not in replaced])
            if owner is None:
                check_foreign(folder, None, _not_of_a_run(folder, file, step))
            before = _there(folder, file, step)
            place = RunFolder(folder, file, step, _signed(folder, title_and_path, owner, planned), before)
            try:
                yield place
            except BaseException:
                if owner is not None:
                    place.end_failed()
                raise
            finally:
                if owner is None:
                    place.give_back()
    finally:
        if is_new:
            with contextlib.suppress(OSError):
                folder.rmdir()


@contextmanager
def held_for_solver(source: Path | str | StudyFile, step: str) -> Iterator[None]:
    """Hold the run folder for a step that writes nothing there but the runs of an external solver, if there is one.

    To be entered before the model is read, since this runs the solver.

    Parameters
    ----------
    source : a study, or the path of a study or of a deck
    step : one of `femtune.journal.run_files.RUNNING_SOLVER`

    Raises
    ------
    FemtuneError : as `held`, as `read_study_file`, and as `check_solvers`
    """
    if not isinstance(source, StudyFile):
        check_solvers()
        if is_deck(source):
            yield
            return
        source = read_study_file(source)
    with contextlib.nullcontext() if source.solver is None else held(source, source.output_folder, step):
        yield


def _there(folder: Path, file: StudyFile, step: str) -> frozenset[str]:
    """What is there of the files that a step makes, and inside of its folders."""
    names = [name for _, name in made_by(step, file, Role.RESULT, Role.RESUME)]
    inside = (f"{n}/{one}" for n in names if (folder / n).is_dir() for one in os.listdir(folder / n))
    return frozenset(n for n in names if os.path.lexists(folder / n) and not (folder / n).is_dir()) | frozenset(inside)


def _not_of_a_run(folder: Path, file: StudyFile, step: str) -> Iterator[str]:
    """Files with the name of one from which an interrupted run goes on, but of other contents."""
    for one, name in made_by(step, file, Role.RESUME):
        if not one.folder and os.path.lexists(folder / name) and not is_of_runs(folder / name):
            yield name


def _signed(folder: Path, of: tuple[str, Path | None], owner: Owner | None, planned: Iterable[str]) -> Owner:
    """The owner, who has begun to make what is planned; in a folder of an earlier femtune it has made what is there."""
    known = {} if owner is None else owner.files
    if known is None:
        known = digests(folder, planned)
    try:
        return sign(folder, *of, {**dict.fromkeys(planned, ""), **known})
    except OSError as error:
        raise unwritable(folder, error) from error


def identity(file: StudyFile) -> tuple[str, Path | None]:
    """Title and file of a study; None for one of Python objects."""
    return file.study.title, file.path if is_file(file.path) else None


def _check_inputs(inputs: Iterable[Input], file: StudyFile, folder: Path, step: str) -> None:
    """Refuse a run that would overwrite or remove an input."""
    made = list(made_by(step, file))
    check_outputs(
        inputs,
        (folder / name for one, name in made if not one.folder),
        (folder / name for one, name in made if one.folder),
    )
