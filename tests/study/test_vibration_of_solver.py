"""Vibration tests with an external solver: two masses that are stiffer on the table than in the modal test."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from femtune.steps.vibration.record import VibrationResults

from .two_masses import SCRIPT, TRUTH, prepared, started

STIFFER, RATIO = 300.0, 0.02
TABLE_SCRIPT = SCRIPT.replace('in open("in.txt"))', f'in open("table.txt"))\nk1 += {STIFFER}').replace(
    'out.write("end', 'out.write("participation Z %.6e %.6e\\n" % (sum(low), sum(high)))\n    out.write("end'
)
VIBRATION = """
[[vibration]]
name = "random"
kind = "random"
base = "Z"
outputs = ["1Z+", "2Z-"]
damping_ratio = 0.02
spectrum_hz = [2.0, 5.0, 20.0]
spectrum = [1.0, 2.0, 0.5]
measured = "random.csv"
{solver}

[[vibration]]
name = "sweep"
kind = "sweep"
base = "Z"
outputs = ["1Z+"]
damping_ratio = 0.02
from_hz = 4.0
to_hz = 7.0
rate = 0.02
measured = "sweep.csv"
{solver}

[validate]
random_rms = 0.01
sweep_frequency = 0.01
"""


def _transfer(values: np.ndarray, hz: np.ndarray) -> np.ndarray:
    """(2, n) accelerations of both masses over that of the table, by the dynamic stiffness at each line."""
    k1, k2 = values
    K = np.array([[k1 + STIFFER + 10.0, -10.0], [-10.0, k2 + 10.0]])
    square, shapes = np.linalg.eigh(K)
    C = shapes @ np.diag(2.0 * RATIO * np.sqrt(square)) @ shapes.T
    omega = (2.0 * np.pi * hz)[:, None, None]
    relative = np.linalg.solve(K - omega**2 * np.eye(2) + 1j * omega * C, np.ones((len(hz), 2, 1)))
    return (1.0 + omega**2 * relative)[:, :, 0].T


def _density(values: np.ndarray, hz: np.ndarray) -> np.ndarray:
    spectrum = np.exp(np.interp(np.log(hz), np.log([2.0, 5.0, 20.0]), np.log([1.0, 2.0, 0.5])))
    return np.abs(_transfer(values, hz)) ** 2 * spectrum


@pytest.fixture
def study(tmp_path: Path) -> Path:
    path = prepared(tmp_path)
    (tmp_path / "table.txt").write_text("{{k1}}\n{{k2}}\n")
    (tmp_path / "table.py").write_text(TABLE_SCRIPT)
    lines = np.geomspace(2.0, 20.0, 40_000)
    _write(tmp_path / "random.csv", lines, _density(TRUTH, lines))
    lines = np.linspace(4.0, 7.0, 2000)
    _write(tmp_path / "sweep.csv", lines, np.abs(_transfer(TRUTH, lines))[:1])
    command = str([sys.executable, "-I", "-S", "table.py"]).replace("'", '"')
    own = f'solver = {{ command = {command}, templates = ["table.txt"], files = ["table.py"] }}'
    path.write_text(path.read_text() + VIBRATION.format(solver=own))
    return path


def _write(path: Path, hz: np.ndarray, values: np.ndarray) -> None:
    np.savetxt(path, np.vstack([hz, values]).T, "%.9g", ",", header=",".join("Hz12"[: 2 + len(values)]), comments="")


def _found(study: Path) -> tuple[VibrationResults, VibrationResults]:
    validation = ft.run(study).results.validation
    assert validation is not None
    assert [v.verdict for v in validation.verdicts if v.data == "vibration test"] == ["pass"] * 2
    random, sweep = validation.vibrations
    return random, sweep


@pytest.mark.slow
def test_responses_are_those_of_the_dynamic_stiffness_before_and_after_the_update(study: Path) -> None:
    random, sweep = _found(study)
    hz = np.geomspace(2.0, 20.0, 40_000)
    for values, names in (((800.0, 1000.0), "before_rms"), (TRUTH, "rms")):
        expected = np.sqrt(np.trapezoid(_density(np.array(values), hz), hz, axis=1))
        np.testing.assert_allclose([getattr(p, names) for p in random.points], expected, rtol=2e-4)
    hz = np.linspace(4.0, 7.0, 20_000)
    (point,) = sweep.points
    for values, peak in (((800.0, 1000.0), point.before_peak_hz), (TRUTH, point.peak_hz)):
        slow = hz[np.abs(_transfer(np.array(values), hz))[0].argmax()]
        assert peak == pytest.approx(slow, rel=2e-3)
    # one run on the table at the initial values and one at the result serve both tests, and a second run none
    with_table = started(study)
    _found(study)
    assert started(study) == with_table
    study.write_text(study.read_text().split("\n[[vibration]]")[0] + '\n[output]\nfolder = "other"\n')
    ft.run(study)
    assert with_table + (with_table - 2) == started(study)


_BAD = {
    "vibration.solver": ("", ""),
    "vibration.solver, outputs": ('outputs = ["1Z+", "2Z-"]', 'outputs = ["1X+", "4Z+"]'),
    "vibration.solver, rotation": ('base = "Z"', 'base = "RX"'),
    "vibration.entry, force with a solver": ('base = "Z"', 'input = "1Z+"'),
    "external.placeholder, of a vibration test": ("", ""),
}


@pytest.mark.parametrize("name", _BAD)
@pytest.mark.slow
def test_what_is_missing_is_said_before_the_update(name: str, study: Path) -> None:
    old, new = _BAD[name]
    text = study.read_text()
    if name == "vibration.solver":
        text = "\n".join(line for line in text.splitlines() if not line.startswith("solver ="))
    elif old:
        text = text.replace(old, new, 1)
    else:
        (study.parent / "table.txt").write_text("{{k1}}\n{{k3}}\n")
    study.write_text(text)
    with pytest.raises(FemtuneError) as caught:
        ft.run(study)
    first = next(iter(getattr(caught.value, "errors", (caught.value,))))
    check_shown(name, str(first).replace(str(study.parent), "."))
