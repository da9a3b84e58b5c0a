"""The pictures of the landing page, the tutorial and the guide, from runs of the tutorial's plate: `make pictures`.

They are kept beside the pages, with the hash of what they were made from, so that building the documentation draws
nothing. A build with other sources warns. The pictures of the guide are those of the reports that the commands write.
"""

from __future__ import annotations

import base64
import hashlib
import html
import re
import shlex
import shutil
import subprocess
import tempfile
from contextlib import chdir
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from PIL import Image

import femtune as ft
from femtune.cli import main
from femtune.modal import ModeSet
from femtune.steps.exit_codes import ENDED, NOT_ACCEPTED, RESERVATIONS

_DOCS = Path(__file__).resolve().parents[1]
_PICTURES = _DOCS / "_static" / "pictures"
_HASH = _PICTURES / "made-from.txt"
_FRAMES = 24
_VIEW = np.array([[0.87, -0.42, 0.0], [0.24, 0.46, 0.85]])  # to the right, upwards

_STUDY = """
[study]
title = "plate"
deck = "plate.bdf"
units = "m-kg-s"

[modes]
max_hz = 592.0

[[parameter]]
name = "T_plate"
fields = ["PSHELL 1 T"]
lower = 0.8
upper = 1.25

[[parameter]]
name = "T_strip"
fields = ["PSHELL 2 T"]
lower = 0.8
upper = 1.25
"""
_MATERIAL = """
[[parameter]]
name = "E"
fields = ["MAT1 1 E"]
lower = 0.8
upper = 1.25

[[parameter]]
name = "density"
fields = ["MAT1 1 RHO"]
lower = 0.8
upper = 1.25
"""
_MODES = """
[test]
file = "test.uff"

[residuals]
frequency_sd = 0.002
shape_sd = 0.01
"""
_FRFS = """
[test]
file = "frfs.uff"

[[residual]]
kind = "frf"
form = "log-complex"
sd = 0.03
floor = 0.001
to_hz = 300.0
ratio = 0.01

[response]
ratio = 0.01

[bootstrap]
runs = 200
"""
_HELD_OUT = """
[[hold_out]]
above_hz = 300.0

[validate]
profile = "ECSS"
frequency_sd = 0.002
shape_sd = 0.01
"""
_SPECIMENS = "\n".join(
    f'[[configuration]]\nname = "{n}"\nspecimen = "{n}"\ntest = "{n}.uff"\n' for n in ("P1", "P2", "P3")
)
_STUDIES = {
    "modes": _STUDY + _MODES,
    "material": _STUDY + _MATERIAL + _MODES,
    "candidates": _STUDY + _MATERIAL + _MODES + '\n[candidates]\nsubsets = "all"\nmost = 3\n',
    "starts": _STUDY + _MODES + "\n[update]\nstarts = 20\nsamples = 40\n",
    "frfs": _STUDY + _FRFS,
    "held_out": _STUDY + _MODES + _HELD_OUT,
    "specimens": _STUDY.replace("lower", "individual = true\nlower")
    + _SPECIMENS
    + "\n[residuals]\nfrequency_sd = 0.002\nshape_sd = 0.01\n",
}
"""Text of the studies of the guide's pictures."""
_SENSORS = '--sensor "1 THRU 13:3" --sensor "401 THRU 413:3" --sensor "801 THRU 813:3"'
_COMMANDS = (
    "respond true.bdf --input 1Z+ --output 1Z+ --output 407Z+ --output 813Z+ --from 60 --to 320 --step 0.5 --ratio 0.01"
    " --scatter 0.03 --floor 0.001 --uff frfs.uff --units m-kg-s",
    *(
        f"modes P{n}.bdf --count 16 --uff P{n}.uff {_SENSORS} --units m-kg-s --frequency-scatter 0.002"
        f" --shape-scatter 0.01 --seed {n}"
        for n in (1, 2, 3)
    ),
    "modes plate.bdf --count 12 --report modes.html",
    "plan plate.bdf --band 60 400 --uniaxial 12 --exciters 2 --units m-kg-s --report plan.html",
    "respond frfs.toml --report respond.html",
    "identify frfs.uff --output identified",
    "screen material.toml --array L9 --levels 3 --report screen.html",
    "search modes.toml --runs 30 --report search.html",
    "candidates candidates.toml --output candidates --report candidates.html",
    *(f"run {name}.toml --output {name}" for name in _STUDIES if name != "candidates"),
)
_GUIDE = {
    "modes": ("modes.html", "Mode shapes of baseline. 7"),
    "plan": ("plan.html", "The structure with"),
    "respond": ("respond.html", "Frequency responses"),
    "identify": ("identified/report.html", "Stabilisation"),
    "screen": ("screen.html", "Mean frequency of the runs of each level"),
    "search": ("search.html", "Smallest"),
    "candidates": ("candidates.html", "Mean error of each candidate"),
    "correlate": ("modes/report.html", "baseline, MAC before"),
    "update": ("modes/report.html", "Weighted mean error"),
    "residuals": ("modes/report.html", "Scaled sensitivities"),
    "select": ("material/report.html", "Coefficients by parameter"),
    "parameters": ("material/report.html", "Updated parameters"),
    "multi-start": ("starts/report.html", "1 optimum"),
    "residuals-frf": ("frfs/report.html", "Frequency responses"),
    "bootstrap": ("frfs/report.html", "Distribution of the parameters"),
    "validate": ("held_out/report.html", "Errors of"),
    "specimens": ("specimens/report.html", "Individual parameters of the specimens"),
}
"""Page of the guide, with the report that shows its picture, and the beginning of the picture's text."""


def _steps() -> tuple[str, list[str]]:
    """The script of the tutorial, and its commands."""
    page = (_DOCS / "tutorial.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.S)
    return code, [c for block in re.findall(r"```\n(femtune.*?)```", page, re.S) for c in block.splitlines()]


def made_from() -> str:
    """Hash of the steps of the tutorial and of this module."""
    code, commands = _steps()
    return hashlib.sha256("\n".join([code, *commands]).encode() + Path(__file__).read_bytes()).hexdigest()


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
    code, commands = _steps()
    _PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        exec(compile(code, "plate.py", "exec"), {})
        for command in commands:
            _run(command.removeprefix("femtune "))
        before, after = ft.correlate("study.toml"), ft.read_results("run")
        for name, result in (("before", before), ("after", after)):
            _save(ft.plot.mac(result), f"plate_mac_{name}.svg")
        _save(ft.plot.parameters(after), "plate_parameters.svg")
        # of the model that the run has written, as all else on the landing page
        modes = ft.modes("run/updated.bdf", count=9)
        (shapes,) = modes.mode_sets.values()
        corners, motion = _plate(shapes, mode=7)
        drawn = moving_shape(corners, motion, f"Mode shape of the plate at {shapes.freq_hz[7]:.0f} Hz")
        (_PICTURES / "plate_moving.svg").write_text(drawn, encoding="utf-8")
        _screenshot(Path("run/report.html"), _PICTURES / "report.png")
        _make_guide()
    _HASH.write_text(made_from() + "\n", encoding="utf-8")


def _run(command: str) -> None:
    try:
        main([*shlex.split(command)])
    except SystemExit as end:
        # a verdict is a result of the tutorial; the mesh of its plate is too coarse for another one
        if end.code not in (ENDED, RESERVATIONS, NOT_ACCEPTED):
            raise


def _make_guide() -> None:
    """The pictures of the guide, in the folder where the tutorial has run."""
    for n, (plate, strip) in enumerate(((0.0049, 0.0072), (0.005, 0.0073), (0.0048, 0.0075)), start=1):
        deck = Path("plate.bdf").read_text(encoding="utf-8")
        deck = deck.replace("PSHELL,1,1,0.0050", f"PSHELL,1,1,{plate}").replace(
            "PSHELL,2,1,0.0080", f"PSHELL,2,1,{strip}"
        )
        Path(f"P{n}.bdf").write_text(deck, encoding="utf-8")
    for name, text in _STUDIES.items():
        Path(f"{name}.toml").write_text(text, encoding="utf-8")
    for command in _COMMANDS:
        _run(command)
    for page, (report, alt) in _GUIDE.items():
        (_PICTURES / f"guide_{page}.svg").write_bytes(_picture(Path(report).read_text(encoding="utf-8"), alt))


def _screenshot(page: Path, picture: Path) -> None:
    """The first screen of a page, drawn by Chromium. Without Chromium the picture stays as it is."""
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        print(f"{picture} stays as it is: no Chromium on this machine")
        return
    shot = Path("shot.png").resolve()
    flags = ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1100,900", "--hide-scrollbars")
    where = (f"--user-data-dir={Path('profile').resolve()}", f"--screenshot={shot}", page.resolve().as_uri())
    subprocess.run([chromium, *flags, *where], check=True, capture_output=True, timeout=120)
    Image.open(shot).convert("RGB").quantize(64, dither=Image.Dither.NONE).save(picture, optimize=True)


def _picture(report: str, alt: str) -> bytes:
    """The picture of a report whose text begins with `alt`."""
    found = re.findall(r'<img src="data:image/svg\+xml;base64,([^"]*)"[^>]* alt="([^"]*)"', report)
    for data, text in found:
        if html.unescape(text).startswith(alt):
            return base64.b64decode(data)
    raise ValueError(f"no picture whose text begins with {alt!r}; there are {[text[:60] for _, text in found]}")


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
