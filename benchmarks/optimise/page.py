"""Criteria, performance profiles and tables from the measured rows; the page of the documentation and its figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from solvers import METHOD, MOST, MOST_AGAIN, OURS, SOLVERS, TIGHT

from femtune.arrays import Reals
from femtune.updating import SensitivityMethod

mpl.use("Agg")
from matplotlib import pyplot as plt

Row = dict[str, Any]
CLOSE = 1e-6
"""Relative difference of objectives that counts as none."""
RATIOS = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0)
NAME = "benchmark_optimise"
STARTS = 10
"""Of each problem."""
REFERENCE = "trf"
"""The rival whose solutions are compared in numbers."""


@dataclass(frozen=True)
class Measured:
    """A problem with the runs from all starts, the nominal values first."""

    runs: tuple[Row, ...]

    def __getitem__(self, key: str) -> Any:
        """A fact of the problem, as the run from the nominal values has it."""
        return self.runs[0][key]


# ----------------------------------------------------------------------------------------------------
# What a run took.


def solutions_to(run: Row, objective: float) -> float:
    """Solutions until the objective was within CLOSE of a value; infinite where it never was."""
    return next((float(n) for n, value in run["falls"] if value <= objective * (1.0 + CLOSE)), np.inf)


def least(runs: Sequence[Row]) -> float:
    """The lowest objective of some runs; infinite where none was solved."""
    values = [run["objective"] for run in runs if np.isfinite(run["objective"])]
    return min(values, default=np.inf)


def all_runs(rows: Sequence[Measured]) -> list[Row]:
    """Every start of every problem."""
    return [run for row in rows for run in row.runs]


def costs(rows: Sequence[Measured], *, of_problem: bool) -> dict[str, Reals]:
    """(runs,) solutions of each solver to the lowest objective that any solver found, infinite if it was not reached.

    The lowest objective is that of the same start, or of all starts of the problem.
    """
    out: dict[str, list[float]] = {name: [] for name in SOLVERS}
    for row in rows:
        best = least([r for run in row.runs for r in run["solvers"].values()])
        for run in row.runs:
            target = best if of_problem else least(list(run["solvers"].values()))
            for name in SOLVERS:
                out[name].append(solutions_to(run["solvers"][name], target))
    return {name: np.array(values) for name, values in out.items()}


def profile(cost: dict[str, Reals]) -> dict[str, Reals]:
    """(runs,) ratio of each solver's cost to the least of all (Dolan and Moré 2002), over the runs that any solved."""
    fewest = np.min(list(cost.values()), axis=0)
    solved = np.isfinite(fewest)
    return {name: c[solved] / fewest[solved] for name, c in cost.items()}


# ----------------------------------------------------------------------------------------------------
# Criteria.


@dataclass(frozen=True)
class Criterion:
    """A measured number beside its target."""

    text: str
    measured: str
    target: str
    met: bool

    def row(self) -> str:
        """Of the table."""
        return f"| {self.text} | {self.measured} | {self.target} | {'met' if self.met else '**not met**'} |"


def lowered(rows: Sequence[Measured], name: str | None = None) -> Reals:
    """(runs,) by how much the objective at the end of femtune is lowered, by one rival or by the best of all."""
    runs = all_runs(rows)
    return np.array([
        np.nanmax([r for n, r in run["restarted"].items() if name in (None, n)]) for run in runs
    ])  # fmt: skip


def ratios(rows: Sequence[Measured], rival: str, *, same_end: bool = False) -> Reals:
    """Solutions of femtune over those of a rival, each to within CLOSE of its own last objective.

    `same_end` keeps the runs only in which both ended at the same objective.
    """
    out = []
    for run in all_runs(rows):
        ours, theirs = run["solvers"][OURS], run["solvers"][rival]
        a, b = ours["objective"], theirs["objective"]
        if not np.isfinite([a, b]).all() or (same_end and abs(a - b) > CLOSE * min(a, b)):
            continue
        out.append(solutions_to(ours, a) / solutions_to(theirs, b))
    return np.array(out)


def criteria(rows: Sequence[Measured]) -> list[Criterion]:
    """(i) to (iv)."""
    kept = float(np.mean(lowered(rows) <= CLOSE))
    wins = []
    for row in rows:
        rivals = [r for run in row.runs for name, r in run["solvers"].items() if name != OURS]
        ours = least([run["solvers"][OURS] for run in row.runs])
        wins.append(ours <= least(rivals) * (1.0 + CLOSE))
    trf = REFERENCE
    ratio = float(np.median(ratios(rows, trf)))
    limits = sum(run["solvers"][OURS]["status"] == "MAX_ITERATIONS" for run in all_runs(rows))
    return [
        Criterion("(i) runs from whose end no rival lowers the objective by more than 1e-6", f"{100 * kept:.1f} %",
                  "99 %", kept >= 0.99),
        Criterion("(ii) problems in which the best of all starts is not above the best of all rivals",
                  f"{100 * np.mean(wins):.1f} %", "95 %", bool(np.mean(wins) >= 0.95)),
        Criterion(f"(iii) median of solutions to within 1e-6 of the own end, over those of {trf}", f"{ratio:.2f}",
                  "0.8 (0.7 wanted)", ratio <= 0.8),
        Criterion(f"(iv) runs that end by the limit of {METHOD.max_iterations} iterations", str(limits), "0",
                  limits == 0),
    ]  # fmt: skip


# ----------------------------------------------------------------------------------------------------
# The page.


def write_page(rows: Sequence[Measured], folder: Path | None) -> str:
    """The text; with a folder it is written there with its figure."""
    text = "\n".join(
        [*_head(rows), *_criteria(rows), *_profiles(rows), *_rivals(rows), *_problems(rows), *_change(rows)]
    )
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{NAME}.md").write_text(text + "\n", encoding="utf-8")
        figure(rows, folder / f"{NAME}.svg")
    return text


def _head(rows: Sequence[Measured]) -> list[str]:
    k = [row["parameters"] for row in rows]
    bound = [row["at_bound"] for row in rows]
    counts = [len(row.runs) for row in rows]
    fewest, starts = min(counts), max(counts)
    number = str(starts) if fewest == starts else f"{fewest} to {starts}"
    return [
        "# The search beside general solvers", "",
        "femtune's sensitivity method, SciPy's `least_squares` (trust region reflective, "
        "trf, and dogbox) "
        "and SciPy's SLSQP minimise the same residuals with the same analytic derivatives inside the same bounds. Made "
        "by `benchmarks/optimise/run.py`.", "",
        *_incomplete(rows),
        "The constants of femtune's damping were chosen on these problems from the nominal values, so that the runs "
        "from there are no independent test; those from the other starts are more of one.", "",
        f"- {len(rows)} problems with {min(k)} to {max(k)} parameters, {number} starts each ({sum(counts)} "
        "runs): the nominal values and a "
        "Latin hypercube over the bounds. In the minimum that femtune finds from the nominal values "
        f"{100 * np.median(bound):.0f} % of the parameters are on a bound (median of the problems; "
        f"{100 * min(bound):.0f} to {100 * max(bound):.0f} %).",
        "- Families: two weakly coupled spring chains and lattices on springs to the ground; towers of nearly square "
        "plan; nearly square plates on an edge of springs; towers as imported matrices; the published test of the "
        "two-storey benchmark building in three mass configurations. Close modes swap. Springs have bounds from "
        "1e-6 to "
        "11 or 1000 times the nominal value.",
        "- The tests have an error of the model in every element that no parameter can repair (lognormal, 20 to "
        "40 % in "
        "stiffness; real in the building), and noise. Standard deviations of frequencies and shape entries span two "
        "decades together. Half of the simulated tests have shapes scaled by their largest entry.",
        "- Pairing. A general solver needs residuals that depend on the parameters alone. At every point all "
        "test modes "
        "are paired afresh, without gates, by the assignment with the least sum of squares. Test modes within 10 % of "
        "each other are compared as a subspace, as femtune compares clusters, since single modes that cross have no "
        "derivative. The number of residuals is constant. All solvers use this rule, so that the search alone is "
        "compared; femtune's own pairing, which is frozen in an iteration, takes no part.",
        "- Cost. One solution is one solve for the modes at one point; rejected trials count. The Jacobian at a point "
        "that is solved is no further solution.",
        f"- Settings. femtune: defaults with `smallest_change` 0, which is the minimum inside the bounds, at most "
        f"{METHOD.max_iterations} iterations (the default). Rivals: ftol = xtol = gtol = "
        f"{TIGHT:g}, at most {MOST} solutions, and "
        f"{MOST_AGAIN} from the end of femtune; trf with x_scale 1 (the parameters are normalised; "
        "with `jac` it took as many solutions on five problems), dogbox with `jac`; SLSQP "
        "minimises the objective over that of its start. Of a rival the best point that it solved is used.", "",
    ]  # fmt: skip


def _incomplete(rows: Sequence[Measured]) -> list[str]:
    """A warning where starts are missing."""
    done, all_starts = sum(len(row.runs) for row in rows), STARTS * len(rows)
    if done == all_starts:
        return []
    return [f"**Incomplete: {done} of {all_starts} runs are measured. The criteria ask for all of them.**", ""]


def _criteria(rows: Sequence[Measured]) -> list[str]:
    trf = REFERENCE
    same, every = ratios(rows, trf, same_end=True), ratios(rows, trf)
    return [
        "## Criteria", "", "| criterion | measured | target | |", "| --- | --- | --- | --- |",
        *(c.row() for c in criteria(rows)), "",
        f"In the {len(same)} of {len(every)} runs in which both end at the same objective the median of (iii) is "
        f"{np.median(same):.2f}. {_by_start(rows, trf)}", "",
    ]  # fmt: skip


def _by_start(rows: Sequence[Measured], rival: str) -> str:
    """(iii) from the nominal values and from the drawn starts apart."""
    drawn = [Measured(row.runs[1:]) for row in rows if len(row.runs) > 1]
    text = f"From the nominal values alone it is {np.median(ratios([Measured(r.runs[:1]) for r in rows], rival)):.2f}"
    if not drawn:
        return f"{text}; no other start is measured."
    others = ratios(drawn, rival)
    return f"{text}, from the {len(others)} drawn starts {np.median(others):.2f}."


def _profiles(rows: Sequence[Measured]) -> list[str]:
    out = [
        "## Performance profiles", "",
        "Share of the runs in which a solver comes within 1e-6 of the lowest objective with at most so many times the "
        "solutions of the quickest solver (Dolan and Moré 2002). On the left the lowest objective is that of "
        "any solver "
        "from the same start, on the right that of any solver from any start of the problem.", "",
        f"![Performance profiles]({NAME}.svg)", "",
    ]  # fmt: skip
    for title, of_problem in (("Same start", False), ("Any start", True)):
        found = profile(costs(rows, of_problem=of_problem))
        out += [f"| {title}: at most × the quickest | " + " | ".join(f"{r:g}" for r in RATIOS) + " | ever |",
                "| --- |" + " --- |" * (len(RATIOS) + 1)]  # fmt: skip
        for name, values in found.items():
            shares = [float(np.mean(values <= r)) for r in RATIOS] + [float(np.mean(np.isfinite(values)))]
            out.append(f"| {name} | " + " | ".join(f"{100 * s:.0f} %" for s in shares) + " |")
        out.append("")
    return out


def _rivals(rows: Sequence[Measured]) -> list[str]:
    out = [
        "## Solvers", "",
        "Solutions and seconds are medians over all runs; solutions to the end are to within 1e-6 of the own last "
        "objective. Best means within 1e-6 of the lowest objective of any solver from the same start; lowered, "
        "that the "
        "solver lowers femtune's end by more than 1e-6 when it is started from there.", "",
        "| solver | solutions | to the end | s | best of its start | lowered | limit |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]  # fmt: skip
    cost = costs(rows, of_problem=False)
    for name in SOLVERS:
        runs = [run["solvers"][name] for run in all_runs(rows)]
        to_end = [solutions_to(r, r["objective"]) for r in runs if np.isfinite(r["objective"])]
        better = f"{int(np.sum(lowered(rows, name) > CLOSE))} of {len(runs)}" if name != OURS else ""
        limit = sum(
            r["status"] in ("MAX_ITERATIONS", "limit") or (name != OURS and r["solutions"] >= MOST) for r in runs
        )
        out.append(
            f"| {name} | {np.median([r['solutions'] for r in runs]):.0f} | {np.median(to_end):.0f} | "
            f"{np.median([r['seconds'] for r in runs]):.2f} | {100 * np.mean(np.isfinite(cost[name])):.0f} % | "
            f"{better} | {limit} |"
        )
    return [*out, ""]


def _problems(rows: Sequence[Measured]) -> list[str]:
    trf = REFERENCE
    out = [
        "## Problems", "",
        f"χ² is of the best of all starts. Solutions are medians over the starts, to within 1e-6 of the own end; the "
        f"rival is {trf}.", "",
        "| problem | | residuals | on bounds | χ², femtune | χ², rivals | solutions, femtune | solutions, rival |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]  # fmt: skip
    for row in rows:
        ours = [run["solvers"][OURS] for run in row.runs]
        rivals = [r for run in row.runs for name, r in run["solvers"].items() if name != OURS]
        theirs = [run["solvers"][trf] for run in row.runs]
        mine, other = ([solutions_to(r, r["objective"]) for r in runs] for runs in (ours, theirs))
        out.append(
            f"| {row['name']} | {row['text']} | {row['residuals']} | {100 * row['at_bound']:.0f} % | "
            f"{2 * least(ours):.7g} | {2 * least(rivals):.7g} | {np.median(mine):.0f} | {np.median(other):.0f} |"
        )
    return [*out, ""]


def _change(rows: Sequence[Measured]) -> list[str]:
    out = [
        "## The smallest change", "",
        "With the default settings the result is the smallest change whose χ² is within an allowed increase of the "
        "minimum, where combinations are undetermined. From the nominal values; sizes are the length of the change in "
        "prior standard deviations. The certificate holds where the projected gradient is small and no multiplier is "
        "negative.", "",
        "| problem | increase of χ² | allowed | size at the minimum | size | on bounds, minimum | on bounds | "
        "solutions | "
        "projected gradient | least multiplier |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]  # fmt: skip
    for row in rows:
        c = row["smallest_change"]
        if "increase" in c:
            out.append(
                f"| {row['name']} | {c['increase']:.4f} | {c['allowed']:.4f} | {c['optimum_size']:.2f} | "
                f"{c['size']:.2f} | "
                f"{c['optimum_at_bound']} | {c['at_bound']} | {c['solutions']} | {c['projected_gradient']:.1e} | "
                f"{c['least_multiplier']:.1e} |"
            )
    others = [row for row in rows if "increase" not in row["smallest_change"]]
    ended = [row["name"] for row in others if row["smallest_change"]["status"].startswith("CONVERGED")]
    limited = [f"{row['name']} ({row['smallest_change']['status']})" for row in others if row["name"] not in ended]
    text = f"No undetermined combination, or no smaller change: {', '.join(ended) or 'none'}. "
    text += f"Not ended with the default limit of {SensitivityMethod().max_iterations} iterations: "
    text += f"{', '.join(limited) or 'none'}."
    return [*out, "", text]


def figure(rows: Sequence[Measured], path: Path) -> None:
    """Both profiles, as SVG with text as text."""
    mpl.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "femtune"})
    drawn, axes = plt.subplots(1, 2, figsize=(10.8, 4.2), layout="constrained", sharey=True)
    for axis, title, of_problem in zip(axes, ("lowest objective of the same start", "of any start"), (False, True)):
        for name, values in profile(costs(rows, of_problem=of_problem)).items():
            finite = np.sort(values[np.isfinite(values)])
            share = np.arange(1, len(finite) + 1) / max(len(values), 1)
            at = np.concatenate([[1.0], finite, [100.0]])
            axis.step(at, np.concatenate([[0.0], share, share[-1:] if len(share) else [0.0]]), where="post", label=name)
        axis.set(title=title, xlabel="solutions over those of the quickest solver", xscale="log", xlim=(1.0, 100.0))
        axis.grid(which="both", alpha=0.25)
    axes[0].set(ylabel="share of runs", ylim=(0.0, 1.0))
    axes[0].legend(fontsize="small")
    drawn.savefig(path, metadata={"Date": None})
    plt.close(drawn)
