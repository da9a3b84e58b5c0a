"""State-space models of given poles: exact where they can be, near where residual modes stand for others."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.identification import (
    fit_quality,
    fit_system,
    in_band,
    join_frfs,
    residual_poles,
    stable_poles,
    with_rigid_body,
    without_rigid_body,
)
from femtune.modal import FrfSet, ModeSet, as_kind, pole_of
from femtune.modal.frf_set import KINDS

_LINES = np.linspace(5.0, 62.0, 700)


def _poles(known: Any) -> np.ndarray:
    return pole_of(known.freq_hz, known.damping_ratio)


@pytest.mark.parametrize("reciprocal", [False, True])
@pytest.mark.parametrize("kind", ["receptance", "mobility"])
def test_receptance_and_mobility_are_exact(eight_modes: Any, kind: str, reciprocal: bool) -> None:
    frfs = eight_modes.frfs(_LINES, kind=kind)
    system = fit_system(frfs, _poles(eight_modes), direct=False, reciprocal=reciprocal)
    assert system.order == 16
    np.testing.assert_allclose(system.frf(_LINES).values, frfs.values, atol=1e-5 * np.abs(frfs.values).max())


def test_accelerance_of_a_whole_structure_is_exact_with_a_direct_term(eight_modes: Any) -> None:
    """s²R/(s−λ) and its conjugate sum to a direct term 2 Re Rλ, no term in s, where R is imaginary as of real modes."""
    frfs = eight_modes.frfs(_LINES)
    system = fit_system(frfs, _poles(eight_modes))
    np.testing.assert_allclose(system.frf(_LINES).values, frfs.values, atol=1e-6 * np.abs(frfs.values).max())
    assert fit_quality(system.frf(_LINES), frfs).error.max() < 1e-4


@pytest.mark.parametrize(("kind", "direct"), [("receptance", False), ("receptance", True), ("accelerance", True)])
def test_functions_of_one_reference_are_exact(three_modes: Any, kind: str, direct: bool) -> None:
    frfs = three_modes.frfs(_LINES, kind=kind)
    values = frfs.values + (0.5 * np.abs(frfs.values).max() if direct else 0.0)
    system = fit_system(dataclasses.replace(frfs, values=values), _poles(three_modes), direct=direct)
    np.testing.assert_allclose(system.frf(_LINES).values, values, atol=1e-9 * np.abs(values).max())


def test_a_reciprocal_model_is_reciprocal_under_noise(eight_modes: Any) -> None:
    frfs = eight_modes.frfs(_LINES, noise=0.1)
    free, tied = (fit_system(frfs, _poles(eight_modes), reciprocal=r) for r in (False, True))
    gaps = []
    for system in (free, tied):
        values = system.frf(_LINES).values - system.D[:, :, None]
        gaps.append(np.abs(values[0, 1] - values[5, 0]).max() / np.abs(values[5, 0]).max())
    assert gaps[0] > 1e-3
    assert gaps[1] < 1e-9


@pytest.mark.slow
def test_residual_modes_stand_for_what_lies_outside(eight_modes: Any) -> None:
    """Three modes of the band 10 to 30 Hz: functions are off by 0.1 % with residual modes, by 1 without."""
    frfs = in_band(eight_modes.frfs(_LINES), 10.0, 30.0)
    inside = _poles(eight_modes)[1:4]
    errors = [
        np.median(fit_quality(fit_system(frfs, p).frf(frfs.freq_hz), frfs).error)
        for p in (inside, np.concatenate([inside, residual_poles((10.0, 30.0), 1, 3)]))
    ]
    assert errors[1] < 0.005
    assert errors[0] > 5.0 * errors[1]


def test_further_bands_and_channels(eight_modes: Any) -> None:
    """Six responses in one band, all in another: B, C and D use each value there is."""
    frfs = eight_modes.frfs(_LINES)
    first = in_band(frfs, 20.0, 62.0)
    some = FrfSet(first.freq_hz, first.values[:6], frfs.responses.select(range(6)), frfs.references, frfs.kind)
    whole = join_frfs([some, in_band(frfs, 5.0, 40.0)])
    assert np.isnan(whole.values).any()
    assert whole.values.shape == frfs.values.shape
    system = fit_system(whole, _poles(eight_modes))
    np.testing.assert_allclose(system.frf(_LINES).values, frfs.values, atol=1e-5 * np.abs(frfs.values).max())


def test_lines_that_differ_by_rounding_are_one(three_modes: Any) -> None:
    """4 + 0.02 k and 14 + 0.1 k give 14.2 Hz with other last bits."""
    fine, coarse = 4.0 + 0.02 * np.arange(600), 14.0 + 0.1 * np.arange(60)
    whole = join_frfs([three_modes.frfs(fine), three_modes.frfs(coarse)])
    assert len(np.intersect1d(fine, coarse)) < 20
    assert len(whole.freq_hz) == 600 + 60 - 20
    assert np.isfinite(whole.values).all()


def test_joined_functions_take_the_signs_of_the_first(three_modes: Any) -> None:
    frfs = three_modes.frfs(_LINES)
    turned = FrfSet(_LINES, -frfs.values, DofSet.parse(["1Z-", "2Z-", "3Z-"]), frfs.references, frfs.kind)
    np.testing.assert_array_equal(join_frfs([frfs, turned]).values, frfs.values)
    np.testing.assert_array_equal(join_frfs([turned, frfs]).values, -frfs.values)
    with pytest.raises(FemtuneError) as caught:
        join_frfs([frfs, as_kind(frfs, "receptance")])
    assert caught.value.code == "identify.kinds-differ"


@pytest.mark.parametrize("kind", ["receptance", "mobility", "accelerance"])
def test_rigid_motion_is_taken_away_and_put_back(eight_modes: Any, kind: str) -> None:
    mass, inertia = 4.0, 0.5
    arm = np.linspace(-1.0, 1.0, 12)
    shapes = np.column_stack([np.full(12, mass**-0.5), arm * inertia**-0.5])
    rigid = ModeSet(np.zeros(2), shapes, eight_modes.dofs, normalisation="mass")
    elastic = eight_modes.frfs(_LINES, kind=kind)
    i_omega = 2j * np.pi * _LINES
    moved = (shapes @ shapes[list(eight_modes.inputs)].T)[:, :, None] * i_omega ** (KINDS.index(kind) - 2)
    whole = dataclasses.replace(elastic, values=elastic.values + moved)
    np.testing.assert_allclose(without_rigid_body(whole, rigid).values, elastic.values, atol=1e-9 * abs(moved).max())
    system = with_rigid_body(fit_system(without_rigid_body(whole, rigid), _poles(eight_modes)), rigid)
    np.testing.assert_allclose(system.frf(_LINES).values, whole.values, atol=1e-5 * np.abs(whole.values).max())


def test_rigid_modes_without_a_scale_are_refused(three_modes: Any) -> None:
    rigid = ModeSet(np.zeros(1), np.ones((3, 1)), three_modes.dofs)
    with pytest.raises(FemtuneError) as caught:
        without_rigid_body(three_modes.frfs(_LINES), rigid)
    assert caught.value.code == "identify.rigid-modes"


def test_poor_channels_are_named(eight_modes: Any) -> None:
    frfs = eight_modes.frfs(_LINES)
    values = frfs.values.copy()
    values[7] *= np.exp(1j * np.random.default_rng(0).uniform(-2.0, 2.0, values[7].shape))
    bad = dataclasses.replace(frfs, values=values)
    assert fit_quality(fit_system(bad, _poles(eight_modes)).frf(_LINES), bad).poor() == [7]
    with pytest.raises(FemtuneError) as caught:
        fit_quality(frfs, in_band(frfs, 10.0, 20.0))
    assert caught.value.code == "identify.lines-differ"


def test_stable_poles_are_kept() -> None:
    poles = np.array([-1 + 20j, 1 + 30j, -1 - 20j, -0.1 + 5j, -3 + 0j])
    np.testing.assert_array_equal(stable_poles(poles), [-0.1 + 5j, -1 + 20j])


@pytest.mark.parametrize(
    ("poles", "code"),
    [(np.zeros(0), "identify.no-poles"), (np.array([1.0 + 5.0j]), "identify.unstable-poles")],
)
def test_poles_that_cannot_be_fitted(three_modes: Any, poles: np.ndarray, code: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        fit_system(three_modes.frfs(_LINES), poles)
    assert caught.value.code == code


def test_reciprocity_needs_the_motion_at_the_references(three_modes: Any) -> None:
    frfs = three_modes.frfs(_LINES)
    rest = FrfSet(_LINES, frfs.values[1:], frfs.responses.select([1, 2]), frfs.references, frfs.kind)
    with pytest.raises(FemtuneError) as caught:
        fit_system(rest, _poles(three_modes), reciprocal=True)
    assert caught.value.code == "identify.no-driving-point"


def test_a_response_with_too_few_lines(three_modes: Any) -> None:
    frfs = three_modes.frfs(_LINES)
    values = frfs.values.copy()
    values[2, 0, 3:] = np.nan
    with pytest.raises(FemtuneError) as caught:
        fit_system(dataclasses.replace(frfs, values=values), _poles(three_modes))
    assert caught.value.code == "identify.few-lines"
