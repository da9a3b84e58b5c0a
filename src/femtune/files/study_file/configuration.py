"""[[configuration]] and [test]: configurations of the structure and their tests."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from femtune.files.formats import ModesFormatKey
from femtune.files.study_file.kinds import (
    Command,
    DeckName,
    ElementsOff,
    Inertia,
    NamesFile,
    NotNegative,
    Number,
    Positive,
    Rotation,
    RunsName,
    SolverFileName,
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

UNCHANGED: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class MassEntry(TomlTable):
    """A mass that the configuration adds to a grid point."""

    node: Number
    mass: NotNegative
    offset: Vector = (0.0, 0.0, 0.0)
    inertia: Inertia = (0.0, 0.0, 0.0)
    label: str = ""

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
    hz: Positive | None = None
    reason: Text


class PairEntry(TomlTable):
    """A prescribed mode pair: label of the test mode, number of the model mode from 1."""

    test: Text
    model: Annotated[int, Field(ge=1)]


class TestKeys(TomlTable):
    """How a test is read and compared."""

    __test__ = False

    records: Text | None = None
    deviations: Annotated[Text, NamesFile("table of standard deviations")] | None = None
    mode_labels: tuple[Text, ...] | None = None
    rotation: Rotation = UNCHANGED
    origin: Vector = (0.0, 0.0, 0.0)
    leave_out: tuple[LeaveOutEntry, ...] = ()
    pairs: tuple[PairEntry, ...] = ()


MEASURED = "freq_hz of [test]"
"""Name of the test that consists of the frequencies in the study."""


class SingleTest(TestKeys):
    """[test]: the only test of a study without [[configuration]]; a file, or frequencies without shapes."""

    file: TestName | Annotated[tuple[TestName, ...], Field(min_length=1)] | None = None
    freq_hz: Annotated[tuple[Positive, ...], Field(max_length=1000)] = ()
    units: Units | None = None


class ConfigurationSolver(TomlTable):
    """What the solver of a configuration has of its own, in place of the keys of [solver] and of the deck."""

    command: Command | None = None
    deck: DeckName | None = None
    templates: tuple[TemplateName, ...] | None = None
    files: tuple[SolverFileName, ...] | None = None
    result: Text | None = None
    format: ModesFormatKey | None = None
    mass: Positive | None = None


class ConfigurationEntry(TestKeys):
    """[[configuration]]: changes of the deck, and the test of this configuration."""

    name: Text
    specimen: SpecimenName | None = None
    test: TestName | Annotated[tuple[TestName, ...], Field(min_length=1)] | None = None
    test_units: Units | None = None
    elements_off: ElementsOff = ()
    components: Annotated[tuple[Text, ...], Field(min_length=1)] | None = None
    interface: Literal["free", "fixed"] = "free"
    spc: Number | None = None
    mpc: Number | None = None
    supports_added: tuple[Support, ...] = ()
    supports_removed: tuple[Support, ...] = ()
    masses: tuple[MassEntry, ...] = ()
    masses_file: Annotated[Text, NamesFile("table of masses")] | None = None
    weighed_mass: Positive | None = None
    use: Literal["update", "validation"] = "update"
    runs: RunsName | None = None
    solver: ConfigurationSolver | None = None


def test_files(entry: ConfigurationEntry) -> tuple[str, ...]:
    """Names of the files of the test of a configuration."""
    return (entry.test,) if isinstance(entry.test, str) else entry.test or ()


def switched_off(entry: ConfigurationEntry) -> frozenset[int]:
    """Numbers of the elements that are absent in the configuration."""
    return off_list(entry.elements_off)


def supports(texts: tuple[str, ...]) -> tuple[tuple[int, str], ...]:
    """(node, components) pairs of a list of supports."""
    return tuple(pair for text in texts for pair in support(text))


def only_configuration(test: SingleTest | None, name: str) -> ConfigurationEntry:
    """The configuration of a study without [[configuration]]: the structure of the deck."""
    if test is None:
        return ConfigurationEntry(name=name)
    shared = {name: getattr(test, name) for name in TestKeys.model_fields}
    return ConfigurationEntry(name=name, test=test.file or MEASURED, test_units=test.units, **shared)
