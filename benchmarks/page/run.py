"""The page of moving shapes against the size of the model: python benchmarks/page/run.py [--evidence docs/evidence].

The page is that of `femtune modes`, with modes of a simply supported square plate in closed form in place of computed
ones, so that only the page is measured. Chromium, Node and the packages of `web/` (`make web`) are required.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import femtune as ft
from femtune.reporting.html import write_html
from femtune.steps.report.build import build_page
from femtune.steps.results import Results
from femtune.study.drawn_mesh import DrawnMesh, thinned

ROOT = Path(__file__).resolve().parents[2]
SIZES = (5_000, 20_000, 50_000, 200_000, 500_000)
MODES = 20
GRIDS = 6
"""Along each side of the plate that is solved: its results have all tables of the page."""


@dataclass(frozen=True)
class Measured:
    """A page: elements of the model, faces that are drawn, stored modes, and what it costs."""

    elements: int
    faces: int
    modes: int
    megabytes: float
    made_seconds: float
    load_seconds: float
    frames_per_second: float


def deck_text() -> str:
    """A plate that is held along one edge."""
    step, at = 1.0 / (GRIDS - 1), range(GRIDS)
    grids = [f"GRID,{GRIDS * i + j + 1},,{i * step:.3f},{j * step:.3f},0." for i in at for j in at]
    corners = [GRIDS * i + j + 1 for i in at[:-1] for j in at[:-1]]
    cells = [f"CQUAD4,{n},1,{n},{n + GRIDS},{n + GRIDS + 1},{n + 1}" for n in corners]
    held = [f"SPC1,1,123456,1,THRU,{GRIDS}", "PSHELL,1,1,.01,1,,1", "MAT1,1,2.1+11,,.3,7850."]
    return "\n".join(["SOL 103", "CEND", "SPC = 1", "BEGIN BULK", *grids, *cells, *held, "ENDDATA\n"])


def plate(side: int) -> tuple[DrawnMesh, dict[str, NDArray[Any]]]:
    """The drawn mesh of side × side elements, and the arrays of its modes."""
    x, y = (a.ravel() for a in np.meshgrid(*[np.linspace(0.0, 1.0, side + 1)] * 2, indexing="ij"))
    row = np.arange(x.size).reshape(side + 1, side + 1)
    faces = np.stack([row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]], axis=-1).reshape(-1, 4)
    whole = DrawnMesh(np.zeros((0, 2), np.int64), np.zeros(0, np.int64), faces)
    points = np.column_stack([x, y, np.zeros_like(x)])
    mesh = thinned(points, whole)
    rows = mesh.used
    waves = np.array([(m, n) for m in range(1, MODES + 1) for n in range(1, MODES + 1)])
    waves = waves[np.argsort((waves**2).sum(axis=1), kind="stable")][:MODES]
    motion = np.zeros((len(rows), 3, MODES), np.float32)
    motion[:, 2] = np.sin(np.pi * np.outer(x[rows], waves[:, 0])) * np.sin(np.pi * np.outer(y[rows], waves[:, 1]))
    energy = 400.0 / side**2 * motion[:, 2] ** 2
    counted = mesh.counted_from(rows)
    return mesh, {
        "points": points[rows], "lines": counted.lines, "line_kinds": counted.kinds, "faces": counted.faces,
        "translations": motion, "energy": energy, "line_energy": np.zeros((0, MODES), np.float32),
    }  # fmt: skip


def measured(size: int, results: Results, folder: Path, seconds: float) -> Measured:
    """One page, made and loaded."""
    side = round(size**0.5)
    mesh, arrays = plate(side)
    path, start = folder / f"{size}.html", time.process_time()
    document = build_page(
        "modes", with_shapes(results, mesh, arrays), {f"plate/{name}": a for name, a in arrays.items()}
    )
    write_html(document, path)
    made = time.process_time() - start
    command = ["node", str(Path(__file__).with_name("measure.mjs")), str(ROOT / "web"), str(path), str(seconds)]
    browser = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    assert document.view is not None
    (scene,) = document.view.scenes
    return Measured(
        side**2, scene.faces.shape[0], len(scene.stages[0].stored), path.stat().st_size / 1e6, made,
        browser["load_seconds"], browser["frames_per_second"],
    )  # fmt: skip


def with_shapes(results: Results, mesh: DrawnMesh, arrays: Mapping[str, NDArray[Any]]) -> Results:
    """The results with shapes from these arrays."""
    keys = {f"{name}_key": f"plate/{name}" for name in arrays}
    shapes = results.mode_shapes[0].model_copy(update={**keys, "simplified": mesh.sentence})
    return results.model_copy(update={"mode_shapes": (shapes,)})


def page(found: Sequence[Measured]) -> str:
    """The table, in Markdown."""
    return "\n".join(_lines(found)) + "\n"


_HOW = """The page of `femtune modes` for a square plate of shells with {modes} modes, in headless Chromium at
1280 × 900 pixels without a graphics card: SwiftShader on {processors} processors. Frames with one were not measured.
Other work ran on the machine: load average {load:.1f} at the end. Made by `benchmarks/page/run.py`.

- Made: processor time from the results to the file, with the still pictures.
- Load: from the request until the shapes have been drawn once.
- Frames: drawn in a second while the shapes move.

Large meshes are drawn with fewer faces. Where modes have no room, some are not stored. The page states both.
"""


def _lines(found: Sequence[Measured]) -> Iterator[str]:
    yield "# The page of moving shapes against the size of the model\n"
    yield _HOW.format(modes=MODES, processors=os.cpu_count(), load=os.getloadavg()[0])
    yield "| elements | faces drawn | modes stored | page, MB | made, s | load, s | frames a second |"
    yield "| ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    for m in found:
        size = f"{m.elements:,} | {m.faces:,} | {m.modes} | {m.megabytes:.2f}"
        yield f"| {size} | {m.made_seconds:.1f} | {m.load_seconds:.1f} | {m.frames_per_second:.1f} |"


def main() -> None:
    """Print the page, and write it where a folder is given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the two smallest models")
    parser.add_argument("--seconds", type=float, default=5.0, help="for which frames are counted")
    parser.add_argument("--evidence", type=Path, help="folder for the page benchmark_page.md")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        deck = folder / "plate.bdf"
        deck.write_text(deck_text(), encoding="ascii")
        results = ft.modes(deck, count=MODES).whole()[0]
        found = [measured(size, results, folder, chosen.seconds) for size in (SIZES[:2] if chosen.quick else SIZES)]
    text = page(found)
    print(text)
    if chosen.evidence:
        (chosen.evidence / "benchmark_page.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
