"""Starts of an FRF calibration that reach the truth, with and without continuation in the damping: python run.py.

A plane, free frame of steel, 1.0 × 0.6 m with a cross bar in the middle, of Euler beams 20 × 12 mm; the moduli of
bottom, top, sides and cross bar are off by 12, −10, 8 and −15 %. Accelerance of two inputs at seven points in two
directions, 20 to 420 Hz, three lines in each half bandwidth; the residual is the logarithm of the ratio. From each of
five Latin hypercubes of 100 points within ±25 % the best 19 are taken, and the nominal values; each start has at most
25 evaluations a stage.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.stats import qmc

from femtune.fem.fields import FieldRef
from femtune.files.nastran import build_structure, read_deck
from femtune.modal import half_band_lines
from femtune.model import (
    Assignment,
    Configuration,
    ConfiguredModel,
    configure,
    constant_damping,
    parametric_model,
    solve_modes,
)
from femtune.model.reduce import ReducedModel, reduce_model
from femtune.model.response import Ports, frf, make_ports
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import Evaluation, ModelWay, UpdateProblem, case_without_modes, frf_residual
from femtune.residuals.case import CaseState
from femtune.residuals.frf.on_reduced import ReducedFrfs
from femtune.residuals.state import reduced_case
from femtune.updating import SensitivityMethod, update

TRUTH = np.array([0.12, -0.10, 0.08, -0.15])
GROUPS = ("bottom", "top", "sides", "cross")
SAMPLES, BOUNDS, STARTS, EVALUATIONS, REACHED = 0.25, 0.30, 20, 25, 1e-3
MODES, BAND = 40, (20.0, 420.0)
# members: group, ends, number of elements
MEMBERS = (
    (1, (0.0, 0.0), (0.5, 0.0), 4), (1, (0.5, 0.0), (1.0, 0.0), 4),
    (2, (0.0, 0.6), (0.5, 0.6), 4), (2, (0.5, 0.6), (1.0, 0.6), 4),
    (3, (0.0, 0.0), (0.0, 0.6), 6), (3, (1.0, 0.0), (1.0, 0.6), 6),
    (4, (0.5, 0.0), (0.5, 0.6), 6),
)  # fmt: skip
INPUTS = ((0.0, 0.0), (0.25, 0.6))
OUTPUTS = ((0.0, 0.0), (0.25, 0.6), (1.0, 0.0), (0.5, 0.3), (0.75, 0.0), (0.0, 0.3), (1.0, 0.6))

Point = tuple[float, float]
Reals = NDArray[np.float64]


def deck() -> tuple[str, dict[Point, int]]:
    """The bulk data, and the grid point at each place."""
    grids: dict[Point, int] = {}
    bars: list[tuple[int, int, int]] = []
    for group, a, b, count in MEMBERS:
        along = np.round(np.linspace(a, b, count + 1), 6)
        numbers = [grids.setdefault((float(x), float(y)), len(grids) + 1) for x, y in along]
        bars += [(group, i, j) for i, j in pairwise(numbers)]
    width, height = 0.020, 0.012
    section = f"{width * height:.6e}", f"{width * height**3 / 12:.6e}", f"{height * width**3 / 12:.6e}", "1.0-9"
    lines = ["SOL 103", "CEND", "BEGIN BULK", "PARAM,COUPMASS,1", "GRDSET,,,,,,,345"]
    lines += [f"GRID,{n},,{x:.6f},{y:.6f},0.0" for (x, y), n in grids.items()]
    lines += [f"MAT1,{g},2.1+11,,0.3,7850." for g in (1, 2, 3, 4)]
    # plane 1 contains the element axis and the vector in the plane of the frame
    lines += [f"PBAR,{g},{g},{','.join(section)}" for g in (1, 2, 3, 4)]
    places = {n: p for p, n in grids.items()}
    for e, (g, i, j) in enumerate(bars, start=1):
        (xi, yi), (xj, yj) = places[i], places[j]
        lines.append(f"CBAR,{e},{g},{i},{j},{-(yj - yi):.6f},{xj - xi:.6f},0.0")
    return "\n".join([*lines, "ENDDATA", ""]), grids


def frame() -> tuple[ConfiguredModel, Ports]:
    """The model with its four moduli, inputs in y, and outputs in x and y."""
    text, grids = deck()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frame.bdf"
        path.write_text(text)
        structure = build_structure(read_deck(path)).structure
    parameters = ParameterSet(tuple(Parameter(n, 1.0, 1.0 - BOUNDS, 1.0 + BOUNDS) for n in GROUPS))
    fields = [Assignment(n, FieldRef("MAT1", i, "E")) for i, n in enumerate(GROUPS, start=1)]
    model = configure(parametric_model(structure, parameters, fields), Configuration())
    outputs = [f"{grids[p]}{d}+" for p in OUTPUTS for d in "XY"]
    return model, make_ports(model, [f"{grids[p]}Y+" for p in INPUTS], outputs)


def problem(model: ConfiguredModel, ports: Ports, reduced: ReducedModel, ratio: float) -> UpdateProblem:
    """Model and test on the nominal modes, with one damping ratio."""
    modes, lines = solve_modes(model.at(np.zeros(4)), MODES), half_band_lines(BAND, ratio)
    way = ModelWay(modes=(MODES, None), damping=constant_damping(ratio))
    nominal = frf(modes, ports, lines, "accelerance", damping=way.damping)
    residual, _ = frf_residual(modes, nominal, way=way)
    case = reduced_case(case_without_modes(model, (residual,), count=MODES), reduced, (residual,))
    (on_basis,) = case.residuals
    assert isinstance(on_basis, ReducedFrfs)
    values, _ = on_basis.functions(CaseState(case, reduced.at(TRUTH)), False)  # type: ignore[arg-type]
    exact = replace(residual, measured=replace(residual.measured, values=values))
    full = case_without_modes(model, (exact,), count=MODES)
    return Watched((reduced_case(full, reduced, (exact,)),), model.model.parameters)


def starts(of: UpdateProblem, seed: int) -> Reals:
    """The nominal values, and the best of a Latin hypercube."""
    points = (2.0 * qmc.LatinHypercube(4, seed=seed).random(100) - 1.0) * SAMPLES
    objective = [of.assess(x, of.solved(x), derivatives=False).objective for x in points]
    return np.vstack([np.zeros(4), points[np.argsort(objective)[: STARTS - 1]]])


_SEEN: list[Reals] = []


class Watched(UpdateProblem):
    """Keeps the points at which it was evaluated."""

    def follow(self, x: Reals, before: Evaluation, derivatives: bool = True) -> Evaluation:
        """As of the problem."""
        if not derivatives or not any(np.array_equal(x, seen) for seen in _SEEN):
            _SEEN.append(np.array(x))
        return super().follow(x, before, derivatives)


def reached(stages: list[UpdateProblem], x: Reals) -> bool:
    """Whether a start reaches the truth with the evaluations that it is allowed in the last stage."""
    method = SensitivityMethod(max_iterations=EVALUATIONS, smallest_change=0.0)
    for of in stages:
        _SEEN[:] = [x]
        x = update(of, method, start=of.start(x)).x
    return any(np.abs(seen - TRUTH).max() < REACHED for seen in _SEEN[:EVALUATIONS])


def evidence(seeds: int, ratio: float) -> str:
    """Counts of both strategies."""
    model, ports = frame()
    modes = solve_modes(model.at(np.zeros(4)), MODES)
    rows = sp.csr_array(sp.vstack([ports.outputs, ports.inputs.T]))
    reduced = reduce_model(model, modes.shapes[:, :MODES], rows, modes.shift)
    problems = {z: problem(model, ports, reduced, z) for z in (8.0 * ratio, 4.0 * ratio, 2.0 * ratio, ratio)}
    words = ", ".join(f"{100 * z:g}" for z in problems)
    strategies = {f"at {100 * ratio:g} %": [problems[ratio]], f"continuation {words} %": list(problems.values())}
    lines = [
        "# Starts of an FRF calibration", "",
        f"A plane frame with four moduli, described in `benchmarks/frf_starts`; {MODES} nominal modes are the basis "
        f"of model and test, damping ratio {100 * ratio:g} %. Starts of {STARTS} for each seed that reach every "
        f"parameter within {REACHED:g} in at most {EVALUATIONS} evaluations of the last stage; Latin hypercubes of "
        f"SciPy with the seeds 0 to {seeds - 1}. With continuation each start goes through the damping ratios from "
        "the highest to the lowest.",
        "", "| strategy | by seed | of all | CPU s |", "| --- | --- | --- | --- |",
    ]  # fmt: skip
    for name, stages in strategies.items():
        began = time.process_time()
        counts = [sum(reached(stages, x) for x in starts(stages[0], seed)) for seed in range(seeds)]
        seconds = time.process_time() - began
        by_seed = ", ".join(map(str, counts))
        lines.append(f"| {name} | {by_seed} | {sum(counts)} of {STARTS * seeds} | {seconds:.0f} |")
        print(lines[-1], flush=True)
    return "\n".join([*lines, ""])


def main() -> None:
    """Print the counts, and write the page where asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--ratio", type=float, default=0.02)
    parser.add_argument("--evidence", type=Path)
    given = parser.parse_args()
    text = evidence(given.seeds, given.ratio)
    print(text)
    if given.evidence is not None:
        given.evidence.mkdir(parents=True, exist_ok=True)
        (given.evidence / "benchmark_frf_starts.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
