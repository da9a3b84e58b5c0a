"""The live model of the report: errors and times: python benchmarks/page/live.py [--evidence docs/evidence].

Studies of the benchmark building, of a plate and of a shell frame are run with simulated tests (the building with its
measured one); ``--only subframe`` is the FRF calibration of the subframe at 600,000 DOFs, which takes half an hour on a
free machine. Each live model is compared with the full model at 50 random points of the 95 % region and at 50
random points and 16 corners of the ranges of the sliders (the subframe at 3, 3 and 2); the random points are not those
of its own certificate. In headless Chromium a parameter is changed, and the time until the answer is drawn is measured.
Chromium, Node and the packages of `web/` (`make web`) are required. Rows of studies that are not run again are kept.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))  # where structures/ lies

import femtune as ft
from femtune.modal import half_band_lines
from femtune.model import AddedMass, configure, constant_damping, solve_modes
from femtune.model.response import frf, mass_response
from femtune.steps.live.stored import stored_model
from femtune.steps.run.result import RunResult
from femtune.study.study import Study, load_study
from structures.ladder_frame import shell_frame, shell_frame_parameters
from structures.meshed import write_structure
from structures.subframe_campaign import FREE, LEVEL, Laboratory
from structures.subframe_study import parameters as parameters_of

ROOT = Path(__file__).resolve().parents[2]
POINTS, CORNERS = 50, 16
MASS_POINTS, MOST_WITH_MASS = 4, 50_000
"""Points at which the model with an added mass is compared, and DOFs up to which it is."""
FEW, FEW_CORNERS = 3, 2
"""The same for the subframe, of which a solution takes half a minute."""
INPUTS = 20
STUDIES = ("building", "plate", "frame", "subframe")
_ELASTIC = 1e-6
_SCATTER = 0.002
_RATIO, _SD = 0.01, 0.05
"""Damping ratio of the FRFs of the subframe on both sides, and σ of a value relative to it."""


@dataclass(frozen=True)
class Found:
    """A study: DOFs, parameters and modes; order, errors of frequencies in the region and in the bounds, %; size and
    times."""

    name: str
    dofs: int
    points: tuple[int, int]
    peak_gib: float
    parameters: int
    modes: int
    order: int
    solutions: int
    seconds: float
    region_percent: float
    bounds_percent: float
    said_region: float
    said_bounds: float
    mass_percent: float
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


def subframe(folder: Path, n_dofs: int) -> Path:
    """The free subframe: nine parameters from FRFs of two inputs and 47 outputs with one damping ratio."""
    lab = Laboratory(n_dofs)
    lab.write(folder / "subframe.bdf")
    lines, ports = half_band_lines(FREE.band_hz, _RATIO), lab.ports(FREE)
    solved = solve_modes(lab.configured[FREE.name].at(lab.truth(0)), None, 2.0 * FREE.band_hz[1])
    exact = frf(solved, ports, lines, "accelerance", damping=constant_damping(_RATIO))
    chance = np.random.default_rng(3).standard_normal((2, *exact.values.shape))
    noise = LEVEL * np.abs(exact.values).max(axis=2, keepdims=True) * (chance[0] + 1j * chance[1])
    lab.write_test(folder / "test.uff", replace(exact, values=exact.values + noise))
    (folder / "study.toml").write_text(
        f'[study]\ntitle = "subframe.bdf"\ndeck = "subframe.bdf"\nunits = "m-kg-s"\n'
        f'[modes]\nmax_hz = {FREE.band_hz[1]}\n[sensors]\nby_id = true\n[test]\nfile = "test.uff"\n[reduction]\n'
        f'[[residual]]\nkind = "frf"\nratio = {_RATIO}\nsd = {_SD}\nfloor = {LEVEL}\n'
        f"[update]\nlook_further = false\n[write]\ndeck = false\n{parameters_of(lab)}",
        encoding="utf-8",
    )
    return folder / "study.toml"


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


def region_points(run: RunResult, count: int) -> NDArray[Any]:
    """(count, k) random points of the 95 % region within the bounds."""
    live = run.results.live
    assert live is not None
    assert live.region is not None
    assert live.x_key is not None
    region, random = live.region, np.random.default_rng(99)
    rows, offset, at = (run.arrays[k] for k in (region.rows_key, region.offset_key, region.at_key))
    moving, x = list(region.moving), run.arrays[live.x_key]
    inverse, out = np.linalg.pinv(rows), []
    lower, upper = _bounds(run)
    while len(out) < count:
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


def errors_with_mass(run: RunResult, study: Study, points: NDArray[Any]) -> float:
    """The same with a tenth of the mass of the structure at some of the points that can carry one; NaN without any."""
    live, worst = run.results.live, np.nan
    assert live is not None
    for case, one in ((c, o) for o in live.configurations for c in study.problem().cases if c.name == o.configuration):
        if one.mass_rows_key is None or case.configured.n_free > MOST_WITH_MASS:
            continue
        model, configured = stored_model(live, case.name, run.arrays), case.configured
        mass = 0.1 * mass_response(configured.at(model.at)).properties.mass
        for k in {0, len(one.mass_points) // 2, len(one.mass_points) - 1}:
            added = AddedMass(int(one.mass_points[k].removeprefix("grid ")), mass)
            state = configured.configuration
            heavy = configure(configured.model, replace(state, masses=(*state.masses, added)))
            for x in points:
                full = solve_modes(heavy.at(x), model.count).eigenvalues[: model.count]
                found = model.modes(x, np.sqrt(mass) * run.arrays[one.mass_rows_key][k]).eigenvalues
                elastic = full > _ELASTIC * full.max()
                worst = np.fmax(worst, np.abs(np.sqrt(found[elastic] / full[elastic]) - 1.0).max())
    return 100.0 * float(worst)


def measured(name: str, path: Path, count: int = POINTS, corners: int = CORNERS) -> Found:
    """One study, run and measured."""
    run = ft.run(path)
    live, study = run.results.live, load_study(path)
    assert live is not None, name
    assert not live.reason, live.reason
    lower, upper = _bounds(run)
    random = np.random.default_rng(98)
    inside = random.uniform(lower, upper, (count, len(lower)))
    inside = np.vstack([inside, np.where(random.uniform(size=(corners, len(lower))) < 0.5, lower, upper)])
    page = ft.report(run.folder)
    command = ["node", str(Path(__file__).with_name("live.mjs")), str(ROOT / "web"), str(page), str(INPUTS)]
    answered = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    times, numbers = answered["times"], answered["numbers"]
    command = ["node", str(Path(__file__).with_name("solve.mjs")), str(ROOT / "web"), str(page)]
    solver = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    # kilobytes on Linux
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
    cases, seconds = live.configurations, {d.step: d.duration_s for d in run.results.provenance.durations}
    return Found(
        name, cases[0].dofs, (count, count + corners), peak, len(live.parameters), cases[0].count,
        max(c.order for c in cases), live.solutions,
        seconds["live model"], errors(run, study, region_points(run, count)), errors(run, study, inside),
        max((k.frequency_percent for c in cases if (k := c.region_full or c.region)), default=np.nan),
        max((c.bounds_full or c.bounds).frequency_percent for c in cases),
        errors_with_mass(run, study, inside[: MASS_POINTS]), page.stat().st_size / 1e6, sum(solver),
        answered["main_ms"], numbers[0], _spread(numbers[1:]), _spread(times[1:]),
        float(np.median(np.array(answered["shapes"], float))), bool(live.narrowed),
    )  # fmt: skip


_HOW = """Made by `make bench-live`; load average {load:.1f} on {processors} processors at the end. Other work on the
machine lengthens the times: the smallest one is nearest to that of a free machine.

- Errors: largest relative error of a frequency against the full model at random points of the 95 % region, and at
  random points and corners of the ranges of the sliders; points: how many of both. Said: what the report states of the
  same from its own comparison with the full model, at other points.
- With a mass: the largest error at four random points of the ranges, with a tenth of the mass of the structure at the
  first, the middle or the last point that can carry one.
- Ranges: the bounds of the study, or a range about the 95 % region where an error within the bounds is above 3 %.
- Numbers: time from the change of a slider to the frame that shows frequencies, MAC and criteria, in headless Chromium
  at 1280 × 900 pixels without 3D; the first one, with the solver not yet compiled, and smallest, median and largest of
  {inputs} more. With 3D: the same where software takes the place of a graphics card, for the window with the shape and
  for the whole page; the shape is drawn in the frame after the numbers (median of its time).
- Solver: processor time of a solution of all configurations in Node. Main: processor time of the main thread of the
  page for an input, with layout and drawing but without the software that draws in place of a graphics card. Other work
  on the machine does not lengthen these two.
- Peak: largest resident memory of the process until the study has been run. The subframe is calibrated from 94 FRFs on
  reduced models and shows no shape of a pair; the others are updated from modes.
- Seconds: of the part of the run that makes the live model, with the solutions of the full model that it needs.
- A dash: not measured. Rows stay from an earlier run where a study is not run again.
"""


def _spread(times: Sequence[float]) -> tuple[float, float, float]:
    """Smallest, median and largest."""
    return min(times), float(np.median(times)), max(times)


def page(rows: dict[str, str]) -> str:
    """The page in Markdown, from the rows of its table."""
    how = _HOW.format(load=os.getloadavg()[0], processors=os.cpu_count(), inputs=INPUTS)
    head = (
        "| study | DOFs | parameters | modes | order | solutions | seconds | peak, GiB | points | region, % (said) | "
        "ranges | error, % (said) | with a mass, % | page, MB | solver, ms | main, ms | first, ms | numbers, ms | "
        "with 3D by software, ms | shape, ms |"
    )
    rule = "| --- |" + " ---: |" * 9 + " --- |" + " ---: |" * 9
    some = [rows[name] for name in STUDIES if name in rows]
    return "\n".join(["# The live model of the report\n", how, head, rule, *some]) + "\n"


def row(f: Found) -> str:
    """A row of the table."""
    return (
        f"| {f.name} | {f.dofs:,} | {f.parameters} | {f.modes} | {f.order} | {f.solutions} | {f.seconds:.1f} | "
        f"{f.peak_gib:.1f} | {f.points[0]} + {f.points[1]} | "
        f"{_percent(f.region_percent)} ({_percent(f.said_region)}) | {'narrowed' if f.narrowed else 'bounds'} | "
        f"{_percent(f.bounds_percent)} ({_percent(f.said_bounds)}) | "
        f"{'–' if np.isnan(f.mass_percent) else _percent(f.mass_percent)} | "
        f"{f.megabytes:.1f} | {f.solver_ms:.1f} | {f.main_ms:.1f} | {f.first_ms:.0f} | "
        f"{_three(f.numbers_ms)} | {_three(f.drawn_ms)} | {'–' if np.isnan(f.shape_ms) else f'{f.shape_ms:.0f}'} |"
    )


def kept(path: Path) -> dict[str, str]:
    """Rows of a page that was written before, by the name of the study."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    return {name: line for line in lines if line.startswith("|") and (name := line.split("|")[1].strip()) in STUDIES}


def _three(times: tuple[float, float, float]) -> str:
    return " / ".join(f"{t:.0f}" for t in times)


def _percent(error: float) -> str:
    return "< 0.001" if error < 1e-3 else f"{error:.2g}"


def main() -> None:
    """Print the page, and write it where a folder is given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="building and plate alone")
    parser.add_argument("--only", choices=STUDIES, help="one of the studies; without it all but the subframe")
    parser.add_argument("--dofs", type=int, help="of the frame (40,000) or the subframe (600,000)")
    parser.add_argument("--evidence", type=Path, help="folder for the page benchmark_live.md")
    chosen = parser.parse_args()
    make = {
        "building": building, "plate": plate, "frame": lambda f: frame(f, chosen.dofs or 40_000),
        "subframe": lambda f: subframe(f, chosen.dofs or 600_000),
    }  # fmt: skip
    written = None if chosen.evidence is None else chosen.evidence / "benchmark_live.md"
    rows = {} if written is None else kept(written)
    with tempfile.TemporaryDirectory() as temporary:
        for name in [chosen.only] if chosen.only else STUDIES[: 2 if chosen.quick else 3]:
            folder = Path(temporary) / name
            folder.mkdir()
            points = (FEW, FEW_CORNERS) if name == "subframe" else (POINTS, CORNERS)
            found = measured(name, make[name](folder), *points)
            print(found, flush=True)
            rows[name] = row(found)
            if written is not None:
                written.write_text(page(rows), encoding="utf-8")
    print(page(rows))


if __name__ == "__main__":
    main()
