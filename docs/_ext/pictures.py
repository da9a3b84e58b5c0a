"""The pictures of the landing page and the tutorial, drawn from the run of the tutorial: `make pictures`.

They are kept beside the pages, with the hash of what they were made from, so that building the documentation draws
nothing. A build with other sources warns.
"""

from __future__ import annotations

import hashlib
import re
import shlex
import tempfile
from contextlib import chdir
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

import femtune as ft
from femtune.cli import main
from femtune.modal import ModeSet

_DOCS = Path(__file__).resolve().parents[1]
_PICTURES = _DOCS / "_static" / "pictures"
_HASH = _PICTURES / "made-from.txt"
_FRAMES = 24
_VIEW = np.array([[0.87, -0.42, 0.0], [0.24, 0.46, 0.85]])  # to the right, upwards


def made_from() -> str:
    """Hash of the tutorial and of this module."""
    text = (_DOCS / "tutorial.md").read_bytes() + Path(__file__).read_bytes()
    return hashlib.sha256(text).hexdigest()


def are_current() -> bool:
    """Whether the pictures were made from the present tutorial."""
    return _HASH.exists() and _HASH.read_text(encoding="utf-8").strip() == made_from()


def moving_shape(corners: NDArray[np.float64], motion: NDArray[np.float64], title: str) -> str:
    """An SVG in which quadrilaterals move: `corners` and `motion` have the shape (elements, 4, 3)."""
    flat = np.concatenate([corners + motion, corners - motion]).reshape(-1, 3) @ _VIEW.T
    low, size = flat.min(axis=0), np.ptp(flat, axis=0)
    scale, margin = 600.0 / size[0], 12.0
    height = size[1] * scale + 2 * margin

    def placed(points: NDArray[np.float64]) -> NDArray[np.float64]:
        at = (points @ _VIEW.T - low) * scale
        return np.stack([at[..., 0] + margin, height - margin - at[..., 1]], axis=-1)

    phases = np.cos(2 * np.pi * np.arange(_FRAMES + 1) / _FRAMES)
    frames = np.stack([placed(corners + phase * motion) for phase in phases])
    strength = np.abs(motion).sum(axis=2).mean(axis=1)
    strength = strength / strength.max()
    shapes = []
    # far elements first, so that near ones cover them
    for e in np.argsort(-corners.mean(axis=1) @ np.array([-0.4, 1.0, 0.0])):
        values = [" ".join(f"{x:.1f},{y:.1f}" for x, y in frame) for frame in frames[:, e]]
        moving = f'<animate attributeName="points" dur="2.4s" repeatCount="indefinite" values="{";".join(values)}"/>'
        fill = f"hsl({215 - 200 * strength[e]:.0f},65%,58%)"
        shapes.append(f'<polygon points="{values[0]}" fill="{fill}">{moving}</polygon>')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 624 {height:.0f}" role="img"><title>{title}</title>'
        f'<g stroke="#33415588" stroke-width=".8" stroke-linejoin="round">{"".join(shapes)}</g></svg>\n'
    )


def make() -> None:
    """Run the tutorial in a temporary folder and draw its pictures."""
    mpl.use("Agg")
    mpl.rcParams["svg.hashsalt"] = "femtune"
    page = (_DOCS / "tutorial.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.S)
    commands = [c for block in re.findall(r"```\n(femtune.*?)```", page, re.S) for c in block.splitlines()]
    _PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        exec(compile(code, "plate.py", "exec"), {})
        for command in commands:
            try:
                main(shlex.split(command.removeprefix("femtune ")))
            except SystemExit as end:
                if end.code:
                    raise
        before, after = ft.correlate("study.toml"), ft.read_results("run")
        for name, result in (("before", before), ("after", after)):
            _save(ft.plot.mac(result), f"plate_mac_{name}.svg")
        _save(ft.plot.parameters(after), "plate_parameters.svg")
        modes = ft.modes("true.bdf", count=9)
        (shapes,) = modes.mode_sets.values()
        corners, motion = _plate(shapes, mode=7)
        drawn = moving_shape(corners, motion, f"Mode shape of the plate at {shapes.freq_hz[7]:.0f} Hz")
        (_PICTURES / "plate_moving.svg").write_text(drawn, encoding="utf-8")
    _HASH.write_text(made_from() + "\n", encoding="utf-8")


def _plate(shapes: ModeSet, mode: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners of the elements of the tutorial's plate, and how they move in a mode."""
    grid = np.array([[100 * j + i + 1 for i in range(13)] for j in range(9)])
    rows = {str(dof): k for k, dof in enumerate(shapes.dofs)}
    w = np.array([[shapes.shapes[rows[f"{g}Z+"], mode] for g in line] for line in grid])
    x, y = np.meshgrid(0.05 * np.arange(13), 0.05 * np.arange(9))
    at = np.stack([x, y, np.zeros_like(x)], axis=-1)
    moved = np.stack([np.zeros_like(w), np.zeros_like(w), 0.07 * w / np.abs(w).max()], axis=-1)
    ways = ((0, 0), (0, 1), (1, 1), (1, 0))
    quads = [np.stack([v[a : a + 8, b : b + 12] for a, b in ways], axis=2).reshape(-1, 4, 3) for v in (at, moved)]
    return quads[0], quads[1]


def _save(axes: Axes, name: str) -> None:
    axes.figure.savefig(_PICTURES / name, bbox_inches="tight", metadata={"Date": None})


if __name__ == "__main__":
    make()
