"""The step respond: FRFs, complex modes and static displacements of a study, or of a deck."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.errors import FemtuneError, Where
from femtune.fem import NodeTable
from femtune.files.study_file import with_response
from femtune.files.uff import write_uff_frfs
from femtune.modal import FrfSet
from femtune.study.cases import StudyCase
from femtune.study.load import Study, is_deck, load_study
from femtune.study.progress import Progress, silent
from femtune.study.provenance import Stopwatch, input_paths, inputs_of, provenance, study_facts
from femtune.study.record_response import response_results
from femtune.study.results import Results
from femtune.study.results_base import Stage
from femtune.study.results_response import FrfResults, ResponseResults
from femtune.study.with_journal import looking_up
from femtune.testdata import NO_GEOMETRY, ModalTest, WireFrame
from femtune.units import unit_system

Arrays = dict[str, NDArray]

FRFS_FILE = "frfs.uff"
"""In a run folder, the functions of the model at its last stage."""


def respond_results(
    path: Path | str,
    options: Mapping[str, Any],
    progress: Progress = silent,
    *,
    fresh: bool = False,
    remarks: list[str] | None = None,
    uff: Path | None = None,
    units: str | None = None,
    keep: Sequence[Path] = (),
) -> tuple[Results, Arrays]:
    """Responses at the start values of the parameters, and their arrays.

    Parameters
    ----------
    options : keys of [response] that take the place of the study's
    uff : Universal File for the FRFs; with several configurations each has its own, with its number in the name
    units : of a deck alone, which tells none
    keep : files that will be written with what this returns; none of them may be one that was read

    Raises
    ------
    FemtuneError : ``response.nothing-asked``, ``response.units-needed``, ``write.overwrites-input``,
        ``uff.cannot-write``, and as `response_results`
    """
    watch = Stopwatch(f"femtune.respond({str(path)!r})")
    arrays: Arrays = {}
    with watch.step("read"):
        loaded = _read(Path(path), options, units, progress)
        files = [] if uff is None else uff_paths(uff, loaded)
        _check_files(loaded, [*keep, *files], uff)
        inputs = inputs_of(loaded)
    with watch.step("respond"), looking_up(loaded, fresh, remarks) as study:
        responses = responses_at(study, "before", np.zeros(len(study.parameters.free)), arrays, progress)
    if uff is not None:
        write_frf_files(loaded, responses, arrays, files)
    facts = study_facts(loaded)
    if not loaded.units_known:
        facts = facts.model_copy(update={"units": ""})
    return Results(provenance=provenance(inputs, watch), study=facts, responses=responses), arrays


def _read(path: Path, options: Mapping[str, Any], units: str | None, progress: Progress) -> Study:
    study = load_study(path, progress)
    file = study.file
    if units is not None:
        if not is_deck(path):
            raise FemtuneError(
                "response.units-given", "units are given on the command line, and the study has its own",
                where=file.where("study", "units"), hint="leave --units out; it is for a deck alone",
            )  # fmt: skip
        file = file.model_copy(update={"study": file.study.model_copy(update={"units": unit_system(units).name})})
    file = with_response(file, options)
    if file.response is None and not file.load:
        raise FemtuneError(
            "response.nothing-asked", "neither [response] nor [[load]] says which responses are wanted",
            where=Where(str(path)), hint="add [response], or give --input 12Z+ --from 1 --to 100 --step 0.5",
        )  # fmt: skip
    return replace(study, file=file, units_known=study.units_known or units is not None)


def responses_at(
    study: Study, stage: Stage, x: NDArray[np.float64], arrays: Arrays, progress: Progress
) -> tuple[ResponseResults, ...]:
    """Responses of all configurations at a parameter vector; () where the study asks for none."""
    if study.file.response is None and not study.file.load:
        return ()
    found = []
    for i, case in enumerate(study.cases):
        progress.step(f"responses, {stage}: {case.name}", i, len(study.cases))
        found.append(response_results(study, case, stage, x, i + 1, arrays, progress))
    return tuple(r for r in found if r is not None)


def uff_paths(path: Path, study: Study) -> list[Path]:
    """A file for each configuration: the path itself, or with several its name and a number."""
    if len(study.cases) == 1:
        return [path]
    return [path.with_name(f"{path.stem}_{i + 1}{path.suffix}") for i in range(len(study.cases))]


def _check_files(study: Study, files: Sequence[Path], uff: Path | None) -> None:
    if uff is not None and not study.units_known:
        raise FemtuneError(
            "response.units-needed", "a Universal File has units, and a deck alone does not tell them",
            where=Where(str(study.file.path)), hint='say them: --units m-kg-s, "mm-t-s", "in-slinch-s" …',
        )  # fmt: skip
    if uff is not None and study.file.response is None:
        raise FemtuneError(
            "response.nothing-asked", "a Universal File is wanted, and the study asks for no FRFs",
            where=Where(str(study.file.path)), hint="add [response] with inputs",
        )  # fmt: skip
    check_places(study, files, uff)


def check_places(study: Study, files: Sequence[Path], uff: Path | None) -> None:
    """Each file has a folder, and a place of its own that nothing was read from.

    Raises
    ------
    FemtuneError : ``uff.cannot-write``, ``write.overwrites-input``
    """
    taken = dict.fromkeys(map(os.path.realpath, (study.file.path, *input_paths(study))), "one that was read")
    if uff is not None and not (uff.name and uff.parent.is_dir()):
        raise FemtuneError(
            "uff.cannot-write", "the file cannot be written: its folder does not exist, or it is a folder",
            where=Where(str(uff)), hint="name a file in a folder that exists and that you may write to",
        )  # fmt: skip
    for file in files:
        if (place := os.path.realpath(file)) in taken:
            raise FemtuneError(
                "write.overwrites-input", f"the file would overwrite {taken[place]}",
                where=Where(str(file)), hint="give it another name",
            )  # fmt: skip
        taken[place] = "another one that is to be written"


def write_frf_files(
    study: Study, responses: Sequence[ResponseResults], arrays: Mapping[str, NDArray], paths: Sequence[Path]
) -> list[Path]:
    """The FRFs of each configuration as a Universal File (error ``uff.cannot-write``)."""
    written = []
    for case, response, path in zip(study.cases, responses, paths):
        if response.frfs is not None:
            frfs = frf_set(response.frfs, arrays)
            test = ModalTest(id_line(case.name), study.file.study.unit_system, _geometry(case, frfs), frfs=frfs)
            written.append(write_uff_frfs(path, test, tuple(map(id_line, _about(study, case, response)))))
    return written


def _about(study: Study, case: StudyCase, response: ResponseResults) -> tuple[str, ...]:
    """ID lines: the program and its method, stage, title and configuration."""
    assert response.frfs is not None
    return f"femtune: {response.frfs.method}", response.stage, study.file.study.title, f"configuration {case.name}"


def frf_set(record: FrfResults, arrays: Mapping[str, NDArray]) -> FrfSet:
    """The functions of a record with their arrays."""
    return FrfSet(
        arrays[record.freq_key], arrays[record.values_key], DofSet.parse(record.outputs), DofSet.parse(record.inputs),
        record.kind, source=f"model, {record.method}",
    )  # fmt: skip


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
    return _grid_points(table, nodes) if table.located else NO_GEOMETRY


def _grid_points(table: NodeTable, nodes: set[int]) -> WireFrame:
    known = sorted(n for n in nodes if table.has_grid(n))
    at = [table.position(n) for n in known]
    return WireFrame(np.array(known, np.int64), table.xyz[at], np.swapaxes(table.frames[at], 1, 2))
