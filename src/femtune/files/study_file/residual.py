"""[[residual]]: one comparison in one configuration; the key `kind` says which, docs/study-file.md the other keys.

A further kind is a table here with its name in `ResidualEntry`, and the class in `femtune.residuals` that `made_by`
names. The tables stand apart from the classes so that a study is checked without the numerical packages.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from femtune.errors import did_you_mean
from femtune.files.study_file.kinds import (
    ByNode,
    Covariance,
    DofLabel,
    Fraction,
    FrequencySd,
    Hertz,
    HertzAboveZero,
    Labels,
    Listed,
    NotNegative,
    Positive,
    Ratio,
    Text,
    TomlTable,
    Vector,
    tables_by_kind,
)
from femtune.files.study_file.python_table import PythonTable
from femtune.files.study_file.source import Data, Place, Problems, StudyLines, number, table, tables, texts
from femtune.files.study_file.specimens import specimens_of
from femtune.model.kinds import FrfMethodWord
from femtune.residuals.kinds import FrequencyForm, FrfForm, MacForm, Scatter, ShapeScaling


@dataclass(frozen=True)
class Breach:
    """A violated rule between the keys of a table: at which key ("" for the table), and what to do."""

    key: str
    code: str
    values: Data = field(default_factory=dict)
    facts: Data = field(default_factory=dict)


class ResidualTable(PythonTable):
    """What all kinds have: the configuration, which a study of several must name.

    `made_by` names the class of `femtune.residuals` whose `of_study` makes the residual, as ``package.module:name``;
    `Residual.block` gives blocks the label of that class. `covariance_of_test` is True for kinds whose covariance a
    test may give; `sd_of_test` for those that take the standard deviations of the test where neither `sd` nor
    `covariance` is stated.
    """

    made_by: ClassVar[str]
    covariance_of_test: ClassVar[bool] = False
    sd_of_test: ClassVar[bool] = False

    kind: str
    """Quantity that is compared; the section of each kind lists its other keys. Example: `"mass"`"""
    configuration: Text | Annotated[Listed[Text], Field(min_length=1)] | None = None
    """Name of its [[configuration]], or a list of names. Required if there are several, but not in a study of
    [specimens](guide/specimens.md), where the default is all configurations that the update uses.
    Example: `"as built"`"""
    assumed: bool = False
    """The standard deviation is an assumption and not known from the test; one that applies by default is an assumption
    without this key. See `assumed` of [residuals]. Example: `true`"""

    @property
    def is_assumed(self) -> bool:
        """Whether the standard deviation is an assumption."""
        return self.assumed

    def is_in(self, configuration: str, several: bool, used: bool) -> bool:
        """Whether it is compared in a configuration; without `configuration` in the only one, or, of a study of
        specimens (`several`), in all that the update uses."""
        if self.configuration is None:
            return used or not several
        return configuration in ((self.configuration,) if isinstance(self.configuration, str) else self.configuration)

    @property
    def is_of_test(self) -> bool:
        """True if the standard deviations are those of the test."""
        sd, covariance = getattr(self, "sd", None), getattr(self, "covariance", None)
        return "test" in (sd, covariance) or (self.sd_of_test and sd is None and covariance is None)

    @classmethod
    def breaches(cls, given: Data) -> Iterator[Breach]:
        """Rules between the keys of a table, for plain data; the table reports wrong types."""
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
    """Response DOFs that are compared. Default: all of the test's FRFs. Example: `["3Z+", "7Z+"]`"""
    inputs: Labels | None = None
    """Reference DOFs that are compared. Default: all. Example: `["1Z+"]`"""
    from_hz: Hertz = 0.0
    """Lowest frequency in Hz; the line at 0 Hz is never used. Example: `20.0`"""
    to_hz: HertzAboveZero | None = None
    """Highest frequency in Hz. Default: the last line of the test. Example: `400.0`"""
    count: Annotated[int, Field(ge=1, le=100_000)] | None = None
    """Number of model modes used for the FRFs. Default: those up to twice the highest frequency line, or twice the
    highest antiresonance, whatever `[modes]` states. Example: `40`"""
    max_hz: HertzAboveZero | None = None
    """Instead of `count`: all modes up to this frequency in Hz. Example: `800.0`"""

    @classmethod
    def breaches(cls, given: Data) -> Iterator[Breach]:
        """The band must rise, and keys must not exclude each other."""
        yield from super().breaches(given)
        low, high = number(given, "from_hz") or 0.0, number(given, "to_hz")
        if high is not None and low >= high:
            yield Breach("to_hz", "study.response-lines/band", {"from_hz": low, "to_hz": high})
        if "count" in given and "max_hz" in given:
            yield Breach("max_hz", "study.modes/residual")
        if "ratio" in given and "ratios" in given:
            yield Breach("ratios", "study.response-ratios/residual")


_KEYS_OF_RESONANCES = ("modes", "bandwidths", "lines", "aligned", "region_ratio")
"""Keys of FRFs in the resonance regions of modes, which exclude those of a band."""


class FrfResidual(MeasuredFunctionsTable):
    """Measured frequency response functions, line by line.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Source: Mottershead, Link and Friswell (2011).

    Examples
    --------
    >>> import femtune as ft
    >>> ft.FrfResidual(from_hz=5.0, to_hz=80.0, sd=0.1).form
    'log-complex'
    """

    made_by = "femtune.residuals.frf.asked:AskedFrfs"

    kind: Literal["frf"] = "frf"
    modes: Annotated[Listed[Text], Field(min_length=1)] | None = None
    """With `around = "resonances"`: labels of the test modes. Default: all modes that are not excluded.
    Example: `["1", "2"]`"""
    form: FrfForm = "log-complex"
    """`"linear"`: real and imaginary parts of the difference; `"log-complex"`: logarithm of the ratio, magnitude and
    phase; `"log-magnitude"`: logarithm of the ratio of magnitudes. Example: `"linear"`"""
    around: Literal["band", "resonances"] = "band"
    """`"band"`, or `"resonances"`: a few frequency lines around each paired test mode (those of `modes`, if given).
    Example: `"resonances"`"""
    most: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    """Largest number of frequency lines of the band, evenly selected. Default: all. Example: `200`"""
    bandwidths: Positive = 2.0
    """Width of the range around a resonance, relative to the half-power bandwidth 2ζf of the test. Example: `3.0`"""
    lines: Annotated[int, Field(ge=1, le=1000)] = 3
    """Desired number of lines in a half-power bandwidth; the nearest lines of the test are used. Example: `5`"""
    aligned: bool = False
    """Evaluate the FRFs of the model at scaled frequencies, so that its peaks coincide with those of the test: for
    updating damping with fixed stiffness and mass. Example: `true`"""
    region_ratio: Fraction | None = None
    """Damping ratio for the width of the ranges, for modes without damping ratio in the test. Example: `0.01`"""
    sd: NotNegative | None = None
    """Relative standard deviation of a value. Default: 0.05, or 0 if there is a `floor`. Example: `0.03`"""
    floor: NotNegative = 0.0
    """Standard deviation as a fraction of the largest magnitude of each FRF. Example: `0.001`"""
    averages: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    """Number of averages of the measurement; if given, the variance that follows from the coherence is added.
    Example: `40`"""
    output_sd: Annotated[dict[DofLabel, Positive], Field(min_length=1)] | None = None
    """Relative standard deviation of single outputs instead of `sd`, for poor channels. Default: `sd` for all. Example:
    `{ "4X+" = 0.3, "4Y+" = 0.3 }`"""
    angle_sd_deg: ByNode = 0.0
    """Standard deviation of the rotation of sensors about each axis, degrees: a number for all, or by test node;
    [adds the variance](guide/residuals-frf.md#badly-oriented-sensors-and-poor-channels) due to the other axes.
    Example: `{ 4 = 5.0 }`"""
    method: FrfMethodWord = "real modes"
    """Method to compute the FRFs of the model, as in `[response]`. Example: `"complex modes"`"""
    residual_vectors: bool = True
    """Add residual vectors (static responses to forces at inputs and outputs) to the modes. Example: `false`"""
    ratio: Ratio | None = None
    """Modal damping ratio of all modes, in addition to the damping of the deck. Default: the table selected in the
    deck. Example: `0.01`"""
    ratios: Annotated[Listed[Ratio], Field(min_length=1)] | None = None
    """Instead of `ratio`: one value per mode. Example: `[0.01, 0.012]`"""
    leave_out_modes_hz: Listed[HertzAboveZero] = ()
    """[Model modes that are left out](guide/residuals-frf.md#modes-that-the-test-does-not-show) of the FRFs of the
    model: their natural frequencies at the initial values, Hz (within 2 %). Example: `[159.2, 204.0]`"""

    @property
    def is_assumed(self) -> bool:
        """See `ResidualTable`."""
        return self.assumed or not {"sd", "floor", "averages"} & self.model_fields_set

    @classmethod
    def breaches(cls, given: Data) -> Iterator[Breach]:
        """Keys of a band and keys of resonances exclude each other."""
        yield from super().breaches(given)
        around = given.get("around", "band")
        resonances = around == "resonances"
        for key in ("from_hz", "to_hz", "most") if resonances else _KEYS_OF_RESONANCES:
            if key in given:
                code = "study.residual-lines" if resonances else "study.residual-lines/band"
                yield Breach(key, code, {"around": around}, {"key": key})
        if given.get("leave_out_modes_hz") and given.get("method", "real modes") != "real modes":
            yield Breach("method", "study.left-out-modes", {"method": given["method"]}, {"method": given["method"]})


class AntiresonanceResidual(MeasuredFunctionsTable):
    """Antiresonance frequencies of measured FRFs, relative to those of the test.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.AntiresonanceResidual(sd=0.01, from_hz=5.0, to_hz=80.0).sd
    0.01
    """

    made_by = "femtune.residuals.frf.asked:AskedAntiresonances"

    kind: Literal["antiresonance"] = "antiresonance"
    sd: FrequencySd = 0.01
    """Relative standard deviation; `"test"`: the standard deviation of each fit. Example: `"test"`"""
    frequency_gate: Annotated[float, Field(gt=0, le=1)] = 0.30
    """Largest relative difference between the frequencies of a pair at the start. Example: `0.5`"""
    mac_gate: Annotated[float, Field(ge=0, le=1)] = 0.50
    """Smallest MAC of the responses at the antiresonances, 0 … 1, if three or more responses are measured. Example:
    `0.0`"""
    depth: Fraction = 0.5
    """Largest ratio of the magnitude at a minimum to that of the smaller adjacent peak. Example: `0.3`"""
    half_width: Annotated[int, Field(ge=2, le=1000)] = 4
    """Smallest number of lines that are fitted on each side of a minimum. Example: `6`"""
    most_damping: Fraction = 0.05
    """Largest loss factor of the fitted zero. Example: `0.02`"""
    above_noise: Annotated[float, Field(ge=0, le=1e6)] = 8.0
    """Smallest ratio of the peaks on both sides of a minimum to the noise of the lines there; 0:
    [minima of noise](guide/residuals-frf.md#antiresonances) are accepted too. Example: `5.0`"""

    @property
    def is_assumed(self) -> bool:
        """See `ResidualTable`."""
        return self.assumed or "sd" not in self.model_fields_set


ModeLabels = Annotated[Listed[Text], Field(min_length=1)]
Sensors = Annotated[Listed[DofLabel], Field(min_length=1)]
Displacements = Annotated[dict[DofLabel, float], Field(min_length=1)]


class OfModesTable(ResidualTable):
    """Residuals of modes: all of the test that are not left out, or those with given labels."""

    modes: ModeLabels | None = None
    """Labels of the test modes. Default: all modes that are not excluded. Example: `["1", "2"]`"""


class FrequencyResidual(OfModesTable):
    """Natural frequencies of paired modes, relative to those of the test. Give either `sd` or `covariance`.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Source: Mottershead, Link and Friswell (2011).

    Examples
    --------
    >>> import femtune as ft
    >>> ft.FrequencyResidual(sd=0.005)
    FrequencyResidual(sd=0.005)
    """

    covariance_of_test = True
    made_by = "femtune.residuals.frequency:FrequencyResidual"

    kind: Literal["frequency"] = "frequency"
    form: FrequencyForm = "frequency"
    """Relative difference of the `"frequency"`, or of the `"eigenvalue"` ω². Example: `"eigenvalue"`"""
    sd: FrequencySd | None = None
    """Relative standard deviation; `"test"`: the value given in the test file. Example: `0.005`"""
    covariance: Covariance | None = None
    """Instead of `sd`: covariance in Hz², with a row for each mode of the test in its order, paired or not; `"test"`:
    the covariance given in the test file. Example: `[[4e-4, 1e-4], [1e-4, 9e-4]]`"""

    @property
    def sd_of_frequency(self) -> float | None:
        """Relative standard deviation of a frequency; None if the table does not state a single number."""
        if isinstance(self.sd, str) or self.sd is None:
            return None
        # a relative error of λ = ω² is twice that of the frequency
        return self.sd / (2.0 if self.form == "eigenvalue" else 1.0)


class ComplexEigenvalueResidual(OfModesTable):
    """Poles of the damped model for paired modes, real and imaginary part, relative to the magnitude of the test's.

    Give either `sd` or `covariance`.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Source: Friswell and Mottershead (1995), section 7.

    Examples
    --------
    >>> import femtune as ft
    >>> ft.ComplexEigenvalueResidual(sd=0.002)
    ComplexEigenvalueResidual(sd=0.002)
    """

    covariance_of_test = True
    made_by = "femtune.residuals.poles:ComplexEigenvalueResidual"

    kind: Literal["complex-eigenvalue"] = "complex-eigenvalue"
    sd: FrequencySd | None = None
    """Standard deviation of the real and of the imaginary part, relative to the magnitude; `"test"`: from the standard
    deviations of frequency and damping ratio given in the test file or in its `deviations`. Example: `0.002`"""
    covariance: Covariance | None = None
    """Instead of `sd`: covariance of the frequencies in Hz and, after them, the damping ratios of all modes of the test
    in its order, paired or not; `"test"`: the covariance given in the test file. Example: `"test"`"""


class DampingResidual(OfModesTable):
    """Damping ratios of the damped model for paired modes, relative to those of the test.

    Give either `sd` or `covariance`.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Source: Friswell and Mottershead (1995), section 7.

    Examples
    --------
    >>> import femtune as ft
    >>> ft.DampingResidual(sd=0.1)
    DampingResidual(sd=0.1)
    """

    covariance_of_test = True
    made_by = "femtune.residuals.poles:DampingResidual"

    kind: Literal["damping"] = "damping"
    sd: FrequencySd | None = None
    """Relative standard deviation; `"test"`: the value given in the test file or in its `deviations`. Example: `0.1`"""
    covariance: Covariance | None = None
    """Instead of `sd`: covariance of the damping ratios, with a row for each mode of the test in its order, paired or
    not; `"test"`: from the covariance given in the test file. Example: `"test"`"""


class ScaledShapesTable(OfModesTable):
    """Shapes, scaled; `covariance` is of the entries of a scaled shape, in the order of `sensors`."""

    sd_of_test = True

    scaling: ShapeScaling = "unit-norm"
    """`"unit-norm"`; `"largest-entry"`: scaled to one at the largest entry of the test shape, which is then not
    compared; `"scale-factor"`: the model shape is multiplied by the modal scale factor; `"mass"`: both are unscaled,
    with unit modal mass. Example: `"scale-factor"`"""
    sensors: Sensors | None = None
    """Sensors whose entries are compared; the scaling uses these only. Default: all. Example: `["201Z+", "202Z+"]`"""
    sd: FrequencySd | None = None
    """Standard deviation of an entry of the scaled shape (`shape_sd` of `[residuals]` is relative to its largest entry
    instead); `"test"`: the standard deviations of the entries given with the test. Default, without `covariance`:
    as `"test"`. Example: `0.05`"""
    covariance: Covariance | None = None
    """Instead of `sd`: covariance of the entries of a scaled shape, positive definite, in the order of `sensors` (of
    the sensors of the test if not given). Example: `[[0.01, 0.002], [0.002, 0.01]]`"""
    mass_scaled: bool = False
    """The shapes of the test have unit modal mass although the file does not state it. Example: `true`"""


class ShapeResidual(ScaledShapesTable):
    """Mode shapes of paired modes at the sensors, scaled. Give either `sd` or `covariance`.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Source: Mottershead, Link and Friswell (2011).

    Examples
    --------
    >>> import femtune as ft
    >>> ft.ShapeResidual(sd=0.05, scaling="largest-entry")
    ShapeResidual(scaling='largest-entry', sd=0.05)
    """

    made_by = "femtune.residuals.shape:ShapeResidual"

    kind: Literal["shape"] = "shape"


class StrainResidual(ScaledShapesTable):
    """Strain mode shapes: the sensors are strain gauges, defined as linear combinations of model DOFs.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.StrainResidual(sensors=["901S+"], sd=0.05).sensors
    ('901S+',)
    """

    made_by = "femtune.residuals.shape:StrainResidual"

    kind: Literal["strain"] = "strain"
    sensors: Sensors
    """The strain gauges. Example: `["201X+", "202X+"]`"""


class MacResidual(OfModesTable):
    """A residual formed from the MAC of paired modes: one value per mode.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Source: Allemang and Brown (1982).

    Examples
    --------
    >>> import femtune as ft
    >>> ft.MacResidual(sd=0.05)
    MacResidual(sd=0.05)
    """

    made_by = "femtune.residuals.mac:MacResidual"

    kind: Literal["mac"] = "mac"
    form: MacForm = "root"
    """`"root"` (1 − √MAC)/√MAC, `"ratio"` (1 − MAC)/MAC, `"difference"` 1 − MAC. Example: `"ratio"`"""
    sd: NotNegative
    """Standard deviation of this value. Example: `0.02`"""


class FlexibilityResidual(OfModesTable):
    """Modal flexibility at the sensors, relative to its largest entry; shapes must be mass-normalised.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Source: Pandey and Biswas (1994).

    Examples
    --------
    >>> import femtune as ft
    >>> ft.FlexibilityResidual(sd=0.02, part="diagonal").part
    'diagonal'
    """

    made_by = "femtune.residuals.flexibility:FlexibilityResidual"

    kind: Literal["flexibility"] = "flexibility"
    part: Literal["matrix", "diagonal"] = "matrix"
    """The complete `"matrix"`, or its `"diagonal"`. Example: `"diagonal"`"""
    sd: NotNegative
    """Standard deviation relative to the largest entry. Example: `0.05`"""
    mass_scaled: bool = False
    """The shapes of the test have unit modal mass although the file does not state it. Example: `true`"""


class DynamicResidual(OfModesTable):
    """Equation error of the measured modes: the residual force of the model in the measured mode shape.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Source: Friswell and Mottershead (1995), equation error.

    Examples
    --------
    >>> import femtune as ft
    >>> ft.DynamicResidual(sd=100.0)
    DynamicResidual(sd=100.0)
    """

    made_by = "femtune.residuals.dynamic:DynamicResidual"

    kind: Literal["dynamic"] = "dynamic"
    sd: NotNegative
    """Standard deviation of a force, for a shape scaled to a largest entry of one. Example: `10.0`"""


class LoadCaseTable(ResidualTable):
    """Static displacements that were measured under known forces."""

    name: Text
    """Name of the load case. Example: `"tip load"`"""
    forces: Displacements
    """Force at each DOF, or at a [`[[sensor]]`](#sensor), in units of the study. Example: `{ "5Z+" = -1000.0 }`"""
    displacements: Displacements
    """Measured displacements, in the unit of length of the study; they are compared in this order. Example: `{ "5Z+" =
    -0.0031, "3Z+" = -0.001 }`"""


class StaticDisplacementResidual(LoadCaseTable):
    """Static displacements under known forces. Give either `sd` or `covariance`.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> load = ft.StaticDisplacementResidual(name="tip", forces={"5Z+": 100.0}, displacements={"5Z+": 0.02}, sd=0.01)
    >>> load.displacements
    {'5Z+': 0.02}
    """

    made_by = "femtune.residuals.static:DisplacementResidual"

    kind: Literal["static-displacement"] = "static-displacement"
    sd: NotNegative | None = None
    """Standard deviation relative to the largest displacement. Example: `0.01`"""
    covariance: Covariance | None = None
    """Instead of `sd`: covariance of the displacements, in their order and in their unit squared.
    Example: `[[1e-8, 0.0], [0.0, 1e-8]]`"""


class StaticForceResidual(LoadCaseTable):
    """Residual forces of measured static displacements: applied forces minus those computed by the model.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.StaticForceResidual(name="tip", forces={"5Z+": 100.0}, displacements={"5Z+": 0.02}, sd=1.0).sd
    1.0
    """

    made_by = "femtune.residuals.static:ForceResidual"

    kind: Literal["static-force"] = "static-force"
    sd: NotNegative
    """Standard deviation of a force. Example: `5.0`"""


class MassResidual(ResidualTable):
    """The measured mass.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.MassResidual(mass=44.2, sd=0.002)
    MassResidual(mass=44.2, sd=0.002)
    """

    made_by = "femtune.residuals.mass:MassResidual"

    kind: Literal["mass"] = "mass"
    mass: Positive
    """Measured mass of everything that is active in the configuration, in units of the study. Example: `12.4`"""
    sd: NotNegative
    """Relative standard deviation. Example: `0.002`"""


class CentreOfGravityResidual(ResidualTable):
    """The measured centre of gravity, in the basic coordinate system.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.CentreOfGravityResidual(x=1.21, sd=0.005)
    CentreOfGravityResidual(x=1.21, sd=0.005)
    """

    made_by = "femtune.residuals.mass:CentreResidual"

    kind: Literal["centre-of-gravity"] = "centre-of-gravity"
    x: float | None = None
    """Coordinate x in the basic coordinate system, length, if measured. Example: `0.412`"""
    y: float | None = None
    """Coordinate y in the basic coordinate system, length, if measured. Example: `0.412`"""
    z: float | None = None
    """Coordinate z in the basic coordinate system, length, if measured. Example: `0.412`"""
    sd: NotNegative
    """Standard deviation, a length. Example: `0.002`"""


class InertiaResidual(ResidualTable):
    """Measured entries of the inertia tensor about a point, in the basic coordinate system.

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.InertiaResidual(izz=3.2, sd=0.01).about
    (0.0, 0.0, 0.0)
    """

    made_by = "femtune.residuals.mass:InertiaResidual"

    kind: Literal["inertia"] = "inertia"
    ixx: float | None = None
    """Entry xx of the inertia tensor, in mass·length² of the study, if measured. Example: `0.8`"""
    iyy: float | None = None
    """Entry yy of the inertia tensor, in mass·length² of the study, if measured. Example: `0.8`"""
    izz: float | None = None
    """Entry zz of the inertia tensor, in mass·length² of the study, if measured. Example: `1.2`"""
    ixy: float | None = None
    """Entry xy of the inertia tensor, in mass·length² of the study, if measured; products have the sign of the tensor,
    −Σ m x y. Example: `-0.1`"""
    ixz: float | None = None
    """Entry xz of the inertia tensor, in mass·length² of the study, if measured; products have the sign of the tensor,
    −Σ m x z. Example: `-0.1`"""
    iyz: float | None = None
    """Entry yz of the inertia tensor, in mass·length² of the study, if measured; products have the sign of the tensor,
    −Σ m y z. Example: `-0.1`"""
    about: Vector = (0.0, 0.0, 0.0)
    """Reference point in the basic coordinate system, length. Example: `[0.4, 0.0, 0.0]`"""
    sd: NotNegative
    """Standard deviation relative to the largest measured entry. Example: `0.01`"""


ResidualEntry = Annotated[
    FrequencyResidual
    | ComplexEigenvalueResidual
    | DampingResidual
    | ShapeResidual
    | StrainResidual
    | MacResidual
    | FlexibilityResidual
    | DynamicResidual
    | StaticDisplacementResidual
    | StaticForceResidual
    | MassResidual
    | CentreOfGravityResidual
    | InertiaResidual
    | FrfResidual
    | AntiresonanceResidual,
    Field(discriminator="kind"),
]
"""Any kind of residual."""

TABLES: Mapping[str, type[ResidualTable]] = tables_by_kind(ResidualEntry)
"""The table of each kind."""


# ----------------------------------------------------------------------------------------------------
# [residuals]: the short form for frequencies and shapes in all configurations with modes.


class ResidualsTable(TomlTable):
    """[residuals]: residuals of all configurations with modes, and their standard deviations."""

    frequency_sd: FrequencySd = 0.01
    """Relative standard deviation of `frequency_form`; `"test"`: the standard deviation given in the test file; 0:
    frequencies are not used; otherwise 1e-12 to 1e12. Example: `0.005`"""
    shape_sd: FrequencySd = 0.0
    """Standard deviation of each entry of a shape, relative to the largest measured entry of the shape, whatever
    `shape_scaling` (see `shape_sd_of`); with `shape_form = "mac"`, of this value; 0: shapes are not used; `"test"`: the
    standard deviations of the entries given with the test, not for `shape_form = "mac"`; otherwise 1e-12 to 1e12.
    Example: `0.1`"""
    shape_form: Literal["difference", "mac"] = "difference"
    """`"difference"` of scaled shapes, or `"mac"`: (1 − √MAC)/√MAC. Example: `"mac"`"""
    frequency_form: FrequencyForm = "frequency"
    """Relative difference of the `"frequency"`, or of the `"eigenvalue"` ω². Example: `"eigenvalue"`"""
    shape_scaling: Literal["unit-norm", "largest-entry"] = "unit-norm"
    """`"unit-norm"`, or `"largest-entry"`: scaled by the largest entry of the test shape, which is then not compared.
    Example: `"largest-entry"`"""
    shape_sd_of: Literal["largest-entry", "scaled-shape"] = "largest-entry"
    """What `shape_sd` is relative to: the `"largest-entry"` of each shape, as in [plan], [validate] and simulated
    tests, or the `"scaled-shape"`: the unit of the entries after `shape_scaling`, as `sd` of [[residual]]. Example:
    `"scaled-shape"`"""
    scatter: Scatter = "stated"
    """`"stated"`: the standard deviations are those of the test, and confidence intervals are normal; `"estimated"`:
    they are relative weights, their common factor is estimated from the residuals, and confidence intervals are those
    of Student's t. Example: `"estimated"`"""
    common_frequency_sd: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Relative standard deviation of an error that all frequencies of the model share, for example of a wrong mass or
    modulus; it widens the results ([guide](guide/update.md)). Example: `0.02`"""
    assumed: tuple[Literal["frequency_sd", "shape_sd"], ...] = ()
    """Keys of this table whose values are assumptions and not known from the test. Residuals that are smaller than
    assumed are no finding, and larger ones are a reservation. A standard deviation that applies by default is an
    assumption. Example: `["frequency_sd"]`"""

    def is_assumed(self, key: str) -> bool:
        """Whether the value of a key is an assumption."""
        return key in self.assumed or key not in self.model_fields_set

    @property
    def _shape_kind(self) -> str:
        return "mac" if self.shape_form == "mac" else "shape"

    def comparisons(self, alone: bool) -> Iterator[Comparison]:
        """The same as [[residual]] tables; beside others (not `alone`) frequencies only where a key says how well."""
        place = ("residuals",)
        if self.frequency_sd and (alone or "frequency_sd" in self.model_fields_set):
            of_frequency = FrequencyResidual(form=self.frequency_form, sd=self.frequency_sd)
            yield Comparison(of_frequency, place, short=True)
        if self.shape_sd and self._shape_kind == "mac" and not isinstance(self.shape_sd, str):
            yield Comparison(MacResidual(sd=self.shape_sd), place, short=True)
        elif self.shape_sd and self._shape_kind != "mac":
            of_shape = ShapeResidual(scaling=self.shape_scaling, sd=self.shape_sd)
            yield Comparison(of_shape, place, short=True, of_largest=self.shape_sd_of == "largest-entry")

    def kinds_of_stage(self, named: tuple[str, ...]) -> frozenset[str]:
        """Kinds by the names that a stage uses; "shape" stands for the kind of `shape_form`."""
        return frozenset(named) | ({self._shape_kind} if "shape" in named else frozenset())


@dataclass(frozen=True)
class Comparison:
    """One comparison of a study: its table and its place; `short` is True if it is from [residuals].

    `of_largest` says that the standard deviation of a shape is relative to its largest entry.
    """

    entry: ResidualEntry
    place: Place
    short: bool = False
    of_largest: bool = False


# ----------------------------------------------------------------------------------------------------
# Rules between [residuals], [[residual]] and the configurations.


def residual_rules(data: Data, source: StudyLines) -> Problems:
    """All violated rules."""
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
