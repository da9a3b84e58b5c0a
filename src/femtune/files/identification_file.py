"""Read an identification file; all problems at once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, ValidationError

from femtune.errors import ErrorCollector, FemtuneError, Where
from femtune.files.formats import RecordFormatKey
from femtune.files.study_file.kinds import DofLabel, NamesFile, Positive, SchemaVersion, Text, TomlTable, Units
from femtune.files.study_file.problems import problems
from femtune.files.study_file.reading import check_version, missing_files, toml_data, toml_text
from femtune.files.study_file.source import StudyLines, falls, line_numbers, table, tables, texts
from femtune.files.study_file.step_tables import OutputTable
from femtune.identification.kinds import KNOWN_INPUT, OUTPUT_ONLY, FrfEstimator, MethodWord

# ----------------------------------------------------------------------------------------------------
# Tables of an identification file; docs/identify-file.md explains every key.


NodePath = Annotated[tuple[Annotated[int, Field(ge=1, le=2**31)], ...], Field(min_length=2)]
Hertz = Annotated[float, Field(ge=0, le=1e12)]
RecordName = Annotated[Text, NamesFile("record")]
FrfsName = Annotated[Text, NamesFile("file of FRFs")]


class IdentifyTable(TomlTable):
    """[identify]: measurement and options of the identification."""

    title: Text | None = None
    record: RecordName | None = None
    frfs: FrfsName | tuple[FrfsName, ...] | None = None
    geometry: Annotated[Text, NamesFile("geometry")] | None = None
    lines: Annotated[tuple[NodePath, ...], Field(max_length=100_000)] = ()
    units: Units = "m-kg-s"
    format: RecordFormatKey | None = None
    variable: Text | None = None
    sampling_hz: Positive | None = None
    band_hz: tuple[Hertz, Hertz] | None = None
    largest_order: Annotated[int, Field(ge=4, le=200)] | None = None
    methods: Annotated[tuple[MethodWord, ...], Field(min_length=1)] | None = None
    estimator: FrfEstimator = "H1"
    resolution_hz: Positive | None = None
    period_s: Positive | None = None
    fragments: Annotated[int, Field(ge=1, le=1000)] = 1
    real: bool = True
    take_hz: tuple[Positive, ...] = ()
    drop_hz: tuple[Positive, ...] = ()


class ChannelEntry(TomlTable):
    """[[channel]]: DOF, quantity and role of one column of the record."""

    column: Annotated[int, Field(ge=1)] | Text
    dof: DofLabel
    quantity: Literal[
        "displacement", "velocity", "acceleration", "force", "strain", "pressure", "voltage", "unknown"
    ] = "acceleration"
    role: Literal["response", "reference", "input"] = "response"
    unit: str = ""
    factor: float = 1.0


Column = Annotated[int, Field(ge=1)] | Text
Axis = Literal["frequency", "response", "reference", "function", "part"]


class SetupEntry(TomlTable):
    """[[setup]]: one of several measurements of the same structure with sensors at other places."""

    name: Text | None = None
    record: RecordName | None = None
    frfs: FrfsName | None = None
    sampling_hz: Positive | None = None
    variable: Text | None = None
    take_hz: tuple[Positive, ...] = ()
    drop_hz: tuple[Positive, ...] = ()
    channel: tuple[ChannelEntry, ...] = ()


class RigidBodyEntry(TomlTable):
    """[[rigid_body]]: sensors on a rigid body, such as a floor, that are reduced to its motions."""

    node: Annotated[int, Field(ge=1, le=2**31)]
    sensors: Annotated[tuple[DofLabel, ...], Field(min_length=1)]
    motions: Annotated[str, Field(min_length=1, pattern="^1?2?3?4?5?6?$")] = "126"


class FunctionsTable(TomlTable):
    """[functions]: what the axes of a file of FRFs mean, if it is not a Universal File."""

    kind: Literal["receptance", "mobility", "accelerance"]
    responses: tuple[DofLabel, ...] = ()
    references: tuple[DofLabel, ...] = ()
    axes: Annotated[tuple[Axis, ...], Field(max_length=4)] = ()
    variable: Text | None = None
    imaginary: Text | None = None
    coherence: Text | None = None
    frequency: Column | None = None
    start_hz: Hertz | None = None
    step_hz: Positive | None = None
    factor: float = 1.0


class FunctionEntry(TomlTable):
    """[[function]]: DOFs of one function of a table, or along the axis "function" of an array."""

    column: Column
    imaginary: Column | None = None
    coherence: Column | None = None
    response: DofLabel
    reference: DofLabel


class LevelEntry(TomlTable):
    """[[level]]: the same measurement at another level of the force."""

    record: RecordName | None = None
    frfs: FrfsName | None = None
    force: Positive
    name: Text | None = None


class LinearityTable(TomlTable):
    """[linearity]: force of the measurement of [identify], and accepted differences between the levels."""

    force: Positive | None = None
    largest_frequency_change: Annotated[float, Field(gt=0, lt=1)] = 0.005
    largest_damping_change: Positive = 0.2
    least_frac: Annotated[float, Field(gt=0, lt=1)] = 0.9


class IdentifyFile(TomlTable):
    """The whole file; names of files are relative to it."""

    schema_version: SchemaVersion = 1
    identify: IdentifyTable
    channel: tuple[ChannelEntry, ...] = ()
    setup: tuple[SetupEntry, ...] = ()
    rigid_body: tuple[RigidBodyEntry, ...] = ()
    functions: FunctionsTable | None = None
    function: tuple[FunctionEntry, ...] = ()
    level: tuple[LevelEntry, ...] = ()
    linearity: LinearityTable = Field(default_factory=LinearityTable)
    output: OutputTable = Field(default_factory=lambda: OutputTable(folder="identified"))

    _path: Path = PrivateAttr(default=Path("identify.toml"))
    _source: StudyLines = PrivateAttr(default=StudyLines("identify.toml"))

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
        named = self.identify.record or self.identify.frfs or tuple(s.record or s.frfs or "" for s in self.setup)
        return tuple(self._path.parent / name for name in ((named,) if isinstance(named, str) else named))

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
        found = IdentifyFile.model_validate(data)
    except ValidationError as findings:
        errors = [*problems(findings, source, IdentifyFile), *errors]
    ErrorCollector(sorted(errors, key=lambda e: (e.where and e.where.line) or 0)).raise_if_any()
    found._path, found._source = file, source
    return found


def _rules(data: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    asked = table(data, "identify")
    yield from _setups(data, asked, source)
    if "identify" in data and "setup" not in data and ("record" in asked) == ("frfs" in asked):
        hint = 'write record = "ambient.csv" or frfs = "frf.unv"'
        yield source.error(("identify",), "identify.source", {}, hint=hint)
    yield from _layout(data, asked, source)
    yield from _methods(asked, source)
    yield from _levels(data, source)
    if falls(asked.get("band_hz")):
        shown = {"band_hz": asked["band_hz"]}
        yield source.error(("identify", "band_hz"), "study.value/empty-band", shown)


def _setups(data: dict[str, Any], asked: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """Every set-up has a measurement of its own, and [identify] has none then."""
    for place, entry in tables(data, "setup"):
        if "record" in asked or "frfs" in asked or ("record" in entry) == ("frfs" in entry):
            yield source.error(place, "identify.setup-source", entry)
    if "setup" in data and "level" in data:
        yield source.error(("level",), "identify.setup-source/levels", {})


def _layout(data: dict[str, Any], asked: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """[functions] belongs to functions; its axes are named once, and the lines are given in one way."""
    stated = table(data, "functions")
    if ("functions" in data or "function" in data) and "frfs" not in asked:
        yield source.error(("functions",), "identify.layout", {})
    axes = texts(stated.get("axes"))
    if len(set(axes)) < len(axes) or (axes and "frequency" not in axes) or {"function", "response"} <= set(axes):
        yield source.error(("functions", "axes"), "identify.layout/axes", {"axes": ", ".join(axes)})
    if "frequency" in stated and ("start_hz" in stated or "step_hz" in stated):
        yield source.error(("functions", "frequency"), "identify.layout/lines", {})
    if asked.get("frfs") == ():
        yield source.error(("identify", "frfs"), "identify.source", {}, hint='write frfs = "frf.unv"')


def _levels(data: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """Levels are measured as the first one is, whose force is stated; without levels there is nothing to compare."""
    entries = list(tables(data, "level"))
    kind = "frfs" if "frfs" in table(data, "identify") else "record"
    for place, entry in entries:
        if kind not in entry or ("record" in entry) == ("frfs" in entry):
            yield source.error(place, "identify.level", entry, key=kind)
    if entries and "force" not in table(data, "linearity"):
        yield source.error(entries[0][0], "identify.level/first-force", {})
    if not entries and "linearity" in data:
        yield source.error(("linearity",), "identify.level/none", {})


def _methods(asked: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """Methods must suit what was measured; with measured forces in a record those for FRFs do too."""
    known = KNOWN_INPUT if "frfs" in asked else (*KNOWN_INPUT, *OUTPUT_ONLY)
    for word in texts(asked.get("methods")):
        if word not in known and word in OUTPUT_ONLY:
            yield source.error(
                ("identify", "methods"),
                "identify.output-only/functions",
                {"methods": word},
                method=word,
                known=", ".join(known),
            )
