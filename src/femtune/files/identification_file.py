"""Read an identification file; all problems at once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, ValidationError, model_validator

from femtune.errors import ErrorCollector, FemtuneError, Where
from femtune.files.formats import RecordFormatKey
from femtune.files.study_file.kinds import (
    DofLabel,
    Fraction,
    Hertz,
    NamesFile,
    Positive,
    SchemaVersion,
    Text,
    TomlTable,
    Units,
)
from femtune.files.study_file.output import OutputTable
from femtune.files.study_file.problems import problems
from femtune.files.study_file.reading import check_version, missing_files, toml_data, toml_text
from femtune.files.study_file.report import ReportTable
from femtune.files.study_file.source import StudyLines, falls, line_numbers, table, tables, texts
from femtune.identification.kinds import (
    KNOWN_INPUT,
    OF_SPECTRA,
    OUTPUT_ONLY,
    FrfEstimator,
    GapWay,
    MethodWord,
    SpectraWindow,
)
from femtune.modal.kinds import FrfKind, Quantity, Role

# ----------------------------------------------------------------------------------------------------
# Tables of an identification file; docs/identify-file.md explains every key.


NodePath = Annotated[tuple[Annotated[int, Field(ge=1, le=2**31)], ...], Field(min_length=2)]
Rate = Annotated[float, Field(ge=1e-9, le=1e9)]
RecordName = Annotated[Text, NamesFile("record")]
FrfsName = Annotated[Text, NamesFile("file of FRFs")]
Axis = Literal["frequency", "response", "reference", "function", "part"]
"""Axes of an array of FRFs."""


class IdentifyTable(TomlTable):
    """[identify]: measurement and options of the identification."""

    title: Text | None = None
    """Title of the report. Default: the name of the file. Example: `"Building, state BC"`"""
    record: RecordName | Annotated[tuple[RecordName, ...], Field(min_length=1)] | None = None
    """Time histories: CSV and other text, UFF 58, .npy, .npz, .mat, HDF5 (`pip install "femtune[hdf5]"`), WAV, LVM,
    TDMS (`pip install "femtune[tdms]"`), MDF. With measured forces also several records of the same channels, such as
    the hits of a hammer. Example: `"bc.csv"`"""
    frfs: FrfsName | tuple[FrfsName, ...] | None = None
    """Instead of `record`: measured FRFs (motion over force): UFF 58, ASCII or binary, one or several files of one
    test; or arrays and tables with [`[functions]`](#functions): .mat, .npy, .npz, HDF5, CSV and other text. Example:
    `"frf.unv"`"""
    spectra: FrfsName | tuple[FrfsName, ...] | None = None
    """Instead of `record`: auto and cross spectra of responses to unmeasured forces, of all responses with at least one
    reference: UFF 58, or arrays and tables with [`[functions]`](#functions), in which `kind` is not given then. The
    cross spectrum of response i and reference j is the mean of Y_i times the conjugate of Y_j. Example: `"psd.unv"`"""
    spectra_window: SpectraWindow = "hann"
    """Window of the segments from which the spectra were averaged: `"hann"`, `"hamming"`, `"flattop"`, `"boxcar"`
    (rectangular); `"none"` for spectra of correlation functions. It adds damping, which is taken out. Example:
    `"boxcar"`"""
    geometry: Annotated[Text, NamesFile("geometry")] | None = None
    """Points and directions of the sensors: a Universal File, or a [table](guide/tests-in.md#tables-of-points) with the
    heading `node,x,y,z`. Default: those of the Universal File. Example: `"points.csv"`"""
    lines: Annotated[tuple[NodePath, ...], Field(max_length=100_000)] = ()
    """Trace lines between points, each a list of nodes. Example: `[[1, 2, 3], [3, 4]]`"""
    units: Units = "m-kg-s"
    """Units of length, mass and time, if a Universal File does not state them. Example: `"mm-t-s"`"""
    format: RecordFormatKey | None = None
    """Format of the record: `"text"`, `"numpy"`, `"matlab"`, `"hdf5"`, `"wav"`, `"lvm"`, `"tdms"`, `"mdf"` or `"uff"`.
    Default: from the extension. Example: `"text"`"""
    variable: Text | None = None
    """Name of the array in a file with several arrays, or of the group of channels in a file of a logger. Example:
    `"acc"`"""
    sampling_hz: Rate | None = None
    """Sampling frequency, if the file does not state it; if it does, both values must agree. Example: `200.0`"""
    band_hz: tuple[Hertz, Hertz] | None = None
    """Frequency band of the identification, Hz; required for time histories. Default for FRFs: all lines. Example:
    `[2.0, 22.0]`"""
    largest_order: Annotated[int, Field(ge=4, le=200)] | None = None
    """Largest order of the state-space models and polynomials, up to 200. Default: 60; of FRFs up to 120 where there
    are more modes than can be told from orders up to 60. Example: `40`"""
    methods: Annotated[tuple[MethodWord, ...], Field(min_length=1)] | None = None
    """For FRFs `"N4SID"` and `"pLSCF"`; for records without measured forces `"SSI-cov"`, `"SSI-data"`, `"ERA"`,
    `"FDD"`, `"TFIE"` and `"TFIE-magnitude"` (its published form). The first method gives the modes of a record without
    forces, the others are for comparison. Default: both methods for FRFs; otherwise `"SSI-cov"`, `"ERA"` and `"FDD"`.
    Example: `["SSI-cov", "FDD"]`"""
    estimator: FrfEstimator = "H1"
    """FRF estimator for records with measured forces: `"H1"` (noise on the responses), `"H2"` (noise on the force),
    `"Hv"` (noise on both). Example: `"Hv"`"""
    resolution_hz: Positive | None = None
    """Frequency resolution of the FRFs that are computed from a record with measured forces, Hz. Default: 400 lines in
    the band. Example: `0.05`"""
    period_s: Positive | None = None
    """Period of a periodic force, s: no window and no leakage; the standard deviations are computed from the variation
    between the periods. Example: `10.0`"""
    exponential_s: Positive | None = None
    """Time constant τ of an exponential window e^(−t/τ) on forces and responses, s. It is applied to the hits of a
    record; FRFs from a file were made with it elsewhere. The damping that it adds, 1/τ in rad/s, is subtracted from all
    poles. Example: `0.5`"""
    force_window_s: Positive | None = None
    """Length of the force window, s: after this time from the beginning of a hit the force is set to zero. Example:
    `0.01`"""
    fragments: Annotated[int, Field(ge=1, le=1000)] = 1
    """Number of fragments into which the record is divided; each method is applied to each fragment, and the result is
    their mean, with standard deviations. Example: `4`"""
    gaps: GapWay | None = None
    """What to do with a [record in which samples are missing](guide/identify.md#gaps): `"parts"`: it is cut at the
    gaps, and its parts are used as records of their own, except those shorter than a quarter of the longest one;
    `"longest"`: only the longest part is used. Default: gaps are an error. Example: `"parts"`"""
    real: bool = True
    """Real shapes; `false`: complex shapes, for FRFs. Example: `false`"""
    take_hz: tuple[Positive, ...] = ()
    """Clusters of stable poles that are accepted manually, Hz; the first method must have found them in at least one
    fragment. Example: `[7.8]`"""
    drop_hz: tuple[Positive, ...] = ()
    """Clusters of stable poles that are rejected manually, Hz. Example: `[7.8]`"""
    suspension_hz: Positive | None = None
    """Modes below this frequency are rigid-body motions on a suspension, Hz: they are fitted with the others, and are
    not among the results. Example: `4.0`"""
    choices: Annotated[Text, NamesFile("choice of poles")] | None = None
    """Poles that were picked in the stabilisation diagram of the report, and saved from there: they are the modes, in
    place of those that the rule chooses. Not with `take_hz`, `drop_hz`, `fragments` or `[[setup]]`. Example:
    `"choices.toml"`"""
    remove_hz: Annotated[tuple[Positive, ...], Field(max_length=100)] = ()
    """Lines of machines or of the mains that are subtracted from a record without measured forces before the
    identification, Hz, within 0.2 %. Example: `[11.0, 22.0]`"""


class ChannelEntry(TomlTable):
    """[[channel]]: DOF, quantity and role of one column of the record."""

    column: Annotated[int, Field(ge=1)] | Text
    """Column of the record: its number from 1 (a time column is not counted), or its name in the file. Example: `"acc
    top"`"""
    dof: DofLabel
    """Node, direction and sign. Example: `"11X+"`"""
    quantity: Quantity = "acceleration"
    """`"acceleration"`, `"displacement"`, `"velocity"`, `"force"`, `"strain"`, `"pressure"`, `"voltage"` or
    `"unknown"`; shapes of records with displacements, velocities and accelerations are [converted to one
    quantity](guide/identify.md). Example: `"velocity"`"""
    role: Role = "response"
    """`"response"`; `"reference"`: a response that all set-ups have in common, used as reference (past outputs);
    `"input"`: the excitation. Example: `"input"`"""
    unit: str = ""
    """Unit shown in tables; responses of different quantities must have the same unit of length. Example: `"m/s2"`"""
    factor: float = 1.0
    """Factor on the values. Example: `9.81`"""


Column = Annotated[int, Field(ge=1)] | Text


class SetupEntry(TomlTable):
    """[[setup]]: one of several measurements of the same structure with sensors at other places."""

    name: Text | None = None
    """Name of the set-up in messages. Default: its number. Example: `"roof"`"""
    record: RecordName | None = None
    """Time histories of this set-up; either this or `frfs`. Example: `"setup1.npy"`"""
    frfs: FrfsName | None = None
    """FRFs of this set-up; either this or `record`. Example: `"setup1.unv"`"""
    sampling_hz: Rate | None = None
    """Sampling frequency of this set-up, Hz. Default: that of `[identify]`. Example: `200.0`"""
    variable: Text | None = None
    """Name of the array of this set-up in a file with several arrays. Default: that of `[identify]`. Example:
    `"acc"`"""
    take_hz: tuple[Positive, ...] = ()
    """Clusters of stable poles of this set-up that are accepted manually, Hz; the first method must have found them in
    at least one fragment. Example: `[7.8]`"""
    drop_hz: tuple[Positive, ...] = ()
    """Clusters of stable poles of this set-up that are rejected manually, Hz. Example: `[7.8]`"""
    channel: tuple[ChannelEntry, ...] = ()
    """Quantities in the columns of the record of this set-up, as `[[channel]]`. Default: those of `[[channel]]`.
    Example: `[{ column = 1, dof = "11X+" }]`"""


class RigidBodyEntry(TomlTable):
    """[[rigid_body]]: sensors on a rigid body, such as a floor, that are reduced to its motions."""

    node: Annotated[int, Field(ge=1, le=2**31)]
    """Node of the body, with a place in the geometry: the motions are those of this point. Example: `101`"""
    sensors: Annotated[tuple[DofLabel, ...], Field(min_length=1)]
    """DOFs of channels on this body. Example: `["11X+", "12X+", "12Y+"]`"""
    motions: Annotated[str, Field(min_length=1, pattern="^1?2?3?4?5?6?$")] = "126"
    """Components of the motion in ascending order. Example: `"345"`"""


class FunctionsTable(TomlTable):
    """[functions]: what the axes of a file of FRFs or spectra mean; of a Universal File only `kind` and `factor`."""

    kind: FrfKind | None = None
    """`"receptance"`, `"mobility"` or `"accelerance"`. Required for FRFs, unless the file is a Universal File: there it
    replaces the data types and unit labels of the file. Example: `"accelerance"`"""
    responses: tuple[DofLabel, ...] = ()
    """Response DOFs in the order of the array. Required without `[[function]]`. Example: `["1Z+", "2Z+"]`"""
    references: tuple[DofLabel, ...] = ()
    """Reference DOFs in the order of the array. Required without `[[function]]`. Example: `["1Z+"]`"""
    axes: Annotated[tuple[Axis, ...], Field(max_length=4)] = ()
    """What the axes are: `"frequency"`, `"response"`, `"reference"`; `"function"`, if responses and references share
    one axis, with a `[[function]]` for each; `"part"` for an axis of length 2 with real and imaginary part. Default: by
    their lengths, if only one order fits. Example: `["frequency", "function"]`"""
    variable: Text | None = None
    """Name of the array, or of its real part. Default: the only (complex) array. Example: `"test.H"`"""
    imaginary: Text | None = None
    """Name of the array of imaginary parts. Example: `"Hi"`"""
    coherence: Text | None = None
    """Name of the array of the coherence, with the same axes. Example: `"coh"`"""
    frequency: Column | None = None
    """Array, or column of a table, with the frequency lines in Hz. Example: `"test.f"`"""
    start_hz: Hertz | None = None
    """First frequency line, Hz, instead of `frequency`. Default: 0. Example: `0.0`"""
    step_hz: Positive | None = None
    """Distance of the frequency lines, Hz, instead of `frequency`. Example: `0.25`"""
    factor: float = 1.0
    """Factor on the values, for example for responses in g; unit labels of a Universal File are not used then. Example:
    `9.80665`"""


class FunctionEntry(TomlTable):
    """[[function]]: DOFs of one function of a table, or along the axis "function" of an array."""

    file: FrfsName | None = None
    """File of the function, if each function has its own; then `frfs` may be left out. Default: the file in `frfs`, or
    the files in `frfs` in the order of the functions. Example: `"frf_3Z.csv"`"""
    column: Column
    """Column of the real part, number from 1 or name in the heading; position from 1 along the axis `"function"`, or
    the name of an array of this function. Example: `2`"""
    imaginary: Column | None = None
    """Column or array of the imaginary part. Example: `3`"""
    coherence: Column | None = None
    """Column or array of the coherence. Example: `"coh 1"`"""
    response: DofLabel
    """Response DOF of the function. Example: `"12Z-"`"""
    reference: DofLabel
    """Reference DOF of the function. Example: `"1Z+"`"""


class LevelEntry(TomlTable):
    """[[level]]: the same measurement at another level of the force."""

    record: RecordName | None = None
    """Time histories of this level, if `[identify]` has a `record`, with the same channels. Example:
    `"sweep_5N.csv"`"""
    frfs: FrfsName | None = None
    """FRFs of this level, if `[identify]` has `frfs`. Example: `"frf_5N.unv"`"""
    force: Positive
    """Level of the force, positive, in any unit; only the ratios of the levels are used. Example: `5.0`"""
    name: Text | None = None
    """Name shown in the report. Default: file and force. Example: `"5 N"`"""


class LinearityTable(TomlTable):
    """[linearity]: force of the measurement of [identify], and accepted differences between the levels."""

    force: Positive | None = None
    """Level of the force of the measurement in `[identify]`. Required with `[[level]]`. Example: `1.0`"""
    largest_frequency_change: Fraction = 0.005
    """Accepted relative change of a natural frequency between the levels. Example: `0.002`"""
    largest_damping_change: Positive = 0.2
    """Accepted relative change of a damping ratio. Example: `0.1`"""
    least_frac: Fraction = 0.9
    """Accepted FRAC of FRFs between the levels. Example: `0.95`"""


class IdentifyOutputTable(OutputTable):
    """[output] of an identification: the folder of what was identified."""

    folder: Text = "identified"
    """Output folder for `report.html`, `modes.uff` (for a study), `deviations.json` (their standard deviations, for the
    key `deviations` of a study), `modes.csv`, `poles.csv`, `identified.json` and, for FRFs, the state-space model
    `system.npz`. Example: `"bc_modes"`"""


class IdentifyFile(TomlTable):
    """The whole file; names of files are relative to it."""

    schema_version: SchemaVersion = 1
    """Version of the identification file, an integer before the first table. A file of a later version is refused.
    Example: `1`"""
    identify: IdentifyTable
    channel: tuple[ChannelEntry, ...] = ()
    setup: tuple[SetupEntry, ...] = ()
    rigid_body: tuple[RigidBodyEntry, ...] = ()
    functions: FunctionsTable | None = None
    function: tuple[FunctionEntry, ...] = ()
    level: tuple[LevelEntry, ...] = ()
    linearity: LinearityTable = Field(default_factory=LinearityTable)
    report: ReportTable = Field(default_factory=ReportTable)
    output: IdentifyOutputTable = Field(default_factory=IdentifyOutputTable)

    _path: Path = PrivateAttr(default=Path("identify.toml"))
    _source: StudyLines = PrivateAttr(default=StudyLines("identify.toml"))

    @model_validator(mode="before")
    @classmethod
    def _files_of_functions(cls, data: Any) -> Any:
        """Files that are named with their functions are the FRFs."""
        asked = data.get("identify") if isinstance(data, dict) else None
        entries = data.get("function") if isinstance(asked, dict) else None
        if not (isinstance(asked, dict) and isinstance(entries, list | tuple)) or {"frfs", "record", "spectra"} & set(
            asked
        ):
            return data
        files = [entry.get("file") for entry in entries if isinstance(entry, dict)]
        if not files or len(files) < len(entries) or not all(isinstance(file, str) for file in files):
            return data
        return {**data, "identify": {**asked, "frfs": tuple(dict.fromkeys(files))}}

    @property
    def path(self) -> Path:
        """The file itself."""
        return self._path

    @property
    def measured_path(self) -> Path:
        """The record or the functions; the first of several files."""
        return self.measured_paths[0]

    @property
    def measured_paths(self) -> tuple[Path, ...]:
        """The record, or all files of the functions."""
        asked = self.identify
        named = asked.record or asked.frfs or asked.spectra or tuple(s.record or s.frfs or "" for s in self.setup)
        return tuple(self._path.parent / name for name in ((named,) if isinstance(named, str) else named))

    @property
    def choices_path(self) -> Path | None:
        """The file of picked poles."""
        return None if self.identify.choices is None else self._path.parent / self.identify.choices

    @property
    def geometry_path(self) -> Path | None:
        """The file of the geometry."""
        return None if self.identify.geometry is None else self._path.parent / self.identify.geometry

    @property
    def output_folder(self) -> Path:
        """Where results go."""
        return self._path.parent / self.output.folder

    def where(self, *place: str | int) -> Where:
        """File and line of a key."""
        return self._source.where(place)


PAGE = "docs/identify-file.md"


def is_identification_file(path: str | Path) -> bool:
    """True for a path that names an identification file rather than what was measured."""
    return Path(path).suffix.lower() == ".toml"


def read_identify_file(path: str | Path) -> IdentifyFile:
    """The identification file at `path`.

    Raises
    ------
    FemtuneError : ``study.missing-file``, ``study.syntax``, ``study.version``
    FemtuneErrors : all that is wrong with its content: ``study.unknown-key``, ``study.type``, ``identify.source``,
        ``identify.output-only`` and others
    """
    file = Path(path)
    text = toml_text(file)
    data = toml_data(text, file)
    source = StudyLines(str(file), line_numbers(text), PAGE)
    check_version(data, source)
    # a file that is absent is told by its reader, which knows what it needs; a pipe would be waited for without end
    unfit = missing_files(IdentifyFile, data, source, file.parent, absent=False)
    errors = [*_rules(data, source), *unfit]
    try:
        settings = IdentifyFile.model_validate(data)
    except ValidationError as findings:
        errors = [*problems(findings, source, IdentifyFile), *errors]
    ErrorCollector(sorted(errors, key=lambda e: (e.where and e.where.line) or 0)).raise_if_any()
    settings._path, settings._source = file, source
    return settings


def _rules(data: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    asked = table(data, "identify")
    yield from _setups(data, asked, source)
    given = ("record" in asked) + ("spectra" in asked) + _has_frfs(data, asked)
    if "identify" in data and "setup" not in data and given != 1:
        hint = 'write record = "ambient.csv" or frfs = "frf.unv"'
        yield source.error(("identify",), "identify.source", {}, hint=hint)
    yield from _layout(data, asked, source)
    yield from _methods(data, asked, source)
    yield from _levels(data, source)
    others = [key for key in ("take_hz", "drop_hz", "fragments") if key in asked] + ["setup"] * ("setup" in data)
    if "choices" in asked and others:
        yield source.error(("identify", "choices"), "identify.choices/with-others", {"keys": ", ".join(others)})
    if falls(asked.get("band_hz")):
        shown = {"band_hz": asked["band_hz"]}
        yield source.error(("identify", "band_hz"), "study.value/empty-band", shown)


def _has_frfs(data: dict[str, Any], asked: dict[str, Any]) -> bool:
    """Whether FRFs are named: in [identify], or in every [[function]]."""
    entries = [entry for _, entry in tables(data, "function")]
    named = bool(entries) and all("file" in entry for entry in entries)
    return "frfs" in asked or (named and "spectra" not in asked)


def _setups(data: dict[str, Any], asked: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """Every set-up has a measurement of its own, and [identify] has none then."""
    for place, entry in tables(data, "setup"):
        if {"record", "frfs", "spectra"} & set(asked) or ("record" in entry) == ("frfs" in entry):
            yield source.error(place, "identify.setup-source", entry)
    if "setup" in data and "level" in data:
        yield source.error(("level",), "identify.setup-source/levels", {})


def _layout(data: dict[str, Any], asked: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """[functions] belongs to functions; its axes are named once, and the lines are given in one way."""
    stated = table(data, "functions")
    if ("functions" in data or "function" in data) and not (_has_frfs(data, asked) or "spectra" in asked):
        yield source.error(("functions",), "identify.layout", {})
    axes = texts(stated.get("axes"))
    if len(set(axes)) < len(axes) or (axes and "frequency" not in axes) or {"function", "response"} <= set(axes):
        yield source.error(("functions", "axes"), "identify.layout/axes", {"axes": ", ".join(axes)})
    if "frequency" in stated and ("start_hz" in stated or "step_hz" in stated):
        yield source.error(("functions", "frequency"), "identify.layout/lines", {})
    for key in ("frfs", "spectra"):
        if asked.get(key) == ():
            yield source.error(("identify", key), "identify.source", {}, hint=f'write {key} = "{key}.unv"')


def _levels(data: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """Levels are measured as the first one is, whose force is stated; without levels there is nothing to compare."""
    entries = list(tables(data, "level"))
    if entries and "spectra" in table(data, "identify"):
        yield source.error(("level",), "identify.level/spectra", {})
    kind = "frfs" if _has_frfs(data, table(data, "identify")) else "record"
    for place, entry in entries:
        if kind not in entry or ("record" in entry) == ("frfs" in entry):
            yield source.error(place, "identify.level", entry, key=kind)
    if entries and "force" not in table(data, "linearity"):
        yield source.error(entries[0][0], "identify.level/first-force", {})
    if not entries and "linearity" in data:
        yield source.error(("linearity",), "identify.level/none", {})


def _methods(data: dict[str, Any], asked: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """Methods must suit what was measured; with measured forces in a record those for FRFs do too."""
    if "spectra" in asked:
        for word in texts(asked.get("methods")):
            if word not in OF_SPECTRA and word in (*KNOWN_INPUT, *OUTPUT_ONLY):
                known_words, shown = ", ".join(OF_SPECTRA), {"methods": word}
                place = ("identify", "methods")
                yield source.error(place, "identify.output-only/spectra", shown, method=word, known=known_words)
        return
    known = KNOWN_INPUT if _has_frfs(data, asked) else (*KNOWN_INPUT, *OUTPUT_ONLY)
    for word in texts(asked.get("methods")):
        if word not in known and word in OUTPUT_ONLY:
            yield source.error(
                ("identify", "methods"),
                "identify.output-only/functions",
                {"methods": word},
                method=word,
                known=", ".join(known),
            )
