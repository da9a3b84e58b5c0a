"""Compare nine models of the benchmark building with the published tables: python run.py [--quick] [--evidence DIR].

One study with all twelve parameters lists the models of Tables 4 and 9 as candidates, which are updated from the same
test. A second one updates the models of Table 4 from 20 random populations each, by a genetic algorithm followed by
least squares (in the quick form, from two populations of one model). Asserts that every objective function is
within 0.12 percentage points of Table 5, the parameters of M1 to M5 within 0.03, the distances within 2 percentage
points of Table 6; that all populations reach one optimum; and that the program finds the two combinations that nothing
determines. With --work, an interrupted run continues.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import digits
import numpy as np
import published as p
from make_inputs import candidates, populations, write_inputs

import femtune as ft
from femtune.steps.candidates.record import CandidateResults
from femtune.steps.candidates.result import CandidatesResult
from femtune.steps.run.result import RunResult

OBJECTIVE_TOLERANCE, PARAMETER_TOLERANCE, DISTANCE_TOLERANCE = 0.12, 0.03, 2.0
SAME_PERCENT = 1e-4
"""Largest difference of the mean errors, %, that populations of one model may reach."""

NOMINAL = "initial values"
CONCRETE = 2500.0
NAMES = [name for name, *_ in p.PARAMETERS]
SEARCHED = [model for model in p.UPDATED if model != "M0"]


def compare(folder: Path, ratios: Sequence[float]) -> CandidatesResult:
    """All candidates from one study, updated from the initial values."""
    path = write_inputs(folder).with_name("candidates.toml")
    path.write_text(candidates(ratios))
    return ft.candidates(path)


def search(folder: Path, models: Sequence[str], starts: int) -> CandidatesResult:
    """Models of Table 4 from random populations."""
    path = write_inputs(folder).with_name("populations.toml")
    path.write_text(populations(models, starts))
    return ft.candidates(path)


def record(found: CandidatesResult, model: str) -> CandidateResults:
    """One candidate; M0 is where every update starts."""
    name = NOMINAL if model == "M0" else model
    return next(c for c in found.record.candidates if c.name == name)


def values(found: CandidatesResult, model: str) -> list[float]:
    """p1 … p12."""
    by_name = {v.parameter: v.value for v in record(found, model).values}
    return [by_name[name] for name in NAMES]


def objective(found: CandidatesResult, model: str) -> float:
    """Weighted mean error, %."""
    error = record(found, model).error_percent
    assert error is not None
    return error


def check(found: CandidatesResult, ratios: Sequence[float]) -> None:
    """Assert the published numbers."""
    for model, (wanted, f_ob) in p.UPDATED.items():
        assert abs(objective(found, model) - f_ob) <= OBJECTIVE_TOLERANCE, (model, objective(found, model), f_ob)
        if model in ("M1", "M2", "M3", "M4", "M5"):
            worst = max(abs(a - b) for a, b in zip(values(found, model), wanted))
            assert worst <= PARAMETER_TOLERANCE, (model, worst)
    order = [objective(found, model) for model in p.UPDATED]
    assert order == sorted(order, reverse=True), order
    ours = distances(found)
    for i, row in enumerate(p.DISTANCES):
        for j, wanted_distance in enumerate(row, start=i + 1):
            assert abs(ours[i, j] - wanted_distance) <= DISTANCE_TOLERANCE, (i, j, ours[i, j], wanted_distance)
    for ratio in ratios:
        assert abs(objective(found, f"ratio {ratio:g}") - objective(found, "M8")) < 1e-3, ratio


def check_populations(searched: CandidatesResult, found: CandidatesResult) -> None:
    """Every population leads to one optimum, that of the update from the initial values or a better one."""
    for c in searched.record.candidates:
        if c.parameters:
            assert (c.starts_at_best, c.starts_unpaired, c.other_optima) == (c.starts, 0, 0), c.name
            assert len(c.start_errors_percent) == c.starts, c.name
            assert max(c.start_errors_percent) - min(c.start_errors_percent) < SAME_PERCENT, c.start_errors_percent
            assert objective(searched, c.name) <= objective(found, c.name) + 1e-4, c.name
            assert abs(objective(searched, c.name) - p.UPDATED[c.name][1]) <= OBJECTIVE_TOLERANCE, c.name


def population_table(searched: CandidatesResult) -> list[str]:
    """Where the searches of each model end."""
    lines = [
        "| model | parameters | populations | at one optimum | mean error %: smallest, largest | their difference "
        "| published % | distance from it |",
        "|---" * 8 + "|",
    ]
    for c in searched.record.candidates:
        if c.parameters:
            ours, wanted = objective(searched, c.name), p.UPDATED[c.name][1]
            low, high = min(c.start_errors_percent), max(c.start_errors_percent)
            lines.append(
                f"| {c.name} | {len(c.parameters)} | {c.starts} | {c.starts_at_best} | {low:.5f}, {high:.5f} "
                f"| {high - low:.1e} | {wanted:.3f} | {ours - wanted:+.3f} |"
            )
    return lines


def distances(found: CandidatesResult) -> np.ndarray:
    """(9, 9) distances of M0 to M8, %."""
    rows = [[c.name for c in found.record.solved].index(record(found, model).name) for model in p.UPDATED]
    return 100.0 * found.distances[np.ix_(rows, rows)]


def check_undetermined(found: CandidatesResult) -> list[str]:
    """The model of all twelve parameters must name the two combinations that nothing determines."""
    model = record(found, "M12")
    assert model.status == "UNDETERMINED", model.status
    shares = [{s.parameter for s in c.shares if abs(s.coefficient) > 0.05} for c in model.undetermined]
    assert len(shares) == 2, shares
    along_x, along_y = {"Icx1", "Icx2", "Ibx1", "Ibx2"}, {"Icy1", "Icy2", "Iby1", "Iby2"}
    assert any(s <= along_x for s in shares), shares
    assert any(s <= along_y for s in shares), shares
    return [f"- {c.sentence}" for c in model.undetermined]


def table_5(found: CandidatesResult) -> list[str]:
    """Parameters and objectives, ours above the published ones."""
    lines = [f"| model | {' | '.join(NAMES)} | mean error % |", "|---" * (len(NAMES) + 2) + "|"]
    for model in p.MODELS:
        lines.append(_row(f"**{model}**", values(found, model), objective(found, model)))
        if model in p.UPDATED:
            lines.append(_row("published", list(p.UPDATED[model][0]), p.UPDATED[model][1]))
    return lines


def _row(head: str, numbers: list[float], f_ob: float) -> str:
    return f"| {head} | " + " | ".join(f"{x:.3f}" for x in numbers) + f" | {f_ob:.3f} |"


def table_6(found: CandidatesResult) -> list[str]:
    """Distances, ours and published."""
    ours, models = distances(found), list(p.UPDATED)
    lines = [f"| | {' | '.join(models[1:])} |", "|---" * len(models) + "|"]
    for i, row in enumerate(p.DISTANCES):
        cells = [""] * i + [f"{ours[i, j]:.1f} ({wanted:.3g})" for j, wanted in enumerate(row, start=i + 1)]
        lines.append(f"| {models[i]} | {' | '.join(cells)} |")
    return lines


def criteria(found: CandidatesResult) -> list[str]:
    """What the criteria say of the published models."""
    lines = [
        "| model | parameters | determined | mean error % | ΔBIC | weight | probability | prediction % | admissible "
        "| cluster |",
        "|---" * 10 + "|",
    ]
    least = min(c.bic for c in found.record.solved if c.bic is not None)
    for model in p.MODELS:
        c = record(found, model)
        assert c.bic is not None
        lines.append(
            f"| {model} | {len(c.parameters)} | {c.rank} | {c.error_percent:.3f} | {c.bic - least:.1f} "
            f"| {c.bic_weight:.3f} | {c.probability:.3f} | {c.prediction_percent:.2f} "
            f"| {'yes' if c.admissible else 'no'} | {c.cluster or '–'} |"
        )
    return lines


def table_9(found: CandidatesResult, ratios: Sequence[float]) -> list[str]:
    """Models that fit equally well, ours above the published ones."""
    lines = [f"| ratio | {' | '.join(NAMES[:8])} | mean error % |", "|---" * 10 + "|"]
    for ratio in ratios:
        name, wanted = f"ratio {ratio:g}", p.RATIOS[ratio]
        lines.append(_row(f"**{ratio:g}**", values(found, name)[:8], objective(found, name)))
        lines.append(f"| published | {' | '.join(f'{x:g}' for x in wanted)} | |")
    return lines


def sagging(found: CandidatesResult) -> list[str]:
    """Thickness and sagging of the slabs by Eqs. (3) and (4) from M7; plan and density that the paper implies."""
    lines = ["| floor | plan m² | density kg/m³ | thickness cm | sagging cm | published |", "|---|---|---|---|---|---|"]
    factors = dict(zip(NAMES, values(found, "M7")))
    for floor, (t, s) in p.SAGGING.items():
        mass, inertia = factors[f"m{floor}"] * p.SLAB_MASS, factors[f"J{floor}"] * p.SLAB_INERTIA
        radius = p.LENGTH_X**2 + p.LENGTH_Y**2
        # the plan, of the same shape, at which the published pair has our ratio of inertia to mass
        scale = inertia / mass * (t + 4 * s / 9) / (radius * (t / 12 + s / 45))
        implied = mass / (scale * p.LENGTH_X * p.LENGTH_Y * (t + 4 * s / 9) / 100)
        for grown, density in ((1.0, CONCRETE), (scale, implied)):
            area = grown * p.LENGTH_X * p.LENGTH_Y
            sides = np.array([mass / (density * area), inertia / (density * area * grown * radius)])
            t0, s0 = 100.0 * np.linalg.solve([[1.0, 4.0 / 9.0], [1.0 / 12.0, 1.0 / 45.0]], sides)
            lines.append(f"| {floor} | {area:.2f} | {density:.0f} | {t0:.1f} | {s0:.1f} | {t}, {s} |")
    return lines


def main() -> None:
    """Run, compare, and write the evidence where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two populations of one model instead of 20 of each")
    parser.add_argument("--evidence", type=Path, help="folder for the table of the documentation")
    parser.add_argument("--work", type=Path, help="folder of the runs, which is kept")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        work = arguments.work or Path(temporary)
        ratios = (0.5, 2.0) if arguments.quick else tuple(p.RATIOS)
        found = compare(work / "all", ratios)
        searched = search(work / "populations", *((["M3"], 2) if arguments.quick else (SEARCHED, 20)))
        study = write_inputs(work / "M8")
        best = ft.update(study)
        modes = digits.entries(study, best)
    digits.check(modes, best)
    check(found, ratios)
    check_populations(searched, found)
    text = _page(found, searched, best, modes, ratios)
    print(text)
    if arguments.evidence:
        (arguments.evidence / "01_building.md").write_text(text)


def _page(
    found: CandidatesResult,
    searched: CandidatesResult,
    best: RunResult,
    modes: list[digits.Entry],
    ratios: Sequence[float],
) -> str:
    parts = [
        "# The benchmark building: nine models compared with published results",
        "Parameters are factors on the nominal values; the mean error is the objective function of the paper's Eq. "
        "(1). The published frequencies have three digits, and this rounding alone changes the objective function "
        "by 5 to 10 %. The mass of the steel carried by the floors is not published and had to be recovered. All "
        "models are candidates of one study, compared by `femtune candidates`.",
        "## Table 5",
        "\n".join(table_5(found)),
        "## From random populations",
        "A genetic algorithm on the model (16 points, 6 generations: 112 evaluations of the model) from random "
        "populations, each followed by the "
        "bounded least squares of the update. Points at which modes lose their partners do not survive.",
        "\n".join(population_table(searched)),
        "## Table 6: distances in %, published in brackets",
        "\n".join(table_6(found)),
        "## Criteria",
        "The authors call M7 and M8 the most plausible models, by the physical meaning of their values; M5 to M8 are "
        "the models below their threshold, here a mean error of at most 1.12 times the smallest. The weights of the "
        "objective are relative, so that the scatter is estimated.",
        "\n".join(criteria(found)),
        "## Tables 7 and 8: the ten-parameter model M8",
        "The tolerances are what the printed digits of the test justify: each measured value may be off by half of its "
        "third digit. They are the largest changes that such errors of all measured values together can cause, by the "
        "Jacobian of the update, and half of the last published digit. All differences are asserted to be within "
        f"them, those of MACs within {digits.MAC_TOLERANCE}. Entries of shapes have a further tolerance of "
        f"{digits.SHAPE_TOLERANCE['BC']}, and {digits.SHAPE_TOLERANCE['NC']} in NC: the masses of the steel, which are "
        "recovered, couple motions along x and rotations there.",
        "\n".join(digits.table_7(modes)),
        "\n".join(digits.table_8(modes, best)),
        "## Twelve parameters at once (M12)",
        "Combinations that the data leave undetermined:",
        "\n".join(check_undetermined(found)),
        "## Table 9: models with the same matrices as M8",
        "The ratio of the stiffness of the upper to the lower beams is fixed; the mean error is the same in all.",
        "\n".join(table_9(found, ratios)),
        "From the published parameters of M8 instead of ours, the table follows within "
        f"{100 * digits.check_table_9():.1f} % beyond half of the last digit (asserted: "
        f"{100 * digits.TABLE_9_TOLERANCE:.1f} %), which the three digits of these parameters justify:",
        "\n".join(digits.table_9()),
        "## Sagging of the slabs",
        "The paper's Eqs. (3) and (4) give the uniform thickness and the sagging of a slab from its mass and polar "
        "inertia. With the plan and density of Table 2 the published values do not follow: the sagging, which depends "
        "on the small difference of two terms, comes out negative. The second line of each floor has the plan and the "
        "density with which M7 gives the published values.",
        "\n".join(sagging(found)),
    ]
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    main()
