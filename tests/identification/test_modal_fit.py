"""The modal fit: exact without noise, derivatives by differences, error bars by the scatter of many seeds."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.identification import (
    as_modes,
    driving_points,
    fit_modes,
    scaled_shapes,
    subspace,
    subspace_poles,
)
from femtune.identification.modal_solve import modal_basis, solve_residues
from femtune.identification.shapes import fit_remarks
from femtune.modal import FrfSet, ModeSet, pole_of

_LINES = np.linspace(5.0, 30.0, 300)
_NOISE = 0.02


def _start(frfs: FrfSet, order: int) -> np.ndarray:
    poles = subspace_poles(subspace(frfs, order), order)[0]
    return poles[poles.imag > 0]


def test_slopes_of_the_basis() -> None:
    poles = pole_of(np.array([10.0, 17.0]), np.array([0.02, 0.1]))
    slopes = modal_basis(_LINES, poles, "mobility").slopes
    h = 1e-4
    for part, move in enumerate((h, 1j * h)):
        sides = [modal_basis(_LINES, poles + sign * move, "mobility").columns[:, :4] for sign in (1, -1)]
        np.testing.assert_allclose(
            slopes[:, 4 * part : 4 * part + 4], (sides[0] - sides[1]) / (2 * h), rtol=1e-6, atol=1e-9
        )


def test_the_gradient_is_that_of_the_squares(three_modes: Any) -> None:
    frfs = three_modes.frfs(_LINES, noise=0.05)
    poles = pole_of(three_modes.freq_hz * 1.002, three_modes.damping_ratio * 1.1)
    values = frfs.values.reshape(3, -1)
    weights = np.ones(values.shape) / np.array([[1.0], [2.0], [0.5]])

    def cost(p: np.ndarray) -> float:
        return float(
            np.sum(solve_residues(values, modal_basis(_LINES, p, frfs.kind), weights, len(p)).squares * [1, 0.25, 4])
        )

    gradient = solve_residues(values, modal_basis(_LINES, poles, frfs.kind), weights, len(poles)).gradient
    for j, move in enumerate([*1e-4 * np.eye(3), *1e-4j * np.eye(3)]):
        assert -2.0 * gradient[j] == pytest.approx((cost(poles + move) - cost(poles - move)) / 2e-4, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["receptance", "mobility", "accelerance"])
def test_a_fit_without_noise_is_exact(eight_modes: Any, kind: str) -> None:
    frfs = eight_modes.frfs(np.linspace(5.0, 62.0, 1000), kind=kind)
    start = pole_of(eight_modes.freq_hz * 1.0003, eight_modes.damping_ratio * 1.2)
    fit = fit_modes(frfs, start)
    assert fit.converged
    modes = as_modes(fit)
    np.testing.assert_allclose(modes.freq_hz, eight_modes.freq_hz, rtol=1e-7)
    np.testing.assert_allclose(modes.damping_ratio, eight_modes.damping_ratio, rtol=1e-5)
    _same_shapes(modes, eight_modes.shapes, 1e-5)
    assert modes.normalisation == "mass"
    np.testing.assert_allclose(fit.terms, 0.0, atol=1e-4 * np.abs(fit.residues).max())


def _same_shapes(modes: ModeSet, wanted: np.ndarray, rtol: float) -> None:
    sign = np.sign(np.sum(modes.shapes * wanted, axis=0))
    np.testing.assert_allclose(modes.shapes * sign, wanted, atol=rtol * np.abs(wanted).max())


def test_shapes_and_scale_give_the_residues_back(eight_modes: Any) -> None:
    modes = as_modes(fit_modes(eight_modes.frfs(_LINES * 2.1), pole_of(eight_modes.freq_hz, eight_modes.damping_ratio)))
    fit = fit_modes(eight_modes.frfs(_LINES * 2.1), pole_of(eight_modes.freq_hz, eight_modes.damping_ratio))
    assert modes.modal_a is not None
    again = np.einsum("ir,jr,r->ijr", modes.shapes, modes.shapes[list(eight_modes.inputs)], 1.0 / modes.modal_a)
    np.testing.assert_allclose(again, fit.residues, atol=1e-5 * np.abs(fit.residues).max())


def test_poles_that_change_places_are_put_in_order(eight_modes: Any) -> None:
    start = pole_of(eight_modes.freq_hz, eight_modes.damping_ratio)
    start[[2, 3]] = pole_of(np.array([25.2, 25.09]), np.array([0.001, 0.01]))
    fit = fit_modes(eight_modes.frfs(np.linspace(5.0, 62.0, 1000)), start)
    assert (np.diff(np.abs(fit.poles)) > 0.0).all()
    np.testing.assert_allclose(as_modes(fit).freq_hz, eight_modes.freq_hz, rtol=1e-6)


def test_without_a_driving_point_the_largest_entry_is_one(three_modes: Any) -> None:
    frfs = three_modes.frfs(_LINES, noise=1e-3)
    rest = FrfSet(_LINES, frfs.values[1:], frfs.responses.select([1, 2]), frfs.references, frfs.kind)
    modes = as_modes(fit_modes(rest, _start(rest, 6)))
    assert (modes.normalisation, modes.modal_a) == ("unit-max", None)
    np.testing.assert_allclose(np.abs(modes.shapes).max(axis=0), 1.0)
    assert modes.shapes_sd is not None
    np.testing.assert_allclose(modes.shapes_sd[np.abs(modes.shapes) == 1.0], 0.0, atol=1e-9)


def test_a_reference_of_opposite_sign_is_the_same_driving_point(three_modes: Any) -> None:
    frfs = three_modes.frfs(_LINES)
    turned = FrfSet(_LINES, -frfs.values, frfs.responses, DofSet.parse(["1Z-"]), frfs.kind)
    _same_shapes(as_modes(fit_modes(turned, _start(turned, 6))), three_modes.shapes, 1e-6)
    wrong = FrfSet(_LINES, -frfs.values, frfs.responses, frfs.references, frfs.kind)
    fit = fit_modes(wrong, _start(wrong, 6))
    notices = [r.notice for r in fit_remarks(fit, scaled_shapes(fit, driving_points(wrong)))]
    assert [n.code for n in notices] == ["identify.driving-point-sign"] * 3


def test_a_mode_with_its_node_at_the_driving_point_has_no_sign_there(three_modes: Any) -> None:
    """Noise alone makes its residue there negative in many tests; a sensor of the wrong sign is still told."""
    shapes = three_modes.shapes.copy()
    shapes[0, 2] = 0.003
    quiet = dataclasses.replace(three_modes, shapes=shapes)
    start, negative = pole_of(quiet.freq_hz, quiet.damping_ratio), 0
    for seed in range(12):
        frfs = quiet.frfs(_LINES, noise=0.005, seed=seed)
        fit = fit_modes(frfs, start)
        negative += int((fit.residues[0, 0, 2] * 2j * fit.poles[2].imag).real < 0.0)
        codes = [r.notice.code for r in fit_remarks(fit, scaled_shapes(fit, driving_points(frfs)))]
        assert "identify.driving-point-sign" not in codes
        wrong = dataclasses.replace(frfs, values=frfs.values * np.array([-1.0, 1.0, 1.0])[:, None, None])
        fit = fit_modes(wrong, start)
        remarks = fit_remarks(fit, scaled_shapes(fit, driving_points(wrong)))
        assert [r.mode for r in remarks if r.notice.code == "identify.driving-point-sign"] == [0, 1]
    assert negative >= 2


def test_two_modes_taken_for_one_are_told(eight_modes: Any) -> None:
    frfs = eight_modes.frfs(_LINES * 2.1)
    fit = fit_modes(frfs, pole_of(np.delete(eight_modes.freq_hz, 3), np.delete(eight_modes.damping_ratio, 3)))
    notices = [r.notice for r in fit_remarks(fit, scaled_shapes(fit, driving_points(frfs)))]
    assert any(n.code == "identify.references-disagree" and "25" in n.what for n in notices)


@pytest.mark.parametrize(("second", "told"), [(0.0, False), (0.2, True)])
def test_a_repeated_mode_that_the_references_excite_little_is_told(second: float, told: bool) -> None:
    """Two modes at 25 Hz, whose residues have singular values in the ratio of 1 to 0.2; one of them is fitted."""
    rng = np.random.default_rng(8)
    left, right = np.linalg.qr(rng.standard_normal((6, 2)))[0], np.linalg.qr(rng.standard_normal((2, 2)))[0]
    residue = left @ np.diag([1.0, second]) @ right.T
    lines, pole = np.linspace(15.0, 40.0, 400), pole_of(np.array([25.0]), np.array([0.01]))
    s = 2j * np.pi * lines
    values = 1j * residue[:, :, None] * (1.0 / (s - pole[0]) - 1.0 / (s - pole[0].conj())) * s**2
    values = values + 1e-3 * np.abs(values).max() * (
        rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape)
    )
    frfs = FrfSet(
        lines, values, DofSet.parse([f"{i}Z+" for i in range(1, 7)]), DofSet.parse(["7Z+", "8Z+"]), "accelerance"
    )
    fit = fit_modes(frfs, pole)
    codes = [r.notice.code for r in fit_remarks(fit, scaled_shapes(fit, driving_points(frfs)))]
    assert ("identify.references-disagree" in codes) == told


def test_nothing_to_fit(three_modes: Any) -> None:
    with pytest.raises(FemtuneError) as caught:
        fit_modes(three_modes.frfs(_LINES), np.zeros(0, complex))
    assert caught.value.code == "identify.no-poles"
    with pytest.raises(FemtuneError) as caught:
        fit_modes(three_modes.frfs(_LINES[:4]), pole_of(three_modes.freq_hz, three_modes.damping_ratio))
    assert caught.value.code == "identify.few-lines"


def test_errors_that_are_no_noise_raise_the_covariance(three_modes: Any) -> None:
    """With one mode left out, what is left is far above the stated noise, and the bars say so."""
    frfs = three_modes.frfs(_LINES, noise=1e-3)
    sd = np.full(frfs.values.shape, 1e-3 * np.sqrt(np.mean(np.abs(frfs.values) ** 2)))
    whole, part = (fit_modes(frfs, pole_of(f, np.full(len(f), 0.01)), sd) for f in ([10.0, 11.0, 20.0], [10.0, 20.0]))
    assert whole.misfit == pytest.approx(1.0, abs=0.1)
    assert part.misfit > 100.0
    assert np.sqrt(part.pole_covariance[0, 0]) > 3.0 * np.sqrt(whole.pole_covariance[0, 0])


@pytest.mark.slow
def test_the_misfit_is_the_square_of_how_much_too_small_the_stated_deviations_are(three_modes: Any) -> None:
    """Half of what they are: 4 in the mean of 40 seeds, where parameters take a third of the values' freedom."""
    lines = np.linspace(7.0, 24.0, 16)
    sd = np.full((3, 1, 16), 0.01 * np.sqrt(np.mean(np.abs(three_modes.frfs(lines).values) ** 2)))
    start = pole_of(three_modes.freq_hz, three_modes.damping_ratio)
    found = [fit_modes(three_modes.frfs(lines, 0.02, seed), start, sd).misfit for seed in range(40)]
    assert np.mean(found) == pytest.approx(4.0, rel=0.1)


def test_the_spread_is_that_of_fits_of_each_function_alone(three_modes: Any) -> None:
    """Birge's ratio of poles and their covariances, with two real numbers a pole."""
    known = dataclasses.replace(three_modes, freq_hz=[10.0], damping_ratio=[0.01], shapes=three_modes.shapes[:, :1])
    parts = [dataclasses.replace(known, freq_hz=[f]).frfs(_LINES) for f in (10.0, 10.004, 9.997)]
    values = np.concatenate([f.values[[i]] for i, f in enumerate(parts)])
    frfs = dataclasses.replace(parts[0], values=values)
    sd, start = np.full(values.shape, 0.002 * np.abs(values).max()), pole_of(np.array([10.0]), np.array([0.01]))
    fit = fit_modes(frfs, start, sd)
    ratio = 0.0
    for i in range(3):
        one = FrfSet(_LINES, values[[i]], frfs.responses.select([i]), frfs.references, frfs.kind)
        alone = fit_modes(one, start, sd[[i]])
        gap = (alone.poles - fit.poles)[0]
        ratio += np.array([gap.real, gap.imag]) @ np.linalg.solve(alone.pole_covariance, [gap.real, gap.imag])
        assert alone.spread.tolist() == [1.0]
    assert fit.spread[0] > 3.0
    assert fit.spread[0] == pytest.approx(ratio / (2 * (3 - 1)), rel=0.02)


def test_the_covariance_of_the_poles_goes_on_to_frequencies_damping_and_scale(three_modes: Any) -> None:
    """Slopes by differences; α² = 2ω_d|R| for a mass-normalised shape, so that its error is that of ω_d by half."""
    fit = fit_modes(three_modes.frfs(_LINES, noise=0.02), pole_of(three_modes.freq_hz, three_modes.damping_ratio))
    made, h = as_modes(fit), 1e-4
    slopes = []
    for move in [*h * np.eye(3), *1j * h * np.eye(3)]:
        ends = [
            np.concatenate([np.abs(p) / (2 * np.pi), -p.real / np.abs(p)]) for p in (fit.poles + move, fit.poles - move)
        ]
        slopes.append((ends[0] - ends[1]) / (2 * h))
    J = np.array(slopes).T
    np.testing.assert_allclose(made.covariance, J @ fit.pole_covariance @ J.T, rtol=1e-5, atol=1e-16)
    sd = np.array([3.0, 2.0, 5.0, 0.1, 0.2, 0.3])
    only_poles = dataclasses.replace(
        fit, pole_covariance=np.diag(sd**2), own_covariance=0.0 * fit.own_covariance, pole_effect=0.0 * fit.pole_effect
    )
    expected = np.abs(made.shapes) * 0.5 * sd[3:] / fit.poles.imag
    np.testing.assert_allclose(as_modes(only_poles).shapes_sd, expected, rtol=1e-5)


def test_functions_that_disagree_on_a_frequency_widen_its_bar(three_modes: Any) -> None:
    """One function of a structure whose second mode has moved by 0.5 %, as between hits of a hammer."""
    frfs = three_modes.frfs(_LINES, noise=0.01)
    moved = dataclasses.replace(three_modes, freq_hz=np.array([10.0, 11.055, 20.0])).frfs(_LINES, noise=0.01)
    values = frfs.values.copy()
    values[2] = moved.values[2]
    fits = [
        fit_modes(f, _start(frfs, 6))
        for f in (frfs, FrfSet(_LINES, values, frfs.responses, frfs.references, frfs.kind))
    ]
    np.testing.assert_array_equal(fits[0].spread, 1.0)
    assert fits[1].spread[1] > 10.0
    assert fits[1].spread[2] < 4.0
    told = [r.notice for r in fit_remarks(fits[1], scaled_shapes(fits[1]))]
    assert any(n.code == "identify.functions-disagree" and " 11" in n.what for n in told)


def _z_scores(known: Any, seeds: range, told: bool) -> np.ndarray:
    """Errors by their standard deviations: of frequencies, damping ratios and entries of shapes, a row a seed."""
    rows = []
    clean = known.frfs(_LINES)
    sd = np.full(clean.values.shape, _NOISE * np.sqrt(np.mean(np.abs(clean.values) ** 2))) if told else None
    for seed in seeds:
        frfs = known.frfs(_LINES, _NOISE, seed)
        modes = as_modes(fit_modes(frfs, _start(frfs, 6), sd))
        assert modes.freq_sd_hz is not None
        assert modes.damping_sd is not None
        sign = np.sign(np.sum(modes.shapes * known.shapes, axis=0))
        freq = (modes.freq_hz - known.freq_hz) / modes.freq_sd_hz
        damping = (modes.damping_ratio - known.damping_ratio) / modes.damping_sd
        shapes = (modes.shapes * sign - known.shapes) / modes.shapes_sd
        rows.append(np.concatenate([freq, damping, shapes.ravel()]))
    return np.array(rows)


@pytest.mark.long
@pytest.mark.parametrize("told", [False, True], ids=["noise from the fit", "noise told"])
def test_intervals_cover(three_modes: Any, told: bool) -> None:
    """200 seeds: a coverage of 95 % scatters by 1.5 % in each quantity, by about 0.6 % in the mean of all."""
    inside = np.abs(_z_scores(three_modes, range(200), told)) < 1.96
    assert inside.mean(axis=0).min() > 0.89
    assert inside.mean() == pytest.approx(0.95, abs=0.02)


@pytest.mark.long
@pytest.mark.parametrize("told", [False, True], ids=["noise from the fit", "noise told"])
def test_intervals_cover_over_1000_seeds(three_modes: Any, told: bool) -> None:
    scores = _z_scores(three_modes, range(1000), told)
    coverage = (np.abs(scores) < 1.96).mean(axis=0)
    assert coverage.min() > 0.93
    assert coverage.max() < 0.97
