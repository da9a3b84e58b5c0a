"""Functions to modes and a system in one step."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from tests.identification.conftest import Known
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.identification import InputKnown, equalised_test, identify_frfs
from femtune.identification.input_known import MOST_ORDER, NoModesChosen, largest_order_of
from femtune.modal import ModeSet, mac

_LINES = np.linspace(5.0, 62.0, 600)


@pytest.mark.slow
def test_modes_and_system_come_out(eight_modes: Any) -> None:
    frfs = eight_modes.frfs(_LINES, noise=0.01)
    sd = np.full(frfs.values.shape, 0.01 * np.sqrt(np.mean(np.abs(frfs.values) ** 2)))
    found = identify_frfs(frfs, InputKnown(), sd)
    modes = found.modes
    assert modes.freq_sd_hz is not None
    assert modes.damping_sd is not None
    assert (np.abs(modes.freq_hz - eight_modes.freq_hz) < 4.0 * modes.freq_sd_hz).all()
    assert modes.damping_ratio is not None
    assert (np.abs(modes.damping_ratio - eight_modes.damping_ratio) < 4.0 * modes.damping_sd).all()
    np.testing.assert_allclose(np.diag(mac(modes.shapes, eight_modes.shapes)), 1.0, atol=1e-3)
    assert modes.normalisation == "mass"
    # the noise that was put in is what is left
    clean = eight_modes.frfs(_LINES).values
    gap = found.system.frf(_LINES).values - clean
    assert np.linalg.norm(gap) < 0.2 * np.linalg.norm(frfs.values - clean)
    assert found.fit.converged
    assert {n.code for n in found.notices} <= {"identify.near-miss"}


@pytest.mark.slow
def test_a_response_that_is_zero_has_no_shape(three_modes: Any) -> None:
    frfs = three_modes.frfs(np.linspace(5.0, 30.0, 300), noise=0.005)
    values = frfs.values.copy()
    values[2] = 0.0
    found = identify_frfs(dataclasses.replace(frfs, values=values), InputKnown(largest_order=16))
    np.testing.assert_allclose(found.modes.freq_hz, three_modes.freq_hz, rtol=1e-3)
    assert found.modes.shapes_sd is not None
    assert np.isnan(found.modes.shapes[2]).all()
    assert np.isnan(found.modes.shapes_sd[2]).all()
    assert np.isfinite(np.delete(found.modes.shapes, 2, axis=0)).all()
    assert any(n.code == "frf.dead" and n.what.endswith("3Z+") for n in found.notices)


@pytest.mark.quick(1)
@pytest.mark.parametrize("hum", [False, True])
def test_the_noise_of_a_dead_response_gives_no_mode_and_costs_none(three_modes: Any, hum: bool) -> None:
    """A million times smaller than the others: scaled to their size, a hum of 16 Hz became a mode, noise hid others."""
    lines, rng = np.linspace(5.0, 30.0, 300), np.random.default_rng(2)
    frfs = three_modes.frfs(lines, noise=0.02, seed=2)
    values = frfs.values.copy()
    noise = rng.standard_normal(values[2].shape) + 1j * rng.standard_normal(values[2].shape)
    values[2] = 1e-7 / (1j * lines - 16j + 0.05) + 1e-9 * noise if hum else 1e-7 * noise
    found = identify_frfs(dataclasses.replace(frfs, values=values), InputKnown(largest_order=16))
    np.testing.assert_allclose(found.modes.freq_hz, three_modes.freq_hz, rtol=1e-3)
    assert [n.code for n in found.notices] == ["frf.dead"]


@pytest.mark.quick(1)
@pytest.mark.parametrize(("more", "digits"), [(False, 15), (True, 15), (True, 5)])
def test_functions_without_noise_are_told_and_not_compared_with_it(three_modes: Any, more: bool, digits: int) -> None:
    """Also where the fit leaves more than rounding, since there are modes outside the band, and of a text file."""
    lines = np.linspace(5.0, 30.0, 400)
    frfs = three_modes.frfs(lines)
    if more:
        shapes = np.column_stack([three_modes.shapes, [[0.5, -0.2], [0.3, 0.4], [0.6, -0.7]]])
        freq, damping = np.append(three_modes.freq_hz, [33.0, 47.0]), np.append(three_modes.damping_ratio, [0.01, 0.01])
        frfs = dataclasses.replace(three_modes, freq_hz=freq, damping_ratio=damping, shapes=shapes).frfs(lines)
    parts = [
        np.array([[f"{x:.{digits}e}" for x in part.ravel()]], float) for part in (frfs.values.real, frfs.values.imag)
    ]
    frfs = dataclasses.replace(frfs, values=(parts[0] + 1j * parts[1]).reshape(frfs.values.shape))
    found = identify_frfs(frfs, InputKnown(band_hz=(8.0, 23.0), largest_order=16))
    codes = [n.code for n in found.notices]
    assert codes.count("identify.no-noise") == 1
    assert "identify.functions-disagree" not in codes
    check_shown("identify.no-noise", next(n for n in found.notices if n.code == "identify.no-noise"))


@pytest.mark.slow
def test_functions_with_little_noise_are_measured_ones(three_modes: Any) -> None:
    frfs = three_modes.frfs(np.linspace(5.0, 30.0, 800), noise=1e-4)
    found = identify_frfs(frfs, InputKnown(largest_order=16))
    assert "identify.no-noise" not in [n.code for n in found.notices]


def test_what_is_wrong_with_the_functions_is_told_with_an_error(three_modes: Any) -> None:
    frfs = three_modes.frfs(np.linspace(5.0, 30.0, 20), noise=0.02)
    values = frfs.values.copy()
    values[2] = 0.0
    with pytest.raises(FemtuneError) as caught:
        identify_frfs(dataclasses.replace(frfs, values=values), InputKnown(largest_order=60))
    assert [n.code for n in caught.value.notices] == ["frf.dead"]


@pytest.mark.slow
def test_a_band_one_method_and_a_choice_by_hand(eight_modes: Any) -> None:
    asked = InputKnown(band_hz=(10.0, 48.0), methods=("N4SID",), largest_order=30, drop=(37.0,))
    found = identify_frfs(eight_modes.frfs(_LINES, noise=0.005), asked)
    np.testing.assert_allclose(found.modes.freq_hz, [13.0, 25.0, 25.1, 44.0], rtol=2e-3)
    assert found.measured.freq_hz[0] >= 10.0
    assert set(found.table.method) == {"N4SID"}


@pytest.mark.slow
def test_motions_on_the_suspension_are_fitted_and_not_reported(three_modes: Any) -> None:
    frfs = three_modes.frfs(np.linspace(5.0, 30.0, 300), noise=0.005)
    every = identify_frfs(frfs, InputKnown(largest_order=16))
    assert len(every.modes) == 3
    highest = float(np.mean(every.modes.freq_hz[:2]))
    found = identify_frfs(frfs, InputKnown(largest_order=16, suspension_hz=highest))
    np.testing.assert_allclose(found.modes.freq_hz, every.modes.freq_hz[1:], rtol=1e-12)
    np.testing.assert_allclose(found.modes.damping_ratio, every.modes.damping_ratio[1:], rtol=1e-9)
    assert [c.reason for c in found.candidates if c.freq_hz < highest and "suspension" in c.reason]
    with pytest.raises(FemtuneError):
        identify_frfs(frfs, InputKnown(largest_order=16, suspension_hz=1e3))


@pytest.mark.slow
def test_rigid_body_motion_is_no_part_of_the_modes(eight_modes: Any) -> None:
    shapes = np.column_stack([np.full(12, 0.5), np.linspace(-1.0, 1.0, 12)])
    rigid = ModeSet(np.zeros(2), shapes, eight_modes.dofs, normalisation="mass")
    elastic = eight_modes.frfs(_LINES, noise=0.003)
    whole = dataclasses.replace(elastic, values=elastic.values + (shapes @ shapes[[0, 5]].T)[:, :, None])
    found = identify_frfs(whole, InputKnown(rigid=rigid))
    np.testing.assert_allclose(found.modes.freq_hz, eight_modes.freq_hz, rtol=1e-3)
    assert np.nanmax(found.quality.error) < 0.1


def test_noise_has_no_modes(three_modes: Any) -> None:
    frfs = three_modes.frfs(_LINES)
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(frfs.values.shape) + 1j * rng.standard_normal(frfs.values.shape)
    with pytest.raises(FemtuneError) as caught:
        identify_frfs(dataclasses.replace(frfs, values=noise), InputKnown())
    assert caught.value.code == "identify.no-poles"


@pytest.mark.parametrize("facts", [{"methods": ("ERA",)}, {"methods": ()}, {"largest_order": 2}])
def test_settings_that_mean_nothing(facts: dict[str, Any]) -> None:
    with pytest.raises(FemtuneError) as caught:
        InputKnown(**facts)
    assert caught.value.code == "identify.method"


@pytest.mark.slow
def test_a_hammer_that_roves_is_identified_by_reciprocity(eight_modes: Any) -> None:
    one = dataclasses.replace(eight_modes, inputs=(0,))
    frfs = one.frfs(_LINES, noise=0.005)
    found, roving = (identify_frfs(some, InputKnown(largest_order=40)) for some in (frfs, frfs.transposed()))
    np.testing.assert_array_equal(roving.modes.freq_hz, found.modes.freq_hz)
    np.testing.assert_array_equal(roving.modes.shapes, found.modes.shapes)
    assert roving.modes.dofs.labels() == frfs.responses.labels()
    (said,) = [n for n in roving.notices if n.code == "identify.reciprocity"]
    check_shown("identify.reciprocity", said)
    # the system has the forces and responses that were measured
    system, values = roving.system.frf(_LINES), found.system.frf(_LINES).values
    assert (system.responses.labels(), system.references.labels()) == (["1Z+"], frfs.responses.labels())
    np.testing.assert_allclose(system.values, np.swapaxes(values, 0, 1), rtol=1e-6)
    # and so have the functions and the fits
    for some in (roving.measured, roving.fit.measured, roving.fit.synthesised, roving.system_fit.system):
        assert (some.responses.labels(), some.references.labels()) == (["1Z+"], frfs.responses.labels())
    np.testing.assert_array_equal(roving.measured.values, np.swapaxes(found.measured.values, 0, 1))
    np.testing.assert_array_equal(roving.quality.error, found.quality.error.T)
    np.testing.assert_array_equal(roving.fit.residues, np.swapaxes(found.fit.residues, 0, 1))
    np.testing.assert_array_equal(roving.fit_of_shapes.own_covariance, found.fit.own_covariance)
    np.testing.assert_array_equal(roving.system_fit.participations, found.system_fit.shapes.T)
    as_measured = identify_frfs(frfs.transposed(), InputKnown(largest_order=8, by_reciprocity=False))
    assert as_measured.modes.dofs.labels() == ["1Z+"]
    noise = np.random.default_rng(0).standard_normal((2, *frfs.values.shape))
    with pytest.raises(NoModesChosen) as caught:
        identify_frfs(dataclasses.replace(frfs, values=noise[0] + 1j * noise[1]).transposed(), InputKnown())
    assert caught.value.measured.references.labels() == frfs.responses.labels()


@pytest.mark.slow
def test_the_damping_of_a_hammer_test_that_roves_is_equalised(eight_modes: Any) -> None:
    frfs = dataclasses.replace(eight_modes, inputs=(0,)).frfs(_LINES, noise=0.005)
    plain, roving = (equalised_test(some, 0.01, InputKnown(largest_order=40)) for some in (frfs, frfs.transposed()))
    assert plain.redrawn is not None
    assert roving.redrawn is not None
    assert roving.redrawn.measured.references.labels() == frfs.responses.labels()
    assert roving.redrawn.equalised.shape == roving.frfs.values.shape
    np.testing.assert_allclose(roving.redrawn.equalised, np.swapaxes(plain.redrawn.equalised, 0, 1), rtol=1e-6)
    np.testing.assert_allclose(roving.redrawn.modes.shapes, plain.redrawn.modes.shapes, rtol=1e-12)
    change = plain.redrawn.draw("noise", np.random.default_rng(1))
    drawn = roving.redrawn.functions(np.swapaxes(change, 0, 1))
    np.testing.assert_allclose(drawn, np.swapaxes(plain.redrawn.functions(change), 0, 1), rtol=1e-6)


@pytest.fixture(scope="module")
def eighteen_modes() -> Known:
    """More than can be told from models of an order up to 40; six responses, two of them driven."""
    rng = np.random.default_rng(3)
    shapes = rng.standard_normal((6, 18)) / 3.0
    freq = np.linspace(12.0, 95.0, 18) * (1.0 + 0.01 * rng.standard_normal(18))
    return Known(freq, np.exp(rng.uniform(*np.log([0.002, 0.02]), 18)), shapes, (0, 1))


def test_orders_that_end_too_early_are_told_or_raised(eighteen_modes: Known) -> None:
    """Without the modes that low orders miss, the others are in doubt, and a model that is compared is wrong."""
    of_one_force = dataclasses.replace(eighteen_modes, inputs=(0,)).frfs(np.linspace(8.0, 100.0, 300), noise=0.003)
    low = identify_frfs(of_one_force, InputKnown(largest_order=40))
    assert len(low.modes) < 18
    (told,) = [n for n in low.notices if n.code == "identify.low-order"]
    check_shown("identify.low-order", told)
    raised = identify_frfs(of_one_force, InputKnown(largest_order=40, raised=True))
    np.testing.assert_allclose(raised.modes.freq_hz, eighteen_modes.freq_hz, rtol=1e-3)
    assert 40 < largest_order_of(raised.table) <= MOST_ORDER
    assert np.median(raised.quality.error) < 0.1 * np.median(low.quality.error)
    assert "identify.low-order" not in [n.code for n in raised.notices]
    # orders that suffice stay
    again = identify_frfs(of_one_force, InputKnown(largest_order=largest_order_of(raised.table), raised=True))
    assert largest_order_of(again.table) == largest_order_of(raised.table)


def test_orders_are_raised_as_far_as_the_lines_allow(eighteen_modes: Known) -> None:
    frfs = eighteen_modes.frfs(np.linspace(8.0, 100.0, 64), noise=0.003)
    found = identify_frfs(frfs, InputKnown(largest_order=40, raised=True))
    assert largest_order_of(found.table) == 40
    assert "identify.low-order" in [n.code for n in found.notices]
