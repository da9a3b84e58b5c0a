"""Runs of the model with derivatives, a surrogate, and a genetic algorithm: python run.py [--quick] [--evidence DIR].

The benchmark building with three, six and ten parameters is updated by the sensitivity method with analytic
derivatives, by Kriging of runs and a genetic algorithm on it, and by the genetic algorithm on the model. A run is one
solution of all three configurations. What counts is the number of runs until χ² is within a part of its minimum.

A frame in CalculiX (`ccx` on the path, or $FEMTUNE_CALCULIX) is updated by differences of its results, and with the
derivatives of femtune's own model of a deck. Without CalculiX this section is left out, and no page is written.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples" / "01_building"))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))  # where structures/ lies

import numpy as np
from make_inputs import write_inputs

import femtune as ft
from femtune.arrays import Reals
from femtune.journal.runs import open_run_journal
from femtune.residuals import CaseState, Evaluation, UpdateProblem
from femtune.steps.run.result import RunResult
from femtune.study.study import read_study
from femtune.study.update_method import method_of
from femtune.updating import StartRules, starting_points, update
from structures import two_solvers
from structures.two_solvers import DeckErrors

NEAR = 0.01
"""Part of the least χ² by which a result may be above it."""
TABLES = (20, 40, 80)
SEEDS = (0, 1)
POPULATION, GENERATIONS = 40, 25
MODELS = ("M2", "M5", "M8")
DECKS = {
    "the same section": DeckErrors(),
    "section 3 % too high": DeckErrors(height=1.03),
    "lower beam with half its moments of inertia": DeckErrors(inertia={"beam": 0.5}),
    "lower beam with a hundredth of them": DeckErrors(inertia={"beam": 0.01}),
}
"""Decks beside the frame in CalculiX; the last one is too different for its derivatives to lead all the way."""
SAME = 0.05
"""Standard deviations within which both updates of the frame must end."""


@dataclass(frozen=True)
class Counted(UpdateProblem):
    """An update problem that remembers χ² of every run in turn."""

    chi2: list[float] = field(default_factory=list)

    def solved(self, x: Reals) -> list[CaseState]:
        """A run."""
        self.chi2.append(np.inf)
        return super().solved(x)

    def follow(self, x: Reals, before: Evaluation, derivatives: bool = True) -> Evaluation:
        """A run."""
        self.chi2.append(np.inf)
        return super().follow(x, before, derivatives)

    def assess(self, x: Reals, states: list[CaseState], derivatives: bool = True) -> Evaluation:  # type: ignore[override]
        """Keeps χ² of the last run."""
        found = super().assess(x, states, derivatives)
        if self.chi2:
            self.chi2[-1] = 2.0 * found.objective
        return found


def until(chi2: list[float], least: float) -> float:
    """Number of runs until χ² is near its minimum; infinite where it never is."""
    good = np.flatnonzero(np.array(chi2) <= (1.0 + NEAR) * least)
    return float(good[0] + 1) if len(good) else np.inf


def sensitivities(path: Path, starts: int) -> tuple[float, list[float], float]:
    """Runs from the initial values, from points of a Latin hypercube, and the least χ²."""
    study = read_study(path)
    problem, method = study.problem(), method_of(study.file.update, study.parameters)
    points = np.vstack(
        [np.zeros(len(problem.parameters.free)), starting_points(problem.parameters, StartRules(starts))]
    )
    traces = []
    for x in points:
        counted = Counted(**{name: getattr(problem, name) for name in UpdateProblem.__dataclass_fields__})
        result = update(counted, method, start=counted.start(x))
        traces.append((counted.chi2, len(result.after.residuals)))
    most = max(count for _, count in traces)
    least = min(min(chi2) for chi2, count in traces if count == most)
    counts = [until(chi2, least) if count == most else np.inf for chi2, count in traces]
    return counts[0], counts[1:], least


def surrogate(path: Path, tables: tuple[int, ...], least: float) -> list[tuple[int, float, float]]:
    """For each size of the table: runs, χ² of the model at the minimum of the surrogate over the least, worst seed."""
    rows = []
    for runs in tables:
        found = [
            ft.search(path, runs=runs, infill=10, method="genetic", population=60, generations=60, seeds=1, seed=seed)
            for seed in SEEDS
        ]
        ends = [f.record.chi2_model for f in found]
        worst = max(np.inf if chi2 is None else chi2 / least for chi2 in ends)
        rows.append((max(f.record.runs for f in found), worst, max(f.record.chi2 for f in found) / least))
    return rows


def genetic(path: Path, least: float) -> list[float]:
    """Runs of the genetic algorithm on the model, of each seed."""
    out = []
    for seed in SEEDS:
        options = {"method": "genetic", "population": POPULATION, "generations": GENERATIONS, "seeds": 1, "seed": seed}
        history = ft.search(path, on="model", **options).history
        good = np.flatnonzero(history[:, 2] <= (1.0 + NEAR) * least)
        out.append(float(history[good[0], 1]) if len(good) else np.inf)
    return out


@dataclass(frozen=True)
class OnSolver:
    """An update of the frame: runs of CalculiX, values and standard deviations of the parameters, and the result."""

    runs: int
    values: np.ndarray
    sd: np.ndarray
    result: RunResult


def on_solver(folder: Path, program: str, deck: DeckErrors | None) -> OnSolver:
    """With the derivatives of a deck, or with differences alone."""
    two_solvers.measure(folder, program)
    if deck is not None:
        (folder / "frame.bdf").write_text(two_solvers.deck(deck))
    path = folder / "study.toml"
    path.write_text(two_solvers.study(program, deck is not None))
    result = ft.run(path)
    assert result.results.update is not None
    assert result.results.update.ok, result.results.update.status
    journal = open_run_journal(folder / "run")
    runs = sum(journal.states().values())
    journal.close()
    values, sd = (np.array(result.parameters.column(name), float) for name in ("value", "sd"))
    return OnSolver(runs, values, sd, result)


def bridge(work: Path, program: str, quick: bool) -> list[str]:
    """Section on the derivatives of a deck."""
    plain, count = on_solver(work / "plain", program, None), len(two_solvers.TRUE)
    rows = [f"| none | – | – | no | {plain.runs} | – |"]
    for i, (name, errors) in enumerate(list(DECKS.items())[: 2 if quick else None]):
        found = on_solver(work / f"deck {i}", program, errors)
        assert found.result.results.model is not None
        (beside,) = found.result.results.model.beside_deck
        differences = [m.difference_percent for m in beside.modes if m.difference_percent is not None]
        least = min(m.mac for m in beside.modes if m.mac is not None)
        away = float(np.abs((found.values - plain.values) / plain.sd).max())
        rows.append(
            f"| {name} | {min(differences):+.1f} to {max(differences):+.1f} % | {least:.3f} | "
            f"{'yes' if beside.derivatives else 'no'} | {found.runs} | {away:.4f} |"
        )
        assert away < SAME, (name, away)
        assert not beside.derivatives or found.runs < plain.runs, (name, found.runs, plain.runs)
    return [
        "",
        "## Derivatives of a deck for another solver",
        "",
        f"A plane frame of two storeys, clamped at feet of two levels, {count} moduli of elasticity, "
        f"{two_solvers.MODES} frequencies with a noise of {100 * two_solvers.NOISE:.1f} %, simulated with quadratic "
        "beams (B32R) of CalculiX, which is also the solver of the study. The deck has bars without shear "
        'deformation, and errors. With `derivatives = "deck"` its exact derivatives lead the update until the steps '
        "are as short as the distance of differences; then differences of the solver's results take over. Counted are "
        "all runs of CalculiX: the one that measures its noise, and those that only confirm the end. Differences of "
        "the frequencies and MAC are those of the record `model.beside_deck` at the initial values.",
        "",
        "| deck | frequencies of deck against CalculiX | least MAC | its derivatives used | runs of CalculiX | largest "
        "difference of a result from the one without deck, standard deviations |",
        "| --- " * 6 + "|",
        *rows,
        "",
        "The results do not depend on the deck, because the end of each update is by differences of the solver's "
        f"results: {2 * count} runs around the point where the derivatives of the deck end, and {2 * count + 1} at and "
        f"around each later one. What the deck saves is the way there, with 1 instead of {2 * count + 1} runs at each "
        "point.",
    ]


def _shown(runs: float, limit: str) -> str:
    return f"{runs:.0f}" if np.isfinite(runs) else limit


def main() -> None:
    """Count, check, and write the evidence where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="three parameters alone")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    parser.add_argument("--models", nargs="+", choices=MODELS, default=MODELS, help="of the building")
    arguments = parser.parse_args()
    models, tables, starts = (MODELS[:1], TABLES[:2], 2) if arguments.quick else (tuple(arguments.models), TABLES, 5)
    lines = [
        "# Runs of the model: derivatives beside a surrogate and a genetic algorithm",
        "",
        "Models of the [benchmark building](01_building.md), frequencies and shapes of 15 "
        "modes. A run is a solution of its three configurations; the derivatives of the sensitivity method follow "
        "from the same solution and take no further runs. Counted are the runs until χ² is within "
        f"{100 * NEAR:.0f} % of its minimum.",
        "",
        "| parameters | sensitivity method, initial values | drawn starts, median (reached) | genetic algorithm on the "
        f"model, {len(SEEDS)} seeds |",
        "| --- " * 4 + "|",
    ]
    details, external = [], []
    program = two_solvers.calculix()
    with tempfile.TemporaryDirectory() as work:
        for model in models:
            path = write_inputs(Path(work) / model, model)
            parameters = len(read_study(path).parameters.free)
            first, drawn, least = sensitivities(path, starts)
            rows = surrogate(path, tables, least)
            runs = genetic(path, least)
            reached = [count for count in drawn if np.isfinite(count)]
            most = f"more than {POPULATION * (GENERATIONS + 1)}"
            lines.append(
                f"| {parameters} | {_shown(first, '–')} | {np.median(reached):.0f} ({len(reached)} of {len(drawn)}) "
                f"| {', '.join(_shown(r, most) for r in runs)} |"
            )
            details += [f"| {parameters} | {r} | {end:.3f} | {fine:.4f} |" for r, end, fine in rows]
            assert np.isfinite(first), model
            assert first < min(r for r, *_ in rows), (model, first)
        if program is not None:
            external = bridge(Path(work), program, arguments.quick)
    lines += [
        "",
        "Kriging of a table of runs with ten more where the objective is expected to improve, searched by the genetic "
        "algorithm and bounded least squares: χ² of the model at the minimum of the surrogate, and after least squares "
        f"on the model, over the minimum; the worst of {len(SEEDS)} tables.",
        "",
        "| parameters | runs | χ² at the minimum of the surrogate | after least squares |",
        "| --- " * 4 + "|",
        *details,
        "",
        "Where derivatives are available they need the fewest runs. The bounds are wide, factors of 0.3 to 3 on most "
        "parameters: with six and ten parameters no surrogate of 96 runs is accurate at its minimum, and the last "
        "column is that of least squares with derivatives that start there. A surrogate pays for solvers that give out "
        "responses only, with narrower bounds or more runs.",
        *external,
        "",
    ]
    text = "\n".join(lines)
    print(text)
    if arguments.evidence and program is not None:
        (arguments.evidence / "benchmark_search.md").write_text(text)


if __name__ == "__main__":
    main()
