"""Shapes scaled by added masses, and modes followed over records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.identification.mass_change import scale_by_masses
from femtune.identification.tracking import track_modes
from femtune.modal import ModeSet

DOFS = DofSet.parse([f"{i}X+" for i in range(1, 6)])
MASS = np.diag([3.0, 2.0, 2.0, 2.0, 1.0])
STIFF = 1e4 * (2.0 * np.eye(5) - np.eye(5, k=1) - np.eye(5, k=-1))


def chain(added: float = 0.0, softer: float = 0.0, sd: float | None = None) -> ModeSet:
    """Modes of unit norm with masses on all DOFs, and a softer first spring."""
    return chain_with(added * np.eye(5), softer, sd)


def chain_with(added: np.ndarray, softer: float = 0.0, sd: float | None = None) -> ModeSet:
    """The same with a matrix of masses."""
    stiff = STIFF.copy()
    stiff[0, 0] -= softer * 1e4
    values, shapes = eigh(stiff, MASS + added)
    hz = np.sqrt(values) / (2.0 * np.pi)
    sds = None if sd is None else sd * hz
    return ModeSet(hz, shapes / np.linalg.norm(shapes, axis=0), DOFS, normalisation="unit-norm", freq_sd_hz=sds)


def test_small_masses_give_the_modal_masses() -> None:
    before, after = chain(), chain(0.02)
    found = scale_by_masses(before, after, dict.fromkeys(DOFS, 0.02))
    assert found.modes.normalisation == "mass"
    assert np.diag(found.modes.shapes.T @ MASS @ found.modes.shapes) == pytest.approx(np.ones(5), rel=0.003)
    assert (found.shift < 0.0).all()
    # the error grows with the masses, as the shapes change with them
    large = scale_by_masses(before, chain(0.2), dict.fromkeys(DOFS, 0.2)).modes.shapes
    assert np.diag(large.T @ MASS @ large) == pytest.approx(np.ones(5), rel=0.03)


def test_the_stated_error_of_the_scale_is_that_of_repeated_records() -> None:
    rng, before, after = np.random.default_rng(1), chain(sd=1e-4), chain(0.1, sd=1e-4)
    exact = scale_by_masses(before, after, dict.fromkeys(DOFS, 0.1))
    scales = []
    for _ in range(300):
        drawn = [replace(m, freq_hz=m.freq_hz * (1.0 + 1e-4 * rng.standard_normal(5))) for m in (before, after)]
        scales.append(scale_by_masses(*drawn, dict.fromkeys(DOFS, 0.1)).modes.shapes[0] / exact.modes.shapes[0])
    assert np.std(scales, axis=0) == pytest.approx(exact.scale_sd, rel=0.15)


def test_the_phase_of_a_complex_shape_and_entries_that_were_not_measured() -> None:
    before, masses = chain(), dict.fromkeys(list(DOFS)[1:], 0.02)
    after = chain_with(np.diag([0.0, 0.02, 0.02, 0.02, 0.02]))
    plain = scale_by_masses(before, after, masses).modes.shapes
    turned = replace(after, shapes=after.shapes * np.exp(0.7j))
    assert np.abs(scale_by_masses(before, turned, masses).modes.shapes) == pytest.approx(np.abs(plain))
    holes = before.shapes.copy()
    holes[0] = np.nan  # without an added mass
    assert np.abs(scale_by_masses(replace(before, shapes=holes), after, masses).modes.shapes[1:]) == pytest.approx(
        np.abs(plain[1:]), rel=0.02
    )
    holes[1, 2] = np.nan  # with one
    told = scale_by_masses(replace(before, shapes=holes), after, masses).notices
    assert [(n.code, f"{before.freq_hz[2]:.4g} Hz" in n.what) for n in told] == [("identify.added-mass", True)]
    assert "was not measured" in told[0].what


def test_modes_that_masses_do_not_shift_are_named() -> None:
    found = scale_by_masses(chain(sd=0.02), chain(0.2, sd=1e-4), dict.fromkeys(DOFS, 0.2))
    assert len(found.modes) + len(found.notices) == 5
    assert found.notices
    with pytest.raises(FemtuneError, match="added mass"):
        scale_by_masses(chain(), chain(0.1), {})
    with pytest.raises(FemtuneError, match="no mode"):
        scale_by_masses(chain(), chain(), dict.fromkeys(DOFS, 0.1))


def test_the_slope_with_temperature_is_found_and_taken_out() -> None:
    rng = np.random.default_rng(2)
    degrees = rng.uniform(-10.0, 30.0, 60)
    records = []
    for i, t in enumerate(degrees):
        own = chain()
        hz = own.freq_hz * (1.0 - 4e-4 * t) * (1.0 + 2e-4 * rng.standard_normal(5))
        # a mode is missed now and then, and the order of the modes does not matter
        order = rng.permutation(5)[: 4 + i % 2]
        records.append(replace(own, freq_hz=hz).select_modes(order.tolist()))
    tracked = track_modes(chain(), records, degrees)
    assert np.isfinite(tracked.freq_hz).sum() == sum(map(len, records))
    low, high = tracked.slope_interval.T
    assert ((low < tracked.slope) & (tracked.slope < high)).all()
    assert tracked.slope == pytest.approx(-4e-4 * np.ones(5) / (1.0 - 4e-4 * degrees.mean()), rel=0.02)
    assert np.nanstd(tracked.corrected_hz / chain().freq_hz, axis=0).max() < 3e-4


def test_parameters_over_time_from_sensitivities() -> None:
    records = [chain(softer=s) for s in (0.0, 0.01, 0.02)]
    step = 1e-5
    sensitivity = np.log(chain(softer=step).freq_hz / chain().freq_hz)[:, None] / step
    changes = track_modes(records[0], records).parameters(sensitivity)
    assert changes[:, 0] == pytest.approx([0.0, 0.01, 0.02], rel=0.02)
    with pytest.raises(FemtuneError, match="temperature"):
        track_modes(records[0], records, [1.0])
