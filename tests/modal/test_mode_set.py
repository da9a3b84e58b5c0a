"""ModeSet: sizes, values, selection."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import ModeSet

_DOFS = DofSet.parse(["1X+", "1Y+", "2X-"])


def _modes(**facts: Any) -> ModeSet:
    given = {
        "freq_hz": np.array([1.0, 2.0]),
        "shapes": np.array([[1.0, 2.0], [3.0, np.nan], [5.0, 6.0]]),
        "dofs": _DOFS,
        "labels": ("1", "4a"),
        "damping_ratio": np.array([0.01, 0.02]),
        "freq_sd_hz": np.array([0.1, 0.2]),
        "shapes_sd": np.full((3, 2), 0.5),
    }
    return ModeSet(**(given | facts))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("facts", "code"),
    [
        ({"shapes": np.ones((2, 3))}, "modes.shape"),
        ({"freq_hz": np.ones((2, 1))}, "modes.shape"),
        ({"labels": ("1",)}, "modes.shape"),
        ({"damping_ratio": np.ones(3)}, "modes.shape"),
        ({"freq_sd_hz": np.ones(1)}, "modes.shape"),
        ({"shapes_sd": np.ones((3, 1))}, "modes.shape"),
        ({"normalisation": "mas"}, "modes.normalisation"),
        ({"freq_hz": np.array([1.0, -2.0])}, "modes.values"),
        ({"freq_hz": np.array([np.nan, 2.0])}, "modes.values"),
        ({"shapes": np.full((3, 2), np.inf)}, "modes.values"),
        ({"freq_sd_hz": np.array([0.1, -0.1])}, "modes.values"),
        ({"shapes_sd": np.full((3, 2), np.inf)}, "modes.values"),
        ({"damping_sd": np.ones(3)}, "modes.shape"),
        ({"damping_sd": np.array([0.1, -0.1])}, "modes.values"),
        ({"covariance": np.eye(2)}, "modes.shape"),
        ({"covariance": np.triu(np.ones((4, 4)))}, "modes.values"),
        ({"covariance": np.eye(4)}, "modes.values"),
        ({"modal_a": np.array([1.0, 0.0])}, "modes.values"),
    ],
)
def test_what_does_not_fit_is_refused(facts: dict[str, Any], code: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        _modes(**facts)
    assert caught.value.code == code


def test_a_bad_frequency_is_named_by_its_mode() -> None:
    with pytest.raises(FemtuneError) as caught:
        _modes(freq_hz=np.array([1.0, -2.0]))
    assert caught.value.values == {"4a": -2.0}


def test_labels_count_where_none_are_given() -> None:
    assert _modes(labels=()).labels == ("1", "2")


def test_eigenvalues_are_squares_of_circular_frequencies() -> None:
    modes = _modes(freq_hz=[1.0, 0.5])
    np.testing.assert_allclose(modes.omega_rad_s, [2 * np.pi, np.pi])
    np.testing.assert_allclose(modes.eigenvalues, [4 * np.pi**2, np.pi**2])


@pytest.mark.parametrize("keep", [[1, 0, 1], np.array([1, 0, 1])])
def test_modes_are_selected_in_the_order_asked_for(keep: Any) -> None:
    some = _modes().select_modes(keep)
    assert some.labels == ("4a", "1", "4a")
    np.testing.assert_array_equal(some.freq_hz, [2.0, 1.0, 2.0])
    np.testing.assert_array_equal(some.shapes[0], [2.0, 1.0, 2.0])
    assert some.damping_ratio is not None
    np.testing.assert_array_equal(some.damping_ratio, [0.02, 0.01, 0.02])
    assert some.shapes_sd is not None
    assert some.shapes_sd.shape == (3, 3)


@pytest.mark.parametrize("mask", [[False, True], np.array([False, True])])
def test_a_mask_selects_where_it_is_true(mask: Any) -> None:
    assert _modes().select_modes(mask).labels == ("4a",)


def test_no_modes_at_all_is_a_mode_set() -> None:
    assert len(_modes().select_modes([])) == 0


def test_rows_follow_the_signs_of_the_dofs() -> None:
    turned = _modes().select_dofs(DofSet.parse(["2X+", "1X+"]))
    np.testing.assert_array_equal(turned.shapes, [[-5.0, -6.0], [1.0, 2.0]])
    assert turned.dofs.labels() == ["2X+", "1X+"]
    assert turned.shapes_sd is not None
    np.testing.assert_array_equal(turned.shapes_sd, 0.5)


def test_a_dof_that_is_not_there_is_an_error() -> None:
    with pytest.raises(FemtuneError, match="DOFs are not in") as caught:
        _modes().select_dofs(DofSet.parse(["9Z+"]))
    assert caught.value.code == "dof.missing"


def test_complex_shapes_stay_complex() -> None:
    assert _modes(shapes=np.ones((3, 2)) * 1j).shapes.dtype == complex


def test_arrays_are_read_only_and_the_giver_keeps_his() -> None:
    mine = np.array([1.0, 2.0])
    modes = _modes(freq_hz=mine)
    with pytest.raises(ValueError, match="read-only"):
        modes.freq_hz[0] = 3.0
    mine[0] = 1.5


def test_covariance_and_scales_go_with_the_modes() -> None:
    variances = np.diag([0.01, 0.04, 1e-4, 4e-4])
    some = _modes(covariance=variances, damping_sd=[0.01, 0.02], modal_a=[1j, 2j]).select_modes([1])
    np.testing.assert_array_equal(some.covariance, np.diag([0.04, 4e-4]))
    np.testing.assert_array_equal(some.damping_sd, [0.02])
    np.testing.assert_array_equal(some.modal_a, [2j])
