"""Estimates made one, set-ups merged, floors made rigid, peaks of the ground told from modes."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.identification.averaging import cross_spectra
from femtune.identification.combine import Estimate, combine
from femtune.identification.input_lines import ground_to_floor, judge_peaks, stands_out_db, unmoved_by_mass
from femtune.identification.setups import merge_setups, same_modes, to_rigid_motion
from femtune.modal import Channel, ModeSet, TimeSeries
from femtune.modal.shape_criteria import mac
from structures.braced_building import sensor_rows

DOFS = DofSet(Dof(i, "X") for i in range(1, 5))
SHAPES = np.linalg.qr(np.random.default_rng(0).standard_normal((4, 3)))[0]
FREQ = np.array([3.0, 3.02, 9.0])


def estimates(fragments: int, sd: float, methods=("a", "b")) -> list[Estimate]:
    rng = np.random.default_rng(1)
    out = []
    for i in range(fragments):
        common = sd * rng.standard_normal(3)
        for j, method in enumerate(methods):
            turned = SHAPES * rng.choice([-1.0, 1.0], 3) * 7.0 + 1e-3 * rng.standard_normal((4, 3))
            freq = FREQ + common + 0.001 * j
            order = np.argsort(freq)
            damping = np.full(3, 0.01) if method == "a" else None
            out.append(Estimate(method, i, ModeSet(freq[order], turned[:, order], DOFS, damping_ratio=damping)))
    return out


def test_close_modes_are_told_apart_by_shape_and_averaged():
    found = combine(estimates(40, 0.01))
    by_shape = np.abs(SHAPES.T @ found.modes.shapes).argmax(axis=0)
    assert sorted(by_shape) == [0, 1, 2]
    assert found.modes.freq_hz == pytest.approx(FREQ[by_shape] + 0.0005, abs=0.006)
    assert np.abs(SHAPES.T @ found.modes.shapes)[by_shape, range(3)] == pytest.approx([1.0] * 3, abs=1e-5)
    assert (found.found == 80).all()
    assert found.modes.damping_ratio == pytest.approx([0.01] * 3)


@pytest.mark.slow
def test_deviation_of_the_mean_comes_from_the_fragments():
    found = combine(estimates(400, 0.01))
    assert found.modes.freq_sd_hz == pytest.approx([0.01 / 20.0] * 3, rel=0.15)
    assert found.scatter_hz == pytest.approx([0.01] * 3, rel=0.15)
    assert found.by_method["b"] - found.by_method["a"] == pytest.approx([0.001] * 3)


def test_longer_fragments_count_more():
    """Means, and their deviations, of two fragments with weights 3 and 1 are those by hand."""
    at = [
        Estimate("a", i, ModeSet(np.array([f]), SHAPES[:, :1], DOFS), w) for i, f, w in ((0, 3.0, 3.0), (1, 3.04, 1.0))
    ]
    found = combine(at)
    assert found.modes.freq_hz == pytest.approx([3.01])
    assert found.modes.freq_sd_hz == pytest.approx([np.sqrt((3.0 * 0.01**2 + 0.03**2) / 4.0)])


def with_sd(sd_hz: float, freqs: tuple[float, ...]) -> list[Estimate]:
    sets = [ModeSet(np.array([f]), SHAPES[:, :1], DOFS, freq_sd_hz=np.array([sd_hz])) for f in freqs]
    return [Estimate("a", i, one, 1.0) for i, one in enumerate(sets)]


def test_deviations_of_the_method_count_where_fragments_are_few():
    """Unless they scatter far more than the method states; many fragments are a measure of their own."""
    for sd_hz, freqs, expected in (
        (0.01, (3.0, 3.001, 3.002), 0.01 / 3**0.5),
        (0.001, (3.0, 3.02, 3.04), 0.02 / 3**0.5),
        (0.01, (3.0, 3.002) * 10, np.std((3.0, 3.002) * 10, ddof=1) / 20**0.5),
        (0.01, (3.0,), 0.01),
    ):
        found = combine(with_sd(sd_hz, freqs))
        assert found.modes.freq_sd_hz == pytest.approx([expected])


def test_one_fragment_gives_no_deviation():
    assert np.isnan(combine(estimates(1, 0.0)).modes.freq_sd_hz).all()


def test_what_few_estimates_have_is_dropped_and_told():
    some = estimates(4, 0.001)
    extra = ModeSet(np.array([5.0]), SHAPES[:, :1], DOFS)
    found = combine([*some, Estimate("c", 0, extra)])
    assert len(found.modes) == 3
    assert found.dropped == ((5.0, 1),)


def test_nothing_in_common_is_an_error():
    alone = [Estimate("a", i, ModeSet(np.array([1.0 + i]), SHAPES[:, :1], DOFS)) for i in range(3)]
    with pytest.raises(FemtuneError, match="no mode was found"):
        combine(alone)


def test_setups_of_different_scale_and_sign_are_one_shape():
    whole = ModeSet(FREQ, SHAPES, DOFS)
    one = whole.select_dofs(DofSet([Dof(1, "X"), Dof(2, "X")]))
    other = ModeSet(FREQ + 0.02, -3.0 * SHAPES[[3, 0, 2]], DofSet([Dof(4, "X"), Dof(1, "X"), Dof(3, "X")]))
    merged = merge_setups([one, other]).select_dofs(DOFS)
    assert merged.shapes == pytest.approx(SHAPES)
    assert merged.freq_hz == pytest.approx(FREQ + 0.01)
    assert merged.freq_sd_hz == pytest.approx([0.01] * 3)


def test_setups_that_cannot_be_merged_say_why():
    references = DofSet([Dof(1, "X")])
    whole = ModeSet(FREQ, SHAPES, DOFS)
    with pytest.raises(FemtuneError, match="different numbers of modes"):
        merge_setups([whole, whole.select_modes([0])])
    apart = ModeSet(FREQ, SHAPES, DofSet(Dof(i + 10, "X") for i in range(4)))
    with pytest.raises(FemtuneError, match="set-ups 2 share no degree of freedom"):
        merge_setups([whole, apart])
    still = SHAPES.copy()
    still[0, 1] = 0.0
    part = ModeSet(FREQ, SHAPES[:1], references)
    rest = ModeSet(FREQ, still, DOFS)
    with pytest.raises(FemtuneError, match="mode 2 of set-up 2 "):
        merge_setups([part, rest])


def chain_of_setups():
    """Five set-ups of eleven DOFs, each overlapping with the next one in one or two points; no common reference."""
    rng = np.random.default_rng(1)
    whole = rng.standard_normal((11, 3))
    parts = [(0, 1, 2, 3), (2, 3, 4), (4, 5, 6, 7), (6, 7, 8), (8, 9, 10)]
    factors = [1.0, -2.0, 0.1, 30.0, -0.7]
    sets = [ModeSet(FREQ, f * whole[list(p)], DofSet(Dof(i + 1, "X") for i in p)) for f, p in zip(factors, parts)]
    return whole, sets


def test_setups_that_only_overlap_are_joined_along_the_chain():
    whole, sets = chain_of_setups()
    merged = merge_setups(sets)
    assert merged.shapes == pytest.approx(whole)
    assert merged.dofs.labels() == [f"{i}X+" for i in range(1, 12)]


def test_joint_scales_are_the_least_squares_ones():
    """The gradient of the sum of squares, computed entry by entry, vanishes on the sphere of the factors."""
    _, sets = chain_of_setups()
    rng = np.random.default_rng(2)
    noisy = (s.shapes * rng.normal(1.0, 0.1, s.shapes.shape) for s in (*sets, sets[0]))
    sets = [ModeSet(FREQ, shapes, s.dofs) for shapes, s in zip(noisy, (*sets, sets[0]))]
    merged = merge_setups(sets)
    counts = {str(d): sum(d in s.dofs for s in sets) for d in merged.dofs}
    for mode in range(3):
        sizes, slopes, scales = [], [], []
        for s in sets:
            common = [d for d in s.dofs if counts[str(d)] > 1]
            own = s.select_dofs(DofSet(common)).shapes[:, mode]
            mean = merged.select_dofs(DofSet(common)).shapes[:, mode]
            alone = DofSet([d for d in s.dofs if counts[str(d)] == 1][:1])
            ratio = merged.select_dofs(alone).shapes[:, mode] / s.select_dofs(alone).shapes[:, mode]
            scale = float(ratio[0]) if len(ratio) else None
            sizes.append(own @ own)
            slopes.append((own, mean))
            scales.append(scale)
        # stationary: |ψ|² α − ψ·φ = λ |ψ|² α with one λ for all set-ups
        ratios = [
            1.0 - (own @ mean) / (size * scale)
            for (own, mean), size, scale in zip(slopes, sizes, scales)
            if scale is not None
        ]
        assert len(ratios) > 1
        assert ratios == pytest.approx([ratios[0]] * len(ratios), rel=1e-6)


def test_the_same_modes_are_found_by_frequency_and_shape():
    rng = np.random.default_rng(3)
    shapes = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    freq = np.array([2.0, 2.02, 5.0, 9.0])
    one = ModeSet(freq, shapes, DOFS)
    # the close pair has changed places, a mode is missing, and there is one more
    other = ModeSet(np.array([1.99, 2.01, 7.0, 9.1]), -2.0 * shapes[:, [1, 0, 2, 3]], DOFS)
    (first, second), left = same_modes([one, other])
    assert first.freq_hz.tolist() == [2.0, 2.02, 9.0] or sorted(first.freq_hz) == [2.0, 2.02, 9.0]
    assert np.diag(mac(first.shapes, second.shapes)) == pytest.approx([1.0] * 3)
    assert sorted(round(m.freq_hz, 3) for m in left) == [5.0, 7.0]


def record_of(values, inputs=0):
    n = len(values) - inputs
    responses = [Channel(Dof(i + 1, "X"), "acceleration") for i in range(n)]
    driven = [Channel(Dof(100 + i, "X"), "acceleration", role="input") for i in range(inputs)]
    return TimeSeries(values, (*responses, *driven), 50.0)


def test_floors_come_out_of_eight_sensors():
    rng = np.random.default_rng(0)
    motion = rng.standard_normal((6, 500))
    values = np.vstack([sensor_rows() @ motion, rng.standard_normal((1, 500))])
    floors = DofSet(Dof(f, d) for f in (1, 2) for d in ("X", "Y", "RZ"))
    made, rest = to_rigid_motion(record_of(values, inputs=1), sensor_rows(), floors)
    assert made.values[:6] == pytest.approx(motion)
    assert (made.values[6] == values[8]).all()
    assert rest == pytest.approx(np.zeros(8), abs=1e-12)
    assert made.dofs("response") == floors


def test_a_wrong_sensor_on_a_floor_shows():
    rng = np.random.default_rng(0)
    values = sensor_rows() @ rng.standard_normal((6, 500))
    values[2] *= -1.0
    floors = DofSet(Dof(f, d) for f in (1, 2) for d in ("X", "Y", "RZ"))
    _, rest = to_rigid_motion(record_of(values), sensor_rows(), floors)
    assert rest[:4].min() > 0.1 > rest[4:].max()


def test_too_few_sensors_for_the_motions_are_refused():
    floors = DofSet(Dof(f, d) for f in (1, 2) for d in ("X", "Y", "RZ"))
    with pytest.raises(FemtuneError, match="do not determine"):
        to_rigid_motion(record_of(np.ones((4, 50))), sensor_rows()[:4], floors)


def test_lines_of_the_ground_are_flagged_and_modes_are_not():
    rng, n = np.random.default_rng(0), 200_000
    ground = rng.standard_normal(n) + 0.5 * np.sin(2.0 * np.pi * 7.8 * np.arange(n) / 50.0)
    spectra = cross_spectra(np.vstack([np.convolve(ground, [1.0, 0.5], "same"), ground]), 50.0, 4096)
    flagged, free = judge_peaks([7.8, 5.0], spectra, [1])
    assert flagged.of_input
    assert "the ground motion has a peak at 7.8 Hz" in flagged.sentence
    assert not free.of_input
    assert abs(free.ground_db) < 3.0
    ratio = np.abs(ground_to_floor(spectra, 1, 0))
    exact = np.abs(1.0 + 0.5 * np.exp(-2j * np.pi * spectra.freq_hz / 50.0))
    assert ratio[10:-10] == pytest.approx(exact[10:-10], rel=0.1)


def test_a_line_outside_the_spectrum_is_no_line():
    assert stands_out_db(np.linspace(0, 25, 100), np.ones(100), 400.0) == 0.0


def test_what_masses_do_not_move_is_no_mode():
    states = [np.array([3.18, 7.80, 9.10]), np.array([2.94, 7.801, 8.64]), np.array([2.75, 7.799, 8.19])]
    assert unmoved_by_mass(states) == (7.80,)
    # masses that move nothing prove nothing
    assert unmoved_by_mass([states[0], states[0]]) == ()
    assert unmoved_by_mass(states[:1]) == ()
