"""Tables of a study as Python objects: parameters, configurations and residuals, with the keys of the file.

The keys and values of an object are checked when it is created; references to the model are checked when the study is
assembled.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from femtune.errors import ErrorCollector
from femtune.files.study_file.configuration import ConfigurationEntry
from femtune.files.study_file.kinds import TomlTable
from femtune.files.study_file.parameter import ParameterEntry
from femtune.files.study_file.problems import problems
from femtune.files.study_file.residual import (
    AntiresonanceResidualEntry,
    CentreResidualEntry,
    ComplexEigenvalueResidualEntry,
    DampingResidualEntry,
    DisplacementResidualEntry,
    DynamicResidualEntry,
    FlexibilityResidualEntry,
    ForceResidualEntry,
    FrequencyResidualEntry,
    FrfResidualEntry,
    InertiaResidualEntry,
    MacResidualEntry,
    MassResidualEntry,
    ShapeResidualEntry,
    StrainResidualEntry,
)
from femtune.files.study_file.source import StudyLines
from femtune.testdata import ModalTest


def plain(value: Any) -> Any:
    """A value as in a TOML file: lists as tuples, numpy numbers as numbers, paths as text."""
    if isinstance(value, BaseModel):
        kind = {"kind": value.kind} if hasattr(value, "kind") else {}
        return plain({**kind, **{name: getattr(value, name) for name in value.model_fields_set}})
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return tuple(map(plain, value))
    return str(value) if isinstance(value, Path) else value


class _Checked(TomlTable):
    """A table that is created in Python: its errors are FemtuneErrors."""

    if not TYPE_CHECKING:

        def __init__(self, **words: Any) -> None:
            given = {name: plain(value) for name, value in words.items() if value is not None}
            try:
                super().__init__(**given)
            except ValidationError as findings:
                errors = problems(findings, StudyLines(type(self).__name__, whole=type(self).__name__), type(self))
                ErrorCollector(errors).raise_if_any()
                raise

    def __repr_args__(self) -> Iterator[tuple[str | None, Any]]:
        return ((name, getattr(self, name)) for name in type(self).model_fields if name in self.model_fields_set)


class Parameter(ParameterEntry, _Checked):
    """A parameter of the update: fields of the deck, bounds and prior; a [[parameter]] of a study.

    Parameters
    ----------
    name : a name that a tie can use: letters, digits and _
    fields : fields of the deck, "PBAR 1 I1", or "MAT1 E" for that of all MAT1
    lower, upper : bounds: of a factor on the values of the deck; with `absolute` of the value itself
    nominal : initial value; 1 for a factor, the value of the deck with `absolute`
    absolute : the parameter is the value of the field, in units of the deck, instead of a factor
    elements, region : elements for which the field is changed; default: all that use it: ``"201 THRU 208"``,
        ``{"properties": [3]}``
    sd, mean : prior standard deviation and mean, in units of `lower`
    prior, prior_name : catalogue that holds the prior, and the name of the entry
    tie : an expression of other parameters, instead of bounds: "2.0*E"
    individual : whether each specimen has its own value
    unit : unit shown in tables

    Raises
    ------
    FemtuneError : ``study.field``, ``study.unknown-key``, ``study.type`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.Parameter("E", fields=["MAT1 1 E"], lower=0.8, upper=1.2)
    Parameter(name='E', fields=('MAT1 1 E',), lower=0.8, upper=1.2)
    """

    if not TYPE_CHECKING:

        def __init__(self, name: str, **words: Any) -> None:
            super().__init__(name=name, **words)

    else:

        def __init__(
            self,
            name: str,
            *,
            fields: Sequence[str] = (),
            lower: float | None = None,
            upper: float | None = None,
            nominal: float | None = None,
            absolute: bool = False,
            elements: str | Sequence[int] | None = None,
            region: Mapping[str, Any] | None = None,
            sd: float | None = None,
            mean: float | None = None,
            prior: str | Path | None = None,
            prior_name: str | None = None,
            tie: str | None = None,
            individual: bool = False,
            unit: str = "",
        ) -> None: ...


class Configuration(ConfigurationEntry, _Checked):
    """A configuration of the structure with its test: a [[configuration]] of a study.

    Parameters
    ----------
    name : unique name
    test : a `ModalTest`, or the path of its file; None without a test
    specimen : name of the specimen, where nominally identical structures were tested
    test_units : length-mass-s of the test, if its file does not state them
    masses, masses_file : added masses: ``[{"node": 12, "mass": 0.5}]``, or a table of them
    elements_off : elements that are absent: "201 THRU 208"
    components, interface : the components that are present, and "fixed" where their interface is supported
    spc, mpc : sets of supports and of multipoint constraints, in place of those of the deck
    supports_added, supports_removed : ``["12:123"]``
    weighed_mass : of the structure in this state, in units of the study
    use : "update", or "validation" for a test that the update must not see
    rotation, origin : axes of the test in the model: rows of a rotation, dimensionless, and a point in the unit of
        length of the study
    mode_labels, leave_out, pairs, records, deviations : which modes of the test, how they are paired, and their scatter
    runs, solver : table of runs of another solver in this configuration, and its keys in place of those of [solver]

    Raises
    ------
    FemtuneError : ``study.*``, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.Configuration("with mass", masses=[{"node": 12, "mass": 0.5}], use="validation").use
    'validation'
    """

    model_config = ConfigDict(arbitrary_types_allowed=True)

    test: str | ModalTest | None = None  # type: ignore[assignment]

    if not TYPE_CHECKING:

        def __init__(self, name: str, **words: Any) -> None:
            super().__init__(name=name, **words)

    else:

        def __init__(self, name: str, *, test: str | Path | ModalTest | None = None, **words: Any) -> None: ...


class FrequencyResidual(FrequencyResidualEntry, _Checked):
    """Natural frequencies of paired modes, relative to those of the test.

    Parameters
    ----------
    sd : standard deviation, relative: 0.01 is 1 %; "test": the value stated in the test
    covariance : instead of `sd`, (modes, modes) in Hz², or "test"
    form : "frequency" or "eigenvalue"
    modes : labels of test modes; None: all
    configuration : name, if the study has several

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

    kind: Literal["frequency"] = "frequency"


class ComplexEigenvalueResidual(ComplexEigenvalueResidualEntry, _Checked):
    """Poles of the damped model for paired modes, real and imaginary part, relative to the magnitude of the test's.

    Parameters
    ----------
    sd : of each part, relative; "test": from the standard deviations of frequency and damping ratio of the test
    covariance : instead of `sd`, of all frequencies in Hz and all damping ratios of the test; "test": that of the test
    modes, configuration : as for `FrequencyResidual`

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

    kind: Literal["complex-eigenvalue"] = "complex-eigenvalue"


class DampingResidual(DampingResidualEntry, _Checked):
    """Damping ratios of the damped model for paired modes, relative to those of the test.

    Parameters
    ----------
    sd : relative standard deviation; "test": that of the test
    covariance : instead of `sd`, of all damping ratios of the test; "test": from that of the test
    modes, configuration : as for `FrequencyResidual`

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

    kind: Literal["damping"] = "damping"


class ShapeResidual(ShapeResidualEntry, _Checked):
    """Shapes of paired modes at the sensors, scaled.

    Parameters
    ----------
    sd : standard deviation of an entry of the scaled shape
    covariance : instead of `sd`, (sensors, sensors)
    scaling : "unit-norm", "largest-entry", "scale-factor" or "mass"
    sensors : labels, "12Z+"; None: all
    modes, configuration : as for `FrequencyResidual`
    mass_scaled : True if the test shapes have unit modal mass though its file does not say so

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

    kind: Literal["shape"] = "shape"


class StrainResidual(StrainResidualEntry, _Checked):
    """Strain mode shapes: the sensors are strain gauges, defined as linear combinations of model DOFs.

    Parameters
    ----------
    sensors : labels of the strain gauges
    sd, covariance, scaling, modes, configuration, mass_scaled : as for `ShapeResidual`

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.StrainResidual(sensors=["901S+"], sd=0.05).sensors
    ('901S+',)
    """

    kind: Literal["strain"] = "strain"


class MacResidual(MacResidualEntry, _Checked):
    """A residual formed from the MAC of paired modes.

    Parameters
    ----------
    sd : standard deviation of the function
    form : "root" √(1 − MAC)/√MAC, "ratio" (1 − MAC)/MAC or "difference" 1 − MAC
    modes, configuration : as for `FrequencyResidual`

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

    kind: Literal["mac"] = "mac"


class FlexibilityResidual(FlexibilityResidualEntry, _Checked):
    """Modal flexibility at the sensors, relative to its largest entry; shapes must be mass-normalised.

    Parameters
    ----------
    sd : relative to the largest entry
    part : "matrix" or "diagonal"
    modes, configuration, mass_scaled : as for `ShapeResidual`

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

    kind: Literal["flexibility"] = "flexibility"


class DynamicResidual(DynamicResidualEntry, _Checked):
    """Equation error of the measured modes: the residual force of the model in the measured mode shape.

    Parameters
    ----------
    sd : of a force, for a shape scaled to a largest entry of one
    modes, configuration : as for `FrequencyResidual`

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

    kind: Literal["dynamic"] = "dynamic"


class FrfResidual(FrfResidualEntry, _Checked):
    """Measured frequency response functions, line by line.

    Parameters
    ----------
    outputs, inputs : response and reference DOFs; None: all of the test
    from_hz, to_hz : band
    form : "log-complex", "log-magnitude" or "linear"
    around : "band", or "resonances": lines around the resonances of the test
    sd, floor, averages : standard deviation of a function, in units of `form`
    output_sd, angle_sd_deg : that of single outputs, relative, and that of the rotation of sensors in degrees
    method, ratio, ratios, residual_vectors, count, max_hz : how the model's functions are computed
    leave_out_modes_hz : natural frequencies of modes that the FRFs of the model leave out
    modes, most, lines, aligned, region_ratio : which lines are compared
    bandwidths : width of the range around a resonance relative to its half-power bandwidth 2ζf
    configuration : name, if the study has several

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

    kind: Literal["frf"] = "frf"


class AntiresonanceResidual(AntiresonanceResidualEntry, _Checked):
    """Antiresonance frequencies of measured FRFs, relative.

    Parameters
    ----------
    sd : standard deviation, relative; "test": the standard deviation of each fit
    outputs, inputs, from_hz, to_hz, count, max_hz : as for `FrfResidual`
    half_width : lines on each side of a minimum that the zero is fitted to
    frequency_gate : largest relative difference of the frequencies of a pair
    mac_gate : smallest MAC of the responses at a pair, 0 … 1
    depth : largest ratio of the magnitude at a minimum to that of the smaller adjacent peak
    most_damping : largest loss factor of the fitted zero, dimensionless
    above_noise : smallest ratio of the adjacent peaks to the noise of the lines there
    configuration : name, if the study has several

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.AntiresonanceResidual(sd=0.01, from_hz=5.0, to_hz=80.0).sd
    0.01
    """

    kind: Literal["antiresonance"] = "antiresonance"


class StaticDisplacementResidual(DisplacementResidualEntry, _Checked):
    """Static displacements under known forces.

    Parameters
    ----------
    name : of the load case
    forces : force by DOF in units of the study, ``{"5Z+": 100.0}``
    displacements : measured displacement by DOF, in the unit of length of the study
    sd : relative to the largest displacement
    covariance : instead of `sd`
    configuration : name, if the study has several

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

    kind: Literal["static-displacement"] = "static-displacement"


class StaticForceResidual(ForceResidualEntry, _Checked):
    """Residual forces of measured static displacements: applied forces minus those computed by the model.

    Parameters
    ----------
    name, forces, displacements, configuration : as for `StaticDisplacementResidual`
    sd : of a force

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.StaticForceResidual(name="tip", forces={"5Z+": 100.0}, displacements={"5Z+": 0.02}, sd=1.0).sd
    1.0
    """

    kind: Literal["static-force"] = "static-force"


class MassResidual(MassResidualEntry, _Checked):
    """The measured mass.

    Parameters
    ----------
    mass : in units of the study
    sd : relative
    configuration : name, if the study has several

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.MassResidual(mass=44.2, sd=0.002)
    MassResidual(mass=44.2, sd=0.002)
    """

    kind: Literal["mass"] = "mass"


class CentreOfGravityResidual(CentreResidualEntry, _Checked):
    """The measured centre of gravity, in the basic system.

    Parameters
    ----------
    x, y, z : measured coordinates, in the unit of length of the study
    sd : a length
    configuration : name, if the study has several

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.CentreOfGravityResidual(x=1.21, sd=0.005)
    CentreOfGravityResidual(x=1.21, sd=0.005)
    """

    kind: Literal["centre-of-gravity"] = "centre-of-gravity"


class InertiaResidual(InertiaResidualEntry, _Checked):
    """Measured entries of the inertia tensor about a point, in the basic system.

    Parameters
    ----------
    ixx, iyy, izz, ixy, ixz, iyz : measured entries, in mass·length² of the study
    about : reference point, in the unit of length of the study
    sd : relative to the largest entry
    configuration : name, if the study has several

    Raises
    ------
    FemtuneError : ``study.unknown-key``, ``study.type``, ``study.value`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.InertiaResidual(izz=3.2, sd=0.01).about
    (0.0, 0.0, 0.0)
    """

    kind: Literal["inertia"] = "inertia"
