"""Thinning of a pressed part from simulated modal tests: python run.py [--quick] [--evidence DIR].

A clamped plate is 5 % thinner than its drawing, varies by ±8 % along its length, and is 6 % thinner still in the middle
of its width. The tests are simulated with a deck in which every element has its own property card. Updated are, from
the same tests, one factor on the thickness, or the amplitudes of the functions 1, u and 1 − v² of position.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np

from femtune.dofs import DofSet
from femtune.files.nastran import build_structure, read_deck
from femtune.files.uff import write_uff_modes
from femtune.modal import ModeSet
from femtune.model import Configuration, configure, parametric_model, solve_modes
from femtune.parameters import ParameterSet
from femtune.study.study import Study, read_study
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI
from femtune.updating import SensitivityMethod, UpdateResult, update
from structures.pressed_plate import NX, NY, TRUTH, plate

COUNT, SD, SHAPE_SD = 8, 5e-4, 2e-3
MOST_NOISE, LEAST_MISFIT, FARTHEST = 1.3, 10.0, 4.5
NAMES = ("thin1", "thin2", "thin3")
HEAD = f"""
[study]
title = "Pressed plate"
deck = "plate.bdf"
units = "m-kg-s"
[test]
file = "plate.uff"
[modes]
count = {COUNT}
[residuals]
frequency_sd = {SD}
shape_sd = {SHAPE_SD}
shape_sd_of = "scaled-shape"
"""
FACTOR = """
[[parameter]]
name = "thickness"
fields = ["PSHELL 1 T"]
lower = 0.7
upper = 1.3
"""
VARIED = """
[[distribution]]
name = "THIN"
fields = ["PSHELL 1 T"]
functions = ["1", "u", "1 - v**2"]
""" + "".join(
    f"""
[[parameter]]
name = "{name}"
fields = ["DISTRIBUTION THIN F{j}"]
absolute = true
lower = -0.3
upper = 0.3
"""
    for j, name in enumerate(NAMES, 1)
)


def simulate(folder: Path) -> None:
    """Decks, and the test without noise."""
    (folder / "plate.bdf").write_text(plate(varied=False))
    (folder / "true.bdf").write_text(plate(varied=True))
    structure = build_structure(read_deck(folder / "true.bdf")).structure
    configured = configure(parametric_model(structure, ParameterSet(()), ()), Configuration())
    solution = solve_modes(configured.at(np.zeros(0)), COUNT)
    nodes = [n for n in range(3, (NX + 1) * (NY + 1) + 1, 4) if n % (NX + 1) != 1]
    rows = [structure.nodes.dof(n, 3) for n in nodes]
    shapes = (configured.transformation @ solution.shapes)[rows][:, :COUNT]
    frame = WireFrame(np.array(nodes), np.array([structure.nodes.xyz[n - 1] for n in nodes]))
    modes = ModeSet(solution.freq_hz[:COUNT], shapes, DofSet.parse(tuple(f"{n}Z+" for n in nodes)))
    write_uff_modes(folder / "plate.uff", ModalTest("plate", SI, frame, modes=modes))


def study_of(folder: Path, name: str, parameters: str) -> Study:
    """A study of the same test with other parameters."""
    path = folder / f"{name}.toml"
    path.write_text(HEAD + parameters)
    return read_study(path)


def updated(study: Study, seed: int) -> UpdateResult:
    """The update from a test with noise."""
    rng, problem = np.random.default_rng(seed), study.problem()
    (case,) = problem.cases
    test = case.test
    size = np.linalg.norm(test.shapes, axis=0)
    freq = test.freq_hz * (1.0 + SD * rng.standard_normal(COUNT))
    shapes = test.shapes + SHAPE_SD * size * rng.standard_normal(test.shapes.shape)
    case = replace(case, test=replace(test, freq_hz=freq, shapes=shapes))
    return update(replace(problem, cases=(case,)), SensitivityMethod())


@dataclass(frozen=True)
class Found:
    """What many tests give: χ² per residual of both parameterisations, and errors of the amplitudes in stated σ."""

    factor: float
    varied: float
    errors: np.ndarray
    sd: np.ndarray


def campaign(folder: Path, tests: int) -> Found:
    """Both updates from every simulated test."""
    simulate(folder)
    one, three = study_of(folder, "factor", FACTOR), study_of(folder, "varied", VARIED)
    squares, errors, sd = [], [], []
    for seed in range(tests):
        found = [updated(study, seed) for study in (one, three)]
        squares.append([float(np.mean(r.after.residuals**2)) for r in found])
        stated = np.array([found[1].sd[name] for name in NAMES])
        errors.append((np.array([found[1].values[name] for name in NAMES]) - TRUTH) / stated)
        sd.append(stated)
    mean = np.mean(squares, axis=0)
    return Found(float(mean[0]), float(mean[1]), np.array(errors), np.mean(sd, axis=0))


def page(found: Found) -> str:
    """The results as Markdown."""
    inside = 100.0 * float(np.mean(np.abs(found.errors) < 2.0))
    rows = [
        f"| {text} | {true:+.3f} | {sd:.4f} | {np.sqrt(np.mean(e**2)):.2f} |"
        for text, true, sd, e in zip(("1", "u", "1 − v²"), TRUTH, found.sd, found.errors.T)
    ]
    text = f"""# Thinning of a pressed part

A clamped plate of 60 shells is 5 % thinner than its drawing, varies by ±8 % along its length (u from −1 to 1), and is
6 % thinner still in the middle of its width. Modal tests of 8 modes are simulated with a deck in which every element
has its own property card; the frequencies have noise of 0.05 %. The model has one thickness. Updated are one factor on
it, or the amplitudes of three functions of position (`[[distribution]]`).

Number of simulated tests: {len(found.errors)}. Mean square of the residuals in their standard deviations:
{found.factor:.3g} with one factor, {found.varied:.3g} with the functions (1 is noise).
Errors of the amplitudes within two stated standard deviations: {inside:.0f} %.

| function | true amplitude | stated σ | root mean square error / σ |
| --- | --- | --- | --- |
"""
    return text + "\n".join(rows) + "\n"


def main() -> int:
    """Run; 1 if a result is outside its tolerance."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--evidence", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = campaign(Path(folder), 4 if options.quick else 60)
    text = page(found)
    print(text)
    if options.evidence:
        (options.evidence / "cases_pressed_part.md").write_text(text, encoding="utf-8")
    size = float(np.sqrt(np.mean(found.errors**2)))
    good = found.varied < MOST_NOISE and found.factor > LEAST_MISFIT and np.abs(found.errors).max() < FARTHEST
    return 0 if good and (options.quick or 0.8 < size < 1.2) else 1


if __name__ == "__main__":
    raise SystemExit(main())
