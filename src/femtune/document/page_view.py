"""The typed document of what moves on a page: numbers, texts, and arrays packed as base64 of little-endian values."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Packed:
    """An array: value = offset + scale · number, along the last axis where these have several entries.

    `type` is "u1", "u2", "u4", "i2" or "f4"; `data` is base64 of the numbers in C order, little-endian.
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
class FunctionsView:
    """Frequency response functions of one configuration, for a section of the page."""

    configuration: str
    ordinate: str
    titles: tuple[str, ...]
    curves: tuple[CurveView, ...]
    note: str = ""
    section: str = "responses"


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
class PageView:
    """All that moves on the page."""

    scenes: tuple[SceneView, ...] = ()
    functions: tuple[FunctionsView, ...] = ()
    history: HistoryView | None = None

    @property
    def empty(self) -> bool:
        """True where nothing can be shown."""
        return not (self.scenes or self.functions or self.history)

    def json(self) -> str:
        """As JSON that may stand inside a script element: without the characters that could end it."""
        text = json.dumps(asdict(self), separators=(",", ":"), allow_nan=False)
        return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
