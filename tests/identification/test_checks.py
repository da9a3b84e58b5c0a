"""Channels and functions with one thing wrong: each is found and named, and sound ones are left alone."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import DofSet, parse_dof
from femtune.errors import FemtuneError
from femtune.identification.frf_checks import (
    apparent_mass,
    check_frfs,
    check_mass,
    compare_levels,
    exchanged,
    power_in,
    reciprocity,
)
from femtune.identification.record_checks import check_record
from femtune.identification.shapes import driving_points
from femtune.modal import Channel, FrfSet, TimeSeries, as_kind
from femtune.modal.frf_set import KINDS

_LINES = np.linspace(5.0, 62.0, 700)


def _values() -> np.ndarray:
    """Four channels of narrow-band noise of other sizes, with 12-bit steps."""
    rng = np.random.default_rng(0)
    waves = np.array([np.convolve(rng.standard_normal(5000), np.hanning(9), "same") for _ in range(4)])
    return np.round(waves * np.array([[1.0], [0.2], [3.0], [0.5]]) * 100.0) / 100.0


def _record(values: np.ndarray) -> TimeSeries:
    channels = tuple(Channel(parse_dof(f"{i + 1}Z+"), "acceleration", "m/s^2") for i in range(4))
    return TimeSeries(values, channels, 100.0)


def _dead(v: np.ndarray) -> None:
    v[1] = 0.02


def _weak(v: np.ndarray) -> None:
    v[1] *= 1e-4


def _clipped(v: np.ndarray) -> None:
    v[1] = np.clip(v[1], -0.5 * v[1].std(), 0.5 * v[1].std())


def _drifting(v: np.ndarray) -> None:
    v[1] += np.linspace(-5.0, 3.0, 5000) * v[1].std()


def _lost(v: np.ndarray) -> None:
    v[1, 100:103] = np.nan


def _spike(v: np.ndarray) -> None:
    v[1, 1234] += 200.0 * v[1].std()


def _two_samples(v: np.ndarray) -> None:
    v[1, 77:79] = [-40.0 * v[1].std(), -35.0 * v[1].std()]


def _overflow(v: np.ndarray) -> None:
    v[1, -1] = 1e30


def _other_unit(v: np.ndarray) -> None:
    v[1] *= 5000.0


def _cut(v: np.ndarray) -> None:
    v[:, 4000:] = v[:, [4000]]


def _doubled(v: np.ndarray) -> None:
    v[1] = -2.0 * v[2]


def test_a_sound_record_has_nothing_to_tell() -> None:
    assert check_record(_record(_values())) == ()


@pytest.mark.parametrize(
    ("harm", "code"),
    [
        (_dead, "record.dead"),
        (_weak, "record.dead"),
        (_clipped, "record.clipped"),
        (_drifting, "record.drifting"),
        (_lost, "record.lost-samples"),
        (_spike, "record.spikes"),
        (_two_samples, "record.spikes"),
        (_overflow, "record.spikes"),
        (_other_unit, "record.other-unit"),
        (_cut, "record.cut-short"),
        (_doubled, "record.same-signal"),
    ],
)
def test_a_bad_channel_is_found_and_named(harm: Callable[[np.ndarray], None], code: str) -> None:
    values = _values()
    harm(values)
    (notice,) = check_record(_record(values))
    assert notice.code == code
    assert "2Z+" in notice.what or (code == "record.cut-short" and "40 s" in notice.what)


def test_spikes_are_counted_with_their_times() -> None:
    values = _values()
    values[1, [500, 3000]] = 1e3
    (notice,) = check_record(_record(values))
    check_shown("record.spikes", notice)


def test_a_burst_is_named_with_its_time_and_power() -> None:
    """A tenth to four tenths of the power of one channel in two seconds; a level that wanders is none."""
    values = _values()
    burst = np.where(np.arange(5000) < 2000, 0.0, np.exp(-(np.arange(5000) - 2000.0) / 40.0))
    burst *= np.sin(0.4 * np.arange(5000))
    values[1] += burst * np.sqrt(0.25 * np.sum(values[1] ** 2) / np.sum(burst**2))
    (notice,) = check_record(_record(np.round(values, 3)))
    assert "2Z+ (20" in notice.what
    check_shown("record.bursts", notice)
    assert check_record(_record(np.round(_values() * (1.0 + 0.5 * np.sin(np.arange(5000) / 400.0)), 3))) == ()


def test_a_clipped_channel_is_named_also_with_noise_behind_the_amplifier() -> None:
    values = _values()
    size = values[1].std()
    values[1] = np.clip(values[1], -size, size) + 0.01 * size * np.random.default_rng(5).standard_normal(5000)
    assert [n.code for n in check_record(_record(values))] == ["record.clipped"]
    values[1] = size * np.sin(np.arange(5000) / 7.0) + 0.01 * size * np.random.default_rng(5).standard_normal(5000)
    assert check_record(_record(values)) == ()


def test_gaps_are_named_with_place_and_size() -> None:
    values = _values()
    values[1, 100:103] = values[1, 200:240] = np.nan
    (notice,) = check_record(_record(values))
    assert "2Z+ (43 in 2 gaps, the longest with 40 from 2 s)" in notice.what


def test_impacts_bursts_and_steps_of_a_converter_are_no_spikes() -> None:
    """Decays after impacts, bursts of fifty times the level, a slow large motion, single bits of a still channel."""
    values, t = _values(), np.arange(5000) / 100.0
    values[0] = 1e-3 * values[0]
    for start in range(250, 5000, 500):
        values[0, start:] += np.exp(-2.0 * t[: 5000 - start]) * np.cos(60.0 * t[: 5000 - start])
    values[1] *= np.where((t > 20.0) & (t < 21.0), 50.0, 1.0)
    values[2] += 1e3 * np.sin(2.0 * np.pi * 0.2 * t)
    values[3] = 0.01 * (np.random.default_rng(1).random(5000) < 0.004)
    assert "record.spikes" not in [n.code for n in check_record(_record(values))]


def test_an_impact_near_the_end_is_no_spike() -> None:
    values = _values()
    values[1] *= 1e-3
    values[1, -10:] = values[0].std() * np.array([9.0, -8.0, 6.0, -5.0, 4.0, -4.0, 3.0, -3.0, 2.0, -2.0])
    assert "record.spikes" not in [n.code for n in check_record(_record(values))]


def test_an_impact_of_one_sample_is_no_spike_of_an_input() -> None:
    values = _values()
    values[1] = 0.0
    values[1, 1000] = 1.0
    record = _record(values)
    force = dataclasses.replace(record.channels[1], quantity="force", role="input", unit="N")
    channels = (record.channels[0], force, *record.channels[2:])
    assert check_record(dataclasses.replace(record, channels=channels)) == ()


def test_the_level_of_a_channel_is_compared_with_all_others() -> None:
    """The median of the others, whose levels are 1, 3 and 0.5 times that of the first."""
    values = _values()
    values[1] = 400.0 * np.roll(values[0], 700)
    (notice,) = check_record(_record(values))
    assert notice.code == "record.other-unit"
    assert "2Z+ (400 times)" in notice.what


@pytest.mark.parametrize(("still", "told"), [(75, False), (125, True)])
def test_a_record_is_cut_short_where_more_than_two_percent_stand_still(still: int, told: bool) -> None:
    values = _values()
    values[:, -still:] = values[:, [-still]]
    assert [n.code for n in check_record(_record(values))] == ["record.cut-short"] * told


def test_fast_signals_are_clipped_at_single_samples() -> None:
    """Noise up to half the sampling rate hardly stays at its limit for three samples."""
    values = _values()
    noise = np.random.default_rng(3).standard_normal(5000)
    values[1] = values[0].std() * np.clip(noise, -2.5, 2.5)
    assert [n.code for n in check_record(_record(values))] == ["record.clipped"]
    values[1] = values[0].std() * np.round(noise, 1)
    assert check_record(_record(values)) == ()


def test_a_force_that_is_zero_between_impacts_is_not_clipped() -> None:
    values = _values()
    values[1] = 0.0
    for start in range(100, 5000, 500):
        values[1, start : start + 30] = (1.0 + start / 5000.0) * np.sin(np.pi * np.arange(30) / 29.0) ** 2
    assert "record.clipped" not in [n.code for n in check_record(_record(values))]


def test_a_wave_that_repeats_has_one_extreme_a_period_and_is_not_clipped() -> None:
    values = _values()
    values[1] = np.tile(0.1 * np.random.default_rng(2).standard_normal(50), 100)
    assert check_record(_record(values)) == ()


def test_sound_functions_have_nothing_to_tell(eight_modes: Any) -> None:
    for kind in KINDS:
        assert check_frfs(eight_modes.frfs(_LINES, noise=0.03, kind=kind)) == ()


@pytest.mark.parametrize("kind", KINDS)
def test_a_driving_point_with_the_wrong_sign_is_named(eight_modes: Any, kind: str) -> None:
    frfs = eight_modes.frfs(_LINES, kind=kind)
    (point, *_) = driving_points(frfs)
    values = frfs.values.copy()
    values[point.response, point.reference] *= -1.0
    (notice,) = [n for n in check_frfs(dataclasses.replace(frfs, values=values)) if "driving point" in n.what]
    label = frfs.references[point.reference]
    if kind == "mobility":
        assert notice.code == "frf.driving-point"
        assert f"driving point {label} only 0% " in notice.what
    else:
        assert f"the driving point {label}" in notice.what
        check_shown(f"frf.kind-contradicts, wrong sign of {kind}", notice)


@pytest.mark.parametrize(("true", "stated"), [("accelerance", "mobility"), ("mobility", "receptance")])
def test_another_kind_than_stated_is_told(eight_modes: Any, true: str, stated: str) -> None:
    """A receptance and an accelerance differ in sign besides: taken for the other, all power comes out."""
    frfs = eight_modes.frfs(_LINES, kind=true)
    found = check_frfs(dataclasses.replace(frfs, kind=stated))
    assert {n.code for n in found} == {"frf.kind-contradicts"}
    assert true in found[0].what
    assert power_in(frfs, driving_points(frfs)[0]) == pytest.approx(1.0)


def test_a_turned_driving_point_is_told(eight_modes: Any) -> None:
    frfs = eight_modes.frfs(_LINES, kind="mobility")
    values = frfs.values * np.array([-1.0, 1.0])[None, :, None]
    (one, *rest) = check_frfs(dataclasses.replace(frfs, values=values))
    assert one.code == "frf.driving-point"
    assert "1Z+" in one.what
    assert [n.code for n in rest] == ["frf.not-reciprocal"]


def test_reciprocity_is_a_difference(eight_modes: Any) -> None:
    frfs = eight_modes.frfs(_LINES)
    (pair,) = reciprocity(frfs)
    assert (pair.first, pair.second) == ("1Z+", "6Z+")
    assert pair.difference == pytest.approx(0.0, abs=1e-12)
    values = frfs.values.copy()
    values[5, 0] *= 1.4
    (notice,) = check_frfs(dataclasses.replace(frfs, values=values))
    assert notice.code == "frf.not-reciprocal"


def test_directions_that_are_not_coupled_are_not_judged(eight_modes: Any) -> None:
    """Their functions are noise, of which one and the other differ by 140 %."""
    frfs = eight_modes.frfs(_LINES)
    values, rng = frfs.values.copy(), np.random.default_rng(5)
    size = np.abs(values[0, 0]).mean()
    for i, j in ((5, 0), (0, 1)):
        values[i, j] = 1e-3 * size * (rng.standard_normal(len(_LINES)) + 1j * rng.standard_normal(len(_LINES)))
    noisy = dataclasses.replace(frfs, values=values)
    (pair,) = reciprocity(noisy)
    assert pair.difference > 1.0
    assert pair.coupling < 0.02
    assert "frf.not-reciprocal" not in [n.code for n in check_frfs(noisy)]


def test_dead_responses_are_named(eight_modes: Any) -> None:
    frfs = eight_modes.frfs(_LINES)
    values = frfs.values.copy()
    values[[3, 7]] = 0.0
    (notice,) = check_frfs(dataclasses.replace(frfs, values=values))
    assert notice.what.endswith("4Z+, 8Z+")


def _free_mass(mass: float, factor: float) -> FrfSet:
    """Driving point of a free structure: its mass, and an elastic mode far above."""
    lines = np.linspace(1.0, 10.0, 50)
    dofs = DofSet.parse(["1Z+"])
    elastic = -((2 * np.pi * lines) ** 2) / ((2 * np.pi * 100.0) ** 2 - (2 * np.pi * lines) ** 2) / mass
    return FrfSet(lines, factor * (1.0 / mass + elastic)[None, None] + 0j, dofs, dofs, "accelerance")


def test_the_mass_line_tells_units() -> None:
    assert apparent_mass(_free_mass(42.0, 1.0), 10.0)[0] == pytest.approx(42.0, rel=0.01)
    assert check_mass(_free_mass(42.0, 1.0), 42.0, 10.0) == ()
    assert apparent_mass(as_kind(_free_mass(42.0, 1.0), "receptance"), 10.0)[0] == pytest.approx(42.0, rel=0.01)
    (notice,) = check_mass(_free_mass(42.0, 1 / 9.80665), 42.0, 10.0)
    assert notice.code == "frf.mass-line"
    assert "g instead of m/s²" in notice.what


def test_exchanged_and_inverted_channels_are_named(eight_modes: Any) -> None:
    one, other = eight_modes.frfs(_LINES, 0.01, 1), eight_modes.frfs(_LINES, 0.01, 2)
    assert exchanged(one, other) == ()
    values = one.values.copy()
    values[[2, 9]] = values[[9, 2]]
    values[4] *= -1.0
    found = exchanged(dataclasses.replace(one, values=values), other)
    told = [re.findall(r"\d+Z\+", n.what) for n in found if n.code == "frf.exchanged"]
    assert told == [["3Z+", "10Z+"], ["10Z+", "3Z+"]]
    assert [n.what.split()[5] for n in found if n.code == "frf.inverted"] == ["5Z+"]


def test_levels_of_a_linear_structure_differ_by_noise(three_modes: Any) -> None:
    lines = np.linspace(5.0, 30.0, 600)
    levels = [three_modes.frfs(lines, 0.02, seed) for seed in range(3)]
    sd = [np.full(f.values.shape, 0.02 * np.sqrt(np.mean(np.abs(f.values) ** 2))) for f in levels]
    assert compare_levels(levels, sd).linear
    softer = dataclasses.replace(three_modes, freq_hz=three_modes.freq_hz * [1.0, 0.995, 1.0])
    found = compare_levels([*levels[:2], softer.frfs(lines, 0.02, 7)], sd)
    assert not found.linear
    assert not compare_levels([levels[0], softer.frfs(lines)]).linear


def test_sets_that_cannot_be_compared(eight_modes: Any, three_modes: Any) -> None:
    for call in (exchanged, lambda a, b: compare_levels([a, b])):
        with pytest.raises(FemtuneError) as caught:
            call(eight_modes.frfs(_LINES), three_modes.frfs(_LINES))
        assert caught.value.code == "identify.lines-differ"


def test_sets_of_other_kinds_are_compared_as_one_kind(eight_modes: Any) -> None:
    one, other = eight_modes.frfs(_LINES, 0.01, 1), as_kind(eight_modes.frfs(_LINES, 0.01, 2), "receptance")
    assert exchanged(one, other) == ()
    with pytest.raises(FemtuneError) as caught:
        compare_levels([one, other])
    check_shown("identify.kinds-differ, levels", caught.value)
