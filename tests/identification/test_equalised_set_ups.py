"""Equalised tests of all set-ups: exponential windows, suspensions, rigid-body motion of a model, a fixed order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.errors import FemtuneError, Notice
from femtune.identification import EqualisedTest, InputKnown, equalised_test, identify_frfs
from femtune.identification.guided import with_mode_near
from femtune.identification.redrawn import RedrawnTest
from femtune.identification.rigid_body import rigid_body_motion
from femtune.modal import FrfSet, ModeSet
from femtune.modal.joined import join_ranges

from ..messages.shown import check_shown
from .conftest import Known

LINES = np.arange(5.0, 40.0, 0.1)
ZETA = 0.01
TAU = 0.4
"""Its damping is 5 % of critical at 8 Hz, 1.2 % at 33 Hz."""
ORDER = InputKnown(largest_order=16)
kinds = pytest.mark.parametrize("kind", ["receptance", "accelerance"])


def known(damping: tuple[float, ...] = (0.01, 0.02, 0.015, 0.008)) -> Known:
    shapes = np.random.default_rng(3).standard_normal((6, 4)) / 3.0
    return Known(np.array([8.0, 13.0, 21.0, 33.0]), np.array(damping), shapes, (0, 3))


def windowed(kind: str, noise: float = 0.0) -> FrfSet:
    return known().frfs(LINES, noise, kind=kind, decay=1.0 / TAU)


def error(found: EqualisedTest, kind: str) -> float:
    """Of the equalised FRFs, relative to the largest: those of the same modes with one damping ratio are exact."""
    exact = known((ZETA,) * 4).frfs(found.frfs.freq_hz, kind=kind).values
    return float(np.abs(found.frfs.values - exact).max() / np.abs(exact).max())


@pytest.mark.slow
@kinds
def test_equalised_functions_are_those_without_the_window(kind: str) -> None:
    told = equalised_test(windowed(kind), ZETA, replace(ORDER, exponential_s=TAU))
    untold = equalised_test(windowed(kind), ZETA, ORDER)
    without = equalised_test(known().frfs(LINES, kind=kind), ZETA, ORDER)
    np.testing.assert_allclose(told.moved.damping_ratio, known().damping_ratio, rtol=1e-5)
    # that of the window is added: 1/(2πfτ)
    added = 1.0 / (2.0 * np.pi * known().freq_hz * TAU)
    np.testing.assert_allclose(untold.moved.damping_ratio, known().damping_ratio + added, rtol=0.02)
    assert error(told, kind) < 2.0 * error(without, kind) + 1e-6
    assert error(untold, kind) > (50.0 if kind == "accelerance" else 1.0) * error(told, kind)


@pytest.mark.slow
@kinds
def test_draws_of_a_test_with_a_window(kind: str) -> None:
    test = equalised_test(windowed(kind, 1e-3), ZETA, replace(ORDER, exponential_s=TAU))
    of = test.redrawn
    np.testing.assert_allclose(of.equalised, test.frfs.values, rtol=1e-8)
    np.testing.assert_allclose(of.modes.damping_ratio, test.identified.modes.damping_ratio, rtol=1e-9)
    check_draws(of)
    # the system repeats the functions as they were measured
    size = np.sqrt(np.mean(np.abs(of.measured.values) ** 2))
    assert np.abs(of.functions_at(LINES) - of.measured.values).max() < 0.01 * size
    assert np.sqrt(np.mean(of.noise_sd**2)) == pytest.approx(1e-3 * size / np.sqrt(2.0), rel=0.1)


def check_draws(of: RedrawnTest) -> None:
    """One step of both fits, against the fits themselves."""
    change = 0.1 * of.draw("noise", np.random.default_rng(5))
    exact = of.refitted(change) - of.refitted(0.0 * change)
    found = of.functions(change) - of.equalised
    assert np.linalg.norm(found - exact) < 0.1 * np.linalg.norm(exact)


@pytest.mark.slow
def test_a_window_that_was_stronger_than_the_decay_is_told() -> None:
    found = identify_frfs(windowed("accelerance", 1e-3), replace(ORDER, exponential_s=0.25 * TAU))
    (notice,) = [n for n in found.notices if n.code == "identify.window-too-strong"]
    assert notice.facts["count"] == 4
    # the slowest decay of all: that of the mode at 8 Hz
    slowest = 1.0 / (1.0 / TAU + 2.0 * np.pi * 8.0 * 0.01)
    assert notice.facts["least"] == pytest.approx(slowest, rel=1e-2)
    shown = {**notice.facts, "least": 0.333, "names": "8.07 Hz, 13 Hz, 21 Hz, 33 Hz"}
    check_shown("identify.window-too-strong", Notice(notice.code, **shown))
    right = identify_frfs(windowed("accelerance", 1e-3), replace(ORDER, exponential_s=TAU))
    assert "identify.window-too-strong" not in {n.code for n in right.notices}


@pytest.mark.slow
def test_a_window_that_hardly_falls_is_told() -> None:
    frfs = known().frfs(LINES, 1e-3)
    codes = {}
    for tau in (400.0, 4.0):
        codes[tau] = {n.code: n for n in identify_frfs(frfs, replace(ORDER, exponential_s=tau)).notices}
    assert "identify.window-weak" not in codes[4.0]
    check_shown("identify.window-weak", codes[400.0]["identify.window-weak"])


@pytest.mark.slow
@kinds
@pytest.mark.parametrize("decay", [0.0, 1.0 / TAU])
def test_rigid_body_motion_of_a_model(kind: str, decay: float) -> None:
    """With and without a window: the motion of the free structure is known exactly, and so are its elastic modes."""
    shapes = np.column_stack([np.full(6, 0.5), np.linspace(-1.0, 1.0, 6)])
    rigid = ModeSet(np.zeros(2), shapes, known().dofs, normalisation="mass")
    elastic = known().frfs(LINES, kind=kind, decay=decay)
    whole = replace(elastic, values=elastic.values + rigid_body_motion(rigid, elastic, LINES, decay))
    window = 1.0 / decay if decay else None
    test = equalised_test(whole, ZETA, replace(ORDER, rigid=rigid, exponential_s=window))
    np.testing.assert_allclose(test.moved.damping_ratio, known().damping_ratio, rtol=1e-5)
    at = test.frfs.freq_hz
    alone = known((ZETA,) * 4).frfs(at, kind=kind)
    exact = alone.values + rigid_body_motion(rigid, alone, at)
    np.testing.assert_allclose(test.frfs.values, exact, atol=1e-5 * np.abs(exact).max())
    np.testing.assert_allclose(test.redrawn.equalised, test.frfs.values, rtol=1e-7, atol=1e-9 * np.abs(exact).max())
    np.testing.assert_allclose(test.redrawn.functions_at(LINES), whole.values, atol=1e-5 * np.abs(whole.values).max())


@pytest.mark.slow
@kinds
def test_the_mass_line_of_a_free_structure_has_the_window_too(kind: str) -> None:
    """L/(iω + σ)², which a model without rigid-body modes leaves in the functions."""
    shapes = 0.1 * np.column_stack([np.full(6, 0.5), np.linspace(-1.0, 1.0, 6)])
    rigid = ModeSet(np.zeros(2), shapes, known().dofs, normalisation="mass")
    elastic = known().frfs(LINES, kind=kind, decay=1.0 / TAU)
    whole = replace(elastic, values=elastic.values + rigid_body_motion(rigid, elastic, LINES, 1.0 / TAU))
    found = identify_frfs(whole, replace(ORDER, exponential_s=TAU)).modes
    np.testing.assert_allclose(found.freq_hz, known().freq_hz, rtol=1e-6)
    np.testing.assert_allclose(found.damping_ratio, known().damping_ratio, rtol=1e-4)


@pytest.mark.slow
def test_draws_of_a_test_without_its_rigid_body_motion() -> None:
    shapes = np.column_stack([np.full(6, 0.5), np.linspace(-1.0, 1.0, 6)])
    rigid = ModeSet(np.zeros(2), shapes, known().dofs, normalisation="mass")
    elastic = known().frfs(LINES, 1e-3)
    whole = replace(elastic, values=elastic.values + rigid_body_motion(rigid, elastic, LINES))
    check_draws(equalised_test(whole, ZETA, replace(ORDER, rigid=rigid)).redrawn)


@pytest.mark.slow
def test_motions_on_a_suspension_are_no_modes_and_keep_their_damping() -> None:
    lines = np.arange(5.0, 40.0, 0.1)
    frfs = known().frfs(lines, 1e-3)
    test = equalised_test(frfs, ZETA, replace(ORDER, suspension_hz=10.0))
    assert test.left_out_hz == ((0.0, 10.0),)
    assert test.frfs.freq_hz[0] > 10.0
    np.testing.assert_allclose(test.identified.modes.freq_hz, [13.0, 21.0, 33.0], rtol=1e-3)
    np.testing.assert_allclose(test.redrawn.modes.freq_hz, [13.0, 21.0, 33.0], rtol=1e-3)
    np.testing.assert_allclose(test.moved.freq_hz, [13.0, 21.0, 33.0], rtol=1e-3)
    # the motion at 8 Hz has its own damping on both sides
    exact = known((0.01, ZETA, ZETA, ZETA)).frfs(test.frfs.freq_hz).values
    assert np.abs(test.frfs.values - exact).max() < 0.01 * np.abs(exact).max()


@pytest.mark.slow
def test_a_suspension_above_the_band_leaves_no_mode() -> None:
    with pytest.raises(FemtuneError) as caught:
        identify_frfs(windowed("receptance"), InputKnown((5.0, 35.0), largest_order=16, suspension_hz=60.0))
    check_shown("identify.suspension", caught.value)


def test_a_mode_that_is_looked_for_later_does_not_make_motions_on_a_suspension_modes() -> None:
    """The damping of a window is known where a mode is looked for."""
    frfs = windowed("accelerance", 1e-3)
    options = replace(ORDER, suspension_hz=10.0, exponential_s=TAU, drop=(21.0,))
    of = equalised_test(frfs, ZETA, options).redrawn
    np.testing.assert_allclose(of.modes.freq_hz, [13.0, 33.0], rtol=1e-2)
    fit = with_mode_near(of.fit, of.terms, 21.05, 0.01, of.decay)
    assert fit is not None
    found = of.modes_of(fit)
    np.testing.assert_allclose(found.freq_hz, [13.0, 21.0, 33.0], rtol=1e-3)
    np.testing.assert_allclose(found.damping_ratio, [0.02, 0.015, 0.008], rtol=0.1)


@pytest.mark.slow
def test_all_poles_of_a_fixed_order_are_modes() -> None:
    frfs = known().frfs(LINES, 1e-3)
    found = identify_frfs(frfs, InputKnown(order=8))
    assert {c.reason for c in found.candidates if c.chosen} == {"pole of the order 8"}
    np.testing.assert_allclose(found.modes.freq_hz, known().freq_hz, rtol=1e-3)
    assert {int(found.table.order[c.at]) for c in found.candidates if c.chosen} == {8}
    fewer = identify_frfs(frfs, InputKnown(order=8, drop=(21.0,)))
    np.testing.assert_allclose(fewer.modes.freq_hz, [8.0, 13.0, 33.0], rtol=2e-2)
    # one of four modes that is not in a model of six states is missed, whatever other orders have
    assert len(identify_frfs(frfs, InputKnown(order=6)).modes) < 4
    with pytest.raises(FemtuneError) as caught:
        InputKnown(order=7)
    check_shown("identify.method, fixed-order", caught.value)


def test_a_later_set_adds_what_an_earlier_one_does_not_have() -> None:
    first, second = known().frfs(np.arange(10.0, 30.0, 0.5)), known().frfs(np.arange(5.0, 20.0, 0.2))
    both = join_ranges([first, second])
    expected = np.union1d(np.arange(10.0, 30.0, 0.5), np.arange(5.0, 10.0, 0.2))
    complete = np.isfinite(both.values).all(axis=(0, 1))
    np.testing.assert_allclose(both.freq_hz[complete], expected, rtol=1e-12)
    np.testing.assert_allclose(both.values[:, :, complete], known().frfs(both.freq_hz[complete]).values, rtol=1e-12)
    # one file for each force
    one, other = (replace(first, values=first.values[:, [j]], references=first.references.select([j])) for j in (0, 1))
    np.testing.assert_array_equal(join_ranges([one, other]).values, first.values)
