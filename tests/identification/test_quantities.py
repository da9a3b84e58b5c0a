"""Records of mixed velocities, accelerations and displacements: shapes as from a record of one quantity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy import signal
from tests.messages.shown import check_shown

from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.identification.kinds import OUTPUT_ONLY
from femtune.identification.operational import Operational, by_covariances
from femtune.identification.quantities import moved_in_one_quantity
from femtune.identification.setups import to_rigid_motion
from femtune.identification.ssi import PoleScatter, covariance_driven, scatter_of_order
from femtune.modal import Channel, TimeSeries
from femtune.modal.shape_criteria import mac
from femtune.testdata.checks import phase_collinearity
from structures.laboratory import Plant, plant_of_matrices

DOFS = DofSet(Dof(i, "X") for i in (1, 2, 3, 4))
ALL = ("acceleration",) * 4
VELOCITIES = ("acceleration", "velocity", "acceleration", "velocity")
THREE = ("velocity", "acceleration", "displacement", "acceleration")
ASKED = Operational((1.0, 12.0), 24)
FINE_S, COARSE = 1.0 / 400.0, 4


def plant() -> Plant:
    """Four masses on springs, modes at 3 to 9 Hz."""
    stiffness = 900.0 * (2.0 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1))
    return plant_of_matrices(np.eye(4), stiffness, 0.008, np.eye(4), DOFS, np.eye(4), DOFS)


def motions(made: Plant, forces: np.ndarray) -> dict[str, np.ndarray]:
    """(s, n) exact displacements, velocities and accelerations under forces (4, n), straight between samples."""
    modal = made.forcing.T @ forces
    found = {}
    for quantity in ("displacement", "velocity", "acceleration"):
        answer = [
            signal.lfilter(*_filter(w, z, quantity), q) for w, z, q in zip(made.omega_rad_s, made.damping_ratio, modal)
        ]
        found[quantity] = made.shapes @ np.array(answer)
    return found


def _filter(omega: float, ratio: float, quantity: str) -> tuple[np.ndarray, np.ndarray]:
    a = np.array([[0.0, 1.0], [-(omega**2), -2.0 * ratio * omega]])
    row, direct = {"displacement": ([[1.0, 0.0]], 0.0), "velocity": ([[0.0, 1.0]], 0.0), "acceleration": (a[1:], 1.0)}[
        quantity
    ]
    system = (a, np.array([[0.0], [1.0]]), np.array(row), np.array([[direct]]))
    discrete = signal.cont2discrete(system, FINE_S, method="foh")
    numerator, denominator = signal.ss2tf(*discrete[:4])
    return numerator[0], denominator


@pytest.fixture(scope="module")
def measured() -> dict[str, np.ndarray]:
    """Twenty minutes at 100 Hz, noise of 1 % on each channel."""
    rng = np.random.default_rng(3)
    exact = motions(plant(), rng.standard_normal((4, round(1220.0 / FINE_S))))
    found = {}
    for quantity, fine in exact.items():
        coarse = signal.decimate(fine, COARSE, ftype="fir", axis=1)[:, 2000:]
        found[quantity] = coarse + 0.01 * coarse.std(axis=1, keepdims=True) * rng.standard_normal(coarse.shape)
    return found


def record(measured: dict[str, np.ndarray], quantities: Sequence[str], units: Sequence[str] = ("",) * 4) -> TimeSeries:
    values = np.stack([measured.get(q, measured["acceleration"])[i] for i, q in enumerate(quantities)])
    channels = tuple(Channel(d, q, u) for d, q, u in zip(DOFS, quantities, units))
    return TimeSeries(values, channels, 1.0 / (FINE_S * COARSE))


@pytest.mark.parametrize("quantities", [VELOCITIES, THREE], ids=["two", "three"])
@pytest.mark.parametrize("method", OUTPUT_ONLY)
@pytest.mark.quick(0, gate=3)
def test_shapes_of_mixed_records_are_those_of_accelerations(measured, method, quantities):
    truth = plant().truth
    mixed, plain = (OUTPUT_ONLY[method].load()(record(measured, q), ASKED) for q in (quantities, ALL))
    for found in (mixed, plain):
        assert np.abs(found.modes.freq_hz[:, None] / truth.freq_hz - 1.0).min(axis=0).max() < 0.01
    rows = [int(np.abs(mixed.modes.freq_hz - f).argmin()) for f in truth.freq_hz]
    others = [int(np.abs(plain.modes.freq_hz - f).argmin()) for f in truth.freq_hz]
    a, b = mixed.modes.shapes[:, rows], plain.modes.shapes[:, others]
    least = 0.999
    assert np.diag(mac(a, b)).min() > least
    assert np.diag(mac(a, truth.shapes)).min() > least
    assert (np.sign(a * a[0]) == np.sign(truth.shapes * truth.shapes[0])).all()
    assert min(phase_collinearity(s) for s in mixed.complex_shapes[:, rows].T) > 0.99


@pytest.mark.slow
def test_deviations_of_mixed_shapes_are_of_the_shapes_that_are_reported(measured):
    truth = plant().truth.shapes / np.linalg.norm(plant().truth.shapes, axis=0)
    found, plain = (by_covariances(record(measured, q), ASKED).modes for q in (THREE, ALL))
    error = (np.abs(found.shapes) - np.abs(truth)) / found.shapes_sd
    assert np.abs(error).max() < 5.0
    assert np.exp(np.abs(np.log(found.shapes_sd / plain.shapes_sd)).mean()) < 2.0


def test_movements_of_converted_shapes_are_derivatives(measured):
    values = record(measured, THREE).values[:, ::4]
    before = scatter_of_order(covariance_driven(values, 4.0 * FINE_S * COARSE, range(4), 10, 8), 8)
    orders, step = np.array([1.0, 2.0, 0.0, 2.0]), 1e-6
    after = before.in_one_quantity(orders)
    assert isinstance(after, PoleScatter)
    ends = [
        (before.found.shapes + side * before.shapes[2])
        / (before.found.poles + side * before.poles[2]) ** orders[:, None]
        for side in (step, -step)
    ]
    assert (ends[0] - ends[1]) / (2.0 * step) == pytest.approx(after.shapes[2], rel=1e-6, abs=1e-12)
    same = moved_in_one_quantity(before.found.shapes, before.shapes, before.found.poles, before.poles, np.zeros(4))
    assert same is before.shapes


@pytest.mark.quick(0)
@pytest.mark.parametrize("quantity", ["strain", "unknown", "displacement"])
def test_records_of_one_quantity_are_not_converted(measured, quantity):
    plain = by_covariances(record(measured, ALL), ASKED).modes
    values = record(measured, ALL).values
    other = TimeSeries(values, tuple(Channel(d, quantity) for d in DOFS), 100.0)
    assert (by_covariances(other, ASKED).modes.shapes == plain.shapes).all()


@pytest.mark.parametrize("method", OUTPUT_ONLY)
@pytest.mark.parametrize(
    ("name", "quantities", "units"),
    [
        ("identify.mixed-quantities", ("acceleration", "strain", "velocity", "acceleration"), ("",) * 4),
        ("identify.mixed-quantities, unknown", ("acceleration", "unknown", "velocity", "velocity"), ("",) * 4),
        ("identify.mixed-quantities, units", VELOCITIES, ("m/s2", "mm/s", "m/s2", "mm/s")),
    ],
)
def test_quantities_that_cannot_be_converted_are_refused(measured, method, name, quantities, units):
    with pytest.raises(FemtuneError) as caught:
        OUTPUT_ONLY[method].load()(record(measured, quantities, units), ASKED)
    check_shown(name, caught.value)


def test_turning_channels_have_another_unit(measured):
    units = ("m/s2", "rad/s", "m/s2", "rad/s")
    channels = tuple(
        Channel(Dof(i + 1, "RZ" if u.startswith("rad") else "X"), q, u)
        for i, (q, u) in enumerate(zip(VELOCITIES, units))
    )
    made = TimeSeries(record(measured, VELOCITIES).values, channels, 100.0)
    assert len(OUTPUT_ONLY["FDD"].load()(made, ASKED).modes) == 4


def test_rigid_motions_are_of_one_quantity(measured):
    rows = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0], [1.0, 3.0]])
    to = DofSet([Dof(1, "X"), Dof(1, "RZ")])
    assert to_rigid_motion(record(measured, ALL), rows, to)[0].channels[1].quantity == "acceleration"
    with pytest.raises(FemtuneError) as caught:
        to_rigid_motion(record(measured, VELOCITIES), rows, to)
    check_shown("identify.rigid-motion, quantities", caught.value)
