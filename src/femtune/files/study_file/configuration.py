"""[[configuration]] and [test]: configurations of the structure and their tests."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from femtune.files.formats import ModesFormatKey
from femtune.files.study_file.kinds import (
    Command,
    DeckName,
    DofLabel,
    ElementsOff,
    Hertz,
    Inertia,
    NamesFile,
    NotNegative,
    Number,
    Positive,
    PositiveVector,
    Rotation,
    RunsName,
    SolverFileName,
    SolverResultName,
    SpecimenName,
    Support,
    TemplateName,
    TestName,
    Text,
    TomlTable,
    Units,
    Vector,
    off_list,
    support,
)
from femtune.model.kinds import BASELINE

UNCHANGED: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""Rotation of a test whose axes are those of the model."""


class MassEntry(TomlTable):
    """A mass that the configuration adds to a grid point."""

    node: Number
    """Grid point of the mass. Example: `11`"""
    mass: NotNegative
    """Mass, zero or positive (not scaled by PARAM WTMASS). Example: `0.35`"""
    offset: Vector = (0.0, 0.0, 0.0)
    """Vector from the grid point to the centre of gravity, basic coordinate system, length. Example: `[0, 0, 0.1]`"""
    inertia: Inertia = (0.0, 0.0, 0.0)
    """Moments of inertia about the centre of gravity, basic coordinate system, mass·length²: Ixx, Iyy, Izz, or the
    symmetric 3 × 3 matrix. Example: `[0.1, 0.1, 0.2]`"""
    label: str = ""
    """Description of the mass. Example: `"sensor"`"""

    @property
    def inertia_matrix(self) -> tuple[Vector, ...]:
        """(3, 3) about the centre of gravity, basic coordinate system."""
        rows = [row if isinstance(row, tuple) else (row, row, row) for row in self.inertia]
        diagonal = not isinstance(self.inertia[0], tuple)
        matrix = [[float(x) * (i == j or not diagonal) for j, x in enumerate(row)] for i, row in enumerate(rows)]
        return tuple((row[0], row[1], row[2]) for row in matrix)


class LeaveOutEntry(TomlTable):
    """A test mode that is left out, given by its label or its frequency, with the reason."""

    mode: Text | None = None
    """Label of the test mode. Give either `mode` or `hz`. Example: `"4a"`"""
    hz: Positive | None = None
    """Frequency of the test mode, Hz, instead of `mode`. Example: `9.39`"""
    reason: Text
    """The reason; listed in the report. Example: `"mode of the braces"`"""


class PairEntry(TomlTable):
    """A prescribed mode pair: label of the test mode, number of the model mode from 1."""

    test: Text
    """Label of the test mode. Example: `"1"`"""
    model: Annotated[int, Field(ge=1)]
    """Number of the model mode, from 1. Example: `1`"""
    model_hz: Hertz | None = None
    """Frequency of that mode at the initial values, Hz: the study is refused (`correlate.renumbered`) if the mode with
    this number has another one, because it may be another mode. Default: not checked. Example: `9.39`"""


class TestKeys(TomlTable):
    """How a test is read and compared."""

    __test__ = False

    records: Text | None = None
    """Only the data sets 55 whose ID lines contain this word. Default: all. Example: `"BC"`"""
    deviations: Annotated[Text, NamesFile("table of standard deviations")] | None = None
    """File of standard deviations of the modes: a [table](guide/tests-in.md#tables-of-standard-deviations), or the file
    that `femtune identify` writes beside them; must be of the same modes. Example: `"identified/deviations.json"`"""
    mode_labels: tuple[Text, ...] | None = None
    """Labels of the test modes, in their order. Default: "1", "2", …. Example: `["1", "2", "4a"]`"""
    rotation: Rotation = UNCHANGED
    """Rotates test axes to model axes: x_model = rotation · x_test + origin; dimensionless. Example:
    `[[0,-1,0],[1,0,0],[0,0,1]]`"""
    origin: Vector = (0.0, 0.0, 0.0)
    """Position of the origin of the test in the model's coordinate system, length. Example: `[0.0, 0.0, 0.5]`"""
    left_handed: bool = False
    """The axes of the test are left-handed: `rotation` has the determinant −1. Example: `true`"""
    coordinate_factor: Positive = 1.0
    """Factor on the coordinates of the test, where its file states a wrong unit for them; dimensionless; shapes are not
    changed. Example: `0.001`"""
    leave_out: tuple[LeaveOutEntry, ...] = ()
    """Test modes that are excluded from the comparison, each with the reason; they are still listed in the report.
    Example: `[{ mode = "4a", reason = "braces" }]`"""
    pairs: tuple[PairEntry, ...] = ()
    """Prescribed mode pairs: the label of the test mode and the number of the model mode. Example: `[{ test = "1",
    model = 1 }]`"""
    never_pairs: tuple[PairEntry, ...] = ()
    """Mode pairs that are not made, whatever their MAC is. Example: `[{ test = "3", model = 4 }]`"""
    sensors_off: tuple[DofLabel, ...] = ()
    """Degrees of freedom of the test modes that are not compared, such as those of a faulty channel; they are still
    listed in the report. Example: `["12X+"]`"""


MEASURED = "freq_hz of [test]"
"""Name of the test that consists of the frequencies in the study."""


class SingleTest(TestKeys):
    """[test]: the only test of a study without [[configuration]]; a file, or frequencies without shapes."""

    file: TestName | Annotated[tuple[TestName, ...], Field(min_length=1)] | None = None
    """The test: a Universal File, a list of several for one test, a [table of mode
    shapes](guide/tests-in.md#tables-of-mode-shapes) or [of
    frequencies](guide/tests-in.md#frequencies-without-shapes), or an identification file that [describes
    FRFs](guide/tests-in.md).
    Required without `freq_hz`. Example: `"frame.uff"`"""
    freq_hz: Annotated[tuple[Positive, ...], Field(max_length=1000)] = ()
    """Measured frequencies [without shapes](guide/tests-in.md#frequencies-without-shapes), Hz, instead of `file`; they
    are paired in ascending order, or by `pairs`. For a model of [runs](#runs) or of a [solver](#solver) without shapes
    they are in the order of the columns of the table. Example: `[43.1, 60.2]`"""
    freq_sd_hz: Annotated[tuple[Positive, ...], Field(max_length=1000)] = ()
    """Standard deviations of `freq_hz`, Hz, one for each. Default: unknown. Example: `[0.1, 0.15]`"""
    units: Units | None = None
    """Units of the test; only if the file does not state them. Example: `"mm-kg-s"`"""


class ConfigurationSolver(TomlTable):
    """What the solver of a configuration has of its own, in place of the keys of [solver] and of the deck."""

    command: Command | None = None
    """Program and arguments, as a list or a line. Default: `command` of `[solver]`. Example: `"ccx bolted"`"""
    deck: DeckName | None = None
    """Deck of this configuration. Default: `deck` of `[study]`. Example: `"bolted.bdf"`"""
    templates: tuple[TemplateName, ...] | None = None
    """Input files with placeholders. Default: `templates` of `[solver]`. Example: `["bolted.inp"]`"""
    files: tuple[SolverFileName, ...] | None = None
    """Further files that are copied into the folder of each run. Default: `files` of `[solver]`. Example:
    `["mesh.inc"]`"""
    result: SolverResultName | None = None
    """The file that is read. Default: `result` of `[solver]`. Example: `"bolted.frd"`"""
    format: ModesFormatKey | None = None
    """Format of the file that is read. Default: `format` of `[solver]`. Example: `"calculix-frd"`"""
    mass: Positive | None = None
    """Mass that the output must state. Default: `mass` of `[solver]`. Example: `12.5`"""


class ConfigurationEntry(TestKeys):
    """[[configuration]]: changes of the deck, and the test of this configuration."""

    name: Text
    """Name of the configuration, unique. Example: `"BC"`"""
    specimen: SpecimenName | None = None
    """Name of the [specimen](guide/specimens.md), where nominally identical structures were tested: letters, digits and
    `_`; either all configurations have it or none has. Example: `"ID1"`"""
    test: TestName | Annotated[tuple[TestName, ...], Field(min_length=1)] | None = None
    """The test: a Universal File, a list of several for one test, a [table of mode
    shapes](guide/tests-in.md#tables-of-mode-shapes) or [of
    frequencies](guide/tests-in.md#frequencies-without-shapes), or an identification file that [describes
    FRFs](guide/tests-in.md).
    Default: only modes are computed. Example: `"building.uff"`"""
    test_units: Units | None = None
    """Units of the test; only if the file does not state them. Example: `"mm-kg-s"`"""
    elements_off: ElementsOff = ()
    """Elements that are absent in this configuration: a text with THRU, BY and EXCEPT, or a list. Example: `"201 THRU
    208, 301"`"""
    components: Annotated[tuple[Text, ...], Field(min_length=1)] | None = None
    """Only these [components](#component) are present; all others are absent, and so are elements of no component that
    act on absent components. Elements and rigid elements of no component are present if they act on these components
    only. Example: `["front"]`"""
    interface: Literal["free", "fixed"] = "free"
    """With `components`: the grid points where absent elements were connected are `"free"`, or `"fixed"`. Example:
    `"fixed"`"""
    spc: Number | None = None
    """Active SPC set. Default: the selection of the deck. Example: `1`"""
    mpc: Number | None = None
    """Active MPC set. Default: the selection of the deck. Example: `2`"""
    supports_added: tuple[Support, ...] = ()
    """Additional constraints, nodes : components (1 to 6; 0 for a scalar point). Example: `["12:123", "13 THRU
    15:3"]`"""
    supports_removed: tuple[Support, ...] = ()
    """Constraints of the deck that are removed in this configuration. Example: `["1:6"]`"""
    masses: tuple[MassEntry, ...] = ()
    """Masses added in this configuration, each with its grid point. Example: `[{ node = 11, mass = 0.35 }]`"""
    masses_file: Annotated[Text, NamesFile("table of masses")] | None = None
    """[Table of small masses](guide/tests-in.md#masses-of-sensors) such as sensors and stingers, added as well; their
    effect on each mode is stated. Example: `"sensors.csv"`"""
    weighed_mass: Positive | None = None
    """Measured mass of this configuration, in units of the study; compared with the mass of the model. Example:
    `7500.0`"""
    weighed_centre: Vector | None = None
    """Measured centre of gravity of this configuration, in the basic system and in units of the study; compared with
    that of the model. Example: `[0.25, 0.4, 0.0]`"""
    weighed_inertia: PositiveVector | None = None
    """Measured moments of inertia of this configuration about the axes through its centre of gravity that are parallel
    to the basic ones, in units of the study; compared with those of the model. Example: `[1.2, 3.4, 4.5]`"""
    use: Literal["update", "validation"] = "update"
    """`"update"`, or `"validation"`: correlated, but not used in the update. Example: `"validation"`"""
    runs: RunsName | None = None
    """For a model of [runs](#runs): the table of this configuration, instead of `file` of `[runs]`. Example:
    `"bolted.csv"`"""
    solver: ConfigurationSolver | None = None
    """For a model of a [solver](#solver): what this configuration has of its own, instead of the same keys of
    `[solver]`: `command`, `templates`, `files`, `result`, `format`, `mass`; and `deck`, instead of that of `[study]`.
    Example: `{ templates = ["bolted.inp"] }`"""


def test_files(entry: ConfigurationEntry) -> tuple[str, ...]:
    """Names of the files of the test of a configuration."""
    return (entry.test,) if isinstance(entry.test, str) else entry.test or ()


def switched_off(entry: ConfigurationEntry) -> frozenset[int]:
    """Numbers of the elements that are absent in the configuration."""
    return off_list(entry.elements_off)


def supports(texts: tuple[str, ...]) -> tuple[tuple[int, str], ...]:
    """(node, components) pairs of a list of supports."""
    return tuple(pair for text in texts for pair in support(text))


def only_configuration(test: SingleTest | None) -> ConfigurationEntry:
    """The configuration of a study without [[configuration]]: the structure of the deck."""
    if test is None:
        return ConfigurationEntry(name=BASELINE)
    shared = {key: getattr(test, key) for key in TestKeys.model_fields}
    return ConfigurationEntry(name=BASELINE, test=test.file or MEASURED, test_units=test.units, **shared)
