"""Lines of machines in records of responses: told from modes with little damping, named, and subtracted."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.messages.shown import check_shown

import femtune as ft
from femtune.dofs import Dof
from femtune.errors import FemtuneError
from femtune.files.identification_file import read_identify_file
from femtune.identification.harmonics import find_lines, multiples, without_lines
from femtune.modal import Channel, TimeSeries
from femtune.steps.identify.from_record import line_notices, subtracted
from femtune.steps.identify.request import check_no_lines

RATE, SECONDS = 64.0, 240.0
T = np.arange(round(RATE * SECONDS)) / RATE
SHAPES = np.array([[0.3, 0.6, 0.9], [0.9, 0.4, -0.6], [0.7, -0.9, 0.5]])
FREQ = np.array([2.9, 7.7, 13.1])


def responses(seed: int, ratio: float) -> np.ndarray:
    """(3, samples) accelerations of three modes under white forces, with 3 % of noise."""
    rng = np.random.default_rng(seed)
    forces = rng.standard_normal((3, T.size))
    out = np.zeros((3, T.size))
    for f, shape in zip(FREQ, SHAPES):
        pole = np.exp(2.0 * np.pi * f * (-ratio + 1j * np.sqrt(1.0 - ratio**2)) / RATE)
        out += np.outer(shape, lfilter([1.0, -2.0, 1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], shape @ forces))
    return out + 0.03 * out.std() * rng.standard_normal(out.shape)


def machine(seed: int, hz: float, wander: float = 0.0) -> np.ndarray:
    """(samples,) A sine with an rms of 1 whose speed wanders smoothly."""
    speed = np.interp(T, np.linspace(0.0, SECONDS, 10), np.random.default_rng(seed).uniform(-wander, wander, 10))
    return np.sqrt(2.0) * np.sin(2.0 * np.pi * hz * np.cumsum(1.0 + speed) / RATE)


def record(values: np.ndarray) -> TimeSeries:
    return TimeSeries(values, [Channel(Dof(i + 1, "Z")) for i in range(len(values))], sampling_hz=RATE)


def found_hz(values: np.ndarray) -> list[float]:
    return [round(line.freq_hz, 2) for line in find_lines(record(values), (1.0, 25.0), FREQ.tolist())]


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [5e-4, 1e-3, 1e-2])
def test_modes_with_little_damping_are_no_lines(ratio):
    assert [found_hz(responses(seed, ratio)) for seed in range(4)] == [[]] * 4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hz", "level_db", "wander"),
    [(10.0, -20.0, 0.0), (10.0, -20.0, 5e-4), (13.1, -3.0, 0.0), (13.3, 0.0, 5e-4), (7.0, 40.0, 5e-4)],
)
def test_lines_of_machines_are_found(hz, level_db, wander):
    values = responses(3, 0.01)
    line = np.outer([0.5, 0.8, 0.3], machine(5, hz, wander))
    assert found_hz(values + line * values.std() / line.std() * 10.0 ** (level_db / 20.0)) == [
        pytest.approx(hz, rel=1e-3)
    ]


def test_multiples_of_a_speed_and_of_the_mains():
    values = responses(0, 0.01) + sum(np.outer([0.5, 0.8, 0.3], machine(1, hz)) for hz in (5.0, 15.0))
    assert multiples(find_lines(record(values), (1.0, 25.0))) == ("", "3 times 5 Hz")
    (line,) = find_lines(record(values).select_samples(0, 12_000), (14.0, 16.0))
    assert line.kurtosis == pytest.approx(1.5, abs=0.05)


@pytest.mark.parametrize("wander", [0.0, 5e-4])
def test_subtracted_lines_leave_the_rest(wander):
    values = responses(2, 0.01)
    line = 3.0 * values.std() * np.outer([0.5, 0.8, 0.3], machine(7, 10.004, wander))
    clean, (removed,) = without_lines(record(values + line), [10.0])
    assert removed.freq_hz == pytest.approx(10.004, rel=3e-4)
    assert (clean.values - values).std() < (0.02 if wander == 0.0 else 0.1) * values.std()


def test_a_line_that_is_absent_is_not_subtracted():
    with pytest.raises(FemtuneError, match=r"no line stands out within 0.2 % of 10 Hz") as caught:
        without_lines(record(responses(2, 0.01)), [10.0])
    check_shown("identify.no-line", caught.value)


def test_messages(tmp_path):
    values = responses(0, 0.01) + sum(np.outer([0.5, 0.8, 0.3], machine(1, hz)) for hz in (5.0, 15.0))
    (notice,) = line_notices(find_lines(record(values), (1.0, 25.0)))
    check_shown("identify.harmonic", notice)
    asked = tmp_path / "identify.toml"
    asked.write_text('[identify]\nrecord = "a.csv"\nband_hz = [1, 20]\nremove_hz = [5.0, 15.0]\n')
    file = read_identify_file(asked)
    _, (notice,), _ = subtracted(record(values), file)
    check_shown("identify.removed-lines", notice)
    with pytest.raises(FemtuneError, match="forces were measured"):
        check_no_lines(file)


def written(tmp_path, values: np.ndarray) -> str:
    path = tmp_path / "r.csv"
    np.savetxt(path, np.column_stack([T, *values]), delimiter=",", header="time,1Z+,2Z+,3Z+", comments="", fmt="%.6g")
    return str(path)


@pytest.mark.slow
def test_a_machine_on_a_mode_hides_it_until_it_is_removed(tmp_path):
    values = responses(1, 0.01)
    values += 4.0 * values.std() * np.outer([0.5, 0.8, 0.3], machine(2, 13.1) + machine(3, 10.0))
    asked = {"band_hz": (1.0, 20.0), "largest_order": 24, "methods": ("SSI-cov", "FDD"), "output": tmp_path / "out"}
    made = ft.identify(written(tmp_path, values), **asked)
    assert [line.freq_hz for line in made.record.harmonics] == pytest.approx([10.0, 13.1], abs=0.01)
    assert all(m.doubtful for m in made.record.modes if abs(m.freq_hz - 13.1) < 0.1)
    assert not any(abs(m.freq_hz - 10.0) < 0.1 for m in made.record.modes)
    assert "2 harmonics excluded" in made.report.read_text()
    made = ft.identify(written(tmp_path, values), **asked, remove_hz=(10.0, 13.1))
    assert [m.freq_hz for m in made.record.modes] == pytest.approx(FREQ, rel=0.01)
    assert not any(m.doubtful for m in made.record.modes)
    assert not made.record.harmonics
    assert "identify.removed-lines" in {a.code for a in made.record.alerts}
    assert len(json.loads((tmp_path / "out" / "identified.json").read_text())["modes"]) == 3


@pytest.mark.slow
def test_a_record_of_machines_only_has_no_modes(tmp_path):
    noise = np.random.default_rng(0).standard_normal((3, T.size))
    values = 0.1 * noise + np.outer([0.5, 0.8, 0.3], machine(2, 12.0) + machine(3, 5.0))
    asked = {"band_hz": (1.0, 20.0), "largest_order": 20, "methods": ("SSI-cov",), "output": tmp_path / "out"}
    made = ft.identify(written(tmp_path, values), **asked)
    assert [line.freq_hz for line in made.record.harmonics] == pytest.approx([5.0, 12.0], abs=0.01)
    assert not any(abs(m.freq_hz - f) < 0.05 for m in made.record.modes for f in (5.0, 12.0))
