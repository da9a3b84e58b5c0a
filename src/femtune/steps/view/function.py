"""The function `view`: a moving mode in a window or in a picture, for models too large for the page."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune._optional import require
from femtune.arguments import checked
from femtune.errors import FemtuneError, Where
from femtune.files.study_file import StudyFile, is_deck, read_study_file
from femtune.files.whole_file import check_writable, write_whole
from femtune.steps.modes.function import modes
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
    with tempfile.TemporaryDirectory() as folder:
        vtu = Path(folder) / "shapes.vtu"
        result = modes(source, count=count, max_hz=max_hz, vtu=vtu, fresh=fresh, progress=progress)
        names = [record.configuration for record in result.records]
        if configuration is not None and configuration not in names:
            raise FemtuneError("study.unknown-configuration/name", configuration=configuration, first=names[0])
        at = 0 if configuration is None else names.index(configuration)
        mesh = pyvista.read(vtu if len(names) == 1 else vtu.with_name(f"shapes_{at + 1}.vtu"))
    record = result.records[at]
    first = min(record.rigid_body_modes + 1, len(record.freq_hz)) if mode is None else mode
    if not 1 <= first <= len(record.freq_hz):
        raise FemtuneError("view.mode", mode=first, modes=len(record.freq_hz))
    shapes = [name for name in mesh.point_data if name.startswith("mode ")]
    if file is None:
        _window(pyvista, mesh, shapes, first)
        return None
    # without a screen VTK writes a warning and draws all the same
    log = require("vtkmodules.vtkCommonCore").vtkLogger
    log.SetStderrVerbosity(log.VERBOSITY_ERROR)
    plotter = _plotter(pyvista, mesh, shapes, first, off_screen=True)
    with tempfile.TemporaryDirectory() as folder:
        drawn = Path(folder) / "mode.png"
        plotter.screenshot(drawn)
        write_whole(file, drawn.read_bytes())
    plotter.close()
    return file


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


def _plotter(pyvista: Any, mesh: Any, shapes: Sequence[str], mode: int, *, off_screen: bool) -> Any:
    plotter = pyvista.Plotter(off_screen=off_screen, window_size=(1280, 900))
    plotter.set_background("white")
    plotter.add_mesh(mesh.copy(), style="wireframe", color="#d4dae0", name="at rest")
    _draw(plotter, mesh, shapes[mode - 1], 1.0)
    plotter.add_axes()
    return plotter


def _draw(plotter: Any, mesh: Any, shape: str, phase: float) -> None:
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
        line_width=2.0, name="shape", reset_camera=False, scalar_bar_args={"title": "displacement / largest"},
    )  # fmt: skip
    plotter.add_text(shape, name="title", font_size=12, color="black")


def _window(pyvista: Any, mesh: Any, shapes: Sequence[str], mode: int) -> None:
    shown = {"mode": mode, "frame": 0}
    plotter = _plotter(pyvista, mesh, shapes, mode, off_screen=False)

    def choose(value: float) -> None:
        shown["mode"] = round(value)

    def move(_: int) -> None:
        shown["frame"] += 1
        _draw(
            plotter, mesh, shapes[shown["mode"] - 1], float(np.cos(2.0 * np.pi * shown["frame"] / _FRAMES_PER_PERIOD))
        )

    if len(shapes) > 1:
        plotter.add_slider_widget(choose, (1, len(shapes)), value=mode, title="mode", fmt="%.0f", color="black")
    plotter.add_timer_event(max_steps=10**9, duration=_FRAME_MS, callback=move)
    plotter.show()
