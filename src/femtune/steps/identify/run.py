"""The step identify: read the measurement, identify modes, write files."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femtune.errors import FemtuneError, Notice, Where, with_notices
from femtune.executor import Processes
from femtune.files.described_test import read_described_geometry
from femtune.files.whole_file import digest_of
from femtune.identification.gaps import cut_at_gaps
from femtune.identification.record_checks import check_record
from femtune.identification.same_shapes import same_shape_remarks
from femtune.journal.owner import owner_of
from femtune.steps.identify.choices import picked_poles
from femtune.steps.identify.facts import identification
from femtune.steps.identify.from_frfs import found_from_file, found_from_forces, has_forces
from femtune.steps.identify.from_record import found_from_record, read_asked
from femtune.steps.identify.from_spectra import found_from_spectra
from femtune.steps.identify.levels import level_file, linearity_notice, linearity_of
from femtune.steps.identify.request import asked_of, check_methods, check_no_lines, check_usable
from femtune.steps.identify.result import IdentifyResult, NothingFound
from femtune.steps.identify.rigid_bodies import with_rigid_bodies
from femtune.steps.identify.setups import found_from_setups
from femtune.steps.identify.write import RECORD_FILE, WRITTEN_FILES, no_modes_file, test_of_modes, write_found
from femtune.steps.run_folder import check_writable
from femtune.study.executor import check_jobs
from femtune.study.progress import silent
from femtune.study.provenance import report_facts
from femtune.study.record import InputFile

if TYPE_CHECKING:
    from femtune.files.identification_file import IdentifyFile
    from femtune.modal import TimeSeries
    from femtune.steps.identify.identified import Found
    from femtune.steps.identify.setups import IdentifyEach
    from femtune.study.progress import Progress


def identify(
    path: Path | str,
    output: Path | str | None = None,
    progress: Progress = silent,
    *,
    options: Mapping[str, Any] | None = None,
    jobs: int | None = None,
) -> IdentifyResult:
    """Identify modes from a time record or FRFs, and write them to a folder.

    Parameters
    ----------
    path : an identification file (TOML), a record (CSV, UFF 58, .npy, .npz, .mat, HDF5, WAV, LVM, TDMS, MDF), or
        functions or spectra (UFF 58)
    output : output folder; default: that of the file, or ``identified`` in its folder
    options : keys of [identify] that replace those of the file: ``{"band_hz": (2.0, 40.0)}``
    jobs : the most set-ups or levels that are identified at a time; one after another where it is None

    Raises
    ------
    FemtuneError : ``record.*``, ``uff.*``, ``identify.*``, ``study.*`` of the file, ``run.unwritable``
    """
    check_jobs(jobs)
    file = asked_of(path, options or {})
    each = partial(_found_each, jobs or 1, progress)
    folder = Path(output) if output is not None else file.output_folder
    _check_folder(folder, file)
    progress.step("reading the measurement", 0, None)
    inputs = tuple(InputFile(path=one.name, sha256=digest_of(one)) for one in file.measured_paths)
    picked_poles(file)  # before anything is computed
    title = file.identify.title or file.measured_path.name
    stated = {"report": report_facts(file.report)}
    try:
        with _at_the_file(file):
            identified = _found(file, progress, each)
    except NothingFound as error:
        nothing = replace(error.found, notices=(*error.notices, *error.found.notices))
        record = identification(nothing, title, inputs, file.identify.units)
        record = record.model_copy(update=stated)
        error.result = IdentifyResult(folder, record, nothing, tuple(write_found(folder, nothing, record, None)))
        raise
    linearity = linearity_of(file, identified, each)
    if linearity is not None:
        identified = replace(identified, notices=(*identified.notices, *linearity_notice(linearity)))
    tables = (file.channel, file.function, file.functions, *(one.channel for one in file.setup))
    test = test_of_modes(identified, title, file.identify.units)
    unwritten = no_modes_file(test, named=any(map(bool, tables)))
    if unwritten is not None:
        identified = replace(identified, notices=(*identified.notices, unwritten))
    record = identification(identified, title, inputs, file.identify.units, linearity).model_copy(update=stated)
    names = write_found(folder, identified, record, test if unwritten is None else None)
    return IdentifyResult(folder, record, identified, tuple(names))


def _found(file: IdentifyFile, progress: Progress, each: IdentifyEach) -> Found:
    if file.setup:
        return _with_same_shapes(_with_geometry(found_from_setups(file, each), file))
    return _found_of_one(file, progress)


def _found_of_one(file: IdentifyFile, progress: Progress) -> Found:
    if file.identify.spectra is not None:
        progress.step("poles of every order", 0, None)
        return _with_agreement(found_from_spectra(file))
    if file.identify.frfs is not None:
        check_no_lines(file)
        progress.step("poles of every order", 0, None)
        return _with_agreement(found_from_file(file))
    geometry = read_described_geometry(file)
    records: list[TimeSeries] = []
    notices: tuple[Notice, ...] = ()
    for read, of_file in read_asked(file):
        record, of_bodies = with_rigid_bodies(read, file, geometry)
        check_usable(record)
        told = (*of_file, *of_bodies, *check_record(record))
        parts, of_gaps = ([record], ()) if file.identify.gaps is None else cut_at_gaps(record, file.identify.gaps)
        told = (*told, *of_gaps)
        notices = (*notices, *(notice for notice in told if notice not in notices))
        records.extend(parts)
    forces = has_forces(records[0])
    check_methods(file, forces)
    if len(file.measured_paths) > 1 and not forces:
        count = len(file.measured_paths)
        raise FemtuneError("identify.several-records", where=file.where("identify", "record"), count=count)
    with with_notices(notices):
        identified = found_from_forces(records, file) if forces else found_from_record(records, file, progress)
    identified = replace(identified, notices=(*notices, *identified.notices))
    return _with_agreement(identified if geometry is None else replace(identified, geometry=geometry))


def _with_geometry(identified: Found, file: IdentifyFile) -> Found:
    geometry = read_described_geometry(file)
    return identified if geometry is None else replace(identified, geometry=geometry)


def _found_each(jobs: int, progress: Progress, asked: Sequence[tuple[IdentifyFile, str]]) -> list[Found]:
    """The modes of several measurements, in their order; more than one job is made by worker processes."""
    if jobs == 1:
        return [_found_named(progress, *one) for one in asked]
    ended: list[str] = []

    def tell(position: int, _: Found) -> None:
        ended.append(asked[position][1])
        progress.step(ended[-1], len(ended), len(asked))

    return Processes(jobs).run(_found_there, asked, name="measurement", finished=tell)


def _found_there(asked: tuple[IdentifyFile, str]) -> Found:
    return _found_named(silent, *asked)


def _found_named(progress: Progress, file: IdentifyFile, name: str) -> Found:
    progress.step(name, 0, None)
    with _at_the_file(file):
        return _found_of_one(file, progress)


def _with_same_shapes(identified: Found) -> Found:
    """With remarks on neighbouring modes of the same shape, each pair told once; peaks of the excitation are known."""
    remarks = tuple(r for r in same_shape_remarks(identified.modes) if identified.of_structure(r.mode))
    notices = tuple({id(r.notice): r.notice for r in remarks}.values())
    return replace(identified, remarks=(*identified.remarks, *remarks), notices=(*identified.notices, *notices))


def _with_agreement(identified: Found) -> Found:
    """With remarks on modes of the same shape, and a notice of the modes that one method alone has."""
    identified = _with_same_shapes(identified)
    structural = [i for i in range(len(identified.modes)) if identified.of_structure(i)]
    alone = {i: name for i in structural if (name := identified.only_method(i)) is not None}
    if not alone:
        return identified
    names = ", ".join(f"{identified.modes.freq_hz[i]:.4g} Hz ({name})" for i, name in alone.items())
    notice = Notice("identify.one-method", level="info", n_alone=len(alone), n_modes=len(structural), names=names)
    return replace(identified, notices=(*identified.notices, notice))


@contextmanager
def _at_the_file(file: IdentifyFile) -> Iterator[None]:
    """Errors of the methods, which know arrays only, are reported for the measured file."""
    try:
        yield
    except FemtuneError as error:
        if not str(error.where or ""):
            error.where = Where(str(file.measured_path))
        raise


def _check_folder(folder: Path, file: IdentifyFile) -> None:
    check_writable(folder)
    levels = [level_file(file, entry).measured_path for entry in file.level]
    geometry = (file.geometry_path,) if file.geometry_path is not None else ()
    inputs = {os.path.realpath(p) for p in (file.path, *file.measured_paths, *geometry, *levels)}
    if any(os.path.realpath(p) in inputs for p in folder.iterdir()):
        raise FemtuneError("write.overwrites-input/measurement", where=Where(str(folder)))
    owner = owner_of(folder, folder.parent)
    if owner is not None:
        raise FemtuneError("run.other-study/identify", where=Where(str(folder)), owner=owner.shown)
    if not os.path.lexists(folder / RECORD_FILE):
        for name in WRITTEN_FILES:
            if os.path.lexists(folder / name):
                raise FemtuneError("run.other-file/identify", where=Where(str(folder / name)), name=name)
