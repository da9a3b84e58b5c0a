"""The step identify: read the measurement, identify modes, write files."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femtune.errors import FemtuneError, Notice, Where, with_notices
from femtune.executor import Processes
from femtune.files.described_test import read_described_geometry
from femtune.identification.choice import Limits, stable
from femtune.identification.record_checks import check_record
from femtune.steps.identify.facts import identification
from femtune.steps.identify.from_frfs import found_from_file, found_from_forces, has_forces
from femtune.steps.identify.from_record import found_from_record, read_asked
from femtune.steps.identify.levels import level_file, linearity_notice, linearity_of
from femtune.steps.identify.request import asked_of, check_methods, check_usable
from femtune.steps.identify.rigid_bodies import with_rigid_bodies
from femtune.steps.identify.several import found_from_setups
from femtune.steps.identify.write import no_modes_file, test_of_modes, write_found
from femtune.steps.result import StepResult
from femtune.steps.run_folder import check_writable
from femtune.study.executor import check_jobs
from femtune.study.progress import silent
from femtune.study.record import InputFile
from femtune.study.rows import Rows, rows_of

if TYPE_CHECKING:
    from femtune.files.identification_file import IdentifyFile
    from femtune.modal import FrfSet, ModeSet
    from femtune.steps.identify.found import Found
    from femtune.steps.identify.record import Identification
    from femtune.steps.identify.several import IdentifyEach
    from femtune.study.progress import Progress
    from femtune.study.record import Alert


@dataclass(frozen=True, eq=False, repr=False)
class IdentifyResult(StepResult):
    """The identified modes, the poles from which they were chosen, and the folder of their files.

    Parameters
    ----------
    folder : where the files are
    record : all results except the arrays, as in identified.json
    found : the modes with the poles of every order, the measured and the synthesised functions
    files : names of the files in the folder
    report : the page that was written, None without one
    """

    folder: Path
    record: Identification
    found: Found
    files: tuple[str, ...]
    report: Path | None = None

    @property
    def modes(self) -> ModeSet:
        """The identified modes, with shapes at the sensors and standard deviations."""
        return self.found.modes

    @property
    def frequencies(self) -> Rows:
        """One line a mode: frequency in Hz and damping ratio with standard deviations, phase collinearity."""
        columns = ("label", "freq_hz", "freq_sd_hz", "damping_ratio", "damping_sd", "phase_collinearity", "remark")
        return rows_of(self.record.modes, *columns)

    @property
    def clusters(self) -> Rows:
        """Clusters of stable poles, chosen or not, and why."""
        return rows_of(self.record.clusters, "freq_hz", "damping_ratio", "chosen", "reason")

    @property
    def linearity(self) -> Rows:
        """Changes of each mode over the levels of the force, in %, and the verdict; no rows with one level."""
        record = self.record.linearity
        return Rows.of(
            {
                "label": m.label,
                "frequency_percent": m.frequency.largest_percent,
                "frequency_per_doubling_percent": m.frequency.per_doubling_percent,
                "damping_percent": m.damping.largest_percent,
                "damping_per_doubling_percent": m.damping.per_doubling_percent,
                "linear": m.linear,
            }
            for m in (record.modes if record is not None else ())
        )

    @property
    def poles(self) -> Rows:
        """Every pole of every order and method; no rows for methods without orders."""
        table = self.found.table
        if table is None:
            return Rows()
        rows = zip(table.method, table.order, table.freq_hz, table.damping_ratio, stable(table, Limits()))
        return Rows.of(
            {"method": m, "order": int(o), "freq_hz": float(f), "damping_ratio": float(z), "stable": bool(s)}
            for m, o, f, z, s in rows
        )

    @property
    def measured(self) -> FrfSet | None:
        """The measured functions at the lines of the fit; None if the input is not known."""
        return self.found.measured

    @property
    def synthesised(self) -> FrfSet | None:
        """The functions of the identified modes at the same lines; None if the input is not known."""
        return self.found.synthesised

    @property
    def notices(self) -> tuple[Alert, ...]:
        """Alerts and remarks."""
        return self.record.alerts

    def _sentences(self) -> list[str]:
        modes = [f"{m.label}: {m.freq_hz:.5g} Hz" for m in self.record.modes]
        alerts = [f"{a.level}: {a.sentence}" for a in self.record.alerts]
        return [f"{len(modes)} modes at {len(self.record.dofs)} sensors, {self.folder}", *modes, *alerts]

    def _table(self) -> Rows:
        return self.frequencies


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
    path : an identification file (TOML), a record (CSV, UFF 58, .npy, .npz, .mat, HDF5, WAV), or functions (UFF 58)
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
    with _at_the_file(file):
        identified = _found(file, progress, each)
    linearity = linearity_of(file, identified, each)
    if linearity is not None:
        identified = replace(identified, notices=(*identified.notices, *linearity_notice(linearity)))
    source = InputFile(path=file.measured_path.name, sha256=_digest(file.measured_path))
    title = file.identify.title or file.measured_path.name
    tables = (file.channel, file.function, file.functions, *(one.channel for one in file.setup))
    test = test_of_modes(identified, title, file.identify.units)
    unwritten = no_modes_file(test, named=any(map(bool, tables)))
    if unwritten is not None:
        identified = replace(identified, notices=(*identified.notices, unwritten))
    record = identification(identified, title, source, file.identify.units, linearity)
    names = write_found(folder, identified, record, test if unwritten is None else None)
    return IdentifyResult(folder, record, identified, tuple(names))


def _found(file: IdentifyFile, progress: Progress, each: IdentifyEach) -> Found:
    if file.setup:
        return _with_geometry(found_from_setups(file, each), file)
    return _found_of_one(file, progress)


def _found_of_one(file: IdentifyFile, progress: Progress) -> Found:
    if file.identify.frfs is not None:
        progress.step("poles of every order", 0, None)
        return _with_agreement(found_from_file(file))
    geometry = read_described_geometry(file)
    record, of_bodies = with_rigid_bodies(read_asked(file), file, geometry)
    check_usable(record)
    notices = (*of_bodies, *check_record(record))
    check_methods(file, has_forces(record))
    with with_notices(notices):
        found = found_from_forces(record, file) if has_forces(record) else found_from_record(record, file, progress)
    found = replace(found, notices=(*notices, *found.notices))
    return _with_agreement(found if geometry is None else replace(found, geometry=geometry))


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


def _with_agreement(identified: Found) -> Found:
    """With a notice of the modes that one method alone has."""
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


def _digest(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
