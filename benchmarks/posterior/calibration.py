"""Whether the posterior is calibrated: python benchmarks/posterior/calibration.py [--each N].

The values of a structure are drawn from the prior, uniform between the bounds, a test with noise as stated is
simulated, and the place of the true values in the weighted samples is noted: the weight of the samples below. With a
right sampler all places between 0 and 1 are equally likely (simulation-based calibration). Each finished test is
written at once; an interrupted run goes on where it ended.

Source: S. Talts, M. Betancourt, D. Simpson, A. Vehtari, A. Gelman, Validating Bayesian inference algorithms with
simulation-based calibration, arXiv:1804.06788, 2018.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "judge"))

import numpy as np
from decks import FRAME, PLATE, RANGES, SUBFRAME, Structure, Values, kind_of
from scipy.stats import binom, chisquare
from series import Row, run_series
from trials import NOISE, Trial, trial, write_data, write_study

import femtune as ft
from femtune.errors import FemtuneError

BINS = 10
ASKED = {"noise": "stated", "draws": 300, "starts": 0, "discrepancy": "none"}
LEAST_P = 0.01


def _chain(v: Values) -> Iterator[str]:
    """Eight masses along a line on ten springs: to the ground, between neighbours, and to the ground at the end."""
    for i in range(1, 9):
        yield f"GRID,{i},,{0.1 * i:.2f},0.,0.,,23456"
        yield f"CONM2,{100 + i},{i},,1.0"
    yield f"CELAS2,1,{float(v['CELAS2 1 K'])!r},1,1"
    for i in range(2, 9):
        yield f"CELAS2,{i},{float(v[f'CELAS2 {i} K'])!r},{i - 1},1,{i},1"
    yield f"CELAS2,9,{float(v['CELAS2 9 K'])!r},8,1"


CHAIN = Structure(
    "chain", {f"CELAS2 {i} K": 1e4 for i in range(1, 10)}, _chain,
    ("CELAS2 2 K", "CELAS2 4 K", "CELAS2 6 K", "CELAS2 8 K"), (), (),
    ("1:1", "3:1", "5:1", "6:1"), 5,
)  # fmt: skip


@dataclass(frozen=True)
class Problem:
    """What is drawn, tested and sampled.

    Parameters
    ----------
    shape_noise : relative standard deviation of shape entries
    starts : of the update, where one from the deck may end in another optimum
    """

    name: str
    structure: Structure
    shape_noise: float = NOISE.shape
    starts: int = 1


_PROBLEMS = (
    Problem("chain of springs", CHAIN, starts=8),
    Problem("frame", FRAME),
    Problem("frame, few data: three modes, shapes to 30 %", replace(FRAME, modes=3), 0.3),
    Problem("plate with shapes", PLATE),
    Problem("subframe, FRFs", SUBFRAME),
)
PROBLEMS = {problem.name: problem for problem in _PROBLEMS}


def drawn(problem: Problem, number: int, seed: int) -> Trial:
    """A structure from the prior."""
    structure = problem.structure
    rng = np.random.default_rng([seed, list(PROBLEMS).index(problem.name), number])
    bounds = [RANGES[kind_of(field)] for field in structure.parameters]
    truth = {f: float(rng.uniform(b.lower, b.upper)) for f, b in zip(structure.parameters, bounds)}
    return replace(
        trial("right", 0, seed), number=number, structure=structure, truth=truth, seed=int(rng.integers(1, 2**31))
    )


def placed(name: str, number: int, seed: int) -> Row:
    """The places of the true values among the samples."""
    problem = PROBLEMS[name]
    one = drawn(problem, number, seed)
    row: Row = {"problem": name, "number": number, "seed": seed}
    noise = replace(NOISE, shape=problem.shape_noise)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        begun = time.process_time()
        try:
            write_data(one, Path(folder), noise)
            study = write_study(one, Path(folder), noise, "posterior")
            found = ft.posterior(study, posterior=ASKED, update={"look_further": False, "starts": problem.starts})
        except FemtuneError as error:
            return row | {"refused": error.code}
    record = found.results.posterior
    if record is None:
        return row | {"refused": "; ".join(a.code for a in found.results.alerts)}
    samples, weights = found.arrays[record.samples_key], found.arrays[record.weights_key]
    truth = {field.replace(" ", "_"): value for field, value in one.truth.items()}
    true = np.array([truth[p] for p in record.free])
    codes = [a.code for a in found.results.alerts if a.level != "info"]
    return row | {
        "seconds": round(time.process_time() - begun, 1),
        "places": {p: round(float(weights @ (samples[:, i] < true[i])), 4) for i, p in enumerate(record.free)},
        "drawn_from": record.drawn_from, "effective": round(record.effective), "told": codes,
        "missing": sorted(set(truth) - set(record.free)),
    }  # fmt: skip


def main() -> None:
    """Run what the journal does not have, and write the page."""
    run_series(__doc__, "calibration", "problem", tuple(PROBLEMS), 200, placed, page)


def page(rows: Sequence[Row], seed: int) -> Iterator[str]:
    """Lines of the table."""
    yield "# Calibration of the posterior distribution"
    yield ""
    yield "The values of structures are drawn from the prior, uniform between the bounds, and tests with noise as"
    yield "stated are simulated. The place of each true value among the weighted samples, from 0 to 1, must be"
    yield "uniformly distributed (simulation-based calibration)."
    yield f"χ² over {BINS} classes for each parameter; seed {seed}."
    yield "Made by `benchmarks/posterior/calibration.py`."
    yield ""
    yield (
        "| problem | tests | no posterior | parameters | least p of χ² | in 50 % intervals | in 95 % intervals | "
        "from a surrogate |"
    )
    yield "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    every: list[float] = []
    for name in PROBLEMS:
        mine = [r for r in rows if r["problem"] == name]
        done = [r for r in mine if "places" in r]
        if not done:
            continue
        names = sorted({n for r in done for n in r["places"]})
        p = [_p([r["places"][n] for r in done if n in r["places"]]) for n in names]
        every += p
        places = np.array([x for r in done for x in r["places"].values()])
        by = np.mean([r["drawn_from"] == "surrogate" for r in done])
        yield (
            f"| {name} | {len(done)} | {len(mine) - len(done)} | {len(names)} | {min(p):.3f} | "
            f"{_inside(places, 0.5)} | {_inside(places, 0.95)} | {100.0 * by:.0f} % |"
        )
    yield ""
    if every:
        # Holm: the least p times the number of tests decides whether any is rejected
        least = min(1.0, min(every) * len(every))
        yield f"Of {len(every)} tests the least p, corrected for their number (Holm), is {least:.2g}; below {LEAST_P}"
        yield "it would be said that the samples are not calibrated."
    refused = [r for r in rows if "refused" in r]
    if refused:
        yield ""
        codes = sorted({r["refused"] for r in refused})
        yield f"{len(refused)} tests have no posterior: {', '.join(codes)}. They are not in the table's shares."


def _p(places: Sequence[float]) -> float:
    counts, _ = np.histogram(places, bins=BINS, range=(0.0, 1.0))
    return float(chisquare(counts).pvalue)


def _inside(places: np.ndarray, level: float) -> str:
    share = float(np.mean(np.abs(places - 0.5) < 0.5 * level))
    n = len(places)
    low, high = binom.ppf([0.025, 0.975], n, level) / n
    return f"{100.0 * share:.1f} % ({100.0 * low:.0f} to {100.0 * high:.0f} by chance)"


if __name__ == "__main__":
    main()
