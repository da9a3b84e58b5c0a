"""The step respond: FRFs, complex modes and static displacements of a study, or of a deck."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.files.study_file import with_response
from femtune.files.uff import write_uff_frfs
from femtune.journal.run_files import numbered
from femtune.steps.held_folder import held_for_solver
from femtune.steps.respond.facts import response_results
from femtune.steps.respond.result import RespondResult, frf_set
from femtune.steps.results import Results
from femtune.study.inputs import check_outputs, inputs_of_study
from femtune.study.progress import silent
from femtune.study.provenance import Stopwatch, call, inputs_of, provenance, study_facts
from femtune.study.solutions import looking_up
from femtune.study.study import load_study
from femtune.testdata import NO_GEOMETRY, ModalTest, WireFrame
from femtune.units import unit_system

if TYPE_CHECKING:
    from femtune.fem import NodeTable
    from femtune.files.study_file import StudyFile
    from femtune.modal import FrfSet
    from femtune.steps.respond.record import ResponseResults
    from femtune.study.cases import StudyCase
    from femtune.study.progress import Progress
    from femtune.study.record import ModelVersion
    from femtune.study.study import Study

Arrays = dict[str, NDArray]


@dataclass(frozen=True)
class FrfNoise:
    """Random errors of simulated FRFs: standard deviations of real and imaginary part, as of FRF residuals.

    Parameters
    ----------
    scatter : part of the magnitude of each value
    floor : part of the largest magnitude of each function
    seed : of the random errors
    """

    scatter: float = 0.0
    floor: float = 0.0
    seed: int = 1

    def check(self, uff: Path | None) -> None:
        """Refuse what is no noise, and noise without a file to write it to (errors ``response.noise``)."""
        values = {"scatter": self.scatter, "floor": self.floor}
        if not all(0.0 <= value < np.inf for value in values.values()):
            raise FemtuneError("response.noise", values=values)
        if self.seed < 0:
            raise FemtuneError("response.noise/seed", values={"seed": self.seed})
        if uff is None and any(values.values()):
            raise FemtuneError("response.noise/no-file", values=values)

    def added(self, frfs: FrfSet, chance: np.random.Generator) -> FrfSet:
        """The functions with errors."""
        size = np.abs(frfs.values)
        sd = np.hypot(self.scatter * size, self.floor * size.max(axis=2, keepdims=True))
        real, imaginary = chance.standard_normal((2, *size.shape))
        return replace(frfs, values=frfs.values + sd * (real + 1j * imaginary))


NO_NOISE = FrfNoise()


def solve_responses(
    source: Path | str | StudyFile,
    options: Mapping[str, Any],
    progress: Progress = silent,
    *,
    fresh: bool = False,
    uff: Path | None = None,
    units: str | None = None,
    page: Path | None = None,
    noise: FrfNoise = NO_NOISE,
) -> RespondResult:
    """Responses at the initial values of the parameters.

    Parameters
    ----------
    options : keys of [response] that take the place of the study's
    uff : Universal File for the FRFs; with several configurations each has its own, with its number in the name
    units : of a deck alone, which does not state them
    page : where the report will be written; not a file that was read
    noise : of the FRFs in the file; what is returned has none

    Raises
    ------
    FemtuneError : ``response.nothing-asked``, ``response.noise``, ``response.units-needed``,
        ``write.overwrites-input``, ``uff.cannot-write``, and as `response_results`
    """
    noise.check(uff)
    watch = Stopwatch(call("respond", source))
    arrays: Arrays = {}
    with watch.step("read"):
        loaded = _read(source, options, units, progress)
        files = [] if uff is None else numbered(uff, len(loaded.cases))
        _check_files(loaded, [*([] if page is None else [page]), *files], uff)
        inputs = inputs_of(loaded)
    with watch.step("respond"), looking_up(loaded, fresh) as looked_up:
        start = np.zeros(len(loaded.parameters.free))
        responses = responses_at(looked_up.study, "before", start, arrays, progress)
    written = [] if uff is None else write_frf_files(loaded, responses, arrays, files, noise)
    facts = study_facts(loaded)
    if not loaded.units_known:
        facts = facts.model_copy(update={"units": ""})
    results = Results(provenance=provenance(inputs, watch), study=facts, responses=responses)
    return RespondResult(
        responses, remarks=tuple(looked_up.remarks), results=results, arrays=arrays, files=tuple(written)
    )


def _read(source: Path | str | StudyFile, options: Mapping[str, Any], units: str | None, progress: Progress) -> Study:
    with held_for_solver(source, "respond"):
        study = load_study(source, progress)
    file = study.file
    if units is not None:
        if study.units_known:
            raise FemtuneError("response.units-given", where=file.where("study", "units"))  # fmt: skip
        file = file.model_copy(update={"study": file.study.model_copy(update={"units": unit_system(units).name})})
    file = with_response(file, options)
    if file.response is None and not file.load:
        raise FemtuneError("response.nothing-asked/no-request", where=Where(str(study.file.path)))  # fmt: skip
    return replace(study, file=file, units_known=study.units_known or units is not None)


def responses_at(
    study: Study, stage: ModelVersion, x: NDArray[np.float64], arrays: Arrays, progress: Progress
) -> tuple[ResponseResults, ...]:
    """Responses of all configurations at a parameter vector; () where the study asks for none."""
    if study.file.response is None and not study.file.load:
        return ()
    records = []
    for i, case in enumerate(study.cases):
        progress.step(f"responses, {stage}: {case.name}", i, len(study.cases))
        records.append(response_results(study, case, stage, x, i + 1, arrays, progress))
    return tuple(r for r in records if r is not None)


def _check_files(study: Study, files: Sequence[Path], uff: Path | None) -> None:
    if uff is not None and not study.units_known:
        raise FemtuneError("response.units-needed", where=Where(str(study.file.path)))  # fmt: skip
    if uff is not None and study.file.response is None:
        raise FemtuneError("response.nothing-asked/no-frfs-for-file", where=Where(str(study.file.path)))  # fmt: skip
    check_places(study, files, uff)


def check_places(study: Study, files: Sequence[Path], uff: Path | None) -> None:
    """Each file has a folder, and a place of its own that nothing was read from.

    Raises
    ------
    FemtuneError : ``uff.cannot-write``, ``write.overwrites-input``
    """
    if uff is not None and not (uff.name and uff.parent.is_dir()):
        raise FemtuneError("uff.cannot-write/folder", where=Where(str(uff)))  # fmt: skip
    check_outputs(inputs_of_study(study), files)
    taken: set[str] = set()
    for file in files:
        if (place := os.path.realpath(file)) in taken:
            raise FemtuneError("write.overwrites-input/named-file", where=Where(str(file)))
        taken.add(place)


def write_frf_files(
    study: Study,
    responses: Sequence[ResponseResults],
    arrays: Mapping[str, NDArray],
    paths: Sequence[Path],
    noise: FrfNoise = NO_NOISE,
) -> list[Path]:
    """The FRFs of each configuration as a Universal File (error ``uff.cannot-write``)."""
    written, chance = [], np.random.default_rng(noise.seed)
    for case, response, path in zip(study.cases, responses, paths):
        if response.frfs is not None:
            frfs = noise.added(frf_set(response.frfs, arrays), chance)
            test = ModalTest(id_line(case.name), study.file.study.unit_system, _geometry(case, frfs), frfs=frfs)
            written.append(write_uff_frfs(path, test, tuple(map(id_line, _about(study, case, response)))))
    return written


def _about(study: Study, case: StudyCase, response: ResponseResults) -> tuple[str, ...]:
    """ID lines: the program and its method, stage, title and configuration."""
    assert response.frfs is not None
    return f"femtune: {response.frfs.method}", response.stage, study.file.study.title, f"configuration {case.name}"


def id_line(text: str) -> str:
    """A text that fits an ID line."""
    return "".join(c if c.isprintable() and c.isascii() else "_" for c in text)[:80]


def _geometry(case: StudyCase, frfs: FrfSet) -> WireFrame:
    """The test's wire frame where all nodes are in it, else the model's grid points, in their displacement frames."""
    nodes = {d.node for d in (*frfs.responses, *frfs.references)}
    frame = case.test.geometry if case.test is not None else NO_GEOMETRY
    if nodes <= set(frame.nodes.tolist()):
        return frame
    table = case.configured.model.structure.nodes
    return _grid_points(table, nodes) if table.has_coordinates else NO_GEOMETRY


def _grid_points(table: NodeTable, nodes: set[int]) -> WireFrame:
    known = sorted(n for n in nodes if table.has_grid(n))
    at = [table.position(n) for n in known]
    return WireFrame(np.array(known, np.int64), table.xyz[at], np.swapaxes(table.frames[at], 1, 2))
