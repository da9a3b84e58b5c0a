"""FRF calibration of a subframe by its size, beside eigsh: python run.py [--dofs N ...] [--paper N] [--evidence DIR].

A deck of the subframe is read and its nine parameters are calibrated from two inputs and 47 outputs with one damping
ratio: reduced models, 100 samples, 20 starts, certified on the full model.
SciPy's eigsh on femtune's factors solves for 50 modes of the same matrices in the same run. With ``--paper`` the
published procedure is followed at that size: a surrogate that is linear in the parameters, by finite differences of
matrices on the nominal modes, and derivatives by finite differences.

Each size runs in a process of its own, whose peak memory is reported.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))

import numpy as np
import scipy.linalg as la
import scipy.sparse.linalg as spla
from scipy.optimize import least_squares
from scipy.stats import qmc

from femtune.arrays import Complexes, Reals
from femtune.modal import FrfSet, half_band_lines
from femtune.model import constant_damping, solve_modes
from femtune.model.reduce import Trained
from femtune.model.response import survey_functions
from femtune.model.solvers.factorise import factorise
from femtune.updating import ReductionRules, SensitivityMethod, StartResult, StartRules, multi_start_reduced
from structures.subframe_campaign import FREE, LEVEL, Laboratory, calibration

MODES, SD = 50, 0.05


@dataclass
class Clock:
    """Seconds of named parts, wall and processor."""

    parts: dict[str, list[float]] = field(default_factory=dict)

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """One part."""
        wall, cpu = time.perf_counter(), time.process_time()
        yield
        self.parts[name] = [time.perf_counter() - wall, time.process_time() - cpu]
        print(f"{name}: {self.parts[name][0]:.1f} s, CPU {self.parts[name][1]:.1f} s", flush=True)


@dataclass
class Told:
    """When trainings and searches ended."""

    began: float = field(default_factory=time.perf_counter)
    training: float = 0.0
    solutions: int = 0

    def trained(self, name: str, trained: Trained) -> None:
        """A full solution was made."""
        self.training, self.solutions = time.perf_counter() - self.began, len(trained.certified)
        print(f"  {self.training:.0f} s: order {trained.model.order}, {trained.certified[-1].error:.1e}", flush=True)

    def estimated(self, name: str, trained: Trained, count: int) -> None:
        """An error was estimated."""
        self.training = time.perf_counter() - self.began

    def searched(self, number: int) -> None:
        """A search ended."""
        print(f"  {time.perf_counter() - self.began:.0f} s: search {number} has ended", flush=True)


def simulated(lab: Laboratory, ratio: float) -> FrfSet:
    """FRFs at the truth with one damping ratio, and noise."""
    solved = solve_modes(lab.configured[FREE.name].at(lab.truth(0)), None, 2.0 * FREE.band_hz[1])
    lines, ports = half_band_lines(FREE.band_hz, ratio), lab.ports(FREE)
    exact = survey_functions(solved, ports, lines, damping=constant_damping(ratio))
    chance = np.random.default_rng(3).standard_normal((2, *exact.shape))
    values = exact + LEVEL * np.abs(exact).max(axis=2, keepdims=True) * (chance[0] + 1j * chance[1])
    return FrfSet(lines, values, ports.output_labels, ports.input_labels, "accelerance")


def measure(n_dofs: int, ratio: float, tolerance: float) -> dict[str, object]:
    """All of one size."""
    clock = Clock()
    with clock.part("test, not counted"):
        test = simulated(Laboratory(n_dofs), ratio)
    lab = Laboratory(n_dofs)
    _ = lab.mesh
    with clock.part("deck read, terms"):
        configured = lab.configured[FREE.name]
    point = configured.at(lab.origin)
    shift = -1e-2 * (2.0 * np.pi * FREE.band_hz[0]) ** 2
    with clock.part("eigsh on PARDISO, 50 modes"):
        K, M = point.symmetric_stiffness, point.symmetric_mass
        factor = factorise(K.plus(-shift, M))
        full = K.full()
        inverse = spla.LinearOperator(full.shape, matvec=factor.solve, dtype=float)
        spla.eigsh(full, MODES, M.full(), sigma=shift, OPinv=inverse, tol=0.0)
    del factor, full, inverse, K, M, point
    peak_before = _peak()
    told, ends = Told(), list[StartResult]()
    first = [0.0, 0.0]

    def tell(start: StartResult) -> None:
        first[len(ends) > 0] = time.perf_counter()
        ends.append(start)

    with clock.part("calibration"):
        problem = calibration(lab, {FREE.name: test}, ratio, SD)
        rules = ReductionRules(tolerance=tolerance)
        found = multi_start_reduced(
            problem, SensitivityMethod(), rules, StartRules(20, samples=100), equation_error=False, report=tell,
            told=told,
        )  # fmt: skip
    truth, result = lab.truth(0), found.update.result
    return {
        "dofs": configured.n_free, "ratio": ratio, "lines": len(test.freq_hz), "parts": clock.parts,
        "training": told.training, "training solutions": told.solutions, "first start": first[0] - told.began,
        "last start": first[1] - told.began, "rounds": list(found.update.rounds),
        "certified": found.update.certified, "solutions": found.update.cases[0].full_solutions,
        "order": found.update.cases[0].order, "error": float(np.abs(result.x - truth).max()),
        "same optimum": len(found.starts.optima[0].members), "peak": _peak(), "peak before": peak_before,
    }  # fmt: skip


def paper(n_dofs: int, ratio: float, starts: int) -> dict[str, object]:
    """The published procedure: 100 samples, some starts, Levenberg-Marquardt with differences, all lines."""
    lab = Laboratory(n_dofs)
    test = simulated(lab, ratio)
    began = time.process_time()
    configured, k, step = lab.configured[FREE.name], lab.parameters, 1e-2
    nominal = configured.at(lab.origin)
    modes = solve_modes(nominal, MODES)
    V, ports = modes.shapes[:, :MODES], lab.ports(FREE)
    C, B = np.asarray(ports.outputs @ V), np.asarray(ports.inputs.T @ V).T
    s = 2j * np.pi * test.freq_hz
    known = [V.T @ (nominal.stiffness @ V), V.T @ (nominal.mass @ V)]
    slopes = []
    for i in range(k):
        there = configured.at(step * np.eye(k)[i])
        moved = V.T @ (there.stiffness @ V), V.T @ (there.mass @ V)
        slopes.append([(m - n) / step for m, n in zip(moved, known)])

    def functions(x: Reals) -> Complexes:
        K, M = (n + sum(v * sl[j] for v, sl in zip(x, slopes)) for j, n in enumerate(known))
        values, Y = la.eigh(K, M)
        omega = np.sqrt(np.maximum(values, 0.0))
        omega[:6] = 0.0
        Z = omega**2 + 2.0 * ratio * omega * s[:, None] + s[:, None] ** 2
        return np.einsum("or,kr,ri->oik", C @ Y, s[:, None] ** 2 / Z, Y.T @ B, optimize=True)

    def residuals(x: Reals) -> Reals:
        logs = np.log10(functions(x) / test.values).ravel()
        return np.concatenate([logs.real, logs.imag])

    lower, upper = lab.parameter_set.bounds
    points = lower + qmc.LatinHypercube(k, rng=0).random(100) * (upper - lower)
    sums = [float(residuals(x) @ residuals(x)) for x in points]
    chosen = [lab.origin, *points[np.argsort(sums)[: starts - 1]]]
    ends = [least_squares(residuals, x, method="lm", max_nfev=100 * (k + 1)) for x in chosen]
    best = min(ends, key=lambda e: e.cost)
    error = float(np.abs(best.x - lab.truth(0)).max())
    return {"dofs": configured.n_free, "cpu": time.process_time() - began, "error": error, "starts": starts}


def ours(n_dofs: int, ratio: float) -> dict[str, object]:
    """The same test by reduced models."""
    lab = Laboratory(n_dofs)
    test = simulated(lab, ratio)
    began = time.process_time()
    lab = Laboratory(n_dofs)
    problem = calibration(lab, {FREE.name: test}, ratio, SD)
    found = multi_start_reduced(
        problem, SensitivityMethod(), ReductionRules(), StartRules(20, samples=100), equation_error=False
    )
    error = float(np.abs(found.update.result.x - lab.truth(0)).max())
    return {"dofs": lab.configured[FREE.name].n_free, "cpu": time.process_time() - began, "error": error}


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2


# ----------------------------------------------------------------------------------------------------
# Processes and page.


def in_own_process(*arguments: str) -> dict[str, object]:
    """What a run of this file with these arguments writes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "found.json"
        subprocess.run([sys.executable, __file__, *arguments, "--write", str(path)], check=True)
        return dict(json.loads(path.read_text()))


def page(sizes: list[dict], beside: list[dict]) -> str:
    """The page."""
    head = (
        "DOFs", "damping, %", "lines", "eigsh on PARDISO, 50 modes", "deck to terms", "first modes and training",
        "samples and starts", "whole calibration", "calibration / eigsh", "full solutions", "order", "certified",
        "starts at the best optimum", "largest error of a parameter", "peak memory, GiB",
    )  # fmt: skip
    lines = [
        "# FRF calibration of a subframe by its size", "",
        "The free subframe with nine parameters, two inputs and 47 outputs, 100 to 400 Hz, three lines in each half "
        "bandwidth; 100 samples, 20 starts, certified on the full model. Wall clock seconds. The machine had other "
        "work to do, so that the ratio to eigsh for 50 modes in the same process tells more.", "",
        f"| {' | '.join(head)} |", "| --- " * len(head) + "|",
    ]  # fmt: skip
    for one in sizes:
        parts = one["parts"]
        eigsh, whole = parts["eigsh on PARDISO, 50 modes"][0], parts["calibration"][0]
        lines.append(
            f"| {one['dofs']:,} | {100 * one['ratio']:g} | {one['lines']} | {eigsh:.0f} | "
            f"{parts['deck read, terms'][0]:.0f} | {one['training']:.0f} | {one['last start'] - one['training']:.0f} | "
            f"{whole:.0f} | {whole / eigsh:.1f} | {one['solutions']} | {one['order']} | "
            f"{'yes' if one['certified'] else 'no'} | {one['same optimum']} of 20 | {one['error']:.1e} | "
            f"{one['peak']:.1f} |"
        )
    if beside:
        new, old = beside
        lines += [
            "", "## The published procedure", "",
            f"At {old['dofs']:,} DOFs, the same test and lines: a surrogate on {MODES} nominal modes that is linear in "
            "the parameters, by differences of the matrices, 100 samples, Levenberg-Marquardt with derivatives by "
            f"differences from {old['starts']} starts.", "",
            "| procedure | CPU s | largest error of a parameter |", "| --- | --- | --- |",
            f"| published | {old['cpu']:.0f} | {old['error']:.2g} |",
            f"| reduced models, certified | {new['cpu']:.0f} | {new['error']:.2g} |",
            f"| ratio | {old['cpu'] / new['cpu']:.1f} | {old['error'] / new['error']:.0f} |",
        ]  # fmt: skip
    return "\n".join([*lines, ""])


def main() -> None:
    """Measure, and write the page where asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dofs", type=int, nargs="*", default=[20_000, 100_000, 600_000])
    parser.add_argument("--ratio", type=float, default=0.01)
    parser.add_argument("--tolerance", type=float, default=1e-4)
    parser.add_argument("--paper", type=int)
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--evidence", type=Path)
    parser.add_argument("--one", choices=("size", "paper", "ours"))
    parser.add_argument("--write", type=Path)
    given = parser.parse_args()
    if given.one is not None:
        kinds = {
            "size": lambda n: measure(n, given.ratio, given.tolerance),
            "paper": lambda n: paper(n, given.ratio, given.starts),
            "ours": lambda n: ours(n, given.ratio),
        }
        given.write.write_text(json.dumps(kinds[given.one](given.dofs[0])))
        return
    common = ["--ratio", str(given.ratio), "--tolerance", str(given.tolerance), "--starts", str(given.starts)]
    sizes = [in_own_process("--one", "size", "--dofs", str(n), *common) for n in given.dofs]
    both = ("ours", "paper") if given.paper else ()
    beside = [in_own_process("--one", kind, "--dofs", str(given.paper), *common) for kind in both]
    text = page(sizes, beside)
    print(text)
    if given.evidence is not None:
        given.evidence.mkdir(parents=True, exist_ok=True)
        (given.evidence / "benchmark_subframe.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
