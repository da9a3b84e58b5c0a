"""The posterior of the benchmark building beside long chains: python benchmarks/posterior/building.py [--evidence DIR].

The building is written once more as three (6, 6) models with closed-form derivatives. The posterior of its
published test, with errors of the data as stated, is sampled from these by a no-U-turn sampler (Mici), with which the
samples of `femtune posterior` are compared: with ten parameters (the published model M8), with all twelve, of which
two combinations are not determined, and with ten from one configuration alone.

Source: M. D. Hoffman, A. Gelman, The no-U-turn sampler, Journal of Machine Learning Research 15, 2014; A. Vehtari and
others, Rank-normalization, folding, and localization: an improved R-hat, Bayesian Analysis 16, 2021.
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
import mici
import numpy as np
import published as p
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import logsumexp, ndtr, ndtri
from scipy.stats import multivariate_t, rankdata

import femtune as ft
from femtune.steps.run.result import RunResult
from femtune.study.study import read_study

FREQUENCY_SD, SHAPE_SD = 0.01, 0.1
CHAINS, WARM_UP, KEPT = 4, 400, 1500
DRAWS, SEED = 1000, 1
STARTS, STEP = 3, 1e-5
AIMS = {"median": 0.12, "quantile": 0.3, "evidence": 0.15}
"""Largest differences: in standard deviations, and of ln Z."""
PROPOSED = 60_000
"""Points of the importance sampling from which ln Z follows."""
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


def _frame(factors: NDArray, column: float, length: float) -> tuple[NDArray, NDArray]:
    """(2, 2) stiffness of the two frames of a direction, and (4, 2, 2) derivatives by the factors."""
    h, E = p.STOREY, p.YOUNG
    # two frames of two columns and a beam
    unit = 2 * np.array([2 * E * column, 2 * E * column, E * p.BEAM, E * p.BEAM])
    uu, ut, tt = np.zeros((4, 2, 2)), np.zeros((4, 2, 2)), np.zeros((4, 2, 2))
    uu[0, 0, 0] = 12 / h**3
    uu[1] = np.array([[12, -12], [-12, 12]]) / h**3
    ut[0, 0, 0] = -6 / h**2
    ut[1] = np.array([[6, 6], [-6, -6]]) / h**2
    tt[0, 0, 0] = 4 / h
    tt[1] = np.array([[4, 2], [2, 4]]) / h
    tt[2, 0, 0] = tt[3, 1, 1] = 12 / length
    of_uu, of_ut, of_tt = (part * unit[:, None, None] for part in (uu, ut, tt))
    whole_uu, whole_ut, whole_tt = (np.tensordot(factors, part, 1) for part in (of_uu, of_ut, of_tt))
    turned = np.linalg.solve(whole_tt, whole_ut.T)
    slope = of_uu - of_ut @ turned - np.swapaxes(of_ut @ turned, 1, 2) + turned.T @ of_tt @ turned
    return whole_uu - whole_ut @ turned, slope


@dataclass(frozen=True, eq=False)
class Building:
    """Residuals of some configurations by the twelve factors p1 … p12."""

    configurations: tuple[str, ...]

    def stiffness(self, factors: NDArray) -> tuple[NDArray, NDArray]:
        """(6, 6), and (12, 6, 6) derivatives."""
        K, slope = np.zeros((6, 6)), np.zeros((12, 6, 6))
        shear = p.YOUNG / 2.6
        K[2::3, 2::3] = 4 * shear * p.COLUMN_TORSION / p.STOREY * np.array([[2, -1], [-1, 1]])
        arms = (0.5 * p.LENGTH_Y) ** 2, (0.5 * p.LENGTH_X) ** 2
        for d, (column, length, arm) in enumerate(zip((p.COLUMN_X, p.COLUMN_Y), (p.LENGTH_X, p.LENGTH_Y), arms)):
            of_frame, by_factor = _frame(factors[d:8:2], column, length)
            K[d::3, d::3] = of_frame
            K[2::3, 2::3] += arm * of_frame
            slope[d:8:2, d::3, d::3] = by_factor
            slope[d:8:2, 2::3, 2::3] = arm * by_factor
        return K, slope

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

    def residuals(self, factors: NDArray) -> tuple[NDArray, NDArray]:
        """(n,), and (n, 12) derivatives: relative frequency errors, and distances of the unit-norm shapes."""
        K, of_K = self.stiffness(factors)
        fixed, of_M = self.masses
        hz, shapes = self.tests
        inverse = np.linalg.inv(np.linalg.cholesky(fixed + np.tensordot(factors, of_M, 1)))
        squares, y = np.linalg.eigh(inverse @ K @ np.swapaxes(inverse, 1, 2))
        phi = np.swapaxes(inverse, 1, 2) @ y
        size = np.linalg.norm(phi, axis=1)
        unit = phi / size[:, None]
        across = shapes @ unit
        # c configurations, t test modes, r the partner of each, h all modes, i factors
        c, r = np.arange(len(hz))[:, None], np.argmax(np.abs(across), axis=2)
        sign = np.sign(np.take_along_axis(across, r[..., None], 2))
        turned = np.swapaxes(phi, 1, 2)[:, None]
        k, m = turned @ of_K @ phi[:, None], turned @ of_M @ phi[:, None]
        k, m = (np.moveaxis(one, 3, 1)[c, r] for one in (k, m))
        own = squares[c, r]
        freq = np.sqrt(own) / (2 * np.pi)
        shift = k - own[..., None, None] * m
        of_square = np.take_along_axis(shift, np.broadcast_to(r[..., None, None], (*shift.shape[:3], 1)), 3)[..., 0]
        is_own = np.arange(6) == r[..., None]
        gap = np.where(is_own, 1.0, own[..., None] - squares[:, None])
        share = np.where(is_own[..., None, :], -0.5 * m, shift / gap[..., None, :])
        of_shape = share @ turned
        mine = np.swapaxes(unit, 1, 2)[c, r]
        of_unit = (of_shape - (of_shape @ mine[..., None]) * mine[..., None, :]) / size[c, r][..., None, None]
        values = np.concatenate([(freq / hz - 1.0)[..., None] / FREQUENCY_SD, (sign * mine - shapes) / SHAPE_SD], 2)
        of_freq = of_square * (freq / hz / (2 * own))[..., None] / FREQUENCY_SD
        slopes = np.concatenate([of_freq[..., None], sign[..., None] * of_unit / SHAPE_SD], 3)
        return values.ravel(), np.swapaxes(slopes, 2, 3).reshape(-1, 12)


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

    def log(self, v: NDArray) -> tuple[float, NDArray]:
        """Log density at v (k,), with all constants, and its gradient."""
        lower, upper = self.bounds
        r, J = self.building.residuals(self.ties @ self.factors(v))
        slope = (upper - lower) * np.exp(-0.5 * v**2) / np.sqrt(2 * np.pi)
        log = -0.5 * (r @ r + v @ v) - 0.5 * (len(r) + len(v)) * np.log(2 * np.pi)
        return float(log), -((J @ self.ties).T @ r) * slope - v

    @cached_property
    def scaling(self) -> tuple[NDArray, NDArray]:
        """Mode v (k,), and L (k, k) with the curvature there L⁻ᵀL⁻¹, at most the prior's variance in any direction."""
        k, rng = len(self.free), np.random.default_rng(SEED)
        starts = 0.3 * rng.standard_normal((STARTS, k))
        found = [minimize(lambda v: -self.log(v)[0], v, jac=lambda v: -self.log(v)[1], method="BFGS") for v in starts]
        v = min(found, key=lambda one: one.fun).x
        curvature = np.array([self.log(v - e)[1] - self.log(v + e)[1] for e in STEP * np.eye(k)]) / (2 * STEP)
        values, turn = np.linalg.eigh(0.5 * (curvature + curvature.T))
        return v, turn / np.sqrt(np.maximum(values, 1.0))

    def chains(self) -> NDArray:
        """(chains, draws, k) coordinates of the no-U-turn sampler, which sees them scaled."""
        v, L = self.scaling
        system = mici.systems.EuclideanMetricSystem(
            neg_log_dens=lambda z: -self.log(v + L @ z)[0], grad_neg_log_dens=lambda z: -L.T @ self.log(v + L @ z)[1]
        )
        sampler = mici.samplers.DynamicMultinomialHMC(
            system, mici.integrators.LeapfrogIntegrator(system), np.random.default_rng(SEED)
        )
        first = np.random.default_rng(SEED).standard_normal((CHAINS, len(v)))
        found = sampler.sample_chains(
            WARM_UP, KEPT, list(first), adapters=[mici.adapters.DualAveragingStepSizeAdapter(0.8)],
            trace_funcs=[lambda state: {"z": state.pos}], display_progress=False,
        )  # fmt: skip
        return v + np.array(found.traces["z"]) @ L.T

    def log_evidence(self, v: NDArray) -> tuple[float, float]:
        """ln Z by importance sampling from a t distribution that is fitted to samples (n, k), and its deviation."""
        rng = np.random.default_rng(SEED)
        near = multivariate_t(v.mean(axis=0), 1.2 * np.cov(v.T), df=5.0, seed=rng)
        points = near.rvs(PROPOSED)
        log = np.array([self.log(point)[0] for point in points]) - near.logpdf(points)
        weights = np.exp(log - log.max())
        relative = weights.std() / weights.mean() / np.sqrt(len(weights))
        return float(logsumexp(log) - np.log(len(log))), float(relative)


def split_r_hat(values: NDArray) -> float:
    """Of one quantity (chains, draws), by the ranks of split chains."""
    half = values.shape[1] // 2
    parts = np.concatenate([values[:, :half], values[:, half : 2 * half]])
    z = ndtri((rankdata(parts).reshape(parts.shape) - 0.375) / (parts.size + 0.25))
    within, between = z.var(axis=1, ddof=1).mean(), half * z.mean(axis=1).var(ddof=1)
    return float(np.sqrt(((half - 1) / half * within + between / half) / within))


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
    r_hat: float
    evidence: tuple[float, float]
    ours_evidence: tuple[float, float]
    drawn_from: str
    effective: float
    gradients: int
    plain: int
    seconds: tuple[float, float]
    """Of the processor, for femtune's samples and for the long chains."""

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
    chains = mine.chains()
    long = mine.factors(chains).reshape(-1, len(mine.free))
    r_hat = max(split_r_hat(chains[:, :, i]) for i in range(len(mine.free)))
    evidence = mine.log_evidence(chains.reshape(-1, len(mine.free)))
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
        problem, mine.free, quantiles(long, even), quantiles(samples, weights), linear, long.std(axis=0), r_hat,
        evidence, (record.log_evidence, record.log_evidence_sd), record.drawn_from, record.effective,
        record.gradient_solutions, record.plain_solutions, seconds,
    )  # fmt: skip


def page(rows: list[Compared]) -> Iterator[str]:
    """Lines of the page."""
    yield "# Posterior of the benchmark building beside long chains"
    yield ""
    yield "The posterior of the published test of the [building](01_building.md), with errors of the data as stated"
    yield "(1 % of frequencies, 0.1 of entries of shapes), without errors of the model. The long chains are those of a"
    yield f"no-U-turn sampler ({CHAINS} chains of {KEPT:,} draws after {WARM_UP:,}) on models with six degrees of"
    yield "freedom that were written for this comparison; the table has the largest R-hat of split ranks. ln Z is by"
    yield f"importance sampling from a t distribution that is fitted to them ({PROPOSED:,} points). Made by"
    yield "`benchmarks/posterior/building.py`."
    yield ""
    yield (
        "| problem | R-hat | medians differ by | 2.5 and 97.5 % quantiles differ by | ln Z, long | ln Z | drawn from | "
        f"effective of {DRAWS:,} | solutions with derivatives | other solutions | processor s, long | processor s |"
    )
    yield "| --- | ---: | ---: | ---: | ---: | ---: | --- | ---: | ---: | ---: | ---: | ---: |"
    for row in rows:
        yield (
            f"| {row.problem.title} | {row.r_hat:.3f} | {row.median.max():.2f} σ (aim {AIMS['median']:g}) | "
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
        yield "| parameter | long chains | femtune | linearised residuals |"
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
