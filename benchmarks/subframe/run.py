"""FRF calibration of a subframe by its size, beside eigsh: python run.py [--dofs N ...] [--paper N] [--evidence DIR].

A deck of the subframe is read and its nine parameters are calibrated from two inputs and 47 outputs with one damping
ratio: reduced models, 100 samples, 20 starts, certified on the full model.
SciPy's eigsh on femtune's factors solves for 50 modes of the same matrices in the same run. With ``--paper`` the
published procedure is followed at that size: a surrogate that is linear in the parameters, by finite differences of
matrices on the nominal modes, and derivatives by finite differences.

Each size runs in a process of its own, whose peak memory is reported, and leaves its numbers in a folder, from which
the page is written: a second start makes what is missing.
"""

from __future__ import annotations

import argparse
import json
import os

# as the commands of femtune do: small dense matrices are slower with threads of their own
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
import resource
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "size"))

import numpy as np
import scipy.linalg as la
import scipy.sparse.linalg as spla
from machine import described
from scipy.optimize import least_squares
from scipy.stats import qmc

from femtune.arrays import Complexes, Reals
from femtune.modal import FrfSet, half_band_lines
from femtune.model import ModelPoint, constant_damping, solve_modes
from femtune.model.reduce import Trained
from femtune.model.response import survey_functions
from femtune.model.solvers.factorise import factorise
from femtune.sampling import Known, PosteriorSamples, SamplingRules
from femtune.steps.posterior.problem import likelihood_of, sampler_of, solving_of
from femtune.uncertainty import Bootstrap, BootstrapRules, BootstrapRun, bootstrap_of, bootstrap_result
from femtune.updating import (
    ReducedUpdate,
    ReductionRules,
    SensitivityMethod,
    StartResult,
    StartRules,
    multi_start_reduced,
)
from structures.subframe_campaign import FREE, LEVEL, Laboratory, calibration

MODES, SD, LIGHT = 50, 0.05, 0.01
RUNS, CHECKED, DRAWS = 1000, 20, 1000


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
    """When trainings, starts and searches ended: seconds by the wall clock, and of the processor, since it began."""

    began: tuple[float, float] = field(default_factory=lambda: (time.perf_counter(), time.process_time()))
    training: tuple[float, float] = (0.0, 0.0)
    starts: tuple[float, float] = (0.0, 0.0)
    solutions: int = 0

    def now(self) -> tuple[float, float]:
        """Since it began."""
        return time.perf_counter() - self.began[0], time.process_time() - self.began[1]

    def trained(self, name: str, trained: Trained) -> None:
        """A full solution was made."""
        self.training, self.solutions = self.now(), len(trained.certified)
        print(f"  {self.training[0]:.0f} s: order {trained.model.order}, {trained.certified[-1].error:.1e}", flush=True)

    def estimated(self, name: str, trained: Trained, count: int) -> None:
        """An error was estimated."""
        self.training = self.now()

    def started(self, start: StartResult) -> None:
        """A start ended."""
        self.starts = self.now()

    def searched(self, number: int) -> None:
        """A search ended."""
        print(f"  {self.now()[0]:.0f} s: search {number} has ended", flush=True)


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
    peak_before, told = _peak(), Told()
    with clock.part("calibration"):
        problem = calibration(lab, {FREE.name: test}, ratio, SD, LEVEL)
        rules = ReductionRules(tolerance=tolerance)
        found = multi_start_reduced(
            problem, SensitivityMethod(), rules, StartRules(20, samples=100), equation_error=False, report=told.started,
            told=told,
        )  # fmt: skip
    truth, update = lab.truth(0), found.update
    peak = _peak()
    with clock.part("bootstrap"):
        work = bootstrap_at(update)
        runs = [work(i) for i in range(RUNS)]
        spread = bootstrap_result(work, runs, ())
    with clock.part("posterior"):
        sampled = samples_at(update)
    finer, shared = replace(work.rules, tolerance=1e-4), replace(work.rules, jacobian="shared")
    error = np.abs(update.result.x - truth)
    measured = {
        "femtune": described(1)["femtune"], "dofs": configured.n_free, "ratio": ratio, "lines": len(test.freq_hz),
        "parts": clock.parts,
        "training": told.training, "starts": told.starts, "training solutions": told.solutions,
        "rounds": list(update.rounds), "certified": update.certified, "solutions": update.cases[0].full_solutions,
        "order": update.cases[0].order, "error": float(error.max()), "errors": error.tolist(),
        "errors in sd": (error / spread.samples.std(axis=0, ddof=1)).tolist(),
        "same optimum": len(found.starts.optima[0].members), "peak": peak, "peak before": peak_before,
        "peak with bootstrap": _peak(), "bootstrap": {
            "runs": RUNS, "converged": len(spread.samples), "solutions": sum(r.solutions for r in spread.runs),
            "difference": largest_difference(work, runs, finer), "shared": largest_difference(work, runs, shared),
            "sentences": list(spread.sentences),
        }, "peak with posterior": _peak(), "posterior": {
            "draws": DRAWS, "effective": sampled.weights.effective, "k_hat": sampled.weights.k_hat,
            "route": sampled.route, "gradients": sampled.gradients, "plain": sampled.plain,
            "sd over that of the bootstrap": (spread_of(sampled) / spread.samples.std(axis=0, ddof=1)).tolist(),
            "off": (np.abs(truth - sampled.weights.values @ sampled.x) / spread_of(sampled)).tolist(),
        },
    }  # fmt: skip
    # the matrices are those of the same model; what was found needs its memory no more
    del found, update, work, runs, problem
    with clock.part("eigsh on PARDISO, 50 modes"):
        eigsh(configured.at(lab.origin))
    return measured


def eigsh(point: ModelPoint) -> None:
    """SciPy's, with femtune's factors and a shift of the size that femtune chooses."""
    shift = -1e-2 * (2.0 * np.pi * FREE.band_hz[0]) ** 2
    K, M = point.symmetric_stiffness, point.symmetric_mass
    factor = factorise(K.plus(-shift, M))
    full = K.full()
    inverse = spla.LinearOperator(full.shape, matvec=factor.solve, dtype=float)
    spla.eigsh(full, MODES, M.full(), sigma=shift, OPinv=inverse, tol=0.0)


def bootstrap_at(update: ReducedUpdate) -> Bootstrap:
    """Lines of the test are drawn with replacement; on the reduced model at the certified end."""
    search, result = update.search, update.result
    assert search is not None
    problem, r = search.reduced_problem(), result.after.residuals
    misfit = float(np.sqrt(r @ r / (len(r) - len(result.active))))
    rules = BootstrapRules("lines", RUNS, jacobian="own", checked=0)
    return bootstrap_of(problem, problem.start(result.x), result.side, result.active, rules, misfit)


def samples_at(update: ReducedUpdate) -> PosteriorSamples:
    """The posterior with errors of the data as stated, on the reduced model at the certified end."""
    search = update.search
    assert search is not None
    solving = solving_of(search.reduced_problem(), update.result, reduced=True)

    def model(points: Sequence[Reals], derivatives: bool) -> list[Known | None]:
        solved = [solving((np.array(x), derivatives)) for x in points]
        return [None if s.problem else Known(x, s.residuals, s.jacobian) for x, s in zip(points, solved)]

    likelihood = likelihood_of(solving, update.result, "stated")
    return sampler_of(solving, likelihood, SamplingRules(DRAWS), model).run()


def spread_of(sampled: PosteriorSamples) -> Reals:
    """Standard deviations of the parameters."""
    w = sampled.weights.values
    return np.sqrt(w @ (sampled.x - w @ sampled.x) ** 2)


def largest_difference(work: Bootstrap, runs: list[BootstrapRun], rules: BootstrapRules) -> float:
    """Of some runs from the same draws by other rules, in standard deviations."""
    again = replace(work, rules=rules)
    return max(float(np.abs((again(i).x - runs[i].x) / work.sd).max()) for i in range(CHECKED))


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
    problem = calibration(lab, {FREE.name: test}, ratio, SD, LEVEL)
    found = multi_start_reduced(
        problem, SensitivityMethod(), ReductionRules(), StartRules(20, samples=100), equation_error=False
    )
    error = float(np.abs(found.update.result.x - lab.truth(0)).max())
    return {"dofs": lab.configured[FREE.name].n_free, "cpu": time.process_time() - began, "error": error}


def _judged(value: float, most: float) -> str:
    return f"{value:.2f}, {'met' if value <= most else 'not met'}"


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2


# ----------------------------------------------------------------------------------------------------
# Processes and page.


def in_own_process(kind: str, dofs: int, given: argparse.Namespace) -> None:
    """A run of this file in a process of its own; what it finds stays in the folder, and is not found again."""
    ratio = given.ratio if kind == "size" else LIGHT
    path = given.folder / f"{kind}_{dofs:07d}_{ratio:g}.json"
    if path.exists():
        return
    given.folder.mkdir(parents=True, exist_ok=True)
    options = {"one": kind, "dofs": dofs, "ratio": ratio, "tolerance": given.tolerance, "starts": given.starts}
    words = [word for name, value in options.items() for word in (f"--{name}", str(value))]
    subprocess.run([sys.executable, __file__, *words, "--write", str(path)], check=True)


def kept(folder: Path, kind: str) -> list[dict]:
    """What was found, by size and damping."""
    found = [json.loads(path.read_text()) for path in folder.glob(f"{kind}_*.json")]
    return sorted(found, key=lambda one: (one["dofs"], -one.get("ratio", 0.0)))


HEAD = (
    "DOFs", "damping, %", "lines", "eigsh, 50 modes", "deck to terms", "first modes and training", "samples and starts",
    "ends", "deck to certified", "× eigsh", "full solutions", "order", "starts at the best optimum",
    "largest error of a parameter", "in its σ", "1000 bootstrap runs", "× eigsh", "20 runs differ by, σ", "peak GiB",
)  # fmt: skip
GOALS = (
    ("deck to certified parameters / eigsh", 480 / 90, "whole"),
    ("samples and starts / eigsh", 1.0, "search"),
    ("1000 bootstrap runs / eigsh", 300 / 90, "bootstrap"),
)


def seconds(one: dict, i: int) -> dict[str, float]:
    """Parts of one size, by the wall clock (0) or of the processor (1)."""
    parts = {name: both[i] for name, both in one["parts"].items()}
    deck, calibration = parts["deck read, terms"], parts["calibration"]
    return {
        "eigsh": parts["eigsh on PARDISO, 50 modes"], "deck": deck, "training": one["training"][i],
        "search": one["starts"][i] - one["training"][i], "ends": calibration - one["starts"][i],
        "whole": deck + calibration, "bootstrap": parts["bootstrap"],
    }  # fmt: skip


def _row(one: dict, i: int) -> str:
    s, b = seconds(one, i), one["bootstrap"]
    cells = [
        f"{one['dofs']:,}", f"{100 * one['ratio']:g}", one["lines"], *(f"{s[name]:.1f}" for name in (
            "eigsh", "deck", "training", "search", "ends", "whole")),
        f"{s['whole'] / s['eigsh']:.2f}", one["solutions"], one["order"],
        f"{one['same optimum']} of 20" + ("" if one["certified"] else " (not certified)"), f"{one['error']:.1e}",
        f"{max(one['errors in sd']):.1f}", f"{s['bootstrap']:.1f}", f"{s['bootstrap'] / s['eigsh']:.2f}",
        f"{b['difference']:.2g}", f"{max(one['peak'], one['peak with bootstrap']):.1f}",
    ]  # fmt: skip
    return f"| {' | '.join(map(str, cells))} |"


def sampling_of(one: dict) -> str:
    """What the posterior of one size took."""
    p, (wall, cpu) = one["posterior"], one["parts"]["posterior"]
    ratios, off = p["sd over that of the bootstrap"], max(p["off"])
    of = "linearised residuals" if p["route"] == "linear" else "a surrogate"
    return (
        f"Posterior distribution on the reduced model, after the calibration: {p['effective']:.0f} of {p['draws']} "
        f"samples are effective (drawn from {of}, k̂ = {p['k_hat']:.2f}), in {wall:.0f} s ({cpu:.0f} s of the "
        f"processor), with {p['gradients']} solutions with and {p['plain']} without derivatives; peak memory "
        f"{one['peak with posterior']:.1f} GiB. Its standard deviations are {min(ratios):.2f} to {max(ratios):.2f} "
        f"times those of the bootstrap; the true values are at most {off:.1f} of them from its mean."
    )


def page(sizes: list[dict], beside: list[dict], machine: dict[str, str]) -> str:
    """The page."""
    lines = [
        "# FRF calibration of a subframe by its size", "",
        "The free subframe with nine parameters, two inputs and 47 outputs, 100 to 400 Hz, three lines in each half "
        "bandwidth; reduced models trained on the box, 100 samples, 20 starts, certified on the full model; then 1000 "
        "bootstrap runs on the measured lines, each by Gauss-Newton steps with derivatives of its own until a step is "
        "below 0.01 σ, of which 20 are repeated until a step is below 0.0001 σ. SciPy's eigsh on PARDISO solves for 50 "
        "modes of the same matrices in the same process, with the shift given, after all else. \"Ends\" are the "
        "enrichments where the best start ends and the check on the full model. Peak memory is the largest resident "
        "memory of the process, from its start until the bootstrap has ended: with the simulation of the test, without "
        "eigsh. The ordering of the equations is known to both from the simulation.", "",
        "| machine | |", "| --- | --- |", *(f"| {name} | {value} |" for name, value in machine.items()),
    ]  # fmt: skip
    for i, name in enumerate(("Seconds by the wall clock", "Seconds of the processor")):
        lines += ["", f"## {name}", "", f"| {' | '.join(HEAD)} |", "| --- " * len(HEAD) + "|"]
        lines += [_row(one, i) for one in sizes]
    large = [one for one in sizes if one["dofs"] == max(o["dofs"] for o in sizes) and one["ratio"] == LIGHT]
    for one in large:
        lines += [
            "",
            f"## Goals at {one['dofs']:,} DOFs and 1 % damping",
            "",
            "| goal | wanted | wall clock | processor |",
        ]
        lines += ["| --- | --- | --- | --- |"]
        for label, most, what in GOALS:
            found = [seconds(one, i)[what] / seconds(one, i)["eigsh"] for i in (0, 1)]
            lines.append(f"| {label} | ≤ {most:.2f} | {' | '.join(_judged(value, most) for value in found)} |")
        peak = max(one["peak"], one["peak with bootstrap"])
        lines.append(f"| peak memory, GiB | < 8 | {_judged(peak, 8.0)} | |")
        difference = one["bootstrap"]["difference"]
        lines.append(f"| difference of 20 runs by full Gauss-Newton, σ | ≤ 0.1 | {_judged(difference, 0.1)} | |")
        lines += [
            "",
            f"20 runs with shared derivatives, those at the optimum, differ by {one['bootstrap']['shared']:.2g} σ.",
        ]
        lines += ["", sampling_of(one)]
        lines += ["", "What happened where searches ended:", "", *(f"- {text}" for text in one["rounds"])]
        lines += ["", "What the bootstrap says:", "", *(f"- {text}" for text in one["bootstrap"]["sentences"])]
    if beside:
        new, old = beside
        lines += [
            "", "## The published procedure", "",
            f"At {old['dofs']:,} DOFs, the same test and lines: a surrogate on {MODES} nominal modes that is linear in "
            "the parameters, by differences of the matrices, 100 samples, Levenberg-Marquardt with derivatives by "
            f"differences from {old['starts']} starts. The certified calibration weights values by the noise of the "
            "test besides, which the published one does not.", "",
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
    parser.add_argument("--folder", type=Path, default=Path("build/benchmark_subframe"), help="what was found so far")
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
    for dofs in given.dofs:
        in_own_process("size", dofs, given)
    for kind in ("ours", "paper") if given.paper else ():
        in_own_process(kind, given.paper, given)
    beside = [*kept(given.folder, "ours")[:1], *kept(given.folder, "paper")[:1]]
    threads = int(os.environ.get("MKL_NUM_THREADS", os.cpu_count() or 1))
    machine = described(threads) | {"threads": f"{threads} of sparse factors and products, 1 of small dense matrices"}
    sizes = kept(given.folder, "size")
    machine |= {"femtune": "; ".join(dict.fromkeys(one["femtune"] for one in sizes))}
    text = page(sizes, beside if len(beside) > 1 else [], machine)
    print(text)
    if given.evidence:
        given.evidence.mkdir(parents=True, exist_ok=True)
        (given.evidence / "benchmark_subframe.md").write_text(text)


if __name__ == "__main__":
    main()
