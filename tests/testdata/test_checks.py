"""Missing values, impossible frequencies, complex shapes."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.dofs import DofSet, parse_dof
from femtune.errors import FemtuneError
from femtune.modal import ModeSet
from femtune.testdata import (
    ModalTest,
    Sensor,
    WireFrame,
    check_modes,
    check_test,
    mean_phase_deviation_deg,
    phase_collinearity,
    real_modes,
)
from femtune.units import SI

DOFS = DofSet.parse(["1Z+", "2Z+", "3X+"])


def modes(shapes: object, freq: object = (3.0, 7.0)) -> ModeSet:
    return ModeSet(np.array(freq, dtype=float), np.array(shapes), DOFS)


GOOD = [[1.0, 1.0], [0.5, -1.0], [0.1, 0.2]]


def test_good_modes_say_nothing() -> None:
    assert check_modes(modes(GOOD)) == ()


def test_nan_names_mode_and_dof() -> None:
    bad = modes([[1.0, 1.0], [0.5, np.nan], [0.1, 0.2]])
    with pytest.raises(FemtuneError) as caught:
        check_modes(bad)
    assert caught.value.code == "test.nan"
    assert caught.value.values["first"] == "mode 2 at 2Z+"
    assert check_modes(bad, allow_missing=True) == ()


@pytest.mark.parametrize("column", [[0.0, 0.0, 0.0], [np.nan, np.nan, np.nan]])
def test_shape_without_entries(column: list[float]) -> None:
    bad = modes(np.column_stack([[1.0, 2.0, 3.0], column]))
    with pytest.raises(FemtuneError) as caught:
        check_modes(bad, allow_missing=True)
    assert caught.value.code == "test.zero-shape"
    assert "mode 2" in caught.value.what


def test_all_errors_are_shown_together() -> None:
    bad = modes([[0.0, np.nan], [0.0, 1.0], [0.0, 1.0]], freq=(0.0, 2.0))
    with pytest.raises(FemtuneError) as caught:
        check_modes(bad)
    assert all(code in str(caught.value) for code in ("test.nan", "test.zero-shape", "test.frequency"))


def test_order_and_repetition_are_notices() -> None:
    assert [n.code for n in check_modes(modes(GOOD, freq=(7.0, 3.0)))] == ["test.unsorted"]
    assert [n.code for n in check_modes(modes(GOOD, freq=(3.0, 3.0)))] == ["test.repeated-frequency"]


def test_direction_of_sensors() -> None:
    sensor = Sensor(parse_dof("1Z+"), np.zeros(3), np.zeros(3))
    with pytest.raises(FemtuneError) as caught:
        check_test(ModalTest("a", SI, sensors=(sensor,)))
    assert caught.value.code == "test.sensor-direction"
    assert "1Z+" in caught.value.what


def test_two_sensors_of_one_name() -> None:
    one = Sensor(parse_dof("1Z+"), np.zeros(3), np.array([0.0, 0, 1]))
    other = Sensor(parse_dof("1Z-"), np.zeros(3), np.array([0.0, 0, -1]))
    with pytest.raises(FemtuneError) as caught:
        ModalTest("a", SI, sensors=(one, other))
    assert caught.value.code == "test.duplicate-sensor"


def test_phase_collinearity_of_line_circle_and_ellipse() -> None:
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    line = np.array([1.0, -2.0, 0.3]) * np.exp(0.7j)
    assert phase_collinearity(line) == pytest.approx(1.0)
    assert phase_collinearity(np.exp(1j * angles)) == pytest.approx(0.0, abs=1e-12)
    # half-axes 2 and 1: scatter 4 to 1, ((4 - 1)/(4 + 1))²
    ellipse = (2 * np.cos(angles) + 1j * np.sin(angles)) * np.exp(-1.1j)
    assert phase_collinearity(ellipse) == pytest.approx(0.36)


def test_mean_phase_deviation() -> None:
    line = np.array([1.0, -2.0, 0.3]) * np.exp(0.7j)
    assert mean_phase_deviation_deg(line) == pytest.approx(0.0, abs=1e-5)
    fan = np.array([np.exp(0.1j), np.exp(-0.1j), -np.exp(0.1j), -np.exp(-0.1j)]) * np.exp(0.4j)
    assert mean_phase_deviation_deg(fan) == pytest.approx(np.degrees(0.1))


def test_real_modes_finds_the_phase() -> None:
    true = np.array([[1.0, 0.3], [-0.4, 2.0], [0.2, 1.0]])
    found = real_modes(modes(true * np.exp(1j * np.array([0.5, -1.2]))))
    ratio = found.modes.shapes / true
    assert np.abs(ratio) == pytest.approx(np.ones((3, 2)))
    assert np.ptp(ratio, axis=0) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert found.residual == pytest.approx([0.0, 0.0], abs=1e-12)


def test_real_modes_reports_what_is_lost_and_no_phase_is_better() -> None:
    shape = np.array([1.0 + 0.1j, -0.4 + 0.3j, 0.2 - 0.5j])
    found = real_modes(modes(np.column_stack([shape, shape])))
    trial = np.linspace(0, np.pi, 2000)[:, None]
    least = np.linalg.norm((shape * np.exp(-1j * trial)).imag, axis=1).min() / np.linalg.norm(shape)
    assert found.residual[0] == pytest.approx(least, rel=1e-4)


def test_real_shapes_stay() -> None:
    assert real_modes(modes(GOOD)).modes.shapes.tolist() == GOOD


def test_complex_shape_is_reported() -> None:
    circle = np.exp(2j * np.pi * np.arange(3) / 3)
    notices = check_modes(modes(np.column_stack([circle, np.array([1, 2, 3 + 0.01j])])))
    assert [n.code for n in notices] == ["test.complex-shape"]
    assert "mode 1" in notices[0].what


def test_wire_frame_refuses_nonsense() -> None:
    points = np.zeros((2, 3))
    cases = {
        "test.duplicate-node": lambda: WireFrame(np.array([1, 1]), points),
        "test.unknown-node": lambda: WireFrame(np.array([1, 2]), points, lines=((1, 3),)),
        "test.geometry": lambda: WireFrame(np.array([1, 2]), points * np.nan),
    }
    for code, build in cases.items():
        with pytest.raises(FemtuneError) as caught:
            build()
        assert caught.value.code == code
    with pytest.raises(FemtuneError):
        WireFrame(np.array([1, 2]), np.zeros((3, 3)))


def test_arrays_cannot_be_changed() -> None:
    frame = WireFrame(np.array([1]), np.zeros((1, 3)))
    for array in (frame.coordinates, frame.axes, frame.nodes):
        with pytest.raises(ValueError):
            array[0] = 1  # type: ignore[index]


@pytest.mark.parametrize("factor", [1e99, 1e-99])
def test_shapes_beyond_all_sizes(factor: float) -> None:
    with pytest.raises(FemtuneError) as caught:
        check_modes(modes(np.array(GOOD) * [1.0, factor]))
    assert caught.value.code == "test.shape-size"
    assert list(caught.value.values) == ["largest of mode 2"]


def test_the_real_part_keeps_half_of_the_variance_of_a_complex_entry() -> None:
    rng = np.random.default_rng(0)
    noise = 0.01 * (rng.standard_normal((2, 4000)) + 1j * rng.standard_normal((2, 4000))) / np.sqrt(2.0)
    shapes = np.array([[1.0], [-0.7]]) * np.exp(0.4j) + noise
    modes = ModeSet(np.ones(4000), shapes, DofSet.parse(["1X+", "2X+"]), shapes_sd=np.full((2, 4000), 0.01))
    found = real_modes(modes).modes
    assert found.shapes_sd is not None
    turned = found.shapes * np.sign(found.shapes[:1])
    np.testing.assert_allclose(turned.std(axis=1), found.shapes_sd[:, 0], rtol=0.05)
