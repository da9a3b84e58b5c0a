"""Plans of a test beside exhaustive search, random sets and simulated tests: python run.py [--quick] [--evidence DIR].

Sensors of a free subframe are compared with all possible sets of few candidates and with random sets of all candidates.
On a chain of masses the expected standard deviations of the parameters are compared with the scatter of 1,000 simulated
tests, each with a full non-linear update by another program. A small frame does the same for a calibration with FRFs.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where structures/ lies

import numpy as np

import femtune as ft
from femtune.arrays import Reals
from femtune.planning import Candidates, eliminate, expand, information_of, log_det, outcome_of
from structures.plan_chain import BOUNDS, NAMES, chain_deck, chain_modes, scatter_of_updates
from structures.plan_frame import BOUNDS as FRAME_BOUNDS
from structures.plan_frame import GROUPS, DenseFrame, frame_deck
from structures.subframe import subframe, write_subframe

TARGETS = "7 THRU 16"
FREQUENCY_SD, SHAPE_SD = 0.002, 0.03
FRF_SD, RATIO = 0.05, 0.02


@dataclass(frozen=True)
class Size:
    """DOFs of the subframe, small problems, random sets, and simulated tests."""

    dofs: int
    problems: int
    sets: int
    tests: int


QUICK, FULL = Size(5_000, 6, 200, 200), Size(20_000, 40, 5_000, 1_000)


def translations(deck: Path) -> Reals:
    """(grid points · 3, 10) target modes at all translations of the subframe that move."""
    modes = ft.modes(deck, count=16).mode_sets["baseline"]
    rows = np.flatnonzero(np.isin(modes.dofs.components, (1, 2, 3)))
    return np.asarray(modes.shapes[rows, 6:16])


def beside_all_sets(shapes: Reals, size: Size) -> list[str]:
    """Six of 14 random candidates for four modes: 3,003 sets each."""
    rng, count = np.random.default_rng(1), 6
    off: dict[str, list[float]] = {"expansion with exchanges": [], "expansion": [], "elimination": []}
    for _ in range(size.problems):
        some = shapes[rng.choice(len(shapes), 14, replace=False)][:, rng.choice(10, 4, replace=False)]
        some = some / np.linalg.norm(some, axis=0)
        candidates = Candidates(some[:, None, :])
        best = max(log_det(information_of(some[list(chosen)])) for chosen in combinations(range(14), count))
        sets = (
            expand(candidates, count).chosen, expand(candidates, count, exchange=False).chosen,
            eliminate(candidates, count).chosen,
        )  # fmt: skip
        for key, chosen in zip(off, sets):
            off[key].append(best - log_det(information_of(some[chosen])))
    rows = [
        f"| {key} | {sum(d < 1e-9 for d in lost)} of {size.problems} | {abs(np.mean(lost)):.3f} | {np.max(lost):.3f} |"
        for key, lost in off.items()
    ]
    assert min(map(min, off.values())) > -1e-9
    assert np.mean(off["expansion with exchanges"]) < 0.02
    return [
        "## Small sets beside all possible ones", "",
        f"Six of 14 directions that are drawn from the subframe, for four of its modes; {size.problems} problems with "
        "3,003 sets each. Loss: log det ΦᵀΦ of the best set minus that of the set found.", "",
        "| method | best set found | mean loss | largest loss |", "| --- " * 4 + "|", *rows, "",
    ]  # fmt: skip


def beside_random_sets(deck: Path, shapes: Reals, size: Size) -> list[str]:
    """Twenty directions for ten modes."""
    asked = {"modes": TARGETS, "uniaxial": 20, "directions": ["X", "Y", "Z"]}
    plans = {
        "expansion with exchanges": ft.plan(deck, **asked),
        "expansion": ft.plan(deck, exchange=False, **asked),
        "elimination": ft.plan(deck, method="elimination", **asked),
        "expansion, threshold 0.05": ft.plan(deck, uniaxial_threshold=0.05, **asked),
    }
    rng = np.random.default_rng(2)
    others = [outcome_of(shapes[rng.choice(len(shapes), 20, replace=False)]) for _ in range(size.sets)]
    dets, macs = (np.array([getattr(o, name) for o in others]) for name in ("log_det", "largest_off_diagonal"))
    rows = []
    for name, plan in plans.items():
        c = plan.record.chosen
        assert c.log_det is not None
        assert c.condition is not None
        assert c.log_det > dets.max()
        assert c.auto_mac < np.median(macs)
        rows.append(f"| {name} | {c.log_det:.1f} | {c.auto_mac:.3f} | {c.auto_mac_rms:.3f} | {c.condition:.2f} |")
    best, condition = int(np.argmax(dets)), np.array([o.condition for o in others])
    rms = np.array([o.root_mean_square for o in others])
    rows += [
        f"| random: best log det | {dets[best]:.1f} | {macs[best]:.3f} | {rms[best]:.3f} | {condition[best]:.2f} |",
        f"| random: median of each | {np.median(dets):.1f} | {np.median(macs):.3f} | {np.median(rms):.3f} | "
        f"{np.median(condition):.2f} |",
        f"| random: best of each | {dets.max():.1f} | {macs.min():.3f} | {rms.min():.3f} | {condition.min():.2f} |",
    ]
    return [
        "## Sets for the subframe beside random ones", "",
        f"Free subframe with {size.dofs:,} DOFs, its first ten elastic modes, 20 uniaxial sensors along X, Y or Z at "
        f"{plans['expansion'].record.candidate_points:,} grid points; {size.sets:,} random sets of translations.", "",
        "| sensors | log det ΦᵀΦ | largest AutoMAC | root mean square AutoMAC | condition number |",
        "| --- " * 5 + "|", *rows, "",
    ]  # fmt: skip


def beside_simulated_tests(folder: Path, size: Size) -> list[str]:
    """Expected standard deviations, and the scatter of updates."""
    deck = chain_deck(folder)
    parameters = [
        ft.Parameter(name, fields=[f"PELAS {g + 1} K"], lower=BOUNDS[0], upper=BOUNDS[1])
        for g, name in enumerate(NAMES)
    ]
    study = ft.Study(model=deck, units="m-kg-s", parameters=parameters)
    asked = {
        "modes": "1 THRU 4", "directions": ["X"], "uniaxial": 6, "uniaxial_threshold": 0.0,
        "frequency_sd": FREQUENCY_SD, "shape_sd": SHAPE_SD,
    }  # fmt: skip
    shapes = chain_modes(np.ones(3), 4)[1]
    entry_sd = SHAPE_SD * np.abs(shapes).max(axis=0)
    rows, aims = [], {"modes": {}, "D": {"aim": "parameters"}, "A": {"aim": "parameters", "criterion": "A"}}
    for aim, more in aims.items():
        plan = ft.plan(study, **asked, **more)
        masses = np.array([s.node - 1 for s in plan.record.sensors])
        factors = scatter_of_updates(masses, np.arange(1, 5), FREQUENCY_SD, entry_sd, size.tests)
        expected, found = plan.parameters.column("data_sd"), factors.std(axis=0)
        # three standard errors, at most 10 % for 1,000 tests
        assert np.abs(found / expected - 1.0).max() < max(0.1, 3.0 / np.sqrt(2.0 * size.tests))
        for name, e, f in zip(NAMES, expected, found):
            where = ", ".join(map(str, sorted(masses))) if name == NAMES[0] else ""
            aimed = ("modes" if aim == "modes" else f"parameters, {aim}") if name == NAMES[0] else ""
            rows.append(f"| {aimed} | {where} | {name} | {100 * e:.3f} | {100 * f:.3f} | {100 * (f / e - 1):+.1f} |")
    return [
        "## Expected standard deviations beside the scatter of simulated tests", "",
        "A chain of 14 masses with three groups of springs, four modes, six sensors; standard deviations of "
        f"{100 * FREQUENCY_SD:g} % of the frequencies and {100 * SHAPE_SD:g} % of the largest entry of each shape. "
        f"Expected: `femtune plan`, from the data alone, to first order. Scatter: standard deviation of {size.tests:,} "
        "updates from simulated tests, by dense matrices and SciPy's `least_squares` without linearisation, each shape "
        f"in its best scale. Its standard error is {100 / np.sqrt(2 * size.tests):.1f} %.", "",
        "| aim | masses with sensors | parameter | expected σ, % | scatter, % | difference % |",
        "| --- " * 6 + "|", *rows, "",
    ]  # fmt: skip


def _at(dof: str) -> int:
    """Position of a translation such as 12X+ in the dense matrices of the frame."""
    node = int(dof.rstrip("+-XY"))
    return 3 * (node - 1) + "XY".index(dof[-2])


def for_frfs(folder: Path, size: Size) -> list[str]:
    """Sensors, exciter and lines for a calibration with FRFs of a small frame."""
    parameters = [
        ft.Parameter(name, fields=[f"MAT1 {g + 1} E"], lower=FRAME_BOUNDS[0], upper=FRAME_BOUNDS[1])
        for g, name in enumerate(GROUPS)
    ]
    study = ft.Study(model=frame_deck(folder), units="m-kg-s", parameters=parameters)
    asked = {
        "modes": "4 THRU 6", "directions": ["X", "Y"], "uniaxial": 3, "uniaxial_threshold": 0.0, "data": "frfs",
        "frf_sd": FRF_SD, "damping_ratio": RATIO, "exciters": 1,
    }  # fmt: skip
    frame = DenseFrame.made()
    aims = {
        "modes": {}, "parameters, D": {"aim": "parameters"}, "parameters, A": {"aim": "parameters", "criterion": "A"},
        "parameters, D, 20 lines": {"aim": "parameters", "frf_lines": 20},
    }  # fmt: skip
    if size is QUICK:
        aims = {"parameters, D": aims["parameters, D"]}
    rows = []
    for aim, more in aims.items():
        plan = ft.plan(study, **asked, **more)
        lines = plan.calibration_lines if plan.chosen_lines is None else plan.chosen_lines
        outputs = np.array([_at(dof) for s in plan.record.sensors for dof in s.dofs])
        inputs = np.array([_at(e.dof) for e in plan.record.exciters])
        factors = frame.calibrated(outputs, inputs, lines, RATIO, FRF_SD, size.tests)
        expected, found = plan.parameters.column("data_sd"), factors.std(axis=0)
        assert np.abs(found / expected - 1.0).max() < max(0.1, 3.0 / np.sqrt(2.0 * size.tests))
        where = " ".join(dof for s in plan.record.sensors for dof in s.dofs) + " / " + plan.record.exciters[0].dof
        for name, e, f in zip(GROUPS, expected, found):
            first = [aim, where, str(len(lines))] if name == GROUPS[0] else ["", "", ""]
            rows.append(f"| {' | '.join(first)} | {name} | {100 * e:.3f} | {100 * f:.3f} | {100 * (f / e - 1):+.1f} |")
    return [
        "## FRFs: expected standard deviations beside the scatter of simulated tests", "",
        "A free plane frame of 1.0 × 0.6 m with a cross bar, four relative moduli, three sensors and one exciter, "
        f"lines around its first three elastic modes at ξ = {100 * RATIO:g} % (three per half band). Real and "
        f"imaginary part of each value have a standard deviation of {100 * FRF_SD:g} % of the magnitude; logarithms of "
        f"the ratio are compared. Scatter: {size.tests:,} simulated tests, each calibrated by four Gauss-Newton steps "
        "with dense matrices that are assembled without femtune.", "",
        "| aim | sensors / exciter | lines | parameter | expected σ, % | scatter, % | difference % |",
        "| --- " * 7 + "|", *rows, "", *_beside_frf_sets(study, asked, size),
    ]  # fmt: skip


def _beside_frf_sets(study: ft.Study, asked: dict[str, Any], size: Size) -> list[str]:
    """Three of all directions at twelve points, and one of these directions as exciter, beside all and random sets."""
    some = {**asked, "nodes": [1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 25, 30]}
    plan = ft.plan(study, aim="parameters", **some)
    assert plan.record.log_det_parameters is not None
    lines, frame = plan.calibration_lines, DenseFrame.made()
    assert lines is not None
    at = np.array([3 * (node - 1) + axis for node in some["nodes"] for axis in (0, 1)])
    one, step = np.ones(len(GROUPS)), 1e-5
    slopes = [
        np.log(frame.frfs(one + e, at, at, lines, RATIO) / frame.frfs(one - e, at, at, lines, RATIO)) / (2.0 * step)
        for e in step * np.eye(len(GROUPS))
    ]
    prior = (FRAME_BOUNDS[1] - FRAME_BOUNDS[0]) / np.sqrt(12.0)
    J = np.moveaxis(np.array(slopes), 0, -1) * prior / FRF_SD
    # values that cannot be measured beside those at the driving point
    values = np.abs(frame.frfs(one, at, at, lines, RATIO))
    J[values < 1e-4 * np.einsum("iil->il", values).max(axis=1)[:, None]] = 0.0
    F = np.einsum("oilk,oilm->oikm", J.real, J.real) + np.einsum("oilk,oilm->oikm", J.imag, J.imag)

    def best_for(exciter: int) -> Reals:
        every = np.array(list(combinations(range(len(at)), 3)))
        return np.linalg.slogdet(np.eye(len(GROUPS)) + F[every, exciter].sum(axis=1))[1]

    every = np.array([best_for(e) for e in range(len(at))])
    rng = np.random.default_rng(3)
    random = rng.choice(every.ravel(), size.sets)
    own = plan.record.log_det_parameters
    # the dense model damps all modes, the plan those up to twice the highest line
    assert own > every.max() - 0.05
    return [
        f"With 24 directions at twelve points there are {every.size:,} sets of three sensors and one exciter. log det "
        f"(1 + F), with parameters per prior standard deviation: plan {own:.3f}, best of all sets {every.max():.3f}, "
        f"median {np.median(every):.2f}, best of {size.sets:,} random sets {random.max():.3f}.", "",
    ]  # fmt: skip


def main() -> None:
    """Run the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="small models, for continuous integration")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    size = QUICK if options.quick else FULL
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        deck = write_subframe(subframe(size.dofs), folder / "subframe.bdf")
        shapes = translations(deck)
        lines = ["# Test plans: sensors beside all sets and random sets, expected beside simulated scatter", ""]
        lines += [*beside_all_sets(shapes, size), *beside_random_sets(deck, shapes, size)]
        lines += [*beside_simulated_tests(folder, size), *for_frfs(folder, size)]
    text = "\n".join(lines)
    print(text)
    if options.evidence:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / "17_plan.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
