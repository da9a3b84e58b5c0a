"""Universal Files in: one test with its geometry, modes and FRFs, in the units of the study."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from femtune.dofs import Dof
from femtune.errors import FemtuneError, Notice, Where, folded
from femtune.files.uff.frf_sets import frf_sets
from femtune.files.uff.function_units import StatedOfFunctions
from femtune.files.uff.geometry import read_geometry
from femtune.files.uff.measured_functions import MeasuredFunction, read_functions
from femtune.files.uff.mode_records import ModeRecord, mode_set, read_mode_records
from femtune.files.uff.scan import DataSet, scan_uff
from femtune.files.uff.unit_records import file_unit_system
from femtune.modal import FrfSet, ModeSet
from femtune.modal.joined import join_ranges
from femtune.testdata import ModalTest, WireFrame, convert_frfs, convert_units, sensors_at
from femtune.units import UnitSystem

READ = (15, 18, 55, 58, 82, 151, 164, 2411, 2412, 2414, 2420)
"""The data sets that are understood."""

_REASONS = {
    1858: "qualifiers of functions; data set 58 has all that is needed",
    2400: "names of a finite element model, not test data",
    2429: "groups of nodes and elements",
    2467: "groups of nodes and elements",
}


@dataclass(frozen=True, eq=False)
class UffContent:
    """All that was read from a Universal File.

    Parameters
    ----------
    test : geometry, sensors, modes and FRFs in the units asked for
    frf_sets : one for each kind and set of frequency lines; ``test.frfs`` is the only one, or None
    functions : every data set 58 as it stands in the file, in the file's units
    mode_records : every data set 55 and 2414 that was read, likewise
    file_units : the system of the file
    data_sets : how many of each number the file has
    notices : everything remarkable, data sets left out among it
    """

    test: ModalTest
    frf_sets: tuple[FrfSet, ...]
    functions: tuple[MeasuredFunction, ...]
    mode_records: tuple[ModeRecord, ...]
    file_units: UnitSystem
    data_sets: dict[int, int]
    notices: tuple[Notice, ...]

    def as_one(self) -> UffContent:
        """With FRFs of one kind at several sets of lines as one set, of which a notice says so.

        Of the same function a later set adds only lines outside the range of an earlier one. Else as it is.
        """
        sets = self.frf_sets
        if len(sets) < 2 or len({frfs.kind for frfs in sets}) > 1:
            return self
        frfs = join_ranges(sets)
        said = ", ".join(f"{len(one.freq_hz)} lines from {one.freq_hz[0]:g} to {one.freq_hz[-1]:g} Hz" for one in sets)
        where = Where(self.test.source)
        told = Notice("test.joined-frfs", level="info", where=where, sets=said, lines=len(frfs.freq_hz))
        notices = (*(n for n in self.notices if n.code != "uff.several-frf-sets"), told)
        return replace(self, test=replace(self.test, frfs=frfs, notices=notices), frf_sets=(frfs,), notices=notices)


@dataclass(frozen=True, eq=False)
class UffFile:
    """A Universal File that is parsed once, whatever is read from it: records of several tests, say.

    `more` are further files of the same test: modes in one and functions in another.
    """

    path: str | Path
    more: tuple[str | Path, ...] = ()

    @cached_property
    def sets(self) -> tuple[DataSet, ...]:
        """All data sets of all files, as of `scan_uff`."""
        return tuple(one for path in (self.path, *self.more) for one in scan_uff(path))

    @cached_property
    def geometry(self) -> tuple[WireFrame, tuple[Notice, ...]]:
        """The wire frame and what was remarkable about it, as of `read_geometry`."""
        return read_geometry(self.sets)

    @cached_property
    def functions(self) -> tuple[tuple[MeasuredFunction, ...], tuple[Notice, ...]]:
        """The measured functions, as of `read_functions`."""
        return read_functions(self.sets)


def read_uff(
    path: str | Path | UffFile,
    *,
    units: UnitSystem | None,
    file_units: UnitSystem | None = None,
    records: str | None = None,
    name: str = "",
    functions: StatedOfFunctions | None = None,
) -> UffContent:
    """Read a Universal File (UFF, UNV) with data sets 15, 18, 55, 58, 58b, 82, 151, 164, 2411, 2412, 2414, 2420.

    Parameters
    ----------
    path : the file, or a `UffFile` from which several tests are read
    units : the system that the test is converted to; None keeps that of the file
    file_units : the system of the file where it has no data set 164
    records : read only the modes whose ID lines contain this word
    name : of the test; by default `records`, or the name of the file
    functions : kind and factor of the functions, in place of their data types and unit labels

    Raises
    ------
    FemtuneError : ``uff.no-units``, ``uff.units-contradict``, ``uff.truncated``, ``uff.nothing-usable`` and
        the other codes ``uff.…`` of the data sets
    """
    file = path if isinstance(path, UffFile) else UffFile(path)
    with np.errstate(all="ignore"):  # overflow becomes infinity, which the checks refuse by name
        return _content(file, units, file_units, records, name or records or Path(file.path).stem, functions)


def _content(
    file: UffFile,
    units: UnitSystem | None,
    file_units: UnitSystem | None,
    records: str | None,
    name: str,
    stated: StatedOfFunctions | None,
) -> UffContent:
    sets, source = file.sets, str(file.path)
    system, unit_notices = file_unit_system(sets, file_units, source)
    units = units or system
    geometry, geometry_notices = file.geometry
    mode_records, record_notices = read_mode_records(sets, records)
    _refuse_useless(sets, mode_records, source)
    modes, mode_notices = mode_set(mode_records, source)
    functions, function_notices = file.functions
    frfs, frf_notices = frf_sets(functions, system, source, stated)
    of_records = (*geometry_notices, *record_notices, *mode_notices, *function_notices, *frf_notices)
    about = (*_several(frfs, source), *_unplaced(geometry, modes, frfs, source))
    of_frame = folded(notice for one in sets for notice in one.notices)
    notices = (*of_frame, *_ignored(sets), *unit_notices, *of_records, *about)
    only = frfs[0] if len(frfs) == 1 else None
    sensors = sensors_at(geometry, _dofs(modes, frfs))
    test = ModalTest(
        name=name,
        units=system,
        geometry=geometry,
        sensors=sensors,
        modes=modes,
        frfs=only,
        conditions=_conditions(sets),
        source=source,
        notices=notices,
    )
    return UffContent(
        convert_units(test, units),
        tuple(convert_frfs(one, system, units) for one in frfs),
        functions,
        mode_records,
        system,
        dict(Counter(one.number for one in sets)),
        notices,
    )


def _refuse_useless(sets: Iterable[DataSet], modes: Sequence[ModeRecord], source: str) -> None:
    numbers = Counter(one.number for one in sets)
    if not set(numbers) & {15, 55, 58, 2411} and not modes:
        raise FemtuneError("uff.nothing-usable", where=Where(source), values={"data sets": _listed(numbers)})


def _listed(numbers: Counter[int]) -> str:
    return ", ".join(f"{number} ({count} times)" for number, count in sorted(numbers.items()))


def _ignored(sets: Iterable[DataSet]) -> Iterable[Notice]:
    groups: dict[int, list[DataSet]] = {}
    for one in sets:
        if one.number not in READ:
            groups.setdefault(one.number, []).append(one)
    for number, members in sorted(groups.items()):
        reason = _REASONS.get(number, "not understood")
        yield Notice(
            "uff.ignored",
            where=members[0].where(),
            level="info" if number in _REASONS else "warning",
            number=number,
            reason=reason,
            n_members=len(members),
        )


def _several(frfs: Sequence[FrfSet], source: str) -> Iterable[Notice]:
    if len(frfs) > 1:
        kinds = ", ".join(f"{len(one.responses)} {one.kind} at {len(one.freq_hz)} lines" for one in frfs)
        yield Notice("uff.several-frf-sets", where=Where(source), kinds=kinds)


def _dofs(modes: ModeSet | None, frfs: Iterable[FrfSet]) -> list[Dof]:
    dofs = [] if modes is None else list(modes.dofs)
    for one in frfs:
        dofs += [*one.responses, *one.references]
    return dofs


def _unplaced(geometry: WireFrame, modes: ModeSet | None, frfs: Iterable[FrfSet], source: str) -> Iterable[Notice]:
    lost = sorted({dof.node for dof in _dofs(modes, frfs) if dof.component} - set(geometry.nodes.tolist()))
    if lost:
        yield Notice("uff.no-position", where=Where(source), n_lost=len(lost), lost=lost[:8])


def _conditions(sets: Iterable[DataSet]) -> tuple[tuple[str, str], ...]:
    """Model name, description and program of data set 151, in words."""
    headers = [one.lines for one in sets if one.number == 151]
    names = ("model", "description", "database program")
    return tuple((name, line.strip()) for lines in headers[:1] for name, line in zip(names, lines))
