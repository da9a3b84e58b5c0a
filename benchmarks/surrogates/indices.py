"""Sobol's indices of the function of Ishigami and Homma (1990), which has them in closed form."""

from __future__ import annotations

from importlib.util import find_spec
from math import pi

import numpy as np

from femtune.experiments import latin_hypercube, sobol_indices
from femtune.surrogates import ChaosRules, chaos_indices, fit_surrogate

A, B = 7.0, 0.1
RUNS, POINTS = 200, 1024
Indices = tuple[np.ndarray, np.ndarray]


def function(x: np.ndarray) -> np.ndarray:
    """(k,) at points (k, 3) of the unit cube."""
    z = pi * (2.0 * x - 1.0)
    return np.asarray(np.sin(z[:, 0]) + A * np.sin(z[:, 1]) ** 2 + B * z[:, 2] ** 4 * np.sin(z[:, 0]))


def closed_form() -> Indices:
    """First and total indices."""
    one, two = 0.5 * (1.0 + B * pi**4 / 5.0) ** 2, A**2 / 8.0
    both = B**2 * pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    whole = one + two + both
    return np.array([one, two, 0.0]) / whole, np.array([one + both, two, both]) / whole


def of_chaos() -> tuple[int, Indices]:
    """femtune, from the coefficients."""
    x = latin_hypercube(3, RUNS, 1).points
    fitted = fit_surrogate(x, function(x)[:, None], ChaosRules(12), (np.zeros(3), np.ones(3)))
    found = chaos_indices(fitted)
    return RUNS, (found.first[:, 0], found.total[:, 0])


def of_scipy() -> tuple[int, Indices]:
    """SciPy, as femtune offers it, by evaluations of the function."""
    found = sobol_indices(lambda x: function(x)[:, None], 3, POINTS)
    return POINTS * 5, (found.first[:, 0], found.total[:, 0])


def of_salib() -> tuple[int, Indices]:
    """SALib, by evaluations of the function."""
    from SALib.analyze import sobol as analysis  # noqa: PLC0415
    from SALib.sample import sobol as sample  # noqa: PLC0415

    problem = {"num_vars": 3, "names": ["a", "b", "c"], "bounds": [[0.0, 1.0]] * 3}
    x = sample.sample(problem, POINTS, calc_second_order=False, seed=0)
    found = analysis.analyze(problem, function(x), calc_second_order=False, seed=0)
    return len(x), (np.asarray(found["S1"]), np.asarray(found["ST"]))


def of_openturns() -> tuple[int, Indices]:
    """OpenTURNS, from the coefficients of its polynomial chaos on the same runs."""
    import openturns as ot  # noqa: PLC0415

    x = latin_hypercube(3, RUNS, 1).points
    law = ot.JointDistribution([ot.Uniform(0.0, 1.0)] * 3)
    enumerate_ = ot.LinearEnumerateFunction(3)
    basis = ot.OrthogonalProductPolynomialFactory([ot.LegendreFactory()] * 3, enumerate_)
    chosen = ot.LeastSquaresMetaModelSelectionFactory(ot.LARS(), ot.CorrectedLeaveOneOut())
    algorithm = ot.FunctionalChaosAlgorithm(
        ot.Sample(x), ot.Sample(function(x)[:, None]), law,
        ot.FixedStrategy(basis, enumerate_.getStrataCumulatedCardinal(10)), ot.LeastSquaresStrategy(chosen),
    )  # fmt: skip
    algorithm.run()
    found = ot.FunctionalChaosSobolIndices(algorithm.getResult())
    each = [(found.getSobolIndex(i), found.getSobolTotalIndex(i)) for i in range(3)]
    return RUNS, tuple(np.array(each).T)  # type: ignore[return-value]


def measured() -> list[tuple[str, int, Indices]]:
    """Name, evaluations of the function, first and total indices; libraries that are not installed are left out."""
    rows = [
        ("femtune, polynomial chaos", *of_chaos()),
        ("SciPy, as in `femtune.experiments`", *of_scipy()),
    ]
    if find_spec("openturns") is not None:
        rows.append(("OpenTURNS, polynomial chaos, degree 10", *of_openturns()))
    if find_spec("SALib") is not None:
        rows.append(("SALib", *of_salib()))
    return rows


def table(rows: list[tuple[str, int, Indices]]) -> list[str]:
    """Lines of the page."""
    first, total = closed_form()
    heads = [f"{kind} {i}" for kind in ("first", "total") for i in (1, 2, 3)]
    shown = [("closed form", "–", (first, total)), *((name, str(runs), found) for name, runs, found in rows)]
    return [
        f"| | evaluations | {' | '.join(heads)} | largest error |",
        "| --- " * 9 + "|",
        *(
            f"| {name} | {runs} | {' | '.join(f'{part:.4f}' for part in np.concatenate(found))} | "
            f"{max(np.abs(found[0] - first).max(), np.abs(found[1] - total).max()):.1e} |"
            for name, runs, found in shown
        ),
    ]
