"""The posterior of the benchmark building beside a sequential Monte Carlo method: building.py [--evidence DIR].

The building is written once more as three (6, 6) models. The posterior of its published test, with errors of the data
as stated, is sampled from these by thousands of particles that begin with the prior and are moved as the likelihood is
raised to its full power. The samples of `femtune posterior` are compared with them: with ten parameters (the published
model M8), with all twelve, of which two combinations are not determined, and with ten from one configuration alone.
Two independent runs of the particles show how well they are converged.

Source: P. Del Moral, A. Doucet, A. Jasra, Sequential Monte Carlo samplers, Journal of the Royal Statistical Society B
68, 2006; C. J. F. ter Braak, A Markov chain Monte Carlo version of the genetic algorithm Differential Evolution,
Statistics and Computing 16, 2006.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples" / "01_building"))

import make_inputs
import numpy as np
import published as p
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import logsumexp, ndtr

import femtune as ft
from femtune.steps.run.result import RunResult
from femtune.study.study import read_study

FREQUENCY_SD, SHAPE_SD = 0.01, 0.1
PARTICLES, MOVES, LAST_MOVES = 8000, 15, 300
"""Particles, steps of each at each power of the likelihood, and at its full power."""
LEFT = 0.9
"""Effective part of the particles that is left when the power of the likelihood grows."""
DRAWS, SEEDS = 1000, (1, 2)
AIMS = {"median": 0.12, "quantile": 0.3, "evidence": 0.15}
"""Largest differences: in standard deviations, and of ln Z."""
NAMES = [name for name, *_ in p.PARAMETERS]


@dataclass(frozen=True)
class Problem:
    """A posterior.

    Parameters
    ----------
    model : of Table 4
    configurations : whose modes are used
    gradients : solutions with derivatives that are allowed
    effective : independent samples of 1000 that are wanted
    """

    title: str
    model: str
    configurations: tuple[str, ...]
    gradients: int
    effective: int


PROBLEMS = (
    Problem("ten parameters", "M8", ("BC", "NC", "SC"), 150, 900),
    Problem("twelve parameters", "M12", ("BC", "NC", "SC"), 300, 650),
    Problem("ten parameters, one configuration", "M8", ("BC",), 300, 650),
)


# ----------------------------------------------------------------------------------------------------
# The building with six degrees of freedom: x, y and rotation of floor 1, then of floor 2.


def _frame(factors: NDArray, column: float, length: float) -> NDArray:
    """(w, 2, 2) stiffness of the two frames of a direction, for factors (w, 4) on columns and beams."""
    h, E = p.STOREY, p.YOUNG
    uu, ut, tt = np.zeros((4, 2, 2)), np.zeros((4, 2, 2)), np.zeros((4, 2, 2))
    uu[0, 0, 0] = 12 / h**3
    uu[1] = np.array([[12, -12], [-12, 12]]) / h**3
    ut[0, 0, 0] = -6 / h**2
    ut[1] = np.array([[6, 6], [-6, -6]]) / h**2
    tt[0, 0, 0] = 4 / h
    tt[1] = np.array([[4, 2], [2, 4]]) / h
    tt[2, 0, 0] = tt[3, 1, 1] = 12 / length
    # two frames of two columns and a beam
    unit = 2 * np.array([2 * E * column, 2 * E * column, E * p.BEAM, E * p.BEAM])
    of_uu, of_ut, of_tt = (np.tensordot(factors * unit, part, 1) for part in (uu, ut, tt))
    return np.asarray(of_uu - of_ut @ np.linalg.solve(of_tt, np.swapaxes(of_ut, 1, 2)))


@dataclass(frozen=True, eq=False)
class Building:
    """Residuals of some configurations by the twelve factors p1 … p12."""

    configurations: tuple[str, ...]

    def stiffness(self, factors: NDArray) -> NDArray:
        """(w, 6, 6) for factors (w, 12)."""
        K = np.zeros((len(factors), 6, 6))
        shear = p.YOUNG / 2.6
        K[:, 2::3, 2::3] = 4 * shear * p.COLUMN_TORSION / p.STOREY * np.array([[2, -1], [-1, 1]])
        arms = (0.5 * p.LENGTH_Y) ** 2, (0.5 * p.LENGTH_X) ** 2
        for d, (column, length, arm) in enumerate(zip((p.COLUMN_X, p.COLUMN_Y), (p.LENGTH_X, p.LENGTH_Y), arms)):
            of_frame = _frame(factors[:, d:8:2], column, length)
            K[:, d::3, d::3] = of_frame
            K[:, 2::3, 2::3] += arm * of_frame
        return K

    @cached_property
    def masses(self) -> tuple[NDArray, NDArray]:
        """(c, 6, 6) of steel and blocks, and (12, 6, 6) of the slabs by the factors."""
        fixed, slope = np.zeros((len(self.configurations), 6, 6)), np.zeros((12, 6, 6))
        for floor, (steel, of_steel) in p.STEEL.items():
            x, y, turn = (3 * (floor - 1) + k for k in range(3))
            slope[7 + floor, x, x] = slope[7 + floor, y, y] = p.SLAB_MASS
            slope[9 + floor, turn, turn] = p.SLAB_INERTIA
            for M, name in zip(fixed, self.configurations):
                M[x, x] += steel
                M[y, y] += steel
                M[turn, turn] += of_steel
                for _, at, mass, e_x, e_y, where in p.BLOCKS:
                    if at == floor and name in where.split():
                        arm = np.zeros((2, 6))
                        arm[0, x] = arm[1, y] = 1.0
                        arm[:, turn] = -e_y, e_x
                        M[...] += mass * arm.T @ arm
        return fixed, slope

    @cached_property
    def tests(self) -> tuple[NDArray, NDArray]:
        """(c, 5) frequencies, and (c, 5, 6) unit-norm shapes."""
        rows = [
            [mode for label, mode in zip(p.MODES, p.MEASURED[name]) if label in make_inputs.TARGETS]
            for name in self.configurations
        ]
        shapes = np.array([[shape for _, shape in modes] for modes in rows])
        return np.array([[hz for hz, _ in modes] for modes in rows]), shapes / np.linalg.norm(
            shapes, axis=2, keepdims=True
        )

    def residuals(self, factors: NDArray) -> NDArray:
        """(w, n) for factors (w, 12): relative frequency errors, and distances of the unit-norm shapes."""
        fixed, of_M = self.masses
        hz, shapes = self.tests
        K = self.stiffness(factors)[:, None]
        inverse = np.linalg.inv(np.linalg.cholesky(fixed + np.tensordot(factors, of_M, 1)[:, None]))
        squares, y = np.linalg.eigh(inverse @ K @ np.swapaxes(inverse, 2, 3))
        phi = np.swapaxes(inverse, 2, 3) @ y
        unit = phi / np.linalg.norm(phi, axis=2, keepdims=True)
        across = shapes @ unit
        partner = np.argmax(np.abs(across), axis=3)
        sign = np.sign(np.take_along_axis(across, partner[..., None], 3))
        freq = np.sqrt(np.take_along_axis(squares, partner, 2)) / (2 * np.pi)
        mine = np.take_along_axis(np.swapaxes(unit, 2, 3), partner[..., None], 2)
        values = [((freq / hz - 1.0) / FREQUENCY_SD)[..., None], (sign * mine - shapes) / SHAPE_SD]
        return np.concatenate(values, axis=3).reshape(len(factors), -1)


@dataclass(frozen=True, eq=False)
class Posterior:
    """Density in coordinates v in which the uniform prior between the bounds is a standard normal one."""

    building: Building
    model: str

    @property
    def free(self) -> list[str]:
        """Names of the free parameters."""
        return [name for name, follows in zip(NAMES, p.MODELS[self.model]) if follows == name]

    @property
    def ties(self) -> NDArray:
        """(12, k) factors by the free parameters."""
        out = np.zeros((12, len(self.free)))
        for i, follows in enumerate(p.MODELS[self.model]):
            out[i, self.free.index(follows)] = 1.0
        return out

    @property
    def bounds(self) -> tuple[NDArray, NDArray]:
        """(k,) lower and upper bounds of the factors."""
        some = [(low, high) for name, _, low, high in p.PARAMETERS if name in self.free]
        return np.array([low for low, _ in some]), np.array([high for _, high in some])

    def factors(self, v: NDArray) -> NDArray:
        """(…, k) of coordinates."""
        lower, upper = self.bounds
        return lower + (upper - lower) * ndtr(v)

    def likelihood(self, v: NDArray) -> NDArray:
        """(w,) log likelihood at v (w, k), with all constants; a shape of unit norm has a value less than entries."""
        parts = np.array_split(v, max(len(v) // 400, 1))
        r = np.concatenate([self.building.residuals(self.factors(part) @ self.ties.T) for part in parts])
        count = r.shape[1] - self.building.tests[0].size
        return np.asarray(-0.5 * np.sum(r**2, axis=1) - 0.5 * count * np.log(2 * np.pi))

    def particles(self, seed: int) -> tuple[NDArray, float]:
        """(n, k) coordinates of equal weight, and ln Z."""
        rng = np.random.default_rng(seed)
        v = rng.standard_normal((PARTICLES, len(self.free)))
        log = self.likelihood(v)
        power, evidence = 0.0, 0.0
        while power < 1.0:
            step = _step(log, 1.0 - power)
            power += step
            evidence += float(logsumexp(step * log) - np.log(len(log)))
            weights = np.exp(step * (log - log.max()))
            at = _resampled(weights / weights.sum(), rng)
            v, log = v[at], log[at]
            for _ in range(MOVES if power < 1.0 else LAST_MOVES):
                self._move(v, log, power, rng)
        return v, evidence

    def _move(self, v: NDArray, log: NDArray, power: float, rng: np.random.Generator) -> None:
        """One step of each half of the particles along differences of the other half, in place."""
        n, k = v.shape
        order = rng.permutation(n)
        for mine, other in ((order[: n // 2], order[n // 2 :]), (order[n // 2 :], order[: n // 2])):
            a, b = rng.permutation(other), rng.permutation(other)
            length = 2.38 / np.sqrt(2 * k) * rng.choice([1.0, 0.5, 0.2], len(mine))
            length[rng.random(len(mine)) < 0.1] = 1.0
            new = v[mine] + length[:, None] * (v[a] - v[b]) + 1e-4 * rng.standard_normal((len(mine), k))
            after = self.likelihood(new)
            gain = power * (after - log[mine]) - 0.5 * np.sum(new**2 - v[mine] ** 2, axis=1)
            taken = np.log(rng.random(len(mine))) < gain
            v[mine[taken]], log[mine[taken]] = new[taken], after[taken]


def _step(log: NDArray, most: float) -> float:
    """The growth of the power that leaves so many effective particles."""

    def left(step: float) -> float:
        w = np.exp(step * (log - log.max()))
        return float(w.sum() ** 2 / np.sum(w**2) / len(w)) - LEFT

    return most if left(most) >= 0.0 else float(brentq(left, 0.0, most))


def _resampled(weights: NDArray, rng: np.random.Generator) -> NDArray:
    """Positions of so many particles, systematically."""
    n = len(weights)
    return np.minimum(np.searchsorted(np.cumsum(weights), (np.arange(n) + rng.random()) / n), n - 1)


# ----------------------------------------------------------------------------------------------------
# Beside it, femtune.


def sampled(problem: Problem, folder: Path) -> tuple[RunResult, NDArray]:
    """`femtune posterior` of the same test, and the nominal values of its free parameters."""
    path = make_inputs.write_inputs(folder, problem.model)
    text = path.read_text()
    if len(problem.configurations) == 1:
        parts = text.split("[[configuration]]")
        rest = parts[-1].split("[sensors]")[1]
        path.write_text(f"{parts[0]}[[configuration]]{parts[1]}[sensors]{rest}")
    asked = {"noise": "stated", "discrepancy": "none", "draws": DRAWS, "gradients": problem.gradients, "starts": 0}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        nominal = np.array([q.nominal for q in read_study(path).parameters.free])
        return ft.posterior(path, posterior=asked), nominal


def quantiles(values: NDArray, weights: NDArray) -> NDArray:
    """(3, k) of weighted samples (n, k): 2.5 %, median, 97.5 %."""
    out = []
    for column in values.T:
        order = np.argsort(column)
        share = np.cumsum(weights[order]) - 0.5 * weights[order]
        out.append(np.interp([0.025, 0.5, 0.975], share, column[order]))
    return np.array(out).T


@dataclass(frozen=True, eq=False)
class Compared:
    """Both ways of one problem; values by parameter."""

    problem: Problem
    free: list[str]
    long: NDArray
    ours: NDArray
    linear: NDArray
    sd: NDArray
    apart: float
    """Largest difference of a quantile between both runs of the particles, in standard deviations."""
    evidence: tuple[float, float]
    ours_evidence: tuple[float, float]
    drawn_from: str
    effective: float
    gradients: int
    plain: int
    seconds: tuple[float, float]
    """Of the processor, for femtune's samples and for the reference."""

    @property
    def median(self) -> NDArray:
        """(k,) differences of the medians in standard deviations."""
        return np.asarray(np.abs(self.ours[1] - self.long[1]) / self.sd)

    @property
    def ends(self) -> NDArray:
        """(k,) larger difference of the 2.5 and 97.5 % quantiles in standard deviations."""
        return np.asarray(np.abs(self.ours[[0, 2]] - self.long[[0, 2]]).max(axis=0) / self.sd)


def compared(problem: Problem) -> Compared:
    """One problem both ways."""
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        found, nominal = sampled(problem, Path(folder))
    between = time.process_time()
    mine = Posterior(Building(problem.configurations), problem.model)
    runs = [mine.particles(seed) for seed in SEEDS]
    each = [mine.factors(v) for v, _ in runs]
    long = np.concatenate(each)
    first, second = (quantiles(x, np.full(len(x), 1.0 / len(x))) for x in each)
    apart = float((np.abs(first - second) / long.std(axis=0)).max())
    logs = [z for _, z in runs]
    evidence = float(np.mean(logs)), 0.5 * abs(logs[0] - logs[1])
    seconds = between - begun, time.process_time() - between
    record = found.results.posterior
    assert record is not None, [a.sentence for a in found.results.alerts]
    assert record.free == tuple(mine.free), record.free
    samples, weights = found.arrays[record.samples_key] / nominal, found.arrays[record.weights_key]
    even = np.full(len(long), 1.0 / len(long))
    linear = np.array([
        (row.linear_interval_95[0], row.linear_median, row.linear_interval_95[1])
        for row in record.parameters if row.parameter in record.free
    ]).T / nominal  # fmt: skip
    return Compared(
        problem, mine.free, quantiles(long, even), quantiles(samples, weights), linear, long.std(axis=0), apart,
        evidence, (record.log_evidence, record.log_evidence_sd), record.drawn_from, record.effective,
        record.gradient_solutions, record.plain_solutions, seconds,
    )  # fmt: skip


def page(rows: list[Compared]) -> Iterator[str]:
    """Lines of the page."""
    yield "# Posterior of the benchmark building beside a sequential Monte Carlo method"
    yield ""
    yield "The posterior of the published test of the [building](01_building.md), with errors of the data as stated"
    yield "(1 % of frequencies, 0.1 of entries of shapes), without errors of the model. The reference is a sequential"
    yield "Monte Carlo method on models with six degrees of freedom, written for this comparison:"
    yield f"{PARTICLES:,} particles begin with the prior, the power of the likelihood is raised in steps that leave"
    yield f"{100 * LEFT:g} % of them effective, and each is moved {MOVES} times at each power and {LAST_MOVES} times at"
    yield "the end. It is run twice, independently; the table has the largest difference of a quantile between both"
    yield "runs. σ is the standard deviation of the reference. Made by `make bench-building`."
    yield ""
    yield (
        "| problem | both runs differ by | medians differ by | 2.5 and 97.5 % quantiles differ by | ln Z, reference | "
        f"ln Z | drawn from | effective of {DRAWS:,} | solutions with derivatives | other solutions | "
        "processor s, reference | processor s |"
    )
    yield "| --- | ---: | ---: | ---: | ---: | ---: | --- | ---: | ---: | ---: | ---: | ---: |"
    for row in rows:
        yield (
            f"| {row.problem.title} | {row.apart:.2f} σ | {row.median.max():.2f} σ (aim {AIMS['median']:g}) | "
            f"{row.ends.max():.2f} σ (aim {AIMS['quantile']:g}) | {row.evidence[0]:.2f} ± {row.evidence[1]:.2f} | "
            f"{row.ours_evidence[0]:.2f} ± {row.ours_evidence[1]:.2f} | {row.drawn_from} | {row.effective:.0f} "
            f"(aim {row.problem.effective}) | {row.gradients} (aim {row.problem.gradients}) | {row.plain} | "
            f"{row.seconds[1]:.0f} | {row.seconds[0]:.0f} |"
        )
    for row in rows:
        yield ""
        yield f"## {row.problem.title[0].upper()}{row.problem.title[1:]}"
        yield ""
        yield "Factors on the values of the deck: median and 95 % interval."
        yield ""
        yield "| parameter | reference | femtune | linearised residuals |"
        yield "| --- | ---: | ---: | ---: |"
        for i, name in enumerate(row.free):
            yield f"| {name} | {' | '.join(_interval(some[:, i]) for some in (row.long, row.ours, row.linear))} |"


def _interval(low_median_high: NDArray) -> str:
    low, median, high = low_median_high
    return f"{median:.3f} ({low:.3f} to {high:.3f})"


def main() -> None:
    """Run, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--evidence", type=Path)
    given = parser.parse_args()
    text = "\n".join(page([compared(problem) for problem in PROBLEMS])) + "\n"
    print(text)
    if given.evidence:
        (given.evidence / "benchmark_building.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
