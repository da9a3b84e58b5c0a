"""Records in which samples are missing, cut where they are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune import identify
from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError, Notice
from femtune.identification.gaps import cut_at_gaps
from femtune.modal import Channel, TimeSeries
from femtune.steps.identify.result import IdentifyResult
from structures.laboratory import accelerations, plant_of_matrices

RATE = 100.0
CHANNELS = (Channel(Dof(1, "Z"), "acceleration"), Channel(Dof(2, "Z"), "acceleration"))
SIGNAL = np.random.default_rng(0).standard_normal((2, 1000))


def with_rows_lost(*lost: tuple[int, int], digits: int = 9) -> TimeSeries:
    kept = np.setdiff1d(np.arange(1000), np.concatenate([np.arange(*one) for one in lost]))
    return TimeSeries(SIGNAL[:, kept], CHANNELS, times_s=np.round(7.0 + kept / RATE, digits))


def with_samples_lost(*lost: tuple[int, int, int]) -> TimeSeries:
    values = SIGNAL.copy()
    for row, a, b in lost:
        values[row, a:b] = np.nan
    return TimeSeries(values, CHANNELS, RATE, 7.0)


@pytest.mark.parametrize("digits", [9, 3])
def test_parts_between_rows_that_are_missing(digits: int) -> None:
    parts, (told,) = cut_at_gaps(with_rows_lost((300, 301), (700, 900), (950, 951), digits=digits), "parts")
    assert [part.samples for part in parts] == [300, 399]
    assert [part.t0_s for part in parts] == pytest.approx([7.0, 10.01])
    assert [part.even_hz for part in parts] == pytest.approx([RATE, RATE])
    assert parts[0].even_hz == parts[1].even_hz
    assert (parts[0].values == SIGNAL[:, :300]).all()
    assert (parts[1].values == SIGNAL[:, 301:700]).all()
    check_shown("identify.gaps", told)


def test_parts_between_samples_that_a_channel_lacks() -> None:
    record = with_samples_lost((0, 0, 10), (1, 400, 420), (0, 410, 450), (1, 900, 1000))
    parts, (told,) = cut_at_gaps(record, "parts")
    assert [(part.t0_s, part.samples) for part in parts] == [(pytest.approx(7.1), 390), (pytest.approx(11.5), 450)]
    assert not np.isnan(parts[0].values).any()
    (longest,), _ = cut_at_gaps(record, "longest")
    assert (longest.values == SIGNAL[:, 450:900]).all()
    assert told.facts["parts"] == 2
    assert told.level == "info"


def test_a_record_without_gaps_is_as_it_was() -> None:
    record = with_samples_lost()
    assert cut_at_gaps(record, "parts") == ([record], ())


def test_nothing_between_the_gaps() -> None:
    record = with_samples_lost(*((0, a, a + 1) for a in range(0, 1000, 20)))
    with pytest.raises(FemtuneError) as caught:
        cut_at_gaps(record, "longest")
    check_shown("record.lost-samples, no part", caught.value)


def test_a_jittering_clock_is_no_gap() -> None:
    times = np.cumsum(0.01 + 0.003 * np.random.default_rng(1).random(1000))
    record = TimeSeries(SIGNAL, CHANNELS, times_s=times)
    (part,), told = cut_at_gaps(record, "parts")
    assert not told
    with pytest.raises(FemtuneError) as caught:
        assert part.even_hz
    assert caught.value.code == "record.uneven"


# ----------------------------------------------------------------------------------------------------
# Modes of such records.

DOFS = DofSet([Dof(1, "X"), Dof(2, "X"), Dof(3, "X")])
STIFFNESS = 400.0 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
PLANT = plant_of_matrices(np.eye(3), STIFFNESS, 0.01, np.eye(3), DOFS, np.eye(3), DOFS)


def written(folder: Path, columns: Sequence[np.ndarray], heading: str, lost: Sequence[int] = ()) -> Path:
    """A table of 20 Hz in which rows are missing."""
    table = np.column_stack([np.arange(len(columns[0])) / 20.0, *columns])
    rows = np.setdiff1d(np.arange(len(table)), lost)
    np.savetxt(folder / "r.csv", table[rows], delimiter=",", header=f"time,{heading}", comments="", fmt="%.8g")
    return folder / "r.csv"


def modes(path: Path, **asked: object) -> IdentifyResult:
    return identify(path, output=path.parent / "out", band_hz=(0.5, 7.0), largest_order=20, **asked)


@pytest.mark.slow
def test_modes_of_parts_of_a_record_of_responses(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    motion = accelerations(PLANT, rng.standard_normal((3, 12_000)), 1.0 / 20.0)
    motion += 0.02 * motion.std() * rng.standard_normal(motion.shape)
    path = written(tmp_path, list(motion), "1X+,2X+,3X+", [*range(4000, 4050), *range(8000, 8100), 11_500])
    with pytest.raises(FemtuneError) as caught:
        modes(path)
    check_shown("record.uneven", str(caught.value).replace(str(path), "r.csv"))
    parts, longest = modes(path, gaps="parts"), modes(path, gaps="longest")
    for found, tolerance in ((parts, 4e-3), (longest, 8e-3)):
        assert found.modes.freq_hz == pytest.approx(PLANT.truth.freq_hz, rel=tolerance)
        assert found.modes.freq_sd_hz is not None
        assert "identify.gaps" in [alert.code for alert in found.record.alerts]
    with pytest.raises(FemtuneError) as caught:
        modes(path, gaps="parts", fragments=2)
    assert caught.value.code == "identify.gaps"


@pytest.mark.slow
def test_modes_of_parts_of_a_record_with_a_force(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    force = np.zeros((3, 12_000))
    force[0] = rng.standard_normal(12_000)
    motion = accelerations(PLANT, force, 1.0 / 20.0)
    motion += 1e-3 * motion.std() * rng.standard_normal(motion.shape)
    motion[1, 5000:5003] = np.nan
    path = written(tmp_path, [force[0], *motion], "force 1X+,1X+,2X+,3X+")
    with pytest.raises(FemtuneError) as caught:
        modes(path)
    assert caught.value.code == "record.lost-samples"
    for way in ("parts", "longest"):
        found = modes(path, gaps=way)
        assert found.modes.freq_hz == pytest.approx(PLANT.truth.freq_hz, rel=2e-3)
        assert found.modes.damping_ratio == pytest.approx(0.01, rel=0.1)


@pytest.mark.slow
def test_hits_that_a_trigger_has_cut_out(tmp_path: Path) -> None:
    """Each part begins a little before a hit; between them nothing was recorded."""
    rng, pieces = np.random.default_rng(5), []
    for hit in range(4):
        force = np.zeros((3, 4000))
        force[0, 60:63] = (1.0 + 0.2 * rng.random()) * np.array([50.0, 100.0, 50.0])
        motion = accelerations(PLANT, force, 1.0 / 20.0)
        motion += 1e-3 * motion.std() * rng.standard_normal(motion.shape)
        pieces.append(np.vstack([np.arange(4000) / 20.0 + 1000.0 * hit, force[0], motion]))
    table = np.hstack(pieces).T
    np.savetxt(tmp_path / "r.csv", table, delimiter=",", header="time,hammer 1X+,1X+,2X+,3X+", comments="", fmt="%.8g")
    found = modes(tmp_path / "r.csv", gaps="parts")
    assert found.modes.freq_hz == pytest.approx(PLANT.truth.freq_hz, rel=1e-4)
    assert found.modes.damping_ratio == pytest.approx(0.01, rel=0.02)
    codes = [alert.code for alert in found.record.alerts]
    assert {"identify.gaps", "identify.hits"} <= set(codes)


def test_messages_of_parts() -> None:
    check_shown("identify.gaps, short parts", Notice("identify.gaps/short-parts", short=2, parts=5))
    check_shown("identify.gaps, with others", FemtuneError("identify.gaps/with-others", other="fragments"))
