"""Modes with damping, modal mass or shapes that no structure has are reported, and others are not."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.identification import driving_points, fit_modes, scaled_shapes
from femtune.identification.mode_checks import (
    LARGE_DAMPING,
    collinearity_remarks,
    damping_remarks,
    mass_remarks,
    quadrature_notices,
)
from femtune.identification.shapes import fit_remarks
from femtune.modal import pole_of

_LINES = np.linspace(4.0, 30.0, 400)


def _fit(known: Any) -> Any:
    return fit_modes(known.frfs(_LINES, 1e-4), pole_of(known.freq_hz, known.damping_ratio), most_steps=0)


def _remarks(known: Any) -> list[tuple[int, str]]:
    fit = _fit(known)
    points = driving_points(fit.measured)
    return [(r.mode, r.notice.code) for r in fit_remarks(fit, scaled_shapes(fit, points)) if r.doubtful]


@pytest.mark.parametrize(("ratio", "name"), [(0.42, "identify.damping"), (-0.012, "identify.damping, negative")])
def test_damping_that_structures_do_not_have_is_reported(three_modes: Any, ratio: float, name: str) -> None:
    assert _remarks(three_modes) == []
    odd = dataclasses.replace(three_modes, damping_ratio=np.array([0.01, 0.015, ratio]))
    assert _remarks(odd) == [(2, "identify.damping")]
    (remark,) = damping_remarks([20.0], np.array([ratio]))
    check_shown(name, remark.notice)


def test_damping_up_to_the_limit_or_unknown_is_not_reported() -> None:
    assert damping_remarks([1.0, 2.0, 3.0], np.array([1e-6, LARGE_DAMPING, np.nan])) == ()
    assert damping_remarks([1.0], None) == ()


@pytest.mark.parametrize("spacing", [0.05, 0.5])
def test_damping_that_is_not_above_zero_is_reported_and_little_damping_is_not(three_modes: Any, spacing: float) -> None:
    """Half bandwidths of 0.1 % are 0.02 to 0.06 Hz; a pole that is not there lies between two lines of 1 % noise."""
    light = dataclasses.replace(three_modes, damping_ratio=np.full(3, 1e-3))
    exact = light.frfs(np.arange(4.0, 32.0, spacing) + 0.3 * spacing)
    error = np.random.default_rng(5).standard_normal((2, *exact.values.shape))
    frfs = dataclasses.replace(exact, values=exact.values * (1.0 + 0.01 * (error[0] + 1j * error[1])))
    poles = pole_of(np.append(light.freq_hz, 10.3), np.append(light.damping_ratio, 1e-6))
    fit = fit_modes(frfs, poles, most_steps=0)
    found = fit_remarks(fit, scaled_shapes(fit, driving_points(frfs)))
    assert [r.mode for r in found if r.notice.code == "identify.damping"] == [1]
    assert {r.mode for r in found if r.doubtful} == {1}


def test_how_damping_that_is_not_above_zero_is_reported() -> None:
    ratio, sd = np.array([6.5e-7, 2.1e-3]), np.array([4.1e-4, 1e-3])
    (remark,) = damping_remarks([142.34, 200.0], ratio, sd)
    check_shown("identify.damping, not above zero", remark.notice)


def test_negative_modal_mass_makes_one_mode_doubtful(three_modes: Any) -> None:
    fit = _fit(three_modes)
    residues = fit.residues.copy()
    residues[:, :, 1] *= -1.0
    fit = dataclasses.replace(fit, residues=residues)
    found = fit_remarks(fit, scaled_shapes(fit, driving_points(fit.measured)))
    assert [(r.mode, r.notice.code, r.doubtful) for r in found] == [(1, "identify.driving-point-sign", True)]
    assert mass_remarks([1.0, 2.0], np.array([np.nan, 0.5])) == ()


def test_a_complex_shape_is_reported_and_is_not_doubtful() -> None:
    (remark,) = collinearity_remarks([5.0, 6.0], [0.95, 0.5], [8.0, 30.0])
    assert (remark.mode, remark.notice.code, remark.doubtful) == (1, "identify.complex-mode", False)


def test_channels_out_of_phase_are_judged_by_their_own_size() -> None:
    """The third channel is small, and in quadrature in all modes; the fourth in the one mode in which it moves."""
    shapes = np.array(
        [[1.0, 0.8, -0.5, 0.9], [0.6, -1.0, 0.7, 0.4], [1e-3j, 2e-3j, -1e-3j, 1e-3j], [0.5j, 1e-3j, 1e-3j, 1e-3j]]
    )
    (notice,) = quadrature_notices(shapes, ["a", "b", "c", "d"])
    assert notice.what.endswith("that of the others: c")


def test_large_damping_that_a_record_determines_is_no_doubt() -> None:
    ratio, sd = np.array([0.15, 0.15, 0.25, 0.103]), np.array([0.003, 0.03, 0.003, 0.002])
    told = [r.mode for r in damping_remarks([1.0, 2.0, 3.0, 4.0], ratio, sd, [True] * 4)]
    # known to a fiftieth; known to a fifth only; above what any mode has; not above the limit by two deviations
    assert told == [1, 2]
    assert [r.mode for r in damping_remarks([1.0, 2.0, 3.0, 4.0], ratio, sd, [False] * 4)] == [0, 1, 2]
    assert [r.mode for r in damping_remarks([1.0, 2.0, 3.0, 4.0], ratio)] == [0, 1, 2, 3]
