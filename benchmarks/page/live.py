"""The live model of the report: errors and times: python benchmarks/page/live.py [--evidence docs/evidence].

Studies of the benchmark building, of a plate and of a shell frame are run with simulated tests (the building with its
measured one). Each live model is compared with the full model at 50 random points of the 95 % region and at 50 random
points and 16 corners of the ranges of the sliders; the random points are not those of its own certificate. In headless
Chromium a parameter is changed, and the time until the answer is drawn is measured. Chromium, Node and the packages of
`web/` (`make web`) are required.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))  # where structures/ lies

import femtune as ft
from femtune.model import solve_modes
from femtune.steps.live.stored import stored_model
from femtune.steps.run.result import RunResult
from femtune.study.study import Study, load_study
from structures.ladder_frame import shell_frame, shell_frame_parameters
from structures.meshed import write_structure

ROOT = Path(__file__).resolve().parents[2]
POINTS = 50
CORNERS = 16
INPUTS = 20
_ELASTIC = 1e-6
_SCATTER = 0.002


@dataclass(frozen=True)
class Found:
    """A study: DOFs, parameters and modes; order, errors of frequencies in the region and in the bounds, %; size and
    times."""

    name: str
    dofs: int
    parameters: int
    modes: int
    order: int
    solutions: int
    seconds: float
    region_percent: float
    bounds_percent: float
    said_region: float
    said_bounds: float
    megabytes: float
    solver_ms: float
    main_ms: float
    first_ms: float
    numbers_ms: tuple[float, float, float]
    drawn_ms: tuple[float, float, float]
    shape_ms: float
    narrowed: bool


# ----------------------------------------------------------------------------------------------------
# Studies.


def building(folder: Path) -> Path:
    """The benchmark building with its measured test."""
    for path in (ROOT / "examples" / "01_building").glob("*.py"):
        shutil.copy(path, folder)
    subprocess.run([sys.executable, str(folder / "make_inputs.py")], check=True, cwd=folder, capture_output=True)
    return folder / "study.toml"


_SIDE = 28
"""Grid points along each side of the plate."""


def _plate_deck(thickness: Sequence[float]) -> str:
    """A steel plate of four thicknesses, held along one edge."""
    step, at = 1.0 / (_SIDE - 1), range(_SIDE)
    grids = [f"GRID,{_SIDE * i + j + 1},,{i * step:.5f},{0.7 * j * step:.5f},0." for i in at for j in at]
    cells = []
    for i in at[:-1]:
        for j in at[:-1]:
            n, own = _SIDE * i + j + 1, 1 + 2 * (2 * i >= _SIDE) + (2 * j >= _SIDE)
            cells.append(f"CQUAD4,{n},{own},{n},{n + _SIDE},{n + _SIDE + 1},{n + 1}")
    shells = [f"PSHELL,{k},1,{t:.6f},1,,1" for k, t in enumerate(thickness, start=1)]
    held = [f"SPC1,1,123456,1,THRU,{_SIDE}", "MAT1,1,2.1+11,,.3,7850."]
    return "\n".join(["SOL 103", "CEND", "SPC = 1", "BEGIN BULK", *grids, *cells, *shells, *held, "ENDDATA\n"])


def plate(folder: Path) -> Path:
    """Four thicknesses and the modulus."""
    (folder / "plate.bdf").write_text(_plate_deck([0.010] * 4), encoding="ascii")
    (folder / "true.bdf").write_text(_plate_deck([0.0095, 0.0108, 0.0102, 0.0097]), encoding="ascii")
    last = _SIDE * _SIDE
    sensors = [f"{n}Z+" for n in range(_SIDE + 9, last, 97)]
    fields = [*(f"PSHELL {k} T" for k in range(1, 5)), "MAT1 1 E"]
    return _study(folder, "plate.bdf", sensors, 10, fields, 0.7, 1.4, "[output]\nlive = true\n")


def frame(folder: Path, n_dofs: int) -> Path:
    """The shell frame in six regions, thickness and modulus of each within ±25 %, updated on a reduced model."""
    structure = shell_frame(n_dofs)
    deck = write_structure(structure, folder / "frame.bdf")
    refs, text = shell_frame_parameters(), deck.read_text(encoding="ascii")
    random, lines = np.random.default_rng(4), []
    for line in text.splitlines():
        of_shell = line.startswith("PSHELL")
        change = 1.0 + random.uniform(-0.1, 0.1) if of_shell else 1.0
        lines.append(f"{line[:24]}{float(line[24:32]) * change:<8.6f}{line[32:]}" if of_shell else line)
    (folder / "true.bdf").write_text("\n".join(lines) + "\n", encoding="ascii")
    nodes = structure.node_ids[:: max(1, len(structure.node_ids) // 14)]
    sensors = [f"{n}{d}+" for n in nodes for d in "XYZ"]
    fields = [str(ref) for ref in refs]
    return _study(folder, "frame.bdf", sensors, 20, fields, 0.75, 1.25, "[reduction]\n")


def _study(
    folder: Path, deck: str, sensors: Sequence[str], count: int, fields: Sequence[str], low: float, high: float,
    more: str,
) -> Path:  # fmt: skip
    test = ft.simulate(
        folder / "true.bdf", list(sensors), units="m-kg-s", count=count, frequency_scatter=_SCATTER, shape_scatter=0.01
    )
    ft.write_test(test, folder / "test.uff")
    parameters = "".join(
        f'[[parameter]]\nname = "p{i}"\nfields = ["{f}"]\nlower = {low}\nupper = {high}\n' for i, f in enumerate(fields)
    )
    (folder / "study.toml").write_text(
        f'[study]\ntitle = "{deck}"\ndeck = "{deck}"\nunits = "m-kg-s"\n[modes]\ncount = {count + 6}\n'
        f'[test]\nfile = "test.uff"\n{parameters}'
        f"[residuals]\nfrequency_sd = {_SCATTER}\nshape_sd = 0.01\n[write]\ndeck = false\n{more}",
        encoding="utf-8",
    )
    return folder / "study.toml"


# ----------------------------------------------------------------------------------------------------
# Errors and times.


def region_points(run: RunResult) -> NDArray[Any]:
    """(n, k) random points of the 95 % region within the bounds."""
    live = run.results.live
    assert live is not None
    assert live.region is not None
    assert live.x_key is not None
    region, random = live.region, np.random.default_rng(99)
    rows, offset, at = (run.arrays[k] for k in (region.rows_key, region.offset_key, region.at_key))
    moving, x = list(region.moving), run.arrays[live.x_key]
    inverse, out = np.linalg.pinv(rows), []
    lower, upper = _bounds(run)
    while len(out) < POINTS:
        u = random.standard_normal(len(rows))
        u *= np.sqrt(region.limit) * random.uniform() ** (1.0 / len(rows)) / np.linalg.norm(u)
        point = x.copy()
        point[moving] = at + inverse @ (u - offset)
        if (point >= lower).all() and (point <= upper).all():
            out.append(point)
    return np.array(out)


def _bounds(run: RunResult) -> tuple[NDArray[Any], NDArray[Any]]:
    live = run.results.live
    assert live is not None
    ends = [[(getattr(p, end) - p.nominal) / p.scale for p in live.parameters] for end in ("lower", "upper")]
    return np.array(ends[0]), np.array(ends[1])


def errors(run: RunResult, study: Study, points: NDArray[Any]) -> float:
    """Largest relative error of a frequency of an elastic mode, %, over all configurations."""
    live, worst = run.results.live, 0.0
    assert live is not None
    for case in study.problem().cases:
        if case.name not in {c.configuration for c in live.configurations}:
            continue
        model = stored_model(live, case.name, run.arrays)
        for x in points:
            full = solve_modes(case.configured.at(x), model.count).eigenvalues[: model.count]
            found, elastic = model.modes(x).eigenvalues, full > _ELASTIC * full.max()
            worst = max(worst, float(np.abs(np.sqrt(found[elastic] / full[elastic]) - 1.0).max()))
    return 100.0 * worst


def measured(name: str, path: Path) -> Found:
    """One study, run and measured."""
    run = ft.run(path)
    live, study = run.results.live, load_study(path)
    assert live is not None, name
    assert not live.reason, live.reason
    lower, upper = _bounds(run)
    random = np.random.default_rng(98)
    inside = random.uniform(lower, upper, (POINTS, len(lower)))
    inside = np.vstack([inside, np.where(random.uniform(size=(CORNERS, len(lower))) < 0.5, lower, upper)])
    page = ft.report(run.folder)
    command = ["node", str(Path(__file__).with_name("live.mjs")), str(ROOT / "web"), str(page), str(INPUTS)]
    answered = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    times, numbers = answered["times"], answered["numbers"]
    command = ["node", str(Path(__file__).with_name("solve.mjs")), str(ROOT / "web"), str(page)]
    solver = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    cases, seconds = live.configurations, {d.step: d.duration_s for d in run.results.provenance.durations}
    return Found(
        name, cases[0].dofs, len(live.parameters), cases[0].count, max(c.order for c in cases), live.solutions,
        seconds["live model"], errors(run, study, region_points(run)), errors(run, study, inside),
        max((k.frequency_percent for c in cases if (k := c.region_full or c.region)), default=np.nan),
        max((c.bounds_full or c.bounds).frequency_percent for c in cases), page.stat().st_size / 1e6, sum(solver),
        answered["main_ms"], numbers[0], _spread(numbers[1:]), _spread(times[1:]),
        float(np.median(answered["shapes"])), bool(live.narrowed),
    )  # fmt: skip


_HOW = """Made by `make bench-live`; load average {load:.1f} on {processors} processors at the end. Other work on the
machine lengthens the times: the smallest one is nearest to that of a free machine.

- Errors: largest relative error of a frequency against the full model at {points} random points of the 95 % region, and
  at {points} random points and {corners} corners of the ranges of the sliders. Said: what the report states of the same
  from its own comparison with the full model, at other points.
- Ranges: the bounds of the study, or a range about the 95 % region where an error within the bounds is above 3 %.
- Numbers: time from the change of a slider to the frame that shows frequencies, MAC and criteria, in headless Chromium
  at 1280 × 900 pixels without 3D; the first one, with the solver not yet compiled, and smallest, median and largest of
  {inputs} more. With 3D: the same where software takes the place of a graphics card, for the window with the shape and
  for the whole page; the shape is drawn in the frame after the numbers (median of its time).
- Solver: processor time of a solution of all configurations in Node. Main: processor time of the main thread of the
  page for an input, with layout and drawing but without the software that draws in place of a graphics card. Other work
  on the machine does not lengthen these two.
- Seconds: of the part of the run that makes the live model, with the solutions of the full model that it needs.
"""


def _spread(times: Sequence[float]) -> tuple[float, float, float]:
    """Smallest, median and largest."""
    return min(times), float(np.median(times)), max(times)


def page(found: Sequence[Found]) -> str:
    """The table, in Markdown."""
    return "\n".join(_lines(found)) + "\n"


def _lines(found: Sequence[Found]) -> Iterator[str]:
    yield "# The live model of the report\n"
    load = os.getloadavg()[0]
    yield _HOW.format(load=load, processors=os.cpu_count(), points=POINTS, corners=CORNERS, inputs=INPUTS)
    yield (
        "| study | DOFs | parameters | modes | order | solutions | seconds | region, % (said) | ranges | "
        "error, % (said) | page, MB | solver, ms | main, ms | first, ms | numbers, ms | "
        "with 3D by software, ms | shape, ms |"
    )
    yield "| --- |" + " ---: |" * 7 + " --- |" + " ---: |" * 8
    for f in found:
        yield (
            f"| {f.name} | {f.dofs:,} | {f.parameters} | {f.modes} | {f.order} | {f.solutions} | {f.seconds:.1f} | "
            f"{_percent(f.region_percent)} ({_percent(f.said_region)}) | {'narrowed' if f.narrowed else 'bounds'} | "
            f"{_percent(f.bounds_percent)} ({_percent(f.said_bounds)}) | "
            f"{f.megabytes:.1f} | {f.solver_ms:.1f} | {f.main_ms:.1f} | {f.first_ms:.0f} | "
            f"{_three(f.numbers_ms)} | {_three(f.drawn_ms)} | {f.shape_ms:.0f} |"
        )


def _three(times: tuple[float, float, float]) -> str:
    return " / ".join(f"{t:.0f}" for t in times)


def _percent(error: float) -> str:
    return "< 0.001" if error < 1e-3 else f"{error:.2g}"


def main() -> None:
    """Print the page, and write it where a folder is given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="building and plate alone")
    parser.add_argument("--only", help="one of the studies: building, plate, frame")
    parser.add_argument("--dofs", type=int, default=40_000, help="of the frame")
    parser.add_argument("--evidence", type=Path, help="folder for the page benchmark_live.md")
    chosen = parser.parse_args()
    found = []
    with tempfile.TemporaryDirectory() as temporary:
        for name, make in (("building", building), ("plate", plate), ("frame", lambda f: frame(f, chosen.dofs))):
            if (name == "frame" and chosen.quick) or chosen.only not in (None, name):
                continue
            folder = Path(temporary) / name
            folder.mkdir()
            found.append(measured(name, make(folder)))
            print(found[-1], flush=True)
            if chosen.evidence:
                (chosen.evidence / "benchmark_live.md").write_text(page(found), encoding="utf-8")
    print(page(found))


if __name__ == "__main__":
    main()
