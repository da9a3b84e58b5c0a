"""Where results come from: files with their check sums, versions, times."""

from __future__ import annotations

import hashlib
import os
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import scipy

from femtune import __version__
from femtune.model import available_solvers
from femtune.study.load import Study
from femtune.study.results_base import InputFile, Provenance, StepDuration, StudyFacts


@dataclass
class Stopwatch:
    """Times the steps of a run."""

    command: str
    started: datetime = field(default_factory=lambda: datetime.now(UTC))
    durations: list[StepDuration] = field(default_factory=list)

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time one step."""
        begin = time.perf_counter()
        yield
        self.durations.append(StepDuration(step=name, duration_s=round(time.perf_counter() - begin, 3)))


def provenance(study: Study, watch: Stopwatch) -> Provenance:
    """Files, versions and times of a run."""
    file = study.file
    base = file.path.parent
    paths = [Path(f.file) for f in study.built.deck.files]
    paths += [file.path_of(c.entry.test) for c in study.cases if c.entry.test is not None]
    return Provenance(
        femtune_version=__version__,
        started_at=watch.started.isoformat(timespec="seconds"),
        command=watch.command,
        study_file=_input(file.path, base),
        input_files=tuple(_input(p, base) for p in dict.fromkeys(paths)),
        python_version=platform.python_version(),
        numpy_version=np.__version__,
        scipy_version=scipy.__version__,
        eigen_solver=f"shift-invert; sparse factorisation by {' or '.join(available_solvers())}",
        durations=tuple(watch.durations),
    )


def _input(path: Path, base: Path) -> InputFile:
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return InputFile(path=os.path.relpath(path, base), sha256=digest)


def study_facts(study: Study) -> StudyFacts:
    """What the study says about itself."""
    table = study.file.study
    return StudyFacts(
        title=table.title,
        units=table.units,
        deck_file=table.deck,
        configurations=tuple(c.configured.configuration.name for c in study.cases),
    )
