"""Tables of a study as objects of Python: parameters, configurations and residuals, in the words of the file.

An object checks its keys and values when it is made; what they mean for a model is checked when the study is put
together.
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
    """A value as a TOML file would hold it: lists as tuples, numbers of numpy as numbers, paths as text."""
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
    """A table that is made in Python: what is wrong with it is a FemtuneError."""

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
    """What an update may change, how far, and which fields of the deck it moves: a [[parameter]] of a study.

    Parameters
    ----------
    name : a name that a tie can use: letters, digits and _
    fields : fields of the deck, "PBAR 1 I1", or "MAT1 E" for that of all MAT1
    lower, upper : bounds: of a factor on the values of the deck; with `absolute` of the value itself
    nominal : start value; 1 for a factor, the value of the deck with `absolute`
    absolute : the parameter is the value of the field, in units of the deck, and no factor
    elements, region : which elements it moves, where not all that use the field: ``"201 THRU 208"``,
        ``{"properties": [3]}``
    sd, mean : prior standard deviation and mean
    prior, prior_name : catalogue that holds the prior, and the name of the entry
    tie : an expression of other parameters that it follows, in place of bounds: "2.0*E"
    unit : of its value, to be shown

    Raises
    ------
    FemtuneError : ``study.field``, ``study.unknown-key``, ``study.type`` …, all that is wrong at once

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
            unit: str = "",
        ) -> None: ...


class Configuration(ConfigurationEntry, _Checked):
    """The structure in one state, and the test that belongs to it: a [[configuration]] of a study.

    Parameters
    ----------
    name : what it is called
    test : a test that was read, or the path of its file; None where it was not tested
    test_units : length-mass-s of a file that says none
    masses : added masses: ``[{"node": 12, "mass": 0.5}]``
    elements_off : elements that are switched off: "201 THRU 208"
    spc, mpc : sets of supports and of multipoint constraints, in place of those of the deck
    supports_added, supports_removed : ``["12:123"]``
    weighed_mass : of the structure in this state
    use : "update", or "validation" for a test that the update must not see
    words : further keys: mode_labels, leave_out, pairs, rotation, origin, records

    Raises
    ------
    FemtuneError : ``study.*``, all that is wrong at once

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
    sd : standard deviation, relative: 0.01 is 1 %; "test" takes what the test states
    covariance : in place of `sd`, (modes, modes) in Hz², or "test"
    form : "frequency" or "eigenvalue"
    modes : labels of test modes; all where None
    configuration : name, where the study has several

    Examples
    --------
    >>> import femtune as ft
    >>> ft.FrequencyResidual(sd=0.005)
    FrequencyResidual(sd=0.005)
    """

    kind: Literal["frequency"] = "frequency"


class ShapeResidual(ShapeResidualEntry, _Checked):
    """Shapes of paired modes at the sensors, scaled.

    Parameters
    ----------
    sd : standard deviation of an entry of the scaled shape
    covariance : in place of `sd`, (sensors, sensors)
    scaling : "unit-norm", "largest-entry", "scale-factor" or "mass"
    sensors : labels, "12Z+"; all where None
    modes, configuration : as for `FrequencyResidual`
    mass_scaled : True where the test's shapes are of unit modal mass though its file does not say so

    Examples
    --------
    >>> import femtune as ft
    >>> ft.ShapeResidual(sd=0.05, scaling="largest-entry")
    ShapeResidual(scaling='largest-entry', sd=0.05)
    """

    kind: Literal["shape"] = "shape"


class StrainResidual(StrainResidualEntry, _Checked):
    """Strain shapes: sensors of the test that are strain gauges, combinations of DOFs in the model.

    Parameters
    ----------
    sensors : labels of the strain gauges
    sd, covariance, scaling, modes, configuration, mass_scaled : as for `ShapeResidual`

    Examples
    --------
    >>> import femtune as ft
    >>> ft.StrainResidual(sensors=["901S+"], sd=0.05).sensors
    ('901S+',)
    """

    kind: Literal["strain"] = "strain"


class MacResidual(MacResidualEntry, _Checked):
    """A function of the MAC of paired modes.

    Parameters
    ----------
    sd : standard deviation of the function
    form : "root" √(1 − MAC)/√MAC, "ratio" (1 − MAC)/MAC or "difference" 1 − MAC
    modes, configuration : as for `FrequencyResidual`

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

    Examples
    --------
    >>> import femtune as ft
    >>> ft.FlexibilityResidual(sd=0.02, part="diagonal").part
    'diagonal'
    """

    kind: Literal["flexibility"] = "flexibility"


class DynamicResidual(DynamicResidualEntry, _Checked):
    """Equation error of the measured modes: the force that is left where the model moves as the test.

    Parameters
    ----------
    sd : of a force, where the largest entry of the shape is one
    modes, configuration : as for `FrequencyResidual`

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
    outputs, inputs : labels of functions, all of the test where None
    from_hz, to_hz : band
    form : "log-complex", "log-magnitude" or "linear"
    around : "band", or "resonances" for lines about those of the test
    sd, floor, averages : standard deviation of a function, in units of `form`
    method, ratio, ratios, residual_vectors, count, max_hz : how the model's functions are computed
    modes, most, bandwidths, lines, aligned, region_ratio : which lines are compared
    configuration : name, where the study has several

    Examples
    --------
    >>> import femtune as ft
    >>> ft.FrfResidual(from_hz=5.0, to_hz=80.0, sd=0.1).form
    'log-complex'
    """

    kind: Literal["frf"] = "frf"


class AntiresonanceResidual(AntiresonanceResidualEntry, _Checked):
    """Antiresonances of measured functions, relative.

    Parameters
    ----------
    sd : standard deviation, relative; "test" takes that with which each is found
    outputs, inputs, from_hz, to_hz, count, max_hz : as for `FrfResidual`
    frequency_gate, mac_gate, depth, half_width, most_damping : which antiresonances are taken and paired
    configuration : name, where the study has several

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
    forces : force by DOF, ``{"5Z+": 100.0}``
    displacements : measured displacement by DOF
    sd : relative to the largest displacement
    covariance : in place of `sd`
    configuration : name, where the study has several

    Examples
    --------
    >>> import femtune as ft
    >>> load = ft.StaticDisplacementResidual(name="tip", forces={"5Z+": 100.0}, displacements={"5Z+": 0.02}, sd=0.01)
    >>> load.displacements
    {'5Z+': 0.02}
    """

    kind: Literal["static-displacement"] = "static-displacement"


class StaticForceResidual(ForceResidualEntry, _Checked):
    """Forces that measured static displacements need in the model, beside those that were applied.

    Parameters
    ----------
    name, forces, displacements, configuration : as for `StaticDisplacementResidual`
    sd : of a force

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
    configuration : name, where the study has several

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
    x, y, z : those that were measured, in the study's unit of length
    sd : a length
    configuration : name, where the study has several

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
    ixx, iyy, izz, ixy, ixz, iyz : those that were measured, in the study's mass·length²
    about : the point
    sd : relative to the largest entry
    configuration : name, where the study has several

    Examples
    --------
    >>> import femtune as ft
    >>> ft.InertiaResidual(izz=3.2, sd=0.01).about
    (0.0, 0.0, 0.0)
    """

    kind: Literal["inertia"] = "inertia"
