"""The function `view`: a moving mode in a window or in a picture, for models too large for the page."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from femtune._optional import require
from femtune.arguments import checked
from femtune.errors import FemtuneError, Where
from femtune.files.study_file import StudyFile, is_deck, read_study_file
from femtune.files.whole_file import check_writable, write_whole
from femtune.steps.modes.run import solve_modes
from femtune.steps.run_folder import read_results
from femtune.study.described import source_of
from femtune.study.inputs import check_outputs, named_inputs
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.study.described import Model, Study
    from femtune.study.progress import Progress

_LARGEST_MOTION = 0.1
"""Largest motion that is drawn, relative to the diagonal of the model.

It is clearly visible and does not distort the form.
"""
_CELLS_WITHOUT_MIDSIDE = {1, 3, 5, 9, 10, 12, 13, 14}
"""Types of VTK cells without mid-side points.

Others are divided into triangles for drawing, whose edges are not those of the elements.
"""
_MOST_ELEMENTS_WITH_EDGES = 50_000
"""Elements up to which edges are drawn: those of finer meshes cover the faces and slow the motion down."""
_MOST_DRAWS = 200
"""Samples that are shown: each takes a solution and a mesh in memory."""
_FRAME_MS = 40
"""Time between two frames in ms: 25 frames per second look continuous."""
_FRAMES_PER_PERIOD = 48
"""Frames of one period, which lasts about two seconds."""


@checked
def view(
    source: Path | str | Study | Model,
    *,
    mode: int | None = None,
    configuration: str | None = None,
    count: int | None = None,
    max_hz: float | None = None,
    picture: Path | str | None = None,
    draws: int | None = None,
    fresh: bool = False,
    progress: Progress = silent,
) -> Path | None:
    """Show a moving mode of a model in a window of PyVista; a slider chooses the mode. Requires the extra ``view``.

    Parameters
    ----------
    source : a study, or a model: an object, or the path of a TOML file or of a deck
    mode : number of the mode that is shown first, from 1; the first elastic mode if it is not given
    configuration : name of the configuration; the first if it is not given
    count, max_hz : number of modes, or highest frequency in Hz, as for `modes`
    picture : PNG file to write, with the largest motion, in place of a window
    draws : number of samples of the posterior in the run folder of a study, at which the modes are solved; a slider
        goes through them, a picture has all of them
    fresh : ignore the journal of an earlier run of the study and solve everything again
    progress : receives progress reports

    Returns
    -------
    The picture, None for a window that was closed

    Raises
    ------
    FemtuneError : ``install.missing``, ``view.*``, ``study.unknown-configuration``, and as `modes`

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> ft.view(example_deck(), count=3, mode=2, picture="mode_2.png")  # doctest: +SKIP
    PosixPath('mode_2.png')
    """
    pyvista = require("pyvista", extra="view")
    file = None if picture is None else Path(picture)
    _check_screen(file)
    described = source_of(source)
    if file is not None and (isinstance(described, StudyFile) or not is_deck(described)):
        study = described if isinstance(described, StudyFile) else read_study_file(described)
        check_outputs(named_inputs(study), [file])
    models: list[Path | str | StudyFile] = [described] if draws is None else [*_at_draws(described, draws)]
    views: list[_View] = []
    for i, one in enumerate(models):
        if len(models) > 1:
            progress.step("solving at the samples", i, len(models))
        with tempfile.TemporaryDirectory() as folder:
            vtu = Path(folder) / "shapes.vtu"
            result = solve_modes(
                one, progress, fresh=fresh, count=count, max_hz=max_hz, simulate=None, vtu=vtu, page=None
            )
            names = [record.configuration for record in result.records]
            if configuration is not None and configuration not in names:
                raise FemtuneError("study.unknown-configuration/name", configuration=configuration, first=names[0])
            at = 0 if configuration is None else names.index(configuration)
            mesh = pyvista.read(vtu if len(names) == 1 else vtu.with_name(f"shapes_{at + 1}.vtu"))
        record = result.records[at]
        if not views:
            first = min(record.rigid_body_modes + 1, len(record.freq_hz)) if mode is None else mode
            if not 1 <= first <= len(record.freq_hz):
                raise FemtuneError("view.mode", mode=first, modes=len(record.freq_hz))
        shapes = [name for name in mesh.point_data if name.startswith("mode ")]
        found = _View(mesh, shapes, tuple(record.freq_hz))
        views.append(_like(views[0], found) if views else found)
    if file is None:
        _window(pyvista, views, first)
        return None
    # without a screen VTK writes a warning and draws all the same
    log = require("vtkmodules.vtkCommonCore").vtkLogger
    log.SetStderrVerbosity(log.VERBOSITY_ERROR)
    plotter = _plotter(pyvista, views, first, off_screen=True)
    with tempfile.TemporaryDirectory() as folder:
        drawn = Path(folder) / "mode.png"
        plotter.screenshot(drawn)
        write_whole(file, drawn.read_bytes())
    plotter.close()
    return file


@dataclass(frozen=True, eq=False)
class _View:
    """A mesh with shapes, and the names and frequencies (modes,) of these in the order of the modes."""

    mesh: Any
    shapes: list[str]
    freq_hz: tuple[float, ...]


def _at_draws(described: Path | str | StudyFile, draws: int) -> list[StudyFile]:
    """The study with the values of some samples, evenly spaced over their weights.

    Raises
    ------
    FemtuneError : ``view.draws`` without samples, or for a number of them that cannot be
    """
    if not isinstance(described, StudyFile) and is_deck(described):
        raise FemtuneError("view.draws/deck")
    if not 1 <= draws <= _MOST_DRAWS:
        raise FemtuneError("view.draws/number", draws=draws, most=_MOST_DRAWS)
    study = described if isinstance(described, StudyFile) else read_study_file(described)
    results, arrays = read_results(study.output_folder)
    record = results.posterior
    if record is None:
        raise FemtuneError("view.draws")
    samples, weights = arrays[record.samples_key], arrays[record.weights_key]
    rows = np.searchsorted(np.cumsum(weights), (np.arange(draws) + 0.5) / draws * weights.sum())
    chosen = samples[np.minimum(rows, len(samples) - 1)]
    return [_with_values(study, dict(zip(record.free, map(float, values)))) for values in chosen]


def _with_values(study: StudyFile, values: dict[str, float]) -> StudyFile:
    entries = [p.model_copy(update={"nominal": values[p.name]}) if p.name in values else p for p in study.parameter]
    return study.model_copy(update={"parameter": tuple(entries)})


def _like(first: _View, other: _View) -> _View:
    """The other with its shapes in the order of those of the first that they are most like."""
    ours, theirs = (np.array([np.ravel(v.mesh.point_data[name]) for name in v.shapes]) for v in (first, other))
    # a mode that moves no point of the mesh is like none
    size = np.maximum(np.linalg.norm(ours, axis=1)[:, None] * np.linalg.norm(theirs, axis=1), np.finfo(float).tiny)
    cosine = np.abs(ours @ theirs.T) / size
    _, order = linear_sum_assignment(-cosine)
    # the signs of shapes are arbitrary
    for i, k in enumerate(order):
        if ours[i] @ theirs[k] < 0.0:
            other.mesh.point_data[other.shapes[k]] = -np.asarray(other.mesh.point_data[other.shapes[k]])
    return replace(
        other, shapes=[other.shapes[k] for k in order], freq_hz=tuple(other.freq_hz[k] for k in order)
    )  # fmt: skip


def _check_screen(picture: Path | None) -> None:
    if picture is None:
        if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise FemtuneError("view.no-screen")
        return
    if picture.suffix.lower() != ".png":
        raise FemtuneError("view.picture/suffix", where=Where(str(picture)))
    try:
        check_writable(picture)
    except (OSError, ValueError) as error:
        raise FemtuneError(
            "view.picture", where=Where(str(picture)), reason=getattr(error, "strerror", None) or error
        ) from error


def _plotter(pyvista: Any, views: Sequence[_View], mode: int, *, off_screen: bool) -> Any:
    plotter = pyvista.Plotter(off_screen=off_screen, window_size=(1280, 900))
    plotter.set_background("white")
    plotter.add_mesh(views[0].mesh.copy(), style="wireframe", color="#d4dae0", name="at rest")
    for i, one in enumerate(views[1:] if off_screen else ()):
        _draw(plotter, one.mesh, one.shapes[mode - 1], 1.0, name=f"sample {i}", opacity=0.35)
    _draw(plotter, views[0].mesh, views[0].shapes[mode - 1], 1.0)
    if len(views) > 1:
        told = ", ".join(dict.fromkeys(_range_of(views, mode)))
        plotter.add_text(f"{len(views)} samples of the posterior: {told}", name="title", font_size=12, color="black")
    plotter.add_axes()
    return plotter


def _range_of(views: Sequence[_View], mode: int) -> tuple[str, str]:
    """Names of the mode with the lowest and the highest frequency."""
    ordered = sorted(views, key=lambda v: v.freq_hz[mode - 1])
    return ordered[0].shapes[mode - 1], ordered[-1].shapes[mode - 1]


def _draw(plotter: Any, mesh: Any, shape: str, phase: float, name: str = "shape", opacity: float = 1.0) -> None:
    motion = np.asarray(mesh.point_data[shape])
    size = np.linalg.norm(motion, axis=1)
    largest = float(size.max()) or 1.0
    moved = mesh.copy()
    moved.points = mesh.points + phase * _LARGEST_MOTION * mesh.length / largest * motion
    moved.point_data["displacement"] = size / largest
    edges = (
        mesh.n_cells < _MOST_ELEMENTS_WITH_EDGES and {int(kind) for kind in mesh.celltypes} <= _CELLS_WITHOUT_MIDSIDE
    )
    plotter.add_mesh(
        moved, scalars="displacement", cmap="Blues", clim=(0.0, 1.0), show_edges=edges,
        line_width=2.0, name=name, opacity=opacity, reset_camera=False,
        scalar_bar_args={"title": "displacement / largest"},
    )  # fmt: skip
    plotter.add_text(shape, name="title", font_size=12, color="black")


def _window(pyvista: Any, views: Sequence[_View], mode: int) -> None:
    shown, shapes = {"mode": mode, "frame": 0, "sample": 1}, views[0].shapes
    plotter = _plotter(pyvista, views, mode, off_screen=False)

    def take(value: float) -> None:
        shown["sample"] = round(value)

    def choose(value: float) -> None:
        shown["mode"] = round(value)

    def move(_: int) -> None:
        shown["frame"] += 1
        one = views[shown["sample"] - 1]
        phase = float(np.cos(2.0 * np.pi * shown["frame"] / _FRAMES_PER_PERIOD))
        _draw(plotter, one.mesh, one.shapes[shown["mode"] - 1], phase)

    if len(shapes) > 1:
        plotter.add_slider_widget(choose, (1, len(shapes)), value=mode, title="mode", fmt="%.0f", color="black")
    if len(views) > 1:
        plotter.add_slider_widget(
            take,
            (1, len(views)),
            value=1,
            title="sample",
            fmt="%.0f",
            color="black",
            pointa=(0.4, 0.1),
            pointb=(0.9, 0.1),
        )
    plotter.add_timer_event(max_steps=10**9, duration=_FRAME_MS, callback=move)
    plotter.show()
