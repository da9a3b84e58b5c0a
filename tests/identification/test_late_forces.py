"""Forces that are late or early are found by the phases of residues; complex shapes and other quantities are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune import identify
from femtune.identification.late_forces import late_force
from femtune.modal import TimeSeries

from .hits import CHANNELS, RATE, codes, measured, written

FREQ = np.array([6.8, 18.7, 29.8, 34.9, 42.8])
STEP_S = 1.0 / 256.0
SD = np.deg2rad([0.6, 0.5, 0.9, 0.7, 1.2])


def phases(seed: int, samples: float, modes: int = 5, scatter: float = 1.0) -> np.ndarray:
    """Phases of residues with noise, mod 180°."""
    rng = np.random.default_rng(seed)
    made = 2.0 * np.pi * FREQ * samples * STEP_S + scatter * SD * rng.standard_normal(5)
    return np.asarray(made + np.pi * rng.integers(-1, 2, 5))[:modes]


@pytest.mark.parametrize("modes", [3, 5])
@pytest.mark.parametrize("scatter", [1.0, 10.0, 40.0])
def test_forces_on_time_are_not_late(modes: int, scatter: float) -> None:
    """Level 0.1 %, less with the correction for all delays; phases that scatter little have no delay that is told."""
    found = [late_force(phases(s, 0.0, modes, scatter), SD[:modes], FREQ[:modes], STEP_S) for s in range(300)]
    assert sum(one is not None for one in found) <= 1


@pytest.mark.parametrize("samples", [0.5, 1.0, 2.0, 5.0, -1.0])
def test_the_delay_of_a_force_is_found_with_its_standard_deviation(samples: float) -> None:
    errors = []
    for seed in range(30):
        found = late_force(phases(seed, samples), SD, FREQ, STEP_S)
        assert found is not None
        assert found.delay_s == pytest.approx(samples * STEP_S, abs=0.1 * STEP_S)
        errors.append((found.delay_s - samples * STEP_S) / found.sd_s)
    # t with four degrees of freedom: its median magnitude is 0.74
    assert 0.4 < np.median(np.abs(errors)) < 1.3


def test_two_modes_another_quantity_and_small_delays_are_not_told() -> None:
    assert late_force(phases(0, 1.0, 2), SD[:2], FREQ[:2], STEP_S) is None
    assert late_force(phases(0, 0.0) + 0.5 * np.pi, SD, FREQ, STEP_S) is None
    assert late_force(phases(0, 0.15, scatter=0.01), SD, FREQ, STEP_S) is None
    assert late_force(phases(0, 0.25, scatter=0.01), SD, FREQ, STEP_S) is not None


@pytest.mark.slow
def test_a_late_force_of_a_hammer_is_told(tmp_path: Path) -> None:
    record = measured([40, 1150, 2290], 3400)
    late = np.vstack([np.roll(record.values[0], 1), record.values[1:]])
    for name, values, told in (("right", record.values, False), ("late", late, True)):
        path = written(TimeSeries(values, CHANNELS, RATE), tmp_path / f"{name}.csv")
        made = identify(path, sampling_hz=RATE, band_hz=(10.0, 90.0))
        assert ("identify.late-channel" in " ".join(codes(made.found.notices))) == told
        if told:
            (said,) = [n for n in made.found.notices if n.code.startswith("identify.late-channel")]
            assert "samples late" in said.what
            check_shown("identify.late-channel, force", said)
