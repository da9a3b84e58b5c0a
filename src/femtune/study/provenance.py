"""Origin of results: files with their checksums, versions, times."""

from __future__ import annotations

import hashlib
import os
import platform
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy

from femtune import __version__
from femtune.files.study_file import StudyFile
from femtune.journal.owner import IN_MEMORY
from femtune.model import available_solvers
from femtune.model.distributed import slepc_is_chosen
from femtune.study.inputs import inputs_of_study
from femtune.study.record import InputFile, Provenance, ReportFacts, StepDuration, StudyFacts

if TYPE_CHECKING:
    from femtune.files.study_file.report import ReportTable
    from femtune.study.study import Study


@dataclass(frozen=True)
class Inputs:
    """The files that a run was made of."""

    study_file: InputFile
    files: tuple[InputFile, ...]


@dataclass
class Stopwatch:
    """Times the steps of a run."""

    command: str
    started: datetime = field(default_factory=lambda: datetime.now(UTC))
    durations: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time one step; times of the same step add up."""
        begin = time.perf_counter()
        try:
            yield
        finally:
            self.durations[name] = self.durations.get(name, 0.0) + time.perf_counter() - begin


def provenance(inputs: Inputs, watch: Stopwatch, eigen_solvers: Iterable[str] = ()) -> Provenance:
    """Files, versions and times of a run, and the eigen-solvers that ran, "" for modes that none computed."""
    return Provenance(
        femtune_version=__version__,
        started_at=watch.started.isoformat(timespec="seconds"),
        command=watch.command,
        study_file=inputs.study_file,
        input_files=inputs.files,
        python_version=platform.python_version(),
        numpy_version=np.__version__,
        scipy_version=scipy.__version__,
        eigen_solver=_eigen_solver(eigen_solvers),
        durations=tuple(StepDuration(step=name, duration_s=round(t, 3)) for name, t in watch.durations.items()),
    )


def _eigen_solver(names: Iterable[str]) -> str:
    """The eigen-solver that was used, or will be used."""
    ran = list(dict.fromkeys(name for name in names if name))
    if ran:
        return "; ".join(ran)
    factors = f"sparse factorisation by {' or '.join(available_solvers())}"
    slepc = f"SLEPc over MPI with MUMPS (small models: shift-invert); {factors}"
    return slepc if slepc_is_chosen() else f"shift-invert; {factors}"


def inputs_of(study: Study) -> Inputs:
    """The files of a study with their current checksums: call it before a long run, not after."""
    base = study.file.path.parent
    text = study.file.given.text
    if text is None:
        study_input = _input(study.file.path, base)
    else:
        study_input = InputFile(path=IN_MEMORY, sha256=hashlib.sha256(text.encode()).hexdigest())
    read = (one.path for one in inputs_of_study(study) if one.what != "study file")
    return Inputs(study_input, tuple(_input(path, base) for path in read))


def call(word: str, source: Path | str | StudyFile) -> str:
    """The Python call that made a result: ``femtune.update('study.toml')``."""
    shown = f"Study({source.study.title!r})" if isinstance(source, StudyFile) else repr(str(source))
    return f"femtune.{word}({shown})"


def _input(path: Path, base: Path) -> InputFile:
    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        # a model or test that was read some time ago and given as an object does not need its file any more
        digest = ""
    return InputFile(path=relative(path, base), sha256=digest)


def relative(path: Path, base: Path) -> str:
    """`path` as seen from `base`."""
    try:
        return os.path.relpath(path, base)
    except ValueError:  # another drive
        return str(path)


def study_facts(study: Study) -> StudyFacts:
    """Title, units and files of the study."""
    table = study.file.study
    return StudyFacts(
        title=table.title,
        units=table.units,
        deck_file=study.source.name,
        configurations=tuple(c.name for c in study.cases),
        imported=not study.source.writes_back,
        choices_file=""
        if table.choices is None
        else relative(study.file.path_of(table.choices), study.file.path.parent),
        report=report_facts(study.file.report),
    )


def report_facts(table: ReportTable) -> ReportFacts:
    """What [report] of a study or an identification file states."""
    return ReportFacts(**{key: text for key, text in table.model_dump().items() if text is not None})
