"""A wrong property of a model with more than 1,000 free DOFs of which FRFs are compared alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.fem import FieldRef
from femtune.judge.widened import WideningFactor, widened_end, widened_problem
from femtune.steps.judge.record.missing import MissingResults
from femtune.study.study import read_study
from femtune.updating import SensitivityMethod, update

POINTS, RATIO, NOISE = 180, 0.02, 0.02
STUDY = f"""
[study]
title = "bar on springs"
deck = "model.bdf"
units = "m-kg-s"
[test]
file = "test.uff"
[checks]
refinement = false
[output]
live = false
[[parameter]]
name = "first"
fields = ["PBAR 1 I1"]
lower = 0.5
upper = 2.0
[[parameter]]
name = "second"
fields = ["PBAR 2 I1"]
lower = 0.5
upper = 2.0
[[residual]]
kind = "frf"
sd = {NOISE}
ratio = {RATIO}
to_hz = 200.0
"""


def bar(third: float = 1.0) -> str:
    """A bar of 3.6 m on four springs, with a property for each third of it."""
    grids = [f"GRID,{k},,{0.02 * (k - 1):.2f},0.,0." for k in range(1, POINTS + 2)]
    bars = [f"CBAR,{k},{1 + 3 * (k - 1) // POINTS},{k},{k + 1},0.,0.,1." for k in range(1, POINTS + 1)]
    properties = [f"PBAR,{n},1,4.-4,{1e-7 * (third if n == 3 else 1.0)!r},{1e-7!r},2.-7" for n in (1, 2, 3)]
    springs = [f"CBUSH,{900 + i},9,{k},,,,,0" for i, k in enumerate((1, 61, 121, 181))]
    spring, material = "PBUSH,9,K,1.+5,1.+5,1.+5,1.+3,1.+3,1.+3", "MAT1,1,2.1+11,,0.3,7850."
    return "\n".join(["BEGIN BULK", *grids, *bars, *properties, *springs, spring, material, "ENDDATA", ""])


def study(folder: Path, third: float) -> Path:
    """The study of FRFs of a bar whose last third has another stiffness."""
    (folder / "model.bdf").write_text(bar())
    (folder / "true.bdf").write_text(bar(third))
    outputs = [f"{k}Z+" for k in (1, 45, 90, 135, 180)]
    ft.respond(
        folder / "true.bdf", inputs=["1Z+"], outputs=outputs, from_hz=5.0, to_hz=200.0, step_hz=1.0, ratio=RATIO,
        scatter=NOISE, seed=1, uff=folder / "test.uff", units="m-kg-s",
    )  # fmt: skip
    path = folder / "study.toml"
    path.write_text(STUDY)
    return path


def missing(folder: Path, third: float) -> MissingResults:
    """What the judgement of the update says of fields that are no parameters."""
    judgement = ft.run(study(folder, third)).results.judgement
    assert judgement is not None
    assert judgement.missing is not None
    return judgement.missing


@pytest.mark.slow
def test_a_wrong_property_is_named(tmp_path: Path) -> None:
    found = missing(tmp_path, 0.8)
    assert found.p_value is not None
    assert found.p_value < 0.01
    # motions along z do not tell E from I1 of a part
    first = found.fields[0]
    assert f"{first.field} {first.place}" in ("MAT1 1 E elements of property 3", "PBAR 3 I1 ")
    assert first.refit is not None
    assert first.refit.factor == pytest.approx(0.8, abs=0.03)


@pytest.mark.slow
def test_a_right_model_lacks_nothing(tmp_path: Path) -> None:
    found = missing(tmp_path, 1.0)
    assert found.tested > 5
    assert found.p_value is not None
    assert found.p_value > 0.05


@pytest.mark.slow
def test_derivatives_by_fields_are_those_of_the_full_model(tmp_path: Path) -> None:
    """By central differences of the FRFs of the full model."""
    read = read_study(study(tmp_path, 0.8))
    result = update(read.problem(), SensitivityMethod(max_iterations=2))
    fields = [FieldRef("PBAR", 3, "I1"), FieldRef("MAT1", 1, "RHO"), FieldRef("PBUSH", 9, "K3")]
    values = read.model.structure.values
    factors = [
        WideningFactor(f"q{i}", ref, frozenset(int(n) for n in read.model.structure.users(values.index(ref) or 0)))
        for i, ref in enumerate(fields)
    ]
    problem = widened_problem(result, read.model, factors)
    assert problem.cases[0].configured.n_free > 1000
    end = widened_end(result, problem)
    # in standard deviations; the superposition of the full model leaves out what the reduced model has
    np.testing.assert_allclose(end.residuals, result.after.residuals, atol=0.2)
    h = 1e-4
    for j in range(len(end.x)):
        up, down = (
            problem.assess(x, problem.solved(x), derivatives=False).residuals
            for x in (end.x + s * h * np.eye(len(end.x))[j] for s in (1.0, -1.0))
        )
        expected = (up - down) / (2.0 * h)
        np.testing.assert_allclose(end.jacobian[:, j], expected, atol=5e-3 * np.abs(expected).max())
