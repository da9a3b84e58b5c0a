"""The data of the interactive view of a page: numbers, texts, and arrays packed as base64 of little-endian values."""

from __future__ import annotations

import base64
import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from femtune.arrays import Reals


@dataclass(frozen=True)
class Packed:
    """An array: value = offset + scale · number, along the last axis where these have several entries.

    `type` is "u1", "u2", "u4", "i1", "i2", "f4" or "f8"; `data` is base64 of the numbers in C order, little-endian.
    """

    type: str
    shape: tuple[int, ...]
    data: str
    scale: tuple[float, ...] = ()
    offset: tuple[float, ...] = ()


@dataclass(frozen=True)
class PairView:
    """A pair: rows of the test's modes and columns of the model's; the model's motion is Σ weight · mode."""

    test: int
    column: int
    modes: tuple[int, ...]
    weights: tuple[float, ...]
    factor: tuple[float, float]
    """Real and imaginary part of the modal scale factor from the test's shape to this motion."""


@dataclass(frozen=True)
class StageView:
    """The model at one version: `freq_hz` of its modes in the order of `numbers`; `motion` (points, 3, modes).

    `mac` (test modes, modes) and `seen` (places, 3, modes), the motion at the places of the sensors, are None without a
    test. `stored` has the column of each mode of `motion` in `numbers`. Complex modes have damping ratios, None where
    there is none, and imaginary parts of `motion` and `seen`.
    """

    title: str
    numbers: tuple[int, ...]
    freq_hz: tuple[float, ...]
    stored: tuple[int, ...]
    motion: Packed
    mac: Packed | None = None
    seen: Packed | None = None
    factors: Packed | None = None
    """(test modes, modes, 2) real and imaginary part of the modal scale factor from test to model."""
    expanded: Packed | None = None
    """(points, 3, test modes) the test's shapes expanded to the points; None where this was not requested."""
    pairs: tuple[PairView, ...] = ()
    energy: Packed | None = None
    """(points, modes) as `motion`: the largest share of an element at the point in the strain energy, %, but for
    elements that are lines."""
    line_energy: Packed | None = None
    """(lines, modes): shares of the lines of the scene, %."""
    damping_ratio: tuple[float | None, ...] = ()
    motion_imaginary: Packed | None = None
    seen_imaginary: Packed | None = None


@dataclass(frozen=True)
class LiveShapesView:
    """How shapes of the live model are drawn: motions Σ vector · (weights y) for y in its coordinates.

    `vectors` (points, 3, n), `weights` (n, order).
    """

    vectors: Packed
    weights: Packed


@dataclass(frozen=True)
class SceneView:
    """One configuration: geometry of model and test, and its shapes.

    `faces` (f, 4) with the third corner of a triangle repeated, `edges` of faces to draw, `lines` and
    `rigid` lines, all by rows of `points`; `wire` by rows of `places`. `test` (places, 3, test modes), with
    `test_imaginary` where shapes are complex.
    """

    configuration: str
    note: str
    points: Packed
    faces: Packed
    edges: Packed
    lines: Packed
    rigid: Packed
    stages: tuple[StageView, ...]
    places: Packed | None = None
    wire: Packed | None = None
    test: Packed | None = None
    test_imaginary: Packed | None = None
    test_labels: tuple[str, ...] = ()
    test_freq_hz: tuple[float, ...] = ()
    test_only: bool = False
    """Whether the modes are those of a test, `test_labels` their names, and no model is shown."""
    parameters: tuple[str, ...] = ()
    slopes: tuple[tuple[float, ...], ...] = ()
    """For each test mode the change of the frequency of its partner, in %, for 1 % of each of `parameters` at the
    initial values; empty where it was not compared."""
    live: LiveShapesView | None = None
    line_parts: Packed | None = None
    """(lines,) part of the structure that each line is of, and `face_parts` (faces,); None where it is not known."""
    face_parts: Packed | None = None
    part_fields: tuple[tuple[str, ...], ...] = ()
    """For each part the fields of the deck that all its elements have, as `FieldChoiceView.field` names them."""
    point_numbers: Packed | None = None
    """(points,) numbers of the grid points or of the points of the test."""
    place_numbers: Packed | None = None
    """(places,) numbers of the points of the test; 0 where a place is none."""


@dataclass(frozen=True)
class CurveView:
    """Curves of all functions over the same lines: `real` and `imaginary` (functions, lines).

    `look` is one of the curves that web/src/functions.ts draws; `phase` is False where these are magnitudes.
    """

    look: str
    freq_hz: Packed
    real: Packed
    imaginary: Packed
    phase: bool = True


@dataclass(frozen=True)
class OperatingView:
    """Where functions are measured: for each the row of a point of the scene (−1 for none), the direction (functions,
    3) and its input, by which functions belong together."""

    rows: tuple[int, ...]
    directions: Packed
    inputs: tuple[str, ...]


@dataclass(frozen=True)
class FunctionsView:
    """Frequency response functions of one configuration, for a section of the page."""

    configuration: str
    ordinate: str
    titles: tuple[str, ...]
    curves: tuple[CurveView, ...]
    note: str = ""
    section: str = "responses"
    operating: OperatingView | None = None


@dataclass(frozen=True)
class IterationModeView:
    """A compared mode during the update."""

    configuration: str
    test_label: str
    test_freq_hz: float
    freq_hz: tuple[float | None, ...]
    mac: tuple[float | None, ...]


@dataclass(frozen=True)
class IterationFunctionsView:
    """Compared functions at each iteration: `real` and `imaginary` (functions, iterations, lines), those of the test
    (functions, lines); 0 where nothing is compared. `phase` is False where these are magnitudes. `test_look` is
    "equalised" where the test is compared with equal damping; `beside` are curves that do not change.
    """

    configuration: str
    ordinate: str
    titles: tuple[str, ...]
    phase: bool
    freq_hz: Packed
    real: Packed
    imaginary: Packed
    test_real: Packed
    test_imaginary: Packed
    test_look: str = "test"
    beside: tuple[CurveView, ...] = ()
    note: str = ""


@dataclass(frozen=True)
class HistoryView:
    """The update by iterations: weighted mean error in %, values of the parameters, compared modes and functions."""

    iterations: tuple[int, ...]
    objective_percent: tuple[float, ...]
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    nominal: tuple[float, ...]
    values: tuple[tuple[float, ...], ...]
    modes: tuple[IterationModeView, ...] = ()
    functions: tuple[IterationFunctionsView, ...] = ()


@dataclass(frozen=True)
class InputView:
    """A measured file, by its name and the SHA-256 of its bytes."""

    path: str
    sha256: str


@dataclass(frozen=True)
class PickedView:
    """A pole that is picked: its row, the name of its mode, and whether only the fit has it."""

    row: int
    name: str
    fit_only: bool


@dataclass(frozen=True)
class StabilisationView:
    """Poles (p,) from which a reader picks modes; `method` are positions in `methods`, `stable` is 0 or 1.

    The curve behind them is over its own lines, which `words` names; `singular_db` (s, lines) are singular values over
    the same lines, `power` (lines,) the sum of the auto spectra of a record, 0 lines where functions were measured. A
    synthesis is fitted to the functions of the page, the section "fit", which have `derivatives` (0 receptance, 1
    mobility, 2 accelerance; −1 without functions) and decay faster than the poles by `decay` (1/s). `functions` are
    all measured ones. `inputs` are the files that the poles are from.
    """

    methods: tuple[str, ...]
    method: Packed
    order: Packed
    freq_hz: Packed
    damping_ratio: Packed
    stable: Packed
    picked: tuple[PickedView, ...]
    curve_hz: Packed
    curve_db: Packed
    words: str
    singular_db: Packed
    power: Packed
    derivatives: int
    decay: float
    functions: int
    band_hz: tuple[float, float]
    inputs: tuple[InputView, ...]


@dataclass(frozen=True)
class ModeChoicesView:
    """Pairs of modes, modes and sensors of a configuration at the initial values.

    `mac` is (test modes, model modes), −1 where it is not known; `pairs` are those of the run, of which `fixed` are
    prescribed; pairs are a label of a test mode and a number of a model mode. `close` are numbers of close model modes,
    which are paired or not paired together. `left_out` are labels with reasons.
    """

    configuration: str
    test_labels: tuple[str, ...]
    test_freq_hz: tuple[float, ...]
    numbers: tuple[int, ...]
    model_freq_hz: tuple[float, ...]
    mac: Packed
    pairs: tuple[tuple[str, int], ...]
    fixed: tuple[tuple[str, int], ...]
    never: tuple[tuple[str, int], ...]
    close: tuple[tuple[int, ...], ...]
    left_out: tuple[tuple[str, str], ...]
    sensors: tuple[str, ...]
    off: tuple[str, ...]


@dataclass(frozen=True)
class FieldChoiceView:
    """A field of the deck that can be a parameter, with bounds of its factor; `chosen` if it is one, and then with the
    `further` fields that have the same factor."""

    name: str
    field: str
    what: str
    value: float
    lower: float
    upper: float
    chosen: bool
    further: tuple[str, ...] = ()


@dataclass(frozen=True)
class ChoicesView:
    """What a reader can choose, and the files that the choices are of."""

    inputs: tuple[InputView, ...]
    configurations: tuple[ModeChoicesView, ...]
    fields: tuple[FieldChoiceView, ...]
    kept: tuple[str, ...]
    """Parameters of the study that the file of choices has no table for."""


@dataclass(frozen=True)
class LiveParameterView:
    """A parameter with a slider; see `LiveParameter` of the results."""

    name: str
    unit: str
    nominal: float
    updated: float
    lower: float
    upper: float
    scale: float
    interval: tuple[float, float] | None


@dataclass(frozen=True)
class LiveRegionView:
    """The 95 % region: |rows (x − at) + offset|² at most `limit`, of the parameters `moving`; `rows` one after the
    other."""

    moving: tuple[int, ...]
    at: tuple[float, ...]
    rows: tuple[float, ...]
    offset: tuple[float, ...]
    limit: float
    centre: tuple[float, ...]
    precision: tuple[float, ...]
    radius_square: float


@dataclass(frozen=True)
class LiveDrawsView:
    """Values of the parameters from which the page chooses; see `LiveDraws` of the results."""

    source: str
    x: Packed
    linear: tuple[float, ...] | None
    degrees: float | None
    factors: dict[str, float]
    reason: str


@dataclass(frozen=True)
class LiveTermView:
    """A matrix of the live model: its kind, and the Chebyshev coefficients (`shape`) of its polynomial of some
    parameters."""

    kind: str
    parameters: tuple[int, ...]
    shape: tuple[int, ...]
    coefficients: tuple[float, ...]
    scale: float


@dataclass(frozen=True)
class LivePartView:
    """Residuals of one pair; see `LivePart` of the results. `weights` are those of a shape, by rows."""

    kind: str
    quantity: str
    form: str
    test: int
    sd: float
    sensors: tuple[int, ...]
    weights: tuple[float, ...] | None
    common: float


@dataclass(frozen=True)
class LiveCertificateView:
    """Largest differences from another model at some points: of frequencies in %, of MACs, of χ² in %."""

    other: str
    points: int
    corners: int
    without_modes: int
    frequency_percent: float
    mac: float | None
    chi_square_percent: float | None


@dataclass(frozen=True)
class LiveCheckView:
    """Normalised parameters, and the eigenvalues and the sum of squares that the page has to find there."""

    x: tuple[float, ...]
    eigenvalues: tuple[float, ...]
    chi_square: float
    functions: tuple[float, ...] = ()
    """Sum of the squares of the magnitudes of each entry of the functions."""


@dataclass(frozen=True)
class LiveFunctionsView:
    """Measured FRFs beside which those of the live model are drawn; see `LiveFunctions` of the results."""

    kind: str
    ordinate: str
    look: str
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    freq_hz: Packed
    test_real: Packed
    test_imaginary: Packed
    """(outputs, inputs, lines); 0 where nothing is compared."""
    output_rows: Packed
    input_rows: Packed
    modes: int
    ratios: tuple[float, ...]
    ratios_hz: tuple[float, ...]
    hysteretic: bool
    loss_factor: float
    si: float
    """What a value is multiplied by to be in SI units."""
    label: str
    form: str
    every: int
    """Every n-th line of the test is there."""
    sd: Packed | None
    shift: Packed | None
    note: str
    errors: tuple[tuple[str, int, float, str], ...]
    """Where ("region" or "bounds"), points, the largest difference from the full model in %, and its function ("" in
    older results)."""


@dataclass(frozen=True)
class LiveCriterionView:
    """An acceptance criterion with the value and the verdict of the update.

    `quantity` is "frequency", "mac", one of an orthogonality ("diagonal", "off_diagonal", "self") or of FRFs ("frac",
    "fdac", "mean_db", "max_db", "resonance"), or "" where the page does not compute it.
    """

    name: str
    quantity: str
    at_most: bool
    limit: float
    unit: str
    measured: float | None
    verdict: str
    remark: str


@dataclass(frozen=True)
class LiveMassView:
    """The mass of a configuration; see `LiveMass` of the results. `weighed` has masses with standard deviations."""

    updated: float
    slopes: tuple[float, ...]
    weighed: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class LiveConfigurationView:
    """The live model of one configuration; see `LiveConfiguration` of the results."""

    configuration: str
    order: int
    count: int
    shift: float
    theta: tuple[float, ...]
    terms: tuple[LiveTermView, ...]
    triangles: Packed
    sensors: Packed
    test_labels: tuple[str, ...]
    test_freq_hz: tuple[float, ...]
    test_shapes: Packed
    sensor_labels: tuple[str, ...]
    mass_points: tuple[str, ...]
    mass_reason: str
    mass_rows: Packed | None
    pairs: tuple[tuple[int, int, tuple[int, ...]], ...]
    """Positions of test mode and mode of the updated model, and of all modes that span the motion."""
    parts: tuple[LivePartView, ...]
    region: tuple[LiveCertificateView, ...]
    bounds: tuple[LiveCertificateView, ...]
    """Beside the full model first, then beside a reduced one."""
    checks: tuple[LiveCheckView, ...]
    functions: tuple[LiveFunctionsView, ...] = ()
    functions_reason: str = ""
    criteria: tuple[LiveCriterionView, ...] = ()
    mass: LiveMassView | None = None
    mass_sensors: tuple[int, ...] = ()
    """Positions of the sensors to which the page reduces the mass; empty where it does not."""


@dataclass(frozen=True)
class LiveOtherView:
    """Residuals that keep the sum of squares of the update."""

    kind: str
    chi_square: float


@dataclass(frozen=True)
class LiveView:
    """A model that the reader changes."""

    parameters: tuple[LiveParameterView, ...]
    narrowed: bool
    """Whether the ranges of the parameters are narrower than their bounds."""
    rejected: bool
    """Whether the fit of the update was rejected."""
    mass_unit: str
    x: tuple[float, ...]
    region: LiveRegionView | None
    draws: LiveDrawsView | None
    configurations: tuple[LiveConfigurationView, ...]
    others: tuple[LiveOtherView, ...]


@dataclass(frozen=True)
class PageView:
    """The data of the interactive view of a page."""

    scenes: tuple[SceneView, ...] = ()
    functions: tuple[FunctionsView, ...] = ()
    history: HistoryView | None = None
    stabilisation: StabilisationView | None = None
    live: LiveView | None = None
    choices: ChoicesView | None = None

    @property
    def empty(self) -> bool:
        """True if nothing can be shown."""
        shown = (self.scenes, self.functions, self.history, self.stabilisation, self.live, self.choices)
        return not any(shown)

    def json(self) -> str:
        """As JSON that may stand inside a script element: without the characters that could end it."""
        text = json.dumps(asdict(self), separators=(",", ":"), allow_nan=False)
        return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


# ----------------------------------------------------------------------------------------------------
# Arrays as text.


FUNCTION_BYTES = 1_000_000
"""Bytes of all frequency response functions."""


def whole(values: NDArray[Any]) -> Packed:
    """Numbers of rows, each with as few bytes as the largest one needs."""
    most = int(values.max(initial=0))
    kind = "u1" if most < 1 << 8 else "u2" if most < 1 << 16 else "u4"
    return _packed(kind, values)


def single(values: NDArray[Any]) -> Packed:
    """Real numbers in single precision."""
    return _packed("f4", np.nan_to_num(values))


def as_stored(values: NDArray[Any]) -> Packed:
    """Numbers in the type that they have: of 8 or 16 bits, or real, NaN included."""
    kinds = {"int8": "i1", "int16": "i2", "float32": "f4", "float64": "f8"}
    return _packed(kinds[values.dtype.name], values)


def quantised(values: Reals) -> Packed:
    """Real numbers as 16-bit multiples of the largest magnitude along all axes but the last."""
    filled = np.nan_to_num(np.asarray(values, dtype=float))
    largest = np.abs(filled).reshape(-1, filled.shape[-1]).max(axis=0, initial=0.0)
    steps = np.where(largest > 0.0, largest, 1.0) / 32767.0
    return _packed("i2", np.round(filled / steps), tuple(map(float, steps)))


def coarse(values: Reals) -> Packed:
    """Values that are not negative, as 8-bit multiples of the largest of each column: enough for a colour."""
    largest = values.max(axis=0, initial=0.0).astype(float)
    steps = np.where(largest > 0.0, largest, 1.0) / 255.0
    return _packed("u1", np.round(values / steps), tuple(map(float, steps)))


def coordinates(points: Reals) -> Packed:
    """Points (n, 3) as 16-bit steps along each axis."""
    first, size = points.min(axis=0), np.maximum(np.ptp(points, axis=0), 1e-300)
    steps = size / 65535.0
    return _packed("u2", np.round((points - first) / steps), tuple(map(float, steps)), tuple(map(float, first)))


def _packed(kind: str, values: NDArray[Any], scale: tuple[float, ...] = (), offset: tuple[float, ...] = ()) -> Packed:
    data = np.ascontiguousarray(values).astype(f"<{kind}").tobytes()
    return Packed(kind, tuple(values.shape), base64.b64encode(data).decode(), scale, offset)


def phases(shapes: NDArray[Any]) -> NDArray[Any]:
    """(m,) factors of magnitude one that make the real parts of shapes (n, m) as large as they can be."""
    if not np.iscomplexobj(shapes):
        return np.ones(shapes.shape[1])
    return np.asarray(np.exp(-0.5j * np.angle(np.sum(shapes**2, axis=0))))


def curve_view(look: str, freq_hz: Reals, values: NDArray[Any], phase: bool = True) -> CurveView:
    """Curves of `values` (functions, lines), 0 where not measured."""
    return CurveView(look, single(freq_hz), single(np.real(values)), single(np.imag(values)), phase)
