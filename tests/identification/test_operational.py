"""Output-only methods from a record to modes: simulated, and records of others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.identification.kinds import OUTPUT_ONLY
from femtune.identification.operational import (
    Operational,
    by_covariances,
    chosen_modes,
    independent_rows,
    prepared,
    segment_of,
)
from femtune.modal import Channel, TimeSeries
from femtune.modal.shape_criteria import mac
from structures.laboratory import Clock, MeasuringChain, plant_of_matrices, simulated_test, white_noise

DOFS = DofSet(Dof(i, "X") for i in (1, 2, 3, 4))


def record(seed: int = 0, duration_s: float = 1200.0):
    stiffness = 900.0 * (2.0 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1))
    plant = plant_of_matrices(np.eye(4), stiffness, 0.008, np.eye(4), DOFS, np.eye(4), DOFS)
    clock = Clock(duration_s, 100.0, 10.0)
    noise = white_noise(np.random.default_rng(seed), 4, clock.fine_samples)
    return plant.truth, simulated_test(plant, noise, clock, MeasuringChain(40.0), seed)


@pytest.mark.quick(0)
@pytest.mark.parametrize("method", OUTPUT_ONLY)
def test_every_method_finds_all_modes_and_no_more(method):
    truth, made = record()
    found = OUTPUT_ONLY[method].load()(made, Operational((1.0, 12.0), 24)).modes
    near = np.abs(found.freq_hz[:, None] / truth.freq_hz - 1.0).min(axis=1) < 0.01
    # phases are steady at a few lines between modes too
    steady = method.startswith("TFIE")
    assert near.all() or steady
    found = found.select_modes(near)
    assert found.freq_hz == pytest.approx(truth.freq_hz, rel=1e-2 if steady else 3e-3)
    assert np.diag(mac(found.shapes, truth.shapes)).min() > 0.99
    if not steady:
        assert found.damping_ratio == pytest.approx([0.008] * 4, rel=0.4)


@pytest.mark.slow
def test_deviations_are_of_the_size_of_the_errors():
    asked = Operational((1.0, 12.0), 16)
    errors, stated = [], []
    for seed in range(12):
        truth, made = record(seed, 600.0)
        found = by_covariances(made, asked).modes
        errors.append(found.freq_hz - truth.freq_hz)
        stated.append(found.freq_sd_hz)
    ratio = np.sqrt(np.mean(np.square(errors), axis=0)) / np.median(stated, axis=0)
    assert ((ratio > 0.5) & (ratio < 1.8)).all(), ratio


@pytest.mark.slow
def test_references_are_enough():
    truth, made = record()
    found = by_covariances(made, Operational((1.0, 12.0), 24, references=DofSet([Dof(1, "X"), Dof(2, "X")]))).modes
    assert found.freq_hz == pytest.approx(truth.freq_hz, rel=3e-3)
    channels = (Channel(made.channels[0].dof, "acceleration", role="reference"), *made.channels[1:])
    found = by_covariances(TimeSeries(made.values, channels, made.sampling_hz), Operational((1.0, 12.0), 24)).modes
    assert found.freq_hz == pytest.approx(truth.freq_hz, rel=3e-3)


def test_records_are_resampled_to_the_band():
    _, made = record(duration_s=100.0)
    ready = prepared(made, Operational((0.5, 8.0)))
    assert ready.sampling_hz == 20.0
    assert np.abs(ready.values.mean(axis=1)).max() < 1e-2 * ready.values.std()
    # eight segments where the record is too short for the resolution, else the power of two next to 20 Hz/.15 Hz
    assert ready.samples == 2000
    assert segment_of(ready, Operational((0.5, 8.0))) == 250
    assert segment_of(ready, Operational((0.5, 8.0), resolution_hz=0.15)) == 128


def test_deviations_contain_the_scatter_over_orders():
    """A pole of one order alone has the deviation by the correlations; the variance over orders is added to it."""
    for duration_s in (200.0, 1200.0):
        found = by_covariances(record(duration_s=duration_s)[1], Operational((1.0, 12.0), 24))
        alone = [replace(c, members=np.array([c.at])) for c in found.candidates]
        of_order = chosen_modes(found, tuple(alone)).modes
        chosen = [found.table.freq_hz[c.members] for c in found.candidates if c.chosen]
        spread = [1.4826 * np.median(np.abs(hz - np.median(hz))) for hz in chosen]
        assert min(spread) > 0.0
        assert found.modes.freq_sd_hz == pytest.approx(np.hypot(of_order.freq_sd_hz, spread), rel=1e-12)
        assert (found.modes.damping_sd > of_order.damping_sd).all()
        # a low order that has the second mode elsewhere, in the longer record, does not count
        assert (found.modes.freq_sd_hz < 1.25 * of_order.freq_sd_hz).all()


def test_deviations_stand_beside_what_they_are_of():
    """Two of the four modes, at four responses."""
    truth, made = record(duration_s=200.0)
    found = by_covariances(made, Operational((1.0, 7.0), 16)).modes
    assert found.freq_hz == pytest.approx(truth.freq_hz[:2], rel=0.02)
    assert found.shapes_sd.shape == found.shapes.shape == (4, 2)
    error = np.abs(found.shapes) - np.abs(truth.shapes[:, :2] / np.linalg.norm(truth.shapes[:, :2], axis=0))
    assert np.abs(error / found.shapes_sd).max() < 6.0


def test_lost_samples_and_bands_that_are_not_there_are_refused():
    _, made = record(duration_s=20.0)
    holes = made.values.copy()
    holes[2, 50] = np.nan
    with pytest.raises(FemtuneError, match=r"not finite(.|\n)*3X\+: 1"):
        by_covariances(TimeSeries(holes, made.channels, 100.0), Operational((1.0, 12.0)))
    with pytest.raises(FemtuneError, match="outside the frequency range"):
        by_covariances(made, Operational((1.0, 60.0)))


SHEAR_FRAME_HZ = 12.0
"""Its owners give no rate. Their frequencies, and the period elongation of the trapezoidal rule that made the record,
tan(ω′Δt/2) = ωΔt/2, fit all five modes at this one."""


@pytest.mark.quick(1)
@pytest.mark.parametrize("method", ["SSI-cov", "SSI-data", "ERA"])
def test_shear_frame_of_others(shared_data, method):
    folder = shared_data / "shear_frame_ambient"
    omega, ratio, shapes = (np.load(folder / f"{n}.npy") for n in ("omega_n", "xi_ref", "phi_ref"))
    values = np.load(folder / "data_shearframe.npy").T
    made = TimeSeries(values, tuple(Channel(Dof(i, "X"), "acceleration") for i in range(1, 6)), SHEAR_FRAME_HZ)
    found = OUTPUT_ONLY[method].load()(made, Operational((0.1, 5.0), 24)).modes
    step = 1.0 / SHEAR_FRAME_HZ
    without_elongation = 2.0 / step * np.tan(np.pi * found.freq_hz * step) / (2.0 * np.pi)
    assert without_elongation == pytest.approx(omega / (2.0 * np.pi), rel=5e-3)
    assert np.diag(mac(found.shapes, shapes)).min() > 0.99
    # damping that decays in a few samples scatters widely in 20 minutes of the lowest mode
    assert found.damping_ratio[1:] == pytest.approx(ratio[1:], rel=0.35)


def test_of_many_channels_those_that_differ_are_references() -> None:
    rng = np.random.default_rng(0)
    sources = rng.standard_normal((3, 4000))
    mixed = rng.uniform(-1.0, 1.0, (17, 3)) @ sources + 1e-3 * rng.standard_normal((17, 4000))
    # one channel moves alone
    alone = np.vstack([mixed, rng.standard_normal(4000), np.zeros(4000)])
    rows = independent_rows(alone, 4)
    assert 17 in rows
    assert 18 not in rows
    others = alone[[i for i in rows if i != 17]]
    assert np.linalg.cond(others @ others.T) < 1e4
