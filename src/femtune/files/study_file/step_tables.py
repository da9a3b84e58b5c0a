"""Tables of a study file with the options of the steps; docs/study-file.md explains every key."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Field

from femtune.correlation.kinds import ExpansionMethod
from femtune.dofs import DIRECTIONS, Dof, parse_dof
from femtune.files.study_file.kinds import (
    ByNode,
    DeckName,
    DofLabel,
    NotNegative,
    Number,
    Positive,
    Text,
    TomlTable,
    Units,
    Vector,
    Weight,
    numbered,
)
from femtune.identification.kinds import Drawing
from femtune.uncertainty.kinds import Jacobian
from femtune.units import UnitSystem, unit_system
from femtune.updating.kinds import RegularisationMethod, SearchMethod, WeightTarget

Component = Literal["X", "Y", "Z", "RX", "RY", "RZ"]


class StudyTable(TomlTable):
    """[study]: title, deck and units."""

    only_configuration: ClassVar[str] = "as the deck"
    """Name of the configuration of a study without [[configuration]]."""

    title: Text
    """Title of the report. Example: `"Two-storey steel building"`"""
    deck: DeckName | None = None
    """The Nastran bulk data file. Required, unless the model is made of [matrices](#matrix) or [runs](#runs), or is an
    external [solver](#solver). Example: `"building.bdf"`"""
    units: Units
    """Units of length, mass and time of the deck; lengths m, cm, mm, in, ft; masses kg, g, t, lbm, slug, slinch; or a
    force N, kN, MN, lbf, kip instead of the mass: `"in-lbf-s"`, `"kip-ft-s"`, whose unit of mass is lbf·s²/in (slinch)
    and kip·s²/ft. A deck does not state its units. Example: `"mm-t-s"`"""
    allow_ignored: tuple[Text, ...] = ()
    """Cards that may be ignored although the modes depend on them. Example: `["CTRIAX6"]`"""
    journal: bool = True
    """Store all solutions of the full model in the run folder, so that [an interrupted run
    continues](guide/interrupted-runs.md). Example: `false`"""
    journal_gib: Annotated[float, Field(gt=0, le=1e6)] = 10.0
    """Size at which the journal stops growing, GiB. Example: `50.0`"""

    @property
    def unit_system(self) -> UnitSystem:
        """The units of the deck and of all values in the study."""
        return unit_system(self.units)


class ModesTable(TomlTable):
    """[modes]: number of modes, or highest frequency."""

    count: Annotated[int, Field(ge=1, le=100_000)] | None = None
    """Number of modes, including the rigid-body modes. Give at most one of `count` and `max_hz`. Example: `8`"""
    max_hz: Annotated[float, Field(gt=0, le=1e12)] | None = None
    """All modes up to this frequency, Hz. Example: `200.0`"""


class SensorsTable(TomlTable):
    """[sensors]: assignment of test nodes to grid points of the model."""

    tolerance: Positive | None = None
    """Largest distance between a test node and its grid point, length, positive. Default: a thousandth of the diagonal
    of the model. Example: `0.05`"""
    by_id: bool = False
    """Assign a test node to the grid point with the same number. Example: `true`"""
    nodes: Annotated[dict[Number, Number], BeforeValidator(numbered)] = Field(default_factory=dict)
    """Prescribed assignment of test nodes to grid points. Example: `{ "101" = 12 }`"""
    leave_out: tuple[Number, ...] = ()
    """Test nodes that are not compared, because the model has no grid point near them. Example: `[12, 31]`"""
    position_sd: ByNode = 0.0
    """Standard deviation of each coordinate of the position of a sensor, length: a number for all test nodes, or by
    test node (0 for the others). It is [propagated](theory/correlation.md#errors-of-sensor-placement) to the covariance
    of shape differences. Example: `{ 11 = 0.005, 12 = 0.01 }`"""
    angle_sd_deg: ByNode = 0.0
    """Standard deviation of the rotation of a sensor about each axis, degrees: a number for all test nodes, or by test
    node (0 for the others). It is propagated likewise. Example: `2.0`"""


class SensorTerm(TomlTable):
    """One model DOF in a generalised sensor."""

    node: Number
    """Grid point or scalar point. Example: `3`"""
    component: Literal["S", Component]
    """X Y Z RX RY RZ in the displacement coordinate system of the grid point, S for a scalar point. Example: `"X"`"""
    factor: float = 1.0
    """Factor on its displacement. Example: `0.5`"""


class SensorEntry(TomlTable):
    """[[sensor]]: a sensor that is a combination of model DOFs."""

    name: DofLabel
    """Label of the degree of freedom in the test. Example: `"11X+"`"""
    terms: Annotated[tuple[SensorTerm, ...], Field(min_length=1)]
    """Terms of the linear combination: model DOFs with their factors. Example: `[{ node = 3, component = "X", factor =
    0.5 }]`"""

    @property
    def label(self) -> Dof:
        """The DOF of the test that it stands for."""
        return parse_dof(self.name)


class RigidFloorEntry(TomlTable):
    """[[rigid_floor]]: least-squares rigid motion of a floor's nodes, as sensors of one test node."""

    test_node: Number
    """Test node of the rigid-body motion. Example: `1`"""
    nodes: Annotated[tuple[Number, ...], Field(min_length=1)]
    """Grid points of the floor. Example: `[11, 12, 13, 14]`"""
    origin: Vector
    """Reference point of the motion, basic coordinate system, length. Example: `[0, 0, 2]`"""
    components: Annotated[tuple[Component, ...], Field(min_length=1)] = ("X", "Y", "RZ")
    """Components of the motion, basic coordinate system. Example: `["X", "Y"]`"""

    @property
    def digits(self) -> str:
        """The components as Nastran writes them: "126"."""
        return "".join(str(DIRECTIONS.index(component)) for component in self.components)


class CorrelateTable(TomlTable):
    """[correlate]: criteria for mode pairing and for close modes, and the expansion of test shapes to the model."""

    frequency_gate: Annotated[float, Field(gt=0, le=1)] = 0.30
    """Frequency limit: modes are paired only if their relative frequency difference is below it; a fraction, at most 1.
    Example: `0.15`"""
    mac_gate: Annotated[float, Field(ge=0, le=1)] = 0.50
    """MAC limit: modes are paired only if their MAC is above it, 0 to 1. Example: `0.8`"""
    cluster_gap: NotNegative = 0.01
    """Modes whose relative frequency difference is smaller are compared as one subspace. Example: `0.02`"""
    expand: Literal["none", ExpansionMethod] = "none"
    """[Expansion](theory/correlation.md#expansion-of-test-shapes) of the test shapes to all grid points of the model:
    `"serep"`, `"dynamic"` or `"mdre"`. `femtune run` writes the shapes to `expanded.uff`. Example: `"dynamic"`"""
    expand_modes: Annotated[int, Field(ge=1, le=100_000)] | None = None
    """Number of the lowest model modes that SEREP uses. Default: the paired modes. Example: `12`"""
    expand_noise: Annotated[float, Field(gt=0, lt=1)] = 0.01
    """Relative misfit at the sensors that the minimum dynamic residual expansion (`"mdre"`) allows, above 0 and below
    1. Example: `0.03`"""


class CorrelationEntry(TomlTable):
    """An entry of [update] correlations: a prior correlation of two parameters."""

    one: Text
    """Name of a parameter. Example: `"k1"`"""
    other: Text
    """Name of the other parameter. Example: `"k2"`"""
    value: Annotated[float, Field(gt=-1, lt=1)]
    """Correlation of their priors, between −1 and 1. Example: `0.8`"""


class UpdateTable(TomlTable):
    """[update]: search, convergence and regularisation."""

    max_iterations: Annotated[int, Field(ge=1, le=1_000_000)] = 250
    """Iteration limit; the best point is kept. Example: `100`"""
    regularisation: RegularisationMethod = "none"
    """Penalty on the change of the parameters: `"none"`; `"minimum-change"` (of normalised parameters from their
    nominal values); `"distance"` (from the initial values, in prior standard deviations); `"link"` (stronger for
    parameters to which the data are less sensitive); `"prior"` (mean and standard deviation); `"identical"`
    (differences between nominally identical parameters); `"truncated"` (combinations to which the data are insensitive
    are not changed). Example: `"link"`"""
    weight: Weight = 0.0
    """Weight of the regularisation: a number, `"l-curve"` or `"gcv"` (determined at the first iteration and kept); for
    `"truncated"` the fraction of the largest singular value, below 1; not used with `"none"` and `"prior"`. Example:
    `"l-curve"`"""
    weight_on: WeightTarget = "whole-change"
    """For `"minimum-change"`, `"distance"` and `"link"`: the weight acts on the `"whole-change"` of the parameters, or
    on the change of each iteration (`"each-step"`), as printed in the handbook chapter; the result of the latter
    [depends on the number of iterations](theory/regularisation.md). Example: `"each-step"`"""
    adapt: bool = False
    """Determine a weight from a rule again at each iteration. Example: `true`"""
    smallest_change: Annotated[float, Field(ge=0, le=1000)] = 0.25
    """Where the data leave combinations of parameters undetermined, the result is the smallest change from the nominal
    values, in prior standard deviations, whose χ² exceeds the minimum within the bounds by at most this; `0`: the
    minimum itself. Example: `0.0`"""
    identical: tuple[Annotated[tuple[Text, ...], Field(min_length=2)], ...] = ()
    """For `"identical"`: groups of parameters. Example: `[["k1", "k2"]]`"""
    correlations: tuple[CorrelationEntry, ...] = ()
    """For `"prior"`: correlations of the priors of two parameters. Example: `[{ one = "k1", other = "k2", value = 0.8
    }]`"""
    tolerance: Annotated[float, Field(gt=0, lt=1)] = 1e-8
    """Relative change below which the iteration has converged. Example: `1e-6`"""
    search: SearchMethod = "levenberg-marquardt"
    """Step control: `"levenberg-marquardt"`, `"line-search"`, or `"gauss-newton"` (full steps). Example:
    `"line-search"`"""
    starts: Annotated[int, Field(ge=1, le=100_000)] = 1
    """Number of initial points of a multi-start update, from a Latin hypercube within the bounds. Example: `20`"""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    """Seed of the random numbers. Example: `1`"""
    hops: Annotated[int, Field(ge=0, le=1000)] = 0
    """How many times a start that ended at a worse minimum than the best is restarted. Example: `2`"""
    samples: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    """Evaluate the objective at so many points of the hypercube and start from the initial values and the best `starts`
    − 1 of them; 0: the starts are the points of the hypercube. Example: `100`"""
    first: Literal["none", "equation-error"] = "none"
    """`"equation-error"`: each start first minimises the equation error of the test modes, which needs no pairing;
    requires `[reduction]`. `"none"`: the residuals from the start. Example: `"equation-error"`"""


class ReductionTable(TomlTable):
    """[reduction]: the update searches on reduced models and is certified on the full one."""

    tolerance: Annotated[float, Field(gt=0, lt=0.1)] = 1e-4
    """Largest relative difference between a frequency of the reduced and of the full model at the end; during the
    update it may be ten times larger; above 0, below 0.1. Example: `1e-3`"""
    full_solutions: Annotated[int, Field(ge=4, le=10_000)] = 20
    """Largest number of solutions of the full model, for each configuration, and of points at which its components are
    computed; 4 to 10,000. Example: `30`"""
    order: Annotated[int, Field(ge=10, le=20_000)] = 600
    """Largest order of each reduced model; 10 to 20,000. Example: `1000`"""
    frf_tolerance: Annotated[float, Field(gt=0, lt=10)] = 0.01
    """How far the difference between the FRFs of the reduced and of the full model may move the parameters at the end,
    in their standard deviations; above 0, below 10. Example: `0.05`"""


class BootstrapTable(TomlTable):
    """[bootstrap]: spread of the parameters from the FRFs of one test, by drawing frequency lines again."""

    method: Drawing = "lines"
    """What is drawn: frequency `"lines"` with all their FRFs, single values (`"entries"`), or `"noise"` of the stated
    standard deviations, which is also possible for modes and other data. Example: `"noise"`"""
    runs: Annotated[int, Field(ge=10, le=1_000_000)] = 1000
    """Number of runs; increasing it keeps the runs that were made. Example: `200`"""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    """Seed of the random numbers. Example: `7`"""
    jacobian: Jacobian = "shared"
    """Derivatives of the steps: those at the result of the update (`"shared"`), which need no further derivatives, or
    those of each point (`"own"`). Example: `"own"`"""
    tolerance: Annotated[float, Field(gt=0, le=1)] = 0.01
    """A run ends if a step is smaller than this, in standard deviations of the parameters. Example: `0.001`"""
    checked: Annotated[int, Field(ge=0, le=1000)] = 5
    """Number of runs that are repeated with `"own"` derivatives, to state the largest difference. Example: `20`"""


class ParallelTable(TomlTable):
    """[parallel]: where runs that do not depend on each other are made: starts, bootstrap runs."""

    how: Literal["auto", "processes", "serial", "cluster"] = "auto"
    """Worker `"processes"` with one thread each, `"serial"` in the process of femtune, or the workers of a Dask
    `"cluster"` (extra `cluster`); `"auto"`: processes if a configuration has more than 3000 free DOFs, or if `workers`
    is above 1. Example: `"processes"`"""
    workers: Annotated[int, Field(ge=0, le=1024)] = 0
    """Number of worker processes; 0: one for each core. Example: `4`"""
    address: Text = "tcp://127.0.0.1:8786"
    """Address of the Dask scheduler, for `"cluster"`. Example: `"tcp://127.0.0.1:9000"`"""
    remote: bool = False
    """Allow an address on another machine; everyone who reaches the cluster can run programs in your name. Example:
    `true`"""


Hertz = Annotated[float, Field(ge=0, le=1e12)]


class EqualiseTable(TomlTable):
    """[equalise]: measured FRFs as those of the identified system with one damping ratio; the model's likewise."""

    damping: Annotated[float, Field(gt=0, lt=0.5)]
    """Damping ratio of test and model; above 0, below 0.5. Example: `0.01`"""
    band_hz: tuple[Hertz, Hertz] | None = None
    """Band of the identification and of the lines, Hz. Default: all measured lines. Example: `[40.0, 400.0]`"""
    leave_out_hz: tuple[tuple[Hertz, Hertz], ...] = ()
    """Bands that are not compared, whose poles keep their damping, Hz. Example: `[[118.0, 131.0]]`"""
    lines: Annotated[float, Field(gt=0, le=100)] = 3.0
    """Lines in a half bandwidth 2ζf. Example: `2.0`"""
    largest_order: Annotated[int, Field(ge=4, le=200)] = 60
    """Largest model order of the identification; 4 to 200. Example: `80`"""
    take_hz: tuple[Positive, ...] = ()
    """Frequencies of candidates that are modes, Hz. Example: `[57.3]`"""
    drop_hz: tuple[Positive, ...] = ()
    """Frequencies of candidates that are not modes, Hz. Example: `[50.0]`"""


class WriteTable(TomlTable):
    """[write]: options for writing the updated deck."""

    wide: bool = False
    """Changed cards are written in large-field format, with 16 characters per field. Example: `true`"""
    split: bool = True
    """If a field is shared with elements that are not updated, these keep the card, and the updated elements get a copy
    with a new number; the report lists the new cards. With `false` such a study is refused before the update.
    Example: `false`"""
    deck: bool = True
    """The update writes `updated.bdf`. With `false` no deck is written, as for parameters that no card can hold.
    Example: `false`"""


class OutputTable(TomlTable):
    """[output]: the run folder; a relative path refers to the folder of the study file."""

    folder: Text = "run"
    """The run folder; created if it does not exist. Example: `"run"`"""


class StudyOutputTable(OutputTable):
    """[output] of a study: the run folder, and what is written beside the report."""

    vtu: bool = False
    """`femtune run` writes `shapes.vtu` for ParaView: mesh, modes and values of the parameters after the update; needs
    the extra `vtu`. Example: `true`"""
