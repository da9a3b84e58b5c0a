"""Plots of results with matplotlib, for notebooks and papers; the functions take the results of the steps.

Each takes an optional `ax` to draw on and returns it; a plot with several panels returns its figure. The colours can be
distinguished by colour-blind readers and in grey print. matplotlib is imported at the first plot.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune._optional import require
from femtune.arguments import checked
from femtune.document.figures.shapes import COLOURS, closed, direction, far_to_near, mean_over_corners
from femtune.document.figures.svg import BLUE, INK, LINE, ORANGE, PALE, PALE_ORANGE, SOFT
from femtune.errors import FemtuneError, did_you_mean
from femtune.modal import FrfSet
from femtune.steps.correlate.result import CorrelateResult
from femtune.steps.modes.record import ModeShapes
from femtune.steps.modes.result import ModesResult
from femtune.steps.respond.result import RespondResult
from femtune.steps.run.result import RunResult
from femtune.steps.update.record.update import ParameterResult, UpdateResults
from femtune.units import frf_unit, unit_system

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from femtune.steps.correlate.record.correlation import CorrelationResults
    from femtune.steps.identify.result import IdentifyResult


__all__ = ["convergence", "frf", "mac", "modes", "parameters", "stabilisation"]

_MOST_NUMBERED_CELLS = 16
"""Largest number of rows or columns of a matrix whose cells have numbers; more would overlap in print."""
_DEFORMATION = 0.12
"""Largest displacement in a drawing, as a fraction of the structure's diagonal: visible, but still recognisable."""


@checked
def mac(
    result: CorrelateResult | RunResult | NDArray[np.float64],
    ax: Axes | None = None,
    *,
    configuration: str | None = None,
) -> Axes:
    """The MAC of test and model as a matrix, with frames around paired modes and values in the cells.

    Parameters
    ----------
    result : of `femtune.correlate`; of an update, for the model after it (``run.before`` for the model before it); or a
        matrix (test modes, model modes) of values in 0 … 1
    ax : axes to draw on; None: a new figure
    configuration : name of the configuration, if there are several

    Raises
    ------
    FemtuneError : ``study.unknown-configuration``, ``correlate.no-shapes``

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> ax = ft.plot.mac(ft.correlate(model, test))
    >>> ax.get_xlabel()
    'model mode: Hz'
    """
    if isinstance(result, np.ndarray):
        if result.ndim != 2:
            raise FemtuneError("plot.nothing-to-draw/matrix", dimensions=result.ndim)
        rows, columns = (tuple(str(i + 1) for i in range(n)) for n in result.shape)
        values, framed, titles = result, [], ("first set", "second set")
    else:
        compared = result.after if isinstance(result, RunResult) else result
        record = _only(compared, configuration)
        values = compared.macs[record.configuration] if record.mac_key else np.zeros((0, 0))
        if not values.size:
            raise FemtuneError("correlate.no-shapes")
        rows, columns = _mode_labels(record)
        at = {label: i for i, label in enumerate(record.mac_test_labels)}
        framed = [(at[p.test_label], p.model_number - 1) for p in record.pairs]
        titles = ("test mode: Hz", "model mode: Hz")
    return _matrix(ax or _axes(_side(columns) + 1.9, _side(rows) + 1.1), values, rows, columns, framed, titles)


def _only(result: CorrelateResult, configuration: str | None) -> CorrelationResults:
    return result._only("mac") if configuration is None else result[configuration]


def _mode_labels(record: CorrelationResults) -> tuple[tuple[str, ...], tuple[str, ...]]:
    rows = zip(record.mac_test_labels, record.mac_test_freq_hz)
    columns = zip(record.mac_model_numbers, record.mac_model_freq_hz)
    rigid = 1e-6 * max(record.mac_model_freq_hz, default=0.0)  # frequencies of rigid-body modes are rounding errors
    names = tuple(f"{n}: {f if f > rigid else 0.0:.4g}" for n, f in columns)
    return tuple(f"{label}: {f:.4g}" for label, f in rows), names


def _side(labels: Sequence[str]) -> float:
    return min(max(0.42 * len(labels), 2.0), 9.0)


def _matrix(
    ax: Axes,
    values: NDArray[np.float64],
    rows: Sequence[str],
    columns: Sequence[str],
    framed: Sequence[tuple[int, int]],
    titles: tuple[str, str],
) -> Axes:
    colours = require("matplotlib.colors").LinearSegmentedColormap.from_list("femtune", ["#f7fafd", *COLOURS[1:]])
    image = ax.imshow(values, vmin=0.0, vmax=1.0, cmap=colours, aspect="equal")
    ax.set_xticks(range(len(columns)), columns, rotation=90)
    ax.set_yticks(range(len(rows)), rows)
    ax.set_xlabel(titles[1])
    ax.set_ylabel(titles[0])
    ax.tick_params(length=0, labelsize=8)
    if max(values.shape) <= _MOST_NUMBERED_CELLS:
        for i, j in np.argwhere(np.isfinite(values)):
            colour = "white" if values[i, j] > 0.55 else INK
            ax.text(j, i, f"{values[i, j]:.2f}", ha="center", va="center", fontsize=7, color=colour)
        for i, j in np.argwhere(~np.isfinite(values)):
            ax.text(j, i, "–", ha="center", va="center", fontsize=7, color=SOFT)
    frame = require("matplotlib.patches").Rectangle
    for i, j in framed:
        ax.add_patch(frame((j - 0.47, i - 0.47), 0.94, 0.94, fill=False, edgecolor=ORANGE, linewidth=1.8))
    for side in ax.spines.values():
        side.set_visible(False)
    bar = ax.figure.colorbar(image, cax=ax.inset_axes((1.03, 0.0, 0.03, 1.0)), label="MAC")
    bar.outline.set_visible(False)
    return ax


@checked
def modes(
    result: ModesResult | RunResult,
    numbers: Sequence[int] | None = None,
    *,
    configuration: str | None = None,
    scale: float = 1.0,
) -> Figure:
    """Mode shapes of the model, each on a panel: undeformed structure in grey, mode shape in blue.

    Parameters
    ----------
    result : of `femtune.modes`, or of an update, for the model after it
    numbers : numbers of the modes, from 1; None: the first six elastic modes
    configuration : name of the configuration, if there are several; None: the first
    scale : factor on the default deformation

    Raises
    ------
    FemtuneError : ``study.unknown-configuration``, ``plot.nothing-to-draw`` if the model has nothing to draw, no
        stored shapes, or no such mode

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> figure = ft.plot.modes(ft.modes(example_deck()), [1, 2])
    >>> [ax.get_title() for ax in figure.axes]
    ['1: 28.27 Hz', '2: 44.7 Hz']
    """
    drawn = _drawn(result.results.mode_shapes, configuration)
    solved = next(m for m in result.results.modes if (m.configuration, m.stage) == (drawn.configuration, drawn.stage))
    arrays = {key: result.arrays[name] for key, name in drawn if key.endswith("_key") and name is not None}
    motion = arrays["translations_key"]
    chosen = list(numbers or range(solved.rigid_body_modes + 1, min(len(solved.freq_hz), motion.shape[2]) + 1)[:6])
    _check_numbers(chosen, motion.shape[2])
    across = min(len(chosen), 3)
    down = -(-len(chosen) // across)
    figure, panels = require("matplotlib.pyplot").subplots(
        down, across, figsize=(3.2 * across, 2.7 * down), squeeze=False, layout="constrained"
    )  # fmt: skip
    for ax, number in zip(panels.ravel(), chosen):
        _shape(ax, arrays, motion[:, :, number - 1], scale)
        rigid = "rigid body" if number <= solved.rigid_body_modes else f"{solved.freq_hz[number - 1]:.4g} Hz"
        ax.set_title(f"{number}: {rigid}", fontsize=9)
    for ax in panels.ravel()[len(chosen) :]:
        ax.remove()
    return figure


def _drawn(shapes: Sequence[ModeShapes], configuration: str | None) -> ModeShapes:
    """The shapes of a configuration at the last stage that has them."""
    names = [s.configuration for s in shapes]
    if configuration is not None and configuration not in names:
        raise FemtuneError(
            "study.unknown-configuration/no-shapes",
            hint=did_you_mean(configuration, names),
            configuration=configuration,
        )
    mine = [s for s in shapes if s.configuration == (configuration or names[0])]
    if not mine:
        raise FemtuneError("plot.nothing-to-draw/no-shapes")
    if mine[-1].points_key is None:
        raise FemtuneError("plot.nothing-to-draw", mine[-1].reason)
    return mine[-1]


def _check_numbers(numbers: Sequence[int], count: int) -> None:
    wrong = [n for n in numbers if not 1 <= n <= count]
    if wrong or not numbers:
        code = "plot.nothing-to-draw/mode" if wrong else "plot.nothing-to-draw/no-mode"
        raise FemtuneError(code, values={"modes": count}, mode=wrong[0] if wrong else None)


def _shape(ax: Axes, arrays: dict[str, NDArray[Any]], motion: NDArray[np.float64], scale: float) -> None:
    points, lines = arrays["points_key"], arrays["lines_key"].astype(int)
    faces = arrays["faces_key"].astype(int) if "faces_key" in arrays else np.zeros((0, 4), int)
    view = direction(points)
    size = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    largest = float(np.linalg.norm(motion, axis=1).max(initial=0.0)) or 1.0
    moved = points + scale * _DEFORMATION * size / largest * motion
    rest, bent = (points @ view.axes[:2].T, moved @ view.axes[:2].T)
    collections = require("matplotlib.collections")
    if len(faces):
        order = far_to_near(faces, view.depth(moved))
        shade = mean_over_corners(faces, np.linalg.norm(motion, axis=1)) / largest
        colours = require("matplotlib.colors").LinearSegmentedColormap.from_list("femtune", list(COLOURS))
        ax.add_collection(
            collections.PolyCollection(rest[closed(faces)], facecolors="#f1f3f5", edgecolors=LINE, linewidths=0.4)
        )
        fills = colours(shade[order])
        ax.add_collection(
            collections.PolyCollection(bent[closed(faces)[order]], facecolors=fills, edgecolors=BLUE, linewidths=0.3)
        )
    if len(lines):
        ax.add_collection(collections.LineCollection(rest[lines], colors=PALE, linewidths=0.9))
        ax.add_collection(collections.LineCollection(bent[lines], colors=BLUE, linewidths=1.6))
        ends = np.unique(lines)
        ax.plot(*bent[ends].T, "o", color=BLUE, markersize=2.0 if len(ends) < 200 else 0.0)
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.08)
    ax.autoscale_view()
    ax.set_axis_off()


@checked
def frf(
    result: RespondResult | IdentifyResult | FrfSet,
    output: str | None = None,
    input: str | None = None,
    *,
    configuration: str | None = None,
    ax: Axes | None = None,
) -> Axes | Figure:
    """Magnitude and phase of a frequency response function of the test and of the model.

    Parameters
    ----------
    result : of `femtune.respond`, with the functions of the test, if any; of `femtune.identify`, measured
        and synthesised; or an `FrfSet`
    output, input : labels, "12Z+"; None: the first
    configuration : name of the configuration, if there are several
    ax : axes for the magnitude alone; None: a figure with magnitude and phase

    Raises
    ------
    FemtuneError : ``study.unknown-configuration``, ``dof.missing``, ``response.nothing-asked``

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> found = ft.respond(example_deck(), inputs=["5Z+"], from_hz=1.0, to_hz=300.0, step_hz=0.5, ratio=0.01)
    >>> figure = ft.plot.frf(found)
    >>> figure.axes[1].get_xlabel()
    'frequency in Hz'
    """
    sets, unit = _functions(result, configuration)
    main = next(iter(sets.values()))
    i, j = _position(main.responses, output), _position(main.references, input)
    figure = None
    if ax is None:
        figure, (upper, lower) = require("matplotlib.pyplot").subplots(
            2, 1, sharex=True, height_ratios=[3, 1], figsize=(7.0, 4.4), layout="constrained"
        )  # fmt: skip
    else:
        upper, lower = ax, None
    for (label, frfs), look in zip(sets.items(), _LOOKS[: len(sets)] if len(sets) > 1 else _LOOKS[1:]):
        values = frfs.values[i, j]
        upper.semilogy(frfs.freq_hz, np.where(values == 0.0, np.nan, np.abs(values)), label=label, **look)
        if lower is not None:
            lower.plot(frfs.freq_hz, np.degrees(np.angle(values)), **look)
    upper.set_ylabel(f"|{main.kind}|" + (f" in {unit}" if unit else ""))
    upper.set_title(f"output {main.responses[i]}, input {main.references[j]}", loc="left", fontsize=10)
    if len(sets) > 1:
        upper.legend(frameon=False)
    _finish_functions(upper, lower)
    return figure if figure is not None else upper


_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": PALE_ORANGE, "linewidth": 3.5, "zorder": 1},
    {"color": BLUE, "linewidth": 1.2, "zorder": 2},
)


def _finish_functions(upper: Axes, lower: Axes | None) -> None:
    for ax in (upper, lower):
        if ax is not None:
            ax.grid(color=LINE, linewidth=0.6)
            ax.set_axisbelow(True)
            ax.spines[["top", "right"]].set_visible(False)
    (lower or upper).set_xlabel("frequency in Hz")
    (lower or upper).margins(x=0.0)
    if lower is not None:
        lower.set_ylabel("phase in °")
        lower.set_yticks([-180, -90, 0, 90, 180])
        lower.set_ylim(-190, 190)


def _functions(
    result: RespondResult | IdentifyResult | FrfSet, configuration: str | None
) -> tuple[dict[str, FrfSet], str]:
    """Functions by name, measured ones first, and their unit."""
    if isinstance(result, FrfSet):
        return {"function": result}, ""
    if isinstance(result, RespondResult):
        record = result._only("frf_set") if configuration is None else result[configuration]
        if record.frfs is None:
            raise FemtuneError("response.nothing-asked/no-frfs")
        measured = result.measured_sets.get(record.configuration)
        model = {"model": result.frf_sets[record.configuration]}
        return ({"test": measured} | model if measured is not None else model), record.frfs.unit
    if result.measured is None or result.synthesised is None:
        raise FemtuneError("response.nothing-asked/no-functions")
    unit = frf_unit(result.measured.kind, unit_system(result.record.units))
    return {"measured": result.measured, "synthesised": result.synthesised}, unit


def _position(dofs: Any, label: str | None) -> int:
    labels = [str(dof) for dof in dofs]
    if label is None:
        return 0
    if label not in labels:
        raise FemtuneError("dof.missing/function", hint=did_you_mean(label, labels), label=label)
    return labels.index(label)


@checked
def parameters(result: RunResult, ax: Axes | None = None) -> Axes:
    """Updated parameters with 95 % confidence intervals, as changes from their initial values; bounds in grey.

    A parameter at a bound has no interval and is shown as an orange square. Parameters with initial value zero are left
    out.

    Parameters
    ----------
    result : of `femtune.update`, `femtune.run` or `femtune.read_results`
    ax : axes to draw on; None: a new figure

    Raises
    ------
    FemtuneError : ``plot.nothing-to-draw`` for results without an update

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> names = {"root": "PBAR 1 I1", "tip": "PBAR 2 I1"}
    >>> free = [ft.Parameter(name, fields=[field], lower=0.5, upper=2.0) for name, field in names.items()]
    >>> ax = ft.plot.parameters(ft.update(model, test, parameters=free))
    >>> [label.get_text() for label in ax.get_yticklabels()]
    ['root', 'tip']
    """
    update = _updated(result)
    facts = {p.name: p for p in result.results.parameters}
    shown = [p for p in update.parameters if facts[p.name].nominal]
    ax = ax or _axes(6.4, 1.1 + 0.36 * len(shown))
    for i, p in enumerate(shown):
        nominal = facts[p.name].nominal
        ends = [_percent(b, nominal) for b in (facts[p.name].lower, facts[p.name].upper) if b is not None]
        if len(ends) == 2:
            ax.plot(ends, [i, i], color=LINE, linewidth=5.0, solid_capstyle="butt", zorder=0)
        _estimate(ax, i, p, nominal)
    ax.axvline(0.0, color=SOFT, linewidth=0.8)
    ax.set_yticks(range(len(shown)), [p.name for p in shown])
    ax.set_ylim(len(shown) - 0.5, -0.5)
    ax.set_xlabel("change in % of the initial value; blue: 95 % interval, grey: bounds")
    ax.tick_params(axis="y", length=0)
    ax.spines[["top", "right", "left"]].set_visible(False)
    return ax


def _percent(value: float, nominal: float) -> float:
    return 100.0 * (value - nominal) / abs(nominal)


def _estimate(ax: Axes, i: int, p: ParameterResult, nominal: float) -> None:
    change = _percent(p.value, nominal)
    text = f"{change:+.3g}"
    if p.interval_95 is not None:
        ends = sorted(_percent(end, nominal) for end in p.interval_95)
        ax.plot(ends, [i, i], color=BLUE, linewidth=1.6, marker="|", markersize=8.0)
        text += f" % ({ends[0]:+.3g} … {ends[1]:+.3g})"
    else:
        text += f" % ({p.sd_reason})" if p.sd_reason else " %"
    text = text.replace("-", "−")
    ax.plot([change], [i], "s" if p.at_bound else "o", color=ORANGE if p.at_bound else BLUE, markersize=4.5)
    ax.annotate(
        text, (1.0, i), xycoords=("axes fraction", "data"), xytext=(6, 0), textcoords="offset points", va="center",
        fontsize=8, color=INK,
    )  # fmt: skip


def _updated(result: RunResult) -> UpdateResults:
    if result.results.update is None:
        raise FemtuneError("plot.nothing-to-draw")
    return result.results.update


@checked
def convergence(result: RunResult, ax: Axes | None = None) -> Axes | Figure:
    """Convergence of the update: weighted mean error over the iterations, and the parameters in a second panel.

    Parameters
    ----------
    result : of `femtune.update`, `femtune.run` or `femtune.read_results`
    ax : axes for the error alone; None: a figure with both panels

    Raises
    ------
    FemtuneError : ``plot.nothing-to-draw`` for results without an update

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> free = [ft.Parameter("root", fields=["PBAR 1 I1"], lower=0.5, upper=2.0)]
    >>> figure = ft.plot.convergence(ft.update(model, test, parameters=free))
    >>> figure.axes[0].get_ylabel()
    'weighted mean error in %'
    """
    update = _updated(result)
    numbers = [i.iteration for i in update.history]
    figure = None
    if ax is None:
        figure, (ax, values) = require("matplotlib.pyplot").subplots(1, 2, figsize=(8.6, 3.2), layout="constrained")
        _way_of_parameters(values, result, update, numbers)
    assert ax is not None
    ax.semilogy(numbers, [i.objective_percent for i in update.history], "o-", color=BLUE, markersize=4, linewidth=1.2)
    ax.set_ylabel("weighted mean error in %")
    ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    _finish_iterations(ax)
    return ax if figure is None else figure


_STYLES = ("-", "--", "-.", ":")
_SAFE = ("#1f5a92", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#5b6977")
"""Colours that colour-blind readers tell apart (Okabe and Ito 2008, the blue darkened)."""


def _way_of_parameters(ax: Axes, result: RunResult, update: UpdateResults, numbers: Sequence[int]) -> None:
    nominal = {p.name: p.nominal for p in result.results.parameters}
    for k, name in enumerate(update.history_parameters):
        if nominal[name]:
            way = [_percent(i.parameters[k], nominal[name]) for i in update.history]
            style = _STYLES[(k // len(_SAFE)) % len(_STYLES)]
            ax.plot(
                numbers, way, style, marker="o", markersize=3, color=_SAFE[k % len(_SAFE)], linewidth=1.2, label=name
            )
    ax.set_ylabel("parameters: change in %")
    ax.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    _finish_iterations(ax)


def _finish_iterations(ax: Axes) -> None:
    ax.set_xlabel("iteration")
    ax.xaxis.set_major_locator(require("matplotlib.ticker").MaxNLocator(integer=True))
    ax.grid(color=LINE, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


@checked
def stabilisation(result: IdentifyResult, ax: Axes | None = None) -> Axes:
    """Poles over the model order, stable ones dark, over the measured functions or spectra; lines at the chosen modes.

    Parameters
    ----------
    result : of `femtune.identify`
    ax : axes to draw on; None: a new figure

    Raises
    ------
    FemtuneError : ``plot.nothing-to-draw`` if the method has no model orders

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> lines = {"from_hz": 5.0, "to_hz": 400.0, "step_hz": 0.25}
    >>> points = ["2Z+", "3Z+", "4Z+", "5Z+"]
    >>> made = ft.respond(
    ...     example_deck(), inputs=["5Z+"], outputs=points, ratio=0.01, uff="frfs.uff", units="m-kg-s", **lines
    ... )
    >>> found = ft.identify("frfs.uff", output="identified", largest_order=20)
    >>> ax = ft.plot.stabilisation(found)
    >>> ax.get_ylabel()
    'model order'
    """
    table = result.found.table
    if table is None:
        raise FemtuneError("plot.nothing-to-draw/stabilisation")
    ax = ax or _axes(7.6, 4.2)
    curve = result.found.curve
    if len(curve.freq_hz):
        behind = ax.twinx()
        behind.plot(curve.freq_hz, curve.level_db, color=PALE, linewidth=0.9)
        behind.set_ylabel(f"{curve.words} in dB", color=SOFT)
        behind.tick_params(axis="y", colors=SOFT, length=0)
        behind.spines[:].set_visible(False)
        ax.set_zorder(behind.get_zorder() + 1)
        ax.patch.set_visible(False)
        ax.set_xlim(curve.freq_hz[0], curve.freq_hz[-1])
    _poles(ax, result)
    for mode in result.record.modes:
        colour, dashes = (ORANGE, "--") if mode.of_input else (BLUE, ":")
        ax.axvline(mode.freq_hz, linewidth=0.9, zorder=0, color=colour, linestyle=dashes)
    ax.set_xlabel("frequency in Hz; dotted: chosen modes")
    ax.set_ylabel("model order")
    ax.yaxis.set_major_locator(require("matplotlib.ticker").MaxNLocator(integer=True))
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4)
    return ax


def _poles(ax: Axes, result: IdentifyResult) -> None:
    poles = result.poles
    freq, order = poles.column("freq_hz"), poles.column("order")
    firm, method = poles.column("stable").astype(bool), poles.column("method")
    ax.plot(freq[~firm], order[~firm], ".", color=PALE, markersize=2.5, label="not stable")
    for mark, colour, name in zip("o^sDv", _SAFE, dict.fromkeys(method)):
        of_method = firm & (method == name)
        ax.plot(freq[of_method], order[of_method], mark, color=colour, markersize=3.2, label=f"{name}, stable")


def _axes(width_in: float, height_in: float) -> Axes:
    """A new figure of one panel."""
    _, ax = require("matplotlib.pyplot").subplots(figsize=(width_in, height_in), layout="constrained")
    return ax
