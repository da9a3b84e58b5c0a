"""Hits of a hammer: found, cut, judged; windows and the damping that they add."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import chirp
from tests.messages.shown import check_shown

from femtune import identify
from femtune.errors import FemtuneError, Notice
from femtune.identification import InputKnown, identify_frfs
from femtune.identification.hammer import DECAYED, hits_of, is_impulsive, still_moving, without_hits
from femtune.modal import FrfSet, TimeSeries, mac, pole_of

from .conftest import Known
from .hits import CHANNELS, DAMPING, FREQ, RATE, SHAPES, codes, measured, response, written


@pytest.mark.parametrize("samples", [4096, 40_960])
@pytest.mark.parametrize("hits", [[40], [40, 1300, 3100]])
def test_hits_are_recognised_and_other_signals_are_not(hits: list[int], samples: int) -> None:
    rng, n, t = np.random.default_rng(1), 4096, np.arange(4096) / RATE
    hammer = measured(hits, samples).values[:1]
    assert is_impulsive(TimeSeries(hammer, CHANNELS[:1], RATE))
    # in the long record the noise has more energy than the hit
    assert is_impulsive(TimeSeries(hammer + 0.5 * rng.standard_normal(samples), CHANNELS[:1], RATE))
    random = rng.standard_normal(n)
    spike, spikes = random.copy(), rng.standard_normal(10 * n)
    spike[700], spikes[300::9000] = 40.0, 60.0
    heavy = (rng.standard_t(3, n), rng.standard_t(3, 10 * n))
    for force in (random, random * (t < 1.0), chirp(t, 1.0, 8.0, 200.0), np.sin(60.0 * t), spike, spikes, *heavy):
        assert not is_impulsive(TimeSeries(force[None], CHANNELS[:1], RATE))


def test_hits_of_different_size_behind_a_steep_filter_are_recognised() -> None:
    n, at = 5120, np.array([40, 1064, 2088, 3112, 4136])
    for seed in range(20):
        force = np.zeros(n)
        force[at] = np.random.default_rng(seed).uniform(0.6, 1.4, len(at))
        steep = np.fft.irfft(np.fft.rfft(force) * (np.fft.rfftfreq(n) < 0.42), n)
        record = TimeSeries(steep[None], CHANNELS[:1], RATE)
        assert is_impulsive(record)


def test_double_hits_and_overloads_are_left_out() -> None:
    good = measured([40, 1100, 2100], 3200)
    assert len(hits_of([good]).blocks) == 3
    double = hits_of([measured([40, 1100, 2100], 3200, again=60)])
    assert [round(float(b.time_s[0]) * RATE) for b in double.blocks] == [
        1093,
        2093,
    ]  # the pulse passes the level one sample after it begins, the block begins eight before
    check_shown("identify.hit-left-out", double.notices[0])
    values = good.values.copy()
    at = slice(1100, 1300)
    limit = 0.5 * np.abs(values[1, at]).max()
    values[1] = np.clip(values[1], -limit, limit)
    values[1, :1000], values[1, 2000:] = 0.4 * good.values[1, :1000], 0.4 * good.values[1, 2000:]
    clipped = hits_of([TimeSeries(values, CHANNELS, RATE)])
    assert len(clipped.blocks) == 2
    assert "overload of 1Z+" in clipped.notices[0].what
    alone = hits_of([measured([40], 1200, again=60)])
    assert len(alone.blocks) == 1
    check_shown("identify.hits-doubtful", alone.notices[0])
    short = hits_of([measured([40, 1100, 2100, 3100], 3300)])
    assert len(short.blocks) == 3
    check_shown("identify.hits-cut", short.notices[0])
    with pytest.raises(FemtuneError, match=r"identify\.resolution"):
        hits_of([good], longest=2000)


@pytest.mark.parametrize("bad", [[], [0], [1], [2], [3], [1, 2], [0, 2], [0, 1]])
def test_hits_are_cut_from_a_record_with_what_follows_them(bad: list[int]) -> None:
    record = measured([40 + 1000 * i for i in range(4)], 4000)
    found = [(41 + 1000 * i, 1033 + 1000 * i if i < 3 else 4000) for i in range(4)]
    assert not hits_of([record]).left_out
    cut, begins = without_hits(record, [found[i] for i in bad])
    # a block begins eight samples before its hit; what comes before the first hit is rest, which goes with it
    edges = [0, 1033, 2033, 3033, 4000]
    good = [i for i in range(4) if i not in bad]
    np.testing.assert_array_equal(
        cut.values, np.hstack([record.values[:, edges[i] : edges[i + 1]] for i in good]), strict=True
    )
    ends = np.cumsum([0] + [edges[i + 1] - edges[i] for i in good])
    assert list(begins) == [int(ends[j]) for j, i in enumerate(good) if j == 0 or i - 1 in bad]


def test_the_hits_that_are_left_out_are_known_by_their_samples() -> None:
    double = hits_of([measured([1040, 40, 2040, 3040], 4000, again=60)])
    assert double.left_out == ((1041, 2033),)
    assert not double.doubtful
    assert hits_of([measured([40], 1200, again=60)]).doubtful


def limited(record: TimeSeries, channel: int, part: float, both: bool = True) -> tuple[TimeSeries, list[bool]]:
    """A channel that stops at a part of its largest value, and in which of the hits it does."""
    values = record.values.copy()
    limit = part * values[channel].max()
    values[channel] = np.clip(values[channel], -limit if both else None, limit)
    stopped = np.abs(values[channel]) == limit
    return TimeSeries(values, CHANNELS, RATE), [bool(stopped[i * 1000 : (i + 1) * 1000].any()) for i in range(5)]


@pytest.mark.parametrize("channel", [0, 1])
@pytest.mark.parametrize("together", [True, False])
def test_hits_that_stop_at_the_same_value_are_overloaded(channel: int, together: bool) -> None:
    some = 0
    for seed in range(40):
        whole, stopped = limited(measured([40 + 1000 * i for i in range(5)], 5000, seed), channel, 0.85, channel > 0)
        parts = [whole] if together else [whole.select_samples(1000 * i, 1000 * (i + 1)) for i in range(5)]
        if not 1 < sum(stopped) < 5:
            continue
        some += sum(stopped) == 2
        hits = hits_of(parts)
        kept = [round(float(b.time_s[0]) * RATE) // 1000 for b in hits.blocks]
        assert set(codes(hits.notices)) <= {"identify.hit-left-out", "identify.hit-overloaded"}
        assert len(hits.notices) == sum(stopped)
        # with fewer than three sound hits those with a sample or two at the limit are used
        if sum(stopped) == 2:
            assert kept == [i for i in range(5) if not stopped[i]]
        else:
            assert {i for i in range(5) if not stopped[i]} <= set(kept)
            used = [n for n in hits.notices if " is used " in n.what]
            assert len(used) == len(kept) - (5 - sum(stopped))
    assert some >= 2


def test_a_hit_with_a_short_overload_is_used_where_few_are_sound() -> None:
    hits = hits_of([limited(measured([40, 1040, 2040], 3000, 1), 0, 0.75)[0]])
    assert len(hits.blocks) == 3
    check_shown("identify.hit-overloaded", hits.notices[0])


@pytest.mark.parametrize("bits", [24, 16, 12])
def test_converters_without_overload_lose_no_hits(bits: int) -> None:
    """Also where the force rests at its least value."""
    lost = 0
    for seed in range(60):
        record = measured([40 + 1000 * i for i in range(5)], 5000, seed)
        values = record.values / (np.abs(record.values).max(axis=1, keepdims=True) * 1.3)
        values[0] = np.maximum(values[0], 0.01)
        steps = TimeSeries(np.rint(values * 2 ** (bits - 1)), CHANNELS, RATE)
        lost += 5 - len(hits_of([steps]).blocks)
    assert lost == 0


def noisy(record: TimeSeries, part: float, hum: float = 0.0, seed: int = 5) -> TimeSeries:
    """With noise of the responses and a steady tone, as parts of their size."""
    size = np.array([[0.0], *([row.std()] for row in record.values[1:])])
    tone = hum * np.sqrt(2.0) * np.sin(2.0 * np.pi * 16.7 * record.time_s)
    noise = np.random.default_rng(seed).standard_normal(record.values.shape)
    return TimeSeries(record.values + size * (part * noise + tone), CHANNELS, RATE)


@pytest.mark.parametrize("before", [300, 60, 10])
@pytest.mark.parametrize(("part", "hum"), [(0.1, 0.0), (0.02, 0.1), (0.3, 0.0)])
def test_noise_is_no_response_that_has_not_decayed(before: int, part: float, hum: float) -> None:
    hits = [before + 1500 * i for i in range(4)]
    for seed in range(10):
        record = noisy(measured(hits, 6000 + before, seed), part, hum, seed)
        assert still_moving(hits_of([record]).blocks, [record]) < DECAYED
    # the first mode falls to 25 % in 250 samples
    record = noisy(measured([before + 250 * i for i in range(4)], 1000 + before), min(part, 0.1), hum)
    assert still_moving(hits_of([record]).blocks, [record]) > DECAYED


@pytest.mark.slow
@pytest.mark.parametrize("several", [False, True])
def test_modes_of_hits_in_one_record_or_in_several(tmp_path: Path, several: bool) -> None:
    if several:
        for i in range(3):
            written(measured([40 + 5 * i], 1100, i), tmp_path / f"{i}.csv")
        (tmp_path / "i.toml").write_text(
            '[identify]\nrecord = ["0.csv", "1.csv", "2.csv"]\nsampling_hz = 512.0\nband_hz = [10.0, 90.0]\n'
        )
        made = identify(tmp_path / "i.toml")
    else:
        path = written(measured([40, 1150, 2290], 3400), tmp_path / "all.csv")
        made = identify(path, sampling_hz=RATE, band_hz=(10.0, 90.0))
    assert made.modes.damping_ratio is not None
    np.testing.assert_allclose(made.modes.freq_hz, FREQ, rtol=1e-3)
    np.testing.assert_allclose(made.modes.damping_ratio, DAMPING, rtol=0.03)
    (said,) = [n for n in made.found.notices if n.code == "identify.hits"]
    check_shown("identify.hits", said) if not several else None
    assert "3 hits" in said.what
    assert made.found.measured is not None
    assert made.found.measured.coherence is not None
    assert made.found.measured_sd is not None


@pytest.mark.slow
def test_one_short_hit_with_windows(tmp_path: Path) -> None:
    path = written(measured([40], 300), tmp_path / "one.csv")
    plain = identify(path, sampling_hz=RATE, band_hz=(10.0, 90.0))
    notices = {n.code: n for n in plain.found.notices}
    check_shown("identify.one-hit", notices["identify.one-hit"])
    check_shown("identify.hits-not-decayed", notices["identify.hits-not-decayed"])
    assert plain.found.measured is not None
    assert plain.found.measured.coherence is None
    made = identify(path, sampling_hz=RATE, band_hz=(10.0, 90.0), exponential_s=0.15, force_window_s=0.02)
    assert "identify.hits-not-decayed" not in codes(made.found.notices)
    assert made.modes.damping_ratio is not None
    np.testing.assert_allclose(made.modes.freq_hz, FREQ, rtol=2e-3)
    np.testing.assert_allclose(made.modes.damping_ratio, DAMPING, rtol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["receptance", "accelerance"])
def test_the_damping_of_an_exponential_window_is_taken_out_exactly(three_modes: Known, kind: str) -> None:
    lines, sigma = np.linspace(5.0, 30.0, 300), 1.0 / 0.8
    frfs = three_modes.frfs(lines, kind=kind)
    poles = pole_of(three_modes.freq_hz, three_modes.damping_ratio)
    residues = np.einsum("ir,jr,r->ijr", three_modes.shapes, three_modes.shapes[:1], 1.0 / (2j * poles.imag))
    s = 2j * np.pi * lines + sigma
    values = residues @ (1.0 / (s - poles[:, None])) + residues.conj() @ (1.0 / (s - poles.conj()[:, None]))
    values = values * s ** (0 if kind == "receptance" else 2)
    made = identify_frfs(
        FrfSet(lines, values, frfs.responses, frfs.references, kind), InputKnown(largest_order=12, exponential_s=0.8)
    )
    assert made.modes.damping_ratio is not None
    np.testing.assert_allclose(made.modes.freq_hz, three_modes.freq_hz, rtol=1e-8)
    np.testing.assert_allclose(made.modes.damping_ratio, three_modes.damping_ratio, rtol=1e-6)
    np.testing.assert_allclose(np.abs(made.modes.shapes), np.abs(three_modes.shapes), rtol=1e-6)
    # the system is that of the structure: its functions at iω are those without the window
    np.testing.assert_allclose(made.system.frf(lines).values, frfs.values, atol=2e-3 * np.abs(frfs.values).max())


def test_windows_of_hits_and_several_records_are_for_hits_and_forces(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    force = rng.standard_normal(2000)
    path = written(TimeSeries(np.vstack([force, response(force)]), CHANNELS, RATE), tmp_path / "random.csv")
    with pytest.raises(FemtuneError) as told:
        identify(path, sampling_hz=RATE, band_hz=(10.0, 90.0), exponential_s=0.5)
    assert "identify.no-hits" in str(told.value)
    check_shown("identify.no-hits", Notice("identify.no-hits", key="exponential_s"))
    for name in "ab":
        np.savetxt(tmp_path / f"{name}.csv", response(force).T, delimiter=",", header="1Z+,2Z+", comments="")
    (tmp_path / "i.toml").write_text(
        '[identify]\nrecord = ["a.csv", "b.csv"]\nsampling_hz = 512.0\nband_hz = [10.0, 90.0]\n'
    )
    with pytest.raises(FemtuneError) as told:
        identify(tmp_path / "i.toml")
    assert "identify.several-records" in str(told.value)
    check_shown("identify.several-records", Notice("identify.several-records", count=2))


@pytest.mark.slow
def test_hits_at_several_points_in_files_of_their_own(tmp_path: Path) -> None:
    shapes = np.vstack([SHAPES, [[-0.4, 0.5, 0.9]]])
    files = []
    for point, shape in enumerate(shapes, 1):
        force = np.zeros(1200)
        force[40:47] = 50.0 * np.hanning(7)
        y = response(force, at=shape)[0]
        noise = np.random.default_rng(point).standard_normal((2, 1200)) * np.array([[0.02], [3e-4 * y.std()]])
        files.append(f"{point}.csv")
        values = np.vstack([force, y]) + noise
        np.savetxt(tmp_path / files[-1], values.T, delimiter=",", header=f"{point}Z+ [N],1Z+ [m/s2]", comments="")
    (tmp_path / "i.toml").write_text(f"[identify]\nrecord = {files}\nsampling_hz = 512.0\nband_hz = [10.0, 90.0]\n")
    made = identify(tmp_path / "i.toml")
    np.testing.assert_allclose(made.modes.freq_hz, FREQ, rtol=1e-3)
    assert made.modes.dofs.labels() == ["1Z+", "2Z+", "3Z+"]
    assert np.diag(mac(made.modes.shapes, shapes)).min() > 0.999
    assert {"identify.reciprocity", "identify.one-hit"} <= set(codes(made.found.notices))
    # a second response in one of the files is not that of the others
    text = (tmp_path / "1.csv").read_text(encoding="utf-8")
    (tmp_path / "1.csv").write_text(text.replace("1Z+ [m/s2]", "2Z+ [m/s2]"), encoding="utf-8")
    with pytest.raises(FemtuneError) as caught:
        identify(tmp_path / "i.toml")
    assert caught.value.code == "identify.records-differ"
    assert "2Z+; 1Z+; 1Z+" in str(caught.value)


SLOW = np.array([0.004, 0.003, 0.002])


def slowly_decaying(hits: list[int], samples: int, folder: Path) -> Path:
    """A record of hits whose responses have not decayed at its end, with noise of force and responses."""
    rng, force = np.random.default_rng(2), np.zeros(samples)
    for at in hits:
        force[at : at + 7] = 50.0 * np.hanning(7)
    y = response(force, SLOW)
    noise = rng.standard_normal((3, samples)) * np.array([[0.005], [1e-3 * y.std()], [1e-3 * y.std()]])
    return written(TimeSeries(np.vstack([force, y]) + noise, CHANNELS, RATE), folder / "hits.csv")


@pytest.mark.slow
@pytest.mark.parametrize("hits", [[40], [40, 560]])
def test_what_the_end_of_a_record_cuts_off_is_missing_in_no_result(hits: list[int], tmp_path: Path) -> None:
    made = identify(slowly_decaying(hits, 1000, tmp_path), sampling_hz=RATE, band_hz=(10.0, 90.0))
    assert made.modes.damping_ratio is not None
    np.testing.assert_allclose(made.modes.freq_hz, FREQ, rtol=2e-4)
    np.testing.assert_allclose(made.modes.damping_ratio, SLOW, rtol=0.02)
    # a quarter of the motion of the first mode is left at the end of the record
    measured, system = made.found.measured, made.found.system
    assert measured is not None
    assert system is not None
    long = np.zeros(60_000)
    long[0] = 1.0
    # the lines of the record are every 60th of the long one
    true = np.fft.rfft(response(long, SLOW))[:, np.rint(measured.freq_hz * len(long) / RATE).astype(int)]
    for values in (measured.values[:, 0], system.frf(measured.freq_hz).values[:, 0]):
        miss = np.linalg.norm(values - true, axis=1) / np.linalg.norm(true, axis=1)
        assert (miss < 0.01).all()
    assert made.found.misfit_percent is not None
    assert made.found.misfit_percent.max() < 1.0
    assert made.found.of_whole_record
    (said,) = [n for n in made.found.notices if n.code.startswith("identify.hits")]
    check_shown("identify.hits, whole", said) if len(hits) == 1 else None
    assert "identify.one-hit" not in codes(made.found.notices)


@pytest.mark.slow
def test_functions_of_hits_whose_responses_are_cut_are_said_to_be(tmp_path: Path) -> None:
    made = identify(slowly_decaying([40, 840, 1640], 2400, tmp_path), sampling_hz=RATE, band_hz=(10.0, 90.0))
    # the modes are those of the whole record
    assert made.modes.damping_ratio is not None
    np.testing.assert_allclose(made.modes.freq_hz, FREQ, rtol=2e-4)
    np.testing.assert_allclose(made.modes.damping_ratio, SLOW, rtol=0.02)
    # the functions and the system are those of the blocks
    assert {"identify.hits", "identify.hits-not-decayed"} <= set(codes(made.found.notices))
    assert not made.found.of_whole_record
    assert made.found.measured is not None
    assert made.found.measured_sd is not None
    assert made.found.measured_sd.shape == made.found.measured.values.shape


def roving(folder: Path, factor: float, hits: int = 3) -> list[str]:
    """Files of hits at three points with the response at the first; the force in the file is `factor` times as large.

    Returns the names of the files.
    """
    shapes = np.vstack([SHAPES, [[-0.4, 0.5, 0.9]]])
    files = []
    for point, shape in enumerate(shapes, 1):
        rng, force = np.random.default_rng(point), np.zeros(1200 * hits)
        for at in 40 + 1200 * np.arange(hits):
            force[at : at + 7] += 50.0 * factor * np.hanning(7) * rng.uniform(0.8, 1.2)
        y = response(force, at=shape)[0]
        noise = rng.standard_normal((2, len(force))) * np.array([[0.02], [3e-4 * y.std()]])
        values = np.vstack([force, y]) + noise
        files.append(f"{point}_{factor:g}.csv")
        np.savetxt(folder / files[-1], values.T, delimiter=",", header=f"{point}Z+ [N],1Z+ [m/s2]", comments="")
    return files


@pytest.mark.slow
def test_levels_of_a_hammer_that_roves_are_compared_with_the_scatter_of_the_hits(tmp_path: Path) -> None:
    soft, hard = roving(tmp_path, 1.0), roving(tmp_path, 3.0)
    (tmp_path / "i.toml").write_text(
        f"[identify]\nrecord = {soft}\nsampling_hz = 512.0\nband_hz = [10.0, 90.0]\n"
        f"[linearity]\nforce = 1.0\n[[level]]\nrecord = '{hard[2]}'\nforce = 3.0\n"
    )
    made = identify(tmp_path / "i.toml")
    np.testing.assert_allclose(made.modes.freq_hz, FREQ, rtol=2e-3)
    assert made.modes.dofs.labels() == ["1Z+", "2Z+", "3Z+"]
    found = made.found
    assert found.measured is not None
    assert found.synthesised is not None
    assert found.measured_sd is not None
    assert found.misfit_percent is not None
    # the axes are those of the test throughout: one response, three points of the force
    assert found.measured.references.labels() == ["1Z+", "2Z+", "3Z+"]
    assert found.measured.responses.labels() == ["1Z+"]
    assert found.measured_sd.shape == found.measured.values.shape == found.synthesised.values.shape
    assert found.misfit_percent.shape == found.measured.values.shape[:2]
    assert made.record.linearity is not None
    assert made.record.linearity.linear
    (functions,) = made.record.linearity.functions
    assert functions.functions == 1
    assert functions.lowest == "1Z+ / 3Z+"
    assert functions.noise_percent is not None


@pytest.mark.slow
def test_the_decay_after_a_hit_that_is_left_out_is_no_error_of_the_next_one(tmp_path: Path) -> None:
    """In blocks 30 % of the motion of each hit is left at the next one."""
    for again in (False, True):
        hits = [40, 560, 1080, 1600, 2120]
        values = np.loadtxt(
            slowly_decaying([*hits, *([1140] if again else [])], 2640, tmp_path), delimiter=",", skiprows=1
        )
        path = written(TimeSeries(values.T, CHANNELS, RATE), tmp_path / "again.csv")
        made = identify(path, sampling_hz=RATE, band_hz=(10.0, 90.0), output=tmp_path / "out")
        assert ("identify.hit-left-out" in codes(made.found.notices)) == again
        modes = made.modes
        assert modes.freq_sd_hz is not None
        assert modes.damping_sd is not None
        assert modes.damping_ratio is not None
        np.testing.assert_allclose(modes.freq_hz, FREQ, rtol=5e-5)
        np.testing.assert_allclose(modes.damping_ratio, SLOW, rtol=5e-3)


@pytest.mark.slow
def test_a_hit_after_one_that_is_left_out_is_doubted(tmp_path: Path) -> None:
    values = np.loadtxt(slowly_decaying([40, 100, 560], 1100, tmp_path), delimiter=",", skiprows=1)
    path = written(TimeSeries(values.T, CHANNELS, RATE), tmp_path / "again.csv")
    made = identify(path, sampling_hz=RATE, band_hz=(10.0, 90.0), output=tmp_path / "out")
    (said,) = [n for n in made.found.notices if n.code == "identify.unsound-hits"]
    check_shown("identify.unsound-hits, decay", said)
    assert {r.mode for r in made.found.remarks if r.doubtful} >= {0, 1, 2}


@pytest.mark.slow
def test_a_hit_long_after_one_that_is_left_out_is_not_doubted(tmp_path: Path) -> None:
    record = measured([40, 3000], 6000, seed=5, again=60)
    path = written(record, tmp_path / "again.csv")
    # blocks of 2 s, not the whole record, which knows what was before its hit
    made = identify(path, sampling_hz=RATE, band_hz=(10.0, 90.0), resolution_hz=0.5)
    assert {"identify.hit-left-out", "identify.one-hit"} <= set(codes(made.found.notices))
    assert "identify.unsound-hits" not in codes(made.found.notices)


@pytest.mark.slow
def test_modes_of_clipped_hits_are_doubtful(tmp_path: Path) -> None:
    record, stopped = limited(measured([40, 1040], 2000, seed=3), 1, 0.6)
    assert stopped[:2] == [True, True]
    made = identify(written(record, tmp_path / "clipped.csv"), sampling_hz=RATE, band_hz=(10.0, 90.0))
    (said,) = [n for n in made.found.notices if n.code == "identify.unsound-hits"]
    check_shown("identify.unsound-hits", said)
    assert all(any(r.mode == i and r.doubtful for r in made.found.remarks) for i in range(len(made.modes)))
