"""[[residual]]: one comparison in one configuration; the key `kind` says which, docs/study-file.md the other keys.

A further kind is a table here with its name in `ResidualEntry`, and the class of that key in `femtune.residuals`. The
tables stand apart from the classes so that a study is checked without the numerical packages.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal, get_args

from pydantic import BeforeValidator, Field

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.kinds import (
    ByNode,
    Covariance,
    DofLabel,
    FrequencySd,
    NotNegative,
    Positive,
    Text,
    TomlTable,
    Vector,
    numbered,
)
from femtune.files.study_file.response import Hertz, HertzAboveZero, Labels, Ratio
from femtune.files.study_file.source import Place, StudyLines, number, table, tables, texts
from femtune.files.study_file.specimens import specimens_of
from femtune.residuals.kinds import FrequencyForm, FrfForm, FrfMethodWord, MacForm, Scatter, ShapeScaling

Data = dict[str, Any]
Problems = Iterator[FemtuneError]


@dataclass(frozen=True)
class Breach:
    """A rule between the keys of a table that is broken: at which key ("" for the table), and what to do."""

    key: str
    code: str
    values: Data = field(default_factory=dict)
    facts: Data = field(default_factory=dict)


class ResidualTable(TomlTable):
    """What all kinds have: the configuration, which a study of several must name.

    `covariance_of_test` is True for kinds whose covariance a test may give; `sd_of_test` for those that take the
    standard deviations of the test where neither `sd` nor `covariance` is stated.
    """

    covariance_of_test: ClassVar[bool] = False
    sd_of_test: ClassVar[bool] = False

    configuration: Text | Annotated[tuple[Text, ...], Field(min_length=1)] | None = None

    def is_in(self, configuration: str, several: bool, used: bool) -> bool:
        """Whether it is compared in a configuration; without `configuration` in the only one, or, of a study of
        specimens (`several`), in all that the update uses."""
        if self.configuration is None:
            return used or not several
        return configuration in ((self.configuration,) if isinstance(self.configuration, str) else self.configuration)

    @property
    def is_of_test(self) -> bool:
        """Whether the standard deviations are those of the test."""
        sd, covariance = getattr(self, "sd", None), getattr(self, "covariance", None)
        return "test" in (sd, covariance) or (self.sd_of_test and sd is None and covariance is None)

    @classmethod
    def breaches(cls, given: Data) -> Iterator[Breach]:
        """Rules between the keys of a table, for plain data; wrong types are reported by the model."""
        both = [key for key in ("sd", "covariance") if key in given]
        if "covariance" in cls.model_fields and len(both) != 1 and (both or not cls.sd_of_test):
            code = "residual.weights/both" if both else "residual.weights/neither"
            yield Breach("".join(both[-1:]), code)
        if given.get("covariance") == "test" and not cls.covariance_of_test:
            yield Breach("covariance", "residual.weights/not-of-test")
        if number(given, "sd") == 0:
            yield Breach("sd", "residual.zero-variance/standard-deviation", {"sd": given["sd"]})


# ----------------------------------------------------------------------------------------------------
# [[residual]] of measured FRFs: the functions themselves, and their antiresonances.


class MeasuredFunctionsTable(ResidualTable):
    """Some of the test's functions in a band, and the modes that the model's are made of."""

    outputs: Labels | None = None
    inputs: Labels | None = None
    from_hz: Hertz = 0.0
    to_hz: HertzAboveZero | None = None
    count: Annotated[int, Field(ge=1, le=100_000)] | None = None
    max_hz: HertzAboveZero | None = None

    @classmethod
    def breaches(cls, given: Data) -> Iterator[Breach]:
        """The band rises, and of keys that exclude each other one is given."""
        yield from super().breaches(given)
        low, high = number(given, "from_hz") or 0.0, number(given, "to_hz")
        if high is not None and low >= high:
            yield Breach("to_hz", "study.response-lines/band", {"from_hz": low, "to_hz": high})
        if "count" in given and "max_hz" in given:
            yield Breach("max_hz", "study.modes/residual")
        if "ratio" in given and "ratios" in given:
            yield Breach("ratios", "study.response-ratios/residual")


_AROUND_RESONANCES = ("modes", "bandwidths", "lines", "aligned", "region_ratio")


class FrfResidualEntry(MeasuredFunctionsTable):
    """FRFs, line by line."""

    kind: Literal["frf"]
    modes: Annotated[tuple[Text, ...], Field(min_length=1)] | None = None
    form: FrfForm = "log-complex"
    around: Literal["band", "resonances"] = "band"
    most: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    bandwidths: Positive = 2.0
    lines: Annotated[int, Field(ge=1, le=1000)] = 3
    aligned: bool = False
    region_ratio: Annotated[float, Field(gt=0, lt=1)] | None = None
    sd: NotNegative | None = None
    floor: NotNegative = 0.0
    averages: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    output_sd: Annotated[dict[DofLabel, Positive], Field(min_length=1)] | None = None
    angle_sd_deg: Annotated[ByNode, BeforeValidator(numbered)] = 0.0
    method: FrfMethodWord = "real modes"
    residual_vectors: bool = True
    ratio: Ratio | None = None
    ratios: Annotated[tuple[Ratio, ...], Field(min_length=1)] | None = None
    leave_out_modes_hz: tuple[HertzAboveZero, ...] = ()

    @classmethod
    def breaches(cls, given: Data) -> Iterator[Breach]:
        """Keys of a band and keys of resonances exclude each other."""
        yield from super().breaches(given)
        around = given.get("around", "band")
        resonances = around == "resonances"
        for key in ("from_hz", "to_hz", "most") if resonances else _AROUND_RESONANCES:
            if key in given:
                code = "study.residual-lines" if resonances else "study.residual-lines/band"
                yield Breach(key, code, {"around": around}, {"key": key})
        if given.get("leave_out_modes_hz") and given.get("method", "real modes") != "real modes":
            yield Breach("method", "study.left-out-modes", {"method": given["method"]}, {"method": given["method"]})


class AntiresonanceResidualEntry(MeasuredFunctionsTable):
    """Antiresonances; "test" takes the standard deviation of each fit."""

    kind: Literal["antiresonance"]
    sd: FrequencySd = 0.01
    frequency_gate: Annotated[float, Field(gt=0, le=1)] = 0.30
    mac_gate: Annotated[float, Field(ge=0, le=1)] = 0.50
    depth: Annotated[float, Field(gt=0, lt=1)] = 0.5
    half_width: Annotated[int, Field(ge=2, le=1000)] = 4
    most_damping: Annotated[float, Field(gt=0, lt=1)] = 0.05
    above_noise: Annotated[float, Field(ge=0, le=1e6)] = 8.0


ModeLabels = Annotated[tuple[Text, ...], Field(min_length=1)]
Sensors = Annotated[tuple[DofLabel, ...], Field(min_length=1)]
Displacements = Annotated[dict[DofLabel, float], Field(min_length=1)]


class OfModesTable(ResidualTable):
    """Of modes: all of the test that are not left out, or those of some labels."""

    modes: ModeLabels | None = None


class FrequencyResidualEntry(OfModesTable):
    """Frequencies, relative, or eigenvalues; `covariance` is in Hz², of all modes of the test."""

    covariance_of_test = True

    kind: Literal["frequency"]
    form: FrequencyForm = "frequency"
    sd: FrequencySd | None = None
    covariance: Covariance | None = None

    @property
    def sd_of_frequency(self) -> float | None:
        """Relative standard deviation of a frequency; None where the table does not state one number."""
        if isinstance(self.sd, str) or self.sd is None:
            return None
        # a relative error of λ = ω² is twice that of the frequency
        return self.sd / (2.0 if self.form == "eigenvalue" else 1.0)


class ComplexEigenvalueResidualEntry(OfModesTable):
    """Poles; `covariance` is of the frequencies in Hz and, after them, the damping ratios of all modes of the test."""

    covariance_of_test = True

    kind: Literal["complex-eigenvalue"]
    sd: FrequencySd | None = None
    covariance: Covariance | None = None


class DampingResidualEntry(OfModesTable):
    """Damping ratios, relative; `covariance` is of those of all modes of the test."""

    covariance_of_test = True

    kind: Literal["damping"]
    sd: FrequencySd | None = None
    covariance: Covariance | None = None


class ShapeResidualEntry(OfModesTable):
    """Shapes, scaled; `covariance` is of the entries of a scaled shape, in the order of `sensors`."""

    sd_of_test = True

    kind: Literal["shape"]
    scaling: ShapeScaling = "unit-norm"
    sensors: Sensors | None = None
    sd: FrequencySd | None = None
    covariance: Covariance | None = None
    mass_scaled: bool = False


class StrainResidualEntry(OfModesTable):
    """Strain shapes: those sensors of the test that are strain gauges, combinations of [[sensor]] in the model."""

    sd_of_test = True

    kind: Literal["strain"]
    scaling: ShapeScaling = "unit-norm"
    sensors: Sensors
    sd: FrequencySd | None = None
    covariance: Covariance | None = None
    mass_scaled: bool = False


class MacResidualEntry(OfModesTable):
    """A function of the MAC."""

    kind: Literal["mac"]
    form: MacForm = "root"
    sd: NotNegative


class FlexibilityResidualEntry(OfModesTable):
    """Modal flexibility at the sensors, relative to its largest entry."""

    kind: Literal["flexibility"]
    part: Literal["matrix", "diagonal"] = "matrix"
    sd: NotNegative
    mass_scaled: bool = False


class DynamicResidualEntry(OfModesTable):
    """Equation error of the measured modes; `sd` is of a force where the largest entry of the shape is one."""

    kind: Literal["dynamic"]
    sd: NotNegative


class DisplacementResidualEntry(ResidualTable):
    """Static displacements; `sd` is relative to the largest one, `covariance` in their unit, in their order."""

    kind: Literal["static-displacement"]
    name: Text
    forces: Displacements
    displacements: Displacements
    sd: NotNegative | None = None
    covariance: Covariance | None = None


class ForceResidualEntry(ResidualTable):
    """Residual forces of measured displacements; `sd` is of a force."""

    kind: Literal["static-force"]
    name: Text
    forces: Displacements
    displacements: Displacements
    sd: NotNegative


class MassResidualEntry(ResidualTable):
    """Measured mass; `sd` is relative."""

    kind: Literal["mass"]
    mass: Positive
    sd: NotNegative


class CentreResidualEntry(ResidualTable):
    """Centre of gravity, basic frame; `sd` is a length."""

    kind: Literal["centre-of-gravity"]
    x: float | None = None
    y: float | None = None
    z: float | None = None
    sd: NotNegative


class InertiaResidualEntry(ResidualTable):
    """Entries of the inertia tensor about a point, basic frame; `sd` is relative to the largest one."""

    kind: Literal["inertia"]
    ixx: float | None = None
    iyy: float | None = None
    izz: float | None = None
    ixy: float | None = None
    ixz: float | None = None
    iyz: float | None = None
    about: Vector = (0.0, 0.0, 0.0)
    sd: NotNegative


ResidualEntry = Annotated[
    FrequencyResidualEntry
    | ComplexEigenvalueResidualEntry
    | DampingResidualEntry
    | ShapeResidualEntry
    | StrainResidualEntry
    | MacResidualEntry
    | FlexibilityResidualEntry
    | DynamicResidualEntry
    | DisplacementResidualEntry
    | ForceResidualEntry
    | MassResidualEntry
    | CentreResidualEntry
    | InertiaResidualEntry
    | FrfResidualEntry
    | AntiresonanceResidualEntry,
    Field(discriminator="kind"),
]
"""Any kind of residual."""

TABLES: Mapping[str, type[ResidualTable]] = {
    get_args(table.model_fields["kind"].annotation)[0]: table for table in get_args(get_args(ResidualEntry)[0])
}
"""The table of each kind."""


# ----------------------------------------------------------------------------------------------------
# [residuals]: frequencies and shapes in all configurations with modes, in short.


class ResidualsTable(TomlTable):
    """[residuals]: residuals of all configurations with modes, and their standard deviations."""

    frequency_sd: FrequencySd = 0.01
    shape_sd: FrequencySd = 0.0
    shape_form: Literal["difference", "mac"] = "difference"
    frequency_form: FrequencyForm = "frequency"
    shape_scaling: Literal["unit-norm", "largest-entry"] = "unit-norm"
    shape_sd_of: Literal["largest-entry", "scaled-shape"] = "largest-entry"
    scatter: Scatter = "stated"
    common_frequency_sd: Annotated[float, Field(ge=0, le=1)] = 0.0

    @property
    def _shape_kind(self) -> str:
        return "mac" if self.shape_form == "mac" else "shape"

    def comparisons(self, alone: bool) -> Iterator[Comparison]:
        """The same as [[residual]] tables; beside others (not `alone`) frequencies only where a key says how well."""
        place = ("residuals",)
        if self.frequency_sd and (alone or "frequency_sd" in self.model_fields_set):
            of_frequency = FrequencyResidualEntry(kind="frequency", form=self.frequency_form, sd=self.frequency_sd)
            yield Comparison(of_frequency, place, short=True)
        if self.shape_sd and self._shape_kind == "mac" and not isinstance(self.shape_sd, str):
            yield Comparison(MacResidualEntry(kind="mac", sd=self.shape_sd), place, short=True)
        elif self.shape_sd and self._shape_kind != "mac":
            of_shape = ShapeResidualEntry(kind="shape", scaling=self.shape_scaling, sd=self.shape_sd)
            yield Comparison(of_shape, place, short=True, of_largest=self.shape_sd_of == "largest-entry")

    def kinds_of_stage(self, named: tuple[str, ...]) -> frozenset[str]:
        """Kinds that a stage names: "shape" is what shape_form says."""
        return frozenset(named) | ({self._shape_kind} if "shape" in named else frozenset())


@dataclass(frozen=True)
class Comparison:
    """One comparison of a study: its table, and where that stands; `short` for what [residuals] says.

    `of_largest` says that the standard deviation of a shape is relative to its largest entry.
    """

    entry: ResidualEntry
    place: Place
    short: bool = False
    of_largest: bool = False


# ----------------------------------------------------------------------------------------------------
# Rules between [residuals], [[residual]] and the configurations.


def residual_rules(data: Data, source: StudyLines) -> Problems:
    """All breaches."""
    yield from _modes(data, source)
    for place, entry in tables(data, "residual"):
        yield from _configuration(data, place, entry, source)
        model = TABLES.get(str(entry.get("kind")))
        for b in model.breaches(entry) if model is not None else ():
            yield source.error((*place, *([b.key] if b.key else [])), b.code, b.values, **b.facts)


def _modes(data: Data, source: StudyLines) -> Problems:
    residuals = table(data, "residuals")
    silent = number(residuals, "frequency_sd") == 0 and not residuals.get("shape_sd")
    if residuals.get("shape_sd") == "test" and residuals.get("shape_form") == "mac":
        yield source.error(("residuals", "shape_sd"), "residual.weights/mac-not-of-test", {"shape_form": "mac"})
    if silent and not data.get("residual"):
        yield source.error(("residuals", "frequency_sd"), "study.nothing-compared", residuals)


def _configuration(data: Data, place: Place, entry: Data, source: StudyLines) -> Problems:
    known = {str(c.get("name")): c for _, c in tables(data, "configuration")}
    given = entry.get("configuration")
    if given is None:
        if len(known) > 1 and not specimens_of(data):
            yield source.error(
                place,
                "study.residual-configuration/several",
                {"configurations": list(known)},
                first=next(iter(known)),
            )
        return
    where = (*place, "configuration")
    if not known:
        yield source.error(where, "study.residual-configuration/none", {})
        return
    for name in texts(given if isinstance(given, tuple) else (given,)):
        if name not in known:
            hint = did_you_mean(name, known)
            yield source.error(where, "study.residual-configuration/unknown", {}, hint=hint, name=name)
        elif known[name].get("use") == "validation":
            yield source.error(where, "study.residual-configuration/for-validation", {}, name=name)
