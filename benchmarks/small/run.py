"""Cost of an evaluation of small models beside dense NumPy: python benchmarks/small/run.py [--evidence docs/evidence].

What a sampler or a start asks for: modes of the model at other values of the parameters, pairs followed, residuals of
frequencies and shapes, with or without derivatives. Dense NumPy does what a user of two hundred lines would: matrices
as sums over the parameters, a generalised eigensolution, pairs by the largest MAC, derivatives by one dense solution a
mode. Both have prepared their matrices, and both are checked to give the same residuals where the model is such a sum.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.linalg as la

import femtune as ft
from femtune.arrays import Reals
from femtune.model.full_model import direct
from femtune.residuals import Evaluation, UpdateProblem
from femtune.study.study import load_study, solved_by

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples" / "01_building"))
import make_inputs as building  # noqa: E402

REPEATS = 7
POINTS = 20
SPREAD = 0.02
FLOORS = (6, 24, 49)
"""Storeys of frames of one bay: 36, 144 and 294 free DOFs."""


HEAD = f"""# Small models beside dense NumPy

Processor time of one evaluation of an update problem: modes at other values of the parameters, pairs followed,
residuals of frequencies and shapes, with or without their derivatives. Dense NumPy is what a user of two hundred lines
would write for one structure: prepared matrices for each parameter, a generalised eigensolution, pairs by the largest
MAC, one dense solution for the derivatives of a mode. It does not check mechanisms, the number of modes, their
accuracy or the pairs. Medians of {REPEATS} runs over {POINTS} points, both in turn; ms. Made by
`benchmarks/small/run.py`.

| model | free DOFs | parameters | pairs | values: femtune | NumPy | ratio | derivatives too: femtune | NumPy | ratio |
| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"""


def frame(folder: Path, floors: int) -> Path:
    """A clamped plane frame of one bay with five stiffnesses to update, and a simulated test of six modes."""
    folder.mkdir()
    lines = ["SOL 103", "CEND", "SPC = 1", "METHOD = 1", "BEGIN BULK", "EIGRL,1,,,8"]
    for level in range(floors + 1):
        lines += [f"GRID,{10 * level + side},,{4.0 * side},0.,{3.0 * level}" for side in (1, 2)]
    number = 0
    for level in range(floors):
        for side in (1, 2):
            number += 1
            lines.append(f"CBAR,{number},{1 + level % 4},{10 * level + side},{10 * level + 10 + side},1.,0.,0.")
        number += 1
        lines.append(f"CBAR,{number},5,{10 * level + 11},{10 * level + 12},0.,0.,1.")
    lines.append(f"SPC1,1,246,11,THRU,{10 * floors + 2}")
    lines += [f"PBAR,{p},1,6.-3,{3.0 + 0.2 * p}-5,2.-5,3.-5" for p in range(1, 6)]
    lines += ["MAT1,1,2.1+11,,.3,7850.", "SPC1,1,123456,1,2", "ENDDATA"]
    nodes = range(11, 10 * floors + 2, 10 * max(1, floors // 6))
    sensors = [f"{n}{d}" for n in nodes for d in ("X+", "Z+")]
    (folder / "frame.bdf").write_text("\n".join(lines) + "\n")
    test = ft.simulate(
        folder / "frame.bdf", sensors, units="m-kg-s", count=6, frequency_scatter=0.002, shape_scatter=0.01
    )
    ft.write_test(test, folder / "test.uff")
    fields = [f"PBAR {p} I1" for p in range(1, 6)]
    parameters = "".join(
        f'[[parameter]]\nname = "p{i}"\nfields = ["{f}"]\nlower = 0.5\nupper = 2\n' for i, f in enumerate(fields)
    )
    (folder / "study.toml").write_text(
        '[study]\ntitle = "Frame"\nunits = "m-kg-s"\ndeck = "frame.bdf"\n'
        '[[configuration]]\nname = "frame"\ntest = "test.uff"\n'
        + parameters
        + "[residuals]\nfrequency_sd = 0.005\nshape_sd = 0.02\n"
    )  # fmt: skip
    return folder / "study.toml"


@dataclass(eq=False)
class DenseCase:
    """One configuration in dense arrays."""

    K0: Reals
    M0: Reals
    stiffness_by_x: Reals
    mass_by_x: Reals
    sensors: Reals
    shift: float
    known: Reals
    """(n, pairs) shapes that are followed."""
    omega2: Reals
    """(pairs,) of the test."""
    shapes: Reals
    """(s, pairs) of the test, of unit length."""


class DenseModel:
    """The residuals of a problem in dense NumPy."""

    def __init__(self, problem: UpdateProblem, at: Evaluation) -> None:
        self.x0, self.cases = at.x, []
        for state in at.states:
            point, solution = state.point, state.solution
            members = [models[0] for _, models in state.groups]
            tests = [test[0] for test, _ in state.groups]
            k, m = (np.array([d.toarray() for d in ds]) for ds in (point.stiffness_derivatives, point.mass_derivatives))
            test = state.case.test
            shapes = np.nan_to_num(test.shapes[:, tests].real)
            self.cases.append(
                DenseCase(
                    point.stiffness.toarray(), point.mass.toarray(), k, m, state.case.sensors.toarray(),
                    -solution.shift, solution.shapes[:, members], (2 * np.pi * test.freq_hz[tests]) ** 2,
                    shapes / np.linalg.norm(shapes, axis=0),
                )
            )  # fmt: skip

    def __call__(self, x: Reals, derivatives: bool) -> tuple[Reals, Reals]:
        """λ/λ_test − 1 and differences of shapes of unit length, with derivatives (n, k) where asked."""
        values, slopes = [], []
        for one in self.cases:
            K = one.K0 + np.tensordot(x - self.x0, one.stiffness_by_x, 1)
            M = one.M0 + np.tensordot(x - self.x0, one.mass_by_x, 1)
            count = one.known.shape[1] + 12
            n = len(K)
            theta, phi = la.eigh(M, K + one.shift * M, subset_by_index=[max(0, n - count), n - 1])
            some = theta > 1e-12 * theta[-1]
            theta, phi = theta[some], phi[:, some]
            found, phi = 1.0 / theta[::-1] - one.shift, (phi / np.sqrt(theta))[:, ::-1]
            cross = (one.known.T @ M @ phi) ** 2
            for j in range(one.known.shape[1]):
                i = int(np.argmax(cross[j]))
                value, shape = found[i], one.sensors @ phi[:, i]
                length = np.linalg.norm(shape) * np.sign(shape @ one.shapes[:, j])
                values.append(np.r_[value / one.omega2[j] - 1.0, shape / length - one.shapes[:, j]])
                if derivatives:
                    f = one.stiffness_by_x @ phi[:, i] - value * (one.mass_by_x @ phi[:, i])
                    slope = f @ phi[:, i]
                    mass = M @ phi[:, i]
                    A = K - value * M + np.outer(mass, mass) * one.shift
                    outside = la.solve(A, -(f - np.outer(slope, mass)).T, assume_a="sym", check_finite=False)
                    bent = one.sensors @ outside / length
                    unit = shape / length
                    slopes.append(np.vstack([slope / one.omega2[j], bent - np.outer(unit, unit @ bent)]))
        return np.concatenate(values), np.vstack(slopes) if derivatives else np.zeros((0, 0))


def milliseconds(call: Callable[[Reals, bool], object], points: Reals, derivatives: bool) -> float:
    """Processor time of a call in a run over the points."""
    begun = time.process_time()
    for x in points:
        call(x, derivatives)
    return 1e3 * (time.process_time() - begun) / len(points)


def row(title: str, study: Path) -> str:
    """A row of the table: both in turn, medians of repeated runs."""
    problem = solved_by(load_study(study), direct).problem()
    x0 = np.zeros(len(problem.parameters.free))
    at = problem.start(x0)
    dense = DenseModel(problem, at)
    points = SPREAD * np.random.default_rng(0).standard_normal((POINTS, len(x0)))
    mine: Callable[[Reals, bool], object] = lambda x, d: problem.follow(x, at, d)  # noqa: E731
    cells = []
    for derivatives in (False, True):
        for call in (mine, dense):
            milliseconds(call, points[:3], derivatives)
        runs = [[milliseconds(call, points, derivatives) for call in (mine, dense)] for _ in range(REPEATS)]
        ours, theirs = (statistics.median(column) for column in zip(*runs))
        ratio = statistics.median(a / b for a, b in runs)
        cells.append(f"{ours:.2f} | {theirs:.2f} | {ratio:.2f}")
    sizes = " + ".join(str(len(c.K0)) for c in dense.cases)
    pairs = sum(c.known.shape[1] for c in dense.cases)
    return f"| {title} | {sizes} | {len(x0)} | {pairs} | {' | '.join(cells)} |"


def main() -> None:
    """Print the table, and write it where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--evidence", type=Path)
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "building").mkdir()
        rows.append(row("benchmark building, three configurations", building.write_inputs(place / "building")))
        for floors in FLOORS:
            study = frame(place / str(floors), floors)
            rows.append(row(f"frame of {floors} storeys", study))
    page = "\n".join([*(line.strip() for line in HEAD.splitlines()), *rows]) + "\n"
    print(page)
    if arguments.evidence:
        (arguments.evidence / "benchmark_small.md").write_text(page)


if __name__ == "__main__":
    main()
