"""A test in other units, other axes, other node numbers; against hand-calculated values."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.dofs import DofSet, parse_dof
from femtune.errors import FemtuneError
from femtune.modal import FrfSet, ModeSet
from femtune.testdata import ModalTest, WireFrame, convert_units, place, renumber, sensors_at
from femtune.units import SI, unit_system

MM_T = unit_system("mm-t-s")
QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def a_test(normalisation: str = "mass") -> ModalTest:
    frame = WireFrame(np.array([1, 2]), np.array([[0.0, 0, 0], [1.5, 0, 2.0]]), lines=((1, 2),))
    dofs = DofSet.parse(["1Z+", "2X-", "2RY+"])
    shapes = np.array([[1.0], [2.0], [3.0]])
    modes = ModeSet(np.array([5.0]), shapes, dofs, normalisation=normalisation)
    frfs = FrfSet(np.array([1.0, 2.0]), np.ones((3, 2, 2), complex), dofs, DofSet.parse(["1Z-", "2RY+"]), "accelerance")
    return ModalTest("a", SI, frame, sensors_at(frame, dofs), modes, frfs)


def test_metres_to_millimetres_and_tonnes() -> None:
    test = convert_units(a_test(), MM_T)
    assert test.geometry.position(2) == pytest.approx([1500.0, 0.0, 2000.0])
    assert test.sensors[1].position == pytest.approx([1500.0, 0.0, 2000.0])
    assert test.modes is not None
    # 1/√kg = √1000/√t; a rotation of 1 rad/(m √kg) is √1000/1000 rad/(mm √t)
    assert test.modes.shapes[:, 0] == pytest.approx(np.sqrt(1000) * np.array([1.0, 2.0, 3.0e-3]))


def test_kinetic_energy_does_not_depend_on_units() -> None:
    """φᵀMφ = 1 in both systems: a point mass of 4 kg at a tip that turns with inertia 0.5 kg m²."""
    shape = np.array([0.0, 0.3, 0.0])
    shape[2] = np.sqrt((1 - 4 * 0.3**2) / 0.5)
    test = a_test()
    assert test.modes is not None
    modes = ModeSet(test.modes.freq_hz, shape[:, None], test.modes.dofs, normalisation="mass")
    new = convert_units(ModalTest("a", SI, modes=modes), MM_T).modes
    assert new is not None
    mass, inertia = 4e-3, 0.5e-3 * 1e6
    assert mass * new.shapes[1, 0] ** 2 + inertia * new.shapes[2, 0] ** 2 == pytest.approx(1.0)


def test_unscaled_translations_keep_their_numbers() -> None:
    modes = convert_units(a_test("unknown"), MM_T).modes
    assert modes is not None
    assert modes.shapes[:, 0] == pytest.approx([1.0, 2.0, 3.0e-3])


def test_frf_units() -> None:
    frfs = convert_units(a_test(), unit_system("mm-kg-s")).frfs
    assert frfs is not None
    # 1 m/s²/N = 1000 mm/s² / 1000 mN; rad/s²/N = 1e-3 rad/s²/mN; per moment another 1e-3
    assert frfs.values[:, 0, 0] == pytest.approx([1.0, 1.0, 1e-3])
    assert frfs.values[:, 1, 0] == pytest.approx([1e-3, 1e-3, 1e-6])


def test_there_and_back() -> None:
    start = a_test()
    end = convert_units(convert_units(start, unit_system("in-slinch-s")), SI)
    assert start.modes is not None
    assert end.modes is not None
    assert end.modes.shapes == pytest.approx(start.modes.shapes, rel=1e-13)
    assert end.geometry.coordinates == pytest.approx(start.geometry.coordinates, rel=1e-13)


def test_place_turns_positions_and_directions() -> None:
    test = place(a_test(), QUARTER_TURN, [10.0, 0.0, 0.0])
    assert test.geometry.position(2) == pytest.approx([10.0, 1.5, 2.0])
    directions = {str(s.label): s.direction for s in test.sensors}
    assert directions["1Z+"] == pytest.approx([0, 0, 1])
    assert directions["2X-"] == pytest.approx([0, -1, 0])
    assert directions["2RY+"] == pytest.approx([-1, 0, 0])
    assert test.geometry.direction(parse_dof("2X+")) == pytest.approx([0, 1, 0])


def test_mirrored_frame_turns_rotations_round() -> None:
    mirror = np.diag([1.0, -1.0, 1.0])
    with pytest.raises(FemtuneError) as caught:
        place(a_test(), mirror, np.zeros(3))
    assert caught.value.code == "test.mirrored"
    directions = {str(s.label): s.direction for s in place(a_test(), mirror, np.zeros(3), allow_mirrored=True).sensors}
    assert directions["2X-"] == pytest.approx([-1, 0, 0])
    # seen in a mirror across y, a turn about y keeps its sense
    assert directions["2RY+"] == pytest.approx([0, 1, 0])


@pytest.mark.parametrize("rotation", [np.eye(3) * 1.01, np.ones((3, 3)), np.full((3, 3), np.nan), np.eye(2)])
def test_refuses_what_is_no_rotation(rotation: np.ndarray) -> None:
    with pytest.raises(FemtuneError) as caught:
        place(a_test(), rotation, np.zeros(3))
    assert caught.value.code == "test.rotation"


def test_renumber() -> None:
    test = renumber(a_test(), {2: 1012})
    assert test.modes is not None
    assert test.modes.dofs.labels() == ["1Z+", "1012X-", "1012RY+"]
    assert test.geometry.lines == ((1, 1012),)
    with pytest.raises(FemtuneError):
        renumber(a_test(), {2: 1})


def test_a_modal_scale_goes_with_units() -> None:
    """ψψᵀ/a is a receptance: 1 m/N is 1000 mm/N whatever the normalisation of the shapes."""
    for normalisation in ("mass", "unit-max"):
        modes = ModeSet([1.0], [[2.0]], DofSet.parse(["1X+"]), normalisation=normalisation, modal_a=[4j])  # type: ignore[arg-type]
        moved = convert_units(ModalTest("one", SI, modes=modes), unit_system("mm-t-s")).modes
        assert moved is not None
        assert moved.modal_a is not None
        np.testing.assert_allclose(moved.shapes[0, 0] ** 2 / moved.modal_a[0], 1000.0 * 4.0 / 4j)
