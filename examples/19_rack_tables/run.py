"""Screen, fit and search the published tables of an experiment rack: python run.py [--quick] [--evidence DIR].

The tables are in `structures/rack_tables.py`. They are all that is published of the rack's model: 18 runs of an
orthogonal array, and 7 runs of later samples. The first step is the analysis of variance of the 18 runs, the second a
surrogate of them that predicts the 7 others, the third the minimum of the frequency errors on it.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where structures/ lies

import numpy as np

from femtune.document.figures.effects import main_effects_svg, search_svg
from femtune.experiments import Effects, main_effects
from femtune.global_search import SearchRules, SurrogateMinimum, surrogate_minimum
from femtune.surrogates import KrigingRules, SumOfSquares, Surrogate, fit_surrogate
from structures import rack_tables as rack

RECIPE = KrigingRules(trend="constant", correlation="gaussian", noise="estimate", logarithms=True)
OTHERS = {
    "without logarithms": KrigingRules(),
    "Matérn 5/2": KrigingRules(correlation="matern-5/2", logarithms=True),
    "linear trend": KrigingRules(trend="linear", logarithms=True),
    "linear response surface": KrigingRules(trend="linear", correlation="none", logarithms=True),
}
OBJECTIVE = SumOfSquares(rack.MEASURED, rack.MEASURED)
SEARCH = SearchRules("genetic", population=100, crossover=0.8, mutation=0.005)
"""As published."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """A surrogate of the array, and its errors in %: of 3 fresh runs, of 4 samples, and of leaving out a run."""

    surrogate: Surrogate
    fresh: np.ndarray
    sample: np.ndarray
    left_out: np.ndarray


def predicted(rules: KrigingRules) -> Predicted:
    """A surrogate of the 18 runs beside the other runs."""
    found = fit_surrogate(rack.RUNS, rack.FREQUENCIES, rules, parameters=rack.NAMES, responses=rack.ORDERS)
    fresh = 100.0 * (found.predict(rack.FRESH_RUNS) / rack.FRESH_FREQUENCIES - 1.0)
    sample = 100.0 * (found.predict(rack.SAMPLE_RUNS) / rack.SAMPLE_FREQUENCIES - 1.0)
    return Predicted(found, fresh, sample, 100.0 * (found.left_out / found.y - 1.0))


def squares(surrogate: Surrogate, x: np.ndarray) -> float:
    """Sum of the squared relative errors of the six frequencies."""
    return 2.0 * float(OBJECTIVE(surrogate.predict(x))[0])


@dataclass(frozen=True)
class Impossible:
    """Two runs whose frequencies no one model can have: the largest ratio of a frequency, and the largest possible."""

    one: str
    other: str
    ratio: float
    possible: float


def impossible(runs: np.ndarray, freq_hz: np.ndarray, names: tuple[str, ...]) -> list[Impossible]:
    """Pairs of runs that contradict each other.

    Stiffness is a sum of parts that are proportional to the moduli, or constant, and mass likewise of densities. By
    Rayleigh's quotient no squared frequency then changes by more than the largest ratio of a modulus (or 1) over the
    smallest ratio of a density (or 1).
    """
    found = []
    for i, (x, f) in enumerate(zip(runs, freq_hz)):
        for j, (x2, f2) in enumerate(zip(runs, freq_hz)):
            moduli, densities = x2[:3] / x[:3], x2[3:] / x[3:]
            possible = np.sqrt(max(1.0, moduli.max()) / min(1.0, densities.min()))
            # half of the last digit of both frequencies
            ratio = float(((f2 - 0.005) / (f + 0.005)).max())
            if ratio > possible:
                found.append(Impossible(names[i], names[j], ratio, float(possible)))
    return found


def check_mixed() -> list[Impossible]:
    """The runs of the solid model agree with each other, those of the mixed one do not."""
    solid = np.vstack([rack.RUNS, rack.SAMPLE_RUNS, rack.FRESH_RUNS])
    of_solid = np.vstack([rack.FREQUENCIES, rack.SAMPLE_FREQUENCIES, rack.FRESH_FREQUENCIES])
    assert not impossible(solid, of_solid, tuple(map(str, range(len(solid)))))
    found = impossible(rack.MIXED_RUNS, rack.MIXED_FREQUENCIES, rack.MIXED_NAMES)
    assert [(pair.one, pair.other) for pair in found] == [("A1(b) X149", "A2(b) X2")], found
    assert found[0].ratio > 1.02 * found[0].possible
    return found


def _mixed(found: list[Impossible]) -> list[str]:
    X = np.column_stack([np.ones(7), np.log(rack.MIXED_RUNS[:, [0, 1, 2, 4]])])
    Y = np.log(rack.MIXED_FREQUENCIES)
    rest = 100.0 * np.abs(X @ np.linalg.lstsq(X, Y, rcond=None)[0] - Y).max()
    first = found[0]
    return [
        "## The mixed model", "",
        "Of the mixed model seven runs are printed, Tables A1(b) and A2(b), for an optimum of "
        f"{rack.MIXED_OPTIMUM[0]} and {rack.MIXED_OPTIMUM[2]} GPa. They cannot be runs of one model: from "
        f"{first.one} to {first.other} a frequency grows by a factor of {first.ratio:.3f}, while the moduli and the "
        f"density allow {first.possible:.3f} at most (Rayleigh's quotient, for any stiffness that is a sum of "
        "parts proportional to the moduli or constant, and such a mass). A power law of four parameters, which fits "
        f"the solid model, leaves up to {rest:.1f} % in seven runs with two degrees of freedom. Therefore the "
        "optimum cannot be recomputed from what is printed. The same test finds no contradiction in the 25 runs of the "
        "solid model.", "",
    ]  # fmt: skip


def check(effects: Effects, main: Predicted, found: SurrogateMinimum) -> None:
    """Assert the published numbers, and what was promised beside them."""
    last_digit = np.where(rack.F_VALUES % 1.0 == 0.0, 1.0, 0.1)
    assert np.all(np.abs(effects.f_values - rack.F_VALUES) <= 0.5 * last_digit)
    assert np.abs(main.fresh).max() < 1.2
    assert 2.0 * found.value < 0.0053
    assert 2.0 * found.value <= 0.5 * squares(main.surrogate, rack.PUBLISHED_OPTIMUM)


def _digits(value: float) -> str:
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


def _screening(effects: Effects) -> list[str]:
    lines = [
        "## The orthogonal array: F, p and contribution", "",
        "18 runs, 5 parameters of three levels, six frequencies; 7 degrees of freedom for the error. In each cell: F, "
        "contribution in %, and 1 where the source calls the effect significant.", "",
        "| parameter | " + " | ".join(rack.ORDERS) + " |", "| --- " * 7 + "|",
    ]  # fmt: skip
    for i, name in enumerate(rack.NAMES):
        cells = [
            f"{_digits(effects.f_values[i, j])}, {100 * effects.contribution[i, j]:.1f} %, {rack.FLAGS[i, j]}"
            for j in range(6)
        ]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    error = [f"{100 * e:.2f} %" for e in effects.error_contribution]
    agree = int(np.sum((effects.contribution > 0.077) == rack.FLAGS))
    return [
        *lines, f"| error | {' | '.join(error)} |", "",
        "All F agree with the recomputed ones of the source's table to the last digit. The largest p of the first five "
        f"frequencies is {effects.p_values[:, :5].max():.1e}: every parameter is significant at any usual level, "
        "because main effects explain almost everything. The flags of the source therefore do not follow from F. A "
        f"contribution above 7.7 % gives {agree} of the 30.", "", "![Main effects](19_rack_tables.svg)", "",
    ]  # fmt: skip


def _surrogates(main: Predicted, others: dict[str, Predicted]) -> list[str]:
    lines = [
        "## A surrogate of the array alone", "",
        "Errors in % of the three runs that the source made to check its own surrogate of 150 runs (0.50 % at most), "
        "of four of these 150, and of leaving out one run of the array. The recipe: Kriging with a constant trend, a "
        "Gaussian correlation with one length per parameter, the noise (nugget) estimated, by restricted likelihood, "
        "on the logarithms of frequencies and parameters; the density of the beams at its nominal value.", "",
        "| surrogate | fresh runs, largest | fresh runs, mean | samples, largest | leaving out, root mean square |",
        "| --- " * 5 + "|",
    ]  # fmt: skip
    for name, p in {"the recipe": main, **others}.items():
        values = (np.abs(p.fresh).max(), p.fresh.mean(), np.abs(p.sample).max(), np.sqrt(np.mean(p.left_out**2)))
        lines.append(f"| {name} | " + " | ".join(f"{v:.2f}" for v in values) + " |")
    lower = int(np.sum(main.fresh < 0.0) + np.sum(main.sample < 0.0))
    shift = -np.mean([*main.fresh.ravel(), *main.sample.ravel()])
    return [
        *lines, "",
        f"{lower} of the 42 predictions are too low: the 18 runs and the later ones differ by about "
        f"{shift:.1f} %. This is a difference between two models, not an error of the surrogate, and prediction "
        "intervals, which hold for runs of the same model, do not contain it.", "",
    ]  # fmt: skip


def _search(main: Predicted, found: SurrogateMinimum) -> list[str]:
    rows = {"published": rack.PUBLISHED_OPTIMUM, "minimum on the surrogate": found.x}
    lines = [
        "## The minimum", "",
        "Sum of the squared relative errors of six frequencies, on the surrogate of the recipe, within the bounds of "
        "the source: a genetic algorithm with its population of 100, crossover of 0.8 and mutation of 0.005, followed "
        f"by bounded least squares. {found.same} of {len(found.searches)} seeds end at the same minimum. Moduli in "
        "GPa, densities in kg/m³.", "",
        "| | X1 | X2 | X3 | X5 | objective | errors of the six frequencies in % |", "| --- " * 7 + "|",
    ]  # fmt: skip
    for name, x in rows.items():
        errors = 100.0 * (main.surrogate.predict(x)[0] / rack.MEASURED - 1.0)
        values = f"{x[0]:.2f} | {x[1]:.2f} | {x[2]:.2f} | {x[4]:.0f} | {squares(main.surrogate, x):.5f}"
        lines.append(f"| {name} | {values} | {', '.join(f'{e:+.1f}' for e in errors)} |")
    bounds = [name for name, side in zip(rack.NAMES, found.at_bound) if side]
    ratio = 2.0 * found.value / squares(main.surrogate, rack.PUBLISHED_OPTIMUM)
    return [
        *lines, "",
        f"The minimum has {100 * ratio:.0f} % of the published point's objective. {' and '.join(bounds)} are on their "
        "bounds: within them, the model cannot have the measured frequencies, and the values say little about the "
        "material.", "",
        "![Convergence](19_rack_tables_search.svg)", "",
    ]  # fmt: skip


def main() -> None:
    """Check, and write the evidence where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="three seeds of the search instead of twenty")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    effects = main_effects(rack.LEVELS, rack.FREQUENCIES)
    kriging = predicted(RECIPE)
    others = {name: predicted(rules) for name, rules in OTHERS.items()}
    seeds = range(3 if options.quick else 20)
    found = surrogate_minimum(kriging.surrogate, OBJECTIVE, (rack.BOUNDS[:, 0], rack.BOUNDS[:, 1]), SEARCH, seeds)
    check(effects, kriging, found)
    lines = ["# The tables of a rack: orthogonal array, surrogate, global search", ""]
    text = "\n".join(
        [*lines, *_screening(effects), *_surrogates(kriging, others), *_search(kriging, found), *_mixed(check_mixed())]
    )
    print(text)
    if options.evidence:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / "19_rack_tables.md").write_text(text, encoding="utf-8")
        changes = [100.0 * (means / rack.FREQUENCIES.mean(axis=0) - 1.0) for means in effects.level_means]
        picture = main_effects_svg(rack.NAMES, rack.ORDERS, rack.VALUES.tolist(), [c.tolist() for c in changes])
        (options.evidence / "19_rack_tables.svg").write_text(picture, encoding="utf-8")
        histories = [
            (f"seed {i}", s.evaluations.tolist(), (2.0 * s.history).tolist()) for i, s in enumerate(found.searches[:5])
        ]
        picture = search_svg(histories, (2.0 * found.values).tolist())
        (options.evidence / "19_rack_tables_search.svg").write_text(picture, encoding="utf-8")


if __name__ == "__main__":
    main()
