"""Functions, spectra and geometry that an identification file describes, whatever the format of its files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femtune.dofs import Dof, parse_dof
from femtune.errors import FemtuneError, Notice, Where, with_notices
from femtune.files.points_table import read_points
from femtune.files.records import FunctionColumn, FunctionLayout
from femtune.files.records.frf_file import FunctionValues, read_values, read_values_of_files
from femtune.files.uff import UffContent, UffFile, read_uff
from femtune.files.uff.function_units import StatedOfFunctions
from femtune.files.uff.scan import names_universal
from femtune.files.uff.spectrum_sets import read_uff_spectra
from femtune.modal import FrfSet
from femtune.modal.spectrum_set import SpectrumSet, spectrum_set
from femtune.testdata import NO_GEOMETRY, ModalTest, WireFrame, convert_units, sensors_at
from femtune.units import UnitSystem, unit_system

if TYPE_CHECKING:
    from femtune.files.identification_file import IdentifyFile


@dataclass(frozen=True, eq=False)
class DescribedFunctions:
    """Functions and wire frame in the units of the identification file, and the notices of reading them."""

    frfs: FrfSet
    geometry: WireFrame = NO_GEOMETRY
    notices: tuple[Notice, ...] = ()


def read_described(file: IdentifyFile) -> DescribedFunctions:
    """The functions of the files that `frfs` names.

    Raises
    ------
    FemtuneError : ``uff.*``, ``record.*``, ``frf.layout``; ``identify.no-frfs`` for files without functions of motion
        over force, or with several kinds of them
    """
    paths, units = file.measured_paths, unit_system(file.identify.units)
    universal = [file.identify.format == "uff" or names_universal(path) for path in paths]
    if not all(universal):
        functions = DescribedFunctions(_of_tables(file))
    else:
        content = read_universal(UffFile(paths[0], paths[1:]), units, _stated(file)).as_one()
        # they say which functions are no FRFs
        with with_notices(content.notices):
            frfs = _only(content.frf_sets, ", ".join(map(str, paths)))
        functions = DescribedFunctions(frfs, content.test.geometry, content.notices)
    stated = read_described_geometry(file)
    notices = (*functions.notices, *_same_values(functions.frfs))
    return DescribedFunctions(functions.frfs, functions.geometry if stated is None else stated, notices)


def _same_values(frfs: FrfSet) -> Iterator[Notice]:
    """Functions that are copies of others; reciprocal ones may be, since programs fill them in."""
    seen: dict[bytes, tuple[Dof, Dof]] = {}
    same = []
    for i, response in enumerate(frfs.responses):
        for j, reference in enumerate(frfs.references):
            values = np.ascontiguousarray(frfs.values[i, j])
            if np.isnan(values).any() or not values.any():
                continue
            first = seen.setdefault(values.tobytes(), (response, reference))
            if first not in ((response, reference), (reference, response)):
                same.append(f"{response}/{reference} and {first[0]}/{first[1]}")
    if same:
        yield Notice("frf.same-values", pairs=", ".join(same[:5]) + (" …" if len(same) > 5 else ""))


def _of_tables(file: IdentifyFile) -> FrfSet:
    """The functions of one file of arrays or columns, or of one file for each function or several.

    Raises
    ------
    FemtuneError : ``identify.several-arrays`` for several files without the functions of each
    """
    stated = file.functions
    if stated is None:
        raise FemtuneError("frf.layout", where=file.where("identify", "frfs"))
    if stated.kind is None:
        raise FemtuneError("frf.layout/no-kind", where=file.where("functions"))
    return _values_of_tables(file, "frfs", stated.kind).frfs(stated.kind)


def read_described_spectra(file: IdentifyFile) -> tuple[SpectrumSet, tuple[Notice, ...]]:
    """The spectra of the files that `spectra` names, and what was remarkable about them.

    Raises
    ------
    FemtuneError : ``uff.*``, ``record.*``, ``frf.layout``; ``identify.spectra``
    """
    paths = file.measured_paths
    source = ", ".join(map(str, paths))
    if all(file.identify.format == "uff" or names_universal(path) for path in paths):
        if file.functions is not None or file.function:
            raise FemtuneError("identify.spectra/layout", where=file.where("functions"))
        with np.errstate(all="ignore"):  # overflow becomes infinity, which the checks refuse by name
            return read_uff_spectra(UffFile(paths[0], paths[1:]).sets, source)
    if file.functions is not None and file.functions.kind is not None:
        raise FemtuneError("identify.spectra/kind", where=file.where("functions", "kind"))
    read = _values_of_tables(file, "spectra", "")
    pairs = {
        (response, reference): read.values[i, j]
        for i, response in enumerate(read.responses)
        for j, reference in enumerate(read.references)
        if not np.isnan(read.values[i, j]).all()
    }
    return spectrum_set(read.freq_hz, pairs, source=source), ()


def _values_of_tables(file: IdentifyFile, key: str, kind: str) -> FunctionValues:
    paths, layout, named = file.measured_paths, _layout(file, kind), [entry.file for entry in file.function]
    if any(named):
        return read_values_of_files([file.path.parent / (name or paths[0]) for name in named], layout)
    if len(paths) > 1 and len(paths) == len(file.function):
        return read_values_of_files(paths, layout)
    if len(paths) > 1:
        raise FemtuneError("identify.several-arrays", where=file.where("identify", key))
    return read_values(paths[0], layout)


def _stated(file: IdentifyFile) -> StatedOfFunctions:
    """What [functions] states of the functions of Universal Files, whose other properties they state themselves."""
    table = file.functions
    if table is None:
        return StatedOfFunctions()
    more = sorted(table.model_fields_set - {"kind", "factor"}) + ["function"] * bool(file.function)
    if more:
        raise FemtuneError("frf.layout/universal", where=file.where("functions"), keys=", ".join(more))
    return StatedOfFunctions(table.kind, table.factor if "factor" in table.model_fields_set else None)


def read_universal(file: UffFile, units: UnitSystem, functions: StatedOfFunctions | None = None) -> UffContent:
    """The content of Universal Files that may state no units: then theirs are `units`."""
    try:
        return read_uff(file, units=units, functions=functions)
    except FemtuneError as error:
        if error.code != "uff.no-units":
            raise
        return read_uff(file, units=units, file_units=units, functions=functions)


def read_described_geometry(file: IdentifyFile) -> WireFrame | None:
    """The wire frame that `geometry` and `lines` describe, None without them (errors ``test.*``, ``uff.*``)."""
    path, units = file.geometry_path, unit_system(file.identify.units)
    if path is None:
        return None
    frame = read_universal(UffFile(path), units).test.geometry if names_universal(path) else read_points(path)
    return WireFrame(
        frame.nodes, frame.coordinates, frame.axes, (*frame.lines, *file.identify.lines), frame.elements
    )  # fmt: skip


def described_test(path: Path, name: str, units: UnitSystem) -> ModalTest:
    """The test that an identification file describes, in the units of a study."""
    from femtune.files.identification_file import read_identify_file  # noqa: PLC0415  few studies name one

    file = read_identify_file(path)
    if file.identify.frfs is None:
        raise FemtuneError("test.described", where=Where(str(path)))
    functions = read_described(file)
    dofs = [*functions.frfs.responses, *functions.frfs.references]
    units_of_file = unit_system(file.identify.units)
    sensors = sensors_at(functions.geometry, dofs)
    test = ModalTest(
        name=name,
        units=units_of_file,
        geometry=functions.geometry,
        sensors=sensors,
        modes=None,
        frfs=functions.frfs,
        conditions=(),
        source=str(path),
        notices=functions.notices,
        exponential_s=file.identify.exponential_s,
    )
    return convert_units(test, units)


def _layout(file: IdentifyFile, kind: str) -> FunctionLayout:
    from femtune.files.identification_file import FunctionsTable  # noqa: PLC0415  few studies name one

    stated = file.functions or FunctionsTable()
    columns = tuple(
        FunctionColumn(parse_dof(f.response), parse_dof(f.reference), f.column, f.imaginary, f.coherence)
        for f in file.function
    )
    return FunctionLayout(
        kind=kind,
        responses=tuple(map(parse_dof, stated.responses)),
        references=tuple(map(parse_dof, stated.references)),
        functions=columns,
        axes=stated.axes,
        variable=stated.variable or file.identify.variable,
        imaginary=stated.imaginary,
        coherence=stated.coherence,
        frequency=stated.frequency,
        start_hz=stated.start_hz,
        step_hz=stated.step_hz,
        factor=stated.factor,
        format=file.identify.format,
    )


def _only(sets: tuple[FrfSet, ...], path: str) -> FrfSet:
    if len(sets) != 1:
        kinds = ", ".join(f"{len(s.responses)} × {len(s.references)} {s.kind}, {len(s.freq_hz)} lines" for s in sets)
        raise FemtuneError("identify.no-frfs", values={"file": path, "sets": kinds or "none"}, n_sets=len(sets))
    return sets[0]
